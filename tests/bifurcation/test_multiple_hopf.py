"""Hopf points at which several pairs cross together: all isolated families, by closed forms."""

import re

import numpy as np
import pytest
import sympy as sp

import phasekit as pk
from phasekit import ConvergenceError, ParameterError

STATES = ("x", "y", "u", "v", "a", "b")


def hopf(f, *, span=(-1.0, 1.0)):
    states = STATES[: len(f)]
    problem = pk.Problem(f, states, {"p": -0.5})
    (point,) = pk.continuation(problem, "p", x0=np.zeros(len(f)), span=span).special("H")
    assert point.status == "converged"
    assert point["p"] == pytest.approx(0.0, abs=1e-10)
    return point


def families(point):
    first = point.switch()
    said = re.search(r"follow (\d+) families", first.stops[0].message)
    count = int(said.group(1)) if said else 1
    with pytest.raises(ParameterError, match="direction"):
        point.switch(direction=count)
    return [first, *(point.switch(direction=k) for k in range(1, count))]


def oscillator(x, y, omega=1.0, cubic=1.0):
    square = f"({x}**2 + {y}**2)"
    return [
        f"p*{x} - {omega}*{y} - {cubic}*{x}*{square}",
        f"p*{y} + {omega}*{x} - {cubic}*{y}*{square}",
    ]


@pytest.mark.parametrize(
    "of", [((1.0, 1.0), (1.0, 1.0)), ((1.0, 2.0), (1.0, 0.5)), ((1.0, 1.0), (1.7, 3.0)),
           ((1.0, 1.0), (1.0, 2.0), (1.0, 3.0)), ((1.0, 1.0), (2.3, 2.0), (1.0, 3.0))],
)  # fmt: skip
def test_each_of_several_oscillators_has_its_family(of):
    pairs = [STATES[2 * k : 2 * k + 2] for k in range(len(of))]
    f = [
        formula
        for (x, y), (omega, cubic) in zip(pairs, of, strict=True)
        for formula in oscillator(x, y, omega, cubic)
    ]
    found = families(hopf(f))
    assert len(found) == len(of)
    moving = set()
    for family in found:
        points = family.points
        assert points.sizes["point"] > 10
        tops = np.array([points[f"{x}_max"].values for x, _ in pairs])
        (k,) = np.flatnonzero(tops[:, -1] > 1e-3)
        moving.add(int(k))
        np.testing.assert_allclose(np.delete(tops, k, axis=0), 0.0, atol=1e-9)
        np.testing.assert_allclose(points.p, of[k][1] * tops[k] ** 2, rtol=1e-6)
        np.testing.assert_allclose(points.period, 2 * np.pi / of[k][0], rtol=1e-8)
    assert len(moving) == len(of)


def pair(A, B, C):
    """Of z1' = (p + i) z1 - A |z1|^2 z1 - B |z2|^2 z1 - C z1* z2^2, and of z2 alike."""
    x, y, u, v, p = sp.symbols("x y u v p", real=True)
    one, two = x + sp.I * y, u + sp.I * v
    formulas = []
    for a, b in ((one, two), (two, one)):
        mixed = B * a * b * sp.conjugate(b) + C * sp.conjugate(a) * b**2
        rate = sp.expand((p + sp.I) * a - A * a**2 * sp.conjugate(a) - mixed)
        formulas += [str(sp.re(rate)), str(sp.im(rate))]
    return formulas


@pytest.mark.parametrize(
    ("A", "B", "C"),
    [
        (1.0 + 0.5j, 0.3 + 0.2j, 0.15 - 0.3j),
        pytest.param(1.0 - 0.2j, -0.4 + 0.1j, 0.2, marks=pytest.mark.slow),
        pytest.param(1.0, 2.0, 0.3 + 0.1j, marks=pytest.mark.slow),
    ],
)  # fmt: skip
def test_two_equal_oscillators_that_see_each_other(A, B, C):
    """One alone, both in phase or against it, both a quarter of a turn apart."""
    laws = {"one": A, "line": A + B + C, "turn": A + B - C}
    seen = dict.fromkeys(laws, 0)
    for family in families(hopf(pair(A, B, C), span=(-0.5, 0.05))):
        points = family.points
        tops = [float(points[f"{name}_max"][5]) for name in "xu"]
        orbit = family.orbit(5)
        if min(tops) < 1e-6 * max(tops):
            kind = "one"
        elif abs(tops[0] - tops[1]) < 1e-6 * tops[0]:
            product = np.mean((orbit.x + 1j * orbit.y) * np.conj(orbit.u + 1j * orbit.v))
            kind = "line" if abs(product.real) > abs(product.imag) else "turn"
        else:
            continue  # of less symmetry
        seen[kind] += 1
        assert points.sizes["point"] > 8
        top = np.max([points.x_max.values, points.u_max.values], axis=0)[1:8]
        law = complex(laws[kind])
        np.testing.assert_allclose(points.p[1:8], law.real * top**2, rtol=1e-6)
        turned = 1.0 - law.imag * top**2
        np.testing.assert_allclose(points.period[1:8], 2 * np.pi / turned, rtol=1e-8)
    assert seen == {"one": 2, "line": 2, "turn": 2}


def test_a_pair_that_stays_on_the_axis_is_none_of_those_that_cross():
    found = families(hopf(["p*x - y - x*(x**2 + y**2)", "x + p*y - y*(x**2 + y**2)",
                           "v", "-2*u - u**3"]))  # fmt: skip
    assert len(found) == 1
    np.testing.assert_allclose(found[0].points.p, found[0].points.x_max ** 2, rtol=1e-6)
    assert "stays on the imaginary axis" in found[0].stops[0].message


def test_centers_of_several_frequencies_have_vertical_families():
    f = ["p*x - y", "x + p*y", "p*u - 1.3*v", "1.3*u + p*v"]
    found = families(hopf(f))
    assert len(found) == 2
    for family, omega in zip(found, (1.0, 1.3), strict=True):
        np.testing.assert_allclose(family.points.period, 2 * np.pi / omega, rtol=1e-9)
        assert any("vertical family" in message for message in family.messages)


def test_of_pairs_in_resonance_the_faster_one_has_a_family():
    one, two = oscillator("x", "y"), oscillator("u", "v", 2.0)
    (family,) = families(hopf([f"{one[0]} + x*u", one[1], f"{two[0]} + x**2", two[1]]))
    np.testing.assert_allclose(family.points.p, family.points.u_max**2, rtol=1e-6)
    assert "omega = 1 are not told: 2 omega" in family.stops[0].message


@pytest.mark.parametrize(
    ("f", "why"),
    [
        (["p*x - y", "x + p*y", "p*u - v", "u + p*v"], "not isolated"),
        (
            ["p*x - y + u", "x + p*y + v", *oscillator("u", "v")], "fewer eigenvectors",
        ),
    ],
)  # fmt: skip
def test_families_that_cannot_be_told_are_said(f, why):
    with pytest.raises(ConvergenceError, match=why):
        hopf(f).switch()


def test_a_simple_point_has_one_direction():
    point = hopf(oscillator("x", "y"))
    assert len(families(point)) == 1
    with pytest.raises(ParameterError, match="wants 0"):
        point.switch(direction=1)
