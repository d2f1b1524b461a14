"""Compute rows of the table on a grid of cells: tile by tile in threads, or lazily with dask.

`Cells` is one tile: it knows the inputs of the tile and finds everything else by name, computing
coefficients and other groups once, when first asked. It holds plain arrays and pickles, so the
same object serves threads here and blocks of a lazy graph.
"""

from __future__ import annotations

import functools
import warnings
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from math import prod
from typing import Any

import numpy as np
import xarray as xr

from phasekit.cells.dispatch import fitted
from phasekit.cells.schema import dataset_attrs, input_attrs, label_coords, own_names
from phasekit.cells.tiling import cut, run_tasks, tiles
from phasekit.errors import ParameterError
from phasekit.labels.arguments import FloatArray, Value
from phasekit.labels.coordinates import STATES
from phasekit.labels.grid import Grid, make_grid, variable
from phasekit.labels.memory import refuse_too_large
from phasekit.systems.system import Model
from phasekit.table.quantities import ROWS, pass_of
from phasekit.table.row import Pass, Quantity


@dataclass
class Cells:
    """Inputs of some cells as arrays that broadcast, and what was computed from them so far."""

    model: type[Model]
    passes: tuple[Pass, ...]
    inputs: Mapping[str, FloatArray]
    computed: dict[str, Any] = field(default_factory=dict)
    done: set[Pass] = field(default_factory=set)

    def get(self, name: str) -> Any:
        """Return an input, a coefficient or a quantity as an array."""
        if name not in self.computed:
            if name in self.model.rung.derived:
                abc = self.model.valid_coefficients(self.inputs)
                self.computed.update(zip(self.model.rung.derived, abc, strict=True))
            elif name in STATES:
                state = self.inputs[name]
                self.computed[name] = np.where(np.isfinite(state), state, np.nan)
            elif name in self.inputs:
                self.computed[name] = self.model.in_domain(name, self.inputs[name])
            else:
                self.run(pass_of(ROWS[name].group, self.passes))
        return self.computed[name]

    def run(self, one: Pass) -> None:
        """Compute the groups of one pass, once."""
        if one in self.done:
            return
        self.done.add(one)
        arrays = [self.get(name) for name in one.inputs]
        with np.errstate(all="ignore"):  # invalid cells give NaN, and no warning
            self.computed.update(one.call(*arrays))


@dataclass(frozen=True)
class Box:
    """What is computed on the same dims, and so tile by tile together."""

    dims: tuple[str, ...]
    passes: tuple[Pass, ...]
    rows: tuple[Quantity, ...]
    names: tuple[str, ...]  # of the inputs


@dataclass(frozen=True)
class Layout:
    """What is computed where: a system, its cells, and the passes over them."""

    system: Model
    grid: Grid
    rows: tuple[Quantity, ...]
    needs: Mapping[Pass, Sequence[str]]  # the inputs on which each pass depends, in the end

    @property
    def model(self) -> type[Model]:
        """The system's class."""
        return type(self.system)

    @property
    def dims(self) -> dict[str, tuple[str, ...]]:
        """The dims of each group."""
        return {
            group: self.grid.dims_of(need)
            for one, need in self.needs.items()
            for group in one.groups
        }

    def boxes(self) -> list[Box]:
        """Return the passes by the dims on which they run."""
        dims = self.dims
        found = []
        for used in dict.fromkeys(dims.values()):
            passes = tuple(one for one in self.needs if dims[one.groups[0]] == used)
            names = dict.fromkeys(name for one in passes for name in self.needs[one])
            rows = tuple(row for row in self.rows if dims[row.group] == used)
            found.append(Box(used, passes, rows, tuple(names)))
        return found

    def arrays(self, box: Box) -> dict[str, FloatArray]:
        """Return the inputs of a box, each with an axis for each of its dims."""
        return {name: self.grid.aligned(name, box.dims) for name in box.names}


def leaves(system: Model, names: Iterable[str], passes: Sequence[Pass]) -> list[str]:
    """Return the parameters and states on which inputs of passes depend, in the end."""
    found: dict[str, None] = {}
    for name in names:
        if name in system.rung.derived:
            found.update(dict.fromkeys(system.formula_inputs()))
        elif name in ROWS:
            found.update(
                dict.fromkeys(leaves(system, pass_of(ROWS[name].group, passes).inputs, passes))
            )
        else:
            found[name] = None
    return list(found)


def evaluate(
    system: Model,
    rows: Sequence[Quantity],
    passes: Sequence[Pass],
    *,
    states: Mapping[str, Value] | None = None,
    axis: Mapping[str, str] | None = None,
    called: Mapping[str, str] | None = None,
    order: Sequence[str] = (),
    progress: bool | None = False,
) -> xr.Dataset:
    """Compute rows of the table for a system, at states where they need them.

    Parameters
    ----------
    system : Model
        Its array parameters span the cells.
    rows, passes : sequence
        What to compute, and the passes that do it.
    states : mapping of str to Value, optional
        States by the names of the table.
    axis : mapping of str to str, optional
        The dim of a bare state array, where that is not its own name.
    called : mapping of str to str, optional
        What messages call a state, where that is not its own name.
    order : sequence of str
        Dims that come first.
    progress : bool or None
        Show a bar; None: if it takes long and standard error is a terminal.

    Raises
    ------
    ParameterError
        If an input is missing, dims disagree, or the result would not fit into memory.
    """
    layout = lay_out(system, rows, passes, states=states, axis=axis, called=called, order=order)
    data = _lazy(layout) if layout.grid.lazy else _eager(layout, progress)
    return assemble(layout, data)


def lay_out(
    system: Model,
    rows: Sequence[Quantity],
    passes: Sequence[Pass],
    *,
    states: Mapping[str, Value] | None = None,
    axis: Mapping[str, str] | None = None,
    called: Mapping[str, str] | None = None,
    order: Sequence[str] = (),
) -> Layout:
    """Say what is computed where, and refuse what cannot be; arguments as in `evaluate`."""
    rows, passes = fitted(system, rows, passes)
    inputs = {**system.parameters, **(states or {})}
    grid = make_grid(inputs, axis=axis, called=called, order=order)
    needs = {one: leaves(system, one.inputs, passes) for one in passes}
    _refuse_missing(system, needs, inputs)
    if not grid.sizes and any(set(system.rung.derived) & set(one.inputs) for one in passes):
        system.coefficients()  # scalars that are invalid raise, where cells of arrays become NaN
    _refuse_taken(grid, rows)
    return Layout(system, grid, tuple(rows), needs)


def _refuse_missing(
    system: Model, needs: Mapping[Pass, Sequence[str]], inputs: Mapping[str, Value]
) -> None:
    for one, names in needs.items():
        for name in names:
            if name not in inputs:
                declared = [parameter.name for parameter in system.declared]
                way = ", which has no such parameter"
                if name in declared:
                    way = f"; use system.replace({name}=...)"
                elif name in STATES:
                    way = f"; give {name}="
                raise ParameterError(
                    f"{name}: got nothing, wants a value for {' and '.join(one.groups)} of "
                    f"{type(system).__name__}{way}"
                )


def _refuse_taken(grid: Grid, rows: Sequence[Quantity]) -> None:
    names, dims = {row.name for row in rows}, {dim for row in rows for dim in row.dims}
    for name in sorted(names & dims):
        counted = ", ".join(sorted(row.name for row in rows if name in row.dims))
        raise ParameterError(
            f"of: got {name!r} beside {counted}, whose dim has that name; compute them apart"
        )
    taken = names | dims
    for dim in grid.sizes:
        if dim in taken:
            raise ParameterError(
                f"dim {dim!r}: got it as a dim of an argument, wants another name, because the "
                f"result has a variable or dim {dim!r}; rename it with .rename({dim}=...)"
            )


# ------------------------------------------------------------------------------ in memory


def _eager(layout: Layout, progress: bool | None) -> dict[str, xr.Variable]:
    sizes = layout.grid.sizes
    refuse_too_large(
        {
            row.name: prod(sizes[dim] for dim in box.dims) * row.cell_bytes
            for box in layout.boxes()
            for row in box.rows
        },
        sizes,
    )
    out: dict[str, xr.Variable] = {}
    tasks: list[tuple[Callable[[], None], int]] = []
    for box in layout.boxes():
        shape = tuple(sizes[dim] for dim in box.dims)
        results = {row.name: np.empty(shape + row.label_shape, dtype=row.dtype) for row in box.rows}
        arrays = layout.arrays(box)
        for tile in tiles(shape):
            task = functools.partial(fill, layout.model, box.passes, arrays, results, tile)
            tasks.append((task, prod(part.stop - part.start for part in tile)))
        for row in box.rows:
            out[row.name] = variable((*box.dims, *row.dims), results[row.name], row.attrs)
    run_tasks(tasks, progress)
    return {row.name: out[row.name] for row in layout.rows}


def fill(
    model: type[Model],
    passes: Sequence[Pass],
    arrays: Mapping[str, FloatArray],
    results: Mapping[str, Any],
    tile: tuple[slice, ...],
) -> None:
    """Compute one tile straight into its part of the results."""
    cells = Cells(model, tuple(passes), {name: cut(array, tile) for name, array in arrays.items()})
    for one in passes:
        cells.run(one)
    with np.errstate(over="ignore"):  # where a result is kept in single precision
        for name, result in results.items():
            result[tile] = cells.computed[name]


# ------------------------------------------------------------------------------ lazily


def _lazy(layout: Layout) -> dict[str, xr.Variable]:
    out: dict[str, xr.Variable] = {}
    grid, dims = layout.grid, layout.dims
    for one, names in layout.needs.items():
        wanted = [row for row in layout.rows if row.group in one.groups]
        block = functools.partial(_block, layout.model, one, tuple(names), wanted)
        sizes = {
            dim: size for row in wanted for dim, size in zip(row.dims, row.label_shape, strict=True)
        }
        with warnings.catch_warnings():
            # Axes make an outer product: many more chunks than each of them has is what is meant.
            warnings.filterwarnings("ignore", message="Increasing number of chunks")
            results = xr.apply_ufunc(
                block,
                *(grid.inputs[name] for name in names),
                output_core_dims=[list(row.dims) for row in wanted],
                dask="parallelized",
                output_dtypes=[np.dtype(row.dtype) for row in wanted],
                dask_gufunc_kwargs={"output_sizes": sizes},
            )
        for row, result in zip(
            wanted, results if isinstance(results, tuple) else (results,), strict=True
        ):
            out[row.name] = result.transpose(*dims[row.group], *row.dims)
            out[row.name].attrs = row.attrs
    return {row.name: out[row.name] for row in layout.rows}


def _block(
    model: type[Model],
    one: Pass,
    names: tuple[str, ...],
    rows: Sequence[Quantity],
    *arrays: FloatArray,
) -> Any:
    """Compute one block of a lazy graph."""
    shape = np.broadcast_shapes(*(np.shape(array) for array in arrays))
    cells = Cells(model, (one,), dict(zip(names, arrays, strict=True)))
    cells.run(one)
    results = []
    for row in rows:
        full = np.broadcast_to(cells.computed[row.name], shape + row.label_shape)
        results.append(np.array(full, dtype=row.dtype))
    return tuple(results) if len(results) > 1 else results[0]


# ------------------------------------------------------------------------------ labels


def assemble(layout: Layout, data: Mapping[str, xr.Variable]) -> xr.Dataset:
    """Put results and coordinates together."""
    coords: dict[str, xr.Variable] = {}
    for dim in layout.grid.sizes:
        if dim in layout.grid.coords:
            coords[dim] = _with_attrs(layout.system, dim, layout.grid.coords[dim])
    coords.update(label_coords(layout.rows))
    for name, given in layout.grid.inputs.items():
        if name not in coords:
            coords[name] = _with_attrs(layout.system, name, given)
    coords.update(own_names(layout.system, {**coords, **data}))
    return xr.Dataset(dict(data), coords=coords, attrs=dataset_attrs(layout.system))


def _with_attrs(system: Model, name: str, given: xr.Variable) -> xr.Variable:
    return variable(map(str, given.dims), given.data, input_attrs(system, name) or given.attrs)
