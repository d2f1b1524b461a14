"""Compute rows of the table on a grid of cells: tile by tile in threads, or lazily with dask.

`Cells` is one tile: it knows the inputs of the tile and finds everything else by name, computing
coefficients and other groups once, when first asked. It holds plain arrays and pickles, so the
same object serves threads here and blocks of a lazy graph.
"""

from __future__ import annotations

import functools
import itertools
import warnings
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor, as_completed
from dataclasses import dataclass, field
from math import prod
from typing import Any

import numpy as np
import xarray as xr

from phasekit.cells import numbered
from phasekit.cells.progress import progress_bar
from phasekit.cells.request import Part, Request, ask
from phasekit.cells.schema import dataset_attrs, input_attrs, label_coords, own_names
from phasekit.errors import ParameterError
from phasekit.labels.arguments import FloatArray
from phasekit.labels.coordinates import STATES
from phasekit.labels.grid import TILE_CELLS, cut, refuse_too_large, tiles, variable
from phasekit.systems.system import System
from phasekit.table.quantities import TABLE
from phasekit.table.row import Pass, Quantity

SAMPLE = 256  # cells that are solved to see how many equilibria there are


@dataclass
class Cells:
    """Inputs of some cells as arrays that broadcast, and what was computed from them so far."""

    model: type[System]
    passes: tuple[Pass, ...]
    inputs: Mapping[str, FloatArray]
    computed: dict[str, Any] = field(default_factory=dict)
    done: set[Pass] = field(default_factory=set)
    widths: dict[str, int] = field(default_factory=dict)  # of dims whose labels are numbered

    @classmethod
    def from_inputs(
        cls, model: type[System], passes: Sequence[Pass], inputs: Mapping[str, FloatArray]
    ) -> Cells:
        """Return cells of which all passes are computed."""
        cells = cls(model, tuple(passes), inputs)
        for one in passes:
            cells.run(one)
        return cells

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
                line = TABLE.line_for(name, self.passes)
                if line is None:
                    raise KeyError(name)
                self.run(line)
        return self.computed[name]

    def run(self, one: Pass) -> None:
        """Compute the groups of one pass, once."""
        if one in self.done:
            return
        self.done.add(one)
        arrays = [self.get(name) for name in one.inputs]
        with np.errstate(all="ignore"):  # invalid cells give NaN, and no warning
            found = TABLE.call(one, *arrays)
        if not TABLE.own.isdisjoint(one.groups):
            self._check_shapes(found)
        if not self.model.rung.labels_fixed:
            found = numbered.measured(one, found, self.widths)
        self.computed.update(found)

    def _check_shapes(self, found: Mapping[str, Any]) -> None:
        """Refuse what a function of the user's gives, if it is not an array over the cells."""
        cells = np.broadcast_shapes(*map(np.shape, self.inputs.values()))
        for name, values in found.items():
            row = TABLE.rows[name]
            if numbered.is_numbered(row):
                continue
            shape = (*cells, *row.label_shape)
            try:
                fits = np.broadcast_shapes(np.shape(values), shape) == shape
            except ValueError:
                fits = False
            if not fits:
                raise ParameterError(
                    f"of: the function of {name!r} gave an array of shape {np.shape(values)}, "
                    f"wants one that broadcasts to {shape}, the cells and its own dims"
                )


def evaluate(
    system: System,
    rows: Sequence[Quantity],
    passes: Sequence[Pass] | None = None,
    **cells: Any,
) -> xr.Dataset:
    """Compute rows of the table for a system, at states where they need them: as `ask` says."""
    return compute(ask(system, rows, passes, **cells))


def compute(request: Request, progress: bool | None = False) -> xr.Dataset:
    """Compute what is asked for.

    ``progress`` shows a bar; None: if it takes long and standard error is a terminal.
    """
    if request.grid.lazy:
        if request.is_open:
            request = _sized(request, _columns_of_blocks(request))
        return assemble(request, _lazy(request))
    sizes, grid = request.grid.sizes, request.grid
    refuse_too_large(
        {
            row.name: prod(sizes[dim] for dim in part.dims) * row.cell_bytes
            for part in request.parts
            for row in part.rows
        },
        sizes,
    )
    filled: dict[str, Any] = {}
    several: list[numbered.Columns] = []
    tasks: list[tuple[Callable[[], None], int]] = []
    for part in request.parts:
        shape = tuple(sizes[dim] for dim in part.dims)
        columns = _columns(request, part) if request.is_open else None
        several += [] if columns is None else [columns]
        results = {
            row.name: np.empty(shape + row.label_shape, dtype=row.dtype)
            for row in part.rows
            if columns is None or row not in columns.rows
        }
        filled.update(results)
        arrays = {name: grid.aligned(name, part.dims) for name in part.inputs}
        most = min(
            (numbered.PIECE if request.is_open else TILE_CELLS, *(r.most_cells for r in part.rows))
        )
        for tile in tiles(shape, most):
            task = functools.partial(
                fill, type(request.system), part.passes, arrays, results, tile, columns
            )
            tasks.append((task, prod(piece.stop - piece.start for piece in tile)))
    run_tasks(tasks, progress)
    if request.is_open:
        request = _sized(request, several)
        widths = numbered.greatest(columns.widths for columns in several)
        for columns in several:
            filled.update(columns.joined(widths))
    dims = {row.name: part.dims for part in request.parts for row in part.rows}
    return assemble(
        request,
        {
            row.name: variable((*dims[row.name], *row.dims), filled[row.name], row.attrs)
            for row in request.rows
        },
    )


def _columns(request: Request, part: Part) -> numbered.Columns:
    rows = tuple(filter(numbered.is_numbered, part.rows))
    return numbered.Columns(rows, {dim: request.grid.sizes[dim] for dim in part.dims})


def _sized(request: Request, several: Sequence[numbered.Columns]) -> Request:
    """Return a request with as many equilibria and saddles as were found, and say what was not."""
    numbered.warn_of_stretches(request.system, several)
    widths = numbered.greatest(columns.widths for columns in several)
    return request.sized(widths)


def fill(
    model: type[System],
    passes: Sequence[Pass],
    arrays: Mapping[str, FloatArray],
    results: Mapping[str, Any],
    tile: tuple[slice, ...],
    columns: numbered.Columns | None = None,
) -> None:
    """Compute one tile straight into its part of the results; keep what has open columns."""
    cells = Cells.from_inputs(
        model, passes, {name: cut(array, tile) for name, array in arrays.items()}
    )
    with np.errstate(over="ignore"):  # where a result is kept in single precision
        for name, result in results.items():
            result[tile] = cells.computed[name]
    if columns is not None:
        columns.put(tile, cells.computed, cells.widths)
        columns.note(cells.widths, numbered.stretches(cells.computed))


def run_tasks(tasks: Sequence[tuple[Callable[[], None], int]], progress: bool | None) -> None:
    """Run tasks in threads (the kernels release the interpreter), with a bar that counts cells."""
    if len(tasks) <= 1 and progress is not True:
        for task, _ in tasks:
            task()
        return
    from phasekit.numerics.launch import cpus  # here, because it loads the kernels

    with progress_bar(sum(cells for _, cells in tasks), progress) as bar:
        pool = ThreadPoolExecutor(max_workers=max(1, min(cpus(), len(tasks))))
        try:
            futures = {pool.submit(task): cells for task, cells in tasks}
            for future in as_completed(futures):
                future.result()
                bar.update(futures[future])
        finally:
            pool.shutdown(cancel_futures=True)


# ------------------------------------------------------------------------------ lazily


def _lazy(request: Request) -> dict[str, xr.Variable]:
    out: dict[str, xr.Variable] = {}
    grid = request.grid
    for one, names in request.needs.items():
        wanted = [row for row in request.rows if row.group in one.groups]
        block = functools.partial(_block, type(request.system), one, tuple(names), wanted)
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
            out[row.name] = result.transpose(*grid.dims_of(names), *row.dims)
            out[row.name].attrs = row.attrs
    return {row.name: out[row.name] for row in request.rows}


def columns_of_sample(request: Request) -> dict[str, int]:
    """Return how many equilibria and saddles a few cells have, evenly over the grid."""
    several = []
    for part in request.parts:
        if any(map(numbered.is_numbered, part.rows)):
            each = max(int(SAMPLE ** (1.0 / max(len(part.dims), 1))), 2)
            places = [
                np.unique(np.linspace(0, request.grid.sizes[dim] - 1, each).astype(int))
                for dim in part.dims
            ]
            arrays = {name: request.grid.aligned(name, part.dims) for name in part.inputs}
            for name, array in arrays.items():
                own = [p if n > 1 else [0] for p, n in zip(places, array.shape, strict=True)]
                arrays[name] = array[np.ix_(*own)]
            several.append(Cells.from_inputs(type(request.system), part.passes, arrays).widths)
    return numbered.greatest(several)


def _columns_of_blocks(request: Request) -> list[numbered.Columns]:
    """Find how many equilibria there are: all blocks are solved now, and no result is kept."""
    from dask.base import compute as computed
    from dask.delayed import delayed

    several = []
    for part in request.parts:
        columns = _columns(request, part)
        several.append(columns)
        if part.rows and not columns.rows:
            continue
        given = {name: request.grid.inputs[name] for name in part.inputs}
        # Under names of their own: a variable with the name of its dim would be read as its index.
        blocks = xr.Dataset({f"_{name}": x for name, x in given.items()}).unify_chunks()
        cuts = []
        for dim in part.dims:
            ends = np.cumsum((0, *blocks.chunks.get(dim, (request.grid.sizes[dim],))))
            cuts.append([slice(low, high) for low, high in itertools.pairwise(map(int, ends))])
        task = delayed(functools.partial(_found_in_block, type(request.system), part))
        tasks = []
        for block in itertools.product(*cuts):
            own = blocks.isel(dict(zip(part.dims, block, strict=True)))
            tasks.append(task(*(_spread(own[f"_{name}"], part.dims) for name in given)))
        for found in computed(*tasks):  # type: ignore[no-untyped-call]
            columns.note(*found)
    return several


def _spread(values: xr.DataArray, dims: Sequence[str]) -> Any:
    """Return an array with an axis for each dim."""
    ordered = values.transpose(*(dim for dim in dims if dim in values.dims))
    return ordered.data.reshape(tuple(values.sizes.get(dim, 1) for dim in dims))


def _found_in_block(model: type[System], part: Part, *arrays: FloatArray) -> tuple[Any, Any]:
    """Return the numbers of columns that a block needs, and what its search left open."""
    cells = Cells.from_inputs(model, part.passes, dict(zip(part.inputs, arrays, strict=True)))
    return cells.widths, numbered.stretches(cells.computed)


def _block(
    model: type[System],
    one: Pass,
    names: tuple[str, ...],
    rows: Sequence[Quantity],
    *arrays: FloatArray,
) -> Any:
    """Compute one block of a lazy graph."""
    shape = np.broadcast_shapes(*(np.shape(array) for array in arrays))
    cells = Cells.from_inputs(model, (one,), dict(zip(names, arrays, strict=True)))
    results = []
    for row in rows:
        values = numbered.resized(cells.computed[row.name], row, row.label_shape)
        full = np.broadcast_to(values, shape + row.label_shape)
        results.append(np.array(full, dtype=row.dtype))
    return tuple(results) if len(results) > 1 else results[0]


# ------------------------------------------------------------------------------ labels


def assemble(request: Request, data: Mapping[str, xr.Variable]) -> xr.Dataset:
    """Put results and coordinates together."""
    system, grid = request.system, request.grid
    axes = {dim: grid.coords[dim] for dim in grid.sizes if dim in grid.coords}
    coords = {**axes, **label_coords(request.rows)}
    given = {**axes, **{name: one for name, one in grid.inputs.items() if name not in coords}}
    for name, one in given.items():
        attrs = input_attrs(system, name) or one.attrs
        coords[name] = variable(map(str, one.dims), one.data, attrs)
    coords.update(own_names(system.coordinate or "phi", {**coords, **data}))
    return xr.Dataset(dict(data), coords=coords, attrs=dataset_attrs(system))
