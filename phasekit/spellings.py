"""Other spellings: older ones, which go on working, and what the field calls things."""

from __future__ import annotations

import inspect
import re
from collections.abc import Iterable, Mapping
from types import MappingProxyType
from typing import TYPE_CHECKING, Any, ClassVar, Self, TypeVar

from phasekit.errors import ParameterError, warn
from phasekit.pickles import Stamped

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


def _glossary(text: str) -> tuple[tuple[str, str], ...]:
    """What is meant and the words for it, of lines ``meant: words``; an indented line goes on."""
    lines = re.sub(r"\n +", " ", text.strip()).split("\n")
    return tuple((meant, words) for meant, _, words in (line.partition(": ") for line in lines))


#: Functions and classes of phasekit, each with what other programs, and the field, call it.
NAMES = _glossary("""
ContinuationOptions: ContinuationPar ContinuationParameters Options
CoupledRotation: coupled_rotations rotation
FreeGyroRotor: TwoDegreesOfFreedom free_rotor
GyroRotorDisk: Disk GyroRotor Gyroscope Rotor disk gyro rotor
Harmonic: Forcing forcing harmonic
Pendulum: pendulum
Perturbed: Damped Driven damped damping perturb torque
Potential: Conservative Hamiltonian Lagrangian hamiltonian lagrangian
Problem: BifurcationProblem ContinuousDynamicalSystem DiscreteDynamicalSystem Duffing Dynamical
    DynamicalSystem Lorenz Map Model ODE ODEProblem ODESystem Ode VanDerPol make_problem model ode
    problem
Problem(jac=...): jac jacobian
Problem(map=True): henon iterate logistic map_
Problem(noise=...): langevin noise sde stochastic
System: System_ system
angle: Angle
attractors: find_attractors
basins: basin basin_fractions basin_stability basins_fractions basins_of_attraction
bifurcation_set: catastrophe_set stability_diagram
bearing_forces: bearing_loads force reactions
BoundaryProblem: BVP boundary_value_problem bvp collocation solve_bvp
capture: capture_probability
connection: connecting_orbit connections heteroclinic heteroclinic_orbit homoclinic homoclinic_orbit
continuation: branch codim1 cont continuate continue_ equilibrium_branch equilibrium_curve follow
    pseudo_arclength track
continuation(...).special('BP'): branch_point branch_points
continuation(...).special('H'): hopf hopf_point hopf_points
continuation(...).special('LP'): fold fold_point fold_points folds limit_point saddle_node
continuation(...).special_points: bifurcation_points bifurcations normal_form special_points
continuation(...).special(...)[0].curve: bogdanov_takens codim2 cusp fold_curve hopf_curve
    two_parameter two_parameter_continuation
continuation(..., orbit=...): cycle_continuation limit_cycle_branch periodic_orbit_continuation
critical: critical_value critical_values
deg: degree degrees deg2rad to_rad
diagram: automatic_bifurcation_diagram bifurcationdiagram
equilibria: eigenvalues equilibrium find_equilibria find_fixed_points find_roots fixed_point
    fixed_points fixedpoints fsolve get_equilibria roots rest rests solve stability steady_state
    steady_states steadystates
escape_rate: escape kramers kramers_rate
explore: app gui interactive page
first_passage: exit_time first_passage_time mean_first_passage_time mfpt
flow: integrate ode45 odeint run simulate simulation solve_ivp solve_ode trajectories trajectory
lyapunov: chaos lyapunov_exponent lyapunov_exponents lyapunov_spectrum lyapunovs lyapunovspectrum
    max_lyapunov
manifolds: invariant_manifold manifold stable_manifold unstable_manifold
melnikov: melnikov_function melnikov_integral
nullclines: isoclines nullcline
open_map: load load_map open open_dataset open_zarr read
Branch.load: load_branch
orbit_diagram: attractor_diagram bifurcation_tree feigenbaum orbitdiagram
orbits: action frequency period periods
parameter: Parameter param
periodic_orbit: cycle floquet frequency_response frf limit_cycle monodromy periodic_solution
periodic_orbits: limit_cycles periodic_solutions
phase_response: iprc isochron isochrons phase_response_curve prc
plot.bifurcation_diagram: bifurcation_diagram plot_bifurcation_diagram
plot.branch: plot_branch plot_continuation
plot.hodograph: hodograph
plot.multipliers: floquet_multipliers multipliers
plot.orbit_diagram: cobweb plot_orbit_diagram
plot.parameter_map: heatmap parameter_map plot_map
plot.phase_portrait: direction_field phase_plane phase_portrait plot_phase_portrait portrait quiver
    streamplot vector_field
plot.potential_well: plot_potential potential_well
plot.time_history: plot_trajectory time_history time_series timeseries
poincare_section: poincare poincare_map poincaremap psos return_map section
potential: V potential_energy
quantities: fields variables
quasi_static: adiabatic hysteresis ramp slow_sweep
resonances: resonance
rpm: RPM
run_up: runup spin_up
separatrices: separatrix
spectrum: fft periodogram power_spectrum psd welch
stroboscopic: strobe stroboscopic_map
sweep: param_sweep parameter_scan parameter_study parameter_sweep scan sweep_map
units: Hz Unit cm convert kg mm rad radians unit ureg
""")

#: What other programs call arguments, by the names that they have here.
ARGUMENTS = {
    right: tuple(others.split())
    for right, others in _glossary("""
boundary: bc bcs boundaries boundary_condition boundary_conditions
box: bounds limits ranges region window domain
center: well minimum
coordinate: x variable symbol q
damping: friction drag gamma zeta
duration: T time tmax t_end tfinal t t_max
grid: box bounds region starts window n_starts n_initial
initial_step: ds h step step_size
kT: kt temperature noise thermal_energy
max_points: max_steps nmax npoints n steps
max_step: dsmax ds_max
min_step: dsmin ds_min
n: steps iterations num count periods
of: quantity quantities what outputs
over: axes pair plane
options: ds dsmax dsmin ds_max ds_min step max_step step_size tol tolerance rtol atol max_steps nmax
    max_points min_step settings
phi0: theta theta0 angle q0
dphi0: omega omega0 dtheta dtheta0 velocity
parameter: param par p icp name lens free
parameters: params par pars args p constants
period: T T0 period_guess
ranges: range sliders bounds limits
section: plane surface condition poincare
tolerance: tol rtol atol
span: range bounds limits interval lims prange p_span tspan uz p_min p_max values
state: states variables vars x unknowns
store: path out file filename save
system: disk model rotor perturbed problem
t: tspan t_span tmax t_end T times time t_eval duration
values: range span grid
window: xlim ylim limits bounds box
workers: n_jobs processes parallel ncores nproc
x0: u0 y0 start initial initial_state ic ics guess state0
""")
}


#: Fields of `ContinuationOptions`, which are often written where ``options`` is an argument.
OPTIONS = (
    "max_step", "min_step", "initial_step", "max_points", "tolerance", "max_iterations", "turn",
    "max_turn", "directions", "detect", "bounds", "scales", "degree", "intervals", "max_intervals",
    "mesh_tolerance",
)  # fmt: skip
#: Arguments of `Perturbed`, which are often written where a system is one.
TERMS = ("damping", "quadratic", "torque", "forcing", "modulation", "drift", "kT")

#: Usual words for kinds of special points, beside their names and labels.
KINDS: Mapping[str, str] = MappingProxyType(
    {
        "andronov_hopf": "hopf",
        "bautin": "generalized_hopf",
        "double_hopf": "hopf_hopf",
        "flip": "period_doubling",
        "fold_hopf": "zero_hopf",
        "hb": "hopf",
        "limit_point": "fold",
        "neimark_sacker": "torus",
        "saddle_node": "fold",
        "sn": "fold",
        "turning_point": "fold",
    }
)

#: What to write for attributes that systems and results do not have, by their `_guides`.
MEMBERS: Mapping[str, tuple[tuple[str, str], ...]] = MappingProxyType(
    {
        "branch": (
            ("branch.extend()", "continue_ resume"),
            ("branch.points", "data solution solutions state states u value values x y"),
            ("branch.points.multiplier", "floquet floquet_multipliers multipliers"),
            (
                "branch.points.n_unstable, or the eigenvalues of branch.special_points",
                "eigenvalue eigenvalues eigs stability stable",
            ),
            ("branch.points.period", "T periods"),
            ("branch.to_dataframe()", "dataframe df frame to_pandas"),
            ("branch.problem", "model system"),
            ("branch.problem.parameters", "parameters params"),
            ("branch.special(...)[0].switch()", "branch_switch branch_switching switch"),
            ("branch.special_points", "bifurcation_points bifurcations specials"),
            ("branch.stops", "message reason status success"),
        ),
        "cycles": (
            ("branch.points, which has extremes and means of states", "amplitude amplitudes"),
        ),
        "pictures": (("pk.plot.branch of what pk.continuation returns", "branch"),),
        "dataset": (
            ("ds.phasekit.plot", "draw show"),
            ("ds.phasekit.table()", "dataframe df to_dataframe to_pandas"),
        ),
        "problem": (("problem.f", "formula formulas rhs vector_field"),),
        "point": (
            ("point.curve(...)", "continuation continue_ follow two_parameter"),
            ("point.kind", "bif_type type"),
            ('point.normal_form["l1"]', "first_lyapunov first_lyapunov_coefficient lyapunov"),
            ("point.normal_form", "coefficients nf normalform"),
            ("point.parameters", "p par param parameter parameter_value params value"),
            (
                "2*np.pi/point.normal_form['omega'] at a Hopf point, point['period'] on a cycle",
                "T frequency period",
            ),
            ("point.x", "coordinates location position solution state states u y"),
        ),
        "system": (
            ("pk.plot.phase_portrait(system)", "draw plot show"),
            ("system.parameters", "p params"),
            ("system.replace(...)", "set set_parameters subs update"),
        ),
        "page": (
            (
                '.save("page.html"), or name it at the end of a cell of a notebook',
                "display launch open run serve show to_html view write",
            ),
        ),
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
    guesses = {guess: right for right, others in NAMES for guess in others.split()}
    right = guesses.get(name)
    if right is None and _plain(name) in same:
        return f"did you mean {same[_plain(name)]!r}?"
    right = right or guesses.get(name.lower())
    if right is not None:
        return f"use 'pk.{right}'"
    near = difflib.get_close_matches(_plain(name), same, n=1, cutoff=0.7)
    return f"did you mean {same[near[0]]!r}?" if near else ""


def kind_meant(word: str, valid: Iterable[str]) -> str:
    """The kind of special points, of those that are valid, that a word means; empty for none.

    >>> kind_meant("Saddle-Node", ["fold", "hopf"]), kind_meant("hopf points", ["fold", "hopf"])
    ('fold', 'hopf')
    """
    valid = set(valid)
    plain = word.strip().lower().replace(" ", "_").replace("-", "_")
    stem = plain.removesuffix("s").removesuffix("_point")
    for one in (word, plain, plain.removesuffix("s"), stem, word.strip().upper()):
        if KINDS.get(one, one) in valid:
            return KINDS.get(one, one)
    return ""


def member_meant(thing: Any, name: str) -> str:
    """What to write in place of an attribute that something does not have; empty where unclear."""
    import difflib

    if place := thing._elsewhere(name):
        return f"use {place}"
    for guide in thing._guides:
        for right, guesses in MEMBERS[guide]:
            if name in guesses.split():
                return f"use {right}"
    own = [one for one in dir(thing) if not one.startswith("_") and one != name]
    near = difflib.get_close_matches(name, own, n=1, cutoff=0.8)
    if near:
        return f"did you mean {near[0]!r}?"
    functions = {right for right, _ in NAMES} | {
        one for _, others in NAMES for one in others.split()
    }
    for one in (name, f"plot.{name}", name.removeprefix("get_"), name.removeprefix("plot_")):
        if one in functions:
            right = next((right for right, others in NAMES if one in others.split()), one)
            return f"use pk.{right}"
    return str(thing._listed())


def keyword_meant(name: str, expected: Iterable[str], given: Iterable[Any] = ()) -> str:
    """What to write for a keyword that a function does not take; empty where unclear.

    `given` are the values of other arguments, a system among them, whose states and parameters are
    often written as keywords.

    >>> keyword_meant("u0", ["x0", "span"])
    "did you mean 'x0'?"
    """
    expected = list(expected)
    for one in given:
        if not isinstance(one, Guided):
            continue
        if name in getattr(one, "state", ()):
            way = next((way for way in ("x0", "grid", "box", "window") if way in expected), "")
            return f"give states as {way}={{{name!r}: ...}};" if way else ""
        if name in getattr(one, "parameters", ()):
            if "parameter" in expected:
                return f"name the parameter as parameter={name!r};"
            return f"give values of parameters by system.replace({name}=...);"
    if "parameters" in expected and argument_meant(name, expected) == "":
        return f"give values of parameters as parameters={{{name!r}: ...}};"
    meant = argument_meant(name, expected)
    if "options" in expected and meant in ("", "options") and (own := _word(name, OPTIONS)):
        return f"it is an option: options=pk.ContinuationOptions({own}=...);"
    if meant:
        return f"did you mean {meant!r}?"
    if "system" in expected and (own := _word(name, TERMS)):
        return f"it belongs to the system: pk.Perturbed(system, {own}=...);"
    if name in ("parameters", *ARGUMENTS["parameters"]):
        return "give values of parameters by system.replace(...);"
    return ""


def _word(name: str, valid: Iterable[str]) -> str:
    """The one of some names that is meant, by itself or by another word for it; empty for none."""
    return next((one for one in valid if name == one or name in ARGUMENTS.get(one, ())), "")


#: Methods of classes that read what is stored.
_READS = re.compile(r"load$|from_")


class NoAttribute(AttributeError):
    """There is no such attribute; the message says what to write, once somebody reads it.

    >>> print(NoAttribute(Guided(), "simulate"))
    'Guided' object has no attribute 'simulate'; use pk.flow
    """

    def __init__(self, thing: Any, name: str) -> None:
        super().__init__(name)
        self.thing, self.asked = thing, name

    def __str__(self) -> str:
        """Say what there is not, and what to write."""
        text = f"{type(self.thing).__name__!r} object has no attribute {self.asked!r}"
        if self.asked.startswith("_"):  # asked for by machines
            return text
        try:
            meant = member_meant(self.thing, self.asked)
        except Exception:  # of what is only half made
            meant = ""
        return f"{text}; {meant}" if meant else text

    def __reduce__(self) -> tuple[Any, ...]:
        """Copies and pickles hold the message alone."""
        return AttributeError, (str(self),)


def refused(thing: Any, name: str) -> Any:
    """Raise that there is no such attribute; of a property that fails, what it raises itself."""
    if any(name in vars(base) for base in type(thing).__mro__):
        return object.__getattribute__(thing, name)
    raise NoAttribute(thing, name)


T = TypeVar("T")


class Guide(type):
    """The class of classes that answer as what is made of them does."""

    if not TYPE_CHECKING:

        def __getattr__(cls, name: str) -> Any:
            """Refuse what is not there, with the ways by which models and branches are read."""
            text = f"type object {cls.__name__!r} has no attribute {name!r}"
            ways = [] if name.startswith("_") else sorted(n for n in dir(cls) if _READS.match(n))
            reads = ways and any(
                word in name for word in ("from", "load", "open", "read", "import")
            )
            raise AttributeError(f"{text}; there are {', '.join(ways)}" if reads else text)


class Made(Guide):
    """The class of classes of which functions make all there is."""

    _made_by: str

    if not TYPE_CHECKING:

        def __call__(cls, *args: Any, **kwargs: Any) -> Any:
            """Make one, but none of nothing."""
            if not (args or kwargs):
                raise TypeError(f"{cls.__name__}() wants to be made by {cls._made_by}")
            return super().__call__(*args, **kwargs)

        @property
        def __signature__(cls) -> inspect.Signature:
            """That of what makes them, which the call above would hide."""
            _, *own = inspect.signature(cls.__init__).parameters.values()
            return inspect.Signature(own)


class Guided(Stamped, metaclass=Guide):
    """What answers an attribute that it does not have by the way to what is meant."""

    __slots__ = ()

    #: Keys of `MEMBERS`.
    _guides: ClassVar[tuple[str, ...]] = ()

    if not TYPE_CHECKING:
        #: What has items by name has none one after the other, though Python would take them so.
        __iter__ = None

        def __getitem__(self, key: Any) -> Any:
            """Refuse what is not there, under a name in brackets as well."""
            if own := getattr(super(), "__getitem__", None):  # of what is a tuple as well
                return own(key)
            text = f"{type(self).__name__!r} object is not subscriptable"
            meant = member_meant(self, key) if isinstance(key, str) else ""
            raise TypeError(f"{text}; {meant}" if meant else text)

        def __getattr__(self, name: str) -> Any:
            """Refuse what is not there."""
            return refused(self, name)

    def _elsewhere(self, name: str) -> str:
        """Where its own names are that are no attributes: states, parameters, coefficients."""
        return ""

    def _listed(self) -> str:
        """What there is, where nothing is near."""
        own = [name for name in dir(self) if not name.startswith("_")]
        return f"there are {', '.join(own)}" if own else ""


class Listed(tuple[T, ...]):
    """A tuple that says what it is of, where a number is asked for that it does not have."""

    def __new__(cls, found: Iterable[T], of: str) -> Self:
        """A tuple of what was found, and where that was looked for."""
        made = super().__new__(cls, found)
        made.of = of
        return made

    of: str

    def __getitem__(self, key: Any) -> Any:
        """Return one of them, or several."""
        try:
            return super().__getitem__(key)
        except IndexError:
            there = f"there are {len(self)}" if self else "there are none"
            raise IndexError(f"{self.of}: got [{key}], {there}") from None

    def __reduce__(self) -> tuple[Any, ...]:
        """Copies are plain tuples."""
        return tuple, (list(self),)


def argument_meant(name: str, expected: Iterable[str]) -> str:
    """The argument that is meant by a keyword that is none; empty where nothing is near.

    >>> argument_meant("u0", ["x0", "span"]), argument_meant("spam", ["x0", "span"])
    ('x0', 'span')
    """
    import difflib

    expected = list(expected)
    if name not in expected and (right := _word(name, expected)):
        return right
    near = difflib.get_close_matches(name, expected, n=1)
    return near[0] if near else ""


def respelled(function: str, keywords: dict[str, Any]) -> dict[str, Any]:
    """Keywords of a call as they are spelled now, with a warning for each old one.

    >>> import warnings
    >>> with warnings.catch_warnings():
    ...     warnings.simplefilter("ignore")
    ...     respelled("lyapunov", {"time": 10.0})
    {'duration': 10.0}
    """
    former = DEPRECATED[function]
    now = {name: value for name, value in keywords.items() if name not in former}
    for name in former.keys() & keywords.keys():
        if former[name] in now:
            raise ParameterError(f"{name}: got it besides {former[name]}, wants {former[name]}")
        deprecate(f"{function}({name}=...)", f"{function}({former[name]}=...)")
        now[former[name]] = keywords[name]
    return now


def deprecate(former: str, now: str) -> None:
    """Warn that what is written so is written otherwise now."""
    warn(f"{former} is now {now}", DeprecationWarning)
