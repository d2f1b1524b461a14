"""Chunked parameters and states give lazy results, equal to the eager ones to the last bit."""

import numpy as np
import pytest
import xarray as xr

import phasekit as pk

pytest.importorskip("dask")

DISK = pk.GyroRotorDisk(beta=0.3, e=0.0115, a=0.02, r=0.21, omega1=2.5, m=2.0)
BETA = np.linspace(-0.1, 1.5, 23)
A = np.linspace(0.0, 0.05, 9)


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


@pytest.mark.slow
@pytest.mark.parametrize("function", [pk.equilibria, pk.separatrices, pk.sweep])
@pytest.mark.parametrize("chunk", [1, 5, 23])
def test_lazy_equals_eager(function, chunk):
    eager = function(DISK.replace(beta=BETA, a=A))
    result = function(DISK.replace(beta=lazy("beta", BETA, chunk), a=lazy("a", A, 4)))
    for variable in result.data_vars.values():
        assert variable.chunks is not None
    assert_same_bits(eager, result.compute())


def test_lazy_and_eager_parameters_mix():
    result = pk.equilibria(DISK.replace(beta=lazy("beta", BETA, 5), a=A))
    assert result.phi.dims == ("beta", "a", "equilibrium")
    assert result.phi.chunks[0] == (5, 5, 5, 5, 3)
    assert_same_bits(pk.equilibria(DISK.replace(beta=BETA, a=A)), result.compute())


def test_lazy_states():
    phi = xr.DataArray(np.linspace(-3, 3, 20), dims="x")
    eager = pk.energy(DISK, phi, 1.5)
    result = pk.energy(DISK, phi.chunk(x=6), 1.5)
    assert result.energy_integral.chunks == ((6, 6, 6, 2),)
    assert_same_bits(eager, result.compute())


def test_lazy_coefficients_and_derived_values():
    swept = DISK.replace(beta=lazy("beta", BETA, 5))
    assert swept.coefficients().A.chunks is not None
    assert swept.eccentricity.chunks is not None
    assert swept.inertia().Jvn.chunks is not None
    eager = DISK.replace(beta=BETA)
    xr.testing.assert_equal(swept.coefficients().A.compute(), eager.coefficients().A)
    xr.testing.assert_equal(swept.inertia().Jvn.compute(), eager.inertia().Jvn)
    assert "lazy" in repr(swept)


def test_lazy_critical():
    e = np.linspace(0.001, 0.02, 7)
    result = pk.critical(DISK.replace(e=lazy("e", e, 3)), "beta")
    assert result.critical_fold.chunks is not None
    assert_same_bits(pk.critical(DISK.replace(e=e), "beta"), result.compute())


def test_lazy_equilibria_of_equations_in_a_box():
    well = pk.Problem("mu*x - x^3", "x", {"mu": 1.0})
    mu, box = np.array([-1.0, 0.5, np.nan, 2.0]), {"x": (-0.8, 2.0)}
    result = pk.equilibria(well.replace(mu=lazy("mu", mu, 3)), box=box)
    assert result.x.chunks is not None
    xr.testing.assert_equal(result.compute(), pk.equilibria(well.replace(mu=mu), box=box))
    assert result.n_equilibria.values.tolist() == [1, 3, -1, 2]


def test_a_lazy_map_is_not_refused_for_its_size(monkeypatch):
    monkeypatch.setattr("phasekit.numerics.memory.available_memory", lambda: 1000)
    monkeypatch.setattr("phasekit.numerics.memory.ALWAYS", 0)
    axes = {"beta": np.linspace(0.1, 0.2, 40), "a": np.linspace(0.0, 0.1, 40)}
    with pytest.raises(pk.ParameterError, match="chunked DataArrays"):
        pk.sweep(DISK, axes)
    ds = pk.sweep(DISK, {name: lazy(name, values, 8) for name, values in axes.items()})
    assert (ds.n_equilibria.isel(beta=slice(3), a=3).compute() > 0).all()
    assert ds.isel(beta=0, a=0).phasekit.system() == DISK.replace(beta=0.1, a=0.0)


@pytest.mark.slow
@pytest.mark.filterwarnings("error")
def test_a_lazy_map_is_written_as_the_eager_one(tmp_path):
    pytest.importorskip("zarr")
    ds = pk.sweep(DISK, beta=lazy("beta", BETA, 5), a=lazy("a", A, 4))
    ds.to_zarr(tmp_path / "map.zarr", zarr_format=3, consolidated=False)
    assert_same_bits(pk.sweep(DISK, beta=BETA, a=A), pk.open_map(tmp_path / "map.zarr").load())


@pytest.mark.slow
def test_chunked_parameters_are_taken_where_their_values_decide_on_the_shape():
    mu = xr.DataArray([0.5, 1.0], {"mu": [0.5, 1.0]}, "mu")
    pol = pk.Problem(
        {"x": "v", "v": "mu*(1 - x^2)*v - x"}, parameters={"mu": mu},
        window={"x": (-4, 4), "v": (-6, 6)},
    )  # fmt: skip
    well = pk.Potential("mu*x^4 - b*x^2", "x", {"mu": mu, "b": 1.0})
    calls = [
        (pol, lambda s: pk.periodic_orbits(s)),
        (pol, lambda s: pk.poincare_section(s, [1.0, 0.0], section="v", n=3)),
        (well, lambda s: pk.critical(s, "b", span=(-1, 1))),
    ]
    for system, call in calls:
        assert call(system.replace(mu=mu.chunk(mu=1))).identical(call(system))
