"""Stored maps as Datasets: what is read is checked, and of unfinished ones what is computed."""

from __future__ import annotations

import contextlib
from collections.abc import Iterator, Mapping
from math import prod
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
import xarray as xr
from xarray.backends import BackendArray

from phasekit.cells.schema import own_names
from phasekit.errors import StoreError
from phasekit.labels.grid import refuse_too_large
from phasekit.maps import files
from phasekit.maps.damage import Damage, at_a_glance, in_full, lost_tiles, refuse
from phasekit.maps.keys import PACKED
from phasekit.maps.marks import Marks, marks_of, read_marks
from phasekit.maps.packed import Packed, digest_of, may_be_packed, packed_bytes, read_packed
from phasekit.maps.parts import StoredPart
from phasekit.maps.place import Place
from phasekit.maps.plan import Plan
from phasekit.maps.stored_arrays import refuse_damaged, zarr_group
from phasekit.systems.identity import MODEL

if TYPE_CHECKING:
    from xarray.core import indexing

COMPUTED = "computed"
_ATTRS = {"long_name": "whether all quantities of the cell are computed", "units": "1"}


@contextlib.contextmanager
def opened(source: Any, plan: Plan, name: str) -> Iterator[tuple[xr.Dataset, Any]]:
    """Give the Dataset and the group of a map, for its metadata and coordinates."""
    ds, store = _open(source, plan, name, None)
    with ds:
        yield ds, zarr_group(store)


def _open(
    source: Any,
    plan: Plan,
    name: str,
    chunks: Any,
    *,
    verify: bool = False,
    packed: Packed | None = None,
) -> tuple[xr.Dataset, Any]:
    from phasekit.maps.checked import Checked  # here: it loads zarr

    store: Any = Checked(source, plan, name, verify=verify, packed=packed)
    ds = xr.open_zarr(store, consolidated=False, chunks=chunks, zarr_format=3)
    inputs = [input for input in (*plan.arrays, *plan.scalars) if input in ds.data_vars]
    return ds.set_coords(inputs), store


def open_stored(
    source: Any, plan: Plan, name: str, chunks: Any = None, *, verify: bool = False
) -> xr.Dataset:
    """Open a map made tile by tile; one that is not finished has the variable `computed`."""
    if not plan.parts or not (plan.ready or plan.before):
        raise StoreError(
            f"store: {name} cannot be opened: its arrays are being created, or their creation was "
            f"interrupted; wait, or repeat the call of sweep"
        )
    packed = None if verify else read_far(source, plan)
    ds, store = _open(source, plan, name, chunks, verify=verify, packed=packed)
    refuse_damaged(ds, zarr_group(store), plan, name)
    if ds.attrs.get(MODEL) != plan.model:
        raise StoreError(
            f"store: {name} is damaged: zarr.json names the model {ds.attrs.get(MODEL)!r}, its "
            f"plan {plan.model!r}"
        )
    ds = ds.drop_vars([other for other in ds.data_vars if other not in plan.quantities])
    ds = ds.assign_coords(
        own_names(plan.coordinate, {str(n): one for n, one in ds.variables.items()})
    )
    if packed is not None:  # files are looked at when they are read: to list them takes long
        store.marks = packed.marks
        return ds
    marks = _all_marks(source, plan, ds)
    damaged: list[Damage] = []
    for part in plan.parts:
        known = marks[part.name].computed()
        found = (in_full if verify else at_a_glance)(source, part, known)
        if found:  # or written anew since its mark was read
            now = read_marks(source, part)
            found = [one for one in found if now.get(one.index) == known[one.index]]
        damaged += [*lost_tiles(part, marks[part.name], plan.sizes), *found]
    refuse(name, damaged, plan.sizes)
    store.marks = {part: one.computed() for part, one in marks.items()}
    if verify and plan.packed and may_be_packed(plan):
        _refuse_packed(source, plan, name, packed_bytes(plan, store.kept, store.marks))
    if all(part.complete for part in plan.parts):
        return ds
    dims = tuple(dim for dim in plan.sizes if any(dim in part.dims for part in plan.parts))
    done = [_done(part, marks[part.name], plan.sizes) for part in plan.parts if not part.complete]
    computed = xr.Variable(dims, _lazy(_Computed(dims, plan.sizes, done)), _ATTRS)
    if chunks is not None:
        if isinstance(chunks, Mapping):  # what it does not name is cut as it is stored
            tiles = {
                d: n for part in plan.parts for d, n in zip(part.dims, part.chunks, strict=True)
            }
            chunks = {dim: chunks.get(dim, tiles[dim]) for dim in dims}
        computed = computed.chunk(chunks)
    return ds.assign({COMPUTED: computed})


def read_far(source: Any, plan: Plan) -> Packed | None:
    """Return what opens a finished map at once; None on a disk, where all files are looked at."""
    return None if files.folder_of(source) is not None else read_packed(source, plan)


def write_packed(place: Place, plan: Plan) -> str:
    """Write the file by which a finished map opens; return its digest, or "" where none can be."""
    if not may_be_packed(plan):
        return ""
    source = place.open(read_only=True)
    ds, store = _open(source, plan, place.name, None)
    with ds:
        marks = {part: one.done for part, one in _all_marks(source, plan, ds).items()}
        data = packed_bytes(plan, store.kept, marks)
    if data is None:
        return ""
    files.put(place.open(read_only=False), {PACKED: data})
    return digest_of(data)


def _all_marks(source: Any, plan: Plan, ds: xr.Dataset) -> dict[str, Marks]:
    """Return the marks of the parts of a map that is open."""
    values = {coord: ds[coord].variable for coord in (*plan.arrays, *plan.scalars)}
    return {part.name: marks_of(source, plan, part, values) for part in plan.parts}


def _refuse_packed(source: Any, plan: Plan, name: str, expected: bytes | None) -> None:
    """Raise a `StoreError` where the file by which a map opens is not what the others say."""
    data = files.read(source, PACKED)
    if data is None or data != expected or digest_of(data) != plan.packed:
        wrong = "is gone" if data is None else "has changed since it was written"
        raise StoreError(
            f"store: {name} is damaged: {PACKED} {wrong}; repeat the call of sweep, which writes "
            "it again"
        )


class _Tiles(NamedTuple):
    """Tiles of a part that are done, as far as a map of some sizes went."""

    marks: Any  # True for each
    sizes: Mapping[str, int]


def _done(
    part: StoredPart, marks: Marks, sizes: Mapping[str, int]
) -> tuple[StoredPart, list[_Tiles]]:
    found = [_Tiles(np.zeros(part.grid(sizes), bool), sizes)]
    for index in marks.done:
        found[0].marks[index] = True
    for index, (_, shorter) in marks.shorter.items():
        tiles = next((one for one in found if one.sizes == shorter), None)
        if tiles is None:
            tiles = _Tiles(np.zeros(part.grid(sizes), bool), shorter)
            found.append(tiles)
        tiles.marks[index] = True
    return part, found


def _lazy(array: _Computed) -> Any:
    """Return it as xarray takes what is made when it is asked for.

    That has no published name: without it, all is made at once, if it fits into memory.
    """
    try:
        from xarray.core.indexing import (  # noqa: F401  # the others, for what reads it
            IndexingSupport,
            LazilyIndexedArray,
            explicit_indexing_adapter,
        )
    except ImportError:
        refuse_too_large(
            {COMPUTED: prod(array.shape)}, dict(zip(array.dims, array.shape, strict=True))
        )
        return array.cells((slice(None),) * len(array.shape))
    return LazilyIndexedArray(array)


class _Computed(BackendArray):
    """The cells whose tiles are done in every part, made when they are asked for."""

    def __init__(
        self,
        dims: tuple[str, ...],
        sizes: Mapping[str, int],
        done: list[tuple[StoredPart, list[_Tiles]]],
    ) -> None:
        self.dims = dims
        self.shape = tuple(sizes[dim] for dim in dims)
        self.dtype = np.dtype(bool)
        self.done = done

    def __getitem__(self, key: indexing.ExplicitIndexer) -> Any:
        from xarray.core import indexing

        return indexing.explicit_indexing_adapter(
            key, self.shape, indexing.IndexingSupport.OUTER, self.cells
        )

    def cells(self, key: tuple[Any, ...]) -> Any:
        """Return whether cells are computed, by slices, numbers or arrays of numbers."""
        cells = dict(
            zip(
                self.dims,
                (np.arange(n)[k] for n, k in zip(self.shape, key, strict=True)),
                strict=True,
            )
        )
        asked = [dim for dim in self.dims if np.ndim(cells[dim])]
        result = np.ones([len(cells[dim]) for dim in asked], bool)
        for part, several in self.done:
            # The part's dims come in the map's order, as those of the map do.
            shape = [len(cells[dim]) if dim in part.dims else 1 for dim in asked]
            there = False
            for marks, sizes in several:
                places = [np.atleast_1d(cells[dim]) for dim in part.dims]
                tiles = [at // n for at, n in zip(places, part.chunks, strict=True)]
                found = marks[np.ix_(*tiles)] if part.dims else marks
                for axis, (at, dim) in enumerate(zip(places, part.dims, strict=True)):
                    beyond = (slice(None),) * axis + (at >= sizes[dim],)
                    found[beyond] = False
                there = there | found
            result &= np.reshape(there, shape)
        return result
