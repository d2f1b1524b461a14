"""Where damped and driven motions end: attractors once a period, and how far around they catch."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from phasekit.laws.perturbed import PerturbedConservative
from phasekit.motion.flow import motions
from phasekit.motion.lost import EXHAUSTED, MOST
from phasekit.motion.method import circle, unit_of
from phasekit.motion.strobe import Strobed, Targets, common_period, strobe

Array = npt.NDArray[np.float64]

#: Longest orbit that counts as periodic, in legs.
LONGEST = 16
#: Legs after which motions are looked at, one round after another.
ROUNDS = (60, 240, 1000, 3000)
#: Motions that are followed further where many have come to nothing that repeats itself.
MOST_OPEN = 24
#: Log of the contraction of areas after which motions count as settled, and most legs until then.
SETTLED, PATIENCE = 30.0, 100_000
#: Change within an orbit, of the size of the box, that Newton's method takes up.
NEAR = 1e-4
#: Two attractors that are closer than this part of the size of the box are one.
SAME = 1e-6
#: Boxes along each axis for attractors that are no periodic orbits, and states that fill them.
BOXES, FILLING, VISITS = 100, 4000, 40
#: States around a point of an attractor that are followed to see how far it catches.
RING = 32
#: Legs for which they are followed.
LONGEST_RING = 20_000
#: Why it is not seen where a motion ends.
TOO_WEAK = f"are damped so weakly that they did not settle within {PATIENCE} periods or less"
TOO_LONG = f"take more than {MOST} steps"


class Attractors(NamedTuple):
    """The group "attractors", rows in the order of the first point's coordinate."""

    attractor_phi: Array
    """Of shape (attractors, points), NaN beyond the last."""
    attractor_dphi: Array
    attractor_period: npt.NDArray[np.int64]
    """Legs after which it repeats itself; 0: it does not."""
    attractor_multiplier: Array
    """Greatest modulus of its multipliers over that period; NaN where there is none."""
    rotation_number: Array
    """Turns in a leg."""


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
    orbits: list[Array] = field(default_factory=list)
    """Periodic ones, of shape (period, 2)."""
    multipliers: list[float] = field(default_factory=list)
    windings: list[float] = field(default_factory=list)
    others: list[Array] = field(default_factory=list)
    """States on those that are not periodic, of shape (states, 2)."""
    drifts: list[float] = field(default_factory=list)
    radii: dict[int, float] = field(default_factory=dict)
    """How far around periodic ones states were seen to come to them, by place."""
    open: Counter[str] = field(default_factory=Counter)
    """Motions of which it was not seen where they end, by the reason."""

    @property
    def period(self) -> float:
        """Of the coordinate, 0 on a line."""
        return circle(self.law)

    def apart(self, x: Array, y: Array) -> Array:
        """Distances of states."""
        off = x - y
        phi = off[..., 0]
        if self.period:
            phi = phi - self.period * np.round(phi / self.period)
        return np.asarray(np.hypot(phi, off[..., 1] / self.scale))

    def run(self, states: Array, kept: int, skip: int) -> Strobed:
        """Follow motions."""
        found = strobe(self.law, self.values, states, self.leg, kept, skip)
        self.open[TOO_LONG] += int(np.sum(found.status == EXHAUSTED))
        return found

    def look(self, states: Array) -> None:
        """Find the attractors to which motions from states come."""
        for legs in ROUNDS:
            if not len(states):
                return
            found = self.run(states, 2 * LONGEST + 1, legs).states
            open_ = []
            for orbit in found[np.isfinite(found[:, -1]).all(axis=1)]:
                if not self._is_known(orbit[-1]) and not self._take(orbit):
                    open_.append(orbit[-1])
            number = min(len(open_), MOST_OPEN)
            some = np.linspace(0, len(open_) - 1, number).round().astype(int)
            states = np.array(open_).reshape(-1, 2)[some]
        if len(states):
            self._look_longer(states)

    def _look_longer(self, states: Array) -> None:
        """Sort out motions that do not repeat themselves: on attractors of their own, or slow."""
        kept = 2 * LONGEST + 1
        found = self.run(states, kept, 0).states
        strength = self._damping(found)
        legs = SETTLED / strength if strength > 0.0 else np.inf
        slow = [orbit[-1] for orbit in found if not self._is_sorted(orbit, legs)]
        if legs > PATIENCE:
            self.open[TOO_WEAK] += len(slow)
        elif slow and legs > ROUNDS[-1]:
            found = self.run(np.array(slow), kept, int(legs)).states
            slow = [orbit[-1] for orbit in found if not self._is_sorted(orbit, legs)]
        for state in slow if legs <= PATIENCE else []:
            self._take_other(state)

    def _is_sorted(self, orbit: Array, legs: float) -> bool:
        """Whether it is known where a motion ends: at a periodic attractor, or nowhere."""
        state = orbit[-1]
        if not np.isfinite(state).all() or self._is_caught(state) or self._take(orbit):
            return True
        # A motion that spirals slowly into a point has that in its middle.
        weak = legs > ROUNDS[-1]
        return weak and self._refined(orbit.mean(axis=0), 1) and self._is_caught(state)

    def _damping(self, found: Array) -> float:
        """Log of the contraction of areas in a leg, the mean along motions."""
        linear, quadratic = (float(np.mean(self.values[n])) for n in ("damping", "quadratic"))
        speeds = np.abs(found[np.isfinite(found).all(axis=2)][:, 1])
        speed = float(speeds.mean()) if speeds.size else 0.0
        return (linear + 2.0 * quadratic * speed) * self.leg

    def _is_caught(self, state: Array) -> bool:
        """Whether a state is so near a periodic attractor that it comes to it."""
        return any(
            self.apart(orbit, state).min() < self._radius(number)
            for number, orbit in enumerate(self.orbits)
        )

    def _is_known(self, state: Array) -> bool:
        return any(
            self.apart(orbit, state).min() < 1e-3 * self.size * (1.0 - multiplier)
            for orbit, multiplier in zip(self.orbits, self.multipliers, strict=True)
        )

    def _take(self, orbit: Array) -> bool:
        """Keep the attracting periodic orbit near which a motion is; whether there is one."""
        half = len(orbit) // 2
        for q in range(1, LONGEST + 1):
            if self.apart(orbit[half:], orbit[half - q : len(orbit) - q]).max() < NEAR * self.size:
                return self._refined(orbit[-1], q)
        return False

    def _refined(self, state: Array, q: int) -> bool:
        start = state
        for _ in range(12):
            image, slope = self._map(state, q)
            off = image - state
            turns = np.round(off[0] / self.period) if self.period else 0.0
            off[0] -= turns * self.period
            try:
                step = np.linalg.solve(np.eye(2) - slope, off)
            except np.linalg.LinAlgError:
                return False
            if not np.isfinite(step).all():
                return False
            state = state + step
            if np.hypot(step[0], step[1] / self.scale) < 1e-12 * self.size:
                break
        else:
            return False
        if self.apart(state, start) > 100.0 * NEAR * self.size:
            return False
        points = self.run(state[None], q, 0).states[0]
        for part in (part for part in range(1, q) if q % part == 0):
            if self.apart(points[part], state) < SAME * self.size:
                return self._refined(state, part)
        multiplier = float(np.abs(np.linalg.eigvals(slope)).max())
        if not (multiplier < 1.0 - 1e-9 or self._is_rest(points, slope)):
            return False
        if not any(self.apart(known, state).min() < SAME * self.size for known in self.orbits):
            self.orbits.append(points)
            self.multipliers.append(multiplier)
            self.windings.append(float(turns) / q + 0.0)
        return True

    def _is_rest(self, points: Array, slope: Array) -> bool:
        """Whether a motion at rest is a center that quadratic damping alone makes attract."""
        turns = float(np.trace(slope) ** 2) < 4.0 * float(np.linalg.det(slope))
        damps = float(np.min(self.values["quadratic"])) > 0.0 == float(self.values["damping"])
        still = bool(np.abs(points[:, 1]).max() < SAME * self.size * self.scale)
        return turns and damps and still and common_period(self.law, self.values) is None

    def _map(self, state: Array, q: int) -> tuple[Array, Array]:
        """State after q legs, and its derivative."""
        start = np.array([[*state, 1.0, 0.0, 0.0, 1.0]])
        times = np.array([[q * self.leg]])
        cell = self.law, self.values, start, times
        # So few maps do not pay for the machine code of series.
        end = motions(*cell, 1e-12, 1e-13, tangents=2, series=False).states[0, 0]
        return end[:2], np.array([[end[2], end[4]], [end[3], end[5]]])

    def _take_other(self, state: Array) -> None:
        """Keep an attractor that is no periodic orbit, unless the state lies on one of them."""
        found = self.run(state[None], FILLING, 0).states[0]
        if not np.isfinite(found).all() or self._is_known(found[-1]):
            return
        if self.apart(found, found[-1]).max() < SAME * self.size:
            return  # at rest where nothing attracts: on a saddle
        for other in self.others:
            near = [self.apart(other, one).min() < 2.0 * self.size / BOXES for one in found[-50:]]
            if np.mean(near) > 0.9:
                return
        self.others.append(found)
        turned = (found[-1, 0] - found[0, 0]) / self.period if self.period else 0.0
        self.drifts.append(turned / (FILLING - 1))

    def result(self) -> Attractors:
        """What was found: periodic orbits first."""
        wide = max([len(orbit) for orbit in self.orbits] + [LONGEST] * bool(self.others) + [1])
        rows = len(self.orbits) + len(self.others)
        phi, dphi = np.full((rows, wide), np.nan), np.full((rows, wide), np.nan)
        for row, points in enumerate((*self.orbits, *self.others)):
            own = points[:wide]
            phi[row, : len(own)], dphi[row, : len(own)] = self.wrapped(own[:, 0]), own[:, 1]
        periods = [len(orbit) for orbit in self.orbits] + [0] * len(self.others)
        multipliers = [*self.multipliers, *[np.nan] * len(self.others)]
        numbers = [*self.windings, *self.drifts]
        return Attractors(
            phi, dphi, np.array(periods, np.int64), np.array(multipliers), np.array(numbers)
        )

    def order(self) -> None:
        """Number the attractors by what they are, not by when they were found.

        Periodic ones come first, by period and least angle, at which they begin; then the others,
        by their turns and mean angle.
        """
        self.radii.clear()  # they go by place

        def first(orbit: Array) -> tuple[float, float]:
            phi, dphi = self.wrapped(orbit[0, 0]), orbit[0, 1] / self.scale
            return round(float(phi) / self.size, 9), round(float(dphi) / self.size, 9)

        def begun(orbit: Array) -> Array:
            turned = [np.roll(orbit, -i, axis=0) for i in range(len(orbit))]
            return min(turned, key=first)

        orbits = [begun(orbit) for orbit in self.orbits]
        rows = zip(orbits, self.multipliers, self.windings, strict=True)
        kept = sorted(rows, key=lambda one: (len(one[0]), *first(one[0])))
        self.orbits, self.multipliers, self.windings = ([one[i] for one in kept] for i in range(3))  # type: ignore[assignment]

        def place(one: tuple[Array, float]) -> tuple[float, float]:
            return round(one[1], 3), float(self.wrapped(one[0][:, 0]).mean())

        rest = sorted(zip(self.others, self.drifts, strict=True), key=place)
        self.others, self.drifts = [one for one, _ in rest], [drift for _, drift in rest]

    def wrapped(self, phi: Array) -> Array:
        """Angles in the half-open turn round 0."""
        if not self.period:
            return np.asarray(phi)
        half = 0.5 * self.period
        return np.asarray(half - np.mod(half - phi, self.period))

    def targets(self) -> Targets:
        """Where motions have come to an attractor."""
        rows = []
        for number, orbit in enumerate(self.orbits):
            radius = self._radius(number)
            rows += [[*point, radius, number] for point in orbit]
        points = np.array(rows).reshape(-1, 4)
        box, boxes = np.array([0.0, 1.0, 0.0, 1.0]), np.zeros((0, 0), np.int16)
        if self.others:
            box, boxes = self._boxes()
        return Targets(points, self.scale, box, boxes, VISITS)

    def _radius(self, number: int) -> float:
        """Distance up to which states around an attractor were seen to come to it."""
        if number not in self.radii:
            self.radii[number] = self._seen_radius(number)
        return self.radii[number]

    def _seen_radius(self, number: int) -> float:
        orbit, multiplier = self.orbits[number], self.multipliers[number]
        rest = [o for i, o in enumerate(self.orbits) if i != number] + self.others
        far = min([self.apart(orbit[:, None], o).min() for o in rest] + [self.size])
        radius = min(0.4 * far, 0.05 * self.size)
        angles = 2.0 * np.pi * np.arange(RING) / RING
        ring = np.stack([np.cos(angles), self.scale * np.sin(angles)], axis=-1)
        rate = -np.log(np.clip(multiplier, 1e-3, 1.0 - 1e-6))
        legs = len(orbit) * (2 + int(-np.log(1e-3) / rate))
        if legs <= LONGEST_RING:
            tries = [(0.5**i * radius, legs) for i in range(40)]
        else:
            tries = [(radius, LONGEST_RING // part) for part in (100, 10, 1)]
        for radius, legs in tries:
            states = (orbit[:, None] + radius * ring).reshape(-1, 2)
            ends = self.run(states, 1, legs).states[:, 0]
            if np.all(self.apart(ends[:, None], orbit).min(axis=1) < 0.5 * radius):
                return float(radius)
        return 0.0

    def _boxes(self) -> tuple[Array, npt.NDArray[np.int16]]:
        every = np.concatenate(self.others)
        low, high = every.min(axis=0), every.max(axis=0)
        room = 0.05 * (high - low)
        low, high = low - room, high + room
        if self.period:
            low[0], high[0] = -0.5 * self.period, 0.5 * self.period
        boxes = np.full((BOXES, BOXES), -1, np.int16)
        for row, states in enumerate(self.others):
            own = np.stack([self.wrapped(states[:, 0]), states[:, 1]], axis=-1)
            i, j = ((own - low) / (high - low) * BOXES).astype(int).T.clip(0, BOXES - 1)
            boxes[i, j] = len(self.orbits) + row
        return np.array([low[0], high[0], low[1], high[1]]), boxes


def find(
    law: PerturbedConservative,
    values: Mapping[str, Array],
    leg: float,
    states: Array,
) -> Search:
    """Return the attractors to which motions from states come, seen once a leg.

    Parameters
    ----------
    law, values
        The law, and values of its parameters.
    leg : float
        Time of a leg: a period of the law.
    states : array, shape (n, 2)
        Where motions start; they also say how coordinates and rates are measured.
    """
    width, fastest = _extent(law, values, leg, states)
    search = Search(law, values, leg, 2.0 * fastest / width, width)
    search.look(states)
    search.order()
    return search


def _extent(
    law: PerturbedConservative, values: Mapping[str, Array], leg: float, states: Array
) -> tuple[float, float]:
    """Width in the coordinate and greatest rate of states, or of the motions from them."""
    width, fastest = float(np.ptp(states[:, 0])), float(np.abs(states[:, 1]).max())
    if width and fastest:
        return width, fastest
    seen = strobe(law, values, states, leg / 8.0, 17).states.reshape(-1, 2)
    seen = seen[np.isfinite(seen).all(axis=1)]
    if not width and circle(law):
        width = unit_of(law)
    elif not width:
        far = float(np.abs(seen[:, 0]).max(initial=0.0))
        width = max(float(np.ptp(seen[:, 0])) if seen.size else 0.0, 1e-3 * far) or 1.0
    return width, fastest or max(float(np.abs(seen[:, 1]).max(initial=0.0)), width / leg)
