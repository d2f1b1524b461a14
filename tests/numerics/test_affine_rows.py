"""Sums of formulas that are affine in the states, by exact algebra."""

import numpy as np
import pytest
import sympy as sp

from phasekit.numerics.intervals.affine_rows import affine_rows
from phasekit.numerics.intervals.sheets import Sheets

X, Y, Z, P, Q, R = sp.symbols("x y z p q r")
BURNT = P * (1 - X) * sp.exp(Y)


@pytest.mark.parametrize("r", [14.0, -0.1])
def test_what_cancels_is_left_out(r):
    f = [-X + BURNT, -Y + R * BURNT - Q * Y]
    exact = sp.Rational(r)
    rows = affine_rows(f, [X, Y], {R: r})
    assert rows[0] == f[0]
    assert sp.simplify(rows[1] / (exact * X - Y - Q * Y)).is_number


@pytest.mark.parametrize("seed", range(6))
def test_zeros_stay_the_same(seed):
    """The new formulas are those times a matrix of numbers that has an inverse."""
    rng = np.random.default_rng(seed)
    rates = [X * Y, sp.exp(Z) * P, X**2, Q * sp.tanh(X * Z)][: int(rng.integers(1, 4))]
    f = [
        sum(float(w) * one for w, one in zip(rng.choice([0, 1, -2, 0.1], 4), rates, strict=False))
        + sum(int(k) * x for k, x in zip(rng.integers(-3, 4, 3), (X, Y, Z), strict=True))
        + P * int(rng.integers(0, 2))
        for _ in range(3)
    ]
    exact = [one.xreplace({d: sp.Rational(d) for d in one.atoms(sp.Float)}) for one in f]
    rows = affine_rows(f, [X, Y, Z], {})
    matrix = sp.eye(3)
    for i, row in enumerate(rows):
        if row == f[i]:
            continue
        weights = sp.symbols("w:3")
        left = sp.expand(row - sum(w * one for w, one in zip(weights, exact, strict=True)))
        equations = sp.Poly(left, *{X, Y, Z, P, *rates} & left.free_symbols, *[
            g for g in left.atoms(sp.exp, sp.tanh)]).coeffs()  # fmt: skip
        (found,) = sp.linsolve(equations, weights)
        matrix[i, :] = sp.Matrix([found]).subs(dict.fromkeys(weights, 0))
        assert all(sp.diff(row, a, b) == 0 for a in (X, Y, Z) for b in (X, Y, Z))
    assert matrix.det() != 0


def test_formulas_that_share_nothing_stay():
    f = [X * Y - P, X**2 + Y**2 - 1]
    assert affine_rows(f, [X, Y], {}) == f


@pytest.mark.parametrize(
    "outer",
    [lambda one: one, sp.sin, lambda one: 1 / one, lambda one: one ** sp.Rational(101, 100)],
)
def test_powers_of_sums_are_not_multiplied_out(outer):
    """Of the fifth as many operations there would be 46,376 terms."""
    steep = outer((X + Y + Z + P + Q) ** 30)
    f = [-X + steep, -Y + steep]
    assert affine_rows(f, [X, Y, Z], {}) == f
    few = outer((X + Y + Z + P + Q) ** 3)
    assert affine_rows([-X + few, -Y + few], [X, Y, Z], {})[1] in (X - Y, Y - X)


def test_a_plane_is_proved_in_which_two_rates_share_a_steep_term():
    """Along y = 14 x / (1 + q) equilibria merge where 14 x (1 - x) = 1 + q, so not for q > 2.5."""
    f = [-X + BURNT, -Y + R * BURNT - Q * Y]
    window = np.zeros(2), np.array([1.0, 14.0])
    sheets = Sheets(f, [X, Y], [P, Q], {R: 14.0}, window, np.array([False, False]))
    found = sheets.changes(np.array([0.2, 3.0]), np.array([0.4, 4.0]), 4)
    assert found.merging.mean() < 0.1  # a third by the rates alone
