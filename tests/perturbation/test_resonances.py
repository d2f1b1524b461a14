"""Resonances: the pendulum's Fourier series, and rotations in the limit of high speed."""

import numpy as np
import pytest
from scipy.optimize import brentq
from scipy.special import ellipe, ellipk

import phasekit as pk

PENDULUM = pk.Pendulum(length=1.0, g=1.0)


def test_the_pendulum():
    """Phi = 8 sum q^(n/2)/(n (1 + q^n)) cos(n theta), n odd, in modulus and nome."""
    F, nu = 0.01, 0.8
    ds = pk.resonances(pk.Perturbed(PENDULUM, forcing=pk.Harmonic(F, nu)), n=[1, 2, 3])
    assert ds.order.values.tolist() == [1, 2, 3]

    def frequency(k):
        return 0.5 * np.pi / ellipk(k * k)

    for n in (1, 3):
        k = brentq(lambda k, n=n: frequency(k) - nu / n, 1e-6, 1 - 1e-14, xtol=1e-15)
        K = ellipk(k * k)
        action = 8 / np.pi * (ellipe(k * k) - (1 - k * k) * K)
        q = np.exp(-np.pi * ellipk(1 - k * k) / K)
        V = F * 4 * q ** (n / 2) / (n * (1 + q**n))
        slope = (ellipe(k * k) - (1 - k * k) * K) / (k * (1 - k * k))  # dK/dk
        twist = -nu / n * 0.5 * np.pi * slope / K**2 / (4 * k)  # h = 2 k^2 - 1
        assert ds.resonance_action.sel(order=n).item() == pytest.approx(action, rel=1e-9)
        width = ds.resonance_width.sel(order=n).item()
        assert width == pytest.approx(2 * np.sqrt(V / abs(twist)), rel=1e-5)
    assert ds.resonance_width.sel(order=2) == 0.0  # by symmetry
    gap = ds.resonance_action.sel(order=2).item() - ds.resonance_action.sel(order=1).item()
    want = ds.resonance_width.sel(order=1).item() / gap
    assert ds.resonance_overlap.sel(order=1).item() == pytest.approx(want, rel=1e-12)


@pytest.mark.parametrize("family", ["forward", "backward"])
def test_fast_rotation(family):
    """Omega = J - 1/(2 J^3) and phi = theta + sin(theta)/J^2, for high speed."""
    driven = pk.Perturbed(PENDULUM, forcing=pk.Harmonic(0.01, 20.0))
    ds = pk.resonances(driven, n=1, family=family)
    action, width = ds.resonance_action.item(), ds.resonance_width.item()
    assert action == pytest.approx(20.0 + 0.5 / 20.0**3, rel=1e-8)
    assert width == pytest.approx(2 * np.sqrt(0.01 / (2 * 20.0**2)), rel=0.01)


def test_modulation_drives_as_the_force_that_it_is():
    A, B, C = 1.0, 0.35, 0.12
    base = pk.Coefficients(A, B, C)
    by = pk.Perturbed(base, modulation={"C": pk.Harmonic(0.01, 0.4)})
    ds = pk.resonances(by, n=2, family="outer")
    assert np.isfinite(ds.resonance_width).all()
    assert (ds.resonance_width > 0.0).all()
    other = pk.resonances(pk.Perturbed(base, forcing=pk.Harmonic(0.01, 0.4)), n=2, family="outer")
    assert np.array_equal(ds.resonance_action, other.resonance_action)
    assert not np.allclose(ds.resonance_width, other.resonance_width, rtol=1e-3)
    multiple = pk.resonances(pk.Perturbed(base, forcing=pk.Harmonic(0.01, 0.4)), n=[1], m=2)
    assert multiple.resonance_width.item() == 0.0 or np.isnan(multiple.resonance_action).all()


def test_refusals_and_absent_orbits():
    driven = pk.Perturbed(PENDULUM, forcing=pk.Harmonic(0.01, 5.0))
    assert np.isnan(pk.resonances(driven, n=1).resonance_action).all()  # faster than any libration
    assert np.isnan(pk.resonances(driven, n=1, family="outer").resonance_action).all()
    assert np.isnan(pk.resonances(pk.Perturbed(PENDULUM), n=1).resonance_action).all()
    for bad in ({"n": 0}, {"n": [2, 1]}, {"n": 1, "m": 0}, {"n": 1, "family": "inner"}):
        with pytest.raises(pk.ParameterError):
            pk.resonances(driven, **bad)
