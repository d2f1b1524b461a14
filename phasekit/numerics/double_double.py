"""Double-double arithmetic: numbers as unevaluated sums of two doubles, some 32 digits.

What decides digits that doubles lose is computed in it: the sign of the discriminant, the energy
of a state against a separatrix, the frequency of a motion over many periods.
"""

from __future__ import annotations

import math
from fractions import Fraction

import numpy as np

from phasekit.numerics.compile import inline, routine

SPLITTER = 134217729.0  # 2^27 + 1 (Veltkamp)

# 2 pi as a sum of three doubles.
TWO_PI = 6.283185307179586
TWO_PI_LOW = 2.4492935982947064e-16
TWO_PI_LOWEST = -5.989539619436679e-33

# Cosines of multiples of pi/32 (high, low), computed in 80 digits.
COS_TABLE = (
    (1.0, 0.0),
    (0.9951847266721969, -4.248691367830441e-17),
    (0.9807852804032304, 1.8546939997825006e-17),
    (0.9569403357322088, 4.05538698618757e-17),
    (0.9238795325112867, 1.7645047084336677e-17),
    (0.881921264348355, -1.9843248405890562e-17),
    (0.8314696123025452, 1.4073856984728024e-18),
    (0.773010453362737, -3.256590703364977e-17),
    (0.7071067811865476, -4.833646656726457e-17),
    (0.6343932841636455, 1.0420901929280035e-17),
    (0.5555702330196022, 4.709410940561677e-17),
    (0.47139673682599764, 6.516678136069013e-18),
    (0.3826834323650898, -1.0050772696461588e-17),
    (0.2902846772544624, -1.892797870777425e-17),
    (0.19509032201612828, -7.991079068461731e-18),
    (0.0980171403295606, -1.634582362244256e-18),
    (0.0, 0.0),
)


def _reciprocal_factorial(n: int) -> tuple[float, float]:
    exact = Fraction((-1) ** (n // 2), math.factorial(n))
    return float(exact), float(exact - Fraction(float(exact)))


# Taylor coefficients of sin(r)/r and cos(r) in r^2: below pi/64 the first need all digits.
SIN_3, SIN_5, SIN_7 = (_reciprocal_factorial(n) for n in (3, 5, 7))
SIN_9, SIN_11, SIN_13, SIN_15 = (_reciprocal_factorial(n)[0] for n in (9, 11, 13, 15))
COS_4, COS_6, COS_8 = (_reciprocal_factorial(n) for n in (4, 6, 8))
COS_10, COS_12, COS_14, COS_16 = (_reciprocal_factorial(n)[0] for n in (10, 12, 14, 16))

# Beyond this angle its own rounding is far more than what the digits below would add.
LARGEST_ANGLE = 1e8


@inline
def two_sum(a: float, b: float) -> tuple[float, float]:
    """Sum a + b as an unevaluated sum of two doubles, exactly."""
    s = a + b
    v = s - a
    return s, (a - (s - v)) + (b - v)


@inline
def two_product(a: float, b: float) -> tuple[float, float]:
    """Product a * b as an unevaluated sum of two doubles, exactly (without underflow)."""
    p = a * b
    t = SPLITTER * a
    ah = t - (t - a)
    al = a - ah
    t = SPLITTER * b
    bh = t - (t - b)
    bl = b - bh
    return p, ((ah * bh - p) + ah * bl + al * bh) + al * bl


@inline
def dd_add(ah: float, al: float, bh: float, bl: float) -> tuple[float, float]:
    """Sum of two double-doubles; relative error 3 * 2^-104 even where it cancels."""
    sh, se = two_sum(ah, bh)
    th, te = two_sum(al, bl)
    h, e = two_sum(sh, se + th)
    return two_sum(h, te + e)


@inline
def dd_multiply(ah: float, al: float, bh: float, bl: float) -> tuple[float, float]:
    """Product of two double-doubles; relative error 8 * 2^-104."""
    p, e = two_product(ah, bh)
    e += ah * bl + al * bh
    return two_sum(p, e)


@inline
def dd_divide(ah: float, al: float, bh: float, bl: float) -> tuple[float, float]:
    """Quotient of two double-doubles, the second not 0; relative error 2^-100 or so."""
    q = ah / bh
    ph, pl = dd_multiply(bh, bl, q, 0.0)
    rh, rl = dd_add(ah, al, -ph, -pl)
    return two_sum(q, (rh + rl) / bh)


@inline
def dd_sqrt(h: float, low: float) -> tuple[float, float]:
    """Square root of a double-double > 0; relative error 2^-103 or so; 0 gives 0."""
    s = np.sqrt(h)
    p, e = two_product(s, s)
    r = ((h - p) - e + low) / (2.0 * s if s > 0.0 else 1.0)
    return two_sum(s, r)


@routine
def reduce_angle(h: float, low: float) -> tuple[float, float, float]:
    """Angle in [-pi, pi] as a double-double, and the number of turns that were taken off.

    Beyond 2^53 turns a double does not say where on the circle it is; any point will do.
    """
    if not abs(h) < 5e16:
        return (h % TWO_PI if abs(h) < math.inf else 0.0), 0.0, np.float64(h) / TWO_PI
    turns = np.rint(h / TWO_PI)
    p, e = two_product(turns, TWO_PI)
    q, f = two_product(turns, TWO_PI_LOW)
    rh, rl = two_sum(h, -p)
    rh, rl = dd_add(rh, rl, low, 0.0)
    rh, rl = dd_add(rh, rl, -e, 0.0)
    rh, rl = dd_add(rh, rl, -q, -f)
    rh, rl = dd_add(rh, rl, -turns * TWO_PI_LOWEST, 0.0)
    return rh, rl, turns


@routine
def dd_cos_sin(phi: float, low: float = 0.0) -> tuple[float, float, float, float]:
    """Cosine and sine of a double-double as double-doubles, absolute error 1e-31 below 1e8.

    The sine of a small angle has a relative error of that size.
    """
    if not abs(phi) < LARGEST_ANGLE:
        return np.float64(math.cos(phi)), 0.0, np.float64(math.sin(phi)), 0.0
    ah, al, _ = reduce_angle(phi, low)
    # The nearest multiple of pi/32, and what remains.
    steps = np.rint(ah * (64.0 / TWO_PI))
    p, e = two_product(steps, TWO_PI / 64.0)
    q, f = two_product(steps, TWO_PI_LOW / 64.0)
    rh, rl = two_sum(ah, -p)
    rh, rl = dd_add(rh, rl, al, -e)
    rh, rl = dd_add(rh, rl, -q, -f)
    rl -= steps * (TWO_PI_LOWEST / 64.0)
    th, tl = dd_multiply(rh, rl, rh, rl)
    # sin(r) = r + r^3 (...)
    tail = SIN_9 + th * (SIN_11 + th * (SIN_13 + th * SIN_15))
    ph, pl = two_sum(SIN_7[0], SIN_7[1] + th * tail)
    ph, pl = dd_multiply(ph, pl, th, tl)
    ph, pl = dd_add(ph, pl, SIN_5[0], SIN_5[1])
    ph, pl = dd_multiply(ph, pl, th, tl)
    ph, pl = dd_add(ph, pl, SIN_3[0], SIN_3[1])
    ph, pl = dd_multiply(ph, pl, th, tl)
    ph, pl = dd_multiply(ph, pl, rh, rl)
    sh, sl = dd_add(rh, rl, ph, pl)
    # cos(r) = 1 - r^2/2 + r^4 (...)
    tail = COS_10 + th * (COS_12 + th * (COS_14 + th * COS_16))
    ph, pl = two_sum(COS_8[0], COS_8[1] + th * tail)
    ph, pl = dd_multiply(ph, pl, th, tl)
    ph, pl = dd_add(ph, pl, COS_6[0], COS_6[1])
    ph, pl = dd_multiply(ph, pl, th, tl)
    ph, pl = dd_add(ph, pl, COS_4[0], COS_4[1])
    ph, pl = dd_multiply(ph, pl, th, tl)
    ph, pl = dd_add(ph, pl, -0.5, 0.0)
    ph, pl = dd_multiply(ph, pl, th, tl)
    ch, cl = dd_add(1.0, 0.0, ph, pl)
    # Add the angle j pi/32 of the table, then the quarter turns.
    k = np.int64(steps) & 63
    j = k & 15
    kh, kl = COS_TABLE[j]
    mh, ml = COS_TABLE[16 - j]
    ph, pl = dd_multiply(ch, cl, kh, kl)
    qh, ql = dd_multiply(sh, sl, mh, ml)
    xh, xl = dd_add(ph, pl, -qh, -ql)
    ph, pl = dd_multiply(ch, cl, mh, ml)
    qh, ql = dd_multiply(sh, sl, kh, kl)
    yh, yl = dd_add(ph, pl, qh, ql)
    quarter = k >> 4
    if quarter == 0:
        return xh, xl, yh, yl
    if quarter == 1:
        return -yh, -yl, xh, xl
    if quarter == 2:
        return -xh, -xl, -yh, -yl
    return yh, yl, -xh, -xl
