"""The energy integral against fifty digits and against differentiation."""

from __future__ import annotations

import numpy as np
import pytest
from mpmath import mp, mpf
from properties.strategies import systems
from witnesses import oracle

from phasekit.phase.exact.potential import curvature, energy, gradient, phase_velocity, potential

UNIT = 2.0**-53
SAMPLES = 300


@pytest.fixture(scope="module")
def states():
    A, B, C = systems(SAMPLES, seed=5)
    rng = np.random.default_rng(5)
    phi = rng.uniform(-7, 7, SAMPLES)
    phi[::4] = rng.choice([0, np.pi / 2, np.pi, -np.pi / 2, -np.pi, 1e-9], phi[::4].size)
    size = np.abs(A) + np.abs(B) + np.abs(C)
    return A, B, C, phi, rng.normal(size=SAMPLES) * np.sqrt(size), size


def derivative(order, A, B, C, phi):
    """Differentiate V numerically with digits to spare."""
    with mp.workdps(3 * oracle.DPS):
        return mp.diff(lambda x: oracle.potential(A, B, C, x), mpf(phi), order)


@pytest.mark.parametrize(
    ("function", "order"),
    [(potential, 0), (gradient, 1), (curvature, 2)],
    ids=lambda x: str(x)[:20],
)
def test_potential_and_derivatives(states, function, order):
    A, B, C, phi, _, size = states
    got = function(A, B, C, phi)
    assert got.shape == phi.shape
    for i in range(SAMPLES):
        want = derivative(order, A[i], B[i], C[i], phi[i])
        assert abs(mpf(got[i]) - want) <= 6 * UNIT * size[i], (A[i], B[i], C[i], phi[i])


def test_potential_has_the_documented_sign_and_constant():
    """V(0) = A/2 - B, V(pi/2) = -C: hanging down is low for B > 0, outward is low for C > 0."""
    assert potential(3.0, 5.0, 7.0, 0.0) == 1.5 - 5.0
    assert abs(potential(3.0, 5.0, 7.0, np.pi / 2) + 7.0) < 1e-15
    assert gradient(3.0, 5.0, 7.0, 0.0) == -7.0
    assert abs(gradient(3.0, 5.0, 7.0, np.pi / 2) - 5.0) < 2e-15
    assert curvature(3.0, 5.0, 7.0, 0.0) == 2.0


def test_energy_is_kinetic_plus_potential(states):
    A, B, C, phi, dphi, size = states
    got = energy(A, B, C, phi, dphi)
    for i in range(SAMPLES):
        want = mpf(dphi[i]) ** 2 / 2 + oracle.potential(A[i], B[i], C[i], phi[i])
        bound = 8 * UNIT * (size[i] + dphi[i] ** 2)
        assert abs(mpf(got[i]) - want) <= bound, (A[i], B[i], C[i], phi[i], dphi[i])


def test_phase_velocity_inverts_energy(states):
    A, B, C, phi, dphi, size = states
    h = energy(A, B, C, phi, dphi)
    got = phase_velocity(A, B, C, phi, h)
    assert np.all(got >= 0)
    assert np.all(np.abs(got**2 - dphi**2) <= 32 * UNIT * (size + dphi**2))
    for i in range(SAMPLES):
        want = 2 * (mpf(h[i]) - oracle.potential(A[i], B[i], C[i], phi[i]))
        assert abs(mpf(got[i]) ** 2 - want) <= 16 * UNIT * (size[i] + abs(h[i]))


def test_phase_velocity_is_nan_where_the_level_does_not_reach():
    assert np.isnan(phase_velocity(2.0, 1.0, 0.5, 0.0, -1e-12))
    assert phase_velocity(2.0, 1.0, 0.5, 0.0, 0.0) == 0.0
    got = phase_velocity(2.0, 1.0, 0.5, [0.0, 3.0], [-1.0, 9.0])
    assert np.isnan(got[0])
    assert got[1] > 0


def test_arguments_broadcast():
    A, phi = np.array([1.0, 2.0, 3.0])[:, None], np.linspace(-3, 3, 5)
    for function in (potential, gradient, curvature):
        got = function(A, 0.5, -0.25, phi)
        assert got.shape == (3, 5)
        assert got[2, 1] == function(3.0, 0.5, -0.25, phi[1])
    assert energy(A, 0.5, -0.25, phi, 1.0).shape == (3, 5)
    assert phase_velocity(A, 0.5, -0.25, phi, 9.0).shape == (3, 5)


@pytest.mark.parametrize("bad", [np.nan, np.inf, -np.inf])
@pytest.mark.filterwarnings("error")
def test_cells_that_are_not_finite_are_nan_without_a_warning(bad):
    for place in range(4):
        arguments = [np.array([1.0, 1.0]), np.array([2.0, 2.0]), np.array([3.0, 3.0])]
        arguments.append(np.array([0.4, 0.4]))
        arguments[place][0] = bad
        for function in (potential, gradient, curvature):
            got = function(*arguments)
            assert np.isnan(got[0]) or (np.isinf(bad) and np.isinf(got[0])), (function, place)
            assert got[1] == function(1.0, 2.0, 3.0, 0.4)
