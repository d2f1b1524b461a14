"""Cells of a map: parameters and states aligned by the names of their dims, tiles, and memory.

A scalar has no dim, a bare 1-D array lies on a dim of its own (named after the parameter, or
`point` for states), a DataArray keeps its dims. `Grid` holds all of them as xarray Variables, so
that one place knows how cells are laid out; what is computed on them is not its business.
"""

from __future__ import annotations

import functools
import itertools
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from math import prod
from typing import Any

import numpy as np
import xarray as xr

from phasekit.errors import ParameterError
from phasekit.labels.arguments import FloatArray, Value, describe
from phasekit.numerics.memory import SHARE, human, room_short_of

#: Dtype of labels: Python's strings. NumPy's own variable-length ones came with 2.0, and xarray
#: before 2026.2 does not compare them; which of the two a store gives back depends on its version.
LABEL_DTYPE = np.dtype(object)

#: Cells of a tile: large enough that calls cost nothing, small enough to stay in the cache.
TILE_CELLS = 1 << 16


@dataclass(frozen=True)
class Grid:
    """Inputs by name, on common named dims."""

    sizes: dict[str, int]  # the dims in their order
    inputs: dict[str, xr.Variable]  # float64
    coords: dict[str, xr.Variable]  # of the dims alone
    lazy: bool  # whether an input is chunked, so that nothing may be computed now

    def dims_of(self, names: Iterable[str]) -> tuple[str, ...]:
        """Dims on which the named inputs depend, in the grid's order."""
        used = {dim for name in names for dim in self.inputs[name].dims}
        return tuple(dim for dim in self.sizes if dim in used)

    def aligned(self, name: str, dims: Sequence[str]) -> FloatArray:
        """One input as an array with an axis for each of `dims`, of length 1 where it has none."""
        given = self.inputs[name]
        ordered = given.transpose(*(dim for dim in dims if dim in given.dims))
        shape = tuple(given.sizes.get(dim, 1) for dim in dims)
        return np.reshape(np.asarray(ordered.data), shape)


def variable(dims: Iterable[str], data: Any, attrs: Mapping[str, Any] | None = None) -> xr.Variable:
    """Make a Variable of an array, which is not copied.

    The fast path skips the conversion of foreign types, for which xarray imports all of
    dask.array: a good part of the time to the first result of a process.
    """
    if not hasattr(data, "chunks"):
        data = np.asarray(data)
    return xr.Variable(tuple(dims), data, attrs, fastpath=True)


@functools.lru_cache(maxsize=64)
def labels_of(axes: tuple[tuple[str, tuple[str, ...]], ...]) -> xr.Coordinates:
    """Names along dims as coordinates, whose indexes take longer to make than all else."""
    return xr.Coordinates({dim: np.array(names, dtype=LABEL_DTYPE) for dim, names in axes})


def make_grid(
    values: Mapping[str, Value],
    *,
    axis: Mapping[str, str] | None = None,
    called: Mapping[str, str] | None = None,
    order: Sequence[str] = (),
) -> Grid:
    """Lay out values on named dims.

    They are kept as by `numeric`. ``axis`` and ``called`` are the dim of a bare array, and what
    messages call it, where these are not its own name; ``order`` are dims that come first.
    """
    axis, called = axis or {}, called or {}
    inputs: dict[str, xr.Variable] = {}
    for name, value in values.items():
        if isinstance(value, xr.DataArray):
            inputs[name] = value.variable
        else:
            inputs[name] = variable(
                () if isinstance(value, float) else (axis.get(name, name),), value
            )
    owner: dict[str, str] = {}
    found: dict[str, int] = {}
    for name, given in inputs.items():
        argument = called.get(name, name)
        for dim, size in given.sizes.items():
            if found.setdefault(str(dim), size) != size:
                raise ParameterError(
                    f"{argument}: got {size} values along {dim!r}, wants {found[str(dim)]} as "
                    f"{owner[str(dim)]} has; arrays pair along a dim only when their lengths are "
                    "equal"
                )
            owner.setdefault(str(dim), argument)
            if str(dim) in inputs and inputs[str(dim)].dims != (dim,):
                raise ParameterError(
                    f"{argument}: got the dim {dim!r}, but {dim!r} is an input that does not lie "
                    f"along it; rename the dim or give {dim} as its axis"
                )
    sizes = {dim: found[dim] for dim in order if dim in found}
    sizes.update(found)
    coords = {  # an axis is its own coordinate, others come with the DataArrays
        name: variable((name,), np.asarray(given.data))
        for name, given in inputs.items()
        if given.dims == (name,)
    }
    for name, value in values.items():
        if isinstance(value, xr.DataArray):
            _add_coords(coords, value, called.get(name, name))
    lazy = any(given.chunks is not None for given in inputs.values())
    return Grid(sizes, inputs, coords, lazy)


def loaded_grid(values: Mapping[str, Value], **layout: Any) -> Grid:
    """The same of chunked arrays as of loaded ones, where their values decide on the shape."""
    loaded = {n: x.compute() if isinstance(x, xr.DataArray) else x for n, x in values.items()}
    return make_grid(loaded, **layout)


def _add_coords(coords: dict[str, xr.Variable], value: xr.DataArray, argument: str) -> None:
    for dim in map(str, value.dims):
        if dim not in value.coords:
            continue
        coord = value.coords[dim].variable
        known = coords.setdefault(dim, coord)
        if not known.to_base_variable().equals(coord.to_base_variable()):  # type: ignore[no-untyped-call]
            raise ParameterError(
                f"{argument}: got {describe(value)} whose coordinate {dim!r} differs from that "
                f"of another argument; align them with xr.align, or select the same {dim} first"
            )


def combine(
    function: Callable[..., tuple[Any, ...]],
    values: Mapping[str, Value],
    names: Sequence[str],
    attrs: Mapping[str, Mapping[str, str]],
    order: Sequence[str] = (),
) -> tuple[Any, ...]:
    """Apply an array function to values: floats in, floats out; arrays in, DataArrays out.

    The function takes the values as they come and returns an array for each of `names`; `attrs`
    holds the attributes of values and results by name, and `order` tells which dims come first.
    """
    if all(isinstance(value, float) for value in values.values()):
        return tuple(float(result) for result in function(*values.values()))
    grid = make_grid(values, order=order)
    if not grid.lazy:
        refuse_too_large(dict.fromkeys(names, 8 * prod(grid.sizes.values())), grid.sizes)
    results = xr.apply_ufunc(
        functools.partial(_broadcast, function),
        *grid.inputs.values(),
        output_core_dims=[[] for _ in names],
        dask="parallelized",
        output_dtypes=[np.float64 for _ in names],
    )
    coords = {
        name: variable(map(str, given.dims), given.data, attrs.get(name, given.attrs))
        for name, given in {**grid.inputs, **grid.coords}.items()
    }
    results = results if isinstance(results, tuple) else (results,)
    return tuple(
        xr.DataArray(result.transpose(*grid.sizes), coords=coords, name=name, attrs=attrs.get(name))
        for result, name in zip(results, names, strict=True)
    )


def _broadcast(function: Callable[..., tuple[Any, ...]], *arrays: FloatArray) -> Any:
    shape = np.broadcast_shapes(*(np.shape(array) for array in arrays))
    results = tuple(np.array(np.broadcast_to(result, shape)) for result in function(*arrays))
    return results if len(results) > 1 else results[0]


# ------------------------------------------------------------------------------ tiles


def cut(array: FloatArray, tile: tuple[slice, ...]) -> FloatArray:
    """Return a tile of an array whose axes of length 1 stand for whole dims."""
    return array[
        tuple(
            part if size > 1 else slice(None) for part, size in zip(tile, array.shape, strict=True)
        )
    ]


def tiles(shape: Sequence[int], cells: int = TILE_CELLS) -> Iterator[tuple[slice, ...]]:
    """Cut a box of cells into even tiles of at most `cells`, whole along the last axes.

    >>> [tuple((s.start, s.stop) for s in tile) for tile in tiles((3, 2), 4)]
    [((0, 2), (0, 2)), ((2, 3), (0, 2))]
    """
    steps, room = [], max(cells, 1)
    for size in reversed(shape):
        parts = -(-size // max(min(size, room), 1))
        step = max(-(-size // max(parts, 1)), 1)  # of nothing there are no tiles
        steps.append(step)
        room //= step
    cuts = [
        [slice(i, min(i + step, size)) for i in range(0, size, step)]
        for size, step in zip(shape, reversed(steps), strict=True)
    ]
    return itertools.product(*cuts)


def refuse_too_large(bytes_of: Mapping[str, int], sizes: Mapping[str, int]) -> None:
    """Refuse results of so many bytes that they will not fit, before any work, with the way out."""
    needed = sum(bytes_of.values())
    room = room_short_of(needed)
    if room is None:
        return
    axes = " x ".join(f"{dim} {size}" for dim, size in sizes.items())
    largest = ", ".join(sorted(bytes_of, key=bytes_of.__getitem__, reverse=True)[:3])
    raise ParameterError(
        f"axes: got {axes} = {prod(sizes.values()):.3g} cells, {human(needed)} of results, wants "
        f"at most {human(room)}, {SHARE:.0%} of the memory that is free; take "
        f"coarser axes, name fewer quantities in of= (largest: {largest}), or put a sweep "
        f"into a store (store='map.zarr'); chunked DataArrays as axes stay lazy"
    )
