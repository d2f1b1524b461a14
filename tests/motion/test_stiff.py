"""Stiff motions: exact solutions, published values, SciPy's own, and which method is taken."""

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import phasekit as pk

PROTHERO = pk.Problem(
    "-L*(x - cos(t)) - sin(t)", "x", {"L": 1e4}, time="t", period="2*pi", start={"x": 1.0}
)
RELAXATION = pk.Problem(
    ["y", "mu*(1 - x^2)*y - x"], ("x", "y"), {"mu": 1000.0}, start={"x": 2.0, "y": 0.0}
)


def test_a_fast_decay_to_a_known_motion():
    """[HairerWanner1996] IV.15: x' = -L (x - cos t) - sin t has x = cos t + (x0 - 1) exp(-L t)."""
    t = np.linspace(0.0, 50.0, 101)
    x = PROTHERO.replace(L=[1e2, 1e4, 1e8])
    ds = pk.flow(x, t=t, method="rosenbrock")
    assert ds.attrs["method"] == "rosenbrock"
    np.testing.assert_allclose(ds.motion_x, np.tile(np.cos(t), (3, 1)), atol=2e-9)
    twice = pk.flow(PROTHERO.replace(L=1e8), t=[1.0, 1.0, 2.0], method="rosenbrock")
    np.testing.assert_array_equal(twice.motion_x[0], twice.motion_x[1])
    off = pk.flow(PROTHERO, x=3.0, t=np.array([-1e-4, 0.0, 1e-4, 3e-4]), method="rosenbrock")
    exact = np.cos(off.time) + 2.0 * np.exp(-1e4 * off.time)
    np.testing.assert_allclose(off.motion_x, exact, rtol=1e-8)


def test_errors_fall_with_the_tolerance_and_between_steps_too():
    """Of a pendulum, beside its exact motion; most times lie within steps."""
    t = np.linspace(0.0, 10.0, 400)
    truth = pk.flow(pk.Coefficients(0.0, 1.0, 0.0), 2.0, 0.0, t)
    swing = pk.Problem({"x": "v", "v": "-sin(x)"}, start={"x": 2.0, "v": 0.0})
    errors = []
    for rtol in (1e-5, 1e-8, 1e-11):
        ds = pk.flow(swing, t=t, rtol=rtol, atol=rtol, method="rosenbrock")
        errors.append(float(np.abs(ds.motion_x - truth.motion_phi.values).max()))
    assert errors[0] < 1e-3
    assert errors[1] < 1e-6
    assert errors[2] < 2e-9


def test_many_stiff_motions_are_recognised():
    mu = np.array([1.0, 200.0, 1000.0])
    t = np.linspace(0.0, 1500.0, 7)
    ds = pk.flow(RELAXATION.replace(mu=mu), t=t)
    assert ds.attrs["method"] == "taylor, rosenbrock"
    alone = pk.flow(RELAXATION.replace(mu=200.0), t=t)
    assert alone.attrs["method"] == "rosenbrock"
    np.testing.assert_array_equal(alone.motion_x, ds.motion_x[1])  # whatever is beside it


@pytest.mark.slow
def test_relaxation_beside_scipy():
    t = np.linspace(0.0, 1500.0, 7)
    for mu, atol in ((200.0, 2e-3), (1000.0, 2e-5)):
        scipy = solve_ivp(
            lambda t, x, m=mu: [x[1], m * (1 - x[0] ** 2) * x[1] - x[0]], (0, 1500), [2, 0],
            method="Radau", t_eval=t, rtol=1e-8, atol=1e-10,
            jac=lambda t, x, m=mu: [[0, 1], [-2 * m * x[0] * x[1] - 1, m * (1 - x[0] ** 2)]],
        )  # fmt: skip
        ds = pk.flow(RELAXATION.replace(mu=mu), t=t)
        np.testing.assert_allclose(ds.motion_x, scipy.y[0], atol=atol)


def test_long_motions_that_are_not_stiff_stay_explicit():
    oscillator = pk.Problem({"x": "v", "v": "-x"}, start={"x": 1.0, "v": 0.0})
    ds = pk.flow(oscillator, t=[0.0, 20_000.0])
    assert ds.attrs["method"] == "taylor"
    assert ds.motion_x[1].item() == pytest.approx(np.cos(20_000.0), abs=1e-5)


def test_what_cannot_be_taken_is_said():
    code = pk.Problem(lambda x: [-x[0]], "x")
    with pytest.raises(pk.ParameterError, match="f is no formula"):
        pk.flow(code, 1.0, [1.0], method="rosenbrock")
    assert pk.flow(code, 1.0, [1.0]).attrs["method"] == "dop853"
    lost = pk.Problem("x^2", "x")
    with pytest.warns(RuntimeWarning, match="their steps become too short"):
        ds = pk.flow(lost, 1.0, [0.5, 2.0], method="rosenbrock")
    np.testing.assert_allclose(ds.motion_x, [2.0, np.nan], rtol=1e-8)
