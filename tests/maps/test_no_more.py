"""A disk that takes no more and memory that is gone, at any moment: a `StoreError`, and no loss."""

import os
import shutil
import sys

import numpy as np
import pytest
import xarray as xr

import phasekit as pk
from phasekit.maps import damage, job, run, tile

pytest.importorskip("zarr")

DISK = pk.GyroRotorDisk(beta=0.3, e=0.0115, a=0.02, r=0.21, omega1=2.5)
AXES = {"beta": np.linspace(0.1, 1.5, 3), "a": np.array([0.0, 0.02])}
CALL = {"of": ["n_equilibria", "phi"], "chunks": 2, "workers": 1}
LONGER = {**AXES, "beta": np.append(AXES["beta"], 1.6)}
WELL = pk.Potential("x^4/4 - mu*x^2/2", "x", {"mu": 1.0})
LINE = pk.continuation(pk.Problem("mu - x**2", "x", {"mu": 1.0}), "mu", x0=[1.0], span=(0.0, 1.5))

WRITES = ("os.mkdir", "os.rename", "os.remove", "os.rmdir", "os.link", "shutil.rmtree", "os.utime")


class Disk:
    """Refuses, for a folder, every change after a number of them: it is read-only from then on."""

    def __init__(self):
        self.folder, self.left, self.refused = None, 0, 0

    def __call__(self, event, args):  # noqa: D102
        if self.folder is None:
            return
        if event == "open":
            path, mode, flags = args
            writes = isinstance(mode, str) and set(mode) & set("wax+")
            writes = writes or (flags or 0) & (os.O_WRONLY | os.O_RDWR)
        else:
            path, writes = args[0] if args else None, event in WRITES
        if writes and isinstance(path, (str, os.PathLike)) and str(path).startswith(self.folder):
            self.left -= 1
            if self.left < 0:
                self.refused += 1
                raise OSError(30, "Read-only file system")


DISK_HOOK = Disk()
sys.addaudithook(DISK_HOOK)

CALLS = {
    "begun": (False, lambda path: pk.sweep(DISK, AXES, store=path / "map.zarr", **CALL)),
    "longer": (True, lambda path: pk.sweep(DISK, LONGER, store=path / "map.zarr", **CALL)),
    "over": (
        True,
        lambda path: pk.sweep(DISK, LONGER, store=path / "map.zarr", **CALL, overwrite=True),
    ),
    "in one go": (
        False,
        lambda path: pk.sweep(WELL, mu=[0.5, 1.0], of="n_equilibria", store=path / "well.zarr"),
    ),
    "a branch": (False, lambda path: LINE.save(path / "branch.zarr")),
}


@pytest.fixture(scope="module")
def begun(tmp_path_factory):
    """A map that others are copies of."""
    path = tmp_path_factory.mktemp("begun") / "map.zarr"
    pk.sweep(DISK, AXES, store=path, **CALL)
    return path


@pytest.fixture(scope="module")
def longer():
    """What it becomes."""
    return pk.sweep(DISK, LONGER, of=CALL["of"])


@pytest.mark.slow
@pytest.mark.parametrize("name", CALLS)
def test_a_disk_that_turns_read_only(name, begun, tmp_path):
    goes_on, call = CALLS[name]
    whole = tmp_path / "whole"
    whole.mkdir()
    if goes_on:
        shutil.copytree(begun, whole / "map.zarr")
    refused = 0
    for left in (0, 1, 2, 3, 5, 8, 13, 21, 34, 55, 10_000):
        folder = shutil.copytree(whole, tmp_path / str(left))
        DISK_HOOK.left, DISK_HOOK.refused, DISK_HOOK.folder = left, 0, str(folder)
        try:
            call(folder)
        except pk.StoreError:
            refused += DISK_HOOK.refused > 0
        finally:
            DISK_HOOK.folder = None
    assert DISK_HOOK.left > 0  # the last one went through
    assert refused >= 6


FULL = np._core._exceptions._ArrayMemoryError((10**9,), np.dtype("f8"))
MOMENTS = {
    "planned": (run, "plan_job"),
    "read": (job, "_look"),
    "marks": (job, "marks_of"),
    "verified": (damage, "damage"),
    "prepared": (run, "prepare"),
    "computed": (tile, "compute_cells"),
    "written": (tile, "_write"),
    "finished": (run, "_finish"),
}


@pytest.mark.slow
@pytest.mark.parametrize("moment", MOMENTS)
@pytest.mark.parametrize("error", [MemoryError(), FULL], ids=["bare", "of an array"])
def test_no_memory_is_left(moment, error, begun, longer, tmp_path, monkeypatch):
    path = shutil.copytree(begun, tmp_path / "map.zarr")
    seen = []

    def fails(*_, **__):
        seen.append(1)
        raise error

    with monkeypatch.context() as patch:
        patch.setattr(*MOMENTS[moment], fails)
        with pytest.raises(pk.StoreError, match="memory|MemoryError") as caught:
            pk.sweep(DISK, LONGER, store=path, **CALL)
    assert seen
    assert str(path) in str(caught.value)
    assert "damaged" not in str(caught.value)
    ds = pk.sweep(DISK, LONGER, store=path, **CALL)
    xr.testing.assert_identical(ds.load(), longer)


def test_no_memory_for_a_map_in_memory(monkeypatch):
    def fails(*_):
        raise FULL

    monkeypatch.setattr("phasekit.maps.sweep.compute", fails)
    with pytest.raises(pk.PhasekitError, match="^axes: got more than the memory that is left"):
        pk.sweep(DISK, AXES)


def test_no_memory_for_what_is_written_or_read_in_one_go(tmp_path, monkeypatch):
    def fails(*_, **__):
        raise MemoryError

    with monkeypatch.context() as patch:
        patch.setattr(xr.Dataset, "to_zarr", fails)
        with pytest.raises(pk.StoreError, match="was not written: no memory is left"):
            LINE.save(tmp_path / "branch.zarr")
    assert os.listdir(tmp_path) == []
    LINE.save(tmp_path / "branch.zarr")
    with monkeypatch.context() as patch:
        patch.setattr(np, "ascontiguousarray", fails)
        with pytest.raises(pk.StoreError, match="cannot be read: no memory is left"):
            pk.Branch.load(tmp_path / "branch.zarr")
    with monkeypatch.context() as patch:
        patch.setattr(xr, "open_zarr", fails)
        for call in (pk.open_map, pk.Branch.load):
            with pytest.raises(pk.StoreError, match="cannot be read: no memory is left"):
                call(tmp_path / "branch.zarr")
