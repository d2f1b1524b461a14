"""What a stored map is, how complete, and how large."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from math import prod
from typing import Any

import xarray as xr

from phasekit.cells.request import ask
from phasekit.errors import StoreError
from phasekit.labelled.accessor import PhasekitAccessor
from phasekit.labels.coordinates import STATES
from phasekit.maps import files
from phasekit.maps.described import described
from phasekit.maps.estimate import Estimate
from phasekit.maps.job import Job
from phasekit.maps.keys import SEAL
from phasekit.maps.left import Left
from phasekit.maps.marks import marks_of
from phasekit.maps.netcdf import has_digest
from phasekit.maps.place import Place, place_of
from phasekit.maps.plan import Plan
from phasekit.maps.stored_arrays import read_plan, zarr_group
from phasekit.maps.unfinished import COMPUTED, read_far
from phasekit.maps.whole import open_map
from phasekit.numerics.memory import human
from phasekit.systems.identity import SCHEMA


@dataclass(frozen=True)
class MapInfo:
    """A stored map in numbers; printed, in lines."""

    name: str
    ds: xr.Dataset
    plan: Plan | None  # None for maps that were written in one go
    done: dict[str, tuple[int, int]]  # tiles that are done and all tiles, by part
    size: int | None  # bytes on the disk
    left: Estimate | None  # None where nothing is left
    checked: bool = False  # whether a map that was written in one go has checksums
    units: Mapping[str, str] = field(default_factory=dict)  # in which inputs are shown

    @property
    def complete(self) -> bool:
        """Whether all is computed."""
        return bool(self.ds.variables) and COMPUTED not in self.ds

    @property
    def verdict(self) -> str:
        """What is known of a map in which no damage was found."""
        without = "all files can be read; they have no checksums"
        if self.plan is None:
            if not self.checked:
                raise StoreError(
                    f"store: {self.name} cannot be verified: {without}; compute it again with this "
                    "version of phasekit"
                )
            return "verified: the arrays are as they were written"
        if not self.ds.variables:
            return "nothing is stored yet that could be verified"
        if not any(part.checked for part in self.plan.parts):
            return f"verified: {without}"
        some = [name for part in self.plan.parts if not part.checked for name in part.quantities]
        tiles = sum(self.done[part.name][0] for part in self.plan.parts if part.checked)
        more = f"; of {', '.join(some)} {without}" if some else ""
        more += "" if self.plan.root else "; zarr.json, of earlier versions, has no checksum"
        return f"verified: {tiles:,} tiles are as they were written{more}"

    def __str__(self) -> str:
        """Write it in lines."""
        return "\n".join(self._lines())

    def _lines(self) -> list[str]:
        from phasekit.numerics.launch import cpus

        ds = self.ds
        model = str(ds.attrs["phasekit_model"])
        made = f"phasekit {ds.attrs.get('phasekit_version', '?')}, schema {ds.attrs[SCHEMA]}"
        lines = [f"{self.name}: map of {model}, made by {made}"]
        if not ds.variables and self.plan:
            axes = ", ".join(f"{dim} {n}" for dim, n in self.plan.sizes.items())
            lines.append(f"axes: {axes}")
            lines.append(
                "its arrays are being made, or that was interrupted: nothing is computed yet; the "
                "same call of sweep begins again"
            )
            return lines
        lines += described(ds, self.units)
        for part in self.plan.parts if self.plan else ():
            done, tiles = self.done[part.name]
            chunks = " x ".join(f"{d} {n}" for d, n in zip(part.dims, part.chunks, strict=True))
            share = f"{done} of {tiles} tiles are done, {100 * done / tiles:.3g} %"
            names = list(part.quantities)
            shown = ", ".join(names[:3]) + (f" and {len(names) - 3} more" if names[3:] else "")
            lines.append(f"chunks of {chunks or 'one cell'} ({shown}): {share}")
        raw = sum(v.nbytes for n, v in ds.data_vars.items() if n != COMPUTED)
        size = "" if self.size is None else f"{human(self.size)} on the disk, "
        lines.append(f"size: {size}{human(raw)} before compression when complete")
        if self.left is not None:
            lines.append(f"left: {self.left.cells:,} cells, {self.left.describe(cpus())}")
        return lines


def map_info(store: Any, *, verify: bool = False) -> MapInfo:
    """Return what a stored map is; cells that are left are estimated from samples."""
    place = place_of(store)
    if (empty := _without_arrays(place)) is not None:
        return empty
    with open_map(store, verify=verify) as ds:
        size = place.size() if not place.is_netcdf else None
        if place.path is not None and place.path.is_file():
            size = place.path.stat().st_size
            return MapInfo(place.name, ds, None, {}, size, None, has_digest(place.path))
        source = place.open(read_only=True)
        plan = read_plan(source)
        if plan is None:
            sealed = files.read(source, SEAL) is not None
            return MapInfo(place.name, ds, None, {}, size, None, sealed)
        done, left = {}, []
        values = {name: ds[name].variable for name in (*plan.arrays, *plan.scalars)}
        finished = read_far(source, plan) is not None
        for part in plan.parts:
            if finished:
                tiles = prod(part.grid(plan.sizes))
                done[part.name] = tiles, tiles
                continue
            one = Left(plan, part, marks_of(source, plan, part, values))
            tiles = prod(one.grid)
            done[part.name] = tiles - len(one), tiles
            if len(one):
                left.append(one)
        estimate = _job(place, ds, plan, left).estimate() if left else None
        return MapInfo(place.name, ds, plan, done, size, estimate)


def _without_arrays(place: Place) -> MapInfo | None:
    """Return what is known of a map whose arrays are not made yet; None of all others."""
    if place.is_netcdf or place.empty:
        return None
    try:
        source = place.open(read_only=True)
        plan = read_plan(source)
        if plan is None or not plan.model or (plan.parts and (plan.ready or plan.before)):
            return None
        attrs = dict(zarr_group(source).attrs)
        return MapInfo(place.name, xr.Dataset(attrs=attrs), plan, {}, place.size(), None)
    except Exception:  # whatever is there, opening it says more
        return None


def _job(place: Place, ds: xr.Dataset, plan: Plan, left: list[Left]) -> Job:
    """Return the job that would finish a map: all that it takes is in the store."""
    system = PhasekitAccessor(ds).system()
    rows = [row for one in left for row in one.part.rows]
    states = {name: ds[name] for name in STATES if name in ds.coords}
    values = {name: float(x) if not x.dims else x.load() for name, x in states.items()}
    request = ask(system, rows, states=values, order=list(plan.sizes))
    return Job(place, request, plan, plan, tuple(left))
