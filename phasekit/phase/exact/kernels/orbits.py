"""One orbit: its frequency, action and turning points, whatever its kind."""

from __future__ import annotations

import math

import numpy as np

from phasekit.arrays import Array
from phasekit.numerics.compile import inline, routine
from phasekit.numerics.double_double import TWO_PI
from phasekit.phase.exact.kernels.action import SIZE, action
from phasekit.phase.exact.kernels.levels import (
    ANGLE,
    ASYMPTOTE,
    FREE,
    GAP,
    HARMONIC,
    MODE,
    RATE,
    REFERENCE,
    REST,
    START,
    SWING,
    TURN,
    TURNS,
)
from phasekit.phase.exact.kernels.shape import (
    ACTION,
    AMPLITUDE,
    HIGH,
    LEVELS,
    LOW,
    MEANS,
    OMEGA,
    PHI_MAX,
    PHI_MIN,
    PHI_S,
    S2,
    SIGMA,
    SLOPE,
    M,
    N,
    P,
    shape,
)
from phasekit.phase.exact.kernels.system import CURVATURE, PHI, UNIT, ZOOM, A, B, C, force

__all__ = ["ACTION", "AMPLITUDE", "OMEGA", "PHI_MAX", "PHI_MIN", "SIZE", "finish", "shape"]


# Rounding does not tell the ends of an orbit apart that are this close together on the circle.
ENDS = 1e-7


@inline
def reach(w: Array) -> tuple[float, float]:
    """Least and greatest angle of a motion on a separatrix, from saddle to saddle or turning point.

    On it k^2 z^2 - 2 S2 z - P >= 0, with the discriminant D = mu (A - mu).
    """
    k2 = -w[SLOPE]
    d = w[M] * w[N]
    half = 0.5 * (w[ANGLE] - w[PHI_S])
    x = np.float64(math.cos(half))
    y = np.float64(math.sin(half))
    if y < 0.0:
        x = -x
        y = -y
    if k2 == 0.0 and w[S2] != 0.0:
        right = w[S2] < 0.0
        z = -0.5 * w[P] / w[S2]
    elif k2 > 0.0 and d >= 0.0:
        # On the right of the saddle z is above the middle of both zeros.
        right = k2 * x > w[S2] * y
        big = w[S2] + np.sqrt(d) if w[S2] >= 0.0 else w[S2] - np.sqrt(d)
        if right == (w[S2] >= 0.0):
            z = big / k2
        else:
            z = -w[P] / big if big != 0.0 else 0.0
    else:
        return w[PHI_S], w[PHI_S] + TWO_PI
    turning = 2.0 * math.atan2(1.0, z)
    if right:
        return w[PHI_S], w[PHI_S] + turning
    return w[PHI_S] + turning - TWO_PI, w[PHI_S]


@inline
def small_frequency(w: Array) -> float:
    """Frequency of small oscillations about a state at rest that is a center, else 0."""
    c = np.float64(math.cos(w[ANGLE]))
    s = np.float64(math.sin(w[ANGLE]))
    slope = w[B] * c - w[A] * (c - s) * (c + s) + w[C] * s
    return np.sqrt(slope) if slope > 0.0 else 0.0


@inline
def reduced(angle: float, w: Array) -> float:
    """Angle of the system itself, where a magnified one is worked with."""
    if w[ZOOM] == 1.0:
        return angle
    turns = TWO_PI * np.rint(angle / TWO_PI)
    return turns + (angle - turns) * w[ZOOM]


@routine
def finish(w: Array) -> None:
    """Frequency, action and turning points from the shape, in the units that were given."""
    unit = w[UNIT]
    mode = w[MODE]
    j = int(w[REFERENCE])
    omega = math.nan
    area_ = math.nan
    low = math.nan
    high = math.nan
    sigma = w[ANGLE]
    if mode == SWING or mode == TURN:
        omega = w[MEANS + int(w[LEVELS])]
        area_ = action(w)
        if mode == SWING:
            low = w[LOW]
            high = w[HIGH]
            sigma = w[SIGMA]
    elif mode == HARMONIC:
        omega = np.sqrt(w[CURVATURE + j])
        area_ = w[GAP] / omega
        width = np.sqrt(2.0 * w[GAP]) / omega
        sigma = w[PHI + j]
        low = sigma - width
        high = sigma + width
    elif mode == FREE:
        omega = abs(w[RATE])
        area_ = omega
    elif mode == ASYMPTOTE:
        omega = 0.0
        low, high = reach(w)
        sigma = 0.5 * (low + high)
    elif mode == REST:
        omega = small_frequency(w)
        area_ = 0.0
        low = w[ANGLE]
        high = w[ANGLE]
    turns = np.rint((w[ANGLE] - sigma) / TWO_PI)
    if mode == SWING:
        rest = (w[ANGLE] - sigma) - turns * TWO_PI
        if abs(rest) > 0.5 * TWO_PI - ENDS:  # V' tells on which side of the saddle it is
            slope = force(w[ANGLE], w)
            turns += 1.0 if rest > 0.0 > slope else (-1.0 if rest < 0.0 < slope else 0.0)
    # Half the way between the ends is known better than they are, far round the circle.
    shift = turns * TWO_PI
    least, most = min(low + shift, w[ANGLE]), max(high + shift, w[ANGLE])
    w[AMPLITUDE] = 0.5 * (reduced(most, w) - reduced(least, w)) if low == low else math.nan
    turns += w[TURNS]
    w[OMEGA] = omega / unit
    w[ACTION] = area_ / unit * w[ZOOM] * w[ZOOM]
    if w[ZOOM] != 1.0 and (mode == TURN or high - low > 1.0):  # round the circle
        w[ACTION] = area_ / unit / w[ZOOM]
    # The state is on its orbit.
    w[PHI_MIN] = reduced(min(low + turns * TWO_PI, w[START]), w)
    w[PHI_MAX] = reduced(max(high + turns * TWO_PI, w[START]), w)
    if low != low:
        w[PHI_MIN] = math.nan
        w[PHI_MAX] = math.nan
