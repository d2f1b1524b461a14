"""Level curves of the energy of one system, on a line or a circle: where they run.

Between neighboring equilibria V is monotone, so that an energy has one turning point there or none.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from phasekit.arrays import Array
from phasekit.errors import EquilibriumKind, Loop
from phasekit.phase.answers import Answers

#: A stretch of the coordinate; on a circle it may run past the cut.
Arc = tuple[float, float]
#: An energy, and the point whose arc alone is meant; None means every arc.
Level = tuple[float, float | None]

_SAMPLES = 241
_BISECTIONS = 60
#: Energies that differ by less than this part of the largest are one.
_SAME = 8.0 * np.finfo(float).eps
#: Turns over which what runs on is followed.
_TURNS = 24
#: How far outside an arc rounding may put a state that is on it, as part of what is seen.
_NEAR = 1e-6


class Separatrix(NamedTuple):
    """What leaves a saddle to one side: its energy, its arc from left to right, and its shape."""

    energy: float
    arc: Arc
    loop: Loop


@dataclass(frozen=True, eq=False)
class LevelCurves:
    """The level curves of a system's energy.

    Attributes
    ----------
    answers : Answers
        What is known of the system.
    window : (float, float)
        What is seen of the coordinate: all of it, or of a line what has a structure.
    knots, height : numpy.ndarray
        Points between which V is monotone, and V there: the equilibria and, on a line, the ends of
        the window; on a circle the first comes once more after a turn.
    hill, well : numpy.ndarray
        Which of them are.
    floor : float
        Least potential that is seen.
    summit : float
        Energy of the highest saddle; where there is none, that of the lower end of a line.
    """

    answers: Answers
    window: Arc
    knots: Array
    height: Array
    hill: npt.NDArray[np.bool_]
    well: npt.NDArray[np.bool_]
    floor: float
    summit: float

    @classmethod
    def from_answers(cls, known: Answers, cut: float | None = None) -> LevelCurves:
        """Make them of what is known of a system, which cuts a circle open unless told where."""
        low, high = known.ends
        if cut is not None and known.period is not None:
            low, high = cut, cut + known.period
        elif not np.isfinite(known.ends).all():
            turning = known.saddle_phi[:, np.newaxis] + known.turning_offset
            marks = np.concatenate([known.phi, turning.ravel()])
            marks = marks[np.isfinite(marks)]
            low, high = (float(marks.min()), float(marks.max())) if marks.size else (0.0, 0.0)
            margin = 0.3 * (high - low) or 2.0
            low, high = low - margin, high + margin
        x, height, kind = known.phi, known.energy, known.kind
        if known.period is None:
            inside = (x > low) & (x < high)
            x = np.concatenate([[low], x[inside], [high]])
            first, last = known.potential(x[[0, -1]])
            height = np.concatenate([[first], height[inside], [last]])
            kind = np.concatenate([[0], kind[inside], [0]])
            sides = np.concatenate([[np.nan], height, [np.nan]])
        else:
            sides = np.concatenate([height[-1:], height, height[:1]])
        # A degenerate equilibrium may be either, or a step; an end of a line may be a well.
        merged = kind == EquilibriumKind.DEGENERATE
        left, right = sides[:-2], sides[2:]
        hill = (kind == EquilibriumKind.SADDLE) | (merged & (height > left) & (height > right))
        well = (kind == EquilibriumKind.CENTER) | (merged & (height < left) & (height < right))
        well |= hill.any() & (kind == 0) & ((height < left) | (height < right))
        if known.period is not None:
            x, height = np.append(x, x[:1] + known.period), np.append(height, height[:1])
            hill, well = np.append(hill, hill[:1]), np.append(well, well[:1])
        floor = float(np.min(height)) if height.size else float(known.potential(0.0))
        summit = float(min(height[0], height[-1])) if height.size else floor
        if known.saddle_energy.size:
            summit = float(known.saddle_energy[0])
        return cls(known, (low, high), x, height, hill, well, floor, summit)

    def energy(self, x: float, speed: float) -> float:
        """Return the energy of a state."""
        inertia = float(self.answers.inertia(np.float64(x)))
        return float(self.answers.potential(x)) + 0.5 * inertia * speed * speed

    def speed(self, x: Any, energy: float) -> Array:
        """Return |x'| on a level; 0 where rounding puts the point outside."""
        kinetic = np.maximum(energy - self.answers.potential(x), 0.0)
        return np.asarray(np.sqrt(2.0 * kinetic / self.answers.inertia(np.asarray(x, float))))

    def fastest(self, energy: float) -> float:
        """Return the greatest speed on a level."""
        x = np.concatenate([np.linspace(*self.window, 2 * _SAMPLES - 1), self.knots])
        return float(np.max(self.speed(x, energy)))

    # ---------------------------------------------------------------- arcs

    def arcs(self, energy: float, x: float | None = None) -> list[Arc]:
        """Return the arcs where V < energy, cut at saddles of that energy; or that which holds x.

        Where no arc holds x, within rounding, there is none.
        """
        knots, height = self.knots, self.height
        if not knots.size:
            return [self.window] if energy >= self.floor else []
        slack = _SAME * (float(np.max(np.abs(height))) + abs(energy))
        above = height - energy
        above[np.abs(above) <= slack] = 0.0
        # Where V, monotone between knots, passes the energy.
        falls = np.flatnonzero(np.sign(above[:-1]) * np.sign(above[1:]) < 0.0)
        low, high = np.where(above[falls] < 0.0, (falls, falls + 1), (falls + 1, falls))
        inner, outer = knots[low], knots[high]
        for _ in range(_BISECTIONS if falls.size else 0):
            middle = 0.5 * (inner + outer)
            over = self.answers.potential(middle) > energy
            inner, outer = np.where(over, inner, middle), np.where(over, middle, outer)
        turning = dict(zip(falls.tolist(), (0.5 * (inner + outer)).tolist(), strict=True))
        arcs: list[Arc] = []
        for i in range(knots.size - 1):
            a, b = above[i], above[i + 1]
            if min(a, b) >= 0.0:
                continue
            start = turning[i] if a > 0.0 else float(knots[i])
            stop = turning[i] if b > 0.0 else float(knots[i + 1])
            if arcs and arcs[-1][1] == start and a < 0.0:
                start = arcs.pop()[0]
            arcs.append((start, stop))
        period = self.answers.period
        if period is not None and arcs and above[0] < 0.0:
            if len(arcs) == 1:
                return [self.window]
            first, last = arcs.pop(0), arcs.pop()
            arcs.append((last[0], first[1] + period))
        if x is None or not arcs:
            return arcs
        distance, nearest = min((self._distance(arc, x), arc) for arc in arcs)
        return [nearest] if distance <= _NEAR * (self.window[1] - self.window[0]) else []

    def _distance(self, arc: Arc, x: float) -> float:
        period = self.answers.period
        if period is None:
            return max(arc[0] - x, x - arc[1], 0.0)
        inside, width = (x - arc[0]) % period, arc[1] - arc[0]
        return 0.0 if inside <= width else min(inside - width, period - inside)

    def at_rest(self, x: float, speed: float) -> bool:
        """Whether a state is an equilibrium, within rounding."""
        size = 1e-3 * _NEAR * (self.window[1] - self.window[0])
        near = [self._distance((float(place),) * 2, x) <= size for place in self.answers.phi]
        return speed == 0.0 and any(near)

    def orbit_levels(self, x: float, speed: float) -> list[tuple[float, Arc]]:
        """Return energy and arc of the orbit through a state, and of its turns where they differ.

        None where it is at rest or out of sight.
        """
        if self.at_rest(x, speed):
            return []
        energy = self.energy(x, speed)
        return [level for arc in self.arcs(energy, x) for level in self.followed(energy, arc)]

    def comes_back(self, x: float, speed: float) -> bool:
        """Whether the orbit through a state turns somewhere, so that both halves are its own."""
        found = self.answers.orbit(x, speed)
        ends = [float(end) for end in (found.phi_min, found.phi_max) if np.isfinite(end)]
        return any(not self.at_rest(end, 0.0) for end in ends)

    def turns(self, arc: Arc) -> bool:
        """Whether a level over an arc runs round the circle."""
        period = self.answers.period
        return period is not None and arc[1] - arc[0] >= (1.0 - 1e-12) * period

    def closes(self, arc: Arc) -> tuple[bool, bool]:
        """Whether a level turns at either end of an arc, or runs on past what is seen."""
        if self.answers.period is not None:
            return (arc != self.window,) * 2
        return arc[0] > self.window[0], arc[1] < self.window[1]

    def curve(self, arc: Arc, energy: float, *, whole: bool = False) -> tuple[Array, Array]:
        """Return x and x' along the upper half of a level over an arc, or along the whole of it."""
        if self.turns(arc):
            x = np.linspace(*arc, 2 * _SAMPLES - 1)
        else:
            # Points crowd at the ends, where x' falls like a square root.
            share = np.sin(np.linspace(-0.5 * np.pi, 0.5 * np.pi, _SAMPLES))
            x = 0.5 * (arc[0] + arc[1]) + 0.5 * (arc[1] - arc[0]) * share
        speed = self.speed(x, energy)
        speed[[0, -1]] = np.where(self.closes(arc), 0.0, speed[[0, -1]])
        if whole:
            return np.concatenate([x, x[::-1]]), np.concatenate([speed, -speed[::-1]])
        return x, speed

    def orbit(self, arc: Arc, energy: float, quantity: str) -> float:
        """Return what the orbit of a level over an arc has, such as its period."""
        places = [x for x in self.knots if self._distance(arc, x) == 0.0]
        x = float(min([0.5 * (arc[0] + arc[1]), *places], key=self.answers.potential))
        return float(getattr(self.answers.orbit(x, float(self.speed(x, energy))), quantity))

    # ---------------------------------------------------------------- what to draw

    @cached_property
    def separatrices(self) -> list[Separatrix]:
        """What leaves the saddles, the highest first; what joins two of them once."""
        known = self.answers
        if known.cut_at is not None:
            return self._tilted_separatrices()
        found = []
        for s, energy, loop, offsets in zip(
            known.saddle_phi, known.saddle_energy, known.loop, known.turning_offset, strict=True
        ):
            if loop == Loop.WINDING and known.period is not None:
                found.append(Separatrix(float(energy), (s, s + known.period), Loop.WINDING))
                continue
            for edge, offset in zip(self.window, offsets, strict=True):
                end, shape = (s + offset, Loop(int(loop))) if np.isfinite(offset) else (edge, None)
                joins = shape == Loop.HETEROCLINIC and self._is_saddle(end)
                if joins and offset < 0.0:
                    continue  # drawn from the other saddle
                if shape == Loop.HETEROCLINIC and not joins:
                    shape = Loop.LOBE
                arc = (float(min(s, end)), float(max(s, end)))
                found.append(Separatrix(float(energy), arc, shape or Loop.UNBOUNDED))
        return found

    def _tilted_separatrices(self) -> list[Separatrix]:
        """What leaves the saddles of one turn of a potential that falls, from turn to turn."""
        known = self.answers
        found = []
        for s, energy, loop, offsets in zip(
            known.saddle_phi, known.saddle_energy, known.loop, known.turning_offset, strict=True
        ):
            for side, offset in enumerate(offsets):
                shape = Loop(int(loop)) if np.isfinite(offset) else Loop.UNBOUNDED
                for arc in self.arcs(float(energy)):
                    if arc[1 - side] == s:
                        parts = self.followed(float(energy), arc)
                        found += [Separatrix(height, part, shape) for height, part in parts]
        return found

    def followed(self, energy: float, arc: Arc) -> list[tuple[float, Arc]]:
        """Return a level over an arc, and how it goes on at the other side of one turn."""
        parts = [(energy, arc)]
        if self.answers.cut_at is None:
            return parts
        for here, there, rise in ((1, 0, self.answers.tilt), (0, 1, -self.answers.tilt)):
            level, part = energy, arc
            for _ in range(_TURNS):
                if part[here] != self.window[here]:
                    break
                level += rise
                on = [one for one in self.arcs(level) if one[there] == self.window[there]]
                if not on:
                    break
                (part,) = on
                parts.append((level, part))
        return parts

    def _is_saddle(self, x: float) -> bool:
        size = 1e-3 * _NEAR * (self.window[1] - self.window[0])
        return any(self._distance((s, s), x) <= size for s in self.answers.saddle_phi)

    @property
    def steps(self) -> list[Separatrix]:
        """The levels of degenerate equilibria on slopes, at which motions come to rest."""
        x, height, hill, well = self.knots, self.height, self.hill, self.well
        known = self.answers
        merged = known.phi[known.kind == EquilibriumKind.DEGENERATE]
        return [
            Separatrix(float(height[i]), arc, Loop.LOBE)
            for i in np.flatnonzero(np.isin(x, merged) & ~hill & ~well)
            for arc in self.arcs(float(height[i]), float(x[i]))
        ]

    def levels(self, spacing: float = 1.0 / 6.0) -> list[Level]:
        """Choose levels that are evenly spaced in the root of the energy, region by region.

        A region begins at the bottom of a well, or at a hill, and ends at the lower of the hills
        round it.
        """
        x, height, hill, well = self.knots, self.height, self.hill, self.well
        own = np.arange(x.size) < x.size - (self.answers.period is not None)
        top = float(np.sqrt(2.0 * max(self.summit - self.floor, 0.0))) or 1.0
        step = spacing * top
        chosen: dict[Any, list[Level]] = {}
        for i in [*np.flatnonzero(well & own), *np.flatnonzero(hill & own)]:
            rims, bottom = self._region(i)
            rim = min(
                (float(height[abs(j) - 1]) for j in rims), default=max(self.summit, height[i])
            )
            first, last = (float(np.sqrt(2.0 * max(h - bottom, 0.0))) for h in (height[i], rim))
            rates: list[float] = []
            if last - first > (0.0 if well[i] else 0.3 * step):
                parts = max(2, round((last - first) / step))
                rates += [first + (last - first) * k / parts for k in range(1, parts)]
            if not rims:
                beyond = max(2, round(1.0 / (3.0 * spacing)))
                rates += [last + step * k for k in range(1, beyond + 1)]
            chosen[rims] = [(bottom + 0.5 * rate**2, float(x[i])) for rate in rates]
        if not chosen:
            return [(self.floor + 0.5 * (k * top) ** 2, None) for k in (1.0, 2.0, 3.0)]
        return [level for region in chosen.values() for level in region]

    def _region(self, i: int) -> tuple[tuple[int, ...], float]:
        """Return the hills that end the region which begins at a knot, and its least potential."""
        height, hill, period = self.height, self.hill, self.answers.period
        count = height.size - (period is not None)  # each once
        slack = _SAME * float(np.max(np.abs(height)))
        rims, bottom = [], float(height[i])
        for side in (-1, 1):
            for k in range(1, count):
                j = i + side * k
                if period is None and not 0 <= j < count:
                    break
                j %= count
                if hill[j] and height[j] > height[i] + slack:
                    rims.append(side * (j + 1))
                    break
                bottom = min(bottom, float(height[j]))
        return tuple(rims), bottom
