"""Attractors of what is the same after each leg: of maps, and of driven flows once a period."""

from __future__ import annotations

import warnings
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from phasekit.arrays import Array
from phasekit.errors import AttractorKind
from phasekit.laws.equations import Equations
from phasekit.laws.ladder import Map
from phasekit.motion.attractor import (
    LONGEST,
    PATIENCE,
    ROUNDS,
    SETTLED,
    TOO_WEAK,
    Attractor,
    Search,
)
from phasekit.motion.cells import cells_of_orbits
from phasekit.motion.exponents import exponents
from phasekit.motion.method import few
from phasekit.motion.pace import calls_of
from phasekit.motion.strobe import Targets, common_period
from phasekit.motion.variational import returned

#: Motions that are followed further where many have come to nothing that repeats itself.
MOST_OPEN = 24
#: The same after each round: the shorter the next, the more, since few may go where others do not.
FOLLOWED_ON = (96, 48, MOST_OPEN, MOST_OPEN)
#: Change within an orbit, of the size of the box, that Newton's method takes up.
NEAR = 1e-4
#: Two attractors that are closer than this part of the size of the box are one.
SAME = 1e-6
#: Way in some legs that is none.
STILL = 1e-9
#: Distance from a known attractor that is no periodic orbit at which a motion runs along it, and
#: states by which that is told.
ALONG, TOLD = 0.02, 50
#: States by which a motion is compared with a run, and the share of them that are among its own.
COMPARED, AMONG = 200, 0.8
#: Calls of a Python function whose steps are short, after which no motion is followed on.
MOST_CALLS = 1e6
CALLED = (
    "were not followed on, since f is a Python function that is called about {:.2g} times a period "
    "for each: formulas are a hundred times as fast, and stiff ones go by implicit steps"
)
#: States that tell of an attractor which is no periodic orbit, and cells of it in succession that
#: a motion visits which belongs to it.
FILLING, VISITS = 4000, 40
#: Legs over which it is seen how motions contract.
LOOKS = 400
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
#: Distance from an attractor beyond which it is not tried whether it catches.
CAUGHT = 0.05
#: States around a point of an attractor that are followed to see how far it catches, and legs for
#: which they are.
RING = 32
PARTS_OF_RING = (np.arange(RING) % 4 == 0, np.arange(RING) % 4 != 0)
LONGEST_RING = 20_000


@dataclass
class StrobedSearch(Search):
    """A search for the attractors of one system, seen once a leg."""

    radii: dict[Any, float] = field(default_factory=dict)
    """How far around periodic ones states were seen to come to them, beside so many others."""
    calls: float = 0.0
    """Of a Python function, so far."""
    legs: int = 0
    """After which motions were looked at last."""
    #: Motions of a round that may come to nothing, until the others are only told from known ones.
    patience = 1_000_000
    adds = True
    #: Whether steps are implicit, and the distance at which Newton's method looks for an orbit.
    stiff = False
    reach = 100.0 * NEAR

    @property
    def span(self) -> float:
        """Time of a leg; 1 of a map, whose leg is one of it."""
        return 1.0 if isinstance(self.law, Map) else self.leg

    @property
    def orbits(self) -> list[Attractor]:
        """Periodic ones."""
        return [one for one in self.found if one.is_periodic]

    @property
    def others(self) -> list[Attractor]:
        """Those that are not."""
        return [one for one in self.found if not one.is_periodic]

    def look(self, states: Array) -> None:
        """Find the attractors to which motions from states come."""
        calls = 0.0
        if isinstance(self.law, Equations):
            calls = calls_of(self.law, self.values, self.leg, states, self.units)
        for legs, most in zip(ROUNDS, FOLLOWED_ON, strict=True):
            if not len(states):
                return
            self.calls += len(states) * legs * calls
            if self.calls > MOST_CALLS:
                self.open[CALLED.format(calls)] += len(states)
                self.ended = True
                return
            self.legs = legs
            found = self.run(states, 2 * LONGEST + 1, legs).states
            open_: list[Array] = []
            waiting: list[Array] = []
            for orbit in found[np.isfinite(found[:, -1]).all(axis=1)]:
                if self._waits(orbit):
                    waiting.append(orbit[-1])
                elif not self._is_known(orbit[-1]) and not (
                    len(open_) < self.patience and self._take(orbit)
                ):
                    if self.apart(orbit, orbit[-1]).max() >= STILL:  # else on a saddle
                        open_.append(orbit[-1])
            both = few(open_, most), few(waiting, MOST_OPEN)
            states = np.concatenate([part.reshape(-1, self.turns.size) for part in both])
        if len(states):
            self._look_longer(states)

    def _waits(self, orbit: Array) -> bool:
        """Whether it is seen later, and then at once, what a motion comes to."""
        return False

    def _look_longer(self, states: Array) -> None:
        """Sort out motions that do not repeat themselves: on attractors of their own, or slow."""
        kept = 2 * LONGEST + 1
        found = self.run(states, kept, 0).states
        strength = self._contraction(found)
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
        if self.apart(orbit, state).max() < STILL:
            return True  # at rest where nothing attracts: on a saddle
        # A motion that spirals slowly into a point has that in its middle.
        weak = legs > ROUNDS[-1]
        return weak and self._refined(orbit.mean(axis=0), 1) and self._is_caught(state)

    def _contraction(self, found: Array) -> float:
        """Log of the contraction of areas in a leg, the mean along motions."""
        good = np.isfinite(found).all(axis=2)
        if not good.any():
            return 0.0
        if isinstance(self.law, Equations):
            return self._contraction_of_equations(self.law, found[good][-1])
        linear, quadratic = (float(np.mean(self.values[n])) for n in ("damping", "quadratic"))
        speed = float(np.abs(found[good][:, 1]).mean())
        return (linear + 2.0 * quadratic * speed) * self.leg

    def _contraction_of_equations(self, law: Equations, state: Array) -> float:
        """The same by all exponents of one motion.

        What expands, and stays where it is, has settled: a map that is not one to one, as one of a
        single state.
        """
        given = [self.values[name] for name in law.names]
        n = self.turns.size
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", RuntimeWarning)
            of = exponents(law, *given, *state, LOOKS * self.span, count=n)
        total, error = float(of["lyapunov_sum"]), float(of["lyapunov_error"].sum())
        if not np.isfinite(total):
            return 0.0
        if total > SURE * error + 1.0 / (LOOKS * self.span) or n == 1 and total > -error:
            return SETTLED
        return -total * 2.0 / n * self.span

    def distance(self, one: Attractor, states: Array) -> Array:
        """Distances of states from a periodic attractor."""
        return np.asarray(self.apart(states[:, None], one.points).min(axis=1))

    def _is_caught(self, state: Array) -> bool:
        """Whether a state is so near a periodic attractor that it comes to it."""
        return any(
            self.distance(one, state[None])[0] < self._radius(number)
            for number, one in enumerate(self.orbits)
        )

    def _is_known(self, state: Array) -> bool:
        return any(
            self.distance(one, state[None])[0] < 1e-3 * (1.0 - self.contraction(one))
            for one in self.orbits
        )

    def contraction(self, one: Attractor) -> float:
        """How much nearer states around a periodic attractor come in a round."""
        return one.multiplier

    def _take(self, orbit: Array) -> bool:
        """Keep the attracting periodic orbit near which a motion is; whether there is one."""
        if not self.repeats:
            return False
        half = len(orbit) // 2
        for q in range(1, LONGEST + 1):
            if self.apart(orbit[half:], orbit[half - q : len(orbit) - q]).max() < NEAR:
                return self._refined(orbit[-1], q)
        return False

    def _refined(self, state: Array, q: int) -> bool:
        """Find the orbit of q legs near a state by Newton's method; whether it attracts."""
        how = q * self.leg, self.units, self.reach, self.stiff
        found = returned(self.law, self.values, state, *how)
        if found is None:
            return False
        state, slope, turned = found
        points = self.run(state[None], q, 0).states[0]
        for part in (part for part in range(1, q) if q % part == 0):
            if self.apart(points[part], state) < SAME:
                return self._refined(state, part)
        multiplier = float(np.abs(np.linalg.eigvals(slope)).max())
        if not (multiplier < 1.0 - 1e-9 or self._is_rest(points, slope)):
            return False
        if not any(self.apart(o.points, state).min() < SAME for o in self.orbits):
            still = common_period(self.law, self.values) is None and q == 1
            kind = AttractorKind.EQUILIBRIUM if still else AttractorKind.CYCLE
            exponent = float(np.log(multiplier)) / (q * self.span) if multiplier > 0.0 else -np.inf
            turns = float(turned[0]) / self.period / q if self.period else 0.0
            self.found.append(Attractor(kind, points, turns, exponent, multiplier=multiplier))
            self.found.sort(key=lambda one: not one.is_periodic)
        return True

    def _is_rest(self, points: Array, slope: Array) -> bool:
        """Whether a motion at rest is a center that quadratic damping alone makes attract."""
        if isinstance(self.law, Equations):
            return False
        turns = float(np.trace(slope) ** 2) < 4.0 * float(np.linalg.det(slope))
        damps = float(np.min(self.values["quadratic"])) > 0.0 == float(self.values["damping"])
        still = bool(np.abs(points[:, 1]).max() < SAME * self.units[1])
        return turns and damps and still and common_period(self.law, self.values) is None

    def _take_other(self, state: Array) -> None:
        """Keep an attractor that is no periodic orbit, unless the state lies on one of them."""
        found = self.run(state[None], FILLING, 0).states[0]
        if not np.isfinite(found).all() or self._is_known(found[-1]):
            return
        if self._is_on_other(found) or self._takes_long_to_repeat(found):
            return
        one = self._classified(found)
        if one is not None and not self._is_on_other(one.points):
            self.found.append(one)

    def _is_on_other(self, found: Array) -> bool:
        """Whether a motion runs along an attractor that is known and no periodic orbit."""
        for other in self.others:
            near = [self.apart(other.points, one).min() < ALONG for one in found[-TOLD:]]
            if np.mean(near) > 0.9 or self._is_among(other.points, found):
                return True
        return False

    def _is_among(self, run: Array, found: Array) -> bool:
        """Whether states are as near to those of a run as these are to each other.

        Those that fill much of space are further from each other than `ALONG`.
        """
        chosen = np.linspace(0, len(run) - 1, COMPARED).astype(int)
        later = np.linspace(len(found) // 2, len(found) - 1, COMPARED).astype(int)
        away = [self.apart(run, run[i]) for i in chosen]
        for i, off in zip(chosen, away, strict=True):
            off[max(i - LONGEST, 0) : i + LONGEST + 1] = np.inf  # it is there by its own way
        reach = np.quantile([off.min() for off in away], 0.95)
        return bool(np.mean([self.apart(run, found[i]).min() <= reach for i in later]) > AMONG)

    def _takes_long_to_repeat(self, found: Array) -> bool:
        """Keep an attracting orbit of a period longer than is looked for at first."""
        if not self.repeats:
            return False
        off = self.apart(found[-1 - MOST_LEGS : -LONGEST - 1], found[-1])[::-1]
        for i in np.flatnonzero(off < NEAR)[:3]:
            if self._refined(found[-1], LONGEST + 1 + int(i)):
                return True
        return False

    def _classified(self, found: Array) -> Attractor | None:
        """What a motion that does not repeat itself runs along; None where it is under way."""
        exponent, error = self._exponent(found[0])
        turns = self._turns(found)
        least = 1.0 / (FILLING * self.span)
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
                turns = self._turns(found)
        self.open[IN_DOUBT] += 1
        return Attractor(AttractorKind.UNKNOWN, found, turns, exponent, error)

    def _turns(self, found: Array) -> float:
        """Turns of the first state in a leg."""
        turned = float(found[-1, 0] - found[0, 0]) / self.period if self.period else 0.0
        return turned / (len(found) - 1)

    def _exponent(self, state: Array) -> tuple[float, float]:
        """Largest Lyapunov exponent of a motion, and its error."""
        parameters = [self.values[name] for name in self.law.names]
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", RuntimeWarning)  # NaN is told as doubt
            time = FILLING * self.span
            count = 1 if isinstance(self.law, Equations) else 2
            of = exponents(self.law, *parameters, *state, time, count=count)
            value, error = of["lyapunov_exponent"], of["lyapunov_error"]
        return float(value[..., 0]), float(error[..., 0])

    def _is_closed(self, found: Array, turns: float) -> bool:
        """Whether states fill a closed curve, on which they go round a circle or their middle.

        Of more than two states by the two directions in which they spread most.
        """
        if abs(turns) > 0.5 / FILLING:
            angle = 2.0 * np.pi * found[:, 0] / self.period
        elif found.shape[1] == 1:
            return False
        else:
            off = (found - found.mean(axis=0)) / self.units
            if off.shape[1] > 2:
                off = off @ np.linalg.svd(off, full_matrices=False)[2][:2].T
            angle = np.arctan2(off[:, 1], off[:, 0])
        angle = np.sort(np.mod(angle, 2.0 * np.pi))
        gaps = np.diff(angle, append=angle[0] + 2.0 * np.pi)
        return bool(gaps.max() < GAP)

    def targets(self) -> Targets:
        """Where motions have come to an attractor."""
        rows = []
        for number, one in enumerate(self.orbits):
            radius = self._radius(number)
            rows += [[*point, radius, number] for point in self._spread(one, radius)]
        points = np.array(rows).reshape(-1, self.turns.size + 2)
        to = self.nowhere()._replace(points=points)
        if not self.others:
            return to
        runs = [one.points for one in self.others]
        filled = cells_of_orbits(runs, self.turns, len(self.orbits))
        return to._replace(**filled, visits=VISITS)

    def _spread(self, one: Attractor, radius: float) -> Array:
        """Points of a periodic attractor around which motions are caught."""
        return one.points

    def _radius(self, number: int) -> float:
        """Distance up to which states around an attractor were seen to come to it."""
        one = self.orbits[number]
        # The points of an orbit may begin anew when attractors are put in order.
        key = id(one), one.points[0].tobytes(), len(self.found)
        if key not in self.radii:
            self.radii[key] = self._seen_radius(one)
        return self.radii[key]

    def _seen_radius(self, one: Attractor) -> float:
        rest = [other.points for other in self.found if other is not one]
        far = min([float(self.apart(one.points[:, None], o).min()) for o in rest] + [1.0])
        radius = min(0.4 * far, CAUGHT)
        legs = self._legs_to_settle(one)
        if legs <= LONGEST_RING:
            tries = [(0.5**i * radius, legs) for i in range(40)]
        else:
            tries = [(radius, LONGEST_RING // part) for part in (100, 10, 1)]
        for radius, legs in tries:
            # A few tell soon of a ring that is not caught.
            if all(
                self._is_caught_from(one, radius * self._ring[part] * self.units, radius, legs)
                for part in PARTS_OF_RING
            ):
                return float(radius)
        return 0.0

    def _legs_to_settle(self, one: Attractor) -> int:
        """Legs after which states around an attractor have come much nearer."""
        rate = -np.log(np.clip(self.contraction(one), 1e-3, 1.0 - 1e-6))
        return len(one.points) * (2 + int(-np.log(1e-3) / rate))

    @property
    def _ring(self) -> Array:
        """States all around a point, at the distance one: a circle, or evenly by chance."""
        n = self.turns.size
        if n <= 2:
            angles = 2.0 * np.pi * np.arange(RING) / RING
            return np.stack([np.cos(angles), np.sin(angles)], axis=-1)[:, :n]
        ring = np.random.default_rng(0).normal(size=(RING, n))
        ring[: min(2 * n, RING)] = np.vstack([np.eye(n), -np.eye(n)])[:RING]
        return np.asarray(ring / np.linalg.norm(ring, axis=1, keepdims=True))

    def _is_caught_from(self, one: Attractor, around: Array, radius: float, legs: int) -> bool:
        """Whether motions from states around an orbit come to half the distance."""
        points = self._spread(one, 4.0 * radius)
        starts = (points[:, None] + around).reshape(-1, self.turns.size)
        ends = self.run(starts, 1, legs).states[:, 0]
        return bool((self.distance(one, ends) < 0.5 * radius).all())
