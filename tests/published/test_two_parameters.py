"""Curves of folds, Hopf points and branch points in two parameters, and the points on them."""

from __future__ import annotations

import math

import numpy as np
import pytest
from published import compare, reference
from published.compare import kind_of
from published.systems import SYSTEMS

import phasekit as pk


def special(branch, kind, index=0):
    found = [one for one in branch.special_points if kind_of(one) == kind]
    return found[index]


@pytest.mark.parametrize("name", reference.FOLD_CURVES)
def test_points_on_fold_curves(name):
    system = SYSTEMS[name]
    second, span = reference.FOLD_CURVES[name]
    wanted = reference.stored("fold_curves")[name]
    curve = special(compare.follow(system), "fold").curve(second, span)
    found = [
        one
        for one in curve.special_points
        if system.span[0] <= one.parameters[system.parameter] <= system.span[1]
    ]
    for kind in ("cusp", "bogdanov_takens", "zero_hopf"):
        places = [(p, q) for which, p, q in wanted if which == kind]
        alike = [one for one in found if kind_of(one) == kind]
        assert len(alike) == len(places), (kind, places, curve)
        for p, q in places:
            off = min(
                abs(one.parameters[system.parameter] - p) + abs(one.parameters[second] - q)
                for one in alike
            )
            assert off < 1e-8, (kind, float(p), float(q), float(off))
    assert all(one.status == "converged" for one in found), found


def test_cusp_of_the_reaction_in_closed_form():
    """p1 = e^-2, p3 = 5/2 exactly."""
    curve = special(compare.follow(SYSTEMS["A -> B reaction"]), "fold").curve("p3", (0.5, 4.0))
    cusp = special(curve, "cusp")
    assert cusp.label == "CP"
    assert abs(cusp.parameters["p1"] - math.exp(-2)) < 1e-11
    assert abs(cusp.parameters["p3"] - 2.5) < 1e-9


def test_every_point_of_a_fold_curve_is_a_fold():
    """27 mu^2 = 4 l^3 for the cusp."""
    curve = special(compare.follow(SYSTEMS["cusp"]), "fold").curve("l", (-1.0, 2.0))
    mu, ell = curve.points.mu.values, curve.points.l.values
    assert np.abs(27 * mu**2 - 4 * ell**3).max() < 1e-10
    assert ell.max() == 2.0
    assert mu.min() < -1.0 < 1.0 < mu.max()  # both sides, through the cusp


def test_hopf_curve_of_the_brusselator():
    """B = 1 + A^2."""
    curve = special(compare.follow(SYSTEMS["Brusselator"]), "hopf").curve("A", (0.5, 2.0))
    points = curve.points
    assert np.abs(points.B - 1 - points.A**2).max() < 1e-10
    assert (points.A.min(), points.A.max()) == (0.5, 2.0)


def test_hopf_curve_ends_at_bogdanov_takens():
    """b1 = 0, b2 < 0 is Hopf, b2 > 0 neutral saddle; they join at the origin."""
    curve = special(compare.follow(SYSTEMS["Bogdanov-Takens, focus side"]), "hopf")
    curve = curve.curve("b2", (-1.5, 1.5))
    point = special(curve, "bogdanov_takens")
    assert abs(point.parameters["b1"]) + abs(point.parameters["b2"]) < 1e-8
    assert np.abs(curve.points.b1).max() < 1e-10


def test_hopf_curve_of_the_reaction():
    """Trace 0 on the curve of equilibria, at each point."""
    system = SYSTEMS["A -> B reaction"]
    curve = special(compare.follow(system), "hopf").curve("p3", (0.5, 4.0))
    for i in range(0, curve.points.sizes["point"], 5):
        u1, u2, p1, p3 = (float(curve.points[n][i]) for n in ("u1", "u2", "p1", "p3"))
        rate = p1 * math.exp(u2)
        assert abs(-u1 + (1 - u1) * rate) < 1e-9
        assert abs(-1 - rate - 1 - p3 + 14 * (1 - u1) * rate) < 1e-9


def test_branch_point_curve():
    """Two cells of Bratu with the coupling c: they part at x = 1 + 2c, a = x e^-x."""
    import phasekit as pk

    problem = pk.Problem(
        ["-(1 + c)*x + c*y + a*exp(x)", "c*x - (1 + c)*y + a*exp(y)"],
        state=("x", "y"),
        parameters={"a": 0.0, "c": 1.0},
    )
    branch = pk.continuation(
        problem,
        "a",
        x0=[0.0, 0.0],
        span=(0.0, 1.0),
        options=pk.ContinuationOptions(bounds={"x": (-1.0, 8.0)}),
    )
    curve = special(branch, "branch_point").curve("c", (0.5, 2.0))
    c, a = curve.points.c.values, curve.points.a.values
    assert np.abs(a - (1 + 2 * c) * np.exp(-(1 + 2 * c))).max() < 1e-9
    assert (c.min(), c.max()) == (0.5, 2.0)


@pytest.mark.parametrize("gap", [0.02, 0.001])
@pytest.mark.parametrize("centre", [0.0, 0.0317])
def test_two_bogdanov_takens_points_a_hair_apart(gap, centre):
    """The trace at the fold x = b = 0 is (m - centre)^2 - gap^2/4."""
    import phasekit as pk

    problem = pk.Problem(
        ["y", f"b + x**2 + ((m - {centre})**2 - {0.25 * gap**2!r})*y"],
        state=("x", "y"),
        parameters={"b": -1.0, "m": 1.5},
    )
    branch = pk.continuation(problem, "b", x0=[1.0, 0.0], span=(-1.0, 1.0))
    curve = special(branch, "fold").curve("m", (-2.0, 2.0))
    found = sorted(one.parameters["m"] for one in curve.special("BT"))
    assert np.allclose(found, [centre - 0.5 * gap, centre + 0.5 * gap], atol=1e-8)
    assert len(found) == 2


@pytest.mark.parametrize("max_step", [0.05, 0.1, 0.5])
@pytest.mark.parametrize("index", [0, 1])
def test_hopf_curves_pass_into_neutral_saddles_whatever_the_step(index, max_step):
    """Beyond a Bogdanov-Takens point no eigenvector becomes a solution of its own."""
    branch = compare.follow(SYSTEMS["CO oxidation, k = 0.4"])
    options = pk.ContinuationOptions(max_step=max_step)
    curve = special(branch, "hopf", index).curve("k", (0.1, 2.0), options=options)
    assert [stop.reason for stop in curve.stops] == ["bound", "bound"], curve
    found = sorted(
        (kind_of(one), round(one.parameters["k"], 5))
        for one in curve.special_points
        if one.kind != "end"
    )
    assert found == [
        ("bogdanov_takens", 0.72234),
        ("bogdanov_takens", 0.9714),
        ("generalized_hopf", 0.23249),
        ("generalized_hopf", 0.30588),
    ]
