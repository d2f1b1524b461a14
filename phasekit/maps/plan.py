"""What a stored map consists of, and whether a sweep may continue it.

A plan says the model, its fixed parameters, fingerprints of its axes, and the parts. A part is a
set of quantities on the same dims, computed by one call, tile by tile. A call that asks for more
quantities adds parts; one with longer axes makes its arrays longer; any other difference is
refused, and named. It is kept as a JSON document of the store.
"""

from __future__ import annotations

import base64
import hashlib
import itertools
import json
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any

import numpy as np
import xarray as xr

from phasekit import errors
from phasekit.cells.numbered import NUMBERED
from phasekit.cells.request import Request
from phasekit.errors import ParameterError, StoreError
from phasekit.labels.coordinates import LABELS
from phasekit.laws.ladder import Law
from phasekit.maps.keys import DOCUMENT, GROUP, is_document, is_name, is_part, unfit
from phasekit.maps.options import StoreOptions
from phasekit.maps.parts import StoredPart, cut_again, new_part
from phasekit.systems.identity import SCHEMA, versions
from phasekit.table.row import Quantity

#: Version of the layout of stores. In layout 1 nothing had checksums.
LAYOUT = 2


@dataclass(frozen=True)
class Plan:
    """A stored map: what it is made of, and how it is cut."""

    model: str
    scalars: dict[str, float]
    arrays: dict[str, dict[str, Any]]  # name -> dims and fingerprint of its values
    sizes: dict[str, int]
    parts: tuple[StoredPart, ...]
    ready: bool = False  # whether all arrays are in place
    earlier: tuple[dict[str, int], ...] = ()  # sizes of which tiles at the end may be left
    #: SHA-256 of each file that describes the arrays or holds a coordinate.
    documents: dict[str, str] = field(default_factory=dict)
    #: Digests of the store's own document, whole and without versions; none in earlier stores.
    root: dict[str, str] = field(default_factory=dict)
    #: Where the arrays are being changed: these files as they were, None for those that were not.
    before: dict[str, bytes | None] = field(default_factory=dict, compare=False)
    coming: frozenset[str] = field(default=frozenset(), compare=False)  # arrays they may be of
    packed: str = ""  # digest of the file by which a finished map opens, if it has one
    coordinate: str = "phi"  # the name under which readers find places as well

    @property
    def names(self) -> frozenset[str]:
        """The names of the map's arrays."""
        dims = (dim for part in self.parts for row in part.rows for dim in row.dims)
        return frozenset([*self.quantities, *self.arrays, *self.scalars, *dims])

    @property
    def quantities(self) -> dict[str, StoredPart]:
        """The part of each quantity."""
        return {name: part for part in self.parts for name in part.quantities}

    @cached_property
    def generation(self) -> str:
        """A digest of all that decides what is in the arrays: that of another map is another."""
        parts = [
            [part.name, part.dims, part.chunks, part.quantities, part.inputs, *own]
            for part in self.parts
            for own in [[] if part.columns is None else [part.columns]]
        ]
        made_of = [self.model, self.scalars, self.arrays, self.sizes, parts]
        return hashlib.sha256(json.dumps(made_of, sort_keys=True).encode()).hexdigest()


def new_plan(request: Request) -> Plan:
    """Return the plan of a request, without parts."""
    inputs = request.grid.inputs
    scalars = {name: float(x.data) for name, x in inputs.items() if not x.dims}
    arrays = {
        name: {"dims": list(map(str, x.dims)), "sha256": fingerprint(x)}
        for name, x in {**request.grid.coords, **inputs}.items()
        if x.dims
    }
    return Plan(
        type(request.system).__name__,
        scalars,
        arrays,
        dict(request.grid.sizes),
        (),
        coordinate=(request.system.coordinate or "phi") if request.is_open else "phi",
    )


def fingerprint(values: xr.Variable) -> str:
    """Return a digest of values that tells any two apart, to the last bit."""
    array = np.asarray(values.data)
    if array.dtype.kind in "mM":
        array = array.astype(f"{array.dtype.kind}8[ns]")
    if array.dtype.kind in "fiubmM":
        kind = array.dtype.newbyteorder("<")
        data = np.ascontiguousarray(array.astype(kind)).tobytes()
    else:
        kind, data = np.dtype(object), repr(list(map(str, array.ravel().tolist()))).encode()
    return hashlib.sha256(kind.str.encode() + repr(array.shape).encode() + data).hexdigest()


def continued(stored: Plan, request: Request, name: str, chunks: Mapping[str, int]) -> Plan:
    """Return the plan of a stored map that a call continues: the same, or with longer axes.

    Tiles that are far too small for longer axes are chosen anew, unless the call names `chunks`.
    """
    wanted = new_plan(request)
    found = list(_differences(stored, wanted, request))
    if found:
        raise StoreError(
            f"store: {name} holds a different map from the one requested: {'; '.join(found)}; "
            f"repeat the original call, choose another name, or pass overwrite=True"
        )
    sizes = {**stored.sizes, **{dim: wanted.sizes[dim] for dim in wanted.sizes}}
    grown = [dim for dim in stored.sizes if sizes[dim] != stored.sizes[dim]]
    asked = {row.name for row in request.rows}
    for part in stored.parts:
        left = [quantity for quantity in part.quantities if quantity not in asked]
        if left and not set(grown).isdisjoint(part.dims):
            raise StoreError(
                f"store: {name} has fewer values of {', '.join(grown)} than the call, which does "
                f"not name {', '.join(left)}; what makes an axis longer names all quantities of "
                "the map in of="
            )
    parts = []
    for part in stored.parts:
        if not set(grown).isdisjoint(part.dims):
            asked_for = (
                one for one in request.parts if any(row.name in part.quantities for row in one.rows)
            )
            names = {name for one in asked_for for name in one.inputs}
            part = replace(part, complete=False)
            part = cut_again(part, names, stored.sizes, sizes, chunks)
        parts.append(part)
    return replace(
        stored,
        scalars={**stored.scalars, **wanted.scalars},
        arrays={**stored.arrays, **wanted.arrays},
        sizes=sizes,
        parts=tuple(parts),
        ready=True,
        earlier=stored.earlier if not grown else (*stored.earlier, stored.sizes),
        before={},
        coming=frozenset(),
    )


def _differences(stored: Plan, wanted: Plan, request: Request) -> Iterable[str]:
    """Name what keeps a call from continuing a map."""
    if stored.model != wanted.model:
        yield f"the model is {stored.model}, the call's {wanted.model}"
        return
    required = {p.name for p in request.system.declared if not p.optional} | set(stored.sizes)
    for name in dict.fromkeys([*stored.scalars, *stored.arrays, *wanted.scalars, *wanted.arrays]):
        old, new = _shown(stored, name), _shown(wanted, name)
        if old is None or new is None:
            # States and optional parameters come with the quantities that need them.
            if name in required if old is None else name not in request.states:
                yield f"{name} is {old or 'not given'}, in the call {new or 'not given'}"
        elif name in stored.scalars and name in wanted.scalars:
            if stored.scalars[name] != wanted.scalars[name]:
                yield f"{name} is {old}, in the call {new}"
        elif name in stored.scalars or name in wanted.scalars:
            yield f"{name} is {old}, in the call {new}"
        else:
            yield from _array_differences(stored, wanted, request, name)
    common = [dim for dim in stored.sizes if dim in wanted.sizes]
    order = [dim for dim in wanted.sizes if dim in stored.sizes]
    if common != order:
        yield f"the order of its axes is {', '.join(common)}, in the call {', '.join(order)}"


def _array_differences(stored: Plan, wanted: Plan, request: Request, name: str) -> Iterable[str]:
    dims = stored.arrays[name]["dims"]
    if dims != wanted.arrays[name]["dims"]:
        yield f"{name} lies on {dims}, in the call on {wanted.arrays[name]['dims']}"
        return
    shorter = [dim for dim in dims if wanted.sizes[dim] < stored.sizes[dim]]
    if shorter:
        yield f"{name} is {_shown(stored, name)}, in the call {_shown(wanted, name)}"
        return
    values = {**request.grid.coords, **request.grid.inputs}[name]
    if (
        fingerprint(values.isel({dim: slice(stored.sizes[dim]) for dim in dims}))
        != stored.arrays[name]["sha256"]
    ):
        grown = any(wanted.sizes[dim] > stored.sizes[dim] for dim in dims)
        hint = ", which may only be longer at its end" if grown else ""
        yield f"the values of {name} are others in the call{hint}"


def _shown(plan: Plan, name: str) -> str | None:
    if name in plan.scalars:
        return repr(plan.scalars[name])
    if name not in plan.arrays:
        return None
    sizes = (f"{plan.sizes[dim]} along {dim}" for dim in plan.arrays[name]["dims"])
    return f"an axis of {' and '.join(sizes)}"


def with_parts(plan: Plan, request: Request, options: StoreOptions, name: str) -> Plan:
    """Add parts for what a request computes and the plan does not hold."""
    held, chunks, dtypes = plan.quantities, options.chunks, options.dtypes
    for row in request.rows:
        known = held.get(row.name)
        if known is None:
            continue
        if row.name in dtypes and dtypes[row.name] != known.quantities[row.name]:
            raise StoreError(
                f"store: {name} holds {row.name} as {known.quantities[row.name]}, the call asks "
                f"for {dtypes[row.name]}; choose another name, or pass overwrite=True"
            )
        for dim, n in zip(known.dims, known.chunks, strict=True):
            if chunks.get(dim, n) not in (n, -1):
                raise StoreError(
                    f"store: {name} holds {row.name} in chunks of {n} along {dim}, the call asks "
                    f"for {chunks[dim]}; leave out chunks=, choose another name, or pass "
                    "overwrite=True"
                )
    parts = list(plan.parts)
    for part in request.parts:
        rows = tuple(
            replace(row, dtype=dtypes.get(row.name, row.dtype))
            for row in part.rows
            if row.name not in held
        )
        if rows:
            taken = {stored.name for stored in parts}
            free = next(n for n in map("part{}".format, itertools.count()) if n not in taken)
            parts.append(
                new_part(
                    free,
                    replace(part, rows=rows),
                    plan.sizes,
                    chunks,
                    is_open=request.is_open,
                )
            )
    return replace(plan, parts=tuple(parts))


#: The file that holds the plan, and the attribute in it.
PLAN_KEY = f"{GROUP}/{DOCUMENT}"
PLAN = "plan"

#: Names of the digests of the store's own document.
WHOLE, DEFINITION = "whole", "definition"

#: What stands in place of a plan while a map is removed.
CLEARED = Plan("", {}, {}, {}, ())

#: Dtypes in which results of others may be stored; equilibria that are numbered may be many.
_KINDS = {"float64": ("float32", "float64"), "int8": ("int8", "int16")}

#: What is text of a row that is of one system.
_TEXTS = ("name", "group", "dtype", "units", "long_name", "equation", "source")

_DAMAGED = "its plan, sweep/zarr.json, is damaged"


def plan_bytes(plan: Plan) -> bytes:
    """Return the file of a plan."""
    import zarr
    from zarr.storage import MemoryStore

    kept: dict[str, Any] = {}
    zarr.create_group(MemoryStore(kept), attributes={PLAN: _to_json(plan)}, zarr_format=3)
    found: bytes = kept["zarr.json"].to_bytes()
    return found


def _to_json(plan: Plan) -> dict[str, Any]:
    parts = [
        {
            "name": part.name,
            "dims": list(part.dims),
            "chunks": list(part.chunks),
            "quantities": part.quantities,
            "complete": part.complete,
        }
        | ({"inputs": list(part.inputs)} if part.inputs is not None else {})
        | ({"columns": part.columns} if part.columns is not None else {})
        | ({"own": [_row_to_json(row) for row in part.own]} if part.own else {})
        for part in plan.parts
    ]
    stored = {
        "layout": LAYOUT,
        "model": plan.model,
        "scalars": plan.scalars,
        "arrays": plan.arrays,
        "sizes": plan.sizes,
        "parts": parts,
        "ready": plan.ready,
        "earlier": list(plan.earlier),
        "documents": dict(sorted(plan.documents.items())),
        "before": {
            key: None if data is None else base64.b64encode(data).decode()
            for key, data in plan.before.items()
        },
        "coming": sorted(plan.coming),
        "root": plan.root,
    } | ({"packed": plan.packed} if plan.packed else {})
    stored |= {"coordinate": plan.coordinate} if plan.coordinate != "phi" else {}
    return {**stored, "sha256": _digest(stored)}


def _row_to_json(row: Quantity) -> dict[str, Any]:
    """A row that is of one system, as text and numbers."""
    kept = {name: getattr(row, name) for name in _TEXTS}
    labels = {
        dim: [list(labels), text] for dim in row.dims for labels, text in [row.labels_of(dim)]
    }
    flags = None if row.flags is None else row.flags.__name__
    return {
        **kept,
        "dims": list(row.dims),
        "cells": row.most_cells,
        "labels": labels,
        "flags": flags,
    }


def _row_from(stored: Mapping[str, Any]) -> Quantity:
    texts = {name: str(stored[name]) for name in _TEXTS}
    labels = {dim: (tuple(labels), str(text)) for dim, (labels, text) in stored["labels"].items()}
    flags = None if stored["flags"] is None else getattr(errors, str(stored["flags"]))
    return Quantity(
        dims=tuple(stored["dims"]), flags=flags, labels={**LABELS, **labels}, of=Law,
        most_cells=int(stored["cells"]), **texts,
    )  # fmt: skip


def _digest(stored: Mapping[str, Any]) -> str:
    fixed = {name: stored[name] for name in stored.keys() - {"ready", "sha256"}}
    fixed["parts"] = [{**part, "complete": None} for part in stored["parts"]]
    return hashlib.sha256(json.dumps(fixed, sort_keys=True).encode()).hexdigest()


def root_digests(data: bytes) -> dict[str, str]:
    """Return the digests of the store's own document: of all, and of all but versions.

    The versions of libraries may be others where a map is continued, that of the schema is looked
    at by itself; what it is a map of may not.
    """
    try:
        root = json.loads(data)
        for name in (SCHEMA, *versions()):
            root["attributes"].pop(name, None)
        definition = json.dumps(root, sort_keys=True)
    except (ValueError, TypeError, KeyError, AttributeError, RecursionError):
        definition = "damaged"
    made = {WHOLE: data, DEFINITION: definition.encode()}
    return {name: hashlib.sha256(part).hexdigest() for name, part in made.items()}


def plan_from(data: bytes) -> Plan:
    """Read the file of a plan."""
    try:
        stored = json.loads(data)["attributes"][PLAN]
        layout = stored["layout"]
    except (ValueError, TypeError, KeyError, RecursionError) as error:
        raise ParameterError(f"{_DAMAGED}: {type(error).__name__}: {error}") from error
    if type(layout) is not int or layout not in (1, LAYOUT):
        raise ParameterError(
            f"got a store of layout {layout!r}, wants {LAYOUT}; it was made by another version of "
            f"phasekit: compute it again or use that version"
        )
    try:
        if layout > 1 and stored["sha256"] != _digest(stored):
            raise ParameterError(f"{_DAMAGED}: it has changed since it was written")
        plan = _read(stored)
        _check(plan)
    except (ValueError, TypeError, KeyError, AttributeError, RecursionError) as error:
        if isinstance(error, ParameterError):
            raise
        raise ParameterError(f"{_DAMAGED}: {type(error).__name__}: {error}") from error
    return plan


def _read(stored: Mapping[str, Any]) -> Plan:
    parts = tuple(
        StoredPart(
            part["name"],
            tuple(part["dims"]),
            tuple(part["chunks"]),
            dict(part["quantities"]),
            part["complete"],
            tuple(part["inputs"]) if "inputs" in part else None,
            dict(part["columns"]) if "columns" in part else None,
            tuple(map(_row_from, part.get("own", ()))),
        )
        for part in stored["parts"]
    )
    before = {
        key: None if data is None else base64.b64decode(data, validate=True)
        for key, data in stored.get("before", {}).items()
    }
    return Plan(
        stored["model"],
        dict(stored["scalars"]),
        {name: dict(array) for name, array in stored["arrays"].items()},
        dict(stored["sizes"]),
        parts,
        stored["ready"],
        tuple(map(dict, stored.get("earlier", ()))),
        dict(stored.get("documents", {})),
        dict(stored.get("root", {})),
        before,
        # Earlier versions did not say which arrays were being made.
        frozenset(stored.get("coming", _named(before))),
        stored.get("packed", ""),
        stored.get("coordinate", "phi"),
    )


def _named(keys: Iterable[str]) -> set[str]:
    """Return the names of arrays in keys."""
    return {key.split("/")[0] for key in keys} - {GROUP, DOCUMENT}


def _check(plan: Plan) -> None:
    """Refuse what no plan holds: values in JSON may have become anything."""

    def wants(condition: bool, what: str) -> None:
        if not condition:
            raise ParameterError(f"{_DAMAGED}: {what} is not what a plan holds")

    wants(type(plan.model) is str, "model")
    wants(type(plan.ready) is bool, "ready")
    wants(all(type(value) is float for value in plan.scalars.values()), "scalars")
    for sizes in (plan.sizes, *plan.earlier):
        wants(all(type(n) is int and 0 < n < 2**63 for n in sizes.values()), "sizes")
        wants(sizes.keys() <= plan.sizes.keys(), "sizes")
    for array in plan.arrays.values():
        wants(type(array["sha256"]) is str, "arrays")
        wants(type(array["dims"]) is list and set(array["dims"]) <= plan.sizes.keys(), "arrays")
    wants(len({part.name for part in plan.parts}) == len(plan.parts), "parts")
    for part in plan.parts:
        wants(is_part(part.name), "the name of a part")
        wants(type(part.complete) is bool, f"complete of {part.name}")
        wants(set(part.dims) <= plan.sizes.keys(), f"dims of {part.name}")
        wants(len(part.chunks) == len(set(part.dims)) == len(part.dims), f"dims of {part.name}")
        wants(all(type(n) is int and 0 < n <= 2**63 for n in part.chunks), f"chunks of {part.name}")
        known_rows = part.rows_by_name
        for name, dtype in part.quantities.items():
            wants(name in known_rows, f"the quantity {name!r}")
            kinds = _KINDS.get(known_rows[name].dtype, (known_rows[name].dtype,))
            wants(dtype in kinds, f"the dtype of {name}")
        own = {dim for row in part.rows for dim in row.dims if dim in NUMBERED}
        columns = dict.fromkeys(own, 0) if part.columns is None else part.columns
        wants(columns.keys() == own, f"columns of {part.name}")
        numbers = columns.values()
        wants(all(type(n) is int and 0 <= n < 2**31 for n in numbers), f"columns of {part.name}")
    known = plan.names | plan.coming
    wants(not unfit(known), "the name of an array")
    # Labels may be there of quantities that are being cut anew.
    keys = {*plan.documents, *plan.before}
    wants(all(is_document(key, known | LABELS.keys()) for key in keys), "the path of a document")
    digests = [*plan.documents.values(), *plan.root.values()]
    wants(all(type(digest) is str for digest in digests), "documents")
    wants(type(plan.packed) is str, "packed")
    wants(is_name(plan.coordinate), "coordinate")
    wants(plan.root.keys() in (set(), {WHOLE, DEFINITION}), "root")
