"""Functions of the multipliers and the tangent whose signs change at special points of families."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from itertools import combinations

import numpy as np

from phasekit.arrays import Complex
from phasekit.cycles.point import Point

ROUNDED = 1e-14  # least relative error of a matrix of multipliers
SURE = 100.0  # times an error that tells: that of a product of matrices far from normal is larger
LARGEST = 2.0**1000  # products beyond which differences may be no numbers
CRITICAL = 1e-3  # distance from 1 of multipliers that may be those of a fold


def nontrivial(values: Complex, forced: bool) -> list[complex]:
    """Multipliers but for the one that is 1 for every orbit of an autonomous system."""
    mu: list[complex] = values.tolist()
    if not forced:
        mu.remove(min(mu, key=lambda one: abs(one - 1.0)))
    return mu


def _of_size(mu: list[complex]) -> list[complex]:
    """Those that are not 0, as most of very many are."""
    return [one for one in mu if one != 0.0]


def unstable(values: Complex, forced: bool) -> int:
    """Number of multipliers outside the unit circle."""
    return sum(abs(mu) > 1.0 for mu in nontrivial(values, forced))


def none_passes(a: Point, b: Point, forced: bool) -> bool:
    """Whether the number of real multipliers beyond 1 stays odd or even, unlike at a fold.

    Nothing is known of it next to a fold, where one is 1 but for errors.
    """
    beyond = 0
    for point in (a, b):
        mu = nontrivial(point.multipliers, forced)
        if any(abs(one - 1.0) < CRITICAL for one in mu):
            return False
        beyond += sum(one.imag == 0.0 and one.real > 1.0 for one in mu)
    return beyond % 2 == 0


def fold_test(point: Point, forced: bool) -> float:
    """The tangent's part along the parameter."""
    return float(point.dy[1])


def _size(z: complex) -> float:
    return 1.0 + math.hypot(z.real, z.imag)


def _parts(values: Sequence[complex], at: float) -> complex:
    """Product of at - z, each beside its size."""
    return math.prod((at - z) / _size(z) for z in values)


def _held(found: complex, test: float) -> float:
    """A number that is nearly straight; where none holds it, the largest one of a test's sign.

    So all numbers of a search have one scale. Of what is not known it is NaN, as the test is.
    """
    if math.isnan(test):
        return test
    fits = -LARGEST < found.real < LARGEST
    return found.real if fits else math.copysign(LARGEST, test)


def doubling_test(point: Point, forced: bool) -> float:
    """det(M + 1), each factor beside its size."""
    return _parts([-mu for mu in point.multipliers.tolist()], 1.0).real


def doubling_whole(point: Point, forced: bool) -> float:
    """det(M + 1), which is nearly straight where each factor beside its size jumps."""
    found: complex = math.prod(1.0 + mu for mu in point.multipliers.tolist())
    return _held(found, doubling_test(point, forced))


def torus_test(point: Point, forced: bool) -> float:
    """Product of 1 - mu_i mu_j over pairs, each beside its size."""
    mu = _of_size(nontrivial(point.multipliers, forced))
    return _parts([a * b for a, b in combinations(mu, 2)], 1.0).real


def conjugate(point: Point, forced: bool) -> bool:
    """Whether the two multipliers whose product is next to 1 are no real ones."""
    pairs = list(combinations(_of_size(nontrivial(point.multipliers, forced)), 2))
    if not pairs:
        return False
    one, _ = min(pairs, key=lambda pair: abs(1.0 - pair[0] * pair[1]))
    return complex_pair(point, one)


def complex_pair(point: Point, one: complex) -> bool:
    """Whether a multiplier is one of a conjugate pair, for all that its error lets one say.

    Errors of the matrix part a double real one into a pair at the root of their size.
    """
    error = max(point.trivial_error, point.liouville_error, ROUNDED)
    largest = max(1.0, float(np.max(np.abs(point.multipliers))))
    return one.imag**2 > SURE * error * largest * abs(one)


def second_doubling(point: Point, forced: bool) -> float:
    """Derivative of det(M - mu) at -1, where one multiplier is that."""
    mu = nontrivial(point.multipliers, forced)
    rest = ([-one for one in mu[:i] + mu[i + 1 :]] for i in range(len(mu)))
    return sum(_parts(part, 1.0).real for part in rest) if len(mu) > 1 else 1.0


def determinant(point: Point, forced: bool) -> float:
    """det(M - 1) or, of an autonomous system, the derivative of det(M - mu) at 1.

    Beside the product of all sizes.
    """
    mu = _of_size(point.multipliers.tolist())
    if forced:
        return _parts(mu, 1.0).real
    return sum(_parts(rest, 1.0).real / _size(one) for one, rest in _each(point, mu))


def determinant_whole(point: Point, forced: bool) -> float:
    """The same, its factors as they are."""
    mu = _of_size(point.multipliers.tolist())
    rests = [mu] if forced else [rest for _, rest in _each(point, mu)]
    found: complex = sum(math.prod(1.0 - mu for mu in rest) for rest in rests)
    return _held(found, determinant(point, forced))


def _each(point: Point, mu: list[complex]) -> Iterator[tuple[complex, list[complex]]]:
    """Each multiplier with the others, where there are some."""
    if len(point.multipliers) > 1:
        for i, one in enumerate(mu):
            yield one, mu[:i] + mu[i + 1 :]
