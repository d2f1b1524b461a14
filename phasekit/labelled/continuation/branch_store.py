"""Branches on disk: everything that they hold, to the last bit."""

from __future__ import annotations

import contextlib
import json
from collections.abc import Iterator, Mapping
from os import PathLike, fspath
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr

from phasekit.errors import ParameterError, StoreError
from phasekit.labelled.continuation.branch import Branch, make_branch
from phasekit.labelled.continuation.branch_stored import ARRAYS, Stored, damaged
from phasekit.labelled.continuation.cycle_store import made_again
from phasekit.labelled.continuation.user_events import written
from phasekit.labels.arguments import bad, flag
from phasekit.maps.netcdf import open_netcdf
from phasekit.maps.replacing import put_back
from phasekit.maps.stored_arrays import reason
from phasekit.maps.whole import WholeTarget, target_of
from phasekit.systems.identity import MODEL, SCHEMA, SCHEMA_VERSION, versions
from phasekit.systems.problem import as_problem

_NAME = "Branch"


def save(branch: Branch, path: str | PathLike[str], overwrite: bool) -> None:
    """Write a branch: its points as a Dataset, and what it takes to go on."""
    curve, problem = branch.known()
    flag("overwrite", overwrite)
    target = WholeTarget(target_of(path), overwrite=overwrite)
    ds = branch.to_dataset()
    for name, array in {
        **{f"curve_{name}": getattr(curve, name) for name in ARRAYS},
        "curve_aux": np.zeros(0) if curve.aux is None else curve.aux,
        "start_u": branch.start.u,
        "start_tangent": branch.start.tangent,
        "start_slopes": branch.start.slopes,
    }.items():
        ds[f"raw_{name}"] = (tuple(f"raw_{name}_{k}" for k in range(array.ndim)), array)
    for name, track in zip(("backward", "forward"), branch.tracks, strict=True):
        if track is not None:
            ds[f"raw_{name}"] = ((f"raw_{name}_point", f"raw_{name}_column"), track.record)
            if track.slopes.shape[1]:
                ds[f"raw_{name}_slopes"] = (
                    (f"raw_{name}_point", f"raw_{name}_slope"), track.slopes,
                )  # fmt: skip
            ds[f"raw_{name}_state"] = ((f"raw_{name}_entry",), track.state)
    spec = {
        "problem": problem.specification(),
        "free": list(branch.free),
        "kind": branch.kind,
        "options": curve.options.as_dict(),
        "stops": [
            None if track is None else [track.stop.reason, track.stop.message]
            for track in branch.tracks
        ],
        "record": {name: function is None for name, function in branch.record.items()},
    }
    if curve.events:
        spec |= {"events": written(curve.events), "ends": list(curve.ends)}
        spec["conditions"] = [event.name for event in curve.events if event.condition]
    elif curve.ends:
        spec["ends"] = list(curve.ends)
    if curve.held is not None:
        spec["held"] = written([curve.held])
    ds.attrs = {
        MODEL: _NAME, SCHEMA: SCHEMA_VERSION, **versions(), "branch": json.dumps(spec),
    }  # fmt: skip
    target.write(ds)


def load(path: str | PathLike[str], problem: Any, record: Any, events: Any = None) -> Branch:
    """Read a branch and make it again of what was traced.

    Raises
    ------
    StoreError
        If nothing is there, or what is there is damaged or was made by another version.
    ParameterError
        If the problem or the functions to record are needed, or are not those of the branch.
    """
    for name, functions in (("record", record), ("events", events)):
        if functions is not None and not isinstance(functions, Mapping):
            raise bad(name, functions, "a mapping from names to functions, or None")
    place = _place(path)
    with _open(place) as ds:
        stored = Stored(ds, str(place), _bytes(place))
        given = None if problem is None else as_problem(problem)
        if given is not None:
            stored.refuse_other(given)
        else:
            given = stored.problem()
        functions = stored.functions(record or {})
        of_cycles = ("cycle", "boundary", "fold_of_cycles", "period_doubling", "torus")
        if stored.spec["kind"] in of_cycles and not given.map:
            return made_again(stored, given, functions, events)
        curve = stored.curve(given).replace(**stored.asked(given, events))
        start, tracks = stored.traces(curve)
    if problem is not None or any(functions.values()) or events:
        return make_branch(given, curve, start, *tracks, functions)  # what f raises is the user's
    with damaged(str(place), "its points"):
        return make_branch(given, curve, start, *tracks, functions)


def _place(path: Any) -> Path:
    try:
        text = fspath(path)
    except TypeError:
        raise bad("path", path, "a path that ends in .zarr or .nc") from None
    if not isinstance(text, str) or not text or "\0" in text:
        raise bad("path", path, "a path that ends in .zarr or .nc, without null bytes")
    try:
        place = Path(text).expanduser()
    except RuntimeError as error:
        raise bad("path", path, f"a path that can exist: {error}") from None
    if not place.exists():
        put_back(place.absolute(), "path")
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
            ds = open_netcdf(place)
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
