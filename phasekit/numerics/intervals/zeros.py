"""All zeros of formulas in a box, proved: interval arithmetic excludes what holds none.

A box is dropped where a component of f cannot vanish in it; on the others Krawczyk's operator
decides (`.krawczyk`). What is undecided is bisected, all boxes of a generation at once. Parameters
may be intervals: then what is proved holds for each of their values. Boxes about the zeros of their
middles are inflated until they hold one zero for all of them, and what lies elsewhere is excluded.
"""

from __future__ import annotations

import functools
from collections.abc import Mapping, Sequence
from copy import copy
from itertools import chain
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from phasekit.arrays import Array, Codes, Flags, Index
from phasekit.numerics.intervals import bisection
from phasekit.numerics.intervals.bisection import INFLATED
from phasekit.numerics.intervals.bounds import Bounds, Interval
from phasekit.numerics.intervals.kernel import DEFINED, NOWHERE
from phasekit.numerics.intervals.krawczyk import UNIT, Image, inverses, krawczyk
from phasekit.numerics.slopes import jacobian

Boxes = tuple[Array, Array]

#: Boxes of a generation beyond which the search stops, and says so.
MOST_BOXES = 1 << 16
#: Cells whose boxes are bisected side by side.
CELLS = 256
#: Relative width at which a box that nothing decides is given up: a multiple zero, or a pole.
NARROW = 1e-9
#: The same where parameters are intervals, which blur zeros anyway.
COARSE = 2.0**-14
#: Steps by which approximate zeros are refined, and boxes about them that are tried.
NEWTON, INFLATIONS = 6, 16
#: Boxes of a cell, with one zero or undecided, that are kept in one compiled search.
KEPT = 64


class Zeros(NamedTuple):
    """Zeros, one a row, with boxes that hold them; and the boxes of which nothing is known."""

    zeros: Array
    """Of interval parameters those of their middles."""
    boxes: Boxes
    """Corners; for each value of the parameters there is exactly one zero in each."""
    undecided: Boxes
    visited: int
    """Number of boxes that were looked at."""

    @property
    def complete(self) -> bool:
        """Whether these are all, and each is one."""
        return not len(self.undecided[0])


class _Known(NamedTuple):
    """Where there is one zero: a box that holds it, and a larger one in which it is alone."""

    least: Boxes
    most: Boxes


class System:
    """Bounds of f and its derivatives over boxes of the states.

    Values of parameters are numbers, or intervals (low, high), or arrays of numbers of several
    cells; units are powers of two in which the states are measured. NoRule is raised of a function
    without bounds.
    """

    def __init__(
        self,
        f: Sequence[Any],
        states: Sequence[Any],
        values: Mapping[Any, Any],
        units: npt.ArrayLike | None = None,
    ) -> None:
        self.units = None if units is None else np.asarray(units, dtype=float)
        self.m, self.n = len(f), len(states)
        self._bounds = _bounds(tuple(f), tuple(states), tuple(values))
        self.parameters: list[Interval] = []
        for value in values.values():
            ends = value if isinstance(value, tuple) else (value, value)
            low, high = (np.atleast_1d(np.asarray(end, dtype=float)) for end in ends)
            self.parameters.append((low, high))
        self.exact = all(np.array_equal(a, b) for a, b in self.parameters)

    @property
    def elementary(self) -> bool:
        """Whether f is made of elementary functions alone."""
        return self._bounds.arrays is not None

    def at_middle(self) -> System:
        """The same for the middles of the parameters."""
        found = copy(self)
        found.exact = True
        found.parameters = [(0.5 * (a + b), 0.5 * (a + b)) for a, b in self.parameters]
        return found

    def __call__(self, low: Array, high: Array, own: Index | int = 0) -> tuple[Boxes, Boxes, Flags]:
        """Bounds of f, of its derivatives, and where either may be undefined, in cells."""
        f, slopes, undefined = self.coded(low, high, own)
        return f, slopes, undefined > 0

    def coded(self, low: Array, high: Array, own: Index | int = 0) -> tuple[Boxes, Boxes, Codes]:
        """The same with codes of where they are defined: all over, at places, or nowhere."""
        if self.units is not None:
            low, high = low * self.units, high * self.units
        columns = [(low[:, i], high[:, i]) for i in range(self.n)]
        numbers = [(a[own], b[own]) for a, b in self.parameters]
        found, undefined = self._bounds.coded(*columns, *numbers)
        lows, highs = (np.stack([one[i] for one in found], axis=1) for i in (0, 1))
        shape = (-1, self.m, self.n)
        f = lows[:, : self.m], highs[:, : self.m]
        slopes = lows[:, self.m :].reshape(shape), highs[:, self.m :].reshape(shape)
        if self.units is not None:
            slopes = slopes[0] * self.units, slopes[1] * self.units
        return f, slopes, undefined


@functools.lru_cache(maxsize=64)
def _bounds(f: tuple[Any, ...], states: tuple[Any, ...], parameters: tuple[Any, ...]) -> Bounds:
    return Bounds([*f, *chain.from_iterable(jacobian(f, states))], [*states, *parameters])


def zeros_in_box(
    f: Sequence[Any],
    states: Sequence[Any],
    values: Mapping[Any, Any],
    low: npt.ArrayLike,
    high: npt.ArrayLike,
) -> Zeros:
    """Return all zeros of f in a closed box.

    Parameters are numbers, or intervals (low, high): then each box holds one zero for each of their
    values, and there are no others, if nothing is undecided.
    """
    system = System(f, states, values)
    whole = np.asarray(low, dtype=float), np.asarray(high, dtype=float)
    if system.exact:
        return _search(system, whole, [])[0]
    middle = _search(system.at_middle(), whole, [])[0]
    known = [box for x in middle.zeros for box in _inflated(system, x, whole[1] - whole[0])]
    found = _search(system, whole, known)[0]
    return found._replace(visited=middle.visited + found.visited)


def zeros_of_cells(
    f: Sequence[Any], states: Sequence[Any], values: Mapping[Any, Array], low: Array, high: Array
) -> list[Zeros]:
    """The same of cells, whose numbers `values` are, each of shape (cells,); all at once."""
    count = max((len(value) for value in values.values()), default=1)
    found: list[Zeros] = []
    for first in range(0, count, CELLS):
        part = {symbol: value[first : first + CELLS] for symbol, value in values.items()}
        cells = np.arange(min(CELLS, count - first))
        found += _search(System(f, states, part), (low, high), [], cells)
    return found


def enclosures(system: System, start: Array) -> tuple[Boxes, Flags]:
    """Boxes next to approximate zeros, one of each cell, that hold exactly one zero, and which do.

    Others are infinite.
    """
    x, own = start.copy(), np.arange(len(start))
    step = np.zeros_like(x)
    with np.errstate(all="ignore"):
        for _ in range(NEWTON):
            f, slopes, _ = system(x, x, own)
            inverse, _ = inverses(0.5 * slopes[0] + 0.5 * slopes[1])
            step = np.einsum("kij,kj->ki", inverse, 0.5 * f[0] + 0.5 * f[1])
            x = np.where(np.isfinite(x - step), x - step, x)
        size = np.abs(x) + 1e-6 * np.max(np.abs(x), axis=1, keepdims=True)
        reach = 4.0 * np.where(np.isfinite(step), np.abs(step), 0.0) + 8.0 * UNIT * size
        reach += np.finfo(float).tiny
        low, high = np.full_like(x, -np.inf), np.full_like(x, np.inf)
        found, left = np.zeros(len(x), dtype=bool), own
        for turn in range(INFLATIONS):
            if not left.size:
                break
            a, b = x[left] - reach[left], x[left] + reach[left]
            image, defined = _image(system, a, b, left, x[left])
            inside = np.all((image.low > a) & (image.high < b), axis=1) & image.usable & defined
            better = inside & np.any(image.high - image.low < 0.9 * (b - a), axis=1)
            at = left[inside]
            found[at] = True
            low[at], high[at] = (
                np.nextafter(image.low, -np.inf)[inside],
                np.nextafter(image.high, np.inf)[inside],
            )
            # A box that holds its image is narrowed to it, another one is widened.
            away = np.abs(image.middle - x[left]) + image.radius
            lost = ~(np.isfinite(away).all(axis=1) & image.usable & defined)
            wider = np.maximum(reach[left], 1.5 * away)
            narrower = 1.1 * away + 4.0 * UNIT * size[left]
            reach[left] = np.where(inside[:, None], narrower, wider)
            left = left[~lost & np.where(found[left], better & (turn < INFLATIONS - 1), True)]
    return (low, high), found


def holds_one(system: System, low: Array, high: Array, middle: Array) -> bool:
    """Whether a box about a point is proved to hold exactly one zero."""
    low, high = low[None], high[None]
    image, defined = _image(system, low, high, np.zeros(1, np.int64), middle[None])
    inside = np.all((image.low > low) & (image.high < high), axis=1)
    return bool((inside & image.usable & defined)[0])


def _search(
    system: System, whole: Boxes, known: list[_Known], cells: Index | None = None
) -> list[Zeros]:
    """All zeros in a box, some of which are the only ones in boxes of their own; of each cell."""
    cells = np.zeros(1, np.int64) if cells is None else cells
    width = whole[1] - whole[0]
    # Nothing is cut that is only a few doubles wide.
    part = NARROW if system.exact else COARSE
    narrowest = np.maximum(part * width, 8.0 * UNIT * np.max(np.abs(whole), axis=0))
    lows, highs = (np.repeat(end[None, :], len(cells), axis=0) for end in whole)
    own = cells.copy()
    sure = [(0.5 * (a + b), a, b, cells[0]) for (a, b), _ in known]
    lost: list[tuple[Array, Array, Index]] = []
    visited = np.zeros(int(cells.max()) + 1, np.int64)
    if system.exact and not known:
        left = _bisected(system, whole, narrowest, cells, sure, lost, visited)
        lows, highs, own = lows[left], highs[left], own[left]
    while len(lows):
        if len(lows) > MOST_BOXES:
            if len(cells) > 1:
                half = len(cells) // 2
                halves = cells[:half], cells[half:]
                return [one for part in halves for one in _search(system, whole, known, part)]
            lost.append((lows, highs, own))
            break
        visited += np.bincount(own, minlength=len(visited))
        for _, (a, b) in known:
            out = np.any((lows < a) | (highs > b), axis=1)
            lows, highs, own = lows[out], highs[out], own[out]
        one, centers, lows, highs, own = _judge(system, lows, highs, own, width)
        sure += zip(centers[one], lows[one], highs[one], own[one], strict=True)
        narrow = np.all(highs - lows <= narrowest, axis=1) & ~one
        if narrow.any():
            lost.append((lows[narrow], highs[narrow], own[narrow]))
        rest = ~one & ~narrow
        lows, highs = _halved(lows[rest], highs[rest], width)
        own = np.tile(own[rest], 2)
    parts = _once(system, sure, whole, cells, lost)
    empty = np.empty((0, system.n)), np.empty((0, system.n)), np.empty(0, np.int64)
    low, high, of = (np.concatenate(part) for part in zip(empty, *lost, strict=True))
    return [
        Zeros(zeros, boxes, (low[of == cell], high[of == cell]), int(visited[cell]))
        for cell, (zeros, boxes) in zip(cells, parts, strict=True)
    ]


def _bisected(
    system: System, whole: Boxes, narrowest: Array, cells: Index,
    sure: list[tuple[Array, Array, Array, int]], lost: list[tuple[Array, Array, Index]],
    visited: Index,
) -> Flags:  # fmt: skip
    """Search cells by compiled code, and add to what is found; which of them it leaves."""
    program, n = system._bounds.arrays, system.n
    if program is None or n > bisection.FEW or system.units is not None:
        return np.ones(len(cells), dtype=bool)
    values = np.array([low[cells] for low, _ in system.parameters]).T.reshape(len(cells), -1)
    values = np.ascontiguousarray(values)
    ones, open_ = np.zeros((len(cells), KEPT, 3 * n)), np.zeros((len(cells), KEPT, 2 * n))
    counts = np.zeros((len(cells), 4), np.int64)
    code, numbers, ulps, outputs = program
    ends = np.stack(whole)
    bisection.bisect(code, numbers, ulps, outputs, values, ends, narrowest, ones, open_, counts)
    left = counts[:, bisection.LEFT] > 0
    visited[cells] += counts[:, bisection.VISITED]
    for k in np.flatnonzero(~left).tolist():
        cell = cells[k]
        for row in ones[k, : counts[k, bisection.ONES]]:
            sure.append((row[:n], row[n : 2 * n], row[2 * n :], cell))
        if number := int(counts[k, bisection.LOST]):
            boxes = open_[k, :number]
            lost.append((boxes[:, :n], boxes[:, n:], np.full(number, cell)))
    return left


def _inflated(system: System, x: Array, width: Array) -> list[_Known]:
    """Boxes about a zero of middle parameters that hold one zero for all of them, if there are."""
    low, high, own = x[None], x[None], np.zeros(1, np.int64)
    least: Boxes | None = None
    most, grown = (low, high), 1.0
    for _ in range(80):
        image, defined = _image(system, low, high, own)
        usable = bool((image.usable & defined).all()) and not np.any(high - low > 2.0 * width)
        if usable and np.all((image.low > low) & (image.high < high)):
            least, most = least or (low[0], high[0]), (low, high)
        elif least is None and usable:
            most = np.minimum(low, image.low), np.maximum(high, image.high)
        elif least is None or grown < 1.0:
            break
        else:  # too much
            grown = 0.1
        more = width * (grown * np.max((most[1] - most[0]) / width) + 1e-15)
        low, high = most[0] - more, most[1] + more
    return [] if least is None else [_Known(least, (most[0][0], most[1][0]))]


def _judge(
    system: System, low: Array, high: Array, own: Index, width: Array
) -> tuple[Flags, Array, Array, Array, Index]:
    """Boxes that may hold a zero, contracted; which hold exactly one, and about where."""
    f, _, codes = system.coded(low, high, own)
    undefined = codes > DEFINED
    possible = np.all((f[0] <= 0.0) & (f[1] >= 0.0), axis=1)
    if system.elementary:  # their bounds are those of all values that f has in a box
        possible &= codes < NOWHERE
    else:
        possible |= undefined
    low, high, own = low[possible], high[possible], own[possible]
    undefined = undefined[possible]
    around = INFLATED * (high - low) + 1e-15 * width
    wide_low, wide_high = low - around, high + around
    image, defined = _image(system, wide_low, wide_high, own, 0.5 * (low + high))
    usable = image.usable & defined & ~undefined
    one = usable & np.all((image.low > wide_low) & (image.high < wide_high), axis=1)
    apart = usable & np.any((image.low > high) | (image.high < low), axis=1)
    tight = (usable & ~one)[:, None]
    new_low = np.where(tight, np.maximum(low, image.low), low)
    new_high = np.where(tight, np.minimum(high, image.high), high)
    new_low = np.where(one[:, None], wide_low, new_low)[~apart]
    new_high = np.where(one[:, None], wide_high, new_high)[~apart]
    return one[~apart], image.middle[~apart], new_low, new_high, own[~apart]


def _image(
    system: System, low: Array, high: Array, own: Index, middle: Array | None = None
) -> tuple[Image, Flags]:
    """Krawczyk's images of boxes, and where f is defined on them."""
    middle = 0.5 * (low + high) if middle is None else middle
    at, _, away = system(middle, middle, own)
    _, slopes, beyond = system(low, high, own)
    reach = np.maximum(high - middle, middle - low)
    return krawczyk(middle, reach, at, slopes), ~(away | beyond)


def _halved(low: Array, high: Array, width: Array) -> Boxes:
    """Boxes cut across their longest side, in units of the whole box."""
    if not len(low):
        return low, high
    side = np.argmax((high - low) / width, axis=1)
    rows = np.arange(len(low))
    cut = 0.5 * (low[rows, side] + high[rows, side])
    left, right = high.copy(), low.copy()
    left[rows, side] = right[rows, side] = cut
    return np.concatenate([low, right]), np.concatenate([left, high])


def _once(
    system: System,
    sure: list[tuple[Array, Array, Array, int]],
    whole: Boxes,
    cells: Index,
    lost: list[tuple[Array, Array, Index]],
) -> list[tuple[Array, Boxes]]:
    """Each zero of each cell once, to rounding, and inside the whole box."""
    empty = np.empty((0, system.n))
    if not sure:
        return [(empty, (empty, empty))] * len(cells)
    start, low, high, own = (np.array(part) for part in zip(*sure, strict=True))
    x = _refined(system.at_middle(), start, low, high, own)
    # Boxes of many cells are left as they are found: each holds one zero as well.
    a, b = _contracted(system, low, high, own) if len(cells) == 1 else (low, high)
    slack = 4e-16 * np.maximum(np.abs(whole[0]), np.abs(whole[1]))
    found = []
    order = np.argsort(own, kind="stable")
    ends = np.searchsorted(own, cells, "right", sorter=order)
    for cell, first, end in zip(
        cells, np.searchsorted(own, cells, sorter=order), ends, strict=True
    ):
        places = order[first:end]
        # A box in which a zero is the only one tells whether another's is the same: of interval
        # parameters for one value of them, and so for all.
        at = x[places, None]
        inside = np.all((at >= low[places]) & (at <= high[places]), axis=2)
        inside |= inside.T
        kept: list[int] = []
        for k in range(len(places)):
            if not inside[k, kept].any():
                kept.append(k)
        rows = []
        for k in places[kept]:
            if system.exact:
                if np.all((x[k] >= whole[0] - slack) & (x[k] <= whole[1] + slack)):
                    box = np.minimum(a[k], x[k]), np.maximum(b[k], x[k])
                    rows.append((np.clip(x[k], *whole), *box))
            elif np.all((a[k] >= whole[0]) & (b[k] <= whole[1])):
                rows.append((x[k], a[k], b[k]))
            elif np.all((b[k] >= whole[0]) & (a[k] <= whole[1])):  # for some values it is outside
                lost.append((a[k][None], b[k][None], np.array([cell])))
        rows.sort(key=lambda row: tuple(row[0]))
        zeros, *boxes = np.array(rows).reshape(-1, 3, system.n).transpose(1, 0, 2)
        found.append((zeros, (boxes[0], boxes[1])))
    return found


def _contracted(system: System, low: Array, high: Array, own: Index) -> Boxes:
    """Boxes that hold one zero each as narrow as steps make them."""
    low, high = low.copy(), high.copy()
    rows = np.arange(len(low))
    for _ in range(100):
        a, b = low[rows], high[rows]
        image, defined = _image(system, a, b, own[rows])
        usable = (image.usable & defined)[:, None]
        low[rows] = np.where(usable, np.maximum(a, image.low), a)
        high[rows] = np.where(usable, np.minimum(b, image.high), b)
        rows = rows[np.any(high[rows] - low[rows] < 0.99 * (b - a), axis=1)]
        if not rows.size:
            break
    return low, high


def _refined(system: System, x: Array, low: Array, high: Array, own: Index) -> Array:
    """Newton's method inside boxes in which a zero is the only one."""
    best, least = x.copy(), np.full((len(x), 2), np.inf)
    rows, x = np.arange(len(x)), x.copy()
    width = np.maximum(high - low, np.finfo(float).tiny)
    for _ in range(60):
        f, slopes, _ = system(x, x, own[rows])
        inverse, _ = inverses(0.5 * (slopes[0] + slopes[1]))
        step = np.einsum("kij,kj->ki", inverse, 0.5 * (f[0] + f[1]))
        # In a state that is known to rounding a step says nothing of how near the others are.
        noise = np.einsum("kij,kj->ki", np.abs(inverse), 0.5 * (f[1] - f[0]))
        long = np.maximum(np.abs(step) - noise, 0.0)
        size = np.stack([np.max(one / width[rows], axis=1) for one in (long, np.abs(step))], axis=1)
        before = least[rows]
        closer = size[:, 0] < before[:, 0]
        closer |= (size[:, 0] == before[:, 0]) & (size[:, 1] < before[:, 1])
        rows, x, step = rows[closer], x[closer], step[closer]
        best[rows], least[rows] = x, size[closer]
        if not rows.size:
            break
        x = np.clip(x - step, low[rows], high[rows])
    return best
