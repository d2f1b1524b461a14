"""Folds of stiff cycles: along canards, in systems with one multiplier and with more."""

from __future__ import annotations

import math

import numpy as np
import pytest

import phasekit as pk
from phasekit.cycles.linear import Linear
from phasekit.cycles.normal_forms import at_fold
from phasekit.errors import ConvergenceError

#: I, the period and a b at the fold with the smaller I, by eps. They are those of the return map P
#: to v = -1.7, with derivatives, from Taylor series of order 34 in 30 to 45 digits: P(w) = w and
#: P'(w) = 1, and a b = P''/2 dP/dI over the square of the period, whatever xi is measured by.
#: Below eps = 0.08 by multiple shooting with series of order 81 to 128 in 60 to 95 digits.
FOLDS = {
    0.02: (0.29979121229081100006, 263.202117204336199, -3.6021290295006258e45),
    0.03: (0.30385354632095819191, 177.793227718725213, -1.18045372014748888654e29),
    0.05: (0.31197981835378917319, 108.192958646222881, -7891594979980959.9001),
    0.08: (0.32417852250371016695, 68.5265032098859898, -376881133.934495),
    0.12: (0.34047996108392329642, 46.3182944527309171, -41123.9195103829),
    0.2: (0.37343528792865547599, 28.4774746087260181, -39.5939055393881),
}
NERVE = pk.Problem(
    ["v - v**3/3 - w + I", "eps*(v + 0.7 - b*w)"], ("v", "w"), {"I": 0.0, "eps": 0.08, "b": 0.8}
)


def folds(problem, x0):
    rest = pk.continuation(problem, "I", x0=x0, span=(0.0, 2.0))
    family = rest.special("H")[0].switch()
    assert [stop.reason for stop in family.stops] == ["hopf", "hopf"]
    return family.special("LPC")


def nerve(eps):
    return folds(NERVE.replace(eps=eps), [-1.2, -0.6])


@pytest.mark.parametrize(
    "eps", [pytest.param(eps, marks=[pytest.mark.slow] * (eps < 0.05)) for eps in FOLDS]
)
def test_folds_along_canards(eps):
    current, period, product = FOLDS[eps]
    one, two = nerve(eps)
    for fold, at in ((one, current), (two, 1.75 - current)):
        assert (fold.status, fold.message) == ("converged", "")
        assert fold["I"] == pytest.approx(at, abs=1e-13)
        assert fold.period == pytest.approx(period, rel=1e-8)
        assert np.abs(fold.eigenvalues) == pytest.approx(1.0, abs=1e-6)
    # (v, w, I) -> (-v, 1.4/b - w, 1.4/b - I) takes one to the other.
    forms = one.normal_form, two.normal_form
    assert forms[0]["a"] * forms[0]["b"] == pytest.approx(product, rel=1e-7)
    assert forms[1]["a"] == pytest.approx(-forms[0]["a"], rel=1e-7)
    assert forms[1]["b"] == pytest.approx(forms[0]["b"], rel=1e-7)


def test_curves_of_folds_along_canards():
    sums = []
    for fold in nerve(0.08):
        curve = fold.curve("eps", (0.05, 0.2))
        assert [stop.reason for stop in curve.stops] == ["bound", "bound"]
        assert len(curve.points.point) < 60
        assert not [s for s in curve.special_points if s.kind != "end"]
        ends = curve.points.isel(point=[0, -1])
        sums.append(ends.I.values)
        at = FOLDS[0.2][0]
        assert min(abs(float(ends.I[1]) - one) for one in (at, 1.75 - at)) < 1e-12
        assert [stop.reason for stop in fold.curve("b", (0.7, 0.9)).stops] == ["bound", "bound"]
    assert np.allclose(sums[0] + sums[1], 1.75, rtol=0.0, atol=1e-12)


def test_curves_of_folds_that_become_stiff():
    curve = nerve(0.2)[0].curve("eps", (0.08, 0.2))
    assert [stop.reason for stop in curve.stops] == ["bound", "bound"]
    assert float(curve.points.I[0]) == pytest.approx(FOLDS[0.08][0], abs=1e-12)


def test_both_ways_to_the_coefficients_of_a_fold():
    """Of r' = r (p + r^2 - r^4): with r^2 = 1/2 + ... a = -sqrt(2) and b = 1/sqrt(2)."""
    square = "(x**2 + y**2)"
    system = pk.Problem(
        [f"x*(p + {square} - {square}**2) - y", f"y*(p + {square} - {square}**2) + x"], ("x", "y"),
        {"p": -0.1},
    )  # fmt: skip
    orbit = pk.periodic_orbit(system, [0.9, 0.0])
    (fold,) = pk.continuation(system, "p", orbit=orbit, span=(-0.4, 0.1)).special("LPC")
    point, cycles = fold.special.point, fold.branch.curve
    for growth in (math.inf, -math.inf):
        form = at_fold(Linear(cycles, point.orbit), point.dx, growth=growth)
        assert abs(form["a"]) == pytest.approx(math.sqrt(2.0), rel=1e-8)
        assert form["a"] * form["b"] == pytest.approx(-1.0, rel=1e-8)


def test_what_more_multipliers_hide_is_announced():
    """A third state that only follows changes neither the folds nor a b, but how they are found."""
    equations = ["v - v**3/3 - w + I", "eps*(v + 0.7 - b*w)", "v - u"]
    problem = pk.Problem(equations, ("v", "w", "u"), {"I": 0.0, "eps": 0.08, "b": 0.8})
    for fold in folds(problem, [-1.2, -0.6, -1.2]):
        at = FOLDS[0.08][0]
        assert min(abs(fold["I"] - at), abs(1.75 - fold["I"] - at)) < 1e-12
        assert math.isnan(fold.normal_form["a"])
        assert "a not known" in fold.message
        with pytest.raises(ConvergenceError, match="critical function changes by a factor"):
            fold.curve("eps", (0.05, 0.2))
    one, _ = folds(problem.replace(eps=0.2), [-1.2, -0.6, -1.2])
    assert one.message == ""
    assert one.normal_form["a"] * one.normal_form["b"] == pytest.approx(FOLDS[0.2][2], rel=1e-6)


@pytest.mark.parametrize("eps", [0.05, pytest.param(0.02, marks=pytest.mark.slow)])
def test_multipliers_that_errors_hide_are_not_told(eps):
    """Two states that decay and grow in turn: the product alone keeps its digits."""
    equations = ["v - v**3/3 - w + I", "eps*(v + 0.7 - b*w)", "v - u"]
    problem = pk.Problem(equations, ("v", "w", "u"), {"I": 0.0, "eps": eps, "b": 0.8})
    rest = pk.continuation(problem, "I", x0=[-1.2, -0.6, -1.2], span=(0.0, 2.0))
    family = rest.special("H")[0].switch()
    assert {one.kind for one in family.special_points} == {"end"}  # no doublings, at least
    assert len(family.messages) == 2
    assert all("multipliers are not known from I = " in one for one in family.messages)
    multipliers, period = family.points.multiplier.values, family.points.period.values
    hidden = np.isnan(multipliers).any(axis=1)
    assert (family.points.n_unstable.values[hidden] == -1).all()
    # The least is exp(-T), where the others are beyond 1.
    seen = np.abs(multipliers[:, 1]) >= 1.0
    assert np.sum(seen) >= 10
    assert np.abs(multipliers[seen, 2]) == pytest.approx(np.exp(-period[seen]), rel=0.1)


@pytest.mark.slow
def test_curves_of_folds_end_where_rounding_hides_the_flow():
    """Towards a homoclinic orbit, where orbits stay at a saddle for nearly their whole period."""
    burst = "p1*(1 - u1)*exp(u2)"
    equations = [f"-u1 + {burst}", f"-u2 + 14*{burst} - p3*u2"]
    problem = pk.Problem(equations, ("u1", "u2"), {"p1": 0.0, "p3": 2.0})
    rest = pk.continuation(problem, "p1", x0=[0.0, 0.0], span=(0.0, 0.2))
    hopf = rest.special("LP")[0].curve("p3", (1.0, 14.0)).special("BT")[0].switch("hopf")
    curve = hopf.special("GH")[0].switch("fold_of_cycles")
    assert curve.stops[0].reason == "stuck"
    assert "the orbit rests at an equilibrium: rounding" in curve.stops[0].message
    assert curve.messages == ()
    points = curve.points
    assert np.isfinite(points.multiplier.values).all()
    end = points.isel(point=0)
    p1, p3, u1 = float(end.p1), float(end.p3), float(end.u1_mean)
    for _ in range(8):  # from near it to the saddle, where u2 = 14 u1/(1 + p3)
        c = 14.0 / (1.0 + p3)
        e = p1 * math.exp(c * u1)
        u1 -= (-u1 + e * (1.0 - u1)) / (-1.0 - e + c * e * (1.0 - u1))
    e = p1 * math.exp(c * u1)
    jacobian = [[-1.0 - e, e * (1.0 - u1)], [-14.0 * e, -1.0 + 14.0 * e * (1.0 - u1) - p3]]
    inward, outward = sorted(np.linalg.eigvals(jacobian))
    assert inward < 0.0 < outward
    # How close they come, where what is left of the way in is what there is of the way out.
    close = math.exp(float(end.period) / (1.0 / inward - 1.0 / outward))
    assert 1e-17 < close < 1e-13
