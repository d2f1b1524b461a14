"""Cells whose parameters are not legal: how many there are, why, and the way out."""

from __future__ import annotations

import warnings

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from phasekit.errors import InvalidCellsWarning
from phasekit.labels.arguments import FloatArray, describe
from phasekit.systems.parameter import Parameter
from phasekit.systems.system import Model

#: Share of the cells from which on it is said: maps may touch what is not legal at their edges.
MANY = 0.1


def warn_of_invalid(system: Model, stacklevel: int = 2) -> None:
    """Warn of many cells that stay empty, once a call; of lazy parameters none are looked at.

    Parameters
    ----------
    system : Model
        Its array parameters span the cells.
    stacklevel : int
        As `warnings.warn` has it, counted from the caller.
    """
    valid: list[xr.Variable] = []
    reasons = []
    for parameter in system.declared:
        value = system.parameters.get(parameter.name)
        if not isinstance(value, (np.ndarray, xr.DataArray)) or getattr(value, "chunks", None):
            continue
        inside = parameter.valid(np.asarray(value))
        if inside.all():
            continue
        dims = value.dims if isinstance(value, xr.DataArray) else (parameter.name,)
        valid.append(xr.Variable(dims, inside))
        reasons.append(_reason(parameter, np.asarray(value), inside))
    if not reasons:
        return
    share = _share_inside(valid)
    if share <= 1.0 - MANY:
        text = f"{100.0 * (1.0 - share):.3g} % of the cells are empty: {'; '.join(reasons)}"
        warnings.warn(text, InvalidCellsWarning, stacklevel=stacklevel + 1)


def _reason(parameter: Parameter, value: FloatArray, inside: NDArray[np.bool_]) -> str:
    example = value[~inside].flat[0]
    text = (
        f"{parameter.name}: {np.count_nonzero(~inside)} of {inside.size} values are not legal, "
        f"such as {describe(example)}; wants {parameter.wants}"
    )
    with np.errstate(all="ignore"):
        in_degrees = parameter.units == "rad" and parameter.valid(value * np.pi / 180.0).all()
    return f"{text}; if they are in degrees: {parameter.name} * pk.deg" if in_degrees else text


def _share_inside(valid: list[xr.Variable]) -> float:
    """Return the share of cells that are valid in all; dims that are shared count once."""
    share = 1.0
    while valid:
        joint = valid.pop()
        while near := [other for other in valid if set(other.dims) & set(joint.dims)]:
            valid = [other for other in valid if not any(other is one for one in near)]
            for other in near:
                joint = joint & other
        share *= float(joint.mean())
    return share
