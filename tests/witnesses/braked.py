"""Rotations that a torque brakes, by leapfrog with exact damping."""

import numba
import numpy as np


@numba.njit
def pull(A, B, C, x):
    return (A * np.cos(x) - B) * np.sin(x) + C * np.cos(x)


@numba.njit
def height(A, B, C, x):
    return (0.5 * A * np.cos(x) - B) * np.cos(x) - C * np.sin(x)


@numba.njit
def fates(abc, torque, damping, speeds, phases, longest, step, caught, fast):
    """Of each: 1 once its energy is below `caught`, -1 once it rotates back so fast, else 0.

    Besides its angle then.
    """
    A, B, C = abc
    found, at = np.zeros(len(speeds), np.int64), np.zeros(len(speeds))
    keep = np.exp(-damping * step)
    sense = -1.0 if torque > 0.0 else 1.0  # of the rotation that is braked
    for i in range(len(speeds)):
        x, v = phases[i], sense * speeds[i]
        for _ in range(int(longest / step)):
            v += 0.5 * step * (torque + pull(A, B, C, x))
            x += 0.5 * step * v
            v *= keep
            x += 0.5 * step * v
            v += 0.5 * step * (torque + pull(A, B, C, x))
            if sense * v < -fast:
                found[i] = -1
                break
            if 0.5 * v * v + height(A, B, C, x) < caught:
                found[i] = 1
                break
        at[i] = x
    return found, at
