"""The shape of an orbit in closed form: roots, turning points, and the map to psi' = Delta(psi).

All is measured from a reference, the equilibrium whose energy is nearest to the orbit's: E is the
orbit's energy above it, o = phi - phi_s the angle from it and z = cot(o/2). So nothing cancels
next to a center or a separatrix. With mu = B/cos(phi_s) = A + C/sin(phi_s) at the reference, S2 =
(A/2) sin(2 phi_s) and P = mu - A sin(phi_s)^2, motion at the energy E obeys

    phi'^2 = 2 E F1(z) F2(z)/(1 + z^2)^2,  F1,2 = z^2 +- tau z + r1,2,

where r1,2 = (x + E -+ R)/E, R = -2 S2/tau, tau^2 = 4 (mu + x) (A - mu - x)/x^2 and x is a root of

    x^3 + (V'' + 2 E) x^2 + 2 E (2 mu - A) x - 2 E mu (A - mu) = 0.

The roots are the Weierstrass roots of the motion times -4, shifted. From the least real one, x0,
and the distances y1, y2 of the others from it, the frequency is the arithmetic-geometric mean of
sqrt(y1) and sqrt(y2). A Moebius map of tan(phi/2) turns the motion into psi' = Delta(psi) of
`phasekit.numerics.agm`: for a libration between the zeros of F1

    tan(psi/2)^2 = sqrt(|V'(low)/V'(high)|) sin((high - phi)/2)/sin((phi - low)/2),

for a rotation, between the slower and the faster of the two points on its axis of symmetry,

    tan(psi/2) = sqrt(v(fast)/v(slow)) sin((phi - slow)/2)/sin((fast - phi)/2).
"""

from __future__ import annotations

import math

import numpy as np

from phasekit.arrays import Array
from phasekit.numerics.agm import STEPS, halve
from phasekit.numerics.compile import inline, routine
from phasekit.numerics.double_double import TWO_PI, TWO_PI_LOW, dd_add, two_sum
from phasekit.numerics.elementary import angle_half
from phasekit.phase.exact.kernels.equilibria import LOWER_SADDLE, UPPER_CENTER
from phasekit.phase.exact.kernels.levels import (
    AROUND,
    ASYMPTOTE,
    GAP,
    INVALID,
    LEFT,
    MODE,
    ORBIT,
    PLACE,
    REFERENCE,
    RIGHT,
    SWING,
    TURN,
)
from phasekit.phase.exact.kernels.system import CURVATURE, PHI, PHI_LOW, A, B, C, multiplier


@inline
def tan_half(y: float, x: float) -> float:
    """Return tan(angle/2) of the angle atan2(y, x), y > 0."""
    size = length(y, x)
    return y / (size + x) if x >= 0.0 else (size - x) / y


@routine
def largest_root(e: float, k2: float, m: float, n: float, c2: float, s2: float) -> float:
    """The largest -x of the cubic of a rotation, whose roots are all real."""
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


@inline
def length(y: float, x: float) -> float:
    """sqrt(x^2 + y^2) without overflow; y and x are not both 0."""
    most = max(abs(x), abs(y))
    return most * np.sqrt(x / most * (x / most) + y / most * (y / most))


@inline
def unit_vector(z: float) -> tuple[float, float]:
    """Cosine and sine >= 0 of the angle whose cotangent is z."""
    size = np.sqrt(1.0 + z * z) if abs(z) < 1e150 else abs(z)
    return (z / size if abs(z) < math.inf else math.copysign(1.0, z)), 1.0 / size


# Rows after those of `levels`. The reference: angle, cosine, sine, V'', mu and
# A - mu of the system with A >= 0, S2, P. The roots: x0, y1 y2, y1 + y2. The motion: a and b of
# Delta, the angle half-way between the ends of the Moebius map, the tangent of a quarter of their
# distance, its ratio (libration: sqrt(V'(high)/V'(low)), rotation: sqrt(v(fast)/v(slow))), and
# 1 - ratio (libration) or ratio - 1 (rotation); turning points. Of the factors of a libration: sum
# of the zeros of its own, r of the other one, |1 + r + i sqrt(disc)| of its own, and its zeros at
# both turning points. Of a rotation in their place: sines (TAU, REST_R) and cosines (Z) of half the
# angles from the reference to the slow and the fast point, and the offset of the slow one (SPAN).
# The number of Gauss steps. What `orbits` makes of all that. What the reference's angle misses,
# Z_HIGH - Z_LOW, what SIGMA misses, and half the width of the orbit. Last, the means of the Gauss
# steps, and room for the nodes of `action`.
PHI_S, COS, SIN, SLOPE, M, N, S2, P, X0, Y_PRODUCT = range(ORBIT, ORBIT + 10)
FIRST, SECOND, SIGMA, U, RATIO, SKEW, LOW, HIGH = range(ORBIT + 10, ORBIT + 18)
TAU, REST_R, SPAN, Z_HIGH, Z_LOW, LEVELS = range(ORBIT + 18, ORBIT + 24)
OMEGA, ACTION, PHI_MIN, PHI_MAX = range(ORBIT + 24, ORBIT + 28)
PHI_S_LOW, Z_APART, SIGMA_LOW, AMPLITUDE = range(ORBIT + 28, ORBIT + 32)
MEANS = ORBIT + 32
# Of roots below this all terms of the cubic underflow.
UNDERFLOWS = 1e-101
NODES = MEANS + 2 * STEPS


@routine
def refer(w: Array) -> None:
    """What the formulas need of the reference."""
    j = int(w[REFERENCE])
    row = multiplier(j, w)
    x = w[row]
    y = w[row + 1]
    w[M] = w[row + 2]
    w[N] = w[row + 3]
    w[PHI_S] = w[PHI + j]
    w[PHI_S_LOW] = w[PHI_LOW + j] if w[PHI_LOW + j] == w[PHI_LOW + j] else 0.0
    w[COS] = x
    w[SIN] = y
    w[SLOPE] = w[CURVATURE + j]
    w[S2] = w[A] * x * y
    w[P] = w[M] * x * x - w[N] * y * y if w[A] >= 0.0 else w[M] * y * y - w[N] * x * x


@routine
def span(slow: float, fast: float, w: Array) -> None:
    """The Moebius map between the slow and the fast point of a rotation, by their cotangents."""
    o_slow = 2.0 * angle_half(1.0, slow)
    o_fast = 2.0 * angle_half(1.0, fast)
    w[Z_LOW], w[TAU] = unit_vector(slow)
    w[Z_HIGH], w[REST_R] = unit_vector(fast)
    if o_fast < o_slow:
        o_fast += TWO_PI
        w[Z_HIGH] = -w[Z_HIGH]
        w[REST_R] = -w[REST_R]
    if slow < 0.0:  # the slow point is near the reference on its left
        o_slow = -2.0 * angle_half(1.0, -slow)
        o_fast -= TWO_PI
        for i in (Z_LOW, TAU, Z_HIGH, REST_R):
            w[i] = -w[i]
    w[SPAN] = o_slow
    w[SIGMA] = w[PHI_S] + 0.5 * (o_slow + o_fast)
    if abs(slow) < math.inf:
        w[U] = tan_half(abs(slow - fast), (1.0 + slow * fast) * (1.0 if slow > fast else -1.0))
    else:
        w[U] = tan_half(1.0, fast)


@routine
def turn(w: Array) -> None:
    """A rotation: roots and Moebius map. The reference is the upper saddle, E > 0."""
    e = w[GAP]
    k2 = -w[SLOPE]
    m = max(-w[M], 0.0)
    n = max(w[N], 0.0)
    size = abs(w[A])
    c2 = w[COS] * w[COS] if w[A] >= 0.0 else w[SIN] * w[SIN]
    s2 = w[SIN] * w[SIN] if w[A] >= 0.0 else w[COS] * w[COS]
    z = largest_root(e, k2, m, n, c2, s2)
    # The others: mu_1 = -q <= 0 <= mu_2, where q mu_2 = product and q - mu_2 = excess.
    b2 = w[B] * w[B] if w[A] >= 0.0 else w[C] * w[C]
    g2 = w[C] * w[C] if w[A] >= 0.0 else w[B] * w[B]
    low = m + z  # -mu_0
    high = n + z  # A - mu_0
    product = size * b2 / low
    if z < n:  # from the reference, where b2 = m^2 c2 and g2 = n^2 s2
        excess = (m - c2 * size) - z * (c2 * m / low + s2 * n / high)
    else:
        excess = b2 / low + g2 / high - size
    root = np.sqrt(excess * excess + 4.0 * product)
    if excess >= 0.0:
        q = 0.5 * (excess + root)
        mu2 = product / q if q > 0.0 else 0.0
    else:
        mu2 = 0.5 * (root - excess)
        q = product / mu2
    x2 = mu2 + m
    x1 = 2.0 * e * m * n / (z * x2) if x2 > 0.0 else 0.0
    y1 = x1 + z
    y2 = x2 + z
    w[FIRST] = np.sqrt(y1)
    w[SECOND] = np.sqrt(y2)
    w[Y_PRODUCT] = y1 * y2
    w[X0] = -z
    # The axis: z^2 + 2 tilt z - (1 + x2/E) = 0.
    below = size * g2 / (high * (size + q))  # A - mu_2
    level = 1.0 + x2 / e
    under = 2.0 * e * mu2 * below
    tilt = w[S2] * x2 * x2 / under if under > 0.0 else math.inf
    if abs(tilt) < 1e150:
        first = -tilt - (
            np.sqrt(tilt * tilt + level) if tilt >= 0.0 else -np.sqrt(tilt * tilt + level)
        )
        second = -level / first
    else:
        first = math.inf
        second = mu2 * below / (w[S2] * x2) if abs(w[S2]) > 0.0 else 0.0
    # The slow point is on the side of the kernel vector of mu_1.
    slow = first
    fast = second
    if abs(tilt) < 1e150 and q > 0.0:
        quotient = x1 / (q * (size + q))
        weight = (c2 * (size + q) + s2 * q) * quotient
        skew = w[S2] * quotient
        if (first * first) * weight - 2.0 - weight - 2.0 * first * skew < 0.0:
            slow = second
            fast = first
    span(slow, fast, w)
    # Ratio of the speeds at both ends: (n1 + n0)/sqrt(n1^2 - n0^2), times sqrt(q) throughout, with
    # n0^2 = y1 y2/(low high) and n1^2 = y1 (y2 - y1)/(q (size + q)).
    if q > 0.0:
        n0 = np.sqrt(q) * np.sqrt(y1 * y2 / (low * high))
        n1 = np.sqrt(y1 * (mu2 + q) / (size + q))
        difference = (mu2 * (size + low + q) + low * q) / ((size + q) * low * high)
        w[RATIO] = (n1 + n0) / (y1 * np.sqrt(difference))
        w[SKEW] = 2.0 * n0 / (n1 + n0) * w[RATIO] * w[RATIO] / (1.0 + w[RATIO])
    else:
        w[RATIO] = 1.0
        w[SKEW] = 0.0


@routine
def factors(x: float, product: float, others: float, w: Array) -> tuple[float, float, float]:
    """Return tau, r1 and r2 of a libration, by x, and sum and product of the other two roots."""
    e = w[GAP]
    slope = w[SLOPE]
    m = w[M]
    n = w[N]
    size = abs(w[A])
    # mu_0 and A - mu_0, from the product of the roots where the sum cancels.
    b2 = w[B] * w[B] if w[A] >= 0.0 else w[C] * w[C]
    g2 = w[C] * w[C] if w[A] >= 0.0 else w[B] * w[B]
    mu0 = m + x
    if abs(mu0) < 0.1 * (abs(m) + abs(x)):
        norm = product + m * others + m * m
        mu0 = size * b2 / norm if norm > 0.0 else 0.0
    rest = n - x
    if abs(rest) < 0.1 * (abs(n) + abs(x)):
        norm = product - n * others + n * n
        rest = size * g2 / norm if norm > 0.0 else 0.0
    # tau R = -2 S2, R^2 = x^2 + 2 E (x + P), tau^2 = 2 (x + V'')/E = 4 mu_0 (A - mu_0)/x^2: each
    # where nothing cancels.
    twice = 2.0 * e * (x + w[P])
    square = x * x + twice
    if square > 0.02 * (x * x + 2.0 * abs(e) * (abs(x) + abs(w[P]))):
        r = np.sqrt(square)
        tau = 2.0 * abs(w[S2]) / r
    else:
        if abs(x + slope) > 0.25 * (abs(x) + abs(slope)):
            tau = np.sqrt(max(2.0 * (x + slope) / e, 0.0))
        else:
            tau = 2.0 * np.sqrt(max(mu0, 0.0) * max(rest, 0.0)) / abs(x) if x != 0.0 else 0.0
        r = 2.0 * abs(w[S2]) / tau if tau > 0.0 else np.sqrt(max(square, 0.0))
    r = -r if w[S2] > 0.0 else r
    # r1 r2 = 1 - 2 P/E: the smaller from the larger.
    top = x + e
    r1 = (top - r) / e
    r2 = (top + r) / e
    both = 1.0 - 2.0 * w[P] / e
    if abs(r1) > abs(r2):
        r2 = both / r1
    elif abs(r2) > 0.0:
        r1 = both / r2
    return tau, r1, r2


@routine
def swing_roots(w: Array) -> tuple[float, float, float]:
    """The real root x that counts of a libration, product and sum of the other two."""
    e, m, n = w[GAP], w[M], w[N]
    c2 = w[SLOPE] + 2.0 * e
    c1 = 2.0 * e * (m - n)
    c0 = -2.0 * e * m * n
    x = least_root(c2, c1, c0, w)
    g = (3.0 * x + 2.0 * c2) * x + c1
    total = -c2 - 3.0 * x
    product = 2.0 * e * m * n / x if x != 0.0 else g
    others = -c2 - x
    if abs(others) < 0.1 * abs(x):
        others = (c1 - product) / x
    g = max(g, 0.0)
    root = np.sqrt(g)
    if total >= 0.0:
        square = 0.25 * (total + 2.0 * root)
    else:
        square = 0.25 * (4.0 * product - others * others) / (2.0 * root - total)
    w[X0] = x
    w[Y_PRODUCT] = g
    w[FIRST] = np.sqrt(root)
    w[SECOND] = np.sqrt(max(square, 0.0))
    return x, product, others


@routine
def swing(w: Array) -> None:
    """A libration: roots, turning points and Moebius map."""
    e, place = w[GAP], int(w[PLACE])
    x, product, others = swing_roots(w)
    tau, r1, r2 = factors(x, product, others, w)
    lobe = e < 0.0 and (place == LEFT or place == RIGHT)
    second = place == RIGHT if lobe else r2 < r1
    sum_ = tau if second else -tau  # of the zeros
    own = r2 if second else r1
    rest_r = r1 if second else r2
    disc = np.sqrt(max(tau * tau - 4.0 * own, 0.0))
    # Next to a level saddle that cancels; there it is known from the other two zeros and roots,
    # |z1 - z2| |z3 - z4| = 2 |x1 - x2|/|E|.
    apart = 4.0 * product - others * others
    other_disc = 4.0 * rest_r - tau * tau
    if place == AROUND and disc < 0.3 * tau and apart > 0.1 * product and other_disc > 0.0:
        disc = 2.0 * np.sqrt(apart) / (abs(e) * np.sqrt(other_disc))
    # The zero without cancellation first.
    big = 0.5 * (sum_ + disc) if sum_ >= 0.0 else 0.5 * (sum_ - disc)
    small = own / big if big != 0.0 else 0.0
    z_big, z_small = max(big, small), min(big, small)
    o_first = 2.0 * angle_half(1.0, z_big)
    o_second = 2.0 * angle_half(1.0, z_small)
    if e > 0.0:  # the orbit encloses the reference
        o_high = o_first
        o_low = -2.0 * angle_half(1.0, -z_small)
        w[U] = tan_half(disc, -(1.0 + own))
        z_high = z_big
        z_low = z_small
        way = disc
    else:
        o_high = o_second
        o_low = o_first
        if z_big < 0.0:  # on the left of the reference
            o_high = -2.0 * angle_half(1.0, -z_small)
            o_low = -2.0 * angle_half(1.0, -z_big)
        w[U] = tan_half(disc, 1.0 + own)
        z_high = z_small
        z_low = z_big
        way = -disc
    w[LOW] = w[PHI_S] + o_low
    w[HIGH] = w[PHI_S] + o_high
    w[SIGMA] = w[PHI_S] + 0.5 * (o_low + o_high)
    w[SIGMA_LOW] = 0.0
    if e < 0.0 and place == AROUND and z_big > 0.0:  # opposite to the reference, all but exactly
        shift = 0.5 * o_low - angle_half(1.0, -z_small)
        w[SIGMA], low = two_sum(w[PHI_S], 0.5 * TWO_PI)
        w[SIGMA], w[SIGMA_LOW] = dd_add(w[SIGMA], low, shift, 0.5 * TWO_PI_LOW + w[PHI_S_LOW])
    # V' at both turning points, but for a common factor.
    force_high = e + x / (1.0 + z_high * z_high)
    force_low = e + x / (1.0 + z_low * z_low)
    w[RATIO] = np.sqrt(force_high / force_low)
    w[SPAN] = length(disc, 1.0 + own)
    difference = x * (way / w[SPAN]) * (sum_ / w[SPAN])
    w[SKEW] = difference / (force_low * (1.0 + w[RATIO]))
    w[TAU] = sum_
    w[Z_HIGH] = z_high
    w[Z_LOW] = z_low
    w[Z_APART] = way
    w[REST_R] = rest_r


@routine
def least_root(c2: float, c1: float, c0: float, w: Array) -> float:
    """Least real root x of the cubic x^3 + c2 x^2 + c1 x + c0 of a libration.

    mu_0 = mu + x lies in (0, A); inside a lobe below mu of the lower saddle, round both lobes
    above mu of the upper center; and is the only root there.
    """
    lower = -w[M]
    upper = w[N]
    guess = -w[SLOPE]
    place = w[PLACE]
    if place == LEFT or place == RIGHT:
        upper = min(upper, distance(LOWER_SADDLE, 1.0, w))
        if w[GAP] < 0.0:
            root = np.sqrt(max(c1 * c1 - 4.0 * c2 * c0, 0.0))
            small = -2.0 * c0 / (c1 + root) if c1 > 0.0 else 0.5 * (root - c1) / c2
            guess = small if small <= 0.0 else guess
    elif place == AROUND and w[PHI + UPPER_CENTER] == w[PHI + UPPER_CENTER]:
        lower = max(lower, distance(UPPER_CENTER, -1.0, w))
    x = min(max(guess, lower), upper)
    last = False
    for _ in range(200):
        value = ((x + c2) * x + c1) * x + c0
        if value < 0.0:
            lower = x
        else:
            upper = x
        slope = (3.0 * x + 2.0 * c2) * x + c1
        step = value / slope if slope > 0.0 else math.inf
        close = abs(step) < 1e-8 * abs(x)
        new = x - step
        if new < lower:
            new = lower if x != lower else 0.5 * (lower + upper)
        elif new > upper:
            new = upper if x != upper else 0.5 * (lower + upper)
        x = new
        if last or lower == upper:
            break
        last = close
    return x


@inline
def distance(i: int, sign: float, w: Array) -> float:
    """mu_i - mu, from the reference to equilibrium i, and its rounding in the direction of sign."""
    mu = w[multiplier(i, w) + 2]
    return mu - w[M] + sign * 1e-15 * abs(w[M]) if mu != w[M] else 0.0


@routine
def shape(w: Array) -> None:
    """Work out what the motion is made of, in the orbit's own mode."""
    mode = w[MODE]
    if mode == SWING or mode == TURN or mode == ASYMPTOTE:
        refer(w)
    if mode == SWING or mode == TURN:
        size = max(abs(w[SLOPE]), np.sqrt(abs(w[GAP])))
        if size < UNDERFLOWS and w[M] != 0.0 and w[N] != 0.0:
            mode = INVALID
            w[MODE] = INVALID
    if mode == TURN:
        turn(w)
    if mode == SWING:
        swing(w)
    if mode == TURN or mode == SWING:
        w[LEVELS] = halve(w[FIRST], w[SECOND], MEANS, w)
