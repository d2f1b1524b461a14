"""Motions: states after times, and on separatrices."""

import numpy as np
import pytest
import xarray as xr
from scipy.integrate import solve_ivp

import phasekit as pk
from phasekit.phase.exact import flow as floor
from phasekit.table.quantities import ROWS, select

C = pk.Coefficients(4.3, 1.2, 0.7)
SINGLE = pk.Coefficients(0.4, 1.2, 0.7)
DISK = pk.GyroRotorDisk(beta=0.3, e=0.0115, a=0.02, r=0.21, omega1=2.5)
PHI, DPHI = [-2.0, 0.3, 1.0], [0.5, -6.0, 0.0]
T = np.linspace(-1.0, 4.0, 6)


def test_flow_is_that_of_the_array_floor():
    ds = pk.flow(C, PHI, DPHI, T)
    assert list(ds.data_vars) == ["motion_phi", "motion_dphi"]
    expected = floor.flow(*C, np.array(PHI)[:, None], np.array(DPHI)[:, None], T)
    for name, values in expected._asdict().items():
        assert ds[name].dims == ("point", "time")
        np.testing.assert_array_equal(ds[name], values)
        assert ds[name].attrs == ROWS[name].attrs
    assert ds.motion_phi.attrs["units"] == "rad"
    assert ds.motion_dphi.attrs["units"] == "s-1"
    np.testing.assert_array_equal(ds.time, T)
    assert ds.time.attrs == {"long_name": "time", "units": "s"}
    assert "time" in ds.indexes
    assert ds.state_phi.dims == ("point",)
    assert [row.name for row in select("motion")] == list(floor.Motion._fields)


@pytest.mark.slow
def test_flow_solves_the_equation_of_motion():
    def rates(_, state):
        return state[1], -pk.gradient(C, state[0]).potential_gradient.item()

    ds = pk.flow(C, 0.3, -6.0, [1.0, 2.0])
    run = solve_ivp(rates, (0, 2), (0.3, -6.0), t_eval=(1.0, 2.0), rtol=1e-9, atol=1e-10)
    np.testing.assert_allclose(ds.motion_phi, run.y[0], rtol=1e-6)
    np.testing.assert_allclose(ds.motion_dphi, run.y[1], rtol=1e-6)


def test_flow_keeps_the_energy_and_has_the_period():
    ds = pk.flow(C, PHI, DPHI, T)
    after = pk.energy(C, ds.motion_phi, ds.motion_dphi)
    before = pk.energy(C, PHI, DPHI)
    np.testing.assert_allclose(
        after.energy_integral, np.repeat(before.energy_integral.values[:, None], 6, 1), rtol=1e-12
    )
    orbit = pk.orbits(C, PHI, DPHI)
    round_ = pk.flow(C, PHI, DPHI, orbit.period)  # pairs by name: one time for each state
    assert round_.motion_phi.dims == ("point",)
    assert round_.time.dims == ("point",)
    np.testing.assert_allclose(round_.motion_dphi, DPHI, atol=1e-9)


def test_dims_of_flow():
    assert pk.flow(DISK, 0.1, 0.2, 1.0).motion_phi.dims == ()
    assert pk.flow(DISK, 0.1, 0.2, [1.0]).motion_phi.dims == ("time",)
    assert pk.flow(DISK, PHI, 0.2, 1.0).motion_phi.dims == ("point",)
    swept = DISK.replace(beta=[0.1, 0.2], a=[0.0, 0.01])
    assert pk.flow(swept, PHI, DPHI, T).motion_phi.dims == ("beta", "a", "point", "time")
    phi = xr.DataArray(PHI, dims="start")
    dphi = xr.DataArray(DPHI, dims="push")
    ds = pk.flow(DISK, phi, dphi, T)
    assert ds.motion_phi.dims == ("start", "push", "time")
    alone = pk.flow(DISK, PHI[2], DPHI[1], T)
    np.testing.assert_array_equal(ds.motion_phi.isel(start=2, push=1), alone.motion_phi)
    named = xr.DataArray(T, dims="time", coords={"time": T}, attrs={"units": "s"})
    xr.testing.assert_identical(pk.flow(DISK, PHI, DPHI, named), pk.flow(DISK, PHI, DPHI, T))
    own = xr.DataArray(T, dims="frame")
    assert pk.flow(DISK, PHI, DPHI, own).motion_phi.dims == ("point", "frame")


def test_a_motion_may_go_on_from_another():
    there = pk.flow(C, PHI, DPHI, T).rename(time="moment")
    back = pk.flow(C, there.motion_phi, there.motion_dphi, -there.moment)
    assert back.motion_phi.dims == ("point", "moment")
    np.testing.assert_allclose(back.motion_phi, np.repeat(np.array(PHI)[:, None], 6, 1), atol=1e-9)
    later = there.motion_phi.rename(moment="time")
    with pytest.raises(pk.ParameterError, match="'time' differs"):  # two meanings of one dim
        pk.flow(C, later, 0.0, -later.time)


def test_motions_in_a_sweep():
    axes = {"beta": [0.1, 0.3], "state_phi": PHI, "time": T}
    ds = pk.sweep(DISK, axes, state_dphi=0.5, of="motion")
    assert ds.motion_phi.dims == ("beta", "state_phi", "time")
    alone = pk.flow(DISK, 0.3, 0.5, T)
    np.testing.assert_array_equal(ds.motion_phi.sel(beta=0.3, state_phi=0.3), alone.motion_phi)
    with pytest.raises(pk.ParameterError, match="axis of GyroRotorDisk: 'time' is unknown"):
        pk.sweep(DISK, time=T)


def test_tiles_in_threads_make_the_same_motion(monkeypatch):
    from phasekit.labels import grid

    swept = DISK.replace(beta=np.linspace(0, 1.5, 5))
    whole = pk.flow(swept, PHI, DPHI, T)
    for cells in (1, 7, 20):
        monkeypatch.setattr(grid.tiles, "__defaults__", (cells,))
        xr.testing.assert_identical(pk.flow(swept, PHI, DPHI, T), whole)


def test_invalid_cells_are_nan():
    ds = pk.flow(C, [0.1, np.nan], 0.2, [1.0, np.inf, np.nan])
    assert ds.motion_phi.notnull().values.tolist() == [[True, False, False], 3 * [False]]
    assert pk.flow(C.replace(A=[1.0, np.nan]), 0.1, 0.2, 1.0).motion_phi.isnull().values[1]
    assert pk.separatrix_motion(C, [1.0, np.nan]).motion_phi.notnull().values.tolist() == [1, 0]


@pytest.mark.parametrize("side", ["left", "right"])
@pytest.mark.parametrize(("saddle", "number"), [("lower", 0), ("upper", 1), (None, -1)])
def test_motions_on_separatrices_are_those_of_the_array_floor(saddle, number, side):
    ds = pk.separatrix_motion(C, T, saddle=saddle, side=side)
    expected = floor.separatrix_motion(*C, T, number, int(side == "right"))
    for name, values in expected._asdict().items():
        assert ds[name].dims == ("time",)
        np.testing.assert_array_equal(ds[name], values)
        assert ds[name].attrs["side"] == side
        assert ds[name].attrs["saddle"] == (saddle or "lower where there is one, else upper")
        assert ds[name].attrs["units"] == ROWS[name].units


def test_motions_on_separatrices_have_their_energy_and_leave_to_their_side():
    sep = pk.separatrices(C)
    for side, sign in (("left", -1), ("right", 1)):
        for saddle in ("lower", "upper"):
            ds = pk.separatrix_motion(C, [-60.0, -5.0, 0.0, 5.0, 60.0], saddle=saddle, side=side)
            h = pk.energy(C, ds.motion_phi, ds.motion_dphi).energy_integral
            at = sep.sel(saddle=saddle)
            np.testing.assert_allclose(h, float(at.saddle_energy), rtol=1e-9)
            turns = (ds.motion_phi[[0, -1]] - at.saddle_phi) / (2 * np.pi)
            np.testing.assert_allclose(turns, np.rint(turns), atol=1e-9)
            assert sign * (ds.motion_phi[2] - ds.motion_phi[0]) > 0
    eight = pk.separatrix_motion(C, 0.0)
    turning = sep.turning_phi.sel(saddle="lower", side="right")
    np.testing.assert_allclose(np.cos(eight.motion_phi), np.cos(turning), atol=1e-9)


def test_the_separatrix_by_default():
    mixed = pk.Coefficients([0.4, 4.3], 1.2, 0.7)
    ds = pk.separatrix_motion(mixed, T)
    assert ds.motion_phi.dims == ("A", "time")
    for A, saddle in ((0.4, "upper"), (4.3, "lower")):
        alone = pk.separatrix_motion(mixed.replace(A=A), T, saddle=saddle)
        np.testing.assert_array_equal(ds.motion_phi.sel(A=A), alone.motion_phi)
    assert pk.separatrix_motion(SINGLE, T, saddle="lower").motion_phi.isnull().all()


@pytest.mark.parametrize(
    ("given", "message"),
    [
        ({"saddle": "left"}, "^saddle: got 'left', wants one of lower, upper"),
        ({"saddle": 0}, "^saddle: got 0"),
        ({"side": "up"}, "^side: got 'up', wants one of left, right"),
        ({"side": 1}, "^side: got 1"),
    ],
)
def test_wrong_arguments_of_separatrix_motion(given, message):
    with pytest.raises(pk.ParameterError, match=message):
        pk.separatrix_motion(C, T, **given)


def test_contradictions_of_dims_are_named():
    with pytest.raises(pk.ParameterError, match="^phi0, dphi0: got 2 values of phi0 and 1 values"):
        pk.flow(C, [0.1, 0.2], [0.3], [1.0, 2.0, 3.0])
    with pytest.raises(pk.ParameterError, match="^t: got 3 values along 'point', wants 2 as phi0"):
        pk.flow(C, [0.1, 0.2], 0.3, xr.DataArray([1.0, 2.0, 3.0], dims="point"))
    with pytest.raises(pk.ParameterError, match="^phi0: got the dim 'time'"):
        pk.flow(C, xr.DataArray([1.0, 2.0], dims="time"), 0.3, 1.0)
