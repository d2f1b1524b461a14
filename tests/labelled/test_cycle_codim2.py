"""Where doublings and tori of cycles turn hard, and folds double: against exact normal forms."""

from __future__ import annotations

import os

import numpy as np
import pytest

import phasekit as pk

more = pytest.mark.skipif(
    os.environ.get("PHASEKIT_PUBLISHED") != "all",
    reason="its formulas take minutes to compile; PHASEKIT_PUBLISHED=all runs it",
)


def twisted(rate, decay, forced):
    """Formulas of xi' = xi rate and eta' = -decay eta, where (a, b) is (xi, eta) turned by t/2.

    Of products of xi and eta none has half the angle left: rate holds squares of xi alone.
    """
    cos, sin = ("cos(t)", "sin(t)") if forced else ("x/sqrt(x**2 + y**2)", "y/sqrt(x**2 + y**2)")
    a, b = ("a", "b") if forced else ("(sqrt(x**2 + y**2) - 1)", "z")
    # xi^2, and what xi and eta are in terms of a and b, by double angles.
    square = f"(({a})**2*(1 + {cos})/2 + ({b})**2*(1 - {cos})/2 + {a}*{b}*{sin})"
    xx, xy, yy = f"(1 + {cos})/2", f"{sin}/2", f"(1 - {cos})/2"
    grow = f"({rate.replace('SQUARE', square)})"
    da = f"({grow}*({xx}*{a} + {xy}*{b}) - {decay}*({yy}*{a} - {xy}*{b}) - {b}/2)"
    db = f"({grow}*({xy}*{a} + {yy}*{b}) - {decay}*(-{xy}*{a} + {xx}*{b}) + {a}/2)"
    return da, db


def doubling(forced):
    """Xi' = (mu - p^2/2) xi + (p - 0.3) xi^3."""
    da, db = twisted("mu - p**2/2 + (p - 3/10)*SQUARE", "0.4", forced)
    values = {"mu": -0.1, "p": 0.1}
    if forced:
        return pk.Problem([da, db], ("a", "b"), values, time="t", period="2*pi")
    r = "sqrt(x**2 + y**2)"
    return pk.Problem([f"x/{r}*{da} - y", f"y/{r}*{da} + x", db], ("x", "y", "z"), values)


@pytest.mark.parametrize("forced", [pytest.param(False, marks=more), True])
def test_doublings_turn_hard(forced):
    system = doubling(forced)
    start = [0.0, 0.0] if forced else [1.0, 0.0, 0.0]
    orbit = pk.periodic_orbit(system, start)
    branch = pk.continuation(system, "mu", orbit=orbit, span=(-0.2, 0.2))
    (point,) = branch.special("PD")
    assert point["mu"] == pytest.approx(0.005, abs=1e-12)
    assert point.normal_form["c"] == pytest.approx(-0.2, rel=1e-8)
    curve = point.curve("p", (-0.5, 0.8))
    np.testing.assert_allclose(curve.points.mu, curve.points.p**2 / 2, rtol=0, atol=1e-10)
    (hard,) = [one for one in curve.special_points if one.kind != "end"]
    assert (hard.kind, hard.label, hard.status) == ("generalized_flip", "GPD", "converged")
    assert hard["p"] == pytest.approx(0.3, abs=1e-8)
    assert hard["mu"] == pytest.approx(0.045, abs=1e-8)


def test_tori_turn_hard():
    """Zeta' = (mu - p^2/2 + i w) zeta + (p - 0.3 + i) zeta |zeta|^2 across a cycle."""
    radius = "(1 - x**2 - y**2)"
    grow, turn = "(mu - p**2/2 + (p - 3/10)*(u**2 + v**2))", "(w + u**2 + v**2)"
    system = pk.Problem(
        [f"x*{radius} - y", f"y*{radius} + x", f"{grow}*u - {turn}*v", f"{grow}*v + {turn}*u"],
        ("x", "y", "u", "v"), {"mu": -0.1, "p": 0.1, "w": 0.21},
    )  # fmt: skip
    orbit = pk.periodic_orbit(system, [1.0, 0.0, 0.0, 0.0])
    branch = pk.continuation(system, "mu", orbit=orbit, span=(-0.2, 0.2))
    (point,) = branch.special("TR")
    curve = point.curve("p", (-0.5, 0.8))
    np.testing.assert_allclose(curve.points.mu, curve.points.p**2 / 2, rtol=0, atol=1e-10)
    (hard,) = [one for one in curve.special_points if one.kind != "end"]
    assert (hard.kind, hard.label, hard.status) == ("chenciner", "CH", "converged")
    assert hard["p"] == pytest.approx(0.3, abs=1e-8)
    # Over w it has d of one sign; at a third of a turn d passes infinity, and is not zero.
    over = point.curve("w", (0.1, 0.45))
    kinds = sorted(one.kind for one in over.special_points if one.kind != "end")
    assert kinds == ["resonance_3", "resonance_4"]


def test_folds_and_doublings_together():
    """S' = nu - s^2 + mu s beside xi' = (mu + s - l) xi - xi^3: they meet at 2 l = 3 mu."""
    da, db = twisted("mu + s - l - SQUARE", "0.4", True)
    system = pk.Problem(
        [da, db, "nu - s**2 + mu*s"], ("a", "b", "s"), {"nu": 0.05, "mu": 0.0, "l": 0.1},
        time="t", period="2*pi",
    )  # fmt: skip
    orbit = pk.periodic_orbit(system, [0.0, 0.0, np.sqrt(0.05)])
    branch = pk.continuation(system, "nu", orbit=orbit, span=(-0.2, 0.2))
    (fold,) = branch.special("LPC")
    (double,) = branch.special("PD")
    # s = l - mu on the doublings, mu/2 on the folds.
    assert double["nu"] == pytest.approx(0.01, abs=1e-10)
    for point, of in ((fold, "fold"), (double, "doubling")):
        curve = point.curve("mu", (-0.15, 0.15))
        mu, nu = curve.points.mu.values, curve.points.nu.values
        exact = -(mu**2) / 4 if of == "fold" else (0.1 - mu) * (0.1 - 2 * mu)
        np.testing.assert_allclose(nu, exact, rtol=0, atol=1e-9)
        (meet,) = [one for one in curve.special_points if one.kind != "end"]
        assert (meet.kind, meet.label, meet.status) == ("fold_flip", "LPPD", "converged")
        assert meet["mu"] == pytest.approx(0.2 / 3, abs=1e-7)
        assert meet["nu"] == pytest.approx(-0.01 / 9, abs=1e-8)


def test_doublings_of_a_linear_system_are_no_generalized_ones():
    system = pk.Problem(
        ["v", "-(a - 2*q*cos(2*t))*x - d*v"], ("x", "v"), {"a": 0.5, "q": 1.0, "d": 0.2},
        time="t", period="pi",
    )  # fmt: skip
    orbit = pk.periodic_orbit(system, [0.0, 0.0])
    branch = pk.continuation(system, "a", orbit=orbit, span=(-1.0, 3.0))
    assert len(branch.special("PD")) == 2
    curve = branch.special("PD")[0].curve("q", (0.6, 1.4))
    assert curve.points.sizes["point"] > 3
    assert {one.kind for one in curve.special_points} == {"end"}


def test_two_multipliers_pass_minus_one_together(tmp_path):
    """(xi, eta)' = ((0, 1), (mu, s)) (xi, eta), turned by t/2: both are -1 at mu = s = 0."""
    D, S, half = "(-s/2)", "((1 + mu)/2)", "((mu - 1)/2)"
    same, across = f"({D}*cos(t) - {S}*sin(t))", f"({D}*sin(t) + {S}*cos(t))"
    system = pk.Problem(
        [
            f"(s/2 + {same})*a + ({across} - {half} - 1/2)*b",
            f"({across} + {half} + 1/2)*a + (s/2 - {same})*b",
        ],
        ("a", "b"), {"mu": 0.02, "s": -0.3}, time="t", period="2*pi",
    )  # fmt: skip
    orbit = pk.periodic_orbit(system, [0.0, 0.0])
    branch = pk.continuation(system, "mu", orbit=orbit, span=(-0.02, 0.02))
    (point,) = branch.special("PD")
    assert point["mu"] == pytest.approx(0.0, abs=1e-12)
    curve = point.curve("s", (-0.4, 0.4))
    np.testing.assert_allclose(curve.points.mu, 0.0, atol=1e-10)
    (strong,) = [one for one in curve.special_points if one.kind != "end"]
    assert (strong.kind, strong.label, strong.status) == ("resonance_2", "R2", "converged")
    assert strong["s"] == pytest.approx(0.0, abs=1e-8)
    curve.save(tmp_path / "curve.nc")
    assert pk.Branch.load(tmp_path / "curve.nc").points.identical(curve.points)


def half_turned(dx, dy):
    """Rates of (a, b), which is (xi, eta) turned by t/2; dx, dy are odd in XI and ETA."""
    cos, sin = "cos(t/2)", "sin(t/2)"
    xi, eta = f"({cos}*a + {sin}*b)", f"({cos}*b - {sin}*a)"
    dx, dy = (f"({one.replace('XI', xi).replace('ETA', eta)})" for one in (dx, dy))
    return f"{cos}*{dx} - {sin}*{dy} - b/2", f"{sin}*{dx} + {cos}*{dy} + a/2"


@pytest.mark.slow
def test_doubled_cycles_fold_from_generalized_flips():
    """Xi' = (mu - p^2/2) xi + (p - 0.3) xi^3 - xi^5: folds where mu - p^2/2 = -(p - 0.3)^2/4."""
    da, db = twisted("mu - p**2/2 + (p - 3/10)*SQUARE - SQUARE**2", "0.4", True)
    system = pk.Problem(
        [da, db], ("a", "b"), {"mu": -0.1, "p": 0.1}, time="t", period="2*pi"
    )  # fmt: skip
    branch = pk.continuation(
        system, "mu", orbit=pk.periodic_orbit(system, [0.0, 0.0]), span=(-0.2, 0.2)
    )
    (point,) = branch.special("PD")[0].curve("p", (-0.5, 0.8)).special("GPD")
    curve = point.switch()
    assert curve.kind == "fold_of_cycles"
    p = curve.points.p
    np.testing.assert_allclose(curve.points.mu - p**2 / 2, -((p - 0.3) ** 2) / 4, atol=1e-10)
    np.testing.assert_allclose(curve.points.period, 4.0 * np.pi, rtol=1e-12)
    assert sorted(stop.reason for stop in curve.stops) == ["bound", "period_doubling"]
    with pytest.raises(pk.ParameterError, match="kind: got 'torus', wants 'fold_of_cycles'"):
        point.switch("torus")


@pytest.mark.slow
def test_doubled_cycles_have_tori_from_second_resonances():
    """Xi' = eta, eta' = m xi + n eta - xi^3 - xi^2 eta: tori of xi^2 = m where n = m."""
    da, db = half_turned("ETA", "m*XI + n*ETA - XI**3 - XI**2*ETA")
    system = pk.Problem(
        [da, db], ("a", "b"), {"m": -0.3, "n": -0.2}, time="t", period="2*pi"
    )  # fmt: skip
    branch = pk.continuation(
        system, "m", orbit=pk.periodic_orbit(system, [0.0, 0.0]), span=(-0.4, 0.5)
    )
    (point,) = branch.special("PD")[0].curve("n", (-0.5, 0.5)).special("R2")
    curve = point.switch("torus")
    assert curve.kind == "torus"
    np.testing.assert_allclose(curve.points.m, curve.points.n, atol=1e-9)
    np.testing.assert_allclose(curve.points.period, 4.0 * np.pi, rtol=1e-12)


@pytest.mark.slow
def test_doubled_cycles_have_tori_from_fold_flips():
    """X' = m + x^2 - xi^2, xi' = (n + 4/5 x + x^2) xi: tori where n = 0 and m > 0."""
    da, db = half_turned("(n + 4/5*x + x**2)*XI", "-ETA/2")
    square = "((a**2 + b**2)/2 + (a**2 - b**2)/2*cos(t) + a*b*sin(t))"
    system = pk.Problem(
        [f"m + x**2 - {square}", da, db], ("x", "a", "b"), {"m": -0.25, "n": 0.1},
        time="t", period="2*pi",
    )  # fmt: skip
    branch = pk.continuation(
        system, "m", orbit=pk.periodic_orbit(system, [-0.5, 0.0, 0.0]), span=(-0.4, 0.3)
    )
    for kind in ("LPC", "PD"):
        (point,) = branch.special(kind)[0].curve("n", (-0.3, 0.3)).special("LPPD")
        curve = point.switch()
        assert curve.kind == "torus"
        np.testing.assert_allclose(curve.points.n, 0.0, atol=1e-9)
        assert float(curve.points.m.min()) > 0.0
