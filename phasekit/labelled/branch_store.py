"""Branches on disk: everything that they hold, to the last bit."""

from __future__ import annotations

import json
from os import PathLike, fspath
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr

from phasekit.bifurcation.continuation.curve import Curve, Stop, Track
from phasekit.bifurcation.continuation.options import ContinuationOptions
from phasekit.bifurcation.continuation.path import Sample
from phasekit.errors import ParameterError, StoreError
from phasekit.kernels.trace import RECORDED
from phasekit.labelled.arguments import bad, flag
from phasekit.labelled.branch import NUMBERS, Branch, make_branch
from phasekit.labelled.problem import Problem, as_problem
from phasekit.labelled.schema import MODEL, SCHEMA, SCHEMA_VERSION, versions
from phasekit.labelled.store import WholeTarget, target_of

_NAME = "Branch"
_ARRAYS = ("par", "scale", "period", "low", "high")


def save(branch: Branch, path: str | PathLike[str], overwrite: bool) -> None:
    """Write a branch: its points as a Dataset, and what it takes to go on."""
    curve, problem = branch.known()
    flag("overwrite", overwrite)
    target = WholeTarget(target_of(path), overwrite=overwrite)
    ds = branch.to_dataset()
    for name, array in {
        **{f"curve_{name}": getattr(curve, name) for name in _ARRAYS},
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
    ds.attrs = {
        MODEL: _NAME, SCHEMA: SCHEMA_VERSION, **versions(), "branch": json.dumps(spec),
    }  # fmt: skip
    target.write(ds)


def load(path: str | PathLike[str], problem: Any, record: Any) -> Branch:
    """Read a branch and make it again of what was traced."""
    ds = _open(path)
    spec = json.loads(ds.attrs["branch"])
    if problem is None:
        problem = Problem.from_specification(spec["problem"])
        if problem is None:
            raise ParameterError(
                "problem: the branch is one of Python or compiled code, which is not saved; "
                "wants the problem itself: Branch.load(path, problem=...)"
            )
    else:
        problem = as_problem(problem)
        wants = spec["problem"]
        same = list(problem.state) == wants["state"] and dict(problem.parameters) == {
            name: float(value) for name, value in wants["parameters"].items()
        }
        if not same:
            raise bad("problem", problem, f"the problem of the branch, with {wants['state']} and "
                      f"{wants['parameters']}")  # fmt: skip
    functions = _functions(spec["record"], record)
    options = spec["options"]
    options["detect"] = tuple(options["detect"])
    options["bounds"] = {name: tuple(pair) for name, pair in options["bounds"].items()}
    names = list(problem.parameters)
    aux = ds["raw_curve_aux"].values
    curve = Curve(
        field=problem.field,
        kind=NUMBERS[spec["kind"]],
        active=tuple(names.index(name) for name in spec["free"]),
        options=ContinuationOptions(**options),
        aux=aux if aux.size else None,
        **{name: ds[f"raw_curve_{name}"].values for name in _ARRAYS},
    )
    start = Sample(*(ds[f"raw_start_{name}"].values for name in ("u", "tangent", "slopes")))
    tracks: list[Track | None] = []
    for name, stop in zip(("backward", "forward"), spec["stops"], strict=True):
        if stop is None:
            tracks.append(None)
            continue
        record_ = ds[f"raw_{name}"].values
        slopes = record_[:, :0]
        here = slice(2 * curve.size, 2 * curve.size + curve.n * curve.m)
        if f"raw_{name}_slopes" in ds:
            slopes = ds[f"raw_{name}_slopes"].values
        elif curve.keeps:  # earlier versions kept them between tangents and step data
            slopes = record_[:, here]
        if record_.shape[1] > 2 * curve.size + RECORDED:
            record_ = np.delete(record_, here, axis=1)
        tracks.append(Track(record_, slopes, ds[f"raw_{name}_state"].values, Stop(*stop)))
    return make_branch(problem, curve, start, tracks[0], tracks[1], functions)


def _functions(kept: dict[str, bool], given: Any) -> dict[str, Any]:
    given = dict(given or {})
    missing = [name for name, by_name in kept.items() if not by_name and name not in given]
    if missing:
        raise ParameterError(
            f"record: the branch records {', '.join(missing)} by functions, which are not saved; "
            "wants them again: Branch.load(path, record={...})"
        )
    return {name: None if by_name else given[name] for name, by_name in kept.items()}


def _open(path: str | PathLike[str]) -> xr.Dataset:
    place = Path(fspath(path)).expanduser()
    if not place.exists():
        raise StoreError(f"path: {place} does not exist")
    ds: xr.Dataset
    try:
        if place.is_dir():
            ds = xr.open_zarr(place, consolidated=False, chunks=None).load()
        else:
            with xr.open_dataset(place, engine="h5netcdf") as opened:
                ds = opened.load()
    except (OSError, ValueError, KeyError) as error:
        raise StoreError(f"path: {place} cannot be read: {error}") from error
    if ds.attrs.get(MODEL) != _NAME or "branch" not in ds.attrs:
        raise StoreError(f"path: {place} holds no branch of phasekit")
    return ds
