"""What is written to Zarr in one go, branches and earlier maps: every damage is noticed."""

import hashlib
import itertools
import json
import random
import shutil
from pathlib import Path

import numpy as np
import pytest
import xarray as xr

import phasekit as pk
from phasekit.cli import main
from phasekit.maps.whole import WholeTarget, target_of

zarr = pytest.importorskip("zarr")

WELL = pk.Potential("x^4/4 - mu*x^2/2 + k*x", "x", {"mu": 1.0, "k": 0.1})
GRID = {"mu": [-1.0, 1.0], "k": [0.0, 0.1]}
#: A result of each type, on cells, equilibria, sides. One is NaN everywhere: Zarr writes no chunk.
KEPT = ["phi", "kind", "n_equilibria", "figure_eight", "winding_area", "turning_offset"]
MAP = pk.sweep(WELL, **GRID)[KEPT].reset_coords(["x", "turning_x", "saddle_x"], drop=True)


def damages(store, rng):
    """Each file of a store, changed in each way: what, and a function that does it."""
    every = sorted(file for file in store.rglob("*") if file.is_file())
    for file in every:
        data = file.read_bytes()
        place, bit = rng.randrange(len(data)), 1 << rng.randrange(8)
        flipped = bytearray(data)
        flipped[place] ^= bit
        other = rng.choice([o for o in every if o.read_bytes() != data])

        def exchange(file=file, other=other, data=data):
            file.write_bytes(other.read_bytes())
            other.write_bytes(data)

        name = str(file.relative_to(store))
        yield f"{name}: bit {bit} of {place}", lambda f=file, d=bytes(flipped): f.write_bytes(d)
        yield f"{name}: cut", lambda f=file, d=data, k=place: f.write_bytes(d[:k])
        yield f"{name}: gone", file.unlink
        yield f"{name}: exchanged with {other}", exchange
    for folder in sorted(store.iterdir()):
        if folder.is_dir():
            yield f"{folder.name}: gone", lambda f=folder: shutil.rmtree(f)


def restored(store, kept):
    shutil.rmtree(store)
    for file, data in kept.items():
        file.parent.mkdir(parents=True, exist_ok=True)
        file.write_bytes(data)


def tried(store, same, call, most, seed=1):
    """Try damages: how many were refused; the others changed nothing of what is read."""
    kept = {file: file.read_bytes() for file in store.rglob("*") if file.is_file()}
    every = list(damages(store, random.Random(seed)))
    chosen = every if most is None else random.Random(seed).sample(every, most)
    refused, messages = [], []
    for what, damage in chosen:
        damage()
        try:
            found = call(store)
        except pk.StoreError as error:
            refused.append(what)
            messages.append(str(error))
        else:
            assert same(found), what
        restored(store, kept)
    assert same(call(store))
    assert all(str(store) in message for message in messages)
    return len(chosen), refused


@pytest.fixture
def stored_map(tmp_path):
    path = tmp_path / "map.zarr"
    WholeTarget(target_of(path)).write(MAP)
    return path


def test_maps_of_potentials_open_as_they_were(stored_map, capsys):
    for chunks, verify in itertools.product((None, {}), (False, True)):
        with pk.open_map(stored_map, chunks=chunks, verify=verify) as ds:
            xr.testing.assert_identical(ds.load(), MAP)
    assert main(["info", str(stored_map), "--verify"]) == 0
    assert "verified: the arrays are as they were written" in capsys.readouterr().out
    with xr.open_zarr(stored_map, consolidated=False) as plain:  # others need know nothing of it
        np.testing.assert_array_equal(plain.phi, MAP.phi)
        assert plain.sizes == MAP.sizes


@pytest.mark.slow
@pytest.mark.parametrize("verify", [True, False])
def test_damages_of_maps_of_potentials(stored_map, verify):
    def call(path):
        with pk.open_map(path, verify=verify) as ds:
            return ds.load()

    count, refused = tried(stored_map, MAP.identical, call, 16)
    # All but the loss of the checksums, and other blanks in JSON.
    assert len(refused) >= count - 4


@pytest.mark.slow
def test_every_damage_of_a_map_of_a_potential(stored_map):
    def call(path):
        with pk.open_map(path, verify=True) as ds:
            return ds.load()

    count, refused = tried(stored_map, MAP.identical, call, None, 2)
    assert count > 80
    assert len(refused) >= count - 8


def test_data_where_none_were_written(stored_map):
    """Of what is NaN everywhere Zarr writes nothing."""
    names = [name for name in MAP if not list((stored_map / str(name)).rglob("c*"))]
    assert names
    dims = MAP[names[0]].dims
    chunk = stored_map.joinpath(str(names[0]), "c", *"0" * len(dims))
    chunk.parent.mkdir(parents=True)
    chunk.write_bytes(
        next(f for f in (stored_map / "phi" / "c").rglob("*") if f.is_file()).read_bytes()
    )
    with pk.open_map(stored_map) as ds, pytest.raises(pk.StoreError, match="was not written with"):
        ds.load()
    assert main(["info", str(stored_map), "--verify"]) == 2


def test_arrays_that_were_not_there(stored_map):
    shutil.copytree(stored_map / "phi", stored_map / "other")
    with pytest.raises(pk.StoreError, match=r"other/zarr\.json was not written with it"):
        pk.open_map(stored_map)


def test_files_of_others_are_passed_over(stored_map):
    (stored_map / "notes.txt").write_text("mine")
    (stored_map / ".DS_Store").write_bytes(b"\0")
    with pk.open_map(stored_map, verify=True) as ds:
        xr.testing.assert_identical(ds.load(), MAP)


def test_names_in_the_checksums_are_no_paths(stored_map, monkeypatch):
    """They name what must be there; nothing is read for them that is not."""
    file = stored_map / "phasekit" / "zarr.json"
    whole = json.loads(file.read_text())
    (stored_map.parent / "zarr.json").write_text("mine")
    read = []
    original = Path.read_bytes
    monkeypatch.setattr(Path, "read_bytes", lambda path: (read.append(path), original(path))[1])
    for name in ("../zarr.json", str(stored_map.parent / "zarr.json"), "phi/../../zarr.json"):
        listed = {**whole["attributes"]["files"], name: "0" * 64}
        digest = hashlib.sha256(json.dumps(listed, sort_keys=True).encode()).hexdigest()
        attributes = {"files": listed, "sha256": digest}
        file.write_text(json.dumps({**whole, "attributes": attributes}))
        with pytest.raises(pk.StoreError, match="is gone"):
            pk.open_map(stored_map)
    assert read
    assert all(stored_map.parent != path.resolve().parent for path in read)


@pytest.mark.slow
@pytest.mark.parametrize("name", ["map.zarr", "map.nc"])
def test_maps_without_checksums_cannot_be_verified(name, tmp_path, capsys):
    path = tmp_path / name
    if name.endswith(".nc"):
        MAP.to_netcdf(path, engine="h5netcdf")
    else:
        WholeTarget(target_of(path)).write(MAP)
        shutil.rmtree(path / "phasekit")
    with pk.open_map(path, verify=True) as ds:
        xr.testing.assert_identical(ds.load(), MAP)
    assert main(["info", str(path)]) == 0
    assert main(["info", str(path), "--verify"]) == 2
    assert "cannot be verified: all files can be read; they have no checksums" in (
        capsys.readouterr().err
    )


# --------------------------------------------------------------------- branches


def line():
    problem = pk.Problem("mu - x**2", "x", {"mu": 1.0})
    return pk.continuation(problem, "mu", x0=[1.0], span=(0.0, 1.5))


def family():
    """Cycles of x' = mu x - y - x (x^2 + y^2), y' = x + mu y - y (x^2 + y^2)."""
    f = ["mu*x - y - x*(x**2 + y**2)", "x + mu*y - y*(x**2 + y**2)"]
    problem = pk.Problem(f, ["x", "y"], {"mu": 0.3})
    orbit = pk.periodic_orbit(problem, [0.5, 0.1], period=6.3)
    return pk.continuation(problem, "mu", orbit=orbit, span=(0.25, 0.35))


@pytest.mark.parametrize("made", [line, pytest.param(family, marks=pytest.mark.slow)])
def test_damages_of_branches(made, tmp_path, capsys):
    branch, path = made(), tmp_path / "branch.zarr"
    branch.save(path)
    assert main(["info", str(path), "--verify"]) == 0
    assert "verified" in capsys.readouterr().out

    def same(other):
        return other.to_dataset().identical(branch.to_dataset())

    count, refused = tried(path, same, pk.Branch.load, 10)
    assert len(refused) > count // 4  # the points are made again from less than is stored
    codes = []
    count, _ = tried(path, bool, lambda path: codes.append(main(["info", str(path), "--verify"]))
                     or True, 4, 3)  # fmt: skip
    assert codes[:-1] == [2] * count
    assert codes[-1] == 0
