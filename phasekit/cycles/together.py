"""Multipliers that pass the unit circle together, which no change of a sign tells."""

from __future__ import annotations

import cmath
import functools
import math
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np

from phasekit.bifurcation.special_points import KINDS
from phasekit.cycles.between import Stretch, root
from phasekit.cycles.criteria import complex_pair, nontrivial
from phasekit.cycles.family import Found
from phasekit.cycles.linear import Linear
from phasekit.cycles.normal_forms import at_torus, coefficients
from phasekit.cycles.point import Point

CLEAR = 1e-5  # distance from the circle at which a multiplier is on one side of it for sure
ON = 1e-6  # the same at which it is on it


def together(stretch: Stretch, found: list[Found]) -> list[Found]:
    """What explains a number of unstable multipliers that special points of a stretch do not."""
    assert isinstance(stretch.a, Point)
    a, b = (_logs(point, stretch.cycles.forced) for point in (stretch.a, stretch.b))
    out, up = (sum(log > CLEAR for log in ends) for ends in (a, b))
    not_in, not_down = (sum(log > -CLEAR for log in ends) for ends in (a, b))
    left = max(up - not_in, out - not_down) - sum(KINDS[one.kind].crossing or 0 for one in found)
    if left <= 0:
        return []
    point = root(stretch, lambda point, forced: sum(_nearest(point, forced, left)))
    p = sorted((float(stretch.a.orbit.y[1]), float(stretch.b.orbit.y[1])))
    interval = (p[0], p[1])
    several = f"{left} multipliers pass the unit circle together: a multiple point, not refined"
    if point is None:
        return [Found("cycle_branch_point", stretch.b, -1, interval, "guess", several)]
    mu = _critical(point, stretch.cycles.forced, left)
    pairs = [one for one in mu if one.imag > 0.0 and complex_pair(point, one)]
    on = all(abs(log) <= ON for log in _nearest(point, stretch.cycles.forced, left))
    if not on or 2 * len(pairs) != left:
        minus = all(one.real < 0.0 for one in mu)
        kind = "period_doubling" if minus else "cycle_branch_point"
        return [Found(kind, point, -1, interval, "guess", several)]
    angle = float(np.mean([*map(cmath.phase, pairs)]))
    made = Found("torus", point, -1, interval, "converged")
    if len(pairs) > 1:
        form = {"d": math.nan, "d_imag": math.nan, "angle": angle}
        words = f"{len(pairs)} pairs of multipliers pass the unit circle together"
        return [replace(made, form=lambda: (form, words))]

    @functools.cache
    def torus() -> tuple[dict[str, float], str]:
        powers = {"d": 2, "d_imag": 2}
        way = functools.partial(_at_torus, angle=angle)
        return coefficients(stretch.cycles, point, powers, way)

    return [replace(made, form=torus)]


def _at_torus(one: Any, angle: float) -> Callable[[Linear], dict[str, float]]:
    return lambda line: at_torus(line, angle)


def _critical(point: Point, forced: bool, count: int) -> list[complex]:
    """The multipliers next to the unit circle."""
    mu = (one for one in nontrivial(point.multipliers, forced) if one != 0.0)
    return sorted(mu, key=lambda one: abs(math.log(abs(one))))[:count]


def _nearest(point: Point, forced: bool, count: int) -> list[float]:
    """The logarithms of their sizes."""
    return [math.log(abs(one)) for one in _critical(point, forced, count)]


def _logs(point: Point, forced: bool) -> list[float]:
    """Logarithms of the sizes of all multipliers but the trivial one."""
    sizes = (abs(one) for one in nontrivial(point.multipliers, forced))
    return [math.log(size) if size > 0.0 else -math.inf for size in sizes]
