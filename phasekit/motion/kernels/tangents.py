"""Growth of tangent vectors along motions."""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt

from phasekit.motion.kernels.dop853 import ROWS
from phasekit.motion.kernels.stepping import (
    ACCEPTED,
    CELL,
    CHANGED,
    END,
    REALS,
    STATE,
    WHOLES,
    advance,
    by_series,
    commit,
    load,
    renew,
)
from phasekit.motion.lost import ARRIVED, IDLE, RUNNING
from phasekit.numerics.compile import Array, inline, kernel, routine
from phasekit.numerics.lanes import LANES

Index = npt.NDArray[np.int64]


@routine
def orthonormal(lane: int, x: Array) -> tuple[float, float]:
    """Make the two tangent vectors of a lane orthonormal; return the logs of their lengths."""
    a, b = x[2 * LANES + lane], x[3 * LANES + lane]
    c, d = x[4 * LANES + lane], x[5 * LANES + lane]
    length = math.hypot(a, b)
    area = a * d - b * c
    a, b = a / length, b / length
    x[2 * LANES + lane], x[3 * LANES + lane] = a, b
    x[4 * LANES + lane], x[5 * LANES + lane] = -b, a
    return math.log(length), math.log(abs(area) / length)


@inline
def is_skewed(lane: int, x: Array) -> bool:
    """Whether the two tangent vectors of a lane are far from orthonormal."""
    a, b = x[2 * LANES + lane], x[3 * LANES + lane]
    c, d = x[4 * LANES + lane], x[5 * LANES + lane]
    one, two, area = a * a + b * b, c * c + d * d, abs(a * d - b * c)
    return not (1e-4 < one < 1e4 and 1e-4 < two < 1e4 and area * area > 0.04 * one * two)


@kernel
def growth(
    series: int,
    room: int,
    address: int | None,
    table: Array,
    limits: Array,
    kink: int,
    legs: Array,
    states: Array,
    parameters: Array,
    first: int,
    stop: int,
    out: Array,
    status: Index,
) -> None:
    """Logs of the growth of two orthogonal tangent vectors after each leg, added up.

    `legs` has a time for each cell, `out` is of shape (cells, legs, 2).
    """
    x, y, h = np.zeros(6 * LANES), np.zeros(6 * LANES), np.zeros(6 * LANES)
    k = np.zeros((ROWS, 6 * LANES))
    p = np.zeros(max(parameters.shape[0], 1) * LANES)
    z = np.zeros(3 * LANES)
    real, whole = np.zeros((REALS + room, LANES)), np.zeros((WHOLES, LANES), np.int64)
    done = np.zeros(LANES, np.int64)
    sums = np.zeros((LANES, 2))
    cell = first
    left = stop - first
    while left > 0:
        fresh = False
        for lane in range(LANES):
            state = whole[STATE, lane]
            own = whole[CELL, lane]
            if state == ARRIVED or (state == RUNNING and is_skewed(lane, x)):
                one, two = orthonormal(lane, x)
                sums[lane, 0] += one
                sums[lane, 1] += two
                whole[ACCEPTED, lane] = CHANGED
                fresh = True
            if state == RUNNING:
                continue
            ended = state != IDLE and state != ARRIVED
            if state == ARRIVED:
                out[own, done[lane], 0] = sums[lane, 0]
                out[own, done[lane], 1] = sums[lane, 1]
                done[lane] += 1
                ended = done[lane] == out.shape[1]
                whole[STATE, lane] = RUNNING
                real[END, lane] = (done[lane] + 1) * legs[own]
            if ended:
                status[own] = state
                for i in range(done[lane], out.shape[1]):
                    out[own, i, 0] = out[own, i, 1] = np.nan
                whole[STATE, lane] = IDLE
                left -= 1
            if whole[STATE, lane] == IDLE and cell < stop:
                load(lane, cell, states, parameters, x, p, kink, real, whole)
                real[END, lane] = legs[cell]
                done[lane] = 0
                sums[lane, 0] = sums[lane, 1] = 0.0
                fresh = True
                cell += 1
        if address is not None and fresh:
            renew(address, table, limits, x, k, p, z, kink, h, real, whole)
        if left > 0:
            if address is not None:
                advance(address, table, limits, x, k, y, p, z, kink, h, real, whole)
                commit(x, k, y, real, whole)
            else:
                by_series(series, x, p, real, limits, whole)
