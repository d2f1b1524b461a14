"""The plan of a stored map as JSON, and the file that holds it: the attributes of a Zarr group.

The file is written in one piece. A digest in it covers all but what changes while a map is made.
"""

from __future__ import annotations

import base64
import hashlib
import json
from collections.abc import Iterable, Mapping
from typing import Any

from phasekit import errors
from phasekit.cells.numbered import NUMBERED
from phasekit.errors import ParameterError
from phasekit.labels.coordinates import LABELS
from phasekit.laws.ladder import Law
from phasekit.maps.keys import DOCUMENT, GROUP, is_document, is_name, is_part, unfit
from phasekit.maps.parts import StoredPart
from phasekit.maps.plan import LAYOUT, Plan
from phasekit.systems.identity import SCHEMA, versions
from phasekit.table.row import Quantity

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
