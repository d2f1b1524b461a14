"""Where damped and driven motions end: attractors once a period, and how far around they catch."""

from __future__ import annotations

import warnings
from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np
import numpy.typing as npt

from phasekit.errors import AttractorKind
from phasekit.laws.perturbed import PerturbedConservative, forcing_names, modulation_names
from phasekit.motion.attractor import (
    LONGEST,
    PATIENCE,
    ROUNDS,
    SETTLED,
    TOO_LONG,
    TOO_WEAK,
    Attractor,
    Attractors,
    Search,
)
from phasekit.motion.autonomous import AutonomousSearch
from phasekit.motion.flow import RTOL, motions
from phasekit.motion.method import circle, unit_of
from phasekit.motion.overdamped import OverdampedSearch, is_overdamped
from phasekit.motion.strobe import Targets, common_period, lyapunov, strobe

__all__ = ["TOO_LONG", "TOO_WEAK", "Attractors", "DrivenSearch", "Search", "find"]

Array = npt.NDArray[np.float64]

#: Motions that are followed further where many have come to nothing that repeats itself.
MOST_OPEN = 24
#: Change within an orbit, of the size of the box, that Newton's method takes up.
NEAR = 1e-4
#: Two attractors that are closer than this part of the size of the box are one.
SAME = 1e-6
#: Boxes along each axis for attractors that are no periodic orbits, and states that fill them.
BOXES, FILLING, VISITS = 100, 4000, 40
#: Longest period that is looked for of motions that do not repeat themselves soon.
MOST_LEGS = 512
#: Errors of an exponent by which it must differ from zero, parts of a turn between states on a
#: closed curve, and how often a run along it is made three times as long.
SURE, GAP, ROUNDS_OF_FILLING = 3.0, 0.2, 3
#: Why it is not seen where a motion ends.
CREEPS = "creep towards what they do not reach"
IN_DOUBT = (
    "neither repeat themselves, nor fill a closed curve, nor have an exponent that is surely "
    "positive: what counts as an attractor of its own may be a part of another"
)
#: States around a point of an attractor that are followed to see how far it catches, and legs for
#: which they are.
RING = 32
PARTS_OF_RING = (np.arange(RING) % 4 == 0, np.arange(RING) % 4 != 0)
LONGEST_RING = 20_000


@dataclass
class DrivenSearch(Search):
    """A search for the attractors of one system, seen once a leg."""

    radii: dict[int, float] = field(default_factory=dict)
    """How far around periodic ones states were seen to come to them, by place."""

    @property
    def orbits(self) -> list[Attractor]:
        """Periodic ones."""
        return [one for one in self.found if one.period]

    @property
    def others(self) -> list[Attractor]:
        """Those that are not."""
        return [one for one in self.found if not one.period]

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
            self.apart(one.points, state).min() < self._radius(number)
            for number, one in enumerate(self.orbits)
        )

    def _is_known(self, state: Array) -> bool:
        return any(
            self.apart(one.points, state).min() < 1e-3 * self.size * (1.0 - one.multiplier)
            for one in self.orbits
        )

    def _take(self, orbit: Array) -> bool:
        """Keep the attracting periodic orbit near which a motion is; whether there is one."""
        if not self.repeats:
            return False
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
        if not any(self.apart(o.points, state).min() < SAME * self.size for o in self.orbits):
            still = common_period(self.law, self.values) is None
            kind = AttractorKind.EQUILIBRIUM if still else AttractorKind.CYCLE
            exponent = float(np.log(multiplier)) / (q * self.leg) if multiplier > 0.0 else -np.inf
            turned = float(turns) / q + 0.0
            self.found.append(Attractor(kind, points, turned, exponent, multiplier=multiplier))
            self.found.sort(key=lambda one: not one.period)
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
        if self._is_on_other(found) or self._takes_long_to_repeat(found):
            return
        one = self._classified(found)
        if one is not None and not self._is_on_other(one.points):
            self.found.append(one)

    def _is_on_other(self, found: Array) -> bool:
        """Whether a motion runs along an attractor that is known and no periodic orbit."""
        for other in self.others:
            points = other.points
            near = [self.apart(points, one).min() < 2.0 * self.size / BOXES for one in found[-50:]]
            if np.mean(near) > 0.9:
                return True
        return False

    def _takes_long_to_repeat(self, found: Array) -> bool:
        """Keep an attracting orbit of a period longer than is looked for at first."""
        if not self.repeats:
            return False
        off = self.apart(found[-1 - MOST_LEGS : -LONGEST - 1], found[-1])[::-1]
        for i in np.flatnonzero(off < NEAR * self.size)[:3]:
            if self._refined(found[-1], LONGEST + 1 + int(i)):
                return True
        return False

    def _classified(self, found: Array) -> Attractor | None:
        """What a motion that does not repeat itself runs along; None where it is under way."""
        exponent, error = self._exponent(found[0])
        turned = float(found[-1, 0] - found[0, 0]) / self.period if self.period else 0.0
        turns = turned / (len(found) - 1)
        least = 1.0 / (FILLING * self.leg)
        if exponent > SURE * error + least:
            return Attractor(AttractorKind.CHAOTIC, found, turns, exponent, error)
        if exponent < -SURE * error - least:
            self.open[CREEPS] += 1
            return None
        if np.isfinite(exponent):
            for _ in range(ROUNDS_OF_FILLING):
                if self._is_closed(found, turns):
                    return Attractor(AttractorKind.TORUS, found, turns, exponent, error)
                more = self.run(found[-1][None], 2 * len(found), 1).states[0]
                if not np.isfinite(more).all():
                    return None
                found = np.concatenate([found, more])
                turned = float(found[-1, 0] - found[0, 0]) / self.period if self.period else 0.0
                turns = turned / (len(found) - 1)
        self.open[IN_DOUBT] += 1
        return Attractor(AttractorKind.UNKNOWN, found, turns, exponent, error)

    def _exponent(self, state: Array) -> tuple[float, float]:
        """Largest Lyapunov exponent of a motion, and its error."""
        parameters = [self.values[name] for name in self.law.names]
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", RuntimeWarning)  # NaN is told as doubt
            found = lyapunov(self.law, *parameters, *state, FILLING * self.leg)
        return float(found.lyapunov_exponent[..., 0]), float(found.lyapunov_error[..., 0])

    def _is_closed(self, found: Array, turns: float) -> bool:
        """Whether states fill a closed curve, on which they go round a circle or their middle."""
        if abs(turns) > 0.5 / FILLING:
            angle = 2.0 * np.pi * found[:, 0] / self.period
        else:
            off = (found - found.mean(axis=0)) / np.array([1.0, self.scale])
            angle = np.arctan2(off[:, 1], off[:, 0])
        angle = np.sort(np.mod(angle, 2.0 * np.pi))
        gaps = np.diff(angle, append=angle[0] + 2.0 * np.pi)
        return bool(gaps.max() < GAP)

    def order(self) -> None:
        """Number the attractors by what they are, not by when they were found."""
        super().order()
        self.radii.clear()  # they go by place

    def targets(self) -> Targets:
        """Where motions have come to an attractor."""
        rows = []
        for number, one in enumerate(self.orbits):
            radius = self._radius(number)
            rows += [[*point, radius, number] for point in one.points]
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
        orbit, multiplier = self.orbits[number].points, self.orbits[number].multiplier
        rest = [one.points for one in self.found if one is not self.orbits[number]]
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
            # A few tell soon of a ring that is not caught.
            if all(
                self._is_caught_from(orbit, radius * ring[part], radius, legs)
                for part in PARTS_OF_RING
            ):
                return float(radius)
        return 0.0

    def _is_caught_from(self, orbit: Array, around: Array, radius: float, legs: int) -> bool:
        """Whether motions from states around an orbit come to half the distance."""
        ends = self.run((orbit[:, None] + around).reshape(-1, 2), 1, legs).states[:, 0]
        return bool(np.all(self.apart(ends[:, None], orbit).min(axis=1) < 0.5 * radius))

    def _boxes(self) -> tuple[Array, npt.NDArray[np.int16]]:
        every = np.concatenate([one.points for one in self.others])
        low, high = every.min(axis=0), every.max(axis=0)
        room = 0.05 * (high - low)
        low, high = low - room, high + room
        if self.period:
            low[0], high[0] = -0.5 * self.period, 0.5 * self.period
        boxes = np.full((BOXES, BOXES), -1, np.int16)
        for row, one in enumerate(self.others):
            states = one.points
            own = np.stack([self.wrapped(states[:, 0]), states[:, 1]], axis=-1)
            i, j = ((own - low) / (high - low) * BOXES).astype(int).T.clip(0, BOXES - 1)
            boxes[i, j] = len(self.orbits) + row
        return np.array([low[0], high[0], low[1], high[1]]), boxes


def find(
    law: PerturbedConservative,
    values: Mapping[str, Array],
    leg: float,
    states: Array,
    rtol: float = RTOL,
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
    rtol : float
        Error of a step that is allowed.
    """
    width, fastest = _extent(law, values, leg, states)
    calm = not _varies(law, values) and min(values["damping"], values["quadratic"]) >= 0.0
    how = law, values, leg, 2.0 * fastest / width, width, rtol
    search: Search = AutonomousSearch(*how) if calm else DrivenSearch(*how)
    if not calm and search.repeats and is_overdamped(law, values, leg, states):
        search = OverdampedSearch(*how)
    search.look(states)
    search.order()
    return search


def _varies(law: PerturbedConservative, values: Mapping[str, Array]) -> bool:
    """Whether anything in the law varies with time."""
    names = [forcing_names(i)[0] for i in range(law.harmonics)]
    names += [modulation_names(name)[0] for name in law.modulated]
    varies = any(float(values[name]) != 0.0 for name in names)
    return varies or bool(law.drifting) or law.prescribed is not None


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
