"""The registry of special points: whatever an engine finds has its entry."""

import ast
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

import phasekit
import phasekit as pk
from phasekit.bifurcation.continuation import locate
from phasekit.bifurcation.continuation.points import branch_point, pair
from phasekit.bifurcation.continuation.points.special import CONVERGED, Special
from phasekit.bifurcation.special_points import KINDS, TESTS
from phasekit.cycles import events
from phasekit.plot.parts.style import POINTS_OF

#: Where special points are made, and by which calls.
FOLDERS = [Path(phasekit.__file__).parent / name for name in ("bifurcation", "cycles")]


def made() -> set[str]:
    """Kinds that the sources name where they make a special point."""
    names = set()
    for path in (path for folder in FOLDERS for path in folder.rglob("*.py")):
        for node in ast.walk(ast.parse(path.read_text())):
            if isinstance(node, ast.Call) and getattr(node.func, "id", "") == "Special":
                names |= {
                    leaf.value
                    for leaf in ast.walk(node.args[0])
                    if isinstance(leaf, ast.Constant) and isinstance(leaf.value, str)
                }
    return names


@pytest.mark.slow
def test_all_kinds_that_are_made_are_registered():
    names = made()
    assert {"fold", "hopf", "branch_point", "bogdanov_takens"} <= names
    assert names <= set(KINDS)


def test_a_kind_that_is_not_registered_cannot_be():
    with pytest.raises(ValueError, match="no special point is a 'fald'"):
        Special("fald", np.zeros(2), (0.0, 1.0), 0.0, CONVERGED)


def test_every_kind_but_ends_has_its_own_look():
    looks = [(look["marker"], look["markerfacecolor"]) for look in POINTS_OF.values()]
    assert set(POINTS_OF) == set(KINDS) - {"end"}
    assert len(set(looks)) == len(looks) >= 11


def test_all_tests_are_of_kinds_that_are_registered():
    kinds = [test.kind for test in (*TESTS, *events.TESTS)]
    assert len(kinds) >= 11
    assert set(kinds) <= set(KINDS)
    assert {test.change for test in locate.TESTS} == {"branch", "fold", "flip", "pair", "touch"}


@pytest.mark.parametrize(
    ("kind", "f", "start", "span", "is_map"),
    [
        ("fold", {"x": "p - x**2"}, (1.0, [1.0]), (-1.0, 2.0), False),
        ("transcritical", {"x": "p*x - x**2"}, (-1.0, [0.0]), (-1.0, 1.0), False),
        ("pitchfork", {"x": "p*x - x**3"}, (-1.0, [0.0]), (-1.0, 1.0), False),
        ("hopf", {"x": "p*x - y - x**3", "y": "x + p*y"}, (-0.5, [0.0, 0.0]), (-0.5, 0.5), False),
        ("period_doubling", {"x": "p*x*(1 - x)"}, (2.0, [0.5]), (2.0, 3.3), True),
        ("torus", {"x": "p*x*(1 - y)", "y": "x"}, (1.5, [1 / 3, 1 / 3]), (1.5, 2.2), True),
    ],
)
def test_a_normal_form_has_the_coefficients_that_the_registry_names(kind, f, start, span, is_map):
    problem = pk.Problem(f, state=tuple(f), parameters={"p": start[0]}, map=is_map)
    (point,) = pk.continuation(problem, "p", x0=start[1], span=span).special(kind)
    assert set(point.normal_form) == set(KINDS[kind].normal_form)
    assert np.isfinite(list(point.normal_form.values())).all()


def test_where_zero_is_an_eigenvalue_too_a_pair_has_no_first_coefficient():
    """There it has a pole; the matrix is singular to the last bit."""
    slopes = np.array([[0.0, -1.0, 0.0, 0.0], [1.0, 0.0, 0.0, 0.0], [0.0, 0.0, 0.0, 0.0]])
    form = pair.normal_form(SimpleNamespace(curve=SimpleNamespace(n=3), slopes=slopes), 1.0)
    assert np.isnan([form["l1"], form["d"]]).all()
    assert form["omega"] == 1.0


@pytest.mark.parametrize("apart", [1e-4, 1e-5, 3e-6])
def test_a_fold_next_to_a_crossing_is_told_from_a_pitchfork(apart):
    """The side branch p = (x - d)^2 - d^2 meets x = 0 at p = 0 and turns at x = d."""
    near = pk.Problem("x*(p - (x - d)^2 + d^2)", "x", {"p": -1.0, "d": apart})
    flat = pk.continuation(near, "p", x0=[0.0], span=(-1, 1)).special_points
    assert [one.kind for one in flat] == ["end", "transcritical", "end"]
    assert abs(flat[1].normal_form["a"]) == pytest.approx(2 * apart, rel=1e-6)
    start = [apart + np.sqrt(1 + apart**2)]
    side = pk.continuation(near.replace(p=1.0), "p", x0=start, span=(-1, 1)).special_points
    assert [one.kind for one in side] == ["end", "transcritical", "fold", "end"]
    np.testing.assert_allclose([side[2]["p"], side[2].x[0]], [-(apart**2), apart], rtol=1e-6)


def test_one_state_has_no_point_of_corank_two(monkeypatch):
    """Where a step is in doubt one of two is looked for, far out through rounding."""
    branch = pk.continuation(pk.Problem("p*x - x^2", "x", {"p": 1.0}), "p", x0=[1.0], span=(-1, 1))
    asked, refine = [], branch_point.refine
    kept = lambda curve, u, k, reach: asked.append(k) or refine(curve, u, k, reach)  # noqa: E731
    monkeypatch.setattr(branch_point, "refine", kept)
    curve, crossing = branch.walker.curve, np.zeros(2)
    assert branch_point.singular_point(curve, crossing, 0.1, 0.2, least=2) is None
    assert branch_point.singular_point(curve, crossing, 0.1, 0.2).corank == 1
    assert set(asked) == {1}


def test_two_folds_that_cross_are_no_pitchfork_and_no_double_zero_of_one_vector():
    """Z' = p - z^2 of a complex z: f_x = 0 at p = 0, where z turns from real to imaginary."""
    plane = pk.Problem({"x": "p - x^2 + y^2", "y": "-2*x*y"}, parameters={"p": 1.0})
    (point,) = pk.continuation(plane, "p", x0=[1.0, 0.0], span=(-1, 1)).special("BP")
    assert point.kind == "branch_point"
    assert not point.normal_form
    assert "a fold of each; two eigenvalues vanish here, with two eigenvectors" in point.message


@pytest.mark.parametrize("unit", [1.0, 1e-6, 1e6])
def test_coefficients_at_a_double_zero_are_those_of_the_second_derivative(unit):
    """X'' = x (p - p^2) - x^3 + 2 p x': exactly at p = 0 the null vectors are at right angles."""
    law = {"x": "y/u + p*x", "y": "u*(p*x - x^3) + p*y"}
    plane = pk.Problem(law, parameters={"p": -1.0, "u": unit})
    point, other = pk.continuation(plane, "p", x0=[0.0, 0.0], span=(-1, 1.5)).special("BP")
    assert point["p"] == pytest.approx(0.0, abs=1e-12)  # of a span of 2.5
    assert point.normal_form == pytest.approx({"d": 1.0, "c": -1.0}, rel=1e-9)
    assert "a Bogdanov-Takens point" in point.message
    # There the other eigenvalue is 2: x' = (x (p - p^2) - x^3)/(-2), of a unit vector.
    assert other.normal_form["d"] == pytest.approx(0.5, rel=1e-9)


@pytest.mark.parametrize("code", [False, True])
def test_a_pitchfork_where_the_parameter_is_next_to_nothing_of_its_span(code):
    """At a = 30, r = exp(-30): r moves there on one branch, as far as f can tell."""
    if code:
        problem = pk.Problem(
            lambda x, r: [r * np.exp(x[0]) - 1.0, (x[0] - 30.0) * x[1] - x[1] ** 3],
            ["a", "b"], {"r": 1.0},
        )  # fmt: skip
    else:
        problem = pk.Problem({"a": "r*exp(a) - 1", "b": "(a - 30)*b - b^3"}, parameters={"r": 1.0})
    branch = pk.continuation(problem, "r", x0=[0.0, 0.0], span=(1e-15, 2.0))
    (point,) = branch.special("BP")
    assert point["r"] == pytest.approx(np.exp(-30.0), rel=1e-6)
    assert point.kind == "pitchfork"
    assert np.isnan([*point.normal_form.values()]).all()
    assert "not known" in point.message
