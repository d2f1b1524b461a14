"""Cells whose parameters are not legal are announced, once a call."""

import warnings

import numpy as np
import pytest
import xarray as xr

import phasekit as pk

DISK = pk.GyroRotorDisk(beta=0.3, e=0.05, a=0.02, r=0.2, omega1=25.0)
DEGREES = np.linspace(0, 90, 91)


def said(function, *args, **kwargs):
    with warnings.catch_warnings(record=True) as found:
        warnings.simplefilter("always")
        result = function(*args, **kwargs)
    assert all(issubclass(one.category, pk.InvalidCellsWarning) for one in found)
    assert all(one.filename == __file__ for one in found) or function is not pk.sweep
    return result, [str(one.message) for one in found]


def test_degrees_that_were_forgotten_are_said_with_share_reason_and_way_out():
    ds, (text,) = said(pk.sweep, DISK, beta=DEGREES)
    share = 100 * (ds.n_equilibria.values == -1).mean()
    assert text.startswith(f"{share:.3g} % of the cells are empty: beta: 87 of 91 values")
    assert text.startswith("95.6 %")
    assert text.endswith("wants a number from 0 to 3.14159 in radians; if they are in degrees: "
                         "beta * pk.deg")  # fmt: skip
    assert said(pk.sweep, DISK, beta=DEGREES * pk.deg)[1] == []


@pytest.mark.slow
def test_stored_maps_say_it_too(tmp_path):
    for name in ("map.zarr", "map.nc"):
        if name.endswith("nc"):
            pytest.importorskip("h5netcdf")
        ds, (text,) = said(pk.sweep, DISK, beta=DEGREES[::30], store=tmp_path / name)
        assert text.startswith("75 % of the cells are empty: beta: 3 of 4 values")
        ds.close()


def test_labelled_functions_say_it():
    for function in (pk.equilibria, pk.separatrices):
        with pytest.warns(pk.InvalidCellsWarning, match="50 % .* length: 1 of 2 .*-1.0; wants a n"):
            function(pk.Pendulum(length=[-1.0, 1.0]))


@pytest.mark.parametrize(
    "axes",
    [
        {"e": [-0.1, 0.1], "beta": [0.1, 4.0, 0.2]},
        {"e": [np.nan, 0.1], "a": [0.1, 0.2, np.inf]},
        {
            "beta": xr.DataArray([0.1, 4.0, 5.0, 0.2], dims="run"),
            "e": xr.DataArray([-0.1, -0.1, 0.1, 0.1], dims="run"),
        },
        {
            "beta": xr.DataArray([[0.1, 4.0, 5.0], [0.1, 0.2, 5.0]], dims=("run", "x")),
            "e": xr.DataArray([-0.1, 0.1], dims="run"),
            "a": xr.DataArray([np.nan, 0.1, 0.2, 0.3], dims="y"),
        },
    ],
)
def test_the_share_is_that_of_the_map(axes):
    ds, (text,) = said(pk.sweep, DISK, axes)
    share = 100 * (ds.n_equilibria.values == -1).mean()
    assert 0 < share < 100
    assert text.startswith(f"{share:.3g} % of the cells are empty: ")
    assert all(f"{name}: " in text for name in axes)
    assert "degrees" not in text or "if they are in degrees: beta * pk.deg" in text


def test_an_error_where_the_user_wants_one():
    with warnings.catch_warnings():
        warnings.simplefilter("error", pk.InvalidCellsWarning)
        with pytest.raises(pk.ParameterError, match="beta: 87 of 91 values"):
            pk.sweep(DISK, beta=DEGREES)
        pk.sweep(DISK, beta=[0.1, 0.2])


def test_few_cells_at_the_edge_of_a_map_are_not_worth_a_word():
    few, many = ([-0.1] * n + [0.1] * (20 - n) for n in (1, 2))
    assert said(pk.sweep, DISK, e=few)[1] == []
    assert said(pk.sweep, DISK, e=many)[1] != []
