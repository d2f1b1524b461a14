"""Rotators and bearing forces as Datasets: at states, along motions, on maps."""

import numpy as np
import pytest
import xarray as xr

import phasekit as pk
from phasekit.labels.coordinates import LABELS
from phasekit.loads import functions as loads_floor
from phasekit.mechanics import bearings as bearings_floor
from phasekit.mechanics import rotators as rotators_floor
from phasekit.phase.exact.phase_space import phase_space
from phasekit.table.quantities import ROWS, select

DISK = pk.GyroRotorDisk(beta=0.7, e=0.05, a=0.024, r=0.2, omega1=31.4, m=2.0, g=9.81, half_span=0.2)
BARE = DISK.replace(m=None, half_span=None)
PHI, DPHI = np.array([-2.0, 0.3, 1.0]), np.array([0.5, -6.0, 0.0])
COLD = (0.7, 0.05, 0.024, 0.2, 31.4, 9.81)
HEAVY = (0.7, 0.05, 0.024, 0.2, 31.4, 2.0, 9.81)
AXES = {"beta": [0.2, 0.5, 0.7], "a": [0.0, 0.01, 0.024, 0.9]}
MAP = pk.sweep(DISK, AXES)
NAMES = ["R01", "R011", "R022", "R012", "R1", "R2", "R12", "R12c"]
AXIS_LABELS = {
    "rotator_name": NAMES,
    "carrier_axis": ["u01", "v01", "n1"],
    "disk_axis": ["u2", "v2", "n2"],
    "bearing": ["A2", "B2"],
    "fixed_bearing": ["A1", "B1"],
}


def assert_same_bits(left, right):
    xr.testing.assert_identical(left, right)
    for name in left.variables:
        if left[name].dtype == float:
            np.testing.assert_array_equal(
                left[name].values.view("i8"), right[name].values.view("i8")
            )


def check_form(ds, group, cells=(), renamed=str):
    """Variables, dims, labels, units and attributes follow from the rows of a group."""
    rows = {renamed(row.name): row for row in select(group)}
    assert list(ds.data_vars) == list(rows)
    for name, row in rows.items():
        assert ds[name].dims == (*cells, *row.dims), name
        assert ds[name].dtype == np.float64
        assert ds[name].attrs == row.attrs
        assert ds[name].attrs["units"] == row.units
    for dim in ds.dims:
        if dim in AXIS_LABELS:
            assert ds[dim].values.tolist() == AXIS_LABELS[dim]
            assert ds[dim].attrs["long_name"] == LABELS[dim][1]
    assert ds.attrs["phasekit_model"] == "GyroRotorDisk"
    assert ds.phasekit.system() is not None


# --- at states ---------------------------------------------------------------------------------


def test_rotators_are_those_of_the_array_floor():
    ds = pk.rotators(BARE, PHI, DPHI)
    check_form(ds, "rotators", ("point",))
    expected = rotators_floor.rotators(*COLD, PHI, DPHI)
    for name, values in expected._asdict().items():
        np.testing.assert_array_equal(ds[name], values)
    assert ds.state_phi.dims == ("point",)
    assert ds.state_phi.attrs["units"] == "rad"
    assert ds.rotator.attrs["units"] == "s-2"
    driven = pk.rotators(BARE, PHI, DPHI, ddphi=3.0, domega1=2.0)
    expected = rotators_floor.rotators(*COLD, PHI, DPHI, 3.0, 2.0)
    for name, values in expected._asdict().items():
        np.testing.assert_array_equal(driven[name], values)
    assert driven.gamma2_rate.isnull().all()
    assert driven.domega1.item() == 2.0
    assert driven.domega1.attrs["units"] == "s-2"


@pytest.mark.parametrize("frame", ["disk", "carrier"])
def test_bearing_forces_are_those_of_the_array_floor(frame):
    ds = pk.bearing_forces(DISK, PHI, DPHI, domega1=2.0, frame=frame)
    expected = bearings_floor.bearing_forces(
        *HEAVY, 0.2, PHI, DPHI, domega1=2.0, carrier=frame == "carrier"
    )
    for name, values in expected._asdict().items():
        np.testing.assert_array_equal(ds[name], values)
        assert ds[name].attrs["units"] in ("N", "N m")
    assert ds.force.dims == ("point", "bearing", f"{frame}_axis")
    assert ds.force_component.dims == ("point", "bearing", "component")
    assert ds.bearing.values.tolist() == ["A2", "B2"]
    assert ds[f"{frame}_axis"].values.tolist() == AXIS_LABELS[f"{frame}_axis"]
    other = {"disk": "carrier_axis", "carrier": "disk_axis"}[frame]
    assert other not in ds.coords
    if frame == "disk":
        check_form(ds, "bearing_forces", ("point",))


def test_fixed_bearing_forces_are_those_of_the_array_floor():
    disk = DISK.replace(half_span=None)
    ds = pk.fixed_bearing_forces(disk, PHI, DPHI, rho_b1=0.4)
    check_form(ds, "fixed_bearing_forces", ("point",))
    expected = bearings_floor.fixed_bearing_forces(*HEAVY, 0.4, PHI, DPHI)
    for name, values in expected._asdict().items():
        np.testing.assert_array_equal(ds[name], values)
    assert ds.rho_b1.item() == 0.4
    assert ds.rho_b1.attrs["units"] == "m"
    several = pk.fixed_bearing_forces(disk, PHI, DPHI, rho_b1=[0.4, -0.2, 0.7])  # they pair
    assert several.fixed_force.dims == ds.fixed_force.dims
    np.testing.assert_array_equal(several.fixed_force[0], ds.fixed_force[0])
    place = xr.DataArray([0.4, -0.2], dims="place")
    several = pk.fixed_bearing_forces(disk, PHI, DPHI, rho_b1=place)
    np.testing.assert_array_equal(several.fixed_force.isel(place=0), ds.fixed_force)


def test_dims_pair_and_broadcast():
    assert pk.rotators(DISK, 0.1, 0.2).rotator.dims == ("rotator_name", "carrier_axis")
    assert pk.bearing_forces(DISK, PHI, 0.2).force_axial.dims == ("point",)
    swept = DISK.replace(beta=[0.1, 0.2], m=[1.0, 2.0, 3.0])
    ds = pk.bearing_forces(swept, PHI, DPHI)
    assert ds.force_axial.dims == ("beta", "m", "point")
    one = pk.bearing_forces(DISK.replace(beta=0.2, m=2.0), PHI[1], DPHI[1])
    np.testing.assert_array_equal(ds.force.sel(beta=0.2, m=2.0).isel(point=1), one.force)
    phi, dphi = xr.DataArray(PHI, dims="start"), xr.DataArray(DPHI[:2], dims="push")
    ds = pk.rotators(DISK, phi, dphi)
    assert ds.gamma2.dims == ("start", "push")
    alone = pk.rotators(DISK, PHI[2], DPHI[1])
    np.testing.assert_array_equal(ds.rotator.isel(start=2, push=1), alone.rotator)
    paired = pk.rotators(DISK, PHI, DPHI, ddphi=[1.0, 2.0, 3.0], domega1=0.5)
    assert paired.gamma2.dims == ("point",)
    alone = pk.rotators(DISK, PHI[2], DPHI[2], ddphi=3.0, domega1=0.5)
    np.testing.assert_array_equal(paired.rotator.isel(point=2), alone.rotator)


def test_domega1_zero_is_the_default():
    one, other = pk.bearing_forces(DISK, PHI, DPHI), pk.bearing_forces(DISK, PHI, DPHI, domega1=0)
    xr.testing.assert_identical(one, other)
    named = pk.bearing_forces(DISK, PHI, DPHI, domega1=[0.0, 1.0, 2.0])
    np.testing.assert_array_equal(named.force.isel(point=0), one.force.isel(point=0))


def test_mass_does_not_matter_for_rotators():
    one, other = pk.rotators(DISK, PHI, DPHI), pk.rotators(BARE, PHI, DPHI)
    for name in one.data_vars:
        np.testing.assert_array_equal(one[name], other[name])


# --- along motions -----------------------------------------------------------------------------


def test_along_a_motion():
    t = np.linspace(0.0, 0.4, 7)
    motion = pk.flow(DISK, PHI, DPHI, t)
    ds = pk.bearing_forces(DISK, motion)
    assert ds.force.dims == ("point", "time", "bearing", "disk_axis")
    np.testing.assert_array_equal(ds.time, t)
    here = motion.isel(point=1, time=3)
    alone = pk.bearing_forces(DISK, here.motion_phi.item(), here.motion_dphi.item())
    np.testing.assert_array_equal(ds.force.isel(point=1, time=3), alone.force)
    # also one state of a motion, and one motion
    xr.testing.assert_equal(
        pk.bearing_forces(DISK, here).force.drop_vars(["point", "time"], errors="ignore"),
        alone.force.drop_vars([]),
    )
    assert pk.rotators(DISK, motion.isel(point=0)).rotator.dims[0] == "time"
    assert pk.fixed_bearing_forces(DISK, motion, rho_b1=0.3).fixed_force.dims[:2] == (
        "point",
        "time",
    )


def test_along_a_motion_of_several_disks():
    swept = DISK.replace(beta=[0.3, 0.7])
    motion = pk.flow(swept, 0.3, 2.0, [0.0, 0.1])
    ds = pk.bearing_forces(swept, motion)
    assert set(ds.force_axial.dims) == {"beta", "time"}
    one = pk.bearing_forces(DISK, pk.flow(DISK, 0.3, 2.0, [0.0, 0.1]))
    np.testing.assert_array_equal(
        ds.force_axial.sel(beta=0.7).transpose("time"), one.force_axial.transpose("time")
    )


def test_along_a_separatrix():
    motion = pk.separatrix_motion(DISK, np.linspace(-0.5, 0.5, 401), side="left")
    ds = pk.bearing_forces(DISK, motion)
    over = MAP.sel(beta=0.7, a=0.024).phasekit.bearing_forces(on="separatrix")
    peak = over.peak_force.sel(saddle="lower", side="left")
    seen = ds.force_magnitude.max("time")
    assert (seen <= peak * (1 + 1e-12)).all()
    np.testing.assert_allclose(seen, peak, rtol=1e-3)
    # far from the saddle in time: the forces of the saddle
    rest = MAP.sel(beta=0.7, a=0.024).phasekit.bearing_forces(on="equilibria")
    saddle = rest.force_magnitude.sel(equilibrium="lower_saddle")
    np.testing.assert_allclose(ds.force_magnitude.isel(time=0), saddle, rtol=1e-3)


def test_along_the_motion_of_a_free_support():
    """omega1 varies: the forces are those of the general machine with the same accelerations."""
    free = pk.FreeGyroRotor(DISK.replace(omega1=6.0), 0.02)
    motion = free.simulate(0.5, 1.0, np.linspace(0.0, 1.0, 6))
    assert float(motion.motion_omega1.std()) > 0.1
    body = pk.RigidBody.disk(2.0, 0.2, 0.05, 0.7)
    machine = pk.CoupledRotation(body, n1=(0, 0, 1), n2=(1, 0, 0), a=0.024)
    state = machine.at(
        omega1=motion.motion_omega1.values,
        domega1=motion.domega1.values,
        phi2=motion.motion_phi.values,
        omega2=motion.motion_dphi.values,
        domega2=motion.ddphi.values,
    )
    G = (0.0, 0.0, -2.0 * 9.81)
    ds = pk.bearing_forces(DISK, motion, frame="carrier")
    assert ds.force.dims == ("time", "bearing", "carrier_axis")
    want = np.stack(state.self_bearings(G, 0.2, -0.2), axis=-2)
    np.testing.assert_allclose(ds.force, want, atol=1e-12 * np.abs(want).max())
    # no torque drives the support but that on the carrier's own inertia
    np.testing.assert_allclose(ds.drive_torque, -0.02 * motion.domega1, rtol=1e-6, atol=1e-9)
    fixed = pk.fixed_bearing_forces(DISK, motion, rho_b1=0.5).fixed_force
    want = np.stack(state.fixed_bearings(G, 0.5), axis=-2)
    np.testing.assert_allclose(fixed, want, atol=1e-12 * np.abs(want).max())
    rotators = pk.rotators(DISK, motion)
    for name, vectors in state.rotators.items():
        got = rotators.rotator.sel(rotator_name=name)
        np.testing.assert_allclose(got, vectors, atol=1e-11 * np.abs(vectors).max(), err_msg=name)


# --- errors ------------------------------------------------------------------------------------

WRONG = [
    (lambda: pk.rotators(DISK, 0.1), "^dphi: got None, wants the angular velocities"),
    (lambda: pk.rotators(DISK, None, 0.1), "^phi: got None"),
    (lambda: pk.rotators(DISK, "a", 0.1), "^phi: got 'a'"),
    (lambda: pk.rotators(DISK, 0.1, [[0.1]]), "^dphi: got a 2-D list"),
    (lambda: pk.rotators(DISK, np.nan, 0.1), "^phi: got nan, wants a finite number"),
    (lambda: pk.rotators(DISK, 0.1, 0.1, ddphi="x"), "^ddphi: got 'x'"),
    (lambda: pk.rotators(DISK, 0.1, 0.1, domega1=None), "^domega1: got None"),
    (lambda: pk.rotators(DISK, 0.1, 0.1, domega1=False), "^domega1: got False"),
    (lambda: pk.rotators(DISK, PHI, [0.1, 0.2]), "^phi, dphi: got 3 values of phi and 2"),
    (lambda: pk.rotators(DISK, PHI, DPHI, ddphi=[1.0]), "^phi, dphi, ddphi: got 3 values"),
    (lambda: pk.rotators(pk.Pendulum(length=0.4), 0.1, 0.2), "^disk: got .*wants a GyroRotorDisk"),
    (lambda: pk.rotators(None, 0.1, 0.2), "None"),
    (lambda: pk.rotators(DISK, pk.flow(DISK, 0.1, 0.2, 1.0), 0.3), "^dphi: got 0.3, wants nothing"),
    (lambda: pk.rotators(DISK, MAP), "^phi: got a Dataset without 'motion_phi'"),
    (lambda: pk.bearing_forces(BARE, 0.1, 0.2), r"^m, half_span: got nothing.*replace\(m="),
    (
        lambda: pk.bearing_forces(DISK.replace(half_span=None), 0.1, 0.2),
        r"^half_span: got nothing.*replace\(half_span=",
    ),
    (lambda: pk.bearing_forces(DISK, 0.1, 0.2, frame="body"), "^frame: got 'body', wants one of"),
    (lambda: pk.bearing_forces(DISK, 0.1, 0.2, frame=1), "^frame: got 1"),
    (lambda: pk.fixed_bearing_forces(DISK, 0.1, 0.2, rho_b1=0), "^rho_b1: got 0, wants a dist"),
    (lambda: pk.fixed_bearing_forces(DISK, 0.1, 0.2, rho_b1="a"), "^rho_b1: got 'a'"),
    (lambda: pk.fixed_bearing_forces(DISK, 0.1, 0.2, rho_b1=np.inf), "^rho_b1: got inf"),
    (lambda: pk.fixed_bearing_forces(BARE, 0.1, 0.2, rho_b1=0.4), "^m: got nothing"),
    (lambda: MAP.phasekit.rotators(on="saddles"), "^on: got 'saddles', wants one of equilibria"),
    (lambda: MAP.phasekit.bearing_forces(on="orbit"), "^phi0: got None, wants the state"),
    (lambda: MAP.phasekit.bearing_forces(on="orbit", phi0=0.1), "^dphi0: got None"),
    (lambda: MAP.phasekit.bearing_forces(phi0=0.1), "^phi0: got 0.1, wants nothing, except"),
    (lambda: MAP.phasekit.rotators(on="separatrix", dphi0=0.1), "^dphi0: got 0.1, wants nothing"),
    (
        lambda: MAP.phasekit.rotators(on="orbit", phi0=[0.1, 0.2], dphi0=[0.1]),
        "^phi0, dphi0: got 2 values",
    ),
    (lambda: MAP.phasekit.bearing_forces(mass=2.0), "parameter of GyroRotorDisk 'mass' is unknown"),
    (lambda: MAP.phasekit.bearing_forces(m=-2.0), "^m: got -2.0, wants a number > 0"),
    (lambda: pk.sweep(BARE, beta=[0.1], of="separatrix_forces"), "^m, half_span: got nothing"),
    (
        lambda: pk.sweep(pk.Reduced(0.1, 0.2), lam=[0.1], of="separatrix_forces"),
        "no such parameter",
    ),
    (lambda: pk.sweep(DISK, beta=[0.1], of="bearing_forces"), "^state_phi, state_dphi: got"),
]


@pytest.mark.parametrize(("call", "message"), WRONG)
def test_errors_name_the_argument(call, message):
    with pytest.raises(pk.ParameterError, match=message) as caught:
        call()
    assert "\n" not in str(caught.value)


def test_maps_of_other_models_are_refused():
    ds = pk.sweep(pk.Reduced(0.1, 0.2), lam=[0.1, 0.2])
    for method in (ds.phasekit.rotators, ds.phasekit.bearing_forces):
        for on in ("equilibria", "separatrix"):
            with pytest.raises(pk.ParameterError, match="Reduced"):
                method(on=on)


# --- maps --------------------------------------------------------------------------------------


@pytest.mark.parametrize("what", ["forces", "rotators"])
def test_at_equilibria_of_a_map(what):
    method = MAP.phasekit.bearing_forces if what == "forces" else MAP.phasekit.rotators
    ds = method(on="equilibria")
    renamed = lambda name: name.removeprefix("equilibrium_")  # noqa: E731
    check_form(ds, f"equilibrium_{what}", ("beta", "a"), renamed)
    values = (np.array(AXES["beta"])[:, None], 0.05, np.array(AXES["a"]), 0.2, 31.4)
    floor = (
        loads_floor.equilibrium_forces(*values, 2.0, 9.81, 0.2, MAP.phi.values)
        if what == "forces"
        else loads_floor.equilibrium_rotators(*values, 9.81, MAP.phi.values)
    )
    for name, expected in zip(ds.data_vars, floor, strict=True):
        np.testing.assert_array_equal(ds[name], expected)
        assert ds[name].isnull().any(dim=[d for d in ds[name].dims if d not in MAP.phi.dims]).sum()
    assert ds.phasekit.system() == MAP.phasekit.system()
    # a state of rest there
    cell = MAP.sel(beta=0.5, a=0.01)
    phi = cell.phi.sel(equilibrium="lower_center").item()
    at = cell.phasekit.system()
    if what == "forces":
        one = pk.bearing_forces(at, phi, 0.0, ddphi=0.0)
        here = ds.sel(beta=0.5, a=0.01, equilibrium="lower_center")
        np.testing.assert_array_equal(here.force, one.force)
        np.testing.assert_array_equal(here.deviation_couple, one.deviation_couple)


@pytest.mark.parametrize("what", ["forces", "rotators"])
def test_over_separatrices_of_a_map(what):
    method = MAP.phasekit.bearing_forces if what == "forces" else MAP.phasekit.rotators
    ds = method(on="separatrix")
    check_form(ds, f"separatrix_{what}", ("beta", "a"))
    disk = MAP.phasekit.system()
    _, loops = phase_space(*disk.coefficients())
    values = (np.array(AXES["beta"])[:, None], 0.05, np.array(AXES["a"]), 0.2, 31.4)
    where = (loops.saddle_phi, loops.saddle_exponent, loops.turning_offset, loops.loop)
    floor = (
        loads_floor.separatrix_forces(*values, 2.0, 9.81, 0.2, *where)
        if what == "forces"
        else loads_floor.separatrix_rotators(*values, 9.81, *where)
    )
    for name, expected in zip(ds.data_vars, floor, strict=True):
        np.testing.assert_array_equal(ds[name], expected)
    first = ds.peak_force.sel(bearing="A2") if what == "forces" else None
    peak = ds.peak_intensity.sel(rotator_name="R022") if first is None else first
    np.testing.assert_array_equal(peak.isel(side=0).notnull(), MAP.loop > 0)


@pytest.mark.parametrize("what", ["forces", "rotators"])
def test_over_orbits_of_a_map(what):
    method = MAP.phasekit.bearing_forces if what == "forces" else MAP.phasekit.rotators
    ds = method(on="orbit", phi0=[0.3, 1.0], dphi0=[2.0, -60.0])
    renamed = lambda name: name.removeprefix("orbit_")  # noqa: E731
    check_form(ds, f"orbit_{what}", ("beta", "a", "point"), renamed)
    cell = ds.sel(beta=0.7, a=0.024).isel(point=1)
    floor = (
        loads_floor.orbit_forces(*HEAVY, 0.2, 1.0, -60.0)
        if what == "forces"
        else loads_floor.orbit_rotators(*COLD, 1.0, -60.0)
    )
    for name, expected in zip(ds.data_vars, floor, strict=True):
        np.testing.assert_array_equal(cell[name], expected)


ACCESS = [
    ("equilibrium_forces", "bearing_forces", "equilibria"),
    ("equilibrium_rotators", "rotators", "equilibria"),
    ("separatrix_forces", "bearing_forces", "separatrix"),
    ("separatrix_rotators", "rotators", "separatrix"),
    ("orbit_forces", "bearing_forces", "orbit"),
    ("orbit_rotators", "rotators", "orbit"),
]


@pytest.mark.parametrize(("group", "method", "on"), ACCESS)
def test_sweeps_equal_the_accessor(group, method, on):
    state = {"phi0": 0.3, "dphi0": 2.0} if on == "orbit" else {}
    swept = pk.sweep(
        DISK, AXES, of=group, **{f"state_{k.removesuffix('0')}": v for k, v in state.items()}
    )
    got = getattr(MAP.phasekit, method)(on=on, **state)
    prefix = {"equilibria": "equilibrium_", "orbit": "orbit_", "separatrix": ""}[on]
    assert list(swept.data_vars) == [prefix + str(name) for name in got.data_vars]
    for name in got.data_vars:
        assert got[name].dims == swept[prefix + str(name)].dims
        np.testing.assert_array_equal(got[name], swept[prefix + str(name)])
        assert got[name].attrs == swept[prefix + str(name)].attrs
    together = pk.sweep(
        DISK,
        AXES,
        of=["phi", group],
        **{f"state_{k.removesuffix('0')}": v for k, v in state.items()},
    )
    np.testing.assert_array_equal(together.phi, MAP.phi)


def test_sweeps_over_states():
    axes = {"beta": [0.5, 0.7], "state_phi": PHI, "state_dphi": [1.0, 2.0]}
    ds = pk.sweep(DISK, axes, of=["bearing_forces", "rotators"])
    assert ds.force_axial.dims == ds.gamma2.dims == ("beta", "state_phi", "state_dphi")
    one = pk.bearing_forces(DISK, PHI[1], 2.0)
    here = ds.sel(beta=0.7, state_phi=PHI[1], state_dphi=2.0)
    np.testing.assert_array_equal(here.force, one.force)
    ds = pk.sweep(
        DISK, beta=[0.5, 0.7], of="fixed_force", state_phi=0.3, state_dphi=2.0, rho_b1=0.4
    )
    one = pk.fixed_bearing_forces(DISK, 0.3, 2.0, rho_b1=0.4)
    np.testing.assert_array_equal(ds.fixed_force.sel(beta=0.7), one.fixed_force)


def test_sweeping_bearings_and_masses():
    ds = pk.sweep(DISK, half_span=[0.1, 0.2], m=[1.0, 2.0], of="separatrix_forces")
    assert ds.peak_force.dims == ("half_span", "m", "saddle", "side", "bearing")
    np.testing.assert_allclose(ds.peak_force.sel(m=2.0), 2 * ds.peak_force.sel(m=1.0), rtol=1e-12)


@pytest.mark.parametrize("method", ["bearing_forces", "rotators"])
@pytest.mark.parametrize(
    "selection",
    [
        {"beta": 0.5},
        {"beta": slice(0.2, 0.5)},
        {"equilibrium": "upper_center"},
        {"equilibrium": ["lower_center", "lower_saddle"]},
        {"saddle": "lower"},
        {"saddle": "upper", "side": "left"},
        {"side": ["right"]},
        {"beta": 0.5, "a": 0.01, "saddle": "lower", "side": "right", "equilibrium": "lower_center"},
    ],
    ids=str,
)
def test_selections_stay_selected(selection, method):
    part = MAP.sel(selection)
    for on in ("equilibria", "separatrix"):
        whole = getattr(MAP.phasekit, method)(on=on)
        here = {d: v for d, v in selection.items() if d in whole.dims}
        want = whole.sel(here)
        got = getattr(part.phasekit, method)(on=on)
        assert got.sizes == want.sizes
        for name in want.data_vars:
            assert got[name].dims == want[name].dims
            np.testing.assert_array_equal(got[name], want[name])
        for dim in here:
            np.testing.assert_array_equal(got[dim], want[dim])


def test_selections_point_by_point():
    points = MAP.sel(
        beta=xr.DataArray([0.2, 0.7], dims="run"), a=xr.DataArray([0.01, 0.024], dims="run")
    )
    got = points.phasekit.bearing_forces(on="separatrix")
    assert got.peak_force.dims == ("run", "saddle", "side", "bearing")
    whole = MAP.phasekit.bearing_forces(on="separatrix")
    np.testing.assert_array_equal(
        got.peak_force.isel(run=1), whole.peak_force.sel(beta=0.7, a=0.024)
    )


def test_replaced_parameters():
    bare = pk.sweep(BARE, AXES)
    with pytest.raises(pk.ParameterError, match="^m: got None"):
        bare.phasekit.bearing_forces()
    with pytest.raises(pk.ParameterError, match="^half_span: got None"):
        bare.phasekit.bearing_forces(m=2.0)
    got = bare.phasekit.bearing_forces(on="separatrix", m=2.0, half_span=0.2)
    want = MAP.phasekit.bearing_forces(on="separatrix")
    np.testing.assert_array_equal(got.peak_force, want.peak_force)
    spans = bare.phasekit.bearing_forces(on="equilibria", m=2.0, half_span=[0.1, 0.2])
    assert set(spans.force_axial.dims) == {"beta", "a", "half_span", "equilibrium"}
    np.testing.assert_array_equal(
        spans.force.sel(half_span=0.2).transpose(*want.dims, ..., missing_dims="ignore"),
        MAP.phasekit.bearing_forces().force.transpose(*want.dims, ..., missing_dims="ignore"),
    )
    slower = MAP.phasekit.rotators(on="separatrix", omega1=20.0)
    alone = pk.sweep(DISK.replace(omega1=20.0), AXES, of="separatrix_rotators")
    np.testing.assert_array_equal(slower.peak_intensity, alone.peak_intensity)
    assert bare.phasekit.rotators().rotator.notnull().any()  # no mass needed


def test_invalid_cells_are_nan():
    ds = pk.sweep(DISK, beta=[-0.1, 0.7, np.nan])
    for on, state in (("equilibria", {}), ("separatrix", {}), ("orbit", {"phi0": 0.3, "dphi0": 1})):
        for method in ("bearing_forces", "rotators"):
            got = getattr(ds.phasekit, method)(on=on, **state)
            for name, variable in got.data_vars.items():
                assert variable.isel(beta=[0, 2]).isnull().all(), (on, name)
            assert next(iter(got.data_vars.values())).isel(beta=1).notnull().any()
    swept = DISK.replace(half_span=[0.2, -0.2], m=[2.0, 0.0])
    at = pk.bearing_forces(swept, 0.3, 1.0)
    for variable in at.data_vars.values():
        assert variable.sel(half_span=-0.2).isnull().all(), variable.name
        assert variable.sel(m=0.0).isnull().all(), variable.name
        assert variable.sel(half_span=0.2, m=2.0).notnull().all(), variable.name
    states = pk.bearing_forces(DISK, [0.3, np.nan, np.inf], 1.0)
    for variable in states.data_vars.values():
        assert variable.isel(point=0).notnull().all()
        assert variable.isel(point=[1, 2]).isnull().all(), variable.name
    fixed = pk.fixed_bearing_forces(DISK, 0.3, 1.0, rho_b1=[0.4, 0.0])
    assert fixed.fixed_force.isel(point=1).isnull().all()
    turning = pk.rotators(DISK, [0.3, np.nan], [1.0, 2.0])
    for variable in turning.data_vars.values():
        if variable.name not in ("rotator", "rotator_intensity", "hodograph_v"):
            assert variable.isel(point=1).isnull().all(), variable.name


# --- stored and lazy ---------------------------------------------------------------------------


@pytest.mark.parametrize("suffix", [".zarr", ".nc"])
def test_on_a_stored_map(suffix, tmp_path):
    pytest.importorskip("zarr" if suffix == ".zarr" else "h5netcdf")
    path = tmp_path / f"map{suffix}"
    pk.sweep(DISK, AXES, store=path)
    with pk.open_map(path) as stored:
        for on in ("equilibria", "separatrix"):
            for method in ("bearing_forces", "rotators"):
                want = getattr(MAP.phasekit, method)(on=on)
                got = getattr(stored.phasekit, method)(on=on)
                assert_same_bits(want, got.load())
        cell = stored.sel(beta=0.5, a=0.01, saddle="lower")
        got = cell.phasekit.bearing_forces(on="separatrix").peak_force
        np.testing.assert_array_equal(
            got,
            MAP.phasekit.bearing_forces(on="separatrix").peak_force.sel(
                beta=0.5, a=0.01, saddle="lower"
            ),
        )


def test_loads_are_stored_themselves(tmp_path):
    pytest.importorskip("zarr")
    path = tmp_path / "loads.zarr"
    ds = pk.sweep(DISK, AXES, of=["separatrix_forces", "equilibrium_forces"], store=path)
    with pk.open_map(path) as back:
        assert_same_bits(ds, back.load())
        assert back.phasekit.system() == DISK.replace(**AXES)


@pytest.mark.parametrize("chunks", [{"beta": 1, "a": 2}, {"beta": 3, "a": 4}, {"a": 1}])
@pytest.mark.parametrize(("group", "method", "on"), ACCESS)
def test_lazy_maps_stay_lazy_and_give_the_same_bits(group, method, on, chunks):
    pytest.importorskip("dask")
    state = {"phi0": 0.3, "dphi0": 2.0} if on == "orbit" else {}
    lazy = getattr(MAP.chunk(chunks).phasekit, method)(on=on, **state)
    for variable in lazy.data_vars.values():
        assert variable.chunks is not None, variable.name
    assert_same_bits(getattr(MAP.phasekit, method)(on=on, **state), lazy.compute())
    sizes = dict(zip(lazy[next(iter(lazy))].dims, lazy[next(iter(lazy))].chunks, strict=True))
    for dim, size in chunks.items():
        assert max(sizes[dim]) <= size
    assert group in pk.quantities().groups


def test_lazy_states():
    pytest.importorskip("dask")
    phi = xr.DataArray(np.linspace(-3, 3, 20), dims="x")
    for function in (pk.rotators, pk.bearing_forces):
        eager, lazy = function(DISK, phi, 1.5), function(DISK, phi.chunk(x=6), 1.5)
        assert all(variable.chunks is not None for variable in lazy.data_vars.values())
        assert_same_bits(eager, lazy.compute())


def test_lazy_selections():
    pytest.importorskip("dask")
    lazy = MAP.chunk(beta=1).isel(a=2, saddle=0)
    got = lazy.phasekit.bearing_forces(on="separatrix")
    assert got.peak_force.chunks is not None
    want = MAP.phasekit.bearing_forces(on="separatrix").isel(a=2, saddle=0)
    np.testing.assert_array_equal(got.peak_force.compute(), want.peak_force)


# --- the table ---------------------------------------------------------------------------------


def test_groups_of_the_table_are_the_fields_of_the_floor():
    for group, fields in (
        ("rotators", rotators_floor.Rotators._fields),
        ("bearing_forces", bearings_floor.BearingForces._fields),
        ("fixed_bearing_forces", bearings_floor.FixedBearingForces._fields),
    ):
        assert tuple(row.name for row in select(group)) == fields
    assert len(select("separatrix_forces")) == len(loads_floor.Loads._fields)


def test_each_force_says_on_whom_it_acts():
    """And readers of the papers find their kinetic pressures."""
    for name, row in ROWS.items():
        if row.units == "N" and "component" not in name and row.group.endswith("forces"):
            assert "on the rotor" in row.long_name or "in the bearing" in row.long_name, name
    for name in ("force_kinetic", "fixed_force_kinetic", "equilibrium_force_kinetic"):
        assert "kinetic pressure" in ROWS[name].long_name
