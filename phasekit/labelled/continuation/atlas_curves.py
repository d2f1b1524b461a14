"""Curves of an atlas: those through the special points of equilibria along cuts, each once."""

from __future__ import annotations

import contextlib
import warnings
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field

import numpy as np

from phasekit.arrays import Array
from phasekit.bifurcation.continuation.options import ContinuationOptions
from phasekit.bifurcation.continuation.path import lies_on
from phasekit.bifurcation.special_points import KINDS
from phasekit.errors import ConvergenceError, ParameterError
from phasekit.labelled.continuation.branch import Branch
from phasekit.labelled.continuation.codimension_two import BEGINS
from phasekit.labelled.continuation.continuation import continuation
from phasekit.labelled.continuation.diagram import path_of
from phasekit.labelled.continuation.special_point import SpecialPoint
from phasekit.numerics.interrupts import act
from phasekit.systems.plane_regions import runs_in_plane
from phasekit.systems.problem import Problem
from phasekit.systems.rests import equilibria_of_cells

#: Kinds of curves of equilibria that bound regions.
KINDS_OF_CURVES = ("fold", "hopf", "branch_point", "event")
#: By what part of the window it is left on the way to points on its faces.
BEYOND = 0.05
#: Distance from a face, in parts of the window, at which a point still lies in it.
ROOM = 1e-9
#: Distance from the border of the rectangle, in parts of it, of points on it.
RIM = 1e-6
#: Distance of places of a Hopf curve, in parts of the rectangle, that families begin at.
FAR = 0.08
#: Points of a curve that all lie on another one if it is the same.
REPEATED = 3


@dataclass
class CurveSearch:
    """Looks for all curves in a rectangle of two parameters.

    Attributes
    ----------
    problem, names, span, low, high
        What `atlas` takes, checked: parameters, their ranges, corners of the window.
    """

    problem: Problem
    names: tuple[str, str]
    span: dict[str, tuple[float, float]]
    low: Array
    high: Array
    curves: list[Branch] = field(default_factory=list)
    missed: list[str] = field(default_factory=list)
    hopf: list[SpecialPoint[Branch]] = field(default_factory=list)

    def __post_init__(self) -> None:
        """Faces of the window, and how far beyond them equilibria are followed."""
        turns = np.array([self.problem.periods.get(name, 0.0) for name in self.problem.state])
        width = self.high - self.low
        self.faces = (turns == 0.0) | (width < turns * (1.0 - 1e-12))
        self.events: dict[str, str] = {}
        self.held: dict[str, str] = {}
        self.wide: dict[str, tuple[float, float]] = {}
        self.tight: dict[str, tuple[float, float]] = {}
        for i in np.flatnonzero(self.faces):
            name = self.problem.state[i]
            for end in (self.low[i], self.high[i]):
                event = f"{name} = {end:.9g}"
                self.events[event] = f"{name} - ({end!r})".replace("np.float64", "")
                self.held[event] = name
            more = BEYOND * width[i]
            self.wide[name] = (float(self.low[i] - more), float(self.high[i] + more))
            self.tight[name] = (float(self.low[i]), float(self.high[i]))

    def cut(self, along: str, other: float, nodes: Iterable[float]) -> None:
        """Follow all equilibria at nodes along one parameter, and all curves through them."""
        (second,) = set(self.names) - {along}
        problems = [self.problem.replace(**{along: float(v), second: other}) for v in nodes]
        branches: list[Branch] = []
        options = ContinuationOptions(bounds=self.wide)
        for problem, found in zip(
            problems, equilibria_of_cells(problems, self.low, self.high), strict=True
        ):
            for x in found.x:
                u = np.append(x, problem.parameters[along])
                if any(lies_on(*path_of(one), u) for one in branches):
                    continue
                with self._quiet(f"equilibria along {along}"):
                    branches.append(
                        continuation(
                            problem, along, x0=x, span=self.span[along], events=self.events,
                            options=options,
                        )
                    )  # fmt: skip
        for branch in branches:
            for point in branch.special_points:
                self.through(point, second)
                converged = point.kind == "hopf" and point.status == "converged"
                if converged and self._inside(point.x, exits=False) and not self._on_rim(point):
                    self.hopf.append(point)

    def cut_hopf_curves(self) -> None:
        """Cut Hopf curves at places of each that are far from all where one was cut before."""
        sizes = np.array([hi - lo for lo, hi in self.span.values()])
        for curve in list(self._alike("hopf", "")):
            runs = polyline(curve, self.names, FAR / 8 * sizes)
            for line in runs:
                for p, q in line[(np.array([0.5, 0.05, 0.95, 0.25, 0.75]) * len(line)).astype(int)]:
                    others = [
                        [one[name] for name in self.names]
                        for one in self.hopf if self._lies_on(curve, one)
                    ]  # fmt: skip
                    gaps = [np.max(np.abs((one - np.array([p, q])) / sizes)) for one in others]
                    if min(gaps, default=np.inf) > FAR:
                        self.cut(self.names[0], float(q), [float(p)])

    def through(self, point: SpecialPoint[Branch], second: str) -> None:
        """Follow the curve through a special point along a cut."""
        kind = KINDS[point.kind].curve
        exits = point.name in self.held
        if kind not in KINDS_OF_CURVES or point.kind == "neutral_saddle":
            return
        if point.status != "converged" or not self._inside(point.x, exits):
            return
        if (kind == "event" and not exits) or self._followed(kind, point.name, point):
            return
        bounds = {**self.tight, **self.span}
        if exits:
            bounds[self.held[point.name]] = self.wide[self.held[point.name]]
        options = ContinuationOptions(bounds=bounds)
        with self._quiet(f"the curve through {point!r}", kind != "branch_point", self._edge(point)):
            self._add(point.curve(second, self.span[second], options=options))

    def _edge(self, point: SpecialPoint[Branch]) -> str:
        """What to do where equilibria pass an edge of the window on no curve of their own."""
        name = self.held.get(point.name, "")
        if not name:
            return ""
        i = self.problem.state.index(name)
        low = abs(point.x[i] - self.low[i]) < abs(point.x[i] - self.high[i])
        room = 0.05 * (self.high[i] - self.low[i])
        other = self.low[i] - room if low else self.high[i] + room
        return (
            f"equilibria stay on the edge {point.name} of the window, or meet there: a window of "
            f"{name} {'from' if low else 'to'} {other:.3g} tells more"
        )

    def lines(self, steps: Array) -> Iterator[tuple[str, Array]]:
        """Kinds of the curves, and their points, closer than steps."""
        for curve in self.curves:
            for line in polyline(curve, self.names, steps):
                yield curve.kind, line

    def _add(self, curve: Branch) -> None:
        """Keep a curve that is new, and follow what else passes its points of codimension two."""
        held = getattr(curve.walker.curve, "held", None)
        path = path_of(curve)[1]
        places = np.linspace(0, path.count - 1, REPEATED + 2).astype(int)[1:-1]
        for one in self._alike(curve.kind, "" if held is None else held.name):
            there = [self._same_order(one, curve, path.u[i]) for i in places]
            if all(lies_on(*path_of(one), u) for u in there):
                return
        self.curves.append(curve)
        for point in curve.special_points:
            for kind in BEGINS.get(point.kind, ()):
                if kind not in ("fold", "hopf") or point.status != "converged":
                    continue
                other = kind == "hopf" and point.kind == "hopf_hopf"
                kinds = (kind, "branch_point") if kind == "fold" else (kind,)
                passing = [
                    one for each in kinds for one in self._alike(each, "")
                    if self._lies_on(one, point)
                ]  # fmt: skip
                if len(passing) < 1 + other:
                    with self._quiet(f"the {kind} curve through {point!r}"):
                        self._add(point.switch(kind))

    def _alike(self, kind: str, name: str) -> Iterator[Branch]:
        for one in self.curves:
            held = getattr(one.walker.curve, "held", None)
            if one.kind == kind and (held is None or held.name == name):
                yield one

    def _followed(self, kind: str, name: str, point: SpecialPoint[Branch]) -> bool:
        return any(self._lies_on(one, point) for one in self._alike(kind, name))

    @staticmethod
    def _same_order(one: Branch, other: Branch, u: Array) -> Array:
        """Unknowns of a curve in the order of another one."""
        n = len(one.problem_state)
        return np.append(u[:n], [u[n + other.free.index(name)] for name in one.free])

    @staticmethod
    def _lies_on(curve: Branch, point: SpecialPoint[Branch]) -> bool:
        u = np.append(point.x, [point.parameters[name] for name in curve.free])
        return lies_on(*path_of(curve), u)

    def _on_rim(self, point: SpecialPoint[Branch]) -> bool:
        return any(
            min(point[name] - low, high - point[name]) < RIM * (high - low)
            for name, (low, high) in self.span.items()
        )

    def _inside(self, x: Array, exits: bool) -> bool:
        room = (1e-6 if exits else ROOM) * (self.high - self.low)
        within = (x >= self.low - room) & (x <= self.high + room)
        return bool(np.all(within | ~self.faces))

    @contextlib.contextmanager
    def _quiet(self, what: str, counts: bool = True, instead: str = "") -> Iterator[None]:
        """What is not found is kept as a sentence, that of the error or another one."""
        try:
            with warnings.catch_warnings():
                warnings.simplefilter("ignore", RuntimeWarning)
                yield
        except (ConvergenceError, ParameterError, np.linalg.LinAlgError) as error:
            if counts:
                self.missed.append(instead or f"{what}: {error}")
        act()


def polyline(curve: Branch, names: tuple[str, str], steps: Array) -> list[Array]:
    """The curve in the plane of two parameters, as runs of points closer than steps.

    Of a Hopf curve without its neutral saddles.
    """
    made, path = path_of(curve)
    return runs_in_plane(made, path, [made.n + curve.free.index(name) for name in names], steps)
