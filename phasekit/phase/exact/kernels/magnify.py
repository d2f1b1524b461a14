"""Orbits too small for their energies, brought to size by powers of two.

Next to phi = 0 doubles tell angles of 1e-300 apart, but the energies of motions there, squares and
fourth powers of them, underflow. So small, V' = (B - A) phi + A phi^3/2 - C, where only the first
power counts, or, if B = A, only the third one: angles, C and time can be multiplied by powers of
two so that this remains the equation of motion.
"""

from __future__ import annotations

import math

import numpy as np

from phasekit.arrays import Array
from phasekit.numerics.compile import inline, routine
from phasekit.numerics.elementary import cbrt, power_of_two_scale
from phasekit.phase.exact.kernels.levels import (
    ASYMPTOTE,
    ASYMPTOTIC,
    ENERGY,
    INVALID,
    MODE,
    NOT_COMPUTED,
    classify,
)
from phasekit.phase.exact.kernels.system import (
    CURVATURE,
    LARGEST,
    MULTIPLIER,
    PHI,
    PHI_LOW,
    UNIT,
    ZOOM,
    A,
    B,
    C,
)

# Angles below this are magnified to about that.
SMALL, SIZE = 2.0**-110, 2.0**-100


@inline
def enter(phi: float, dphi: float, valid: bool, w: Array) -> int:
    """Kind of the orbit through a state, as `classify`; the system may then be a magnified one."""
    unit = w[UNIT]
    scale = 1.0
    if valid and abs(phi) < SMALL and abs(w[C]) < SMALL:
        scale = magnify(phi, dphi, w)
    code = classify(phi * scale, dphi * scale, valid, w)
    w[ENERGY] = w[ENERGY] / unit / unit
    if w[MODE] == INVALID and code != NOT_COMPUTED:
        w[MODE] = ASYMPTOTE  # a saddle's energy, as far as doubles tell
        return ASYMPTOTIC
    return code


@routine
def magnify(phi: float, dphi: float, w: Array) -> float:
    """Magnify the system about a small orbit round phi = 0, and return by how much.

    NaN where no double would hold the unit of time.
    """
    bend = w[B] - w[A]
    cubic = bend == 0.0
    rate = abs(dphi * 2.0**400 * w[UNIT])
    if cubic:
        size = max(abs(phi), np.sqrt(rate) * 2.0**-200, cbrt(abs(w[C])))
    else:
        size = max(abs(phi), rate / np.sqrt(bend) * 2.0**-400, abs(w[C]) / bend)
    # At a saddle motion grows out of what is magnified; but at a cusp it takes no time elsewhere.
    if not (bend >= 0.0 and 0.0 < size < SMALL):
        return 1.0
    scale = power_of_two_scale(size) * SIZE
    w[C] *= scale
    if cubic:
        w[C] = w[C] * scale * scale
        w[UNIT] *= scale
    for j in range(4):
        if abs(w[PHI + j]) < SMALL:
            w[PHI + j] *= scale
            if cubic:
                w[CURVATURE + j] = w[CURVATURE + j] * scale * scale
        w[MULTIPLIER + 4 * j] = math.nan
        w[PHI_LOW + j] = math.nan
    w[ZOOM] = 1.0 / scale
    return scale if w[UNIT] <= LARGEST else math.nan
