"""What a stored map consists of, and whether a sweep may continue it.

A plan says the model, its fixed parameters, fingerprints of its axes, and the parts. A part is a
set of quantities on the same dims, computed by one call, tile by tile. A call that asks for more
quantities adds parts; one with longer axes makes its arrays longer; any other difference is
refused, and named.
"""

from __future__ import annotations

import hashlib
import itertools
import json
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any

import numpy as np
import xarray as xr

from phasekit.cells.request import Request
from phasekit.errors import StoreError
from phasekit.maps.options import StoreOptions
from phasekit.maps.parts import StoredPart, cut_again, new_part

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
