"""Orbits by state, energy and gap; action and angle; families of orbits."""

import numpy as np
import pytest
import xarray as xr
from scipy.special import ellipe, ellipk

import phasekit as pk
from phasekit.labels.coordinates import LABELS, STATES
from phasekit.laws.ladder import Standing
from phasekit.laws.trigonometric import Trigonometric
from phasekit.phase.exact import action_angle as angle_floor
from phasekit.phase.exact import orbits as floor
from phasekit.table.quantities import ROWS, TABLE, select

C = pk.Coefficients(4.3, 1.2, 0.7)  # figure-eight
SINGLE = pk.Coefficients(0.4, 1.2, 0.7)  # one saddle
HETEROCLINIC = pk.Coefficients(2.0, 0.0, 1.0)
DISK = pk.GyroRotorDisk(beta=0.3, e=0.0115, a=0.02, r=0.21, omega1=2.5)
PENDULUM = pk.Pendulum(length=0.5, g=10.0)
ORBITS = [
    "orbit_kind",
    "orbit_energy",
    "period",
    "frequency",
    "action",
    "phi_min",
    "phi_max",
    "amplitude",
]
ANGLES = ["frequency", "action", "orbit_family", "angle", "twist"]
PHI, DPHI = np.linspace(-3, 3, 7), np.linspace(-6.0, 6.0, 7)


def attrs_equal(left, right):
    assert left.keys() == right.keys()
    for key, value in left.items():
        np.testing.assert_array_equal(value, right[key])


# ------------------------------------------------------------------------------ by state


def test_orbits_are_those_of_the_array_floor():
    ds = pk.orbits(C, PHI, DPHI)
    assert list(ds.data_vars) == ORBITS
    for name, expected in floor.orbits(*C, PHI, DPHI)._asdict().items():
        np.testing.assert_array_equal(ds[name], expected)
        assert ds[name].dims == ("point",)
        assert ds[name].dtype == ROWS[name].dtype
        attrs_equal(ds[name].attrs, ROWS[name].attrs)
    np.testing.assert_array_equal(ds.state_phi, PHI)
    assert ds.state_phi.attrs == {"long_name": "angle of the state", "units": "rad"}
    assert ds.state_dphi.attrs["units"] == "s-1"


def test_orbits_of_a_pendulum():
    k = np.sin(0.5 * np.array([0.1, 1.0, 3.0]))
    ds = pk.orbits(PENDULUM, [0.1, 1.0, 3.0], 0.0)
    root = np.sqrt(20.0)
    np.testing.assert_allclose(ds.period, 4 * ellipk(k**2) / root, rtol=1e-12)
    action = 8 / np.pi * root * (ellipe(k**2) - (1 - k**2) * ellipk(k**2))
    np.testing.assert_allclose(ds.action, action, rtol=1e-10)
    assert (ds.orbit_kind == pk.OrbitKind.LIBRATION).all()


def test_dims_of_orbits():
    assert pk.orbits(DISK, 0.1, 0.2).period.dims == ()
    assert pk.orbits(DISK, 0.1, [0.2]).period.dims == ("point",)
    assert pk.orbits(DISK.replace(beta=[0.1, 0.2]), PHI, 0.0).period.dims == ("beta", "point")
    phi = xr.DataArray([0.0, 1.0], dims="start", coords={"start": ["a", "b"]})
    dphi = xr.DataArray([0.0, 1.0, 2.0], dims="push")
    ds = pk.orbits(DISK, phi, dphi)
    assert ds.action.dims == ("start", "push")
    alone = pk.orbits(DISK, 1.0, 2.0)
    assert ds.action.sel(start="b").isel(push=2).item() == alone.action.item()
    path = pk.orbits(DISK.replace(beta=[0.1, 0.2]), xr.DataArray([0.3, 0.4], dims="beta"), 0.0)
    assert path.period.dims == ("beta",)


def test_equilibria_and_separatrices_are_orbits():
    eq = pk.equilibria(C)
    ds = pk.orbits(C, eq.phi, 0.0)
    assert ds.period.dims == ("equilibrium",)
    centers = ["lower_center", "upper_center"]
    np.testing.assert_allclose(
        ds.frequency.sel(equilibrium=centers),
        eq.natural_frequency.sel(equilibrium=centers),
        rtol=1e-7,
    )
    free = pk.orbits(pk.Coefficients(0.0, 0.0, 0.0), 1.0, [0.0, -2.0])
    assert free.orbit_kind.values.tolist() == [pk.OrbitKind.EQUILIBRIUM, pk.OrbitKind.ROTATION]
    np.testing.assert_allclose(free.period.values[1], np.pi)
    np.testing.assert_allclose(free.action.values[1], 2.0)


def test_energy_is_the_integral_and_frequency_its_derivative():
    ds = pk.orbits(C, 0.5, [1.0, 4.0])
    np.testing.assert_allclose(ds.orbit_energy, pk.energy(C, 0.5, [1.0, 4.0]).energy_integral)
    h = ds.orbit_energy.values
    low, high = pk.orbits(C, energy=h - 1e-4), pk.orbits(C, energy=h + 1e-4)
    slope = 2e-4 / (high.action - low.action)
    np.testing.assert_allclose(slope, ds.frequency, rtol=1e-6)


# ------------------------------------------------------------------------------ by energy and gap


@pytest.mark.parametrize("center", [None, "lower_center", "upper_center"])
def test_orbits_at_an_energy(center):
    number = int(center == "upper_center")
    h = pk.equilibria(C).energy.values[[0, 2]][number] + np.array([-0.1, 0.1, 0.3, 20.0])
    ds = pk.orbits(C, energy=h, center=center)
    for name, expected in floor.orbits_at_energy(*C, h, number)._asdict().items():
        np.testing.assert_array_equal(ds[name], expected)
    assert ds.orbit_kind.values[0] == pk.OrbitKind.NOT_COMPUTED
    assert ds.period.isnull().values.tolist() == [True, False, False, False]
    assert ds.orbit_kind.values[-1] == pk.OrbitKind.ROTATION
    assert ds.period.attrs["center"] == (center or "lower_center")
    assert ds.state_energy.attrs["units"] == "s-2"
    assert "center" not in ROWS["period"].attrs


def test_an_orbit_at_an_energy_is_that_through_its_turning_point():
    ds = pk.orbits(C, energy=0.5)
    through = pk.orbits(C, ds.phi_max, 0.0)
    np.testing.assert_allclose(through.period, ds.period, rtol=1e-9)
    np.testing.assert_allclose(through.action, ds.action, rtol=1e-9)


def test_orbits_at_a_gap():
    gap = [-0.1, -1e-30, 1e-30, 0.1]
    for saddle, s in (("lower", 0), ("upper", 1)):
        for side, i in (("left", 0), ("right", 1)):
            ds = pk.orbits(C, gap=gap, saddle=saddle, side=side)
            for name, expected in floor.orbits_at_gap(*C, gap, s, i)._asdict().items():
                np.testing.assert_array_equal(ds[name], expected)
            assert ds.period.attrs["saddle"] == saddle
            assert ds.period.attrs["side"] == side
    assert ds.state_gap.attrs == {
        "long_name": "energy of the state above the saddle",
        "units": "s-2",
    }


def test_the_saddle_by_default_is_that_of_the_eight_or_the_only_one():
    mixed = pk.Coefficients([0.4, 4.3], 1.2, 0.7)
    ds = pk.orbits(mixed, gap=xr.DataArray([-1e-9, 1e-9], dims="gap"))
    for A, saddle in ((0.4, "upper"), (4.3, "lower")):
        alone = pk.orbits(mixed.replace(A=A), gap=[-1e-9, 1e-9], saddle=saddle)
        for name in ORBITS:
            np.testing.assert_array_equal(ds[name].sel(A=A), alone[name])
    absent = pk.orbits(SINGLE, gap=-0.1, saddle="lower")
    assert absent.orbit_kind.item() == pk.OrbitKind.NOT_COMPUTED
    assert absent.period.isnull()


# ------------------------------------------------------------------------------ action and angle


def test_action_and_angle_are_those_of_the_array_floor():
    ds = pk.action_angle(C, PHI, DPHI)
    assert list(ds.data_vars) == [name for name in ROWS if name in ANGLES]
    for name, expected in angle_floor.action_angle(*C, PHI, DPHI)._asdict().items():
        np.testing.assert_array_equal(ds[name], expected)
        attrs_equal(ds[name].attrs, ROWS[name].attrs)
    assert ds.orbit_family.dtype == np.int8
    assert ds.orbit_family.attrs["flag_meanings"].split()[-1] == "backward"
    assert ((ds.angle >= 0) & (ds.angle < 2 * np.pi)).all()
    orbit = pk.orbits(C, PHI, DPHI)
    for name in ("action", "frequency"):
        xr.testing.assert_identical(ds[name], orbit[name])


def test_the_angle_grows_at_the_frequency():
    start = pk.action_angle(C, PHI, DPHI)
    moved = pk.flow(C, PHI, DPHI, 0.7)
    later = pk.action_angle(C, moved.motion_phi, moved.motion_dphi)
    turn = (later.angle - start.angle - 0.7 * start.frequency) / (2 * np.pi)
    np.testing.assert_allclose(turn, np.rint(turn), atol=1e-9)
    np.testing.assert_allclose(later.action, start.action, rtol=1e-10)
    np.testing.assert_array_equal(later.orbit_family, start.orbit_family)


def test_states_come_back():
    system = DISK.replace(beta=[0.1, 0.3])
    to = pk.action_angle(system, PHI, DPHI)
    back = pk.state_of(system, to.action, to.angle, to.orbit_family)
    assert back.phi_of_angle.dims == ("beta", "point")
    assert back.phi_of_angle.attrs["units"] == "rad"
    assert back.dphi_of_angle.attrs["units"] == "s-1"
    turns = (back.phi_of_angle - PHI) / (2 * np.pi)
    np.testing.assert_allclose(turns, np.rint(turns), atol=1e-9)
    np.testing.assert_allclose(back.dphi_of_angle, np.broadcast_to(DPHI, (2, 7)), atol=1e-8)
    assert back.state_action.dims == ("beta", "point")
    assert back.state_family.attrs["units"] == "1"


def test_twist_is_the_slope_of_the_frequency():
    ds = pk.action_angle(C, [0.5, 0.5], [0.3, 6.0])
    for i, family in enumerate(("lower_well", "forward")):
        near = [ds.action.values[i] - 1e-5, ds.action.values[i] + 1e-5]
        states = pk.state_of(C, near, 0.5, family)
        low, high = pk.orbits(C, states.phi_of_angle, states.dphi_of_angle).frequency.values
        np.testing.assert_allclose((high - low) / 2e-5, ds.twist.values[i], rtol=1e-5)


def test_families_by_name_and_by_code():
    names, codes = ["lower_well", "upper_well", "forward"], [1, 2, 4]
    expected = pk.state_of(C, 0.1, 0.5, codes)
    for given in (
        names,
        tuple(names),
        np.array(names),
        np.array(names, np.dtypes.StringDType()),
        np.array(codes, np.int8),
        [pk.OrbitFamily(code) for code in codes],
        [1.0, 2.0, 4.0],
    ):
        xr.testing.assert_identical(pk.state_of(C, 0.1, 0.5, given), expected)
    one = pk.state_of(C, 0.1, 0.5, "upper_well")
    for given in (2, pk.OrbitFamily.UPPER_WELL, np.int8(2), xr.DataArray(2)):
        xr.testing.assert_identical(pk.state_of(C, 0.1, 0.5, given), one)
    labels = xr.DataArray(names, dims="family", coords={"family": names})
    ds = pk.state_of(C, 0.1, 0.5, labels)
    np.testing.assert_array_equal(ds.phi_of_angle.sel(family=names), expected.phi_of_angle)
    scalar = pk.state_of(C, 0.1, 0.5, labels[1])
    assert scalar.phi_of_angle.item() == one.phi_of_angle.item()


def test_states_that_do_not_exist_are_nan():
    wrong = pk.state_of(C, 0.1, 0.5, [1, 0, 7, 1.5, np.nan, -1])
    assert wrong.phi_of_angle.notnull().values.tolist() == [True] + 5 * [False]
    ds = pk.state_of(C, [0.1, -0.1, 1e9, np.nan], 0.5, "lower_well")
    assert ds.phi_of_angle.notnull().values.tolist() == [True, False, False, False]
    assert pk.state_of(SINGLE, 0.1, 0.5, "upper_well").phi_of_angle.isnull()


# ------------------------------------------------------------------------------ families


@pytest.mark.slow
@pytest.mark.parametrize("system", [C, HETEROCLINIC, SINGLE, pk.Coefficients(-3.0, 0.3, -0.4)])
def test_families_are_orbits_at_their_energies(system):
    ds = pk.orbit_families(system, 40)
    assert list(ds.data_vars) == ["energy_level", "period", "frequency", "action"]
    assert ds.period.dims == ("family", "level")
    assert ds.family.values.tolist() == list(LABELS["family"][0])
    assert ds.level.attrs["units"] == "1"
    eq = pk.equilibria(system)
    saddles = eq.energy.where(eq.kind == pk.EquilibriumKind.SADDLE).dropna("equilibrium")
    two, split = len(saddles) == 2, saddles.max() - saddles.min() > 0
    present = ds.period.notnull().all("level")
    assert present.values.tolist() == [True, two, bool(two and split), True]
    assert (ds.period.notnull() == ds.energy_level.notnull()).all()
    assert (ds.energy_level.where(present, drop=True).diff("level") > 0).all()
    assert (ds.action.where(present, drop=True).diff("level") > 0).all()
    for family, center in (("lower_well", 0), ("upper_well", 1), ("outer", 0), ("rotation", 0)):
        part = ds.sel(family=family).isel(level=slice(4, -4))
        expected = floor.orbits_at_energy(*system, part.energy_level.values, center)
        if present.sel(family=family):
            for name in ("period", "frequency", "action"):
                np.testing.assert_allclose(part[name], getattr(expected, name), rtol=1e-9)
            kind = pk.OrbitKind.ROTATION if family == "rotation" else pk.OrbitKind.LIBRATION
            assert (expected.orbit_kind == kind).all()


def test_families_reach_the_separatrices_and_centers():
    ds = pk.orbit_families(C)
    eq, sep = pk.equilibria(C), pk.separatrices(C)
    assert ds.sizes["level"] == 200
    assert ((0 < ds.level) & (ds.level < 1)).all()
    low = eq.natural_frequency.sel(equilibrium=["lower_center", "upper_center"])
    np.testing.assert_allclose(ds.frequency[:2, 0], low, rtol=0.02)
    lobes = np.sort(sep.lobe_area.sel(saddle="lower").values)
    np.testing.assert_allclose(np.sort(ds.action[:2, -1]) * 2 * np.pi, lobes, rtol=1e-7)
    np.testing.assert_allclose(ds.action[2, 0] * 2 * np.pi, lobes.sum(), rtol=1e-7)
    np.testing.assert_allclose(
        ds.action[3, 0] * 2 * np.pi, sep.winding_area.sel(saddle="upper"), rtol=1e-7
    )
    assert ds.energy_level[3, -1] < 2 * eq.energy[3] - eq.energy[0]
    top = pk.orbit_families(C, 10, energy_max=50.0).energy_level.sel(family="rotation")
    assert 40 < top[-1] < 50
    assert pk.orbit_families(C, 3, energy_max=-50.0).period.sel(family="rotation").isnull().all()
    assert pk.orbit_families(pk.Coefficients(0.0, 0.0, 0.0), 3).period.isnull().all()


def test_families_over_parameters():
    beta = [0.1, 0.7, 1.5, -1.0]
    ds = pk.orbit_families(DISK.replace(beta=beta), 11)
    assert ds.action.dims == ("beta", "family", "level")
    for value in beta[:3]:
        alone = pk.orbit_families(DISK.replace(beta=value), 11)
        for name in ds.data_vars:
            np.testing.assert_array_equal(ds[name].sel(beta=value), alone[name])
    for name in ds.data_vars:
        assert ds[name].sel(beta=-1.0).isnull().all()
        assert ds[name].attrs == ROWS[name].attrs


# ------------------------------------------------------------------------------ table, sweep, lazy


def test_rows_and_fields_of_the_floor_below_are_the_same():
    for group, fields in (
        ("orbits", floor.Orbits._fields), ("action_angle", angle_floor.Angles._fields),
    ):  # fmt: skip
        # besides, there are rows of systems under a torque alone
        rows = [row.name for row in select(group) if Standing(Trigonometric).is_within(row.of)]
        assert rows == list(fields)
    assert [p.groups for p in TABLE.plan(select("orbits"))] == [("orbits",)]
    for of in ("angle", ["angle", "twist"], ["angle", "period"]):
        assert [p.groups for p in TABLE.plan(select(of))] == [("orbits", "action_angle")]


def test_orbits_in_a_sweep():
    axes = {"beta": [0.1, 0.3], "state_phi": [0.0, 0.5, 1.0], "state_dphi": [0.1, 9.0]}
    ds = pk.sweep(DISK, axes, of="orbits")
    assert list(ds.data_vars) == ORBITS
    assert ds.period.dims == ("beta", "state_phi", "state_dphi")
    assert ds.indexes.keys() == axes.keys()
    assert ds.state_dphi.attrs["units"] == "s-1"
    cell = ds.sel(beta=0.3, state_phi=0.5, state_dphi=9.0)
    xr.testing.assert_identical(cell, pk.orbits(DISK, 0.5, 9.0))
    assert cell.phasekit.system() == DISK
    few = pk.sweep(DISK, axes, of=["period", "action"])
    xr.testing.assert_identical(few, ds[["period", "action"]])
    more = pk.sweep(DISK, axes, of=["period", "twist", "topology"])
    xr.testing.assert_equal(more.period, ds.period)
    assert more.topology.dims == ("beta",)
    assert set(pk.sweep(DISK, axes, of="action_angle").data_vars) == {
        "orbit_family",
        "angle",
        "twist",
    }


def test_limits_and_states_in_a_sweep():
    axes = {"state_action": [0.01, 0.1], "state_angle": [0.0, 1.0], "state_family": [1, 2]}
    ds = pk.sweep(C, axes, of="state_of")
    alone = pk.state_of(C, 0.1, 1.0, "upper_well")
    cell = ds.sel(state_action=0.1, state_angle=1.0, state_family=2)
    xr.testing.assert_identical(cell, alone)
    ds = pk.sweep(C, A=[1.0, 4.3], state_gap=[-1e-9, 1e-9], of="near_separatrix")
    assert ds.near_separatrix_period.dims == ("A", "state_gap", "saddle")


@pytest.mark.slow
@pytest.mark.parametrize("store", ["map.zarr", "map.nc"])
def test_orbits_are_stored_and_come_back(tmp_path, store):
    pytest.importorskip("h5netcdf")
    path = tmp_path / store
    ds = pk.sweep(
        DISK, state_phi=[0.0, 1.0], state_dphi=[0.0], of=["orbits", "action_angle"], store=path
    )
    again = pk.open_map(path).load()
    xr.testing.assert_identical(ds, again)
    assert again.orbit_family.attrs["flag_values"].dtype == np.int8


def lazy(name, values, chunk):
    return xr.DataArray(values, dims=name).chunk({name: chunk})


def assert_same_bits(left, right):
    xr.testing.assert_identical(left, right)
    for name in left.variables:
        assert left[name].dtype == right[name].dtype
        if left[name].dtype == float:
            np.testing.assert_array_equal(
                left[name].values.view("i8"), right[name].values.view("i8")
            )


LAZY = {
    "orbits": lambda s, x, y: pk.orbits(s, x, y),
    "energy": lambda s, x, y: pk.orbits(s, energy=x, center="upper_center"),
    "gap": lambda s, x, y: pk.orbits(s, gap=x),
    "action_angle": lambda s, x, y: pk.action_angle(s, x, y),
    "state_of": lambda s, x, y: pk.state_of(s, x, y, "lower_well"),
    "families": lambda s, x, y: pk.orbit_families(s, 7),
    "near_center": lambda s, x, y: pk.near_center(s, x),
    "near_separatrix": lambda s, x, y: pk.near_separatrix(s, x),
    "flow": lambda s, x, y: pk.flow(s, x, y, np.linspace(0, 5, 6)),
    "flow times": lambda s, x, y: pk.flow(s, 0.3, x, y),
    "separatrix_motion": lambda s, x, y: pk.separatrix_motion(s, x),
}


@pytest.mark.slow
@pytest.mark.parametrize("call", LAZY.values(), ids=list(LAZY))
def test_lazy_equals_eager(call):
    pytest.importorskip("dask")
    beta = np.linspace(-0.1, 1.5, 7)
    x, y = np.linspace(-2.0, 2.0, 5), np.linspace(0.0, 9.0, 4)
    x[1] = np.nan
    eager = call(DISK.replace(beta=beta), xr.DataArray(x, dims="x"), xr.DataArray(y, dims="y"))
    chunked = call(DISK.replace(beta=lazy("beta", beta, 3)), lazy("x", x, 2), lazy("y", y, 3))
    for variable in chunked.data_vars.values():
        assert variable.chunks is not None
    assert_same_bits(eager, chunked.compute())
    mixed = call(DISK.replace(beta=lazy("beta", beta, 3)), xr.DataArray(x, dims="x"), 1.0)
    assert all(variable.chunks is not None for variable in mixed.data_vars.values())


def test_states_of_tiles_and_threads(monkeypatch):
    from phasekit.labels import grid

    axes = {"beta": np.linspace(0.0, 1.5, 5), "state_phi": PHI, "state_dphi": DPHI}
    of = ["orbits", "action_angle"]
    whole = pk.sweep(DISK, axes, of=of)
    monkeypatch.setattr(grid.tiles, "__defaults__", (17,))
    xr.testing.assert_identical(pk.sweep(DISK, axes, of=of), whole)


def test_results_merge():
    parts = [
        pk.equilibria(DISK),
        pk.separatrices(DISK),
        pk.energy(DISK, 0.5, 1.5),
        pk.orbits(DISK, 0.5, 1.5),
        pk.action_angle(DISK, 0.5, 1.5),
        pk.flow(DISK, 0.5, 1.5, [0.0, 1.0]),
        pk.state_of(DISK, 0.1, 0.5, "lower_well"),
        pk.near_center(DISK, 0.1),
        pk.near_separatrix(DISK, 0.1),
    ]
    ds = xr.merge(parts, compat="identical", join="exact")
    assert len(ds.data_vars) == 18 + 1 + 8 + 3 + 2 + 2 + 2 + 1
    assert ds.phasekit.system() == DISK


# ------------------------------------------------------------------------------ what is wrong


@pytest.mark.parametrize("value", [np.nan, np.inf, -np.inf])
def test_invalid_cells_of_states_are_flagged(value):
    for ds in (
        pk.orbits(C, [0.3, value], 1.0),
        pk.orbits(C, 0.3, [1.0, value]),
        pk.orbits(C, energy=[1.0, value]),
        pk.orbits(C, gap=[0.1, value]),
        pk.action_angle(C, [0.3, value], 1.0),
        pk.action_angle(C, 0.3, [1.0, value]),
        pk.orbits(C.replace(A=xr.DataArray([4.0, value], dims="point")), 0.3, 1.0),
        pk.action_angle(C.replace(A=xr.DataArray([4.0, value], dims="point")), 0.3, 1.0),
    ):
        for name, variable in ds.data_vars.items():
            if variable.dtype == np.int8:
                assert variable.values[1] == -1, name
                assert variable.values[0] > 0
            else:
                assert np.isnan(variable.values[1]), name
    for states in ([0.1, value], 0.5), (0.1, [0.5, value]):
        assert np.isnan(pk.state_of(C, *states, "lower_well").phi_of_angle.values[1])


FUNCTIONS = {
    "orbits": (pk.orbits, {"phi0": 0.3, "dphi0": 0.2}),
    "energy": (pk.orbits, {"energy": 1.0}),
    "gap": (pk.orbits, {"gap": 1.0}),
    "action_angle": (pk.action_angle, {"phi": 0.3, "dphi": 0.2}),
    "state_of": (pk.state_of, {"action": 0.1, "angle": 0.2, "family": "lower_well"}),
    "flow": (pk.flow, {"phi0": 0.3, "dphi0": 0.2, "t": 1.0}),
    "separatrix_motion": (pk.separatrix_motion, {"t": 1.0}),
    "near_center": (pk.near_center, {"energy": 0.1}),
    "near_separatrix": (pk.near_separatrix, {"gap": 0.1}),
}
STATES_OF = [(key, name) for key, (_, given) in FUNCTIONS.items() for name in given]
WRONG = [True, "three", 1j, np.nan, np.inf, [], [[0.1, 0.2]], np.ones((2, 2)), [None], {}]
WRONG += [object, xr.DataArray([True]), xr.DataArray(np.nan), ["a"], [0.1, True]]


@pytest.mark.slow
@pytest.mark.parametrize(("key", "name"), STATES_OF)
@pytest.mark.parametrize("wrong", WRONG, ids=repr)
def test_wrong_states(key, name, wrong):
    function, given = FUNCTIONS[key]
    with pytest.raises(pk.ParameterError, match=rf"^{name}: got .*, wants "):
        function(C, **{**given, name: wrong})


@pytest.mark.parametrize("key", FUNCTIONS)
@pytest.mark.parametrize("wrong", [None, 3.0, "disk", pk.GyroRotorDisk, {}])
def test_wrong_systems(key, wrong):
    function, given = FUNCTIONS[key]
    with pytest.raises(pk.ParameterError, match=r"^system: got .*, wants one of Coefficients"):
        function(wrong, **given)


WRONG_CALLS = [
    ({}, "^phi0: got nothing, wants a state"),
    ({"phi0": 0.1}, "^dphi0: got None, wants a real"),
    ({"dphi0": 0.1}, "^phi0: got None, wants a real"),
    ({"phi0": 0.1, "dphi0": 0.1, "energy": 1.0}, "^energy: got it besides phi0 and dphi0"),
    ({"phi0": 0.1, "gap": 1.0}, "^gap: got it besides phi0"),
    ({"energy": 0.1, "gap": 1.0}, "^gap: got it besides energy"),
    ({"energy": 0.1, "center": "center"}, "^center: got 'center', wants one of lower_center, "),
    ({"energy": 0.1, "center": 0}, "^center: got 0, wants one of"),
    ({"energy": 0.1, "saddle": "lower"}, "^saddle: got 'lower', wants it with gap="),
    ({"energy": 0.1, "side": "left"}, "^side: got 'left', wants it with gap="),
    ({"gap": 0.1, "center": "lower_center"}, "^center: got 'lower_center', wants it with energy="),
    ({"gap": 0.1, "saddle": "lower_saddle"}, "^saddle: got 'lower_saddle', wants one of lower, "),
    ({"gap": 0.1, "side": "up"}, "^side: got 'up', wants one of left, right"),
    ({"gap": 0.1, "side": None}, "^side: got None"),
    ({"phi0": 0.1, "dphi0": 0.1, "center": "lower_center"}, "^center: got"),
    ({"phi0": [0.1], "dphi0": [0.1, 0.2]}, "^phi0, dphi0: got 1 values of phi0 and 2 values"),
    (
        {"phi0": xr.DataArray([1.0], dims="s"), "dphi0": xr.DataArray([1.0, 2.0], dims="s")},
        "^dphi0: got 2 values along 's', wants 1 as phi0 has",
    ),
    ({"phi0": xr.DataArray([1.0], dims="period"), "dphi0": 0.0}, "^dim 'period': .*rename"),
]


@pytest.mark.parametrize(("given", "message"), WRONG_CALLS)
def test_wrong_calls_of_orbits(given, message):
    with pytest.raises(pk.ParameterError, match=message):
        pk.orbits(C, **given)


@pytest.mark.parametrize(
    "family", ["none", "well", "", 0, 6, 1.5, -1, ["lower_well", "well"], [["outer"]], ["outer", 1]]
)
def test_wrong_families(family):
    with pytest.raises(pk.ParameterError, match="^family: got .*, wants "):
        pk.state_of(C, 0.1, 0.2, family)


@pytest.mark.parametrize(
    ("given", "message"),
    [
        ({"n": 0}, "^n: got 0, wants a number of orbits >= 1"),
        ({"n": 2.0}, "^n: got 2.0"),
        ({"n": True}, "^n: got True"),
        ({"n": None}, "^n: got None"),
        ({"energy_max": np.nan}, "^energy_max: got nan, wants a finite"),
        ({"energy_max": [1.0]}, r"^energy_max: got \[1.0\], wants one number"),
        ({"energy_max": "one"}, "^energy_max: got 'one'"),
    ],
)
def test_wrong_arguments_of_families(given, message):
    with pytest.raises(pk.ParameterError, match=message):
        pk.orbit_families(C, **given)


@pytest.mark.parametrize("dim", ["family", "level"])
def test_dims_that_families_have_are_refused(dim):
    with pytest.raises(pk.ParameterError, match=rf"'{dim}'.*rename"):
        pk.orbit_families(C.replace(A=xr.DataArray([1.0, 2.0], dims=dim)), 2)


def test_states_that_a_sweep_lacks_are_named():
    with pytest.raises(pk.ParameterError, match="state_dphi: got nothing.*give state_dphi="):
        pk.sweep(C, A=[1.0], state_phi=[0.1], of="orbits")
    with pytest.raises(pk.ParameterError, match="time: got nothing, .*give time="):
        pk.sweep(C, A=[1.0], state_phi=[0.1], state_dphi=[0.1], of="motion")
    with pytest.raises(pk.ParameterError, match=r"call pk\.orbit_families"):
        pk.sweep(C, A=[1.0], of="energy_level")
    assert "energy_level" not in pk.quantities()
    assert set(STATES) >= {"time", "level", "state_family"}


def test_orbits_and_angles_agree_to_the_bit():
    """A quantity does not depend on what else is asked for."""
    rng = np.random.default_rng(5)
    phi, dphi = rng.uniform(-3, 3, 200), rng.normal(size=200)
    xr.merge([pk.orbits(C, phi, dphi), pk.action_angle(C, phi, dphi)], compat="identical")


def test_gap_of_a_fold_has_no_saddle():
    fold = pk.Coefficients(125.0, 27.0, 64.0)
    ds = pk.orbits(fold, gap=-1.0, saddle="lower")
    assert ds.orbit_kind == pk.OrbitKind.NOT_COMPUTED
    assert np.isnan(ds.period)
