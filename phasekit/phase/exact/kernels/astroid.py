"""Where a system stands against the fold: exact sign of the discriminant, and the gap.

For A, B, C >= 0 four equilibria exist iff B^(2/3) + C^(2/3) < A^(2/3), the inside of an
astroid, that is iff

    Delta = (B^2 + C^2 - A^2)^3 + 27 A^2 B^2 C^2 < 0.

Delta is computed in double-double arithmetic, with a bound on its error. Where the bound does
not decide the sign and the leading digits, the caller supplies Delta from exact arithmetic.
"""

from __future__ import annotations

import math

import numpy as np

from phasekit.numerics.compile import inline
from phasekit.numerics.double_double import dd_add, dd_multiply, two_product, two_sum
from phasekit.numerics.elementary import cbrt

# Inputs are scaled to [0, 4). The double-double result below is within 32 * 2^-104 of the sum of
# its terms; asking for 2^-48 of it leaves a relative error under 2^-50. Products that underflow
# lose at most 1e-290.
DECIDED = 2.0**-48
UNDERFLOW = 1e-280

LEAST = 5e-324


@inline
def discriminant(a: float, b: float, c: float) -> tuple[float, bool]:
    """Delta of a, b, c in [0, 4) and whether sign and 48 bits of it are certain."""
    big = b if b > c else c
    small = c if b > c else b
    # big^2 - a^2 as a product: no cancellation next to the cusps, where big = a.
    dh, dl = two_sum(big, -a)
    sh, sl = two_sum(big, a)
    ph, pl = dd_multiply(dh, dl, sh, sl)
    qh, ql = two_product(small, small)
    xh, xl = dd_add(ph, pl, qh, ql)
    x2h, x2l = dd_multiply(xh, xl, xh, xl)
    x3h, x3l = dd_multiply(x2h, x2l, xh, xl)
    abh, abl = two_product(a, big)
    yh, yl = dd_multiply(abh, abl, small, 0.0)
    y2h, y2l = dd_multiply(yh, yl, yh, yl)
    y3h, y3l = dd_multiply(y2h, y2l, 27.0, 0.0)
    delta, _ = dd_add(x3h, x3l, y3h, y3l)
    bound = DECIDED * (abs(x3h) + y3h) + UNDERFLOW
    # Without the product term the sign is that of big - a; big^2 - a^2 = 0 is then exact.
    flat = small == 0.0 or a == 0.0
    return delta, flat or abs(delta) > bound


@inline
def fold_margin(a: float, b: float, c: float, delta: float) -> tuple[float, float, float]:
    """1 - ((b^(2/3) + c^(2/3)) / a^(2/3))^(3/2), and the cube roots of b and c.

    With p, q, t = a^(2/3), b^(2/3), c^(2/3), X = q^3 + t^3 - p^3 and Y = 3 p q t,
    Delta = (q + t - p) (q^2 + t^2 + p^2 - q t + q p + t p) (X^2 - X Y + Y^2), where
    only the first factor can vanish.
    """
    root_b = cbrt(b)
    root_c = cbrt(c)
    p = cbrt(a) * cbrt(a)
    q = root_b * root_b
    t = root_c * root_c
    big = b if b > c else c
    small = c if b > c else b
    high = q if b > c else t
    low = t if b > c else q
    # The gap as a difference of two terms; where these cancel, next to the fold, from Delta.
    rise = (big - a) * (big + a) / (high * high + high * p + p * p)
    gap = rise + low
    x = (big - a) * (big + a) + small * small
    y = 3.0 * p * q * t
    cofactor = (q * q + t * t + p * p - q * t + q * p + t * p) * ((x - y) * x + y * y)
    gap = delta / cofactor if abs(gap) < 0.25 * (abs(rise) + low) else gap
    gap /= p
    ratio = (q + t) / p
    near = -gap * (1.0 + ratio + ratio * ratio) / (1.0 + ratio * np.sqrt(ratio))
    far = 1.0 - ratio * np.sqrt(ratio)
    margin = near if ratio > 0.25 and ratio < 4.0 else far
    # Its sign is that of -delta also where it underflows.
    least = 0.0 if delta == 0.0 else (LEAST if delta < 0.0 else -LEAST)
    margin = least if delta == 0.0 or margin == 0.0 else margin
    return (margin if a > 0.0 else -math.inf), root_b, root_c
