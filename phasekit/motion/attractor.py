"""Attractors as they are found, and what a search for them holds."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from phasekit.arrays import Array
from phasekit.errors import AttractorKind
from phasekit.laws.equations import Equations
from phasekit.laws.perturbed import PerturbedConservative
from phasekit.motion.flow import ATOL, RTOL
from phasekit.motion.lost import EXHAUSTED, MOST, MOST_JUMPING, UNDEFINED
from phasekit.motion.method import turns_of, whole_turns
from phasekit.motion.strobe import Steps, Strobed, Targets, common_period, strobe

#: Longest orbit that counts as periodic at first sight, in legs, and states of one that is not.
LONGEST = 16
#: Legs after which motions are looked at, one round after another.
ROUNDS = (60, 240, 1000, 3000)
#: Log of the contraction of areas after which motions count as settled, and most legs until then.
SETTLED, PATIENCE = 30.0, 100_000
#: Why it is not seen where a motion ends.
TOO_WEAK = f"are damped so weakly that they did not settle within {PATIENCE} periods or less"
TOO_LONG = f"take more than {MOST} steps"
TOO_LONG_JUMPING = f"take more than {MOST_JUMPING} steps, where the law jumps and may hold them"
NO_VALUE = "end where the law has no value"


class Attractors(NamedTuple):
    """The group "attractors", rows in the order of the first point's first state."""

    state: Array
    """Of shape (attractors, points, states), NaN beyond the last point."""
    kind: npt.NDArray[np.int8]
    period: Array
    """Legs, or the time, after which it repeats itself; 0: it does not."""
    multiplier: Array
    """Greatest modulus of its multipliers over that period or, of a rotation, over a turn."""
    exponent: Array
    """Largest Lyapunov exponent."""
    exponent_error: Array
    rotation: Array
    """Turns of the first state in a leg, or in a unit of time."""


@dataclass
class Attractor:
    """One attractor."""

    kind: AttractorKind
    points: Array
    """States once a leg, of shape (n, states): the whole orbit of a periodic one."""
    turns: float
    """In a leg, or in a unit of time."""
    exponent: float
    exponent_error: float = 0.0
    multiplier: float = np.nan
    time: float | None = None
    """Of a flow that does not vary: in which it repeats itself."""

    @property
    def is_periodic(self) -> bool:
        """Whether the points are the whole of it."""
        at_once = self.kind in (AttractorKind.EQUILIBRIUM, AttractorKind.CYCLE)
        return at_once or self.time is not None

    @property
    def period(self) -> float:
        """Legs, or the time, after which it repeats itself; 0: it does not."""
        if self.time is not None:
            return self.time
        return len(self.points) if self.is_periodic else 0


@dataclass
class Search:
    """A search for the attractors of one system."""

    law: PerturbedConservative | Equations
    values: Mapping[str, Array]
    leg: float
    """Time, or steps of a map."""
    units: Array
    """By which the states are measured: the box from which motions start, or their range."""
    rtol: float = RTOL
    found: list[Attractor] = field(default_factory=list)
    open: Counter[str] = field(default_factory=Counter)
    """Motions of which it was not seen where they end, by the reason."""
    ended: bool = False
    """Whether motions take so long that none is followed any more."""
    bounds: Array | None = None
    """Rows: least and greatest state of a motion that is not gone for good."""
    #: Points of an attractor that are kept.
    kept = LONGEST
    #: Whether a further look adds to what was found.
    adds = False

    def __post_init__(self) -> None:
        """Note which states are angles."""
        self.turns = turns_of(self.law)

    @property
    def period(self) -> float:
        """Of the first state, 0 on a line."""
        return float(self.turns[0])

    @property
    def step(self) -> float:
        """Time after which motions are held against attractors at first."""
        return self.leg

    def rounds(self, legs: int) -> list[tuple[int, float]]:
        """How often, and after which time each, motions are held against attractors."""
        return [(legs, self.leg)]

    @property
    def repeats(self) -> bool:
        """Whether the law is the same after each leg."""
        period = common_period(self.law, self.values)
        if period is None:
            return True
        number = self.leg / float(period)
        return bool(abs(number - round(number)) <= 1e-13 * number and number > 0.5)

    @property
    def steps(self) -> Steps:
        """How steps are taken."""
        return Steps(self.rtol, self.rtol * ATOL / RTOL)

    def look(self, states: Array) -> None:
        """Find the attractors to which motions from states come."""
        raise NotImplementedError

    def targets(self) -> Targets:
        """Where motions have come to an attractor."""
        raise NotImplementedError

    def nowhere(self) -> Targets:
        """No attractors, but where motions are gone."""
        to = Targets.none(self.units)
        return to if self.bounds is None else to._replace(reach=self.bounds)

    def apart(self, x: Array, y: Array) -> Array:
        """Distances of states, in units of the box."""
        off = x - y
        return np.asarray(
            np.linalg.norm((off - whole_turns(off, self.turns)) / self.units, axis=-1)
        )

    def distance(self, one: Attractor, states: Array) -> Array:
        """Distances of states from a periodic attractor."""
        raise NotImplementedError

    def blur(self, one: Attractor) -> float:
        """What these distances may be wrong by."""
        return 0.0

    def run(self, states: Array, kept: int, skip: int) -> Strobed:
        """Follow motions."""
        found = strobe(
            self.law, self.values, states, self.leg, kept, skip, targets=self.nowhere(),
            steps=self.steps,
        )  # fmt: skip
        self.count_open(found.status, found.raised)
        return found

    def count_open(self, status: npt.NDArray[np.int64], raised: str) -> None:
        """Count the motions of which it was not seen where they come to."""
        jumps = isinstance(self.law, Equations) and self.law.jumps
        self.open[TOO_LONG_JUMPING if jumps else TOO_LONG] += int(np.sum(status == EXHAUSTED))
        said = f", where f raised {raised[:200]}" if raised else ""
        self.open[NO_VALUE + said] += int(np.sum(status == UNDEFINED))

    def wrapped(self, states: Array) -> Array:
        """States whose angles lie in the half-open turn round 0."""
        half = 0.5 * self.turns
        with np.errstate(invalid="ignore", divide="ignore"):
            inside = half - np.mod(half - states, self.turns)
        return np.asarray(np.where(self.turns > 0.0, inside, states))

    def order(self) -> None:
        """Number the attractors by what they are, not by when they were found.

        Periodic ones come first, by period and least state, at which they begin; then the others,
        by their turns and mean first state.
        """

        def first(orbit: Array) -> tuple[float, ...]:
            return tuple(np.round(self.wrapped(orbit[0]) / self.units, 9).tolist())

        def sort_key(one: Attractor) -> tuple[float, ...]:
            if one.is_periodic:
                return (0.0, round(one.period, 9), *first(one.points))
            mean = self.wrapped(one.points)[:, 0].mean()
            return (1.0, round(one.turns, 3), float(mean))

        for one in self.found:
            if one.is_periodic:
                turned = (np.roll(one.points, -i, axis=0) for i in range(len(one.points)))
                one.points = min(turned, key=first)
        self.found.sort(key=sort_key)

    def result(self) -> Attractors:
        """What was found: periodic orbits first."""
        lengths = [len(one.points) if one.is_periodic else self.kept for one in self.found]
        states = np.full((len(self.found), max([*lengths, 1]), self.turns.size), np.nan)
        for row, (one, length) in enumerate(zip(self.found, lengths, strict=True)):
            own = one.points[:length]
            states[row, : len(own)] = self.wrapped(own)
        return Attractors(
            states,
            np.array([one.kind for one in self.found], np.int8),
            np.array([one.period for one in self.found], float),
            np.array([one.multiplier for one in self.found], float),
            np.array([one.exponent for one in self.found], float),
            np.array([one.exponent_error for one in self.found], float),
            np.array([one.turns for one in self.found], float),
        )


class PlaneSearch(Search):
    """A search in the plane of a coordinate and its rate."""

    law: PerturbedConservative

    @property
    def size(self) -> float:
        """Of the box, along the coordinate."""
        return float(self.units[0])

    @property
    def scale(self) -> float:
        """By which rates are measured against coordinates."""
        return float(self.units[1] / self.units[0])
