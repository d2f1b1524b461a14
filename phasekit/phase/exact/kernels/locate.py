"""Where a libration or rotation is at a phase."""

from __future__ import annotations

import math

import numpy as np

from phasekit.arrays import Array
from phasekit.numerics.agm import amplitude
from phasekit.numerics.compile import inline
from phasekit.phase.exact.kernels.levels import MODE, SWING, TURN
from phasekit.phase.exact.kernels.shape import (
    HIGH,
    LEVELS,
    LOW,
    MEANS,
    PHI_S,
    PHI_S_LOW,
    RATIO,
    SIGMA,
    SKEW,
    SPAN,
    U,
)


@inline
def locate(sine: float, cosine: float, w: Array) -> tuple[float, float]:
    """Angle and |angular velocity| at the phase with this sine and cosine.

    Far from the middle of a libration the angle is measured from the nearer turning point.
    """
    sn, cn, delta = amplitude(sine, cosine, MEANS, int(w[LEVELS]), w)
    ratio = w[RATIO]
    skew = w[SKEW]
    if w[MODE] == SWING:  # squares of cosine and sine of psi/2, whose difference is cn
        big = 0.5 * (1.0 + abs(cn))
        small = 0.25 * sn * sn / big
        near = big if cn > 0.0 else small
        far = small if cn > 0.0 else big
        top = cn + skew * far if skew < 0.5 else near - ratio * far
        bottom = near + ratio * far
        rate = -2.0 * sn
    else:  # cosine and sine of psi/2, whose sum and difference have the product cn
        big = np.sqrt(0.5 * (1.0 + abs(cn)))
        small = 0.5 * abs(sn) / big
        near = big if cn >= 0.0 else small
        far = small if cn >= 0.0 else big
        both = near + far
        rest = cn / both  # near - far
        top = skew * near + rest if sn >= 0.0 else skew * near + both
        bottom = skew * near + both if sn >= 0.0 else skew * near + rest
        top = -top
        rate = 2.0
    u = w[U]
    if w[MODE] == TURN:  # next to the slow point, from the reference
        sine = far if sn >= 0.0 else -far
        reach = 2.0 * u * sine
        rest = (1.0 + u * u) * ratio * near + (1.0 - u * u) * sine
        if abs(reach) < 0.1 * rest:
            rate *= u * ratio * delta / (bottom * bottom + u * top * (u * top))
            o = w[SPAN] + 2.0 * math.atan2(reach, rest)
            return w[PHI_S] + (o + w[PHI_S_LOW]), rate
    rate *= u * ratio * delta / (bottom * bottom + u * top * (u * top))
    if w[MODE] == SWING and abs(top) * max(u, 1.0) > 0.5 * bottom:
        if top > 0.0:
            reach = 2.0 * ratio * far
            return w[HIGH] - 2.0 * math.atan2(reach, bottom / u + u * top), rate
        return w[LOW] + 2.0 * math.atan2(2.0 * near, bottom / u - u * top), rate
    return w[SIGMA] + 2.0 * math.atan2(u * top, bottom), rate
