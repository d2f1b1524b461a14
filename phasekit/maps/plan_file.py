"""The plan of a stored map as JSON, and the file that holds it: the attributes of a Zarr group.

The file is written in one piece. A digest in it covers all but what changes while a map is made.
"""

from __future__ import annotations

import base64
import hashlib
import json
from collections.abc import Mapping
from typing import Any

from phasekit.errors import ParameterError
from phasekit.maps.parts import StoredPart
from phasekit.maps.plan import LAYOUT, Plan
from phasekit.table.quantities import ROWS

#: The group that holds the plan, and the marks of tiles that are done; its file and attribute.
GROUP = "sweep"
PLAN_KEY = f"{GROUP}/zarr.json"
PLAN = "plan"

#: What stands in place of a plan while a map is removed.
CLEARED = Plan("", {}, {}, {}, ())

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
    }
    return {**stored, "sha256": _digest(stored)}


def _digest(stored: Mapping[str, Any]) -> str:
    fixed = {name: stored[name] for name in stored.keys() - {"ready", "sha256"}}
    fixed["parts"] = [{**part, "complete": None} for part in stored["parts"]]
    return hashlib.sha256(json.dumps(fixed, sort_keys=True).encode()).hexdigest()


def plan_from(data: bytes) -> Plan:
    """Read the file of a plan.

    Raises
    ------
    ParameterError
        If it is damaged, or of another version of phasekit.
    """
    try:
        stored = json.loads(data)["attributes"][PLAN]
        layout = stored["layout"]
    except (ValueError, TypeError, KeyError, RecursionError) as error:
        raise ParameterError(f"{_DAMAGED}: {type(error).__name__}: {error}") from error
    if type(layout) is not int or layout not in (1, LAYOUT):
        raise ParameterError(
            f"got a store of layout {layout!r}, wants {LAYOUT}; it was made by "
            "another version of phasekit: make it anew or use that version"
        )
    try:
        if layout > 1 and stored["sha256"] != _digest(stored):
            raise ParameterError(f"{_DAMAGED}: it is not what it was when it was written")
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
        before,
    )


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
        wants(type(part.name) is str, "the name of a part")
        wants(type(part.complete) is bool, f"complete of {part.name}")
        wants(set(part.dims) <= plan.sizes.keys(), f"dims of {part.name}")
        wants(len(part.chunks) == len(set(part.dims)) == len(part.dims), f"dims of {part.name}")
        wants(all(type(n) is int and 0 < n <= 2**63 for n in part.chunks), f"chunks of {part.name}")
        for name, dtype in part.quantities.items():
            wants(name in ROWS, f"the quantity {name!r}")
            kinds = ("float32", "float64") if ROWS[name].dtype == "float64" else (ROWS[name].dtype,)
            wants(dtype in kinds, f"the dtype of {name}")
