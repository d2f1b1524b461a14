"""All equilibria of a system of equations in a box, labelled."""

from __future__ import annotations

from dataclasses import replace
from types import MappingProxyType
from typing import Any

import numpy as np
import xarray as xr

from phasekit.arrays import Array
from phasekit.cells.equations import tabulated
from phasekit.cells.schema import dataset_attrs
from phasekit.errors import warn
from phasekit.labels.arguments import bad, whole
from phasekit.labels.grid import LABEL_DTYPE, Grid, make_grid, variable
from phasekit.maps.sweep import sweep
from phasekit.numerics.waits import notice
from phasekit.systems.problem import Problem, as_problem
from phasekit.systems.rests import Equilibria, corners, equilibria_of_cells, window_of
from phasekit.systems.smooth import refuse_jumps
from phasekit.table.equations import rows_of


def equilibria_in_box(system: Any, box: Any, n: Any = None) -> xr.Dataset:
    """All equilibria of a flow, or fixed points of a map's iterate; see `phasekit.equilibria`."""
    problem = as_problem(system, arrays=True)
    refuse_jumps(problem)
    if n is not None and not problem.map:
        raise bad("n", n, "None for a flow")
    if problem.time is not None:
        hint = "pk.periodic_orbit finds its periodic motions"
        raise bad("system", problem, "a flow without forcing, which has equilibria", hint)
    grid = make_grid(problem.parameters)
    if n is not None:
        times = whole("n", n, "a number of iterations >= 1")
        problem = problem.iterated(times)
    low, high = corners(problem, window_of(system, box))
    if grid.lazy:
        return _of_blocks(problem, low, high)
    dims, shape = tuple(grid.sizes), tuple(grid.sizes.values())
    values = {name: grid.aligned(name, dims) for name in grid.inputs}
    singles = dict[int, Problem]()
    for k, cell in enumerate(np.ndindex(shape)):
        own = {name: float(np.broadcast_to(array, shape)[cell]) for name, array in values.items()}
        if not dims:
            singles[k] = problem
        elif all(map(np.isfinite, own.values())):
            singles[k] = problem.replace(**own)
    with notice("looking for equilibria"):
        ones = equilibria_of_cells(list(singles.values()), low, high)
    of_cells = dict(zip(singles, ones, strict=True))
    found = [of_cells.get(k) for k in range(int(np.prod(shape, dtype=int)))]
    reasons = [one.why for one in ones if one.why]
    if reasons:
        of = f" in {len(reasons)} of {len(found)} systems" if dims else ""
        warn(f"equilibria: there may be others than these{of}: {reasons[0]}")
    return dataset_of(problem, grid, found, low, high)


def _of_blocks(problem: Problem, low: Array, high: Array) -> xr.Dataset:
    """Those of chunked parameters, found block by block when they are read, as in maps."""
    window = dict(zip(problem.state, zip(low.tolist(), high.tolist(), strict=True), strict=True))
    here = problem.replace()
    here._set("window", MappingProxyType(window))
    found = sweep(here, of="equilibria")
    ends = {name: variable(("state",), end) for name, end in (("box_low", low), ("box_high", high))}
    found = found.drop_vars(["n_stable", "eigenvalue_number"]).assign_coords(ends)
    return found.assign_attrs(dataset_attrs(problem))


def dataset_of(
    problem: Problem, grid: Grid, found: list[Equilibria | None], low: Array, high: Array
) -> xr.Dataset:
    """Results of all cells, filled up to the greatest number of equilibria."""
    dims, shape = tuple(grid.sizes), tuple(grid.sizes.values())
    rows, names = rows_of(replace(problem.own_equations, time=None)), list(problem.state)
    known = {k: one for k, one in enumerate(found) if one is not None}
    data = {
        name: variable(
            (*dims, *rows[name].dims), array.reshape(shape + array.shape[1:]), rows[name].attrs
        )
        for name, array in tabulated(known, len(found), len(names)).items()
        if name != "n_stable"
    }
    labels = rows["x"].labels
    assert labels is not None
    number = labels["equilibrium"][1]
    coords = {
        **grid.coords,
        "equilibrium": variable(
            ("equilibrium",), np.arange(data["kind"].shape[-1]), {"long_name": number}
        ),
        "state": variable(("state",), np.array(names, LABEL_DTYPE)),
        **{name: given for name, given in grid.inputs.items() if name not in grid.coords},
        "box_low": variable(("state",), low),
        "box_high": variable(("state",), high),
    }
    return xr.Dataset(data, coords, dataset_attrs(problem))
