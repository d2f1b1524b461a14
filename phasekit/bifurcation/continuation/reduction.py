"""Flows and maps next to an equilibrium, reduced to its center manifold, as power series.

With x = H(w), w' = G(w), of a map w -> G(w), the series of f(H) and of H_w G, of a map H(G), are
compared power by power. What makes the linear equations of H solvable where their matrix is
singular are the coefficients of G ([Kuznetsov2004] 8.7; [KuznetsovMeijer2005]). Powers that G holds
are those which turn with their coordinate: an exponent counts for so many of its mark, and sums of
marks are compared.
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from itertools import product
from typing import Any

import numpy as np

from phasekit.arrays import Complex
from phasekit.bifurcation.continuation import normal_form as forms
from phasekit.bifurcation.continuation.derivatives import EPSILON
from phasekit.bifurcation.continuation.normal_form import DIGITS, SMALL, Derivatives, Estimate
from phasekit.bifurcation.continuation.units import force_sizes

Power = tuple[int, ...]

CLEAR = 1e-6  # relative error of a coefficient up to which nothing is said of it
NEAR = 1e-4  # distance of eigenvalues, beside the largest one, that resonate


@dataclass(frozen=True)
class Critical:
    """Eigenvalues on the axis or circle, vectors (rows) with p_j q_j = 1, and their marks."""

    values: tuple[complex, ...]
    right: Complex  # shape (k, n)
    left: Complex
    marks: tuple[Power, ...]  # how often a coordinate turns with each of the frequencies
    #: After how many of them a mark counts as none, of maps at a part of a turn; 0: never.
    turns: Power

    def resonant(self, power: Power) -> list[int]:
        """The coordinates that turn as a power does."""
        whole = self._mark(power)
        count = len(self.values)
        return [
            j for j in range(count) if self._mark(tuple(int(i == j) for i in range(count))) == whole
        ]

    def _mark(self, power: Power) -> Power:
        sums = (
            sum(k * mark[i] for k, mark in zip(power, self.marks, strict=True))
            for i in range(len(self.turns))
        )
        return tuple(s % t if t else s for s, t in zip(sums, self.turns, strict=True))


def simple(d: Derivatives, value: complex) -> tuple[Complex, Complex]:
    """Right and left vector of a simple eigenvalue: |q| = 1, and <p, q> = 1."""
    n = d.curve.n
    scale = d.curve.scale[:n]
    A = d.curve.linear(d.slopes)
    if np.imag(value) == 0.0:
        matrix = A - float(np.real(value)) * np.eye(n)
        q, p = forms.null_vectors(matrix, scale, force_sizes(d.curve, d.u))
        return q.astype(complex), (p / float(p @ q)).astype(complex)
    values, vectors = np.linalg.eig(A * scale / scale[:, None])
    q = vectors[:, np.argmin(np.abs(values - value))] * scale
    values, vectors = np.linalg.eig((A * scale / scale[:, None]).T)
    p = vectors[:, np.argmin(np.abs(values - np.conj(value)))] / scale
    q = q / np.linalg.norm(q)
    lead = q[np.argmax(np.abs(q))]
    q = q * abs(lead) / lead
    return q, p / np.conj(np.vdot(p, q))


def frequencies(d: Derivatives, count: int) -> tuple[float, ...]:
    """Those of so many pairs of eigenvalues next to the imaginary axis, the largest first."""
    scale = d.curve.scale[: d.curve.n]
    values = np.linalg.eigvals(d.slopes[:, : d.curve.n] * scale / scale[:, None])
    above = values[values.imag > 0.0]
    near = above[np.argsort(np.abs(above.real))][:count]
    return tuple(sorted((float(one.imag) for one in near), reverse=True))


def critical(
    d: Derivatives,
    values: Sequence[complex],
    marks: Sequence[Power],
    turns: Power | None = None,
) -> Critical:
    """What a reduction begins with; of conjugate eigenvalues vectors are conjugate."""
    pairs: list[tuple[Complex, Complex]] = []
    for j, value in enumerate(values):
        earlier = [i for i in range(j) if np.imag(value) != 0.0 and values[i] == np.conj(value)]
        q, p = pairs[earlier[0]] if earlier else simple(d, value)
        pairs.append((np.conj(q), np.conj(p)) if earlier else (q, p))
    right, left = (np.array([pair[k] for pair in pairs]) for k in (0, 1))
    none = (0,) * len(marks[0])
    return Critical(tuple(values), right, left, tuple(marks), none if turns is None else turns)


class Reduction:
    """The series of H and G up to a power; ``g`` has estimates by coordinate and power."""

    def __init__(self, d: Derivatives, at: Critical, order: int) -> None:
        self.d, self.at, self.map = d, at, d.curve.discrete
        self.A = d.curve.linear(d.slopes)
        self.count = len(at.values)
        none = np.zeros(d.curve.n)
        self.units = [tuple(int(i == j) for i in range(self.count)) for j in range(self.count)]
        self.h: dict[Power, Estimate] = {
            unit: Estimate(q, none) for unit, q in zip(self.units, at.right, strict=True)
        }
        self.g: dict[tuple[int, Power], Estimate] = {}
        self.resonance = ""
        self._conjugate = self._mirror()
        for total in range(2, order + 1):
            for power in powers(self.count, total):
                self._find(power)

    def coefficient(self, j: int, power: Power) -> Estimate:
        """The coefficient of a power in the equation of a coordinate."""
        nan = Estimate(math.nan, math.inf)
        return nan if self.resonance else self.g.get((j, power), nan)

    def _mirror(self) -> list[int]:
        """The coordinate that is the conjugate of each."""
        values = self.at.values
        return [
            next(i for i in range(self.count) if values[i] == np.conj(values[j]))
            if np.imag(values[j]) != 0.0
            else j
            for j in range(self.count)
        ]

    def _find(self, power: Power) -> None:
        mirrored = tuple(power[self._conjugate[j]] for j in range(self.count))
        if mirrored in self.h:
            one = self.h[mirrored]
            self.h[power] = Estimate(np.conj(one.value), one.error)
            for (j, known), g in list(self.g.items()):
                if known == mirrored:
                    self.g[self._conjugate[j], power] = Estimate(np.conj(g.value), g.error)
            return
        n, values = self.d.curve.n, self.at.values
        if self.map:
            own = math.prod(v**k for v, k in zip(values, power, strict=True))
        else:
            own = sum(k * v for v, k in zip(values, power, strict=True))
        columns = self.at.resonant(power)
        size = max(abs(v) for v in np.linalg.eigvals(self.A))
        for j, value in enumerate(values):
            if j not in columns and abs(own - value) <= NEAR * size:
                self.resonance = "a strong resonance of the frequencies"
        k = len(columns)
        matrix = np.zeros((n + k, n + k), dtype=complex)
        matrix[:n, :n] = own * np.eye(n) - self.A
        for i, j in enumerate(columns):
            matrix[:n, n + i] = self.at.right[j]
            matrix[n + i, :n] = np.conj(self.at.left[j])
        right = self._image(power) - self._moved(power)
        inverse = np.linalg.pinv(matrix) if self.resonance else _inverse(matrix)
        found = inverse[:, :n] @ right.value
        error = np.abs(inverse[:, :n]) @ np.abs(right.error)
        self.h[power] = Estimate(found[:n], error[:n])
        for i, j in enumerate(columns):
            self.g[j, power] = Estimate(complex(found[n + i]), float(error[n + i]))

    def _image(self, power: Power) -> Estimate:
        """The coefficient of f(H), without the derivative along h itself."""
        n = self.d.curve.n
        total = Estimate(np.zeros(n, dtype=complex), np.zeros(n))
        for parts in parted(power):
            found = fed(self.d, *(self.h[one] for one in parts))
            weight = 1.0 / math.prod(math.factorial(k) for k in Counter(parts).values())
            total = total + found * weight
        return total

    def _moved(self, power: Power) -> Estimate:
        """The coefficient of H_w G, of a map H(G), by what is known of them."""
        n = self.d.curve.n
        total = Estimate(np.zeros(n, dtype=complex), np.zeros(n))
        for of, h in self.h.items():
            if sum(of) < 2:
                continue
            if self.map:
                factor = self._composed(of, power)
            else:
                factor = Estimate(0.0, 0.0)
                for j in range(self.count):
                    rest = tuple(
                        p - o + (i == j) for i, (p, o) in enumerate(zip(power, of, strict=True))
                    )
                    if of[j] and (j, rest) in self.g:
                        factor = factor + self.g[j, rest] * of[j]
            if factor.value != 0.0:
                total = total + _times(h, factor)
        return total

    def _composed(self, of: Power, power: Power) -> Estimate:
        """The coefficient of a power in the product of powers of G."""
        factors = [j for j in range(self.count) for _ in range(of[j])]
        series: dict[Power, Estimate] = {(0,) * self.count: Estimate(1.0, 0.0)}
        for j in factors:
            own = {self.units[j]: Estimate(self.at.values[j], 0.0)}
            own.update({known: g for (i, known), g in self.g.items() if i == j})
            more: dict[Power, Estimate] = {}
            for (a, x), (b, y) in product(series.items(), own.items()):
                both = tuple(p + q for p, q in zip(a, b, strict=True))
                if any(p > q for p, q in zip(both, power, strict=True)):
                    continue
                more[both] = more.get(both, Estimate(0.0, 0.0)) + _times(x, y)
            series = more
        return series.get(power, Estimate(0.0, 0.0))


def _inverse(matrix: Complex) -> Complex:
    """The inverse, in units of rows and columns."""
    rows = np.max(np.abs(matrix), axis=1)
    columns = np.max(np.abs(matrix / rows[:, None]), axis=0)
    return np.asarray(np.linalg.inv(matrix / rows[:, None] / columns) / columns[:, None] / rows)


def fed(d: Derivatives, *given: Estimate) -> Estimate:
    """The derivative of f along directions, with what their errors leave of it."""
    found = d.form(*(one.value for one in given))
    loose = sum(
        float(np.max(np.abs(one.error)) / max(float(np.max(np.abs(one.value))), 1e-300))
        for one in given
    )
    return Estimate(found.value, np.abs(found.error) + loose * np.abs(found.value))


def _times(a: Estimate, b: Estimate) -> Estimate:
    return Estimate(a.value * b.value, np.abs(a.value) * b.error + a.error * abs(b.value))


@cache
def powers(count: int, total: int) -> tuple[Power, ...]:
    """All exponents of so many coordinates with a sum."""
    if count == 1:
        return ((total,),)
    return tuple((k, *rest) for k in range(total, -1, -1) for rest in powers(count - 1, total - k))


def parted(power: Power) -> Iterator[tuple[Power, ...]]:
    """All ways to write a power as a product of two or more, whose order does not count."""

    def ways(left: Power, most: Power) -> Iterator[tuple[Power, ...]]:
        if not any(left):
            yield ()
            return
        for part in product(*(range(k + 1) for k in left)):
            if any(part) and part <= most:
                rest = tuple(k - p for k, p in zip(left, part, strict=True))
                for more in ways(rest, part):
                    yield (part, *more)

    for parts in ways(power, power):
        if len(parts) > 1:
            yield parts


def combined(function: Callable[..., Any], *given: Estimate) -> Estimate:
    """A number made of numbers that are known within their errors."""
    values = [np.complex128(one.value) for one in given]
    with np.errstate(all="ignore"):
        found = function(*values)
        error = abs(found) * 4.0 * EPSILON
        for i, one in enumerate(given):
            moved = [*values[:i], one.value + one.error, *values[i + 1 :]]
            error += abs(function(*moved) - found)
    return Estimate(float(np.real(found)), float(error))


def described(
    found: Mapping[str, tuple[Estimate, float]], because: str = ""
) -> tuple[dict[str, float], str]:
    """Coefficients with their sizes of nothing; NaN where errors hide them, and what is said of it.

    A coefficient that is next to zero is known if its error is small beside its unit. Why others
    are not may be known, too.
    """
    form: dict[str, float] = {}
    words = []
    for name, (one, unit) in found.items():
        value, error = float(np.real(one.value)), float(np.max(one.error))
        sure = error <= DIGITS * abs(value) or error <= SMALL * unit
        form[name] = value if sure else math.nan
        if sure and error > CLEAR * abs(value) and error > SMALL * unit:
            words.append(f"{name} is known to {error:.1g} only")
    missing = [name for name, value in form.items() if math.isnan(value)]
    if missing and because:
        words.append(f"{' and '.join(missing)} not known: {because}")
    elif missing:
        words.append(forms.unknown(form))
    return form, "; ".join(words)
