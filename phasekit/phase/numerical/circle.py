"""Whole turns of a circle taken from a coordinate without rounding, as far as its period is known.

V repeats over 2 pi, not over the double next to it: far round the circle the difference counts.
"""

from __future__ import annotations

import functools
import math
from fractions import Fraction
from typing import Any

import numpy as np

from phasekit.arrays import Array
from phasekit.numerics.double_double import (
    TWO_PI,
    TWO_PI_LOW,
    TWO_PI_LOWEST,
    dd_add,
    two_product,
    two_sum,
)

_EXACT_TURN = sum(map(Fraction, (TWO_PI, TWO_PI_LOW, TWO_PI_LOWEST)), Fraction(0))
#: Largest divisor of the parts of 2 pi that periods are looked for among.
_PARTS = 1000
#: Turns up to which three doubles hold a period well enough.
_FARTHEST = 1e30


@functools.lru_cache(maxsize=128)
def exact_period(period: float) -> tuple[float, float, float]:
    """A period as the sum of three doubles: a multiple of pi where it is the double next to one."""
    ratio = Fraction(period / TWO_PI).limit_denominator(_PARTS)
    near = ratio * _EXACT_TURN
    exact = near if abs(float(near) - period) <= math.ulp(period) else Fraction(period)
    parts = []
    for _ in range(3):
        parts.append(float(exact))
        exact -= Fraction(parts[-1])
    return parts[0], parts[1], parts[2]


def wrapped(x: Array, period: float) -> tuple[Array, Array]:
    """A coordinate next to the origin of its circle, and the turns that were taken from it.

    NaN where these are too many.
    """
    high, low, lowest = exact_period(period)
    far = np.abs(x) > 0.5 * period
    home, turns = x.copy(), np.zeros(x.shape)
    rest: Any = x[far]
    with np.errstate(all="ignore"):
        rest = np.where(np.abs(rest) <= _FARTHEST * period, rest, np.nan)
        tail: Any = np.zeros(rest.shape)
        for _ in range(3):  # the number of turns may be rounded itself
            count: Any = np.round(rest / period)
            for part in (high, low, lowest):
                product = two_product(-count, part)
                rest, tail = dd_add(rest, tail, *product)
    home[far] = two_sum(rest, tail)[0]
    turns[far] = x[far] - home[far]
    return home, turns
