"""Motions that creep behind states which decay much faster, and rests that attract slowly."""

import warnings

import numpy as np
import pytest

import phasekit as pk
from phasekit.motion.newton import Neighbourhood

KIND = pk.AttractorKind
DRIVE = {"time": "t", "period": 2.0 * np.pi}


def pendulum(u):
    return np.array([u[1], -1e4 * u[1] - np.sin(u[0])])


def basins_of(problem, grid, **how):
    with warnings.catch_warnings():
        warnings.filterwarnings("ignore", "basin: .* too coarse", RuntimeWarning)
        return pk.basins(problem, grid, **how)


@pytest.mark.parametrize("damping", [3e2, 1e4, 1e6])
def test_a_creeping_transient_is_no_attractor(damping):
    """Of x'' = x - x^3 - d x' a start comes to the side where it is once its speed is spent."""
    problem = pk.Problem(["v", "-d*v + x - x^3"], ("x", "v"), {"d": damping})
    x, v = np.linspace(-1.4, 1.4, 4), damping * np.array([-0.3, 0.0, 0.3])
    ds = basins_of(problem, {"x": x, "v": v})
    assert ds.attractor_kind.values.tolist() == [KIND.EQUILIBRIUM] * 2
    np.testing.assert_allclose(ds.attractor_x.values[:, 0], [-1.0, 1.0], atol=1e-9)
    rate = 4.0 / (damping + np.sqrt(damping**2 - 8.0))  # of l^2 + d l + 2 = 0
    rounding = 10.0 * np.finfo(float).eps * damping
    np.testing.assert_allclose(ds.attractor_exponent.values, -rate, atol=rounding)
    side = (x[:, None] + v / damping > 0.0).astype(int)
    assert ds.basin.values.tolist() == side.tolist()


@pytest.mark.parametrize("f", [["v", "-1e4*v - sin(x)"], pendulum], ids=["formulas", "python"])
def test_starts_of_one_speed_are_measured_by_how_they_creep(f):
    """The speed's unit is that of motions: they end at 0, far beyond the starts' rounding."""
    problem = pk.Problem(f, ("x", "v"))
    ds = basins_of(problem, {"x": [-1.0, 2.0], "v": [0.5]}, rtol=1e-6)
    assert ds.attractor_kind.values.tolist() == [KIND.EQUILIBRIUM]
    np.testing.assert_allclose(ds.attractor_x.values, 0.0, atol=1e-9)
    assert (ds.basin == 0).all()


def test_states_with_nothing_left_of_what_is_fast_come_nearer():
    """Of x' = -10^4 (x - cos t) and y' = -r y no displacement of x lasts a period."""
    rate = 1e-3
    problem = pk.Problem(["-1e4*(x - cos(t))", "-r*y"], ("x", "y"), {"r": rate}, **DRIVE)
    ds = basins_of(problem, {"x": [-1.3, 1.2], "y": [-1.0, 0.3]})
    x = 1e8 / (1e8 + 1.0)  # the part of cos t
    np.testing.assert_allclose(ds.attractor_x.values, [[x]], rtol=1e-8)
    assert ds.attractor_exponent.values.tolist() == pytest.approx([-rate], rel=1e-6)
    assert (ds.basin == 0).all()


def test_an_orbit_of_two_periods_behind_a_fast_state():
    """On r = 1 the angle has 2 a' = 1 - 2 k sin(2 a - t), so that a = t/2 in the end."""
    turn = "(1/2 - k*(2*x*y*cos(t) - (x^2 - y^2)*sin(t)))"
    f = [f"x*(1 - x^2 - y^2) - y*{turn}", f"y*(1 - x^2 - y^2) + x*{turn}", "-1e4*(z - x)"]
    problem = pk.Problem(f, ("x", "y", "z"), {"k": 0.05}, **DRIVE)
    ds = pk.attractors(problem, {"x": [-0.6, 0.7], "y": [0.4]}, fixed={"z": 0.0})
    assert ds.attractor_period.values.tolist() == [2]
    np.testing.assert_allclose(ds.attractor_x.values, [[-1.0, 1.0]], atol=1e-7)
    assert ds.attractor_exponent.values.tolist() == pytest.approx([-0.1], rel=1e-5)


def test_motions_that_go_on_are_not_said_to_creep():
    """Of two frequencies that share no period, behind a fast state."""
    f = ["-sqrt(2)*y + x*(1 - x^2 - y^2)", "sqrt(2)*x + y*(1 - x^2 - y^2)", "-1e4*(z - cos(t))"]
    problem = pk.Problem(f, ("x", "y", "z"), **DRIVE)
    with pytest.warns(RuntimeWarning, match="2 of the motions .* go on after 200 periods"):
        ds = pk.attractors(problem, {"x": [-0.6, 0.7], "y": [0.4]}, fixed={"z": 0.0})
    assert ds.sizes["attractor"] == 0


def test_states_that_follow_others_do_not_make_attractors():
    problem = pk.Problem(["x - x^3", "-5000*(y - x)", "-2000*(z - y)"], ("x", "y", "z"))
    ds = basins_of(problem, {"x": [-1.2, -0.4, 0.7], "y": [-1.0, 1.0]}, fixed={"z": 0.3})
    assert ds.attractor_kind.values.tolist() == [KIND.EQUILIBRIUM] * 2
    assert ds.basin.values.tolist() == [[0, 0], [0, 0], [1, 1]]


@pytest.mark.parametrize("damping", [0.3, 2.0])
def test_a_degenerate_rest_attracts_across_its_slow_direction(damping):
    problem = pk.Problem(["v", "-d*v - x^3"], ("x", "v"), {"d": damping})
    ds = basins_of(problem, {"x": np.linspace(-1.0, 1.0, 4), "v": np.linspace(-1.0, 1.0, 3)})
    assert ds.attractor_kind.values.tolist() == [KIND.EQUILIBRIUM]
    assert (ds.basin == 0).all()


@pytest.mark.parametrize("f", [["v", "-x^3"], ["x^2", "-v"], ["v", "x^2 - v"]])
def test_a_degenerate_rest_that_does_not_attract_is_none(f):
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", RuntimeWarning)
        ds = pk.attractors(pk.Problem(f, ("x", "v")), {"x": [-0.4, 0.3], "v": [-0.2, 0.3]})
    assert KIND.EQUILIBRIUM not in ds.attractor_kind.values


def test_a_relaxation_oscillation_has_the_period_of_another_integrator():
    """The period of Lienard's form tends to 3 - 2 log 2, with a correction of order mu^(-4/3)."""
    from scipy.integrate import solve_ivp

    mu = 1e3
    problem = pk.Problem(["m*(y - x^3/3 + x)", "-x"], ("x", "y"), {"m": mu})
    ds = pk.attractors(problem, {"x": [-2.0, 2.0], "y": [-0.5, 1.0]})
    assert ds.attractor_kind.values.tolist() == [KIND.CYCLE]

    def up(t, u):
        return u[0]

    up.direction = 1.0
    how = {"method": "Radau", "rtol": 1e-10, "atol": 1e-12, "events": up}
    rates = lambda t, u: [mu * (u[1] - u[0] ** 3 / 3.0 + u[0]), -u[0]]  # noqa: E731
    times = solve_ivp(rates, (0.0, 6.0), [2.0, 0.0], **how).t_events[0]
    assert ds.attractor_period.values[0] == pytest.approx(times[-1] - times[-2], rel=1e-6)


@pytest.mark.parametrize(("power", "damping"), [(3, 50.0), (5, 0.5), (5, 50.0), (7, 2.0)])
def test_a_rest_is_degenerate_in_any_order(power, damping):
    """Of x'' = -x^k - d x' all comes to 0, however slowly, wherever 0 is moved to."""
    problem = pk.Problem(["v", f"-d*v - (x - m)^{power}"], ("x", "v"), {"d": damping, "m": 0.3})
    x, v = 0.3 + np.linspace(-1.0, 1.0, 4), np.linspace(-1.0, 1.0, 3)
    ds = basins_of(problem, {"x": x, "v": v})
    assert ds.attractor_kind.values.tolist() == [KIND.EQUILIBRIUM]
    assert ds.attractor_x.values[0, 0] == pytest.approx(0.3, abs=1e-5)
    assert ds.attractor_exponent.values.tolist() == [0.0]
    assert (ds.basin == 0).all()


def test_a_slow_curve_that_bends_tells_what_a_rest_does():
    """On y = x^2 + ..., x' = (a - 1) x^3 + ...: linear terms say nothing, nor does x' alone."""
    found = []
    for a in (0.5, 1.5):
        problem = pk.Problem(["a*x^3 - x*y", "-y + x^2"], ("x", "y"), {"a": a})
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", RuntimeWarning)
            ds = pk.attractors(problem, {"x": [-0.3, 0.2], "y": [-0.1, 0.1]})
        found.append(int(ds.sizes["attractor"]))
    assert found == [1, 0]


def test_a_cycle_is_not_solved_for_from_every_start_next_to_its_hopf_point(monkeypatch):
    solved = []
    own = Neighbourhood.cycle

    def counted(*given, **how):
        solved.append(1)
        return own(*given, **how)

    monkeypatch.setattr(Neighbourhood, "cycle", counted)
    mu = 1e-3
    f = ["mu*x - y - x*(x^2 + y^2)", "x + mu*y - y*(x^2 + y^2)"]
    problem = pk.Problem(f, ("x", "y"), {"mu": mu})
    ds = pk.attractors(problem, {"x": np.linspace(-0.5, 0.5, 8), "y": np.linspace(-0.5, 0.5, 8)})
    assert ds.attractor_period.values == pytest.approx([2.0 * np.pi], rel=1e-9)
    assert ds.attractor_multiplier.values == pytest.approx([np.exp(-4.0 * np.pi * mu)], rel=1e-7)
    assert len(solved) < 30  # of 64 motions


def test_cycles_close_beside_each_other_are_all_found():
    """Of 30 starts two lie inside both cycles, and come to the inner one."""
    radial = "60*(r - 1)*(r - 1.0005)*(r - 1.001)"
    problem = pk.Problem(
        [f"-x*({radial}) - y", f"x - y*({radial})"],
        ("x", "y"),
        definitions={"r": "sqrt(x^2 + y^2)"},
    )
    ds = pk.attractors(problem, {"x": np.linspace(-2.0, 2.1, 6), "y": np.linspace(-2.0, 2.0, 5)})
    radii = np.hypot(ds.attractor_x, ds.attractor_y)[:, 0]
    assert sorted(radii.values) == pytest.approx([1.0, 1.001], rel=1e-8)


def test_a_place_without_derivatives_is_no_rest():
    """Of sqrt(x^2 + y^2) there are none at 0."""
    f = ["-x*(r - 1) - y", "x - y*(r - 1)"]
    problem = pk.Problem(f, ("x", "y"), definitions={"r": "sqrt(x^2 + y^2)"})
    assert Neighbourhood(problem.law, {}, np.ones(2)).rest(np.zeros(2), 1.0) is None
