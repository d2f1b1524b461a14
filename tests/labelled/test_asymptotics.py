"""Limits of the period, against the period itself."""

import numpy as np
import pytest
import xarray as xr

import phasekit as pk
from phasekit.phase.exact import asymptotics as floor
from phasekit.table.quantities import ROWS, select

C = pk.Coefficients(4.3, 1.2, 0.7)
SINGLE = pk.Coefficients(0.4, 1.2, 0.7)
HETEROCLINIC = pk.Coefficients(2.0, 0.0, 1.0)


def test_limits_are_those_of_the_array_floor():
    values = [-1e-3, 1e-6, np.nan]
    near_center, near_separatrix = pk.near_center(C, values), pk.near_separatrix(C, values)
    for ds, result, dim in (
        (near_center, floor.near_center(*C, values), "equilibrium"),
        (near_separatrix, floor.near_separatrix(*C, values), "saddle"),
    ):
        assert list(ds.data_vars) == list(result._fields)
        for name, expected in result._asdict().items():
            assert ds[name].dims == ("point", dim)
            np.testing.assert_array_equal(ds[name], expected)
            assert ds[name].attrs == ROWS[name].attrs
            assert ds[name].isel(point=2).isnull().all()
    assert near_center.state_excess.attrs["units"] == "s-2"
    assert near_separatrix.state_gap.attrs["units"] == "s-2"
    assert {row.name for row in select("near_center")} == set(floor.NearCenter._fields)
    assert {row.name for row in select("near_separatrix")} == set(floor.NearSeparatrix._fields)


@pytest.mark.parametrize("center", ["lower_center", "upper_center"])
def test_near_a_center_the_error_is_of_second_order(center):
    bottom = pk.equilibria(C).energy.sel(equilibrium=center).item()
    excess = np.array([1e-2, 1e-3])
    near = pk.near_center(C, excess).sel(equilibrium=center)
    orbit = pk.orbits(C, energy=bottom + excess, center=center)
    for name in ("period", "frequency"):
        error = abs(near[f"near_center_{name}"] / orbit[name] - 1).values
        assert error[0] < 1e-4
        np.testing.assert_allclose(error[1], error[0] / 100, rtol=0.1)
    assert pk.near_center(C, 0.1).near_center_period.sel(equilibrium="lower_saddle").isnull()


@pytest.mark.parametrize(
    ("system", "saddle"),
    [(C, "lower"), (C, "upper"), (SINGLE, "upper"), (HETEROCLINIC, "lower")],
)
@pytest.mark.parametrize("sign", [-1.0, 1.0])
def test_near_a_separatrix_the_error_is_of_the_order_of_the_gap(system, saddle, sign):
    gap = sign * np.array([1e-5, 1e-7])
    near = pk.near_separatrix(system, gap).near_separatrix_period.sel(saddle=saddle)
    orbit = pk.orbits(system, gap=gap, saddle=saddle)
    error = abs(near - orbit.period).values
    assert error[0] < 1e-2
    assert error[1] < 0.02 * error[0]


def test_absent_saddles_are_nan():
    ds = pk.near_separatrix(SINGLE, 1e-6)
    assert ds.near_separatrix_period.isnull().values.tolist() == [True, False]


def test_parameters_make_dims():
    ds = pk.near_center(C.replace(A=[1.0, 2.0, np.nan]), xr.DataArray([0.1, 0.2], dims="h"))
    assert ds.near_center_period.dims == ("A", "h", "equilibrium")
    assert ds.near_center_period.isel(A=2).isnull().all()
