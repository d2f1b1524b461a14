"""Phase responses: in closed form, and against kicks that SciPy follows."""

import matplotlib
import numpy as np
import pytest
import xarray as xr
from scipy.integrate import solve_ivp

import phasekit as pk

OSCILLATOR = pk.Problem(["y", "mu*(1 - x**2)*y - x"], ("x", "y"), {"mu": 1.0})


def rates(problem):
    """The right-hand side of a problem of formulas, of states in columns."""
    import sympy

    given = {sympy.Symbol(k, real=True): v for k, v in problem.parameters.items()}
    states = [sympy.Symbol(name, real=True) for name in problem.state]
    return sympy.lambdify(states, [e.subs(given) for e in problem.field.expressions], cse=True)


def kicked(problem, orbit, response, name, places, size, periods):
    """Responses by kicks of a state to both sides, each followed until it is back on the orbit."""
    f, period = rates(problem), float(orbit.period)
    x = np.array([orbit[state].values[places] for state in problem.state])
    starts = np.repeat(x[:, None], 4, axis=1)  # states, kicks, places
    starts[problem.state.index(name)] += size * np.array([2.0, 1.0, -1.0, -2.0])[:, None]
    ran = solve_ivp(
        lambda t, all_: np.concatenate(f(*all_.reshape(len(x), -1))), (0.0, periods * period),
        starts.ravel(), method="DOP853", rtol=1e-12, atol=1e-12,
    )  # fmt: skip
    ends = ran.y[:, -1].reshape(starts.shape)
    speed = np.array(f(*x))
    slope = (8.0 * (ends[:, 1] - ends[:, 2]) - (ends[:, 0] - ends[:, 3])) / (12.0 * size)
    return np.sum(slope * speed, axis=0) / np.sum(speed * speed, axis=0)


def test_normal_form_of_a_hopf_point():
    """Theta' = w + b (1 - r^2), r' = r (1 - r^2): isochrons theta - b ln r = const."""
    grow, turn = "(1 - x**2 - y**2)", "(w + b*(1 - x**2 - y**2))"
    system = pk.Problem(
        [f"x*{grow} - y*{turn}", f"y*{grow} + x*{turn}"], ("x", "y"), {"w": 1.7, "b": 0.6}
    )
    orbit = pk.periodic_orbit(system, [1.0, 0.0])
    response = pk.phase_response(orbit)
    x, y = orbit.x.values, orbit.y.values
    wanted = np.stack([(-y - 0.6 * x) / 1.7, (x - 0.6 * y) / 1.7], axis=1)
    np.testing.assert_array_equal(response.time, orbit.time)
    np.testing.assert_allclose(response.phase_response, wanted, atol=1e-10)
    table = response.phasekit.table()
    np.testing.assert_array_equal(table["phase_response x"], response.phase_response[:, 0])
    direct = pk.phase_response(orbit, direct=True)
    same = response.sel(time=direct.time)
    np.testing.assert_allclose(direct.phase_response, same.phase_response, atol=1e-7)


def test_van_der_pol():
    branch = pk.continuation(
        OSCILLATOR, "mu", orbit=pk.periodic_orbit(OSCILLATOR, [2.0, 0.0]), span=(0.9, 1.4)
    )
    orbit = branch.orbit(-1)  # which knows its parameter
    system = OSCILLATOR.replace(mu=float(orbit.mu))
    response = pk.phase_response(orbit)
    assert float(response.mu) == pytest.approx(1.4)
    places = [0, 100, 210]
    wanted = kicked(system, orbit, response, "x", places, 1e-3, 4)
    got = response.phase_response.sel(state="x").values[places]
    np.testing.assert_allclose(got, wanted, atol=2e-7)
    ax = pk.plot.phase_response(response)
    assert [line.get_label() for line in ax.lines[:2]] == ["x", "y"]
    matplotlib.pyplot.close(ax.figure)


@pytest.mark.slow
def test_hodgkin_huxley():
    """[HodgkinHuxley1952] at 10 uA/cm^2, in shifted voltages."""
    neuron = pk.Problem(
        {
            "v": "I - 120*m^3*h*(v - 115) - 36*n^4*(v + 12) - 0.3*(v - 10.6)",
            "m": "(25 - v)/10/(exp((25 - v)/10) - 1)*(1 - m) - 4*exp(-v/18)*m",
            "h": "7/100*exp(-v/20)*(1 - h) - h/(exp((30 - v)/10) + 1)",
            "n": "(10 - v)/100/(exp((10 - v)/10) - 1)*(1 - n) - exp(-v/80)/8*n",
        },
        parameters={"I": 10.0},
    )
    orbit = pk.periodic_orbit(neuron, {"v": 0.0, "m": 0.05, "h": 0.6, "n": 0.32}, settle=100.0)
    response = pk.phase_response(orbit)
    assert float(response.phase_response_error) < 1e-5
    places = np.linspace(0, orbit.sizes["time"] - 1, 6).astype(int)[:-1]
    for name, size in (("v", 0.02), ("n", 1e-3)):
        wanted = kicked(neuron, orbit, response, name, places, size, 5)
        got = response.phase_response.sel(state=name).values[places]
        np.testing.assert_allclose(got, wanted, rtol=1e-5, atol=1e-5 * np.max(np.abs(got)))


def test_rotations_under_torque_and_damping():
    system = pk.Perturbed(pk.Coefficients(1.0, 2.0, 0.0), damping=0.5, torque=3.5)
    orbit = pk.periodic_orbit(system, [0.0, 5.0])
    response = pk.phase_response(orbit)
    direct = pk.phase_response(orbit, direct=True)
    same = response.sel(time=direct.time)
    np.testing.assert_allclose(direct.phase_response, same.phase_response, atol=1e-7)
    # A kick of the rate against one of the angle: f z = 1.
    assert float(response.phase_response_error) < 1e-8


def test_times_have_the_unit_of_the_model():
    """None where it names none; that of its states where these have seconds in theirs."""
    words = {"x": {"units": "mV"}}
    orbit = pk.periodic_orbit(OSCILLATOR, [2.0, 0.0])
    for more, unit in [
        ({}, None), ({"time": {"units": "ms"}}, "ms"), ({"y": {"units": "mV s-1"}}, "s"),
        ({"y": {"units": "mV ms-1"}}, None),
    ]:  # fmt: skip
        response = pk.phase_response(orbit, system=OSCILLATOR.described(words | more))
        for name in ("time", "period", "phase_response"):
            assert response[name].attrs.get("units") == unit


def test_motions_take_and_have_times_in_the_unit_of_the_model():
    forced = pk.Problem({"x": "cos(t) - x"}, time="t", period=2.0 * np.pi).described(
        {"t": {"units": "ms"}}
    )
    plain = OSCILLATOR.described({"time": {"units": "ms"}})
    times = xr.DataArray([1.0, 2.0], {"time": [1.0, 2.0]}, attrs={"units": "ms"})
    in_seconds = xr.DataArray([1e-3, 2e-3], dims="time", attrs={"units": "s"})
    for system, start in [(forced, [1.0]), (plain, [1.0, 0.0])]:
        wanted = pk.flow(system, start, [1.0, 2.0])
        assert wanted.time.attrs["units"] == "ms"
        assert wanted.time.values.tolist() == [1.0, 2.0]
        for given in (times, times.time, in_seconds, wanted.time):
            xr.testing.assert_allclose(pk.flow(system, start, given), wanted, rtol=1e-12)
    found = pk.lyapunov(plain, [2.0, 0.0], duration=5.0)
    assert found.lyapunov_exponent.attrs["units"] == found.lyapunov_sum.attrs["units"] == "ms-1"
    noisy = pk.Problem({"x": "-x"}, noise={"x": 0.1}).described({"time": {"units": "ms"}})
    paths = pk.flow(noisy, [1.0], [0.5, 1.0], paths=2, seed=1)
    passed = pk.first_passage(noisy, x0=[1.0], target="x - 0.5", duration=2.0, paths=4, seed=1)
    assert paths.noise_step.attrs["units"] == passed.mean_passage_time.attrs["units"] == "ms"
    assert passed.passage_rate.attrs["units"] == "ms-1"
    orbit = pk.periodic_orbit(plain, [2.0, 0.0])
    again = pk.flow(plain, [2.0, 0.0], orbit.time, events="x")
    assert again.event_time.attrs["units"] == "ms"
    period = xr.DataArray(float(orbit.period), attrs={"units": "ms"})
    again = pk.periodic_orbit(plain, [2.0, 0.0], period=period)
    assert float(again.period) == pytest.approx(float(orbit.period), rel=1e-9)


def test_what_has_no_phase_is_refused():
    forced = pk.Perturbed(
        pk.Coefficients(1.0, 2.0, 0.0), damping=0.5, forcing=pk.Harmonic(0.5, 1.0)
    )
    with pytest.raises(pk.ParameterError, match="a forced cycle has the phase of its forcing"):
        pk.phase_response(pk.periodic_orbit(forced, [0.0, 0.0]))
    spring = pk.Potential("x^2/2 + x^4", "x")
    with pytest.raises(pk.ParameterError, match="wants a stable one"):
        pk.phase_response(pk.periodic_orbit(spring, [1.0, 0.0]))
    back = pk.Problem(["-y", "-(1 - x**2)*y*mu + x"], ("x", "y"), {"mu": 1.0})
    with pytest.raises(pk.ParameterError, match="motions beside an orbit that is not stable"):
        pk.phase_response(pk.periodic_orbit(back, pk.periodic_orbit(OSCILLATOR, [2.0, 0.0])
                          .isel(time=slice(None, None, -1))[["x", "y"]].assign_coords(
                              time=pk.periodic_orbit(OSCILLATOR, [2.0, 0.0]).time)))  # fmt: skip


def test_orbits_of_functions_need_their_system():
    def f(x, mu):
        return [x[1], mu * (1 - x[0] ** 2) * x[1] - x[0]]

    problem = pk.Problem(f, ("x", "y"), {"mu": 1.0})
    orbit = pk.periodic_orbit(problem, [2.0, 0.0])
    with pytest.raises(pk.ParameterError, match="system=problem"):
        pk.phase_response(orbit)
    response = pk.phase_response(orbit, system=problem)
    exact = pk.phase_response(pk.periodic_orbit(OSCILLATOR, orbit))
    assert float(response.period) == pytest.approx(float(exact.period), rel=1e-9)
    np.testing.assert_allclose(
        response.phase_response[0], exact.phase_response[0], rtol=1e-4, atol=1e-4
    )
