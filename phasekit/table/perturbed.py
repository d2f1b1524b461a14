"""Rows of perturbed systems: what damping and drive do to first order."""

from __future__ import annotations

from phasekit.errors import EscapeRegime
from phasekit.laws.ladder import Routhian
from phasekit.laws.perturbed import (
    PerturbedConservative,
    PerturbedRouthian,
    PerturbedTrigonometric,
    TiltedConservative,
    TiltedRouthian,
    TiltedTrigonometric,
)
from phasekit.table.row import ABC, LAW, SIDES, STATE, Pass, Quantity

REGION, DIRECTION = ("region",), ("direction",)
CHIRIKOV = "[Chirikov1979] section 4"
ESCAPE = "[MelnikovMeshkov1986]; [HanggiTalknerBorkovec1990]"
TORQUE = "derivative of [Veljovic2015] (12), corrected coefficients"
CAPTURE = "[Neishtadt1975]; [GoldreichPeale1966] (18)"
MELNIKOV = "[GuckenheimerHolmes1983] section 4.5; [Melnikov1963]"

_GENERAL = PerturbedConservative

# fmt: off
QUANTITIES: tuple[Quantity, ...] = (
    Quantity("melnikov_mean", "melnikov", SIDES, "float64", "s-2",
             "mean of Melnikov's function: energy that the loop gains on average",
             "-damping S - quadratic int |phi'|^3 dt + torque (phi(inf) - phi(-inf)) - dS/dt",
             MELNIKOV, of=_GENERAL),
    Quantity("melnikov_amplitude", "melnikov", SIDES, "float64", "s-2",
             "greatest oscillation of Melnikov's function against its mean",
             "|int phi' f(phi) exp(i nu t) dt| of the drive f(phi) cos(nu t)", MELNIKOV,
             of=_GENERAL),
    Quantity("melnikov_phase", "melnikov", SIDES, "float64", "rad",
             "phase of the oscillation of Melnikov's function, NaN with several frequencies",
             "M(t0) = mean + amplitude cos(nu t0 + phase)", MELNIKOV, of=_GENERAL),
    Quantity("chaos_threshold", "melnikov", SIDES, "float64", "s-2",
             "amplitude of the first harmonic of the drive, the others in proportion, from which "
             "on stable and unstable manifold intersect transversally",
             "forcing_amplitude |mean|/amplitude", MELNIKOV, of=_GENERAL),
    Quantity("turnstile_area", "melnikov", SIDES, "float64", "s-1",
             "area of a turnstile of the undamped system: what crosses in one period of the drive",
             "integral of the positive part of M(t0) over one period; 2 amplitude/nu",
             "[MacKayMeissPercival1984]; " + MELNIKOV, of=_GENERAL),
    Quantity("quiet_frequency", "quiet_frequencies", SIDES, "float64", "s-1",
             "least frequency of a torque to which the lobe does not respond to first order; its "
             "multiples are the others",
             "nu x = pi, cosh(k (x + i y)) = (-S + i k^2)/sqrt(D)", MELNIKOV,
             of=PerturbedTrigonometric),
    Quantity("capture_flux", "capture", REGION, "float64", "s-2",
             "energy that a round of the region's separatrix loses: rate at which it takes phase",
             "damping S + dS/dt", CAPTURE, of=_GENERAL),
    Quantity("capture_probability", "capture", REGION, "float64", "1",
             "probability that a motion led to the separatrix ends in the region",
             "P_i = Theta_i/sum Theta, 0 or 1 where one region gives phase away", CAPTURE,
             of=_GENERAL),
    Quantity("critical_torque", "critical_torques", DIRECTION, "float64", "s-2",
             "least and greatest constant torque, over the inertia, under which an equilibrium "
             "exists", "extremes of V'(phi), where V''(phi) = 0", TORQUE),
    Quantity("critical_phi", "critical_torques", DIRECTION, "float64", "rad",
             "angle at which equilibria merge under the critical torque", "V''(phi) = 0", TORQUE),
    Quantity("energy_per_turn", "separatrices", (), "float64", "s-2",
             "energy that a turn forward gains under the torque, NaN on a line", "2 pi torque",
             TORQUE, of=_GENERAL),
    Quantity("lobe_area_error", "separatrices", SIDES, "float64", "s-1",
             "estimated error of the area inside the separatrix", "of its quadrature", TORQUE,
             of=TiltedTrigonometric),
    Quantity("period_error", "orbits", (), "float64", "s", "estimated error of the period",
             "of its quadrature", TORQUE, of=TiltedTrigonometric),
    Quantity("action_error", "orbits", (), "float64", "s-1", "estimated error of the action",
             "of its quadrature", TORQUE, of=TiltedTrigonometric),
    Quantity("gain_per_turn", "orbits", (), "float64", "s-2",
             "energy that an orbit which runs gains each turn, 0 for others", "2 pi |torque|",
             TORQUE, of=_GENERAL),
    Quantity("angle_error", "action_angle", (), "float64", "rad",
             "estimated error of the angle variable", "distance from the orbit found back", TORQUE,
             of=TiltedTrigonometric),
    Quantity("retrapping_torque", "retrapping", DIRECTION, "float64", "s-2",
             "least constant torque, over the inertia, that keeps a rotation going, at small "
             "damping", "(damping S + quadratic int |phi'|^3 dt)/(2 pi) of a winding separatrix",
             "[Stewart1968]; " + MELNIKOV, of=PerturbedTrigonometric),
    Quantity("escape_rate", "escape", SIDES, "float64", "s-1",
             "rate at which noise leads out of the well on that side of the saddle, over it",
             "[sqrt(1 + (d/2k)^2) - d/2k] Y sqrt(kT/2 pi) exp(-barrier/kT)/int exp(-(V - V_c)/kT); "
             "Y = Y(D1) Y(D2)/Y(D1 + D2), D = d S/kT; D corrected by the mean passage of the "
             "energy, k by that of the angle",
             ESCAPE, of=PerturbedTrigonometric),
    Quantity("barrier", "escape", SIDES, "float64", "s-2",
             "energy from the center to the saddle",
             "V(phi_s) - V(phi_c) - torque (phi_s - phi_c)", ESCAPE,
             of=PerturbedTrigonometric),
    Quantity("escape_regime", "escape", SIDES, "int8", "1",
             "what limits the escape", "damping S < kT: diffusion of the energy; damping > 2 k: "
             "diffusion in space; else the turnover between them", ESCAPE, EscapeRegime,
             of=PerturbedTrigonometric),
    Quantity("escape_error", "escape", SIDES, "float64", "1",
             "estimated relative error of the rate",
             "to the farther one of the rates with all and with none of the corrections", ESCAPE,
             of=PerturbedTrigonometric),
    Quantity("resonance_action", "resonances", ("order",), "float64", "s-1",
             "action of the orbit in resonance with the drive", "n Omega(J) = m nu", CHIRIKOV,
             of=PerturbedTrigonometric),
    Quantity("resonance_width", "resonances", ("order",), "float64", "s-1",
             "half-width of the resonance in action",
             "2 sqrt(V/|dOmega/dJ|), V = |(f dphi/dtheta)_n|/n of the drive f(phi) cos(m nu t)",
             CHIRIKOV, of=PerturbedTrigonometric),
    Quantity("resonance_overlap", "resonances", ("order",), "float64", "1",
             "half-widths of the resonance and of that of the next order over their distance",
             "(width_n + width_(n+1))/|J_(n+1) - J_n|", CHIRIKOV, of=PerturbedTrigonometric),
)
# fmt: on

_CAPTURE = "phasekit.perturbation.capture:"
_TORQUE = "phasekit.perturbation.torque:"
_TILTED = "phasekit.perturbation.tilted_"
_POTENTIAL = "phasekit.perturbation.tilted_potential:"
_MELNIKOV = "phasekit.perturbation.melnikov:"
_NUMERICAL = "phasekit.perturbation.tilted_numerical:"
_KEPT = "phasekit.perturbation.kept_momentum:"

PASSES: tuple[Pass, ...] = (
    Pass(_MELNIKOV + "melnikov", (LAW,), ("melnikov",), PerturbedTrigonometric),
    Pass(_MELNIKOV + "quiet_frequency", (LAW,), ("quiet_frequencies",), PerturbedTrigonometric),
    Pass("phasekit.perturbation.quadrature:melnikov", (LAW,), ("melnikov",), _GENERAL),
    Pass(_CAPTURE + "capture", (LAW,), ("capture",), PerturbedTrigonometric),
    Pass(_CAPTURE + "capture_numerical", (LAW,), ("capture",), _GENERAL),
    Pass(_TORQUE + "critical_torque", ABC, ("critical_torques",)),
    Pass(_TORQUE + "critical_of_perturbed", (LAW,), ("critical_torques",), PerturbedTrigonometric),
    Pass(_TORQUE + "retrapping_torque", (LAW,), ("retrapping",), PerturbedTrigonometric),
    Pass(_TORQUE + "torqued_equilibria", (LAW,), ("equilibria",), PerturbedTrigonometric),
    Pass(
        "phasekit.perturbation.tilted:tilted_separatrices",
        (LAW,),
        ("separatrices",),
        TiltedTrigonometric,
    ),
    Pass(
        "phasekit.perturbation.tilted:tilted_phase_space",
        (LAW,),
        ("equilibria", "separatrices"),
        TiltedTrigonometric,
    ),
    *(
        Pass(_TILTED + name, (LAW, *states), groups, TiltedTrigonometric, options)
        for name, states, groups, options in (
            ("energy:potential", ("state_phi",), ("potential",), ()),
            ("energy:gradient", ("state_phi",), ("potential_gradient",), ()),
            ("energy:curvature", ("state_phi",), ("potential_curvature",), ()),
            ("energy:energy", STATE, ("energy_integral",), ()),
            ("energy:phase_velocity", ("state_phi", "state_energy"), ("phase_velocity",), ()),
            ("orbits:orbits", STATE, ("orbits",), ()),
            ("orbits:angle_variables", STATE, ("action_angle",), ()),
            ("orbits:orbits_at_energy", ("state_energy",), ("orbits",), ("center",)),
            ("orbits:orbits_at_gap", ("state_gap",), ("orbits",), ("saddle", "side")),
            ("orbits:separatrix_motion", ("time",), ("motion",), ("saddle", "side")),
        )
    ),
    Pass("phasekit.perturbation.escape:escape_rate", (LAW,), ("escape",), PerturbedTrigonometric),
    Pass(
        "phasekit.perturbation.resonances:resonances",
        (LAW,),
        ("resonances",),
        PerturbedTrigonometric,
    ),
    Pass(_POTENTIAL + "most", (LAW,), ("labels",), _GENERAL),
    Pass(_POTENTIAL + "equilibria", (LAW,), ("equilibria",), _GENERAL),
    *(
        Pass(module + name, (LAW, *states), (group,), rung)
        for module, rung in (
            (_POTENTIAL, TiltedConservative),
            (_KEPT, TiltedRouthian),
            (_KEPT, Routhian),
        )
        for name, states, group in (
            ("potential", ("state_phi",), "potential"),
            ("gradient", ("state_phi",), "potential_gradient"),
            ("curvature", ("state_phi",), "potential_curvature"),
            ("energy", STATE, "energy_integral"),
            ("phase_velocity", ("state_phi", "state_energy"), "phase_velocity"),
        )
    ),
    *(
        Pass(_NUMERICAL + name, (LAW, *states), groups, TiltedConservative, options)
        for name, states, groups, options in (
            ("most", (), ("labels",), ()),
            ("separatrices", (), ("separatrices",), ()),
            ("orbits", STATE, ("orbits",), ()),
            ("angle_variables", STATE, ("action_angle",), ()),
            ("orbits_at_energy", ("state_energy",), ("orbits",), ("center",)),
            ("orbits_at_gap", ("state_gap",), ("orbits",), ("saddle", "side")),
            ("separatrix_motion", ("time",), ("motion",), ("saddle", "side")),
        )
    ),
    *(
        Pass(_KEPT + name, (LAW,), (group,), PerturbedRouthian)
        for name, group in (
            ("most", "labels"),
            ("equilibria", "equilibria"),
            ("melnikov", "melnikov"),
            ("capture", "capture"),
        )
    ),
)
