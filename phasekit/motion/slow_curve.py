"""Rests at which one eigenvalue is none: how far around them slow motions come nearer.

Linear terms decide nothing there. On the curve through the rest along which all rates but one
vanish, that one has the sign of what the flow does ([Kuznetsov2004] 5.1): its centre manifold is
there up to terms that are smaller still.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from phasekit.arrays import Array
from phasekit.motion.equation_rates import slopes_at
from phasekit.motion.newton import Neighbourhood

#: Greatest distance from a rest, in units of the states, and how often it is halved.
FARTHEST, HALVES = 0.4, 8
#: Times that a rest is placed by the rates on both sides, and the power of the distance with which
#: these go below which it is a simple one, which Newton's method places better.
PASSES, SIMPLE = 3, 1.5
#: Steps of Newton's method, and the last beside the distance.
STEPS, LAST = 12, 1e-10
#: Part of the slopes times the distance that is rounding of a rate, and cosine of null vectors that
#: are at right angles.
ROUNDING, ACROSS = 1e-15, 1e-8
#: Part of the slopes that an eigenvalue along the curve may have and not grow.
LEAST = 1e-9


class SlowRest(NamedTuple):
    """A rest, and what slow motions do next to it."""

    x: Array
    reach: float
    """Distance along its slow curve up to which motions come to it; or 0."""
    is_simple: bool
    """Whether their rates go with the distance itself: its eigenvalue is small, and not none."""


def slow_rest(near: Neighbourhood, x: Array) -> SlowRest:
    """The rest next to a state that Newton's method found, simple or not."""
    units, one = near.units, near.single
    slopes = slopes_at(near.law, one, x) * units / units[:, None]
    left, _, right = np.linalg.svd(slopes)
    way = right[-1]
    if abs(left[:, -1] @ way) < ACROSS:
        return SlowRest(x, 0.0, False)
    reach, given = 0.0, x
    for _ in range(PASSES):
        sides = [_along(near, x, side * way, slopes) for side in (1.0, -1.0)]
        reach = min(max(rates, default=0.0) for rates in sides)
        both = sorted(set(sides[0]) & set(sides[1]))
        if len(both) < 2:
            break
        # Rates go with a power of the distance: they are alike on both sides of the rest.
        s, twice = both[0], both[1]
        power = np.log2([side[twice] / side[s] for side in sides]).mean()
        if power < SIMPLE:
            return SlowRest(given, reach, True)
        ahead, behind = (side[s] ** (1.0 / power) for side in sides)
        x = x + s * (behind - ahead) / (behind + ahead) * way * units
    return SlowRest(x, reach, False)


def _along(near: Neighbourhood, x: Array, way: Array, slopes: Array) -> dict[float, float]:
    """Rates towards a rest at distances on one side, as far as motions come to it."""
    size, n = float(np.linalg.norm(slopes, 2)), len(x)
    found: dict[float, float] = {}
    off, rate = np.zeros(n), 0.0
    for s in FARTHEST * 0.5 ** np.arange(HALVES, -1, -1.0):
        off = off * 2.0 if found else s * way
        for _ in range(STEPS):
            at = x + off * near.units
            here = slopes_at(near.law, near.single, at) * near.units / near.units[:, None]
            matrix = np.block([[here, -way[:, None]], [way[None], np.zeros((1, 1))]])
            missing = np.append(near.rates(at) / near.units - rate * way, way @ off - s)
            if not (np.isfinite(matrix).all() and np.isfinite(missing).all()):
                return found
            try:
                step = np.linalg.solve(matrix, -missing)
            except np.linalg.LinAlgError:
                return found
            off, rate = off + step[:n], rate + float(step[n])
            if np.abs(step[:n]).max() < LAST * s:
                break
        else:
            return found
        if np.linalg.eigvals(here).real.max() > LEAST * size:
            return found
        if abs(rate) <= ROUNDING * size * s:
            continue  # too near to tell
        if rate > 0.0:
            return found
        found[float(s)] = -rate
    return found
