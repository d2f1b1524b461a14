"""Derivatives of special points by the other parameters, with labels."""

from __future__ import annotations

from typing import Any

import numpy as np
import xarray as xr

from phasekit.bifurcation.continuation import sensitivity as equilibria
from phasekit.labelled.continuation.special_point import SpecialPoint
from phasekit.labels.arguments import bad

TEXT = np.dtypes.StringDType()


def of_equilibrium(point: SpecialPoint[Any]) -> xr.Dataset:
    """Of a point of a branch of equilibria, or of a curve of their points."""
    return labelled(point, equilibria.sensitivity(point.branch.curve, point.special))


def of_orbit(point: SpecialPoint[Any]) -> xr.Dataset:
    """Of a point of a family of periodic orbits."""
    raise bad("point", point.kind, "a point of a branch of equilibria or of a curve of theirs")


def labelled(point: SpecialPoint[Any], found: equilibria.Sensitivity) -> xr.Dataset:
    """With the names of parameters, states and coefficients, and units."""
    problem = point.branch.problem
    names = list(problem.parameters)
    others = [names[i] for i in found.others]
    form = list(found.form)

    def units(of: Any) -> Any:
        return np.array([problem.unit_of(name) or "" for name in of], dtype=TEXT)

    free, states = list(point.branch.free), list(problem.state)
    coefficients = np.array([found.form[name] for name in form]).reshape(len(form), len(others))
    data: dict[str, Any] = {
        "d_free": (
            ("free", "parameter"), found.free,
            {"long_name": "derivative of the branch's own parameters at the point"},
        ),
        "d_state": (
            ("state", "parameter"), found.x,
            {"long_name": "derivative of the state at the point"},
        ),
        "d_coefficient": (
            ("coefficient", "parameter"), coefficients,
            {"long_name": "derivative of the coefficients of the normal form"},
        ),
        "reason": (
            "parameter", np.array(found.reasons, dtype=TEXT),
            {"long_name": "why a derivative is not known; empty where it is"},
        ),
    }  # fmt: skip
    if found.period is not None:
        words = {"long_name": "derivative of the period of the orbit"}
        data["d_period"] = ("parameter", found.period, words)
    coords = {
        "parameter": np.array(others, dtype=TEXT), "free": np.array(free, dtype=TEXT),
        "state": np.array(states, dtype=TEXT), "coefficient": np.array(form, dtype=TEXT),
        "parameter_units": ("parameter", units(others)), "free_units": ("free", units(free)),
        "state_units": ("state", units(states)),
    }  # fmt: skip
    return xr.Dataset(data, coords, {"kind": point.kind, "label": point.label})
