"""First returns of planar flows: to a ray round a point, or to a line across a cylinder.

A motion returns when it has gone once round, in either sense, and then for the first time comes to
where it began: to the ray again, or to the line a period further on. So a closed orbit is a fixed
point of the map even where the ray or line is not crossed in one sense alone.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from phasekit.arrays import Array, Index
from phasekit.laws.equations import Equations
from phasekit.motion.crossings import NEVER, Crossing, Edges, crossings, symbols_here
from phasekit.motion.lost import ARRIVED

#: Distance from an equilibrium at which a motion has come to rest, in widths of the plane.
NEAR = 1e-6
#: Absolute error of a step that is allowed, over the relative one, in widths.
ATOL = 0.01


class Plane(NamedTuple):
    """The part of the plane in which motions are followed, and where they come to rest."""

    low: Array
    high: Array
    widths: Array
    """What distances are measured by."""
    rests: Array
    """Equilibria that attract or repel, of shape (n, 2)."""


class Returned(NamedTuple):
    """First returns; NaN where there is none."""

    place: Array
    """Along the section."""
    time: Array
    state: Array
    status: Index
    steps: Index


@dataclass(frozen=True)
class Ray:
    """A ray from a point, in widths of the plane."""

    start: Array
    direction: Array
    """Of length 1 in widths."""
    widths: Array
    longest: float
    """How far from the point it leaves the plane."""
    period: float = 0.0
    """No place on it returns to itself after a turn."""

    def states(self, places: Array) -> Array:
        """States at places along it."""
        return self.start + places[:, None] * self.direction * self.widths

    def places(self, states: Array) -> Array:
        """Places of states on it."""
        return ((states - self.start) / self.widths) @ self.direction

    def watched(self, law: Equations) -> tuple[list[Crossing], dict[str, float]]:
        """What to look for: the ray, where the motion has gone round."""
        names = ("_x", "_y", "_a", "_b", "_c", "_d")
        symbols, _ = symbols_here((*law.states, *names), law.names, law.time)
        x, y = (symbols[name] for name in law.states)
        x0, y0, a, b, c, d = (symbols[name] for name in names)
        (u, v), (wide, high) = self.direction, self.widths
        more = dict(zip(names, (*self.start, u / high, v / wide, u / wide, v / high), strict=True))
        across = Crossing(a * (y - y0) - b * (x - x0), last=1, gate=1, net=True)
        return [across, Crossing(c * (x - x0) + d * (y - y0), sense=NEVER)], more


@dataclass(frozen=True)
class Line:
    """A line across a cylinder, on which an angle has a value."""

    angle: int
    """Place of the angle among the states."""
    value: float
    turn: float
    """Its period."""
    low: float
    width: float
    """Where the line begins in the other state, and how long it is."""
    period: float = 0.0
    """Of the other state over the width, if it is an angle as well."""
    longest: float = 1.0

    def states(self, places: Array) -> Array:
        """States at places along it."""
        found = np.full((len(places), 2), self.value)
        found[:, 1 - self.angle] = self.low + places * self.width
        return found

    def places(self, states: Array) -> Array:
        """Places of states on it."""
        return np.asarray((states[..., 1 - self.angle] - self.low) / self.width)

    def watched(self, law: Equations) -> tuple[list[Crossing], dict[str, float]]:
        """What to look for: the line, a turn further on in either sense."""
        names = ("_value", "_turn")
        symbols, _ = symbols_here((*law.states, *names), law.names, law.time)
        away = symbols[law.states[self.angle]] - symbols["_value"]
        both = [
            Crossing(away - symbols["_turn"], last=1),
            Crossing(away + symbols["_turn"], last=1),
        ]
        return both, {"_value": self.value, "_turn": self.turn}


Section = Ray | Line


def first_returns(
    law: Equations,
    values: Mapping[str, float],
    section: Section,
    places: Array,
    plane: Plane,
    *,
    sense: float = 1.0,
    rtol: float,
    most: int,
) -> Returned:
    """Where motions that begin on a section return to it, forward or backward in time."""
    watched, more = section.watched(law)
    states = section.states(places)
    count = len(places)
    times = np.tile([0.0, sense * np.inf], (count, 1))  # something else ends it before
    on = np.full(count, 0 if isinstance(section, Ray) else -1)
    found = crossings(
        law, {name: np.array(value) for name, value in values.items()}, states, times, watched,
        more={name: np.array(value) for name, value in more.items()}, on=on,
        edges=Edges.around(plane.rests, NEAR * plane.widths, (plane.low, plane.high)),
        kept=False, rtol=rtol, atol=rtol * ATOL, most=most,
    )  # fmt: skip
    came = found.status == ARRIVED
    state, time = np.full((count, 2), np.nan), np.full(count, np.nan)
    if came.any():
        state[came], time[came] = found.state[came, 0], found.time[came, 0]
    return Returned(section.places(state), time, state, found.status, found.steps)
