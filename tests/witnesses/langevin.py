"""Escape out of a well by simulated paths, from core to core."""

import numba
import numpy as np


@numba.njit
def first_times(A, B, C, torque, damping, kT, start, ends, bottoms, number, step, longest, seed):
    """Times at which paths first come to rest beyond either end; negative on the left.

    At rest: by less than kT above the bottom of the well that lies there.
    """
    np.random.seed(seed)  # noqa: NPY002
    keep = np.exp(-damping * step)
    kick = np.sqrt(kT * (1.0 - keep * keep))
    times = np.full(number, np.inf)
    for i in range(number):
        x, v = start, np.sqrt(kT) * np.random.normal()  # noqa: NPY002
        f = -(B - A * np.cos(x)) * np.sin(x) + C * np.cos(x) + torque
        for j in range(int(longest / step)):
            v += 0.5 * step * f
            x += 0.5 * step * v
            v = keep * v + kick * np.random.normal()  # noqa: NPY002
            x += 0.5 * step * v
            c, s = np.cos(x), np.sin(x)
            f = -(B - A * c) * s + C * c + torque
            v += 0.5 * step * f
            if x < ends[0] or x > ends[1]:
                way = 1 if x > ends[1] else 0
                h = 0.5 * v * v - B * c + 0.5 * A * c * c - C * s - torque * x
                if h < bottoms[way] + kT:
                    times[i] = (j + 1) * step * (2 * way - 1)
                    break
    return times


def rates(times, begin, longest):
    """Rates to the left and right with their standard errors, of the paths left at a time."""
    on = np.abs(times) > begin
    total = (np.minimum(np.abs(times[on]), longest) - begin).sum()
    counts = [(on & (times < 0.0)).sum(), (on & (times > 0.0) & np.isfinite(times)).sum()]
    return [(n / total, np.sqrt(n) / total) for n in counts]
