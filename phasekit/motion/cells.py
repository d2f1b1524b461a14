"""Cells of a grid that attractors fill, in a table by their numbers [DatserisWagemakers2022]."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from phasekit.arrays import Array, Index

#: Cells along each axis, from fine to coarse.
SIDES = (100, 70, 50, 35, 25, 18, 12)
#: Share of an attractor's states that must lie in cells which its others fill.
FILLED = 0.99
#: Part by which the grid reaches beyond the attractors.
ROOM = 0.05
#: A table is so many times as long as what it holds.
LOOSE = 2.0


def cells_of_orbits(runs: Sequence[Array], turns: Array, first: int) -> dict[str, Any]:
    """The grid of cells that long runs fill, each along its own attractor, and what is in them.

    The cells are as fine as the runs, of shape (states, n), can fill; `first` is the number of the
    first attractor. What is returned is `grid`, `side`, `keys` and `codes` of `Targets`.
    """
    every = np.concatenate(list(runs))
    low, high = every.min(axis=0), every.max(axis=0)
    room = ROOM * np.where(high > low, high - low, np.maximum(np.abs(low), 1.0))
    low, high = low - room, high + room
    angles = turns > 0.0
    low, high = np.where(angles, -0.5 * turns, low), np.where(angles, 0.5 * turns, high)
    most = int(2.0 ** (62.0 / turns.size))  # so that the number of a cell is one of 64 bits
    sides = [side for side in SIDES if side <= most] or [most]
    found: dict[str, Any] = {}
    for side in sides:
        edges = (high - low) / side
        numbers = [_numbers(run, low, edges, turns, side) for run in runs]
        apart = sum(len(np.unique(own)) for own in numbers) == len(np.unique(np.hstack(numbers)))
        if found and not apart:
            break  # coarser ones tell the attractors apart less
        keys, codes = _table(numbers, first)
        found = {"grid": np.stack([low, edges]), "side": side, "keys": keys, "codes": codes}
        if all(_is_filled(own) for own in numbers):
            break
    return found


def _numbers(states: Array, low: Array, edges: Array, turns: Array, side: int) -> Index:
    """Numbers of the cells in which states lie."""
    off = states - low
    whole = np.where(turns > 0.0, turns, 1.0)
    off = np.where(turns > 0.0, off - turns * np.floor(off / whole), off)
    places = np.clip((off / edges).astype(np.int64), 0, side - 1)
    number = np.zeros(len(states), np.int64)
    for place in places.T:
        number = number * side + place
    return number


def _is_filled(numbers: Index) -> bool:
    """Whether the later states of a run lie in cells that the earlier ones fill."""
    half = len(numbers) // 2
    return bool(np.isin(numbers[half:], numbers[:half]).mean() >= FILLED)


def _table(numbers: Sequence[Index], first: int) -> tuple[Index, Index]:
    """Each cell at the place of its number modulo the size, or the next that is free."""
    owner: dict[int, int] = {}
    for row, own in enumerate(numbers):
        owner.update(dict.fromkeys(np.unique(own).tolist(), first + row))
    size = int(LOOSE * len(owner)) | 1
    keys, codes = np.full(size, -1, np.int64), np.full(size, -1, np.int64)
    for key, code in owner.items():
        at = key % size
        while keys[at] >= 0:
            at = (at + 1) % size
        keys[at], codes[at] = key, code
    return keys, codes
