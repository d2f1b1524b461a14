"""What a call for a stored map has to do: found out from the store, before anything is written."""

from __future__ import annotations

import contextlib
import itertools
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from math import prod

import xarray as xr

from phasekit.cells.evaluate import columns_of_sample
from phasekit.cells.numbered import NUMBERED, greatest
from phasekit.cells.request import Request
from phasekit.errors import ParameterError, StoreError
from phasekit.maps.damage import Damage, at_a_glance, in_full, lost_tiles
from phasekit.maps.estimate import SAMPLES, Estimate, estimate
from phasekit.maps.keys import unfit
from phasekit.maps.left import Left
from phasekit.maps.marks import Marks, marks_of
from phasekit.maps.options import StoreOptions
from phasekit.maps.packed import read_packed
from phasekit.maps.parts import StoredPart
from phasekit.maps.place import Place
from phasekit.maps.plan import CLEARED, Plan, continued, new_plan, with_parts
from phasekit.maps.stored_arrays import (
    read_plan,
    reason,
    refuse_damaged,
    refuse_strange,
    zarr_group,
)
from phasekit.maps.tile import Tile
from phasekit.maps.unfinished import opened
from phasekit.systems.identity import MODEL, SCHEMA, model_name, versions


@dataclass(frozen=True)
class Job:
    """What a call has to do."""

    place: Place
    request: Request
    old: Plan | None  # of the map that is continued
    plan: Plan
    left: tuple[Left, ...]
    damaged: tuple[Damage, ...] = ()

    @property
    def cells(self) -> int:
        """Number of cells that are left."""
        return sum(left.cells for left in self.left)

    @property
    def count(self) -> int:
        """Number of tiles that are left."""
        return sum(map(len, self.left))

    @property
    def total(self) -> int:
        """Number of tiles, done or left, of all parts that are not complete."""
        return sum(prod(left.part.grid(left.sizes)) for left in self.left)

    def tiles(self) -> Iterator[Tile]:
        """Return the tiles that are left."""
        return itertools.chain.from_iterable(
            left.tiles(self.place, self.request) for left in self.left
        )

    def estimate(self) -> Estimate:
        """Estimate what is left from samples."""
        left = [one for one in self.left if len(one)]
        return estimate([(one, one.samples(self.place, self.request, SAMPLES)) for one in left])


def plan_job(
    place: Place,
    request: Request,
    options: StoreOptions,
    *,
    verify: bool = False,
) -> Job:
    """Find out what a call has to do; nothing is written.

    Tiles that are damaged count as not done: those whose files are gone or have another size, and
    with `verify`, for which all files are read, any that are not what was written.
    """
    place.refuse_file()
    with _readable(place):
        old = None if place.empty else _look(place, options.overwrite)
        if old is not None and old.parts:
            with opened(place.open(read_only=True), old, place.name) as (ds, group):
                refuse_damaged(ds, group, old, place.name)
                _refuse_other(ds, old, request, place.name)
    name = place.name
    base = new_plan(request) if old is None else continued(old, request, name, options.chunks)
    if request.is_open:
        base, request = _with_columns(place, old, base, request)
    plan = replace(with_parts(base, request, options, name), ready=True)
    if wrong := unfit(sorted(plan.names)):
        raise StoreError(
            f"store: {name} would have arrays called {', '.join(wrong)}, wants names that are "
            "names of files on every system, no two of them equal but for case: rename the dims "
            "of the axes"
        )
    asked = {row.name for row in request.rows}
    left, damaged, parts = [], [], []
    for part in plan.parts:
        if not asked.isdisjoint(part.quantities):
            with _readable(place):
                marks, found = _marks(place, old, plan, part, request, verify)
            damaged.extend(found)
            one = Left(plan, part, marks)
            if len(one) or not part.complete:
                part = replace(part, complete=False)
                left.append(replace(one, part=part))
        parts.append(part)
    plan = replace(plan, parts=tuple(parts), packed="")
    if old is not None and old.packed and plan == replace(old, packed=""):
        # A plan without it, which is written otherwise, comes before anything is changed.
        store = place.open(read_only=True)
        if not verify or read_packed(store, old) is not None:
            plan = replace(plan, packed=old.packed)
    return Job(place, request, old, plan, tuple(left), tuple(damaged))


def _with_columns(
    place: Place, old: Plan | None, base: Plan, request: Request
) -> tuple[Plan, Request]:
    """Return a plan and a request with as many equilibria and saddles as are known by now.

    Tiles may have been found to need more than the arrays had; of a new map a few cells are tried.
    """
    asked = {row.name for row in request.rows}
    widths: list[Mapping[str, int]] = [part.columns or {} for part in base.parts]
    for part in base.parts if old is not None else ():
        if not asked.isdisjoint(part.quantities):
            with _readable(place):
                store = place.open(read_only=True)
                marks = marks_of(store, base, part, request.grid.inputs, old)
            widths += [mark.columns for mark in marks.uneven.values()]
    needed = {dim for row in request.rows for dim in row.dims if dim in NUMBERED}
    if not needed <= greatest(widths).keys():
        widths.append(columns_of_sample(request))
    columns = {**dict.fromkeys(NUMBERED, 0), **greatest(widths)}
    parts = tuple(part.with_columns(columns) for part in base.parts)
    for part, was in zip(parts, base.parts, strict=True):
        if part != was and asked.isdisjoint(part.quantities):
            raise StoreError(
                f"store: {place.name} has room for fewer equilibria than the call finds, which "
                f"does not name {', '.join(part.quantities)}; name all quantities of the map in of="
            )
    return replace(base, parts=parts), request.sized(columns)


def _refuse_other(ds: xr.Dataset, old: Plan, request: Request, name: str) -> None:
    """Raise a `StoreError` where a map is one of another system, beside its parameters."""
    others = {MODEL, SCHEMA, *versions()}
    stored = {k: v for k, v in ds.attrs.items() if k.startswith("phasekit_") and k not in others}
    wanted = dict(request.system.definition)
    if old.model == type(request.system).__name__ and stored != wanted:
        different = sorted(k for k in stored.keys() | wanted if stored.get(k) != wanted.get(k))
        told = (f"{k} is {stored.get(k)!r}, in the call {wanted.get(k)!r}" for k in different)
        raise StoreError(
            f"store: {name} holds a different map from the one requested: {'; '.join(told)}; "
            f"repeat the original call, choose another name, or pass overwrite=True"
        )


def _marks(
    place: Place,
    old: Plan | None,
    plan: Plan,
    part: StoredPart,
    request: Request,
    verify: bool,
) -> tuple[Marks, list[Damage]]:
    """Return the marks of a part that hold, and what is damaged."""
    if old is None or not any(
        (part.name, part.chunks) == (known.name, known.chunks) for known in old.parts
    ):
        return Marks({}, {}, frozenset()), []
    store = place.open(read_only=True)
    marks = marks_of(store, plan, part, request.grid.inputs, old)
    damaged = lost_tiles(part, marks, plan.sizes)
    damaged += (in_full if verify else at_a_glance)(store, part, marks.done)
    return marks.without(one.index for one in damaged), damaged


@contextlib.contextmanager
def _readable(place: Place) -> Iterator[None]:
    try:
        yield
    except StoreError:
        raise
    except Exception as error:  # whatever zarr makes of files that are not what they were
        raise StoreError(
            f"store: {place.name} exists but cannot be read: {reason(error)}; choose "
            "another name, or pass overwrite=True"
        ) from error


def _look(place: Place, overwrite: bool) -> Plan | None:
    """Return the plan of the map that is there; None where there is none, or it is to go."""
    store = place.open(read_only=True)
    try:
        group = zarr_group(store)
    except FileNotFoundError:
        group = None
    except (ValueError, TypeError, KeyError) as error:
        raise StoreError(
            f"store: {place.name} exists but cannot be read: {reason(error)}; choose another name"
        ) from error
    if group is None and place.path is None:
        return None
    if group is None or MODEL not in group.attrs:
        raise StoreError(
            f"store: {place.name} exists and is not a map, so it is not overwritten; choose "
            "another name"
        )
    if overwrite:
        refuse_strange(store, place.name)
        return None
    try:
        model_name(xr.Dataset(attrs=dict(group.attrs)))
        plan = read_plan(store)
    except ParameterError as error:
        raise StoreError(
            f"store: {place.name} cannot be continued: {error}; choose another name, or pass "
            "overwrite=True"
        ) from error
    if plan == CLEARED:
        refuse_strange(store, place.name)
        return None
    if plan is None and any(True for _ in group):
        raise StoreError(
            f"store: {place.name} exists and does not say how it was made, so it cannot be "
            "continued; choose another name, or pass overwrite=True"
        )
    if plan is not None and plan.model != group.attrs[MODEL]:
        raise StoreError(
            f"store: {place.name} is damaged: zarr.json names the model {group.attrs[MODEL]!r}, "
            f"its plan {plan.model!r}; choose another name, or pass overwrite=True"
        )
    return plan
