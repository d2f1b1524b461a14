"""What other packages do not publish may go: phasekit still answers, by what they publish."""

import ast
import os
import re
import subprocess
import sys
from pathlib import Path

import pytest

PACKAGE = Path(__file__).parents[1] / "phasekit"

#: Parts of a module's name that say that it is not published.
PRIVATE = re.compile(r"(^|\.)(core|_\w+|\w+_)(\.|$)|^numba\.(np|misc)\b")

#: Names that are hidden from phasekit; the packages themselves use them.
HIDDEN = {
    "xarray.backends.H5NetCDFStore",
    "xarray.backends.h5netcdf_.H5NetCDFArrayWrapper",
    "xarray.core.indexing.IndexingSupport",
    "xarray.core.indexing.LazilyIndexedArray",
    "xarray.core.indexing.explicit_indexing_adapter",
    "xarray.namedarray.pycompat._cached_duck_array_modules",
    "zarr.core.sync.sync",
}
OURS = {"phasekit", "__future__"}
#: Packages that only some calls need.
OPTIONAL = {"dask", "distributed", "h5netcdf"}

#: Each name goes in a process of its own, forked when the packages are loaded, for that takes long.
PROGRAM = """
import builtins, importlib, os, sys, traceback
import xarray, zarr, zarr.buffer, zarr.storage
import xarray.backends, xarray.core.indexing
import distributed, matplotlib.pyplot, pandas, scipy.linalg.lapack, sympy, tqdm.auto, numpy as np

names, folder = eval(sys.argv[1]), sys.argv[2]


def hide(name):
    load = builtins.__import__
    module, _, last = name.rpartition(".")

    def without(wanted, globals=None, locals=None, fromlist=(), level=0):
        if str((globals or {}).get("__name__")).startswith("phasekit."):
            if (wanted == module and last in (fromlist or ())) or wanted.split(".")[0] == name:
                raise ImportError(f"{name} is gone")
        return load(wanted, globals, locals, fromlist, level)

    builtins.__import__ = without


def maps(folder):
    from phasekit.errors import StoreError
    from phasekit.maps import tile

    axes = {"beta": np.linspace(0.1, 1.4, 6), "of": "n_equilibria"}
    expected = pk.sweep(disk, **axes)
    assert expected.n_equilibria.values.tolist().count(4) >= 2
    for store in (f"{folder}/map.zarr", zarr.storage.MemoryStore()):
        assert pk.sweep(disk, **axes, store=store, chunks=2, workers=1).equals(expected)
        assert pk.open_map(store, verify=True).equals(expected)
        if not name.startswith("zarr"):
            break
    if name != "h5netcdf":
        pk.sweep(disk, **axes, store=f"{folder}/map.nc")
        with pk.open_map(f"{folder}/map.nc") as ds:
            assert ds.equals(expected)
        if "h5" in name:
            return
    else:
        try:
            pk.open_map(f"{folder}/map.zarr/zarr.json")
        except StoreError as error:
            assert "phasekit[netcdf]" in str(error), error
        return
    write, done = tile._write, []

    def fail(*given):
        if len(done) == 2:
            raise OSError("no more")
        done.append(write(*given))

    tile._write = fail
    try:
        pk.sweep(disk, **axes, store=f"{folder}/part.zarr", chunks=2, workers=1)
    except StoreError as error:
        assert "no more" in str(error)
    part = pk.open_map(f"{folder}/part.zarr")
    assert part.computed.values.tolist() == [True] * 4 + [False] * 2
    assert part.computed[3:5].values.tolist() == [True, False]
    assert part.n_equilibria[:4].equals(expected.n_equilibria[:4])


def answer():
    import phasekit as pk

    disk = pk.GyroRotorDisk(beta=0.3, e=0.0115, a=0.02, r=0.21, omega1=2.5)
    assert pk.equilibria(disk).n_equilibria.item() == 4
    return pk, disk


answer()  # loads what the names have nothing to do with
failed = []
for name in names:
    process = os.fork()
    if not process:
        try:
            hide(name)
            pk, disk = answer()
            os.mkdir(f"{folder}/{name}")
            maps(f"{folder}/{name}")
        except BaseException:
            print(name, file=sys.stderr)
            traceback.print_exc()
            os._exit(1)
        os._exit(0)
    failed += [name] * (os.waitpid(process, 0)[1] != 0)
print(failed)
"""


def imported(nodes):
    """Return the names that are imported from modules of others that are not published."""
    for node in nodes:
        if isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names if PRIVATE.search(alias.name))
        elif isinstance(node, ast.ImportFrom) and node.module.split(".")[0] not in OURS:
            names = (f"{node.module}.{alias.name}" for alias in node.names)
            yield from (name for name in names if PRIVATE.search(name))


def test_all_names_that_are_not_published_are_known_here():
    """And are imported where a module can do without them, or by one that can be done without."""
    found = set()
    for path in PACKAGE.rglob("*.py"):
        tree = ast.parse(path.read_text())
        found |= set(imported(ast.walk(tree)))
        if path.name != "netcdf_store.py":
            assert not list(imported(tree.body)), path
    assert len(found) > 4
    # For type checkers alone: a module, and no name in it.
    assert found - {"xarray.core.indexing"} == HIDDEN - {
        "xarray.backends.H5NetCDFStore"  # of a module that is published
    }


@pytest.mark.skipif(not hasattr(os, "fork"), reason="Windows forks no processes")
@pytest.mark.slow  # about ten processes
def test_without_any_one_of_them_there_is_an_answer(tmp_path):
    done = subprocess.run(
        [sys.executable, "-c", PROGRAM, repr(sorted(HIDDEN | OPTIONAL)), str(tmp_path)],
        capture_output=True,
        text=True,
        env={**os.environ, "PHASEKIT_CACHE_DIR": str(tmp_path / "kernels")},
    )
    assert done.stdout == "[]\n", done.stdout + done.stderr[-4000:]
