"""No file outside a map is read, written or removed, whatever its documents name.

What a name may do is tried as a text, for every system at once: this one may take a name for what
another takes for a device, another file or a place elsewhere.
"""

import base64
import hashlib
import itertools
import json
import os
import shutil

import h5py
import numpy as np
import pytest
import xarray as xr

import phasekit as pk
from phasekit.cli import main
from phasekit.errors import ParameterError
from phasekit.maps.keys import is_document, is_name, is_part, unfit
from phasekit.maps.plan import plan_from

zarr = pytest.importorskip("zarr")

DISK = pk.GyroRotorDisk(beta=0.3, e=0.0115, a=0.02, r=0.21, omega1=2.5)
AXES = {"beta": np.linspace(0.1, 1.5, 3), "a": np.array([0.0, 0.02])}
CALL = {"of": ["n_equilibria", "phi"], "chunks": 2, "workers": 1}
LONGER = {**AXES, "beta": np.append(AXES["beta"], 1.6)}
MORE = {**CALL, "of": [*CALL["of"], "topology"]}

#: Names of which none is one file, the same one, on every system.
NAMES = [
    "", ".", "..", "...", "../planted", "..\\planted", "a/../b", "a//b", "/planted", "\\planted",
    "//host/share", "\\\\host\\share", "~/planted/x", "C:", "C:planted", "C:\\planted",
    "c:/planted", "file:///planted", "NUL", "nul", "CON", "Con.txt", "aux.tar.gz", "PRN", "COM1",
    "com9.x", "LPT1", "COM¹", "CONIN$", "nul .x", "phi.", "phi..", "phi ", " phi", "phi\t",
    "phi:stream", "phi::$DATA", "phi\0", "\0", "phi\n", "\x1f", "\x7f", "ph*", "ph?", "<phi>",
    "phi|x", '"phi"', "x" * 300, "\ud800", "é" * 150, "sweep", "SWEEP", "zarr.json", "Zarr.JSON",
]  # fmt: skip
#: What a key may be made of them, beside the name of an array.
KEYS = [
    *NAMES,
    *(f"{name}/zarr.json" for name in NAMES),
    *(f"{name}/c/0" for name in NAMES),
    *(f"phi/{name}" for name in NAMES),
    *(f"phi/c/{name}" for name in NAMES if name),
    *(f"sweep/{name}/zarr.json" for name in NAMES),
    *(f"sweep/part0/{name}" for name in NAMES if name != "zarr.json"),
    "phi", "phi/", "phi/.", "phi//zarr.json", "./phi/zarr.json", "phi/./zarr.json",
    "phi/zarr.json/", "phi/zarr.json/x", "phi/../phi/zarr.json", "PHI/zarr.json", "Phi/c/0",
    "phi/ZARR.JSON", "phi/C/0", "phi/c/1", "phi/c/-1", "phi/c/00", "phi/c/٠", "phi/c.0",
    "phi/c/0/..", "sweep", "sweep/zarr.json", "sweep/part0", "sweep/part0/c.0",
    "sweep/PART0/zarr.json", "sweep/part00/zarr.json", "sweep/part-1/zarr.json",
    "sweep/part٠/zarr.json", "sweep/part/zarr.json", "other/zarr.json", "notes.txt", "planted.py",
    "energy/zarr.json", "zarr.json ", "zarr.json.", None, 5, ["phi"],
]  # fmt: skip
KEYS = [key for key in KEYS if key not in ("zarr.json", "phi/zarr.json")]


@pytest.mark.parametrize("name", NAMES)
def test_names_that_are_no_file_everywhere(name):
    assert not is_name(name)
    assert not is_part(name)
    assert unfit([name, "beta"]) == [repr(name)]


@pytest.mark.parametrize("name", ["phi", "beta [deg]", "ω₀", "x'", "a-b", ".x", "a.b", "sweeps",
                                  "console", "com", "com10", "null", "x" * 200])  # fmt: skip
def test_names_that_are_files_everywhere(name):
    assert is_name(name)
    assert is_document(f"{name}/zarr.json", {name})
    assert is_document(f"{name}/c/0", {name})
    assert unfit([name, "beta"]) == []


@pytest.mark.parametrize(
    "names",
    [("beta", "BETA"), ("x", "X", "y"), ("straße", "STRASSE"), ("é", "e\u0301"), ("É", "é")],
)
def test_names_that_are_equal_but_for_case(names):
    assert {repr(name) for name in names[:2]} == set(unfit(names))


def test_only_documents_of_own_arrays_are_paths():
    names = {"phi", "beta", *(name for name in NAMES)}
    assert len(KEYS) > 350
    assert [key for key in KEYS if is_document(key, names)] == []
    own = ["zarr.json", "phi/zarr.json", "phi/c", "phi/c/0", "beta/c/0/0", "sweep/part0/zarr.json",
           "sweep/part12/zarr.json"]  # fmt: skip
    assert [key for key in own if is_document(key, names)] == own


# --------------------------------------------------------------------- plans


@pytest.fixture(scope="module")
def made(tmp_path_factory):
    path = tmp_path_factory.mktemp("made") / "map.zarr"
    pk.sweep(DISK, AXES, store=path, **CALL)
    return path


@pytest.fixture
def store(made, tmp_path):
    """A copy of a map in a folder with files that are not the map's."""
    for file in ("victim/a", "victim/zarr.json", "victim/c", "victim/part0/x", "notes.py"):
        (tmp_path / file).parent.mkdir(exist_ok=True, parents=True)
        (tmp_path / file).write_text(f"mine: {file}")
    return shutil.copytree(made, tmp_path / "box" / "map.zarr")


def around(store):
    """All that lies outside of a map."""
    folder = store.parent.parent
    found = {
        str(path.relative_to(folder)): path.read_bytes() if path.is_file() else None
        for path in folder.rglob("*")
        if store not in (path, *path.parents)
    }
    assert len(found) >= 8
    return found


def signed(plan):
    """A plan with the digest that it should have, as whoever writes one can make it."""
    fixed = {name: plan[name] for name in plan.keys() - {"ready", "sha256"}}
    fixed["parts"] = [{**part, "complete": None} for part in plan["parts"]]
    digest = hashlib.sha256(json.dumps(fixed, sort_keys=True).encode()).hexdigest()
    return {**plan, "sha256": digest}


def edit(store, change):
    """Change the plan of a map; return its file."""
    file = store / "sweep" / "zarr.json"
    whole = json.loads(file.read_text())
    plan = whole["attributes"]["plan"]
    assert signed(plan) == plan
    change(plan)
    whole["attributes"]["plan"] = signed(plan)
    file.write_text(json.dumps(whole))
    return file


DATA = base64.b64encode(b"import os; print('planted')").decode()


#: Everything in a plan that is, or could be made, a path: what is put there, by its name.
PLACES = {
    "before": lambda plan, name: plan.update(before={name: DATA}),
    "before, unready": lambda plan, name: plan.update(before={name: DATA}, ready=False),
    "before, removed": lambda plan, name: plan.update(before={name: None}, ready=False),
    "before, coming": lambda plan, name: plan.update(
        before={f"{name}/zarr.json": None}, coming=[name], ready=False
    ),
    "coming": lambda plan, name: plan.update(coming=[name]),
    "documents": lambda plan, name: plan["documents"].update({name: "0" * 64}),
    "a part": lambda plan, name: plan["parts"][0].update(name=name),
    "a new part": lambda plan, name: plan["parts"].append({**plan["parts"][0], "name": name}),
    "a quantity": lambda plan, name: plan["parts"][0]["quantities"].update({name: "float64"}),
    "an array": lambda plan, name: plan["arrays"].update({name: plan["arrays"]["beta"]}),
    "a number": lambda plan, name: plan["scalars"].update({name: 0.0}),
}


@pytest.mark.slow
@pytest.mark.parametrize("place", PLACES)
def test_plans_with_other_paths_are_refused(place, store):
    """Each text in each place, as the file is read."""
    kept = (store / "sweep" / "zarr.json").read_bytes()
    assert plan_from(kept).parts
    texts = [text for text in [*NAMES, *KEYS] if type(text) is str and text != "zarr.json"]
    if place not in ("before", "before, unready", "before, removed", "documents"):
        texts = [*NAMES, "PHI"]
    refused = 0
    for text in texts:
        file = edit(store, lambda plan, text=text: PLACES[place](plan, text))
        with pytest.raises(ParameterError, match="is damaged: .* is not what a plan holds"):
            plan_from(file.read_bytes())
        file.write_bytes(kept)
        refused += 1
    assert refused > 50


OUTSIDE = ["../planted.py", "../../victim/a", "../victim", "{}/planted.py", "phi/../../../victim/a"]
CALLS = {
    "opened": lambda store: pk.open_map(store).load(),
    "continued": lambda store: pk.sweep(DISK, AXES, store=store, **CALL),
    "more of it": lambda store: pk.sweep(DISK, AXES, store=store, **MORE),
    "as a store": lambda store: pk.sweep(
        DISK, LONGER, store=zarr.storage.LocalStore(store), **CALL
    ),
}


@pytest.mark.slow
@pytest.mark.parametrize("call", CALLS)
@pytest.mark.parametrize("place", ["before, unready", "before, removed", "documents", "a part"])
def test_nothing_outside_is_touched(call, place, store):
    kept, before = (store / "sweep" / "zarr.json").read_bytes(), around(store)
    for text in OUTSIDE:
        name = text.format(store.parent.parent)
        file = edit(store, lambda plan, name=name: PLACES[place](plan, name))
        with pytest.raises(pk.StoreError, match="sweep/zarr.json, is damaged"):
            CALLS[call](store)
        assert around(store) == before
        file.write_bytes(kept)
    CALLS[call](store)
    assert around(store) == before


def test_nothing_outside_is_touched_by_the_command(store, capsys):
    recipe = store.parent / "map.toml"
    values = {name: getattr(DISK, name) for name in ("e", "r", "omega1")}
    recipe.write_text(
        'model = "GyroRotorDisk"\nof = ["n_equilibria", "phi", "topology"]\n'
        + "".join(f"parameters.{name} = {value}\n" for name, value in values.items())
        + "".join(f"axes.{name} = {list(map(float, axis))}\n" for name, axis in AXES.items())
    )
    kept, before = (store / "sweep" / "zarr.json").read_bytes(), around(store)
    for place, name in itertools.product(("before, unready", "before, removed"), OUTSIDE[:3]):
        file = edit(store, lambda plan, place=place, name=name: PLACES[place](plan, name))
        assert main(["sweep", str(recipe), "--store", str(store)]) == 2
        assert main(["info", str(store)]) == 2
        assert "is damaged" in capsys.readouterr().err
        file.write_bytes(kept)
        assert around(store) == before
    assert main(["sweep", str(recipe), "--store", str(store)]) == 0
    assert around(store) == before


def test_marks_with_other_names_are_none(store):
    """Names of marks are places of tiles: each is that of one tile, as it is written."""
    expected = pk.open_map(store).load()
    marks = store / "sweep" / "part0"
    for name in ("c.-1.0", "c.0.-1", "c.00.0", "c.+0.0", "c. 0.0", "c.0_0.0", "c.٠.0", "c.0.0.0"):
        shutil.copy(marks / "c.0.0", marks / name)
    xr.testing.assert_identical(pk.open_map(store, verify=True).load(), expected)
    (marks / "c.0.0").unlink()
    with pytest.raises(pk.StoreError, match="has no mark"):
        pk.open_map(store)


# --------------------------------------------------------------------- new maps


@pytest.mark.parametrize("name", ["NUL", "x:y", "x.", "x ", "a\\b", "SWEEP", "Beta", "BETA"])
def test_maps_with_such_names_are_not_begun(name, tmp_path):
    beta = xr.DataArray([0.1, 0.2], dims=name, coords={name: [1.0, 2.0]})
    with pytest.raises(pk.StoreError, match="wants names that are names of files on every system"):
        pk.sweep(DISK, beta=beta, store=tmp_path / "map.zarr", of="phi")
    assert list(tmp_path.iterdir()) == []


@pytest.mark.slow
def test_names_of_ones_own_stay(tmp_path):
    """An extension that is stopped at any moment goes on, with coordinates that only it knows."""
    path, whole = tmp_path / "map.zarr", tmp_path / "whole.zarr"
    beta = xr.DataArray([0.1, 0.2], dims="speed [rpm]", coords={"speed [rpm]": [1.0, 2.0]})
    phi = xr.DataArray([0.1, 0.2], dims="ort", coords={"ort": ["p", "q"]})
    more = {"of": ["phi", "period"], "beta": beta, "state_phi": phi, "state_dphi": 0.0}
    pk.sweep(DISK, beta=beta, store=path, of="phi")
    shutil.copytree(path, whole)
    expected = pk.sweep(DISK, store=whole, **more).load()
    stopped = 0
    original = zarr.storage.LocalStore.set
    for writes in range(0, 24, 4):
        copy = shutil.copytree(path, tmp_path / f"{writes}.zarr")
        left = iter(range(writes))

        async def stops(self, key, value, left=left):
            if next(left, None) is None:
                raise OSError("stopped")
            await original(self, key, value)

        with pytest.MonkeyPatch.context() as patch:
            patch.setattr(zarr.storage.LocalStore, "set", stops)
            try:
                pk.sweep(DISK, store=copy, **more)
            except pk.StoreError:
                stopped += 1
        pk.open_map(copy).load()
        xr.testing.assert_identical(pk.sweep(DISK, store=copy, **more).load(), expected)
    assert stopped >= 4


# --------------------------------------------------------------------- links


def link(path, target):
    if path.is_dir():
        shutil.rmtree(path)
    path.symlink_to(target)


@pytest.mark.skipif(os.name == "nt", reason="links take rights on Windows")
@pytest.mark.parametrize("name", ["phi", "sweep", "sweep/part0", "topology", "sweep/part1"])
@pytest.mark.parametrize("target", ["victim", "nothing"])
def test_folders_that_are_links_are_not_written_to(name, target, store):
    link(store / name, store.parent.parent / target)
    before = around(store)
    for place, overwrite in ((store, False), (store, True), (zarr.storage.LocalStore(store), True)):
        with pytest.raises(pk.StoreError, match=rf"holds a link, {name}, wants a folder there"):
            pk.sweep(DISK, LONGER, store=place, **MORE, overwrite=overwrite)
        assert around(store) == before


@pytest.mark.slow
@pytest.mark.skipif(os.name == "nt", reason="links take rights on Windows")
@pytest.mark.parametrize(
    "name", ["zarr.json", "sweep/zarr.json", "phi/zarr.json", "beta/c/0", "phi/c.0.0.0",
             "sweep/part0/c.0.0"]
)  # fmt: skip
def test_what_files_that_are_links_lead_to_stays(name, store):
    other = store.parent.parent / "victim" / "kept"
    shutil.move(store / name, other)
    link(store / name, other)
    before = around(store)
    expected = pk.sweep(DISK, LONGER, of=MORE["of"])
    ds = pk.sweep(DISK, LONGER, store=store, **MORE)
    xr.testing.assert_identical(ds.load(), expected)
    assert around(store) == before
    pk.sweep(DISK, AXES, store=store, **CALL, overwrite=True)
    assert not any(path.is_symlink() for path in store.rglob("*"))
    assert around(store) == before


@pytest.mark.skipif(os.name == "nt", reason="links take rights on Windows")
def test_a_map_may_be_a_link_itself(store):
    link(store.parent / "link.zarr", store)
    ds = pk.sweep(DISK, LONGER, store=store.parent / "link.zarr", **MORE)
    xr.testing.assert_identical(ds.load(), pk.sweep(DISK, LONGER, of=MORE["of"]))
    assert (store.parent / "link.zarr").is_symlink()


def test_metadata_that_is_gathered_in_the_root_names_nothing(store):
    """Zarr may keep that of all arrays in one file, under any names."""
    file = store / "zarr.json"
    root = json.loads(file.read_text())
    array = json.loads((store / "phi" / "zarr.json").read_text())
    names = ["../../victim", "../victim", "topology", "phi"]
    root["consolidated_metadata"] = {
        "kind": "inline", "must_understand": False, "metadata": dict.fromkeys(names, array),
    }  # fmt: skip
    file.write_text(json.dumps(root))
    before = around(store)
    place = zarr.storage.LocalStore(store)
    pk.sweep(DISK, AXES, store=place, **CALL, overwrite=True)
    assert around(store) == before
    xr.testing.assert_identical(pk.open_map(place).load(), pk.sweep(DISK, AXES, of=CALL["of"]))


# --------------------------------------------------------------------- netCDF, branches


def external_link(file, other):
    del file["n_equilibria"]
    file["n_equilibria"] = h5py.ExternalLink(other, "n_equilibria")


def external_group(file, other):
    file["more"] = h5py.ExternalLink(other, "/")


def external_values(file, other):
    file.create_dataset("raw", (4,), "u1", external=[(other, 0, 4)])


def virtual_values(file, other):
    layout = h5py.VirtualLayout((2,), "f8")
    layout[:] = h5py.VirtualSource(other, "lam", (2,))
    file.create_group("deep").create_virtual_dataset("raw", layout)


@pytest.fixture(scope="module")
def files(tmp_path_factory):
    """A folder with two maps and a branch."""
    folder = tmp_path_factory.mktemp("files")
    for name in ("map.nc", "other.nc"):
        pk.sweep(pk.Reduced(0.1, 0.2), lam=[0.1, 0.2], store=folder / name).close()
    problem = pk.Problem("mu - x**2", "x", {"mu": 1.0})
    branch = pk.continuation(problem, "mu", x0=[1.0], span=(0.0, 1.0))
    branch.save(folder / "branch.nc")
    pk.open_map(folder / "map.nc").close()
    pk.Branch.load(folder / "branch.nc")
    return folder


@pytest.mark.slow
@pytest.mark.parametrize("change", [external_link, external_group, external_values, virtual_values])
def test_values_in_other_files_are_refused(change, files, tmp_path):
    shutil.copytree(files, tmp_path, dirs_exist_ok=True)
    maps = [tmp_path / "map.nc", tmp_path / "other.nc"]
    for path, name in ((maps[0], "../other.nc"), (maps[0], str(maps[1]))):
        copy = shutil.copy(path, tmp_path / "copy.nc")
        with h5py.File(copy, "r+") as file:
            change(file, name)
        with pytest.raises(pk.StoreError, match=r"copy\.nc is refused: .* in another file"):
            pk.open_map(copy)
    with h5py.File(tmp_path / "branch.nc", "r+") as file:
        if change is not external_link:
            change(file, str(maps[1]))
        else:
            file["new"] = h5py.ExternalLink(str(maps[1]), "lam")
    with pytest.raises(pk.StoreError, match=r"branch\.nc .*another file"):
        pk.Branch.load(tmp_path / "branch.nc")
