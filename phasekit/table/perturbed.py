"""Rows of perturbed systems: what damping and drive do to first order."""

from __future__ import annotations

from phasekit.errors import EscapeRegime, Validity
from phasekit.laws.ladder import ANY, PERTURBED, Conservative, Flow, Routhian, Standing, Trait
from phasekit.laws.trigonometric import Trigonometric
from phasekit.table.row import ABC, DIRECTION, LAW, SIDES, STATE, Pass, Quantity

REGION = ("region",)
CHIRIKOV = "[Chirikov1979] section 4"
ESCAPE = "[MelnikovMeshkov1986]; [HanggiTalknerBorkovec1990]"
TORQUE = "derivative of [Veljovic2015] (12), corrected coefficients"
CAPTURE = "[Neishtadt1975]; [GoldreichPeale1966] (18)"
MELNIKOV = "[GuckenheimerHolmes1983] section 4.5; [Melnikov1963]"


#: Laws with any terms, of any base; in the potential of (A, B, C); and under a torque alone.
_ANY = Standing(Flow, ANY)
_EXACT, _NUMERICAL = (Standing(rung, PERTURBED) for rung in (Trigonometric, Conservative))
_TILTED, _PUSHED = (Standing(rung, Trait.TORQUED) for rung in (Trigonometric, Conservative))

# fmt: off
QUANTITIES: tuple[Quantity, ...] = (
    Quantity("melnikov_mean", "melnikov", SIDES, "float64", "s-2",
             "mean of Melnikov's function: mean energy gained along the loop",
             "-damping S - quadratic int |phi'|^3 dt + torque (phi(inf) - phi(-inf)) - dS/dt",
             MELNIKOV, of=_ANY),
    Quantity("melnikov_amplitude", "melnikov", SIDES, "float64", "s-2",
             "largest deviation of Melnikov's function from its mean",
             "|int phi' f(phi) exp(i nu t) dt| of the drive f(phi) cos(nu t)", MELNIKOV,
             of=_ANY),
    Quantity("melnikov_phase", "melnikov", SIDES, "float64", "rad",
             "phase of the oscillation of Melnikov's function, NaN with several frequencies",
             "M(t0) = mean + amplitude cos(nu t0 + phase)", MELNIKOV, of=_ANY),
    Quantity("chaos_threshold", "melnikov", SIDES, "float64", "s-2",
             "amplitude of the first harmonic of the drive, the others in proportion, above which "
             "stable and unstable manifolds intersect",
             "forcing_amplitude |mean|/amplitude", MELNIKOV, of=_ANY),
    Quantity("chaos_threshold_error", "melnikov", SIDES, "float64", "s-2",
             "estimated error of the threshold, for the drive at it is not weak",
             "chaos_threshold (c swing^2 (1 + |nu dlog(amplitude)/dnu|) + sqrt(1 + (4 |mean|/(5 nu "
             "S (1 + nu^2/k^2)))^2) - 1), swing = chaos_threshold/(nu^2 + k^2), c the greater of "
             "1.5 k/S and |V_4 + V_3^2/k^2|/(8 k^2), V_n the derivatives at the saddle; the root "
             "of lobes alone", MELNIKOV, of=_ANY),
    Quantity("turnstile_area", "melnikov", SIDES, "float64", "s-1",
             "area of a turnstile of the undamped system: flux across the separatrix in one "
             "period of the drive",
             "integral of the positive part of M(t0) over one period; 2 amplitude/nu",
             "[MacKayMeissPercival1984]; " + MELNIKOV, of=_ANY),
    Quantity("threshold_validity", "melnikov", SIDES, "int8", "1",
             "whether damping and drive are weak enough for the threshold, or why they are not",
             "|mean|, damping S < 2 S k; no noise; a torque changes the threshold by less than a "
             "quarter; its error is less than a quarter of it", MELNIKOV, Validity, of=_ANY),
    Quantity("quiet_frequency", "quiet_frequencies", (*SIDES, "order"), "float64", "s-1",
             "frequency of a torque to which the lobe does not respond at first order",
             "multiples of nu x = pi, cosh(k (x + i y)) = (-S + i k^2)/sqrt(D)", MELNIKOV,
             of=_NUMERICAL, general="int phi' sin(nu t) dt = 0, t = 0 at the turning point"),
    Quantity("capture_flux", "capture", REGION, "float64", "s-2",
             "energy lost in one round of the region's separatrix: rate at which the region gains "
             "phase space",
             "damping S + dS/dt", CAPTURE, of=_ANY),
    Quantity("capture_probability", "capture", REGION, "float64", "1",
             "probability that a motion that reaches the separatrix is captured in the region",
             "P_i = Theta_i/sum Theta, 0 or 1 where one region loses phase space", CAPTURE,
             of=_ANY),
    Quantity("capture_error", "capture", (), "float64", "1",
             "estimated error of the probabilities",
             "(1 + log(1/rate)) rate/4, rate = (damping S + dS/dt)/(S k); and 3 torque width/(S k) "
             "of each area", CAPTURE, of=_ANY),
    Quantity("capture_validity", "capture", (), "int8", "1",
             "whether the probabilities hold, or why they are NaN",
             "rate < 1, no drive, no noise, a torque leaves all equilibria", CAPTURE, Validity,
             of=_ANY),
    Quantity("critical_torque", "critical_torques", DIRECTION, "float64", "s-2",
             "smallest and largest constant torque, over the inertia, with an equilibrium",
             "extremes of V'(phi), where V''(phi) = 0", TORQUE),
    Quantity("critical_phi", "critical_torques", DIRECTION, "float64", "rad",
             "angle at which equilibria merge under the critical torque", "V''(phi) = 0", TORQUE),
    Quantity("energy_per_turn", "separatrices", (), "float64", "s-2",
             "energy gained in a forward turn under the torque, NaN on a line", "2 pi torque",
             TORQUE, of=_ANY),
    Quantity("lobe_area_error", "separatrices", SIDES, "float64", "s-1",
             "estimated error of the area inside the separatrix", "of its quadrature", TORQUE,
             of=_TILTED),
    Quantity("period_error", "orbits", (), "float64", "s", "estimated error of the period",
             "of its quadrature", TORQUE, of=_TILTED),
    Quantity("action_error", "orbits", (), "float64", "s-1", "estimated error of the action",
             "of its quadrature", TORQUE, of=_TILTED),
    Quantity("phi_min_error", "orbits", (), "float64", "rad",
             "bound of the error of the least angle, NaN for a rotation and without a torque",
             "the nearest points at which the sign of V - torque phi - h is known", TORQUE,
             of=_TILTED),
    Quantity("phi_max_error", "orbits", (), "float64", "rad",
             "bound of the error of the greatest angle, NaN for a rotation and without a torque",
             "the nearest points at which the sign of V - torque phi - h is known", TORQUE,
             of=_TILTED),
    Quantity("gain_per_turn", "orbits", (), "float64", "s-2",
             "energy gained in each turn of a running orbit, 0 for others", "2 pi |torque|",
             TORQUE, of=_ANY),
    Quantity("angle_error", "action_angle", (), "float64", "rad",
             "estimated error of the angle variable",
             "distance between the orbit and its reconstruction", TORQUE,
             of=_TILTED),
    Quantity("phi_of_angle_error", "state_of", (), "float64", "rad",
             "estimated error of the angle", "errors of the action and of the motion", TORQUE,
             of=_TILTED),
    Quantity("dphi_of_angle_error", "state_of", (), "float64", "s-1",
             "estimated error of the angular velocity", "errors of the action and of the motion",
             TORQUE, of=_TILTED),
    Quantity("retrapping_torque", "retrapping", DIRECTION, "float64", "s-2",
             "smallest constant torque, over the inertia, that sustains a rotation, at small "
             "damping", "(damping S + quadratic int |phi'|^3 dt)/(2 pi) of a winding separatrix",
             "[Stewart1968]; " + MELNIKOV, of=_NUMERICAL),
    Quantity("retrapping_validity", "retrapping", DIRECTION, "int8", "1",
             "whether the torque holds, or why it is NaN",
             "damping < k, |torque| below the critical one, no drive, no noise", TORQUE, Validity,
             of=_NUMERICAL),
    Quantity("escape_rate", "escape", SIDES, "float64", "s-1",
             "rate of escape by noise from the well on that side, over the saddle",
             "[sqrt(1 + (d/2k)^2) - d/2k] Y sqrt(kT/2 pi) exp(-barrier/kT)/int exp(-(V - V_c)/kT); "
             "Y = Y(D1) Y(D2)/Y(D1 + D2), D = d S/kT; D corrected by the mean passage of the "
             "energy, k by that of the angle",
             ESCAPE, of=_NUMERICAL),
    Quantity("barrier", "escape", SIDES, "float64", "s-2",
             "energy from the center to the saddle",
             "V(phi_s) - V(phi_c) - torque (phi_s - phi_c)", ESCAPE,
             of=_NUMERICAL),
    Quantity("escape_regime", "escape", SIDES, "int8", "1",
             "what limits the escape", "damping S < kT: diffusion of the energy; damping > 2 k: "
             "diffusion in space; else the turnover between them", ESCAPE, EscapeRegime,
             of=_NUMERICAL),
    Quantity("escape_error", "escape", SIDES, "float64", "1",
             "estimated relative error of the rate",
             "distance to the farther of the rates with all corrections and with none", ESCAPE,
             of=_NUMERICAL),
    Quantity("resonance_action", "resonances", ("order",), "float64", "s-1",
             "action of the orbit in resonance with the drive", "n Omega(J) = m nu", CHIRIKOV,
             of=_NUMERICAL),
    Quantity("resonance_width", "resonances", ("order",), "float64", "s-1",
             "half-width of the resonance in action",
             "2 sqrt(V/|dOmega/dJ|), V = |(f dphi/dtheta)_n|/n of the drive f(phi) cos(m nu t)",
             CHIRIKOV, of=_NUMERICAL),
    Quantity("resonance_overlap", "resonances", ("order",), "float64", "1",
             "half-widths of the resonance and of the next one, over their distance",
             "(width_n + width_(n+1))/|J_(n+1) - J_n|", CHIRIKOV, of=_NUMERICAL),
)
# fmt: on

_CAPTURE = "phasekit.perturbation.capture:"
_TORQUE = "phasekit.perturbation.torque:"
_QUADRATURE = "phasekit.perturbation.quadrature:"
_MELNIKOV = "phasekit.perturbation.melnikov:"
_TORQUED = "phasekit.phase.numerical.torqued:"
_KEPT = "phasekit.perturbation.kept_momentum:"

PASSES: tuple[Pass, ...] = (
    Pass(_TORQUE + "critical_torque", ABC, ("critical_torques",)),
    *(
        Pass(_TORQUE + name, (LAW,), ("critical_torques",), Standing(rung, ANY))
        for name, rung in (
            ("critical_of_perturbed", Trigonometric),
            ("critical_of_formula", Conservative),
        )
    ),
    *(
        Pass(function, (LAW,), (group,), _EXACT)
        for function, group in (
            (_MELNIKOV + "melnikov", "melnikov"),
            (_MELNIKOV + "quiet_frequencies", "quiet_frequencies"),
            (_CAPTURE + "capture", "capture"),
            (_TORQUE + "retrapping_torque", "retrapping"),
        )
    ),
    *(
        Pass(function, (LAW,), (group,), _NUMERICAL)
        for function, group in (
            ("phasekit.perturbation.escape:escape_rate", "escape"),
            ("phasekit.perturbation.resonances:resonances", "resonances"),
            (_QUADRATURE + "melnikov", "melnikov"),
            (_QUADRATURE + "quiet_frequencies", "quiet_frequencies"),
            (_TORQUE + "retrapping_of_formula", "retrapping"),
            (_CAPTURE + "capture_numerical", "capture"),
            (_TORQUED + "equilibria", "equilibria"),
        )
    ),
    *(
        Pass(_TORQUED + name, (LAW, *states), groups, _PUSHED, options)
        for name, states, groups, options in (
            ("phase_space", (), ("equilibria", "separatrices"), ()),
            ("equilibria", (), ("equilibria",), ()),
            ("separatrices", (), ("separatrices",), ()),
            ("orbits", STATE, ("orbits",), ()),
            ("angles", STATE, ("action_angle",), ()),
            ("state_of", ("state_action", "state_angle", "state_family"), ("state_of",), ()),
            ("orbits_at_energy", ("state_energy",), ("orbits",), ("center",)),
            ("orbits_at_gap", ("state_gap",), ("orbits",), ("saddle", "side")),
            ("separatrix_motion_with_errors", ("time",), ("motion",), ("saddle", "side")),
        )
    ),
    *(
        Pass(module + name, (LAW, *states), (group,), of)
        for module, of in (
            (_TORQUED, _PUSHED),
            (_KEPT, Standing(Routhian, Trait.TORQUED)),
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
        Pass(_KEPT + name, (LAW,), (group,), Standing(Routhian, PERTURBED))
        for name, group in (
            ("equilibria", "equilibria"),
            ("melnikov", "melnikov"),
            ("capture", "capture"),
        )
    ),
)
