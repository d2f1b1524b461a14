"""Attractors of flows that do not vary: equilibria, cycles, rotations, tori and chaotic sets.

No section is needed: a motion is seen after equal times until it comes back through the plane
across its own way. The cycle is then the zero of Newton's method in a state and a time.
"""

from __future__ import annotations

import functools
import warnings
from dataclasses import dataclass, field

import numpy as np

from phasekit.arrays import Array
from phasekit.errors import AttractorKind
from phasekit.laws.equations import Equations
from phasekit.motion.attractor import ROUNDS, SETTLED, Attractor
from phasekit.motion.exponents import exponents
from phasekit.motion.newton import SAME, Cycle, Neighbourhood, Rest
from phasekit.motion.slow_curve import slow_rest
from phasekit.motion.strobe import Steps
from phasekit.motion.strobed import (
    CAUGHT,
    CREEPS,
    FILLING,
    IN_DOUBT,
    MOST_OPEN,
    SURE,
    StrobedSearch,
)
from phasekit.motion.way import Way

#: Points along a cycle, and states of another attractor, that are kept.
POINTS, KEPT = 256, 1000
#: Points between which chords are as good as a cycle, and distance from them that may be none.
FINE, CHORD = 4096, 1e-3
#: Distance from an equilibrium at which a motion may be coming to it.
NEAR_REST = 5e-2
#: Legs after which cycles are solved for again from motions next to known ones.
WAITING = ROUNDS[2]
#: The same of one to which it creeps, and halvings of the distance up to which that catches.
FAR_REST, HALVINGS = 0.6, 6
#: Returns through which cycles are tried, and distance from 1 of a multiplier that is none.
TRIES, NEUTRAL = 6, 1e-6
#: Multiplier of what comes back to a settled motion that tells of no attracting cycle beside it.
PARTING = 100.0
#: Part of the distance to which states around a flat rest must come, and legs for it.
NEARER, SLOW_LEGS = 1.0 - 1e-5, (20, 200, 2000)
#: Part of an eigenvalue that may be none which rounding makes.
ROUNDED = 1e-5
#: Distance from a rest that is none, and steps away from where a creeping motion came along.
LEAST, STEPS = 1e-12, 10.0


@dataclass
class FreeSearch(StrobedSearch):
    """A search for the attractors of one flow that does not vary."""

    law: Equations
    fine: float = 0.0
    """Time in which a motion hardly turns."""
    stiff: bool = False
    """Whether motions creep behind states that decay much faster: by implicit steps."""
    flat: dict[int, float] = field(default_factory=dict)
    """How far slow motions come to rests at which one eigenvalue is none, by their identity."""
    ways: dict[int, Way] = field(default_factory=dict)
    """Ways along cycles, by the identity of these."""
    passed: list[Array] = field(default_factory=list)
    """Rests that no eigenvalue decides about, and from which some motions around go away."""
    kept = KEPT
    patience = MOST_OPEN

    @functools.cached_property
    def near(self) -> Neighbourhood:
        """Motions next to states."""
        return Neighbourhood(self.law, self.values, self.units, *super().steps[:2])

    @property
    def steps(self) -> Steps:
        """How steps are taken."""
        return super().steps._replace(stiff=self.stiff)

    def contraction(self, one: Attractor) -> float:
        """How much nearer states come in a leg to a rest, in a period to a cycle."""
        return one.multiplier if one.time else float(np.exp(one.exponent * self.leg))

    def _legs_to_settle(self, one: Attractor) -> int:
        per = max(int(np.ceil(one.time / self.leg)), 1) if one.time else 1
        rate = -np.log(np.clip(self.contraction(one), 1e-3, 1.0 - 1e-6))
        return per * (2 + int(-np.log(1e-3) / rate))

    def _spread(self, one: Attractor, radius: float) -> Array:
        """Points along a cycle, as close to each other as states around them are caught."""
        chosen = [0]
        for i in range(1, len(one.points)):
            if self.apart(one.points[i], one.points[chosen[-1]]) > 0.5 * radius:
                chosen.append(i)
        return one.points[chosen]

    def distance(self, one: Attractor, states: Array) -> Array:
        """Distances of states from an equilibrium, or from the way along a cycle."""
        if not one.time:
            return self.apart(states, one.points[0])
        if id(one) not in self.ways:
            points = self.near.along(one.points[0], one.time * np.arange(FINE) / FINE)
            self.ways[id(one)] = Way(points, self.turns, self.units)
        return self.ways[id(one)].distance(states)

    def blur(self, one: Attractor) -> float:
        """How far chords are from the way along a cycle."""
        return self.ways[id(one)].bulge if one.time else 0.0

    def _take(self, orbit: Array) -> bool:
        """Keep the attracting equilibrium or cycle near which a motion is; whether there is one."""
        state = orbit[-1]
        if self._rest(state):
            return self._is_caught(state)
        if self._creeps_to_rest(orbit):
            return True
        if not self.apart(orbit[-2], state) > SAME:
            return False
        return self._cycle(state)

    def _waits(self, orbit: Array) -> bool:
        """Whether a motion comes slowly to a cycle that is known, perhaps to one beside it."""
        if self.legs >= WAITING:
            return False
        for number, one in enumerate(self.orbits):
            if one.time:
                first, last = self.distance(one, orbit[[0, -1]])
                if last < min(first, CAUGHT) and last < self._radius(number):
                    return not self._is_known(orbit[-1])
        return False

    def _rest(self, state: Array) -> bool:
        """Keep the attracting equilibrium next to a state; whether there is one."""
        found = self.near.rest(state, NEAR_REST)
        if found is None:
            return False
        x, growth = found.x, float(found.eigenvalues.real.max())
        if any(self.distance(one, x[None])[0] < SAME for one in self.orbits):
            return True
        if growth > found.flat:
            return False
        if growth > -found.flat:
            return self._flat_rest(found) or (self._attracts(x) and self._keep_rest(x, 0.0))
        return self._keep_rest(x, growth if growth < -ROUNDED * found.flat else 0.0)

    def _keep_rest(self, x: Array, exponent: float) -> bool:
        self._file(Attractor(AttractorKind.EQUILIBRIUM, x[None], 0.0, exponent, time=0.0))
        return True

    def _flat_rest(self, found: Rest) -> bool:
        """Keep a rest at which one eigenvalue is none, if slow motions come to it; whether so."""
        if self._is_flat_rest(found.x):
            return True
        if np.sum(found.eigenvalues.real > -found.flat) != 1:
            return False
        x, reach, is_simple = slow_rest(self.near, found.x)
        if reach > 0.0 and is_simple:
            return self._keep_rest(x, min(float(found.eigenvalues.real.max()), 0.0))
        if reach > 0.0:
            one = Attractor(AttractorKind.EQUILIBRIUM, x[None], 0.0, 0.0, time=0.0)
            self.flat[id(one)] = reach
            self._file(one)
        return reach > 0.0

    def _is_flat_rest(self, x: Array) -> bool:
        """Whether a rest is a known one, which Newton's method finds with few digits."""
        flat = ((one, self.flat.get(id(one), 0.0)) for one in self.orbits)
        return any(self.distance(one, x[None])[0] < 0.25 * reach for one, reach in flat)

    def _creeps_to_rest(self, orbit: Array) -> bool:
        """Whether a motion creeps to a rest that is far, which is kept."""
        state = orbit[-1]
        if not self._creeps(orbit):
            return False
        # Of a cycle the motion may come to another one close beside it.
        if any(
            not one.time and self.distance(one, state[None])[0] < self._radius(number)
            for number, one in enumerate(self.orbits)
        ):
            return True
        found = self.near.rest(state, FAR_REST)
        if found is None or not abs(float(found.eigenvalues.real.max())) <= found.flat:
            return False
        return self._flat_rest(found) and self._is_caught(state)

    def _seen_radius(self, one: Attractor) -> float:
        """The same; of a flat rest as far as slow motions come to it once what is fast is gone."""
        reach = self.flat.get(id(one), 0.0)
        if not reach > 0.0:
            return super()._seen_radius(one)
        others = [self.apart(o.points, one.points[0]).min() for o in self.found if o is not one]
        radius = min([0.4 * float(far) for far in others] + [0.5 * reach])
        for _ in range(HALVINGS):
            starts = one.points[0] + radius * self._ring * self.units
            seen = self.run(starts, SLOW_LEGS[0], SLOW_LEGS[0]).states
            before, after = (self.distance(one, seen[:, k]) for k in (0, -1))
            if (before < reach).all() and (after <= before + LEAST).all():
                return radius
            radius *= 0.5
        return 0.0

    def _attracts(self, x: Array) -> bool:
        """Whether `_draws_near` says so, which is asked once of each rest."""
        if any(self.apart(x, one) < SAME for one in self.passed):
            return False
        if self._draws_near(x):
            return True
        self.passed.append(x)
        return False

    def _draws_near(self, x: Array) -> bool:
        """Whether all states around a rest that no eigenvalue decides about come nearer to it."""
        for radius in (1e-2, 1e-3):
            starts = x + radius * self._ring * self.units
            before = self.run(starts, 1, SLOW_LEGS[0]).states[:, 0]  # what is fast has decayed
            away = self.apart(before, x)
            for legs in SLOW_LEGS:
                ends = self.run(before, 1, legs).states[:, 0] if np.isfinite(away).all() else before
                if not np.isfinite(ends).all():  # nor will they be after more legs
                    return False
                nearer = (self.apart(ends, x) < NEARER * away + LEAST) & (away < NEAR_REST)
                if nearer.all():
                    break
            else:
                return False
        return True

    def _cycle(self, state: Array) -> bool:
        """Keep the attracting cycle through the neighbourhood of a state; whether there is one."""
        span = min(self.legs, ROUNDS[2]) * self.leg
        for time in self.near.returns(state, span, self.fine or self.leg)[:TRIES]:
            found = self.near.cycle(state, float(time), most=PARTING)
            if found is not None:
                return self._keep_cycle(found)
        return False

    def _keep_cycle(self, found: Cycle) -> bool:
        """Keep a cycle, if it attracts; whether it does."""
        multiplier = float(np.abs(found.multipliers).max(initial=0.0))
        if not multiplier < 1.0 - NEUTRAL:
            return False
        if any(self._is_on(one, found.x) for one in self.orbits):
            return True
        times = found.period * np.arange(POINTS + 1) / POINTS
        points = self.near.along(found.x, times)
        if not np.isfinite(points).all():
            return False
        turned = np.abs(points[-1] - found.x) > 0.5 * self.turns
        kind = AttractorKind.CYCLE
        if np.any(turned & (self.turns > 0.0)):
            kind = AttractorKind.ROTATION
        turns = round((points[-1] - found.x)[0] / self.period) if self.period else 0
        rate = turns / found.period + 0.0
        self._file(
            Attractor(kind, points[:-1], rate, 0.0, multiplier=multiplier, time=found.period)
        )
        return True

    def _is_on(self, one: Attractor, x: Array) -> bool:
        """Whether a state lies on a cycle, between its points as well."""
        if not one.time or self.distance(one, x[None])[0] > CHORD:
            return False
        i = int(np.argmin(self.apart(one.points, x))) - 1
        time = one.time / len(one.points)
        for _ in range(8):
            at = self.near.along(one.points[i], np.array([time]))[0]
            way, off = self.near.rates(at) / self.units, self.near.off(x, at) / self.units
            change = float(way @ off / (way @ way))
            time += change
            if abs(change) < 1e-12 * one.time:
                break
        return float(np.linalg.norm(off)) < SAME

    def _creeps(self, found: Array) -> bool:
        """Whether a motion does not come back to where it was before."""
        step, before = self.apart(found[-2], found[-1]), found[: len(found) // 2]
        return bool(self.apart(before, found[-1]).min() > STEPS * step)

    def _contraction(self, found: Array) -> float:
        return SETTLED if self.stiff else super()._contraction(found)

    def _file(self, one: Attractor) -> None:
        self.found.append(one)
        self.found.sort(key=lambda other: not other.is_periodic)

    def _takes_long_to_repeat(self, found: Array) -> bool:
        return not self._creeps(found) and self._cycle(found[-1])

    def _classified(self, found: Array) -> Attractor | None:
        """What a motion that does not repeat itself runs along; None where it is under way.

        On a plane there is nothing but rests and cycles. What does not come back to where it was
        creeps.
        """
        n, least = self.turns.size, 1.0 / (FILLING * self.leg)
        if n < 3 or self._creeps(found):
            self.open[CREEPS] += 1
            return None
        parameters = [self.values[name] for name in self.law.names]
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", RuntimeWarning)  # NaN is told as doubt
            of = exponents(self.law, *parameters, *found[0], FILLING * self.leg, count=min(n, 2))
        value, error = of["lyapunov_exponent"], of["lyapunov_error"]
        doubt = SURE * error + least
        turns = self._turns(found) / self.leg
        kind = AttractorKind.UNKNOWN
        if value[0] < -doubt[0]:
            self.open[CREEPS] += 1
            return None
        if n > 2 and value[0] > doubt[0]:
            kind = AttractorKind.CHAOTIC
        elif n > 2 and (np.abs(value) <= doubt).all():
            kind = AttractorKind.TORUS
        else:
            self.open[IN_DOUBT] += 1
        return Attractor(kind, found, turns, float(value[0]), float(error[0]))
