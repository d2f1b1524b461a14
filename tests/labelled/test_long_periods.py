"""Families that are told to go on towards a homoclinic orbit, to a period."""

from __future__ import annotations

import functools

import numpy as np
import pytest

import phasekit as pk

REACTION = pk.Problem(
    ["-u1 + p1*(1 - u1)*exp(u2)", "-u2 + p1*p2*(1 - u1)*exp(u2) - p3*u2"],
    ("u1", "u2"), {"p1": 0.1, "p2": 14.0, "p3": 2.0},
)  # fmt: skip
LORENZ = pk.Problem(
    ["10*(y - x)", "rho*x - y - x*z", "x*y - 8*z/3"], ("x", "y", "z"), {"rho": 23.0}
)
#: The parameter, where equilibria are, its span; the period that is asked for, and where it is.
CASES = {
    "reaction": (REACTION, "p1", [0.1, 0.7], (0.0, 0.4), 80.0, 0.105507070040),
    "lorenz": (LORENZ, "rho", [7.7, 7.7, 22.0], (10.0, 30.0), 30.0, 13.9265574075),
}


@functools.cache
def nearest(name):
    """The family from its Hopf point, which ends where the parameter stands still."""
    problem, parameter, x0, span, *_ = CASES[name]
    rest = pk.continuation(problem, parameter, x0=x0, span=span)
    return rest.special("H")[0].switch()


@pytest.mark.parametrize("name", CASES)
def test_a_family_goes_on_to_the_bound_of_its_period(name):
    problem, parameter, x0, span, period, at = CASES[name]
    first = nearest(name)
    assert first.stops[1].reason == "homoclinic"
    assert "bounds" in first.stops[1].message
    assert float(first.points.period[-1]) < period
    rest = pk.continuation(problem, parameter, x0=x0, span=span)
    options = pk.ContinuationOptions(bounds={"period": (0.0, period)})
    family = rest.special("H")[0].switch(options=options)
    assert [stop.reason for stop in family.stops] == ["hopf", "bound"]
    assert float(family.points.period[-1]) == period
    assert float(family.points[parameter][-1]) == pytest.approx(at, rel=1e-10)
    assert family.points.sizes["point"] > 3
    assert np.all(np.diff(family.points.period) > 0.0)
    assert family.points.mesh_error.max() <= 1e-8  # that of the last point, too
    assert family.points.residual.max() < 1e-9
    assert [s.kind for s in family.special_points] == ["end", "end"]  # no folds of rounding


@pytest.mark.parametrize("name", CASES)
def test_a_family_goes_on_to_an_event_of_its_period(name):
    problem, parameter, _, span, period, at = CASES[name]
    orbit = nearest(name).orbit(nearest(name).points.sizes["point"] // 2)
    there = problem.replace(**{parameter: float(orbit[parameter])})
    family = pk.continuation(
        there, parameter, orbit=orbit, span=span, events={"long": f"period - {period}"}, stop="long"
    )
    side = [stop.reason for stop in family.stops].index("long")
    assert family.stops[1 - side].reason == "hopf"
    assert float(family.points.period[-side]) == pytest.approx(period, rel=1e-12)
    assert float(family.points[parameter][-side]) == pytest.approx(at, rel=1e-10)
    (event,) = family.special("UZ")
    assert event["period"] == pytest.approx(period, rel=1e-12)


@pytest.mark.parametrize("event", ["period - 5", "u1_max - 100", "p1 - 0.3"])
def test_no_event_is_awaited_that_a_longer_period_does_not_bring(event):
    first = nearest("reaction")
    i = int(np.argmax(first.points.period.values > 8.0))
    family = pk.continuation(
        REACTION.replace(p1=float(first.points.p1[i])), "p1", orbit=first.orbit(i),
        span=(0.0, 0.4), events={"far": event}, stop="far",
        options=pk.ContinuationOptions(directions="backward"),
    )  # fmt: skip
    assert family.stops[0].reason == "homoclinic"
    assert float(family.points.period[0]) == pytest.approx(float(first.points.period[-1]), rel=0.3)


def test_an_orbit_of_a_long_period_is_followed_in_two_parameters():
    """Beside families in one parameter at another value of the second one."""
    orbit = nearest("reaction").orbit(-1)
    period = float(orbit.period)
    curve = pk.continuation(
        REACTION.replace(p1=float(orbit.p1)), ("p1", "p3"), orbit=orbit,
        span=((0.0, 0.4), (1.95, 2.05)), fix="period",
    )  # fmt: skip
    assert [stop.reason for stop in curve.stops] == ["bound", "bound"]
    assert curve.points.sizes["point"] > 3
    assert np.allclose(curve.points.period, period, rtol=1e-12)
    assert sorted(np.round(curve.points.p3.values[[0, -1]], 12)) == [1.95, 2.05]
    at = int(np.argmax(curve.points.p3.values))
    other = REACTION.replace(p3=2.05)
    rest = pk.continuation(other, "p1", x0=[0.1, 0.7], span=(0.0, 0.4))
    options = pk.ContinuationOptions(bounds={"period": (0.0, period)})
    family = rest.special("H")[0].switch(options=options)
    assert family.stops[1].reason == "bound"
    assert float(family.points.p1[-1]) == pytest.approx(float(curve.points.p1[at]), rel=1e-10)
