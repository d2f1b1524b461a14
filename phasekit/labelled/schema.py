"""The schema of labelled results: coordinates, attributes, and reading them back.

Attributes are strings, or int8 arrays for flag values, and hold nothing that changes from run to
run: two identical computations make identical Datasets.
"""

from __future__ import annotations

import functools
import importlib.metadata
from collections.abc import Iterable
from typing import Any

import numpy as np
import xarray as xr

from phasekit.errors import ParameterError
from phasekit.labelled.arguments import describe
from phasekit.labelled.grid import variable
from phasekit.labelled.quantities import LABELS, ROWS, STATES, Quantity
from phasekit.labelled.system import Model, Parameter

SCHEMA_VERSION = "1"

MODEL = "phasekit_model"
SCHEMA = "phasekit_schema"


#: Dtype of label coordinates: variable-length strings, the only ones that zarr v3 stores without a
#: warning. From 2026.9 on xarray reads them back from zarr as they were written; netCDF gives
#: fixed-width ones, which `restore` turns back.
LABEL_DTYPE = np.dtypes.StringDType()


@functools.cache
def versions() -> dict[str, str]:
    """Return the versions of the libraries that made a result, as attributes."""
    from phasekit import __version__

    libraries = {name: importlib.metadata.version(name) for name in ("numpy", "numba", "xarray")}
    return {f"{name}_version": v for name, v in {"phasekit": __version__, **libraries}.items()}


def dataset_attrs(system: Model) -> dict[str, str]:
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


def input_attrs(system: Model, name: str) -> dict[str, str]:
    """Return long_name and units of a parameter's or state's coordinate."""
    for parameter in system.declared:
        if parameter.name == name:
            return {"long_name": parameter.long_name, "units": parameter.units}
    if name in STATES:
        return {"long_name": STATES[name][1], "units": STATES[name][0]}
    return {}


def model_name(ds: Any) -> str:
    """Return the name of the model that made a Dataset.

    Raises
    ------
    ParameterError
        If it was not made by phasekit, or with another version of the schema.
    """
    if not isinstance(ds, xr.Dataset):
        raise ParameterError(f"ds: got {describe(ds)}, wants a Dataset that phasekit made")
    if MODEL not in ds.attrs:
        raise ParameterError(
            f"ds: got a Dataset without the attribute {MODEL!r}, wants one that phasekit made; "
            "operations that drop attributes need keep_attrs=True"
        )
    schema = ds.attrs.get(SCHEMA)
    if not isinstance(schema, str) or schema != SCHEMA_VERSION:
        raise ParameterError(
            f"ds: got schema {schema!r:.80}, wants {SCHEMA_VERSION!r}; "
            "it was made by another version of phasekit: make it anew or read it with that version"
        )
    return str(ds.attrs[MODEL])


def parameter_values(ds: xr.Dataset, declared: Iterable[Parameter]) -> dict[str, Any]:
    """Read a model's parameters from a Dataset: scalars where selected, DataArrays elsewhere.

    Raises
    ------
    ParameterError
        If the coordinate of a parameter that is not optional is gone.
    """
    values: dict[str, Any] = {}
    for parameter in declared:
        name = parameter.name
        if name in ds.variables:
            values[name] = ds[name]
        elif not parameter.optional:
            raise ParameterError(
                f"ds: got no coordinate {name!r}, which the model needs; select cells with .sel or "
                ".isel without drop=True, and keep the scalar coordinates"
            )
    return values


def restore(ds: xr.Dataset) -> xr.Dataset:
    """Give a Dataset that was read from a store the form in which it was written.

    netCDF returns fixed-width labels; zarr returns flag values as lists, and variables in the
    order of the files in a folder.
    """
    coords = {
        dim: variable(map(str, ds[dim].dims), ds[dim].values.astype(LABEL_DTYPE), ds[dim].attrs)
        for dim in LABELS
        if dim in ds.coords and ds[dim].dtype != LABEL_DTYPE and ds[dim].dtype.kind not in "iu"
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
