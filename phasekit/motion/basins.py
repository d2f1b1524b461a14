"""Which attractor a damped and driven motion comes to: basins over a grid, and their shares."""

from __future__ import annotations

import itertools
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from phasekit.errors import AttractorKind
from phasekit.motion.attractor import TOO_LONG, Search
from phasekit.motion.lost import EXHAUSTED, FAILED
from phasekit.motion.strobe import strobe

Array = npt.NDArray[np.float64]

#: Legs after which a motion is given up.
LEGS = 10_000
#: Codes of motions that came to no attractor: undecided, or away to infinity.
UNDECIDED, ESCAPED = -1, -2
#: Errors of a leg in units of the tolerance; parts of the size of the box that errors may come to,
#: and where borders decide, which motions pass more closely.
ERRORS, FINE, BORDERS = 10.0, 1e-2, 1e-6
#: Share of the cells beside another basin from which on a grid is too coarse.
COARSE = 0.5


class Basins(NamedTuple):
    """The group "basins"."""

    basin: npt.NDArray[np.int16]
    """Of shape (phi, dphi)."""
    basin_decided: npt.NDArray[np.bool_]
    """Whether errors of the steps cannot have grown so far that they decide where it comes to."""
    basin_time: Array
    """Time until the motion was seen to come to its attractor; NaN where it came to none."""
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
    enough = _least(search, phi, dphi) / (
        max(search.rtol, np.finfo(float).eps) * ERRORS * search.size
    )
    code, time, status, grown = _followed(search, states, legs, enough, threads)
    search.open[TOO_LONG] += int(np.sum(status == EXHAUSTED))
    code[(code < 0) & (status == FAILED)] = ESCAPED
    # Where all come to the same, errors decide nothing.
    decided = (code != UNDECIDED) & (~grown | (code == code[:1]).all())
    number = len(search.found)
    size = max(len(code), 1)
    shares = np.array([np.sum(code == i) for i in range(number)], float) / size
    open_ = np.sum(code == UNDECIDED) / size
    sampled = np.sqrt(shares * (1.0 - shares) / size + 0.25 / size**2) / (1.0 + 1.0 / size)
    doubt = [one.kind is AttractorKind.UNKNOWN for one in search.found]
    errors = np.where(doubt, np.nan, sampled + open_)
    grid = code.reshape(shape)
    wraps = bool(search.period) and _covers_turn(phi, search.period)
    rows = grid, decided.reshape(shape), time.reshape(shape)
    return Basins(*rows, shares, errors, _boundary(grid, wraps))


def _followed(
    search: Search, states: Array, legs: int, enough: float, threads: int | None
) -> tuple[npt.NDArray[np.int16], Array, npt.NDArray[np.int64], npt.NDArray[np.bool_]]:
    """Attractors to which motions come, times until then, how they end, and where errors grew.

    Errors grow as a tangent vector does, to which each leg adds a new one: it moves along until
    they are too great. Where damping is strong, a motion is first held against attractors as soon
    as its speed is spent.
    """
    count, targets = len(states), search.targets()
    code, status = np.full(count, -1, np.int16), np.zeros(count, np.int64)
    time, grown, on = np.zeros(count), np.zeros(count, bool), np.ones(count, bool)
    now = np.column_stack([states, np.ones(count), np.zeros(count)])
    rounds = search.rounds(legs)
    # Motions can be taken up again after any leg of a law that is the same then.
    stop = enough if search.repeats else np.inf
    for (many, leg), measured in itertools.product(rounds, (True, False)):
        rows = np.flatnonzero(on & (grown != measured))
        if not rows.size:
            continue
        width = 4 if measured else 2
        found = strobe(
            search.law, search.values, now[rows, :width], leg, 1, many, targets=targets,
            most_legs=many, enough=stop, **search.tolerances, threads=threads,
        )  # fmt: skip
        code[rows], status[rows], now[rows, :width] = found.code, found.status, found.states[:, 0]
        time[rows] += found.taken * leg
        grown[rows] |= ~(found.growth < enough)
        on[rows] = (found.code < 0) & np.isfinite(found.states[:, 0, 0])
    code[time > sum(many * leg for many, leg in rounds) * (1.0 + 1e-9)] = UNDECIDED
    return code, np.where(code >= 0, time, np.nan), status, grown


def _least(search: Search, phi: Array, dphi: Array) -> float:
    """Greatest error that cannot decide: less than a cell, and than attractors catch."""
    parts = [FINE * search.size]
    for axis, unit in ((phi, 1.0), (dphi, search.scale)):
        if len(axis) > 1:
            parts.append(float(np.diff(axis).min()) / unit)
    targets = search.targets()
    radii = targets.points[:, 2]
    parts += [float(radii[radii > 0.0].min())] if (radii > 0.0).any() else []
    if len(targets.spans):
        parts.append(BORDERS * search.size)
    return min(parts)


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
