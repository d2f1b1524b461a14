"""Growth of tangent vectors along motions."""

from __future__ import annotations

import math

import numpy as np

from phasekit.arrays import Array, Index
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
from phasekit.numerics.compile import kernel, routine
from phasekit.numerics.lanes import LANES


@routine
def orthonormal(lane: int, n: int, x: Array, sums: Array) -> None:
    """Make the tangent vectors of a lane, of n entries, orthonormal; add the logs of their lengths.

    Gram and Schmidt's way, each vector twice where it loses digits.
    """
    count = x.size // (n * LANES) - 1
    for i in range(count):
        own = (1 + i) * n
        for again in range(2):
            before = 0.0
            for c in range(n):
                before += x[(own + c) * LANES + lane] ** 2
            for j in range(i):
                other, product = (1 + j) * n, 0.0
                for c in range(n):
                    product += x[(own + c) * LANES + lane] * x[(other + c) * LANES + lane]
                for c in range(n):
                    x[(own + c) * LANES + lane] -= product * x[(other + c) * LANES + lane]
            after = 0.0
            for c in range(n):
                after += x[(own + c) * LANES + lane] ** 2
            if again == 0 and i > 0 and after < 0.25 * before:
                continue
            break
        length = math.sqrt(after)
        if length == 0.0:  # a map may put an end to it at once
            sums[lane, i] = -np.inf
            continue
        for c in range(n):
            x[(own + c) * LANES + lane] /= length
        sums[lane, i] += math.log(length)


@routine
def is_skewed(lane: int, n: int, x: Array, gram: Array) -> bool:
    """Whether tangent vectors of a lane are far from orthonormal.

    By Cholesky's factors of their products: the parts of each that are not in those before it.
    """
    for i in range(gram.shape[0]):
        own = (1 + i) * n
        for j in range(i + 1):
            other, product = (1 + j) * n, 0.0
            for c in range(n):
                product += x[(own + c) * LANES + lane] * x[(other + c) * LANES + lane]
            whole = product
            for k in range(j):
                product -= gram[i, k] * gram[j, k]
            if j < i:
                gram[i, j] = product / gram[j, j]
            else:
                if not (1e-4 < whole < 1e4 and product > 0.04 * whole):
                    return True
                gram[i, i] = math.sqrt(product)
    return False


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
    """Logs of the growth of orthogonal tangent vectors after each leg, added up.

    `legs` has a time for each cell, `out` is of shape (cells, legs, vectors). The entries of a
    vector stand behind those of the state and of the vectors before it.
    """
    size, count = states.shape[1] * LANES, out.shape[2]
    n = states.shape[1] // (1 + count)
    x, y, h = np.full(size, np.nan), np.zeros(size), np.zeros(size)
    k = np.zeros((ROWS, size))
    p = np.zeros(max(parameters.shape[0], 1) * LANES)
    z = np.zeros(3 * LANES)
    real, whole = np.zeros((REALS + room, LANES)), np.zeros((WHOLES, LANES), np.int64)
    done = np.zeros(LANES, np.int64)
    sums, gram = np.zeros((LANES, count)), np.zeros((count, count))
    cell = first
    left = stop - first
    while left > 0:
        fresh = False
        for lane in range(LANES):
            state = whole[STATE, lane]
            own = whole[CELL, lane]
            if state == ARRIVED or (state == RUNNING and is_skewed(lane, n, x, gram)):
                orthonormal(lane, n, x, sums)
                whole[ACCEPTED, lane] = CHANGED
                fresh = True
            if state == RUNNING:
                continue
            ended = state != IDLE and state != ARRIVED
            if state == ARRIVED:
                for i in range(count):
                    out[own, done[lane], i] = sums[lane, i]
                done[lane] += 1
                ended = done[lane] == out.shape[1]
                whole[STATE, lane] = RUNNING
                real[END, lane] = (done[lane] + 1) * legs[own]
            if ended:
                status[own] = state
                for i in range(done[lane], out.shape[1]):
                    for j in range(count):
                        out[own, i, j] = np.nan
                whole[STATE, lane] = IDLE
                left -= 1
            if whole[STATE, lane] == IDLE and cell < stop:
                load(lane, cell, states, parameters, x, p, kink, real, whole)
                real[END, lane] = legs[cell]
                done[lane] = 0
                sums[lane] = 0.0
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
