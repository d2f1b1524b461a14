"""Equilibria and cycles of a flow next to a state, by Newton's method: attracting or not."""

from __future__ import annotations

import warnings
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from phasekit.arrays import Array, Complex
from phasekit.laws.equations import Equations
from phasekit.motion import flows
from phasekit.motion.equation_rates import rates_on, slopes_at
from phasekit.motion.flow import motions
from phasekit.motion.method import single, turns_of, whole_turns
from phasekit.motion.variational import carried, is_rounding

#: Distance from a state at which a motion comes back to it, in parts of that to which it went.
BACK = 0.05
#: Greatest distance of a cycle from a state next to it.
NEXT = 0.1
#: Points at which a return is looked for.
MOST = 100_000
#: Steps of Newton's method for a cycle, and for an equilibrium, which may be a multiple one.
STEPS, MANY = 12, 100
#: Last step, in units of the states and the period.
LAST = 1e-11
#: Least part of the time of a cycle that may be its period, and distance that is none.
PARTS, SAME = 12, 1e-6
#: Multiplier of a plane cycle that comes from the divergence, and points along it for that.
SMALL, FINE = 1e-6, 1024


class Rest(NamedTuple):
    """An equilibrium."""

    x: Array
    eigenvalues: Complex
    flat: float
    """Size of an eigenvalue that may be none."""


class Cycle(NamedTuple):
    """A cycle."""

    x: Array
    period: float
    multipliers: Complex
    """Without the one along it."""


@dataclass(frozen=True)
class Neighbourhood:
    """Motions of one flow that does not vary, next to a state, in units of its states."""

    law: Equations
    values: Mapping[str, Any]
    units: Array
    rtol: float = 1e-10
    atol: float = 1e-12

    @property
    def single(self) -> dict[str, float]:
        """The parameters."""
        return single(self.values)

    def rates(self, x: Array) -> Array:
        """Rates at a state."""
        return np.asarray(rates_on(self.law, self.single, x[None])[0])

    def off(self, x: Array, y: Array) -> Array:
        """Differences of states, those of angles less than half a turn."""
        return np.asarray(x - y - whole_turns(x - y, turns_of(self.law)))

    def apart(self, x: Array, y: Array) -> Array:
        """Distances of states."""
        return np.asarray(np.linalg.norm(self.off(x, y) / self.units, axis=-1))

    def along(self, state: Array, times: Array) -> Array:
        """States of a motion at times, NaN where it does not come to them."""
        cell = self.law, self.values, state[None], times[None]
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", RuntimeWarning)
            if self.law.kind == "python":
                how = {"rtol": self.rtol, "atol": self.atol}
                found, _ = flows.one_by_one(*cell, None, how)
            else:
                found = motions(*cell, self.rtol, self.atol).states
        return np.asarray(found[0])

    def rest(self, state: Array, reach: float) -> Rest | None:
        """The equilibrium next to a state, within a distance; None where there is none."""
        x, one = state, self.single
        for _ in range(MANY):
            f, slope = self.rates(x), slopes_at(self.law, one, x)
            if not (np.isfinite(f).all() and np.isfinite(slope).all()):
                return None
            matrix = slope * self.units / self.units[:, None]
            step = np.linalg.lstsq(matrix, f / self.units, rcond=None)[0]
            x = x - step * self.units
            if self.apart(x, state) > reach:
                return None
            if np.linalg.norm(step) < 1e-14:
                break
        slope = slopes_at(self.law, one, x)
        if not np.isfinite(slope).all():  # which has no norm
            return None
        force = np.linalg.norm(self.rates(x) / self.units)
        size = float(np.linalg.norm(slope * self.units / self.units[:, None], 2))
        if not force <= 1e-9 * max(size, np.finfo(float).tiny):
            return None
        return Rest(x, np.linalg.eigvals(slope).astype(complex), 1e-9 * size)

    def returns(self, state: Array, span: float, fine: float) -> Array:
        """Times at which a motion comes back, through the plane across its way, close by.

        Up to a time; between looks at it, it hardly turns.
        """
        way = self.rates(state) / self.units**2
        count = int(min(np.ceil(span / fine), MOST))
        times = np.arange(count + 1, dtype=float) * fine
        x = self.along(state, times)
        if not np.isfinite(x).all():
            return np.zeros(0)
        ahead, away = self.off(x, state) @ way, self.apart(x, state)
        i = np.flatnonzero((ahead[:-1] < 0.0) & (ahead[1:] >= 0.0))
        part = ahead[i] / (ahead[i] - ahead[i + 1])
        between = x[i] + part[:, None] * (x[i + 1] - x[i])
        # Between two points a way bends less than their distance.
        room = BACK * np.maximum.accumulate(away)[i] + 0.25 * self.apart(x[i + 1], x[i]) ** 2
        close = self.apart(between, state) < room
        return np.asarray((times[i] + part * (times[i + 1] - times[i]))[close])

    def cycle(
        self, state: Array, time: float, reach: float = NEXT, most: float = np.inf
    ) -> Cycle | None:
        """The cycle near a state that takes about a time; None where Newton's method finds none.

        None also where motions next to the state part by more than so many times.
        """
        x, period, n, before = state, time, len(state), np.inf
        way = self.rates(state) / self.units
        way /= np.linalg.norm(way)
        for _ in range(STEPS):
            image, slope = carried(self.law, self.values, x, period)
            if not (np.isfinite(image).all() and np.isfinite(slope).all()):
                return None
            if before == np.inf > most and np.abs(np.linalg.eigvals(slope)).max() > most:
                return None
            matrix = np.zeros((n + 1, n + 1))
            matrix[:n, :n] = slope * self.units / self.units[:, None] - np.eye(n)
            matrix[:n, n] = self.rates(image) / self.units * period
            matrix[n, :n] = way
            off = np.append(-self.off(image, x) / self.units, 0.0)
            try:
                step = np.linalg.solve(matrix, off)
            except np.linalg.LinAlgError:
                return None
            x, period = x + step[:n] * self.units, period * (1.0 + step[n])
            if not (np.isfinite(step).all() and 0.5 * time < period < 2.0 * time):
                return None
            if self.apart(x, state) > reach:
                return None
            size = float(np.abs(step).max())
            if size < LAST or is_rounding(size, before):
                return self._least(x, period, slope)
            before = size
        return None

    def _least(self, x: Array, period: float, slope: Array) -> Cycle | None:
        """A cycle that was found, run through once."""
        parts = period / np.arange(PARTS, 1, -1)
        back = np.flatnonzero(self.apart(self.along(x, parts), x) < SAME)
        if back.size:
            period = float(parts[back[0]])
            slope = carried(self.law, self.values, x, period)[1]
        if not np.linalg.norm(self.rates(x) / self.units) * period > SAME:
            return None  # a rest
        found = np.linalg.eigvals(slope).astype(complex)
        others = np.delete(found, np.argmin(np.abs(found - 1.0)))
        if others.size == 1 and abs(others[0]) < SMALL:  # below what the derivative resolves
            others = np.array([self._from_divergence(x, period)], complex)
        return Cycle(x, period, others)

    def _from_divergence(self, x: Array, period: float) -> float:
        """The multiplier of a cycle on a plane, from the mean of the divergence along it."""
        states, one = self.along(x, period * np.arange(FINE) / FINE), self.single
        divergence = [np.trace(slopes_at(self.law, one, state)) for state in states]
        return float(np.exp(period * np.mean(divergence)))
