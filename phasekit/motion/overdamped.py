"""Attractors of driven systems that damping rules: by the order of their slow motions.

Where damping is much faster than all else, every motion comes to a slow one, whose speed is a
function of time and place. Slow motions do not pass each other, so that the coordinate
after a period grows with that before: between two orbits that repel lies one that attracts. They
are found by the slow law, and then solved for as Fourier series of the full one: no step is as
short as the time in which damping acts.
"""

from __future__ import annotations

import functools
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from phasekit.arrays import Array
from phasekit.errors import AttractorKind
from phasekit.laws.equations import Equations
from phasekit.laws.formulas import symbols_of
from phasekit.laws.perturbed import PerturbedConservative, forcing_names, modulation_names
from phasekit.motion.attractor import LONGEST, Attractor, PlaneSearch
from phasekit.motion.equation_rates import code_of, rates_along
from phasekit.motion.method import turns_of
from phasekit.motion.strobe import Targets, strobe

Waves = npt.NDArray[np.complexfloating[Any, Any]]

#: Damping times in a leg from which on damping rules, if its square is so many times the slopes.
FAST, STRONG = 300.0, 100.0
#: How often as great as all frequencies damping is then.
QUICK = 10.0
#: Times in a period at which a force is looked at, the part of its greatest wave that is a trace,
#: and the part of itself that is rounding.
TIMES, TRACE, GRAIN = (512, 8192), 1e-6, 1e-13
#: Times at which slopes are looked at, at least, and in the shortest period.
LEAST, OFTEN = 64, 4
#: Share that spreads times and places without a pattern, of which no wave is a multiple.
GOLDEN = 0.6180339887498949
#: Damping times after which a motion is a slow one.
SPENT = 40.0
#: Points at which slow motions start, and their steps in the shortest period of the drive.
STARTS, STEPS, MOST_STEPS = 400, 64, 20_000
#: Steps in the time in which slow motions come together; such times in a step that is stable and
#: keeps their order.
STEEP, STABLE = 2.0, 2.0
#: How often the range of a line is made wider, and by which part.
WIDER, ROOM = 12, 0.5
#: Coefficients of an orbit at first and at most, steps of Newton's method, and its last change.
FEW, MANY, TRIES, ENOUGH = 65, 513, 60, 1e-13
#: Part of the greatest force that may be missing where Newton's method converges slowly.
MISSING = 1e-14
#: Part of the coefficients that are next to nothing at the end, and how small these are.
TAIL, NOTHING = 4, 1e-9
#: Parts of the size, and of the damping, by which a series may be wrong.
NEAR, NEAR_RATE = 1e-8, 1e-6
#: Parts of the size within which borders decide; displacement that is rounding.
BORDER, ROUNDING = 1e-6, 1e-14
#: States that are kept of a motion which does not repeat itself.
KEPT = 4000
#: A rate that counts as without bound.
BOUNDLESS = 1e300
#: Why it is not seen where a motion ends.
AWAY = "creep out of the range in which attractors were looked for, or next to a border"
#: The same, where too much happens in a period.
TOO_FAST = "are shaken, or come together, too fast in a period for slow motions to be followed"
#: Why an orbit is not seen that lies between others.
ROUGH = f"lie near a periodic orbit that no Fourier series of {MANY} terms gave"


class Orbit(NamedTuple):
    """A periodic orbit at equal times, q legs in all."""

    x: Array
    v: Array
    x_spent: float
    """Where it is when other motions have become slow."""
    exponent: float


Law = PerturbedConservative | Equations


class InPlane(NamedTuple):
    """A law of a coordinate and its rate, in this order."""

    law: Law
    at: int = 0
    """Place of the coordinate among the states of the law as it was stated."""
    factor: float = 1.0
    """Rate of the coordinate over the other state."""

    def states(self, given: Array) -> Array:
        """Coordinates and their rates, of states as stated."""
        return np.stack([given[:, self.at], self.factor * given[:, 1 - self.at]], axis=-1)

    def stated(self, x: Array, v: Array) -> Array:
        """States as stated, of coordinates and their rates."""
        parts = [x, v / self.factor]
        return np.stack(parts[::-1] if self.at else parts, axis=-1)


def in_plane(law: Law, values: Mapping[str, Array]) -> InPlane | None:
    """The law of a coordinate and its rate, wherever these stand; None of any other.

    The other state may be a constant times the rate, as a momentum is.
    """
    if not isinstance(law, Equations):
        return InPlane(law)
    if law.kind != "symbolic" or len(law.states) != 2:
        return None
    symbols = symbols_of([*law.states, *law.names, *([law.time] if law.time else [])])
    varying = {symbols[name] for name in symbols.keys() - set(law.names)}
    for at in (0, 1):
        x, v = law.states[at], law.states[1 - at]
        rate, change, own = law.f[at], law.f[1 - at], symbols[v]
        factor = rate.diff(own)
        if v in law.periods or factor.free_symbols & varying or (rate - factor * own).expand() != 0:
            continue
        size = float(factor.subs({symbols[name]: float(values[name]) for name in law.names}))
        if size == 0.0 or not np.isfinite(size):
            continue
        f = own, change if factor == 1 else factor * change.subs(own, own / factor)
        return InPlane(replace(law, states=(x, v), f=f), at, size)
    return None


def damping_of(law: Law, values: Mapping[str, Array]) -> float:
    """Rate at which linear damping acts; NaN where damping is not linear."""
    if not isinstance(law, Equations):
        linear = float(values["quadratic"]) == 0.0 and law.prescribed is None
        return float(values["damping"]) if linear else np.nan
    x, v = symbols_of(law.states).values()
    varying = {x, v, *symbols_of([law.time] if law.time else []).values()}
    slope = law.f[1].diff(v)
    if slope.free_symbols & varying:
        return np.nan
    symbols = symbols_of(law.names)
    return -float(slope.subs({symbols[name]: float(values[name]) for name in law.names}))


def fastest(law: Law, values: Mapping[str, Array], leg: float, low: float, high: float) -> float:
    """Greatest frequency of all that varies between two coordinates."""
    if isinstance(law, Equations):
        return _fastest_of_equations(law, values, leg, low, high)
    names = [forcing_names(i)[1] for i in range(law.harmonics)]
    names += [modulation_names(name)[1] for name in law.modulated]
    return max([float(values[name]) for name in names] + [2.0 * np.pi / leg])


def is_overdamped(law: Law, values: Mapping[str, Array], leg: float, states: Array) -> bool:
    """Whether damping is linear and rules the motions from states."""
    plane = in_plane(law, values)
    if plane is None:
        return False
    law, states = plane.law, plane.states(states)
    damping = damping_of(law, values)
    if not damping * leg >= FAST:
        return False
    low, high = _reach(law, states, damping)
    most = fastest(law, values, leg, low, high)
    return damping >= QUICK * most and _rules(law, values, leg, low, high, most)


def _fastest_of_equations(
    law: Equations, values: Mapping[str, Array], leg: float, low: float, high: float
) -> float:
    """The frequency of the highest harmonic of the force that is more than a trace.

    Infinite where it is not seen: waves between two times of a grid look like slow ones, so that
    the series through a grid must also hold at other times.
    """
    places = low + (high - low) * np.mod(GOLDEN * np.arange(1, 8), 1.0)
    for count in TIMES:
        even, other = np.arange(count) / count, np.mod(GOLDEN * np.arange(1, 65), 1.0)
        x, t = np.meshgrid(places, leg * np.append(even, other), indexing="ij")
        force = partials(law, values, t.ravel(), x.ravel(), np.zeros(x.size))[0].reshape(x.shape)
        if not np.isfinite(force).all():
            return np.inf
        parts = np.fft.rfft(force[:, :count], axis=1) / count
        parts[:, 1:] *= 2.0
        size = np.abs(parts).max(axis=0)
        least = max(TRACE * size[1:].max(), GRAIN * np.abs(force).max())
        waves = np.flatnonzero(size[1:] > least) + 1
        turns = np.exp(2j * np.pi * np.outer(np.arange(len(size)), other))
        missing = np.abs(force[:, count:] - (parts @ turns).real).max()
        highest = int(waves.max(initial=1))
        if highest < count // 2 * (1 - 1 / TAIL) and missing <= least * np.sqrt(count):
            return 2.0 * np.pi / leg * highest
    return np.inf


def _reach(law: Law, states: Array, damping: float) -> tuple[float, float]:
    """The turn; or of a line the coordinates to which motions slide before they are slow."""
    turn = float(turns_of(law)[0])
    if turn:
        return -0.5 * turn, 0.5 * turn
    ends = np.concatenate([states[:, 0], states[:, 0] + states[:, 1] / damping])
    return float(ends.min()), float(ends.max())


def _slopes(
    law: Law, values: Mapping[str, Array], leg: float, low: float, high: float, most: float
) -> tuple[Array, Array]:
    """Slopes and dampings between two coordinates, at times that share no pattern."""
    count = int(max(LEAST, OFTEN * min(most * leg / (2.0 * np.pi), TIMES[-1] / 2)))
    times = leg * np.mod(GOLDEN * np.arange(count), 1.0)
    x, t = np.meshgrid(np.linspace(low, high, 65), times)
    return partials(law, values, t.ravel(), x.ravel(), np.zeros(x.size))[1:]


def _rules(
    law: Law, values: Mapping[str, Array], leg: float, low: float, high: float, most: float
) -> bool:
    """Whether damping is much faster than all else between two coordinates."""
    slope, damping = _slopes(law, values, leg, low, high, most)
    rules = (-damping > 0.0) & (-damping * leg >= FAST) & (damping**2 >= STRONG * np.abs(slope))
    return bool(rules.all())


def _relaxation(
    law: Law, values: Mapping[str, Array], leg: float, low: float, high: float, most: float
) -> float:
    """Greatest rate of slow motions towards each other, or apart."""
    slope, damping = _slopes(law, values, leg, low, high, most)
    return float(np.abs(slope / damping).max())


def partials(
    law: Law, values: Mapping[str, Array], t: Array, x: Array, v: Array
) -> tuple[Array, Array, Array]:
    """Accelerations, and their derivatives by the coordinate and the rate."""
    states = np.zeros((len(x), 6))
    states[:, 0], states[:, 1], states[:, 2], states[:, 5] = x, v, 1.0, 1.0
    out = rates_along(law, values, t, states, 2)
    return out[:, 1], out[:, 3], out[:, 5]


def _derivatives(number: int, span: float) -> tuple[Waves, Array, Array]:
    """Waves of a series, and its first two derivatives at equal times as matrices."""
    waves = np.fft.fftfreq(number, 1.0 / number) * 2j * np.pi / span
    basis = np.fft.fft(np.eye(number), axis=0)
    one, two = (np.fft.ifft(waves[:, None] ** k * basis, axis=0).real for k in (1, 2))
    return waves, one, two


@dataclass
class OverdampedSearch(PlaneSearch):
    """A search for the attractors of one driven system that damping rules."""

    spans: list[tuple[float, float, Attractor]] = field(default_factory=list)
    """Where motions are that come to an attractor, once they are slow."""
    ends: tuple[float, float] = (0.0, 0.0)
    """Of the range in which they are."""
    fastest: float = 0.0
    """Greatest frequency of all that varies."""
    relaxation: float = 0.0
    """Greatest rate of slow motions towards each other."""

    @functools.cached_property
    def plane(self) -> InPlane:
        """The law of the coordinate and its rate."""
        found = in_plane(self.law, self.values)
        assert found is not None
        return found

    @property
    def period(self) -> float:
        """Of the coordinate, 0 on a line."""
        return float(self.turns[self.plane.at])

    @property
    def size(self) -> float:
        """Of the box, along the coordinate."""
        return float(self.units[self.plane.at])

    @functools.cached_property
    def damping(self) -> float:
        """Rate at which it acts."""
        return damping_of(self.plane.law, self.values)

    @property
    def step(self) -> float:
        """Time after which motions are slow."""
        return SPENT / self.damping

    def rounds(self, legs: int) -> list[tuple[int, float]]:
        """Once motions are slow it is known where they go."""
        return [(1, self.step)]

    def look(self, states: Array) -> None:
        """Find the attractors to which motions from states come."""
        reach = _reach(self.plane.law, self.plane.states(states), self.damping)
        self.fastest = fastest(self.plane.law, self.values, self.leg, *reach)
        if self.fastest * self.leg / (2.0 * np.pi) > MANY // 2 * (1.0 - 1.0 / TAIL):
            self.open[TOO_FAST] += len(states)
            return
        self.ends = low, high = self._range(*reach)
        how = self.plane.law, self.values, self.leg, low, high, self.fastest
        self.relaxation = _relaxation(*how)
        if not self.relaxation * self.leg <= STABLE * MOST_STEPS:
            self.open[TOO_FAST] += len(states)
            return
        x = np.linspace(low, high, STARTS + 1)
        if self.period:
            x += 0.2360679775 * (x[1] - x[0])
        else:
            x[1:-1] += 0.2360679775 * (x[1] - x[0])
        ends = self._slow(x)
        for q in range(1, LONGEST + 1):
            if self._take(q, x, self._again(q, x, ends)):
                break
            if not self.period:
                break
        else:
            self._take_rotation(x, ends)
        self._keep_reached(states)

    def _range(self, low: float, high: float) -> tuple[float, float]:
        """The turn; or of a line what motions do not leave, if there is such a range."""
        if self.period:
            return low, high
        wide, how = ROOM * max(high - low, self.size), (self.plane.law, self.values, self.leg)
        while not _rules(*how, low - wide, high + wide, self.fastest) and wide > BORDER * self.size:
            wide *= 0.5
        low, high = low - wide, high + wide
        for _ in range(WIDER):
            ends = self._slow(np.array([low, high]))
            if not (ends[0] < low or ends[1] > high):
                break
            new = low - wide if ends[0] < low else low, high + wide if ends[1] > high else high
            if not _rules(*how, *new, self.fastest):
                break
            (low, high), wide = new, 2.0 * wide
        return low, high

    def _code(self, count: int) -> tuple[int, Array, int]:
        """Machine code of accelerations, parameters in so many cells, and the place of signs."""
        code, own = code_of(self.plane.law, self.values, count, 2)
        return code.address, own, code.kink

    @property
    def _slowness(self) -> tuple[float, float]:
        """The time over which the change of slow rates is taken, and the damping."""
        return 1e-3 / self.fastest, self.damping

    def _speed(self, t: float, x: Array) -> Array:
        """Rate of slow motions."""
        from phasekit.motion.kernels.slow import speed

        out = np.empty(x.size)
        speed(*self._code(x.size), t, x, *self._slowness, out)
        return out

    def _slow(self, x: Array) -> Array:
        """Where slow motions are after a leg."""
        return np.asarray(self._path(x, 1)[-1])

    def _path(self, x: Array, legs: int) -> Array:
        """Slow motions at equal times, of shape (times, motions)."""
        from phasekit.motion.kernels.slow import slow_path

        per = max(self.fastest / (2.0 * np.pi) * STEPS, self.relaxation * STEEP)
        count = legs * int(min(self.leg * per, MOST_STEPS))
        path = np.empty((count + 1, x.size))
        path[0] = x
        slow_path(*self._code(x.size), legs * self.leg / count, *self._slowness, path)
        return path

    def _map(self, x: Array, ends: Array) -> Callable[[Any], Any]:
        """Where slow motions on a circle are after a leg, by those from some coordinates."""
        from scipy.interpolate import CubicSpline

        shift = ends - x
        shift[-1] = shift[0]
        curve = CubicSpline(x, shift, bc_type="periodic")
        return lambda at: at + curve(x[0] + np.mod(at - x[0], self.period))

    def _again(self, q: int, x: Array, ends: Array) -> Array:
        """Where slow motions are after q legs."""
        now = ends
        for _ in range(q - 1):
            now = self._map(x, ends)(now)
        return now

    def _take(self, q: int, x: Array, ends: Array) -> bool:
        """Keep the orbits that close after q legs; whether there are any."""
        shift = ends - x
        turn = self.period
        turns = int(np.ceil(shift.min() / turn)) if turn else 0
        off = shift - turns * turn
        kept = np.isfinite(off) & (np.abs(off) > ROUNDING * (self.size + np.abs(x)))
        x, off = x[kept], off[kept]
        change = np.flatnonzero(np.sign(off[1:]) != np.sign(off[:-1]))
        rows = []
        for i in change:
            at = x[i] - off[i] * (x[i + 1] - x[i]) / (off[i + 1] - off[i])
            orbit = self._solved(float(at), q, turns * turn)
            if orbit is None:
                self.open[ROUGH] += 1
            else:
                rows.append((orbit, bool(off[i] > 0.0)))
        if not rows:
            return len(change) > 0
        self._divide(rows, q, turns)
        return True

    def _divide(self, rows: list[tuple[Orbit, bool]], q: int, turns: int) -> None:
        """Divide the coordinates among the orbits that attract, at those that repel."""
        kept: list[Attractor] = []
        rows.sort(key=lambda row: row[0].x_spent)
        for i, (orbit, attracts) in enumerate(rows):
            if not attracts:
                continue
            if self.period:
                left, right = rows[i - 1], rows[(i + 1) % len(rows)]
                low = left[0].x_spent - (self.period if i == 0 else 0.0)
                high = right[0].x_spent + (self.period if i == len(rows) - 1 else 0.0)
            else:
                low = rows[i - 1][0].x_spent if i else self.ends[0]
                high = rows[i + 1][0].x_spent if i + 1 < len(rows) else self.ends[1]
            one = self._attractor(orbit, q, turns)
            same = [k for k in kept if self.apart(k.points, one.points[0]).min() < BORDER]
            if not same:
                kept.append(one)
            self.spans.append((low, high, same[0] if same else one))

    def _attractor(self, orbit: Orbit, q: int, turns: int) -> Attractor:
        part = len(orbit.x) // q
        points = self.plane.stated(orbit.x[::part][:q], orbit.v[::part][:q])
        multiplier = float(np.exp(orbit.exponent * q * self.leg))
        turned = turns / q if self.period else 0.0
        return Attractor(AttractorKind.CYCLE, points, turned, orbit.exponent, 0.0, multiplier)

    def _solved(self, at: float, q: int, way: float) -> Orbit | None:
        """The periodic orbit that begins near a coordinate, by a Fourier series."""
        path = self._path(np.array([at]), q)[:, 0]
        span = q * self.leg
        count = FEW
        while count <= MANY:
            number = count * q
            t = span * np.arange(number) / number
            x = np.interp(t, np.linspace(0.0, span, len(path)), path) - way * t / span
            found = self._newton(t, x, span, way / span)
            if found is not None:
                return found
            count = 2 * count - 1
        return None

    def _newton(self, t: Array, x: Array, span: float, drift: float) -> Orbit | None:
        """A Fourier series of the full law, and the exponent; None where it is too short."""
        number = len(t)
        waves, one, two = _derivatives(number, span)
        # What moves may be far smaller than where it is, and is kept by itself.
        middle = float(x.mean())
        x = x - middle
        for _ in range(TRIES):
            v = one @ x + drift
            now = middle + x + drift * t, v, two @ x
            missing, step, slope, damping = self._missing(t, *now, one, two)
            if not np.isfinite(step).all():
                return None
            middle += float(step.mean())
            x = x + (step - step.mean())
            if np.abs(step).max() < ENOUGH * (self.size + abs(middle) + np.abs(x).max()):
                break
        else:
            # So it does at a degenerate rest, which the sign of the force shows to attract.
            if not np.abs(missing).max() < MISSING * np.abs(damping * v).max():
                return None
        parts = np.abs(np.fft.fft(x))[1 : (number + 1) // 2] / number
        tail = parts[-(len(parts) // TAIL) :].max()
        if tail > max(NOTHING * parts.max(), ENOUGH * self.size):
            return None
        if not self._holds(middle, np.fft.fft(x) / number, waves, span, drift):
            return None
        # The growth w of what lies beside it: w' = slope + damping w - w^2.
        w: Array = np.zeros(number)
        matrix = one - np.diag(damping)
        for _ in range(20):
            w = np.asarray(np.linalg.solve(matrix, slope - w**2), float)
        there = middle + float(np.real(np.fft.fft(x) @ np.exp(waves * self.step)) / number)
        v = one @ x + drift
        return Orbit(middle + x + drift * t, v, there + drift * self.step, float(w.mean()))

    def _missing(
        self, t: Array, x: Array, v: Array, change: Array, one: Array, two: Array
    ) -> tuple[Array, Array, Array, Array]:
        """What a motion lacks to obey the law, Newton's step, and slopes by coordinate and rate."""
        force, slope, damping = partials(self.plane.law, self.values, t, x, v)
        missing = change - force
        try:
            matrix = two - np.diag(slope) - damping[:, None] * one
            step = np.asarray(np.linalg.solve(matrix, -missing), float)
        except np.linalg.LinAlgError:
            step = np.full(len(t), np.nan)
        return missing, step, slope, damping

    def _holds(self, middle: float, parts: Waves, waves: Waves, span: float, drift: float) -> bool:
        """Whether a series obeys the law at other times than those it was found by.

        Waves of the force between the times look like slow ones. At times at another distance,
        that begin elsewhere, they look like others, and Newton's method moves the orbit.
        """
        number = (len(parts) | 1) + 4
        t = span * (np.arange(number) + GOLDEN) / number
        turns = np.exp(np.outer(t, waves))
        x, v, change = ((turns @ (waves**k * parts)).real for k in range(3))
        x, v = middle + x + drift * t, v + drift
        _, one, two = _derivatives(number, span)
        missing, step, slope, damping = self._missing(t, x, v, change, one, two)
        if np.abs(missing).max() < 10.0 * MISSING * np.abs(damping * v).max():
            return True
        rounding = ENOUGH * np.abs(slope).max() * (self.size + np.abs(x).max())
        lacks = NEAR_RATE * np.abs(damping * v).max() + rounding
        return bool(np.abs(step).max() < NEAR * self.size and np.abs(missing).max() <= lacks)

    def _take_rotation(self, x: Array, ends: Array) -> None:
        """Keep the rotation of which no orbit closes soon."""
        if not (np.abs(ends - x) > ROUNDING * self.size).any():
            self.open[AWAY] += 1
            return
        image = self._map(x, ends)
        places, now = np.empty(KEPT), x[0]
        for i in range(KEPT):
            places[i] = now
            now = image(now)
        states = self.plane.stated(places, self._speed(0.0, places))
        turned = np.abs(places - places[0]) / self.period
        # After whole turns, that the place in a turn does not count.
        whole = float(np.floor(turned[-1])) or 1.0
        if turned[-1] >= 1.0:
            legs = float(np.interp(whole, turned, np.arange(KEPT)))
        else:  # so slow that it is a flow
            legs = float(np.mean(1.0 / np.abs(ends - x)[1:])) * self.period
        turns = float(np.sign(now - x[0])) * whole / legs
        error = 1.0 / (KEPT * self.leg)
        one = Attractor(AttractorKind.TORUS, states, turns, 0.0, error)
        self.spans.append((-0.5 * self.period, 0.5 * self.period, one))

    def _keep_reached(self, states: Array) -> None:
        """Keep the attractors to which states come, and count those that come to none."""
        every: list[Attractor] = []
        for *_, one in self.spans:
            if not any(one is other for other in every):
                every.append(one)
        self.found = every
        ends = strobe(
            self.law, self.values, states, self.step, 1, 1, targets=self.targets(),
            most_legs=1, steps=self.steps,
        )  # fmt: skip
        self.open[AWAY] += int(np.sum((ends.code < 0) & np.isfinite(ends.states[:, 0, 0])))
        self.found = [one for i, one in enumerate(every) if (ends.code == i).any()]

    def targets(self) -> Targets:
        """Where motions are that come to an attractor, once they are slow."""
        place = {id(one): i for i, one in enumerate(self.found)}
        edge = BORDER * self.size
        rows = []
        for low, high, one in self.spans:
            if id(one) in place:
                whole = self.period and high - low > self.period * (1.0 - 1e-9)
                gap = 0.0 if whole else edge
                rows.append([low + gap, high - gap, place[id(one)]])
        spans = np.array(rows).reshape(-1, 3)
        bands = np.tile(np.array([-BOUNDLESS, BOUNDLESS]), (len(spans), 2, 1))
        return self.nowhere()._replace(spans=spans, bands=bands, at=self.plane.at)
