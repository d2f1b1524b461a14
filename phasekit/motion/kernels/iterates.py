"""States of maps after so many steps, eight cells at once."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from phasekit.motion.kernels.tangents import is_skewed, orthonormal
from phasekit.motion.lost import ARRIVED, FAILED
from phasekit.numerics.compile import Array, inline, kernel
from phasekit.numerics.lanes import LANES, invoke

Index = npt.NDArray[np.int64]


@inline
def apply(address: int, x: Array, p: Array, z: Array, y: Array) -> None:
    """Y = f(x) of all lanes."""
    invoke(address, x, p, z, y)  # type: ignore[call-arg]


@kernel
def iterates(
    address: int,
    counts: Index,
    states: Array,
    parameters: Array,
    first: int,
    stop: int,
    out: Array,
) -> None:
    """States after counts of steps, which rise along each row; none where a count is below 0."""
    n = states.shape[1]
    x, y, z = np.zeros(n * LANES), np.zeros(n * LANES), np.zeros(3 * LANES)
    p = np.zeros(max(parameters.shape[0], 1) * LANES)
    written = np.zeros(LANES, np.int64)
    for begun in range(first, stop, LANES):
        many = min(LANES, stop - begun)
        last = 0
        for lane in range(LANES):
            cell = begun + min(lane, many - 1)
            for c in range(n):
                x[c * LANES + lane] = states[cell, c]
            for c in range(parameters.shape[0]):
                p[c * LANES + lane] = parameters[c, cell]
            written[lane] = 0
            last = max(last, counts[cell, counts.shape[1] - 1])
        for step in range(last + 1):
            for lane in range(many):
                cell = begun + lane
                while written[lane] < counts.shape[1] and counts[cell, written[lane]] <= step:
                    if counts[cell, written[lane]] == step:
                        for c in range(n):
                            out[cell, written[lane], c] = x[c * LANES + lane]
                    written[lane] += 1
            if step < last:
                for lane in range(LANES):
                    z[lane] = step
                apply(address, x, p, z, y)
                x, y = y, x


@kernel
def growth(
    address: int,
    legs: Index,
    states: Array,
    parameters: Array,
    first: int,
    stop: int,
    out: Array,
    status: Index,
) -> None:
    """Logs of the growth of orthogonal tangent vectors of a map after each leg, added up.

    `legs` has a number of steps for each cell, `out` is of shape (cells, legs, vectors).
    """
    size, count = states.shape[1] * LANES, out.shape[2]
    n = states.shape[1] // (1 + count)
    x, y, z = np.zeros(size), np.zeros(size), np.zeros(3 * LANES)
    p = np.zeros(max(parameters.shape[0], 1) * LANES)
    sums, gram = np.zeros((LANES, count)), np.zeros((count, count))
    for begun in range(first, stop, LANES):
        many = min(LANES, stop - begun)
        longest = 0
        for lane in range(LANES):
            cell = begun + min(lane, many - 1)
            for c in range(states.shape[1]):
                x[c * LANES + lane] = states[cell, c]
            for c in range(parameters.shape[0]):
                p[c * LANES + lane] = parameters[c, cell]
            longest = max(longest, legs[cell])
        sums[:] = 0.0
        for step in range(longest * out.shape[1]):
            for lane in range(LANES):
                z[lane] = step
            apply(address, x, p, z, y)
            x, y = y, x
            for lane in range(many):
                cell = begun + lane
                leg = legs[cell]
                ends = (step + 1) % leg == 0 and (step + 1) // leg <= out.shape[1]
                if ends or is_skewed(lane, n, x, gram):
                    orthonormal(lane, n, x, sums)
                if ends:
                    for i in range(count):
                        out[cell, (step + 1) // leg - 1, i] = sums[lane, i]
        for lane in range(many):
            cell = begun + lane
            status[cell] = ARRIVED
            for c in range(n):
                if not np.isfinite(x[c * LANES + lane]):
                    status[cell] = FAILED
            for i in range(count):
                if np.isnan(out[cell, out.shape[1] - 1, i]):
                    status[cell] = FAILED
