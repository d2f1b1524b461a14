"""Which attractor a damped and driven motion comes to: basins over a grid, and their shares."""

from __future__ import annotations

import itertools
from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from phasekit.arrays import Array
from phasekit.errors import AttractorKind
from phasekit.motion.attractor import Attractor, Search
from phasekit.motion.equation_rates import LONG
from phasekit.motion.lost import ARRIVED, FAILED
from phasekit.motion.strobe import strobe

#: Legs after which a motion is given up.
LEGS = 10_000
#: Legs after which undecided ones are looked at again, and how many of them.
FIRST, AGAIN = 1_000, 32
#: Codes of motions that came to no attractor: undecided, or away to infinity.
UNDECIDED, ESCAPED = -1, -2
#: Errors of a leg in units of the tolerance; parts of the size of the box that errors may come to,
#: and where borders decide, which motions pass more closely.
ERRORS, FINE, BORDERS = 10.0, 1e-2, 1e-6
#: Motions from which on steps by series are compiled of formulas so many times as long.
MANY, PAYS = 4_000, 4.0
#: Share of the cells beside another basin from which on a grid is too coarse.
COARSE = 0.5


class Basins(NamedTuple):
    """The group "basins"."""

    basin: npt.NDArray[np.int16]
    """Of the shape of the grid."""
    basin_decided: npt.NDArray[np.bool_]
    """Whether errors of the steps cannot have grown so far that they decide where it comes to."""
    basin_time: Array
    """Time until the motion was seen to come to its attractor; NaN where it came to none."""
    basin_fraction: Array
    basin_fraction_error: Array
    boundary_fraction: float
    """Share of the cells with a neighbour in another basin."""


def basins(
    search: Search,
    axes: Mapping[int, Array],
    states: Array | None = None,
    *,
    legs: int = LEGS,
    threads: int | None = None,
) -> Basins:
    """Basins of the attractors that a search has found, over a grid.

    Axes are values of states by their places; where there are more states than the axes say,
    `states` are those of the cells. The error of a share has two parts: that of a sample of as many
    states, Wilson's, which is not 0 of a share of 0 or 1; and the undecided.
    """
    shape = tuple(map(len, axes.values()))
    if states is None:
        states = np.stack(np.meshgrid(*axes.values(), indexing="ij"), axis=-1)
        states = states.reshape(-1, len(axes))
    legs = 0 if search.ended and not search.found else legs
    enough = _least(search, axes) / (max(search.rtol, np.finfo(float).eps) * ERRORS)
    code, time, status, grown, raised = _followed(
        search, states, min(legs, FIRST) if search.adds else legs, enough, threads
    )
    left = np.flatnonzero((code == UNDECIDED) & (status == ARRIVED))
    if search.adds and left.size and legs > FIRST:
        # What they come to may be an attractor that no start of the search came to.
        old = list(search.found)
        search.look(states[left[np.linspace(0, left.size - 1, AGAIN).astype(int)]])
        search.order()
        code = _renumbered(code, old, search.found)
        more = _followed(search, states[left], legs, enough, threads)
        code[left], time[left], status[left], grown[left] = more[:-1]
        raised = raised or more[-1]
    search.count_open(status, raised)
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
    wraps = [_covers_turn(axis, float(search.turns[i])) for i, axis in axes.items()]
    rows = grid, decided.reshape(shape), time.reshape(shape)
    return Basins(*rows, shares, errors, _boundary(grid, wraps))


def _followed(
    search: Search, states: Array, legs: int, enough: float, threads: int | None
) -> tuple[npt.NDArray[np.int16], Array, npt.NDArray[np.int64], npt.NDArray[np.bool_], str]:
    """Attractors to which motions come, times until then, how they end, and where errors grew.

    And what a function raised on the way.

    Errors grow as a tangent vector does, to which each leg adds a new one: it moves along until
    they are too great. Where damping is strong, a motion is first held against attractors as soon
    as its speed is spent.
    """
    count, targets = len(states), search.targets()
    code, status = np.full(count, -1, np.int16), np.zeros(count, np.int64)
    time, grown, on = np.zeros(count), np.zeros(count, bool), np.ones(count, bool)
    n = states.shape[1]
    now = np.column_stack([states, np.zeros(states.shape)])
    now[:, n] = search.units[0]
    rounds = search.rounds(legs)
    # Motions can be taken up again after any leg of a law that is the same then.
    stop, raised = enough if search.repeats else np.inf, ""
    for (many, leg), measured in itertools.product(rounds, (True, False)):
        rows = np.flatnonzero(on & (grown != measured))
        if not rows.size:
            continue
        width = 2 * n if measured else n
        found = strobe(
            search.law, search.values, now[rows, :width], leg, 1, many, targets=targets,
            most_legs=many, enough=stop, threads=threads,
            steps=search.steps._replace(longest=PAYS * LONG if count >= MANY else LONG),
        )  # fmt: skip
        code[rows], status[rows], now[rows, :width] = found.code, found.status, found.states[:, 0]
        time[rows] += found.taken * leg
        raised = raised or found.raised
        grown[rows] |= ~(found.growth < enough)
        on[rows] = (found.code < 0) & np.isfinite(found.states[:, 0, 0])
    code[time > sum(many * leg for many, leg in rounds) * (1.0 + 1e-9)] = UNDECIDED
    return code, np.where(code >= 0, time, np.nan), status, grown, raised


def _renumbered(
    code: npt.NDArray[np.int16], old: Sequence[Attractor], new: Sequence[Attractor]
) -> npt.NDArray[np.int16]:
    """Codes of attractors among others that were found since."""
    place = {id(one): i for i, one in enumerate(new)}
    moved = np.array([place[id(one)] for one in old] + [UNDECIDED, ESCAPED][::-1], np.int16)
    return moved[code]


def _least(search: Search, axes: Mapping[int, Array]) -> float:
    """Greatest error that cannot decide: less than a cell, and than attractors catch."""
    parts = [FINE]
    for i, axis in axes.items():
        if len(axis) > 1:
            parts.append(float(np.diff(axis).min() / search.units[i]))
    targets = search.targets()
    radii = targets.points[:, -2]
    parts += [float(radii[radii > 0.0].min())] if (radii > 0.0).any() else []
    if len(targets.spans):
        parts.append(BORDERS)
    return min(parts)


def _covers_turn(axis: Array, turn: float) -> bool:
    """Whether the last cell has the first as its neighbour."""
    way = abs(axis[-1] - axis[0]) * len(axis) / max(len(axis) - 1, 1)
    return turn > 0.0 and len(axis) > 2 and bool(abs(way / turn - 1.0) < 1e-6)


def _boundary(grid: npt.NDArray[np.int16], wraps: Sequence[bool]) -> float:
    """Share of the cells with a neighbour in another basin."""
    beside = np.zeros(grid.shape, bool)
    for axis, around in enumerate(wraps):
        other = np.diff(grid, axis=axis) != 0
        left, right = [slice(None)] * grid.ndim, [slice(None)] * grid.ndim
        left[axis], right[axis] = slice(None, -1), slice(1, None)
        beside[tuple(left)] |= other
        beside[tuple(right)] |= other
        if around:
            left[axis], right[axis] = slice(None, 1), slice(-1, None)
            ends = grid[tuple(left)] != grid[tuple(right)]
            beside[tuple(left)] |= ends
            beside[tuple(right)] |= ends
    return float(beside.mean()) if beside.size else 0.0
