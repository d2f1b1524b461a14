"""`periodic_orbit` returns an orbit over its least period, whatever the guess."""

import re

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import phasekit as pk

ROESSLER = pk.Problem(
    ["-y - z", "x + a*y", "b + z*(x - c)"], ("x", "y", "z"), {"c": 2.5, "a": 0.2, "b": 0.2}
)
VAN_DER_POL = pk.Problem(["y", "mu*(1 - x**2)*y - x"], ("x", "y"), {"mu": 1.0})


def simulated(f, x, length, samples):
    at = np.linspace(0.0, length, samples)
    return solve_ivp(f, (0.0, length), x, t_eval=at, rtol=1e-10, atol=1e-12, method="LSODA").y.T


def roessler(t, x):
    return [-x[1] - x[2], x[0] + 0.2 * x[1], 0.2 + x[2] * (x[0] - 2.5)]


def van_der_pol(t, x):
    return [x[1], (1 - x[0] ** 2) * x[1] - x[0]]


@pytest.mark.slow
def test_the_orbit_of_roessler_is_run_through_once():
    x = simulated(roessler, [1.0, 1.0, 0.1], 300.0, 2)[-1]
    t = np.linspace(0.0, 60.0, 60001)
    y = simulated(roessler, x, 60.0, len(t))[:, 1]
    up = np.flatnonzero((y[:-1] < 0.0) & (y[1:] >= 0.0))
    crossings = t[up] - y[up] * np.diff(t)[up] / (y[up + 1] - y[up])
    assert len(crossings) > 8
    period = np.diff(crossings)
    assert np.ptp(period) < 1e-3
    for start in ([1.0, 1.0, 0.1], [2.0, -1.0, 0.2], [0.5, 3.0, 0.1]):
        orbit = pk.periodic_orbit(ROESSLER, start)
        assert orbit.period == pytest.approx(period.mean(), rel=1e-5)
    family = pk.continuation(ROESSLER, "c", orbit=orbit, span=(2.0, 3.5))
    assert [point.kind for point in family.special_points if point.kind != "end"] == [
        "period_doubling"
    ]
    assert family.special("BPC") == ()


@pytest.mark.slow
@pytest.mark.parametrize("times", [2, 3, 6])
def test_a_guess_of_several_turns_leads_to_one(times):
    once = pk.periodic_orbit(VAN_DER_POL, [2.0, 0.0])
    period = float(once.period)
    x = np.array([float(once[name][0]) for name in ("x", "y")])
    again = pk.periodic_orbit(VAN_DER_POL, x, period=times * period)
    assert again.period == pytest.approx(period, rel=1e-9)
    samples = simulated(van_der_pol, x, times * period, 400 * times)
    again = pk.periodic_orbit(VAN_DER_POL, samples, period=times * period)
    assert again.period == pytest.approx(period, rel=1e-9)
    assert np.ptp(again.x.values) == pytest.approx(np.ptp(once.x.values), rel=1e-4)


@pytest.mark.slow
def test_rotations_and_forced_orbits():
    pendulum = pk.Problem(
        ["v", "I - al*v - sin(phi)"], ("phi", "v"), {"I": 1.2, "al": 0.5},
        periods={"phi": 2 * np.pi},
    )  # fmt: skip
    once = pk.periodic_orbit(pendulum, [0.0, 2.0])
    x = [float(once.phi[0]), float(once.v[0])]
    for times in (2, 3):
        again = pk.periodic_orbit(pendulum, x, period=times * float(once.period))
        assert again.period == pytest.approx(float(once.period), rel=1e-9)
        assert abs(int(again.winding.max())) == 1
    duffing = pk.Problem(
        ["v", "F*cos(w*t) - d*v - x - x**3"], ("x", "v"), {"d": 0.3, "F": 0.2, "w": 1.3},
        time="t", period="2*pi/w",
    )  # fmt: skip
    swing = pk.periodic_orbit(duffing, [0.0, 0.0], settle=100.0)
    x = [float(swing.x[0]), float(swing.v[0])]
    for times in (2, 3):
        again = pk.periodic_orbit(duffing, x, period=times * 2 * np.pi / 1.3)
        assert again.period == pytest.approx(2 * np.pi / 1.3, rel=1e-12)


@pytest.mark.slow
@pytest.mark.parametrize("beyond", [1e-3, 1e-5])
def test_orbits_beside_a_doubling_keep_their_two_turns(beyond):
    """Their halves differ by the root of the distance, which is more than any error."""
    orbit = pk.periodic_orbit(ROESSLER, [1.0, 1.0, 0.1])
    family = pk.continuation(ROESSLER, "c", orbit=orbit, span=(2.0, 3.5))
    (doubling,) = family.special("PD")
    doubled = doubling.switch(options=pk.ContinuationOptions(max_step=0.05, max_points=12))
    at = doubled.points.c.values - doubling["c"]
    i = int(np.flatnonzero(at > beyond)[0])
    two = doubled.orbit(i)
    problem = ROESSLER.replace(c=float(doubled.points.c[i]))
    again = pk.periodic_orbit(problem, two)
    assert again.period == pytest.approx(float(two.period), rel=1e-9)
    assert again.period == pytest.approx(2 * doubling["period"], rel=0.02)


def test_an_orbit_of_equations_without_parameters():
    """It is that of the same equations with one, and knows nothing of a parameter."""
    without = pk.Problem(["y", "(1 - x**2)*y - x"], ("x", "y"))
    called = pk.Problem(lambda x: [x[1], (1.0 - x[0] ** 2) * x[1] - x[0]], ("x", "y"))
    expected = pk.periodic_orbit(VAN_DER_POL, [2.0, 0.0])
    orbits = [pk.periodic_orbit(problem, [2.0, 0.0]) for problem in (without, called)]
    for orbit in orbits:
        assert abs(float(orbit.period - expected.period)) < 1e-11
        assert set(orbit.coords) == {"time", "multiplier"}
    assert pk.Problem.from_dataset(orbits[0]) == without
    response = pk.phase_response(orbits[0])
    assert set(response.coords) == {"time", "state"}
    wanted = pk.phase_response(expected).interp(time=response.time)
    assert abs(response.phase_response - wanted.phase_response).max() < 1e-5
    driven = pk.Problem(["y", "-0.2*y - x - x**3 + cos(1.2*t)"], ("x", "y"), time="t",
                        period="2*pi/1.2")  # fmt: skip
    orbit = pk.periodic_orbit(driven, [0.1, 0.0])
    ends = pk.flow(driven, x0=[float(orbit.x[0]), float(orbit.y[0])], t=[0.0, float(orbit.period)])
    assert abs(float(ends.motion_x[-1] - orbit.x[0])) < 1e-8


@pytest.mark.slow
@pytest.mark.parametrize(
    ("force", "least"),
    [
        ("cos(2*t)", 0.5), ("x*sin(6*t) + cos(9*t - x)", 1 / 3), ("cos(t)**2", 0.5),
        ("cos(t)*sin(3*t)", 0.5), ("tan(t/2)*sin(t)", 1.0), ("cos(t) + cos(5*t)", 1.0),
        ("sin(t)**3", 1.0), ("exp(cos(4*t))", 0.25), ("abs(cos(3*t))", 1 / 6), ("cos(3*t)*t", 1.0),
    ],
)  # fmt: skip
@pytest.mark.parametrize("period", ["2*pi/w", 2.0 * np.pi])
def test_the_period_of_a_forcing_is_the_least_one(force, least, period):
    given = re.sub(r"\bt\b", "(w*t)", force) if period == "2*pi/w" else force
    problem = pk.Problem(
        ["y", f"-x - y/10 + {given}"], ("x", "y"), {"w": 1.0}, time="t", period=period
    )
    assert problem.forcing_period == pytest.approx(2.0 * np.pi * least, rel=1e-14)
    if force.endswith("t"):
        return
    at = np.linspace(0.1, 6.0, 40)
    values = [[problem([0.3, 0.2], t=t + part)[1] for t in at]
              for part in (0.0, problem.forcing_period)]  # fmt: skip
    assert np.allclose(*values, rtol=1e-9, atol=1e-12)
    for k in (2, 3, 5):  # and it does not repeat itself before
        sooner = [problem([0.3, 0.2], t=t + problem.forcing_period / k)[1] for t in at]
        assert not np.allclose(values[0], sooner, rtol=1e-3)


def test_forced_orbits_have_the_least_period():
    """The response to a sine is known: a sine of its frequency."""
    problem = pk.Problem(
        ["y", "-x - y/10 + cos(3*w*t)"], ("x", "y"), {"w": 1.0}, time="t", period="2*pi/w"
    )
    orbit = pk.periodic_orbit(problem, [0.0, 0.0], period=2.0 * np.pi)
    assert orbit.period == pytest.approx(2.0 * np.pi / 3.0, rel=1e-14)
    response = 1.0 / (1.0 - 9.0 + 0.3j)
    assert orbit.x_max == pytest.approx(abs(response), rel=1e-6)
    roots = np.exp(np.roots([1.0, 0.1, 1.0]) * 2.0 * np.pi / 3.0)
    found = orbit.multiplier.values
    assert np.sort_complex(found) == pytest.approx(np.sort_complex(roots), rel=1e-6)
    branch = pk.continuation(problem, "w", orbit=orbit, span=(0.8, 1.2))
    product = (branch.points.period * branch.points.w).values
    assert product == pytest.approx(2.0 * np.pi / 3.0, rel=1e-12)


def test_a_function_that_repeats_itself_sooner_is_announced():
    def f(x, t, a):
        return [-x[0] + np.cos(2.0 * t)]

    problem = pk.Problem(f, ("x",), {"a": 1.0}, time="t", period="2*pi")
    with pytest.warns(UserWarning, match="after 1/2 of 6.28319"):
        pk.periodic_orbit(problem, [0.0])


@pytest.mark.parametrize("period", ["2*pi", 4.0 * np.pi / 3.0, 12.5663])
def test_a_period_that_is_none_is_refused(period):
    problem = pk.Problem(["-x + cos(t/2)"], ("x",), {"a": 1.0}, time="t", period=period)
    with pytest.raises(pk.ParameterError, match="wants a period of f in time"):
        pk.periodic_orbit(problem, [0.0])


@pytest.mark.parametrize("size", [1.0, 1e-4, 1e-7])
def test_a_small_forcing_is_as_good_as_a_large_one(size):
    """Beside rates of order 1: what counts is what time does."""

    def system(period, rate=1.0):
        return pk.Problem(
            lambda x, F, t: [1.0 - x[0] ** 2 + F * np.cos(rate * t)], ("x",), {"F": size}, time="t",
            period=period, window={"x": (-2, 2)},
        )  # fmt: skip

    for period in (6.283185, 2.0 * np.pi, 4.0 * np.pi):  # in seven digits, in all, and twice that
        assert pk.stroboscopic(system(period), [1.0], n=2).section_x.size == 2
    for period, rate in ((6.2831, 1.0), (3.0, 1.0), (2.0 * np.pi, 1.01), (2.0 * np.pi, 1e-3)):
        with pytest.raises(pk.ParameterError, match="wants a period of f in time"):
            pk.stroboscopic(system(period, rate), [1.0], n=2)


ANOTHER = {
    "of another frequency": (["v", "-v/4 + x - x**3 + F*cos(w*t)"], "3.0"),
    "of one of two waves": (["v", "-v/4 + x - x**3 + F*(cos(w*t) + cos(1.5*w*t))"], "2*pi/w"),
    "by a function": (lambda x, F, w, t: [x[1], x[0] - x[0] ** 3 + F * np.cos(w * t)], "3.0"),
    "in small units": (["v", "-v/4 + x + 1e-9*F*cos(w*t)"], "3.0"),
}
ASKED = {
    "attractors": lambda s, grid: pk.attractors(s, grid),
    "basins": lambda s, grid: pk.basins(s, grid),
    "stroboscopic": lambda s, grid: pk.stroboscopic(s, [1e-9, 0.0], n=3),
    "sweep": lambda s, grid: pk.sweep(s, F=[0.1, 0.2], of="period"),
}


@pytest.mark.parametrize("name", ANOTHER)
@pytest.mark.parametrize("call", ASKED)
def test_a_period_that_is_none_is_refused_by_what_rests_on_it(name, call):
    f, period = ANOTHER[name]
    size = 1e-9 if "units" in name else 1.0
    window = dict.fromkeys("xv", (-2.0 * size, 2.0 * size))
    system = pk.Problem(
        f, ("x", "v"), {"F": 0.1, "w": 1.0}, time="t", period=period, window=window
    )  # fmt: skip
    grid = dict.fromkeys("xv", np.linspace(-size, size, 2))
    with pytest.raises(pk.ParameterError, match=r"period: got .* wants a period of f in time"):
        ASKED[call](system, grid)


def test_a_period_of_one_cell_that_is_none_of_another_is_refused():
    system = pk.Problem(
        ["v", "-v/4 - x + F*cos(w*t)"], ("x", "v"), {"F": 0.1, "w": 1.0}, time="t", period="2*pi",
        window={"x": (-2, 2), "v": (-2, 2)},
    )  # fmt: skip
    assert pk.sweep(system, w=[1.0, 2.0, 3.0], of="period").period.shape == (3,)
    with pytest.raises(pk.ParameterError, match="wants a period of f in time"):
        pk.sweep(system, w=[1.0, 1.3], of="period")


def test_an_orbit_without_forcing_repeats_itself_without_a_word(recwarn):
    """Of what is at rest each part is like the others."""
    system = pk.Problem(
        ["v", "-v/4 - x + F*cos(w*t)"], ("x", "v"), {"F": 0.0, "w": 1.0}, time="t", period="2*pi/w"
    )
    assert pk.periodic_orbit(system, [0.0, 0.0]).period == pytest.approx(2.0 * np.pi)
    assert not recwarn.list
