"""What a call for a stored map has to do: found out from the store, before anything is written."""

from __future__ import annotations

import contextlib
import itertools
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from math import prod
from typing import Any

import numpy as np
import xarray as xr

from phasekit.cells.dispatch import passes_of
from phasekit.cells.evaluate import Layout, leaves
from phasekit.cells.tiling import cut
from phasekit.errors import ParameterError, StoreError
from phasekit.maps.damage import Damage, at_a_glance, in_full, lost_tiles
from phasekit.maps.estimate import SAMPLES, Estimate, Share, estimate
from phasekit.maps.marks import Index, Inputs, Marks, marks_of
from phasekit.maps.parts import Part
from phasekit.maps.place import Place
from phasekit.maps.plan import Plan, continued, new_plan, with_parts
from phasekit.maps.plan_file import CLEARED
from phasekit.maps.stored_arrays import (
    read_plan,
    reason,
    refuse_damaged,
    refuse_strange,
    zarr_group,
)
from phasekit.maps.tile import Tile
from phasekit.maps.unfinished import opened
from phasekit.systems.identity import MODEL, model_name


@dataclass(frozen=True)
class Left:
    """The tiles of a part that are not done: counted and found without a list of them."""

    plan: Plan
    part: Part
    marks: Marks

    @property
    def sizes(self) -> Mapping[str, int]:
        """Sizes of the map's dims."""
        return self.plan.sizes

    @cached_property
    def grid(self) -> tuple[int, ...]:
        """Number of tiles along each dim."""
        return self.part.grid(self.sizes)

    @cached_property
    def _done(self) -> Any:
        """Places of the tiles that are done, counted row by row."""
        places = [_place_of(index, self.grid) for index in self.marks.done]
        return np.sort(np.array(places, np.int64))

    def __len__(self) -> int:
        """Return the number of tiles."""
        return prod(self.grid) - len(self._done)

    @cached_property
    def cells(self) -> int:
        """Number of cells."""
        done = (self.part.region(index, self.sizes) for index in self.marks.done)
        cells: int = sum(prod(piece.stop - piece.start for piece in region) for region in done)
        return self.part.cells(self.sizes) - cells

    def at(self, number: int) -> Index:
        """Return one of the tiles, by its place among those that are left."""
        before = self._done - np.arange(len(self._done))  # tiles that are left before each
        return _index_of(number + int(np.searchsorted(before, number, side="right")), self.grid)

    def indices(self) -> Iterator[Index]:
        """Return the tiles, row by row."""
        for index in itertools.product(*map(range, self.grid)):
            if index not in self.marks.done:
                yield index

    def tiles(self, place: Place, layout: Layout, indices: Iterable[Index]) -> Iterator[Tile]:
        """Return tiles with what is needed to compute them."""
        part = self.part
        passes = passes_of(layout.system, part.rows)
        names = {name for one in passes for name in leaves(layout.system, one.inputs, passes)}
        missing = sorted(names - layout.grid.inputs.keys())
        if missing:
            raise StoreError(
                f"store: {', '.join(part.quantities)} are not complete and need "
                f"{', '.join(missing)}; make the call as it was"
            )
        arrays = {name: layout.grid.aligned(name, part.dims) for name in sorted(names)}
        made_of = Inputs(self.plan, part, layout.grid.inputs)
        marked = self.marks.others | self.marks.shorter.keys()
        for index in indices:
            region = part.region(index, self.sizes)
            yield Tile(
                place,
                self.plan.generation,
                part.name,
                index,
                made_of.of(index, self.sizes),
                index in marked,
                region,
                layout.model,
                passes,
                part.rows,
                {name: np.array(cut(array, region)) for name, array in arrays.items()},
            )


def _place_of(index: Index, grid: Sequence[int]) -> int:
    place = 0
    for i, n in zip(index, grid, strict=True):
        place = place * n + i
    return place


def _index_of(place: int, grid: Sequence[int]) -> Index:
    found = []
    for n in reversed(grid):
        place, i = divmod(place, n)
        found.append(i)
    return tuple(reversed(found))


@dataclass(frozen=True)
class Job:
    """What a call has to do."""

    place: Place
    layout: Layout
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
            left.tiles(self.place, self.layout, left.indices()) for left in self.left
        )

    def shares(self, samples: int = SAMPLES) -> list[Share]:
        """Return what is left of each part, with tiles to take samples of."""
        found = []
        for left in self.left:
            count = len(left)
            if count:
                chosen = sorted({i * (count - 1) // max(samples - 1, 1) for i in range(samples)})
                tiles = list(left.tiles(self.place, self.layout, map(left.at, chosen)))
                found.append(Share(left.cells, count, left.part.rows, tiles))
        return found

    def estimate(self) -> Estimate:
        """Estimate what is left from samples."""
        return estimate(self.shares())


def plan_job(
    place: Place,
    layout: Layout,
    *,
    chunks: Mapping[str, int],
    dtypes: Mapping[str, str],
    overwrite: bool = False,
    verify: bool = False,
) -> Job:
    """Find out what a call has to do; nothing is written.

    Tiles that are damaged count as not done: those whose files are gone or have another size, and
    with `verify`, for which all files are read, any that are not what was written.

    Raises
    ------
    StoreError
        If the store holds something else.
    """
    place.refuse_file()
    with _readable(place):
        old = None if place.empty else _look(place, overwrite)
        if old is not None and old.parts:
            with opened(place.open(read_only=True), old, place.name) as (ds, group):
                refuse_damaged(ds, group, old, place.name)
    base = new_plan(layout) if old is None else continued(old, layout, place.name, chunks)
    plan = replace(with_parts(base, layout, chunks, dtypes, place.name), ready=True)
    asked = {row.name for row in layout.rows}
    left, damaged, parts = [], [], []
    for part in plan.parts:
        if not asked.isdisjoint(part.quantities):
            with _readable(place):
                marks, found = _marks(place, old, plan, part, layout, verify)
            damaged.extend(found)
            one = Left(plan, part, marks)
            if len(one) or not part.complete:
                part = replace(part, complete=False)
                left.append(replace(one, part=part))
        parts.append(part)
    plan = replace(plan, parts=tuple(parts))
    return Job(place, layout, old, plan, tuple(left), tuple(damaged))


def _marks(
    place: Place, old: Plan | None, plan: Plan, part: Part, layout: Layout, verify: bool
) -> tuple[Marks, list[Damage]]:
    """Return the marks of a part that hold, and what is damaged."""
    if old is None or not any(
        (part.name, part.chunks) == (known.name, known.chunks) for known in old.parts
    ):
        return Marks({}, {}, frozenset()), []
    store = place.open(read_only=True)
    marks = marks_of(store, plan, part, layout.grid.inputs, old)
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
