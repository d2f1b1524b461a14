"""Steps by Taylor series: against other integrators, beside Runge-Kutta steps, where they end."""

import functools

import mpmath as mp
import numpy as np
import pytest
from scipy.integrate import solve_ivp

import phasekit as pk
from phasekit.motion import method
from phasekit.motion.exponents import lyapunov
from phasekit.motion.flow import motions
from phasekit.motion.lost import EXHAUSTED, FAILED
from phasekit.motion.rates import order_of, rates_of
from phasekit.motion.strobe import Steps, strobe

H = pk.Harmonic
EIGHT = pk.Coefficients(1.0, 0.35, 0.12)
DISK = pk.GyroRotorDisk(beta=1.0, e=0.1, a=0.05, r=0.1, omega1=2.0)
QUARTIC = pk.Potential("x^4/4", "x")
EVERY = pk.Potential("exp(-x)/4 + x*sinh(x/2) - 2*tanh(x)*cos(x) + x^7*cosh(x/3)*sin(k*x)/50", "x",
                     {"k": 1.5})  # fmt: skip
SYSTEMS = {
    "duffing": pk.Perturbed(QUARTIC, damping=0.15, forcing=H(0.2, 1.0)),
    "every": pk.Perturbed(EVERY, damping=0.05, torque=0.1, forcing=[H(0.3, 1.3), H(0.1, 2.6, 0.4)]),
    "disk": pk.Perturbed(DISK, damping=0.3, modulation={"omega1": H(0.8, 1.7)}),
    "drifts": pk.Perturbed(EIGHT, damping=0.1, drift={"A": 0.05}),
}


def followed(system, states, legs, kept=4, **how):
    law = system.law
    values = law.values(*system.parameters.values())
    return strobe(law, values, np.array(states), legs, kept, steps=Steps(**how))


def moved(system, states, times, series=True, **how):
    law = system.law
    values = law.values(*system.parameters.values())
    how["method"] = None if series else "dop853"
    return motions(law, values, np.array(states), np.array(times), **how)


def has_series(system):
    law = system.law
    return rates_of(law, law.values(*system.parameters.values()), order=16)[0].series != 0


def every_rates(t, x):
    x, v = x
    slope = -np.exp(-x) / 4 + np.sinh(x / 2) + x * np.cosh(x / 2) / 2
    slope += 2 * np.tanh(x) * np.sin(x) - 2 * np.cos(x) / np.cosh(x) ** 2
    slope += x**6 * (7 * np.cosh(x / 3) + x * np.sinh(x / 3) / 3) * np.sin(1.5 * x) / 50
    slope += x**7 * np.cosh(x / 3) * 1.5 * np.cos(1.5 * x) / 50
    return v, 0.1 - slope - 0.05 * v + 0.3 * np.cos(1.3 * t) + 0.1 * np.cos(2.6 * t + 0.4)


def test_every_function_as_scipy_says():
    assert has_series(SYSTEMS["every"])
    times = [0.7, 3.0, 6.0, -2.0]
    found = moved(SYSTEMS["every"], [[0.7, -0.4]], [times], rtol=1e-13, atol=1e-13)
    for t, state in zip(times, found.states[0], strict=True):
        there = solve_ivp(every_rates, (0.0, t), [0.7, -0.4], "DOP853", rtol=1e-13, atol=1e-14)
        assert state == pytest.approx(there.y[:, -1], abs=1e-11)


@pytest.mark.parametrize("rtol", [1e-3, 1e-5, 1e-7, 1e-9, 1e-11, 1e-13])
def test_the_error_follows_the_tolerance(rtol):
    """A quartic oscillator is cn(t | 1/2), a pendulum that turns am(3 t/2 | 16/9)."""
    times = np.arange(1.0, 40.0, 3.0)
    with mp.workdps(25):
        quartic = [float(mp.ellipfun("cn", t, m=0.5)) for t in times]
        sines = [float(mp.ellipfun("sn", 1.5 * t, m=mp.mpf(16) / 9 / 4)) for t in times]
    free = pk.Perturbed(QUARTIC, torque=0.0)
    found = moved(free, [[1.0, 0.0]], [times], rtol=rtol, atol=rtol).states[0, :, 0]
    # Of a period of 7.4 each step in it counts.
    assert np.abs(found - quartic).max() < 100.0 * rtol
    pendulum = pk.Perturbed(pk.Coefficients(0.0, 1.0, 0.0), damping=0.0, forcing=H(0.0, 1.0))
    found = moved(pendulum, [[0.0, 3.0]], [times], rtol=rtol, atol=rtol).states[0, :, 0]
    assert np.abs(np.sin(0.5 * found) - sines).max() < 300.0 * rtol


@pytest.mark.parametrize("name", SYSTEMS)
def test_both_ways_agree(name):
    system = SYSTEMS[name]
    assert has_series(system)
    states = np.random.default_rng(0).uniform(-1.2, 1.2, (11, 2))
    ways = [
        followed(system, states, 1.7, rtol=1e-12, atol=1e-13, series=how) for how in (True, False)
    ]
    for way in ways:
        assert way.status.tolist() == [2] * 11
    assert np.abs(ways[0].states - ways[1].states).max() < 1e-9
    times = [[-0.4, 2.0, 0.0, 0.3, 0.3, 1.9]]
    ways = [
        moved(system, states, times, rtol=1e-12, atol=1e-13, series=how) for how in (True, False)
    ]
    assert np.abs(ways[0].states - ways[1].states).max() < 1e-9
    assert (3 * ways[0].steps < 2 * ways[1].steps).all()
    beside = np.hstack([states[:3], np.tile([1.0, 0.0, 0.0, 1.0], (3, 1))])
    how = {"rtol": 1e-12, "atol": 1e-13, "tangents": 2}
    ways = [moved(system, beside, times, **how, series=one) for one in (True, False)]
    assert ways[0].states.shape == (3, 6, 6)
    assert np.abs(ways[0].states - ways[1].states).max() < 1e-9
    assert (3 * ways[0].steps < 2 * ways[1].steps).all()
    law, parameters = system.law, list(system.parameters.values())
    arrays = (*parameters, states[:2, 0], states[:2, 1], 8.0)
    own = {"rtol": 1e-11, "atol": 1e-12}
    ways = [lyapunov(law, *arrays, **own, method=how) for how in (None, "dop853")]
    assert np.abs(ways[0].lyapunov_exponent - ways[1].lyapunov_exponent).max() < 1e-8
    assert ways[0].lyapunov_exponent.shape == (2, 2)


@pytest.mark.parametrize("power", [4, 10, 16])
def test_series_whose_last_terms_vanish(power):
    """From rest at 0 under a torque, x = t^2/2 is exact to the order 2 power - 1."""
    system = pk.Perturbed(pk.Potential(f"x^{power}/{power}", "x"), torque=1.0)
    assert has_series(system)
    found = moved(system, [[0.0, 0.0]], [[0.5, 2.0, 5.0]]).states[0]
    energy = 0.5 * found[:, 1] ** 2 + found[:, 0] ** power / power - found[:, 0]
    assert np.abs(energy).max() < 1e-8
    other = moved(system, [[0.0, 0.0]], [[0.5, 2.0, 5.0]], series=False).states[0]
    assert np.abs(found - other).max() < 1e-7
    assert found[0, 0] == pytest.approx(0.125, abs=0.5 ** (2 * power - 3))


def test_laws_without_series_are_left_to_runge_kutta():
    for text in ("x*atan(x)", "x^20", "asinh(x)*x", "x^2*erf(x)"):
        assert not has_series(pk.Perturbed(pk.Potential(text, "x"), damping=0.1))
    assert not has_series(pk.Perturbed(EIGHT, quadratic=0.1))
    assert has_series(pk.Perturbed(pk.Potential("b*x^2/sqrt(1 + b)", "x", {"b": 1.0}), damping=0.1))


def test_motions_end_where_they_do_by_runge_kutta():
    """X'' = x^3 from (1, 1/sqrt 2) is 1/(1 - t/sqrt 2)."""
    runaway = pk.Perturbed(pk.Potential("-x^4/4", "x"), damping=0.0, forcing=H(0.0, 1.0))
    times = 2.0**0.5 * np.array([0.5, 0.9, 0.999, 1.0001, 1.1])
    states = [[1.0, 0.5**0.5], [np.nan, 0.0], [0.0, 0.0]]
    for series in (True, False):
        found = moved(runaway, states, [times], series=series)
        assert found.status.tolist() == [FAILED, FAILED, 2]
        assert found.states[0, :3, 0] == pytest.approx([2.0, 10.0, 1000.0], rel=1e-5)
        assert np.isnan(found.states[0, 3:]).all()
        assert np.isnan(found.states[1]).all()
        assert (found.states[2] == 0.0).all()
    with pytest.warns(RuntimeWarning, match="1 of 1 motions end before .* run to infinity"):
        pk.flow(runaway, 1.0, 0.5**0.5, times)


def test_turns_that_do_not_matter_are_left_to_runge_kutta():
    """Backwards in time strong damping makes a rotor so fast that its potential is nothing."""
    system = pk.Perturbed(EIGHT, damping=1e3)
    how = {"rtol": 1e-6, "atol": 1e-6, "most": 2000}
    found = moved(system, [[0.3, 0.1], [0.3, 0.0]], [[-0.02], [-0.001]], **how)
    assert found.status.tolist() == [2, 2]
    assert found.states[0, 0, 1] == pytest.approx(0.1 * np.exp(20.0), rel=0.01)
    alone = moved(system, [[0.3, 0.1]], [[-0.02]], **how, series=False)
    assert np.array_equal(alone.states[0], found.states[0])
    lost = moved(system, [[0.3, 0.1]], [[-0.02]], **{**how, "most": 3})
    assert lost.status.tolist() == [EXHAUSTED]


def test_what_series_leave_is_followed_anew(monkeypatch):
    """Series come further in as many steps; of what they saw nothing is left."""
    few = functools.partial(method.limits_of, most=400)
    monkeypatch.setattr("phasekit.motion.strobe.limits_of", few)
    ways = [
        followed(SYSTEMS["duffing"], [[0.3, 0.1]], 2.0 * np.pi, 60, series=how)
        for how in (True, False)
    ]
    for way in ways:
        assert way.status.tolist() == [EXHAUSTED]
        assert way.taken[0] == np.isfinite(way.states[0, 1:, 0]).sum() < 20
    assert np.array_equal(ways[0].states, ways[1].states, equal_nan=True)


def test_a_motion_is_the_same_in_any_lane():
    system = SYSTEMS["duffing"]
    states = np.random.default_rng(1).uniform(-2.0, 2.0, (29, 2))
    together = followed(system, states, 2.0 * np.pi, 30)
    assert together.status.tolist() == [2] * 29
    neighbours = np.concatenate([[[np.nan, 0.0], [1e200, 0.0], [0.0, 1e8]], states[20:23]])
    apart = followed(system, neighbours, 2.0 * np.pi, 30)
    assert np.array_equal(apart.states[3:], together.states[20:23])


def test_orders_rise_with_the_digits():
    orders = [order_of(rtol) for rtol in (0.1, 1e-6, 1e-10, 1e-14)]
    assert orders == [6, 12, 16, 20]


# ------------------------------------------------------------------------- flows of many states

FLOWS = {
    "quotients": ({"s": "-V*s/(K + s)", "p": "V*s/(K + s) - p"}, {"V": 1.0, "K": 0.5}, (2.0, 0.1)),
    "logs": ({"x": "x*(1 - log(x + 1))*a", "y": "-y*log(2 + x)"}, {"a": 2.0}, (0.3, 1.0)),
    "roots": (
        {"x": "a - sqrt(1 + x^2 + y^2)", "y": "x/(1 + y^2)^1.5 - y", "z": "x*y - z"},
        {"a": 1.4}, (0.3, 1.0, 0.0),
    ),
    "real powers": (
        {"x": "b/(1 + y^n) - x", "y": "b/(1 + x^n) - y"}, {"b": 3.0, "n": 2.7}, (0.3, 1.0),
    ),
    "forced": ({"x": "y", "y": "x - x^3 - y/5 + 0.3*cos(w*t)"}, {"w": 1.2}, (0.5, 0.0)),
}  # fmt: skip
RATES = {
    "quotients": lambda t, x: [-x[0] / (0.5 + x[0]), x[0] / (0.5 + x[0]) - x[1]],
    "logs": lambda t, x: [2 * x[0] * (1 - np.log(x[0] + 1)), -x[1] * np.log(2 + x[0])],
    "roots": lambda t, x: [
        1.4 - np.sqrt(1 + x[0] ** 2 + x[1] ** 2), x[0] / (1 + x[1] ** 2) ** 1.5 - x[1],
        x[0] * x[1] - x[2],
    ],
    "real powers": lambda t, x: [3 / (1 + x[1] ** 2.7) - x[0], 3 / (1 + x[0] ** 2.7) - x[1]],
    "forced": lambda t, x: [x[1], x[0] - x[0] ** 3 - x[1] / 5 + 0.3 * np.cos(1.2 * t)],
}  # fmt: skip


@pytest.mark.parametrize("name", FLOWS)
def test_states_of_flows_as_scipy_says(name):
    formulas, parameters, x0 = FLOWS[name]
    clock = {"time": "t", "period": "2*pi/w"} if name == "forced" else {}
    problem = pk.Problem(formulas, parameters=parameters, **clock)
    times = np.array([0.3, 2.0, 7.0, 12.0])
    start = dict(zip(formulas, x0, strict=True))
    found = pk.flow(problem, x0=start, t=times, method="taylor", rtol=1e-12, atol=1e-12)
    assert pk.flow(problem, x0=start, t=times, rtol=1e-12, atol=1e-12).equals(found)
    true = solve_ivp(
        RATES[name], (0, 12), x0, method="DOP853", rtol=3e-14, atol=1e-15, t_eval=times
    ).y
    for state, one in zip(formulas, true, strict=True):
        assert found[f"motion_{state}"].values.ravel() == pytest.approx(one, rel=1e-9, abs=1e-11)
    other = pk.flow(problem, x0=start, t=times, method="dop853", rtol=1e-12, atol=1e-12)
    assert not other.equals(found)


def test_flows_without_series_say_so_when_they_are_asked_for():
    for f in ({"x": "-atan(x)"}, lambda x: -x):
        problem = pk.Problem(f, state=("x",))
        with pytest.raises(pk.ParameterError, match="method: got 'taylor', wants dop853 or radau"):
            pk.flow(problem, x0=[1.0], t=[1.0], method="taylor")


def test_a_state_at_a_zero_of_a_root_goes_on_by_runge_kutta():
    """X' = sqrt(x) + 1 from 0, where the root has no series: t = 2 sqrt(x) - 2 log(1 + sqrt(x))."""
    problem = pk.Problem({"x": "sqrt(x) + 1"})
    x = float(pk.flow(problem, x0=[0.0], t=[3.0]).motion_x[0].squeeze())
    root = x**0.5
    assert 2 * root - 2 * np.log1p(root) == pytest.approx(3.0, abs=1e-6)
