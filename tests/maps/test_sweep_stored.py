"""Sweeps into stores: the same map in every way, and only what is new is computed."""

import pickle
import shutil
import subprocess
import sys
import threading

import numpy as np
import pytest
import xarray as xr

import phasekit as pk
from phasekit.laws.trigonometric import Trigonometric
from phasekit.maps import run, tile
from phasekit.maps.plan import LAYOUT
from phasekit.maps.sweep import plan_sweep
from phasekit.maps.workers import keeps_here
from phasekit.systems.registry import models

zarr = pytest.importorskip("zarr")

DISK = pk.GyroRotorDisk(beta=0.3, e=0.0115, a=0.02, r=0.21, omega1=2.5)
AXES = {"beta": np.linspace(-0.1, 1.5, 7), "a": np.linspace(0.0, 0.05, 5)}
WHOLE = pk.sweep(DISK, AXES)
CODES = ["n_equilibria", "topology", "figure_eight"]


def content(folder):
    return {
        str(file.relative_to(folder)): file.read_bytes()
        for file in sorted(folder.rglob("*"))
        if file.is_file()
    }


@pytest.fixture
def computed(monkeypatch):
    """The numbers of the tiles that are computed."""
    seen = []
    original = tile.compute_cells

    def watched(model, passes, rows, inputs, shape):
        seen.append(shape)
        return original(model, passes, rows, inputs, shape)

    monkeypatch.setattr(tile, "compute_cells", watched)
    return seen


@pytest.mark.slow
@pytest.mark.parametrize("chunks", [None, 2, -1, {"beta": 3}, {"a": 4, "beta": -1}])
def test_a_stored_map_is_the_one_in_memory(chunks, tmp_path):
    ds = pk.sweep(DISK, AXES, store=tmp_path / "map.zarr", chunks=chunks, workers=1)
    assert "computed" not in ds
    xr.testing.assert_identical(ds.load(), WHOLE)
    with pk.open_map(tmp_path / "map.zarr") as again:
        assert list(again.data_vars) == list(WHOLE.data_vars)


LAWS = (
    pk.Coefficients(4.0, 1.0, 0.5), pk.Reduced(0.25, 0.125, 4.0), DISK, pk.Pendulum(length=1.0),
    pk.ParticleOnCircle(radius=1.0, omega=4.0), pk.StonerWohlfarth(K=-2.0, h_x=1.0, h_y=0.5),
    pk.JosephsonJunction(plasma_frequency=1.0), pk.SpinOrbit(mean_motion=1.0, asymmetry=0.1),
)  # fmt: skip


@pytest.mark.parametrize("system", LAWS, ids=lambda system: type(system).__name__)
def test_perturbed_maps_are_computed_in_other_processes(system, tmp_path):
    assert {type(one) for one in LAWS} == {m for m in models().values() if m.rung is Trigonometric}
    driven = pk.Perturbed(system, damping=0.1, forcing=pk.Harmonic(0.2, 1.3))
    tilted = pk.Perturbed(system, torque=0.1)
    for one, of in ((driven, "melnikov"), (tilted, "separatrices"), (system, "equilibria")):
        axis = next(iter(system.parameters))
        axes = {axis: system.parameters[axis] * np.array([1.0, 1.1])}
        job = plan_sweep(one, axes, of=of, store=tmp_path / f"{of}.zarr", chunks=1)
        assert job.count == 2
        assert keeps_here(next(job.tiles())) is None


@pytest.mark.slow
def test_a_stored_map_under_a_torque_says_so(tmp_path):
    system = pk.Perturbed(LAWS[0], torque=0.01)
    axes = {"A": np.linspace(4, 5, 4), "state_phi": [0.1, 0.2], "state_dphi": [0.0, 0.1]}
    of = ["equilibria", "orbits"]
    memory = pk.sweep(system, axes, of=of)
    assert memory.phi.equation == "V'(phi) = torque"
    store = tmp_path / "map.zarr"
    ds = pk.sweep(system, axes, of=of, store=store, workers=1)
    xr.testing.assert_identical(ds.load(), memory)
    extra = pk.sweep(system, axes, of=["orbits", "separatrices"], store=store, workers=1)
    assert extra.phi.equation == "V'(phi) = torque"
    longer = {**axes, "A": np.linspace(4, 6, 7)}
    ds = pk.sweep(system, longer, of=[*of, "separatrices"], store=store, workers=1)
    whole = pk.sweep(system, longer, of=[*of, "separatrices"])
    # Batches of other sizes round otherwise.
    assert ds.data_vars.keys() == whole.data_vars.keys()
    for name in whole.data_vars:
        np.testing.assert_allclose(ds[name], whole[name], rtol=1e-13)
    assert [ds[name].equation for name in whole] == [whole[name].equation for name in whole]


@pytest.mark.slow
def test_chunks_are_the_tiles(tmp_path, computed):
    chunks = {"a": 2, "beta": 4}
    ds = pk.sweep(DISK, AXES, store=tmp_path / "map.zarr", chunks=chunks, workers=1)
    assert sorted(computed) == sorted([(4, 2), (4, 2), (4, 1), (3, 2), (3, 2), (3, 1)])
    assert ds.phi.encoding["chunks"] == (4, 2, 4)
    assert ds.kind.dtype == np.int8


@pytest.mark.parametrize(
    ("sizes", "expected"),
    [
        ({"x": 10}, (10,)),
        ({"x": 3000, "y": 3000}, (750, 750)),
        ({"x": 20_000, "y": 20_000}, (1000, 1000)),
        ({"x": 10, "y": 10**8}, (10, 104_822)),
        ({"x": 500, "y": 500, "z": 500}, (100, 100, 100)),
        ({"x": 2, "y": 10**6}, (2, 62_500)),
    ],
)
def test_chunks_by_default_are_about_even_and_hold_a_million_cells(sizes, expected):
    from phasekit.cells.request import Part
    from phasekit.maps.parts import new_part
    from phasekit.table.quantities import select

    part = new_part("part0", Part(tuple(sizes), (), select(CODES), ()), sizes, {})
    assert part.chunks == expected
    forces = new_part("part0", Part(tuple(sizes), (), select("bearing_forces"), ()), sizes, {})
    assert np.prod(forces.chunks) * forces.cell_bytes <= 2**27


@pytest.mark.slow
def test_parts_lie_on_the_dims_on_which_they_depend(tmp_path):
    axes = {"beta": [0.1, 0.2, 0.3], "m": [1.0, 2.0], "state_phi": [0.1, 0.2], "state_dphi": 0.0}
    axes["half_span"] = [0.5]
    of = ["phi", "energy_integral", "force_magnitude"]
    expected = pk.sweep(DISK, axes, of=of)
    ds = pk.sweep(DISK, axes, of=of, store=tmp_path / "map.zarr", chunks=2, workers=1)
    assert ds.phi.dims == ("beta", "equilibrium")
    xr.testing.assert_identical(ds.load(), expected)
    one = pk.sweep(DISK, g=[9.8], r=[0.2], m=[1.0, 2.0], of="n_equilibria")
    two = pk.sweep(DISK, g=[9.8], r=[0.2], m=[1.0, 2.0], of="n_equilibria",
                   store=tmp_path / "one.zarr")  # fmt: skip
    xr.testing.assert_identical(two.load(), one)


def test_a_map_of_one_cell(tmp_path):
    disk = DISK.replace(m=1.0)
    ds = pk.sweep(disk, m=[1.0, 2.0], of="phi", store=tmp_path / "map.zarr")
    assert ds.phi.dims == ("equilibrium",)
    xr.testing.assert_identical(ds.load(), pk.sweep(disk, m=[1.0, 2.0], of="phi"))


@pytest.mark.slow
def test_paths_as_axes(tmp_path):
    s = xr.DataArray(np.linspace(0, 1, 9), dims="s", coords={"s": np.linspace(0, 1, 9)})
    named = xr.DataArray([0.2, 0.21], dims="case", coords={"case": ["thin", "thick"]})
    axes = {"beta": 0.1 + s, "a": 0.05 * s, "r": named}
    path = tmp_path / "map.zarr"
    ds = pk.sweep(DISK, axes, store=path, chunks={"s": 4}, workers=1)
    np.testing.assert_array_equal(ds.phi, pk.sweep(DISK, axes).phi)
    pk.sweep(DISK, axes, store=path, chunks={"s": 4})
    with pytest.raises(pk.StoreError, match="the values of case are others in the call"):
        pk.sweep(DISK, {**axes, "r": named.assign_coords(case=["thin", "thicker"])}, store=path)


def test_chunked_axes_are_read(tmp_path):
    pytest.importorskip("dask")
    beta = xr.DataArray(AXES["beta"], dims="beta").chunk(beta=2)
    ds = pk.sweep(DISK, {**AXES, "beta": beta}, store=tmp_path / "map.zarr")
    xr.testing.assert_identical(ds.load(), WHOLE)


# ------------------------------------------------------------------------------ dtypes


@pytest.mark.slow
def test_numbers_in_single_precision(tmp_path):
    for dtype in ("float32", np.float32):
        ds = pk.sweep(DISK, AXES, dtype=dtype, store=tmp_path / f"{dtype!r}.zarr".replace("'", ""))
        for name, full in WHOLE.data_vars.items():
            kind = np.float32 if full.dtype == float else full.dtype
            assert ds[name].dtype == kind
            np.testing.assert_array_equal(ds[name], full.astype(kind))
        xr.testing.assert_identical(ds.load(), pk.sweep(DISK, AXES, dtype=dtype))
    ds = pk.sweep(DISK, AXES, dtype={"phi": "float32"}, store=tmp_path / "one.zarr")
    assert (ds.phi.dtype, ds.energy.dtype) == (np.float32, np.float64)
    pk.sweep(DISK, AXES, store=tmp_path / "one.zarr")  # as the store has it


# ------------------------------------------------------------------------------ places


@pytest.mark.slow
@pytest.mark.parametrize("url", ["memory://tests/{}.zarr", "file://{}/map.zarr"])
def test_urls(url, tmp_path, computed):
    if url.startswith("memory"):
        pytest.importorskip("fsspec")
    url = url.format(tmp_path)
    xr.testing.assert_identical(pk.sweep(DISK, AXES, store=url).load(), WHOLE)
    count = len(computed)
    assert count
    pk.sweep(DISK, AXES, store=url)
    assert len(computed) == count
    with pytest.raises(pk.StoreError, match="e is 0.0115, in the call 0.02"):
        pk.sweep(DISK.replace(e=0.02), AXES, store=url)
    other = pk.sweep(DISK.replace(e=0.02), AXES, store=url, overwrite=True).load()
    xr.testing.assert_identical(other, pk.sweep(DISK.replace(e=0.02), AXES))


def test_stores_of_zarr():
    store = zarr.storage.MemoryStore()
    xr.testing.assert_identical(pk.sweep(DISK, AXES, store=store).load(), WHOLE)
    xr.testing.assert_identical(pk.open_map(store).load(), WHOLE)
    with pytest.raises(pk.StoreError, match="in other processes: .* lies in the memory"):
        pk.sweep(DISK, AXES, store=zarr.storage.MemoryStore(), workers=2, chunks=2)


def test_stores_that_cannot_be_continued(tmp_path):
    pk.sweep(DISK, AXES, of=CODES, store=tmp_path / "map.zarr")
    archive = shutil.make_archive(str(tmp_path / "map"), "zip", tmp_path / "map.zarr")
    with zarr.storage.ZipStore(archive, mode="r") as store:
        assert pk.open_map(store).load().equals(pk.sweep(DISK, AXES, of=CODES))
    store = zarr.storage.ZipStore(tmp_path / "new.zip", mode="w")
    with pytest.raises(pk.StoreError, match="cannot be changed once it is written"):
        pk.sweep(DISK, AXES, store=store)
    store = zarr.storage.LocalStore(tmp_path / "new.zarr", read_only=True)
    with pytest.raises(pk.StoreError, match="was opened for reading"):
        pk.sweep(DISK, AXES, store=store)


def test_a_file_is_in_the_way(tmp_path):
    (tmp_path / "map.zarr").write_text("text")
    for overwrite in (False, True):
        with pytest.raises(pk.StoreError, match="map.zarr is a file, not a folder of Zarr"):
            pk.sweep(DISK, AXES, store=tmp_path / "map.zarr", overwrite=overwrite)


def test_a_map_that_has_only_just_been_begun(tmp_path):
    (tmp_path / "map.zarr").mkdir()
    with pytest.raises(pk.StoreError, match="there is no map, or not yet"):
        pk.open_map(tmp_path / "map.zarr")


@pytest.mark.slow
def test_an_empty_folder_is_free(tmp_path):
    xr.testing.assert_identical(pk.sweep(DISK, AXES, store=tmp_path / "x.zarr").load(), WHOLE)
    (tmp_path / "map.zarr").mkdir()
    xr.testing.assert_identical(pk.sweep(DISK, AXES, store=tmp_path / "map.zarr").load(), WHOLE)


# ------------------------------------------------------------------------------ processes


@pytest.mark.slow
def test_scripts_need_no_guard(tmp_path):
    """Worker processes do not run the script that starts them."""
    (tmp_path / "script.py").write_text(
        "import numpy as np, phasekit as pk\n"
        "print('runs')\n"
        "disk = pk.GyroRotorDisk(beta=0.3, e=0.0115, a=0.02, r=0.21, omega1=2.5)\n"
        "ds = pk.sweep(disk, beta=np.linspace(0.1, 1.5, 40), store='map.zarr', chunks=10,\n"
        "              workers=2, progress=True)\n"
        "print(int(ds.n_equilibria.min()))\n"
    )
    done = subprocess.run(
        [sys.executable, "-W", "error", "script.py"],
        cwd=tmp_path,
        capture_output=True,
        text=True,
        check=True,
    )
    assert done.stdout == "runs\n2\n"
    assert "40.0/40.0" in done.stderr


def test_the_bar_begins_where_the_map_stood(tmp_path, capfd):
    store = tmp_path / "map.zarr"
    pk.sweep(DISK, AXES, of=CODES, store=store, chunks=4, workers=1, progress=True)
    assert "35.0/35.0" in capfd.readouterr().err
    axes = {**AXES, "a": np.append(AXES["a"], [0.06, 0.07, 0.08])}
    pk.sweep(DISK, axes, of=CODES, store=store, workers=1, progress=True)
    err = capfd.readouterr().err
    assert "28.0/56.0" in err
    assert "56.0/56.0" in err
    pk.sweep(DISK, axes, of=CODES, store=store, progress=True)
    assert capfd.readouterr().err == ""


# ------------------------------------------------------------------------------ campaigns


@pytest.mark.slow
def test_the_same_call_computes_nothing(tmp_path, computed):
    store = tmp_path / "map.zarr"
    pk.sweep(DISK, AXES, store=store, chunks=3)
    files, count = content(store), len(computed)
    for of in (("equilibria", "separatrices"), "phi", CODES):
        pk.sweep(DISK, AXES, of=of, store=store)
    assert len(computed) == count
    assert content(store) == files


@pytest.mark.slow
def test_more_quantities_are_added(tmp_path, computed):
    store = tmp_path / "map.zarr"
    pk.sweep(DISK, AXES, of=CODES, store=store, chunks=3)
    count = len(computed)
    ds = pk.sweep(DISK, AXES, store=store, chunks=3)
    assert len(computed) == 2 * count
    xr.testing.assert_identical(ds.load(), WHOLE)
    states = {"state_phi": 0.3, "state_dphi": [0.0, 1.0]}
    ds = pk.sweep(DISK.replace(m=2.0), {**AXES, **states}, of="orbits", store=store)
    assert ds.period.dims == ("beta", "a", "state_dphi")
    assert ds.m.item() == 2.0
    ds = pk.sweep(DISK.replace(m=2.0), AXES, of="fold_margin", store=store)
    assert ds.state_phi.item() == 0.3
    expected = pk.sweep(DISK.replace(m=2.0), {**AXES, **states}, of=[*WHOLE.data_vars, "orbits"])
    xr.testing.assert_identical(ds.load(), expected)
    with pytest.raises(pk.StoreError, match="m is 2.0, in the call not given"):
        pk.sweep(DISK, AXES, store=store)


@pytest.fixture(scope="module")
def in_tiles(tmp_path_factory):
    """The files of a map that was made at once."""
    path = tmp_path_factory.mktemp("tiles") / "whole.zarr"
    pk.sweep(DISK, AXES, store=path, chunks={"beta": 2, "a": 2})
    return content(path)


@pytest.mark.slow
@pytest.mark.parametrize(("before", "new"), [(4, 3 * 2), (3, 3 + 3 * 2)])
def test_longer_axes_compute_only_the_tiles_with_new_cells(
    before, new, tmp_path, in_tiles, computed
):
    store = tmp_path / "map.zarr"
    chunks = {"beta": 2, "a": 2}
    pk.sweep(DISK, {**AXES, "beta": AXES["beta"][:before]}, store=store, chunks=chunks)
    del computed[:]
    ds = pk.sweep(DISK, AXES, store=store, chunks=chunks)
    assert len(computed) == new
    xr.testing.assert_identical(ds.load(), WHOLE)
    assert content(store) == in_tiles


def test_what_makes_an_axis_longer_names_all_quantities(tmp_path):
    store = tmp_path / "map.zarr"
    short = {**AXES, "beta": AXES["beta"][:4]}
    pk.sweep(DISK, short, of=CODES, store=store)
    with pytest.raises(pk.StoreError, match="fewer values of beta than the call, which does not"):
        pk.sweep(DISK, AXES, of="topology", store=store)
    xr.testing.assert_identical(
        pk.sweep(DISK, AXES, of=CODES, store=store).load(), pk.sweep(DISK, AXES, of=CODES)
    )


def test_maps_that_xarray_wrote_are_not_continued(tmp_path):
    WHOLE.to_zarr(tmp_path / "map.zarr", zarr_format=3, consolidated=False)
    with pytest.raises(pk.StoreError, match="does not say how it was made"):
        pk.sweep(DISK, AXES, store=tmp_path / "map.zarr")
    ds = pk.sweep(DISK, AXES, of="phi", store=tmp_path / "map.zarr", overwrite=True)
    assert list(ds.data_vars) == ["phi"]


# ------------------------------------------------------------------------------ not finished


@pytest.fixture
def part(tmp_path, monkeypatch):
    """A map of which the first three of six tiles are done."""
    original, count = tile.compute_cells, iter(range(100))

    def fail(*args):
        if next(count) == 3:
            raise RuntimeError("no more")
        return original(*args)

    with monkeypatch.context() as patch:
        patch.setattr(tile, "compute_cells", fail)
        with pytest.raises(pk.StoreError, match="RuntimeError: no more; 3 of 6 tiles are left"):
            pk.sweep(DISK, AXES, store=tmp_path / "map.zarr", chunks={"beta": 3, "a": 3}, workers=1)
    return tmp_path / "map.zarr"


@pytest.mark.slow
def test_a_map_that_is_not_finished(part):
    ds = pk.open_map(part)
    computed = ds.computed
    assert computed.dtype == bool
    assert computed.dims == ("beta", "a")
    expected = np.zeros((7, 5), bool)
    expected[:3] = expected[3:6, :3] = True
    np.testing.assert_array_equal(computed, expected)
    full = ds.load()
    for name, whole in WHOLE.data_vars.items():
        missing = full[name].where(~computed, drop=True)
        assert full[name].dtype == whole.dtype
        xr.testing.assert_identical(
            full[name].where(computed, drop=True), whole.where(computed, drop=True)
        )
        if whole.dtype == float:
            assert np.isnan(missing).all()
        elif name in ("kind", "topology", "n_equilibria"):
            assert set(np.unique(missing.values[~np.isnan(missing.values)])) == {-1.0}
    assert not full.figure_eight.where(~computed, False).any()
    assert full.phasekit.system() == DISK.replace(**AXES)


@pytest.mark.slow
@pytest.mark.parametrize(
    "key",
    [
        {"beta": 0},
        {"beta": -1, "a": 0},
        {"a": slice(1, None, 2)},
        {"beta": [6, 0, 3], "a": [4, 0]},
        {"beta": slice(None, None, -1)},
        {"beta": xr.DataArray([0, 6], dims="z"), "a": xr.DataArray([0, 4], dims="z")},
        {"beta": []},
    ],
)
def test_what_is_computed_can_be_selected_before_it_is_read(key, part):
    ds = pk.open_map(part)
    whole = ds.computed.copy(deep=True).load()
    xr.testing.assert_identical(ds.computed.isel(key).load(), whole.isel(key))


@pytest.mark.slow
def test_it_is_read_lazily_and_in_chunks(part, monkeypatch):
    pytest.importorskip("dask")
    lazy = pk.open_map(part, chunks={})
    assert lazy.computed.chunks == lazy.topology.chunks == ((3, 3, 1), (3, 2))
    assert pk.open_map(part, chunks={"beta": -1}).computed.chunks == ((7,), (3, 2))
    assert pk.open_map(part, chunks=-1).computed.chunks == ((7,), (5,))
    xr.testing.assert_identical(lazy.compute(), pk.open_map(part).load())


@pytest.mark.slow
def test_it_goes_on(part, computed):
    ds = pk.sweep(DISK, AXES, store=part, workers=1)
    assert len(computed) == 3
    assert "computed" not in ds
    xr.testing.assert_identical(ds.load(), WHOLE)


@pytest.mark.slow
def test_parts_without_their_states_are_left(tmp_path, part):
    axes = {**AXES, "state_phi": 0.1, "state_dphi": 0.0}
    with pytest.raises(pk.StoreError, match="chunks of 3 along beta"):
        pk.sweep(DISK, axes, of=["orbits", "phi"], store=part, chunks=2)
    ds = pk.sweep(DISK, axes, of="orbits", store=part, workers=1)
    assert not ds.computed.all()  # of what the first call asked for
    assert not np.isnan(ds.action.isel(beta=slice(1, None))).all()


# ------------------------------------------------------------------------------ estimates


@pytest.mark.slow
def test_size_and_time_are_estimated(tmp_path):
    from phasekit.maps.place import place_of
    from phasekit.maps.sweep import plan_sweep

    store = tmp_path / "map.zarr"
    axes = {"beta": np.linspace(0.01, 1.5, 300), "a": np.linspace(0, 0.05, 300)}
    what = {"of": ("equilibria", "separatrices"), "store": store}
    needed = plan_sweep(DISK, axes, **what).estimate()
    assert not store.exists()
    assert needed.cells == 90_000
    assert needed.raw == sum(v.nbytes for v in pk.sweep(DISK, axes).data_vars.values())
    pk.sweep(DISK, axes, **what, workers=1)
    assert 0.7 < needed.stored / place_of(store).size() < 1.4
    assert plan_sweep(DISK, axes, **what).count == 0


@pytest.mark.slow
def test_what_does_not_fit_is_refused_before_anything_is_removed(tmp_path, monkeypatch):
    store = tmp_path / "map.zarr"
    axes = {"beta": np.linspace(0.01, 1.5, 100), "a": np.linspace(0, 0.05, 60)}
    pk.sweep(DISK, AXES, store=store)
    monkeypatch.setattr("phasekit.maps.place.Place.free_bytes", lambda self: 100_000)
    before = content(store)
    with pytest.raises(pk.StoreError, match=r"the map will not fit: it takes about .* MB more"):
        pk.sweep(DISK, axes, store=store, overwrite=True)
    assert content(store) == before
    with pytest.raises(pk.StoreError, match=r"a disk that has 100 kB left; make room"):
        pk.sweep(DISK, axes, store=tmp_path / "new.zarr")
    assert not (tmp_path / "new.zarr").exists()
    pk.sweep(DISK, axes, store=tmp_path / "new.zarr", force=True)


def test_a_map_larger_than_memory(tmp_path, monkeypatch):
    monkeypatch.setattr("phasekit.numerics.memory.available_memory", lambda: 1000)
    monkeypatch.setattr("phasekit.numerics.memory.ALWAYS", 0)
    with pytest.raises(pk.ParameterError, match=r"store='map\.zarr'"):
        pk.sweep(DISK, AXES)
    xr.testing.assert_identical(pk.sweep(DISK, AXES, store=tmp_path / "map.zarr").load(), WHOLE)


@pytest.mark.slow
def test_processes_are_started_for_long_work_alone(tmp_path, monkeypatch):
    started = []

    def watched(tiles, number):
        started.append(number)
        return run.run.in_this_process(tiles)

    monkeypatch.setattr(run.run, "in_processes", watched)
    monkeypatch.setattr("phasekit.numerics.launch.cpus", lambda: 3)
    axes = {"beta": np.linspace(0.01, 1.5, 200), "a": np.linspace(0, 0.05, 150)}
    for number, seconds in enumerate((1e9, 0.0)):
        monkeypatch.setattr(run, "FEW_SECONDS", seconds)
        pk.sweep(DISK, axes, store=tmp_path / f"{number}.zarr", of=CODES, chunks=50)
    assert started == [3]


AS_IN_A_WORKER = """
import pickle, sys
from phasekit.maps.worker_process import Later
sys.modules["xarray"] = Later("xarray")
calls = pickle.load(open(sys.argv[1], "rb"))
from phasekit.maps.tile import compute_cells
for call in calls:
    assert compute_cells(*call)["n_equilibria"].max() == 4
assert "pandas" not in sys.modules, "labels were loaded"
import xarray
assert xarray.DataArray([1.0]).item() == 1.0
assert type(sys.modules["xarray"]).__name__ == "module"
"""


@pytest.mark.slow
def test_worker_processes_start_without_labels(tmp_path, monkeypatch):
    calls = []
    original = tile.compute_cells
    monkeypatch.setattr(tile, "compute_cells", lambda *call: calls.append(call) or original(*call))
    pk.sweep(DISK, AXES, store=tmp_path / "map.zarr", of=CODES, workers=1)
    assert calls
    (tmp_path / "calls").write_bytes(pickle.dumps(calls))
    command = [sys.executable, "-c", AS_IN_A_WORKER, str(tmp_path / "calls")]
    subprocess.run(command, check=True, timeout=120)


# ------------------------------------------------------------------------------ options


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"chunks": 0}, r"chunks: got 0, wants a number of cells >= 1 or -1"),
        ({"chunks": "auto"}, "chunks: got 'auto', wants"),
        ({"chunks": {"bta": 3}}, "chunks: dim 'bta' is unknown; did you mean 'beta'"),
        ({"chunks": {"beta": 1.5}}, r"chunks: got 1\.5, wants"),
        ({"chunks": {"beta": True}}, "chunks: got True, wants"),
        ({"workers": 0}, "workers: got 0, wants a number of processes >= 1"),
        ({"workers": 1.5}, r"workers: got 1\.5, wants"),
        ({"workers": True}, "workers: got True, wants"),
        ({"workers": 2, "client": "tcp://localhost:1"}, "workers: got it together with client="),
        ({"dtype": "int8"}, "dtype: got 'int8', wants 'float32' or 'float64'"),
        ({"dtype": "single_"}, "dtype: got 'single_', wants"),
        ({"dtype": {"kind": "float32"}}, "dtype: got one for 'kind', which holds codes"),
        ({"dtype": {"ph": "float32"}}, "dtype: the quantity 'ph' is unknown; did you mean 'phi'"),
        ({"dtype": {"phi": None}}, "dtype of phi: got None, wants"),
        ({"force": "yes"}, "force: got 'yes', wants True or False"),
        ({"client": 3}, "client: got 3, wants a dask.distributed.Client or the address"),
    ],
)
def test_wrong_options_are_named(options, message, tmp_path):
    with pytest.raises(pk.ParameterError, match=message):
        pk.sweep(DISK, AXES, store=tmp_path / "map.zarr", **options)
    assert not (tmp_path / "map.zarr").exists()


@pytest.mark.parametrize(
    "option", [{"chunks": 2}, {"workers": 2}, {"client": "x"}, {"force": True}]
)
@pytest.mark.parametrize("store", [None, "map.nc"])
def test_options_of_stores_need_a_zarr_store(option, store, tmp_path):
    store = store and tmp_path / store
    with pytest.raises(pk.ParameterError, match=f"{next(iter(option))}: got .* give store="):
        pk.sweep(DISK, AXES, store=store, **option)


def test_tiles_that_no_process_can_hold(tmp_path):
    axes = {"beta": np.linspace(0, 1.5, 400_000), "a": np.linspace(0, 0.06, 300_000)}
    for chunks in (-1, 10**6):
        with pytest.raises(pk.ParameterError, match="chunks: got tiles of beta .* TB of results"):
            pk.sweep(DISK, axes, store=tmp_path / "map.zarr", chunks=chunks, force=True)
    assert not (tmp_path / "map.zarr").exists()


@pytest.mark.slow
def test_no_scheduler_there(tmp_path):
    pytest.importorskip("distributed")
    before = set(threading.enumerate())
    with pytest.raises(pk.StoreError, match="client: no scheduler answers at nowhere"):
        pk.sweep(DISK, AXES, store=tmp_path / "map.zarr", client="nowhere://x")
    # Otherwise its thread is waited for where it is collected, or 20 s at the end of the process.
    assert [one.name for one in threading.enumerate() if one not in before] == []


@pytest.mark.slow
def test_on_a_cluster(tmp_path):
    distributed = pytest.importorskip("distributed")
    with distributed.LocalCluster(
        n_workers=1, threads_per_worker=2, processes=False, dashboard_address=":0"
    ) as cluster:
        address = cluster.scheduler_address
        ds = pk.sweep(DISK, AXES, store=tmp_path / "map.zarr", chunks=2, client=address)
        xr.testing.assert_identical(ds.load(), WHOLE)
        with distributed.Client(cluster, set_as_default=False) as client:
            pk.sweep(DISK, AXES, store=tmp_path / "two.zarr", chunks=2, client=client)
        with pytest.raises(pk.StoreError, match="client: it is closed, wants one that is"):
            pk.sweep(DISK, AXES, store=tmp_path / "three.zarr", client=client)
    assert content(tmp_path / "map.zarr") == content(tmp_path / "two.zarr")


def test_the_layout_has_a_version():
    assert LAYOUT == 2  # a change of what is in a store needs another one
