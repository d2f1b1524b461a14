"""Definitions and functions in the formulas of a problem, against the formulas written out."""

from __future__ import annotations

import math

import numpy as np
import pytest
import sympy

import phasekit as pk

#: Morris and Lecar's neuron with MatCont's parameters.
VALUES = {
    "I": 0.0, "gca": 4.4, "vca": 120.0, "gk": 8.0, "vk": -84.0, "gl": 2.0, "vl": -60.0, "C": 20.0,
    "phi": 0.04, "v1": -1.2, "v2": 18.0, "v3": 2.0, "v4": 30.0,
}  # fmt: skip


def morris_lecar():
    return pk.Problem(
        {
            "v": "(I - gca*minf*(v - vca) - gk*w*(v - vk) - gl*(v - vl))/C",
            "w": "phi*(winf - w)*cosh((v - v3)/(2*v4))",
        },
        parameters=VALUES,
        definitions={"minf": "half((v - v1)/v2)", "winf": "half((v - v3)/v4)"},
        functions={"half(x)": "(1 + tanh(x))/2"},
        window={"v": (-80.0, 60.0), "w": (-0.1, 1.0)},
    )


def test_a_neuron_is_the_one_written_out():
    neuron = morris_lecar()
    v, w = -20.0, 0.3
    p = VALUES
    m = 0.5 * (1.0 + math.tanh((v - p["v1"]) / p["v2"]))
    n = 0.5 * (1.0 + math.tanh((v - p["v3"]) / p["v4"]))
    flow = p["I"] - p["gca"] * m * (v - p["vca"]) - p["gk"] * w * (v - p["vk"])
    flow -= p["gl"] * (v - p["vl"])
    wanted = [flow / p["C"], p["phi"] * (n - w) * math.cosh((v - p["v3"]) / (2.0 * p["v4"]))]
    np.testing.assert_allclose(neuron([v, w]), wanted, rtol=1e-14)
    again = pk.Problem.from_specification(neuron.specification())
    np.testing.assert_array_equal(again([v, w]), neuron([v, w]))
    branch = pk.continuation(neuron, "I", x0=[-60.0, 0.0], span=(0.0, 300.0))
    found = [point["I"] for point in branch.special("hopf")]
    np.testing.assert_allclose(found, [93.85762, 212.01882], atol=5e-6)  # MatCont's


def test_names_stand_for_formulas_of_those_before_them():
    problem = pk.Problem(
        "g(x, a)^2 - q", "x", {"a": 2.0}, definitions={"p": "x + a", "q": "3*p^2"},
        functions={"g(u, s)": "u*s", "h(u)": "g(u, u)"},
    )  # fmt: skip
    x, a = sympy.symbols("x a", real=True)
    assert sympy.expand(problem.f[0] - ((x * a) ** 2 - 3 * (x + a) ** 2)) == 0
    # The variables of a function are its own, whatever the states are called.
    other = pk.Problem("g(2*x)", "x", functions={"g(x)": "x^3"})
    assert float(other([1.0])[0]) == 8.0


@pytest.mark.parametrize(
    ("keywords", "message"),
    [
        ({"functions": {"s": "x"}}, r"functions: got 's', wants forms such as"),
        ({"functions": {"sin(x)": "x"}}, "functions: got 'sin', wants a name that is not taken"),
        ({"functions": {"g(x, x)": "x"}}, r"functions\['g\(x, x\)'\]: .*differ"),
        ({"functions": {"g(lambda)": "1"}}, "no keywords"),
        ({"functions": {"g(u)": "u + z"}}, r"functions\['g\(u\)'\]: got the unknown symbol z"),
        ({"definitions": {"x": "1"}}, "definitions: got 'x', wants a name that is not taken"),
        ({"definitions": {"q": "z + 1"}}, r"definitions\['q'\]: got the unknown symbol z"),
        ({"definitions": [("q", "1")]}, "definitions: .* a mapping"),
    ],
)
def test_what_is_no_shorthand_is_refused_by_name(keywords, message):
    with pytest.raises(pk.ParameterError, match=message):
        pk.Problem("x", "x", **keywords)


def test_calls_have_as_many_arguments_as_the_function():
    for text, message in (("g(x)", "g with 1 arguments; it takes 2"), ("g + x", "write g")):
        with pytest.raises(pk.ParameterError, match=message):
            pk.Problem(text, "x", functions={"g(u, v)": "u*v"})
    with pytest.raises(pk.ParameterError, match="f: got '{}', wants equations"):
        pk.Problem({})
    with pytest.raises(pk.ParameterError, match="definitions: .* no formula"):
        pk.Problem(lambda x: x, "x", definitions={"q": "x"})
    with pytest.raises(pk.ParameterError, match=r"np.sin at character 1; write sin\(...\)"):
        pk.Problem("np.sin(x)", "x")


def test_symbols_are_names():
    x, y, m, w = sympy.symbols("x y m w")
    t = sympy.Symbol("t", real=True)
    named = pk.Problem(
        ["y", "m*y - x + sin(w*t)"], ("x", "y"), {"m": 0.1, "w": 1.0}, time="t", period="2*pi/w",
        window={"x": (-1, 1)}, periods={"x": 2.0}, start={"y": 0.5}, observables={"e": "x^2"},
    )  # fmt: skip
    f = [y, m * y - x + sympy.sin(w * t)]
    more = {
        "parameters": {m: 0.1, w: 1.0}, "time": t, "period": 2 * sympy.pi / w,
        "window": {x: (-1, 1)}, "periods": {x: 2.0}, "start": {y: 0.5}, "observables": {"e": x**2},
    }  # fmt: skip
    matrices, mapping = (sympy.Matrix(f), sympy.Matrix([x, y])), ({x: f[0], y: f[1]}, None)
    for right, state in ((f, [x, y]), matrices, mapping):
        assert pk.Problem(right, state, **more) == named
