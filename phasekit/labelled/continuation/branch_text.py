"""What is said of a branch: in words, as columns and in a table, and if it is not complete."""

from __future__ import annotations

import html
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any, TypeVar

import numpy as np
import xarray as xr

from phasekit.bifurcation.continuation.walk import UNFINISHED
from phasekit.errors import warn
from phasekit.labels.grid import LABEL_DTYPE

#: Special points that a branch shows at most.
SHOWN = 20


def text_of(branch: Any, notes: Sequence[str]) -> str:
    """What it is, its range, its special points and why it ends."""
    points = [repr(s) for s in branch.special_points if s.kind != "end"]
    more = [f"... {len(points) - SHOWN} more"] if len(points) > SHOWN else []
    return "\n  ".join([f"<{head_of(branch)}", *points[:SHOWN], *more, *notes]) + ">"


def html_of(branch: Any, notes: Sequence[str]) -> str:
    """The same, special points in a table."""
    points = branch.table()
    points = points[points.kind != "end"]
    rows = points.to_html(index=False, border=0, max_rows=SHOWN) if len(points) else ""
    lines = "".join(f"<div>{html.escape(note)}</div>" for note in notes)
    return f"<div><b>{html.escape(head_of(branch))}</b>{rows}{lines}</div>"


def head_of(branch: Any) -> str:
    """What its points are, how many there are, and where."""
    points = branch._points
    u = {name: points[name].values for name in (*branch.free, *branch._numbers)}
    ranges = ", ".join(f"{n} from {v.min():.6g} to {v.max():.6g}" for n, v in u.items())
    return f"Branch of {_followed(branch)}: {points.sizes['point']} points, {ranges}"


def _followed(branch: Any) -> str:
    held = getattr(branch.walker.curve, "held", None)
    if held is not None:
        return f"points of the event {held.name!r}"
    holds = " and ".join(one.name for one in getattr(branch.walker.curve, "holds", ()))
    with_held = f" with {holds}" if holds else ""
    words = {
        "equilibrium": "fixed points" if branch.problem.map else "equilibria",
        "cycle": "periodic orbits",
        "boundary": "solutions",
        "connection": "connections",
    }
    pairs = branch._points.get("kind_of_pair")
    names = set[str]() if pairs is None else set(map(str, pairs.values))
    beyond = sorted(names - {"", branch.kind})
    with_others = "".join(f" and {name} points" for name in beyond)
    return words.get(branch.kind, f"{branch.kind} points") + with_others + with_held


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


Of = TypeVar("Of", bound=Any)


def interrupted(branch: Any) -> bool:
    """Whether Ctrl-C ended it."""
    return any(stop.reason == "interrupted" for stop in branch.stops)


def announced(branch: Of) -> Of:
    """The branch, with a warning if it ended for its number of points, or by Ctrl-C."""
    ends = [
        f"{name}: {stop.message}"
        for name, stop in zip(("first point", "last point"), branch.stops, strict=True)
        if stop.reason in UNFINISHED
    ]
    if ends:
        more = (
            ""
            if interrupted(branch)
            else ", ContinuationOptions(max_points=...) allows more points"
        )
        warn(
            f"the branch in {branch.parameter} is not complete, {'; '.join(ends)}; what "
            f"lies beyond on this {_named(branch)} was not seen; extend() continues it{more}",
            RuntimeWarning,
        )
    return branch


def _named(branch: Any) -> str:
    """What a branch is, and at which point it begins."""
    what = "family of periodic orbits" if branch.kind == "cycle" else f"{branch.kind} branch"
    points = branch.special_points
    return f"{what} from {points[0]!r}" if points else what
