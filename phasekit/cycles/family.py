"""A traced family of periodic orbits as one path, with its special points found."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import ClassVar

from phasekit.arrays import Array
from phasekit.bifurcation.continuation import walk
from phasekit.bifurcation.continuation.walk import Stop, stops_of
from phasekit.cycles.point import Point
from phasekit.cycles.trace import Track

Tracks = tuple[Track | None, Track | None]


@dataclass(frozen=True, eq=False)
class Found:
    """A special point of a family, after one of its points."""

    kind: str
    point: Point
    index: int  # the point of the path before it
    #: Values of the parameter at the points between which it was found.
    interval: tuple[float, float]
    status: str
    words: str = ""  # what is to be said of it
    #: Makes the coefficients of the normal form, and what is to be said of them.
    form: Callable[[], tuple[dict[str, float], str]] | None = None
    #: Directions (dx, dy) of other families, on the mesh of the point.
    others: tuple[tuple[Array, Array], ...] = ()
    name: str = ""  # of an event, else empty

    @property
    def along(self) -> float:
        """How far along the family it is."""
        return self.point.arclength

    @property
    def position(self) -> Point:
        """Where it stands."""
        return self.point

    @property
    def special(self) -> Found:
        """What is known of it: itself."""
        return self

    @property
    def residual(self) -> float:
        """Of the orbit."""
        return self.point.residual

    @property
    def normal_form(self) -> dict[str, float]:
        """Coefficients, made when they are first asked for."""
        return {} if self.form is None else self.form()[0]

    @property
    def message(self) -> str:
        """What is to be said of it and its coefficients."""
        return self.words if self.form is None else self.form()[1]


@dataclass(frozen=True, eq=False)
class Path(walk.Path):
    """Points in order along the family, and why it ends on both sides."""

    points: tuple[Point, ...]
    start: int
    stops: tuple[Stop, Stop]
    #: The special points at which it was told to end.
    ends: tuple[Found | None, Found | None] = (None, None)
    rows: ClassVar[tuple[str, ...]] = ("points",)


def join(start: Point, tracks: Tracks, first: Stop) -> Path:
    """One path of two tracks from the same start; without a first track, ``first`` says why."""
    backward, forward = tracks
    behind = [] if backward is None else [p.flipped() for p in backward.points[::-1]]
    ahead = [] if forward is None else list(forward.points)
    return Path((*behind, start, *ahead), len(behind), stops_of(tracks, first))
