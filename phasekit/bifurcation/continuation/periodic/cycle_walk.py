"""How families of periodic orbits and curves of their special points are walked."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import ClassVar

import numpy as np

from phasekit.bifurcation.continuation.options import ContinuationOptions
from phasekit.bifurcation.continuation.periodic.cycles import Cycles
from phasekit.bifurcation.continuation.periodic.events import find
from phasekit.bifurcation.continuation.periodic.family import Found, Path
from phasekit.bifurcation.continuation.periodic.point import Point, State
from phasekit.bifurcation.continuation.periodic.trace import Track, begin, follow, where

START = 1e-6  # arclength within which a point is the start itself


@dataclass(frozen=True)
class CycleWalk:
    """A family of orbits as a `Walker`."""

    cycles: Cycles
    chunk: ClassVar[int] = 8
    looks_back: ClassVar[bool] = False

    @property
    def options(self) -> ContinuationOptions:
        """How far and how finely."""
        return self.cycles.options

    @property
    def ends(self) -> tuple[str, ...]:
        """Kinds, labels and names of special points at which it ends."""
        return self.cycles.ends

    def hindered(self, start: Point) -> None:
        """Nothing is known beforehand."""

    def turned(self, start: Point) -> Point:
        """The start in the other direction."""
        return start.flipped()

    def begin(self, start: Point) -> State:
        """The state of a walk that begins at a point."""
        return begin(self.cycles, start)

    def follow(self, state: State, points: int, start: Point) -> Track:
        """At most so many points from a state."""
        return follow(self.cycles, state, points, start)

    def passed(self, start: Point, track: Track, since: int) -> list[Found]:
        """Special points from one of its points on."""
        last = track.points[since - 1] if since else start
        path = Path((last, *track.points[since:]), 0, (track.stop, track.stop))
        found = in_order(find(self.cycles, path)[0])
        return [replace(one, index=one.index + since) for one in found]

    def is_start(self, seen: Found, start: Point) -> bool:
        """Whether a special point is the start itself."""
        return abs(seen.point.arclength) <= START

    def within(self, state: State) -> bool:
        """Whether a state stands inside its bounds."""
        cycles, y = self.cycles, state.orbit.y
        p = y[1 : 1 + len(cycles.low)]
        low, high = cycles.options.bounds.get("period", (-np.inf, np.inf))
        return bool(np.all((p > cycles.low) & (p < cycles.high)) and low < y[0] < high)

    def words(self, seen: Found) -> str:
        """Where a special point is."""
        cycles = self.cycles
        return where(cycles, seen.point.orbit)


def in_order(found: list[Found]) -> list[Found]:
    """Special points as they come along the family."""
    return sorted(found, key=lambda one: (one.index, one.point.arclength))
