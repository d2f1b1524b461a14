"""All equilibria of a system: how many, each from its own bracket, step by step.

For A, B, C >= 0 four exist iff B^(2/3) + C^(2/3) < A^(2/3), the inside of an astroid, that is iff

    Delta = (B^2 + C^2 - A^2)^3 + 27 A^2 B^2 C^2 < 0.

Delta is computed in double-double arithmetic, with a bound on its error. Where the bound does
not decide the sign and the leading digits, the caller supplies Delta from exact arithmetic.

With cos phi = B/mu and sin phi = C/(mu - A) the equilibria are the roots of the secular
equation B^2/mu^2 + C^2/(mu - A)^2 = 1. In the distance nu from the nearest pole it reads

    (p/nu)^2 + (q/(a + nu))^2 = 1   beyond the poles ("outer": one root), and
    (p/nu)^2 + (q/(a - nu))^2 = 1   between them ("inner": one root on that pole's side),

where p is the coefficient that belongs to that pole and q the other one. So two functions find
the global minimum and maximum, and the upper center and lower saddle. Both return (s, f, slope):
sine s and cosine f of the angle from the pole's axis, and the slope of the force there, |V''|.

No branch, no trigonometric function: the starts are close enough for a fixed number of Newton
steps on every input, which the tests measure over 40 orders of magnitude.

A step does the arithmetic of one column ``i`` of a block: a flat work array ``w`` with one
quantity a row, whose rows start at the offsets named below. Steps are run over all columns of a
block, which LLVM turns into vector code; a single system is a block of one column.
"""

from __future__ import annotations

import math
from fractions import Fraction

import numpy as np

from phasekit.arrays import Array
from phasekit.errors import EquilibriumKind
from phasekit.numerics.compile import Outputs, inline
from phasekit.numerics.double_double import dd_add, dd_multiply, two_product, two_sum
from phasekit.numerics.elementary import (
    PI,
    PI_LOW,
    angle_quadrant,
    cbrt,
    inverse_cbrt,
    power_of_two_scale,
)

BLOCK = 128

# Order of the equilibria.
LOWER_CENTER, LOWER_SADDLE, UPPER_CENTER, UPPER_SADDLE = range(4)

# Rows of a system: coefficients as given, the reduced system (A, B, C >= 0, scaled to [0, 4)),
# its unit, discriminant, fold margin, cube roots of B and C, number of equilibria.
A0, B0, C0, A, B, C, UNIT, DELTA, MARGIN, ROOT_B, ROOT_C, COUNT = range(0, 12 * BLOCK, BLOCK)
# Rows of a point, four of each: |cos|, |sin| and |V''| in the reduced system; then results.
X, Y, SLOPE, KIND, PHI, ENERGY, CURVATURE, FREQUENCY, EXPONENT = range(
    12 * BLOCK, 48 * BLOCK, 4 * BLOCK
)
SYSTEM_ROWS = 12
SIZE = 48 * BLOCK

# Values of COUNT that are not a number of equilibria.
INVALID = -1.0
UNDECIDED = -2.0

LARGEST = 1.7976931348623157e308

ABSENT = int(EquilibriumKind.ABSENT)
CENTER = int(EquilibriumKind.CENTER)
SADDLE = int(EquilibriumKind.SADDLE)
DEGENERATE = int(EquilibriumKind.DEGENERATE)

# Stands for a nonzero discriminant that is too small for a double; only its sign matters.
TINY = 1e-300

# Inputs are scaled to [0, 4). The double-double result below is within 32 * 2^-104 of the sum of
# its terms; asking for 2^-48 of it leaves a relative error under 2^-50. Products that underflow
# lose at most 1e-290.
DECIDED = 2.0**-48
UNDERFLOW = 1e-280

LEAST = 5e-324

SLIGHTLY_LESS = 1.0 - 2.0**-48


def exact_discriminant(a: float, b: float, c: float) -> float:
    """(B^2 + C^2 - A^2)^3 + 27 A^2 B^2 C^2 of the doubles given, in units of 2^e near the largest.

    Correctly rounded in the scale of ``elementary.power_of_two_scale``; the sign is exact.
    """
    _, exponent = math.frexp(max(abs(a), abs(b), abs(c)))
    unit = Fraction(2) ** min(max(exponent - 1, -1023), 1022)
    a2, b2, c2 = ((Fraction(value) / unit) ** 2 for value in (a, b, c))
    delta = (b2 + c2 - a2) ** 3 + 27 * a2 * b2 * c2
    value = float(delta)
    return math.copysign(TINY, delta) if delta != 0 and abs(value) < TINY else value


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


@inline
def rotate(s: float, f: float, turn: float) -> tuple[float, float]:
    """(sine, cosine) of the angle less a small turn, the length kept at one to rounding."""
    s, f = s - turn * f, f + turn * s
    shrink = 1.5 - 0.5 * (s * s + f * f)
    return s * shrink, f * shrink


@inline
def outer_root(a: float, p: float, q: float, root_p: float) -> tuple[float, float, float]:
    """Root of R(alpha) = q sin - a sin cos - p cos in [0, pi/2], where R increases.

    ``root_p`` is the cube root of p.
    """
    # 1/|(p/nu, q/(a+nu))| is concave in nu (a power mean of linear functions), so its tangents
    # bound the root from below: at the pole, on the axis p = 0, and at infinity.
    excess = q - a
    norm2 = p * p + q * q
    # (The last one less a rounding error, which is large against the root next to a cusp.)
    far = SLIGHTLY_LESS * np.sqrt(norm2) - a * (q / norm2) * q if norm2 > 0.0 else 0.0
    low = excess if excess > far else far
    low = p if p > low else low
    # Next to the cusp (p -> 0, q -> a) these are far off. There nu^2 (nu - excess) = K(nu) with a
    # slowly growing K, so K at a lower bound gives another one: with y = K^(1/3)/nu it is
    # y^3 + d y = 1, convex, and a Newton step from above stays above.
    inverse = inverse_cbrt((a + low) * (a + low) / (a + low + q), 1)
    k = root_p * root_p / inverse
    d = excess / k if p > 0.0 else 0.0
    y = np.sqrt(1.0 - d) if d < 0.0 else (1.0 / d if d > 1.0 else 1.0)
    y = (2.0 * y * y * y + 1.0) / (3.0 * y * y + d)
    nu = k / y if k / y > low else low
    nu = nu if p > 0.0 else (excess if excess > 0.0 else 0.0)
    reach = 1.0 / (a + nu) if a + nu > 0.0 else 0.0
    # On either side of the cusp, the form that keeps the small component's digits.
    f = q * reach
    s = p / nu if excess > 0.0 else np.sqrt((nu - excess) * (a + q + nu)) * reach
    length = 1.0 / np.sqrt(s * s + f * f)
    s *= length
    f *= length
    # Newton on the angle; q - a f = excess + a s^2/(1 + f) does not cancel, and all is multiplied
    # by 1 + f, which saves a division.
    for _ in range(4):
        g = 1.0 + f
        bracket = excess * g + a * (s * s)
        slope = f * bracket + s * (a * s + p) * g
        turn = (s * bracket - p * f * g) / slope if slope > 0.0 else 0.0
        s, f = rotate(s, f, turn)
    f = q * s / (a * s + p) if f < s else f  # a small cosine has lost its digits
    slope = f * (excess + a * (s * s / (1.0 + f))) + s * (a * s + p)
    return s, f, slope


@inline
def inner_root(
    a: float, p: float, q: float, root_p: float, root_q: float, margin: float
) -> tuple[float, float, float]:
    """Root of R(alpha) = q sin - a sin cos + p cos with alpha beyond the fold point.

    ``root_p``, ``root_q`` are the cube roots of p and q, ``margin`` is the fold margin w >= 0.
    The fold point has tan alpha* = (p/q)^(1/3); with alpha = alpha* + 2 atan(t) the equation is

        -(2-w) P t^4 + 2 (2-w) Q t^3 + 6 P t^2 - 2 w Q t - w P = 0,

    P = sin alpha* cos alpha*, Q = cos 2 alpha*: the gap w enters as a datum, and the terms that
    cancel at the fold are gone.
    """
    norm = np.sqrt(root_p * root_p + root_q * root_q)
    s0 = root_p / norm if norm > 0.0 else np.sqrt(0.5)
    f0 = root_q / norm if norm > 0.0 else np.sqrt(0.5)
    big_p = s0 * f0
    big_q = (f0 - s0) * (f0 + s0)
    v = 2.0 - margin
    # Start: the quadratic that is left without t^3 and t^4, at most the root left without P.
    linear = margin * big_q
    constant = margin * big_p
    root = np.sqrt(linear * linear + 6.0 * constant * big_p)
    most = np.sqrt(margin / v)
    rising = big_q > 0.0
    top = linear + root if rising else constant
    bottom = 6.0 * big_p if rising else root - linear
    t = top / bottom if top < bottom * most else (most if rising else 0.0)
    c4 = -v * big_p
    c3 = 2.0 * v * big_q
    c2 = 6.0 * big_p
    for _ in range(4):
        value = (((c4 * t + c3) * t + c2) * t - 2.0 * linear) * t - constant
        rate = ((4.0 * c4 * t + 3.0 * c3) * t + 2.0 * c2) * t - 2.0 * linear
        t -= value / rate if rate != 0.0 else 0.0
    square = 1.0 / (1.0 + t * t)
    cos_turn = (1.0 - t * t) * square
    sin_turn = 2.0 * t * square
    s1 = s0 * cos_turn + f0 * sin_turn
    f1 = f0 * cos_turn - s0 * sin_turn
    f1 = f1 if f1 > 0.0 else 0.0
    # Near the fold V'' is proportional to the turn, without cancellation.
    slope1 = a * (1.0 - margin) * sin_turn
    slope1 *= (f0 * f0 * s1 * s1 + f0 * s0 * f1 * s1 + s0 * s0 * f1 * f1) / (f1 * s1)
    # Elsewhere a Newton step on the angle gives a small component its digits; of q - a f and
    # p - a s, the one that could cancel is rewritten (as in outer_root).
    shallow = s1 < f1
    g = 1.0 + (f1 if shallow else s1)
    along = (q - a) * g + a * (s1 * s1) if shallow else (q - a * f1) * g
    across = (p - a * s1) * g if shallow else (p - a) * g + a * (f1 * f1)
    force = s1 * along + p * f1 * g if shallow else q * s1 * g + f1 * across
    slope = f1 * along - s1 * across
    s, f = rotate(s1, f1, force / slope if slope > 0.0 else 0.0)
    along = (q - a) + a * (s * s / (1.0 + f)) if shallow else q - a * f
    across = p - a * s if shallow else (p - a) + a * (f * f / (1.0 + s))
    f = f if shallow else q * s / -across
    slope = f * along - s * across
    folding = t < 0.125 * s0 and t < 0.125 * f0
    return (s1 if folding else s), (f1 if folding else f), (slope1 if folding else slope)


@inline
def reduce(i: int, w: Array) -> None:
    """The equivalent system with A, B, C >= 0, scaled by a power of two.

    phi -> pi/2 - phi turns A < 0 into -A > 0 and exchanges B and C; phi -> -phi and
    phi -> pi - phi flip the signs of C and B.
    """
    a = abs(w[A0 + i])
    b = abs(w[B0 + i])
    c = abs(w[C0 + i])
    negative = w[A0 + i] < 0.0
    size = a if a > b else b
    scale = power_of_two_scale(size if size > c else c)
    w[A + i] = a * scale
    w[B + i] = (c if negative else b) * scale
    w[C + i] = (b if negative else c) * scale
    w[UNIT + i] = 1.0 / scale


@inline
def discriminate(i: int, w: Array) -> None:
    """Delta of the reduced system; NaN where only exact arithmetic can decide its sign."""
    delta, decided = discriminant(w[A + i], w[B + i], w[C + i])
    w[DELTA + i] = delta if decided else math.nan


@inline
def count(i: int, w: Array) -> None:
    """Number of equilibria and the fold margin; a fold's pair and a cusp's triple count once.

    A coefficient that is lost in the scaling (a ratio beyond 1e308) leaves the sign undecided.
    """
    a0 = w[A0 + i]
    b0 = w[B0 + i]
    c0 = w[C0 + i]
    delta = w[DELTA + i]
    flat = w[B + i] == 0.0 or w[C + i] == 0.0
    lost = flat and delta == 0.0 and b0 != 0.0 and c0 != 0.0
    number = 4.0 if delta < 0.0 else (3.0 if delta == 0.0 and not flat else 2.0)
    number = UNDECIDED if lost or delta != delta else number
    number = 0.0 if a0 == 0.0 and b0 == 0.0 and c0 == 0.0 else number
    valid = abs(a0) <= LARGEST and abs(b0) <= LARGEST and abs(c0) <= LARGEST
    w[COUNT + i] = number if valid else INVALID
    margin, root_b, root_c = fold_margin(w[A + i], w[B + i], w[C + i], delta)
    w[MARGIN + i] = margin
    w[ROOT_B + i] = root_b
    w[ROOT_C + i] = root_c


@inline
def find_outer(j: int, i: int, w: Array) -> None:
    """The global minimum (quadrant 1 of the reduced system) or maximum (quadrant 3)."""
    center = j == LOWER_CENTER
    swap = BLOCK if center else 0  # rows B and C are neighbours
    root = w[ROOT_B + swap + i]
    s, f, slope = outer_root(w[A + i], w[B + swap + i], w[C - swap + i], root)
    p = j * BLOCK + i
    w[X + p] = f if center else s
    w[Y + p] = s if center else f
    w[SLOPE + p] = slope


@inline
def find_inner(j: int, i: int, w: Array) -> None:
    """The upper center or the lower saddle (quadrant 4), where they exist."""
    center = j == UPPER_CENTER
    swap = BLOCK if center else 0
    margin = w[MARGIN + i] if w[MARGIN + i] > 0.0 else 0.0
    s, f, slope = inner_root(
        w[A + i],
        w[B + swap + i],
        w[C - swap + i],
        w[ROOT_B + swap + i],
        w[ROOT_C - swap + i],
        margin,
    )
    p = j * BLOCK + i
    w[X + p] = f if center else s
    w[Y + p] = s if center else f
    w[SLOPE + p] = slope


@inline
def classify(j: int, i: int, w: Array) -> None:
    """The kind of point j; of the points that merge only one is kept."""
    number = w[COUNT + i]
    along_b = w[B + i]
    along_c = w[C + i]
    outer = j == LOWER_CENTER or j == UPPER_SADDLE
    axis = along_c if j == LOWER_CENTER else along_b
    cusp = outer and number == 2.0 and w[DELTA + i] == 0.0 and axis == 0.0
    fold = j == LOWER_SADDLE and number == 3.0
    present = number == 4.0 or (outer and number >= 2.0) or fold
    kind = CENTER if j == LOWER_CENTER or j == UPPER_CENTER else SADDLE
    kind = DEGENERATE if cusp or fold else kind
    w[KIND + j * BLOCK + i] = kind if present else ABSENT


@inline
def put_back(j: int, i: int, w: Array) -> None:
    """Angle and energy of point j, back in the frame that was given; NaN where absent."""
    p = j * BLOCK + i
    x = w[X + p]
    y = w[Y + p]
    a0 = w[A0 + i]
    b0 = w[B0 + i]
    c0 = w[C0 + i]
    # Quadrants 1, 4, 4, 3 in the reduced system.
    right = -1.0 if j == UPPER_SADDLE else 1.0
    above = 1.0 if j == LOWER_CENTER else -1.0
    swapped = a0 < 0.0
    cosine = y if swapped else x
    sine = x if swapped else y
    side = (above if swapped else right) * (-1.0 if b0 < 0.0 else 1.0)
    half = (right if swapped else above) * (-1.0 if c0 < 0.0 else 1.0)
    # An angle of exactly pi is +pi; one that only rounds to -pi stays there.
    half = 1.0 if sine == 0.0 and c0 == 0.0 else half
    phi = angle_quadrant(sine, cosine)
    phi = (PI - phi) + PI_LOW if side < 0.0 else phi
    x = side * cosine
    energy = (0.5 * a0 * x - b0) * x - c0 * (half * sine)
    # Twins are level to the last bit.
    saddle = j == LOWER_SADDLE or j == UPPER_SADDLE
    upright = saddle != swapped
    twins = w[COUNT + i] == 4.0 and (b0 if upright else c0) == 0.0
    share = (c0 if upright else b0) / a0
    level = 0.5 * a0 + 0.5 * c0 * share if upright else -0.5 * b0 * share
    energy = level if twins else energy
    present = w[KIND + p] != ABSENT
    w[PHI + p] = half * phi + 0.0 if present else math.nan
    w[ENERGY + p] = energy if present else math.nan


@inline
def measure(j: int, i: int, w: Array) -> None:
    """V'' and its square root at point j, in the units that were given; NaN where absent."""
    p = j * BLOCK + i
    kind = w[KIND + p]
    slope = w[SLOPE + p] * w[UNIT + i]
    slope = 0.0 if kind == DEGENERATE else slope
    rate = np.sqrt(slope)
    center = j == LOWER_CENTER or j == UPPER_CENTER
    curvature = slope if center else 0.0 - slope
    w[CURVATURE + p] = math.nan if kind == ABSENT else curvature
    w[FREQUENCY + p] = rate if kind == CENTER else math.nan
    w[EXPONENT + p] = rate if kind == SADDLE else math.nan


@inline
def leave_out(j: int, i: int, w: Array) -> None:
    """Mark point j as absent without computing it."""
    p = j * BLOCK + i
    w[PHI + p] = math.nan
    w[ENERGY + p] = math.nan
    w[CURVATURE + p] = math.nan
    w[FREQUENCY + p] = math.nan
    w[EXPONENT + p] = math.nan


@inline
def write(i: int, k: int, w: Array, out: Outputs) -> None:
    """Column i becomes cell k of the output arrays."""
    phi, kind, energy, curvature, natural_frequency, exponent, n_equilibria, margin = out
    for j in range(4):
        p = j * BLOCK + i
        phi[k, j] = w[PHI + p]
        kind[k, j] = np.int8(w[KIND + p])
        energy[k, j] = w[ENERGY + p]
        curvature[k, j] = w[CURVATURE + p]
        natural_frequency[k, j] = w[FREQUENCY + p]
        exponent[k, j] = w[EXPONENT + p]
    n_equilibria[k] = np.int8(w[COUNT + i])
    present = w[COUNT + i] > 0.0
    margin[k] = w[MARGIN + i] if present else math.nan
