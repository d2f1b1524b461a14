"""Chains of masses by their matrices, against SciPy, elliptic integrals and eigenvectors."""

from __future__ import annotations

import pickle

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.linalg import eigh
from scipy.sparse import csr_array
from scipy.special import ellipk

import phasekit as pk

MASSES = np.array([[2.0, 1.0, 0.0], [1.0, 3.0, 0.5], [0.0, 0.5, 1.0]])
STIFF = np.array([[3.0, -1.0, 0.0], [-1.0, 2.0, -1.0], [0.0, -1.0, 4.0]])
VALUES = {"k": 0.7, "F": 0.3, "w": 1.2}
STATE = np.array([0.3, -0.4, 0.5, 0.6, 0.2, -0.1])


def cubic(x, k, F, w):
    return k * x**3


def cubic_slopes(x, k, F, w):
    return csr_array(np.diag(3.0 * k * x**2))


def pushed(t, k, F, w):
    return np.array([0.0, F * np.cos(w * t), 0.0])


FORMULAS = [f"k*x{i}**3" for i in (1, 2, 3)], {"x2": "F*cos(w*t)"}


def rates(t, x):
    q, v = x[:3], x[3:]
    load = pushed(t, **VALUES) - 0.1 * STIFF @ v - STIFF @ q - cubic(q, **VALUES)
    return np.concatenate([v, np.linalg.solve(MASSES, load)])


@pytest.mark.slow
@pytest.mark.parametrize(
    "given",
    [
        ((MASSES, 0.1 * STIFF, STIFF, *FORMULAS), {}),
        ((MASSES, 0.1 * STIFF, csr_array(STIFF), cubic, pushed), {"period": "2*pi/w"}),
        (
            (csr_array(MASSES), 0.1 * STIFF, STIFF, cubic, FORMULAS[1]),
            {"jac": cubic_slopes},
        ),
        ((MASSES, 0.1 * STIFF, STIFF, FORMULAS[0], pushed), {"period": "2*pi/w"}),
    ],
    ids=["formulas", "functions", "with derivatives", "formulas beside a function"],
)
def test_equations_of_motion(given):
    """Rates, slopes and motions are those of M solved, however the forces are given."""
    arguments, more = given
    chain = pk.Problem.mechanical(*arguments, parameters=VALUES, **more)
    assert chain.state == ("x1", "x2", "x3", "dx1", "dx2", "dx3")
    assert abs(chain.forcing_period - 2 * np.pi / 1.2) < 1e-14
    for t in (0.0, 0.8):
        value, slopes = chain.derivatives(STATE, t)
        np.testing.assert_allclose(value, rates(t, STATE), atol=1e-15)
        stiff = STIFF + np.diag(3 * 0.7 * STATE[:3] ** 2)
        np.testing.assert_allclose(slopes[:3], np.eye(6)[3:], atol=1e-10)
        both = np.hstack([-np.linalg.solve(MASSES, stiff), -0.1 * np.linalg.solve(MASSES, STIFF)])
        np.testing.assert_allclose(slopes[3:], both, atol=1e-9)
    motion = pk.flow(chain, STATE, [0.0, 3.0])
    wanted = solve_ivp(rates, (0.0, 3.0), STATE, rtol=1e-11, atol=1e-12).y[:, -1]
    got = [float(motion[f"motion_{name}"][-1]) for name in chain.state]
    np.testing.assert_allclose(got, wanted, atol=1e-8)
    copy = pickle.loads(pickle.dumps(chain))
    assert copy == chain
    np.testing.assert_array_equal(copy(STATE, t=0.3), chain(STATE, t=0.3))


def test_many_terms_make_a_function(monkeypatch):
    """What is too long for formulas is the same as a function."""
    written = pk.Problem.mechanical(MASSES, STIFF, STIFF, *FORMULAS, parameters=VALUES)
    monkeypatch.setattr("phasekit.systems.mechanical.MOST", 1)
    called = pk.Problem.mechanical(MASSES, STIFF, STIFF, *FORMULAS, parameters=VALUES)
    assert (written.kind, called.kind) == ("symbolic", "python")
    for mine, other in zip(
        written.derivatives(STATE, 0.3), called.derivatives(STATE, 0.3), strict=True
    ):
        np.testing.assert_allclose(mine, other, atol=1e-14)
    other = pk.Problem.mechanical(MASSES, STIFF, 2 * STIFF, *FORMULAS, parameters=VALUES)
    assert other != called
    assert called == called.replace(k=0.7)


def test_conservation():
    """Energy is conserved without damping and forcing, by symmetric matrices and a potential."""

    def conserved(*given, **more):
        return pk.Problem.mechanical(*given, parameters={"k": 1.0}, **more).conservative

    one, none, K = np.eye(2), np.zeros((2, 2)), [[2, -1], [-1, 2]]
    assert conserved(one, none, K)
    assert conserved(one, none, K, ["k*x1*x2**2", "k*x1**2*x2"])
    assert not conserved(one, none, K, ["k*x1*x2**2", "0"])
    assert not conserved(one, none, K, ["k*dx1**2", "0"])
    assert not conserved(one, none, [[2, -1], [0, 2]])
    assert not conserved([[1, 0.1], [0, 1]], none, K)
    assert not conserved(one, 0.1 * one, K)
    assert conserved(one, none, K, None, ["1", "k"])
    assert not conserved(one, none, K, None, ["1", "sin(t)"])
    assert not conserved(one, none, K, lambda x, k: k * x**3)
    assert conserved(one, none, K, lambda x, k: k * x**3, conservative=True)


def test_in_phase_mode_is_duffing():
    """Two equal oscillators: the in-phase mode x1 = x2 has the period of x'' + x + x^3 = 0."""
    k = 0.3
    oscillators = pk.Problem.mechanical(
        np.eye(2), np.zeros((2, 2)), [[1 + k, -k], [-k, 1 + k]], ["a*x1**3", "a*x2**3"],
        parameters={"a": 1.0},
    )  # fmt: skip
    mode = pk.periodic_orbit(oscillators, [1.0, 1.0, 0.0, 0.0])
    family = pk.continuation(oscillators, "period", orbit=mode, span=(2.5, 6.2))
    a = family.points.x1_max.values
    assert a.min() < 0.2
    assert a.max() > 2.0
    wanted = 4 * ellipk(a**2 / (2 * (1 + a**2))) / np.sqrt(1 + a**2)
    np.testing.assert_allclose(family.points.period.values, wanted, rtol=1e-10)
    np.testing.assert_allclose(family.points.x2_max.values, a, rtol=1e-10)
    # Out of phase x1 = -x2: x'' + (1 + 2 k) x + x^3 = 0.
    other = pk.periodic_orbit(oscillators, [1.0, -1.0, 0.0, 0.0])
    w2 = 1 + 2 * k
    assert abs(float(other.period) - 4 * ellipk(1 / (2 * (w2 + 1))) / np.sqrt(w2 + 1)) < 1e-10


def test_linear_modes():
    """Normal modes of small amplitude, and eigenvalues at rest, are those of K a = w^2 M a."""
    K = np.array([[3.0, -1.0, 0.0], [-1.0, 2.0, -1.0], [0.0, -1.0, 4.0]])
    squares, shapes = eigh(K, MASSES)
    chain = pk.Problem.mechanical(
        MASSES, np.zeros((3, 3)), K, {"x1": "a*x1**3"}, parameters={"a": 1.0}
    )
    values = np.linalg.eigvals(chain.derivatives(np.zeros(6))[1])
    np.testing.assert_allclose(np.sort(values.imag)[3:], np.sqrt(squares), rtol=1e-13)
    assert np.max(np.abs(values.real)) < 1e-13
    phase = np.linspace(0.0, 2.0 * np.pi, 65)
    for square, shape in zip(squares, shapes.T, strict=True):
        w, size = np.sqrt(square), 1e-3 * shape / np.max(np.abs(shape))
        samples = np.hstack([np.outer(np.cos(phase), size), np.outer(-w * np.sin(phase), size)])
        mode = pk.periodic_orbit(chain, samples, period=2 * np.pi / w)
        assert abs(float(mode.period) * w / (2 * np.pi) - 1.0) < 1e-6


@pytest.mark.slow
def test_frequency_response_of_fourteen_masses():
    """Both sides of a resonance of hardening masses, of 28 states: orbits close after a period."""
    n, k, F = 14, 0.5, 0.3
    M, K = np.eye(n), 2 * np.eye(n) - np.eye(n, k=1) - np.eye(n, k=-1)
    C = 0.1 * np.eye(n)
    chain = pk.Problem.mechanical(
        M, C, K, [f"k*x{i + 1}**3" for i in range(n)], {"x1": "F*cos(w*t)"},
        parameters={"k": k, "F": F, "w": 0.4},
    )  # fmt: skip
    orbit = pk.periodic_orbit(chain, np.zeros(2 * n), settle=100.0)
    response = pk.continuation(chain, "w", orbit=orbit, span=(0.38, 0.42))
    assert response.stops[0].reason == response.stops[1].reason == "bound"
    for i in np.linspace(0, response.points.sizes["point"] - 1, 3).astype(int):
        orbit = response.orbit(int(i))
        w, start = float(orbit.w), np.array([float(orbit[name][0]) for name in chain.state])

        def rates(t, x, w=w):
            load = -C @ x[n:] - K @ x[:n] - k * x[:n] ** 3
            load[0] += F * np.cos(w * t)
            return np.concatenate([x[n:], load])

        after = solve_ivp(rates, (0.0, 2 * np.pi / w), start, rtol=1e-10, atol=1e-11).y[:, -1]
        np.testing.assert_allclose(after, start, atol=1e-7)


@pytest.mark.parametrize(
    ("given", "more", "message"),
    [
        (([[1, 0], [0, 0]], np.zeros((2, 2)), np.eye(2)), {}, "M: .*not singular"),
        (([[1, 1], [1, 1]], np.zeros((2, 2)), np.eye(2)), {}, "M: .*not singular"),
        ((np.ones((2, 3)), 0, 0), {}, "M: .*square matrix"),
        ((np.eye(2), np.eye(3), np.eye(2)), {}, r"C: .*shape \(2, 2\), as M"),
        ((np.eye(2), np.eye(2), [[np.nan, 0], [0, 1]]), {}, "K: .*finite numbers"),
        ((1.0, 0.0, 1.0, {"y": "x"}), {}, "force: coordinate 'y' is unknown"),
        ((1.0, 0.0, 1.0, ["x", "x"]), {}, "force: .*1 formulas"),
        ((1.0, 0.0, 1.0, "x**3", "F*cos(t)"), {}, "forcing: .*unknown symbol F"),
        ((1.0, 0.0, 1.0, "x**3", "x"), {}, "forcing: .*unknown symbol x"),
        ((1.0, 0.0, 1.0, "x**3"), {"period": 1.0}, "period: .*forcing does not depend"),
        ((1.0, 0.0, 1.0, "x**3"), {"jac": abs}, "jac: .*unless force is a function"),
        ((1.0, 0.0, 1.0), {"coordinates": ("a", "b")}, "coordinates: .*1 names"),
        ((1.0, 0.0, 1.0), {"parameters": {"dx": 1.0}}, "parameters: .*'dx' is taken"),
        ((1.0, 0.0, 1.0), {"time": "x"}, "time: .*no state"),
        ((1.0, 1.0, 1.0), {"conservative": True}, "conservative: .*damping"),
        ((1.0, 0.0, 1.0, lambda y: y), {"parameters": {"a": 1.0}}, "force: .*arguments"),
    ],
)
def test_unusable_arguments(given, more, message):
    """What cannot be taken is named before any work."""
    with pytest.raises(pk.ParameterError, match=message):
        pk.Problem.mechanical(*given, **more)
