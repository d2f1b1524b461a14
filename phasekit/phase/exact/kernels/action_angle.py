"""Action-angle coordinates of a state, and the state that has given ones.

The angle is the phase: 0 at the greatest angle phi of a libration, at the lower center for a
rotation, and growing with time. The energy of a given action is found by Newton's method, since
the frequency is the slope of energy against action.
"""

from __future__ import annotations

import math

import numpy as np

from phasekit.arrays import Array
from phasekit.errors import OrbitFamily
from phasekit.numerics.compile import inline, routine
from phasekit.numerics.double_double import TWO_PI, reduce_angle
from phasekit.phase.exact.kernels.equilibria import (
    LOWER_CENTER,
    LOWER_SADDLE,
    UPPER_CENTER,
    UPPER_SADDLE,
)
from phasekit.phase.exact.kernels.levels import (
    ANGLE,
    AROUND,
    ASYMPTOTE,
    DIRECTION,
    FREE,
    FREE_FROM,
    GAP,
    HARMONIC,
    INVALID,
    MODE,
    PLACE,
    RATE,
    REFERENCE,
    REST,
    SINGLE,
    SWING,
    TURN,
    classify_level,
    well,
)
from phasekit.phase.exact.kernels.locate import locate
from phasekit.phase.exact.kernels.motion import phase_at
from phasekit.phase.exact.kernels.orbits import finish
from phasekit.phase.exact.kernels.shape import (
    ACTION,
    FIRST,
    OMEGA,
    SECOND,
    SLOPE,
    X0,
    Y_PRODUCT,
    M,
    N,
    shape,
)
from phasekit.phase.exact.kernels.system import CURVATURE, PHI, UNIT, A, energy_between, multiplier

# What the action of an orbit may miss of the one that was asked for.
FOUND_TO = 1e-9
NOT_COMPUTED = int(OrbitFamily.NOT_COMPUTED)
NONE = int(OrbitFamily.NONE)
LOWER_WELL = int(OrbitFamily.LOWER_WELL)
UPPER_WELL = int(OrbitFamily.UPPER_WELL)
OUTER = int(OrbitFamily.OUTER)
FORWARD = int(OrbitFamily.FORWARD)
BACKWARD = int(OrbitFamily.BACKWARD)


@inline
def family(w: Array) -> int:
    """Family of the orbit."""
    mode = w[MODE]
    if mode == INVALID:
        return NOT_COMPUTED
    if mode == TURN or mode == FREE:
        return FORWARD if w[DIRECTION] > 0.0 else BACKWARD
    if mode == HARMONIC:
        return UPPER_WELL if w[REFERENCE] == UPPER_CENTER else LOWER_WELL
    if mode != SWING:
        return NONE
    if w[PLACE] == SINGLE or w[PHI + UPPER_CENTER] != w[PHI + UPPER_CENTER]:
        return LOWER_WELL
    if w[PLACE] == AROUND:
        return OUTER
    _, center = well(w[ANGLE], w)
    return UPPER_WELL if center == UPPER_CENTER else LOWER_WELL


@inline
def angle(w: Array) -> float:
    """Angle in [0, 2 pi) of the state; NaN for an equilibrium and on a separatrix."""
    mode = w[MODE]
    theta = math.nan
    if mode == SWING:
        theta = phase_at(w[ANGLE], w[RATE], w)
    elif mode == TURN:
        origin = phase_at(w[PHI + LOWER_CENTER], 0.0, w)
        theta = w[DIRECTION] * (phase_at(w[ANGLE], 0.0, w) - origin)
    elif mode == HARMONIC:
        j = int(w[REFERENCE])
        x, _, _ = reduce_angle(w[ANGLE] - w[PHI + j], 0.0)
        theta = math.atan2(-w[RATE] / np.sqrt(w[CURVATURE + j]), x)
    elif mode == FREE:
        origin = w[PHI + LOWER_CENTER]
        theta = w[DIRECTION] * (w[ANGLE] - (origin if origin == origin else 0.0))
    if theta != theta:
        return theta
    theta, _, _ = reduce_angle(theta, 0.0)
    theta = theta + TWO_PI if theta < 0.0 else theta
    return theta if theta < TWO_PI else 0.0


@routine
def twist(w: Array) -> float:
    """Slope of the frequency against the action: every step of the orbit, differentiated.

    The frequency is the mean of a = (y1 y2)^(1/4) and b = (y1 + y2 + 2 sqrt(y1 y2))^(1/2)/2 in
    either mode, and its slope against the action is that against the energy times itself.
    """
    mode = w[MODE]
    j = int(w[REFERENCE])
    if mode == HARMONIC:
        # omega = omega_0 (1 + amplitude^2 (V''''/(16 V'') - 5 V'''^2/(48 V''^2)))
        row = multiplier(j, w)
        x = w[row]
        y = w[row + 1]
        m = w[row + 2]
        n = w[row + 3]
        slope = w[CURVATURE + j]
        third = 3.0 * w[A] * x * y
        fourth = 4.0 * w[A] * (x - y) * (x + y) - (
            m * x * x - n * y * y if w[A] >= 0.0 else m * y * y - n * x * x
        )
        return fourth / (8.0 * slope) - 5.0 * third * third / (24.0 * slope * slope)
    if mode == FREE:
        return 1.0
    if mode != SWING and mode != TURN:
        return math.nan
    x = w[X0]
    g = w[Y_PRODUCT]
    c2 = w[SLOPE] + 2.0 * w[GAP]
    spread = w[M] - w[N]
    dx = 2.0 * (x + w[M]) * (w[N] - x) / g
    dg = (6.0 * x + 2.0 * c2) * dx + 4.0 * x + 2.0 * spread
    if mode == SWING:
        a = w[FIRST]
        b = w[SECOND]
    else:
        a = np.sqrt(w[FIRST] * w[SECOND])
        b = 0.5 * (w[FIRST] + w[SECOND])
    da = 0.25 * dg * a / g
    db = 0.125 * (dg / (a * a) - 2.0 - 3.0 * dx) / b
    for _ in range(16):
        root = np.sqrt(a * b)
        da, db = 0.5 * (da + db), 0.5 * (da * b + a * db) / root
        a, b = 0.5 * (a + b), root
        if abs(a - b) <= 5e-16 * a:
            break
    return 0.5 * (da + db) * a


@routine
def orbit_at(base: int, gap: float, center: int, w: Array) -> float:
    """Work out the orbit at an energy above an equilibrium, and return its action."""
    classify_level(base, gap, center, 0.0, True, w)
    shape(w)
    finish(w)
    return w[ACTION]


@routine
def find_action(code: int, action: float, w: Array) -> None:
    """Work out the orbit of a family that has an action, within the family's limits."""
    single = w[PHI + UPPER_CENTER] != w[PHI + UPPER_CENTER]
    center = UPPER_CENTER if code == UPPER_WELL else LOWER_CENTER
    base = center
    upper = 0.5 * action * action
    if code == OUTER:
        base = LOWER_SADDLE
        upper = energy_between(LOWER_SADDLE, UPPER_SADDLE, w) / w[UNIT] / w[UNIT]
    elif code == FORWARD or code == BACKWARD:
        base = UPPER_SADDLE
    else:
        upper = (
            energy_between(center, UPPER_SADDLE if single else LOWER_SADDLE, w) / w[UNIT] / w[UNIT]
        )
    origin = w[PHI + LOWER_CENTER]
    if base == UPPER_SADDLE and not (origin == origin and action * w[UNIT] < FREE_FROM):
        w[MODE] = FREE
        w[ANGLE] = origin if origin == origin else 0.0  # without force
        w[RATE] = action * w[UNIT]
        w[DIRECTION] = -1.0 if code == BACKWARD else 1.0
        return
    lower = 0.0
    top = upper
    gap = 0.5 * upper
    last = False
    for _ in range(200):
        found = orbit_at(base, gap, center, w)
        if w[MODE] == REST:
            break
        step = (found - action) * w[OMEGA]
        if found < action:
            lower = gap
        else:  # or NaN, on the separatrix within rounding
            upper = gap
        new = gap - step
        if base == center and action < 0.5 * found:  # the action grows like a power of the gap
            power = found * w[OMEGA] / gap
            new = gap * math.exp(min(power * math.log(max(action, 1e-300) / found), 0.0))
        # Newton squares the error, but next to a separatrix only that against the distance to it.
        close = abs(step) <= max(1e-8 * min(gap, top - gap), 4e-16 * gap)
        if not (lower < new < upper):
            new = gap if close else 0.5 * (lower + upper)
        gap = new
        if last or lower == upper:
            break
        last = close
    found = orbit_at(base, gap, center, w)
    if found != action and w[MODE] == ASYMPTOTE:
        found = orbit_at(base, lower, center, w)
    if not abs(found - action) <= FOUND_TO * action:
        w[MODE] = INVALID
    if code == BACKWARD:
        w[DIRECTION] = -1.0


@inline
def state_at(theta: float, w: Array) -> tuple[float, float]:
    """State at an angle of the orbit that is worked out; phi in [-pi, pi]."""
    mode = w[MODE]
    unit = w[UNIT]
    if not abs(theta) < math.inf or mode == INVALID:
        return math.nan, math.nan
    if mode == REST:
        return w[ANGLE], 0.0
    theta, _, _ = reduce_angle(theta, 0.0)
    if mode == FREE:
        phi, _, _ = reduce_angle(w[ANGLE] + w[DIRECTION] * theta, 0.0)
        return phi, w[DIRECTION] * w[RATE] / unit
    if mode == HARMONIC:
        j = int(w[REFERENCE])
        omega = np.sqrt(w[CURVATURE + j])
        width = np.sqrt(2.0 * w[GAP]) / omega
        phi, _, _ = reduce_angle(w[PHI + j] + width * math.cos(theta), 0.0)
        return phi, -width * omega * math.sin(theta) / unit
    if mode == TURN:
        theta = w[DIRECTION] * theta + phase_at(w[PHI + LOWER_CENTER], 0.0, w)
    elif mode != SWING:
        return math.nan, math.nan
    local, rate = locate(np.float64(math.sin(theta)), np.float64(math.cos(theta)), w)
    phi, _, _ = reduce_angle(local, 0.0)
    return phi, (w[DIRECTION] if mode == TURN else 1.0) * rate / unit + 0.0  # not -0
