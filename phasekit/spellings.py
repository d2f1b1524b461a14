"""Other spellings: older ones, which go on working, and what the field calls things."""

from __future__ import annotations

import warnings
from collections.abc import Iterable, Mapping
from types import MappingProxyType
from typing import Any

from phasekit.errors import ParameterError

#: Names of arguments that functions had before, and those that they have now.
DEPRECATED: Mapping[str, Mapping[str, str]] = MappingProxyType(
    {
        "capture": {"perturbed": "system"},
        "damped_portrait": {"perturbed": "system"},
        "derivatives": {"time": "t"},
        "escape_rate": {"perturbed": "system"},
        "first_passage": {"longest": "duration"},
        "iterated": {"times": "n"},
        "lyapunov": {"perturbed": "system", "time": "duration"},
        "melnikov": {"perturbed": "system"},
        "nullclines": {"what": "system"},
        "quiet_frequencies": {"perturbed": "system"},
        "resonances": {"perturbed": "system"},
        "retrapping_torque": {"perturbed": "system"},
        "stroboscopic": {"perturbed": "system"},
    }
)

#: Functions and classes of phasekit, each with what other programs, and the field, call it.
NAMES: tuple[tuple[str, str], ...] = (
    ("ContinuationOptions", "ContinuationPar ContinuationParameters Options"),
    ("CoupledRotation", "coupled_rotations rotation"),
    ("FreeGyroRotor", "TwoDegreesOfFreedom free_rotor"),
    ("GyroRotorDisk", "Disk GyroRotor Gyroscope Rotor disk gyro rotor"),
    ("Harmonic", "Forcing forcing harmonic"),
    ("Pendulum", "pendulum"),
    ("Perturbed", "Damped Driven damped damping perturb torque"),
    ("Potential", "Conservative Hamiltonian Lagrangian hamiltonian lagrangian"),
    (
        "Problem",
        "BifurcationProblem ContinuousDynamicalSystem DiscreteDynamicalSystem Duffing "
        "Dynamical DynamicalSystem Lorenz Map Model ODE ODEProblem ODESystem Ode VanDerPol "
        "make_problem model ode problem",
    ),
    ("Problem(jac=...)", "jac jacobian"),
    ("Problem(map=True)", "henon iterate logistic map_"),
    ("Problem(noise=...)", "langevin noise sde stochastic"),
    ("System", "System_ system"),
    ("angle", "Angle"),
    ("attractors", "find_attractors"),
    ("basins", "basin basin_fractions basin_stability basins_fractions basins_of_attraction"),
    ("bifurcation_set", "catastrophe_set stability_diagram"),
    ("bearing_forces", "bearing_loads force loads reactions"),
    ("BoundaryProblem", "BVP boundary_value_problem bvp collocation solve_bvp"),
    ("capture", "capture_probability"),
    (
        "connection",
        "connecting_orbit connections heteroclinic heteroclinic_orbit homoclinic homoclinic_orbit",
    ),
    (
        "continuation",
        "branch codim1 cont continuate continue_ equilibrium_branch equilibrium_curve follow "
        "pseudo_arclength track",
    ),
    ("continuation(...).special('BP')", "branch_point branch_points"),
    ("continuation(...).special('H')", "hopf hopf_point hopf_points"),
    (
        "continuation(...).special('LP')",
        "fold fold_point fold_points folds limit_point saddle_node",
    ),
    (
        "continuation(...).special_points",
        "bifurcation_points bifurcations normal_form special_points",
    ),
    (
        "continuation(...).special(...)[0].curve",
        "bogdanov_takens codim2 cusp fold_curve hopf_curve two_parameter "
        "two_parameter_continuation",
    ),
    (
        "continuation(..., orbit=...)",
        "cycle_continuation limit_cycle_branch periodic_orbit_continuation",
    ),
    ("critical", "critical_value critical_values"),
    ("deg", "degree degrees deg2rad to_rad"),
    ("diagram", "automatic_bifurcation_diagram bifurcationdiagram"),
    (
        "equilibria",
        "eigenvalues equilibrium find_equilibria find_fixed_points find_roots fixed_point "
        "fixed_points fixedpoints fsolve get_equilibria roots rest rests solve stability "
        "steady_state steady_states steadystates",
    ),
    ("escape_rate", "escape kramers kramers_rate"),
    ("explore", "app explorer gui interactive page"),
    ("first_passage", "exit_time first_passage_time mean_first_passage_time mfpt"),
    (
        "flow",
        "integrate motion ode45 odeint run simulate simulation solve_ivp solve_ode "
        "trajectories trajectory",
    ),
    (
        "lyapunov",
        "chaos lyapunov_exponent lyapunov_exponents lyapunov_spectrum lyapunovs "
        "lyapunovspectrum max_lyapunov",
    ),
    ("manifolds", "invariant_manifold manifold stable_manifold unstable_manifold"),
    ("melnikov", "melnikov_function melnikov_integral"),
    ("nullclines", "isoclines nullcline"),
    ("open_map", "load load_map open open_dataset open_zarr read"),
    ("Branch.load", "load_branch"),
    ("orbit_diagram", "attractor_diagram bifurcation_tree feigenbaum orbitdiagram"),
    ("orbits", "action frequency period periods"),
    ("parameter", "Parameter param"),
    (
        "periodic_orbit",
        "cycle floquet frequency_response frf limit_cycle monodromy periodic_solution",
    ),
    ("periodic_orbits", "cycles limit_cycles periodic_solutions"),
    ("phase_response", "iprc isochron isochrons phase_response_curve prc"),
    ("plot.bifurcation_diagram", "bifurcation_diagram plot_bifurcation_diagram"),
    ("plot.branch", "plot_branch plot_continuation"),
    ("plot.hodograph", "hodograph"),
    ("plot.multipliers", "floquet_multipliers multipliers"),
    ("plot.orbit_diagram", "cobweb plot_orbit_diagram"),
    ("plot.parameter_map", "heatmap parameter_map plot_map"),
    (
        "plot.phase_portrait",
        "direction_field phase_plane phase_portrait plot_phase_portrait portrait quiver "
        "streamplot vector_field",
    ),
    ("plot.potential_well", "plot_potential potential_well"),
    ("plot.time_history", "plot_trajectory time_history time_series timeseries"),
    ("poincare_section", "poincare poincare_map poincaremap psos return_map section"),
    ("potential", "V potential_energy"),
    ("quantities", "fields variables"),
    ("quasi_static", "adiabatic hysteresis ramp slow_sweep"),
    ("resonances", "resonance"),
    ("rpm", "RPM"),
    ("run_up", "runup spin_up"),
    ("separatrices", "separatrix"),
    ("spectrum", "fft periodogram power_spectrum psd welch"),
    ("stroboscopic", "strobe stroboscopic_map"),
    ("sweep", "param_sweep parameter_scan parameter_study parameter_sweep scan sweep_map"),
    ("units", "Hz Unit cm convert kg mm rad radians unit ureg"),
)

#: What other programs call arguments, by the names that they have here.
ARGUMENTS: Mapping[str, tuple[str, ...]] = MappingProxyType(
    {
        "box": ("bounds", "limits", "ranges", "region", "window", "domain"),
        "coordinate": ("x", "variable", "symbol", "q"),
        "duration": ("T", "time", "tmax", "t_end", "tfinal", "t", "t_max"),
        "grid": ("box", "bounds", "region", "starts"),
        "n": ("steps", "iterations", "num", "count", "periods"),
        "of": ("quantity", "quantities", "what", "outputs"),
        "options": (
            "ds",
            "dsmax",
            "dsmin",
            "ds_max",
            "ds_min",
            "step",
            "max_step",
            "step_size",
            "tol",
            "tolerance",
            "rtol",
            "atol",
            "max_steps",
            "nmax",
            "max_points",
            "min_step",
            "settings",
        ),
        "parameter": ("param", "par", "p", "icp", "name", "lens", "free"),
        "parameters": ("params", "par", "pars", "args", "p", "constants"),
        "section": ("plane", "surface", "condition", "poincare"),
        "span": (
            "range",
            "bounds",
            "limits",
            "interval",
            "lims",
            "prange",
            "p_span",
            "tspan",
            "uz",
            "p_min",
            "p_max",
            "values",
        ),
        "state": ("states", "variables", "vars", "x", "unknowns"),
        "store": ("path", "out", "file", "filename", "save"),
        "system": ("disk", "model", "rotor", "perturbed", "problem"),
        "t": ("tspan", "t_span", "tmax", "t_end", "T", "times", "time", "t_eval", "duration"),
        "values": ("range", "span", "grid"),
        "window": ("xlim", "ylim", "limits", "bounds", "box"),
        "workers": ("n_jobs", "processes", "parallel", "ncores", "nproc"),
        "x0": ("u0", "y0", "start", "initial", "initial_state", "ic", "ics", "guess", "state0"),
    }
)


def _plain(name: str) -> str:
    return name.lower().replace("_", "")


def name_meant(name: str, public: Iterable[str]) -> str:
    """What to write in place of a name that phasekit does not have; empty where nothing is near.

    >>> name_meant("simulate", ["flow"]), name_meant("equilibrio", ["equilibria"])
    ("use 'pk.flow'", "did you mean 'equilibria'?")
    """
    import difflib

    same = {_plain(one): one for one in public}
    if _plain(name) in same:
        return f"did you mean {same[_plain(name)]!r}?"
    guesses = {guess: right for right, others in NAMES for guess in others.split()}
    right = guesses.get(name) or guesses.get(name.lower())
    if right is not None:
        return f"use 'pk.{right}'"
    near = difflib.get_close_matches(_plain(name), same, n=1, cutoff=0.7)
    return f"did you mean {same[near[0]]!r}?" if near else ""


def argument_meant(name: str, expected: Iterable[str]) -> str:
    """The argument that is meant by a keyword that is none; empty where nothing is near.

    >>> argument_meant("u0", ["x0", "span"]), argument_meant("spam", ["x0", "span"])
    ('x0', 'span')
    """
    import difflib

    expected = list(expected)
    for right in expected:
        if name in ARGUMENTS.get(right, ()):
            return right
    near = difflib.get_close_matches(name, expected, n=1)
    return near[0] if near else ""


def respelled(function: str, keywords: dict[str, Any], level: int = 3) -> dict[str, Any]:
    """Keywords of a call as they are spelled now, with a warning for each old one.

    Raises
    ------
    ParameterError
        If an argument is given in both spellings.

    Examples
    --------
    >>> import warnings
    >>> with warnings.catch_warnings():
    ...     warnings.simplefilter("ignore")
    ...     respelled("lyapunov", {"time": 10.0})
    {'duration': 10.0}
    """
    former = DEPRECATED.get(function, {})
    if former.keys().isdisjoint(keywords):
        return keywords
    now = {name: value for name, value in keywords.items() if name not in former}
    for name in former.keys() & keywords.keys():
        if former[name] in now:
            raise ParameterError(f"{name}: got it besides {former[name]}, wants {former[name]}")
        deprecate(f"{function}({name}=...)", f"{function}({former[name]}=...)", level + 1)
        now[former[name]] = keywords[name]
    return now


def deprecate(former: str, now: str, level: int = 3) -> None:
    """Warn that what is written so is written otherwise now."""
    warnings.warn(f"{former} is now {now}", DeprecationWarning, stacklevel=level)
