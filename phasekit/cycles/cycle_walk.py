"""How families of periodic orbits and curves of their special points are walked."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import ClassVar

import numpy as np

from phasekit.bifurcation.continuation.walk import Stop, Tracks, Walker, in_order
from phasekit.cycles.cycles import Cycles, where
from phasekit.cycles.events import find
from phasekit.cycles.family import Found, Path, join
from phasekit.cycles.point import Point, State, neutral
from phasekit.cycles.trace import Track, begin, follow

SAME_PLACE = 1e-6  # arclength within which two places are one


@dataclass(frozen=True)
class CycleWalk(Walker):
    """How a family of orbits is walked."""

    curve: Cycles
    chunk: ClassVar[int] = 8
    looks_back: ClassVar[bool] = False

    @property
    def kind(self) -> str:
        """What it is a curve of."""
        kind: str = getattr(self.curve, "kind", "cycle")
        return kind

    @property
    def bounded(self) -> tuple[str, ...]:
        """Names of what its bounds are bounds of."""
        return tuple(self.curve.field.parameters[i] for i in self.curve.active)

    def turned(self, start: Point) -> Point:
        """The start in the other direction."""
        return start.flipped()

    def begin(self, start: Point) -> State:
        """The state of a walk that begins at a point."""
        return begin(self.curve, start)

    def follow(self, state: State, points: int, start: Point) -> Track:
        """At most so many points from a state."""
        return follow(self.curve, state, points, start)

    def passed(self, start: Point, track: Track, since: int) -> list[Found]:
        """Special points from one of its points on."""
        last = track.points[since - 1] if since else start
        path = Path((last, *track.points[since:]), 0, (track.stop, track.stop))
        found = in_order(find(self.curve, path)[0])
        return [replace(one, index=one.index + since) for one in found]

    def is_at(self, seen: Found, place: Point) -> bool:
        """Whether a special point stands at the start, or where another one does."""
        return abs(seen.point.arclength - place.arclength) <= SAME_PLACE

    def within(self, state: State) -> bool:
        """Whether a state stands inside its bounds."""
        cycles, y = self.curve, state.orbit.y
        p = y[1 : 1 + len(cycles.low)]
        low, high = cycles.options.bounds.get("period", (-np.inf, np.inf))
        return bool(np.all((p > cycles.low) & (p < cycles.high)) and low < y[0] < high)

    def words(self, seen: Found) -> str:
        """Where a special point is."""
        return where(self.curve, seen.point.orbit)

    def joined(self, start: Point, tracks: Tracks, origin: Stop) -> Path:
        """One path of two tracks; without a first one, the origin says why it begins there."""
        return join(start, tracks, origin)

    def search(self, path: Path) -> tuple[Path, list[Found], tuple[str, ...]]:
        """The path, its special points in order, and which coefficients are zero all along it."""
        found, zeros = find(self.curve, path)
        return path, in_order(found), zeros

    def notes(self, path: Path) -> tuple[str, ...]:
        """That a family is vertical."""
        return said_of(self.curve, path)

    def at_ends(self, path: Path) -> list[Found]:
        """The two ends of a path as special points."""
        first, last = (
            path.points[-k] if end is None else end.point for k, end in enumerate(path.ends)
        )
        return [
            Found("end", point, index, (at, at), "converged", stop.message)
            for index, point, stop, at in (
                (-2, first, path.stops[0], float(first.orbit.y[1])),
                (path.count, last, path.stops[1], float(last.orbit.y[1])),
            )
        ]


STAYS = 1e-9  # part of its span by which a parameter moves by rounding
ALIKE = 1e-9  # part by which periods differ by rounding


def said_of(cycles: Cycles, path: Path) -> tuple[str, ...]:
    """That a family is vertical, in words; nothing where it is not, or is so by its equations."""
    points = path.points
    if len(cycles.active) > 1 or not np.isfinite(cycles.width[0]) or len(points) < 3:
        return ()
    p = np.array([point.orbit.y[1] for point in points])
    # Rounding of the largest orbits is that of their rates.
    rates = np.array([1.0 / point.orbit.y[0] for point in points])
    moved = np.abs(p - np.median(p)) > STAYS * cycles.width[0] * np.maximum(rates / rates[0], 1.0)
    known = [point for point in points if point.trusted]
    if np.any(moved) or not known or not all(neutral(cycles, point) for point in known):
        return ()
    name, value = cycles.field.parameters[cycles.active[0]], float(np.median(p))
    value = 0.0 if abs(value) <= STAYS * cycles.width[0] else value
    alike = bool(np.ptp(rates) <= ALIKE * rates[0])
    periods = ", with one period," if alike else ""
    return (
        f"a vertical family: {name} = {value:.9g} all along it, within rounding; orbits of all its "
        f"amplitudes{periods} exist together there, as round a center; families that leave it are "
        f"not looked for: an orbit at another {name} leads to one",
    )
