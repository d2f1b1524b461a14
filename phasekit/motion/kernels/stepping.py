"""Adaptive steps of eight motions: how long, whether accepted, and the turns at which they end.

A lane's numbers stand in two arrays, `real` and `whole`, whose rows are named here. Quadratic
damping is smooth on either side of phi' = 0 alone: there the steps of such motions end, and within
a step its sign, a parameter of the rates, stays.
"""

from __future__ import annotations

import math

import numpy as np

from phasekit.arrays import Array, Index
from phasekit.motion.kernels.dop853 import (
    ATOL,
    BESIDE,
    MOST,
    OWN,
    RTOL,
    UNIT,
    attempt,
    errors,
    errors_of_flow,
    next_step,
    rates,
)
from phasekit.motion.lost import ARRIVED, EXHAUSTED, FAILED, RUNNING
from phasekit.numerics.compile import inline, routine
from phasekit.numerics.lanes import LANES, invoke

#: Rows of `real`: time, next step, the step that is tried, where the lane stops, error of the
#: step over what is allowed, step that is tried to end at a turn. Of steps by series their number,
#: the state, and whether the last was rejected; the greatest coordinate or rate so far, and that
#: of the first steps; of one step alone what was gone, 0 where it was rejected, when it began, the
#: unit of its time, and further rows with its coefficients.
T, H, TRY, END, ERROR, AIM, COUNT, OUTCOME, REFUSED, SIZE, FIRST, GONE, START, SCALE = range(14)
TERMS = 14
REALS, KEPT = TERMS, GONE
#: Rows of `whole`: cell, state, whether the step was accepted, steps so far, whether the last was
#: rejected, tries to end at a turn.
CELL, STATE, ACCEPTED, STEPS, REJECTED, AIMS = range(6)
WHOLES = 6

#: In place of `ACCEPTED`: its state was changed between steps.
CHANGED = 2

#: First steps, steps after which it is foreseen that too many would be needed, and how often as
#: great as in the first ones, and as its window, a motion is then.
EARLY, TRIAL, BEYOND = 16, 4096, 1e6

_EPS = float(np.finfo(float).eps)
_MOST_AIMS = 12
#: Part of the time to go that a first step takes at least.
_SHORTEST = 1e-14
#: And at most, where it is told by rates that are hardly there.
_LONGEST = 1e-8


@routine
def load(
    lane: int,
    cell: int,
    states: Array,
    parameters: Array,
    x: Array,
    p: Array,
    kink: int,
    real: Array,
    whole: Index,
) -> None:
    """Put a cell into a lane."""
    whole[CELL, lane] = cell
    whole[STATE, lane] = RUNNING
    whole[STEPS, lane] = whole[REJECTED, lane] = whole[AIMS, lane] = 0
    for c in range(states.shape[1]):
        x[c * LANES + lane] = states[cell, c]
    for c in range(parameters.shape[0]):
        p[c * LANES + lane] = parameters[c, cell]
    if kink >= 0:
        p[kink * LANES + lane] = np.sign(states[cell, 1])
    real[T, lane] = real[H, lane] = real[AIM, lane] = 0.0
    real[COUNT, lane] = real[REFUSED, lane] = real[SIZE, lane] = real[FIRST, lane] = 0.0
    whole[ACCEPTED, lane] = CHANGED


@routine
def careful_step(lane: int, x: Array, f: Array, span: float) -> float:
    """A first step where states or rates are next to nothing beside their errors, in any unit.

    A state that is 0 tells no time.
    """
    h = 0.0
    for m in range(lane, x.size, LANES):
        if x[m] != 0.0 and f[m] != 0.0:
            h = max(h, 0.01 * abs(x[m] / f[m]))
    if not 0.0 < h:
        return 1e-6
    return min(max(h, _SHORTEST * span), _LONGEST * span) if span < np.inf else h


@routine
def begin(
    lane: int, x: Array, k: Array, p: Array, kink: int, real: Array, rtol: float, atol: float
) -> None:
    """First step of a motion, and the sign of its rate."""
    sense = 1.0 if real[END, lane] >= real[T, lane] else -1.0
    size = speed = 0.0
    for m in range(lane, x.size, LANES):
        scale = atol + rtol * abs(x[m])
        size += (x[m] / scale) ** 2
        speed += (k[0, m] / scale) ** 2
    size, speed = math.sqrt(size), math.sqrt(speed)
    span = abs(real[END, lane] - real[T, lane])
    h = 0.01 * size / speed if size > 1e-5 and speed > 1e-5 else careful_step(lane, x, k[0], span)
    real[H, lane] = sense * min(h, span)
    if kink >= 0 and x[LANES + lane] == 0.0:
        p[kink * LANES + lane] = np.sign(sense * k[0, LANES + lane])


@inline
def turn_at(v0: float, v1: float, a0: float, a1: float) -> float:
    """Part of a step at which the cubic with these ends and slopes vanishes; v0 v1 < 0."""
    low, high = 0.0, 1.0
    for _ in range(60):
        s = 0.5 * (low + high)
        r = 1.0 - s
        v = r * r * ((1.0 + 2.0 * s) * v0 + s * a0) + s * s * ((1.0 + 2.0 * r) * v1 - r * a1)
        if (v > 0.0) == (v0 > 0.0):
            low = s
        else:
            high = s
    return 0.5 * (low + high)


@routine
def ends_well(
    lane: int, x: Array, k: Array, y: Array, p: Array, kink: int, real: Array, whole: Index
) -> bool:
    """Whether a step may end where it does: not beyond a turn."""
    tried, rate = real[TRY, lane], y[LANES + lane]
    sign = p[kink * LANES + lane]
    if sign * rate >= 0.0 and real[AIM, lane] == 0.0:
        return True
    slope = k[12, LANES + lane]
    rest = -rate / slope if slope != 0.0 else 0.0
    close = abs(rest) <= 4.0 * _EPS * max(abs(real[T, lane]), abs(tried))
    if close or whole[AIMS, lane] >= _MOST_AIMS or sign == 0.0:
        sense = 1.0 if tried >= 0.0 else -1.0
        turned = np.sign(sense * slope)
        p[kink * LANES + lane] = turned if turned != 0.0 else np.sign(rate)
        real[AIM, lane] = 0.0
        whole[AIMS, lane] = 0
        return True
    if sign * rate < 0.0:  # somewhat before: by the cubic, which the next tries refine
        before, bend = x[LANES + lane], k[0, LANES + lane]
        if sign * before > 0.0:
            aim = tried * turn_at(before, rate, tried * bend, tried * slope)
        else:
            aim = tried + rest
    else:
        aim = tried + rest
    sense = 1.0 if tried >= 0.0 else -1.0
    if not 0.0 < sense * aim < 2.0 * abs(tried):
        aim = 0.5 * tried
    real[AIM, lane] = aim
    whole[AIMS, lane] += 1
    return False


@routine
def is_beyond(lane: int, limits: Array, y: Array, real: Array) -> bool:
    """Whether a motion far from where it began needs too many steps as short as this one.

    On the way to infinity in finite time steps become the shorter the farther it is: the time is
    never over.
    """
    rest = abs(real[END, lane] - real[T, lane])
    if not rest > limits[MOST, 0] * abs(real[TRY, lane]):
        return False
    size, scale, states = 0.0, real[FIRST, lane], 2
    if limits.shape[0] > OWN:
        states = (limits.shape[0] - OWN) // 2
        for c in range(states):
            own = limits[OWN + 2 * c + 1, 0]
            if own < np.inf:
                scale = max(scale, own)
    for c in range(states):
        size = max(size, abs(y[c * LANES + lane]))
    return size > BEYOND * scale


@inline
def judge(
    lane: int,
    limits: Array,
    x: Array,
    k: Array,
    y: Array,
    p: Array,
    kink: int,
    real: Array,
    whole: Index,
) -> None:
    """Accept the step of a lane or not, and say how long the next one is."""
    whole[STEPS, lane] += 1
    error, tried = real[ERROR, lane], real[TRY, lane]
    change = next_step(error)
    if not error <= 1.0:
        whole[REJECTED, lane] = 1
        real[AIM, lane] = 0.0
        real[H, lane] = tried * min(change, 1.0)
        if not abs(real[H, lane]) > 4.0 * _EPS * abs(real[T, lane]) or real[H, lane] == 0.0:
            whole[STATE, lane] = FAILED
    elif kink < 0 or ends_well(lane, x, k, y, p, kink, real, whole):
        whole[ACCEPTED, lane] = 1
        if whole[REJECTED, lane] == 1:
            change = min(change, 1.0)
        whole[REJECTED, lane] = 0
        # A step that was cut short says little of the next one.
        if abs(tried * change) > abs(real[H, lane]) or abs(tried) >= abs(real[H, lane]):
            real[H, lane] = tried * change
    taken = whole[STEPS, lane]
    if taken <= EARLY:
        real[FIRST, lane] = real[SIZE, lane]
    if whole[STATE, lane] == RUNNING and (
        taken >= int(limits[MOST, 0])
        or taken >= TRIAL
        and taken % EARLY == 0
        and is_beyond(lane, limits, y, real)
    ):
        whole[STATE, lane] = EXHAUSTED


@routine
def advance(
    address: int,
    table: Array,
    limits: Array,
    x: Array,
    k: Array,
    y: Array,
    p: Array,
    z: Array,
    kink: int,
    h: Array,
    real: Array,
    whole: Index,
) -> None:
    """Try a step of every lane, and judge it; y and k[12] are its end, x and k[0] its start."""
    for lane in range(LANES):
        rest = real[END, lane] - real[T, lane]
        step = real[AIM, lane] if real[AIM, lane] != 0.0 else real[H, lane]
        if whole[STATE, lane] != RUNNING:
            step = 0.0
        elif abs(step) >= abs(rest):
            step = rest
        elif abs(step) > 0.5 * abs(rest) and real[AIM, lane] == 0.0:
            step = 0.5 * rest  # rather than leave a short one
        real[TRY, lane] = step
        whole[ACCEPTED, lane] = 0
    for m in range(x.size):
        h[m] = real[TRY, m % LANES]
    attempt(address, table, real[T], h, x, k, y, p, z)
    rtol, atol, unit = limits[RTOL, 0], limits[ATOL, 0], limits[UNIT, 0]
    if limits.shape[0] > OWN:
        errors_of_flow(h, x, y, k, limits, k[13:], real[ERROR], real[SIZE])
    else:
        errors(h, x, y, k, unit, rtol, atol, limits[BESIDE, 0], k[13:], real[ERROR], real[SIZE])
    for lane in range(LANES):
        if whole[STATE, lane] == RUNNING:
            judge(lane, limits, x, k, y, p, kink, real, whole)


@routine
def commit(x: Array, k: Array, y: Array, real: Array, whole: Index) -> None:
    """Go on to the ends of the accepted steps."""
    for lane in range(LANES):
        if whole[ACCEPTED, lane] == 0:
            continue
        for m in range(lane, x.size, LANES):
            x[m] = y[m]
            k[0, m] = k[12, m]
        if real[TRY, lane] == real[END, lane] - real[T, lane]:
            real[T, lane] = real[END, lane]
            whole[STATE, lane] = ARRIVED
        else:
            real[T, lane] += real[TRY, lane]


@routine
def renew(
    address: int,
    table: Array,
    limits: Array,
    x: Array,
    k: Array,
    p: Array,
    z: Array,
    kink: int,
    h: Array,
    real: Array,
    whole: Index,
) -> None:
    """Rates of the lanes that were changed, and first steps of those that have none."""
    rates(address, table, real[T], h, 0.0, x, p, z, k[13])
    for lane in range(LANES):
        if whole[ACCEPTED, lane] != CHANGED:
            continue
        for m in range(lane, x.size, LANES):
            k[0, m] = k[13, m]
        if real[H, lane] == 0.0:
            begin(lane, x, k, p, kink, real, limits[RTOL, 0], limits[ATOL, 0])


@inline
def _run(series: int, x: Array, p: Array, real: Array, limits: Array) -> None:
    invoke(series, x, p, real, limits)


@routine
def by_series(series: int, x: Array, p: Array, real: Array, limits: Array, whole: Index) -> None:
    """Take steps by the machine code of `taylor`."""
    for lane in range(LANES):
        real[OUTCOME, lane] = whole[STATE, lane]
    _run(series, x, p, real, limits)
    for lane in range(LANES):
        whole[STATE, lane] = int(real[OUTCOME, lane])
        whole[STEPS, lane] = int(real[COUNT, lane])
