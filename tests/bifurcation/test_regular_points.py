"""Regular points of a path in one call, beside what is found of each bracket by itself."""

import re

import numpy as np
import pytest

import phasekit as pk
from phasekit.bifurcation.continuation import events, specials
from phasekit.bifurcation.continuation.locate import locate
from phasekit.bifurcation.continuation.points.regular import forms_beside

WINDOW = dict.fromkeys("xyuv", (-3, 3))
LAWS = {
    "reaction": (
        {"x": "-x + p*(1 - x)*exp(y)", "y": "-y + 14*p*(1 - x)*exp(y) - 2*y"},
        {"x": 0, "y": 0}, (0.0, 0.2),
    ),
    "atmosphere": (
        {"x": "-y^2 - u^2 - x/4 + p/4", "y": "x*y - 4*x*u - y + 1/4", "u": "4*x*y + x*u - u"},
        {"x": 0, "y": 0.2, "u": 0}, (0.0, 8.0),
    ),
    "two pairs": (
        {
            "x": "p*x - y - x*(x^2 + y^2) + x^2", "y": "x + p*y - y*(x^2 + y^2)",
            "u": "(p - 1/3)*u - 20*v + u*v - 3*u^3", "v": "u/5 + (p - 1/3)*v + x^2*u",
        },
        dict.fromkeys("xyuv", 0), (-1.0, 1.0),
    ),
    "fold of a map": ({"x": "p + x - x^2 + x^3/3"}, {"x": 3.3}, (-1.0, 2.0)),
}  # fmt: skip


def beside(monkeypatch, law, x0, span, **options):
    """Points that are placed in one call, each with what `locate` finds in its bracket."""
    together, found = specials.regular_points, []

    def kept(bracketed):
        placed = together(bracketed)
        for (curve, brackets), here in zip(bracketed, placed, strict=True):
            found.extend((curve, one, locate(curve, brackets[k])) for k, one in here.items())
        return placed

    monkeypatch.setattr(specials, "regular_points", kept)
    branch = pk.continuation(pk.Problem(law, parameters={"p": span[0]}, **options), "p", x0=x0,
                             span=span)  # fmt: skip
    return branch, found


@pytest.mark.slow
@pytest.mark.parametrize("name", LAWS)
@pytest.mark.parametrize("unit", [1.0, 1e-7])
def test_points_in_one_call_are_those_found_one_by_one(monkeypatch, name, unit):
    """Also where states are measured in other units."""
    law, x0, span = LAWS[name]
    law = {x: f"{unit}*({_in_units(row, unit)})" for x, row in law.items()}
    x0 = {x: value * unit for x, value in x0.items()}
    _, found = beside(monkeypatch, law, x0, span, map=name.endswith("map"))
    kinds = [one.kind for _, one, _ in found]
    assert {"fold" if "map" in name else "hopf"} <= set(kinds)
    for curve, one, others in found:
        (other,) = others
        assert (one.kind, one.status, one.message) == (other.kind, other.status, other.message)
        scale = curve.scale[: curve.m]
        np.testing.assert_allclose(one.u / scale, other.u / scale, rtol=1e-12, atol=1e-14)
        np.testing.assert_allclose(one.tangent / scale, other.tangent / scale, rtol=0, atol=1e-9)
        assert one.normal_form == pytest.approx(other.normal_form, rel=1e-10)
        assert (one.interval, one.corank) == (other.interval, other.corank)


def _in_units(row, unit):
    """A row of states that are so many times as small."""
    return re.sub(r"\b([xyuv])\b", rf"(\1/{unit})", row)


@pytest.mark.parametrize("order", [2, 3])
def test_points_that_are_not_regular_are_left_to_a_closer_look(monkeypatch, order):
    """At p = 0 a pitchfork or a crossing, and a Hopf point with l1 = 0."""
    growth = "(p - x^2 - y^2)" if order == 2 else "(p - (x^2 + y^2)^2)"
    laws = [
        ({"x": f"p*x - x^{order}"}, {"x": 0.0}, {"transcritical", "pitchfork"}),
        ({"x": f"x*{growth} - y", "y": f"y*{growth} + x"}, {"x": 0, "y": 0}, {"hopf"}),
    ]
    for law, x0, kinds in laws:
        branch, found = beside(monkeypatch, law, x0, (-1.0, 0.7))
        seen = {s.kind for s in branch.special_points} & kinds
        assert len(seen) == 1
        assert [one.kind for _, one, _ in found] == ["hopf"] * ("y" in law and order == 2)


MORE = {
    "a pitchfork beside a fold": ({"x": "p*x + x^2/2 - x^3"}, {"x": 0}, (-1.0, 1.0)),
    "a pair beside zero": (
        {"x": "p*x - y/9 - x^3", "y": "x/9 + p*y", "u": "(1/8 - p)*u - u^2"},
        dict.fromkeys("xyu", 0), (-1.0, 1.0),
    ),
    "near misses": ({"x": "p + x^3 + x/10^4"}, {"x": 0.9}, (-1.0, 1.0)),
}  # fmt: skip


@pytest.mark.slow
@pytest.mark.parametrize("name", [name for name in (*LAWS, *MORE) if "map" not in name])
def test_steps_of_one_look_are_those_of_arrays(monkeypatch, name):
    """Steps with special points by compiled code, beside those by arrays of NumPy."""
    law, x0, span = {**LAWS, **MORE}[name]
    together, looks = specials.brackets_of_all, []

    def kept(paths):
        one = together(paths)
        with monkeypatch.context() as only:
            only.setattr(events, "FEW", 0)
            looks.append((*one, *together(paths)))
        return one

    scans, scan = [], events.scan.scan
    monkeypatch.setattr(events.scan, "scan", lambda *given: scans.append(scan(*given)) or scans[-1])
    monkeypatch.setattr(specials, "brackets_of_all", kept)
    pk.continuation(pk.Problem(law, parameters={"p": span[0]}), "p", x0=x0, span=span)
    assert scans == [0]
    ((one, other),) = looks
    assert bool(one[0]) == (name != "near misses")
    for own, its in zip(one[0], other[0], strict=True):
        same = ("changes", "jump", "index", "neutral")
        assert [getattr(own, key) for key in same] == [getattr(its, key) for key in same]
        np.testing.assert_array_equal([own.a.u, own.b.u], [its.a.u, its.b.u])
    np.testing.assert_array_equal(one[1], other[1])
    assert one[2] == other[2] == ()


@pytest.mark.slow
@pytest.mark.parametrize(
    ("turns", "rate", "offset"), [(60, -30, 0.03), (100, 20, 0.03), (200, 60, 0.6)]
)
def test_neutral_saddles_of_eigenvectors_that_turn(turns, rate, offset):
    """Eigenvalues h +- 1, whose eigenvectors turn fast: the only neutral saddle is where h = 0."""
    law = pk.Problem(
        {
            "x": "(h + cos(k*p))*x + sin(k*p)*y - x^3", "y": "sin(k*p)*x + (h - cos(k*p))*y - y^3",
        },
        parameters={"p": -1.0, "k": turns, "g": rate, "c": offset},
        definitions={"h": "exp(g*p) - c"},
    )  # fmt: skip
    branch = pk.continuation(law, "p", x0=[0.0, 0.0], span=(-1.0, 1.0))
    found = [one.parameters["p"] for one in branch.special_points if one.kind == "neutral_saddle"]
    assert found == pytest.approx([np.log(offset) / rate], rel=1e-12)


def test_forms_are_of_the_point_that_is_guessed_or_none():
    """Folds of p + x^2 - x^3 are at x = 0 and 2/3, with f_xx = 2 and -2."""
    branch = pk.continuation(pk.Problem("p + x^2 - x^3", "x", {"p": 0.3}), "p", x0=[1.2],
                             span=(-0.5, 0.5))  # fmt: skip
    points = branch.special("LP")
    assert [round(point["x"], 9) + 0.0 for point in points] == [0.0, round(2 / 3, 9)]
    for point, a in zip(points, (1.0, -1.0), strict=True):
        curve, one = point.branch.curve, point.special
        for off, known in ((1e-6, True), (-1e-3, False), (5e-3, False)):
            u = one.u + [off * curve.scale[0], 0.0]
            found = forms_beside(curve, one, curve.par[None], u[None], np.zeros((1, 1)))
            assert (found is not None) == known
            if known:
                np.testing.assert_allclose(found["a"], a, rtol=1e-9)
