"""Regions of a plane of two parameters: what is the same all over each, and where it is proved."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from phasekit.arrays import Array, Flags, Index
from phasekit.bifurcation.continuation.curve import Curve
from phasekit.bifurcation.continuation.kernels.defining import HOPF
from phasekit.bifurcation.continuation.path import Path
from phasekit.bifurcation.regions import depths
from phasekit.errors import FlowEquilibriumKind
from phasekit.laws.formulas import symbols_of
from phasekit.numerics.intervals.program import NoRule
from phasekit.numerics.intervals.sheets import Changes, Sheets
from phasekit.numerics.intervals.stability import MOST
from phasekit.systems.problem import Problem
from phasekit.systems.rests import equilibria_of_cells

#: Halvings of the rectangle to its cells.
DEPTH = 7
#: Cells from a curve within which nothing but that curve is looked for.
BESIDE = 3
#: How often cells with no curve near them are quartered twice, and up to which part of all.
DEEPER, MOST_OPEN = 2, 0.05
#: Parts of the side of a cell at which points of curves are taken.
FINE = 0.2
#: In cells: how far curves are apart between which a region is narrow, and at places of which they
#: meet; the side of blocks in each of which one place is looked at. How many points of one curve
#: are near each other anyway.
BETWEEN, MEET, BLOCK, ALONG = 1.0, 1e-4, 4.0, 20
#: Stable ones; without damping those are centers.
STABLE = (
    FlowEquilibriumKind.STABLE_NODE, FlowEquilibriumKind.STABLE_FOCUS, FlowEquilibriumKind.CENTER,
)  # fmt: skip


class Regions(NamedTuple):
    """Cells of the plane, on (first, second), and the regions that they form."""

    region: Index
    """Number of the region; -1 in cells that a curve crosses."""
    place: Array
    """A point well inside each region, shape (regions, 2)."""
    n_equilibria: Index
    n_stable: Index
    """Of each region; -1 where parts of it differ, so that a curve is missing."""
    reach: Array
    """How far inside these are, in parts of the rectangle."""
    open_equilibria: Flags
    open_stable: Flags
    """Cells without a curve in which the number may change."""
    why: str
    why_stable: str
    """Why nothing is proved; empty where something is."""
    near: Flags
    """Cells beside a curve at which a number changes."""

    @property
    def inner(self) -> Index:
        """Number of the region of cells whose neighbours are in it as well, else -1."""
        from scipy import ndimage

        least, most = (
            one(self.region, 3) for one in (ndimage.minimum_filter, ndimage.maximum_filter)
        )
        return np.where(least == most, self.region, -1)

    def far(self, cells: Flags) -> Flags:
        """Cells of these that are not beside a curve at which a number changes."""
        return np.asarray(cells & ~self.near)


@dataclass
class RegionSearch:
    """Counts equilibria between curves."""

    #: What `atlas` takes, checked: parameters, their ranges, corners of the window.
    problem: Problem
    names: tuple[str, str]
    span: dict[str, tuple[float, float]]
    low: Array
    high: Array
    #: Of which states the ends of the window are looked at.
    faces: Flags
    #: From steps of both parameters the curves as they are now, with their kinds (fold,
    #: branch_point, hopf; event where an equilibrium leaves the window), as points closer than
    #: these steps.
    lines: Callable[[Array], Iterable[tuple[str, Array]]]

    def __post_init__(self) -> None:
        """The rectangle, and the bounds of what happens in it, where formulas have such."""
        ends = np.array([self.span[name] for name in self.names])
        self.start, self.end = ends.T
        self.side = 1 << DEPTH
        self.step = (self.end - self.start) / self.side
        problem = self.problem
        self.sheets: Sheets | None = None
        self.why = ""
        if problem.kind != "symbolic":
            self.why = "f is code"
        elif len(problem.state) > MOST:
            self.why = f"there are more than {MOST} states"
        else:
            symbols = symbols_of([*problem.state, *problem.parameters])
            others = {
                symbols[name]: float(value)
                for name, value in problem.parameters.items()
                if name not in self.names
            }
            try:
                self.sheets = Sheets(
                    problem.f, [symbols[name] for name in problem.state],
                    [symbols[name] for name in self.names], others, (self.low, self.high),
                    self.faces,
                )  # fmt: skip
            except NoRule as rule:
                self.why = f"no bounds are known for {rule}"

    def cells(self, places: Array, finer: int = 1) -> Index:
        """The cells in which points lie."""
        found = np.floor((places - self.start) / self.step * finer).astype(np.int64)
        return np.asarray(np.clip(found, 0, finer * self.side - 1))

    def crossed(self, finer: int = 1) -> Changes:
        """Cells that curves cross, of a grid so many times finer."""
        merging, losing, leaving = np.zeros((3, finer * self.side, finer * self.side), bool)
        what = {"fold": merging, "branch_point": merging, "hopf": losing, "event": leaving}
        for kind, line in self.lines(FINE / finer * self.step):
            # A curve on a line of the grid crosses the cells of both sides.
            for off in (-1e-7, 1e-7):
                for way in ((off, off), (off, -off)):
                    i, j = self.cells(line + np.array(way) * self.step, finer).T
                    what[kind][i, j] = True
        return Changes(merging, merging | losing, leaving)

    def changes(self, own: Changes) -> Changes:
        """Cells in which a number may change, and no further halvings exclude it."""
        from scipy import ndimage

        if self.sheets is None:
            return own
        found = self.sheets.changes(self.start, self.end, DEPTH, own)
        crossed = own.merging | own.losing | own.leaving
        near = ndimage.binary_dilation(crossed, np.ones((3, 3), bool), iterations=BESIDE)
        for deeper in range(2, 2 * DEEPER + 1, 2):
            far = (found.merging | found.losing | found.leaving) & ~near
            if not 0 < far.mean() <= MOST_OPEN:
                break
            blocks = np.argwhere(far)
            parts = 1 << deeper
            fine = self.sheets.changes(
                self.start, self.end, DEPTH + deeper, self.crossed(parts),
                (blocks * parts, (blocks + 1) * parts),
            )  # fmt: skip
            shape = (self.side, parts, self.side, parts)
            for whole, part in zip(found, fine, strict=True):
                left = np.asarray(np.any(part.reshape(shape), axis=(1, 3)))
                whole[far] &= left[far]
        return found

    def regions(self) -> Regions:
        """The regions between the curves that are there now."""
        from scipy import ndimage

        own = self.crossed()
        found = self.changes(own)
        any_curve = own.merging | own.losing | own.leaving
        blocked = found.merging | found.leaving
        blocked_stable = blocked | found.losing
        region, count = ndimage.label(~any_curve)
        place, reach = self._places(region, count)
        number, why = self._agreed(region, count, ~blocked, place, 0)
        stable, why_stable = self._agreed(region, count, ~blocked_stable, place, 1)
        undamped = self.problem.conservative and len(self.problem.state) > 1
        return Regions(
            region.astype(np.int64) - 1, place, number, stable, reach,
            blocked & ~any_curve, blocked_stable & ~any_curve,
            self.why or why,
            self.why or why_stable or ("nothing is damped" if undamped else ""),
            ndimage.binary_dilation(any_curve, np.ones((3, 3), bool), iterations=BESIDE),
        )  # fmt: skip

    def divided(self, found: Regions, lines: Iterable[Array]) -> Regions:
        """Regions that further curves divide, at which their numbers do not change."""
        from scipy import ndimage

        whole = found.region >= 0
        for line in lines:
            i, j = self.cells(line).T
            whole[i, j] = False
        region, count = ndimage.label(whole)
        place, reach = self._places(region, count)
        i, j = self.cells(place).T
        old = found.region[i, j]
        return found._replace(
            region=region.astype(np.int64) - 1, place=place, reach=reach,
            n_equilibria=found.n_equilibria[old], n_stable=found.n_stable[old],
        )  # fmt: skip

    def _places(self, region: Index, count: int) -> tuple[Array, Array]:
        """Middles of the cells that lie deepest in each region, and how deep."""
        from scipy import ndimage

        depth = depths(region, region > 0)
        at = np.zeros((count, 2), np.int64)
        for k, where in enumerate(ndimage.find_objects(region)):
            own = np.where(region[where] == k + 1, depth[where], -1)
            at[k] = [s.start for s in where] + np.array(np.unravel_index(own.argmax(), own.shape))
        return self.start + (at + 0.5) * self.step, depth[at[:, 0], at[:, 1]] / self.side

    def _agreed(
        self, region: Index, count: int, clear: Flags, place: Array, which: int
    ) -> tuple[Index, str]:
        """The number in each region, counted once in each part in which it cannot change."""
        from scipy import ndimage

        parts, many = ndimage.label(clear & (region > 0))
        spots, _ = self._places(parts, many)
        i, j = self.cells(spots).T
        own = region[i, j] - 1
        # Regions that no clear cell lies in are counted as they are.
        bare = np.setdiff1d(np.arange(count), own)
        spots = np.concatenate([spots, place[bare]])
        own = np.concatenate([own, bare])
        numbers, sure = self.counted(spots)
        result = np.full(count, -2)
        for k, value in zip(own, numbers[:, which], strict=True):
            result[k] = value if result[k] in (-2, value) else -1
        why = "" if sure[:many].all() else "equilibria at some points of it are not all proved"
        return result, why

    def counted(self, places: Array) -> tuple[Index, Flags]:
        """Numbers of equilibria and of stable ones at points; whether both are proved."""
        problems = [
            self.problem.replace(**dict(zip(self.names, map(float, place), strict=True)))
            for place in places
        ]
        found = equilibria_of_cells(problems, self.low, self.high)
        numbers = np.array(
            [(len(one.x), np.isin(one.kind, STABLE).sum()) for one in found], np.int64
        ).reshape(-1, 2)
        return numbers, np.array([one.complete for one in found], bool)

    def narrow(self, found: Regions) -> tuple[Array, Index]:
        """Points between curves in the same cells whose numbers no region has, and these numbers.

        Each pair of numbers once, and only where it is proved. Looked for at one place in each
        block of cells: the middle of the two points that are nearest to each other there, which may
        be those of curves that cross. So that nothing is found proves nothing.
        """
        from scipy.spatial import cKDTree

        lines = [line / self.step for _, line in self.lines(FINE * self.step) if len(line) > 1]
        empty = np.empty((0, 2)), np.empty((0, 2), np.int64)
        if not lines or self.why:
            return empty
        points = np.concatenate(lines)
        tree = cKDTree(points)
        sizes = [len(line) for line in lines]
        number = np.arange(len(points)) + np.repeat(2 * ALONG * np.arange(len(lines)), sizes)
        pairs = tree.query_pairs(BETWEEN, output_type="ndarray")
        pairs = pairs[np.abs(number[pairs[:, 0]] - number[pairs[:, 1]]) > ALONG]
        one, other = points[pairs[:, 0]], points[pairs[:, 1]]
        apart = np.linalg.norm(one - other, axis=1)
        order = np.argsort(apart, kind="stable")
        middles = 0.5 * (one + other)[order[apart[order] > MEET]]
        if not len(middles):
            return empty
        _, first = np.unique(middles // BLOCK, axis=0, return_index=True)
        places = middles[first] * self.step
        places = places[np.all((places >= self.start) & (places <= self.end), axis=1)]
        numbers, sure = self.counted(places)
        known = np.stack([found.n_equilibria, found.n_stable], axis=1)
        same = (numbers[:, None] == known) | (known < 0)  # -1: parts of a region disagree
        sure &= ~same.all(axis=2).any(axis=1)
        numbers, first = np.unique(numbers[sure], axis=0, return_index=True)
        return places[sure][first], numbers

    def missing(self, found: Regions) -> list[tuple[Any, ...]]:
        """Points of the plane at which a curve may pass that is not there yet."""
        from scipy import ndimage

        spots: list[tuple[Any, ...]] = []
        for cells in (found.far(found.open_equilibria), found.far(found.open_stable)):
            parts, count = ndimage.label(cells, np.ones((3, 3)))
            for k in range(1, count + 1):
                rows = np.argwhere(parts == k)
                middle = rows[np.argmin(np.abs(rows - rows.mean(axis=0)).sum(axis=1))]
                spots.append(tuple(self.start + (middle + 0.5) * self.step))
        return spots


def runs_in_plane(curve: Curve, path: Path, plane: Sequence[int], steps: Array) -> list[Array]:
    """A path in the plane of two unknowns, as runs of points closer than steps.

    Of a Hopf curve without its neutral saddles.
    """
    rows = list(plane)
    pairs = np.ones(len(path.u))
    if curve.kind == HOPF:  # omega^2, which is negative of neutral saddles
        rows.append(curve.m + curve.n)
        pairs = path.u[:, rows[2]]
    u, t = path.u[:, rows], path.tangent[:, rows]
    runs: list[Array] = []
    own: list[Array] = []
    for i in range(len(u) - 1):
        length = curve.length(path.u[i + 1] - path.u[i])

        def smooth(s: Array, i: int = i, length: float = length) -> Array:
            """The cubic with the tangents of both ends."""
            s = s[:, None]
            bend = (1.0 - s) * t[i] - s * t[i + 1]
            rise = (3.0 - 2.0 * s) * s * s * (u[i + 1] - u[i])
            return np.asarray(u[i] + rise + length * s * (1.0 - s) * bend)

        first, last = 0.0, 1.0
        if (pairs[i] > 0.0) != (pairs[i + 1] > 0.0):
            least, most = (0.0, 1.0) if pairs[i + 1] > 0.0 else (1.0, 0.0)
            for _ in range(60):  # where both eigenvalues are zero
                middle = 0.5 * (least + most)
                if smooth(np.array([middle]))[0, 2] > 0.0:
                    most = middle
                else:
                    least = middle
            first, last = (most, 1.0) if pairs[i + 1] > 0.0 else (0.0, most)
        if pairs[i] > 0.0 or pairs[i + 1] > 0.0:
            count = np.ceil(np.max(np.abs((u[i + 1] - u[i])[:2] / steps)))
            points = smooth(np.linspace(first, last, int(np.clip(count, 1, 4096)) + 1))[:, :2]
            own.append(points[1:] if own else points)
        if own and (not pairs[i + 1] > 0.0 or i == len(u) - 2):
            runs.append(np.concatenate(own))
            own = []
    return runs
