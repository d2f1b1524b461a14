"""Sheets of equilibria over a plane of two parameters: where their number may change, proved.

Boxes of states and parameters are dropped where a component of f, or a sum of some that is affine
in the states (`affine_rows`), cannot vanish in them, contracted
by Krawczyk's operator, and dropped where a sign decides that no equilibrium in them merges with
another one, or none changes its stability. What is left is bisected, until it lies over one cell of
a grid of the plane: there the number may change. Off these cells it does not: it is the same all
over each connected part of the plane.
"""

from __future__ import annotations

import functools
from collections.abc import Mapping, Sequence
from itertools import chain
from typing import Any, NamedTuple

import numpy as np

from phasekit.arrays import Array, Flags, Index
from phasekit.numerics.intervals.affine_rows import affine_rows
from phasekit.numerics.intervals.bounds import Bounds
from phasekit.numerics.intervals.krawczyk import krawczyk
from phasekit.numerics.intervals.stability import stability_signs
from phasekit.numerics.slopes import jacobian

Boxes = tuple[Array, Array]

#: Boxes over one cell of the grid beyond which it is given up.
MOST = 64
#: Boxes beyond which the search stops.
MOST_BOXES = 1 << 19
#: Width of a box of states, in parts of the window, at which it is given up.
NARROW = 2.0**-16
#: Boxes of which bounds are taken at once.
AT_ONCE = 1 << 14


class Changes(NamedTuple):
    """Cells of a grid of the plane, on (first, second), in which something may change."""

    merging: Flags
    """Two equilibria may merge or cross."""
    losing: Flags
    """One may change its stability."""
    leaving: Flags
    """One may lie on a face of the window."""


class Sheets:
    """Equilibria in a window of the states over two parameters.

    There are as many formulas as states, at most four, and two parameters of the plane; the other
    parameters have values. Faces are the states of which the ends of the window, low and high, are
    looked at; not angles. NoRule is raised of a function without bounds.
    """

    def __init__(
        self, f: Sequence[Any], states: Sequence[Any], plane: Sequence[Any],
        values: Mapping[Any, float], window: Boxes, faces: Flags,
    ) -> None:  # fmt: skip
        self.n, self.window, self.faces = len(f), window, faces
        rows = tuple(affine_rows(f, states, values))
        whole = _bounds(rows, tuple(f), (*states, *plane), tuple(values))
        counts = self.n, self.n * (self.n + 3)
        #: Of f, of its derivatives as well, and of the signs of stability as well.
        self._bounds = (*(whole.first(count) for count in counts), whole)
        self._numbers = [(value, value) for value in values.values()]

    def changes(
        self, low: Array, high: Array, depth: int, crossed: Changes | None = None,
        within: tuple[Index, Index] | None = None,
    ) -> Changes:  # fmt: skip
        """Cells in which something may change, on a grid of 2^depth by 2^depth of a rectangle.

        Those in which it is known to change are left out of the search, and all but those within
        blocks of cells, from the first to before the last, if there are such.
        """
        side = 1 << depth
        self._plane, self._side = (low, high), side
        found = np.zeros((2, side, side), bool)
        leaving = np.zeros((1, side, side), bool)
        if crossed is not None:
            found[:], leaving[:] = crossed[:2], crossed.leaving
        if within is None:
            within = np.zeros((1, 2), np.int64), np.full((1, 2), side, np.int64)
        self._search(found, None, within)
        for i in np.flatnonzero(self.faces):
            for end in self.window:
                self._search(leaving, (int(i), float(end[i])), within)
        return Changes(found[0], found[1], leaving[0])

    def _search(
        self, marks: Flags, face: tuple[int, float] | None, within: tuple[Index, Index]
    ) -> None:
        """Mark the cells that are left; of a face of the window those with an equilibrium on it."""
        side = self._side
        a, b = (end[None].copy() for end in self.window)
        if face is not None:
            a[:, face[0]] = b[:, face[0]] = face[1]
        first, last = within
        a, b = np.repeat(a, len(first), axis=0), np.repeat(b, len(first), axis=0)
        open_ = np.ones((len(first), len(marks)), bool)
        while len(a):
            if len(a) > MOST_BOXES:
                self._mark(marks, first, last, open_)
                break
            parts = []
            for k in range(0, len(a), AT_ONCE):
                rows = slice(k, k + AT_ONCE)
                own, *rest = self._judged(a[rows], b[rows], first[rows], last[rows], face)
                parts.append((own + k, *rest))
            kept, a, b, undecided = (np.concatenate(part) for part in zip(*parts, strict=True))
            first, last, open_ = first[kept], last[kept], open_[kept]
            open_ &= undecided if face is None else True
            single = np.all(last - first == 1, axis=1)
            # What is open in a cell that is marked already decides nothing.
            cell = first[single]
            open_[single] &= ~marks[:, cell[:, 0], cell[:, 1]].T
            width = (b - a) / (self.window[1] - self.window[0])
            number = np.bincount(first[single] @ [side, 1], minlength=side * side)
            over = single & (number[first @ [side, 1]] > MOST)
            over |= single & np.all(width <= NARROW, axis=1)
            self._mark(marks, first[over], last[over], open_[over])
            rest = open_.any(axis=1) & ~over
            a, b, first, last, open_, width = (x[rest] for x in (a, b, first, last, open_, width))
            if not len(a):
                break
            cells = (last - first) / side
            cells[last - first == 1] = 0.0
            along = np.argmax(np.concatenate([width, cells], axis=1), axis=1)
            a, b = _halved(a, b, along)
            first, last = _parted(first, last, along - self.n)
            open_ = np.tile(open_, (2, 1))

    @staticmethod
    def _mark(marks: Flags, first: Index, last: Index, open_: Flags) -> None:
        for (i, j), (k, m), own in zip(first, last, open_, strict=True):
            marks[own, i:k, j:m] = True

    def _judged(
        self, low: Array, high: Array, first: Index, last: Index, face: tuple[int, float] | None
    ) -> tuple[Index, Array, Array, Flags]:
        """Which boxes may hold an equilibrium, contracted; whether it may merge, or lose."""
        n, (start, end) = self.n, self._plane
        step = (end - start) / self._side
        # Outward, by more than rounding of the plane's ends.
        blur = 4e-16 * np.maximum(np.abs(start), np.abs(end))
        p, q = start + first * step - blur, start + last * step + blur
        f, slopes, _, undefined = self._values(low, high, p, q, 1)
        possible = np.all((f[0] <= 0.0) & (f[1] >= 0.0), axis=1) | undefined
        rows = np.flatnonzero(possible)
        a, b, p, q = low[rows], high[rows], p[rows], q[rows]
        slopes = slopes[0][rows], slopes[1][rows]
        middle, center = 0.5 * (a + b), 0.5 * (p + q)
        at, _, _, away = self._values(middle, middle, center, center, 0)
        usable = ~(away | undefined[rows])
        # f(m, P) by its value in the middle and its slopes with the parameters.
        with np.errstate(all="ignore"):
            half = np.maximum(q - center, center - p) * (1.0 + 1e-15)
            size = np.maximum(np.abs(slopes[0][:, :, n:]), np.abs(slopes[1][:, :, n:]))
            sway = np.einsum("kij,kj->ki", size, half) * (1.0 + 1e-14)
            sway += 1e-300
            spread = at[0] - sway, at[1] + sway
            reach = np.maximum(b - middle, middle - a)
            inner = np.maximum(np.abs(slopes[0][:, :, :n]), np.abs(slopes[1][:, :, :n]))
            more = np.einsum("kij,kj->ki", inner, reach) * (1.0 + 1e-14)
            none = np.any((spread[0] - more > 0.0) | (spread[1] + more < 0.0), axis=1) & usable
        if face is None:
            image = krawczyk(middle, reach, spread, (slopes[0][:, :, :n], slopes[1][:, :, :n]))
            sure = usable & image.usable
            none |= sure & np.any((image.low > b) | (image.high < a), axis=1)
            tight = sure[:, None]
            a = np.where(tight, np.maximum(a, image.low), a)
            b = np.where(tight, np.minimum(b, image.high), b)
        rows, a, b, p, q = rows[~none], a[~none], b[~none], p[~none], q[~none]
        if face is not None:
            return rows, a, b, np.ones((len(rows), 1), bool)
        _, _, signs, beyond = self._values(a, b, p, q, 2)
        below, above = signs[1] < 0.0, signs[0] > 0.0
        merging = ~(below[:, 0] | above[:, 0]) | beyond
        losing = ~(below.any(axis=1) | above.all(axis=1)) | beyond
        return rows, a, b, np.stack([merging, losing], axis=1)

    def _values(
        self, low: Array, high: Array, p: Array, q: Array, most: int
    ) -> tuple[Boxes, Boxes, Boxes, Flags]:
        """Bounds of f, of its derivatives, and of the signs of stability, or fewer of these."""
        n = self.n
        columns = [(low[:, i], high[:, i]) for i in range(n)]
        columns += [(p[:, i], q[:, i]) for i in (0, 1)]
        found, undefined = self._bounds[most](*columns, *self._numbers)
        a, b = (
            np.stack([np.broadcast_to(one[i], len(low)) for one in found], axis=1) for i in (0, 1)
        )
        cut = n + n * (n + 2)
        shape = (len(low) if most else 0, n, n + 2)
        return (
            (a[:, :n], b[:, :n]),
            (a[:, n:cut].reshape(shape), b[:, n:cut].reshape(shape)),
            (a[:, cut:], b[:, cut:]),
            undefined,
        )


@functools.lru_cache(maxsize=16)
def _bounds(
    rows: tuple[Any, ...], f: tuple[Any, ...], variables: tuple[Any, ...], others: tuple[Any, ...]
) -> Bounds:
    slopes = chain.from_iterable(jacobian(rows, variables))
    signs = stability_signs(f, variables[: len(f)])
    return Bounds([*rows, *slopes, *signs], [*variables, *others])


def _halved(low: Array, high: Array, along: Index) -> Boxes:
    """Boxes cut across a state; where that is none, twice."""
    left, right = high.copy(), low.copy()
    rows = np.flatnonzero(along < low.shape[1])
    cut = 0.5 * (low + high)[rows, along[rows]]
    left[rows, along[rows]] = right[rows, along[rows]] = cut
    return np.concatenate([low, right]), np.concatenate([left, high])


def _parted(first: Index, last: Index, along: Index) -> tuple[Index, Index]:
    """Cells cut across a parameter; where that is none, twice."""
    left, right = last.copy(), first.copy()
    rows = np.flatnonzero(along >= 0)
    cut = (first + last)[rows, along[rows]] // 2
    left[rows, along[rows]] = right[rows, along[rows]] = cut
    return np.concatenate([first, right]), np.concatenate([left, last])
