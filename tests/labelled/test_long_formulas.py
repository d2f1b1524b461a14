"""Formulas of thousands of operations: special points that do not depend on their length."""

import numpy as np
import sympy as sp

import phasekit as pk
from phasekit.numerics import long_formulas

X, MU, L = sp.symbols("x mu l", real=True)


def long_function(terms):
    """A function of x that rises everywhere: 4 operations a term."""
    k = range(1, terms + 1)
    return X + sp.Add(*(sp.Rational(i % 7 - 3, 9 * i * terms) * sp.sin(i * X / 5) for i in k))


def test_a_cusp_seen_through_two_thousand_operations():
    h = long_function(540)
    problem = pk.Problem(MU + L * h - h**3, "x", {"mu": -1.0, "l": 1.0})
    at, slope = (sp.lambdify(X, one, "numpy") for one in (h, h.diff(X)))
    branch = pk.continuation(problem, "mu", x0=[-1.3], span=(-1.0, 1.0))
    folds = branch.special("LP")
    np.testing.assert_allclose([at(f.x[0]) for f in folds], [-np.sqrt(1 / 3), np.sqrt(1 / 3)])
    np.testing.assert_allclose([f["mu"] for f in folds], np.array([1, -1]) * np.sqrt(4 / 27))
    # f'' = -6 h h'^2 there, and folds of x' = a x^2 have a = f''/2.
    rises = [slope(f.x[0]) for f in folds]
    wanted = [-3.0 * at(f.x[0]) * rise**2 for f, rise in zip(folds, rises, strict=True)]
    found = [f.normal_form["a"] for f in folds]
    np.testing.assert_allclose(np.abs(found), np.abs(wanted), rtol=1e-9)
    (cusp,) = folds[0].curve("l", (-1.0, 2.0)).special("CP")
    assert max(abs(cusp["mu"]), abs(cusp["l"])) < 1e-12


def hopf_point(name):
    """The Hopf point of a Brusselator with a ripple; formulas that differ are compiled anew."""
    ripple = " + ".join(f"{1 / k:.3f}*sin({k}*x*y/10)*(x - 1)**3" for k in range(1, 9))
    problem = pk.Problem(
        [f"1 - ({name} + 1)*x + x**2*y + ({ripple})", f"{name}*x - x**2*y - ({ripple})*y"],
        ("x", "y"), {name: 1.5},
    )  # fmt: skip
    (point,) = pk.continuation(problem, name, x0=[1.0, 1.5], span=(1.0, 3.0)).special("H")
    return point[name], point.normal_form["l1"]


def test_normal_forms_do_not_depend_on_how_derivatives_are_made(monkeypatch):
    by_formulas = hopf_point("b")
    monkeypatch.setattr(long_formulas, "LONG", 10)
    np.testing.assert_allclose(hopf_point("c"), by_formulas, rtol=1e-11)
    assert abs(by_formulas[0] - 2.0) < 1e-12


def test_formulas_inside_formulas():
    """Eight steps of the logistic map, put into one another: 24 operations, of degree 256."""
    x, r = sp.symbols("x r", real=True)
    eight, at = x, 0.5
    for _ in range(8):
        eight = r * eight * (1 - eight)
    for _ in range(8000):
        at = 3.55 * at * (1.0 - at)
    once = pk.Problem("r*x*(1 - x)", "x", {"r": 3.55}, map=True)
    found = []
    for problem in (pk.Problem(eight, "x", {"r": 3.55}, map=True), once.iterated(8)):
        (point,) = pk.continuation(problem, "r", x0=[at], span=(3.55, 3.566)).special("PD")
        found.append((point["r"], point.normal_form["c"]))
    np.testing.assert_allclose(found[0], found[1], rtol=1e-9)
    assert abs(found[0][0] - 3.5644072660954325977) < 1e-12
