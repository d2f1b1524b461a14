"""From one cell of a map of branches back to its branches."""

from __future__ import annotations

from typing import Any

import xarray as xr

from phasekit.cells.along import branches_of, ends_of, parameter_along
from phasekit.labelled.continuation.branch import Branch, branch_of_found
from phasekit.labels.arguments import bad, whole


def cell_branch(ds: xr.Dataset, system: Any, number: int) -> Branch:
    """One of the branches of a cell."""
    parameter = parameter_along(system.parameters, map(str, ds.coords))
    if parameter is None:
        raise bad("ds", ds, "a map of branches, of pk.sweep(..., along=...)")
    several = [name for name, value in system.parameters.items() if not isinstance(value, float)]
    if several:
        raise bad(
            "ds", f"cells of several {', '.join(several)}", "one cell", "select it with .isel(...)"
        )
    low, high = (float(ds[name]) for name in ends_of(parameter))
    problem, found = branches_of(system, parameter, (low, high))
    wants = f"a whole number from 0 to {len(found) - 1}" if found else "a cell with equilibria"
    if not 0 <= whole("number", number, wants, 0) < len(found):
        raise bad("number", number, wants)
    one = found[number]
    return branch_of_found(Branch, problem, one.walker, one.start, one.tracks, {}, one.found)
