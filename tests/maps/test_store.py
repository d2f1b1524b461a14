"""Stored maps come back as they were, and nothing is overwritten unasked."""

import os
import shutil

import numpy as np
import pytest
import xarray as xr

import phasekit as pk
from phasekit.maps import files

DISK = pk.GyroRotorDisk(beta=0.3, e=0.0115, a=0.02, r=0.21, omega1=2.5, m=1.5)
AXES = {"beta": [-0.1, 0.1, 0.5, 1.2], "a": np.array([0.0, 0.01, 0.02])}
PATH = xr.DataArray([0.1, 0.2], dims="case", coords={"case": [10, 20]})

pytest.importorskip("zarr")

MAPS = {
    "map": pk.sweep(DISK, AXES),
    "codes": pk.sweep(DISK, AXES, of=["n_equilibria", "topology", "figure_eight", "kind"]),
    "cell": pk.sweep(DISK, AXES).isel(beta=1, a=2),
    "one label": pk.sweep(DISK, AXES).sel(equilibrium="lower_center", saddle="upper", side="left"),
    "reduced": pk.sweep(pk.Reduced(0.1, 0.2), lam=[0.1, 0.2], psi=[0.0, 0.3]),
    "path": pk.equilibria(DISK.replace(beta=PATH, a=PATH)),
    "energy": pk.energy(DISK, [0.1, 0.2], [0.3, 0.4]),
    "critical": pk.critical(DISK, "beta"),
}
SUFFIXES = [".zarr", ".nc"]


def assert_same(left, right):
    """Identical in every sense that counts: values, dtypes, attributes and their types.

    One label alone, of which xarray makes one of a fixed width, is Python's string again.
    """
    xr.testing.assert_identical(left, right)
    assert list(left.data_vars) == list(right.data_vars)
    assert left.sizes == right.sizes
    for name in left.variables:
        if left[name].dtype.kind != "U":
            assert left[name].dtype == right[name].dtype, name
        assert left[name].attrs.keys() == right[name].attrs.keys()
        for key, value in left[name].attrs.items():
            other = right[name].attrs[key]
            assert type(value) is type(other), (name, key)
            assert getattr(value, "dtype", None) == getattr(other, "dtype", None)
    assert left.attrs == right.attrs


def write(ds, path):
    ds = files.with_texts(ds)
    if path.suffix == ".nc":
        pytest.importorskip("h5netcdf")
        ds.to_netcdf(path, engine="h5netcdf")
    else:
        ds.to_zarr(path, zarr_format=3, consolidated=False)


@pytest.mark.slow
@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize("suffix", SUFFIXES)
@pytest.mark.parametrize("name", MAPS)
def test_round_trip_leaves_everything_unchanged(name, suffix, tmp_path):
    path = tmp_path / f"map{suffix}"
    write(MAPS[name], path)
    with pk.open_map(path) as back:
        assert_same(MAPS[name], back.load())
    again = tmp_path / f"again{suffix}"
    write(back, again)
    with pk.open_map(again) as back:
        assert_same(MAPS[name], back.load())


@pytest.mark.slow
@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize("suffix", SUFFIXES)
def test_plain_xarray_reads_the_same_values(suffix, tmp_path):
    path = tmp_path / f"map{suffix}"
    write(MAPS["map"], path)
    back = (
        xr.open_dataset(path, engine="h5netcdf")
        if suffix == ".nc"
        else xr.open_zarr(path, consolidated=False, chunks=None)
    )
    with back:
        xr.testing.assert_identical(MAPS["map"], back.load())
        for name in MAPS["map"].data_vars:
            assert back[name].dtype == MAPS["map"][name].dtype
        assert back.isel(beta=1, a=1).phasekit.system() == DISK.replace(beta=0.1, a=0.01)
    if suffix == ".zarr":
        assert back.equilibrium.values.tolist() == MAPS["map"].equilibrium.values.tolist()


@pytest.mark.slow
@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize(
    ("system", "name", "more"),
    [
        (DISK, "beta", "separatrices"),
        (pk.Potential("x^4/4 - mu*x^2/2", "x", {"mu": 1.0}), "mu", "separatrices"),
        (
            pk.Problem({"x": "mu - x^2"}, parameters={"mu": 1.0}, window={"x": (-3, 3)}),
            "mu",
            "period",
        ),
    ],
)
def test_others_open_a_map_by_its_root(system, name, more, tmp_path):
    """A fresh one, one that was made longer, and one with more quantities, in a later call."""
    path = tmp_path / "map.zarr"
    for n, of in [(2, "equilibria"), (3, "equilibria"), (3, more)]:
        ds = pk.sweep(system, {name: 0.2 + 0.1 * np.arange(n)}, of=of, store=path)
        held = pk.open_map(path)
        for back in (xr.open_zarr(path), xr.open_dataset(path, engine="zarr")):
            assert held.data_vars.keys() == back.data_vars.keys()
            for one in ds.data_vars:
                xr.testing.assert_equal(ds[one].variable.load(), back[one].variable.load())


@pytest.mark.filterwarnings("error")
def test_others_open_a_branch_by_its_root(tmp_path):
    problem = pk.Problem({"x": "mu - x^2"}, parameters={"mu": 1.0}, window={"x": (-3, 3)})
    branch = pk.continuation(problem, "mu", span=(0.5, 1.0), x0={"x": 1.0})
    branch.save(tmp_path / "branch.zarr")
    back = xr.open_zarr(tmp_path / "branch.zarr")
    np.testing.assert_array_equal(back.x, branch.points.x)


@pytest.mark.slow
@pytest.mark.parametrize("suffix", SUFFIXES)
def test_sweep_writes_what_it_returns(suffix, tmp_path):
    if suffix == ".nc":
        pytest.importorskip("h5netcdf")
    path = tmp_path / f"map{suffix}"
    ds = pk.sweep(DISK, AXES, store=path)
    assert_same(ds, MAPS["map"])
    with pk.open_map(str(path)) as back:
        assert_same(ds, back.load())
        assert back.phasekit.system() == DISK.replace(**AXES)
    assert os.listdir(tmp_path) == [path.name]


@pytest.mark.slow
@pytest.mark.parametrize("suffix", SUFFIXES)
def test_existing_maps_are_replaced_only_when_asked(suffix, tmp_path):
    if suffix == ".nc":
        pytest.importorskip("h5netcdf")
    path = tmp_path / f"map{suffix}"
    pk.sweep(DISK, AXES, store=path)
    with pytest.raises(pk.StoreError, match="choose another name, or pass overwrite=True"):
        pk.sweep(DISK, beta=[0.1], store=path)
    with pk.open_map(path) as back:
        assert_same(MAPS["map"], back.load())
    ds = pk.sweep(DISK, beta=[0.1], store=path, overwrite=True)
    with pk.open_map(path) as back:
        assert_same(ds, back.load())
    assert os.listdir(tmp_path) == [path.name]


def test_what_is_not_a_map_is_never_overwritten(tmp_path):
    pytest.importorskip("h5netcdf")
    folder = tmp_path / "thesis.zarr"
    folder.mkdir()
    (folder / "chapter1.tex").write_text("...")
    file = tmp_path / "notes.nc"
    file.write_text("...")
    for path in (folder, file):
        with pytest.raises(pk.StoreError, match="is not a map, so it is not overwritten"):
            pk.sweep(DISK, beta=[0.1], store=path, overwrite=True)
    assert (folder / "chapter1.tex").read_text() == file.read_text() == "..."


@pytest.mark.slow
def test_a_failed_write_leaves_nothing_and_keeps_what_was_there(tmp_path, monkeypatch):
    pytest.importorskip("h5netcdf")
    path = tmp_path / "map.nc"
    pk.sweep(DISK, AXES, store=path)

    def fail(*_, **__):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(xr.Dataset, "to_netcdf", fail)
    with pytest.raises(pk.StoreError, match="was not written: .*No space left"):
        pk.sweep(DISK, beta=[0.1], store=path, overwrite=True)
    assert os.listdir(tmp_path) == ["map.nc"]
    with pk.open_map(path) as back:
        assert_same(MAPS["map"], back.load())


def test_unusable_places_are_refused_before_the_work(tmp_path, monkeypatch):
    def work(*_, **__):
        raise AssertionError("worked")

    monkeypatch.setattr("phasekit.maps.sweep.compute", work)
    monkeypatch.setattr("phasekit.maps.tile.compute_cells", work)
    for store, error, message in (
        (tmp_path / "no" / "map.zarr", pk.StoreError, "does not exist; make it first"),
        (tmp_path / "map.txt", pk.ParameterError, r"ends in \.zarr or \.nc"),
        (tmp_path / "map", pk.ParameterError, r"ends in \.zarr or \.nc"),
        ("", pk.ParameterError, "^store: got ''"),
        (3, pk.ParameterError, "^store: got 3"),
        ("no://bucket/map.zarr", pk.StoreError, "cannot be reached: .* URLs need fsspec"),
    ):
        with pytest.raises(error, match=message):
            pk.sweep(DISK, beta=[0.1], store=store)


def test_opening_what_is_not_a_map(tmp_path):
    with pytest.raises(pk.StoreError, match="does not exist"):
        pk.open_map(tmp_path / "map.zarr")
    (tmp_path / "empty.zarr").mkdir()
    with pytest.raises(pk.StoreError, match="cannot be read"):
        pk.open_map(tmp_path / "empty.zarr")
    pytest.importorskip("h5netcdf")
    (tmp_path / "text.nc").write_text("no")
    with pytest.raises(pk.StoreError, match="cannot be read"):
        pk.open_map(tmp_path / "text.nc")
    write(xr.Dataset({"x": 1.0}), tmp_path / "other.nc")
    with pytest.raises(pk.StoreError, match="is not a map of phasekit"):
        pk.open_map(tmp_path / "other.nc")
    write(MAPS["map"].assign_attrs(phasekit_schema="0"), tmp_path / "old.nc")
    with pytest.raises(pk.StoreError, match="schema '0', wants '1'"):
        pk.open_map(tmp_path / "old.nc")


def test_identical_runs_make_identical_files(tmp_path):
    def content(folder):
        return {
            str(file.relative_to(folder)): file.read_bytes()
            for file in sorted(folder.rglob("*"))
            if file.is_file()
        }

    pk.sweep(DISK, AXES, store=tmp_path / "one.zarr")
    pk.sweep(DISK, AXES, store=tmp_path / "two.zarr")
    assert content(tmp_path / "one.zarr") == content(tmp_path / "two.zarr")


def test_chunked_opening(tmp_path):
    pytest.importorskip("dask")
    path = tmp_path / "map.zarr"
    ds = pk.sweep(DISK, AXES, store=path)
    back = pk.open_map(path, chunks={})
    assert back.phi.chunks is not None
    assert_same(ds, back.load())


@pytest.mark.parametrize("suffix", [".zarr", ".nc"])
def test_files_of_others_are_never_overwritten(suffix, tmp_path):
    """A store of the same format that phasekit did not make is data, not a map."""
    path = tmp_path / f"thesis{suffix}"
    measured = xr.Dataset({"measured": ("t", [1.0, 2.0])})
    if suffix == ".zarr":
        measured.to_zarr(path, zarr_format=3, consolidated=False)
    else:
        measured.to_netcdf(path, engine="h5netcdf")
    with pytest.raises(pk.StoreError, match="is not a map"):
        pk.sweep(pk.Reduced(0.1, 0.2), lam=[0.1, 0.2], store=path, overwrite=True)
    with xr.open_dataset(
        path,
        engine="zarr" if suffix == ".zarr" else "h5netcdf",
        **({"consolidated": False} if suffix == ".zarr" else {}),
    ) as kept:
        assert list(kept) == ["measured"]


@pytest.mark.parametrize(
    ("option", "value"), [("overwrite", "no"), ("overwrite", 1), ("progress", "yes")]
)
def test_switches_are_true_or_false(option, value, tmp_path):
    path = tmp_path / "map.zarr"
    with pytest.raises(pk.ParameterError, match=f"{option}: got .* wants True or False"):
        pk.sweep(pk.Reduced(0.1, 0.2), lam=[0.1, 0.2], store=path, **{option: value})
    assert not path.exists()


@pytest.mark.parametrize("store", ["~nosuchuser/x.zarr", "a\0.zarr"])
def test_paths_that_cannot_be_are_refused(store):
    with pytest.raises(pk.ParameterError, match="store: got"):
        pk.open_map(store)
    with pytest.raises(pk.ParameterError, match="store: got"):
        pk.sweep(pk.Reduced(0.1, 0.2), lam=[0.1, 0.2], store=store)


def test_a_map_that_appears_while_it_is_opened_is_not_taken_for_a_finished_one(
    tmp_path, monkeypatch
):
    """Its coordinates are there before its data, and its plan after the reader looked for one."""
    from phasekit.maps import whole

    there, early = tmp_path / "there.zarr", tmp_path / "early.zarr"
    pk.sweep(pk.Reduced(lam=0.5, psi=0.2), {"lam": [0.5, 1.5]}, store=there, chunks={"lam": 1})
    shutil.copytree(there, early)
    shutil.rmtree(early / "sweep")
    for folder in early.iterdir():
        if folder.is_dir() and folder.name not in ("lam", "psi"):
            shutil.rmtree(folder)
    look = whole.read_plan

    def looked_too_early(store):
        if (early / "sweep").exists():
            return look(store)
        assert look(store) is None
        shutil.copytree(there / "sweep", early / "sweep")
        return None

    monkeypatch.setattr(whole, "read_plan", looked_too_early)
    with pytest.raises(pk.StoreError, match="are being created"):
        pk.open_map(early)
