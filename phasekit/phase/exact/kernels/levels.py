"""Where a state stands: the kind of its orbit, and its energy above the nearest equilibrium."""

from __future__ import annotations

import math

import numpy as np

from phasekit.arrays import Array
from phasekit.errors import OrbitKind
from phasekit.numerics.compile import inline, routine
from phasekit.numerics.double_double import reduce_angle
from phasekit.phase.exact.kernels.equilibria import (
    LOWER_CENTER,
    LOWER_SADDLE,
    UPPER_CENTER,
    UPPER_SADDLE,
)
from phasekit.phase.exact.kernels.system import (
    CURVATURE,
    LARGEST,
    PHI,
    ROUNDING,
    STATE,
    UNIT,
    A,
    B,
    C,
    energy_above,
    energy_between,
    force,
    offset,
)

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

# Rows after those of `system`. The state and its energy, how it moves, its
# reference, the energy above it, and where it lies. Last, the energy above an equilibrium up to
# which it is computed in double-double arithmetic; then the rows of `shape`.
START, TURNS, ANGLE, RATE, ENERGY, DIRECTION, MODE, REFERENCE, GAP, PLACE = range(STATE, STATE + 10)
DOUBLE_TO = STATE + 10
ORBIT = STATE + 11

# Beyond this speed (against the root of the largest coefficient) V changes no digit.
FREE_FROM = 1e9
# Energies below this (against V'' and V''^3) move harmonically to all digits.
HARMONIC_TO = 1e-30
# For one orbit among many, and for a motion, where every digit counts.
SOME, ALL = 1e-3, math.inf
# Saddles with energies closer than this are level.
LEVEL_TO = 1e-15
# What the rounding of an angle of 1 changes in the energy above a saddle, in units of -V''.
NOISE = 2e-31
# Motion in full with less energy above an equilibrium, degenerate or not, is not computed, as
# products of it underflow.
LEAST, TINIEST = 1e-290, 1e-307


@routine
def settle(j: int, gap: float, place: int, kind: int, w: Array) -> None:
    """Fix the reference of an orbit, its energy above that, where it lies, and how it moves."""
    w[REFERENCE] = j
    if j == LOWER_CENTER or j == UPPER_CENTER:
        gap = max(gap, 0.0)
    w[GAP] = gap
    w[PLACE] = place
    slope = w[CURVATURE + j]
    mode = TURN if kind == ROTATION else SWING
    if gap == 0.0 or (slope > 0.0 and gap < HARMONIC_TO * min(slope, slope * slope * slope)):
        mode = HARMONIC if slope > 0.0 else REST
    least = LEAST if slope == 0.0 else TINIEST
    if abs(gap) < least and (mode == SWING or mode == TURN):
        mode = INVALID
    w[MODE] = ASYMPTOTE if kind == ASYMPTOTIC else mode


@routine
def above_level_saddles(phi: float, v: float, w: Array) -> tuple[float, float]:
    """Energy of a state above the lower and the upper saddle, whose energies almost agree.

    The nearer one tells; the farther one is compared with it.
    """
    rise = energy_between(LOWER_SADDLE, UPPER_SADDLE, w)
    lower = math.cos(w[ANGLE] - w[PHI + LOWER_SADDLE])
    if lower > math.cos(w[ANGLE] - w[PHI + UPPER_SADDLE]):
        within = energy_above(LOWER_SADDLE, phi, w[ANGLE], v, w[DOUBLE_TO], w)
        return within, within - rise
    above = energy_above(UPPER_SADDLE, phi, w[ANGLE], v, w[DOUBLE_TO], w)
    return above + rise, above


@inline
def classify(phi: float, dphi: float, valid: bool, w: Array) -> int:
    """Kind of the orbit through a state, its reference, energy gap and place."""
    w[MODE] = INVALID
    w[ENERGY] = math.nan
    if not (abs(phi) <= LARGEST and abs(dphi) <= LARGEST and (valid or w[A] == 0.0)):
        return NOT_COMPUTED
    w[START] = phi
    w[ANGLE], _, w[TURNS] = reduce_angle(phi, 0.0)
    angle = w[ANGLE]
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
    slope = force(phi, w)
    if v == 0.0 and slope == 0.0:
        w[MODE] = REST
        return EQUILIBRIUM
    single = w[PHI + LOWER_SADDLE] != w[PHI + LOWER_SADDLE]
    level = not single and abs(w[B] if w[A] >= 0.0 else w[C]) < LEVEL_TO
    within = math.nan
    # What the rounding of the state changes in its energy, turns being taken off exactly, and that
    # of angles at a saddle. But saddles that are almost level are told apart as far as the state
    # does.
    blur = NOISE * min(1.0, angle * angle)
    if level and energy_between(LOWER_SADDLE, UPPER_SADDLE, w) > 0.0:
        blur = 0.0
    slack = 8.0 * ROUNDING * (v * v + abs(slope * angle))
    if level:
        within, above = above_level_saddles(phi, v, w)
    else:
        above = energy_above(UPPER_SADDLE, phi, w[ANGLE], v, w[DOUBLE_TO], w)
    if abs(above) <= slack - blur * w[CURVATURE + UPPER_SADDLE]:
        settle(UPPER_SADDLE, above, SINGLE, ASYMPTOTIC, w)
        return ASYMPTOTIC
    if above > 0.0:
        settle(UPPER_SADDLE, above, SINGLE, ROTATION, w)
        return ROTATION
    if single:
        own = energy_above(LOWER_CENTER, phi, w[ANGLE], v, w[DOUBLE_TO], w)
        if own < -above:
            settle(LOWER_CENTER, own, SINGLE, LIBRATION, w)
        else:
            settle(UPPER_SADDLE, above, SINGLE, LIBRATION, w)
        return LIBRATION
    if not level:
        within = energy_above(LOWER_SADDLE, phi, w[ANGLE], v, w[DOUBLE_TO], w)
    if abs(within) <= slack - blur * w[CURVATURE + LOWER_SADDLE]:
        settle(LOWER_SADDLE, within, AROUND, ASYMPTOTIC, w)
        return ASYMPTOTIC
    if within > 0.0 or w[PHI + UPPER_CENTER] != w[PHI + UPPER_CENTER]:
        enclose(energy_above(LOWER_CENTER, phi, w[ANGLE], v, w[DOUBLE_TO], w), within, above, w)
        return LIBRATION
    place, center = well(angle, w)
    own = energy_above(center, phi, w[ANGLE], v, w[DOUBLE_TO], w)
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
