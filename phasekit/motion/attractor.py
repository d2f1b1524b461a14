"""Attractors as they are found, and what a search for them holds."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from phasekit.errors import AttractorKind
from phasekit.laws.perturbed import PerturbedConservative
from phasekit.motion.flow import ATOL, RTOL
from phasekit.motion.lost import EXHAUSTED, MOST
from phasekit.motion.method import circle
from phasekit.motion.strobe import Strobed, Targets, common_period, strobe

Array = npt.NDArray[np.float64]

#: Longest orbit that counts as periodic at first sight, in legs, and states of one that is not.
LONGEST = 16
#: Legs after which motions are looked at, one round after another.
ROUNDS = (60, 240, 1000, 3000)
#: Motions that are followed further where many have come to nothing that repeats itself.
MOST_OPEN = 24
#: Log of the contraction of areas after which motions count as settled, and most legs until then.
SETTLED, PATIENCE = 30.0, 100_000
#: Why it is not seen where a motion ends.
TOO_WEAK = f"are damped so weakly that they did not settle within {PATIENCE} periods or less"
TOO_LONG = f"take more than {MOST} steps"


class Attractors(NamedTuple):
    """The group "attractors", rows in the order of the first point's coordinate."""

    attractor_phi: Array
    """Of shape (attractors, points), NaN beyond the last."""
    attractor_dphi: Array
    attractor_kind: npt.NDArray[np.int8]
    attractor_period: npt.NDArray[np.int64]
    """Legs after which it repeats itself; 0: it does not."""
    attractor_multiplier: Array
    """Greatest modulus of its multipliers over that period or, of a rotation, over a turn."""
    attractor_exponent: Array
    """Largest Lyapunov exponent."""
    attractor_exponent_error: Array
    rotation_number: Array
    """Turns in a leg."""


@dataclass
class Attractor:
    """One attractor."""

    kind: AttractorKind
    points: Array
    """States once a leg, of shape (n, 2): the whole orbit of a periodic one."""
    turns: float
    """In a leg."""
    exponent: float
    exponent_error: float = 0.0
    multiplier: float = np.nan

    @property
    def period(self) -> int:
        """Legs after which it repeats itself; 0: it does not."""
        periodic = self.kind in (AttractorKind.EQUILIBRIUM, AttractorKind.CYCLE)
        return len(self.points) if periodic else 0


@dataclass
class Search:
    """A search for the attractors of one system."""

    law: PerturbedConservative
    values: Mapping[str, Array]
    leg: float
    scale: float
    """By which rates are measured against coordinates."""
    size: float
    """Of the box from which motions start."""
    rtol: float = RTOL
    found: list[Attractor] = field(default_factory=list)
    open: Counter[str] = field(default_factory=Counter)
    """Motions of which it was not seen where they end, by the reason."""

    @property
    def period(self) -> float:
        """Of the coordinate, 0 on a line."""
        return circle(self.law)

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
    def tolerances(self) -> dict[str, Any]:
        """Errors of a step that are allowed."""
        return {"rtol": self.rtol, "atol": self.rtol * ATOL / RTOL}

    def look(self, states: Array) -> None:
        """Find the attractors to which motions from states come."""
        raise NotImplementedError

    def targets(self) -> Targets:
        """Where motions have come to an attractor."""
        raise NotImplementedError

    def apart(self, x: Array, y: Array) -> Array:
        """Distances of states."""
        off = x - y
        phi = off[..., 0]
        if self.period:
            phi = phi - self.period * np.round(phi / self.period)
        return np.asarray(np.hypot(phi, off[..., 1] / self.scale))

    def run(self, states: Array, kept: int, skip: int) -> Strobed:
        """Follow motions."""
        found = strobe(self.law, self.values, states, self.leg, kept, skip, **self.tolerances)
        self.open[TOO_LONG] += int(np.sum(found.status == EXHAUSTED))
        return found

    def wrapped(self, phi: Array) -> Array:
        """Angles in the half-open turn round 0."""
        if not self.period:
            return np.asarray(phi)
        half = 0.5 * self.period
        return np.asarray(half - np.mod(half - phi, self.period))

    def order(self) -> None:
        """Number the attractors by what they are, not by when they were found.

        Periodic ones come first, by period and least angle, at which they begin; then the others,
        by their turns and mean angle.
        """

        def first(orbit: Array) -> tuple[float, float]:
            phi, dphi = self.wrapped(orbit[0, 0]), orbit[0, 1] / self.scale
            return round(float(phi) / self.size, 9), round(float(dphi) / self.size, 9)

        def place(one: Attractor) -> tuple[float, ...]:
            if one.period:
                return (0.0, one.period, *first(one.points))
            return (1.0, round(one.turns, 3), float(self.wrapped(one.points[:, 0]).mean()))

        for one in self.found:
            if one.period:
                turned = [np.roll(one.points, -i, axis=0) for i in range(one.period)]
                one.points = min(turned, key=first)
        self.found.sort(key=place)

    def result(self) -> Attractors:
        """What was found: periodic orbits first."""
        lengths = [one.period or LONGEST for one in self.found]
        shape = len(self.found), max([*lengths, 1])
        phi, dphi = np.full(shape, np.nan), np.full(shape, np.nan)
        for row, (one, length) in enumerate(zip(self.found, lengths, strict=True)):
            own = one.points[:length]
            phi[row, : len(own)], dphi[row, : len(own)] = self.wrapped(own[:, 0]), own[:, 1]
        return Attractors(
            phi,
            dphi,
            np.array([one.kind for one in self.found], np.int8),
            np.array([one.period for one in self.found], np.int64),
            np.array([one.multiplier for one in self.found], float),
            np.array([one.exponent for one in self.found], float),
            np.array([one.exponent_error for one in self.found], float),
            np.array([one.turns for one in self.found], float),
        )
