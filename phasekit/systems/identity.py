"""What a Dataset says of the system that made it: its model, and the values of its parameters."""

from __future__ import annotations

import functools
import importlib.metadata
from collections.abc import Iterable
from typing import Any

import xarray as xr

from phasekit.errors import ParameterError
from phasekit.labels.arguments import describe
from phasekit.labels.conversion import in_si
from phasekit.systems.parameter import Parameter
from phasekit.version import __version__

SCHEMA_VERSION = "1"

MODEL = "phasekit_model"
SCHEMA = "phasekit_schema"


@functools.cache
def versions() -> dict[str, str]:
    """Return the versions of the libraries that made a result, as attributes."""
    libraries = {name: importlib.metadata.version(name) for name in ("numpy", "llvmlite", "xarray")}
    return {f"{name}_version": v for name, v in {"phasekit": __version__, **libraries}.items()}


def model_name(ds: Any) -> str:
    """Return the name of the model that made a Dataset."""
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
            "it was made by another version of phasekit: compute it again or read it with that "
            "version"
        )
    return str(ds.attrs[MODEL])


def parameter_values(ds: xr.Dataset, declared: Iterable[Parameter]) -> dict[str, Any]:
    """Read a model's parameters from a Dataset: scalars where selected, DataArrays elsewhere."""
    ds = in_si(ds)
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


def refuse_another(ds: Any, name: str) -> None:
    """Raise a `ParameterError` if a Dataset was not made by the model of a name."""
    made = model_name(ds)
    if made != name:
        raise ParameterError(
            f"ds: got a map of {made}, wants one of {name}; "
            f"use ds.phasekit.system() or {made}.from_dataset(ds)"
        )
