"""Values in the units that people ask for."""

import numpy as np
import pytest
import xarray as xr

from phasekit.errors import ParameterError
from phasekit.labels.units import UNITS, converted, factor


@pytest.mark.parametrize("held", UNITS)
def test_units_lead_there_and_back(held):
    values = np.array([-1.153, 0.0, 7.25e-3, np.nan, np.inf])
    for unit in UNITS[held]:
        there = converted("units", values, held, unit)
        np.testing.assert_allclose(there * float(factor("x", unit, held)), values, rtol=3e-16)


@pytest.mark.parametrize(
    ("value", "held", "unit", "shown"),
    [
        (np.pi, "rad", "deg", 180.0),
        (np.pi, "rad", " degrees ", 180.0),
        (10.0 * np.pi, "s-1", "rpm", 300.0),
        (np.pi, "s-1", "deg/s", 180.0),
        (0.001153, "m", "mm", 1.153),
        (2.5, "m s-2", "m/s^2", 2.5),
        (90.0, "s", "min", 1.5),
        (2.5, "rad2 s-1", "rad2 s-1", 2.5),
        (2.5, "", "1", 2.5),
        (2.5, "1", "", 2.5),
    ],
)
def test_known_values(value, held, unit, shown):
    assert converted("units", value, held, unit) == pytest.approx(shown, rel=1e-15)


def test_arrays_keep_their_names():
    given = xr.DataArray([0.0, np.pi], dims="beta", coords={"beta": [0.0, 1.0]}, name="beta")
    xr.testing.assert_identical(
        converted("units", given, "rad", "deg"), given.copy(data=[0.0, 180.0])
    )


@pytest.mark.parametrize(
    ("held", "unit", "wants"),
    [
        ("rad", "mm", "rad or deg"),
        ("m", "deg", "m or cm or mm"),
        ("s-1", "s", "s-1 or rad/s"),
        ("rad2 s-1", "deg", "rad2 s-1"),
        ("1", "deg", "'1', for it has no unit"),
        ("", "mm", "'1', for it has no unit"),
        ("rad", None, "rad or deg"),
        ("rad", 3, "rad or deg"),
        ("rad", True, "rad or deg"),
        ("m", "", "m or cm"),
        ("m", "parsec", "m or cm"),
    ],
)
def test_units_of_something_else_are_refused(held, unit, wants):
    with pytest.raises(ParameterError, match="units: a: got ") as caught:
        converted("units: a", 1.0, held, unit)
    assert f"{unit!r}, wants {wants}" in str(caught.value)
