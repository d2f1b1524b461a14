"""Attractors of driven flows whose motions creep behind states that decay much faster.

Implicit steps follow them, and Newton's method goes on from where they have slowed down: they may
take more periods to an attractor than anybody waits for.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from phasekit.arrays import Array
from phasekit.motion.attractor import SETTLED, Attractor
from phasekit.motion.method import few
from phasekit.motion.strobe import Steps
from phasekit.motion.strobed import CREEPS, MOST_OPEN, StrobedSearch

#: Periods after which motions are looked at, states that are kept then, and the longest orbit that
#: is looked for, in periods.
LOOKS, SEEN, MOST = (4, 40, 200), 6, 4
#: Part of their way in one period that states are apart after some, where Newton's method may close
#: them; and way in a period, in units of the box, that is no creeping.
CLOSES, GOES = 0.3, 0.1
#: Why it is not seen where a motion ends that goes on.
GO_ON = (
    f"go on after {LOOKS[-1]} periods and come to no orbit of 1 to {MOST}, the only ones that are "
    "looked for behind states that decay much faster"
)
#: Periods in which what is fast has decayed, and after which it is seen whether states come nearer.
SPENT, LATER = 4, 40
#: Part of the way to an attractor, by its multiplier, that states beside it must go in these.
ENOUGH = 0.3
#: Distance from it, beside that from which they began, of those that have nothing left of theirs.
THERE = 1e-3


@dataclass
class CreepingSearch(StrobedSearch):
    """A search for the attractors of one driven flow that is stiff."""

    stiff = True
    reach = 0.5

    @property
    def steps(self) -> Steps:
        """How steps are taken."""
        return super().steps._replace(stiff=True)

    def look(self, states: Array) -> None:
        """Find the attractors to which motions from states come."""
        for legs in LOOKS:
            found = self.run(states, SEEN, legs).states
            open_ = [
                orbit
                for orbit in found[np.isfinite(found[:, -1]).all(axis=1)]
                if not self._is_caught(orbit[-1]) and not self._comes_to_one(orbit)
            ]
            if not open_:
                return
            states = few([orbit[-1] for orbit in open_], MOST_OPEN)
        goes = [bool(self.apart(orbit[1:], orbit[:-1]).min() > GOES) for orbit in open_]
        self.open[GO_ON] += sum(goes)
        self.open[CREEPS] += len(goes) - sum(goes)

    def _comes_to_one(self, orbit: Array) -> bool:
        """Whether Newton's method goes on from a motion to a periodic orbit that attracts."""
        if self._refined(orbit[-1], 1):
            return True
        way = self.apart(orbit[-1], orbit[-2])
        return any(
            self.apart(orbit[-1], orbit[-1 - q]) < CLOSES * way and self._refined(orbit[-1], q)
            for q in range(2, MOST + 1)
        )

    def _contraction(self, found: Array) -> float:
        return SETTLED

    def _is_caught_from(self, one: Attractor, around: Array, radius: float, legs: int) -> bool:
        """Whether states around an orbit come nearer once what is fast has decayed."""
        starts = (one.points[:, None] + around).reshape(-1, self.turns.size)
        seen = self.run(starts, LATER + 1, SPENT).states
        before, after = (self.distance(one, seen[:, k]) for k in (0, -1))
        part = 1.0 - self.contraction(one) ** (LATER / len(one.points))
        nearer = (after <= (1.0 - ENOUGH * part) * before) | (after <= THERE * radius)
        return bool(nearer.all() and (before < 0.5).all())
