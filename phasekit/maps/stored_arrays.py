"""The arrays of a stored map: made from a plan, made longer, and the marks of its tiles.

The order of what is written makes an interrupted change one that is made again: the plan says that
the arrays are not ready, then they are changed, then it says that they are.
"""

from __future__ import annotations

import contextlib
import hashlib
import re
from collections.abc import Mapping, Sequence, Set
from dataclasses import replace
from typing import Any

import numpy as np
import xarray as xr

from phasekit.cells.evaluate import assemble
from phasekit.cells.request import Request, with_words
from phasekit.cells.schema import label_coords, own_names
from phasekit.errors import ParameterError, PhasekitError, StoreError
from phasekit.labels.coordinates import LABELS, STATES
from phasekit.maps import files
from phasekit.maps.keys import DOCUMENT, GROUP
from phasekit.maps.marks import key_of, marks_of
from phasekit.maps.parts import StoredPart
from phasekit.maps.place import Place
from phasekit.maps.plan import PLAN_KEY, Plan, fingerprint, plan_bytes, plan_from, root_digests
from phasekit.systems.registry import models
from phasekit.systems.system import System
from phasekit.table.quantities import ROWS
from phasekit.table.row import Quantity

#: Names of files in a Zarr v3 store: metadata, chunks, and what a killed process left.
_OWN = re.compile(r"zarr\.json|c?(\.?\d+)*|part\d+|.*\.[0-9a-f]{32}\.partial")

#: What is said of a `MemoryError`.
NO_MEMORY = "no memory is left; end other programs, or take smaller tiles by chunks="

#: The attribute in which xarray names coordinates that are no axes.
_NAMED = "coordinates"


def zarr_group(store: Any) -> Any:
    """Return the group of a store."""
    import zarr

    # Format 2 has codecs that unpickle what they read; phasekit writes none of it. What is gathered
    # in the root is for others: there any path could have metadata.
    return zarr.open_group(
        store, mode="r" if store.read_only else "r+", zarr_format=3, use_consolidated=False
    )


def read_plan(store: Any) -> Plan | None:
    """Return the plan in a store, None where it was written in one go."""
    data = files.read(store, PLAN_KEY)
    if data is None and (GROUP in zarr_group(store) or files.sizes(store, f"{GROUP}/part0")):
        data = files.read(store, PLAN_KEY)  # it may have been written between the two looks
        if data is None:
            raise ParameterError("its plan, sweep/zarr.json, is gone")
    return None if data is None else plan_from(data)


def write_plan(place: Place, plan: Plan) -> None:
    """Write the plan, in one piece."""
    files.put(place.open(read_only=False), {PLAN_KEY: plan_bytes(plan)})


def prepare(place: Place, old: Plan | None, plan: Plan, request: Request, compressor: str) -> None:
    """Make the store's arrays those of the plan; done again in whole if it is interrupted.

    Each document is written in one piece, and those that are there as they should be are left.
    Until the last one the plan keeps what there was, so that the map can be read meanwhile.
    """
    store = place.open(read_only=False)
    ds = assemble(request, {})
    if request.is_open:  # of quantities as well that the call does not name
        ds = ds.assign_coords(label_coords(row for part in plan.parts for row in part.rows))
    # Other names of what is there are given by who opens it.
    ds = ds.drop_vars(own_names(plan.coordinate, request.grid.inputs))
    kept: dict[str, StoredPart] = {}
    before: dict[str, bytes | None] = {}
    known: dict[str, str] = {}
    if old is None:
        documents = _documents(ds, plan, {}, compressor, request.system)
        # What says that this is a map comes first, then what it will be.
        files.put(store, {DOCUMENT: documents[DOCUMENT]})
        write_plan(place, replace(plan, parts=()))
        documents[DOCUMENT] = files.gathered(documents)
    else:
        root = dict(zarr_group(place.open(read_only=True)).attrs)
        documents = _documents(ds, plan, root, compressor, request.system)
        kept = {part.name: part for part in old.parts if _same_tiles(part, plan)}
        dropped = {row for part in old.parts if part.name not in kept for row in part.quantities}
        known = {k: v for k, v in old.documents.items() if k.split("/")[0] not in dropped}
        before = dict(old.before)
        others = dict(files.read_all(store, (key for key in known if key not in documents)))
        documents[DOCUMENT] = files.gathered({**others, **before, **documents})
        for key in documents.keys() - before.keys():
            if (there := files.read(store, key)) != documents[key]:
                before[key] = there
        if before:
            parts = tuple(kept.values())
            write_plan(
                place,
                replace(
                    old,
                    parts=parts,
                    ready=False,
                    before=before,
                    documents=known,
                    packed="",
                    coming=old.coming | plan.names,
                ),
            )
        _forget_marks(store, old, plan)
        for part in plan.parts:
            if part.name not in kept:  # of a change that was given up, or of other tiles
                for folder in (*part.quantities, f"{GROUP}/{part.name}"):
                    files.remove_folder(store, folder)
    changed = {**before, **documents}
    changed[DOCUMENT] = changed.pop(DOCUMENT)  # last: others open the map by it
    files.put(store, changed)
    digests = {key: hashlib.sha256(data).hexdigest() for key, data in documents.items()}
    del digests[DOCUMENT]  # names versions of libraries, which change
    root = root_digests(documents[DOCUMENT])
    write_plan(place, replace(plan, documents={**known, **digests}, root=root, before={}))


def _same_tiles(part: StoredPart, plan: Plan) -> bool:
    """Whether a part of the old plan is in the new one, cut as it was."""
    return any((part.name, part.chunks) == (other.name, other.chunks) for other in plan.parts)


def _documents(
    ds: xr.Dataset, plan: Plan, root: Mapping[str, Any], compressor: str, system: System
) -> dict[str, bytes]:
    """Return what describes the arrays of a plan, and its coordinates, as they will be stored.

    They are made in memory, by xarray and zarr.
    """
    import zarr
    from zarr.storage import MemoryStore

    kept: dict[str, Any] = {}
    store = MemoryStore(kept)
    ds = files.with_texts(ds)  # those of fixed width have no place in Zarr v3
    for variable in ds.variables.values():
        variable.encoding = (
            {"chunks": tuple(max(n, 1) for n in variable.shape)} if variable.shape else {}
        )
    ds.to_zarr(store, mode="w", zarr_format=3, consolidated=False)
    group: Any = zarr.open_group(store, mode="r+", zarr_format=3)
    # What a call does not name, earlier ones did: their coordinates, and versions of libraries.
    named = {*root.get(_NAMED, "").split(), *group.attrs.get(_NAMED, "").split()}
    attrs = {**group.attrs, **root}
    group.attrs.put({**attrs, _NAMED: " ".join(sorted(named))} if named else attrs)
    for part in plan.parts:
        _create_marks(group, part, part.grid(plan.sizes))
        for row in with_words(system, part.rows):
            shape = tuple(plan.sizes[dim] for dim in part.dims) + row.label_shape
            _create(group, part, row, shape, compressor)
    kept.pop(PLAN_KEY, None)  # is written last
    return {key: value.to_bytes() for key, value in kept.items()}


def refuse_damaged(ds: xr.Dataset, group: Any, plan: Plan, name: str) -> None:
    """Raise a `StoreError` where arrays or coordinates are not those of the plan."""
    missing = {*plan.quantities, *plan.arrays, *plan.scalars} - ds.variables.keys()
    if missing:
        raise StoreError(
            f"store: {name} cannot be read: {', '.join(sorted(missing))} is not there; restore "
            f"it, choose another name, or pass overwrite=True"
        )
    for scalar, value in plan.scalars.items():
        variable = ds[scalar].variable
        if variable.dims or variable.dtype != np.float64 or float(variable) != value:
            raise _damaged(name, scalar)
    for coord, array in plan.arrays.items():
        variable = ds[coord].variable
        if list(variable.dims) != array["dims"] or fingerprint(variable) != array["sha256"]:
            raise _damaged(name, coord)
    for label, expected in label_coords(row for part in plan.parts for row in part.rows).items():
        if label not in ds.variables or not np.array_equal(ds[label].values, expected.values):
            raise _damaged(name, label)
    for part in plan.parts:
        for row in part.rows:
            array = group[row.name]
            shape = tuple(plan.sizes[dim] for dim in part.dims) + row.label_shape
            if (array.shape, array.dtype, array.chunks, ds[row.name].dims) != (
                shape, np.dtype(row.dtype), part.chunk_of(row), part.dims + row.dims
            ):  # fmt: skip
                raise _damaged(name, row.name)


def _damaged(name: str, what: str) -> StoreError:
    return StoreError(
        f"store: {name} is damaged: {what} has changed since it was written; restore its files, "
        f"choose another name, or pass overwrite=True"
    )


def refuse_strange(store: Any, name: str) -> None:
    """Raise a `StoreError` where files are not the map's own, which would be lost with it."""
    keys = files.every_key(store)
    own = {GROUP, *str(zarr_group(store).attrs.get(_NAMED, "")).split()}
    own |= {*ROWS, *STATES, *LABELS}
    own |= {parameter.name for model in models().values() for parameter in model.declared}
    with contextlib.suppress(ParameterError):  # a plan that is damaged
        plan = read_plan(store)
        if plan is None:  # written in one go, with any arrays
            own |= {key.split("/")[0] for key in keys if key.endswith("/zarr.json")}
        else:
            own |= plan.arrays.keys()
    strange = sorted(key for key in keys if not _is_own(key.split("/"), own))
    if strange:
        more = f" and {len(strange) - 3} more" if strange[3:] else ""
        raise StoreError(
            f"store: {name} holds files that are not the map's, so it is not removed: "
            f"{', '.join(strange[:3])}{more}; move them, or choose another name"
        )


def _is_own(key: Sequence[str], names: Set[str]) -> bool:
    """Whether a file belongs to an array or group with one of these names, or to the root."""
    return (len(key) == 1 or key[0] in names) and (
        _OWN.fullmatch(key[-1]) is not None or key[-1] in names
    )


def reason(error: Exception) -> str:
    """Say what keeps a store from being read."""
    if isinstance(error, MemoryError):
        return NO_MEMORY
    return str(error) if isinstance(error, PhasekitError) else f"{type(error).__name__}: {error}"


def _forget_marks(store: Any, old: Plan, plan: Plan) -> None:
    """Forget tiles that get new cells, where marks do not say of which cells they are."""
    for part in old.parts:
        if not part.checked and _same_tiles(part, plan):
            others = marks_of(store, plan, part, {}, old).others
            files.put(store, {f"{GROUP}/{part.name}/{key_of(i)}": None for i in sorted(others)})


def _create_marks(group: Any, part: StoredPart, shape: tuple[int, ...]) -> None:
    from zarr.codecs import Crc32cCodec

    group.create_array(
        f"{GROUP}/{part.name}",
        shape=shape,
        chunks=(1,) * len(shape),
        dtype="string" if part.checked else "uint8",
        fill_value="" if part.checked else 0,
        compressors=[Crc32cCodec()],  # a mark that is half written is none
        chunk_key_encoding={"name": "default", "separator": "."},
        config={"write_empty_chunks": False},
    )


def fill_value(row: Quantity) -> Any:
    """Return what stands where nothing is computed."""
    if row.dtype == "bool":
        return False
    if not row.dtype.startswith("int"):
        return np.nan
    return -1 if row.flags is None or -1 in {flag.value for flag in row.flags} else 0


def _create(
    group: Any, part: StoredPart, row: Quantity, shape: tuple[int, ...], compressor: str
) -> None:
    attrs = dict(row.attrs)
    if "flag_values" in attrs:
        attrs["flag_values"] = attrs["flag_values"].tolist()
    group.create_array(
        row.name,
        shape=shape,
        chunks=part.chunk_of(row),
        dtype=row.dtype,
        fill_value=fill_value(row),
        compressors=codecs(compressor) if part.checked else [codec(compressor)],
        chunk_key_encoding={"name": "default", "separator": "."},
        dimension_names=(*part.dims, *row.dims),
        attributes=attrs,
        config={"write_empty_chunks": True},
    )


def codec(compressor: str = "lz4") -> Any:
    """Return the codec that compresses stored results; it reads what any compressor wrote."""
    from zarr.codecs import BloscCodec

    known: Any = compressor
    return BloscCodec(cname=known, clevel=5, shuffle="shuffle")


def codecs(compressor: str = "lz4") -> list[Any]:
    """Return the codecs of stored results: compression, then a checksum."""
    from zarr.codecs import Crc32cCodec

    return [codec(compressor), Crc32cCodec()]
