"""Motions that creep behind states which decay much faster, and rests that attract slowly."""

import warnings

import numpy as np
import pytest

import phasekit as pk

KIND = pk.AttractorKind


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


@pytest.mark.slow  # integrates in Python
def test_a_python_function_creeps_as_formulas_do():
    problem = pk.Problem(lambda u: np.array([u[1], -1e4 * u[1] - np.sin(u[0])]), ("x", "v"))
    ds = basins_of(problem, {"x": [-1.0, 2.0], "v": [0.5]})
    assert ds.attractor_kind.values.tolist() == [KIND.EQUILIBRIUM]
    assert (ds.basin == 0).all()


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
