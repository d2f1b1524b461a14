"""Curves in two parameters along which a coefficient of the normal form is zero everywhere."""

import pytest

import phasekit as pk

CODIMENSION_TWO = ("CH", "GH", "GPD")


def lines(branch, word):
    return [message for message in branch.messages if word in message]


def area(f, low, high):
    """A map that keeps areas at be = 1, and the curve of its tori there."""
    problem = pk.Problem(["y", f], ["x", "y"], {"al": 0.3, "be": 0.9}, map=True)
    branch = pk.continuation(problem, "be", x0=[0.2, 0.2], span=(0.8, 1.2))
    (point,) = branch.special("TR")
    return point, point.curve("al", span=(low, high))


@pytest.mark.parametrize(
    ("f", "low", "high"),
    [
        ("al - be*x - y**2", -0.9, 3.0),
        ("1e3*(al/1e3 - be*x/1e3 - y**2/1e3 + y**3/5e3)", -0.4, 0.6),
        ("al - be*x - 0.7*sin(y)", 0.05, 0.6),
    ],
)
def test_maps_that_keep_areas_have_no_chenciner_points(f, low, high):
    point, curve = area(f, low, high)
    assert point.normal_form["d"] == 0.0
    assert curve.points.sizes["point"] > 10
    assert [s.label for s in curve.special_points if s.label in CODIMENSION_TWO] == []
    assert len(lines(curve, "chenciner")) == 1
    assert "zero all along" in lines(curve, "chenciner")[0]


def test_flips_of_involutions_are_not_generalized():
    problem = pk.Problem("(a*x + b)/(x + 2)", "x", {"a": -1.7, "b": 3.0}, map=True)
    branch = pk.continuation(problem, "a", x0=[0.7], span=(-2.5, -1.5))
    (point,) = branch.special("PD")
    assert point["a"] == pytest.approx(-2.0, abs=1e-9)
    curve = point.curve("b", span=(0.5, 6.0))
    assert curve.points.sizes["point"] > 10
    assert curve.special("GPD") == ()
    assert len(lines(curve, "generalized flip")) == 1


def test_hopf_points_of_conserved_energy_are_not_generalized():
    def f(x, mu, k):
        return [x[1], -x[0] + mu * x[1] + k * x[0] ** 2]

    formulas = ["y", "-x + mu*y + k*x**2"]
    for given in (formulas, f):
        problem = pk.Problem(given, ["x", "y"], {"mu": -0.5, "k": 0.7})
        (point,) = pk.continuation(problem, "mu", span=(-1.0, 1.0)).special("H")
        curve = point.curve("k", span=(-2.0, 2.0))
        assert curve.points.sizes["point"] > 10
        assert curve.special("GH") == ()
        assert len(lines(curve, "generalized hopf")) == 1


@pytest.mark.parametrize("size", [1e-6, 1.0, 1e6])
def test_a_coefficient_that_changes_its_sign_is_found_in_every_unit(size):
    x, y = f"(x/{size!r})", f"(y/{size!r})"
    square = f"({x}**2 + {y}**2)"
    formulas = [
        f"{size!r}*(mu*{x} - {y} + (k - 0.3)*{x}*{square} - {x}*{square}**2)",
        f"{size!r}*({x} + mu*{y} + (k - 0.3)*{y}*{square} - {y}*{square}**2)",
    ]
    problem = pk.Problem(formulas, ["x", "y"], {"mu": -0.5, "k": 0.9})
    (point,) = pk.continuation(problem, "mu", span=(-1.0, 1.0)).special("H")
    curve = point.curve("k", span=(-2.0, 2.0))
    (found,) = curve.special("GH")
    assert found["k"] == pytest.approx(0.3, abs=1e-9)
    assert lines(curve, "zero all along") == []
