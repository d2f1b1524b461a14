"""The arithmetic-geometric mean, and the motion psi' = Delta(psi) that it solves.

With Delta(psi) = sqrt(a^2 cos(psi)^2 + b^2 sin(psi)^2), Gauss's transformation

    sin(psi) = 2 a sin(psi_1) / ((a + b) + (a - b) sin(psi_1)^2)

turns psi' = Delta(psi) into the same equation with the two means of a and b. A few steps make
both equal to their common mean w, and psi_n = w t: the angle that grows in proportion to time,
here called the phase. Each step is rational in sin, cos and Delta and adds only what has one sign,
so all three keep their relative accuracy, however far a and b are apart.
"""

from __future__ import annotations

import math

import numpy as np

from phasekit.arrays import Array
from phasekit.numerics.compile import inline

# Ratios down to 1e-300 take thirteen steps.
STEPS = 16


@inline
def halve(a: float, b: float, first: int, w: Array) -> int:
    """Means of a, b > 0 from w[first] (arithmetic) and w[first + STEPS] (geometric); their number.

    The last pair is equal to rounding: w[first + n] is the arithmetic-geometric mean.
    """
    n = 0
    w[first] = a
    w[first + STEPS] = b
    while n < STEPS - 1 and abs(a - b) > 5e-16 * a:
        a, b = 0.5 * (a + b), np.sqrt(a * b)
        n += 1
        w[first + n] = a
        w[first + STEPS + n] = b
    return n


@inline
def phase(sine: float, cosine: float, first: int, n: int, w: Array) -> float:
    """Phase in [-pi, pi] at which psi has this sine and cosine."""
    for i in range(n):
        a = w[first + i]
        b = w[first + STEPS + i]
        delta = np.sqrt(a * cosine * (a * cosine) + b * sine * (b * sine))
        sine *= (a + b) / (a + delta)
        cosine *= np.sqrt(2.0 * a / (a + delta) * ((a + b) / (b + delta)))
    return np.float64(math.atan2(sine, cosine))


@inline
def amplitude(
    sine: float, cosine: float, first: int, n: int, w: Array
) -> tuple[float, float, float]:
    """Return sin(psi), cos(psi) and Delta(psi) where the phase has this sine and cosine."""
    delta = w[first + n]
    for i in range(n - 1, -1, -1):
        a = w[first + i]
        b = w[first + STEPS + i]
        mean = w[first + i + 1]
        square = sine * sine
        rest = cosine * cosine
        inverse = 1.0 / (rest * mean + square * a)
        cosine *= delta * inverse
        delta = a * (rest * mean + square * b) * inverse
        sine *= a * inverse
    return sine, cosine, delta
