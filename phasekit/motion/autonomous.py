"""Attractors of damped systems that do not vary: rests in wells, and a rotation on a circle.

Damping that is nowhere negative shrinks areas everywhere, so that no cycle closes on itself
without going round, and at most one goes round: two would enclose an area that shrinks and stays.
The rotation is the fixed point of the map from a speed at an angle to that one turn later, which
grows with the speed: all motions above it come to it, and below it all that complete a turn.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np

from phasekit.arrays import Array
from phasekit.errors import AttractorKind
from phasekit.motion.attractor import PATIENCE, ROUNDS, SETTLED, TOO_WEAK, Attractor, PlaneSearch
from phasekit.motion.landscape import BORDER, Landscape
from phasekit.motion.rotation import Turn, rotation, slowest
from phasekit.motion.strobe import Targets, strobe

#: Damping times after which a speed that nothing sustains is spent.
SPENT = 30.0
#: Steps of this time at first, and damping times for which strongly damped motions are followed.
FIRST, LONG = 8, 1e6
#: Damping times for which the states of a grid are followed.
MOST_SPENT = 1e5
#: A rate that counts as without bound.
BOUNDLESS = 1e300
#: Part of the size of the box by which the range of a line is wider than the motions.
ROOM = 0.25
#: States of a rotation that are kept.
KEPT = 64
#: Why it is not seen where a motion ends.
UNDER_WAY = "were given up under way: they come to no rest, or creep next to a barrier"


class Candidate(NamedTuple):
    """What attracts, and between which borders it is certain to."""

    attractor: Attractor
    low: float
    high: float
    border: Array
    """Least and greatest rates at equal distances from one to the other."""


@dataclass
class AutonomousSearch(PlaneSearch):
    """A search for the attractors of one system that does not vary."""

    adds = True

    candidates: list[Candidate] = field(default_factory=list)
    spun: Turn | None = None
    """The rotation."""
    reach: tuple[float, float] = (np.inf, -np.inf)
    """Coordinates to which motions came."""
    drag: float = 0.0

    @property
    def land(self) -> Landscape:
        """Wells and barriers."""
        return Landscape(self.law, self.values)

    @property
    def step(self) -> float:
        """Time after which motions are held against attractors at first: their speed is spent."""
        return min(self.leg, SPENT / self.drag) if self.drag > 0.0 else self.leg

    def rounds(self, legs: int) -> list[tuple[int, float]]:
        """At first as soon as speed is spent.

        No more than strong damping lets a motion go in a reasonable number of steps.
        """
        if not self.step < self.leg:
            return [(legs, self.leg)]
        few = max(1, min(legs, int(MOST_SPENT * self.step / self.leg)))
        soon = int(self.leg / self.step) + 1 if few > 1 else FIRST
        return [(soon, self.step), (few, self.leg)]

    def look(self, states: Array) -> None:
        """Find the attractors to which motions from states come."""
        self.drag = self.land.drag(states[:, 0], float(np.abs(states[:, 1]).max()) or self.scale)
        self._survey(states)
        rounds = [(FIRST, self.step)]
        rounds += [(n, self.leg) for n in ROUNDS if n * self.leg * self.drag < LONG]
        if (weak := SETTLED / (self.drag * self.leg)) > ROUNDS[-1]:
            rounds.append((int(min(weak, PATIENCE)), self.leg))
        known = {id(one) for one in self.found}
        reached = {i for i, one in enumerate(self.candidates) if id(one.attractor) in known}
        for legs, leg in rounds:
            for _ in range(2):
                states, moved = self._follow(states, legs, leg, reached)
                if not (len(states) and (self._survey(states) or self._spin(states, moved))):
                    break
                legs, leg = 1, self.step
        self.found = [one.attractor for i, one in enumerate(self.candidates) if i in reached]
        moving = self._moving(states)
        if moving:
            self.open[TOO_WEAK if weak > PATIENCE else UNDER_WAY] += moving

    def _follow(
        self, states: Array, legs: int, leg: float, reached: set[int]
    ) -> tuple[Array, Array]:
        """Follow motions; return where those that came to nothing are, and how far they went."""
        if not len(states):
            return states, states[:, 0]
        found = strobe(
            self.law, self.values, states, leg, 1, legs,
            targets=self._targets(self.candidates), steps=self.steps,
        )  # fmt: skip
        reached.update(found.code[found.code >= 0].tolist())
        ends = found.states[:, 0]
        left = (found.code < 0) & np.isfinite(ends).all(axis=1)
        return ends[left], (ends - states)[left, 0]

    def _survey(self, states: Array) -> bool:
        """Find the wells within reach of states; whether there are new ones."""
        if self.period:
            low, high = -0.5 * self.period, 0.5 * self.period
            if np.isfinite(self.reach).all():
                return False
            self.reach = low, high
        else:
            least, most = float(states[:, 0].min()), float(states[:, 0].max())
            if self.reach[0] <= least and most <= self.reach[1]:
                return False
            low, high = min(self.reach[0], least), max(self.reach[1], most)
            room = ROOM * max(high - low, self.size)
            low, high = low - room, high + room
            self.reach = low, high
        known = [one.attractor.points[0, 0] for one in self.candidates]
        new = False
        for well in self.land.wells(low, high):
            exponent = self.land.exponent(well.rest)
            at = np.array([[well.rest, 0.0]])
            multiplier = float(np.exp(exponent * self.leg))
            one = Attractor(AttractorKind.EQUILIBRIUM, at, 0.0, exponent, multiplier=multiplier)
            border = self.land.border(well)
            found = Candidate(one, border[0, 0], border[-1, 0], border[:, 1:])
            near = np.abs(np.array(known) - well.rest) < 1e-9 * self.size
            if near.any():
                self.candidates[int(np.argmax(near))] = found
            else:
                self.candidates.append(found)
                new = True
        return new

    def _spin(self, states: Array, moved: Array) -> bool:
        """Find the rotation to which states may come; whether it is new.

        Beside a rest there is none without inertia: there a motion must have turned round.
        """
        if not self.period or self.spun is not None:
            return False
        work = self.land.work()
        ahead = states[:, 1] * work > 0.0
        if self.land.has_rest():
            ahead &= moved * np.sign(work) > self.period
        some = states[ahead]
        if not len(some):
            return False
        fastest = some[np.argmax(np.abs(some[:, 1]))]
        self.spun = found = rotation(self.law, self.values, fastest)
        if found is None:
            return False
        sense = np.sign(work)
        times = np.mod(np.arange(KEPT) * self.leg, found.time)
        turns = sense * self.leg / found.time
        one = Attractor(
            AttractorKind.ROTATION, found.states(times), turns, 0.0, multiplier=found.multiplier
        )
        least: Array | float = -np.inf
        low = float(found.phi.min())
        if self.land.has_rest():
            below = slowest(self.law, self.values, found)
            low, least = float(below.phi.min()), below.rates(BORDER)
        bounds = np.full((BORDER, 2), BOUNDLESS)
        bounds[:, 0] = np.maximum(least, -BOUNDLESS)
        if sense < 0.0:
            bounds = -bounds[:, ::-1]
        self.candidates.append(Candidate(one, low, low + self.period, bounds))
        return True

    def _moving(self, states: Array) -> int:
        """Number of states that are not at rest, as on a saddle."""
        if not len(states):
            return 0
        speed = np.abs(states[:, 1]) / self.scale
        force = np.abs(self.land.forces(states[:, 0]))
        unit = np.abs(self.land.forces(np.linspace(*self.reach, 65))).max()
        return int(np.sum((speed > 1e-9 * self.size) | (force > 1e-9 * unit)))

    def _targets(self, candidates: list[Candidate]) -> Targets:
        if not candidates:
            return self.nowhere()
        spans = np.array([[one.low, one.high, i] for i, one in enumerate(candidates)])
        bands = np.stack([one.border for one in candidates])
        return self.nowhere()._replace(spans=spans, bands=bands)

    def targets(self) -> Targets:
        """Where motions have come to an attractor."""
        of = {id(one.attractor): one for one in self.candidates}
        return self._targets([of[id(one)] for one in self.found])
