"""A system in the work array of one orbit: its equilibria, and energies above them.

The energy above an equilibrium decides on which side of a separatrix a state lies, and carries the
digits of its period there. So it is never the difference of two energies. With o the angle from
the equilibrium, where V' = 0,

    V(phi) - V(phi_s) = 2 sin(o/2)^2 [V'' + A sin(o/2 + 2 phi_s) sin(o/2)],

which is accurate next to the equilibrium, also where V'' = 0. Where that and the kinetic energy
cancel, it is computed in double-double arithmetic, from the angle that the double next to the
equilibrium misses.
"""

from __future__ import annotations

import math

import numpy as np

from phasekit.arrays import Array
from phasekit.numerics.compile import inline, routine
from phasekit.numerics.double_double import (
    TWO_PI,
    TWO_PI_LOW,
    dd_add,
    dd_cos_sin,
    dd_divide,
    dd_multiply,
    reduce_angle,
    two_product,
    two_sum,
)

# One orbit is a flat work array. First the system: coefficients in a unit of time that brings
# the sum of their sizes into [1, 4), that unit; of the equilibria angles, V'', multipliers; what
# the angles miss, and V'' as a double-double; what angles are multiplied by at last, see `magnify`.
A, B, C, UNIT, PHI, CURVATURE, MULTIPLIER = 0, 1, 2, 3, 4, 8, 12
PHI_LOW, BEND, BEND_LOW, ZOOM, STATE = 28, 32, 36, 40, 41

LARGEST = 1.7976931348623157e308
ROUNDING = 2.0**-53
# Below this V'' is known better as a double than in double-double arithmetic.
BEND_FROM = 1e-15
# Newton's steps to the angle of an equilibrium: most of them are where three almost merge.
STEPS = 100


@inline
def load(a: float, b: float, c: float, w: Array) -> bool:
    """Scale a system by a power of four; whether it is valid and has a force."""
    w[ZOOM] = 1.0
    size = abs(a) + abs(b) + abs(c)  # NaN if any is
    if size > LARGEST:
        size = max(abs(a), abs(b), abs(c))
    if not (size > 0.0 and abs(a) <= LARGEST and abs(b) <= LARGEST and abs(c) <= LARGEST):
        w[UNIT] = 1.0
        w[A] = size  # 0 without force
        w[B] = 0.0
        w[C] = 0.0
        return False
    exponent = (np.float64(size).view(np.int64) >> 52) & 0x7FF
    half = (exponent - 1023) >> 1
    unit = np.int64((1023 - half) << 52).view(np.float64)
    w[UNIT] = unit
    w[A] = a * unit * unit
    w[B] = b * unit * unit
    w[C] = c * unit * unit
    return True


@inline
def load_point(j: int, phi: float, curvature: float, w: Array) -> None:
    """Take over equilibrium j of the system."""
    w[PHI + j] = phi
    w[CURVATURE + j] = curvature * w[UNIT] * w[UNIT]
    if abs(curvature) > LARGEST:  # overflow: twice the largest coefficient
        x = math.cos(phi)
        y = math.sin(phi)
        w[CURVATURE + j] = w[B] * x - w[A] * (x - y) * (x + y) + w[C] * y
    w[MULTIPLIER + 4 * j] = math.nan
    w[PHI_LOW + j] = math.nan


@inline
def force(phi: float, w: Array) -> float:
    """V', without cancellation next to the axes, where B - A or C + A may vanish."""
    a = w[A]
    x = np.float64(math.cos(phi))
    y = np.float64(math.sin(phi))
    if abs(y) < 0.1:
        size = a if x > 0.0 else -a
        return ((w[B] - size) + size * (y * y / (1.0 + abs(x)))) * y - w[C] * x
    if abs(x) < 0.1:
        size = a if y > 0.0 else -a
        return w[B] * y - ((w[C] + size) - size * (x * x / (1.0 + abs(y)))) * x
    return (w[B] - a * x) * y - w[C] * x


@inline
def potential_dd(
    a: float, b: float, c: float, ch: float, cl: float, sh: float, sl: float
) -> tuple[float, float]:
    """V = (a cos/2 - b) cos - c sin as a double-double."""
    h, low = dd_multiply(ch, cl, 0.5 * a, 0.0)
    h, low = dd_add(h, low, -b, 0.0)
    h, low = dd_multiply(h, low, ch, cl)
    th, tl = dd_multiply(sh, sl, c, 0.0)
    return dd_add(h, low, -th, -tl)


@routine
def slopes_dd(phi: float, low: float, w: Array) -> tuple[float, float, float, float]:
    """V', V'' as a double-double, and its slope, next to an equilibrium; accurate on the axes.

    With A' = A sign(cos) the first is [B - A' + A' (1 - |cos|)] sin - C cos; so long as it
    vanishes, the second is [B - A' + A' (1 - |cos|^3)]/cos = B/cos - A cos^2. Likewise with sine
    and cosine, B and C exchanged, and -A.
    """
    xh, xl, yh, yl = dd_cos_sin(phi, low)
    b, c, a, sign = w[B], w[C], w[A], 1.0
    if abs(xh) < abs(yh):
        xh, xl, yh, yl = yh, yl, xh, xl
        b, c, a, sign = w[C], w[B], -w[A], -1.0
    side = 1.0 if xh > 0.0 else -1.0
    ph, pl = dd_multiply(yh, yl, yh, yl)
    qh, ql = dd_add(1.0, 0.0, side * xh, side * xl)
    ph, pl = dd_divide(ph, pl, qh, ql)  # 1 - |cos|
    ph, pl = dd_multiply(ph, pl, side * a, 0.0)
    rh, rl = two_sum(b, -side * a)
    fh, fl = dd_add(rh, rl, ph, pl)
    fh, fl = dd_multiply(fh, fl, yh, yl)
    th, tl = dd_multiply(xh, xl, c, 0.0)
    fh, fl = dd_add(fh, fl, -th, -tl)
    th, tl = dd_multiply(xh, xl, xh, xl)
    qh, ql = dd_add(qh, ql, th, tl)
    ph, pl = dd_multiply(ph, pl, qh, ql)
    ph, pl = dd_add(ph, pl, rh, rl)
    ph, pl = dd_divide(ph, pl, xh, xl)
    return sign * fh, ph, pl, sign * yh * (b / (xh * xh) + 2.0 * a * xh)


@routine
def sharpen(j: int, w: Array) -> None:
    """What the angle of equilibrium j misses, and V'' there, when they are first needed."""
    if w[PHI_LOW + j] == w[PHI_LOW + j]:
        return
    phi = w[PHI + j]
    curvature = w[CURVATURE + j]
    most = 8.0 * ROUNDING * abs(phi)
    low = 0.0
    bend = curvature
    rest = 0.0
    if curvature == 0.0 and (w[B] == 0.0 or w[C] == 0.0):  # a cusp, on an axis
        quarter = 0.25 * np.rint(4.0 * phi / TWO_PI)
        low = (quarter * TWO_PI - phi) + quarter * TWO_PI_LOW
    elif curvature == 0.0:  # a fold, where V'' changes its sign
        _, slope, _, third = slopes_dd(phi, 0.0, w)
        low = min(max(-slope / third, -most), most)
    else:
        for _ in range(STEPS):
            slope, bend, rest, third = slopes_dd(phi, low, w)
            step = min(max(low - slope / bend, -most), most) - low if bend != 0.0 else 0.0
            low += step
            if not step * step > 4.0 * ROUNDING * ROUNDING * abs(bend * phi):
                break
        bend, rest = dd_add(bend, rest, third * step, 0.0)
        if abs(curvature) < BEND_FROM:
            bend = curvature
            rest = 0.0
    w[PHI_LOW + j] = low
    w[BEND + j] = bend
    w[BEND_LOW + j] = rest


@routine
def energy_above(j: int, phi: float, angle: float, v: float, below: float, w: Array) -> float:
    """Energy of a state above equilibrium j; with all digits where it is less than ``below``.

    ``angle`` is phi, reduced to a turn.
    """
    a = w[A]
    if below < math.inf:
        sine = math.sin(0.5 * (angle - w[PHI + j]))
        bend = w[CURVATURE + j] + a * math.sin(0.5 * (angle + 3.0 * w[PHI + j])) * sine
        gap = 0.5 * v * v + 2.0 * sine * sine * bend
        if not abs(gap) < below:
            return gap
    sharpen(j, w)
    h, low = two_sum(phi, -w[PHI + j])
    h, low, _ = reduce_angle(h, low - w[PHI_LOW + j])
    h *= 0.5
    low *= 0.5
    _, _, sh, sl = dd_cos_sin(h, low)
    th, tl = two_sum(h, 2.0 * w[PHI + j])
    _, _, ph, pl = dd_cos_sin(th, tl + low + 2.0 * w[PHI_LOW + j])
    ph, pl = dd_multiply(ph, pl, sh, sl)
    ph, pl = dd_multiply(ph, pl, a, 0.0)
    ph, pl = dd_add(ph, pl, w[BEND + j], w[BEND_LOW + j])
    sh, sl = dd_multiply(sh, sl, sh, sl)
    ph, pl = dd_multiply(ph, pl, sh, sl)
    kh, kl = two_product(v, v)
    ph, pl = dd_add(2.0 * ph, 2.0 * pl, 0.5 * kh, 0.5 * kl)
    return ph


@inline
def next_to_axis(
    x: np.float64, y: np.float64, a: float, b: float, c: float
) -> tuple[np.float64, np.float64]:
    """B/x + A = C/y of an equilibrium with a small y, and y, each with its digits.

    What remains of B + A and y, where they cancel, is known from y; else it knows y better.
    """
    apart = math.copysign(1.0, x) * b + a
    bend = -a * y * y / (1.0 + abs(x))
    rest = (apart + bend) / abs(x)
    if abs(apart + bend) < 1e-3 * (abs(apart) + abs(bend)):
        return c / y, y
    return rest, (c / rest if rest != 0.0 else y)


@routine
def multiplier(j: int, w: Array) -> int:
    """Row of cosine, sine, mu = B/cos and A - mu = -C/sin of equilibrium j, each with its digits.

    mu and A - mu are those of the equivalent system with A >= 0: both >= 0 at inner equilibria.
    They are worked out when they are first needed.
    """
    row = MULTIPLIER + 4 * j
    if w[row] == w[row]:
        return row
    a = w[A]
    b = w[B]
    c = w[C]
    x = np.float64(math.cos(w[PHI + j]))
    y = np.float64(math.sin(w[PHI + j]))
    if abs(y) < 1e-3:
        sharpen(j, w)
        rest, y = next_to_axis(x, y + w[PHI_LOW + j] * x, -a, b, c)
        mu = b / x
    elif abs(x) < 1e-3:
        sharpen(j, w)
        mu, x = next_to_axis(y, x - w[PHI_LOW + j] * y, a, c, b)
        rest = c / y
    else:
        # The quotient, or through the other one, whichever rounding harms less.
        mu = b / x if abs(x) > abs(y) or abs(a + c / y) < abs(a * x) else a + c / y
        rest = c / y if abs(y) >= abs(x) or abs(b / x - a) < abs(a * y) else b / x - a
    w[row] = x
    w[row + 1] = y
    w[row + 2] = mu if a >= 0.0 else rest
    w[row + 3] = -rest if a >= 0.0 else -mu
    return row


@inline
def energy_between(j: int, i: int, w: Array) -> float:
    """V(phi_i) - V(phi_j) = (mu_j - mu_i) sin((phi_i - phi_j)/2)^2, exactly 0 for equal saddles."""
    mu_j = w[multiplier(j, w) + 2]
    mu_i = w[multiplier(i, w) + 2]
    sine = math.sin(0.5 * (w[PHI + i] - w[PHI + j]))
    return (mu_j - mu_i) * sine * sine


@routine
def offset(phi: float, j: int, w: Array) -> float:
    """Angle from equilibrium j in [0, 2 pi)."""
    half = 0.5 * (phi - w[PHI + j])
    angle = 2.0 * math.atan2(math.sin(half), math.cos(half))
    return angle if angle >= 0.0 else angle + TWO_PI
