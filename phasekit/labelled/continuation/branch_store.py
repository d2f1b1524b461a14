"""Branches on disk: everything that they hold, to the last bit."""

from __future__ import annotations

import contextlib
import json
from collections.abc import Iterator, Mapping
from os import PathLike, fspath
from pathlib import Path
from typing import Any

import xarray as xr

from phasekit.bifurcation.continuation.walk import Stop, Unsearched
from phasekit.errors import ParameterError, StoreError
from phasekit.labelled.continuation.branch import Branch, branch_of
from phasekit.labelled.continuation.branch_stored import Stored, damaged
from phasekit.labels.arguments import bad, flag
from phasekit.maps.netcdf import open_netcdf
from phasekit.maps.place import path_at
from phasekit.maps.stored_arrays import reason
from phasekit.maps.whole import WholeTarget, target_of
from phasekit.systems.identity import MODEL, SCHEMA, SCHEMA_VERSION, versions
from phasekit.systems.problem import Problem, as_problem
from phasekit.systems.user_events import written

_NAME = "Branch"
#: What branches of orbits are of, and those of fixed points of maps may be as well.
_OF_ORBITS = (
    "cycle", "boundary", "connection", "fold_of_cycles", "period_doubling", "torus",
    "cycle_branch_point",
)  # fmt: skip


def save(branch: Branch, path: str | PathLike[str], overwrite: bool) -> None:
    """Write a branch: its points as a Dataset, and what it takes to go on."""
    flag("overwrite", overwrite)
    target = WholeTarget(target_of(path), overwrite=overwrite)
    ds = branch.to_dataset()
    for name, values in list(ds.data_vars.items()):
        if values.dtype.kind == "c":
            ds = ds.drop_vars(str(name))
            for part, numbers in (("real", values.real), ("imag", values.imag)):
                ds[f"{name}_{part}"] = ((*values.dims[:-1], "number"), numbers.values)
    form, _ = _form(branch.kind, branch.problem)
    for name, array in form.arrays_of(branch).items():
        ds[f"raw_{name}"] = (tuple(f"raw_{name}_{k}" for k in range(array.ndim)), array)
    curve = branch.walker.curve
    spec = {
        "problem": branch.problem.specification(),
        "free": list(branch.free),
        "kind": branch.kind,
        "options": curve.options.as_dict(),
        "stops": [None if track is None else _stop_written(track.stop) for track in branch.tracks],
        "record": {name: _recorded_so(function) for name, function in branch.record.items()},
        **form.words_of(branch),
    }
    if curve.events:
        spec["events"] = written(curve.events)
    if curve.ends or curve.events:
        spec["ends"] = list(curve.ends)
    ds.attrs = {
        MODEL: _NAME, SCHEMA: SCHEMA_VERSION, **versions(), "branch": json.dumps(spec),
    }  # fmt: skip
    target.write(ds)


def _stop_written(stop: Stop) -> list[str]:
    """Why a track ended; where special points were not looked for, why it did before that as well.

    Where a wish ended it, its state stands beyond: who goes on has to know.
    """
    was = [stop.was.reason, stop.was.message] if isinstance(stop, Unsearched) else []
    return [stop.reason, stop.message, *was]


def _recorded_so(function: Any) -> Any:
    """What says in a file how a quantity is recorded: True by its name, False by a function."""
    return function.written() if hasattr(function, "written") else function is None


def _form(kind: str, problem: Problem) -> tuple[Any, type[Branch]]:
    """The module that knows the arrays of such branches, and their class."""
    if problem.bounded or (kind in _OF_ORBITS and not problem.map):
        from phasekit.labelled.continuation import cycle_store
        from phasekit.labelled.continuation.cycle_branch import ConnectionBranch, CycleBranch

        return cycle_store, ConnectionBranch if kind == cycle_store.CONNECTION else CycleBranch
    if problem.blocks:
        from phasekit.labelled.continuation import large_store
        from phasekit.labelled.continuation.large_branch import LargeBranch

        return large_store, LargeBranch
    from phasekit.labelled.continuation import curve_store

    return curve_store, Branch


def load(path: str | PathLike[str], problem: Any, record: Any, events: Any = None) -> Branch:
    """Read a branch and make it again of what was traced."""
    for name, functions in (("record", record), ("events", events)):
        if functions is not None and not isinstance(functions, Mapping):
            raise bad(name, functions, "a mapping from names to functions, or None")
    place = _existing(path)
    with _open(place) as ds:
        stored = Stored(ds, str(place), _bytes(place))
        given = None if problem is None else as_problem(problem)
        if given is not None:
            stored.refuse_other(given)
        else:
            given = stored.problem()
        functions = stored.functions(given, record or {})
        reader, form = _form(stored.kind, given)
        walker, start, tracks, origin = reader.read(stored, given, events)
    of_user = problem is not None or record or events
    with contextlib.nullcontext() if of_user else damaged(str(place), "its points"):
        if hasattr(reader, "solve") and not reader.solve(walker.curve, start, tracks):
            raise bad("problem", given, "the problem of the branch, whose points solve f = 0")
        branch: Branch = branch_of(form, given, walker, start, functions, tracks, origin)
    return branch


def _existing(path: Any) -> Path:
    try:
        text = fspath(path)
    except TypeError:
        raise bad("path", path, "a path that ends in .zarr or .nc") from None
    if not isinstance(text, str) or not text or "\0" in text:
        raise bad("path", path, "a path that ends in .zarr or .nc, without null bytes")
    place = path_at(text, "path")
    if not place.exists():
        raise StoreError(f"path: {place} does not exist")
    return place


def _bytes(place: Path) -> int:
    files = place.rglob("*") if place.is_dir() else [place]
    return sum(file.stat().st_size for file in files if file.is_file())


@contextlib.contextmanager
def _open(place: Path) -> Iterator[xr.Dataset]:
    """Open what is there, without reading its arrays."""
    store = None
    try:
        if place.is_dir():
            from zarr.storage import LocalStore

            from phasekit.maps.seal import sealed  # here: it loads zarr

            folder = LocalStore(place, read_only=True)
            store = sealed(folder, str(place))
            # Format 2 has codecs that unpickle what they read; branches are of format 3.
            ds: xr.Dataset = xr.open_zarr(
                store or folder, consolidated=False, chunks=None, zarr_format=3
            )
        else:
            ds = open_netcdf(place, verify=True)  # few numbers, which are all read
    except Exception as error:  # whatever is made of files that are not what they were
        raise StoreError(f"path: {place} cannot be read: {reason(error)}") from error
    with ds:
        if str(ds.attrs.get(MODEL)) != _NAME or "branch" not in ds.attrs:
            raise StoreError(f"path: {place} holds no branch of phasekit")
        try:
            yield ds
        except StoreError:  # what is asked of any file says more
            raise
        except ParameterError:
            if store is not None:
                store.refuse_documents()
            raise
    if store is not None:
        store.refuse_documents()
