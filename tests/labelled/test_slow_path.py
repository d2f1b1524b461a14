"""Attractors of flows and maps along slow paths, against folds and Hopf points in closed form."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import phasekit as pk
from phasekit.motion.slow_path import Kept, SlowPath

KIND = pk.AttractorKind
APERIODIC = pk.Problem({"x": "-x + a*sin(t)"}, parameters={"a": 0.1}, time="t")


def test_a_loop_of_hysteresis_and_its_folds():
    """X' = mu + x - x^3: folds at |mu| = 2/(3 sqrt 3), from x = -+1/sqrt 3 to +-2/sqrt 3."""
    cubic = pk.Problem("mu + x - x^3", "x", {"mu": 0.0}, window={"x": (-2, 2)})
    mu = np.concatenate([np.linspace(-0.6, 0.6, 13), np.linspace(0.6, -0.6, 13)])
    ds = pk.quasi_static(cubic, mu=mu, x0=-1.0)
    np.testing.assert_allclose(ds.jump_mu, [2 / 27**0.5, -2 / 27**0.5], rtol=1e-10)
    np.testing.assert_allclose(ds.jump_from_x, [-(3**-0.5), 3**-0.5], atol=1e-5)
    np.testing.assert_allclose(ds.jump_to_x, [2 * 3**-0.5, -2 * 3**-0.5], atol=1e-4)
    assert ds.jump_kind.values.tolist() == ["fold", "fold"]
    assert not ds.jump_soft.any()
    assert np.flatnonzero(ds.jumped).tolist() == ds.jump_step.values.tolist()
    x = ds.x_max.values
    np.testing.assert_array_equal(ds.x_min, x)
    np.testing.assert_allclose(mu + x - x**3, 0.0, atol=1e-12)
    np.testing.assert_allclose(ds.recovery_rate, 3.0 * x**2 - 1.0, rtol=1e-9)
    # The places do not depend on the steps.
    few = pk.quasi_static(cubic, mu=[-0.6, 0.6, -0.6], x0=-1.0)
    np.testing.assert_allclose(few.jump_mu, ds.jump_mu, rtol=1e-10)
    assert ds.isel(step=3).phasekit.system() == cubic.replace(mu=mu[3])


RADIAL = {"x": "x*g - y", "y": "x + y*g"}


@pytest.mark.parametrize(("g", "soft"), [("mu - r2", True), ("mu + r2 - r2^2", False)])
def test_hopf_points_soft_and_hard(g, soft):
    """R' = r g(r^2): soft for mu - r^2; for mu + r^2 - r^4 hard, with a fold of cycles at -1/4."""
    system = pk.Problem(
        RADIAL, parameters={"mu": -0.4}, definitions={"r2": "x^2 + y^2", "g": g},
        window={"x": (-2, 2), "y": (-2, 2)},
    )  # fmt: skip
    mu = np.array([-0.4, -0.1, 0.1, 0.2, 0.1, -0.1, -0.4])
    ds = pk.quasi_static(system, {"mu": mu}, x0=[0.01, 0.0])
    assert ds.jump_kind.values[0] == "hopf"
    assert abs(ds.jump_mu[0].item()) < 1e-9
    assert ds.jump_soft.values[0] == soft
    up = mu[2:5]
    radius = np.sqrt(up) if soft else np.sqrt(0.5 + np.sqrt(0.25 + up))
    np.testing.assert_allclose(ds.x_max[2:5], radius, rtol=1e-7)
    np.testing.assert_allclose(ds.x_min[2:5], -radius, rtol=1e-7)
    np.testing.assert_allclose(ds.attractor_period[2:5], 2.0 * np.pi, rtol=1e-9)
    want = 2.0 * radius**2 if soft else radius**2 * (4.0 * radius**2 - 2.0)
    np.testing.assert_allclose(ds.recovery_rate[2:5], want, rtol=1e-4)
    assert ds.x_max[6].item() == pytest.approx(0.0, abs=1e-9)
    if not soft:
        assert ds.x_max[5].item() == pytest.approx(np.sqrt(0.5 + np.sqrt(0.15)), rel=1e-7)
        assert ds.jump_kind.values[1] == "fold"
        assert ds.jump_mu[1].item() == pytest.approx(-0.25, abs=1e-8)


def test_the_doublings_of_the_logistic_map():
    """3, 1 + sqrt 6, 3.5440903596."""
    logistic = pk.Problem("r*x*(1 - x)", "x", {"r": 2.5}, map=True, window={"x": (0, 1)})
    ds = pk.quasi_static(logistic, r=[2.5, 3.2, 3.5, 3.55], x0=0.3)
    assert ds.attractor_period.values.tolist() == [1, 2, 4, 8]
    np.testing.assert_allclose(ds.jump_r, [3.0, 1.0 + 6.0**0.5, 3.5440903596], rtol=1e-10)
    assert set(ds.jump_kind.values) == {"period_doubling"}
    assert ds.jump_soft.all()
    assert ds.x_max[0].item() == pytest.approx(0.6, rel=1e-12)
    x = [0.3]
    for _ in range(20_000):
        x.append(3.55 * x[-1] * (1.0 - x[-1]))
    assert ds.x_max[3].item() == pytest.approx(max(x[-8:]), rel=1e-9)
    assert ds.x_min[3].item() == pytest.approx(min(x[-8:]), rel=1e-9)


@pytest.mark.slow
def test_extremes_of_a_fast_relaxation_are_those_of_scipy():
    relaxing = {"x": "y", "y": "m*(1 - x^2)*y - x"}
    problem = pk.Problem(relaxing, parameters={"m": 6.0}, window={"x": (-3, 3), "y": (-30, 30)})
    ds = pk.quasi_static(problem, m=[6.0, 8.0], x0=[2.0, 0.0])

    def f(t, s):
        return [s[1], 8.0 * (1.0 - s[0] ** 2) * s[1] - s[0]]

    found = solve_ivp(f, (0.0, 45.0), [2.0, 0.0], "LSODA", rtol=1e-10, atol=1e-10,
                      t_eval=np.linspace(25.0, 45.0, 100_000))  # fmt: skip
    assert ds.x_max[1].item() == pytest.approx(found.y[0].max(), rel=1e-6)
    assert ds.y_max[1].item() == pytest.approx(found.y[1].max(), rel=1e-4)


def test_where_nothing_is_left_it_is_said():
    runs = pk.Problem("mu + x^2", "x", {"mu": -1.0}, window={"x": (-2, 2)})
    with pytest.warns(RuntimeWarning, match="lost before step 2, .* runs to infinity"):
        ds = pk.quasi_static(runs, mu=[-1.0, -0.25, 0.25, 0.5], x0=-1.0)
    np.testing.assert_allclose(ds.x_max, [-1.0, -0.5, np.nan, np.nan])
    assert ds.jump_mu.item() == pytest.approx(0.0, abs=1e-10)
    assert np.isnan(ds.jump_to_x.item())


@pytest.mark.slow
def test_a_force_of_ones_own_pushes_a_pendulum_over():
    """It rests where sin(phi) is the force, and turns beyond."""
    push = pk.Term("push", {"push": 0.0})
    pendulum = pk.Perturbed(pk.Pendulum(length=1.0, g=1.0), damping=0.5, terms=push)
    ds = pk.quasi_static(pendulum, push=[0.0, 0.9, 1.1], x0=[0.1, 0.0])
    np.testing.assert_allclose(ds.phi_max[:2], np.arcsin([0.0, 0.9]), atol=1e-9)
    assert ds.jump_push.item() == pytest.approx(1.0, abs=1e-10)
    assert ds.jump_kind.item() == "fold"
    assert ds.attractor_kind.values.tolist() == [KIND.EQUILIBRIUM] * 2 + [KIND.ROTATION]


@pytest.mark.slow
def test_a_forced_oscillator_jumps_where_its_response_folds():
    """The folds of the periodic response, by continuation."""
    duffing = pk.Problem(
        {"x": "v", "v": "-x - x^3 - d*v + F*cos(w*t)"}, parameters={"d": 0.05, "F": 0.1, "w": 0.8},
        time="t", period="2*pi/w", window={"x": (-2.2, 2.2), "v": (-2.2, 2.2)},
    )  # fmt: skip
    w = np.concatenate([np.linspace(0.9, 1.8, 10), np.linspace(1.8, 0.9, 10)])
    ds = pk.quasi_static(duffing, w=w, x0=[0.0, 0.0])
    assert ds.jump_kind.values.tolist() == ["fold", "fold"]
    start = pk.periodic_orbit(duffing.replace(w=0.9), [0.3, 0.0])
    branch = pk.continuation(duffing.replace(w=0.9), "w", orbit=start, span=(0.85, 1.9))
    folds = sorted(point["w"] for point in branch.special("LPC"))
    np.testing.assert_allclose(np.sort(ds.jump_w), folds, rtol=1e-7)


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda p: pk.quasi_static(p, q=[0.0, 1.0]), "path: parameter 'q' is unknown"),
        (lambda p: pk.quasi_static(p, mu=0.5), "path: got .'mu': 0.5., wants a 1-D array"),
        (lambda p: pk.quasi_static(p, mu=[0.0, np.nan]), "mu: got"),
        (lambda p: pk.quasi_static(p, mu=[0.0, 1.0], phi0=1.0), "phi0: got 1.0"),
        (lambda p: pk.quasi_static(p, mu=[0.0, 1.0]), "x0: got None"),
        (lambda p: pk.quasi_static(APERIODIC, a=[0.1, 0.2], x0=0.0), "wants an f with a period"),
        (lambda p: pk.quasi_static(p, mu=[-1.0, 0.0], x0=2.0), "x0: .* runs to infinity"),
        (lambda p: pk.quasi_static(pk.Pendulum(length=1.0), g=[1.0, 2.0], x0=1.0), "x0: got"),
    ],
)
def test_what_is_wrong_is_said(call, message):
    problem = pk.Problem("mu + x^2", "x", {"mu": -1.0})
    with pytest.raises(pk.ParameterError, match=message):
        call(problem)


@pytest.mark.parametrize("rest", [4e-4, 1e-6])
def test_what_does_not_repeat_itself_goes_on_over_the_rest_of_a_step(rest):
    """As after a loss close to the next place: it was given up untried there."""
    chaos = Kept(KIND.CHAOTIC, np.zeros((3, 2)), 0.0, np.zeros(0, complex))
    path = SimpleNamespace(carried=lambda kept, place: kept)
    assert SlowPath.advance(path, chaos, 1.0 - rest, 1.0) == (1.0, chaos)
    lost = SimpleNamespace(carried=lambda kept, place: None)
    assert SlowPath.advance(lost, chaos, 1.0 - rest, 1.0) == (1.0 - rest, chaos)
