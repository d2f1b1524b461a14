"""A center of any potential along a slow path, against closed forms, the exact rung and motions."""

import numpy as np
import pytest

import phasekit as pk

WELL = pk.Potential("x^4/4 - m*x^2/2 + h*x", "x", {"m": 1.0, "h": 0.0})
MAGNET = pk.StonerWohlfarth(K=1.0, h_x=0.0, h_y=0.0)
LIKE = pk.Potential(
    "K*sin(phi)^2 - h_x*cos(phi) - h_y*sin(phi)", "phi", {"K": 1.0, "h_x": 0.0, "h_y": 0.0}, "2*pi"
)


def test_the_hysteresis_of_a_double_well():
    """Between the folds at h = -2/27^(1/2) and 2/27^(1/2), whatever the steps are."""
    fold = 2.0 / 27.0**0.5
    for n in (2, 50):
        h = np.concatenate([np.linspace(-1.0, 1.0, n), np.linspace(1.0, -1.0, n)])
        ds = pk.quasi_static(WELL, h=h)
        assert ds.complete
        np.testing.assert_allclose(ds.jump_h, [fold, -fold], rtol=1e-14)
        np.testing.assert_allclose(ds.jump_phi_from, [3.0**-0.5, -(3.0**-0.5)], rtol=1e-13)
        np.testing.assert_allclose(ds.jump_phi_to, [-2.0 * 3.0**-0.5, 2.0 * 3.0**-0.5], rtol=1e-13)
        np.testing.assert_allclose(ds.jump_loss, 0.75, rtol=1e-13)
        assert ds.jump_certain.all()
        np.testing.assert_allclose(ds.x**3 - ds.x + ds.h, 0.0, atol=1e-14)
        np.testing.assert_allclose(ds.natural_frequency, np.sqrt(3 * ds.x**2 - 1), rtol=1e-13)


@pytest.mark.slow
@pytest.mark.parametrize("path", [(0.3, 25), (1.0, 4), (0.7, 9)])
def test_the_exact_rung_goes_the_same_way(path):
    psi, n = path
    field = np.concatenate([np.linspace(3, -3, n), np.linspace(-3, 3, n)])
    way = {"h_x": field * np.cos(psi), "h_y": field * np.sin(psi) + 0.2 * np.cos(3.0 * field)}
    exact, found = (pk.quasi_static(one, **way) for one in (MAGNET, LIKE))
    assert found.sizes == exact.sizes
    assert exact.sizes["jump"] >= 2
    for name in exact.data_vars:
        one, other = exact[name].values, found[name].values
        if exact[name].dtype.kind != "f":
            np.testing.assert_array_equal(other, one, err_msg=name)
        elif exact[name].attrs["units"] == "rad":
            np.testing.assert_allclose(
                np.exp(1j * other), np.exp(1j * one), rtol=1e-11, err_msg=name
            )
        else:  # the magnet's energies have another zero
            np.testing.assert_allclose(np.diff(other), np.diff(one), rtol=1e-9, atol=1e-11)


@pytest.mark.slow
def test_steps_on_a_fold():
    for field in (-2.0, -2.0 * (1 + 1e-15), -2.0 * (1 - 1e-15)):
        ds = pk.quasi_static(LIKE, h_x=[1.0, field, -3.0])
        assert ds.sizes["jump"] == 1
        np.testing.assert_allclose(np.cos(ds.phi.values[2]), -1.0)


def test_where_it_starts_and_what_a_pitchfork_does():
    ds = pk.quasi_static(WELL, m=[2.0, -1.0, 2.0], phi0=-0.1)
    np.testing.assert_allclose(ds.x, [-(2.0**0.5), 0.0, 2.0**0.5], atol=1e-14)  # to the right
    assert ds.sizes["jump"] == 0
    with pytest.raises(pk.ParameterError, match="phi0: got 0.0, wants a coordinate from which"):
        pk.quasi_static(WELL, m=[2.0, 1.0], phi0=0.0)
    with pytest.raises(pk.ParameterError, match="parameter of Potential 'k' is unknown"):
        pk.quasi_static(WELL, k=[2.0, 1.0])
    narrow = pk.Potential("x^4/4 - m*x^2/2", "x", {"m": 1.0}, interval=(-1.0, 1.0))
    with pytest.warns(RuntimeWarning, match="the center leaves the interval before step 2"):
        ds = pk.quasi_static(narrow, m=[0.2, 0.9, 1.1, 0.5])
    assert np.isfinite(ds.x).values.tolist() == [True, True, False, False]


def test_a_pendulum_is_lost_to_its_torque():
    tilted = pk.Perturbed(pk.Pendulum(length=1.0, g=1.0), damping=0.1)
    torque = np.linspace(0.0, 1.2, 13)
    with pytest.warns(RuntimeWarning, match="nothing stops the motion before step 11"):
        ds = pk.quasi_static(tilted, torque=torque)
    np.testing.assert_allclose(ds.phi[:11], np.arcsin(np.minimum(torque[:11], 1.0)), atol=1e-7)


@pytest.mark.slow
def test_what_weak_damping_does():
    """Out of the shallow well it slides into the deep one, or through it."""
    wells = pk.Potential("-cos(x) - cos(2*x)", "x", {}, "2*pi")
    ds = pk.quasi_static(pk.Perturbed(wells), torque=[0.0, 1.4], phi0=3.1)
    assert ds.jump_certain.values.tolist() == [False]
    torque, start = ds.jump_torque.item() + 1e-3, ds.jump_phi_from.item()
    ends = []
    for damping in (3.0, 0.05):
        moved = pk.flow(pk.Perturbed(wells, damping=damping, torque=torque), start, 0.0, [400.0])
        ends.append(moved.motion_phi.item())
    assert ends[0] == pytest.approx(ds.jump_phi_to.item(), abs=1e-2)
    assert ends[1] > start + 20.0


def test_chaos_is_lost_where_it_ends():
    """Of r x (1 - x): all motions leave beyond r = 4."""
    logistic = pk.Problem("r*x*(1 - x)", "x", {"r": 3.7}, map=True, window={"x": (0, 1)})
    with pytest.warns(RuntimeWarning, match="lost before step 2"):
        found = pk.quasi_static(logistic, r=np.array([3.7, 3.9, 4.1]))
    assert found.jump_kind.values.tolist() == ["crisis"]
    assert found.jump_r.item() == pytest.approx(4.0, abs=2e-3)
    assert found.jumped.values.tolist() == [False, False, True]
