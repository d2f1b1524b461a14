"""Run-ups against SciPy, and their forces against those of the states that they pass."""

import numpy as np
import pytest
import xarray as xr
from scipy.integrate import solve_ivp

import phasekit as pk

DISK = pk.GyroRotorDisk(beta=1.0, e=0.01, a=0.1, r=0.1, omega1=0.0, m=2.0, half_span=0.1)
TIMES = np.linspace(0.0, 2.0, 9)


def speed(t):
    return 5.0 * t + np.sin(3.0 * t)


def rates(t, x):
    A, B, C = DISK.replace(omega1=speed(t)).coefficients()
    s, c = np.sin(1.0), np.cos(1.0)
    kappa = (0.1**2 + 4 * 0.01**2) * s * c / (4 * 0.01**2 * s**2 + 0.1**2 * (1 + s**2))
    force = (A * np.cos(x[0]) - B) * np.sin(x[0]) + C * np.cos(x[0])
    return [x[1], force - kappa * (5.0 + 3.0 * np.cos(3.0 * t)) * np.cos(x[0]) - 0.2 * x[1]]


@pytest.fixture(scope="module")
def motion():
    return pk.run_up(DISK, omega1=speed, phi0=0.1, dphi0=0.0, t=TIMES, damping=0.2)


def test_the_motion_is_scipys(motion):
    found = solve_ivp(rates, (0, 2), [0.1, 0.0], "DOP853", TIMES, rtol=1e-12, atol=1e-13)
    assert np.abs(motion.motion_phi - found.y[0]).max() < 1e-9
    assert np.abs(motion.motion_dphi - found.y[1]).max() < 1e-8
    bends = [rates(t, x)[1] for t, x in zip(TIMES, found.y.T, strict=True)]
    assert np.abs(motion.ddphi - bends).max() < 1e-7
    assert np.abs(motion.motion_omega1 - speed(TIMES)).max() < 1e-11
    assert np.abs(motion.domega1 - 5.0 - 3.0 * np.cos(3.0 * TIMES)).max() < 1e-10
    assert "omega1" not in motion.coords


def test_the_forces_are_those_of_the_states(motion):
    for i in (0, 4, 8):
        now = motion.isel(time=i)
        one = pk.bearing_forces(
            DISK.replace(omega1=now.motion_omega1.item()), now.motion_phi.item(),
            now.motion_dphi.item(), ddphi=now.ddphi.item(), domega1=now.domega1.item(),
        )  # fmt: skip
        assert np.abs(one.force.values - now.force.values).max() < 1e-12
        assert one.drive_torque.item() == pytest.approx(now.drive_torque.item(), abs=1e-12)
    fixed = pk.fixed_bearing_forces(DISK, motion, rho_b1=0.3)
    assert fixed.fixed_force.sizes["time"] == 9


@pytest.mark.slow
def test_a_table_gives_what_its_function_gives(motion):
    grid = np.linspace(-0.5, 2.5, 301)
    for table in (
        (grid, speed(grid)),
        xr.DataArray(speed(grid), dims="time", coords={"time": grid}),
    ):
        found = pk.run_up(DISK, omega1=table, phi0=0.1, dphi0=0.0, t=TIMES, damping=0.2)
        assert np.abs(found.motion_phi - motion.motion_phi).max() < 1e-9


def test_many_states_at_once(motion):
    found = pk.run_up(DISK, omega1=speed, phi0=[0.1, 0.5], dphi0=0.0, t=TIMES, damping=0.2)
    assert found.force.dims == ("point", "time", "bearing", "disk_axis")
    assert np.abs(found.force.values[0] - motion.force.values).max() < 1e-9


def test_without_a_mass_there_are_no_forces():
    light = DISK.replace(m=None, half_span=None)
    found = pk.run_up(light, omega1=speed, phi0=0.1, dphi0=0.0, t=TIMES)
    assert "force" not in found
    assert "ddphi" in found


@pytest.mark.parametrize(
    ("omega1", "message"),
    [
        (3.0, "omega1: got 3.0, wants a function of time"),
        (([0.0, 1.0], [1.0, 2.0]), "omega1: got a table from 0 s to 1 s"),
        (lambda t: "x", "omega1: got a function whose value at t = "),
        (lambda t: np.nan, "omega1: got a function whose value at t = "),
        (xr.DataArray([1.0, 2.0], dims="x"), "omega1: got"),
    ],
)
def test_unusable_speeds(omega1, message):
    with pytest.raises(pk.ParameterError, match=message):
        pk.run_up(DISK, omega1=omega1, phi0=0.1, dphi0=0.0, t=TIMES)
    with pytest.raises(pk.ParameterError, match="disk: got"):
        pk.run_up(pk.Pendulum(length=1.0), omega1=speed, phi0=0.1, dphi0=0.0, t=TIMES)


def test_starts_that_are_missing_run_nowhere(recwarn):
    ds = pk.run_up(DISK, omega1=lambda t: 5.0 * t, phi0=[0.1, np.nan], dphi0=0.0, t=[0.0, 0.5])
    lost = np.isnan(ds.motion_phi.values)
    assert 0 < lost.sum() < lost.size
    assert not [w for w in recwarn if "run to infinity" in str(w.message)]
