"""The schema of labelled results: coordinates, attributes, and reading them back.

Attributes are strings, or int8 arrays for flag values, and hold nothing that changes from run to
run: two identical computations make identical Datasets.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping
from typing import Any

import numpy as np
import xarray as xr

from phasekit.labels.coordinates import LABELS, STATES
from phasekit.labels.grid import LABEL_DTYPE, variable
from phasekit.laws.ladder import Map
from phasekit.systems.identity import MODEL, SCHEMA, SCHEMA_VERSION, versions
from phasekit.systems.system import System
from phasekit.table.quantities import ROWS
from phasekit.table.row import Quantity

#: States that are places and rates.
PLACES = ("state_phi", "state_dphi")


def dataset_attrs(system: System) -> dict[str, str]:
    """Return the attributes of a Dataset: model, schema and versions."""
    return {
        MODEL: type(system).__name__,
        **system.definition,
        SCHEMA: SCHEMA_VERSION,
        **versions(),
    }


def label_coords(rows: Iterable[Quantity]) -> dict[str, xr.Variable]:
    """Return the label coordinates of the rows' dims: names, or numbers."""
    coords = {}
    for row in rows:
        for dim in row.dims:
            labels, long_name = row.labels_of(dim)
            dtype: Any = LABEL_DTYPE if any(isinstance(x, str) for x in labels) else np.int64
            coords[dim] = variable((dim,), np.array(labels, dtype), {"long_name": long_name})
    return coords


def input_attrs(system: System, name: str) -> dict[str, str]:
    """Return long_name and units of a parameter's or state's coordinate."""
    for parameter in system.declared:
        if parameter.name == name:
            return {"long_name": parameter.long_name, "units": parameter.units}
    own = name.removeprefix("state_")
    law = system.own_equations
    if law is not None and own != name and own in law.states:
        return {"long_name": f"{own} at the start", "units": law.units.get(own, "1")}
    if name == "time" and system.rung is Map:
        return {"long_name": "number of iterations", "units": "1"}
    if name not in STATES:
        return {}
    units, words = STATES[name]
    if name == "time":
        unit = system.unit_of(name)
        return {"long_name": words, **({"units": unit} if unit else {})}
    if name in PLACES and system.unit_of(name) is None:  # of a coordinate of any kind
        return {"long_name": words.replace("angular ", "").replace("angle", "coordinate")}
    return {"long_name": words, "units": system.own_units.get(name, units)}


#: Places and rates, which a system that names its coordinate calls by that name; not their errors.
_PLACE = re.compile(r"(?<![^\W_])(d*)phi(?![^\W_])(?!\w*_(?:error|kind)$)")


def own_names(coordinate: str, variables: Mapping[str, xr.Variable]) -> dict[str, xr.Variable]:
    """Return places under the name that the coordinate has, where that is not phi.

    The same numbers, as coordinates: ``x`` beside ``phi``, ``motion_dx`` beside ``motion_dphi``.
    """
    if coordinate == "phi":
        return {}
    named = {
        _PLACE.sub(rf"\g<1>{coordinate}", name): one
        for name, one in variables.items()
        if _PLACE.search(name)
    }
    taken = {dim for one in variables.values() for dim in one.dims} | variables.keys()
    return {name: one.copy(deep=False) for name, one in named.items() if name not in taken}


def restore(ds: xr.Dataset) -> xr.Dataset:
    """Give a Dataset that was read from a store the form in which it was written.

    Texts are read as NumPy's own strings, of netCDF in fixed width, too; zarr returns flag values
    as lists, and variables in the order of the files in a folder.
    """
    coords = {
        name: variable(map(str, one.dims), one.values.astype(LABEL_DTYPE), one.attrs)
        for name, one in ds.coords.items()
        if one.dtype.kind == "T" or (one.dtype.kind == "U" and name in LABELS)
    }
    known = [name for name in ROWS if name in ds.data_vars]
    ordered = ds[known + [name for name in ds.data_vars if name not in known]]
    # With those on which no variable depends, which a selection drops.
    ds = ordered.assign_coords({**ds.coords, **coords})
    for name in ds.data_vars:
        flags = ROWS[str(name)].flags if str(name) in ROWS else None
        if flags is not None and "flag_values" in ds[name].attrs:
            ds[name].attrs["flag_values"] = np.asarray(ds[name].attrs["flag_values"], np.int8)
    return ds
