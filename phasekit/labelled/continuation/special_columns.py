"""Special points of a branch as columns: behind its points, and in a table for reading."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
import xarray as xr

from phasekit.labels.grid import LABEL_DTYPE

if TYPE_CHECKING:
    import pandas as pd

DIM = "special_point"


def with_special_points(ds: xr.Dataset, branch: Any) -> xr.Dataset:
    """The points of a branch, and its special points on a dim of their own."""
    specials = branch.special_points

    def strings(values: list[str]) -> tuple[str, Any]:
        return DIM, np.array(values, dtype=LABEL_DTYPE)

    ds["special_kind"] = strings([s.kind for s in specials])
    ds["special_label"] = strings([s.label for s in specials])
    ds["special_status"] = strings([s.status for s in specials])
    ds["special_message"] = strings([s.message for s in specials])
    if any(s.name for s in specials):
        ds["special_name"] = strings([s.name for s in specials])
    fields = tuple(block.name for block in branch.problem.blocks)
    names = (*branch.free, *(fields or branch.problem_state))
    for name in names:
        of = [s[name] for s in specials]
        dims = getattr(of[0], "dims", ()) if of else ()
        ds[f"special_{name}"] = ((DIM, *dims), np.array(of))
    ds["special_residual"] = (DIM, np.array([s.residual for s in specials]))
    ds["special_corank"] = (DIM, np.array([s.corank for s in specials], dtype=np.int64))
    ds["special_index"] = (DIM, np.array([s.index for s in specials], dtype=np.int64))
    intervals = np.array([s.interval for s in specials])
    ds["special_interval"] = ((DIM, "end"), intervals.reshape(-1, 2))
    for name in branch._numbers:
        ds[f"special_{name}"] = (DIM, np.array([s[name] for s in specials]))
    if branch._certificate is not None:
        ds["special_certified"] = (DIM, np.array([s.certified for s in specials], dtype=bool))
        ds["special_doubt"] = strings([s.doubt for s in specials])
        for name in names:
            ends = [s.enclosure.get(name, (np.nan, np.nan)) for s in specials]
            ds[f"special_{name}_enclosure"] = ((DIM, "end"), np.array(ends).reshape(-1, 2))
    return ds


def special_table(branch: Any) -> pd.DataFrame:
    """The special points of a branch, a row each."""
    import pandas as pd

    specials = branch.special_points
    columns: dict[str, Any] = {
        "label": [s.label for s in specials], "kind": [s.kind for s in specials]
    }  # fmt: skip
    states = () if branch.problem.blocks else branch.problem_state
    for name in (*branch.free, *branch._numbers, *states):
        columns[name] = [s[name] for s in specials]
    columns["residual"] = [s.residual for s in specials]
    if branch._certificate is not None:
        columns["certified"] = [s.certified for s in specials]
    columns["status"] = [s.status for s in specials]
    columns["message"] = ["; ".join(filter(None, (s.name, s.message))) for s in specials]
    return pd.DataFrame(columns)
