"""Curves of cycles of an atlas: those that begin at its points, and those that families meet."""

from __future__ import annotations

import contextlib
import itertools
import warnings
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import numpy.typing as npt
import xarray as xr

from phasekit.arrays import Array
from phasekit.bifurcation.continuation.options import ContinuationOptions
from phasekit.bifurcation.special_points import KINDS
from phasekit.errors import ConvergenceError, ParameterError
from phasekit.labelled.continuation.branch import Branch, branch_of
from phasekit.labelled.continuation.codimension_two import BEGINS
from phasekit.labelled.continuation.connection import connection
from phasekit.labelled.continuation.cycle_branch import CycleBranch, HomoclinicEnd
from phasekit.labelled.continuation.cycle_start import continue_orbit
from phasekit.labelled.continuation.special_point import SpecialPoint
from phasekit.labelled.periodic_orbits import cycles_of, most_cycles
from phasekit.numerics.interrupts import act
from phasekit.numerics.waits import stage
from phasekit.systems.plane_regions import Regions
from phasekit.systems.problem import Problem
from phasekit.systems.rests import equilibria_of

#: Kinds of curves of cycles, and of what they end as; in this order.
KINDS_OF_CYCLES = ("fold_of_cycles", "period_doubling", "torus", "connection")
#: The kind of a curve that begins at a point, by what the point calls it.
LEADS_TO = {"homoclinic": "connection"}
#: The points of codimension two at which curves of cycles begin or end.
ENDS = {
    "fold_of_cycles": ("generalized_hopf", "neutral_saddle_loop"),
    "connection": ("bogdanov_takens",),
    "torus": ("zero_hopf", "hopf_hopf", "resonance_1", "resonance_2"),
}  # fmt: skip
#: What curves are called, by what was followed.
CALLED = {"event": "window_exit", "connection": "homoclinic"}
#: Reasons for which a curve or family ends where it is not over.
EARLY = ("stuck", "max_points", "lost", "interrupted")
#: Regions thinner than this part of the rectangle are not looked through for cycles.
THIN = 0.02
#: Points of a family, to each side, within which other curves are met.
MOST = 300
#: Points of a curve, to each side.
LONG = 2000
#: The same of connections, whose steps are short where they take long.
LOOPS = 1000
#: Places of a curve, by distance, that all lie on others if it is no new one.
PARTS = 25
#: Distance from a curve, in parts of its step, within which an orbit lies on it.
ACROSS = 0.2
SAME = 1e-6
#: Distance in the plane, in parts of it, of the end of a family from the fold that it ends at.
ON_FOLD = 1e-3
#: Distance in the plane, in parts of it, of an end at which orbits shrink from the point there.
BESIDE = 1e-2
#: Ends at which orbits are seen to shrink to an equilibrium.
SHRUNK = ("hopf", "bogdanov_takens")
#: Size of an orbit, in parts of the greatest on its curve, at which it has shrunk, too.
SMALL = 1e-4
#: Last steps of a curve that ends otherwise, within which the point is at which it ends.
STEPS = 5


@dataclass
class CycleSearch:
    """Looks for curves of cycles in a rectangle of two parameters.

    Attributes
    ----------
    problem, names, span
        What `atlas` takes, checked.
    extent : dict
        Widths of the window, by state.
    points : sequence of SpecialPoint
        Points of codimension two of equilibria.
    folds : sequence of array, shape (points, 2)
        Folds of equilibria in the plane.
    """

    problem: Problem
    names: tuple[str, str]
    span: Mapping[str, tuple[float, float]]
    extent: Mapping[str, float]
    points: Sequence[SpecialPoint[Branch]]
    folds: Sequence[Array] = ()
    curves: list[CycleBranch] = field(default_factory=list)
    missed: list[str] = field(default_factory=list)
    families: list[CycleBranch] = field(default_factory=list)

    def __post_init__(self) -> None:
        """Curves end at the rectangle."""
        self.options = ContinuationOptions(bounds=self.span, max_points=LONG)
        self.of_loops = ContinuationOptions(bounds=self.span, max_points=LOOPS)
        self.sizes = np.array([high - low for low, high in self.span.values()])

    def from_points(self) -> None:
        """Follow what begins at points of codimension two."""
        for k, point in enumerate(self.points):
            stage(f"cycles at point {k + 1} of {len(self.points)}, {len(self.curves)} curves")
            for kind in BEGINS.get(point.kind, ()):
                if kind in ("fold", "hopf") or self._begun(point, kind):
                    continue
                for direction in (0, 1)[: 1 + (point.kind == "hopf_hopf")]:
                    with self._quiet(f"the {kind} curve from {point!r}"):
                        loops = LEADS_TO.get(kind, kind) == "connection"
                        options = self.of_loops if loops else self.options
                        curve = point.switch(kind, direction=direction, options=options)
                        assert isinstance(curve, CycleBranch)
                        self._add(curve)
                        self._restart(curve)

    def _restart(self, curve: CycleBranch) -> None:
        """Follow loops that grew away from their steps anew, by steps of the size of the last."""
        for stop, i in zip(curve.stops, (0, -1), strict=True):
            if curve.kind == "connection" and stop.reason == "max_points":
                first, second = self.names
                values = {name: float(ranges_of(curve)[name][i]) for name in self.names}
                there = connection(curve.problem.replace(**values), curve.orbit(i), free=first)
                self._add(there.curve(second, self.span[second], options=self.of_loops))

    def from_families(self, hopf: Iterable[SpecialPoint[Branch]]) -> None:
        """Follow the curves that families from Hopf points of cuts meet."""
        for k, point in enumerate(hopf):
            stage(f"family {k + 1} of cycles, {len(self.curves)} curves")
            if any(self._ends_at(one, point) for one in self.families):
                continue
            with self._quiet(f"the cycles from {point!r}"):
                family = point.switch(options=ContinuationOptions(max_points=MOST))
                assert isinstance(family, CycleBranch)
                self.families.append(family)
                self.missed += early(family, f"the family from {point!r}")
                self._met(family)
                self._across(family)

    def _across(self, family: CycleBranch) -> None:
        """Follow the orbit in the middle of a family along the other parameter, too."""
        values = ranges_of(family)[family.parameter].values
        middle = int(np.argmin(np.abs(values - 0.5 * (values.min() + values.max()))))
        (second,) = set(self.names) - {family.parameter}
        value = float(values[middle])
        there = family.problem.replace(**{family.parameter: value})
        where = f"the cycles through {family.parameter} = {value:.6g} along {second}"
        with self._quiet(where):
            crossing = continue_orbit(
                there, second, family.orbit(middle), self.span[second], {},
                ContinuationOptions(max_points=MOST),
            )  # fmt: skip
            self.families.append(crossing)
            self.missed += early(crossing, where)
            self._met(crossing)

    def _met(self, family: CycleBranch) -> None:
        """Follow the curves of special orbits of a family, and of homoclinic ones at its ends."""
        (second,) = set(self.names) - {family.parameter}
        for point in family.special_points:
            kind = KINDS[point.kind].curve
            if kind not in KINDS_OF_CYCLES or point.status != "converged":
                continue
            if not self._passes(kind, self._rows(family)[point.index]):
                with self._quiet(f"the {kind} curve through {point!r}"):
                    self._add(point.curve(second, self.span[second], options=self.options))
        for stop in family.stops:
            if not isinstance(stop, HomoclinicEnd):
                continue
            if self._passes("connection", self._rows(family)[stop.side]):
                continue
            value = float(ranges_of(family)[family.parameter][stop.side])
            other = family.problem.parameters[second]
            where = f"{family.parameter} = {value:.6g}, {second} = {other:.6g}"
            # A cycle that ends at a saddle-node on it ends at the fold itself, which is there.
            fold = self._on_fold(self._rows(family)[stop.side][:2])
            with self._quiet(f"the homoclinic curve through {where}", counts=not fold):
                loop = stop.connection()
                # The cycle at the end is the farther from the loop the shorter its period.
                if not self._passes("connection", self._rows(loop)[0]):
                    self._add(loop.curve(second, self.span[second], options=self.of_loops))

    def _add(self, curve: Branch) -> None:
        """Keep a curve that is new, and none that is a part of it."""
        assert isinstance(curve, CycleBranch)
        rows = self._rows(curve)
        if not self._is_new(curve, rows):
            return
        self.curves = [
            other for other in self.curves
            if other.kind != curve.kind or not all(is_on(row, rows) for row in self._rows(other))
        ]  # fmt: skip
        self.curves.append(self._once(curve, rows))

    def _is_new(self, curve: CycleBranch, rows: Array) -> bool:
        """Whether a part of a curve lies on none that is there, or it ends where none does."""
        # By distance: where steps are short many points lie on a small part.
        along = np.append(0.0, np.cumsum(np.linalg.norm(np.diff(rows, axis=0), axis=1)))
        places = np.unique(np.searchsorted(along, np.linspace(0.0, along[-1], PARTS + 2)[1:-1]))
        ends = [
            way for way, stop in zip((1, -1), curve.stops, strict=True) if stop.reason not in EARLY
        ]
        return len(rows) > 1 and not (
            all(self._passes(curve.kind, rows[i]) for i in places)
            and all(self._passes(curve.kind, rows[::way][0], tail(rows[::way])) for way in ends)
        )

    def _once(self, curve: CycleBranch, rows: Array) -> CycleBranch:
        """A curve without the way from its start that is cut on curves that are there."""
        for way, stop in enumerate(curve.stops):
            tracks = (None, curve.tracks[1]) if way == 0 else (curve.tracks[0], None)
            if stop.reason != "max_points" or not any(tracks):
                continue
            if not self._passes(curve.kind, rows[-way]):
                continue
            part = branch_of(
                type(curve), curve.problem, curve.walker, curve.start, curve.record, tracks
            )
            count = len(self._rows(part))
            left = rows[:-count] if way == 0 else rows[count:]
            if all(self._passes(curve.kind, row) for row in left):
                return part
        return curve

    def _goes_on(self, curve: CycleBranch, side: int) -> bool:
        """Whether another curve goes on where this one ends: passes there, and is not cut."""
        row = self._rows(curve)[side]
        for other in self.curves:
            if other is curve or other.kind != curve.kind:
                continue
            rows = self._rows(other)
            cut = any(
                stop.reason in EARLY and np.linalg.norm(rows[::way][0] - row) < tail(rows[::way])
                for stop, way in zip(other.stops, (1, -1), strict=True)
            )
            if is_on(row, rows) and not cut:
                return True
        return False

    def _twice(self) -> Iterator[str]:
        """Where curves lie on each other, in words."""
        for one, other in itertools.permutations(self.curves, 2):
            if one.kind != other.kind:
                continue
            rows, others = self._rows(one), self._rows(other)
            for i, way in ((0, 1), (-1, -1)):
                if all(is_on(row, others) for row in rows[::way][: STEPS + 1]):
                    points = ranges_of(one)
                    there = ", ".join(f"{n} = {float(points[n][i]):.6g}" for n in one.free)
                    yield (
                        f"a part of the {called(one)} curve is there twice: what ends at {there} "
                        "lies on another one"
                    )

    def not_followed(self, points: Sequence[SpecialPoint[Any]]) -> list[str]:
        """What was not followed, or not to its end, beside all points of codimension two."""
        missed = [*self.missed, *self._twice()]
        for curve in self.curves:
            ends = [
                curve if end is None and self._goes_on(curve, side) else end
                for end, side in zip(
                    ends_of(curve, points, self.names, self.sizes), (0, -1), strict=True
                )
            ]
            missed += early(curve, f"the {called(curve)} curve", ends)
            missed += guesses(curve.special_points, f"on the {called(curve)} curve")
        for family in self.families:
            (other,) = set(self.names) - {family.parameter}
            value = family.problem.parameters[other]
            where = f"on the cycles along {family.parameter} at {other} = {value:.6g}"
            missed += guesses(self._leading_on(family), where)
        return list(dict.fromkeys(missed))

    def _leading_on(self, family: CycleBranch) -> list[SpecialPoint[Any]]:
        """Guesses of a family at which a curve of cycles begins that is not there."""
        rows, found = self._rows(family), []
        for point in family.special_points:
            kind, i = KINDS[point.kind].curve, point.index
            if kind not in KINDS_OF_CYCLES or point.status == "converged":
                continue
            # It lies somewhere on the step before it.
            step = np.linspace(rows[max(i - 1, 0)], rows[i], STEPS)
            if not any(self._passes(kind, row) for row in step):
                found.append(point)
        return found

    def _rows(self, curve: CycleBranch) -> Array:
        """Parameters, least and largest states of orbits, in parts of their ranges."""
        points, count = ranges_of(curve), len(curve.path)
        columns = [
            points[name].values if name in curve.free
            else np.full(count, curve.problem.parameters[name])
            for name in self.names
        ]  # fmt: skip
        columns = [v / size for v, size in zip(columns, self.sizes, strict=True)]
        for name, width in self.extent.items():
            low, high = points[f"{name}_min"].values, points[f"{name}_max"].values
            turns = self.problem.periods.get(name)
            columns += [high - low] if turns else [low / width, high / width]
        return np.stack(columns, axis=1)

    def _passes(self, kind: str, row: Array, room: float = SAME) -> bool:
        """Whether a curve of a kind that is there passes an orbit."""
        return any(
            is_on(row, self._rows(curve), room) for curve in self.curves if curve.kind == kind
        )

    def _on_fold(self, place: Array) -> bool:
        """Whether a point, in parts of the plane, is on a fold curve."""
        gaps = (np.abs(line / self.sizes - place).max(axis=1).min() for line in self.folds)
        return bool(min(gaps, default=np.inf) < ON_FOLD)

    def _begun(self, point: SpecialPoint[Branch], kind: str) -> bool:
        """Whether a curve that is there ends at a point; of two, whether both do."""
        ends = [
            end for curve in self.curves if curve.kind == LEADS_TO.get(kind, kind)
            for end in ends_of(curve, self.points, self.names, self.sizes)
        ]  # fmt: skip
        return sum(end is point for end in ends) > (point.kind == "hopf_hopf")

    def _ends_at(self, family: CycleBranch, point: SpecialPoint[Branch]) -> bool:
        """Whether a family has come to a Hopf point from its other end."""
        if family.stops[-1].reason != "hopf" or family.free != point.branch.free:
            return False
        row = [point[name] / size for name, size in zip(self.names, self.sizes, strict=True)]
        for name, width in self.extent.items():
            at = point[name] / width
            row += [0.0] if self.problem.periods.get(name) else [at, at]
        return bool(np.max(np.abs(self._rows(family)[-1] - row)) < BESIDE)

    @contextlib.contextmanager
    def _quiet(self, what: str, *, counts: bool = True) -> Iterator[None]:
        """What cannot be followed is kept as a sentence; where nothing begins there is nothing."""
        try:
            with warnings.catch_warnings():
                warnings.simplefilter("ignore", RuntimeWarning)
                yield
        except (ConvergenceError, np.linalg.LinAlgError) as error:
            self.missed += [f"{what}: {error}"] * counts
        except ParameterError:
            pass
        act()


def tail(rows: Array) -> float:
    """Length of the first steps of a curve, within which it is known where it ends."""
    return float(np.linalg.norm(np.diff(rows[: STEPS + 1], axis=0), axis=1).sum()) + SAME


def is_on(row: Array, rows: Array, room: float = SAME) -> bool:
    """Whether an orbit lies on a curve of orbits, within a part of its steps there, and a room."""
    chord, gap = np.diff(rows, axis=0), row - rows
    square = np.sum(chord**2, axis=1)
    part = np.sum(chord * gap[:-1], axis=1) / np.where(square > 0.0, square, 1.0)
    off = gap[:-1] - np.clip(part, 0.0, 1.0)[:, None] * chord
    return bool(np.any(np.linalg.norm(off, axis=1) < ACROSS * np.sqrt(square) + room))


def ranges_of(curve: Branch) -> xr.Dataset:
    """The points of a curve; of orbits their parameters and ranges alone, which is soon done."""
    return curve._ranges if isinstance(curve, CycleBranch) else curve.points


def called(curve: Branch) -> str:
    """What a curve of an atlas is called."""
    return CALLED.get(curve.kind, curve.kind)


def early(curve: Branch, what: str, joined: Sequence[Any] = (None, None)) -> list[str]:
    """Where something is not followed to its end, which is at no other point."""
    found = []
    for stop, end, i in zip(curve.stops, joined, (0, -1), strict=True):
        if stop.reason in EARLY and end is None:
            points = ranges_of(curve)
            there = ", ".join(f"{n} = {float(points[n][i]):.6g}" for n in curve.free)
            found.append(f"{what} beyond {there}: {stop.message}")
    return found


def guesses(points: Sequence[SpecialPoint[Any]], where: str) -> list[str]:
    """Points that were not found to the end, a sentence for each kind."""
    texts = []
    left = [point for point in points if point.status != "converged"]
    for kind in dict.fromkeys(point.kind for point in left):
        own = [point for point in left if point.kind == kind]
        more = f"{len(own)} points, the first of them " if len(own) > 1 else ""
        texts.append(f"{where}: {more}{own[0]!r}")
    return texts


def orbit_sizes(curve: Branch) -> Array:
    """Widths of orbits along a curve, in parts of the greatest on it, by the widest state."""
    orbits = ranges_of(curve)
    widths = np.array(
        [(orbits[f"{x}_max"] - orbits[f"{x}_min"]).values for x in curve.problem_state]
    )
    most = np.maximum(widths.max(axis=1, keepdims=True), np.finfo(float).tiny)
    return np.asarray(np.max(widths / most, axis=0))


def ends_of(
    curve: Branch, points: Iterable[SpecialPoint[Any]], names: tuple[str, str], sizes: Array
) -> list[SpecialPoint[Any] | None]:
    """The points of codimension two at which a curve begins and ends; None where there is none.

    Of those at which such curves begin the nearest one: where orbits shrink beside it, or within
    the last steps of the curve.
    """
    if curve.kind not in ENDS:
        return [None, None]
    ends: list[SpecialPoint[Any] | None] = []
    places = np.stack([ranges_of(curve)[name].values for name in names], axis=1) / sizes
    able = [point for point in points if point.kind in ENDS[curve.kind]]
    for stop, way, small in zip(
        curve.stops, (1, -1), orbit_sizes(curve)[[0, -1]] < SMALL, strict=True
    ):
        last = places[::way][: STEPS + 1]
        gaps = [
            float(np.max(np.abs(last[0] - [point[name] for name in names] / sizes)))
            for point in able
        ]
        reach = BESIDE
        if stop.reason not in SHRUNK and not small:
            reach = min(reach, float(np.abs(np.diff(last, axis=0)).sum(axis=0).max()) + SAME)
        k = int(np.argmin([*gaps, reach]))
        ends.append(able[k] if k < len(able) and stop.reason != "bound" else None)
    return ends


def cycle_line(
    curve: Branch, names: tuple[str, str], steps: Array, ends: Sequence[SpecialPoint[Any] | None]
) -> Array:  # fmt: skip
    """The points of a curve in the plane, closer than steps, from where it begins to its end."""
    from scipy.interpolate import PchipInterpolator

    places: Array = np.stack([ranges_of(curve)[name].values for name in names], axis=1)
    for k, point in enumerate(ends):
        if point is not None:
            there = np.array([[point[name] for name in names]])
            places = np.concatenate([there, places] if k == 0 else [places, there])
    gaps = np.linalg.norm(np.diff(places, axis=0) / steps, axis=1)
    keep = np.append(True, gaps > 0.0)
    places, along = places[keep], np.append(0.0, np.cumsum(gaps[gaps > 0.0]))
    if len(places) < 3:
        return np.asarray(places, float)
    fine = np.linspace(0.0, along[-1], int(np.clip(np.ceil(2.0 * along[-1]), 2, 1 << 16)))
    curve_at = PchipInterpolator(along, places, axis=0)
    return np.array(curve_at(np.union1d(fine, along)), dtype=float)


def within(
    family: CycleBranch, names: tuple[str, str], window: Mapping[str, tuple[float, float]]
) -> tuple[Array, npt.NDArray[np.bool_]]:
    """Where orbits of a family are in the plane, and whether each lies in the window."""
    points, count = ranges_of(family), len(family.path)
    places = [
        points[name].values if name in family.free
        else np.full(count, family.problem.parameters[name])
        for name in names
    ]  # fmt: skip
    inside = np.ones(count, bool)
    for name, (low, high) in window.items():
        if name not in family.problem.periods:
            inside &= (points[f"{name}_min"].values >= low) & (points[f"{name}_max"].values <= high)
    return np.stack(places, axis=1), inside


def cycles_in(
    problem: Problem, names: tuple[str, str], found: Regions, low: Array, high: Array,
    seen: Sequence[tuple[npt.NDArray[np.int64], npt.NDArray[np.bool_]]] = (),
) -> tuple[npt.NDArray[np.int64], list[str]]:  # fmt: skip
    """Limit cycles well inside each region of a planar flow, and where that number is in doubt.

    It is -1 there, of thin regions, and of other problems. Of families that were seen the regions
    of their orbits are given, and whether these lie in the window: where some do, and others do
    not, the number is not the same all over the region.
    """
    number = np.full(len(found.place), -1)
    doubts: list[str] = []
    if len(problem.state) != 2 or problem.kind != "symbolic" or problem.conservative:
        return number, doubts
    wide = np.flatnonzero(found.reach > THIN)
    for i, k in enumerate(wide):
        stage(f"region {i + 1} of {len(wide)}")
        place = dict(zip(names, found.place[k].tolist(), strict=True))
        here = problem.replace(**place)
        rests = equilibria_of(here, low, high)
        # Those of one family are in part orbits of another one: they are taken together.
        own = np.array([one for region, inside in seen for one in inside[region == k]], bool)
        if most_cycles(here, low, high, rests) == 0 and not own.any():
            number[k] = 0
            continue
        limits = cycles_of(here, low, high, rests.x)
        why = [*([rests.why] if rests.why else []), *limits.doubts]
        if own.any() and not own.all():
            why.append("in other parts of the region cycles leave the window")
        elif not limits.cycles and own.any():
            why.append("in other parts of the region there is one in the window")
        if why:
            at = ", ".join(f"{name} = {value:.6g}" for name, value in place.items())
            count = len(limits.cycles)
            doubts.append(
                f"the number of limit cycles about {at}, of which {count} "
                f"{'was' if count == 1 else 'were'} found: {'; '.join(why)}"
            )
        else:
            number[k] = len(limits.cycles)
    return number, doubts
