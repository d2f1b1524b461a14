"""States of motions after equal times, one after another: kept, or held against attractors."""

from __future__ import annotations

import math

import numpy as np

from phasekit.arrays import Array, Flags, Index
from phasekit.motion.kernels.dop853 import ROWS
from phasekit.motion.kernels.stepping import (
    ACCEPTED,
    CELL,
    CHANGED,
    END,
    REALS,
    STATE,
    WHOLES,
    T,
    advance,
    by_series,
    commit,
    load,
    renew,
)
from phasekit.motion.lost import ARRIVED, EXHAUSTED, FAILED, IDLE, RUNNING
from phasekit.numerics.compile import inline, kernel, routine
from phasekit.numerics.lanes import LANES

#: Where motions end: the fields of `phasekit.motion.strobe.Targets`, in their order.
Targets = tuple[Array, Array, Array, int, Index, Index, int, Array, Array, Array, int]


@inline
def nearest_of(lane: int, x: Array, points: Array, turns: Array, units: Array) -> int:
    """Number of the attractor's point near which a state lies; -1: of none.

    Rows of the points: state, radius, attractor. Distances are measured by a unit of each state;
    of angles `turns` are the periods, 0 of others.
    """
    n = turns.size
    for row in range(points.shape[0]):
        room, total = points[row, n] ** 2, 0.0
        for c in range(n):
            off = x[c * LANES + lane] - points[row, c]
            if turns[c] > 0.0:
                off -= turns[c] * np.rint(off / turns[c])
            total += (off / units[c]) ** 2
        if total <= room:
            return int(points[row, n + 1])
    return -1


@inline
def cell_of(
    lane: int, x: Array, turns: Array, grid: Array, side: int, keys: Index, codes: Index
) -> int:
    """What is written in the cell of a grid in which a state lies; -1 outside, or for nothing.

    Rows of the grid: its least state, and the edges of a cell, `side` along each axis. The cells
    stand in a table: each at the place of its number modulo the size, or the next that was free.
    """
    if keys.size == 0:
        return -1
    key = 0
    for c in range(turns.size):
        off = x[c * LANES + lane] - grid[0, c]
        if turns[c] > 0.0:
            off -= turns[c] * math.floor(off / turns[c])
        place = off / grid[1, c]
        if not 0.0 <= place < side:
            return -1
        key = key * side + int(place)
    at = key % keys.size
    while keys[at] >= 0:
        if keys[at] == key:
            return int(codes[at])
        at = (at + 1) % keys.size
    return -1


@inline
def is_far(lane: int, x: Array, reach: Array) -> bool:
    """Whether a state lies beyond where motions count as gone for good."""
    for c in range(reach.shape[1]):
        if not reach[0, c] <= x[c * LANES + lane] <= reach[1, c]:
            return True
    return False


@inline
def band_of(phi: float, dphi: float, period: float, spans: Array, bands: Array) -> int:
    """Number of the attractor within whose borders a state lies; -1: within none.

    Rows of spans: coordinate from, to, attractor. Borders are the least and the greatest rate at
    equal distances from one to the other.
    """
    for row in range(spans.shape[0]):
        off = phi - spans[row, 0]
        if period > 0.0:
            off -= period * math.floor(off / period)
        last = bands.shape[1] - 1
        place = off / (spans[row, 1] - spans[row, 0]) * last
        if 0.0 <= place <= last:
            i = min(int(place), last - 1)
            part = place - i
            low = (1.0 - part) * bands[row, i, 0] + part * bands[row, i + 1, 0]
            high = (1.0 - part) * bands[row, i, 1] + part * bands[row, i + 1, 1]
            if low <= dphi <= high:
                return int(spans[row, 2])
    return -1


@routine
def grow(lane: int, units: Array, x: Array, sizes: Array) -> None:
    """Make the tangent vector one unit long, and count by how much errors have grown.

    Each leg adds an error of one unit. Rows of sizes: the error now, the greatest so far, and that
    when the motion came to the boxes in which it is.
    """
    n, size = units.size, 0.0
    for c in range(n):
        size += (x[(n + c) * LANES + lane] / units[c]) ** 2
    size = math.sqrt(size)
    if size > 0.0:
        for c in range(n):
            x[(n + c) * LANES + lane] /= size
    sizes[0, lane] = sizes[0, lane] * size + 1.0
    sizes[1, lane] = max(sizes[0, lane], sizes[1, lane])


@routine
def write(lane: int, n: int, x: Array, sizes: Array, out: Array) -> None:
    """Write the state of a lane, and its tangent vector as long as the error now."""
    for c in range(out.size):
        out[c] = x[c * LANES + lane] * (sizes[0, lane] if c >= n else 1.0)


@routine
def stays(lane: int, inside: int, visits: int, last: Index, same: Index) -> bool:
    """Whether a motion has come to boxes of one attractor so many times in succession."""
    same[lane] = same[lane] + 1 if inside >= 0 and inside == last[lane] else 1
    last[lane] = inside
    return inside >= 0 and bool(same[lane] >= visits)


@routine
def resume(
    lane: int, done: int, leg: float, again: bool, anew: bool, real: Array, whole: Index
) -> None:
    """Let a motion go on through its next leg; where the law repeats itself, time begins anew."""
    whole[STATE, lane] = RUNNING
    if anew:
        whole[ACCEPTED, lane] = CHANGED
    real[T, lane] = 0.0 if again else done * leg
    real[END, lane] = leg if again else (done + 1) * leg


@kernel
def strobe(
    series: int,
    room: int,
    address: int | None,
    table: Array,
    limits: Array,
    kink: int,
    skip: int,
    many: int,
    turns: Array,
    targets: Targets,
    enough: float,
    legs: Array,
    again: Flags,
    states: Array,
    parameters: Array,
    first: int,
    stop: int,
    out: Array,
    code: Index,
    taken: Index,
    growth: Array,
    status: Index,
) -> None:
    """States after a leg, two legs, ... of each cell: from the one after `skip` on in `out`.

    `out` is of shape (cells, kept, n), NaN once a motion has ended; the state after no leg is not
    written.

    Where the law repeats itself after each leg (`again`), time begins anew. A motion ends early
    near a point of an attractor, in whose number `code` is then, within its borders, or after so
    many visits in succession to cells of the same attractor; and it fails out of `reach`, at the
    end of a leg or where it would never come to that: the last of `out` is then where it was last.
    `taken` is the number of legs. Where a tangent vector moves along, as long as the error at
    first, `growth` is by how much it and an error of every leg have grown at most before the
    motion came to where it ends. Where that is `enough`, the motion ends as well, and its state is
    the first of `out`.
    """
    units, points, grid, side, keys, codes, visits, reach, spans, bands, at = targets
    size = states.shape[1] * LANES
    x, y, h = np.zeros(size), np.zeros(size), np.zeros(size)
    k = np.zeros((ROWS, size))
    p = np.zeros(max(parameters.shape[0], 1) * LANES)
    z = np.zeros(3 * LANES)
    real, whole = np.zeros((REALS + room, LANES)), np.zeros((WHOLES, LANES), np.int64)
    counts = np.zeros((3, LANES), np.int64)
    done, last, same = counts[0], counts[1], counts[2]
    sizes = np.zeros((3, LANES))
    n = turns.size
    measured = states.shape[1] > n
    cell = first
    left = stop - first
    while left > 0:
        fresh = False
        for lane in range(LANES):
            state = whole[STATE, lane]
            if state == RUNNING:
                continue
            own = whole[CELL, lane]
            ended, grown = state != IDLE and state != ARRIVED, False
            if state == EXHAUSTED and is_far(lane, x, reach):
                state = FAILED
            if state == ARRIVED:
                done[lane] += 1
                if measured:
                    grow(lane, units, x, sizes)
                if skip <= done[lane] < skip + out.shape[1]:
                    write(lane, n, x, sizes, out[own, done[lane] - skip])
                inside = cell_of(lane, x, turns, grid, side, keys, codes)
                code[own] = nearest_of(lane, x, points, turns, units)
                if code[own] < 0 and spans.shape[0] > 0:
                    place, rate = at * LANES + lane, (1 - at) * LANES + lane
                    code[own] = band_of(x[place], x[rate], turns[at], spans, bands)
                if stays(lane, inside, visits, last, same) and code[own] < 0:
                    code[own] = inside
                if same[lane] == 1 or 0 <= code[own] != inside:
                    sizes[2, lane] = sizes[1, lane]
                ended = code[own] >= 0 or done[lane] >= many
                if not ended and is_far(lane, x, reach):
                    state, ended = FAILED, True
                grown = not ended and sizes[2, lane] > enough
                if grown:
                    write(lane, n, x, sizes, out[own, 0])
                if not ended and not grown:
                    anew = again[own] or measured
                    resume(lane, done[lane], legs[own], again[own], anew, real, whole)
                    fresh = fresh or anew
            if ended or grown:
                taken[own] = done[lane]
                status[own] = state
                growth[own] = sizes[2, lane]
                for i in range(max(done[lane] + 1 - skip, int(grown)), out.shape[1]):
                    out[own, i] = np.nan
                if state == FAILED and done[lane] < many and out.shape[1] > 0:
                    write(lane, n, x, sizes, out[own, out.shape[1] - 1])
                whole[STATE, lane] = IDLE
                left -= 1
            if whole[STATE, lane] == IDLE and cell < stop:
                load(lane, cell, states, parameters, x, p, kink, real, whole)
                real[END, lane] = legs[cell]
                done[lane] = last[lane] = same[lane] = 0
                sizes[0, lane], sizes[1, lane], sizes[2, lane] = 1.0, 0.0, 0.0
                if measured:
                    grow(lane, units, x, sizes)
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
