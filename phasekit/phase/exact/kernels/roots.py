"""The equilibria of one system with A, B, C >= 0, each from its own bracket.

With cos phi = B/mu and sin phi = C/(mu - A) the equilibria are the roots of the secular
equation B^2/mu^2 + C^2/(mu - A)^2 = 1. In the distance nu from the nearest pole it reads

    (p/nu)^2 + (q/(a + nu))^2 = 1   beyond the poles ("outer": one root), and
    (p/nu)^2 + (q/(a - nu))^2 = 1   between them ("inner": one root on that pole's side),

where p is the coefficient that belongs to that pole and q the other one. So two functions find
the global minimum and maximum, and the upper center and lower saddle. Both return (s, f, slope):
sine s and cosine f of the angle from the pole's axis, and the slope of the force there, |V''|.

No branch, no trigonometric function: the starts are close enough for a fixed number of Newton
steps on every input, which the tests measure over 40 orders of magnitude.
"""

from __future__ import annotations

import numpy as np

from phasekit.numerics.compile import inline, routine
from phasekit.numerics.elementary import inverse_cbrt

SLIGHTLY_LESS = 1.0 - 2.0**-48


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


@routine
def largest_root(e: float, k2: float, m: float, n: float, c2: float, s2: float) -> float:
    """The largest -x of the cubic of a rotation in `shape`, whose roots are all real."""
    # From above, so that Newton comes down to it.
    p2 = k2 - 2.0 * e
    p1 = -2.0 * e * (m + n)
    p0 = -2.0 * e * m * n
    # 2 E = z^2 (c2/(m + z) + s2/(n + z)), so z is below what either term gives alone.
    z = e + np.sqrt(e) * np.sqrt(e + 2.0 * max(m, n))
    if c2 > 0.0:
        z = min(z, (e + np.sqrt(e) * np.sqrt(e + 2.0 * m * c2)) / c2)
    if s2 > 0.0:
        z = min(z, (e + np.sqrt(e) * np.sqrt(e + 2.0 * n * s2)) / s2)
    for _ in range(100):
        q1 = p1 / z  # so that nothing underflows
        step = z * ((z + p2) + q1 + p0 / z / z) / (3.0 * z + 2.0 * p2 + q1)
        z -= step
        if not step > 1e-15 * z:
            break
    return z
