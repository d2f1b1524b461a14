"""Slow motions of overdamped systems in equal steps."""

from __future__ import annotations

import numpy as np

from phasekit.arrays import Array
from phasekit.motion.kernels.motions import rates_at
from phasekit.numerics.compile import kernel


@kernel
def speed(
    address: int, parameters: Array, kink: int, t: float, x: Array, lapse: float, damping: float,
    out: Array,
) -> None:  # fmt: skip
    """Rates of slow motions, up to the third power of the time in which damping acts.

    Rates change within a ``lapse`` along them.
    """
    count = x.size
    table, times, signs = np.zeros((0, 3)), np.empty(count), np.zeros(count)
    states, partials = np.zeros((count, 6)), np.empty((count, 6))
    sides = np.empty((3, count))
    for side in range(3):  # here, later and earlier
        ahead = 0.0 if side == 0 else (lapse if side == 1 else -lapse)
        for i in range(count):
            times[i] = t + ahead
            # With the tangent vectors of the coordinate and the rate.
            states[i, 0] = x[i] if side == 0 else x[i] + ahead * sides[0, i]
            states[i, 2], states[i, 5] = 1.0, 1.0
        rates_at(address, table, times, states, parameters, signs, kink, 0, count, partials)
        for i in range(count):
            sides[side, i] = -partials[i, 1] / partials[i, 5]
    for i in range(count):
        change = (sides[1, i] - sides[2, i]) / (2.0 * lapse)
        out[i] = sides[0, i] - change / damping


@kernel
def slow_path(
    address: int, parameters: Array, kink: int, h: float, lapse: float, damping: float, path: Array
) -> None:
    """Fill rows of a path, shape (times, motions), from its first one by steps of fourth order."""
    count = path.shape[1]
    a, b, c = np.empty(count), np.empty(count), np.empty(count)
    d, x = np.empty(count), np.empty(count)
    for step in range(path.shape[0] - 1):
        t, at = step * h, path[step]
        speed(address, parameters, kink, t, at, lapse, damping, a)
        for i in range(count):
            x[i] = at[i] + 0.5 * h * a[i]
        speed(address, parameters, kink, t + 0.5 * h, x, lapse, damping, b)
        for i in range(count):
            x[i] = at[i] + 0.5 * h * b[i]
        speed(address, parameters, kink, t + 0.5 * h, x, lapse, damping, c)
        for i in range(count):
            x[i] = at[i] + h * c[i]
        speed(address, parameters, kink, t + h, x, lapse, damping, d)
        for i in range(count):
            path[step + 1, i] = at[i] + h / 6.0 * (a[i] + 2.0 * b[i] + 2.0 * c[i] + d[i])
