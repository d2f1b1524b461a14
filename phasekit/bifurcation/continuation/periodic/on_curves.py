"""Special points on curves of folds and tori of cycles in two parameters.

A cusp is where the quadratic coefficient of the fold vanishes; where it is infinite, a second
multiplier besides that of the fold is 1. A torus has a strong resonance where its multipliers meet
or are at a third or a quarter of a turn ([Kuznetsov2004] chapters 8 and 9).
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from phasekit.bifurcation.continuation.periodic.cycles import Cycles, Orbit
from phasekit.bifurcation.continuation.periodic.extended import FOLD, TORUS, Extended
from phasekit.bifurcation.continuation.periodic.normal_forms import at_fold

SAME = 2e-5  # half the angle within which multipliers meet, at ends of curves


@dataclass(frozen=True)
class CurveTest:
    """A kind of point on curves of a kind, and the number of an orbit that vanishes there."""

    kind: str
    of: str
    function: Callable[[Extended, Orbit], float]
    name: str = ""
    #: Whether the equations are singular there, so that it is known to `SAME` alone.
    blurred: bool = False

    def value(self, cycles: Cycles, orbit: Orbit) -> float:
        """The number of an orbit with its critical function."""
        assert isinstance(cycles, Extended)
        return self.function(cycles, orbit)


def _coefficients(cycles: Extended, orbit: Orbit) -> tuple[float, float]:
    """Those of a fold, xi' = b + a xi^2, as xi and the parameter change by their scales.

    Their signs go with that of the critical function; both are infinite where it resonates.
    """
    n = cycles.own
    one, v = cycles.plain(orbit.y[2]), orbit.x[:, n:].copy()
    alone = Orbit(orbit.mesh, orbit.x[:, :n].copy(), orbit.y[:2].copy())
    dy = np.zeros(2)
    if not cycles.forced:
        dy[0] = orbit.y[-1] * orbit.y[0]
    stretch = 0.0
    if cycles.forced:
        stretch = float(cycles.own_period(orbit.y)[1][0]) / float(orbit.y[0])
    form = at_fold(one, alone, v, dy, stretch)
    nothing = np.zeros(2)
    parts = one.inner(orbit.mesh, v, v, nothing, nothing)
    whole = one.replace(scale=np.ones(n)).inner(orbit.mesh, v, v, nothing, nothing)
    return form["a"] * whole / parts, form["b"] * float(one.width[0])


def _bend(cycles: Extended, orbit: Orbit) -> float:
    """The quadratic coefficient beside both."""
    a, b = _coefficients(cycles, orbit)
    return a / math.hypot(a, b)


def _meet(cycles: Extended, orbit: Orbit) -> float:
    """The product of the left and the right critical function, with the sign of a."""
    a, b = _coefficients(cycles, orbit)
    return math.copysign(1.0 / math.hypot(a, b), a)


def _half(cycles: Extended, orbit: Orbit) -> float:
    """Half the angle of the pair of multipliers."""
    return 0.5 * float(orbit.y[-1] * orbit.y[0])


def _at(turn: float) -> Callable[[Extended, Orbit], float]:
    """How far the pair of multipliers is from a part of a turn."""
    cosine = round(math.cos(2.0 * math.pi * turn), 15)
    return lambda cycles, orbit: math.cos(2.0 * _half(cycles, orbit)) - cosine


def _zero(value: float) -> float:
    """A sine at its zero."""
    return 0.0 if abs(value) < SAME else value


TESTS = (
    CurveTest("cusp", FOLD, _bend),
    CurveTest("resonance_1", FOLD, _meet),
    CurveTest(
        "resonance_1", TORUS, lambda cycles, o: _zero(math.sin(_half(cycles, o))), blurred=True
    ),
    CurveTest(
        "resonance_2", TORUS, lambda cycles, o: _zero(math.cos(_half(cycles, o))), blurred=True
    ),
    CurveTest("resonance_3", TORUS, _at(1.0 / 3.0)),
    CurveTest("resonance_4", TORUS, _at(0.25)),
)


def tests_of(cycles: Cycles) -> tuple[CurveTest, ...]:
    """What is looked for along a curve."""
    kind = cycles.kind if isinstance(cycles, Extended) else ""
    return tuple(test for test in TESTS if test.of == kind)
