"""The discriminant in exact arithmetic, for the few systems that floating point cannot decide."""

from __future__ import annotations

import math
from fractions import Fraction

# Stands for a nonzero discriminant that is too small for a double; only its sign matters.
TINY = 1e-300


def exact_discriminant(a: float, b: float, c: float) -> float:
    """(B^2 + C^2 - A^2)^3 + 27 A^2 B^2 C^2 of the doubles given, in units of 2^e near the largest.

    Correctly rounded in the scale of ``elementary.power_of_two_scale``; the sign is exact.
    """
    _, exponent = math.frexp(max(abs(a), abs(b), abs(c)))
    unit = Fraction(2) ** min(max(exponent - 1, -1023), 1022)
    a2, b2, c2 = ((Fraction(value) / unit) ** 2 for value in (a, b, c))
    delta = (b2 + c2 - a2) ** 3 + 27 * a2 * b2 * c2
    value = float(delta)
    return math.copysign(TINY, delta) if delta != 0 and abs(value) < TINY else value
