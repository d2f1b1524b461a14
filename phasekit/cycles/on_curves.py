"""Special points on families of cycles, and on curves of their folds, doublings and tori.

A cusp is where the quadratic coefficient of the fold vanishes; where it is infinite, a second
multiplier besides that of the fold is 1. A torus has a strong resonance where its multipliers meet
or are at a third or a quarter of a turn. Doublings and tori change from soft to hard where their
cubic coefficient vanishes; a fold doubles where multipliers are 1 and -1 ([Kuznetsov2004] chapters
8 and 9).
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import numpy as np

from phasekit.arrays import Array
from phasekit.bifurcation.special_points import functions_along, look_for
from phasekit.cycles.criteria import determinant, doubling_test, second_doubling
from phasekit.cycles.cycles import Cycles, Orbit
from phasekit.cycles.extended import DOUBLING, FOLD, TORUS, Extended
from phasekit.cycles.linear import Linear
from phasekit.cycles.multilinear import VARIANTS
from phasekit.cycles.normal_forms import at_doubling, at_fold, at_torus
from phasekit.cycles.point import Point

Sized = tuple[float, float]

RESONANT = 0.05  # distance of half the angle from resonances 1 and 2 below which d says nothing
NOTHING = 1e-9  # size of a function of the multipliers that is rounding
LARGE = 1e-2  # part of its terms from which on a coefficient is not zero by their errors
CYCLE = "cycle"  # families themselves
SAME = 2e-5  # half the angle within which multipliers meet, at ends of curves


@dataclass(frozen=True)
class OrbitTest:
    """A kind of point along cycles or a curve, and the number of an orbit that vanishes there.

    Attributes
    ----------
    kind : str
        A kind of the registry of special points.
    along : str
        "cycle", or "fold_of_cycles", "period_doubling", "torus" or "cycle_branch_point", which are
        curves, or "fold", of boundary value problems.
    function : callable
        The number of a family and a point of it.
    name : str
        What it is called in messages besides its kind.
    """

    kind: str
    along: str
    function: Callable[..., Any]
    name: str = ""
    #: Whether the equations are singular there, so that it is known to `SAME` alone.
    blurred: bool = False
    #: Whether it goes with second or third derivatives, of which there are variants; then the
    #: function gives its size, too, did its terms not cancel.
    bent: bool = False
    #: What messages call the number.
    coefficient: str = ""
    #: Of a family and a point, why the number says nothing there, in words; or "".
    lost: Callable[..., str] = lambda cycles, point: ""

    def value(self, cycles: Cycles, point: Point) -> float:
        """The number of an orbit with its critical function."""
        return float(self.function(cycles, point)[0] if self.bent else self.function(cycles, point))

    def signed(self, cycles: Cycles, point: Point) -> bool:
        """Whether the number has a sign, and is not zero but for its error."""
        if not self.bent:
            return abs(self.value(cycles, point)) >= NOTHING
        value, size = self.function(cycles, point)
        # Derivatives have errors, and the orbit has, along which terms cancel.
        error = max(point.mesh_error, NOTHING) * size
        if abs(value) <= error or abs(value) > LARGE * size or not isinstance(cycles, Extended):
            return bool(abs(value) > error)
        count = 2 if cycles.jets.jets.exact else VARIANTS
        variants = (float(self.function(cycles, point, k)[0]) for k in range(1, count))
        return bool(abs(value) > error + max(abs(one - value) for one in variants))

    def vanishes(self, cycles: Cycles, points: Sequence[Point], values: Array) -> bool:
        """Whether it is zero, but for its error, along more than half of a curve."""
        known = np.flatnonzero(np.isfinite(values))
        if len(known) < 3:
            return False
        for some in (known[[0, len(known) // 2, -1]], known):  # three points speak first
            zero = sum(not self.signed(cycles, points[i]) for i in some.tolist())
            if 2 * zero <= len(some):
                return False
        return True


def _parted(cycles: Extended, point: Point) -> tuple[Cycles, Orbit, Array]:
    """The family of the orbit alone, the orbit, and its critical function."""
    n, orbit = cycles.own, point.orbit
    alone = Orbit(orbit.mesh, orbit.x[:, :n].copy(), orbit.y[:2].copy())
    return cycles.plain(orbit.y[2]), alone, orbit.x[:, n:].copy()


@lru_cache(maxsize=2)  # two tests ask for those of one point
def _coefficients(cycles: Extended, point: Point, variant: int) -> tuple[float, float, float]:
    """Those of a fold, xi' = b + a xi^2, as xi and the parameter change by their scales; a's size.

    Their signs go with that of the critical function; both are infinite where it resonates.
    """
    n, orbit = cycles.own, point.orbit
    one, alone, v = _parted(cycles, point)
    stretch = 0.0
    if cycles.forced:
        stretch = float(cycles.own_period(orbit.y)[1][0]) / float(orbit.y[0])
    line = Linear(one, alone, variant)
    form = at_fold(line, v, stretch)
    nothing = np.zeros(2)
    parts = one.inner(orbit.mesh, v, v, nothing, nothing)
    whole = one.replace(scale=np.ones(n)).inner(orbit.mesh, v, v, nothing, nothing)
    ratio = float(whole / parts)
    return form["a"] * ratio, form["b"] * float(one.width[0]), line.size * ratio


def _bend(cycles: Extended, point: Point, variant: int = 0) -> Sized:
    """The quadratic coefficient beside both."""
    a, b, size = _coefficients(cycles, point, variant)
    return a / math.hypot(a, b), size / math.hypot(a, b)


def _meet(cycles: Extended, point: Point, variant: int = 0) -> Sized:
    """The product of the left and the right critical function, with the sign of a."""
    a, b, _ = _coefficients(cycles, point, variant)
    return math.copysign(1.0 / math.hypot(a, b), a), 0.0


def _doubled(cycles: Extended, point: Point, variant: int = 0) -> Sized:
    """The cubic coefficient of a period doubling."""
    one, alone, v = _parted(cycles, point)
    line = Linear(one, alone, variant)
    unit = _unit(cycles, point)
    return at_doubling(line, v)["c"] * unit, line.size * unit


def _unit(cycles: Extended, point: Point) -> float:
    """By what a cubic coefficient is multiplied as states change by their scales in a period."""
    return float(np.mean(cycles.scale[: cycles.own] ** 2) * point.orbit.y[0])


def _angle(cycles: Extended, point: Point) -> float:
    """The angle of the pair of multipliers."""
    return float(point.orbit.y[-1] * point.orbit.y[0])


def _torus(cycles: Extended, point: Point, variant: int = 0) -> Sized:
    """The cubic coefficient of a torus; none next to resonances, where it is infinite."""
    angle = _angle(cycles, point)
    if min(abs(math.sin(0.5 * angle)), abs(math.cos(0.5 * angle))) < RESONANT:
        return math.nan, math.nan
    one, alone, v = _parted(cycles, point)
    line = Linear(one, alone, variant)
    unit = _unit(cycles, point)
    return at_torus(line, angle, v)["d"] * unit, line.size * unit


def _turn_test(turn: float) -> Callable[[Extended, Point], float]:
    """How far the pair of multipliers is from a part of a turn."""
    cosine = round(math.cos(2.0 * math.pi * turn), 15)
    return lambda cycles, point: math.cos(_angle(cycles, point)) - cosine


def _zero(value: float) -> float:
    """A sine at its zero."""
    return 0.0 if abs(value) < SAME else value


def _multiplier_test(test: Callable[[Point, bool], float]) -> Callable[[Extended, Point], float]:
    """A function of the multipliers alone; none where they are not known."""
    return lambda cycles, point: test(point, cycles.forced) if point.trusted else math.nan


_A, _C, _D = "the coefficient a", "the coefficient c", "the coefficient d"
_PAIR = "the distance of the pair of multipliers from that angle"
_OTHER = "the distance of another multiplier from 1 or -1"
for _test in (
    OrbitTest("cusp", FOLD, _bend, bent=True, coefficient=_A),
    OrbitTest("resonance_1", FOLD, _meet, bent=True),
    OrbitTest("fold_flip", FOLD, _multiplier_test(doubling_test), coefficient=_OTHER),
    OrbitTest("generalized_flip", DOUBLING, _doubled, bent=True, coefficient=_C),
    OrbitTest("fold_flip", DOUBLING, _multiplier_test(determinant), coefficient=_OTHER),
    OrbitTest("resonance_2", DOUBLING, _multiplier_test(second_doubling), coefficient=_OTHER),
    OrbitTest(
        "resonance_1", TORUS, lambda cycles, p: _zero(math.sin(0.5 * _angle(cycles, p))),
        blurred=True, coefficient=_PAIR,
    ),
    OrbitTest(
        "resonance_2", TORUS, lambda cycles, p: _zero(math.cos(0.5 * _angle(cycles, p))),
        blurred=True, coefficient=_PAIR,
    ),
    OrbitTest("resonance_3", TORUS, _turn_test(1.0 / 3.0), coefficient=_PAIR),
    OrbitTest("resonance_4", TORUS, _turn_test(0.25), coefficient=_PAIR),
    OrbitTest("chenciner", TORUS, _torus, bent=True, coefficient=_D),
):  # fmt: skip
    look_for(_test)


def looked_for_on(cycles: Cycles) -> tuple[OrbitTest, ...]:
    """What is looked for along a family or a curve."""
    return tuple(functions_along(getattr(cycles, "kind", CYCLE)))
