"""Directional derivatives of f at one point, each with an estimate of its error.

Those of formulas are exact. Of a function they are taken along lines: f is sampled at steps
t, t/2, t/4, ... to both sides; each window of neighbouring steps gives one extrapolated value
(Richardson), with the rounding error that f brings into it. A wide step may miss what f does
nearby, and give values that agree with each other all the same: so each value is held against
those of all shorter steps as well. The one with the least error is taken, entry by entry. Forms of
several directions are combinations of lines (polarisation), and a line is sampled once.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cache
from itertools import product
from math import comb, factorial
from typing import Any

import numpy as np
import numpy.typing as npt

from phasekit.arrays import Array
from phasekit.bifurcation.continuation.curve import APART, STEPS, Curve, rounding_shown

Vector = npt.NDArray[Any]  # real or complex

EPSILON = 2.0**-52
LEVELS = 24  # steps of a line: from half the size of the unknowns, each half the one before
MORE = 10  # further ones, where the best lie at an end
FARTHEST, WIDEST = 44, -19
POOR = 1e-7  # relative error that wider steps might bring down
CAUTION = 3.0  # errors that are said, over errors that were seen
SLACK = 6.0  # noise of the worst among hundreds of samples, over its estimate from a few
WINDOW = 5  # most steps of one extrapolation


@dataclass(frozen=True, eq=False)
class Estimate:
    """An array or a number, and the estimated size of its error, entry by entry."""

    value: Any
    error: Any

    def __add__(self, other: Estimate) -> Estimate:
        """The sum; errors add."""
        return Estimate(self.value + other.value, self.error + other.error)

    def __sub__(self, other: Estimate) -> Estimate:
        """The difference; errors add."""
        return Estimate(self.value - other.value, self.error + other.error)

    def __mul__(self, factor: complex) -> Estimate:
        """The multiple by a number."""
        return Estimate(self.value * factor, self.error * abs(factor))

    __rmul__ = __mul__

    def dot(self, p: Vector) -> Estimate:
        """The product with a vector, which is conjugated."""
        return Estimate(np.vdot(p, self.value), float(np.abs(p) @ np.abs(self.error)))

    def has_digits(self, digits: float = 1.0) -> bool:
        """Whether so many digits are known, in the largest entry; of zero, whether it is exact."""
        size, error = np.max(np.abs(self.value)), np.max(np.abs(self.error))
        return bool(error <= 10.0**-digits * size)


class Derivatives:
    """The multilinear forms of f at one point, of the unknowns u = (x, free parameters)."""

    def __init__(self, curve: Curve, u: Array) -> None:
        self.curve, self.u = curve, np.array(u[: curve.m])
        self.exact = curve.field.exact
        self.reach = np.maximum(np.abs(self.u), curve.scale[: curve.m])
        self.value, self.slopes = curve.evaluate(self.u)
        # By line: samples by level, and derivatives by order.
        self._lines: dict[bytes, tuple[dict[int, Array], dict[int, Estimate]]] = {}
        self._noise: Array | None = None
        self._steps: list[Derivatives] | None = None
        self._middle: Array | None = None
        self.widest = WIDEST

    def first(self, a: Vector) -> Estimate:
        """The derivative of f along a."""
        if np.iscomplexobj(a):
            one, two = self.first(np.real(a)), self.first(np.imag(a))
            return Estimate(one.value + 1j * two.value, one.error + two.error)
        a = self._full(a)
        if self.exact:
            return self._rounded(self.slopes @ a)
        return self._along(a, 1)

    def second(self, a: Vector, b: Vector) -> Estimate:
        """B(a, b): the second derivative of f along a and b."""
        if np.iscomplexobj(a) or np.iscomplexobj(b):
            return _multilinear(self.second, a, b)
        a, b = self._full(a), self._full(b)
        if self.exact:
            return self._rounded(self.curve.bend(self.u, a) @ b)
        if self.curve.field.steps > 1:
            return self._chained(a, b)
        (a, b), size = self._balanced(a, b)
        if size == 0.0:
            return self._nothing()
        if np.array_equal(a, b):
            return size * self._along(a, 2)
        return (self._along(a + b, 2) - self._along(a - b, 2)) * (0.25 * size)

    def third(self, a: Vector, b: Vector, c: Vector) -> Estimate:
        """C(a, b, c): the third derivative of f along a, b and c."""
        if any(np.iscomplexobj(z) for z in (a, b, c)):
            return _multilinear(self.third, a, b, c)
        a, b, c = self._full(a), self._full(b), self._full(c)
        if self.exact:
            return self._rounded(self.curve.twist(self.u, a, b, c))
        if self.curve.field.steps > 1:
            return self._chained(a, b, c)
        (a, b, c), size = self._balanced(a, b, c)
        if size == 0.0:
            return self._nothing()
        if np.array_equal(a, c):
            b, c = c, b
        elif np.array_equal(b, c):
            a, c = c, a
        if np.array_equal(a, b):  # C(a, a, c)
            if np.array_equal(b, c):
                return size * self._along(a, 3)
            total = self._along(a + c, 3) - self._along(a - c, 3)
            return (size / 6.0) * (total - 2.0 * self._along(c, 3))
        total = self._along(a + b + c, 3) - self._along(a + b - c, 3)
        total = total - self._along(a - b + c, 3) + self._along(a - b - c, 3)
        return (size / 24.0) * total

    def form(self, *z: Vector) -> Estimate:
        """The derivative of f along one to five directions."""
        if len(z) <= 3:
            short: Callable[..., Estimate] = (self.first, self.second, self.third)[len(z) - 1]
            return short(*z)
        if any(np.iscomplexobj(one) for one in z):
            return _multilinear(self.form, *z)
        z = tuple(self._full(one) for one in z)
        if self.curve.field.steps > 1:
            return self._chained(*z)
        if self.exact:
            return self._rounded(self.curve.derivative(self.u, *z))
        balanced, size = self._balanced(*z)
        return size * self._polarised(balanced) if size else self._nothing()

    def _polarised(self, z: Sequence[Array]) -> Estimate:
        """The derivative along directions by those along lines.

        Of a direction m times these are its multiples m, m - 2, ..., -m, weighted as in a binomial
        of differences.
        """
        different: dict[bytes, tuple[Array, int]] = {}
        for one in z:
            _, times = different.get(one.tobytes(), (one, 0))
            different[one.tobytes()] = one, times + 1
        order = len(z)
        total = self._nothing()
        if len(different) == 1:
            return self._along(z[0], order)
        for taken in product(*(range(times + 1) for _, times in different.values())):
            left = tuple(times - k for k, (_, times) in zip(taken, different.values(), strict=True))
            if (sum(taken), taken) >= (sum(left), left):
                continue  # the opposite line, which gives the same, or none
            parts = list(zip(different.values(), taken, strict=True))
            line = np.sum([(times - 2 * k) * one for (one, times), k in parts], axis=0)
            weight = math.prod(comb(times, k) for (_, times), k in parts) * (-1.0) ** sum(taken)
            total = total + self._along(line, order) * weight
        return total * (2.0 ** (1 - order) / factorial(order))

    def noise(self) -> Array:
        """Size of the rounding errors of f near the point, of whatever it does inside as well."""
        return self._noise_of(self.reach, None)

    def rounding(self) -> Array:
        """Size of the rounding errors of f, as they show between neighbours in relative size."""
        return self._shown(np.abs(self.u), self.curve.values)

    def doubt(self, noise: Array) -> None:
        """Take rounding errors of f for no smaller than these."""
        self._noise = np.maximum(self.noise(), noise)

    def _full(self, z: Array) -> Array:
        full = np.zeros(self.curve.m)
        full[: len(z)] = z
        return full

    def _rounded(self, value: Array) -> Estimate:
        error = 4.0 * EPSILON * self.curve.field.steps * np.abs(value)
        return Estimate(np.asarray(value), error)

    def _chained(self, *z: Array) -> Estimate:
        """A derivative of a map applied many times, by those of its steps.

        What a step makes of directions together is the sum over all ways to part them, of its
        derivative along what the steps before have made of the parts (Faa di Bruno).
        """
        if self._steps is None:
            self._steps = self._of_steps()
        n, order = self.curve.n, len(z)
        full = (1 << order) - 1  # sets of directions are sums of powers of 2
        found = {
            some: Estimate(z[some.bit_length() - 1][:n], np.zeros(n))
            if some & (some - 1) == 0
            else self._nothing()
            for some in range(1, full + 1)
        }
        for d in self._steps:
            after = {}
            for some, whole in found.items():
                total = d.turned(whole)
                if some & (some - 1) == 0:
                    own = z[some.bit_length() - 1][n:]
                    total = total + Estimate(d.slopes[:, n:] @ own, np.zeros(n))
                for parts in _parted(some):
                    given = [np.append(found[one].value, _parameters(z, one, n)) for one in parts]
                    total = total + d.form(*given)
                after[some] = total
            found = after
        return found[full]

    def _of_steps(self) -> list[Derivatives]:
        """The derivatives of each step of a map that is applied many times."""
        field: Any = self.curve.field
        once = self.curve.replace(field=field.base)
        u, found = self.u, []
        for _ in range(field.steps):
            found.append(Derivatives(once, u))
            u = np.append(found[-1].value, u[self.curve.n :])
        return found

    def turned(self, z: Estimate) -> Estimate:
        """The derivative of f along a vector of states that is known within its error."""
        slopes = self.slopes[:, : self.curve.n]
        return Estimate(slopes @ z.value, np.abs(slopes) @ z.error)

    def _nothing(self) -> Estimate:
        return Estimate(np.zeros(self.curve.n), np.zeros(self.curve.n))

    def _balanced(self, *directions: Array) -> tuple[list[Array], float]:
        """Directions brought to the same length, and the product of their lengths."""
        lengths = [float(np.max(np.abs(z) / self.reach)) for z in directions]
        if min(lengths) == 0.0:
            return list(directions), 0.0
        return [z / s for z, s in zip(directions, lengths, strict=True)], float(np.prod(lengths))

    def _along(self, z: Array, order: int) -> Estimate:
        """The derivative of f of an order along a line; of even ones z's sign does not matter."""
        lead = z[np.flatnonzero(z)[:1]]
        if not len(lead):
            return self._nothing()
        sign = float(np.sign(lead[0]))
        z = z * sign
        samples, results = self._lines.setdefault(z.tobytes(), ({}, {}))
        if order not in results:
            with np.errstate(all="ignore"):
                results[order] = self._sampled(z, order, samples)
        return sign**order * results[order]

    def _sampled(self, z: Array, order: int, samples: dict[int, Array]) -> Estimate:
        given = self.curve.field.slopes_along(self.curve.par, self.curve.active, self.u, z)
        length = float((np.abs(z) / self.reach).max())
        noise = self._noise_of(z, given)
        middle = self._value(given)
        # Terms of f may cancel, as along a null vector, where their rounding does not.
        terms = np.abs(self.slopes) @ np.abs(z) if given is None else np.zeros(self.curve.n)
        first, last = 1, LEVELS
        while True:
            levels = range(first, last + 1)
            missing = [k for k in levels if k not in samples]
            if missing:
                steps = np.array([s * 2.0**-k / length for k in missing for s in (1.0, -1.0)])
                found = self._values(self.u + steps[:, None] * z, given)
                samples.update(zip(missing, found.reshape(len(missing), 2, -1), strict=True))
            sides = np.array([samples[k] for k in levels])
            steps = np.array([2.0**-k / length for k in levels])
            ladder = _Ladder(steps, sides[:, 0], sides[:, 1], middle, noise, terms)
            estimate, finest, wide = ladder.derivative(order if given is None else order - 1)
            if finest >= len(ladder.steps) - 3 and last < FARTHEST:
                last += MORE
            elif wide and first > self.widest:
                first -= MORE
            else:
                return estimate

    def _value(self, given: Any) -> Array:
        """F, or what stands for it, at the point."""
        if given is not None:
            return np.asarray(self._values(self.u[None], given)[0])
        if self._middle is None:
            self._middle = self.curve.values(self.u[None])[0]
        return self._middle

    def _values(self, points: Array, given: Any) -> Array:
        if given is None:
            return self.curve.values(points)
        return np.array([given(point) for point in points])

    def _noise_of(self, z: Array, given: Any) -> Array:
        """Size of the rounding errors of f, or of what stands for it, near the point.

        At least that of the unknowns, by which f changes; and what differences over tiny steps
        show, of a smooth function nothing else (J. More, S. Wild, SIAM J. Sci. Comput. 33 (2011)).
        """
        if given is not None:
            return self._shown(z, lambda points: self._values(points, given))
        if self._noise is None:
            terms = np.abs(self.slopes) @ np.abs(self.u)
            terms = EPSILON * np.where(np.isfinite(terms), terms, 0.0)
            self._noise = np.maximum(self._shown(self.reach, self.curve.values), terms)
        return self._noise

    def _shown(self, z: Array, values: Callable[[Array], Array]) -> Array:
        return rounding_shown(values(self.u + STEPS[:, None] * (APART * z)))


class _Ladder:
    """Samples of a vector along a line, at steps that are halved, to both sides."""

    def __init__(
        self, steps: Array, ahead: Array, behind: Array, middle: Array, noise: Array, terms: Array
    ) -> None:
        self.steps = steps
        self.middle, self.noise = middle, noise
        column = steps[:, None]
        self.even = (0.5 * (ahead - middle) + 0.5 * (behind - middle)) / column**2
        self.odd = 0.5 * (ahead - behind) / column
        self.errors = noise + EPSILON * (np.abs(ahead) + np.abs(behind) + column * terms)

    def derivative(self, order: int) -> tuple[Estimate, int, bool]:
        """The derivative with the least error, entry by entry; the shortest step that it needs.

        And whether rounding hides it that wider steps may leave behind.
        """
        if order == 0:
            return Estimate(self.middle, self.noise), 0, False
        count, n = self.even.shape
        data = self.odd if order % 2 else self.even
        errors = self.errors / self.steps[:, None] ** (1 if order % 2 else 2)
        place_of = (order - 1) // 2  # among the squares of the step
        least = 1 + place_of
        values = np.full((WINDOW + 1, count, n), np.nan)
        noises = np.full((WINDOW + 1, count, n), np.inf)
        for width in range(least, WINDOW + 1):
            weights = _weights(order, width)
            place = slice(0, count - width + 1)
            for kept, given, by in (
                (values, data, weights),
                (noises, errors, np.abs(weights)),
            ):
                step, across = given.strides
                windows = np.ndarray(
                    (count - width + 1, n, width), float, given, 0, (step, across, step)
                )
                found = windows @ by
                if place_of:
                    found = found / self.steps[place, None] ** (2 * place_of)
                kept[width, place] = found
        return self._best(values, noises, least)

    def _best(self, values: Array, noises: Array, least: int) -> tuple[Estimate, int, bool]:
        _, count, n = values.shape
        # What the same window says one step on; and how far all shorter steps are from it.
        cut = np.full_like(values, np.inf)
        np.abs(values[:, 1:] - values[:, :-1], out=cut[:, :-1])
        plain = values[least]
        slack = 2.0 * cut[least] + SLACK * noises[least]
        # All shorter steps at once: the range that they all allow.
        low, high = plain - slack, plain + slack
        low[~np.isfinite(low)], high[~np.isfinite(high)] = -np.inf, np.inf
        low = np.maximum.accumulate(low[::-1], axis=0)[::-1]
        high = np.minimum.accumulate(high[::-1], axis=0)[::-1]
        errors = cut + noises
        errors[:, :-1] += np.maximum(np.maximum(low[1:] - values[:, :-1], 0.0),
                                     values[:, :-1] - high[1:])  # fmt: skip
        errors[~np.isfinite(errors)] = np.inf
        errors = errors.reshape(-1, n)
        best = errors.argmin(axis=0)
        columns = np.arange(n)
        error = errors[best, columns]
        value = np.where(np.isfinite(error), values.reshape(-1, n)[best, columns], np.nan)
        width, place = np.divmod(best, count)
        wide = (place <= 1) & np.isfinite(value)
        poor = False
        if wide.any():
            unit = np.maximum(np.abs(self.odd).max(axis=0), 1e-300)[wide]
            poor = bool((error[wide] / unit).max() > POOR * (np.abs(value)[wide] / unit).max())
        # Entries that are exact show nothing of the steps that they need.
        finest = int(np.where(error > 0.0, place + width - 1, 0).max(initial=0))
        return Estimate(value, CAUTION * error), finest, poor


@cache
def _weights(order: int, width: int) -> Array:
    """Weights of samples at the steps 1, 1/2, 1/4, ... for a derivative at 0 (of unit step).

    Samples are polynomials of the squares: f(t) - f(-t) over 2 t is f' + f''' t^2/6 + ..., and the
    even part over t^2 is f''/2 + ....
    """
    squares = 4.0 ** -np.arange(width)
    wanted = np.zeros(width)
    wanted[(order - 1) // 2] = factorial(order)
    return np.asarray(np.linalg.solve(np.vander(squares, increasing=True).T, wanted))


def _parted(some: int) -> list[tuple[int, ...]]:
    """All ways to part a set, a sum of powers of 2, into two or more sets."""

    def ways(left: int) -> list[tuple[int, ...]]:
        if not left:
            return [()]
        lowest = left & -left
        rest, found, other = left - lowest, [], left - lowest
        while True:  # over all sets of the rest, which the lowest is joined to
            found += [(lowest | other, *more) for more in ways(rest & ~other)]
            if not other:
                return found
            other = (other - 1) & rest

    return [parts for parts in ways(some) if len(parts) > 1]


def _parameters(z: Sequence[Array], some: int, n: int) -> Array:
    """The parts along parameters of a set of directions: none of several together."""
    if some & (some - 1):
        return np.zeros(len(z[0]) - n)
    return z[some.bit_length() - 1][n:]


def _multilinear(form: Any, *directions: Vector) -> Estimate:
    """A real multilinear form of complex vectors."""
    parts = [
        [(np.real(z), 1.0), (np.imag(z), 1j)] if np.iscomplexobj(z) else [(z, 1.0)]
        for z in directions
    ]
    # In any order a form is the same.
    weights: dict[tuple[bytes, ...], complex] = {}
    vectors: dict[bytes, Array] = {}
    for chosen in product(*parts):
        factor: complex = 1.0
        for vector, unit in chosen:
            factor = factor * unit
            vectors[vector.tobytes()] = vector
        if all(np.any(vector) for vector, _ in chosen):
            names = tuple(vector.tobytes() for vector, _ in chosen)
            names = tuple(sorted(names)) if len(names) > 3 else names
            weights[names] = weights.get(names, 0.0) + factor
    total: Estimate | None = None
    for names, factor in weights.items():
        part: Estimate = form(*(vectors[name] for name in names)) * (factor + 0j)
        total = part if total is None else total + part
    if total is None:
        total = form(*(0.0 * np.real(z) for z in directions))
    return total
