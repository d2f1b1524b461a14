"""Damped and driven motions against SciPy's integrator, mpmath, and what is known exactly."""

import numpy as np
from scipy.integrate import solve_ivp

import phasekit as pk

DISK = pk.GyroRotorDisk(beta=1.0, e=0.1, a=0.05, r=0.1, omega1=6.0)
EIGHT = pk.Coefficients(1.0, 0.35, 0.12)


def slope(system, phi):
    A, B, C = system.coefficients()
    return (B - A * np.cos(phi)) * np.sin(phi) - C * np.cos(phi)


def scipy_flow(rates, start, times):
    found = solve_ivp(
        rates, (0.0, times[-1]), start, "DOP853", times, rtol=3e-14, atol=1e-15, max_step=0.05
    )
    return found.y


def test_a_damped_disk_moves_as_scipy_says():
    damped = pk.Perturbed(DISK, damping=0.3)
    t = np.linspace(0.0, 8.0, 41)
    ds = pk.flow(damped, 0.3, 20.0, t)
    assert ds.motion_phi.dims == ("time",)
    assert ds.motion_phi.units == "rad"
    assert ds.attrs["phasekit_model"] == "Perturbed"
    expected = scipy_flow(lambda t, x: [x[1], -slope(DISK, x[0]) - 0.3 * x[1]], [0.3, 20.0], t)
    assert np.abs(ds.motion_phi - expected[0]).max() < 1e-8
    assert np.abs(ds.motion_dphi - expected[1]).max() < 1e-7
    assert abs(ds.motion_phi).max() > np.pi  # unwrapped
