"""Extremes of V': the torques beyond which no equilibrium exists.

They are zeros of V'', which is V' of another system: with phi = theta + pi/4,
``V''(phi; A, B, C) = V'(theta; -2 A, (C - B)/sqrt 2, -(B + C)/sqrt 2)``. Between two neighboring
ones V' is monotone, so that it takes each value once or not at all.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from phasekit.arrays import Array
from phasekit.phase.exact.phase_space import equilibria
from phasekit.phase.exact.potential import gradient


class CriticalTorque(NamedTuple):
    """Least and greatest V'; the last axis is the direction (minus, plus)."""

    critical_torque: Array
    critical_phi: Array


def inflections(A: npt.ArrayLike, B: npt.ArrayLike, C: npt.ArrayLike) -> Array:
    """Zeros of V'' in ascending order on a last axis of length 4, NaN where there are fewer."""
    A, B, C = (np.asarray(x, float) for x in (A, B, C))
    half = np.sqrt(0.5)
    theta = equilibria(-2.0 * A, (C - B) * half, -(B + C) * half).phi
    phi = theta + 0.25 * np.pi
    return np.sort(np.where(phi > np.pi, phi - 2.0 * np.pi, phi), axis=-1)


def critical_torque(A: npt.ArrayLike, B: npt.ArrayLike, C: npt.ArrayLike) -> CriticalTorque:
    """Smallest and largest constant torque for which an equilibrium exists.

    Signed torques, and the angles where the equilibria merge; 0 and NaN without force.
    """
    A, B, C = (np.asarray(x, float)[..., None] for x in (A, B, C))
    at = inflections(A[..., 0], B[..., 0], C[..., 0])
    with np.errstate(all="ignore"):
        slope = np.where(np.isnan(at), np.nan, gradient(A, B, C, at))
        known = np.isfinite(slope).any(axis=-1, keepdims=True)
        low = np.where(known, np.where(np.isnan(slope), np.inf, slope), 0.0)
        high = np.where(known, np.where(np.isnan(slope), -np.inf, slope), 0.0)
    ends = [
        np.take_along_axis(slope, which[..., None], -1)[..., 0]
        for which in (low.argmin(-1), high.argmax(-1))
    ]
    places = [
        np.take_along_axis(at, which[..., None], -1)[..., 0]
        for which in (low.argmin(-1), high.argmax(-1))
    ]
    free = ((A == 0.0) & (B == 0.0) & (C == 0.0))[..., 0]
    torque = np.stack(np.broadcast_arrays(*(np.where(free, 0.0, end) for end in ends)), axis=-1)
    return CriticalTorque(torque, np.stack(places, axis=-1))
