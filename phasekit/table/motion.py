"""Damped and driven motions: once a period, exponents, attractors and their basins."""

from __future__ import annotations

from phasekit.errors import AttractorKind
from phasekit.labels.coordinates import LABELS
from phasekit.laws.ladder import FORMULAS, PERTURBED, Flow, Routhian, Standing
from phasekit.table.row import LAW, STATE, Pass, Quantity

STEPS = "[JorbaZou2005]; [HairerNorsettWanner1993] II.5"
EXPONENTS = "[BenettinGalganiGiorgilliStrelcyn1980]"
RECURRENCE = "[DatserisWagemakers2022]"

#: Flows, with any terms.
_ANY = Flow
_ATTRACTOR = ("attractor",)
#: On maps there is place for so many attractors.
_NUMBERED = {**LABELS, "attractor": (range(8), LABELS["attractor"][1])}

# fmt: off
QUANTITIES: tuple[Quantity, ...] = (
    Quantity("lyapunov_exponent", "lyapunov", ("exponent",), "float64", "s-1",
             "Lyapunov exponent of the motion, the largest first",
             "mean growth of log|u|, u'' = -V''(phi) u - d u' - 2 q |phi'| u'", EXPONENTS, of=_ANY),
    Quantity("lyapunov_error", "lyapunov", ("exponent",), "float64", "s-1",
             "estimated error of the Lyapunov exponent",
             "of the mean over 18 parts of the time, or their trend", EXPONENTS, of=_ANY),
    Quantity("lyapunov_sum", "lyapunov", (), "float64", "s-1",
             "sum of the Lyapunov exponents: -damping, without quadratic damping",
             "mean of -d - 2 q |phi'|", EXPONENTS, of=_ANY),
    Quantity("lyapunov_dimension", "lyapunov", (), "float64", "1", "Kaplan and Yorke's dimension",
             "k + (l_1 + ... + l_k)/|l_(k+1)|", EXPONENTS, of=_ANY),
    Quantity("section_time", "stroboscopic", ("crossing",), "float64", "s",
             "time of the crossing", "n T", STEPS, of=_ANY),
    Quantity("section_phi", "stroboscopic", ("crossing",), "float64", "rad",
             "angle in the section", "phi(n T), wrapped", STEPS, of=_ANY),
    Quantity("section_dphi", "stroboscopic", ("crossing",), "float64", "s-1",
             "angular velocity in the section", "phi'(n T)", STEPS, of=_ANY),
    Quantity("rotation_number", "stroboscopic", (), "float64", "1",
             "turns in a period, the mean over the section", "(phi(n T) - phi(0))/(2 pi n)",
             STEPS, of=_ANY),
    Quantity("attractor_phi", "attractors", (*_ATTRACTOR, "crossing"), "float64", "rad",
             "angle on the attractor, once a period", "phi(n T), wrapped", RECURRENCE, of=_ANY),
    Quantity("attractor_dphi", "attractors", (*_ATTRACTOR, "crossing"), "float64", "s-1",
             "angular velocity on the attractor, once a period", "phi'(n T)", RECURRENCE, of=_ANY),
    Quantity("attractor_kind", "attractors", _ATTRACTOR, "int8", "1",
             "kind of the attractor", "by its return and its exponent", RECURRENCE, of=_ANY,
             flags=AttractorKind),
    Quantity("attractor_period", "attractors", _ATTRACTOR, "int64", "1",
             "periods after which the attractor repeats itself, 0: it does not",
             "least q with phi(n + q) = phi(n)", RECURRENCE, of=_ANY),
    Quantity("attractor_multiplier", "attractors", _ATTRACTOR, "float64", "1",
             "greatest modulus of the attractor's multipliers over its period, of a rotation over "
             "a turn; NaN where it is neither",
             "max |eigenvalue of the map's derivative|", RECURRENCE, of=_ANY),
    Quantity("attractor_exponent", "attractors", _ATTRACTOR, "float64", "s-1",
             "largest Lyapunov exponent on the attractor", "log(multiplier)/period, or the mean "
             "growth of log|u|", EXPONENTS, of=_ANY),
    Quantity("attractor_exponent_error", "attractors", _ATTRACTOR, "float64", "s-1",
             "estimated error of the exponent, 0 where it comes from a multiplier",
             "of the mean over 18 parts of the time, or their trend", EXPONENTS, of=_ANY),
    Quantity("attractor_rotation", "attractors", _ATTRACTOR, "float64", "1",
             "turns in a period on the attractor", "(phi(n T) - phi(0))/(2 pi n)", RECURRENCE,
             of=_ANY),
    Quantity("basin", "basins", (), "int16", "1",
             "attractor of the motion; -1: undecided, -2: to infinity",
             "first state near the attractor", RECURRENCE, of=_ANY),
    Quantity("basin_decided", "basins", (), "bool", "1",
             "whether the errors of the steps stayed smaller than a cell until the motion was "
             "caught, so that they do not decide where it comes to", "10 rtol max|u| < cell",
             RECURRENCE, of=_ANY),
    Quantity("basin_time", "basins", (), "float64", "s",
             "time until the motion is seen to come to its attractor",
             "first state that is caught",
             RECURRENCE, of=_ANY),
    Quantity("boundary_fraction", "basins", (), "float64", "1",
             "share of the states beside another basin", "number of cells over all",
             RECURRENCE, of=_ANY),
    Quantity("basin_fraction", "basin_fractions", _ATTRACTOR, "float64", "1",
             "share of the states in the attractor's basin", "number of states over all",
             RECURRENCE, of=_ANY, labels=_NUMBERED),
    Quantity("basin_fraction_error", "basin_fractions", _ATTRACTOR, "float64", "1",
             "error of the share: that of a sample of as many states, and the undecided",
             "sqrt(f (1 - f)/N + 1/(4 N^2))/(1 + 1/N) + undecided", RECURRENCE, of=_ANY,
             labels=_NUMBERED),
    Quantity("attractor_angle", "basin_fractions", _ATTRACTOR, "float64", "rad",
             "angle of the attractor, once a period the least one; attractors are numbered by "
             "period, then by it", "phi(n T), wrapped", RECURRENCE, of=_ANY, labels=_NUMBERED),
    Quantity("remaining_fraction", "basin_fractions", (), "float64", "1",
             "share of the states that reach none of the numbered attractors: undecided, "
             "to infinity, or to others", "1 - sum of the shares", RECURRENCE, of=_ANY),
    Quantity("n_attractors", "basin_fractions", (), "int64", "1",
             "number of attractors found, including those that are not numbered; "
             "-1: without damping or a common period", "attractors of 256 states",
             RECURRENCE, of=_ANY),
)
# fmt: on

PASSES: tuple[Pass, ...] = (
    Pass("phasekit.motion.flow:at_momentum", (LAW, *STATE, "time"), ("motion",), Routhian),
    *(
        Pass(function, (LAW, *more), (group,), Standing(Flow, traits))
        for function, more, group, traits in (
            ("phasekit.motion.flow:flow", (*STATE, "time"), "motion", FORMULAS),
            ("phasekit.motion.exponents:lyapunov", (*STATE, "time"), "lyapunov", FORMULAS),
            (
                "phasekit.motion.shares:fractions",
                ("box_phi", "box_dphi"),
                "basin_fractions",
                PERTURBED,
            ),
        )
    ),
)
