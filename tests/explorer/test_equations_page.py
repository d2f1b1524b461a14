"""The page of equations as a file: what stands in it, and what is refused. No browser is needed."""

from __future__ import annotations

import re

import numpy as np
import pytest
from explorer.test_page import EQUATIONS, facts, page_of

import phasekit as pk
from phasekit.cli import main
from phasekit.explorer.curves import bifurcation_curves
from phasekit.systems.problem import as_problem

NEURON = EQUATIONS["planar"]


@pytest.mark.slow
@pytest.mark.parametrize("name", EQUATIONS)
def test_the_law_has_places_and_no_names(name):
    problem = as_problem(EQUATIONS[name])
    (law,) = re.findall(r"const LAW = (\{n: .*?\n.*?period: .*?\});", page_of(name), re.S)
    words = set(re.findall(r"[A-Za-z_]\w*", law)) - {"x", "p", "t", "out"}
    words -= {f"t{i}" for i in range(100)}
    allowed = {"n", "discrete", "times", "rates", "slopes", "parts", "part_of", "period", "const"}
    assert words - allowed <= {
        "true",
        "false",
        "null",
        "Math",
        "sin",
        "cos",
        "abs",
        "sign",
        "return",
        "PI",
    }
    assert f"n: {len(problem.state)}, discrete: {str(problem.map).lower()}" in law


def test_names_of_a_page_that_mean_something_in_javascript_are_places():
    names = ["constructor", "document", "p", "t0", "out", "Math", "special", "ψ"]
    rates = {name: f"-{name} + {names[i - 1]}*k" for i, name in enumerate(names)}
    window = dict.fromkeys(names, (-1.0, 1.0))
    page = pk.explore(pk.Problem(rates, parameters={"k": 0.3}, window=window)).html
    (law,) = re.findall(r"const LAW = (\{n: .*?\n.*?period: .*?\});", page, re.S)
    assert not set(re.findall(r"[A-Za-zψ_]\w*", law)) & {"constructor", "document", "ψ", "Math"}


def test_sliders_have_units_ranges_and_what_was_asked_for():
    system = NEURON.described({"I": {"units": "s-1", "long_name": "current"}})
    given = facts(pk.explore(system, over=(), ranges={"I": (0, 2)}, duration=80).html)
    one, two = given["parameters"][:2]
    assert (one["low"], one["high"], one["units"], one["meaning"]) == (0.0, 2.0, "s-1", "current")
    assert (two["low"], two["high"]) == (-0.08, 0.32)
    assert given["duration"] == 80.0
    assert given["maps"] == []
    assert given["written"]["units"]["s-1"]["rpm"] == pytest.approx(2 * np.pi / 60)
    # Twelve turns of the focus at the slowest.
    assert facts(page_of("planar"))["duration"] == 300.0
    assert facts(page_of("forced"))["duration"] == pytest.approx(80 * np.pi)
    plane = facts(pk.explore(EQUATIONS["three states"], over=(), plane=("x", "z")).html)["plane"]
    assert plane == ["x", "z"]


def test_a_window_that_is_not_said_is_where_the_motion_from_the_start_goes():
    system = pk.Problem(
        {"x": "y", "y": "-x", "z": "-z"},
        start={"x": 2.0, "y": 0.0, "z": 1.0},
        window={"y": (-3, 3)},
    )
    x, y, z = facts(pk.explore(system).html)["states"]
    assert x["low"] == pytest.approx(-2.8, rel=1e-2)
    assert (y["low"], y["high"]) == (-3.0, 3.0)
    assert z["high"] == pytest.approx(1.2, rel=1e-2)


@pytest.mark.slow
def test_curves_over_two_parameters_are_those_of_theory():
    """Of x' = m + l x - x^3 the folds are 27 m^2 = 4 l^3; the Brusselator's Hopf is b = 1 + a^2."""
    cusp = pk.Problem("m + l*x - x^3", "x", {"m": 0.0, "l": 1.0}, window={"x": (-2, 2)})
    (found,) = facts(pk.explore(cusp, ranges={"m": (-1, 1), "l": (-1, 2)}).html)["maps"]
    assert {one["kind"] for one in found["curves"]} == {"fold"}
    points = np.concatenate([one["points"] for one in found["curves"]])
    assert len(points) > 20
    np.testing.assert_allclose(27 * points[:, 0] ** 2, 4 * points[:, 1] ** 3, atol=1e-9)
    assert [one["kind"] for one in found["points"]] == ["cusp"]
    assert found["missing"] == []
    brusselator = pk.Problem(
        {"x": "a - (b + 1)*x + x^2*y", "y": "b*x - x^2*y"}, parameters={"b": 1.5, "a": 1.0}
    )
    rest = np.array([[1.0, 1.5]])
    found = bifurcation_curves(brusselator, ("b", "a"), {"b": (0.1, 6), "a": (0.1, 2)}, rest)
    (hopf,) = found["curves"]
    b, a = np.transpose(hopf["points"])
    assert hopf["kind"] == "hopf"
    np.testing.assert_allclose(b, 1 + a**2, atol=1e-9)


def test_what_is_not_found_is_said():
    lonely = pk.Problem({"x": "1 + x^2 + k*y^2", "y": "-l*y"}, parameters={"k": 1.0, "l": 1.0},
                        window={"x": (-2, 2), "y": (-1, 1)})  # fmt: skip
    (found,) = facts(pk.explore(lonely).html)["maps"]
    assert found["curves"] == []
    assert "no equilibrium" in found["missing"][0]


def plain(x, k):
    return [x[1], -k * x[0]]


@pytest.mark.parametrize(
    ("system", "more", "says"),
    [
        (pk.Problem(plain, ("x", "v"), {"k": 1.0}), {}, r"formulas.*pk\.plot\.phase_portrait"),
        (pk.Problem({"x": "-x", "y": "-y"}), {}, "window: got None, wants a range of x, y"),
        (NEURON.replace(I=[0.1, 0.2]), {}, "system: got array parameters"),
        (pk.Problem("-x + sin(t)", "x", time="t", window={"x": (-1, 1)}), {}, "period"),
        (NEURON, {"over": ("I", "q")}, "over: parameter"),
        (NEURON, {"over": "I"}, "over: got 'I', wants a pair"),
        (NEURON, {"over": ("I", "I")}, "over: "),
        (EQUATIONS["forced"], {"over": ("F", "d")}, "no equilibria"),
        (NEURON, {"ranges": {"I": (1, 2)}}, r"ranges\['I'\]: .*round the value 0.5"),
        (NEURON, {"ranges": {"q": (1, 2)}}, "ranges: parameter"),
        (NEURON, {"ranges": [1]}, "ranges: got "),
        (NEURON, {"window": {"q": (0, 1)}}, "window: state"),
        (NEURON, {"window": {"v": (1, 0)}}, r"window\['v'\]: "),
        (NEURON, {"window": 3}, "window: got 3"),
        (NEURON, {"plane": ("v", "v")}, "plane: "),
        (NEURON, {"duration": 0.0}, "duration: got 0.0"),
        (EQUATIONS["map"], {"duration": 2.5}, "duration: got 2.5, wants a whole number"),
        (pk.Pendulum(length=1.0), {"plane": ("phi", "dphi")}, "plane: .*nothing for a system in a"),
    ],
)
def test_what_has_no_page_is_refused_by_its_name(system, more, says):
    with pytest.raises(pk.ParameterError, match=says):
        pk.explore(system, **more)


MODEL = """
duration = 150
[rates]
v = "v - v^3/3 - w + I"
w = "eps*(v + a - b*w)"
[parameters]
I = 0.5
eps = 0.08
a = 0.7
b = 0.8
[window]
v = [-2.5, 2.5]
w = [-1, 2]
"""
ODE = """
par k=2 d=0.1
init x=1 v=0
x'=v
v'=-k*x-d*v
@ total=40
done
"""


@pytest.mark.slow
def test_the_command_shows_files_of_equations(tmp_path, capsys):
    out = tmp_path / "page.html"
    common = ["--output", str(out), "--overwrite", "--no-open"]
    (tmp_path / "model.toml").write_text(MODEL)
    (tmp_path / "model.ode").write_text(ODE)
    words = ["--I", "0.6", "--over", "I,b", "--range", "I=0:2"]
    assert main(["explore", str(tmp_path / "model.toml"), *words, *common]) == 0
    given = facts(out.read_text(encoding="utf-8"))
    assert given["duration"] == 150.0
    one = given["parameters"][0]
    assert (one["value"], one["low"], one["high"]) == (0.6, 0.0, 2.0)
    assert [(m["x"], m["y"]) for m in given["maps"]] == [("I", "b")]
    assert main(["explore", str(tmp_path / "model.ode"), *common]) == 0
    given = facts(out.read_text(encoding="utf-8"))
    assert [one["name"] for one in given["states"]] == ["x", "v"]
    assert given["duration"] == 40.0
    capsys.readouterr()
    for words, says in ((["--over", "I"], "over"), (["--range", "I"], "NAME=FROM:TO")):
        assert main(["explore", str(tmp_path / "model.toml"), *words, *common]) == 2
        assert says in capsys.readouterr().err


def test_a_problem_of_a_system_shows_that_system():
    problem = pk.Problem.from_system(pk.Pendulum(length=0.5))
    assert pk.explore(problem).html == pk.explore(pk.Pendulum(length=0.5)).html
