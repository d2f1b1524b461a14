"""One center of any potential along a path of parameters: where it stays, and where it is lost.

Between two steps parameters change on a straight line. In a tube about both centers V'' > 0 and V'
has its signs at the walls for all parameters in between, as bounds tell: so the same center is in
it at all of them. Where no tube is found, all mergers along the line are.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, NamedTuple

import numpy as np

from phasekit.arrays import Array, Flags, Ints
from phasekit.bifurcation.curves import End
from phasekit.bifurcation.numerical.atlas import Atlas
from phasekit.bifurcation.numerical.boxes import bounds_of
from phasekit.bifurcation.numerical.line import Line, terms_of
from phasekit.errors import EquilibriumKind
from phasekit.numerics.intervals.program import NoRule
from phasekit.phase.numerical import functions
from phasekit.phase.numerical.formula import Formula

CENTER = EquilibriumKind.CENTER.value
#: Half widths of tubes that are tried, as parts of what equilibria are measured in.
_TUBES = (1e-9, 1e-6, 1e-4, 1e-3, 1e-2, 5e-2)
#: How far beyond an event the force is looked at, as part of the line.
_BEYOND = 1e-7


class Jump(NamedTuple):
    """A place where the center is lost: before which step, and where it comes to rest."""

    step: int
    at: dict[str, float]
    start: float
    end: float
    loss: float
    certain: bool
    """Whether it comes to rest there however weak the damping is."""


@dataclass
class Track:
    """Steps of a potential along a path; `steps` are the parameters that change."""

    formula: Formula
    still: Mapping[str, float]
    steps: Mapping[str, Array]
    jumps: list[Jump] = field(default_factory=list)
    missing: str = ""
    #: Why the center is nowhere from some step on.
    gone: str = ""

    def __post_init__(self) -> None:
        """Find the equilibria of all steps."""
        size = len(next(iter(self.steps.values())))
        values = {name: np.full(size, value) for name, value in self.still.items()}
        own = [{**values, **self.steps}[name] for name in self.formula.names]
        self.points = functions.equilibria(self.formula, *own)
        self.moving = tuple(name for name, array in self.steps.items() if np.ptp(array) > 0.0)
        self.fixed = {**self.still} | {
            name: float(array[0]) for name, array in self.steps.items() if name not in self.moving
        }

    @property
    def size(self) -> int:
        """Number of steps."""
        return len(self.points.n_equilibria)

    def line(self, step: int) -> Line:
        """The line from one step to the next."""
        ends = {
            n: (float(self.steps[n][step]), float(self.steps[n][step + 1])) for n in self.moving
        }
        moved = {name: pair for name, pair in ends.items() if pair[0] != pair[1]}
        rest = {name: pair[0] for name, pair in ends.items() if name not in moved}
        return Line(self.formula, {**self.fixed, **rest}, moved)

    def deepest(self) -> int:
        """The column of the deepest center at the first step, -1 without one."""
        centers = self.points.kind[0] == CENTER
        energy = np.where(centers, self.points.energy[0], np.inf)
        return int(np.argmin(energy)) if centers.any() else -1

    def slide(self, x: float) -> int:
        """The column of the center to which a state at rest slides at the first step, or -1."""
        phi, kind = self.points.phi[0], self.points.kind[0]
        there = np.flatnonzero(np.isfinite(phi))
        if (phi[there] == x).any():
            column = int(there[phi[there] == x][0])
            return column if kind[column] == CENTER else -1
        values = {**self.still, **{name: float(array[0]) for name, array in self.steps.items()}}
        own = [values[name] for name in self.formula.names]
        way = -float(np.sign(self.formula.slopes(x, *own)))
        column = self._ahead(phi, x, way)
        return column if column >= 0 and kind[column] == CENTER else -1

    def _ahead(self, phi: Array, x: float, way: float) -> int:
        """The column of the next equilibrium on one side; -1 if there is none."""
        far = way * (phi - x)
        if self.formula.period is not None:
            far = far % self.formula.period
        far = np.where((far > 0.0) & (way != 0.0), far, np.inf)
        return int(np.argmin(far)) if np.isfinite(far).any() else -1

    # ---------------------------------------------------------------- the walk

    def follow(self, column: int) -> Ints:
        """The column of the center at each step, -1 from where on there is none."""
        found = np.full(self.size, -1)
        found[0] = column
        start = 0
        while start < self.size - 1:
            chain = self._chain(start, int(found[start]))
            held = self._held(start, chain)
            good = int(np.argmin(held)) if not held.all() else held.size
            found[start : start + good + 1] = chain[: good + 1]
            start += good
            if start < self.size - 1:
                column = self._across(start, int(found[start]))
                start += 1
                found[start] = column
                if column < 0:
                    break
        return found

    def _chain(self, start: int, column: int) -> Ints:
        """From step to step the nearest center, as far as there are some."""
        found = [column]
        for step in range(start + 1, self.size):
            x = self.points.phi[step - 1, found[-1]]
            away = np.abs(self._near(self.points.phi[step], x) - x)
            away = np.where(self.points.kind[step] == CENTER, away, np.inf)
            if not np.isfinite(away).any():
                break
            found.append(int(np.argmin(away)))
        return np.array(found, np.intp)

    def _near(self, phi: Any, x: Any) -> Any:
        period = self.formula.period
        return phi if period is None else phi - period * np.round((phi - x) / period)

    def _held(self, start: int, chain: Ints) -> Flags:
        """Whether a tube holds the center from each step of a chain to the next one."""
        count = chain.size - 1
        held = np.zeros(count, dtype=bool)
        if not count:
            return np.zeros(min(1, self.size - 1 - start), dtype=bool)
        rows = start + np.arange(count)
        here = self.points.phi[rows, chain[:-1]]
        there = self._near(self.points.phi[rows + 1, chain[1:]], here)
        if not self.moving:
            return np.ones(count, dtype=bool)
        still = np.all(
            [self.steps[n][rows] == self.steps[n][rows + 1] for n in self.moving], axis=0
        )
        held |= still
        try:
            slope, bend = (bounds_of(self.formula, self.moving, ((order, 0),)) for order in (1, 2))
        except NoRule as rule:
            self.missing = f"no bounds of {rule} are known"
            return held
        low, high = np.minimum(here, there), np.maximum(here, there)
        seen = self.points.phi[np.isfinite(self.points.phi)]
        size = self.formula.period or float(np.ptp(seen)) or float(np.abs(seen).max()) or 1.0
        for part in _TUBES:
            rest = np.flatnonzero(~held)
            if not rest.size:
                break
            room = part * size + 0.5 * (high - low)[rest]
            a, b = low[rest] - room, high[rest] + room
            places, numbers = self._between(rows[rest])
            walls = [slope((x, x), places, *numbers)[0][0] for x in (a, b)]
            (bent,), undefined = bend((a, b), places, *numbers)
            held[rest] = (walls[0][1] < 0.0) & (walls[1][0] > 0.0) & (bent[0] > 0.0) & ~undefined
        return held if chain.size == self.size - start else np.append(held, False)

    def _between(self, rows: Ints) -> tuple[Any, list[Any]]:
        """Bounds of the place between steps, and of the numbers of the lines, for formulas of x."""
        first = {name: self.steps[name][rows] for name in self.moving}
        last = {name: self.steps[name][rows + 1] for name in self.moving}
        values: dict[str, Any] = {name: np.full(rows.shape, v) for name, v in self.fixed.items()}
        numbers = [values[name] for name in self.formula.names if name not in self.moving]
        if len(self.moving) == 1:
            (name,) = self.moving
            places = np.minimum(first[name], last[name]), np.maximum(first[name], last[name])
        else:
            places = np.zeros(rows.shape), np.ones(rows.shape)
            numbers += [first[name] for name in self.moving]
            numbers += [last[name] - first[name] for name in self.moving]
        assert len(numbers) == len(terms_of(self.formula, self.moving).parameters)
        return places, [(n, n) for n in numbers]

    def _across(self, step: int, column: int) -> int:
        """The column of the center after a step across mergers, -1 if it is lost for good."""
        line = self.line(step)
        if not line.moving:
            return column
        atlas = Atlas.from_line(line)
        self.missing = self.missing or atlas.missing
        low, high = line.span
        back = len(line.moving) == 1 and next(iter(line.moving.values()))[0] == high
        merged = self.points.kind[step, column] == EquilibriumKind.DEGENERATE
        walk = _Walk(self, atlas, step, back, bool(merged))
        x = walk.through(float(self.points.phi[step, column]))
        if x is None:
            return -1
        away = np.abs(self._near(self.points.phi[step + 1], x) - x)
        # On a fold within rounding the merged pair stands for the center.
        usable = self.points.kind[step + 1] == CENTER
        usable |= self.points.kind[step + 1] == EquilibriumKind.DEGENERATE
        away = np.where(usable, away, np.inf)
        if not np.isfinite(away).any():
            self.gone = "the center disappears"
            return -1
        return int(np.argmin(away))


@dataclass
class _Walk:
    """One center along a line, from interval to interval, in the sense of the path."""

    track: Track
    atlas: Atlas
    step: int
    back: bool
    #: Whether the center has merged with a saddle at the begin, within rounding.
    merged: bool

    def through(self, x: float) -> float | None:
        """Where the center is at the end; None if it is lost for good."""
        count = len(self.atlas.numbers)
        order = range(count)[::-1] if self.back else range(count)
        label = self._nearest(order[0], x)
        if self.merged and (label is None or self._left(order[0], label, x)):
            begin = self.atlas.span[1 if self.back else 0]
            label = self._jump(order[0], begin, x)
        for k in order:
            here = self._positions(k, leaving=True)
            if label is None or here[label] != here[label]:
                return None
            if k == order[-1]:
                return float(here[label])
            label = self._pass(k, label)
            if label is None:
                return None
        return None

    def _positions(self, k: int, *, leaving: bool) -> Array:
        """Where the arcs of an interval are next to its end, or next to its begin."""
        return self.atlas.beside(k, 1 if leaving != self.back else 0)[1]

    def _kinds(self, k: int, *, leaving: bool) -> Any:
        """The kinds of the arcs there."""
        step, phi = self.atlas.beside(k, 1 if leaving != self.back else 0)
        low, high = self.atlas.limits[k : k + 2]
        at = high - step if leaving != self.back else low + step
        own = self.atlas.line.parameters(np.full(phi.shape, at))
        return np.sign(self.track.formula.bends(phi, *own))

    def _nearest(self, k: int, x: float) -> int | None:
        """The arc of a center that is nearest at the begin of an interval."""
        phi, bent = self._positions(k, leaving=False), self._kinds(k, leaving=False)
        away = np.where(bent > 0.0, np.abs(self.track._near(phi, x) - x), np.inf)
        return int(np.argmin(away)) if np.isfinite(away).any() else None

    def _left(self, k: int, label: int, x: float) -> bool:
        """Whether a center beside a merged pair is none of those that it parts into."""
        line, at = self.atlas.line, self.atlas.span[1 if self.back else 0]
        step, phi = self.atlas.beside(k, 1 if self.back else 0)
        push = abs(line.derivative(1, 1, at, x)) * step
        third, fourth = (abs(line.derivative(order, 0, at, x)) for order in (3, 4))
        reach = math.sqrt(2.0 * push / third) if third else math.inf
        if fourth:
            reach = min(reach, (6.0 * push / fourth) ** (1.0 / 3.0))
        return abs(float(self.track._near(phi[label], x)) - x) > 3.0 * reach

    def _pass(self, k: int, label: int) -> int | None:
        """The arc on which the center is after an event, at which it may jump."""
        joints, nxt = self.atlas.joints, k - 1 if self.back else k + 1
        out, begin = (0, 1) if self.back else (1, 0)
        end = End(k, label, out)
        partner, place = joints.partner.get(end), joints.place.get(end)
        bent = self._kinds(nxt, leaving=False) if self.atlas.numbers[nxt] else np.empty(0)
        if partner is not None and partner.interval == nxt and bent[partner.label] > 0.0:
            return partner.label
        if place is not None:
            # Of the arcs that begin there a center, of several the one on the right.
            after = [
                other.label for other, at in joints.place.items()
                if at == place and other.interval == nxt and other.side == begin
                and bent[other.label] > 0.0
            ]  # fmt: skip
            if after:
                phi = self._positions(nxt, leaving=False)
                x = joints.meetings[place].phi
                return max(after, key=lambda one: float(self.track._near(phi[one], x)))
            if joints.meetings[place].kind == "end":
                self.track.gone = "the center leaves the interval"
                return None
        event = self.atlas.limits[k if self.back else k + 1]
        x = (
            joints.meetings[place].phi
            if place is not None
            else float(self._positions(k, leaving=True)[label])
        )
        return self._jump(nxt, event, x)

    def _jump(self, nxt: int, event: float, x: float) -> int | None:
        """The arc of the center to which the force leads from where one was lost."""
        line, formula = self.atlas.line, self.track.formula
        width = line.span[1] - line.span[0]
        beyond = event + (-1.0 if self.back else 1.0) * _BEYOND * width
        own = [float(p) for p in line.parameters(np.asarray(beyond))]
        way = -float(np.sign(formula.slopes(x, *own))) or 1.0
        third = line.derivative(3, 0, event, x)
        if third and abs(line.derivative(1, 1, event, x)) > 0.0:
            way = -math.copysign(1.0, third)  # a fold: the force is that of the square
        phi = self._positions(nxt, leaving=False)
        column = self.track._ahead(phi, x, way) if phi.size else -1
        if column < 0:
            self.track.gone = "nothing stops the motion"
            return None
        there = (
            x + way * ((way * (phi[column] - x)) % formula.period)
            if formula.period
            else phi[column]
        )
        heights = [line.height(event, place) for place in (x, float(there))]
        at = [float(p) for p in line.parameters(np.asarray(event))]
        names = dict(zip(formula.names, at, strict=True))
        end = self._settled(event, float(there))
        certain = self._certain(nxt, event, x, float(there), way)
        heights[1] = line.height(event, end)
        home = 0.5 * formula.period if formula.period else math.inf
        shown = [
            v if formula.period is None else home - (home - v) % formula.period for v in (x, end)
        ]
        self.track.jumps.append(
            Jump(self.step + 1, names, shown[0], shown[1], heights[0] - heights[1], certain)
        )
        return column

    def _settled(self, event: float, x: float) -> float:
        """The center at the event itself, next to where it is a little later."""
        points = self.atlas.line.equilibria(np.array([event]))
        phi = self.track._near(points.phi[0], x)
        away = np.where(points.kind[0] == CENTER, np.abs(phi - x), np.inf)
        return float(phi[int(np.argmin(away))]) if np.isfinite(away).any() else x

    def _certain(self, nxt: int, event: float, x: float, there: float, way: float) -> bool:
        """Whether the next barrier beyond a center is higher than where the motion began."""
        formula, line = self.track.formula, self.atlas.line
        phi = self._positions(nxt, leaving=False)
        column = self.track._ahead(phi, there + 1e-9 * way * (1.0 + abs(there)), way)
        start = line.height(event, x)
        if formula.period is not None and line.height(event, x + formula.period) == start:
            if np.sum(self._kinds(nxt, leaving=False) > 0.0) == 1:
                return True  # wherever it goes round, there is but this one
        if column < 0:  # what comes next is the end of the interval, or a slope without end
            end = formula.ends[1 if way > 0.0 else 0]
            return not math.isfinite(end) or line.height(event, end) > start
        beyond = float(phi[column])
        if formula.period is not None:
            beyond = there + way * ((way * (beyond - there)) % formula.period)
        return line.height(event, beyond) > start
