"""One center along a path of parameters: where it stays, and where a fold ends it.

While A keeps its sign, the two centers that exist inside the astroid never meet but on it: with
A < 0 one of them has cos phi > 0 and the other cos phi < 0, with A > 0 likewise by sin phi (V' = 0
with cos phi = 0, or sin phi = 0, holds at saddles only). So a center inside is told by a sign, its
*sheet*. On the fold the center survives whose sheet is the sign of B, or of C: it is the deeper
one. Where the path enters the astroid, the one center that there was is that one.
"""

from __future__ import annotations

from bisect import bisect_left
from collections.abc import Sequence
from dataclasses import dataclass
from fractions import Fraction
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt
from flint import fmpq_poly

from phasekit.arrays import Array
from phasekit.bifurcation.exact.line import Path
from phasekit.bifurcation.exact.meetings import Event, Interval, survey
from phasekit.errors import EquilibriumKind
from phasekit.laws.trigonometric import Factor, Values, exact
from phasekit.numerics.real_roots import interpolate, rational
from phasekit.phase.exact.phase_space import Equilibria
from phasekit.phase.exact.potential import gradient

#: Values this near to an event, relative to the path, count as on it.
NEAR = 1e-14


@dataclass(frozen=True)
class Segment(Path):
    """A law along a straight line through several parameters, none of them an angle."""

    ends: tuple[Values, Values] = ({}, {})

    def polynomial(self, factor: Factor) -> fmpq_poly:
        """Return a factor of the law as a polynomial of x."""
        fixed = exact(self.law.turned(self.values))
        first, last = ({k: Fraction(v) for k, v in end.items()} for end in self.ends)
        degree = sum(self.law.degree(name) for name in first)
        values = []
        for k in range(degree + 1):
            here = {name: first[name] + (last[name] - first[name]) * k for name in first}
            values.append(Fraction(factor({**fixed, **here})))
        return interpolate([rational(v) for v in values])

    def along(self, x: Fraction) -> float:
        """Return x: how far along the line."""
        return float(x)


class Jump(NamedTuple):
    """A fold at which the center disappears: between which steps, and where on the path."""

    step: int
    at: float


@dataclass(frozen=True)
class Walk:
    """Steps along one path, forth and back."""

    path: Path
    #: Where each step is on the path, and how many equilibria there are.
    at: Sequence[float]
    number: Sequence[int]

    @cached_property
    def _events(self) -> tuple[list[Event], list[Interval]]:
        return survey(self.path)

    @cached_property
    def _places(self) -> list[float]:
        return [event.at for event in self._events[0]]

    @cached_property
    def _near(self) -> float:
        return NEAR * max(map(abs, self.at))

    def follow(self, sheet: int) -> tuple[list[int], list[Jump], bool]:
        """Return the sheet at each step (0 outside), the jumps, and whether the force vanished."""
        events, intervals = self._events
        place = self._interval(0, None, sheet != 0)
        sheets, jumps = [sheet], list[Jump]()
        for step in range(1, len(self.at)):
            to = self._interval(step, place, None)
            while place != to:
                way = 1 if to > place else -1
                event = events[place if way > 0 else place - 1]
                before, after = intervals[place], intervals[place + way]
                if event.forceless or not (before.force and after.force):
                    return sheets, jumps, True
                lost, sheet = _crossed(event, before, after, sheet)
                if lost:
                    jumps.append(Jump(step, event.at))
                place += way
            sheets.append(sheet)
        return sheets, jumps, False

    def _interval(self, step: int, near: int | None, inside: bool | None) -> int:
        """The interval in which a step is; next to an event the one with as many equilibria."""
        _, intervals = self._events
        values, value = self._places, self.at[step]
        place = bisect_left(values, value)
        close = [
            side
            for k in (place - 1, place)
            if 0 <= k < len(values) and abs(values[k] - value) <= self._near
            for side in (k, k + 1)
        ]
        if not close:
            return place
        there = self.number[step] > 2 if inside is None else inside
        fitting = [side for side in close if (intervals[side].number == 4) == there] or close
        return min(fitting, key=lambda side: abs(side - (place if near is None else near)))


def _crossed(event: Event, before: Interval, after: Interval, sheet: int) -> tuple[bool, int]:
    """Whether the center disappears at an event, and the sheet beyond it."""
    was, enters = before.number == 4, after.number == 4
    if was == enters:
        return False, sheet
    signs = [side.B if event.sign_of_A < 0 else side.C for side in (before, after)]
    if enters:  # at a pitchfork both are alike: the limit of positive B and C
        return False, signs[1] or 1
    through_cusp = signs[0] != signs[1] or signs[0] == 0
    return not through_cusp and sheet != signs[0], 0


def sheet_of(A: float, phi: float) -> int:
    """The sheet of a center inside the astroid."""
    return 1 if (np.cos(phi) if A < 0.0 else np.sin(phi)) > 0.0 else -1


def center_on(points: Equilibria, A: Array, sheets: npt.NDArray[np.int_]) -> npt.NDArray[np.intp]:
    """The label of the center on a sheet, one system each; on a fold that of the merged pair."""
    side = np.where((A < 0.0)[:, None], np.cos(points.phi), np.sin(points.phi))
    inside = (sheets != 0)[:, None]
    center = points.kind == EquilibriumKind.CENTER
    there = center | (inside & (points.kind == EquilibriumKind.DEGENERATE))
    there |= ~center.any(axis=1, keepdims=True) & (points.kind == EquilibriumKind.DEGENERATE)
    rank = np.where(inside, sheets[:, None] * side, -points.energy)
    return np.asarray(np.argmax(np.where(there, rank, -np.inf), axis=1))


def start_label(points: Any, coefficients: tuple[float, float, float], phi0: float) -> int:
    """The label of the center to which a state at rest slides; -1 if it stays where it is."""
    there = np.flatnonzero(np.isin(points.kind, (EquilibriumKind.CENTER,)))
    if (points.phi[there] == phi0).any():
        return int(there[points.phi[there] == phi0][0])
    slope = float(gradient(*coefficients, phi0))
    present = np.flatnonzero(points.kind != EquilibriumKind.ABSENT)
    if slope == 0.0 or (points.phi[present] == phi0).any():
        return -1
    way = (-np.sign(slope) * (points.phi[present] - phi0)) % (2.0 * np.pi)
    label = int(present[np.argmin(way)])
    if points.kind[label] == EquilibriumKind.CENTER:
        return label
    # The state is the double next to a saddle, or to a center.
    return int(there[np.argmin(np.abs(np.sin(0.5 * (points.phi[there] - phi0))))])
