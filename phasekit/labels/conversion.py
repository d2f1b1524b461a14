"""Datasets in the units that people ask for, and back to SI units and radians.

The attribute ``units`` of a variable says in which unit its numbers are. Everything that takes a
Dataset back reads it, so that degrees are never taken for radians.
"""

from __future__ import annotations

import difflib
from collections.abc import Hashable, Mapping
from typing import Any

import xarray as xr

from phasekit.labels.arguments import bad, unknown, variable_in_si
from phasekit.labels.units import UNITS, converted, si_unit, usual


def in_units(ds: xr.Dataset, units: Mapping[Any, Any]) -> xr.Dataset:
    """Return a Dataset with some variables and coordinates in other units.

    A stacked axis loses its index where one of its levels is converted.
    """
    changed = {}
    for name, unit in units.items():
        if name not in ds.variables:
            raise unknown("variable or coordinate", name, map(str, ds.variables))
        changed[name] = _in_unit(str(name), ds.variables[name], unit)
    return _replaced(ds, changed)


def in_si(ds: xr.Dataset) -> xr.Dataset:
    """Return a Dataset in SI units and radians; itself where nothing is in other units."""
    changed = {
        name: si
        for name, variable in ds.variables.items()
        if (si := variable_in_si(str(name), variable)) is not variable
    }
    return _replaced(ds, changed) if changed else ds


def _in_unit(name: str, variable: xr.Variable, unit: Any) -> xr.Variable:
    held = variable.attrs.get("units")
    if not isinstance(unit, str):
        raise bad(name, unit, "the name of a unit, such as 'deg', 'rpm' or 'mm'")
    if held is None:
        raise bad(
            name, unit, "a variable whose unit is known",
            f"it has no attribute units: ds[{name!r}].attrs['units'] = ...",
        )  # fmt: skip
    if variable.dtype.kind not in "iuf":
        raise bad(name, unit, f"a variable of numbers; it has the dtype {variable.dtype}")
    if usual(unit) == usual(str(held)):
        return variable
    base = si_unit(held) or str(held)
    _refuse_unfit(name, unit, base)
    data = converted(name, variable_in_si(name, variable).data, base, unit)
    return xr.Variable(variable.dims, data, {**variable.attrs, "units": usual(unit)})


def _refuse_unfit(name: str, unit: str, base: str) -> None:
    """Raise a `ParameterError` if a unit is not one of what has the unit `base`."""
    fits = list(dict.fromkeys([base, *UNITS.get(base, {})]))
    if usual(unit) not in fits:
        near = difflib.get_close_matches(unit, fits, n=1, cutoff=0.5)
        known = si_unit(unit)
        hint = f"did you mean {near[0]!r}?" if near else ""
        if known is not None:
            hint = f"{name} is in {base}, which {unit!r} does not measure"
        raise bad(f"unit of {name}", unit, " or ".join(map(repr, fits)), hint)


def _replaced(ds: xr.Dataset, changed: Mapping[Hashable, xr.Variable]) -> xr.Dataset:
    stacked = [dim for dim in ds.dims if len(ds.xindexes.get_all_coords(dim, "ignore")) > 1]
    levels = {dim for dim in stacked for name in ds.xindexes.get_all_coords(dim) if name in changed}
    ds = ds.reset_index(list(levels)) if levels else ds
    coords = {name: variable for name, variable in changed.items() if name in ds.coords}
    data = {name: variable for name, variable in changed.items() if name not in ds.coords}
    new = ds.assign_coords(coords).assign(data)
    # xarray puts what was replaced at the end.
    order = {name: new.coords[name].variable for name in ds.coords}
    kept = xr.Coordinates(order, indexes=dict(new.xindexes))
    return xr.Dataset({name: new[name].variable for name in ds.data_vars}, kept, ds.attrs)
