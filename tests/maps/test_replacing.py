"""What is overwritten in one go stands there, the old one or the new one, whatever happens."""

import itertools
import os
import shutil
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest
import xarray as xr

import phasekit as pk
from phasekit.maps import netcdf
from phasekit.maps.whole import WholeTarget, target_of

pytest.importorskip("zarr")

WELL = pk.Potential("x^4/4 - mu*x^2/2 + k*x", "x", {"mu": 1.0, "k": 0.1})
OF = "n_equilibria"
MAPS = [pk.sweep(WELL, mu=[0.5, 1.0], k=[0.0, number], of=OF) for number in (0.1, 0.2)]
LINES = [
    pk.continuation(pk.Problem("mu - x**2", "x", {"mu": 1.0}), "mu", x0=[1.0], span=(low, 1.5))
    for low in (0.0, 0.5)
]


def write_map(path, number):
    WholeTarget(target_of(path), overwrite=True).write(MAPS[number])


def read_map(path):
    with pk.open_map(path, verify=True) as ds:
        found = [number for number in (0, 1) if ds.load().identical(MAPS[number])]
    assert len(found) == 1
    return found[0]


def write_branch(path, number):
    LINES[number].save(path, overwrite=True)


def read_branch(path):
    points = pk.Branch.load(path).points
    found = [number for number in (0, 1) if points.identical(LINES[number].points)]
    assert len(found) == 1
    return found[0]


KINDS = {
    "a map": ("map.zarr", write_map, read_map),
    "a branch": ("branch.zarr", write_branch, read_branch),
    "a map as a file": ("map.nc", write_map, read_map),
    "a branch as a file": ("branch.nc", write_branch, read_branch),
}


@pytest.fixture(scope="module")
def written(tmp_path_factory):
    """Each kind with each content, written once; tests copy it."""
    paths = {}
    for kind, (name, write, _) in KINDS.items():
        for number in (0, 1):
            paths[kind, number] = tmp_path_factory.mktemp("written") / name
            write(paths[kind, number], number)
    return paths


def copy(source, target):
    """Copy a store or a file."""
    (shutil.copytree if source.is_dir() else shutil.copy)(source, target)


class Fails:
    """Renames a path, until one of its renames, or that and all after it, fails."""

    def __init__(self, path, first, lasting):
        self.path, self.first, self.lasting, self.count = path, first, lasting, 0

    def instead_of(self, original):
        def step(source, target, **kwargs):
            if self.path in (Path(source), Path(target)):
                self.count += 1
                if self.count == self.first or (self.lasting and self.count > self.first):
                    raise OSError(13, "Permission denied")
            return original(source, target, **kwargs)

        return step


@pytest.mark.parametrize("kind", KINDS)
def test_a_step_that_fails(kind, written, tmp_path):
    name, write, read = KINDS[kind]
    path = tmp_path / name
    copy(written[kind, 0], path)
    assert (read(path), os.listdir(tmp_path)) == (0, [name])
    steps = 2 if name.endswith(".zarr") else 1
    for first, lasting in itertools.product(range(1, steps + 1), (False, True)):
        with pytest.MonkeyPatch.context() as patch:
            fails = Fails(path, first, lasting)
            for step in ("rename", "replace"):
                patch.setattr(os, step, fails.instead_of(getattr(os, step)))
            with pytest.raises(pk.StoreError, match=f"{name} was not written: .*Permission denied"):
                write(path, 1)
        assert read(path) == 0
        assert os.listdir(tmp_path) == [name]
    with pytest.MonkeyPatch.context() as patch:
        counts = Fails(path, 99, False)
        for step in ("rename", "replace"):
            patch.setattr(os, step, counts.instead_of(getattr(os, step)))
        write(path, 1)
        assert counts.count == steps
    assert read(path) == 1
    assert os.listdir(tmp_path) == [name]


def test_ctrl_c_between_the_steps(written, tmp_path, monkeypatch):
    path = tmp_path / "map.zarr"
    copy(written["a map", 0], path)
    original = os.rename

    def interrupted(source, target):
        original(source, target)
        if Path(source) == path:
            signal.raise_signal(signal.SIGINT)

    monkeypatch.setattr(os, "rename", interrupted)
    with pytest.raises(KeyboardInterrupt):
        write_map(path, 1)
    assert read_map(path) == 1
    assert os.listdir(tmp_path) == ["map.zarr"]


KILLED = """
import os, sys
from pathlib import Path
import phasekit as pk

path, original = Path(sys.argv[1]), os.rename

def killed(source, target):
    original(source, target)
    if Path(source) == path:
        os._exit(9)

os.rename = killed
line = pk.continuation(pk.Problem("mu - x**2", "x", {"mu": 1.0}), "mu", x0=[1.0], span=(0.5, 1.5))
line.save(path, overwrite=True)
"""


@pytest.mark.slow
def test_a_kill_between_the_steps(tmp_path):
    path = tmp_path / "branch.zarr"
    write_branch(path, 0)
    done = subprocess.run([sys.executable, "-c", KILLED, str(path)], check=False)
    assert done.returncode == 9
    assert "branch.zarr" not in os.listdir(tmp_path)
    assert read_branch(path) == 0
    assert os.listdir(tmp_path) == ["branch.zarr"]


CALLS = {
    "opened": lambda path, kind: kind[2](path),
    "written": lambda path, kind: kind[1](path, 1),
    "refused": lambda path, kind: pytest.raises(pk.StoreError, LINES[0].save, path),
}


@pytest.mark.parametrize("left", ["whole", "half", "nothing"])
@pytest.mark.parametrize("kind", ["a map", "a branch"])
@pytest.mark.parametrize("call", CALLS)
def test_what_a_kill_left_is_put_back(left, kind, call, written, tmp_path):
    name, _, read = KINDS[kind]
    path, aside = tmp_path / name, tmp_path / f".{name}.ab_12xyz"
    copy(written[kind, 0], aside / "replaced")
    if left == "whole":
        copy(written[kind, 1], aside / name)
    if left == "half":
        (aside / name / "mu").mkdir(parents=True)
    # Of others, and of those who write now: with these names, and not.
    for other in (f".{name}.zarr.ab_12xyz", f".{name}.notes", f".{name}.ab_12xy-"):
        (tmp_path / other / "replaced").mkdir(parents=True)
    kept = set(os.listdir(tmp_path)) - {aside.name}
    CALLS[call](path, KINDS[kind])
    assert set(os.listdir(tmp_path)) == {*kept, name}
    assert read(path) == (1 if call == "written" else 0)


def test_what_a_kill_left_is_not_put_in_the_place_of_another(tmp_path):
    path, aside = tmp_path / "map.zarr", tmp_path / ".map.zarr.abcdefgh"
    write_map(path, 1)
    aside.mkdir()
    path.rename(aside / "replaced")
    write_map(path, 0)  # put back, and written over
    assert read_map(path) == 0
    assert os.listdir(tmp_path) == ["map.zarr"]
    shutil.copytree(path, aside / "replaced")
    write_map(tmp_path / "other.zarr", 1)
    assert read_map(path) == 0
    assert aside.exists()
    write_map(path, 1)
    assert read_map(path) == 1
    assert sorted(os.listdir(tmp_path)) == ["map.zarr", "other.zarr"]


def test_what_others_write_is_left_alone(tmp_path, monkeypatch):
    """A writer that is slow, and one that comes meanwhile."""
    path = tmp_path / "map.nc"
    write_map(path, 0)
    original, inside = netcdf.write, []

    def slow(ds, fresh):
        original(ds, fresh)
        if not inside:
            inside.append(fresh)
            write_map(path, 0)
            assert fresh.exists()

    monkeypatch.setattr(netcdf, "write", slow)
    write_map(path, 1)
    assert inside
    assert read_map(path) == 1
    assert os.listdir(tmp_path) == ["map.nc"]


def test_folders_of_other_files_are_kept(tmp_path):
    """What only looks like a scratch folder, or holds more than one does."""
    path, aside = tmp_path / "map.zarr", tmp_path / ".map.zarr.abcdefgh"
    aside.mkdir()
    (aside / "notes.txt").write_text("mine")
    old = tmp_path / ".map.zarr.12345678"
    old.mkdir()
    (old / "map.zarr").mkdir()
    os.utime(old, (0, time.time() - 1e7))
    write_map(path, 0)
    assert sorted(os.listdir(tmp_path)) == [".map.zarr.abcdefgh", "map.zarr"]


@pytest.mark.skipif(os.name == "nt", reason="folders have other rights on Windows")
def test_where_nothing_can_be_put_back(tmp_path, monkeypatch):
    path, aside = tmp_path / "map.zarr", tmp_path / ".map.zarr.abcdefgh"
    write_map(path, 0)
    aside.mkdir()
    path.rename(aside / "replaced")

    def refuses(*_):
        raise OSError(30, "Read-only file system")

    with monkeypatch.context() as patch:
        patch.setattr(os, "rename", refuses)
        for call, what in ((pk.open_map, "store"), (pk.Branch.load, "path")):
            with pytest.raises(pk.StoreError, match=f"^{what}: .*replaced and cannot be put back"):
                call(path)
    assert read_map(path) == 0


def test_tiles_take_the_place_of_what_was_put_back(tmp_path):
    path, aside = tmp_path / "map.zarr", tmp_path / ".map.zarr.abcdefgh"
    write_map(path, 0)
    aside.mkdir()
    path.rename(aside / "replaced")
    reduced = pk.Reduced(0.1, 0.2)
    with pytest.raises(pk.StoreError):
        pk.sweep(reduced, lam=[0.1, 0.2], store=path)
    ds = pk.sweep(reduced, lam=[0.1, 0.2], store=path, overwrite=True)
    xr.testing.assert_identical(ds.load(), pk.sweep(reduced, lam=[0.1, 0.2]))
    assert os.listdir(tmp_path) == ["map.zarr"]
