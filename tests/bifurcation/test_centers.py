"""Hopf points at centers: families of periodic orbits at one value of the parameter."""

import math

import numpy as np
import pytest
from scipy.integrate import quad, solve_ivp
from scipy.special import ellipk

import phasekit as pk


def switched(f, states=("x", "y"), x0=None, p=-0.5, span=(-1.0, 1.0)):
    problem = pk.Problem(f, states, {"p": p})
    x0 = np.zeros(len(states)) if x0 is None else x0
    (hopf,) = pk.continuation(problem, "p", x0=x0, span=span).special("H")
    return hopf, hopf.switch()


def vertical(family):
    return [message for message in family.messages if "vertical family" in message]


@pytest.mark.parametrize("rate", [1e-3, 1.0, 3e4])
@pytest.mark.parametrize("more", [0, 1, 2])
def test_linear_centers_have_a_vertical_family(rate, more, tmp_path):
    states = ["x", "y", "z", "w"][: 2 + more]
    f = [f"p*x - {rate}*y", f"{rate}*x + p*y", f"-{rate}*z", f"-0.7*{rate}*w + x"]
    hopf, family = switched(f[: 2 + more], states, span=(-rate, rate), p=-rate / 2)
    assert hopf.normal_form["l1"] == 0.0
    points = family.points
    assert points.sizes["point"] > 20
    np.testing.assert_allclose(points.p, 0.0, atol=1e-12 * rate)
    np.testing.assert_allclose(points.period, 2 * math.pi / rate, rtol=1e-12)
    radius = points.x_max.values
    assert np.all(np.diff(radius) > 0.0)
    assert radius[-1] > 1e3 * radius[0]
    assert [stop.reason for stop in family.stops] == ["hopf", "unbounded"]
    if not more and rate == 1.0:
        family.save(tmp_path / "family.nc")
        assert pk.Branch.load(tmp_path / "family.nc") == family
    (message,) = vertical(family)
    assert "with one period" in message
    assert message in repr(family)


def pendulum(a):
    return 4 * ellipk(math.sin(a / 2) ** 2)


def quartic(a):
    """Of x'' + x + x^3 = 0, by its energy, with x = a sin(s)."""
    return 4 * quad(lambda s: (1 + 0.5 * a**2 * (1 + math.sin(s) ** 2)) ** -0.5, 0, math.pi / 2)[0]


@pytest.mark.parametrize("p0", [0.0, 0.3])
@pytest.mark.parametrize(
    ("force", "period", "end", "largest"),
    [("sin(x)", pendulum, "homoclinic", 3.1), ("x + x**3", quartic, "unbounded", 100.0)],
)
def test_nonlinear_centers_have_a_vertical_family(force, period, end, largest, p0):
    _, family = switched(["y", f"-(p - {p0})*y - ({force})"])
    points = family.points
    np.testing.assert_allclose(points.p, p0, atol=1e-10)
    a = points.x_max.values
    assert a[-1] > largest
    seen = a < largest
    assert seen.sum() > 15
    assert np.all(np.diff(a[seen]) > 0.0)
    exact = [period(one) for one in a[seen]]
    np.testing.assert_allclose(points.period[seen], exact, rtol=1e-7)
    assert family.stops[1].reason == end
    (message,) = vertical(family)
    assert f"p = {p0:g} " in message
    assert "one period" not in message


def test_reversible_centers_have_a_vertical_family():
    """(x, y, t) -> (-x, y, -t): x^2/2 - y - ln(1 - y) is constant at p = 0; no force is known."""
    _, family = switched(["y", "-x + x*y + p*y"])
    points = family.points
    np.testing.assert_allclose(points.p, 0.0, atol=1e-9)
    energy = points.x_max**2 / 2
    for name in ("y_min", "y_max"):
        y = points[name].values
        near = y < 1.0 - 1e-6
        assert near.sum() > 15
        np.testing.assert_allclose(-y[near] - np.log1p(-y[near]), energy[near], rtol=1e-6)
    assert len(vertical(family)) == 1
    assert family.stops[1].reason == "unbounded"  # though the period grows for ever


@pytest.mark.parametrize("p0", [0.0, 0.3])
def test_a_center_of_a_function_is_one(p0):
    def f(x, p):
        return [x[1], -x[0] - x[0] ** 3 - (p - p0) * x[1]]

    _, family = switched(f)
    assert family.points.sizes["point"] > 20
    np.testing.assert_allclose(family.points.p, p0, atol=1e-10)
    assert len(vertical(family)) == 1


@pytest.mark.parametrize("sign", [1, -1])
def test_a_first_coefficient_of_zero_need_not_be_a_center(sign):
    r = "(x**2 + y**2)"
    _, family = switched([f"p*x - y - {sign}*x*{r}**2", f"x + p*y - {sign}*y*{r}**2"])
    points = family.points
    assert points.sizes["point"] > 10
    np.testing.assert_allclose(points.p, sign * points.x_max**4, rtol=1e-6, atol=1e-11)
    assert vertical(family) == []
    assert family.stops[1].reason == "bound"


def test_a_family_that_goes_to_infinity_ends_there():
    """R^2 = p/(1 - p) at once with a speed of growth that goes to zero."""
    growth = "(p - 1 + 1/(1 + x**2 + y**2))"
    _, family = switched([f"{growth}*x - y", f"{growth}*y + x"], span=(-1.0, 2.0))
    points = family.points
    seen = points.p < 0.999
    assert seen.sum() > 10
    np.testing.assert_allclose(
        (points.x_max**2)[seen], (points.p / (1 - points.p))[seen], rtol=1e-6
    )
    assert float(points.p[-1]) == pytest.approx(1.0, abs=1e-10)
    assert family.stops[1].reason == "unbounded"
    assert vertical(family) == []


@pytest.mark.parametrize("force", ["sin(x)", "x + x**3"])
def test_a_vertical_family_ends_at_its_hopf_point_and_has_no_folds(force):
    _, family = switched(["y", f"-p*y - ({force})"])
    problem = pk.Problem(["y", f"-p*y - ({force})"], ("x", "y"), {"p": 0.0})
    whole = pk.continuation(problem, "p", orbit=family.orbit(10), span=(-1.0, 1.0))
    assert whole.points.sizes["point"] > 20
    assert {one.kind for one in whole.special_points} == {"end"}
    assert "hopf" in [stop.reason for stop in whole.stops]
    assert len(vertical(whole)) == 1


def volterra(largest):
    """Period of x' = x (1 - y), y' = y (x - 1), by SciPy in u = ln x and v = ln y."""

    def back(t, state):  # to y = 1 where x is largest
        return state[1]

    back.direction, back.terminal = 1.0, 2  # the start counts
    with np.errstate(over="ignore", invalid="ignore"):  # of steps that are tried in vain
        ran = solve_ivp(
            lambda t, state: (1.0 - np.exp(state[1]), np.exp(state[0]) - 1.0),
            (0.0, 1e4), (math.log(largest), 0.0), "DOP853", rtol=1e-13, atol=1e-13, events=back,
        )  # fmt: skip
    times = ran.t_events[0]
    return times[times > 1e-6][0]


@pytest.mark.slow
@pytest.mark.parametrize(
    "f", [["x*(1 - y) + p*x*(x - 1)", "y*(x - 1)"], ["x*(1 - y + p)", "y*(x - 1) + p*(y - 1)"]]
)
def test_periods_are_right_where_states_pass_far_below_their_largest_values(f):
    """X and y fall to 1e-60 of their amplitudes, where they decide how long an orbit takes."""
    problem = pk.Problem(f, ("x", "y"), {"p": -0.25})
    (hopf,) = pk.continuation(problem, "p", x0=[1.0, 1.0], span=(-0.3, 0.3)).special("H")
    family = hopf.switch(options=pk.ContinuationOptions(max_points=300))
    points = family.points
    np.testing.assert_allclose(points.p, 0.0, atol=1e-10)
    assert len(vertical(family)) == 1
    assert {one.kind for one in family.special_points} == {"end"}
    a = points.x_max.values
    assert a[-1] > 100.0
    few = [int(np.argmin(np.abs(a - one))) for one in (10.0, 30.0, 55.0, 65.0, 100.0)]
    exact = [volterra(a[k]) for k in few]
    np.testing.assert_allclose(points.period[few], exact, rtol=1e-8)
    assert family.stops[1].reason == "stuck"
    assert "more than max_intervals = 1000" in family.stops[1].message
