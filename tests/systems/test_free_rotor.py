"""The machine of two degrees of freedom: limits, conserved quantities, motions, sections."""

from __future__ import annotations

import pickle

import numpy as np
import pytest
import xarray as xr

import phasekit as pk
from phasekit import FreeGyroRotor

DISK = pk.GyroRotorDisk(beta=1.0, e=0.1, a=0.05, r=0.1, omega1=6.0, m=2.0)
ROTOR = FreeGyroRotor(DISK, 0.02)
#: omega1 = 15 at rest gives four steady rotations
TRIGGER = FreeGyroRotor(DISK.replace(a=0.01, omega1=15.0), 0.02)
LIBRATION, ROTATION = (0.5, 0.0), (0.5, 25.0)


def state(motion: xr.Dataset) -> tuple[xr.DataArray, xr.DataArray, xr.DataArray]:
    return motion.motion_phi, motion.motion_dphi, motion.motion_omega1


# Limits


@pytest.mark.parametrize("inertia", [1e4, 1e8, 1e14])
def test_heavy_support_gives_the_driven_disk(inertia):
    rng = np.random.default_rng(0)
    phi, dphi = rng.normal(size=(2, 50)) * [[2], [10]]
    driven = -pk.gradient(DISK, phi).potential_gradient.values
    got = FreeGyroRotor(DISK, inertia).accelerations(phi, dphi)
    scale = 500.0  # of the accelerations
    assert np.abs(got.ddphi - driven).max() <= scale * (1.0 / inertia + 1e-15)
    assert np.abs(got.domega1).max() <= scale / inertia


@pytest.mark.parametrize("start", [LIBRATION, ROTATION])
def test_heavy_support_gives_the_exact_motion_of_the_driven_disk(start):
    times = np.linspace(0, 3, 31)
    got = FreeGyroRotor(DISK, 1e13).simulate(*start, times)
    want = pk.flow(DISK, *start, times)
    assert np.abs(got.motion_phi - want.motion_phi).max() < 1e-9
    assert np.abs(got.motion_dphi - want.motion_dphi).max() < 1e-8
    assert np.abs(got.motion_phi1 - 6.0 * times).max() < 1e-9


def test_pendulum_and_wheel():
    """Limits without any coupling: torque over inertia."""
    pendulum = FreeGyroRotor(
        pk.GyroRotorDisk(beta=90 * pk.deg, e=0.5, a=0, r=0, omega1=0.0, m=1, g=9.81), 1.0
    )
    found = pendulum.accelerations(0.3, 0.0, torque1=2.0)
    assert found.domega1 == pytest.approx(2.0 / (1.0 + (0.5 * np.sin(0.3)) ** 2), rel=1e-14)
    assert found.ddphi == pytest.approx(-9.81 / 0.5 * np.sin(0.3), rel=1e-14)
    wheel = FreeGyroRotor(DISK.replace(beta=np.pi / 2, e=0.0, a=0.3), 0.1)
    found = wheel.accelerations(0.3, 50.0, torque2=0.7)
    assert found.domega1 == pytest.approx(0.0, abs=1e-15)
    assert found.ddphi == pytest.approx(0.7 / (2.0 * 0.1**2 / 2), rel=1e-14)


# Conserved quantities and balances


@pytest.mark.slow
@pytest.mark.parametrize("start", [LIBRATION, ROTATION])
def test_energy_and_momentum_are_kept(start):
    motion = ROTOR.simulate(*start, (0.0, 20.0))
    for name in ("mechanical_energy", "angular_momentum"):
        values = motion[name].values
        assert np.ptp(values) <= 2e-9 * np.abs(values).max(), name
        assert motion[name].attrs["units"] in ("J", "kg m2 s-1")
    assert np.all(motion.torque_power == 0)
    energy = ROTOR.energy(*state(motion))
    assert np.array_equal(energy, motion.mechanical_energy)
    assert energy.dims == ("time",)
    p = ROTOR.angular_momentum(*start)
    assert motion.angular_momentum[0].item() == p


def gauss_integral(trajectory, name: str) -> float:
    """Integrate a variable over the motion, by Gauss points in each step."""
    x, w = np.polynomial.legendre.leggauss(6)
    half = np.diff(trajectory.steps)[:, None] / 2
    nodes = trajectory.steps[:-1, None] + half * (1 + x)
    values = trajectory(nodes.ravel())[name].values.reshape(nodes.shape)
    return float((half * w * values).sum())


def test_work_of_torques_is_the_change_of_energy():
    def motor(t, phi1, phi, omega1, dphi):
        return 0.4 * np.cos(3 * t) - 0.1 * phi1

    def brake(t, phi1, phi, omega1, dphi):
        return 0.05 - 0.02 * dphi

    found = ROTOR.trajectory(*ROTATION, (0.0, 4.0), torque1=motor, torque2=brake)
    ends = found([0.0, 4.0])
    change = ends.mechanical_energy.diff("time").item()
    assert abs(change) > 1.0
    assert gauss_integral(found, "torque_power") == pytest.approx(change, rel=1e-8)
    change = ends.angular_momentum.diff("time").item()
    assert abs(change) > 0.02
    assert gauss_integral(found, "torque1") == pytest.approx(change, rel=1e-8)


def test_accelerations_are_the_rates_of_the_velocities():
    found = ROTOR.trajectory(*LIBRATION, (0.0, 2.0), torque1=0.2)
    times, step = np.linspace(0.1, 1.9, 15), 1e-4
    near = [found(times + shift * step) for shift in (-2, -1, 1, 2)]
    at = found(times)
    pairs = {"phi1": "motion_omega1", "phi": "motion_dphi", "omega1": "domega1", "dphi": "ddphi"}
    for name, rate in pairs.items():
        far2, far1, near1, near2 = (x[f"motion_{name}"].values for x in near)
        slope = (far2 - 8 * far1 + 8 * near1 - near2) / (12 * step)
        assert np.allclose(slope, at[rate], rtol=1e-6, atol=1e-6), name


def test_simulation_runs_back():
    forth = ROTOR.simulate(*ROTATION, [0.0, 1.5, 3.0])
    end = {name: forth[f"motion_{name}"][-1].item() for name in ("phi", "dphi", "omega1", "phi1")}
    back = ROTOR.simulate(
        end["phi"], end["dphi"], [3.0, 1.5, 0.0], omega1=end["omega1"], phi1=end["phi1"]
    )
    for name in end:
        there, here = forth[f"motion_{name}"].values, back[f"motion_{name}"].values[::-1]
        assert np.allclose(here, there, rtol=0, atol=1e-7), name


def test_bearing_forces_along_a_motion():
    """What the drive gives to the disk is its torque without what turns the support itself."""
    disk = DISK.replace(half_span=0.2)
    motion = FreeGyroRotor(disk, 0.02).simulate(*ROTATION, np.linspace(0, 1, 21), torque1=0.3)
    forces = pk.bearing_forces(disk, motion)
    want = motion.torque1 - 0.02 * motion.domega1
    assert forces.force.dims == ("time", "bearing", "disk_axis")
    assert np.allclose(forces.drive_torque, want, rtol=0, atol=1e-11)
    for name in ("ddphi", "domega1"):
        with pytest.raises(pk.ParameterError, match=f"^{name}: got 1.0, wants nothing beside"):
            pk.bearing_forces(disk, motion, **{name: 1.0})


# Reduction


def test_amended_potential_by_differences():
    amended = ROTOR.amended(0.8)
    phi, step = np.linspace(-3, 3, 13), 1e-3
    for function, derivative in (
        (amended.potential, amended.gradient),
        (amended.gradient, amended.curvature),
    ):
        far2, far1, near1, near2 = (function(phi + k * step) for k in (-2, -1, 1, 2))
        slope = (far2 - 8 * far1 + 8 * near1 - near2) / (12 * step)
        assert np.allclose(slope, derivative(phi), rtol=1e-8, atol=1e-8)


def test_motion_moves_in_the_amended_potential():
    start = (0.9, 1.0)
    motion = TRIGGER.simulate(*start, np.linspace(0, 3, 61))
    amended = TRIGGER.amended(TRIGGER.angular_momentum(*start))
    speed = amended.phase_velocity(motion.motion_phi, TRIGGER.energy(*start))
    moving = np.abs(motion.motion_dphi) > 0.1
    assert moving.sum() > 30
    assert np.allclose(speed[moving], np.abs(motion.motion_dphi)[moving], rtol=0, atol=1e-8)
    omega1 = amended.omega1(motion.motion_phi, motion.motion_dphi)
    assert np.allclose(omega1, motion.motion_omega1, rtol=0, atol=1e-8)
    lowest = amended.equilibria().steady_energy.min().item()
    assert np.isnan(amended.phase_velocity(0.3, lowest - 1e-9))
    assert amended.effective_inertia(0.3) < DISK.inertia().Jn


def test_steady_rotations_stand_still():
    amended = TRIGGER.amended(TRIGGER.angular_momentum(0.0, 0.0))
    ds = amended.equilibria()
    assert ds.steady_kind.values.tolist() == [2, 1, 2, 1]
    assert ds.momentum.item() == amended.p
    for _, at in ds.groupby("steady_rotation"):
        phi, omega1 = at.steady_phi.item(), at.steady_omega1.item()
        time = 3.0 if at.steady_kind == pk.EquilibriumKind.CENTER else 0.5
        motion = TRIGGER.simulate(phi, 0.0, [0.0, time / 2, time], omega1=omega1)
        assert np.abs(motion.motion_phi - phi).max() < 1e-10
        assert np.abs(motion.motion_phi1 - omega1 * motion.time).max() < 1e-9
        assert motion.mechanical_energy[0].item() == pytest.approx(at.steady_energy.item())


def test_small_oscillations_have_the_frequency_that_is_told():
    p = TRIGGER.angular_momentum(0.0, 0.0)
    ds = TRIGGER.amended(p).equilibria()
    amplitude = 1e-4
    for phi, frequency in zip(ds.steady_phi.values, ds.steady_frequency.values, strict=True):
        if np.isnan(frequency):
            continue
        omega1 = TRIGGER.amended(p).omega1(phi + amplitude, 0.0)
        period = 2 * np.pi / frequency
        turning = TRIGGER.trajectory(
            phi + amplitude,
            0.0,
            (0.0, 3.2 * period),
            omega1=omega1,
            events={"turning": lambda t, phi1, phi, omega1, dphi: dphi},
            atol=1e-15,
        ).events.event_time.values
        halves = np.diff(turning[turning > 0.1 * period])
        assert 2 * halves.mean() == pytest.approx(period, rel=2e-6)


# Trajectories and events


def test_trajectory_is_what_simulate_returns():
    times = np.linspace(0, 2, 9)
    found = ROTOR.trajectory(*LIBRATION, (0.0, 2.0), torque1=0.1)
    xr.testing.assert_identical(found(times), ROTOR.simulate(*LIBRATION, times, torque1=0.1))
    steps = ROTOR.simulate(*LIBRATION, (0.0, 2.0), torque1=0.1)
    assert np.array_equal(steps.time, found.steps)
    assert (found.start, found.stop) == (0.0, 2.0)
    one = found(0.75)
    assert one.motion_phi.dims == ()
    assert one.time.item() == 0.75
    assert one.motion_phi.item() == found([0.75]).motion_phi.values[0]


def test_events():
    def top(t, phi1, phi, omega1, dphi):
        return np.cos(phi / 2)

    def turn(t, phi1, phi, omega1, dphi):
        return phi1 - 9.0

    turn.terminal = True
    found = ROTOR.trajectory(*ROTATION, (0.0, 60.0), events={"top": top, "turn": turn})
    events = found.events
    assert events.event_name.values[-1] == "turn"
    assert events.event_phi1[-1].item() == pytest.approx(9.0, abs=1e-9)
    assert found.stop == events.event_time[-1].item() < 60.0
    over = events.isel(event=np.flatnonzero(events.event_name.values == "top"))
    assert over.sizes["event"] > 1
    assert np.allclose(np.mod(over.event_phi, 2 * np.pi), np.pi, atol=1e-9)
    assert np.allclose(over.event_phi.diff("event"), 2 * np.pi, atol=1e-9)
    at = found(events.event_time.values)
    assert np.array_equal(at.motion_phi, events.event_phi)
    alone = ROTOR.trajectory(*ROTATION, (0.0, 60.0), events=turn)
    assert alone.events.event_name.values.tolist() == ["event"]
    assert ROTOR.trajectory(*ROTATION, (0.0, 0.1)).events.sizes["event"] == 0


# Sections


def drive(t, phi1, phi, omega1, dphi):
    return 0.3 * np.cos(4.0 * t)


@pytest.mark.slow
def test_stroboscopic_section():
    period = 2 * np.pi / 4.0
    ds = ROTOR.poincare(*ROTATION, 5 * period, period=period, torque1=drive)
    times = period * np.arange(6)
    assert np.array_equal(ds.section_time, times)
    want = ROTOR.simulate(*ROTATION, times, torque1=drive)
    for name in ("omega1", "dphi"):
        assert np.allclose(ds[f"section_{name}"], want[f"motion_{name}"], rtol=0, atol=1e-10)
    for name in ("phi1", "phi"):
        wrapped = ds[f"section_{name}"].values
        assert np.all((wrapped > -np.pi) & (wrapped <= np.pi))
        turns = (want[f"motion_{name}"].values - wrapped) / (2 * np.pi)
        assert np.allclose(turns, np.round(turns), atol=1e-9)
    assert np.ptp(want.motion_phi.values) > 2 * np.pi


@pytest.mark.slow
@pytest.mark.parametrize("direction", [1, -1, 0])
def test_section_at_an_angle(direction):
    ds = ROTOR.poincare(*LIBRATION, 8.0, section=0.2, direction=direction, torque1=drive)
    event = lambda t, phi1, phi, omega1, dphi: np.sin((phi - 0.2) / 2)  # noqa: E731
    found = ROTOR.trajectory(*LIBRATION, (0.0, 8.0), torque1=drive, events=event).events
    wanted = found.event_dphi.values * direction >= 0
    assert ds.sizes["crossing"] == wanted.sum() > 5
    assert np.allclose(ds.section_phi, 0.2, rtol=0, atol=1e-12)
    assert np.allclose(ds.section_time, found.event_time[wanted], rtol=0, atol=1e-10)
    assert np.allclose(ds.section_omega1, found.event_omega1[wanted], rtol=0, atol=1e-9)
    assert np.allclose(ds.section_dphi, found.event_dphi[wanted], rtol=0, atol=1e-9)
    assert np.all(np.diff(ds.section_time) > 0)


def test_a_section_just_inside_the_turning_points_is_passed_twice_at_each():
    """The two passages lie within one step."""
    turning = lambda t, phi1, phi, omega1, dphi: dphi  # noqa: E731
    found = ROTOR.trajectory(*LIBRATION, (0.0, 10.0), events=turning)
    turns = found.events.isel(event=found.events.event_time.values > 1e-6)
    # it starts at a turning point of the other side
    lower = turns.event_phi.values[turns.event_phi.values < 0.5 - 1e-3]
    assert lower.size > 5
    assert np.ptp(lower) < 1e-8
    ds = ROTOR.poincare(*LIBRATION, 10.0, section=lower[0] + 1e-7, direction=0)
    assert ds.sizes["crossing"] == 2 * lower.size
    assert np.all(ds.section_dphi[::2] < 0)
    assert np.all(ds.section_dphi[1::2] > 0)
    assert np.diff(ds.section_time)[::2].max() < np.diff(found.steps).min()


@pytest.mark.slow
def test_section_of_a_rotation_counts_its_turns():
    ds = ROTOR.poincare(*ROTATION, 5.0, section=3.0)
    end = ROTOR.simulate(*ROTATION, [0.0, 2.5, 5.0]).motion_phi[-1].item()
    assert ds.sizes["crossing"] == np.floor((end - 3.0) / (2 * np.pi)) + 1
    assert np.ptp(ds.section_dphi.values) < 1e-7 * ds.section_dphi[0]  # one energy and momentum
    assert ROTOR.poincare(*ROTATION, 5.0, section=3.0, direction=-1).sizes["crossing"] == 0
    # the start is no passage
    assert ROTOR.poincare(*ROTATION, 0.01, section=0.5).sizes["crossing"] == 0


# Arguments and results


def test_states_broadcast():
    phi = np.linspace(0, 3, 4)
    numbers = ROTOR.accelerations(0.3, 1.0)
    assert all(type(x) is float for x in numbers)
    arrays = ROTOR.accelerations(phi[:, None], [1.0, 2.0], 3.0)
    assert arrays.ddphi.shape == (4, 2)
    assert type(arrays.ddphi) is np.ndarray
    rows = xr.DataArray(phi, dims="phi", coords={"phi": phi})
    columns = xr.DataArray([1.0, 2.0], dims="speed")
    labelled = ROTOR.accelerations(rows, columns, 3.0)
    assert labelled.ddphi.dims == ("phi", "speed")
    assert labelled.ddphi.attrs["units"] == "s-2"
    assert np.array_equal(labelled.ddphi, arrays.ddphi)
    assert np.array_equal(labelled.domega1, arrays.domega1)
    assert ROTOR.mass_matrix(phi).shape == (4, 2, 2)
    assert ROTOR.mass_matrix(0.3).shape == (2, 2)
    assert ROTOR.mass_matrix(rows).dims == ("phi", "row", "column")
    assert ROTOR.amended(0.3).potential(rows).dims == ("phi",)
    assert np.isnan(ROTOR.energy(np.array([0.1, np.nan]), 0.0)).tolist() == [False, True]
    default = ROTOR.energy(0.3, 1.0)
    assert default == ROTOR.energy(0.3, 1.0, 6.0) != ROTOR.energy(0.3, 1.0, 0.0)


def test_results_say_what_they_are():
    motion = ROTOR.simulate(*LIBRATION, [0.0, 0.1, 0.2])
    events = ROTOR.trajectory(*LIBRATION, (0.0, 0.1)).events
    section = ROTOR.poincare(*LIBRATION, 1.0, section=0.0)
    for ds in (motion, section, ROTOR.amended(0.3).equilibria(), events.drop_vars("event_name")):
        for name in ds.data_vars:
            attrs = ds[name].attrs
            assert all(attrs[key] for key in ("units", "long_name", "equation", "source")), name
        assert ds.carrier_inertia.item() == 0.02
        assert ds.beta.attrs["units"] == "rad"
        assert "omega1" not in ds.coords  # a state here
        assert ds.attrs["phasekit_model"] == "FreeGyroRotor"
    assert motion.time.attrs["units"] == "s"
    kind = ROTOR.amended(0.3).equilibria().steady_kind
    assert kind.dtype == np.int8
    assert kind.attrs["flag_meanings"].split()[2] == "center"


def test_machines_are_values():
    assert FreeGyroRotor(DISK, 0.02) == ROTOR != FreeGyroRotor(DISK, 0.03)
    assert hash(FreeGyroRotor(DISK, 0.02)) == hash(ROTOR)
    assert pickle.loads(pickle.dumps(ROTOR)) == ROTOR
    assert repr(ROTOR).startswith("FreeGyroRotor(disk=GyroRotorDisk(beta=1.0")
    assert repr(ROTOR.amended(0.5)) == "Amended(p=0.5)"
    with pytest.raises(AttributeError):
        ROTOR.carrier_inertia = 1.0


def fits(t, phi1, phi, omega1, dphi):
    return 0.0


WRONG = {
    "disk": lambda: FreeGyroRotor(pk.Coefficients(1, 2, 3), 0.1),
    "disk.m": lambda: FreeGyroRotor(DISK.replace(m=None), 0.1),
    "disk.beta": lambda: FreeGyroRotor(DISK.replace(beta=[0.1, 0.2]), 0.1),
    "carrier_inertia": lambda: FreeGyroRotor(DISK, -0.1),
    "carrier_inertia: got 'x'": lambda: FreeGyroRotor(DISK, "x"),
    "carrier_inertia: got None": lambda: FreeGyroRotor(DISK, None),
    "parameter of FreeGyroRotor 'inertia'": lambda: FreeGyroRotor(DISK, inertia=1.0),
    "phi: got 'x'": lambda: ROTOR.accelerations("x", 0.0),
    "dphi: got nan": lambda: ROTOR.accelerations(0.0, np.nan),
    "phi, dphi, omega1": lambda: ROTOR.energy([1.0, 2.0], [1.0, 2.0, 3.0]),
    "dphi: got a 1-D": lambda: ROTOR.energy(xr.DataArray([1.0], dims="x"), np.arange(9.0)),
    "p: got [1.0, 2.0]": lambda: ROTOR.amended([1.0, 2.0]),
    "p: got 1e+200": lambda: ROTOR.amended(1e200),
    "t: got 1.0": lambda: ROTOR.simulate(0.1, 0.0, 1.0),
    "t: got [0.0, 2.0, 1.0]": lambda: ROTOR.simulate(0.1, 0.0, [0.0, 2.0, 1.0]),
    "t: got [0.0, nan]": lambda: ROTOR.simulate(0.1, 0.0, [0.0, np.nan]),
    "span: got [0.0, 1.0, 2.0]": lambda: ROTOR.trajectory(0.1, 0.0, [0.0, 1.0, 2.0]),
    "phi0": lambda: ROTOR.simulate([0.1, 0.2], 0.0, (0.0, 1.0)),
    "dphi0": lambda: ROTOR.simulate(0.1, None, (0.0, 1.0)),
    "omega1": lambda: ROTOR.simulate(0.1, 0.0, (0.0, 1.0), omega1=np.inf),
    "phi1": lambda: ROTOR.simulate(0.1, 0.0, (0.0, 1.0), phi1="x"),
    "rtol": lambda: ROTOR.simulate(0.1, 0.0, (0.0, 1.0), rtol=1e-16),
    "atol": lambda: ROTOR.simulate(0.1, 0.0, (0.0, 1.0), atol=-1.0),
    "max_step": lambda: ROTOR.simulate(0.1, 0.0, (0.0, 1.0), max_step=0.0),
    "torque1: got 'x'": lambda: ROTOR.simulate(0.1, 0.0, (0.0, 1.0), torque1="x"),
    "torque2: got an object": lambda: ROTOR.simulate(0.1, 0.0, (0.0, 1.0), torque2=lambda t: 0.0),
    "torque1 at t = 0.0: got None": lambda: ROTOR.simulate(
        0.1, 0.0, (0.0, 1.0), torque1=lambda *x: None
    ),
    "torque2 at t = 0.0: got nan": lambda: ROTOR.simulate(
        0.1, 0.0, (0.0, 1.0), torque2=lambda *x: np.nan
    ),
    "events: got 3": lambda: ROTOR.trajectory(0.1, 0.0, (0.0, 1.0), events=3),
    "events: got 1": lambda: ROTOR.trajectory(0.1, 0.0, (0.0, 1.0), events={1: fits}),
    "events: got an object": lambda: ROTOR.trajectory(
        0.1, 0.0, (0.0, 1.0), events=lambda t, y: 0.0
    ),
    "t: got 2.0": lambda: ROTOR.trajectory(0.1, 0.0, (0.0, 1.0))(2.0),
    "duration": lambda: ROTOR.poincare(0.1, 0.0, 0.0, section=0.0),
    "period, section": lambda: ROTOR.poincare(0.1, 0.0, 1.0),
    "period, section: got 1.0 and 0.0": lambda: ROTOR.poincare(
        0.1, 0.0, 1.0, period=1.0, section=0.0
    ),
    "period: got 3.0": lambda: ROTOR.poincare(0.1, 0.0, 1.0, period=3.0),
    "section": lambda: ROTOR.poincare(0.1, 0.0, 1.0, section=np.nan),
    "direction": lambda: ROTOR.poincare(0.1, 0.0, 1.0, section=0.0, direction=2),
}


@pytest.mark.parametrize("start", WRONG, ids=list(WRONG))
def test_wrong_arguments_are_named(start):
    with pytest.raises(pk.ParameterError) as caught:
        WRONG[start]()
    assert str(caught.value).startswith(start)
    assert "wants" in str(caught.value) or "valid" in str(caught.value).lower()


def runaway(t, phi1, phi, omega1, dphi):
    """Reach infinity in finite time."""
    return dphi**3


@pytest.mark.parametrize(
    "start",
    [
        lambda **torque: ROTOR.simulate(0.1, 20.0, (0.0, 50.0), **torque),
        lambda **torque: ROTOR.poincare(0.1, 20.0, 50.0, section=0.1, **torque),
        lambda **torque: ROTOR.poincare(0.1, 20.0, 50.0, period=10.0, **torque),
    ],
    ids=["simulate", "section", "period"],
)
def test_what_the_integrator_cannot_do(start):
    with pytest.raises(pk.ConvergenceError, match=r"stopped at t = 2\.4\d*e-05 s of 50\.0 s: "):
        start(torque2=runaway)


def test_particle_over_the_axis_of_a_support_without_inertia():
    """Nothing resists the support's turn there."""
    pendulum = FreeGyroRotor(
        pk.GyroRotorDisk(beta=np.pi / 2, e=0.5, a=0.0, r=0.0, omega1=0.0, m=1.0), 0.0
    )
    assert np.isnan(pendulum.accelerations(0.0, 1.0).domega1)
    with pytest.raises(pk.ParameterError, match="support without inertia"):
        pendulum.simulate(0.0, 1.0, (0.0, 1.0))
    # with momentum it never gets there
    motion = pendulum.simulate(1.0, 0.0, (0.0, 10.0), omega1=2.0)
    assert np.ptp(motion.mechanical_energy.values) < 1e-8


@pytest.mark.slow
def test_the_whole_machine_is_a_problem():
    """Formulas of Lagrange's equations against the arrays that simulate, and the same by code."""
    machine = pk.FreeGyroRotor(
        pk.GyroRotorDisk(beta=1.0, e=0.1, a=0.05, r=0.1, omega1=6.0, m=2.0), carrier_inertia=0.02
    )
    t = np.linspace(0.0, 2.0, 5)

    def curve(t, phi1, phi, omega1, dphi):
        return 0.5 - 0.05 * omega1

    old = machine.simulate(0.5, 0.0, t, torque1=curve, torque2=-0.01)
    motor = machine.driven("pull - slip*omega1", -0.01, parameters={"pull": 0.5, "slip": 0.05})
    for driven in (motor, machine.driven(curve, -0.01)):
        new = pk.flow(driven, phi=0.5, dphi=0.0, t=t)
        for name in ("phi1", "phi", "omega1", "dphi"):
            name = f"motion_{name}"
            np.testing.assert_allclose(new[name], old[name], rtol=1e-8, atol=1e-8)
    new = pk.flow(motor, phi=0.5, dphi=0.0, t=t)
    for name in ("torque1", "torque_power", "mechanical_energy", "angular_momentum"):
        np.testing.assert_allclose(new[f"motion_{name}"], old[name], rtol=1e-8, atol=1e-8)
    swept = pk.flow(motor.replace(slip=[0.05, 0.1]), phi=0.5, dphi=0.0, t=2.0)
    assert swept.motion_omega1.dims == ("slip",)
    exponents = pk.lyapunov(
        machine.driven(), {"phi1": 0.0, "phi": 0.5, "omega1": 6.0, "dphi": 0.0}, duration=30.0
    )
    assert abs(exponents.lyapunov_sum) < 1e-2  # nothing is lost
    with pytest.raises(pk.ParameterError, match="a name that the machine has not"):
        machine.driven("e*omega1", parameters={"e": 1.0})
