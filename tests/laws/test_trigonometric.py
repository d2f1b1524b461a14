"""Laws against sympy: what is derived from the products, and the coefficients themselves."""

from __future__ import annotations

import numpy as np
import pytest
import sympy

import phasekit as pk
from phasekit.laws.trigonometric import entries, named

MODELS = (
    pk.GyroRotorDisk,
    pk.Reduced,
    pk.Coefficients,
    pk.ParticleOnCircle,
    pk.Pendulum,
    pk.StonerWohlfarth,
)


def symbols_of(law):
    return {name: sympy.Symbol(name, real=True) for name in law.domains}


def value_at(law, atom, values):
    """A factor as a sympy expression."""
    turned = {
        name: (sympy.sin(x), sympy.cos(x), 1) if name in law.angles else x
        for name, x in values.items()
    }
    return atom(turned)


@pytest.mark.parametrize("model", MODELS, ids=lambda m: m.__name__)
def test_products_multiply_out_to_the_coefficients(model):
    law = model.trigonometric()
    symbols = symbols_of(law)
    A, B, C = law.formulas(symbols)
    *products, scale = law.symbolic
    for product, coefficient in zip(products, (A, B, C), strict=True):
        ratio = value_at(law, product, symbols) / value_at(law, scale, symbols)
        assert sympy.simplify(ratio - coefficient) == 0
    found = set().union(*(x.free_symbols for x in (A, B, C)))
    assert {str(x) for x in found} == set(law.parameters)


@pytest.mark.parametrize("model", MODELS, ids=lambda m: m.__name__)
def test_formulas_are_the_coefficients_in_floating_point(model):
    rng = np.random.default_rng(3)
    law = model.trigonometric()
    symbols = symbols_of(law)
    formulas = law.formulas(symbols)
    for _ in range(5):
        values = {}
        for p in model.declared:
            low, high = max(p.low, -3.0), min(p.high, 3.0)
            values[p.name] = float(rng.uniform(max(low, 0.1), high))
        got = model(**values).coefficients()
        at = {symbols[name]: sympy.Float(x, 40) for name, x in values.items()}
        for x, formula in zip(got, formulas, strict=True):
            want = float(sympy.N(formula.subs(at), 40))
            assert x == pytest.approx(want, rel=2e-15, abs=1e-15)


def test_factors_of_the_disk():
    """A changes sign with 2 e s -+ r c; B vanishes with g, C with a, both with e and s."""
    law = pk.GyroRotorDisk.trigonometric()
    symbols = symbols_of(law)
    e, r, beta = symbols["e"], symbols["r"], symbols["beta"]
    s, c = sympy.sin(beta), sympy.cos(beta)
    signs = {value_at(law, factor, symbols) for factor in law.sign_changes}
    assert signs == {2 * e * s - r * c, 2 * e * s + r * c}
    zeros = {value_at(law, z.factor, symbols): (z.of_B, z.of_C) for z in law.zeros}
    assert zeros == {
        symbols["g"]: (True, False),
        symbols["a"]: (False, True),
        e: (True, True),
        s: (True, True),
    }


def test_what_keeps_its_sign_or_never_vanishes_is_no_factor():
    particle = pk.ParticleOnCircle.trigonometric()
    assert particle.sign_changes == ()  # radius omega^2 cos(tilt)^2
    assert [(z.of_B, z.of_C) for z in particle.zeros] == [(True, False), (False, True)]
    (K,) = pk.StonerWohlfarth.trigonometric().sign_changes
    assert K({"K": 3.0}) == 3.0


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(40))
def test_sums_and_products_against_sympy(seed):
    """Random expressions: the value, the degree, and that every factor divides its product."""
    rng = np.random.default_rng(seed)
    names = ("a", "b", "c")
    mine = {name: named(name) for name in names}
    theirs = {name: sympy.Symbol(name) for name in names}
    sine, cosine, _ = entries("t")
    S, K = sympy.symbols("S K")
    pairs = [(mine[n], theirs[n]) for n in names] + [(sine, S), (cosine, K)]
    for _ in range(7):
        (x, X), (y, Y) = (pairs[i] for i in rng.integers(len(pairs), size=2))
        k = int(rng.integers(-3, 4))
        pairs.append([(x * y, X * Y), (x + k * y, X + k * Y), (k - x, k - X), (x**2, X**2)][
            rng.integers(4)
        ])  # fmt: skip
    got, want = pairs[-1]
    values = {**theirs, "t": (S, K, 1)}
    assert sympy.expand(got(values) - want) == 0
    expanded = sympy.expand(want)
    for name in names:
        if expanded != 0:
            assert got.degree(name) >= sympy.degree(expanded, theirs[name])
    for atom in got.atoms:
        assert sympy.rem(expanded, sympy.expand(atom(values)), *_generators(atom, values)) == 0


def _generators(atom, values):
    return sorted(sympy.sympify(atom(values)).free_symbols, key=str)
