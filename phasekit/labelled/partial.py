"""Maps that are not finished: which of their cells are computed."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
import xarray as xr
from xarray.backends import BackendArray
from xarray.core import indexing

from phasekit.errors import StoreError
from phasekit.labelled.arrays import read_marks, read_plan, zarr_group
from phasekit.labelled.tile import GROUP

COMPUTED = "computed"
_ATTRS = {"long_name": "whether all quantities of the cell are computed", "units": "1"}


def with_computed(ds: xr.Dataset, store: Any, name: str, chunks: Any) -> xr.Dataset:
    """Add the variable `computed` to a map that is not finished; leave all others as they are.

    Raises
    ------
    StoreError
        If its arrays were being made when that was interrupted.
    """
    group = zarr_group(store)
    plan = read_plan(group)
    if plan is None and ds.variables:  # written in one go
        return ds
    if plan is None or not plan.ready:
        raise StoreError(
            f"store: {name} cannot be opened: its arrays are being made, or that was interrupted; "
            "wait, or make the sweep's call again"
        )
    missing = {*plan.quantities, *plan.arrays, *plan.scalars} - ds.variables.keys()
    if missing:
        raise StoreError(f"store: {name} cannot be read: {', '.join(sorted(missing))} is not there")
    ds = ds.drop_vars([other for other in ds.data_vars if other not in plan.quantities])
    if all(part.complete for part in plan.parts):
        return ds
    done = [
        (part.dims, part.chunks, read_marks(group[f"{GROUP}/{part.name}"]))
        for part in plan.parts
        if not part.complete
    ]
    dims = tuple(dim for dim in plan.sizes if any(dim in part.dims for part in plan.parts))
    data = indexing.LazilyIndexedArray(_Computed(dims, plan.sizes, done))
    computed = xr.Variable(dims, data, _ATTRS)
    if chunks is not None:
        if isinstance(chunks, Mapping):  # what it does not name is cut as it is stored
            tiles = {
                d: n for part in plan.parts for d, n in zip(part.dims, part.chunks, strict=True)
            }
            chunks = {dim: chunks.get(dim, tiles[dim]) for dim in dims}
        computed = computed.chunk(chunks)
    return ds.assign({COMPUTED: computed})


class _Computed(BackendArray):
    """The cells whose tiles are done in every part, made when they are asked for."""

    def __init__(
        self,
        dims: tuple[str, ...],
        sizes: Mapping[str, int],
        done: list[tuple[tuple[str, ...], tuple[int, ...], Any]],
    ) -> None:
        self.dims = dims
        self.shape = tuple(sizes[dim] for dim in dims)
        self.dtype = np.dtype(bool)
        self.done = done

    def __getitem__(self, key: indexing.ExplicitIndexer) -> Any:
        return indexing.explicit_indexing_adapter(
            key, self.shape, indexing.IndexingSupport.OUTER, self._cells
        )

    def _cells(self, key: tuple[Any, ...]) -> Any:
        cells = dict(
            zip(
                self.dims,
                (np.arange(n)[k] for n, k in zip(self.shape, key, strict=True)),
                strict=True,
            )
        )
        asked = [dim for dim in self.dims if np.ndim(cells[dim])]
        result = np.ones([len(cells[dim]) for dim in asked], bool)
        for dims, chunks, marks in self.done:
            tiles = [cells[dim] // n for dim, n in zip(dims, chunks, strict=True)]
            part = marks[np.ix_(*map(np.atleast_1d, tiles))] if dims else marks
            shape = [len(cells[dim]) if dim in dims else 1 for dim in asked]
            # The part's dims come in the map's order, as those of the map do.
            result &= part.reshape(shape)
        return result
