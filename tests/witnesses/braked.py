"""Rotations of a pendulum that a torque brakes, by leapfrog with exact damping."""

import numba
import numpy as np


@numba.njit
def captured(torque, damping, speeds, phases, longest, step):
    """Of each: 1 once it librates, -1 once it rotates backwards, 0 while neither is so."""
    found = np.zeros(len(speeds), np.int64)
    keep = np.exp(-damping * step)
    for i in range(len(speeds)):
        x, v = phases[i], speeds[i]
        for _ in range(int(longest / step)):
            v += 0.5 * step * (torque - np.sin(x))
            x += 0.5 * step * v
            v *= keep
            x += 0.5 * step * v
            v += 0.5 * step * (torque - np.sin(x))
            if v < -2.4:
                found[i] = -1
                break
            if 0.5 * v * v - np.cos(x) < 0.8:
                found[i] = 1
                break
    return found
