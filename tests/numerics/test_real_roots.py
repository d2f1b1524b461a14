"""Real roots of polynomials against sympy, multiple and clustered ones included."""

from __future__ import annotations

from fractions import Fraction

import numpy as np
import pytest
import sympy
from flint import fmpq, fmpq_poly

from phasekit.numerics.real_roots import interpolate, nearest_roots, rational, unit_roots

X = sympy.Symbol("x")


def by_sympy(coefficients):
    polynomial = sympy.Poly(list(reversed(coefficients)), X)
    roots = {root for root in polynomial.real_roots() if 0 <= root <= 1}
    return sorted(float(root.evalf(25)) for root in roots)


def polynomial(*coefficients):
    """The constant term first."""
    return fmpq_poly([rational(c) for c in coefficients])


@pytest.mark.parametrize("seed", range(12))
def test_random_polynomials(seed):
    rng = np.random.default_rng(seed)
    coefficients = [int(c) for c in rng.integers(-9, 10, rng.integers(2, 9))]
    coefficients[-1] = coefficients[-1] or 1
    got = [float(x) for x in unit_roots(polynomial(*coefficients))]
    assert got == pytest.approx(by_sympy(coefficients), abs=1e-15)


@pytest.mark.parametrize("seed", range(6))
def test_multiple_roots_count_once(seed):
    rng = np.random.default_rng(100 + seed)
    roots = [Fraction(int(n), 40) for n in rng.choice(np.arange(1, 40), 4, replace=False)]
    product = polynomial(1)
    for root, times in zip(roots, (1, 2, 3, 4), strict=True):
        product *= polynomial(-root, 1) ** times
    assert [float(x) for x in unit_roots(product)] == pytest.approx(sorted(map(float, roots)))
    # As the nearest doubles, which fractions round to.
    want = sorted(zip(map(float, roots), (1, 2, 3, 4), strict=True))
    assert nearest_roots(product) == want


def test_neighbors_at_1e_12_are_told_apart():
    gap = Fraction(1, 10**12)
    both = polynomial(Fraction(-1, 3), 1) * polynomial(-Fraction(1, 3) - gap, 1)
    low, high = unit_roots(both)
    assert float(high - low) == pytest.approx(1e-12, rel=1e-5)


def test_no_real_roots_next_to_the_axis():
    close = polynomial(Fraction(1, 4) + Fraction(1, 10**12), -1, 1)
    assert unit_roots(close) == nearest_roots(close) == []


def test_roots_at_the_ends():
    assert unit_roots(polynomial(0, -1, 1)) == [0, 1]
    assert unit_roots(polynomial(0, 0, 0, 1)) == [0]
    assert unit_roots(polynomial()) == unit_roots(polynomial(0)) == unit_roots(polynomial(3)) == []


def test_roots_half_way_between_doubles_are_rounded_to_even():
    low, high = 1.0, 1.0 + 2.0**-52
    halfway = (Fraction(low) + Fraction(high)) / 2
    ((root, _),) = nearest_roots(polynomial(-halfway, 1))
    assert root == float(halfway) == low
    barely = halfway + Fraction(1, 2**300)
    assert nearest_roots(polynomial(-barely, 1) * polynomial(2, 0, 1)) == [(high, 1)]


def test_interpolation():
    cubic = polynomial(2, -1, Fraction(1, 3), 7)
    assert interpolate([cubic(fmpq(k)) for k in range(6)]) == cubic
