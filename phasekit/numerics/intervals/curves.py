"""All curves f(x, y) = 0 in a rectangle, proved: boxes that hold none are excluded.

Boxes are quartered until on each that is left the directions of the gradient stay within a right
angle: then the curve has in it no loop and no crossing, and the signs of f at the corners of a grid
of such boxes tell how its pieces are joined ([PlantingaVegter2004]). A formula is taken apart into
factors first, as curves of different factors may cross.
"""

from __future__ import annotations

import functools
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
import numpy.typing as npt

from phasekit.arrays import Array, Flags, Index
from phasekit.numerics.intervals.bounds import FUNCTIONS, Evaluator
from phasekit.numerics.intervals.kernel import NOWHERE
from phasekit.numerics.intervals.program import real_program
from phasekit.numerics.later import later
from phasekit.numerics.slopes import jacobian

if TYPE_CHECKING:
    import sympy as sp
else:
    sp = later("sympy")

Boxes = tuple[Array, Array]

#: Halvings of the rectangle to the first grid, and to the last that is tried.
FIRST, LAST = 2, 20
#: Boxes of a grid beyond which the search stops, and says so.
MOST_BOXES = 1 << 16
#: Parts of the rectangle by which it is enlarged, so that curves on its edges lie inside of a grid
#: whose lines lie at no special places.
MARGINS = 0.0137, 0.0171
#: Operations of a formula up to which it is taken apart into factors.
SHORT = 300
#: Distance from the edge, in parts of the rectangle, at which a point lies on it.
ON_EDGE = 1e-12


class Curves(NamedTuple):
    """Curves as points in their order, and boxes of which nothing is known."""

    lines: list[Array]
    """Of shape (points, 2) each; the last point of a closed curve is the first."""
    undecided: Boxes
    visited: int
    """Number of boxes that were looked at."""

    @property
    def complete(self) -> bool:
        """Whether these are all, each of which is one."""
        return not len(self.undecided[0])


def zero_curves(
    f: Any,
    variables: Sequence[Any],
    values: Mapping[Any, float],
    low: npt.ArrayLike,
    high: npt.ArrayLike,
    resolution: int = 256,
) -> Curves:
    """Return all curves on which a formula vanishes in a closed rectangle.

    Arcs that leave the rectangle and return within one box of the grid, of so many along each side
    at least, count as one. A formula that vanishes everywhere leaves the whole rectangle undecided.
    NoRule is raised of a function without bounds.
    """
    whole = np.asarray(low, dtype=float), np.asarray(high, dtype=float)
    depth = max(int(np.ceil(np.log2(resolution))), FIRST)
    numbers = {symbol: float(value) for symbol, value in values.items()}
    above, below = factors(f, tuple(variables))
    lines: list[Array] = []
    lost: list[Boxes] = []
    visited = 0
    for part in above:
        found = _Curve(part, below, variables, numbers, whole).traced(depth)
        lines += found.lines
        lost.append(found.undecided)
        visited += found.visited
    rest = [
        np.concatenate([part[i] for part in lost]) if lost else np.empty((0, 2)) for i in (0, 1)
    ]
    return Curves(lines, (rest[0], rest[1]), visited)


def closed_curves(
    f: Any, variables: Sequence[Any], low: Array, high: Array, resolution: int = 64
) -> int | None:
    """How many closed curves there are on which a formula without factors vanishes in a rectangle.

    Those that are proved to leave it do not count; None where there may be others.
    """
    curve = _Curve(f, [], variables, {}, (low, high))
    undecided, cells, level, _ = curve.cells(int(np.log2(resolution)))
    if len(undecided[0]):
        return None
    chains, ends = curve.chains(cells, level)
    # A point lies somewhere on its edge of the grid: only where that lies outside does the point.
    outside = np.any(np.all(ends > high, axis=1) | np.all(ends < low, axis=1), axis=1)
    closed = (chain for chain in chains if len(chain) > 2 and chain[0] == chain[-1])
    return sum(not outside[chain].any() for chain in closed)


@functools.lru_cache(maxsize=128)
def factors(f: Any, variables: tuple[Any, ...]) -> tuple[list[Any], list[Any]]:
    """Factors of the numerator that hold a variable, each once, and those of the denominator."""
    if sp.sympify(f).count_ops() > SHORT:
        return [part for part in sp.Mul.make_args(f) if part.free_symbols & set(variables)] or [
            f
        ], []
    exact = f.xreplace({number: sp.Rational(number) for number in f.atoms(sp.Float)})
    exact = exact.replace(sp.tan, lambda u: sp.sin(u) / sp.cos(u))
    parts = []
    for side in sp.fraction(sp.together(exact)):
        try:
            found = [factor for factor, _ in sp.factor_list(side)[1]]
        except (sp.PolynomialError, NotImplementedError):
            found = list(sp.Mul.make_args(side))
        parts.append([e for e in found if e.free_symbols & set(variables)])
    return parts[0] or [exact], parts[1]


@functools.lru_cache(maxsize=128)
def _evaluator(formulas: tuple[Any, ...], symbols: tuple[Any, ...]) -> Evaluator:
    return Evaluator(real_program(formulas, symbols, FUNCTIONS))


_CHILDREN = np.array([[0, 0], [0, 1], [1, 0], [1, 1]])


def _quartered(cells: Index) -> Index:
    """Boxes of the next grid, the four of each together."""
    return np.asarray((2 * cells[:, None] + _CHILDREN).reshape(-1, 2))


class _Curve:
    """The zeros of one factor in a rectangle."""

    def __init__(
        self,
        factor: Any,
        below: Sequence[Any],
        variables: Sequence[Any],
        values: Mapping[Any, float],
        whole: Boxes,
    ) -> None:
        (slopes,) = jacobian([factor], variables)
        symbols = (*variables, *values)
        self._evaluate = _evaluator((factor, *slopes, *below), symbols)
        self._numbers = [(value, value) for value in values.values()]
        self.whole, self.width = whole, whole[1] - whole[0]
        self.start = whole[0] - MARGINS[0] * self.width
        self.size = self.width * (1.0 + MARGINS[0] + MARGINS[1])

    # -- boxes -------------------------------------------------------------------------------------

    def places(self, corners: Index, depth: int) -> Array:
        """Where corners of a grid are."""
        return np.asarray(self.start + self.size * (corners / 2.0**depth))

    def bounds(self, low: Array, high: Array) -> tuple[Array, Array, Flags, Flags]:
        """Bounds of f and its slopes, in columns; where these may be undefined, or f is."""
        columns = [(low[:, i], high[:, i]) for i in (0, 1)]
        found, undefined = self._evaluate([*columns, *self._numbers])
        lows, highs = (np.stack([one[i] for one in found], axis=1) for i in (0, 1))
        # Where the denominator vanishes the formula has no value.
        poles = np.any((lows[:, 3:] <= 0.0) & (highs[:, 3:] >= 0.0), axis=1)
        return lows[:, :3], highs[:, :3], (undefined > 0) | poles, undefined == NOWHERE

    def judge(self, cells: Index, depth: int) -> tuple[Flags, Flags]:
        """Which boxes may hold zeros; on which the gradient stays within a right angle."""
        low, high = (self.places(cells + k, depth) for k in (0, 1))
        least, most, undefined, nowhere = self.bounds(low, high)
        possible = (least[:, 0] <= 0.0) & (most[:, 0] >= 0.0) & ~nowhere
        clear = np.zeros(len(cells), dtype=bool)
        rows = np.flatnonzero(possible & ~undefined)
        low, high, least, most = low[rows], high[rows], least[rows], most[rows]
        middle = 0.5 * (low + high)
        at_low, at_high, _, _ = self.bounds(middle, middle)
        with np.errstate(all="ignore"):
            # f(m) + f'(X) (X - m), rounded outward.
            half = np.maximum(high - middle, middle - low) * (1.0 + 1e-15)
            slopes = np.maximum(np.abs(least[:, 1:]), np.abs(most[:, 1:]))
            sway = np.sum(slopes * half, axis=1) * (1.0 + 1e-15)
            possible[rows] = ~((at_low[:, 0] - sway > 0.0) | (at_high[:, 0] + sway < 0.0))
            # The least product of two gradients, in units of the rectangle.
            a, b = least[:, 1:] * self.width, most[:, 1:] * self.width
            product = np.where(a * b < 0.0, a * b, np.minimum(a * a, b * b))
            clear[rows] = (np.sum(product, axis=1) > 0.0) & np.isfinite(a + b).all(axis=1)
        return possible, clear

    def traced(self, depth: int) -> Curves:
        """The curves, on a grid with so many halvings at least."""
        undecided, cells, level, visited = self.cells(depth)
        chains, ends = self.chains(cells, level)
        points = self._crossings(ends)
        lines = []
        for chain in chains:
            lines += self.clipped(_thinned(points[chain], 2 ** max(level - depth, 0)))
        return Curves(lines, undecided, visited)

    def cells(self, depth: int) -> tuple[Boxes, Index, int, int]:
        """Boxes that are undecided; those of the curves, with their halvings; how many were seen.

        The first are those that meet the rectangle.
        """
        side = np.arange(2**FIRST)
        cells = np.stack(np.meshgrid(side, side, indexing="ij"), axis=-1).reshape(-1, 2)
        level, visited = FIRST, len(cells)
        possible, clear = self.judge(cells, level)
        lost = np.empty((0, 2), dtype=np.int64)
        last = depth
        while level < last and 4 * possible.sum() <= MOST_BOXES:
            cells, level = _quartered(cells[possible]), level + 1
            visited += len(cells)
            possible, clear = self.judge(cells, level)
            if level == depth:
                lost, last = self.unclear(cells[possible & ~clear], level)
        cells = cells[possible]
        if level < last:
            lost = cells[~clear[possible]] // 2 ** max(level - depth, 0)
        low, high = (self.places(lost + k, min(level, depth)) for k in (0, 1))
        inside = self._meets(low, high)
        return (low[inside], high[inside]), cells, level, visited

    def unclear(self, cells: Index, level: int) -> tuple[Index, int]:
        """Which boxes no halving makes clear; and how many halvings make all others so."""
        owner, parts = np.arange(len(cells)), cells
        settled = np.full(len(cells), level)
        for deeper in range(level + 1, LAST + 1):
            if not len(parts) or len(parts) > MOST_BOXES // 16:
                break
            parts, owner = _quartered(parts), np.repeat(owner, 4)
            possible, clear = self.judge(parts, deeper)
            settled[owner[possible & clear]] = deeper
            parts, owner = parts[possible & ~clear], owner[possible & ~clear]
        open_ = np.zeros(len(cells), dtype=bool)
        open_[owner] = True
        if open_.any():  # not worth boxes that small all along the curve
            open_ |= settled > level + 2
        return cells[open_], int(np.max(settled[~open_], initial=level))

    def _meets(self, low: Array, high: Array) -> Flags:
        """Whether boxes meet the rectangle itself."""
        return np.all((low <= self.whole[1]) & (high >= self.whole[0]), axis=1)

    # -- lines -------------------------------------------------------------------------------------

    def chains(self, cells: Index, depth: int) -> tuple[list[list[int]], Array]:
        """Edges of a grid on which f vanishes by their order on curves, and the ends of each."""
        if not len(cells):
            return [], np.empty((0, 2, 2))
        corners, where = np.unique(
            (cells[:, None] + np.array([[0, 0], [1, 0], [1, 1], [0, 1]])).reshape(-1, 2),
            axis=0, return_inverse=True,
        )  # fmt: skip
        positive = self._positive(self.places(corners, depth))
        around = where.reshape(-1, 4)
        sides = np.stack([around, np.roll(around, -1, axis=1)], axis=2)  # by their corners
        crossed = positive[sides[..., 0]] != positive[sides[..., 1]]
        keys, number = np.unique(np.sort(sides[crossed], axis=1), axis=0, return_inverse=True)
        numbers = np.full(crossed.shape, -1)
        numbers[crossed] = number.reshape(-1)
        links = [[] for _ in range(len(keys))]  # type: list[list[int]]
        for row in numbers[crossed.any(axis=1)].tolist():
            found = [k for k in row if k >= 0]
            # Two, but for boxes that are not clear: neighbors belong together there.
            for a, b in zip(found[::2], found[1::2], strict=True):
                links[a].append(b)
                links[b].append(a)
        return _chains(links), self.places(corners[keys], depth)

    def _positive(self, places: Array) -> Flags:
        """Signs of f at corners; what cannot be told from 0 counts as above it."""
        _, most, _, _ = self.bounds(places, places)
        return ~(most[:, 0] < 0.0)

    def _crossings(self, ends: Array) -> Array:
        """Zeros of f on edges with the signs of it at their ends: Newton's method, safeguarded."""
        a, b = ends[:, 0].copy(), ends[:, 1].copy()
        along = (b - a != 0.0).argmax(axis=1)
        rows = np.arange(len(a))
        rising = self._positive(b)
        x = 0.5 * (a + b)
        for _ in range(60):
            least, most, _, _ = self.bounds(x[rows], x[rows])
            value = 0.5 * (least[:, 0] + most[:, 0])
            axis = along[rows]
            slope = 0.5 * (least + most)[np.arange(len(rows)), 1 + axis]
            under = (value >= 0.0) != rising[rows]
            a[rows[under]], b[rows[~under]] = x[rows[under]], x[rows[~under]]
            here = x[rows, axis]
            first, last = np.sort(np.stack([a[rows, axis], b[rows, axis]]), axis=0)
            with np.errstate(all="ignore"):
                step = here - value / slope
            inside = (step > first) & (step < last)
            fresh = np.where(value == 0.0, here, np.where(inside, step, 0.5 * (first + last)))
            x[rows, axis] = fresh
            still = (np.abs(fresh - here) <= 4.0 * np.spacing(np.abs(fresh))) | (value == 0.0)
            rows = rows[~still]
            if not len(rows):
                break
        return x

    def clipped(self, line: Array) -> list[Array]:
        """The parts of a line in the rectangle, with points on its edge where they end."""
        low, high = self.whole
        room = ON_EDGE * self.width
        inside = np.all((line >= low - room) & (line <= high + room), axis=1)
        if inside.all():
            return [np.clip(line, low, high)]
        if np.all(line[0] == line[-1]):  # a closed line may begin outside
            first = int(np.argmin(inside))
            line = np.concatenate([line[first:-1], line[: first + 1]])
            inside = np.concatenate([inside[first:-1], inside[: first + 1]])
        parts: list[Array] = []
        edges = np.flatnonzero(np.diff(np.concatenate([[False], inside, [False]]).astype(int)))
        for start, stop in edges.reshape(-1, 2):
            own = [np.clip(line[start:stop], low, high)]
            if start > 0:
                own.insert(0, self._on_edge(line[start], line[start - 1])[None])
            if stop < len(line):
                own.append(self._on_edge(line[stop - 1], line[stop])[None])
            parts.append(np.concatenate(own))
        return [part for part in parts if len(part) > 1]

    def _on_edge(self, inner: Array, outer: Array) -> Array:
        """Where a curve between a point inside and one outside crosses the edge."""
        low, high = self.whole
        with np.errstate(all="ignore"):
            limit = np.where(outer > high, high, low)
            part = np.where(
                (outer > high) | (outer < low), (limit - inner) / (outer - inner), np.inf
            )
        axis = int(np.argmin(part))
        x = inner + max(float(part[axis]), 0.0) * (outer - inner)
        x[axis] = limit[axis]
        other = 1 - axis
        reach = abs(outer[other] - inner[other]) + 1e-3 * self.size[other]
        start = x[other]
        for _ in range(8):
            least, most, _, _ = self.bounds(x[None], x[None])
            slope = 0.5 * (least + most)[0, 1 + other]
            with np.errstate(all="ignore"):
                step = 0.5 * (least[0, 0] + most[0, 0]) / slope
            if not abs(x[other] - step - start) <= reach:
                break
            x[other] -= step
        return np.clip(x, low, high)


def _thinned(line: Array, every: int) -> Array:
    """Every so many points, the first and the last among them, but some dozens."""
    every = min(every, max(len(line) // 32, 1))
    return line if every == 1 else np.concatenate([line[:-1:every], line[-1:]])


def _chains(links: list[list[int]]) -> list[list[int]]:
    """Points in the order of their links: open chains, then closed ones, whose first comes last."""
    seen = [False] * len(links)
    ends = [k for k, near in enumerate(links) if len(near) == 1]
    found = []
    for start in (*ends, *range(len(links))):
        if seen[start] or not links[start]:
            continue
        chain, at = [start], start
        seen[start] = True
        while (after := next((k for k in links[at] if not seen[k]), None)) is not None:
            chain.append(after)
            seen[after] = True
            at = after
        if len(chain) > 2 and start in links[at] and len(links[start]) == 2:
            chain.append(start)
        found.append(chain)
    return found
