"""Motions from many states, at given times."""

from __future__ import annotations

import numpy as np

from phasekit.arrays import Array, Index
from phasekit.arrays import Index as Whole
from phasekit.motion.kernels.dop853 import OWN, ROWS, densify, rates, within
from phasekit.motion.kernels.stepping import (
    ACCEPTED,
    CELL,
    END,
    GONE,
    REALS,
    SCALE,
    START,
    STATE,
    STEPS,
    TERMS,
    TRY,
    WHOLES,
    T,
    advance,
    by_series,
    commit,
    load,
    renew,
)
from phasekit.motion.lost import ARRIVED, IDLE, RUNNING
from phasekit.numerics.compile import inline, kernel, routine
from phasekit.numerics.lanes import LANES


@routine
def enter(
    lane: int, start: float, times: Array, x: Array, real: Array, whole: Whole, out: Array
) -> int:
    """Begin the motion of a lane; write its states at the start, and return how many."""
    real[T, lane], real[END, lane] = start, times[-1]
    done = 0
    while done < times.size and times[done] == start:
        for c in range(out.shape[1]):
            out[done, c] = x[c * LANES + lane]
        done += 1
    if done == times.size:
        whole[STATE, lane] = ARRIVED
    return done


@routine
def is_passed(times: Array, written: Index, real: Array, whole: Whole) -> bool:
    """Whether a time lies within the accepted step of a lane."""
    for lane in range(LANES):
        if whole[ACCEPTED, lane] == 1 and written[lane] < times.shape[1]:
            row = whole[CELL, lane] if times.shape[0] > 1 else 0
            if abs(times[row, written[lane]] - real[T, lane]) < abs(real[TRY, lane]):
                return True
    return False


@routine
def write(
    lane: int, times: Array, done: int, x: Array, k: Array, y: Array, real: Array, out: Array
) -> int:
    """Write the states of a lane at the times within its step; return how many are written."""
    start, step = real[T, lane], real[TRY, lane]
    sense = 1.0 if step > 0.0 else -1.0
    last = step == real[END, lane] - start
    while done < times.size and (last or sense * (times[done] - start) <= sense * step):
        s = min((times[done] - start) / step, 1.0)
        for c in range(out.shape[1]):
            m = c * LANES + lane
            out[done, c] = y[m] if s == 1.0 else within(s, step, x, y, k, m)
        done += 1
    return done


@routine
def write_series(
    lane: int, times: Array, done: int, degree: int, x: Array, real: Array, out: Array
) -> int:
    """The same of a step by series, whose chains are coordinates with their rates, or states."""
    start, step, end = real[START, lane], real[GONE, lane], real[T, lane]
    sense = 1.0 if step > 0.0 else -1.0
    chains = out.shape[1] // degree
    terms = (real.shape[0] - TERMS) // chains
    per = 1.0 / real[SCALE, lane]
    while done < times.size and sense * (times[done] - end) <= 0.0:
        s = (times[done] - start) * per
        for i in range(chains):
            value = slope = 0.0
            for row in range(TERMS + (i + 1) * terms - 1, TERMS + i * terms - 1, -1):
                slope = slope * s + value
                value = value * s + real[row, lane]
            out[done, degree * i] = value
            if degree == 2:
                out[done, 2 * i + 1] = slope * per
        if times[done] == end:
            for c in range(out.shape[1]):
                out[done, c] = x[c * LANES + lane]
        done += 1
    return done


@inline
def swap(p: Array, kink: int, signs: Array) -> None:
    """Exchange the signs of quadratic damping; a turn at the end of a step changes them there."""
    for lane in range(signs.size if kink >= 0 else 0):
        m = kink * LANES + lane
        p[m], signs[lane] = signs[lane], p[m]


@kernel
def motions(
    series: int,
    room: int,
    address: int | None,
    table: Array,
    limits: Array,
    start: float,
    kink: int,
    times: Array,
    states: Array,
    parameters: Array,
    first: int,
    stop: int,
    out: Array,
    status: Array,
    steps: Array,
) -> None:
    """Integrate the motions of cells; times are all after the start or all before it, in order.

    `times` is of shape (cells, times), or (1, times) where they are the same; `states` of shape
    (cells, n), `parameters` of shape (parameters, cells), `out` of shape (cells, times, n): NaN
    where a motion did not come to a time.
    """
    size = states.shape[1] * LANES
    # Lanes without a motion hold no state.
    x, y, spare, h = np.full(size, np.nan), np.zeros(size), np.zeros(size), np.zeros(size)
    k = np.zeros((ROWS, size))
    p = np.zeros(max(parameters.shape[0], 1) * LANES)
    signs = np.zeros(LANES)  # those within the step
    z = np.zeros(3 * LANES)
    real, whole = np.zeros((REALS + room, LANES)), np.zeros((WHOLES, LANES), np.int64)
    written = np.zeros(LANES, np.int64)
    degree = 1 if limits.shape[0] > OWN else 2
    cell = first
    while True:
        fresh = 0
        for lane in range(LANES):
            if whole[STATE, lane] == RUNNING:
                continue
            if whole[STATE, lane] != IDLE:
                old = whole[CELL, lane]
                status[old] = whole[STATE, lane]
                steps[old] = whole[STEPS, lane]
                for i in range(written[lane], out.shape[1]):
                    for c in range(out.shape[2]):
                        out[old, i, c] = np.nan
                whole[STATE, lane] = IDLE
            if cell < stop:
                own_times = times[cell if times.shape[0] > 1 else 0]
                load(lane, cell, states, parameters, x, p, kink, real, whole)
                written[lane] = enter(lane, start, own_times, x, real, whole, out[cell])
                fresh += 1
                cell += 1
        if address is not None and fresh > 0:
            renew(address, table, limits, x, k, p, z, kink, h, real, whole)
        running = False
        for lane in range(LANES):
            running = running or whole[STATE, lane] == RUNNING
        if not running:
            if fresh > 0:
                continue
            break
        if address is None:
            by_series(series, x, p, real, limits, whole)
            for lane in range(LANES):
                if real[GONE, lane] != 0.0:
                    own = out[whole[CELL, lane]]
                    row = whole[CELL, lane] if times.shape[0] > 1 else 0
                    done = written[lane]
                    written[lane] = write_series(lane, times[row], done, degree, x, real, own)
            continue
        for lane in range(LANES if kink >= 0 else 0):
            signs[lane] = p[kink * LANES + lane]
        advance(address, table, limits, x, k, y, p, z, kink, h, real, whole)
        if is_passed(times, written, real, whole):
            swap(p, kink, signs)
            densify(address, table, real[T], h, x, k, spare, p, z)
            swap(p, kink, signs)
        for lane in range(LANES):
            if whole[ACCEPTED, lane] == 1:
                own = out[whole[CELL, lane]]
                row = whole[CELL, lane] if times.shape[0] > 1 else 0
                written[lane] = write(lane, times[row], written[lane], x, k, y, real, own)
        commit(x, k, y, real, whole)


@kernel
def rates_at(
    address: int,
    table: Array,
    times: Array,
    states: Array,
    parameters: Array,
    signs: Array,
    kink: int,
    first: int,
    stop: int,
    out: Array,
) -> None:
    """Rates at states of shape (cells, n), with the signs of quadratic damping."""
    n = states.shape[1]
    x, k, h = np.zeros(n * LANES), np.zeros(n * LANES), np.zeros(LANES)
    t, z = np.zeros(LANES), np.zeros(3 * LANES)
    p = np.zeros(max(parameters.shape[0], 1) * LANES)
    for begun in range(first, stop, LANES):
        for lane in range(LANES):
            cell = min(begun + lane, stop - 1)
            t[lane] = times[cell]
            for c in range(n):
                x[c * LANES + lane] = states[cell, c]
            for c in range(parameters.shape[0]):
                p[c * LANES + lane] = parameters[c, cell]
            if kink >= 0:
                p[kink * LANES + lane] = signs[cell]
        rates(address, table, t, h, 0.0, x, p, z, k)
        for lane in range(min(LANES, stop - begun)):
            for c in range(n):
                out[begun + lane, c] = k[c * LANES + lane]
