"""Events: zeros of functions of the user's along a curve.

Between two points of the curve a function is looked at on the cubic through both with their
tangents, as finely as the function itself asks for: where a cubic does not foretell it or, of a
formula, where interval arithmetic does not exclude a zero. What is found there is refined on the
curve itself.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from phasekit.arrays import Array
from phasekit.bifurcation.continuation.curve import Curve
from phasekit.bifurcation.continuation.functions import Event
from phasekit.bifurcation.continuation.path import Path, Sample, between, bracket_root, turned
from phasekit.bifurcation.continuation.points.special import CONVERGED, GUESS, Placed, Special

LEAST, DEPTH = 2, 12  # times that a step is halved to look at a function: always, and at most
MOST = 4096  # parts of one path, beside the least of each step
BETWEEN = (0.23, 0.5, 0.79)  # places between two zeros that are one; no parts of each other
FORETOLD = 0.02  # of its size: by how much a function may differ from the cubic through its ends
DIP = 0.3  # part of its values at the ends to which a function falls that may touch zero
SAME = 1e-9  # distance on scaled axes of two events that are one
JUMP = 1e-3  # part of its values at the ends that a function keeps where it jumps
SHARP = 1e-12  # part of its values around a zero that is left of a function there
STILL = 3  # points in a row on which a function that vanishes has no zeros to speak of


def events_of(curve: Curve, path: Path) -> tuple[list[Placed], tuple[str, ...]]:
    """The events of a path in order, and what is not certain about them."""
    found: list[Placed] = []
    messages: list[str] = []
    with np.errstate(all="ignore"):
        cubics = Cubics(curve, path)
        for event in curve.events:
            seek = _Seek(cubics, event)
            found += seek.found()
            messages += seek.messages
    return sorted(found, key=lambda one: (one.index, one.along)), tuple(messages)


class _Seek:
    """The search for the zeros of one function."""

    def __init__(self, cubics: Cubics, event: Event) -> None:
        self.cubics, self.curve, self.path, self.event = cubics, cubics.curve, cubics.path, event
        self.of = event.function
        self.messages: list[str] = []
        self.still = np.zeros(self.path.count, dtype=bool)
        self.u, self.length = cubics.u, cubics.length

    def found(self) -> list[Placed]:
        """Each zero once; angles count as they are shown, in one turn."""
        if self.path.count < 2:
            return []
        shown = self.cubics.turned(self.u, self.cubics.turns(self.u))
        at = self.of.values(self.curve, shown)
        self._say_undefined(at)
        zero = self._without_runs(np.abs(at) <= self.of.noise(self.curve, shown))
        placed = [self._at_point(i) for i in np.flatnonzero(zero).tolist()]
        turns = self.cubics.turns(self.u)
        steps = np.arange(self.path.count - 1)
        placed += self._between(steps, turns[:-1])
        other = np.flatnonzero(np.any(turns[1:] != turns[:-1], axis=1))
        if len(other):
            placed += self._between(other, turns[1:])
        return self._once(placed)

    def _say_undefined(self, values: Array) -> None:
        """Say where on the path the function has no value."""
        missing = np.flatnonzero(~np.isfinite(values))
        if len(missing):
            p = self.path.u[missing, self.curve.n]
            self.messages.append(
                f"the event {self.event.name!r} has no value at {len(missing)} of "
                f"{len(values)} points, between {self._parameter} = {np.min(p):.6g} and "
                f"{np.max(p):.6g}"
            )

    @property
    def _parameter(self) -> str:
        return self.curve.field.parameters[self.curve.active[0]]

    def _without_runs(self, zero: npt.NDArray[np.bool_]) -> npt.NDArray[np.bool_]:
        """Leave out stretches on which the function vanishes throughout, and say so."""
        ends = np.flatnonzero(np.diff(np.concatenate([[False], zero, [False]]).astype(int)))
        single = zero.copy()
        n = self.curve.n
        for first, after in ends.reshape(-1, 2).tolist():
            if after - first >= STILL:
                single[first:after] = False
                self.still[first:after] = True
                p = self.path.u[first, n], self.path.u[after - 1, n]
                self.messages.append(
                    f"the event {self.event.name!r} is zero all along the curve between "
                    f"{self._parameter} = "
                    f"{p[0]:.6g} and {p[1]:.6g}: no points of it are kept there"
                )
        return single

    def _between(self, steps: npt.NDArray[np.int64], turns: Array) -> list[Placed]:
        """Zeros inside some of the steps, angles brought to the given turns."""
        parts, ends, rates = self._looked_at(steps, turns)
        sign = np.sign(ends)
        change = (sign[:, 0] != sign[:, 1]) & np.isfinite(ends).all(axis=1)
        width = (parts.high - parts.low) * self.length[parts.step]
        # The least value of the cubic between both ends, where it falls towards its middle.
        inward = (ends[:, 0] * rates[:, 0] < 0.0) & (ends[:, 1] * rates[:, 1] > 0.0) & ~change
        s = np.linspace(0.0, 1.0, 33)[:, None]
        lowest = np.min(sign[:, 0] * cubic(s, ends, rates, width), axis=0)
        doubt = self._doubt(turns)[parts.step]
        deepest = parts.high - parts.low <= 2.0**-DEPTH  # a kink, which is no cubic
        dip = inward & ((lowest < DIP * np.min(np.abs(ends), axis=1) + doubt) | deepest)
        placed = []
        for k in np.flatnonzero(change | dip).tolist():
            i = int(parts.step[k])
            if not (self.still[i] or self.still[i + 1]):
                one = parts.low[k], parts.high[k]
                placed += self._refined(i, (float(one[0]), float(one[1])), turns[i])
        return placed

    def _doubt(self, turns: Array) -> Array:
        """What a function changes by from the cubic of each step to the curve, half of it."""
        steps = np.arange(self.path.count - 1)
        u, _ = self.cubics.points(steps, np.full(len(steps), 0.5))
        on, off = (
            self.of.values(self.curve, self.cubics.turned(one, turns))
            for one in (u, u - self.cubics.off)
        )
        return np.asarray(0.5 * np.nan_to_num(np.abs(on - off)))

    def _looked_at(self, steps: npt.NDArray[np.int64], turns: Array) -> tuple[Parts, Array, Array]:
        """Parts of the steps between which the function is as a cubic; values and rates there."""
        parts = Parts(steps, np.zeros(len(steps)), np.ones(len(steps)))
        excluded, most = self.of.bounds(self.curve), MOST + 2**LEAST * len(steps)
        done: list[tuple[Parts, Array, Array]] = []
        for level in range(DEPTH + 1):
            ends, rates = self._values(parts, turns)
            width = (parts.high - parts.low) * self.length[parts.step]
            at = self._middles(parts, turns)
            size = np.max(np.abs(np.column_stack([ends, at])), axis=1)
            off = np.abs(at - cubic(0.5, ends, rates, width))
            split = ~(off <= FORETOLD * size)
            may = split if excluded is None else excluded(*self.cubics.hull(parts, turns))
            split |= may
            split &= np.isfinite(at) | np.isfinite(ends).any(axis=1)
            split &= ~(self.still[parts.step] | self.still[parts.step + 1])
            if level < LEAST:
                split[:] = True
            if len(parts.step) + np.sum(split) > most and level < DEPTH:
                self._say_unresolved(parts.take(split & may))
                split[:] = False
            if level == DEPTH:
                split[:] = False
            done.append((parts.take(~split), ends[~split], rates[~split]))
            parts = parts.take(split).halved()
            if not len(parts.step):
                break
        every = Parts(*(np.concatenate([getattr(one[0], name) for one in done])
                        for name in ("step", "low", "high")))  # fmt: skip
        order = np.lexsort([every.low, every.step])
        ends, rates = (np.concatenate([one[k] for one in done])[order] for k in (1, 2))
        return every.take(order), ends, rates

    def _say_unresolved(self, parts: Parts) -> None:
        """Say where the function changes too often to be looked at."""
        if not len(parts.step):
            return
        p = self.path.u[np.concatenate([parts.step, parts.step + 1]), self.curve.n]
        self.messages.append(
            f"the event {self.event.name!r} changes so often between {self._parameter} = "
            f"{np.min(p):.6g} and {np.max(p):.6g} that zeros there may be missing"
        )

    def _values(self, parts: Parts, turns: Array) -> tuple[Array, Array]:
        """Values at both ends of each part, and their rates by the length along the step."""
        values, rates = [], []
        for s in (parts.low, parts.high):
            u, along = self.cubics.points(parts.step, s)
            u = self.cubics.turned(u, turns[parts.step])
            values.append(self.of.values(self.curve, u))
            rates.append(self.of.rates(self.curve, u, along))
        return np.stack(values, axis=1), np.stack(rates, axis=1)

    def _middles(self, parts: Parts, turns: Array) -> Array:
        """Values in the middle of each part."""
        u, _ = self.cubics.points(parts.step, 0.5 * (parts.low + parts.high))
        return self.of.values(self.curve, self.cubics.turned(u, turns[parts.step]))

    def _refined(self, i: int, part: tuple[float, float], turns: Array) -> list[Placed]:
        """The zeros in a part of a step, on the curve itself."""
        curve = self.curve

        def test(s: Sample) -> float:
            return self._value(s, turns)

        left, right, lowest = self._around(i, part, turns)
        if self.event.condition:
            if test(left) == test(right):
                return []
            return [self._placed(i, self._bisected(left, right, test), turns)]
        pairs = [(left, right)]
        if test(left) * test(right) > 0.0:
            if lowest is None:
                return []
            if abs(test(lowest)) <= self._noise(lowest, turns):
                return [self._placed(i, lowest, turns, "the function touches zero: a double zero")]
            if test(left) * test(lowest) > 0.0:
                return []
            pairs = [(left, lowest), (lowest, right)]
        placed = []
        for one, two in pairs:
            best, _, _ = bracket_root(curve, one, two, test, steps=60, width=1e-16)
            if self._jumps(best, turns):
                continue
            size = max(abs(test(one)), abs(test(two)))
            placed.append(self._placed(i, best, turns, size=size))
        return placed

    def _around(
        self, i: int, part: tuple[float, float], turns: Array
    ) -> tuple[Sample, Sample, Sample | None]:
        """Points of the curve around a part of a step with a change of sign, or a least size.

        The cubic is not the curve: what is seen on it may lie beside the part.
        """
        a, b = self._sample(i), self._sample(i + 1)
        margin = 0.25 * (part[1] - part[0])
        while True:
            low, high = max(0.0, part[0] - margin), min(1.0, part[1] + margin)
            left = a if low == 0.0 else between(self.curve, a, b, low)
            right = b if high == 1.0 else between(self.curve, a, b, high)
            left, right = left or a, right or b
            change = self._value(left, turns) * self._value(right, turns) <= 0.0
            lowest = None if change else self._lowest(left, right, turns)
            if change or lowest is not None or (left is a and right is b):
                return left, right, lowest
            margin *= 4.0

    def _bisected(self, a: Sample, b: Sample, test: Callable[[Sample], float]) -> Sample:
        """The first of two neighbours, but for rounding, between which a condition changes."""
        low, high, end = 0.0, 1.0, b
        for _ in range(52):
            middle = between(self.curve, a, b, 0.5 * (low + high))
            if middle is None:
                break
            if test(middle) == test(a):
                low = 0.5 * (low + high)
            else:
                high, end = 0.5 * (low + high), middle
        return end

    def _lowest(self, a: Sample, b: Sample, turns: Array) -> Sample | None:
        """Where the function has its least size between two points, by the sign of its rate."""

        def rate(s: Sample) -> float:
            u = self.cubics.turned(s.u[None, : self.curve.m], turns)
            t = s.tangent[None] / self.curve.length(s.tangent)
            return float(self.of.rates(self.curve, u, t)[0])

        sign = np.sign(self._value(a, turns))
        if not sign * rate(a) < 0.0 < sign * rate(b):
            return None
        best = bracket_root(self.curve, a, b, rate, steps=60, width=1e-14)[0]
        if abs(self._value(best, turns)) <= self._noise(best, turns):
            return best
        kink = self._bisected(a, b, lambda s: float(np.sign(rate(s))))
        return min(best, kink, key=lambda s: sign * self._value(s, turns))

    def _jumps(self, best: Sample, turns: Array) -> bool:
        """Whether the sign changes without a zero, at a jump or a pole, which is said."""
        if self.event.condition or abs(self._value(best, turns)) <= max(
            JUMP * self._size, 1e4 * self._noise(best, turns)
        ):
            return False
        self.messages.append(
            f"the event {self.event.name!r} changes its sign without a zero at {self._parameter} = "
            f"{best.u[self.curve.n]:.9g}"
        )
        return True

    @property
    def _size(self) -> float:
        """The median size of the function at the points of the path."""
        values = np.abs(
            self.of.values(self.curve, self.cubics.turned(self.u, self.cubics.turns(self.u)))
        )
        values = values[np.isfinite(values)]
        return float(np.median(values)) if len(values) else 0.0

    def _sample(self, i: int) -> Sample:
        return Sample(self.path.u[i], self.path.tangent[i], self.path.slopes[i])

    def _value(self, s: Sample, turns: Array) -> float:
        u = self.cubics.turned(s.u[None, : self.curve.m], turns)
        return float(self.of.values(self.curve, u)[0])

    def _noise(self, s: Sample, turns: Array) -> float:
        u = self.cubics.turned(s.u[None, : self.curve.m], turns)
        return float(self.of.noise(self.curve, u)[0])

    def _at_point(self, i: int) -> Placed:
        """A zero at a point of the path itself."""
        u = self.u[i]
        k = min(i, self.path.count - 2)
        return self._placed(k, self._sample(i), self.cubics.turns(u))

    def _placed(
        self, i: int, s: Sample, turns: Array, message: str = "", size: float = 0.0
    ) -> Placed:
        curve = self.curve
        n, m = curve.n, curve.m
        value = self._value(s, turns)
        chord = self.path.u[i + 1] - self.path.u[i]
        square = float(np.dot(curve.weight * chord, chord))
        gap = s.u - self.path.u[i]
        along = float(np.dot(curve.weight * chord, gap)) / square if square > 0.0 else 0.0
        ends = sorted((float(self.path.u[i, n]), float(self.path.u[i + 1, n])))
        residual = float(np.max(np.abs(curve.evaluate(s.u)[0])))
        least = max(1e4 * self._noise(s, turns), SHARP * size)
        sharp = self.event.condition or abs(value) <= least
        special = Special(
            "event", s.u[:m].copy(), (ends[0], ends[1]), max(abs(value), residual),
            CONVERGED if sharp else GUESS,
            message if sharp else "the function did not reach zero within rounding",
            tangent=s.tangent, name=self.event.name,
        )  # fmt: skip
        return Placed(i, along, special)

    def _once(self, placed: list[Placed]) -> list[Placed]:
        """In order, each once, and none that is a zero in another turn of an angle only."""
        m = self.curve.m
        placed = sorted(placed, key=lambda one: (one.index, one.along))
        kept: list[Placed] = []
        for one in placed:
            if not any(self._same(one, other) for other in kept[-2:]):
                kept.append(one)
        if self.path.closed and len(kept) > 1:
            gap = turned(self.curve, kept[0].special.u - kept[-1].special.u)
            if np.max(np.abs(gap / self.curve.scale[:m])) < SAME:
                kept.pop()
        return [one for one in kept if self._shown(one)]

    def _same(self, one: Placed, other: Placed) -> bool:
        """Whether two are one zero: next to each other, or zero but for rounding between."""
        if abs(other.index - one.index) > 1:
            return False
        m = self.curve.m
        gap = turned(self.curve, one.special.u - other.special.u)
        if np.max(np.abs(gap / self.curve.scale[:m])) < SAME:
            return True
        inner = other.special.u + np.array(BETWEEN)[:, None] * gap
        inner = self.cubics.turned(inner, self.cubics.turns(inner))
        value = np.abs(self.of.values(self.curve, inner))
        return bool(np.all(value <= self.of.noise(self.curve, inner)))

    def _shown(self, one: Placed) -> bool:
        """Whether it is a zero of the angles as they are shown, not in another turn only."""
        u = one.special.u[None]
        here = self.cubics.turned(u, self.cubics.turns(u))
        if self.event.condition or np.array_equal(here, u):
            return True
        value = np.abs(self.of.values(self.curve, here))
        return bool(value[0] <= 1e8 * self.of.noise(self.curve, here)[0])


@dataclass(frozen=True)
class Parts:
    """Parts of the steps of a path, in order: which step, from where to where in it."""

    step: npt.NDArray[np.int64]
    low: Array
    high: Array

    def take(self, places: Any) -> Parts:
        """Some of them."""
        return Parts(self.step[places], self.low[places], self.high[places])

    def halved(self) -> Parts:
        """Both halves of each."""
        middle = 0.5 * (self.low + self.high)
        return Parts(
            np.repeat(self.step, 2), np.stack([self.low, middle], 1).ravel(),
            np.stack([middle, self.high], 1).ravel(),
        )  # fmt: skip


class Cubics:
    """The steps of a path as functions of s in [0, 1]."""

    def __init__(self, curve: Curve, path: Path) -> None:
        self.curve, self.path, m = curve, path, curve.m
        self.u, self.t = path.u[:, :m], path.tangent[:, :m]
        self.length = np.sqrt(np.sum(np.diff(path.u, axis=0) ** 2 * curve.weight, axis=1))
        self.off = _off(curve, path)

    def turns(self, u: Array) -> Array:
        """What brings angles to the turn in which they are shown."""
        period = self.curve.period[: self.curve.m]
        with np.errstate(all="ignore"):
            turns = np.where(period > 0.0, np.ceil(u / period - 0.5), 0.0)
        return np.asarray(turns)

    def turned(self, u: Array, turns: Array) -> Array:
        """Points with their angles brought by so many turns."""
        return np.asarray(u - self.curve.period[: self.curve.m] * turns)

    def points(self, i: npt.NDArray[np.int64], s: Array) -> tuple[Array, Array]:
        """Points on the cubics of steps, and their derivatives by length."""
        h, s = self.length[i][:, None], s[:, None]
        a, b, ta, tb = self.u[i], self.u[i + 1], h * self.t[i], h * self.t[i + 1]
        u = a + s * s * (3.0 - 2.0 * s) * (b - a) + s * (1.0 - s) * ((1.0 - s) * ta - s * tb)
        rate = 6.0 * s * (1.0 - s) * (b - a) + (1.0 - s) * (1.0 - 3.0 * s) * ta
        rate = rate + s * (3.0 * s - 2.0) * tb
        u = u + 16.0 * (s * (1.0 - s)) ** 2 * self.off[i]
        rate = rate + 32.0 * s * (1.0 - s) * (1.0 - 2.0 * s) * self.off[i]
        with np.errstate(all="ignore"):
            rate = np.where(h > 0.0, rate / h, 0.0)
        ends = (s == 0.0, s == 1.0)  # to the last bit
        u = np.where(ends[0], a, np.where(ends[1], b, u))
        return np.asarray(u), np.asarray(rate)

    def hull(self, parts: Parts, turns: Array) -> tuple[Array, Array]:
        """Boxes around parts of the cubics: around the control points of Bezier's form."""
        width = (parts.high - parts.low)[:, None] * self.length[parts.step][:, None]
        (a, ta), (b, tb) = (self.points(parts.step, s) for s in (parts.low, parts.high))
        corners = np.stack([a, a + width * ta / 3.0, b - width * tb / 3.0, b])
        around = np.abs(self.off[parts.step])  # of what is no cubic
        shift = self.curve.period[: self.curve.m] * turns[parts.step]
        low, high = np.min(corners, axis=0), np.max(corners, axis=0)
        return low - shift - around, high - shift + around


def _off(curve: Curve, path: Path) -> Array:
    """By how much the middle of each step lies off the cubic through its ends."""
    found = np.zeros((max(path.count - 1, 0), curve.m))
    for i in range(path.count - 1):
        a, b = (Sample(path.u[k], path.tangent[k], path.slopes[k]) for k in (i, i + 1))
        middle = between(curve, a, b, 0.5)
        if middle is not None:
            chord = b.u - a.u
            ta, tb = (s.tangent / curve.length(s.tangent) for s in (a, b))
            cubic = a.u + 0.5 * chord + 0.125 * curve.length(chord) * (ta - tb)
            found[i] = (middle.u - cubic)[: curve.m]
    return found


def cubic(s: Any, ends: Array, rates: Array, width: Array) -> Array:
    """Values at s in [0, 1] of the cubics with given values and rates at both ends."""
    a, b = ends[:, 0], ends[:, 1]
    ta, tb = width * rates[:, 0], width * rates[:, 1]
    return np.asarray(
        a + s * s * (3.0 - 2.0 * s) * (b - a) + s * (1.0 - s) * ((1.0 - s) * ta - s * tb)
    )
