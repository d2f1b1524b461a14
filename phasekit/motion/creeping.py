"""Attractors of driven flows whose motions creep behind states that decay much faster.

Implicit steps follow them, and Newton's method goes on from where they have slowed down: they may
take more periods to an attractor than anybody waits for.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from phasekit.motion.attractor import SETTLED, Attractor
from phasekit.motion.strobe import Steps
from phasekit.motion.strobed import CREEPS, MOST_OPEN, StrobedSearch, few_of

Array = npt.NDArray[np.float64]

#: Periods after which motions are looked at, and states that are kept then.
LOOKS, SEEN = (4, 40, 200), 5
#: Periods in which what is fast has decayed, and after which it is seen whether states come nearer.
SPENT, LATER = 4, 40
#: Part of the way to an attractor, by its multiplier, that states beside it must go in these.
ENOUGH = 0.3


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
                orbit[-1]
                for orbit in found[np.isfinite(found[:, -1]).all(axis=1)]
                if not self._is_caught(orbit[-1]) and not self._refined(orbit[-1], 1)
            ]
            if not open_:
                return
            states = few_of(open_, MOST_OPEN)
        self.open[CREEPS] += len(open_)

    def _contraction(self, found: Array) -> float:
        return SETTLED

    def _is_caught_from(self, one: Attractor, around: Array, radius: float, legs: int) -> bool:
        """Whether states around an orbit come nearer once what is fast has decayed."""
        starts = (one.points[:, None] + around).reshape(-1, self.turns.size)
        seen = self.run(starts, LATER + 1, SPENT).states
        before, after = (self.distance(one, seen[:, k]) for k in (0, -1))
        part = 1.0 - self.contraction(one) ** (LATER / len(one.points))
        return bool((after <= (1.0 - ENOUGH * part) * before).all() and (before < 0.5).all())
