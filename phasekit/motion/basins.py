"""Which attractor a damped and driven motion comes to: basins over a grid, and their shares."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from phasekit.motion.attractors import TOO_LONG, Search
from phasekit.motion.lost import EXHAUSTED, FAILED
from phasekit.motion.strobe import strobe

Array = npt.NDArray[np.float64]

#: Legs after which a motion is given up.
LEGS = 10_000
#: Codes of motions that came to no attractor: undecided, or away to infinity.
UNDECIDED, ESCAPED = -1, -2
#: Share of the cells beside another basin from which on a grid is too coarse.
COARSE = 0.5


class Basins(NamedTuple):
    """The group "basins"."""

    basin: npt.NDArray[np.int16]
    """Of shape (phi, dphi)."""
    basin_time: Array
    """Time until the motion was near its attractor; NaN where it came to none."""
    basin_fraction: Array
    basin_fraction_error: Array
    boundary_fraction: float
    """Share of the cells with a neighbour in another basin."""


def basins(
    search: Search, phi: Array, dphi: Array, *, legs: int = LEGS, threads: int | None = None
) -> Basins:
    """Basins of the attractors that a search has found, over a grid.

    Parameters
    ----------
    search : Search
        The attractors.
    phi, dphi : array, 1-D
        The grid.
    legs : int
        Legs after which a motion is given up.

    Notes
    -----
    The error of a share has two parts: that of a sample of as many states, Wilson's, which is
    not 0 of a share of 0 or 1; and the undecided.
    """
    shape = (len(phi), len(dphi))
    states = np.stack(np.meshgrid(phi, dphi, indexing="ij"), axis=-1).reshape(-1, 2)
    found = strobe(
        search.law, search.values, states, search.leg, 0,
        targets=search.targets(), most_legs=legs, threads=threads,
    )  # fmt: skip
    code = found.code.astype(np.int16)
    search.open[TOO_LONG] += int(np.sum(found.status == EXHAUSTED))
    lost = (code < 0) & (found.status == FAILED)
    code[lost] = ESCAPED
    time = np.where(code >= 0, found.taken * search.leg, np.nan)
    number = len(search.orbits) + len(search.others)
    size = max(len(code), 1)
    shares = np.array([np.sum(code == i) for i in range(number)], float) / size
    open_ = np.sum(code == UNDECIDED) / size
    sampled = np.sqrt(shares * (1.0 - shares) / size + 0.25 / size**2) / (1.0 + 1.0 / size)
    errors = sampled + open_
    grid = code.reshape(shape)
    wraps = bool(search.period) and _covers_turn(phi, search.period)
    return Basins(grid, time.reshape(shape), shares, errors, _boundary(grid, wraps))


def _covers_turn(phi: Array, period: float) -> bool:
    """Whether the last cell has the first as its neighbour."""
    turn = abs(phi[-1] - phi[0]) * len(phi) / max(len(phi) - 1, 1)
    return len(phi) > 2 and bool(abs(turn / period - 1.0) < 1e-6)


def _boundary(grid: npt.NDArray[np.int16], wraps: bool) -> float:
    """Share of the cells with a neighbour in another basin."""
    beside = np.zeros(grid.shape, bool)
    for axis in (0, 1):
        other = np.diff(grid, axis=axis) != 0
        left = [slice(None), slice(None)]
        right = [slice(None), slice(None)]
        left[axis], right[axis] = slice(None, -1), slice(1, None)
        beside[tuple(left)] |= other
        beside[tuple(right)] |= other
    if wraps:
        ends = grid[0] != grid[-1]
        beside[0] |= ends
        beside[-1] |= ends
    return float(beside.mean()) if beside.size else 0.0
