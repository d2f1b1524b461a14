"""Paths of motions: their states step by step, as closely as a drawn curve needs them."""

from __future__ import annotations

import math

import numpy as np

from phasekit.arrays import Array, Index
from phasekit.motion.kernels.crossings import is_beside, rest_of
from phasekit.motion.kernels.dop853 import ROWS, densify, within
from phasekit.motion.kernels.stepping import (
    ACCEPTED,
    CELL,
    END,
    REALS,
    STATE,
    STEPS,
    TRY,
    WHOLES,
    T,
    advance,
    commit,
    load,
    renew,
)
from phasekit.motion.lost import ARRIVED, CROWDED, IDLE, LEFT, RESTING, RUNNING
from phasekit.numerics.compile import kernel, routine
from phasekit.numerics.lanes import LANES


@routine
def chord(lane: int, x: Array, y: Array, widths: Array) -> float:
    """Distance between two states, in widths."""
    total = 0.0
    for c in range(widths.size):
        total += ((y[c * LANES + lane] - x[c * LANES + lane]) / widths[c]) ** 2
    return math.sqrt(total)


@kernel
def paths(
    address: int,
    table: Array,
    limits: Array,
    box: Array,
    rests: Array,
    widths: Array,
    close: float,
    longest: float,
    times: Array,
    states: Array,
    parameters: Array,
    first: int,
    stop: int,
    when: Array,
    where: Array,
    number: Index,
    status: Index,
    steps: Index,
) -> None:
    """Follow motions and keep states that are at most so `close`, in `widths`.

    `when` is of shape (cells, room), `where` of shape (cells, room, n). A motion ends at its time,
    outside of the `box`, at one of the `rests` other than that where it starts, when it is as long
    as the `longest`, and where there is no more room.
    """
    n, room = states.shape[1], when.shape[1]
    size = n * LANES
    x, y, spare, h = np.full(size, np.nan), np.zeros(size), np.zeros(size), np.zeros(size)
    k, length, away = np.zeros((ROWS, size)), np.zeros(LANES), np.zeros(LANES)
    p, z = np.zeros(max(parameters.shape[0], 1) * LANES), np.zeros(3 * LANES)
    real, whole = np.zeros((REALS, LANES)), np.zeros((WHOLES, LANES), np.int64)
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
                when[cell, 0] = times[cell, 0]
                for c in range(n):
                    where[cell, 0, c] = states[cell, c]
                number[cell], length[lane], away[lane] = 1, 0.0, 0.0
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
        densify(address, table, real[T], h, x, k, spare, p, z)
        for lane in range(LANES):
            if whole[ACCEPTED, lane] != 1 or whole[STATE, lane] != RUNNING:
                continue
            own, far = whole[CELL, lane], chord(lane, x, y, widths)
            parts = max(1, min(int(math.ceil(min(far / close, 1000.0))), 1000))
            for part in range(1, parts + 1):
                row = number[own]
                if row == room:
                    whole[STATE, lane] = CROWDED
                    break
                s = part / parts
                when[own, row] = real[T, lane] + s * real[TRY, lane]
                far = 0.0
                for c in range(n):
                    m = c * LANES + lane
                    where[own, row, c] = y[m] if part == parts else within(s, h[m], x, y, k, m)
                    far += ((where[own, row, c] - where[own, row - 1, c]) / widths[c]) ** 2
                length[lane] += math.sqrt(far)
                number[own] += 1
                if length[lane] >= longest:
                    whole[STATE, lane] = ARRIVED
                    break
            if whole[STATE, lane] == RUNNING:
                rest = rest_of(lane, y, rests)
                if is_beside(lane, y, box):
                    whole[STATE, lane] = LEFT
                elif rest < 0:
                    away[lane] = 1.0
                elif away[lane] == 1.0:
                    whole[STATE, lane] = RESTING + rest
        for lane in range(LANES):  # what has ended stays as it is
            if whole[STATE, lane] != RUNNING:
                whole[ACCEPTED, lane] = 0
        commit(x, k, y, real, whole)
