"""Forces and rotators along an arc of a separatrix, and their means over its angle.

Where a force almost vanishes its size all but has a kink, and no rule that knows nothing of it
converges; then the arc is halved until each part agrees with its halves.
"""

from __future__ import annotations

import math

import numpy as np

from phasekit.arrays import Array
from phasekit.mechanics.disk_states import ALONG, OMEGA, SPAN, WEIGHT, A, B, C, acceleration, pair
from phasekit.numerics.compile import inline, routine

# Rows of the description of an arc.
FIRST, DELTA, SIGN, WINDS = 0, 1, 2, 3  # angle, signed length, sign of phi', whether it winds
BEYOND, STEEP = 4, 5  # if not: what `square_speed_between` needs;
AT_FIRST, AT_LAST = 6, 7  # if so: phi'^2 at the ends, which are saddles,
SIN_FIRST, COS_FIRST, SIN_LAST, COS_LAST = 8, 9, 10, 11  # sines and cosines there
ARC = 12

MEASURES = 2
# Mean and mean square of two measures.
SUMS = 2 * MEASURES
NODE, SHARE = np.polynomial.legendre.leggauss(10)
# Parts of the double-exponential variable: the whole, the least, and the most at a time and in
# all. Agreement of a part with its halves, and of all of them, in units of the whole.
REACHED, LEAST, PARTS, MOST = 3.4, 1e-9, 64, 600
CLOSE, ENOUGH = 3e-11, 1e-6


@inline
def square_speed_from_saddle(x: float, s: float, c: float, a: float, b: float, cc: float) -> float:
    """phi'^2 at the offset x from a saddle with sine s and cosine c, on its separatrix.

    V' = 0 at the saddle is used, so that it vanishes there with all its digits.
    """
    sin1, cos1 = math.sin(0.25 * x), math.cos(0.25 * x)
    sin2, cos2 = 2.0 * sin1 * cos1, (cos1 - sin1) * (cos1 + sin1)
    sin3, cos3 = sin2 * cos1 + cos2 * sin1, cos2 * cos1 - sin2 * sin1
    double_s, double_c = 2.0 * s * c, (c - s) * (c + s)
    slope = 2.0 * sin1 * (b * (c * cos1 - s * sin1) + cc * (s * cos1 + c * sin1))
    slope -= 0.5 * a * sin3 * (double_c * cos3 - double_s * sin3)
    slope -= 0.5 * a * sin1 * (double_c * cos1 - double_s * sin1)
    return -4.0 * sin2 * slope


@inline
def square_speed_between(x: float, rest: float, beyond: float, k: float) -> float:
    """phi'^2 at the offset x from a saddle, on the way to where it turns or to a partner saddle.

    That end lies ``rest`` further on, the turning point on the other side of the saddle (the
    partner again) ``beyond`` further on; k is -V'' of the saddle over the
    product of the sines of half their offsets.
    """
    rise = math.sin(0.5 * x)
    fall = math.sin(0.5 * rest) * math.sin(0.5 * beyond)
    return 4.0 * k * rise * rise * fall


@inline
def measures(
    k: int, s: float, c: float, dphi: float, ddphi: float, rotators: bool, table: Array
) -> tuple[float, float]:
    """Forces at A2 and B2, or intensities of R022 and R012."""
    if rotators:
        q = dphi * dphi
        return math.sqrt(ddphi * ddphi + q * q), 2.0 * abs(table[OMEGA, k] * dphi)
    u, v, du, dv, axial = pair(k, s, c, dphi, ddphi, 0.0, table)
    hold = 0.5 * table[WEIGHT, k]
    u, v = u + hold * s, v + hold * c
    hold *= table[ALONG, k] / table[SPAN, k]
    du, dv = du + hold * s, dv + hold * c
    at_a = math.sqrt((u + du) * (u + du) + (v + dv) * (v + dv) + axial * axial)
    at_b = math.sqrt((u - du) * (u - du) + (v - dv) * (v - dv))
    return at_a, at_b


@inline
def state(k: int, arc: Array, distance: float, table: Array) -> tuple[float, float]:
    """Angle and angular velocity at a distance, as a part of the arc, from the nearer end.

    It is negative where the last end is the nearer one.
    """
    from_first = distance > 0.0
    x = arc[DELTA] * distance
    if arc[WINDS] != 0.0:
        s = arc[SIN_FIRST] if from_first else arc[SIN_LAST]
        c = arc[COS_FIRST] if from_first else arc[COS_LAST]
        square = square_speed_from_saddle(x, s, c, table[A, k], table[B, k], table[C, k])
        square += arc[AT_FIRST] if from_first else arc[AT_LAST]
    else:
        rest = arc[DELTA] - x if from_first else -x
        along = x if from_first else arc[DELTA] + x
        square = square_speed_between(along, rest, arc[BEYOND] + rest, arc[STEEP])
    end = arc[FIRST] if from_first else arc[FIRST] + arc[DELTA]
    return end + x, arc[SIGN] * math.sqrt(max(square, 0.0))


@routine
def over_part(
    k: int,
    arc: Array,
    branches: int,
    rotators: bool,
    low: float,
    high: float,
    out: Array,
    table: Array,
) -> None:
    """Sums over a part of an arc in the variable of the double-exponential nodes."""
    out[:] = 0.0
    for n in range(NODE.size):
        t = 0.5 * (low + high) + 0.5 * (high - low) * NODE[n]
        stretch = 0.5 * math.pi * math.sinh(t)
        spread = math.cosh(stretch)
        near = 0.5 * math.exp(-abs(stretch)) / spread
        share = 0.5 * (high - low) * SHARE[n] * 0.25 * math.pi * math.cosh(t) / (spread * spread)
        phi, dphi = state(k, arc, -near if t > 0.0 else near, table)
        s, c = math.sin(phi), math.cos(phi)
        ddphi = acceleration(k, s, c, 0.0, table)
        for b in range(branches):
            values = measures(k, s, c, -dphi if b == 1 else dphi, ddphi, rotators, table)
            for measure in range(MEASURES):
                value = values[0] if measure == 0 else values[1]
                out[2 * measure] += share * value
                out[2 * measure + 1] += share * value * value


@routine
def halved(
    k: int,
    arc: Array,
    branches: int,
    measure: int,
    rotators: bool,
    sums: Array,
    table: Array,
) -> None:
    """Sums of one measure over an arc by halves, in place of estimates; NaN if they disagree."""
    parts = np.zeros((PARTS, 2 + SUMS))
    left, right, off = np.zeros(SUMS), np.zeros(SUMS), np.zeros(SUMS)
    first, last = 2 * measure, 2 * measure + 2
    rough = sums.copy()
    sums[first:last] = 0.0
    parts[0, 0], parts[0, 1] = -REACHED, REACHED
    over_part(k, arc, branches, rotators, -REACHED, REACHED, parts[0, 2:], table)
    count, tried = 1, 0
    while count > 0:
        tried += 1
        count -= 1
        low, high = parts[count, 0], parts[count, 1]
        middle = 0.5 * (low + high)
        over_part(k, arc, branches, rotators, low, middle, left, table)
        over_part(k, arc, branches, rotators, middle, high, right, table)
        close = True
        for n in range(first, last):
            close = close and abs(left[n] + right[n] - parts[count, 2 + n]) <= CLOSE * rough[n]
        if close or high - low < LEAST or tried > MOST or count + 2 > PARTS:
            for n in range(first, last):
                sums[n] += left[n] + right[n]
                off[n] += abs(left[n] + right[n] - parts[count, 2 + n])
        else:
            parts[count + 1, 0], parts[count + 1, 1] = low, middle
            parts[count + 1, 2:] = left
            parts[count, 0], parts[count, 1] = middle, high
            parts[count, 2:] = right
            count += 2
    for n in range(first, last):
        if not off[n] <= ENOUGH * sums[n]:
            sums[n] = math.nan
