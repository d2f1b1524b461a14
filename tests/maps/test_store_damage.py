"""Damaged stores: every damage is noticed, said, and where a tile is damaged, mended.

``PHASEKIT_DAMAGES=3000 PHASEKIT_SEED=1`` changes the files of a store in so many ways, others than
those of every run; ``PHASEKIT_KILLS=1`` stops an extension after each of its writes.
"""

import dataclasses
import itertools
import json
import os
import random
import shutil
import warnings
from pathlib import Path

import numpy as np
import pytest
import xarray as xr
from witnesses.variants import ALL

import phasekit as pk
from phasekit.cli import main
from phasekit.maps import tile
from phasekit.maps.place import place_of

zarr = pytest.importorskip("zarr")

DISK = pk.GyroRotorDisk(beta=0.3, e=0.0115, a=0.02, r=0.21, omega1=2.5)
AXES = {"beta": np.linspace(0.1, 1.5, 5), "a": np.array([0.0, 0.02, 0.05])}
CALL = {"of": ["n_equilibria", "phi"], "chunks": {"beta": 2, "a": 2}, "workers": 1}
EXPECTED = pk.sweep(DISK, AXES, of=CALL["of"])


def sweep(path, axes=AXES, **options):
    return pk.sweep(DISK, axes, store=path, **{**CALL, **options})


def content(store):
    return {str(f.relative_to(store)): f.read_bytes() for f in store.rglob("*") if f.is_file()}


@pytest.fixture(scope="module")
def whole(tmp_path_factory):
    """A complete map."""
    path = tmp_path_factory.mktemp("whole") / "map.zarr"
    sweep(path)
    return path


def begun(path, tiles=3):
    """Begin a map, of which some tiles are done."""
    original, count = tile.compute_cells, iter(range(100))

    def fail(*args):
        if next(count) == tiles:
            raise RuntimeError("stopped")
        return original(*args)

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(tile, "compute_cells", fail)
        with pytest.raises(pk.StoreError, match="stopped"):
            sweep(path)
    return path


@pytest.fixture
def store(whole, tmp_path):
    return Path(shutil.copytree(whole, tmp_path / "map.zarr"))


def flip(file, place=-5):
    data = bytearray(file.read_bytes())
    data[place] ^= 16
    file.write_bytes(data)


def cut(file):
    file.write_bytes(file.read_bytes()[:-1])


def exchange(file):
    other = file.with_name(file.name.replace("c.1.0", "c.0.1"))
    one, two = file.read_bytes(), other.read_bytes()
    assert one != two
    file.write_bytes(two)
    other.write_bytes(one)


def directory(file):
    file.unlink()
    file.mkdir()


def exchange_with_mark(file):
    """The neighbours' marks as well, so that each chunk is what its mark says."""
    exchange(file)
    exchange(file.parent.parent / "n_equilibria" / "c.1.0")
    exchange(file.parent.parent / "sweep" / "part0" / "c.1.0")


DAMAGES = {
    "removed": (Path.unlink, True),
    "cut": (cut, True),
    "a folder": (directory, True),
    "flipped": (flip, False),
    "its first bit flipped": (lambda file: flip(file, 0), False),
    "its checksum flipped": (lambda file: flip(file, -1), False),
    "exchanged": (exchange, None),
}


#: Each of them, in finished stores and others by turns.
TURNS = [
    case
    for i, case in enumerate(itertools.product(DAMAGES, [True, False]))
    if ALL or i % 4 in (0, 3)
]


@pytest.mark.parametrize(("damage", "finished"), TURNS)
def test_a_damaged_chunk(damage, finished, store, tmp_path, whole, capsys):
    if not finished:
        store = begun(tmp_path / "begun.zarr")
    change, at_once = DAMAGES[damage]
    change(store / "phi" / "c.1.0.0")
    tiles = r"\[2:4, 0:2\]|\[0:2, 2:3\]"
    if at_once:
        with pytest.raises(pk.StoreError, match=rf"damaged: .*({tiles}).*phi"):
            pk.open_map(store)
        assert main(["info", str(store)]) == 2
    elif at_once is False:
        with pk.open_map(store) as ds:
            np.testing.assert_array_equal(ds.phi[:2, :2], EXPECTED.phi[:2, :2])
            with pytest.raises(pk.StoreError, match=rf"phi in the tile {tiles}"):
                ds.phi.load()
    with pytest.raises(pk.StoreError, match=rf"({tiles}).*phi.*repeat the call of sweep"):
        pk.open_map(store, verify=True).load()
    capsys.readouterr()
    assert main(["info", str(store), "--verify"]) == 2
    said = capsys.readouterr().err
    assert "phi" in said
    assert "repeat the call of sweep" in said
    with pytest.warns(UserWarning, match=rf"({tiles}).*phi.*computed again"):
        xr.testing.assert_identical(sweep(store).load(), EXPECTED)
    assert content(store) == content(whole)
    assert main(["info", str(store), "--verify"]) == 0
    assert "6 tiles are as they were written" in capsys.readouterr().out


def test_tiles_that_are_exchanged_with_their_marks(store, whole):
    exchange_with_mark(store / "phi" / "c.1.0.0")
    with pytest.raises(pk.StoreError, match=r"tile \[0:2, 2:3\].* has no mark that it is done"):
        pk.open_map(store)
    with pytest.warns(UserWarning, match=r"\[2:4, 0:2\]"):
        sweep(store)
    assert content(store) == content(whole)


def test_a_chunk_of_another_map(store, tmp_path):
    """Whole files of a map with another parameter are damage as well."""
    pk.sweep(DISK.replace(e=0.02), AXES, store=tmp_path / "other.zarr", **CALL)
    for name in ("phi/c.0.0.0", "n_equilibria/c.0.0", "sweep/part0/c.0.0"):
        shutil.copy(tmp_path / "other.zarr" / name, store / name)
    with pytest.raises(pk.StoreError, match=r"tile \[0:2, 0:2\]"):
        pk.open_map(store)


def test_damage_is_noticed_in_dask_arrays(store):
    pytest.importorskip("dask")
    flip(store / "phi" / "c.1.0.0")
    with pk.open_map(store, chunks={}) as ds, pytest.raises(pk.StoreError, match="phi in the tile"):
        ds.phi.max().compute()


def test_a_map_that_is_read_while_it_is_replaced(store):
    with pk.open_map(store) as ds:
        pk.sweep(DISK.replace(e=0.02), AXES, store=store, **CALL, overwrite=True)
        with pytest.raises(pk.StoreError, match="was changed after it was opened"):
            ds.phi.load()


@pytest.mark.parametrize("name", ["beta/c/0", "equilibrium/c/0", "e/c", "e/zarr.json"])
@pytest.mark.parametrize("change", [flip, Path.unlink])
def test_damaged_coordinates(name, change, store):
    change(store / name)
    before = content(store)
    for call in (pk.open_map, sweep):
        with pytest.raises(pk.StoreError, match=f"damaged: {name}|{name.split('/')[0]} is not"):
            call(store)
    assert content(store) == before


def test_coordinates_of_another_map(store, tmp_path):
    """Valid files, with other values."""
    other = {"beta": AXES["beta"] + 0.1, "a": AXES["a"]}
    pk.sweep(DISK.replace(e=0.02), other, store=tmp_path / "other.zarr", **CALL)
    for name in ("beta/c/0", "e/c"):
        shutil.copytree(store, tmp_path / "copy.zarr", dirs_exist_ok=True)
        shutil.copy(tmp_path / "other.zarr" / name, tmp_path / "copy.zarr" / name)
        for call in (pk.open_map, sweep):
            with pytest.raises(pk.StoreError, match=f"damaged: {name}"):
                call(tmp_path / "copy.zarr")
        shutil.rmtree(tmp_path / "copy.zarr")


def test_a_store_without_its_plan(store, tmp_path):
    shutil.copytree(store, tmp_path / "copy.zarr")
    shutil.rmtree(tmp_path / "copy.zarr" / "sweep")
    (store / "sweep" / "zarr.json").unlink()
    for path in (store, tmp_path / "copy.zarr"):
        with pytest.raises(pk.StoreError, match=r"sweep.* is gone"):
            pk.open_map(path)
        with pytest.raises(pk.StoreError, match="overwrite=True"):
            sweep(path)
        sweep(path, overwrite=True)
        xr.testing.assert_identical(pk.open_map(path).load(), EXPECTED)


# ------------------------------------------------------------------------------ anything at all


def places_in(value, path=()):
    """All places in a JSON document."""
    found = [path] if path else []
    for key in (
        value if isinstance(value, dict) else range(len(value)) if type(value) is list else ()
    ):
        found += places_in(value[key], (*path, key))
    return found


def change_json(file, random):
    data = json.loads(file.read_text())
    *path, last = random.choice(places_in(data))
    place = data
    for key in path:
        place = place[key]
    how = random.choice([None, "text", 10**30, -1, 0, 1.5, [], {}, True, "drop"])
    if how == "drop":
        del place[last]
    else:
        place[last] = how
    file.write_text(json.dumps(data))


def change_file(file, random):
    how = random.choice(["cut", "flip", "delete", "swap", "folder", "link", "empty"])
    data = file.read_bytes()
    other = random.choice(sorted(f for f in file.parent.parent.rglob("*") if f.is_file()))
    if how == "cut":
        file.write_bytes(data[: random.randrange(max(len(data), 1))])
    elif how == "flip" and data:
        flip(file, random.randrange(len(data)))
    elif how == "swap":
        file.write_bytes(other.read_bytes())
        other.write_bytes(data)
    elif how == "empty":
        file.write_bytes(b"")
    else:
        file.unlink()
        if how == "folder":
            file.mkdir()
        elif how == "link":
            file.symlink_to(other)


def right_or_refused(call, expected=EXPECTED):
    """A call gives what is right, or a StoreError; it never warns of anything but damage."""
    with warnings.catch_warnings():
        warnings.filterwarnings("ignore", message=".*is damaged: the tile")
        try:
            ds = call().load()
        except pk.StoreError:
            return
    computed = ds.computed if "computed" in ds else True
    for name, values in expected.items():
        right = values.where(computed)
        np.testing.assert_array_equal(ds[name].where(computed), right, err_msg=name)
        assert dict(ds[name].coords).keys() == dict(values.coords).keys()
        for coord in values.coords:
            np.testing.assert_array_equal(ds[coord], values[coord], err_msg=str(coord))


FUZZ = int(os.environ.get("PHASEKIT_DAMAGES", "30"))


@pytest.mark.parametrize("kind", ["complete", "begun", "begun longer"])
def test_files_that_hold_anything(kind, whole, tmp_path):
    source = whole
    if kind != "complete":
        source = begun(tmp_path / "begun.zarr", 5)
    if kind == "begun longer":
        source = tmp_path / "longer.zarr"
        sweep(source, {**AXES, "beta": AXES["beta"][:3]})
        stop_after(6, lambda: sweep(source))
        assert not json.loads((source / "sweep/zarr.json").read_text())["attributes"]["plan"][
            "ready"
        ]
    files = sorted(file.relative_to(source) for file in source.rglob("*") if file.is_file())
    documents = [file for file in files if file.name == "zarr.json"]
    chosen = random.Random(os.environ.get("PHASEKIT_SEED", kind))
    expected = EXPECTED if kind != "begun longer" else EXPECTED.isel(beta=slice(3))
    for number in range(FUZZ // 3):
        path = tmp_path / f"{number}.zarr"
        shutil.copytree(source, path)
        for _ in range(chosen.choice([1, 1, 2])):
            if number % 2:
                change_json(path / chosen.choice(documents), chosen)
            else:
                change_file(
                    path / chosen.choice([f for f in files if (path / f).is_file()]), chosen
                )
        right_or_refused(lambda path=path: pk.open_map(path), expected)
        right_or_refused(lambda path=path: pk.open_map(path, verify=True), expected)
        right_or_refused(lambda path=path: sweep(path))
        shutil.rmtree(path)


@pytest.mark.parametrize(
    "edit",
    [
        lambda plan: plan["parts"][0].update(chunks=[0, 2]),
        lambda plan: plan["parts"][0].update(chunks=[3, 2]),
        lambda plan: plan["parts"][0].update(chunks=[-1, 2]),
        lambda plan: plan["sizes"].update(beta=10**30),
        lambda plan: plan["scalars"].update(e=None),
        lambda plan: plan["arrays"].update(beta=None),
    ],
)
@pytest.mark.parametrize("layout", [1, 2])
def test_plans_that_hold_anything(edit, layout, store, tmp_path):
    path = store if layout == 2 else unpacked(tmp_path) / "double.zarr"
    file = path / "sweep" / "zarr.json"
    data = json.loads(file.read_text())
    edit(data["attributes"]["plan"])
    file.write_text(json.dumps(data))
    for call in (pk.open_map, sweep if layout == 2 else old_sweep):
        with pytest.raises(pk.StoreError, match=r"damaged|holds another map|in chunks of"):
            call(path)


def test_a_plan_of_null(store):
    (store / "sweep" / "zarr.json").write_text(
        '{"attributes": {"plan": null}, "zarr_format": 3, "node_type": "group"}'
    )
    for call in (pk.open_map, sweep):
        with pytest.raises(pk.StoreError, match="plan, sweep/zarr.json, is damaged"):
            call(store)


# ------------------------------------------------------------------------------ interrupted


class Stopped(OSError):
    """Nothing can be written any more."""


def stop_after(writes, call):
    """Make a call that is stopped after some writes; say whether it was."""
    count = iter(range(writes))

    def counted(function):
        async def write(*args, **kwargs):
            if next(count, None) is None:
                raise Stopped("stopped")
            return await function(*args, **kwargs)

        return write

    with pytest.MonkeyPatch.context() as patch:
        for name in ("set", "delete"):
            original = getattr(zarr.storage.LocalStore, name)
            patch.setattr(zarr.storage.LocalStore, name, counted(original))
        try:
            call()
        except pk.StoreError:
            return True
    return False


def test_an_extension_that_is_interrupted_can_be_read(tmp_path):
    """At any moment: first as it was, then with what is done of the longer one."""
    short = {**AXES, "beta": AXES["beta"][:3]}
    start = tmp_path / "start.zarr"
    sweep(start, short)
    writes, seen = 0, set()
    while True:
        path = tmp_path / f"{writes}.zarr"
        shutil.copytree(start, path)
        stopped = stop_after(writes, lambda path=path: sweep(path))
        with pk.open_map(path) as ds:
            seen.add(ds.sizes["beta"])
            computed = ds.computed if "computed" in ds else xr.ones_like(ds.n_equilibria, bool)
            if ds.sizes["beta"] == 3:
                assert computed.all()
            lost = (~computed.isel(beta=slice(3))).values  # the tile that is written just now
            assert lost.sum() in (0, 1, 2)
            assert not lost[:2].any()
            for name in EXPECTED:
                right = EXPECTED[name].isel(beta=slice(ds.sizes["beta"]))
                np.testing.assert_array_equal(ds[name].where(computed), right.where(computed))
        if not stopped:
            break
        xr.testing.assert_identical(sweep(path).load(), EXPECTED)
        shutil.rmtree(path)
        writes += 1 if "PHASEKIT_KILLS" in os.environ else 3
    assert seen == {3, 5}
    assert writes > 15


def test_an_overwrite_that_is_interrupted_while_it_clears(store, monkeypatch):
    """Nothing of it opens; the same call, or one without overwrite, goes on."""
    call = {**CALL, "overwrite": True}
    other = DISK.replace(e=0.02)
    monkeypatch.setattr(
        shutil, "rmtree", lambda *_, **__: (_ for _ in ()).throw(Stopped("stopped"))
    )
    with pytest.raises(pk.StoreError, match="stopped"):
        pk.sweep(other, AXES, store=store, **call)
    monkeypatch.undo()
    (store / "phi" / "c.0.0.0").unlink()  # as the next moment would have it
    with pytest.raises(pk.StoreError, match="repeat the call of sweep"):
        pk.open_map(store)
    ds = pk.sweep(other, AXES, store=store, **CALL)
    xr.testing.assert_identical(ds.load(), pk.sweep(other, AXES, of=CALL["of"]))


def test_a_kill_during_the_very_first_file(tmp_path):
    path = tmp_path / "map.zarr"
    (path / "phi").mkdir(parents=True)
    (path / f"zarr.{'0a' * 16}.partial").write_text("{")
    xr.testing.assert_identical(sweep(path).load(), EXPECTED)
    assert not list(path.rglob("*.partial"))


@pytest.mark.parametrize("name", ["notes.txt", "phi/notes.txt", "mine/zarr.json", "sweep/a.csv"])
def test_overwrite_keeps_files_of_others(name, store):
    file = store / name
    file.parent.mkdir(exist_ok=True)
    file.write_text("mine")
    before = content(store)
    with pytest.raises(pk.StoreError, match=f"not the map's, so it is not removed: {name}"):
        pk.sweep(DISK, AXES, store=store, **CALL, overwrite=True)
    assert content(store) == before
    if name == "notes.txt":
        xr.testing.assert_identical(sweep(store).load(), EXPECTED)


def test_a_folder_that_cannot_be_written_to(store, monkeypatch):
    monkeypatch.setattr(os, "access", lambda *_: False)
    xr.testing.assert_identical(sweep(store).load(), EXPECTED)
    for options in ({"overwrite": True}, {"of": [*CALL["of"], "topology"]}):
        with pytest.raises(pk.StoreError, match="cannot be written to"):
            sweep(store, **options)


def test_stores_of_zarr_that_are_read_only(store):
    read_only = zarr.storage.LocalStore(store, read_only=True)
    xr.testing.assert_identical(sweep(read_only).load(), EXPECTED)
    with pytest.raises(pk.StoreError, match="was opened for reading"):
        sweep(read_only, of=[*CALL["of"], "topology"])


def test_files_of_other_machines(tmp_path):
    for call in (pk.open_map, sweep):
        with pytest.raises(pk.ParameterError, match=r"store: got 'file://host/.*' wants|file:///"):
            call(f"file://host{tmp_path}/map.zarr")
    assert not list(tmp_path.iterdir())


# ------------------------------------------------------------------------------ late writers


def tiles_of(path, axes=AXES, disk=DISK):
    """The tiles of a sweep that never computes them."""
    caught = []
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("phasekit.maps.workers.compute", caught.append)
        patch.setattr("phasekit.maps.run._finish", lambda job: None)
        patch.setattr("phasekit.maps.run.open_map", lambda *_: None, raising=False)
        with pytest.MonkeyPatch.context() as inner:
            inner.setattr("phasekit.maps.sweep.open_map", lambda *_, **__: None)
            pk.sweep(disk, axes, store=path, **CALL)
    return caught


@pytest.mark.parametrize("how", ["overwritten", "longer", "begun anew"])
def test_what_comes_late_is_not_written(how, tmp_path):
    path = tmp_path / "map.zarr"
    short = {**AXES, "beta": AXES["beta"][:3]}
    late = tiles_of(path, short)
    assert len(late) == 4
    tile.release_buffers()
    if how == "longer":
        sweep(path)
    else:
        if how == "begun anew":
            shutil.rmtree(path)
        pk.sweep(DISK.replace(e=0.02), AXES, store=path, **CALL, overwrite=how == "overwritten")
    before = content(path)
    for one in late:
        with pytest.raises(pk.StoreError, match="replaced or extended by another sweep"):
            tile.compute(one)
    assert content(path) == before


def test_a_map_that_is_removed_while_it_is_made(tmp_path, monkeypatch):
    path = tmp_path / "map.zarr"
    original, count = tile.compute_cells, iter(range(100))

    def removes(*args):
        if next(count) == 2:
            shutil.rmtree(path)
        return original(*args)

    with monkeypatch.context() as patch:
        patch.setattr(tile, "compute_cells", removes)
        with pytest.raises(pk.StoreError, match="the map was removed while it was being computed"):
            sweep(path)
    assert not path.exists() or not list(path.rglob("*"))
    xr.testing.assert_identical(sweep(path).load(), EXPECTED)


def test_a_map_that_is_removed_while_a_tile_is_written(tmp_path, monkeypatch):
    path = tmp_path / "map.zarr"
    original = zarr.Array.__setitem__

    def removes(self, key, value):
        if self.name == "/phi":
            shutil.rmtree(path)
        original(self, key, value)

    with monkeypatch.context() as patch:
        patch.setattr(zarr.Array, "__setitem__", removes)
        with pytest.raises(pk.StoreError, match="the map was removed while it was being computed"):
            sweep(path)
    with pytest.raises(pk.StoreError):
        pk.open_map(path)
    xr.testing.assert_identical(sweep(path).load(), EXPECTED)


# ------------------------------------------------------------------------------ tiles


def test_a_trial_that_is_made_large_gets_larger_tiles(tmp_path):
    path = tmp_path / "map.zarr"
    of = "n_equilibria"
    trial = {"beta": np.linspace(0.1, 0.2, 4), "a": np.linspace(0, 0.001, 4)}
    large = {
        "beta": np.append(trial["beta"], np.linspace(0.21, 1.5, 156)),
        "a": np.append(trial["a"], np.linspace(0.002, 0.05, 156)),
    }
    pk.sweep(DISK, trial, of=of, store=path)
    files = len(content(path))
    stopped = shutil.copytree(path, tmp_path / "stopped.zarr")
    pk.sweep(DISK, large, of=of, store=path)
    assert len(content(path)) - files < 10
    expected = pk.sweep(DISK, large, of=of)
    xr.testing.assert_identical(pk.open_map(path).load(), expected)
    with pytest.raises(pk.StoreError, match="in chunks of 160 along beta, the call asks for 4"):
        pk.sweep(DISK, large, of=of, store=path, chunks=4)
    seen = set()
    for writes in range(0, 40, 4):
        if not stop_after(writes, lambda: pk.sweep(DISK, large, of=of, store=stopped)):
            break
        try:
            ds = pk.open_map(stopped).load()
        except pk.StoreError:  # the arrays are being made
            continue
        seen.add(ds.sizes["beta"])
        right = expected.isel(beta=slice(ds.sizes["beta"]), a=slice(ds.sizes["a"]))
        computed = ds.computed if "computed" in ds else True
        xr.testing.assert_equal(ds.n_equilibria.where(computed), right.n_equilibria.where(computed))
    assert {4} <= seen <= {4, 160}  # how many writes come between depends on zarr
    assert writes > 4
    xr.testing.assert_identical(pk.open_map(stopped).load(), expected)


def test_tiles_need_no_list():
    """10^10 tiles are planned, and the first and the last of them found."""
    from phasekit.maps.sweep import plan_sweep

    axes = {"beta": np.linspace(0.1, 1.5, 10**6), "a": np.linspace(0, 0.05, 10**6)}
    job = plan_sweep(DISK, axes, of="n_equilibria", store="none.zarr", chunks=10)
    assert (job.cells, job.count) == (10**12, 10**10)
    assert next(job.tiles()).index == (0, 0)
    assert job.left[0].tile(10**10 - 1) == (10**5 - 1, 10**5 - 1)
    samples = job.left[0].samples(job.place, job.request, 2)
    assert [tile.index for tile in samples] == [(0, 0), (10**5 - 1, 10**5 - 1)]


def test_tiles_that_are_left_are_found_between_those_that_are_done(tmp_path):
    from phasekit.maps.sweep import plan_sweep

    path = begun(tmp_path / "map.zarr", 5)
    for name in ("c.0.1", "c.1.0"):
        (path / "sweep" / "part0" / name).unlink()
    left = plan_sweep(DISK, AXES, of=CALL["of"], store=path, chunks=CALL["chunks"]).left[0]
    assert list(left.indices()) == [left.tile(k) for k in range(len(left))]
    assert list(left.indices()) == [(0, 1), (1, 0), (2, 1)]
    assert left.cells == 2 + 4 + 1


def test_a_map_that_fits_nowhere(tmp_path):
    values = np.linspace(0.1, 0.2, 10**5)
    axes = dict.fromkeys(("beta", "a", "r", "omega1"), values)
    with pytest.raises(pk.ParameterError, match=r"axes: got .* = 1e\+20 cells, wants fewer than"):
        pk.sweep(DISK, axes, of="n_equilibria", store=tmp_path / "map.zarr", force=True)
    assert not list(tmp_path.iterdir())


# ------------------------------------------------------------------------------ older stores


def unpacked(folder):
    """Stores that phasekit made before there were checksums; tests/data/README.md says how."""
    archive = Path(__file__).parent.parent / "data" / "stores_layout1.zip"
    shutil.unpack_archive(archive, folder / "old")
    return folder / "old"


OLD = {"beta": np.linspace(0.1, 1.5, 4), "a": np.array([0.0, 0.02, 0.05])}
OLD_CALL = {"of": ["n_equilibria", "topology", "phi"], "workers": 1}


def old_sweep(path, axes=OLD, **options):
    return pk.sweep(DISK, axes, store=path, **{**OLD_CALL, **options})


@pytest.mark.parametrize("kind", ["double", "single", "partial"])
def test_stores_without_checksums(kind, tmp_path, capsys):
    path = unpacked(tmp_path) / f"{kind}.zarr"
    dtype = "float32" if kind == "single" else None
    expected = pk.sweep(DISK, OLD, of=OLD_CALL["of"], dtype=dtype)
    with pk.open_map(path, verify=True) as ds:
        assert ("computed" in ds) == (kind == "partial")
        computed = ds.computed if kind == "partial" else True
        if kind == "partial":
            assert ds.computed.sum() == 10
        for name in expected:
            np.testing.assert_array_equal(ds[name].where(computed), expected[name].where(computed))
    assert main(["info", str(path), "--verify"]) == 0
    assert "they have no checksums" in capsys.readouterr().out
    before = content(path)
    xr.testing.assert_equal(old_sweep(path).load(), expected)
    assert kind == "partial" or content(path) == before
    longer = {**OLD, "a": np.append(OLD["a"], [0.06, 0.07])}
    of = [*OLD_CALL["of"], "energy"]
    expected = pk.sweep(DISK, longer, of=of, dtype=dtype and {"phi": dtype})
    xr.testing.assert_equal(old_sweep(path, longer, of=of).load(), expected)
    flip(path / "energy" / "c.0.0.0")
    with pytest.raises(pk.StoreError, match="energy"):
        pk.open_map(path, verify=True)
    with pytest.warns(UserWarning, match="energy"):
        xr.testing.assert_equal(old_sweep(path, longer, of=of).load(), expected)


def test_an_older_store_goes_on_without_its_states(tmp_path):
    """A call that does not name a state leaves its coordinate as it was."""
    path = unpacked(tmp_path) / "double.zarr"
    states = {**OLD, "state_phi": [0.1, 0.2], "state_dphi": 0.0}
    old_sweep(path, states, of=["period"])
    plan = json.loads((path / "sweep" / "zarr.json").read_text())
    assert "state_phi/zarr.json" in plan["attributes"]["plan"]["documents"]
    ds = old_sweep(path, of=["phi", "energy"])
    assert list(ds.state_phi.values) == [0.1, 0.2]
    xr.testing.assert_equal(ds.period.load(), pk.sweep(DISK, states, of="period").period)


def test_damage_of_stores_without_checksums(tmp_path):
    """What cannot be decoded is noticed."""
    path = unpacked(tmp_path) / "double.zarr"
    cut(path / "phi" / "c.0.1.0")
    with (
        pk.open_map(path) as ds,
        pytest.raises(pk.StoreError, match=r"phi in .* is not as long as it says"),
    ):
        ds.phi.load()
    with pytest.warns(UserWarning, match=r"\[0:2, 2:3\] of .* phi is not as long as it says"):
        ds = old_sweep(path)
    xr.testing.assert_equal(ds.load(), pk.sweep(DISK, OLD, of=OLD_CALL["of"]))


def test_sizes_are_of_the_place(store):
    assert place_of(store).size() == sum(map(len, content(store).values()))


def test_bits_that_flip_in_arrays_of_netcdf_files_are_noticed(tmp_path, capsys):
    path = tmp_path / "map.nc"
    ds = pk.sweep(pk.Reduced(0.1, 0.2), lam=np.linspace(0.1, 0.9, 9), store=path).load()
    ds.close()
    assert main(["info", str(path), "--verify"]) == 0
    assert "verified: the arrays are as they were written" in capsys.readouterr().out
    intact = path.read_bytes()
    for name in ("lam", "phi", "n_equilibria"):
        place = intact.index(ds[name].values.tobytes())
        data = bytearray(intact)
        data[place + ds[name].nbytes // 2] ^= 4
        path.write_bytes(data)
        with pytest.raises(pk.StoreError, match="cannot be read"):
            pk.open_map(path, verify=True)
        assert main(["info", str(path), "--verify"]) == 2


def test_numbers_that_others_wrote_into_a_netcdf_file_are_noticed(tmp_path, capsys):
    """Their checksums are those of what was written; a digest of all tells what does not belong."""
    h5py = pytest.importorskip("h5py")
    path = tmp_path / "map.nc"
    pk.sweep(pk.Reduced(0.1, 0.2), lam=np.linspace(0.1, 0.9, 9), store=path).close()
    assert main(["info", str(path), "--verify"]) == 0
    with h5py.File(path, "a") as file:
        file["phi"][...] = file["phi"][...][::-1]
    with pytest.raises(pk.StoreError, match=r"map\.nc is damaged: numbers have changed"):
        pk.open_map(path, verify=True)
    assert main(["info", str(path), "--verify"]) == 2


# h5netcdf's own, of a file that it could not open.
@pytest.mark.filterwarnings("ignore:Exception ignored in.*File.close")
def test_bits_that_flip_beside_the_arrays_of_netcdf_files_are_noticed(tmp_path):
    """Scalars, texts and attributes, for which HDF5 has no checksums."""
    path = tmp_path / "map.nc"
    ds = pk.sweep(DISK, beta=np.linspace(0.1, 0.9, 9), store=path).load()
    ds.close()
    with pk.open_map(path) as opened:
        xr.testing.assert_identical(opened.load(), ds)
    intact = path.read_bytes()
    for text in (b"phasekit_model", b"GyroRotorDisk", b"lower_saddle", b"rad", b"flag_meanings",
                 ds.e.values.tobytes(), ds.omega1.values.tobytes()):  # fmt: skip
        place = intact.index(text)
        for bit in (1, 64):
            data = bytearray(intact)
            data[place + len(text) // 2] ^= bit
            other = tmp_path / f"{place}-{bit}.nc"
            other.write_bytes(data)
            with pytest.raises(pk.StoreError, match=other.name):
                pk.open_map(other)
    xr.testing.assert_identical(pk.open_map(path, verify=True).load(), ds)


def test_heaps_of_netcdf_files_that_damage_makes_endless_are_refused(tmp_path, capsys):
    """HDF5 goes through their objects by sizes; at one of size 0 it would stand for ever."""
    path = tmp_path / "map.nc"
    ds = pk.sweep(DISK, beta=np.linspace(0.1, 0.9, 9), store=path).load()
    ds.close()
    intact = path.read_bytes()
    heap = intact.index(b"GCOL")
    places = [intact.index(text, heap) for text in (b"rad", b"angle between")]
    for place in places:
        data = bytearray(intact)
        data[place - 16 : place + 48] = bytes(64)  # with the number and size of the object
        path.write_bytes(data)
        with pytest.raises(pk.StoreError, match=r"map\.nc is damaged: a heap"):
            pk.open_map(path)
        assert main(["info", str(path)]) == 2
        assert "is damaged: a heap" in capsys.readouterr().err
        with pytest.raises(pk.StoreError):  # nobody knows whose it is
            pk.sweep(DISK, beta=[0.1], store=path, overwrite=True)
    path.write_bytes(intact)
    xr.testing.assert_identical(pk.open_map(path, verify=True).load(), ds)


def test_chunks_that_the_index_of_a_netcdf_file_lost_are_missed(tmp_path):
    """HDF5 gives zeros for them, which no checksum knows of."""
    path = tmp_path / "map.nc"
    pk.sweep(DISK, beta=np.linspace(0.1, 0.9, 9), store=path).close()
    intact = path.read_bytes()
    starts = [k for k in range(len(intact)) if intact.startswith(b"TREE\x01", k)]  # of chunks
    assert len(starts) > 5
    for start in starts:
        data = bytearray(intact)
        data[start + 6 : start + 8] = bytes(2)  # how many there are
        path.write_bytes(data)
        with pytest.raises(pk.StoreError, match=r"map\.nc is damaged: parts of \w+ are gone"):
            pk.open_map(path)


@pytest.mark.parametrize("chunks", [None, {}])
def test_damage_of_netcdf_files_that_are_open_is_a_store_error(tmp_path, chunks):
    path = tmp_path / "map.nc"
    ds = pk.sweep(DISK, beta=np.linspace(0.1, 0.9, 9), store=path).load()
    ds.close()
    data = bytearray(path.read_bytes())
    data[data.index(ds.phi.values.tobytes()) + 8] ^= 1
    path.write_bytes(data)
    with pk.open_map(path, chunks=chunks) as opened:
        assert np.array_equal(opened.energy, ds.energy, equal_nan=True)
        with pytest.raises(pk.StoreError, match=r"map\.nc is damaged: phi cannot be read"):
            opened.phi.load()


def test_netcdf_files_without_a_digest_open_as_before(tmp_path):
    ds = pk.sweep(DISK, beta=np.linspace(0.1, 0.9, 9))
    ds.to_netcdf(tmp_path / "map.nc", engine="h5netcdf")
    with pk.open_map(tmp_path / "map.nc") as opened:
        xr.testing.assert_identical(opened.load(), ds)
    # What is saved again by others keeps no digest of what it was.
    pk.sweep(DISK, beta=[0.1, 0.2], store=tmp_path / "own.nc").close()
    with xr.open_dataset(tmp_path / "own.nc", engine="h5netcdf") as own:
        own.assign_attrs(note="mine").to_netcdf(tmp_path / "copy.nc", engine="h5netcdf")
    with pk.open_map(tmp_path / "copy.nc") as copy:
        assert copy.attrs["note"] == "mine"


@pytest.mark.parametrize(
    "call",
    [pk.open_map, pk.Branch.load, lambda p: pk.sweep(pk.Reduced(1, 1), {"lam": [1]}, store=p)],
)
def test_names_that_are_too_long_are_refused(call, tmp_path):
    with pytest.raises(pk.StoreError, match="cannot be reached: File name too long"):
        call(tmp_path / f"{'x' * 300}.zarr")


# ------------------------------------------------------------------------------ what it is a map of


DRIVEN = pk.Perturbed(pk.Pendulum(length=1.0), damping=0.1, forcing=pk.Harmonic(0.5, 2.0))


@pytest.fixture(scope="module")
def driven(tmp_path_factory):
    path = tmp_path_factory.mktemp("driven") / "map.zarr"
    pk.sweep(DRIVEN, length=[1.0, 2.0], of=["phi"], store=path, workers=1)
    return path


CHANGED = r"is damaged: zarr\.json has changed since it was written"


def test_the_forcing_cannot_be_switched_off(driven, tmp_path):
    path = Path(shutil.copytree(driven, tmp_path / "map.zarr"))
    assert pk.open_map(path).phasekit.system().forcing
    file = path / "zarr.json"
    text = file.read_text()
    assert text.count('"phasekit_forcing": "1"') == 1
    file.write_text(text.replace('"phasekit_forcing": "1"', '"phasekit_forcing": "0"'))
    for verify in (False, True):
        with pytest.raises(pk.StoreError, match=CHANGED):
            pk.open_map(path, verify=verify)
    assert main(["info", str(path), "--verify"]) == 2
    with pytest.raises(pk.StoreError, match=CHANGED):
        pk.sweep(DRIVEN, length=[1.0, 2.0, 3.0], of=["phi"], store=path)


def test_each_bit_of_what_a_map_is_of(driven, tmp_path):
    """The document of the store: refused, or the same, by each way to verify it."""
    path = Path(shutil.copytree(driven, tmp_path / "map.zarr"))
    expected = pk.open_map(path).load()
    file = path / "zarr.json"
    data, rng = file.read_bytes(), random.Random(0)
    refused = 0
    for place in sorted(rng.sample(range(len(data)), 60)):
        changed = bytearray(data)
        changed[place] ^= 1 << rng.randrange(8)
        file.write_bytes(changed)
        try:
            with pk.open_map(path, verify=True) as ds:
                assert ds.load().identical(expected)
        except pk.StoreError:
            refused += 1
    assert refused == 60
    for damage in (data[:-1], data[: len(data) // 2], b""):
        file.write_bytes(damage)
        with pytest.raises(pk.StoreError):
            pk.open_map(path)
    file.unlink()
    assert main(["info", str(path), "--verify"]) == 2
    file.write_bytes(data)
    assert main(["info", str(path), "--verify"]) == 0


def test_stores_that_do_not_say_it_go_on(driven, tmp_path, capsys):
    """Those of versions before there was a checksum of it get one when they get longer."""
    from phasekit.maps.plan import plan_bytes, plan_from

    path = Path(shutil.copytree(driven, tmp_path / "map.zarr"))
    file = path / "sweep" / "zarr.json"
    file.write_bytes(plan_bytes(dataclasses.replace(plan_from(file.read_bytes()), root={})))
    assert main(["info", str(path), "--verify"]) == 0
    assert "zarr.json, of earlier versions, has no checksum" in capsys.readouterr().out
    root = (path / "zarr.json").read_text()
    (path / "zarr.json").write_text(
        root.replace('"phasekit_forcing": "1"', '"phasekit_forcing": "0"')
    )
    with pytest.raises(pk.StoreError, match="phasekit_forcing is '0', in the call '1'"):
        pk.sweep(DRIVEN, length=[1.0, 2.0, 3.0], of=["phi"], store=path)
    (path / "zarr.json").write_text(root)
    pk.sweep(DRIVEN, length=[1.0, 2.0, 3.0], of=["phi"], store=path)
    assert main(["info", str(path), "--verify"]) == 0
    assert "checksum" not in capsys.readouterr().out.replace("no checksums", "")
