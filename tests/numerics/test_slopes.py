"""Derivatives are the trees that sympy's `diff` makes, of whatever a formula may hold."""

import random

import pytest
import sympy as sp

from phasekit.numerics.slopes import jacobian, slope

X = sp.symbols("x y mu", real=True)
ONE = (sp.sin, sp.exp, sp.log, sp.tanh, sp.cosh, sp.atan, sp.erf, sp.Abs, sp.sign, sp.sqrt, sp.Si,
       sp.LambertW, sp.Heaviside, sp.loggamma)  # fmt: skip
TWO = (sp.Add, sp.Mul, sp.Pow, sp.atan2, sp.Max, sp.besselj, sp.Function("g"))


def formula(chance: random.Random, depth: int) -> sp.Expr:
    """A random formula."""
    if depth == 0:
        return chance.choice([*X, *X, sp.Integer(2), sp.Rational(-1, 3), sp.Float(0.7)])
    a, b = (formula(chance, depth - 1) for _ in range(2))
    match chance.randrange(7):
        case 0:
            return chance.choice(ONE)(a + X[0])
        case 1:
            return chance.choice(TWO)(a, b)
        case 2:
            return sp.Piecewise((a, X[0] > b + X[1]), (b, True))
        case 3:
            return (a + X[1]) ** chance.choice([-2, 3, sp.Rational(1, 2)])
        case 4:
            return a + b
        case _:
            return a * b


@pytest.mark.slow
def test_random_formulas():
    chance, tried = random.Random(5), 0
    while tried < 25:
        e = formula(chance, 3)
        if not e.free_symbols or e.has(sp.zoo, sp.nan):
            continue
        row = [e.diff(x) for x in X]
        assert jacobian([e, e], X) == [row, row]
        along = sp.Add(*(one * x for one, x in zip(row, X, strict=True)))
        if sp.count_ops(along) < 200:
            assert slope(along, X[0]) == along.diff(X[0])
        tried += 1


@pytest.mark.parametrize("e", [sp.Integer(3), X[1], sp.gamma(2), sp.pi * X[1] ** sp.E])
def test_what_stands_still_has_none(e):
    assert slope(e, X[0]) is sp.S.Zero
    assert jacobian([e], X[:1]) == [[0]]


def test_functions_without_a_rule_of_their_own_keep_sympys():
    class Bare(sp.Function):
        def fdiff(self, argindex=1):
            raise sp.core.function.ArgumentIndexError(self, argindex)

    e = Bare(X[0] ** 2)
    assert slope(e, X[0]) == e.diff(X[0])
