"""Functions whose values go in steps, as rounding leaves them, which may not tell zeros apart."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from phasekit.arrays import Array
from phasekit.laws.smoothness import is_jump
from phasekit.systems.smooth import stepping

#: Places along a way to either side, and by how much longer ways follow one on which f is constant.
SIDE, LONGER = 8, 4.0
#: Steps across a way on which f is known in spite of them, and that tell of more than a jump.
KNOWN, MANY = 4.0, 3
#: Units in the last places of states, whose rounding no function is to blame for.
OWN = 4.0
#: What tells zeros apart.
WANTS = "one that tells its zeros apart, written without such terms, or a formula"


def refuse_rounding_at(problem: Any, x: Array, slopes: Array, near: Array, width: Array) -> None:
    """Refuse a function of which rounding leaves too little to tell a zero from others.

    Near is the distance within which two zeros are one, and width that of the box.
    """
    if problem.kind == "symbolic" or problem.blocks:
        return

    def f(place: Array) -> Array:
        with np.errstate(all="ignore"):
            return np.asarray(problem(place) - problem.map * place)

    ways = np.diag(near)
    own = OWN * (np.abs(slopes) @ np.spacing(np.abs(x)))
    known = [_changes(f, x, way, own) for way in ways]
    moved, stepped = (np.array(one) for one in zip(*known, strict=True))
    for i in np.flatnonzero(~moved.any(axis=0)).tolist():
        for j, way in enumerate(ways):
            far = way if stepped[j, i] else _far(f, x, way, i, float(width[j] / near[j]))
            if far is not None and (step := _step(f, x, far, i, float(own[i]))) > 0.0:
                raise stepping(problem, j, x, step, WANTS)
    if len(x) > 1:  # a combination of equations may be less known than any of them
        way = _least(slopes, near)
        moved, stepped = _changes(f, x, way, own)
        if stepped.any() and not moved.any():
            row = int(np.argmax(stepped))
            step = _step(f, x, way, row, float(own[row]))
            if step > 0.0:
                j = int(np.argmax(np.abs(way) / near))
                raise stepping(problem, j, x, step, WANTS)


def _least(slopes: Array, near: Array) -> Array:
    """The way along which f changes least, beside what it does along others."""
    sizes = np.abs(slopes) @ near
    scaled = slopes * near / np.where(sizes > 0.0, sizes, 1.0)[:, None]
    return np.asarray(np.linalg.svd(scaled)[2][-1] * near)


def _along(f: Callable[[Array], Array], x: Array, way: Array) -> tuple[Array, Array]:
    """Values of f at places along a way to both sides, and how far along they are."""
    parts = np.arange(-SIDE, SIDE + 1) / SIDE
    return np.array([f(x + part * way) for part in parts]), parts


def _changes(f: Callable[[Array], Array], x: Array, way: Array, own: Array) -> tuple[Array, Array]:
    """Which values change along a way by more than steps do, and which by steps alone."""
    values, parts = _along(f, x, way)
    gaps, ranges = np.abs(np.diff(values, axis=0)), np.ptp(values, axis=0)
    moved, stepped = ranges > 0.0, np.zeros(len(ranges), bool)
    for i in np.flatnonzero(moved & (KNOWN * gaps.max(axis=0) > ranges)).tolist():
        k = int(np.argmax(gaps[:, i]))
        if _jumps(f, x, way, i, parts[k : k + 2], values[k : k + 2, i]):
            moved[i], stepped[i] = False, gaps[k, i] > own[i]
    return moved, stepped


def _jumps(
    f: Callable[[Array], Array], x: Array, way: Array, i: int, parts: Array, ends: Array
) -> bool:
    """Whether a value jumps between two places along a way."""
    return is_jump(lambda part: float(f(x + part * way)[i]), *parts.tolist(), *ends.tolist())


def _far(f: Callable[[Array], Array], x: Array, way: Array, i: int, most: float) -> Array | None:
    """A longer way on which a value changes that is constant along one; None where it does not."""
    here, longer = f(x)[i], LONGER
    while longer <= most:
        if any(f(x + side * longer * way)[i] != here for side in (-1.0, 1.0)):
            return longer * way
        longer *= LONGER
    return None


def _step(f: Callable[[Array], Array], x: Array, way: Array, i: int, own: float) -> float:
    """The step in which a value changes along a way, next to a place; 0 where it has none."""
    values, parts = _along(f, x, way)
    gaps = np.abs(np.diff(values[:, i]))
    changes = np.flatnonzero(gaps > own)
    if not changes.size:
        return 0.0
    k = int(changes[np.argmin(np.abs(changes + 0.5 - SIDE))])
    if not _jumps(f, x, way, i, parts[k : k + 2], values[k : k + 2, i]):
        return 0.0
    wider = np.abs(np.diff(_along(f, x, LONGER * way)[0][:, i]))
    many = max(np.sum(gaps > own), np.sum(wider > own)) >= MANY
    return float(gaps[changes].min()) if many else 0.0
