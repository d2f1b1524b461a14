"""What a call for a stored map has to do: found out from the store, before anything is written."""

from __future__ import annotations

import contextlib
import itertools
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from math import prod
from typing import Any

import numpy as np
import xarray as xr

from phasekit.errors import ParameterError, StoreError
from phasekit.labelled.arrays import done_tiles, read_plan, reason, refuse_damaged, zarr_group
from phasekit.labelled.estimate import SAMPLES, Estimate, Share, estimate
from phasekit.labelled.evaluate import Layout, leaves
from phasekit.labelled.identity import MODEL, model_name
from phasekit.labelled.parts import Part
from phasekit.labelled.place import Place
from phasekit.labelled.plan import Plan, continued, new_plan, with_parts
from phasekit.labelled.tile import Tile
from phasekit.labelled.tiling import cut


@dataclass(frozen=True)
class Left:
    """The tiles of a part that are not done."""

    part: Part
    indices: Any  # of the tiles, one a row
    sizes: Mapping[str, int]

    @cached_property
    def cells(self) -> int:
        """Number of cells."""
        return sum(
            prod(piece.stop - piece.start for piece in self.part.region(index, self.sizes))
            for index in self.indices.tolist()
        )

    def tiles(self, place: Place, layout: Layout, indices: Any) -> Iterator[Tile]:
        """Return tiles with what is needed to compute them."""
        part, passes = self.part, self.part.passes
        names = {name for one in passes for name in leaves(layout.system, one.inputs, passes)}
        missing = sorted(names - layout.grid.inputs.keys())
        if missing:
            raise StoreError(
                f"store: {', '.join(part.quantities)} are not complete and need "
                f"{', '.join(missing)}; make the call as it was"
            )
        arrays = {name: layout.grid.aligned(name, part.dims) for name in sorted(names)}
        generation = repr((part, self.sizes))
        for index in map(tuple, indices.tolist()):
            region = part.region(index, self.sizes)
            inputs = {name: np.array(cut(array, region)) for name, array in arrays.items()}
            yield Tile(
                place, generation, part.name, index, region, layout.model, passes, part.rows, inputs
            )


@dataclass(frozen=True)
class Job:
    """What a call has to do."""

    place: Place
    layout: Layout
    old: Plan | None  # of the map that is continued
    plan: Plan
    left: tuple[Left, ...]

    @property
    def cells(self) -> int:
        """Number of cells that are left."""
        return sum(left.cells for left in self.left)

    @property
    def count(self) -> int:
        """Number of tiles that are left."""
        return sum(len(left.indices) for left in self.left)

    @property
    def total(self) -> int:
        """Number of tiles, done or left, of all parts that are not complete."""
        return sum(prod(left.part.grid(left.sizes)) for left in self.left)

    def tiles(self) -> Iterator[Tile]:
        """Return the tiles that are left."""
        return itertools.chain.from_iterable(
            left.tiles(self.place, self.layout, left.indices) for left in self.left
        )

    def shares(self, samples: int = SAMPLES) -> list[Share]:
        """Return what is left of each part, with tiles to take samples of."""
        found = []
        for left in self.left:
            count = len(left.indices)
            if count:
                chosen = sorted({i * (count - 1) // max(samples - 1, 1) for i in range(samples)})
                tiles = list(left.tiles(self.place, self.layout, left.indices[chosen]))
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
) -> Job:
    """Find out what a call has to do; nothing is written.

    Raises
    ------
    StoreError
        If the store holds something else.
    """
    place.refuse_unwritable()
    with _readable(place):
        old = None if place.empty else _look(place, overwrite)
        if old is not None and old.ready:
            refuse_damaged(place, old)
    base = new_plan(layout) if old is None else continued(old, layout, place.name)
    plan = replace(with_parts(base, layout, chunks, dtypes, place.name), ready=True)
    asked = {row.name for row in layout.rows}
    left = []
    for part in plan.parts:
        if not part.complete and not asked.isdisjoint(part.quantities):
            done = done_tiles(place, old, plan, part)
            left.append(Left(part, np.argwhere(~done), plan.sizes))
    return Job(place, layout, old, plan, tuple(left))


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
    try:
        group = zarr_group(place.open(read_only=True))
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
        return None
    try:
        model_name(xr.Dataset(attrs=dict(group.attrs)))
    except ParameterError as error:
        raise StoreError(f"store: {place.name} cannot be continued: {error}") from error
    plan = read_plan(group)
    if plan is None and any(True for _ in group.members()):
        raise StoreError(
            f"store: {place.name} exists and does not say how it was made, so it cannot be "
            "continued; choose another name, or pass overwrite=True"
        )
    return plan
