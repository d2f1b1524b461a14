"""The freely carried rotor as a system: its steady rotations in maps, and back from them."""

from __future__ import annotations

import pickle

import matplotlib.pyplot as plt
import numpy as np
import pytest
from scipy.optimize import brentq

import phasekit as pk

DISK = pk.GyroRotorDisk(beta=1.0, e=0.1, a=0.005, r=0.1, omega1=15.0, m=2.0)
ROTOR = pk.FreeGyroRotor(DISK, 0.02, momentum=0.6)
PRESENT = 1, 2, 3


def test_equilibria_are_the_steady_rotations():
    ds = pk.equilibria(ROTOR)
    steady = ROTOR.amended(0.6).equilibria()
    assert ds.sizes["equilibrium"] == steady.sizes["steady_rotation"] == ds.n_equilibria.item() > 2
    for name in ("phi", "kind", "energy", "curvature", "natural_frequency"):
        other = steady[f"steady_{name.removeprefix('natural_')}"]
        np.testing.assert_array_equal(ds[name].values, other.values)
    assert ds.energy.attrs["units"] == "J"
    assert ds.momentum.item() == 0.6
    assert "fold_margin" not in ds


def test_the_disk_stays_at_an_equilibrium_and_leaves_a_saddle_by_its_exponent():
    ds = pk.sweep(ROTOR, momentum=[0.6], of=("equilibria", "steady_rotations")).squeeze()
    for i in range(ds.sizes["equilibrium"]):
        phi, speed = ds.phi.values[i], ds.support_speed.values[i]
        assert abs(ROTOR.accelerations(phi, 0.0, speed).ddphi) < 1e-10
        assert ROTOR.angular_momentum(phi, 0.0, speed) == pytest.approx(0.6, rel=1e-13)
        # The linear motion at this momentum, by differences of the exact accelerations.
        step = 1e-5
        rates = []
        for sign in (1, -1):
            x = phi + sign * step
            rates.append(ROTOR.accelerations(x, 0.0, ROTOR.amended(0.6).omega1(x, 0.0)).ddphi)
        square = (rates[0] - rates[1]) / (2 * step)
        if ds.kind.values[i] == pk.EquilibriumKind.CENTER:
            assert square == pytest.approx(-(ds.natural_frequency.values[i] ** 2), rel=1e-6)
            assert np.isnan(ds.exponent.values[i])
        else:
            assert square == pytest.approx(ds.exponent.values[i] ** 2, rel=1e-6)


def test_maps_over_momentum_and_disk_hold_what_single_machines_have(tmp_path):
    p, beta = np.linspace(0.0, 0.8, 5), np.array([0.6, 1.0, 9.0])
    ds = pk.sweep(ROTOR, momentum=p, beta=beta)
    assert ds.n_equilibria.dims == ("momentum", "beta")
    assert (ds.n_equilibria.values[:, 2] == -1).all()  # not an angle of a disk
    for i in range(5):
        for j in range(2):
            one = pk.equilibria(ROTOR.replace(momentum=p[i], beta=beta[j]))
            n = one.n_equilibria.item()
            assert ds.n_equilibria.values[i, j] == n
            np.testing.assert_array_equal(ds.phi.values[i, j, :n], one.phi.values)
    cell = ds.isel(momentum=3, beta=1)
    assert cell.phasekit.system() == ROTOR.replace(momentum=p[3], beta=1.0)
    back = ds.isel(beta=1).phasekit.system()
    np.testing.assert_array_equal(back.momentum, p)
    stored = pk.sweep(ROTOR, momentum=p, beta=beta, store=tmp_path / "map.nc")
    np.testing.assert_array_equal(stored.phi.values, ds.phi.values)


def test_without_a_momentum_it_is_that_of_omega1():
    free = pk.FreeGyroRotor(DISK, 0.02)
    p = free.angular_momentum(0.0, 0.0)
    np.testing.assert_array_equal(
        pk.equilibria(free).phi.values, pk.equilibria(free.replace(momentum=p)).phi.values
    )
    ds = pk.sweep(free, omega1=[5.0, 15.0])
    assert "momentum" not in ds.coords
    assert ds.isel(omega1=0).phasekit.system() == free.replace(omega1=5.0)


def test_an_axis_of_momenta_counts_for_a_machine_that_has_none_of_its_own():
    free = pk.FreeGyroRotor(DISK, 0.02)
    p = [0.0, 0.1, 5.0]
    ds = pk.sweep(free, momentum=p, of=("equilibria", "steady_rotations"))
    assert ds.n_equilibria.dims == ("momentum",)
    for i, momentum in enumerate(p):
        one = pk.equilibria(free.replace(momentum=momentum))
        n = one.sizes["equilibrium"]
        assert n >= 2
        np.testing.assert_array_equal(ds.phi.values[i, :n], one.phi.values)


def test_what_follows_from_equilibria_needs_no_mention_of_them():
    p = [0.1, 0.5]
    alone = pk.sweep(ROTOR, momentum=p, of="support_speed")
    both = pk.sweep(ROTOR, momentum=p, of=("phi", "support_speed"))
    assert list(alone.data_vars) == ["support_speed"]
    assert np.isfinite(alone.support_speed).sum() >= 4
    np.testing.assert_array_equal(alone.support_speed, both.support_speed)


def test_coefficients_are_refused_and_maps_drawn_without_them():
    for rotor in (ROTOR, pk.FreeGyroRotor(DISK, 0.02)):
        assert pk.plot.phase_portrait(rotor).get_ylabel()
        for call in (pk.FreeGyroRotor.coefficients, pk.FreeGyroRotor.reduced):
            with pytest.raises(pk.ParameterError, match="wants a system with coefficients"):
                call(rotor)
    ds = pk.sweep(ROTOR, momentum=[0.1, 0.6, 0.8], beta=[0.5, 1.0])
    ax = ds.phasekit.plot.parameter_map("n_equilibria")
    assert ax.get_xlabel()
    plt.close("all")


def test_two_centers_appear_where_the_bottom_turns():
    """With a = 0 the bottom becomes a saddle at a momentum that V_p'' = 0 gives."""
    rotor = pk.FreeGyroRotor(DISK.replace(a=0.0), 0.02)

    def bend(p):
        return rotor.amended(p).curvature(0.0)

    critical = brentq(bend, 0.1, 1.0, xtol=1e-14)
    counts = [
        pk.equilibria(rotor.replace(momentum=critical * x)).n_equilibria.item()
        for x in (1 - 1e-6, 1 + 1e-6)
    ]
    assert counts == [2, 4]


def test_what_it_has_not_is_refused():
    with pytest.raises(pk.ParameterError, match=r"span: got None, wants \(low, high\)"):
        pk.critical(ROTOR, "e")
    with pytest.raises(pk.ParameterError, match="momentum"):
        pk.FreeGyroRotor(DISK, 0.02, momentum=np.inf)
    with pytest.raises(pk.ParameterError, match=r"momentum: .*wants one number, for a single"):
        ROTOR.replace(momentum=[0.1, 0.2]).energy(0.0, 0.0)
    with pytest.raises(pk.ParameterError, match="unknown"):
        ROTOR.replace(mass=1.0)
    assert pickle.loads(pickle.dumps(ROTOR)) == ROTOR
    assert ROTOR != ROTOR.replace(momentum=0.5)


def test_motions_are_those_of_both_degrees_of_freedom():
    times = np.linspace(0.0, 3.0, 7)
    momenta = np.array([0.2, 0.6])
    swept = pk.flow(ROTOR.replace(momentum=momenta), 0.3, 0.5, times)
    assert swept.motion_phi.dims == ("momentum", "time")
    assert "V_p'" in swept.motion_phi.equation
    map_ = pk.sweep(ROTOR, momentum=momenta, state_phi=[0.3], state_dphi=[0.5], time=times,
                    of="motion")  # fmt: skip
    np.testing.assert_allclose(
        map_.motion_phi.squeeze(["state_phi", "state_dphi"]), swept.motion_phi, rtol=1e-12
    )
    for p in momenta:
        omega1 = float(ROTOR.amended(p).omega1(0.3, 0.5))
        both = ROTOR.simulate(0.3, 0.5, times, omega1=omega1)
        one = swept.sel(momentum=p)
        np.testing.assert_allclose(one.motion_phi, both.motion_phi, atol=1e-8)
        np.testing.assert_allclose(one.motion_dphi, both.motion_dphi, atol=1e-7)
    assert swept.isel(momentum=1, time=0).phasekit.system() == ROTOR.replace(momentum=0.6)
    # At the momentum at rest, where none is given.
    own = pk.flow(ROTOR.replace(momentum=None), 0.3, 0.5, times)
    rest = ROTOR.amended(ROTOR.angular_momentum(0.0, 0.0))
    again = pk.flow(ROTOR.replace(momentum=rest.p), 0.3, 0.5, times)
    np.testing.assert_allclose(own.motion_phi, again.motion_phi, atol=1e-9)


def test_events_of_a_motion_at_a_momentum():
    rotor = ROTOR.replace(momentum=0.6)
    watched = {"turn": lambda t, phi, dphi: dphi}
    ds = pk.flow(rotor, 0.3, 0.5, np.linspace(0.0, 3.0, 4), events=watched, rtol=1e-11)
    assert ds.sizes["event"] >= 1
    speed = pk.flow(rotor, 0.3, 0.5, ds.event_time.values).motion_dphi
    np.testing.assert_allclose(speed, 0.0, atol=1e-7)
    with pytest.raises(pk.ParameterError, match=r"motion is exact; pk.Perturbed\(system\) takes"):
        pk.flow(pk.Pendulum(length=1.0), 0.3, 0.5, [0.0, 1.0], events=watched)
