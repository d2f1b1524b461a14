"""Maps in memory."""

import re

import numpy as np
import pytest
import xarray as xr

import phasekit as pk
from phasekit.cells import evaluate
from phasekit.labels import grid
from phasekit.numerics import memory
from phasekit.phase.exact.phase_space import phase_space

DISK = pk.GyroRotorDisk(beta=0.3, e=0.0115, a=0.02, r=0.21, omega1=2.5)


def test_sweep_equals_the_array_floor_and_the_labelled_functions():
    beta, a = np.linspace(0.01, 1.5, 7), np.linspace(0.0, 0.05, 4)
    ds = pk.sweep(DISK, beta=beta, a=a)
    points, loops = phase_space(*DISK.replace(beta=beta, a=a).coefficients())
    for results in (points, loops):
        for name, expected in results._asdict().items():
            np.testing.assert_array_equal(ds[name], expected)
            assert ds[name].dtype == expected.dtype
    labelled = DISK.replace(beta=beta, a=a)
    xr.testing.assert_identical(
        ds[list(points._fields)], pk.equilibria(labelled)[list(points._fields)]
    )


def test_axes_come_in_the_order_given():
    ds = pk.sweep(DISK, {"a": [0.0, 0.01]}, omega1=[1.0, 2.0, 3.0], beta=range(1, 3))
    assert ds.phi.dims == ("a", "omega1", "beta", "equilibrium")
    assert ds.beta.values.tolist() == [1.0, 2.0]
    assert list(ds.indexes)[:3] == ["a", "omega1", "beta"]
    assert ds.e.dims == ()


def test_axes_of_the_system_come_after_those_of_the_sweep():
    ds = pk.sweep(DISK.replace(beta=[0.1, 0.2]), a=[0.0, 0.01, 0.02])
    assert ds.n_equilibria.dims == ("a", "beta")
    assert pk.sweep(DISK.replace(beta=[0.1, 0.2])).n_equilibria.dims == ("beta",)


@pytest.mark.parametrize(
    ("system", "axes"),
    [
        (DISK, {"r": [0.1, 0.2], "g": [9.7, 9.8]}),
        (DISK.replace(m=1.0), {"m": [1.0, 2.0], "beta": [0.1, 0.2]}),
        (pk.Reduced(0.1, 0.2), {"lam": [0.1, 1.2], "psi": [-0.3, 0.0, 0.3]}),
        (pk.Reduced(0.1, 0.2), {"Omega_sq": [-1.0, 1.0]}),
        (pk.Coefficients(1, 2, 3), {"A": [0.0, 1.0], "B": [1.0, 2.0], "C": [0.0, 0.5]}),
        (pk.ParticleOnCircle(radius=0.4, omega=2.0), {"tilt": [0.0, 0.1], "offset": [0.0, 0.1]}),
        (pk.Pendulum(length=0.4), {"length": [0.4, 0.5]}),
        (pk.StonerWohlfarth(K=1.0, h_x=0.1, h_y=0.2), {"h_x": [0.1, 3.0], "K": [1.0, 2.0]}),
    ],
)
def test_every_parameter_can_be_swept(system, axes):
    ds = pk.sweep(system, axes)
    assert ds.phasekit.system() == system.replace(**axes)
    last = dict.fromkeys(axes, -1)
    alone = system.replace(**{name: values[-1] for name, values in axes.items()})
    cell = ds.isel(last)
    assert cell.phasekit.system() == alone
    for name, variable in pk.equilibria(alone).data_vars.items():
        np.testing.assert_array_equal(cell[name], variable)


def test_axes_may_be_paths_of_dataarrays():
    path = xr.DataArray(np.linspace(0, 1, 5), dims="s", coords={"s": np.linspace(0, 1, 5)})
    ds = pk.sweep(DISK, beta=0.1 + path, a=0.05 * path)
    assert ds.topology.dims == ("s",)
    assert ds.sel(s=0.5).phasekit.system() == DISK.replace(beta=0.6, a=0.025)


def test_only_what_is_asked_for():
    ds = pk.sweep(DISK, beta=[0.1, 0.2], of="n_equilibria")
    assert list(ds.data_vars) == ["n_equilibria"]
    assert "equilibrium" not in ds.coords
    ds = pk.sweep(DISK, beta=[0.1, 0.2], of=["topology", "phi", "phi"])
    assert list(ds.data_vars) == ["phi", "topology"]


def test_tiles_in_threads_make_the_same_map(monkeypatch):
    axes = {"beta": np.linspace(0.01, 1.5, 13), "a": np.linspace(0, 0.05, 11)}
    whole = pk.sweep(DISK, axes)
    for cells in (1, 7, 30):
        monkeypatch.setattr(grid.tiles, "__defaults__", (cells,))
        xr.testing.assert_identical(pk.sweep(DISK, axes), whole)


@pytest.mark.parametrize("shape", [(), (5,), (3, 4), (2, 3, 5), (1, 7, 1), (100, 3)])
@pytest.mark.parametrize("cells", [1, 4, 6, 10**6])
def test_tiles_cover_each_cell_once(shape, cells):
    seen = np.zeros(shape, dtype=int)
    for tile in grid.tiles(shape, cells):
        assert seen[tile].size <= cells
        seen[tile] += 1
    assert (seen == 1).all()


def test_an_error_in_a_tile_is_raised(monkeypatch):
    def fail():
        raise RuntimeError("no")

    with pytest.raises(RuntimeError, match="no"):
        evaluate.run_tasks([(fail, 1), (lambda: None, 1)], False)


def test_progress_bar_counts_cells_and_is_quiet_by_default(capfd, monkeypatch):
    monkeypatch.setattr(grid.tiles, "__defaults__", (2,))
    pk.sweep(DISK, beta=[0.1, 0.2, 0.3, 0.4])
    pk.sweep(DISK, beta=[0.1, 0.2, 0.3, 0.4], progress=False)
    assert capfd.readouterr().err == ""
    pk.sweep(DISK, beta=[0.1, 0.2, 0.3, 0.4], progress=True)
    assert re.search(r"phasekit: 100%.*4\.00/4\.00", capfd.readouterr().err)


def test_a_map_too_large_is_refused_before_any_work():
    axes = {name: np.linspace(0.1, 0.2, 30_000) for name in ("beta", "e", "a")}
    with pytest.raises(pk.ParameterError) as caught:
        pk.sweep(DISK, axes)
    text = str(caught.value)
    assert "beta 30000 x e 30000 x a 30000 = 2.7e+13 cells" in text
    assert "coarser axes" in text
    assert "of=" in text
    assert "chunked DataArrays" in text
    for work in (pk.equilibria, pk.GyroRotorDisk.coefficients, pk.GyroRotorDisk.reduced):
        with pytest.raises(pk.ParameterError, match="cells"):
            work(DISK.replace(**axes))


def test_the_refusal_goes_by_the_bytes_of_the_quantities(monkeypatch):
    monkeypatch.setattr("phasekit.numerics.memory.available_memory", lambda: 10_000)
    monkeypatch.setattr(memory, "ALWAYS", 0)
    beta = np.linspace(0.1, 0.2, 1000)
    assert pk.sweep(DISK, beta=beta, of="n_equilibria").sizes["beta"] == 1000
    assert pk.sweep(DISK, beta=beta, of=["n_equilibria", "kind"]).sizes["beta"] == 1000
    with pytest.raises(pk.ParameterError, match=r"32 kB .* 8 kB, 80% of .*largest: phi"):
        pk.sweep(DISK, beta=beta, of="phi")


def test_available_memory_is_known_here():
    assert 0 < memory.available_memory() < 2**60


WRONG_AXES = [
    ({"bta": [0.1]}, r"axis of GyroRotorDisk: 'bta' is unknown; did you mean 'beta'"),
    ({"lam": [0.1]}, r"axis 'lam' is not a parameter of GyroRotorDisk; sweep system\.reduced"),
    ({"A": [0.1]}, r"sweep system\.coefficients"),
    ({"state_phi": [0.1]}, "axis of GyroRotorDisk: 'state_phi' is unknown"),
    ({1: [0.1]}, "axis of GyroRotorDisk: 1 is unknown"),
    ({"beta": 0.1}, r"beta: got 0\.1, wants a 1-D list.*system\.replace\(beta="),
    ({"beta": []}, r"beta: got \[\], wants at least one value"),
    ({"beta": [[0.1]]}, "beta: got a 2-D list of shape"),
    ({"beta": "0.1"}, "beta: got '0.1'"),
    ({"beta": ["a"]}, "beta: got"),
    ({"beta": None}, "beta: got None"),
    ({"beta": [True]}, "beta: got .*bool"),
    ([("beta", [0.1])], "axes: got .*, wants a mapping"),
    (None, "axes: got none, wants at least one of beta, e, a"),
    ({}, "axes: got none"),
]


@pytest.mark.parametrize(("axes", "message"), WRONG_AXES)
def test_wrong_axes_are_named(axes, message):
    with pytest.raises(pk.ParameterError, match=message):
        pk.sweep(DISK, axes)


def test_an_axis_given_twice_is_refused():
    with pytest.raises(pk.ParameterError, match="beta: got it in axes and as a keyword"):
        pk.sweep(DISK, {"beta": [0.1]}, beta=[0.2])


@pytest.mark.parametrize(
    "of", ["orbit", "n_equilibra", "critical_fold", 3, None, [], ["phi", 3], b"phi", {}]
)
def test_wrong_quantities_are_named(of):
    with pytest.raises(pk.ParameterError, match=r"^of"):
        pk.sweep(DISK, beta=[0.1], of=of)


def test_missing_states_are_named():
    with pytest.raises(pk.ParameterError, match="state_phi: got nothing, wants a value for poten"):
        pk.sweep(DISK, beta=[0.1], of="potential")
