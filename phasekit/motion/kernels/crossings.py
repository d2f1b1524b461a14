"""Crossings: where functions of the state vanish along motions, in the lanes of the processor.

The functions come as machine code of the state and its rates, with their own rates behind them. A
step is looked at in parts; where a function turns towards zero between two of them, there as well.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from phasekit.arrays import Array, Index
from phasekit.arrays import Index as Rules
from phasekit.arrays import Index as Whole
from phasekit.motion.kernels.dop853 import ROWS, densify, rates, within
from phasekit.motion.kernels.stepping import (
    ACCEPTED,
    CELL,
    END,
    REALS,
    STATE,
    STEPS,
    WHOLES,
    T,
    advance,
    commit,
    load,
    renew,
)
from phasekit.motion.lost import ARRIVED, CROWDED, IDLE, LEFT, RESTING, RUNNING
from phasekit.numerics.compile import inline, kernel, routine
from phasekit.numerics.lanes import LANES, invoke

#: Columns of the rules, of a row for each function: where it counts (where it rises 1, falls -1,
#: both 0, nowhere 2); at which of its crossings the motion ends, 0 at none; the function that has
#: to be above zero there, -1 none; whether falls are taken from rises, so that the motion ends
#: after turns; and whether a function that touches zero crosses it.
SENSE, LAST, GATE, NET, TOUCHES = range(5)
NEVER = 2
#: Parts in which a step is looked at.
PARTS = 4
#: A function that comes so near to zero, as part of its values around, touches it.
TOUCH = 1e-8

_EPS = float(np.finfo(float).eps)


@inline
def _run(watch: int, x: Array, p: Array, z: Array, g: Array) -> None:
    invoke(watch, x, p, z, g)


class Steps(NamedTuple):
    """A step of all lanes, and what is seen in it: states w, their rates v, and functions g."""

    address: int
    watch: int
    table: Array
    h: Array
    x: Array
    y: Array
    k: Array
    p: Array
    z: Array
    real: Array
    w: Array
    v: Array
    clock: Array
    g: Array


@routine
def look(s: float, lanes: Steps) -> None:
    """Functions and their rates at a part of the steps of all lanes."""
    h, x, y, k, real, w, v = (
        lanes.h, lanes.x, lanes.y, lanes.k, lanes.real, lanes.w, lanes.v
    )  # fmt: skip
    if s == 0.0:
        for m in range(x.size):
            w[m], v[m] = x[m], k[0, m]
    elif s == 1.0:
        for m in range(x.size):
            w[m], v[m] = y[m], k[12, m]
    else:
        for m in range(x.size):
            w[m] = within(s, h[m], x, y, k, m)
        rates(lanes.address, lanes.table, real[T], h, s, w, lanes.p, lanes.z, v)
    for lane in range(LANES):
        lanes.clock[lane] = real[T, lane] + s * h[lane]
    for m in range(x.size):
        lanes.clock[LANES + m] = v[m]
    _run(lanes.watch, w, lanes.p, lanes.clock, lanes.g)


@inline
def turns_near(ga: float, da: float, gb: float, db: float) -> bool:
    """Whether a cubic with these ends and slopes over [0, 1] comes near to zero between them.

    Its ends have one sign, and its slopes turn it towards zero and away again.
    """
    sign = 1.0 if ga > 0.0 else -1.0
    a, b = sign * ga, sign * gb
    low, high = 0.0, 1.0
    for _ in range(30):
        s = 0.5 * (low + high)
        slope = (6.0 * s * s - 6.0 * s) * (a - b)
        slope += sign * ((3.0 * s * s - 4.0 * s + 1.0) * da + (3.0 * s * s - 2.0 * s) * db)
        if slope < 0.0:
            low = s
        else:
            high = s
    r = 1.0 - s
    least = r * r * ((1.0 + 2.0 * s) * a + s * sign * da)
    least += s * s * ((1.0 + 2.0 * r) * b - r * sign * db)
    return least < 0.5 * max(a, b)


@routine
def zero(
    lane: int,
    row: int,
    sa: float,
    ga: float,
    sb: float,
    gb: float,
    slopes: int,
    lanes: Steps,
) -> float:
    """Part of a step at which row `row` of g vanishes, between parts where its signs differ.

    By Newton's method where the row `slopes` further on has its rate, else by regula falsi.
    """
    if gb == 0.0:
        return sb
    s = sa - ga * (sb - sa) / (gb - ga)
    side = 0
    for _ in range(100):
        if not sa < s < sb:
            s = 0.5 * (sa + sb)
        look(s, lanes)
        value = lanes.g[row * LANES + lane]
        if value == 0.0 or sb - sa <= 4.0 * _EPS:
            return s
        if (value > 0.0) == (ga > 0.0):
            sa, ga = s, value
            if side == 1:
                gb *= 0.5
            side = 1
        else:
            sb, gb = s, value
            if side == -1:
                ga *= 0.5
            side = -1
        if slopes > 0:
            slope = lanes.g[(row + slopes) * LANES + lane] * lanes.h[lane]
            change = -value / slope if slope != 0.0 else 2.0
        else:
            change = sa - ga * (sb - sa) / (gb - ga) - s
        if abs(change) <= 2.0 * _EPS:
            return s
        s += change
    return s


@routine
def watched(
    lane: int,
    row: int,
    sa: float,
    sb: float,
    before: Array,
    after: Array,
    touches: bool,
    lanes: Steps,
    at: Array,
    sense: Whole,
    found: int,
) -> int:
    """Add the zeros of a function in a part of a step to those found; return how many there are."""
    count = before.size // LANES // 2
    m, part = row * LANES + lane, (sb - sa) * lanes.h[lane]
    ga, gb = before[m], after[m]
    da, db = before[m + count * LANES] * part, after[m + count * LANES] * part
    if ga == 0.0:  # it begins there: by its rate it is somewhere a little later
        if da == 0.0 or (gb > 0.0) == (da > 0.0) or gb == 0.0:
            return found
        begin = sa
        for i in range(1, 8):
            begin = sa + (sb - sa) * 0.0625**i
            look(begin, lanes)
            ga = lanes.g[m]
            if ga != 0.0 and (ga > 0.0) == (da > 0.0):
                break
        else:
            return found
        sa = begin
    if (ga < 0.0 and gb >= 0.0) or (ga > 0.0 and gb <= 0.0):
        at[found] = zero(lane, row, sa, ga, sb, gb, count, lanes)
        sense[found] = 1 if ga < 0.0 else -1
        return found + 1
    sign = 1.0 if ga > 0.0 else -1.0
    if not (sign * da < 0.0 and sign * db >= 0.0 and turns_near(ga, da, gb, db)):
        return found
    other = m + count * LANES
    turn = zero(lane, row + count, sa, before[other], sb, after[other], 0, lanes)
    look(turn, lanes)
    least = lanes.g[m]
    if sign * least < 0.0:
        for i in range(2):
            a, fa = (sa, ga) if i == 0 else (turn, least)
            b, fb = (turn, least) if i == 0 else (sb, gb)
            at[found] = zero(lane, row, a, fa, b, fb, count, lanes)
            sense[found] = 1 if fa < 0.0 else -1
            found += 1
    elif touches and abs(least) <= TOUCH * max(abs(ga), abs(gb)):
        at[found], sense[found] = turn, 0
        found += 1
    return found


@routine
def is_near(lane: int, rules: Rules, before: Array, after: Array, h: float) -> bool:
    """Whether a function may vanish in a step, by its values and slopes at the ends."""
    count = rules.shape[0]
    for i in range(count):
        m, slope = i * LANES + lane, (count + i) * LANES + lane
        a, b = before[m], after[m]
        most = max(abs(before[slope] * h), abs(after[slope] * h))
        far = (a > 0.0) == (b > 0.0) and min(abs(a), abs(b)) > most
        if rules[i, SENSE] != NEVER and not far:
            return True
    return False


@routine
def begin(
    lane: int, on: int, rules: Rules, before: Array, h: float, total: Whole, at: Array,
    sense: Whole, of: Whole,
) -> int:  # fmt: skip
    """What is said of the functions at the start of a motion; return how many zeros it counts."""
    found, count = 0, rules.shape[0]
    for i in range(count):
        m, slope = i * LANES + lane, before[(count + i) * LANES + lane] * h
        if rules[i, NET] == 1 and slope < 0.0:
            total[i, lane] = -1
        if on == i:
            before[m] = 0.0
        elif on == -2 and before[m] == 0.0:
            at[found], of[found] = 0.0, i
            sense[found] = 1 if slope > 0.0 else -1 if slope < 0.0 else 0
            found += 1
    return found


@routine
def note(
    lane: int, own: int, found: int, kept: bool, rules: Rules, lanes: Steps, total: Whole,
    at: Array, sense: Whole, of: Whole, when: Array, where: Array, which: Index, number: Index,
) -> int:  # fmt: skip
    """Note the zeros of a part of a step that count, in time; return the state of the motion."""
    for _ in range(found):
        j = 0
        for i in range(1, found):
            if at[i] < at[j]:
                j = i
        s, i = at[j], of[j]
        at[j] = 2.0  # what is done lies behind the step
        if rules[i, SENSE] != 0 and rules[i, SENSE] != sense[j]:
            continue
        look(s, lanes)
        gate = rules[i, GATE]
        if gate >= 0 and not lanes.g[gate * LANES + lane] > 0.0:
            continue
        total[i, lane] += sense[j] if rules[i, NET] == 1 else 1
        ends = rules[i, LAST] > 0 and total[i, lane] == rules[i, LAST]
        ends = ends or (rules[i, NET] == 1 and total[i, lane] == -1 - rules[i, LAST])
        if kept or ends:
            row = number[own]
            when[own, row], which[own, row] = lanes.clock[lane], i
            for c in range(where.shape[2]):
                where[own, row, c] = lanes.w[c * LANES + lane]
            number[own] += 1
        if ends:
            return ARRIVED
        if number[own] == when.shape[1]:
            return CROWDED
    return RUNNING


@routine
def is_beside(lane: int, y: Array, box: Array) -> bool:
    """Whether a state is outside a box, of two rows; one without columns holds all."""
    for c in range(box.shape[1]):
        value = y[c * LANES + lane]
        if not box[0, c] <= value <= box[1, c]:
            return True
    return False


@routine
def rest_of(lane: int, y: Array, rests: Array) -> int:
    """Row of the point at which a state has come to rest, -1 at none; the last row is how near."""
    last = rests.shape[0] - 1
    for i in range(last):
        near = True
        for c in range(rests.shape[1]):
            near = near and abs(y[c * LANES + lane] - rests[i, c]) <= rests[last, c]
        if near:
            return i
    return -1


@kernel
def crossings(
    address: int,
    table: Array,
    limits: Array,
    watch: int,
    rules: Rules,
    box: Array,
    rests: Array,
    kept: bool,
    times: Array,
    states: Array,
    on: Index,
    already: Index,
    parameters: Array,
    first: int,
    stop: int,
    when: Array,
    where: Array,
    which: Index,
    number: Index,
    status: Index,
    steps: Index,
) -> None:
    """Find the crossings of motions, each from its first to its last time.

    `times` is of shape (cells, 2), `states` of shape (cells, n). `on` is the function on whose
    zero a cell starts, which is no crossing, or -1; with -2 zeros at the start are crossings.
    `already` says how often each function was crossed before, of shape (cells, functions).

    `when` and `which` are of shape (cells, room), `where` of shape (cells, room, n): all crossings
    that count, or, unless they are `kept`, the one that ends the motion. A motion also ends outside
    of the `box`, at one of the `rests`, and where there is no more room.
    """
    n, count = states.shape[1], rules.shape[0]
    size = n * LANES
    x, y, spare, h = np.full(size, np.nan), np.zeros(size), np.zeros(size), np.zeros(size)
    k, z, p = np.zeros((ROWS, size)), np.zeros(3 * LANES), np.zeros(parameters.shape[0] * LANES)
    real, whole = np.zeros((REALS, LANES)), np.zeros((WHOLES, LANES), np.int64)
    w, v, clock = np.zeros(size), np.zeros(size), np.zeros((1 + n) * LANES)
    g, before, after = (
        np.zeros(2 * count * LANES),
        np.zeros(2 * count * LANES),
        np.zeros(2 * count * LANES),
    )
    lanes = Steps(address, watch, table, h, x, y, k, p, z, real, w, v, clock, g)
    total, fresh = np.zeros((count, LANES), np.int64), np.zeros(LANES, np.int64)
    at, sense, of = (
        np.zeros(3 * count),
        np.zeros(3 * count, np.int64),
        np.zeros(3 * count, np.int64),
    )
    cell = first
    while True:
        loaded = 0
        for lane in range(LANES):
            if whole[STATE, lane] == RUNNING:
                continue
            if whole[STATE, lane] != IDLE:
                old = whole[CELL, lane]
                status[old], steps[old] = whole[STATE, lane], whole[STEPS, lane]
                whole[STATE, lane] = IDLE
            if cell < stop:
                load(lane, cell, states, parameters, x, p, -1, real, whole)
                real[T, lane], real[END, lane] = times[cell, 0], times[cell, 1]
                if times[cell, 0] == times[cell, 1]:
                    whole[STATE, lane] = ARRIVED
                number[cell], fresh[lane] = 0, 1
                for i in range(count):
                    total[i, lane] = already[cell, i]
                loaded += 1
                cell += 1
        if loaded > 0:
            renew(address, table, limits, x, k, p, z, -1, h, real, whole)
        running = False
        for lane in range(LANES):
            running = running or whole[STATE, lane] == RUNNING
        if not running:
            if loaded > 0:
                continue
            break
        advance(address, table, limits, x, k, y, p, z, -1, h, real, whole)
        # At the ends of the step alone most functions are seen to be far from zero.
        look(1.0, lanes)
        after[:] = g
        look(0.0, lanes)
        before[:] = g
        near = False
        for lane in range(LANES):
            if whole[ACCEPTED, lane] == 1 and whole[STATE, lane] == RUNNING:
                near = near or fresh[lane] == 1 or is_near(lane, rules, before, after, h[lane])
        if near:
            densify(address, table, real[T], h, x, k, spare, p, z)
        for part in range(PARTS if near else 0):
            sa, sb = part / PARTS, (part + 1) / PARTS
            look(sb, lanes)
            after[:] = g
            for lane in range(LANES):
                if whole[ACCEPTED, lane] != 1 or whole[STATE, lane] != RUNNING:
                    continue
                own, found = whole[CELL, lane], 0
                if fresh[lane] == 1:
                    found = begin(lane, on[own], rules, before, h[lane], total, at, sense, of)
                    fresh[lane] = 0
                for i in range(count):
                    if rules[i, SENSE] == NEVER:
                        continue
                    last = watched(
                        lane, i, sa, sb, before, after, rules[i, TOUCHES] == 1, lanes, at, sense,
                        found,
                    )  # fmt: skip
                    of[found:last] = i
                    found = last
                whole[STATE, lane] = note(
                    lane, own, found, kept, rules, lanes, total, at, sense, of, when, where, which,
                    number,
                )  # fmt: skip
            before, after = after, before
        for lane in range(LANES):
            if whole[ACCEPTED, lane] == 1 and whole[STATE, lane] == RUNNING:
                rest = rest_of(lane, y, rests)
                if is_beside(lane, y, box):
                    whole[STATE, lane] = LEFT
                elif rest >= 0:
                    whole[STATE, lane] = RESTING + rest
            if whole[STATE, lane] != RUNNING:  # what has ended stays as it is
                whole[ACCEPTED, lane] = 0
        commit(x, k, y, real, whole)
