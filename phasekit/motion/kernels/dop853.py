"""One step of the Runge-Kutta method DOP853, of eight motions in the lanes of the processor.

Each lane has its own time, step and error. Component c of lane l stands in place 8 c + l. The
components are a coordinate and its rate, or the states of a flow; then tangent vectors of the
motion, of as many components.
[HairerNorsettWanner1993] section II.5 and II.10.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
import numpy.typing as npt

from phasekit.arrays import Array
from phasekit.motion.kernels import coefficients
from phasekit.numerics.compile import inline, routine
from phasekit.numerics.elementary import hypot
from phasekit.numerics.lanes import LANES, invoke

STAGES = 12
ROWS = 16
C, C_MORE = np.array(coefficients.TIMES), np.array(coefficients.TIMES_MORE)
#: Rows that are summed at a time.
TOGETHER = 4


def packed(sums: Sequence[dict[int, float]]) -> tuple[Array, npt.NDArray[np.int64]]:
    """Weights of sums and the rows they belong to, filled up with zeros."""
    most = -(-max(map(len, sums)) // TOGETHER) * TOGETHER
    weights, places = np.zeros((len(sums), most)), np.zeros((len(sums), most), np.int64)
    for row, one in enumerate(sums):
        weights[row, : len(one)], places[row, : len(one)] = list(one.values()), list(one)
    return weights, places


D = np.array([[one.get(place, 0.0) for place in range(ROWS)] for one in coefficients.DENSE])
#: Sums for the stages 1 to 11, for the end, for the stages 13 to 15 and for both errors.
WEIGHTS, PLACES = packed(coefficients.SUMS)
_, MORE, THIRD, FIFTH = 11, 12, 15, 16

#: Rows of limits: errors that are allowed, value from which on a coordinate is held as closely as
#: there, most steps; for steps by series, whether to take one alone, and to keep its series; and
#: how often as great the errors of tangent vectors may be. Of a flow two more a state, from `OWN`
#: on: that value, and the scale of its absolute error.
RTOL, ATOL, UNIT, MOST, ALONE, KEEP, BESIDE, OWN = range(8)

#: Error of a tangent vector, of its length, below which rounding hides it.
CLOSEST = 1e-14
#: Error of a motion that does not move, so that it is not divided by 0.
LEAST = 1e-150
#: Least and greatest change of the step, and what of the step that just fits is taken.
SHORTEST, LONGEST, SAFETY = 0.2, 10.0, 0.9


@inline
def drive_at(table: Array, t: float, z: Array, lane: int) -> None:
    """Value and slope at a time of a function in Chebyshev pieces.

    Rows of the table: start, half-width, number of coefficients, coefficients.
    """
    low, high = 0, table.shape[0]
    while high - low > 1:
        middle = (low + high) >> 1
        if table[middle, 0] <= t:
            low = middle
        else:
            high = middle
    half = table[low, 1]
    s = (t - table[low, 0]) / half - 1.0
    # Clenshaw, with that of the derivative.
    b1 = b2 = d1 = d2 = 0.0
    for j in range(int(table[low, 2]) - 1, 0, -1):
        d1, d2 = 2.0 * s * d1 - d2 + 2.0 * b1, d1
        b1, b2 = 2.0 * s * b1 - b2 + table[low, 3 + j], b1
    z[LANES + lane] = s * b1 - b2 + table[low, 3]
    z[2 * LANES + lane] = (b1 + s * d1 - d2) / half


@routine
def rates(
    address: int, table: Array, t: Array, h: Array, c: float, y: Array, p: Array, z: Array, k: Array
) -> None:
    """Rates of all lanes at the states y and the times t + c h."""
    for lane in range(LANES):
        z[lane] = t[lane] + c * h[lane]
    if table.shape[0] > 0:
        for lane in range(LANES):
            drive_at(table, z[lane], z, lane)
    invoke(address, y, p, z, k)


@routine
def add_up(which: int, k: Array, y: Array) -> None:
    """Y = weighted sum of rows of k."""
    for j in range(0, WEIGHTS.shape[1], TOGETHER):
        w0, w1, w2, w3 = (
            WEIGHTS[which, j],
            WEIGHTS[which, j + 1],
            WEIGHTS[which, j + 2],
            WEIGHTS[which, j + 3],
        )
        if j > 0 and w0 == 0.0:
            break
        k0, k1, k2, k3 = (
            k[PLACES[which, j]],
            k[PLACES[which, j + 1]],
            k[PLACES[which, j + 2]],
            k[PLACES[which, j + 3]],
        )
        if j == 0:
            for m in range(y.size):
                y[m] = (w0 * k0[m] + w1 * k1[m]) + (w2 * k2[m] + w3 * k3[m])
        else:
            for m in range(y.size):
                y[m] += (w0 * k0[m] + w1 * k1[m]) + (w2 * k2[m] + w3 * k3[m])


@inline
def state_of(which: int, x: Array, h: Array, k: Array, y: Array) -> None:
    """Y = x + h times a weighted sum of rows of k."""
    add_up(which, k, y)
    for m in range(x.size):
        y[m] = x[m] + h[m] * y[m]


@routine
def attempt(
    address: int, table: Array, t: Array, h: Array, x: Array, k: Array, y: Array, p: Array, z: Array
) -> None:
    """Try a step of every lane: k[0] are the rates at x, y becomes the end, k[12] its rates."""
    for i in range(1, STAGES + 1):
        state_of(i - 1, x, h, k, y)
        rates(address, table, t, h, C[i] if i < STAGES else 1.0, y, p, z, k[i])


@routine
def errors(
    h: Array,
    x: Array,
    y: Array,
    k: Array,
    unit: float,
    rtol: float,
    atol: float,
    beside: float,
    spare: Array,
    error: Array,
    size: Array,
) -> None:
    """Error of each lane's step over what is allowed.

    A coordinate beyond `unit` counts as `unit`, so that an angle which runs on is held as closely
    as at first. The absolute error is of a unit, on a line of the motion's size so far, where that
    is below 1: coordinates may be lengths in any unit; of a rate it is what adds up to that in the
    step, if that is longer than a second. A tangent vector is held against its length,
    the more closely the shorter the step is: the logs of lengths add up, so that what counts is the
    error in a second; that may be `beside` times as great.
    """
    third, fifth = spare[0], spare[1]
    add_up(THIRD, k, third)
    add_up(FIFTH, k, fifth)
    n = x.size // LANES
    for lane in range(LANES):
        e3 = e5 = 0.0
        rate = LANES + lane
        size[lane] = max(size[lane], max(abs(x[lane]), abs(x[rate])))
        own = unit if unit < np.inf else max(size[lane], max(abs(y[lane]), abs(y[rate])))
        least = max(atol * min(own, 1.0), LEAST)
        for c in range(n):
            m = c * LANES + lane
            if c < 2:
                scale = max(abs(x[m]), abs(y[m]))
                if c == 0 and scale > unit:
                    scale = unit
            else:
                other = m + LANES if c % 2 == 0 else m - LANES
                scale = max(hypot(x[m], x[other]), hypot(y[m], y[other]))
            allowed = rtol * scale
            if c == 0:
                allowed += least
            elif c == 1:
                allowed += least / max(1.0, abs(h[lane]))
            else:
                allowed = max((allowed + atol) * min(1.0, abs(h[lane])), CLOSEST * scale)
                allowed *= beside
            scale = 1.0 / allowed
            e3 += (third[m] * scale) ** 2
            e5 += (fifth[m] * scale) ** 2
        below = e5 + 0.01 * e3
        error[lane] = abs(h[lane]) * e5 / math.sqrt(below * n) if below > 0.0 else below


@routine
def errors_of_flow(
    h: Array, x: Array, y: Array, k: Array, limits: Array, spare: Array, error: Array, size: Array
) -> None:
    """The same of a flow, whose states follow the common limits with a unit and a scale each.

    The absolute error of a state is of its scale; without one (0) of the greatest state so far,
    where that is below 1.
    """
    third, fifth = spare[0], spare[1]
    add_up(THIRD, k, third)
    add_up(FIFTH, k, fifth)
    rtol, atol, beside = limits[RTOL, 0], limits[ATOL, 0], limits[BESIDE, 0]
    n, states = x.size // LANES, (limits.shape[0] - OWN) // 2
    for lane in range(LANES):
        e3 = e5 = 0.0
        for c in range(states):
            m = c * LANES + lane
            size[lane] = max(size[lane], max(abs(x[m]), abs(y[m])))
        allowed = 1.0
        for c in range(n):
            m = c * LANES + lane
            if c < states:
                scale = limits[OWN + 2 * c + 1, 0]
                least = scale if scale > 0.0 else min(size[lane], 1.0)
                reach = min(max(abs(x[m]), abs(y[m])), limits[OWN + 2 * c, 0])
                allowed = rtol * reach + max(atol * least, LEAST)
            elif c % states == 0:
                before = after = 0.0
                for i in range(states):
                    before += x[m + i * LANES] ** 2
                    after += y[m + i * LANES] ** 2
                scale = math.sqrt(max(before, after))
                allowed = max((rtol * scale + atol) * min(1.0, abs(h[lane])), CLOSEST * scale)
                allowed *= beside
            e3 += (third[m] / allowed) ** 2
            e5 += (fifth[m] / allowed) ** 2
        below = e5 + 0.01 * e3
        error[lane] = abs(h[lane]) * e5 / math.sqrt(below * n) if below > 0.0 else below


@inline
def next_step(error: float) -> float:
    """Factor by which a step may change that made an error over what is allowed."""
    if error == 0.0:
        return LONGEST
    # The eighth root; NaN and infinity come out as the least.
    factor = SAFETY / math.sqrt(math.sqrt(math.sqrt(error)))
    return min(LONGEST, max(SHORTEST, factor)) if factor > SHORTEST else SHORTEST


@routine
def densify(
    address: int, table: Array, t: Array, h: Array, x: Array, k: Array, y: Array, p: Array, z: Array
) -> None:
    """The three further stages from which states within the step follow; y is lost."""
    for i in range(3):
        state_of(MORE + i, x, h, k, y)
        rates(address, table, t, h, C_MORE[i], y, p, z, k[13 + i])


@inline
def within(s: float, h: float, x: Array, end: Array, k: Array, m: int) -> float:
    """Entry m of the state at the part s of a step, to the seventh order."""
    change = end[m] - x[m]
    first, last = h * k[0, m], h * k[12, m]
    total = 0.0
    for i in range(3, -1, -1):
        row = 0.0
        for j in range(ROWS):
            row += D[i, j] * k[j, m]
        total = (total + h * row) * (s if i % 2 == 1 else 1.0 - s)
    total = (total + 2.0 * change - last - first) * s
    total = (total + first - change) * (1.0 - s)
    total = (total + change) * s
    return x[m] + total
