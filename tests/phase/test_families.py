"""Families of orbits by the wells that they go round; states by action and angle."""

import numpy as np
import pytest
import xarray as xr

import phasekit as pk

THREE = pk.Potential("-cos(3*x) + a*cos(x) + 0.1*sin(x)", "x", {"a": 0.3}, "2*pi")
ANGLES = np.array([-2.0, 0.0, 0.7, 3.0, 5.5, 9.0])


def test_a_harmonic_oscillator():
    """J = h/w, and x = sqrt(2 J/w) cos(theta)."""
    spring = pk.Potential("k*x^2/2", "x", {"k": [1.0, 4.0]})
    state = pk.state_of(spring, 0.6, ANGLES, "well_0")
    w = np.sqrt(spring.k)[:, None]
    size = np.sqrt(1.2 / w)
    found = (state.phi_of_angle.values, state.dphi_of_angle.values)
    wanted = (size * np.cos(ANGLES), -w * size * np.sin(ANGLES))
    for name, one, true in zip(("phi", "dphi"), found, wanted, strict=True):
        assert np.all(abs(one - true) <= state[f"{name}_of_angle_error"].values)
    assert state.phi_of_angle_error.max() < 1e-13


@pytest.mark.slow
def test_every_family_and_back():
    families = pk.orbit_families(THREE, 1)
    names = [name for name in families.family.values if name != "rotation"]
    assert names == ["well_0", "well_4", "well_2", "wells_0_4", "wells_0_2_4"]
    action = families.action.sel(family=names).values[:, 0]
    names += ["forward", "backward"]
    action = np.append(action, 2 * [2.0 * families.action.sel(family="rotation").item()])
    state = pk.state_of(THREE, action, np.full(7, 5.0), names)
    back = pk.action_angle(THREE, state.phi_of_angle.values, state.dphi_of_angle.values)
    assert back.orbit_family.values.tolist() == [1, 16, 4, 17, 21, -1, -2]
    np.testing.assert_allclose(back.action, action, rtol=1e-12)
    np.testing.assert_allclose(back.angle, 5.0, rtol=1e-11)


@pytest.mark.slow
def test_actions_that_a_family_has_not():
    loops = pk.separatrices(THREE)
    top = loops.saddle_energy.values.argmax()
    whole = 2.0 * loops.winding_area.values[top] / (2.0 * np.pi)
    action = whole * np.array([1.0 - 1e-7, 1.0 + 1e-7, 0.01, -1.0])
    state = pk.state_of(THREE, action, np.zeros(4), "wells_0_2_4")
    assert np.isfinite(state.phi_of_angle.values).tolist() == [True, False, False, False]
    state = pk.state_of(THREE, 0.5 * action, np.zeros(4), "forward")
    assert np.isfinite(state.phi_of_angle.values).tolist() == [False, True, False, False]
    for name in ("well_1", "wells_0_9", "wells_0_2"):  # no center; not there; apart
        assert np.isnan(pk.state_of(THREE, 0.1, 0.2, name).phi_of_angle)
    at_rest = pk.state_of(THREE, 0.0, 1.0, "well_2")
    assert at_rest.phi_of_angle == pk.equilibria(THREE).phi[2]
    with pytest.raises(pk.ParameterError, match="family: got 'outer', wants one of forward"):
        pk.state_of(THREE, 0.1, 0.2, "outer")
    assert np.isnan(pk.state_of(pk.Potential("x^4/4", "x"), 0.1, 0.2, "forward").phi_of_angle)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("base", "families"),
    [
        (pk.Coefficients(1.0, 0.35, 0.12), {"upper_well": 0.05, "outer": 0.6}),
        (THREE, {"well_0": 0.05, "wells_0_4": 1.6}),
    ],
    ids=["ABC", "three"],
)
def test_librations_under_a_torque(base, families):
    """Both wells of one sign of the torque are in one turn, of the other one apart."""
    tilted = pk.Perturbed(base, torque=xr.DataArray([0.03, -0.03], dims="point"))
    for name, action in families.items():
        state = pk.state_of(tilted, action, [0.3, 4.0], name)
        assert state.phi_of_angle_error.max() < 1e-11
        back = pk.action_angle(tilted, state.phi_of_angle.values, state.dphi_of_angle.values)
        np.testing.assert_allclose(back.action, action, rtol=1e-11)
        np.testing.assert_allclose(back.angle, [0.3, 4.0], rtol=1e-10)
    rotation = pk.state_of(tilted, 5.0, 0.2, "forward")
    assert np.isnan(rotation.phi_of_angle).all()
