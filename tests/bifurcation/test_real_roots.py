"""Real roots of polynomials against sympy, multiple and clustered ones included."""

from __future__ import annotations

from fractions import Fraction

import numpy as np
import pytest
import sympy

from phasekit.bifurcation.exact.real_roots import (
    common_divisor,
    interpolate,
    multiply,
    quotient,
    unit_roots,
    value,
)

X = sympy.Symbol("x")


def by_sympy(coefficients):
    polynomial = sympy.Poly(list(reversed(coefficients)), X)
    roots = {root for root in polynomial.real_roots() if 0 <= root <= 1}
    return sorted(float(root.evalf(25)) for root in roots)


@pytest.mark.parametrize("seed", range(12))
def test_random_polynomials(seed):
    rng = np.random.default_rng(seed)
    coefficients = [int(c) for c in rng.integers(-9, 10, rng.integers(2, 9))]
    coefficients[-1] = coefficients[-1] or 1
    got = [float(x) for x in unit_roots(coefficients)]
    assert got == pytest.approx(by_sympy(coefficients), abs=1e-15)


@pytest.mark.parametrize("seed", range(6))
def test_multiple_roots_count_once(seed):
    rng = np.random.default_rng(100 + seed)
    roots = [Fraction(int(n), 40) for n in rng.choice(np.arange(1, 40), 4, replace=False)]
    polynomial = [Fraction(1)]
    for root, times in zip(roots, (1, 2, 3, 4), strict=True):
        for _ in range(times):
            polynomial = multiply(polynomial, [-root, 1])
    got = unit_roots(polynomial)
    assert [float(x) for x in got] == pytest.approx(sorted(map(float, roots)), abs=1e-15)


def test_neighbors_at_1e_12_are_told_apart():
    gap = Fraction(1, 10**12)
    polynomial = multiply([Fraction(-1, 3), 1], [-Fraction(1, 3) - gap, 1])
    low, high = unit_roots(polynomial)
    assert float(high - low) == pytest.approx(1e-12, rel=1e-5)


def test_no_real_roots_next_to_the_axis():
    assert unit_roots([Fraction(1, 4) + Fraction(1, 10**12), -1, 1]) == []


def test_roots_at_the_ends():
    assert unit_roots([0, -1, 1]) == [0, 1]
    assert unit_roots([0, 0, 0, 1]) == [0]
    assert unit_roots([]) == unit_roots([0]) == unit_roots([3]) == []


def test_division_and_interpolation():
    rng = np.random.default_rng(1)
    a, b, c = ([Fraction(int(n)) for n in rng.integers(1, 9, 3)] for _ in range(3))
    divisor = common_divisor(multiply(a, c), multiply(b, c))
    whole = sympy.gcd(*(sympy.Poly(list(reversed(multiply(p, c))), X, domain="QQ") for p in (a, b)))
    assert len(divisor) - 1 == whole.degree()
    product = multiply(a, c)
    assert quotient(product, a) == c
    assert interpolate([Fraction(value(product, k)) for k in range(5)]) == product
