"""Elementary functions without branches or library calls, so that loops over them vectorise."""

from __future__ import annotations

import math

import numpy as np

from phasekit.numerics.compile import inline

PI = math.pi
PI_LOW = 1.2246467991473532e-16  # pi - PI
HALF_PI_LOW = 0.5 * PI_LOW
TAN_EIGHTH_PI = math.tan(math.pi / 8)

# (atan(t)/t - 1)/t^2 as a polynomial in t^2: interpolation at the Chebyshev nodes of
# [0, tan(pi/8)^2] in 40 digits, relative error of atan below 5e-18.
ATAN = (
    -0.3333333333333333,
    0.1999999999999552,
    -0.14285714284666542,
    0.11111111015256361,
    -0.09090904578123903,
    0.07692183190826087,
    -0.06664511447381948,
    0.0585814891280221,
    -0.0508544973794026,
    0.03923165829558719,
    -0.01917688711906226,
)

# (atanh(t)/t - 1)/t^2 likewise on [0, tan(pi/8)^2], relative error of atanh below 5e-18.
ATANH = (
    0.3333333333333335,
    0.19999999999949655,
    0.1428571431303169,
    0.11111105560224649,
    0.09091445085156985,
    0.07665843434319214,
    0.07308439459514911,
)
HALF_LOG_2 = 0.5 * math.log(2.0)
BITS_OF_ROOT_HALF = 0x3FE6A09E667F3BCD


@inline
def power_of_two_scale(x: float) -> float:
    """Power of two that brings x > 0 into [1, 2) (as close as the exponent range allows)."""
    exponent = (np.float64(x).view(np.int64) >> 52) & 0x7FF
    inverse = 2046 - exponent if exponent < 2046 else 1
    return np.int64(inverse << 52).view(np.float64)


@inline
def inverse_cbrt(x: float, steps: int) -> float:
    """x^(-1/3) for 2^-600 <= x < 2^300 without division: three digits a step, sixteen in three."""
    # A third of the exponent, negated, gives 4 % accuracy; each step triples the digits.
    third = np.float64(np.float64(x).view(np.int64)) * (1.0 / 3.0)
    y = np.int64(0x553EF0FF289DD796 - np.int64(third)).view(np.float64)
    for _ in range(steps):
        h = 1.0 - x * (y * y * y)
        y += y * h * (1.0 / 3.0 + (2.0 / 9.0) * h)
    return y


@inline
def cbrt(x: float) -> float:
    """Cube root of 0 <= x < 2^300 to about one unit in the last place."""
    small = x < 2.0**-600
    z = x * 2.0**600 if small else x
    y = inverse_cbrt(z, 3)
    y2 = y * y
    r = z * y2
    r -= (r * r * r - z) * (y2 * (1.0 / 3.0))
    r = r * 2.0**-200 if small else r
    return r if x > 0.0 else x


@inline
def angle_quadrant(y: float, x: float) -> float:
    """atan2(y, x) for y >= 0 and x >= 0; 0 where both vanish."""
    low = y if y < x else x
    high = x if y < x else y
    steep = low > TAN_EIGHTH_PI * high
    top = low - high if steep else low
    bottom = low + high if steep else (high if high > 0.0 else 1.0)
    t = top / bottom
    s = t * t
    p = ATAN[10]
    for j in range(9, -1, -1):
        p = p * s + ATAN[j]
    angle = t + t * s * p
    angle = 0.25 * PI + (angle + 0.5 * HALF_PI_LOW) if steep else angle
    return (0.5 * PI - angle) + HALF_PI_LOW if y > x else angle


@inline
def angle_half(y: float, x: float) -> float:
    """atan2(y, x) for y >= 0, in [0, pi]; 0 where both vanish."""
    angle = angle_quadrant(y, abs(x))
    return (PI - angle) + PI_LOW if x < 0.0 else angle


@inline
def atanh(z: float, rest: float) -> float:
    """Inverse hyperbolic tangent of 0 <= z < 1; rest = 1 - z^2, given without cancellation."""
    # atanh z = log(r)/2 with r = (1 + z)^2/rest = 2^e f, and log f = 2 atanh((f - 1)/(f + 1)).
    bits = np.float64((1.0 + z) * (1.0 + z) / rest).view(np.int64)
    e = (bits - BITS_OF_ROOT_HALF) >> 52
    f = np.int64(bits - (e << 52)).view(np.float64)
    t = z if e == 0 else (f - 1.0) / (f + 1.0)
    s = t * t
    p = ATANH[6]
    for j in range(5, -1, -1):
        p = p * s + ATANH[j]
    return HALF_LOG_2 * np.float64(e) + (t + t * s * p)


@inline
def hypot(x: float, y: float) -> float:
    """Length of (x, y), without overflow on the way; Python's own differs between its versions."""
    x = abs(x)
    y = abs(y)
    large = x if x >= y else y
    small = y if x >= y else x
    ratio = small / large if 0.0 < large < np.inf else 0.0
    return large * np.sqrt(1.0 + ratio * ratio) if small == small else small


@inline
def wrap(angle: float) -> float:
    """Bring an angle of (-3 pi, 3 pi) into (-pi, pi]."""
    lower = (angle - 2.0 * PI) - 2.0 * PI_LOW
    upper = (angle + 2.0 * PI) + 2.0 * PI_LOW
    return lower if angle > PI else (upper if angle < -PI else angle)
