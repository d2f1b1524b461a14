"""Critical values, labelled."""

import numpy as np
import pytest

import phasekit as pk
from phasekit.bifurcation.exact.critical import critical_disk, critical_reduced

DISK = pk.GyroRotorDisk(beta=0.3, e=0.0115, a=0.02, r=0.21, omega1=2.5, g=9.81)
UNITS = {"beta": "rad", "e": "m", "a": "m", "omega1": "s-1", "lam": "1", "psi": "1"}


@pytest.mark.parametrize("parameter", UNITS)
def test_values_are_those_of_the_floor_below(parameter):
    ds = pk.critical(DISK, parameter)
    if parameter in ("lam", "psi"):
        expected = critical_reduced(parameter, *DISK.coefficients())
    else:
        names = ("beta", "e", "a", "r", "omega1", "g")
        expected = critical_disk(parameter, **{n: getattr(DISK, n) for n in names})
    assert ds.critical_fold.dims == ("fold",)
    assert ds.fold.values.tolist() == ["minus", "plus"]
    np.testing.assert_array_equal(ds.critical_fold, expected[:2])
    np.testing.assert_array_equal(ds.critical_sign_change, expected[2])
    for variable in ds.data_vars.values():
        assert variable.attrs["units"] == UNITS[parameter]
        assert variable.attrs["parameter"] == parameter
        assert variable.dtype == float
    assert parameter not in ds.coords


@pytest.mark.parametrize("parameter", ["beta", "e", "a", "omega1"])
def test_the_count_changes_at_the_fold(parameter):
    for fold in pk.critical(DISK, parameter).critical_fold.values:
        if np.isfinite(fold):
            ds = pk.sweep(DISK, {parameter: [fold * (1 - 1e-9), fold * (1 + 1e-9)]})
            assert sorted(ds.n_equilibria.values.tolist()) == [2, 4]


@pytest.mark.parametrize(("parameter", "other"), [("lam", "psi"), ("psi", "lam")])
def test_the_count_changes_at_the_fold_of_the_reduced_form(parameter, other):
    system = pk.Reduced(0.3, 0.3, 2.0)
    fold = pk.critical(system, parameter).critical_fold.sel(fold="plus").item()
    assert fold ** (2 / 3) + 0.3 ** (2 / 3) == pytest.approx(1.0, rel=1e-13)
    ds = pk.sweep(system, {parameter: [fold * (1 - 1e-9), fold * (1 + 1e-9)]})
    assert ds.n_equilibria.values.tolist() == [4, 2]


def test_the_axis_of_the_parameter_itself_does_not_count():
    swept = DISK.replace(beta=[0.1, 0.2, 0.3], e=[0.005, 0.01])
    ds = pk.critical(swept, "beta")
    assert ds.critical_fold.dims == ("e", "fold")
    assert "beta" not in ds.coords
    alone = pk.critical(DISK.replace(e=0.01), "beta")
    np.testing.assert_array_equal(ds.critical_fold.sel(e=0.01), alone.critical_fold)


def test_attributes_of_the_table_are_left_alone():
    pk.critical(DISK, "beta")
    from phasekit.table.quantities import ROWS

    assert ROWS["critical_fold"].units == "1"
    assert "parameter" not in ROWS["critical_fold"].attrs
