"""The arrays of a stored map: made from a plan, made longer, and the marks of its tiles.

The order of what is written makes an interrupted change one that is made again: the plan says that
the arrays are not ready, then they are changed, then it says that they are.
"""

from __future__ import annotations

import contextlib
from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np
import xarray as xr

from phasekit.errors import PhasekitError, StoreError
from phasekit.labelled.evaluate import Layout, assemble
from phasekit.labelled.parts import Part
from phasekit.labelled.place import Place
from phasekit.labelled.plan import Plan, fingerprint
from phasekit.labelled.quantities import Quantity
from phasekit.labelled.schema import LABEL_DTYPE
from phasekit.labelled.tile import GROUP

#: The attribute of the group that holds the plan.
PLAN = "plan"

#: The attribute in which xarray names coordinates that are no axes.
_NAMED = "coordinates"


def zarr_group(store: Any) -> Any:
    """Return the group of a store."""
    import zarr

    # Format 2 has codecs that unpickle what they read; phasekit writes none of it.
    return zarr.open_group(store, mode="r" if store.read_only else "r+", zarr_format=3)


def read_plan(group: Any) -> Plan | None:
    """Return the plan in a store, None where it was written in one go."""
    if GROUP not in group:
        return None
    return Plan.from_json(group[GROUP].attrs[PLAN])


def write_plan(place: Place, plan: Plan) -> None:
    """Write the plan, in one piece."""
    _put(place, _documents_of_plan(plan))


def prepare(place: Place, old: Plan | None, plan: Plan, layout: Layout) -> None:
    """Make the store's arrays those of the plan; done again in whole if it is interrupted.

    Each document is written in one piece, and those that are there as they should be are left.
    """
    ds = assemble(layout, {})
    root: dict[str, Any] = {}
    if old is None:
        # What says that this is a map comes first, then what it will be.
        _put(place, {"zarr.json": _documents(ds, plan, root)["zarr.json"]})
        old = replace(plan, parts=())
    else:
        root = dict(zarr_group(place.open(read_only=True)).attrs)
    complete = {part.name: part.complete for part in plan.parts}
    parts = tuple(replace(part, complete=complete[part.name]) for part in old.parts)
    write_plan(place, replace(old, parts=parts, ready=False))
    _forget_marks(place, old, plan)
    _put(place, _documents(ds, plan, root))
    write_plan(place, plan)


def _put(place: Place, documents: Mapping[str, bytes]) -> None:
    """Write documents under their keys, each in one piece, where they are not there already."""
    from zarr.core.buffer import default_buffer_prototype
    from zarr.core.sync import sync

    store, prototype = place.open(read_only=False), default_buffer_prototype()
    for key, document in documents.items():
        there = sync(store.get(key, prototype))
        if there is None or there.to_bytes() != document:
            sync(store.set(key, prototype.buffer.from_bytes(document)))


def _documents_of_plan(plan: Plan) -> dict[str, bytes]:
    import zarr
    from zarr.storage import MemoryStore

    kept: dict[str, Any] = {}
    zarr.create_group(MemoryStore(kept), attributes={PLAN: plan.to_json()}, zarr_format=3)
    return {f"{GROUP}/zarr.json": kept["zarr.json"].to_bytes()}


def _documents(ds: xr.Dataset, plan: Plan, root: Mapping[str, Any]) -> dict[str, bytes]:
    """Return what describes the arrays of a plan, and its coordinates, as they will be stored.

    They are made in memory, by xarray and zarr.
    """
    import zarr
    from zarr.storage import MemoryStore

    kept: dict[str, Any] = {}
    store = MemoryStore(kept)
    # Labels of fixed width have no place in Zarr v3.
    ds = ds.assign_coords(
        {n: c.astype(LABEL_DTYPE) for n, c in ds.coords.items() if c.dtype.kind == "U"}
    )
    for variable in ds.variables.values():
        variable.encoding = {"chunks": variable.shape} if variable.shape else {}
    ds.to_zarr(store, mode="w", zarr_format=3, consolidated=False)
    group: Any = zarr.open_group(store, mode="r+", zarr_format=3)
    # What a call does not name, earlier ones did: their coordinates, and versions of libraries.
    named = {*root.get(_NAMED, "").split(), *group.attrs.get(_NAMED, "").split()}
    attrs = {**group.attrs, **root}
    group.attrs.put({**attrs, _NAMED: " ".join(sorted(named))} if named else attrs)
    for part in plan.parts:
        _create_marks(group, f"{GROUP}/{part.name}", part.grid(plan.sizes))
        for row in part.rows:
            shape = tuple(plan.sizes[dim] for dim in part.dims) + row.label_shape
            _create(group, part, row, shape)
    kept.pop(f"{GROUP}/zarr.json", None)  # holds the plan, and is written last
    return {key: value.to_bytes() for key, value in kept.items()}


def refuse_damaged(place: Place, plan: Plan) -> None:
    """Raise a `StoreError` where arrays are not those of the plan."""
    store = place.open(read_only=True)
    group = zarr_group(store)
    with xr.open_zarr(store, consolidated=False, chunks=None, zarr_format=3) as ds:
        for name, array in plan.arrays.items():
            if fingerprint(ds[name].variable) != array["sha256"]:
                raise _damaged(place, name)
    for part in plan.parts:
        if group[f"{GROUP}/{part.name}"].shape != part.grid(plan.sizes):
            raise _damaged(place, part.name)
        for row in part.rows:
            array = group[row.name]
            shape = tuple(plan.sizes[dim] for dim in part.dims) + row.label_shape
            if (array.shape, array.dtype, array.chunks) != (
                shape, np.dtype(row.dtype), part.chunks + row.label_shape
            ):  # fmt: skip
                raise _damaged(place, row.name)


def _damaged(place: Place, name: str) -> StoreError:
    return StoreError(
        f"store: {place.name} is damaged: {name} is not what it was when it was written; choose "
        "another name, or pass overwrite=True"
    )


def reason(error: Exception) -> str:
    """Say what keeps a store from being read."""
    return str(error) if isinstance(error, PhasekitError) else f"{type(error).__name__}: {error}"


def done_tiles(place: Place, old: Plan | None, plan: Plan, part: Part) -> Any:
    """Return which tiles of a part are done; those that get new cells are not."""
    done = np.zeros(part.grid(plan.sizes), bool)
    if old is not None and part.name in {known.name for known in old.parts}:
        group = zarr_group(place.open(read_only=True))
        if f"{GROUP}/{part.name}" in group:
            marks = read_marks(group[f"{GROUP}/{part.name}"])
            marks &= ~_stale(marks.shape, part, old, plan)
            there = tuple(slice(min(both)) for both in zip(done.shape, marks.shape, strict=True))
            done[there] = marks[there]
    return done


def _forget_marks(place: Place, old: Plan, plan: Plan) -> None:
    """Forget the tiles that get new cells."""
    group = zarr_group(place.open(read_only=False))
    for part in old.parts:
        array = group[f"{GROUP}/{part.name}"]
        marks = read_marks(array)
        for index in np.argwhere(marks & _stale(marks.shape, part, old, plan)).tolist():
            array[tuple(index)] = 0


def _stale(shape: tuple[int, ...], part: Part, old: Plan, plan: Plan) -> Any:
    """Return which tiles lie at the end of dims that grow, or beyond."""
    stale = np.zeros(shape, bool)
    for axis, (dim, n) in enumerate(zip(part.dims, part.chunks, strict=True)):
        if plan.sizes[dim] > old.sizes[dim]:
            stale[(slice(None),) * axis + (slice(old.sizes[dim] // n, None),)] = True
    return stale


def _create_marks(group: Any, name: str, shape: tuple[int, ...]) -> None:
    from zarr.codecs import Crc32cCodec

    group.create_array(
        name,
        shape=shape,
        chunks=(1,) * len(shape),
        dtype="uint8",
        fill_value=0,
        compressors=[Crc32cCodec()],  # a mark that is half written is none
        chunk_key_encoding={"name": "default", "separator": "."},
        config={"write_empty_chunks": False},
    )


def read_marks(array: Any) -> Any:
    """Return which tiles are done; a mark that cannot be read says no."""
    try:
        return np.asarray(array[...]) == 1
    except Exception:
        done = np.zeros(array.shape, bool)
        for index in np.ndindex(*array.shape):
            with contextlib.suppress(Exception):
                done[index] = array[index] == 1
        return done


def fill_value(row: Quantity) -> Any:
    """Return what stands where nothing is computed."""
    if row.dtype == "bool":
        return False
    if not row.dtype.startswith("int"):
        return np.nan
    return -1 if row.flags is None or -1 in {flag.value for flag in row.flags} else 0


def _create(group: Any, part: Part, row: Quantity, shape: tuple[int, ...]) -> None:
    attrs = dict(row.attrs)
    if "flag_values" in attrs:
        attrs["flag_values"] = attrs["flag_values"].tolist()
    group.create_array(
        row.name,
        shape=shape,
        chunks=part.chunks + row.label_shape,
        dtype=row.dtype,
        fill_value=fill_value(row),
        compressors=[codec()],
        chunk_key_encoding={"name": "default", "separator": "."},
        dimension_names=(*part.dims, *row.dims),
        attributes=attrs,
        config={"write_empty_chunks": True},
    )


def codec() -> Any:
    """Return the codec of stored results."""
    from zarr.codecs import BloscCodec

    return BloscCodec(cname="lz4", clevel=5, shuffle="shuffle")
