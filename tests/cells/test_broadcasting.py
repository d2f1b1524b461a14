"""How scalars, arrays and DataArrays combine, and what the results carry."""

import numpy as np
import pytest
import xarray as xr

import phasekit as pk
from phasekit.phase.exact.phase_space import equilibria
from phasekit.phase.exact.potential import energy, potential

DISK = pk.GyroRotorDisk(beta=0.3, e=0.0115, a=0.02, r=0.21, omega1=2.5)


def test_scalar_system_has_label_dims_only():
    ds = pk.equilibria(DISK)
    assert ds.phi.dims == ("equilibrium",)
    assert ds.n_equilibria.dims == ()
    assert ds.equilibrium.values.tolist() == [
        "lower_center",
        "lower_saddle",
        "upper_center",
        "upper_saddle",
    ]
    np.testing.assert_array_equal(ds.phi, equilibria(*DISK.coefficients()).phi)
    assert set(ds.coords) == {"equilibrium", *DISK.parameters}
    assert ds.beta.item() == 0.3
    assert ds.beta.attrs == {
        "long_name": "angle between the shaft and the disk's plane",
        "units": "rad",
    }


def test_arrays_make_an_outer_product():
    beta, a = np.linspace(0.1, 1.4, 5), [0.0, 0.01, 0.02]
    ds = pk.equilibria(DISK.replace(beta=beta, a=a))
    assert dict(ds.sizes) == {"beta": 5, "a": 3, "equilibrium": 4}
    assert ds.phi.dims == ("beta", "a", "equilibrium")
    assert ds.indexes.keys() == {"beta", "a", "equilibrium"}
    cell = ds.isel(beta=3, a=1)
    alone = pk.equilibria(DISK.replace(beta=beta[3], a=0.01))
    for name in ds.data_vars:
        np.testing.assert_array_equal(cell[name], alone[name])


def test_dataarrays_broadcast_by_name():
    beta = np.linspace(0.1, 1.4, 5)
    a = xr.DataArray(0.01 + 0.02 * beta, dims="beta")  # a path in the (beta, a) plane
    ds = pk.equilibria(DISK.replace(beta=beta, a=a))
    assert ds.phi.dims == ("beta", "equilibrium")
    assert ds.a.dims == ("beta",)
    for i in range(5):
        alone = pk.equilibria(DISK.replace(beta=beta[i], a=a.values[i]))
        np.testing.assert_array_equal(ds.phi[i], alone.phi)


def test_dataarrays_on_foreign_dims_mix_with_arrays_and_scalars():
    case = xr.DataArray([0.01, 0.02], dims="case", coords={"case": ["x", "y"]}, attrs={"k": 1})
    ds = pk.equilibria(DISK.replace(beta=[0.1, 0.2, 0.3], e=case, a=case))
    assert dict(ds.n_equilibria.sizes) == {"beta": 3, "case": 2}
    assert ds.case.values.tolist() == ["x", "y"]
    assert ds.e.dims == ("case",)
    alone = pk.equilibria(DISK.replace(beta=0.2, e=0.02, a=0.02))
    np.testing.assert_array_equal(ds.phi.sel(beta=0.2, case="y"), alone.phi)


def test_coefficients_of_arrays_are_a_system_on_the_same_dims():
    swept = DISK.replace(beta=[0.1, 0.2], a=[0.0, 0.01, 0.02])
    direct, through = pk.equilibria(swept), pk.equilibria(swept.coefficients())
    assert through.phi.dims == ("beta", "a", "equilibrium")
    np.testing.assert_array_equal(direct.phi, through.phi)
    assert through.A.dims == ("beta", "a")
    np.testing.assert_array_equal(through.beta, [0.1, 0.2])


def test_coordinates_of_a_map_do_not_come_along_with_a_parameter():
    ds = pk.equilibria(DISK.replace(beta=[0.1, 0.2]))
    other = pk.equilibria(DISK.replace(beta=ds.beta, e=0.02))  # ds.beta carries the old e
    assert other.e.item() == 0.02


def test_anything_with_coefficients_is_a_system():
    class Mine:
        def coefficients(self):
            return 4.0, 1.0, 0.5

    xr.testing.assert_identical(pk.equilibria(Mine()), pk.equilibria(pk.Coefficients(4, 1, 0.5)))


def test_equal_shapes_of_states_pair_on_point():
    phi, dphi = np.linspace(-3, 3, 5), np.linspace(0, 2, 5)
    ds = pk.energy(DISK, phi, dphi)
    assert ds.energy_integral.dims == ("point",)
    np.testing.assert_array_equal(ds.energy_integral, energy(*DISK.coefficients(), phi, dphi))
    np.testing.assert_array_equal(ds.state_phi, phi)
    assert ds.state_dphi.attrs["units"] == "s-1"
    assert pk.energy(DISK, phi, 1.5).energy_integral.dims == ("point",)
    assert pk.energy(DISK, 0.5, 1.5).energy_integral.dims == ()


def test_states_and_array_parameters_make_an_outer_product():
    phi = np.linspace(-3, 3, 4)
    ds = pk.potential(DISK.replace(beta=[0.1, 0.2]), phi)
    assert ds.potential.dims == ("beta", "point")
    alone = potential(*DISK.replace(beta=0.2).coefficients(), phi)
    np.testing.assert_array_equal(ds.potential.sel(beta=0.2), alone)


def test_states_as_dataarrays_broadcast_by_name():
    eq = pk.equilibria(DISK.replace(beta=[0.1, 0.2]))
    ds = pk.gradient(DISK.replace(beta=eq.beta), eq.phi)
    assert ds.potential_gradient.dims == ("beta", "equilibrium")
    assert float(abs(ds.potential_gradient).max()) < 1e-14
    levels = xr.DataArray([-1.0, 0.0, 9.0], dims="level")
    phi = xr.DataArray([0.0, 1.0], dims="phi", coords={"phi": [0.0, 1.0]})
    assert pk.phase_velocity(DISK, phi, levels).phase_velocity.dims == ("phi", "level")


def test_results_merge():
    ds = xr.merge(
        [
            pk.equilibria(DISK),
            pk.separatrices(DISK),
            pk.potential(DISK, 0.5),
            pk.gradient(DISK, 0.5),
            pk.curvature(DISK, 0.5),
            pk.energy(DISK, 0.5, 1.5),
            pk.phase_velocity(DISK, 0.5, 3.0),
        ],
        compat="identical",
        join="exact",
    )
    assert len(ds.data_vars) == 8 + 10 + 5


INVALID = {
    "beta": [-0.1, 4.0, np.nan, np.inf],
    "e": [-0.1, np.nan, np.inf],
    "a": [np.nan, -np.inf],
    "r": [-0.1, np.nan, np.inf],
    "omega1": [np.nan, np.inf],
    "g": [np.nan, np.inf],
}


@pytest.mark.parametrize("name", INVALID)
def test_invalid_cells_are_marked_and_leave_the_rest_alone(name):
    good = DISK.parameters[name]
    ds = pk.sweep(DISK, {name: [good, *INVALID[name]]})
    bad = ds.isel({name: slice(1, None)})
    assert (bad.n_equilibria == -1).all()
    assert (bad.topology == pk.Topology.NOT_COMPUTED).all()
    assert not bad.figure_eight.any()
    assert (bad.kind == pk.EquilibriumKind.ABSENT).all()
    assert (bad.loop == pk.Loop.ABSENT).all()
    for variable in bad.data_vars.values():
        if variable.dtype == float:
            assert variable.isnull().all()
    alone = pk.sweep(DISK, {name: [good]})
    for variable in alone.data_vars:
        np.testing.assert_array_equal(ds[variable].isel({name: [0]}), alone[variable])


@pytest.mark.parametrize("value", [np.nan, np.inf, -np.inf])
@pytest.mark.parametrize("name", ["A", "B", "C"])
def test_invalid_coefficients_in_arrays(name, value):
    c = pk.Coefficients(4.0, 1.0, 0.5).replace(**{name: [2.0, value]})
    assert pk.equilibria(c).n_equilibria.values[1] == -1
    assert np.isnan(pk.potential(c, 0.3).potential.values[1])
    assert pk.potential(c, 0.3).potential.notnull().values[0]


@pytest.mark.parametrize("value", [np.nan, np.inf])
def test_invalid_states_in_arrays(value):
    c, good = pk.Coefficients(4.0, 1.0, 0.5), [0.3, value]
    for ds in (
        pk.potential(c, good),
        pk.gradient(c, good),
        pk.curvature(c, good),
        pk.energy(c, good, 1.0),
        pk.energy(c, 1.0, good),
        pk.phase_velocity(c, 0.3, [9.0, value]),
        pk.phase_velocity(c, good, 9.0),
    ):
        (variable,) = ds.data_vars.values()
        assert variable.notnull().values.tolist() == [True, False]


@pytest.mark.parametrize(
    ("system", "message"),
    [
        (
            {"beta": [0.1, 0.2], "a": xr.DataArray([1.0, 2.0, 3.0], dims="beta")},
            "a: got 3 values along 'beta', wants 2 as beta has",
        ),
        (
            {"beta": [0.1, 0.2], "a": xr.DataArray([1.0, 2.0], coords={"beta": [0.1, 0.3]})},
            "a: got a DataArray .* whose coordinate 'beta' differs",
        ),
        ({"a": xr.DataArray([1.0, 2.0], dims="beta")}, "a: got the dim 'beta'.*rename"),
        ({"a": xr.DataArray([1.0, 2.0], dims="equilibrium")}, "dim 'equilibrium': .*rename"),
        ({"a": xr.DataArray([1.0, 2.0], dims="phi")}, "dim 'phi': .*rename"),
    ],
)
def test_contradictions_of_dims_are_named(system, message):
    with pytest.raises(pk.ParameterError, match=message):
        pk.equilibria(DISK.replace(**system))


def test_unequal_lengths_of_states_are_refused():
    with pytest.raises(pk.ParameterError, match=r"phi, dphi: got 2 values of phi and 3 values"):
        pk.energy(DISK, [0.1, 0.2], [1.0, 2.0, 3.0])
