"""Where a state stands: the kind of its orbit, and its energy above the nearest equilibrium.

The energy above an equilibrium decides on which side of a separatrix a state lies, and carries the
digits of its period there. So it is never the difference of two energies: it is computed from the
angle to the equilibrium, and where that cancels too, in double-double arithmetic.
"""

from __future__ import annotations

import math

import numpy as np

from phasekit.errors import OrbitKind
from phasekit.kernels.compile import Array, inline, routine
from phasekit.kernels.double_double import (
    TWO_PI,
    dd_add,
    dd_cos_sin,
    dd_multiply,
    reduce_angle,
    two_product,
)
from phasekit.kernels.equilibria import LOWER_CENTER, LOWER_SADDLE, UPPER_CENTER, UPPER_SADDLE

NOT_COMPUTED = int(OrbitKind.NOT_COMPUTED)
EQUILIBRIUM = int(OrbitKind.EQUILIBRIUM)
LIBRATION = int(OrbitKind.LIBRATION)
ROTATION = int(OrbitKind.ROTATION)
ASYMPTOTIC = int(OrbitKind.ASYMPTOTIC)

# How the motion is computed: not at all, at rest, as V = 0, as a harmonic oscillation, or in full.
INVALID, REST, FREE, HARMONIC, ASYMPTOTE, SWING, TURN = range(7)

# Where the orbit lies: inside the lobe on the left or right of the lower saddle, round both
# lobes, or in a portrait without lobes.
LEFT, RIGHT, AROUND, SINGLE = range(4)

# One orbit is a flat work array. First the system: coefficients in a unit of time that brings
# the sum of their sizes into [1, 4), that unit; angles, V'' and multipliers of the equilibria. Then
# the state and its energy, how it moves, its reference, the energy above it, and where it lies.
# Last, the energy above an equilibrium up to which it is computed in double-double arithmetic.
A, B, C, UNIT, PHI, CURVATURE, MULTIPLIER = 0, 1, 2, 3, 4, 8, 12
START, TURNS, ANGLE, RATE, ENERGY, DIRECTION, MODE, REFERENCE, GAP, PLACE = range(28, 38)
DOUBLE_TO = 38
# Then the rows of `phasekit.kernels.shape`.
ORBIT = 39

# Beyond this speed (against the root of the largest coefficient) V changes no digit.
FREE_FROM = 1e9
# Energies below this (against V'' and V''^3) move harmonically to all digits.
HARMONIC_TO = 1e-30
# For one orbit among many, and for a motion, where every digit counts.
SOME, ALL = 1e-3, math.inf
ROUNDING = 2.0**-53
# Smaller energies above an equilibrium, degenerate or not, are raised to these, lest they
# underflow.
LEAST, TINIEST = 1e-290, 1e-307
# What double-double arithmetic leaves of a gap that is none.
NOISE = 2e-31
LARGEST = 1.7976931348623157e308


@inline
def load(a: float, b: float, c: float, w: Array) -> bool:
    """Scale a system by a power of four; whether it is valid and has a force."""
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


@routine
def energy_above(j: int, w: Array) -> float:
    """Energy of the state above equilibrium j; where it is small, with all digits."""
    a = w[A]
    v = w[RATE]
    # V(phi) - V(phi_s) as a product, which is accurate next to the equilibrium.
    sine = math.sin(0.5 * (w[ANGLE] - w[PHI + j]))
    bend = w[CURVATURE + j] + a * math.sin(0.5 * (w[ANGLE] + 3.0 * w[PHI + j])) * sine
    gap = 0.5 * v * v + 2.0 * sine * sine * bend
    if not abs(gap) < w[DOUBLE_TO]:
        return gap
    ch, cl, sh, sl = dd_cos_sin(w[START])
    vh, vl = potential_dd(a, w[B], w[C], ch, cl, sh, sl)
    ch, cl, sh, sl = dd_cos_sin(w[PHI + j])
    uh, ul = potential_dd(a, w[B], w[C], ch, cl, sh, sl)
    h, low = dd_add(vh, vl, -uh, -ul)
    kh, kl = two_product(v, v)
    h, low = dd_add(h, low, 0.5 * kh, 0.5 * kl)
    return h


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
    # The quotient, or through the other one, whichever rounding harms less.
    mu = b / x if abs(x) > abs(y) else a + c / y
    rest = c / y if abs(y) >= abs(x) else b / x - a
    if abs(mu) < abs(a * x):
        mu = b / x
    if abs(rest) < abs(a * y):
        rest = c / y
    # Next to an axis the small coefficient knows the angle better than a double does.
    size = abs(a) + abs(mu)
    if abs(y) < 1e-3 and abs(rest) > 1e-3 * size:
        y = c / rest
    if abs(x) < 1e-3 and abs(mu) > 1e-3 * size:
        x = b / mu
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


@routine
def settle(j: int, gap: float, place: int, kind: int, w: Array) -> None:
    """Fix the reference of an orbit, its energy above that, where it lies, and how it moves."""
    w[REFERENCE] = j
    if j == LOWER_CENTER or j == UPPER_CENTER:
        gap = max(gap, 0.0)
    least = LEAST if w[CURVATURE + j] == 0.0 else TINIEST
    if gap != 0.0 and abs(gap) < least:
        gap = least if gap > 0.0 else -least
    w[GAP] = gap
    w[PLACE] = place
    slope = w[CURVATURE + j]
    mode = TURN if kind == ROTATION else SWING
    if gap == 0.0 or (slope > 0.0 and gap < HARMONIC_TO * min(slope, slope * slope * slope)):
        mode = HARMONIC if slope > 0.0 else REST
    w[MODE] = ASYMPTOTE if kind == ASYMPTOTIC else mode


@inline
def classify(phi: float, dphi: float, valid: bool, w: Array) -> int:
    """Kind of the orbit through a state, its reference, energy gap and place."""
    w[MODE] = INVALID
    w[ENERGY] = math.nan
    if not (abs(phi) <= LARGEST and abs(dphi) <= LARGEST and (valid or w[A] == 0.0)):
        return NOT_COMPUTED
    w[START] = phi
    w[ANGLE], _, w[TURNS] = reduce_angle(phi, 0.0)
    w[RATE] = dphi * w[UNIT]
    w[DIRECTION] = -1.0 if dphi < 0.0 else 1.0
    v = w[RATE]
    c = np.float64(math.cos(phi))
    s = np.float64(math.sin(phi))
    w[ENERGY] = 0.5 * v * v
    if not valid or not abs(v) < FREE_FROM:
        w[MODE] = FREE if dphi != 0.0 else REST
        return ROTATION if dphi != 0.0 else EQUILIBRIUM
    w[ENERGY] += (0.5 * w[A] * c - w[B]) * c - w[C] * s
    force = (w[B] - w[A] * c) * s - w[C] * c
    if v == 0.0 and force == 0.0:
        w[MODE] = REST
        return EQUILIBRIUM
    # What the rounding of the state changes in its energy.
    slack = 8.0 * ROUNDING * (v * v + abs(force) * max(1.0, abs(phi))) + NOISE
    above = energy_above(UPPER_SADDLE, w)
    if abs(above) <= slack:
        settle(UPPER_SADDLE, above, SINGLE, ASYMPTOTIC, w)
        return ASYMPTOTIC
    if above > 0.0:
        settle(UPPER_SADDLE, above, SINGLE, ROTATION, w)
        return ROTATION
    if w[PHI + LOWER_SADDLE] != w[PHI + LOWER_SADDLE]:  # a single saddle
        own = energy_above(LOWER_CENTER, w)
        if own < -above:
            settle(LOWER_CENTER, own, SINGLE, LIBRATION, w)
        else:
            settle(UPPER_SADDLE, above, SINGLE, LIBRATION, w)
        return LIBRATION
    within = energy_above(LOWER_SADDLE, w)
    if abs(within) <= slack:
        settle(LOWER_SADDLE, within, AROUND, ASYMPTOTIC, w)
        return ASYMPTOTIC
    if within > 0.0 or w[PHI + UPPER_CENTER] != w[PHI + UPPER_CENTER]:
        enclose(energy_above(LOWER_CENTER, w), within, above, w)
        return LIBRATION
    place, center = well(phi, w)
    own = energy_above(center, w)
    if own < -within:
        settle(center, own, place, LIBRATION, w)
    else:
        settle(LOWER_SADDLE, within, place, LIBRATION, w)
    return LIBRATION


@routine
def well(phi: float, w: Array) -> tuple[int, int]:
    """Which lobe of the figure-eight an angle belongs to, and the center inside."""
    barrier = offset(w[PHI + UPPER_SADDLE], LOWER_SADDLE, w)
    right = offset(phi, LOWER_SADDLE, w) < barrier
    lower = (offset(w[PHI + LOWER_CENTER], LOWER_SADDLE, w) < barrier) == right
    return RIGHT if right else LEFT, LOWER_CENTER if lower else UPPER_CENTER


@inline
def enclose(own: float, within: float, above: float, w: Array) -> None:
    """Choose the reference of a libration round more than one equilibrium.

    Its energy is ``own`` above the lower center, ``within`` above the lower saddle.
    """
    if abs(within) < min(-above, own):
        settle(LOWER_SADDLE, within, AROUND, LIBRATION, w)
    elif own < -above:
        settle(LOWER_CENTER, own, AROUND, LIBRATION, w)
    else:
        settle(UPPER_SADDLE, above, AROUND, LIBRATION, w)


@routine
def classify_level(j: int, gap: float, center: int, slack: float, valid: bool, w: Array) -> int:
    """Kind of the orbit at an energy above equilibrium j that a center sees, as in `classify`."""
    w[MODE] = INVALID
    if not (valid and abs(gap) <= LARGEST):
        return NOT_COMPUTED
    gap = gap * w[UNIT] * w[UNIT]
    slack = slack * w[UNIT] * w[UNIT]
    own = gap if j == center else gap + energy_between(center, j, w)
    if not own >= -slack:
        return NOT_COMPUTED
    w[START] = w[PHI + center]
    w[ANGLE] = w[PHI + center]
    w[TURNS] = 0.0
    w[RATE] = np.sqrt(2.0 * max(own, 0.0))
    w[DIRECTION] = 1.0
    if not w[RATE] < FREE_FROM:
        w[MODE] = FREE
        return ROTATION
    if own <= slack:
        w[MODE] = REST
        return EQUILIBRIUM
    above = gap if j == UPPER_SADDLE else gap + energy_between(UPPER_SADDLE, j, w)
    if abs(above) <= slack:
        settle(UPPER_SADDLE, 0.0, SINGLE, ASYMPTOTIC, w)
        return ASYMPTOTIC
    if above > 0.0:
        settle(UPPER_SADDLE, above, SINGLE, ROTATION, w)
        return ROTATION
    if w[PHI + LOWER_SADDLE] != w[PHI + LOWER_SADDLE]:
        if own < -above:
            settle(center, own, SINGLE, LIBRATION, w)
        else:
            settle(UPPER_SADDLE, above, SINGLE, LIBRATION, w)
        return LIBRATION
    within = gap if j == LOWER_SADDLE else gap + energy_between(LOWER_SADDLE, j, w)
    if abs(within) <= slack:
        settle(LOWER_SADDLE, 0.0, AROUND, ASYMPTOTIC, w)
        return ASYMPTOTIC
    if within > 0.0 or w[PHI + UPPER_CENTER] != w[PHI + UPPER_CENTER]:
        enclose(gap + energy_between(LOWER_CENTER, j, w), within, above, w)
    elif own < -within:
        place, _ = well(w[ANGLE], w)
        settle(center, own, place, LIBRATION, w)
    else:
        place, _ = well(w[ANGLE], w)
        settle(LOWER_SADDLE, within, place, LIBRATION, w)
    return LIBRATION


@routine
def neighbor(j: int, right: bool, w: Array) -> int:
    """The center next to saddle j on one side."""
    if w[PHI + UPPER_CENTER] != w[PHI + UPPER_CENTER]:
        return LOWER_CENTER
    first = offset(w[PHI + LOWER_CENTER], j, w) < offset(w[PHI + UPPER_CENTER], j, w)
    return LOWER_CENTER if first == right else UPPER_CENTER
