"""Special points on curves of folds and tori of cycles in two parameters.

A cusp is where the quadratic coefficient of the fold vanishes; a torus has a strong resonance where
its multipliers are at a third or a quarter of a turn ([Kuznetsov2004] chapters 8 and 9).
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

from phasekit.bifurcation.continuation.periodic.cycles import Cycles, Orbit
from phasekit.bifurcation.continuation.periodic.extended import FOLD, TORUS, Extended
from phasekit.bifurcation.continuation.periodic.normal_forms import at_fold


@dataclass(frozen=True)
class CurveTest:
    """A kind of point on curves of a kind, and the number of an orbit that vanishes there."""

    kind: str
    of: str
    function: Callable[[Extended, Orbit], float]
    name: str = ""

    def value(self, cycles: Cycles, orbit: Orbit) -> float:
        """The number of an orbit with its critical function."""
        assert isinstance(cycles, Extended)
        return self.function(cycles, orbit)


def _bend(cycles: Extended, orbit: Orbit) -> float:
    """The quadratic coefficient of a fold; its sign goes with that of the critical function."""
    n = cycles.own
    one = cycles.plain(orbit.y[2])
    alone = Orbit(orbit.mesh, orbit.x[:, :n].copy(), orbit.y[:2].copy())
    dy = alone.y * 0.0
    if not cycles.forced:
        dy[0] = orbit.y[-1] * orbit.y[0]
    return at_fold(one, alone, orbit.x[:, n:].copy(), dy)["a"]


def _turn(cosine: float) -> Callable[[Extended, Orbit], float]:
    """How far the pair of multipliers is from an angle, by its cosine."""
    return lambda cycles, orbit: math.cos(orbit.y[-1] * orbit.y[0]) - cosine


TESTS = (
    CurveTest("cusp", FOLD, _bend),
    CurveTest("resonance_3", TORUS, _turn(-0.5)),
    CurveTest("resonance_4", TORUS, _turn(0.0)),
)


def tests_of(cycles: Cycles) -> tuple[CurveTest, ...]:
    """What is looked for along a curve."""
    kind = cycles.kind if isinstance(cycles, Extended) else ""
    return tuple(test for test in TESTS if test.of == kind)
