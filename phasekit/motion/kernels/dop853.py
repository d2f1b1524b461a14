"""One step of the Runge-Kutta method DOP853, of eight motions in the lanes of the processor.

Each lane has its own time, step and error. Component c of lane l stands in place 8 c + l. The
components come in pairs, the coordinate and its rate, then tangent vectors of the motion.
[HairerNorsettWanner1993] section II.5 and II.10.
"""

from __future__ import annotations

import math

import numpy as np
from scipy.integrate import DOP853

from phasekit.numerics.compile import Array, inline, routine
from phasekit.numerics.lanes import LANES, invoke

STAGES = 12
ROWS = 16
A, B, C = np.ascontiguousarray(DOP853.A), np.ascontiguousarray(DOP853.B), DOP853.C.copy()
A_MORE, C_MORE = np.ascontiguousarray(DOP853.A_EXTRA), DOP853.C_EXTRA.copy()
E3, E5 = DOP853.E3.copy(), DOP853.E5.copy()
D = np.ascontiguousarray(DOP853.D)

#: Least and greatest change of the step, and what of the step that just fits is taken.
SHORTEST, LONGEST, SAFETY = 0.2, 10.0, 0.9
ORDER = 8


@inline
def drive_at(table: Array, t: float, z: Array, lane: int) -> None:
    """Time, and the value and slope at it of a function in Chebyshev pieces.

    Rows of the table: start, half-width, number of coefficients, coefficients.
    """
    z[lane] = t
    pieces = table.shape[0]
    if pieces == 0:
        return
    low, high = 0, pieces
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
        drive_at(table, t[lane] + c * h[lane], z, lane)
    invoke(address, y, p, z, k)


@inline
def stage(i: int, x: Array, h: Array, k: Array, y: Array) -> None:
    """State of a stage from the rates of those before."""
    for m in range(x.size):
        total = A[i, 0] * k[0, m]
        for j in range(1, i):
            if A[i, j] != 0.0:
                total += A[i, j] * k[j, m]
        y[m] = x[m] + h[m] * total


@routine
def attempt(
    address: int, table: Array, t: Array, h: Array, x: Array, k: Array, y: Array, p: Array, z: Array
) -> None:
    """Try a step of every lane: k[0] are the rates at x, y becomes the end, k[12] its rates."""
    stage(1, x, h, k, y)
    rates(address, table, t, h, C[1], y, p, z, k[1])
    stage(2, x, h, k, y)
    rates(address, table, t, h, C[2], y, p, z, k[2])
    stage(3, x, h, k, y)
    rates(address, table, t, h, C[3], y, p, z, k[3])
    stage(4, x, h, k, y)
    rates(address, table, t, h, C[4], y, p, z, k[4])
    stage(5, x, h, k, y)
    rates(address, table, t, h, C[5], y, p, z, k[5])
    stage(6, x, h, k, y)
    rates(address, table, t, h, C[6], y, p, z, k[6])
    stage(7, x, h, k, y)
    rates(address, table, t, h, C[7], y, p, z, k[7])
    stage(8, x, h, k, y)
    rates(address, table, t, h, C[8], y, p, z, k[8])
    stage(9, x, h, k, y)
    rates(address, table, t, h, C[9], y, p, z, k[9])
    stage(10, x, h, k, y)
    rates(address, table, t, h, C[10], y, p, z, k[10])
    stage(11, x, h, k, y)
    rates(address, table, t, h, 1.0, y, p, z, k[11])
    for m in range(x.size):
        total = 0.0
        for j in range(STAGES):
            if B[j] != 0.0:
                total += B[j] * k[j, m]
        y[m] = x[m] + h[m] * total
    rates(address, table, t, h, 1.0, y, p, z, k[12])


@routine
def errors(
    h: Array, x: Array, y: Array, k: Array, unit: float, rtol: float, atol: float, size: Array
) -> None:
    """Error of each lane's step over what is allowed.

    A coordinate beyond `unit` counts as `unit`, so that an angle which runs on is held as closely
    as at first. A tangent vector is held against its length.
    """
    third, fifth = np.zeros(LANES), np.zeros(LANES)
    n = x.size // LANES
    for c in range(n):
        for lane in range(LANES):
            m = c * LANES + lane
            e3 = e5 = 0.0
            for j in range(STAGES):
                if E3[j] != 0.0:
                    e3 += E3[j] * k[j, m]
                if E5[j] != 0.0:
                    e5 += E5[j] * k[j, m]
            if c < 2:
                scale = max(abs(x[m]), abs(y[m]))
                if c == 0 and scale > unit:
                    scale = unit
            else:
                other = m + LANES if c % 2 == 0 else m - LANES
                scale = max(math.hypot(x[m], x[other]), math.hypot(y[m], y[other]))
            scale = 1.0 / (atol + rtol * scale)
            third[lane] += (e3 * scale) ** 2
            fifth[lane] += (e5 * scale) ** 2
    for lane in range(LANES):
        below = fifth[lane] + 0.01 * third[lane]
        size[lane] = abs(h[lane]) * fifth[lane] / math.sqrt(below * n) if below > 0.0 else below


@inline
def next_step(error: float) -> float:
    """Factor by which a step may change that made an error over what is allowed."""
    if error == 0.0:
        return LONGEST
    # NaN and infinity come out as the least.
    factor = SAFETY * error ** (-1.0 / ORDER)
    return min(LONGEST, max(SHORTEST, factor)) if factor > SHORTEST else SHORTEST


@routine
def densify(
    address: int, table: Array, t: Array, h: Array, x: Array, k: Array, y: Array, p: Array, z: Array
) -> None:
    """The three further stages from which states within the step follow; y is lost."""
    for i in range(3):
        for m in range(x.size):
            total = 0.0
            for j in range(STAGES + 1 + i):
                total += A_MORE[i, j] * k[j, m]
            y[m] = x[m] + h[m] * total
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
