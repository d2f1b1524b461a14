"""What a map holds and how complete it is, in lines."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
import xarray as xr

from phasekit.labels.conversion import in_units
from phasekit.maps.unfinished import COMPUTED


def described(ds: xr.Dataset, units: Mapping[str, str] | None = None) -> list[str]:
    """Return what is fixed, the axes with their units, and the quantities of a map, in lines."""
    inputs = {
        name: coord.variable for name, coord in ds.coords.items() if coord.dtype.kind in "fiu"
    }
    given = in_units(xr.Dataset(coords=inputs), units or {}).coords
    lines = []
    fixed = [
        f"{name} = {coord.item():.6g}{_unit(coord)}"
        for name, coord in given.items()
        if not coord.dims
    ]
    if fixed:
        lines.append(f"fixed: {', '.join(sorted(fixed))}")
    lines += [f"axis {_axis(str(name), coord)}" for name, coord in given.items() if coord.dims]
    lines.append("quantities:")
    width = max((len(str(name)) for name in ds.data_vars), default=0)
    for name, variable in ds.data_vars.items():
        if name != COMPUTED:
            dims = " x ".join(map(str, variable.dims)) or "one value"
            lines.append(f"  {name!s:<{width}}  {variable.dtype.name:<8} {dims}")
    return lines


def completeness(ds: xr.Dataset) -> str:
    """Say how many cells of a map are computed; nothing is read for it that is not in memory."""
    if COMPUTED not in ds:
        return "all cells are computed"
    computed = ds[COMPUTED]
    if not computed.variable._in_memory:
        return f"not all cells are computed: {COMPUTED!r} says which"
    done = int(np.count_nonzero(computed.values))
    return f"{done:,} of {computed.size:,} cells are computed: {COMPUTED!r} says which"


def _axis(name: str, coord: xr.DataArray) -> str:
    values = coord.values
    dims = "" if coord.dims == (name,) else f" along {' x '.join(map(str, coord.dims))}"
    ends = f", {values.flat[0]:.6g} to {values.flat[-1]:.6g}" if values.size else ""
    return f"{name}: {values.size} values{dims}{ends}{_unit(coord)}"


def _unit(coord: xr.DataArray) -> str:
    units = coord.attrs.get("units", "1")
    return "" if units == "1" else f" {units}"
