"""All curves of equilibria of a potential along a line of parameters.

Between two mergers the number of equilibria is constant, and their order round the circle; so each
arc is followed by its place among them. At a merger it is told by how equilibria come near to it
which of them meet there; the others go on in their order.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import numpy as np

from phasekit.arrays import Array, Ints
from phasekit.bifurcation.curves import (
    Columns,
    Curve,
    End,
    Joints,
    Meeting,
    NormalForm,
    curves,
    places,
)
from phasekit.bifurcation.numerical.boxes import Merger
from phasekit.bifurcation.numerical.line import Line
from phasekit.bifurcation.numerical.mergers import SAME, apart, mergers, window
from phasekit.errors import EquilibriumKind
from phasekit.phase.numerical.equilibria import Equilibria

#: How near to an event arcs are looked at, as part of the interval.
_NEAR = 1e-6
#: Samples of an interval in which arcs are followed.
_SAMPLES = 33


@dataclass
class Atlas:
    """Equilibria along a line: intervals between events, and how arcs go on at these."""

    line: Line
    events: list[list[Merger]]
    missing: str
    joints: Joints = field(default_factory=Joints)
    _seen: dict[tuple[int, int], tuple[float, Array]] = field(default_factory=dict)

    @classmethod
    def from_line(cls, line: Line) -> Atlas:
        """Find all events of a line, and join the arcs there."""
        found = mergers(line)
        low, high = line.span
        # What happens at an end, within its error, is not inside.
        room = 2.0**-50 * (high - low)
        inside = [m for m in found.found if low + room < m.at - m.error]
        inside = [m for m in inside if m.at + m.error < high - room]
        made = cls(line, _grouped(inside, SAME * (high - low)), found.missing)
        for k in range(len(made.events)):
            made._join(k)
        return made

    @property
    def span(self) -> tuple[float, float]:
        """First and last place."""
        return self.line.span

    @property
    def circle(self) -> float | None:
        """Length of the circle."""
        return self.line.circle

    @cached_property
    def size(self) -> float:
        """A turn, or how far apart equilibria lie."""
        low, high = window(self.line)
        return high - low

    @cached_property
    def limits(self) -> list[float]:
        """Ends of the intervals."""
        low, high = self.span
        return [low, *(group[0].at for group in self.events), high]

    @cached_property
    def numbers(self) -> list[int]:
        """How many equilibria each interval has."""
        middles = np.array([0.5 * (a + b) for a, b in itertools.pairwise(self.limits)])
        found = self.line.equilibria(middles)
        if not found.complete.all() and not self.missing:
            self.missing = "rounding hides whether there are other equilibria"
        return [max(int(n), 0) for n in found.n_equilibria]

    def curves(self) -> list[Curve]:
        """All curves of equilibria."""
        return curves(self, self.limits, [range(n) for n in self.numbers], self.joints)

    # ---------------------------------------------------------------- arcs

    def solve(self, at: Array) -> Equilibria:
        """Equilibria at places."""
        return self.line.equilibria(at)

    def columns(self, interval: int, at: Array, points: Equilibria) -> Columns:
        """These by their arcs, which have the numbers of the middle of the interval."""
        n, middle = self.numbers[interval], 0.5 * sum(self.limits[interval : interval + 2])
        usable = np.flatnonzero(points.n_equilibria == n)
        shape = (at.size, n)
        found = [np.full(shape, np.nan), np.zeros(shape, np.int8), *np.full((2, *shape), np.nan)]
        label = np.tile(np.arange(n), (at.size, 1))
        if n and usable.size:
            phi = points.phi[usable, :n]
            shift = _shifts(phi, self.circle, int(np.argmin(np.abs(at[usable] - middle))))
            label[usable] = (np.arange(n) + shift[:, None]) % n
            fields: Any = points[:4]
            for column, field_ in zip(found, fields, strict=True):
                column[usable] = np.take_along_axis(field_[usable, :n], label[usable], axis=1)
        return Columns(found[0], found[1], found[2], found[3], label)

    def end(self, at: float, near: float, kind: int, label: int) -> Sequence[float]:
        """The equilibrium next to a coordinate."""
        points = self.solve(np.array([at]))
        away = [apart(self.line, x, near) if np.isfinite(x) else np.inf for x in points.phi[0]]
        same = np.where(points.kind[0] == kind, away, np.inf)
        slot = int(np.argmin(same if np.isfinite(same).any() else away))
        return [float(x[0, slot]) for x in points[:4]]

    def special(self, meeting: Meeting, kind: int) -> Sequence[float]:
        """A merged equilibrium, or one that leaves."""
        x = meeting.phi
        if not np.isfinite(x):
            return x, kind, math.nan, math.nan
        merged = meeting.kind != "end"
        bend = 0.0 if merged else self.line.derivative(2, 0, meeting.at, x)
        code = EquilibriumKind.DEGENERATE if merged else kind
        return x, code, self.line.height(meeting.at, x), bend

    # ---------------------------------------------------------------- joints

    def beside(self, k: int, side: int) -> tuple[float, Array]:
        """How far from the event at one end of an interval arcs are seen, and where they are."""
        if (k, side) not in self._seen:
            self._seen[k, side] = self._beside(k, side)
        return self._seen[k, side]

    def _beside(self, k: int, side: int) -> tuple[float, Array]:
        low, high = self.limits[k : k + 2]
        step = _NEAR * (high - low)
        at = np.sort(np.append(places((low, high), np.linspace(0.0, 1.0, _SAMPLES)[1:-1]),
                               [low + step, high - step]))  # fmt: skip
        phi = self.columns(k, at, self.solve(at)).phi
        rows = np.flatnonzero(np.isfinite(phi).all(axis=1)) if phi.shape[1] else np.array([0])
        if not rows.size:
            return step, np.full(phi.shape[1], np.nan)
        row = rows[0] if side == 0 else rows[-1]
        return float(abs(at[row] - (low if side == 0 else high))), phi[row]

    def _join(self, k: int) -> None:
        """Link the ends of arcs at one event, between intervals k and k + 1."""
        sides = [self.beside(k, 1), self.beside(k + 1, 0)]
        free = [set(range(len(phi))) for _, phi in sides]
        for merger in self.events[k]:
            self._meet(k, merger, sides, free)
        left, right = (sorted(labels) for labels in free)
        if len(left) != len(right):
            self.missing = self.missing or f"what meets at {self.events[k][0].at:.6g} is not known"
        for one, other in self._in_order(left, right, sides):
            self.joints.link(End(k, one, 1), End(k + 1, other, 0))

    def _in_order(
        self, left: list[int], right: list[int], sides: list[tuple[float, Array]]
    ) -> list[tuple[int, int]]:
        """Pairs of arcs that go on, each into the nearest one."""
        pairs, rest = [], list(right)
        for one in left:
            if rest:
                x = float(sides[0][1][one])
                away = [apart(self.line, x, float(sides[1][1][j])) for j in rest]
                other = rest[int(np.argmin(away))]
                rest.remove(other)
                pairs.append((one, other))
        return pairs

    def _meet(
        self, k: int, m: Merger, sides: list[tuple[float, Array]], free: list[set[int]]
    ) -> None:
        """Link the arcs that meet at one point."""
        near = [
            _Near(self, k + side, 1 - side, m, *sides[side], free[side]) for side in (0, 1)
        ]  # the end of the left interval, the begin of the right one
        if m.kind == "exit":
            self._leave(m, near)
            return
        d = self.line.derivative
        s, x = m.at, m.x
        kind, pairs = m.kind, list[tuple[End, End]]()
        if kind == "fold":
            curve = -2.0 * d(1, 1, s, x) / d(3, 0, s, x)
            side = near[1] if curve > 0.0 else near[0]
            pairs.append(side.take_pair(math.sqrt(abs(curve) * side.step)))
        elif kind == "pitchfork":
            curve = -6.0 * d(2, 1, s, x) / d(4, 0, s, x)
            full, bare = (near[1], near[0]) if curve > 0.0 else (near[0], near[1])
            middle = full.take(0.0)
            pairs.append(full.take_pair(math.sqrt(abs(curve) * full.step)))
            pairs.append((middle, bare.take(0.0)))
        elif kind == "transcritical":
            slope = -2.0 * d(2, 1, s, x) / d(3, 0, s, x)
            for rate in (0.0, slope):
                pairs.append(
                    (near[0].take(-rate * near[0].step), near[1].take(rate * near[1].step))
                )
        else:
            kind, pairs = _undecided(near)
        form = self._normal_form(m, kind)
        place = self.joints.note(Meeting(m.at, m.x, kind, form))
        for one, other in pairs:
            if one is not None and other is not None:
                self.joints.link(one, other, place)

    def _leave(self, m: Merger, near: list[_Near]) -> None:
        """End the arcs that leave at an end of the interval, or for infinity."""
        for side in near:
            if math.isinf(m.x):
                ends = side.take_far(self.size)
            else:
                rate = -self.line.derivative(1, 1, m.at, m.x) / self.line.derivative(
                    2, 0, m.at, m.x
                )
                way = rate if side.side == 0 else -rate
                low = m.x == self.line.formula.ends[0]
                ends = [side.take(way * side.step)] if (way > 0.0) == low else []
            for end, x in ((end, side.position(end)) for end in ends):
                at = math.copysign(math.inf, x) if math.isinf(m.x) else m.x
                self.joints.place[end] = self.joints.note(Meeting(m.at, at, "end"))

    def _normal_form(self, m: Merger, kind: str) -> NormalForm:
        d = self.line.derivative
        crossing = kind in ("pitchfork", "transcritical", "branch_point")
        unfolding = -d(2, 1, m.at, m.x) if crossing else -d(1, 1, m.at, m.x)
        third, fourth = d(3, 0, m.at, m.x), d(4, 0, m.at, m.x)
        quadratic = -0.5 * third if kind in ("fold", "transcritical") else 0.0
        return NormalForm(unfolding, quadratic, math.nan if kind == "fold" else -fourth / 6.0)


@dataclass
class _Near:
    """Arcs of one interval next to a merger: where they are, and which of them are still free."""

    atlas: Atlas
    interval: int
    side: int
    merger: Merger
    step: float
    phi: Array
    free: set[int]

    def away(self, label: int, u: float = 0.0) -> float:
        """Distance of an arc from a point beside the merger."""
        return apart(self.atlas.line, float(self.phi[label]), self.merger.x + u)

    def take(self, u: float) -> Any:
        """The end of the free arc that is nearest to a point beside the merger; None if none is."""
        if not self.free:
            return None
        label = min(self.free, key=lambda j: self.away(j, u))
        self.free.remove(label)
        return End(self.interval, label, self.side)

    def take_pair(self, u: float) -> tuple[Any, Any]:
        """Those on either side of it."""
        return self.take(-u), self.take(u)

    def take_far(self, size: float) -> list[End]:
        """Those far outside the window."""
        far = [label for label in sorted(self.free) if abs(self.phi[label]) > size]
        self.free.difference_update(far)
        return [End(self.interval, label, self.side) for label in far]

    def take_near(self) -> list[End]:
        """Those that come near to what is not decided, from left to right."""
        reach = (
            self.merger.reach + self.atlas.size * (2.0 * self.step / _length(self.atlas)) ** 0.25
        )
        near = [label for label in self.free if self.away(label) <= reach]
        self.free.difference_update(near)
        line, x = self.atlas.line, self.merger.x

        def offset(label: int) -> float:
            way = float(self.phi[label]) - x
            return way if line.circle is None else way - line.circle * round(way / line.circle)

        return [End(self.interval, label, self.side) for label in sorted(near, key=offset)]

    def position(self, end: End) -> float:
        """Where an arc is."""
        return float(self.phi[end.label])


def _length(atlas: Atlas) -> float:
    return atlas.span[1] - atlas.span[0]


def _undecided(near: list[_Near]) -> tuple[str, list[tuple[Any, Any]]]:
    """What arcs do next to a point where nothing is decided: its kind, and their links."""
    left, right = (side.take_near() for side in near)
    if len(left) == len(right):
        kind = {1: "cusp", 2: "transcritical"}.get(len(left), "branch_point")
        crossed = right[::-1] if len(left) == 2 else right
        return kind, list(zip(left, crossed, strict=True))
    many, few = (left, right) if len(left) > len(right) else (right, left)
    first = (len(many) - len(few)) // 2
    if len(few) == 1 and len(many) == 3:
        return "pitchfork", [(many[0], many[2]), (many[1], few[0])]
    kind = "fold" if not few and len(many) == 2 else "branch_point"
    surplus = many[len(few) - len(few) // 2 :][: 2 * first]
    rest = [end for end in many if end not in surplus]
    pairs: list[tuple[Any, Any]] = list(zip(surplus[::2], surplus[1::2], strict=False))
    return kind, pairs + list(zip(rest, few, strict=False))


def _grouped(found: Sequence[Merger], near: float) -> list[list[Merger]]:
    """Mergers at one place together."""
    groups: list[list[Merger]] = []
    for one in sorted(found, key=lambda m: m.at):
        if groups and one.at - groups[-1][-1].at <= near:
            groups[-1].append(one)
        else:
            groups.append([one])
    return groups


def _shifts(phi: Array, circle: float | None, anchor: int) -> Ints:
    """By how many places equilibria have moved in their rows since one of these, on a circle."""
    rows, n = phi.shape
    if circle is None or rows < 2 or n < 2:
        return np.zeros(rows, np.intp)
    turned = (np.arange(n)[:, None] + np.arange(n)) % n  # by shift
    way = phi[1:, turned] - phi[:-1, None, :]
    away = np.abs(way - circle * np.round(way / circle)).sum(axis=2)
    steps = np.concatenate([[0], np.cumsum(np.argmin(away, axis=1))])
    return np.asarray((steps - steps[anchor]) % n)
