"""States of fields as arrays over their places, instead of one variable for each of them."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
import xarray as xr

from phasekit.arrays import Array
from phasekit.labels.arguments import bad
from phasekit.systems.problem import Problem

#: What stands before and after the name of a state in the names of variables.
BEFORE = ("", "motion_", "state_", "event_", "special_")
WHICH = {"_min": "least", "_max": "largest", "_mean": "mean"}
AFTER = ("", "_min", "_max", "_mean", "_from", "_to")


def gathered(problem: Any, ds: xr.Dataset) -> xr.Dataset:
    """A Dataset with arrays over places, where it has a variable for each state of a field."""
    blocks = getattr(problem, "blocks", ())
    if not blocks:
        return ds
    found: dict[str, xr.Variable] = {}
    held: list[str] = []  # coordinates
    gone: list[str] = []
    for block in blocks:
        for before, after in ((b, a) for b in BEFORE for a in AFTER):
            names = [f"{before}{state}{after}" for state in block.states]
            if names[0] not in ds.variables or names[-1] not in ds.variables:
                continue
            parts = [ds.variables[name] for name in names]
            widest = max(parts, key=lambda one: one.ndim)
            dims, shape = widest.dims, widest.shape
            each = [np.broadcast_to(one.values, shape) for one in parts]
            name = f"{before}{block.name}{after}"
            values = np.stack(each, axis=-1).reshape(*shape, *block.shape)
            attrs = _attrs(problem, block, parts[0].attrs, before, after)
            found[name] = xr.Variable((*dims, *block.dims), values, attrs)
            held += [name] if names[0] in ds.coords else []
            gone += names
    coords = {name: one for name, one in problem.coords.items() if name not in ds.coords}
    made = ds.drop_vars(gone).assign({k: v for k, v in found.items() if k not in held})
    return made.assign_coords({**coords, **{k: found[k] for k in held}})


def _attrs(problem: Any, block: Any, own: Mapping[str, Any], before: str, after: str) -> Any:
    """What the first of the states says, of the field."""
    words = problem.words.get(block.name, {})
    attrs = {
        key: value.replace(block.states[0], block.name) if isinstance(value, str) else value
        for key, value in own.items() if key != "equation"
    }  # fmt: skip
    if "units" in words:
        attrs["units"] = words["units"]
    if not before and "long_name" in words:
        attrs["long_name"] = f"{WHICH.get(after, '')} {words['long_name']}".strip()
    return attrs


def by_state(problem: Any, given: Any, argument: str = "x0") -> Any:
    """A value for each state, where fields by name are given; else what is given."""
    blocks = {block.name: block for block in getattr(problem, "blocks", ())}
    if not blocks or not isinstance(given, Mapping | xr.Dataset):
        return given
    if not set(map(str, given)) & set(blocks):
        return given
    if set(map(str, given)) != set(blocks):
        raise bad(argument, list(map(str, given)), f"a value for each of {', '.join(blocks)}")
    found: dict[str, Any] = {}
    for name, block in blocks.items():
        value = given[name]
        wants = f"a number, or an array over {block.dims} of shape {block.shape}"
        if isinstance(value, xr.DataArray):
            own = problem.words.get(name, {}).get("units", "1")
            value = value.drop_attrs() if value.attrs.get("units", own) == own else value
        if isinstance(value, xr.DataArray) and set(block.dims) <= set(value.dims):
            shape = tuple(value.sizes[dim] for dim in block.dims)
            if shape == block.shape:
                flat = value.stack(_place=block.dims)
                found |= {
                    state: flat.isel(_place=i, drop=True) for i, state in enumerate(block.states)
                }
                continue
        if isinstance(value, xr.DataArray) and not set(block.dims) & set(value.dims):
            found |= dict.fromkeys(block.states, value)
            continue
        array = np.asarray(value)
        if array.size not in (1, block.size) or array.shape not in ((), (block.size,), block.shape):
            raise bad(f"{argument}[{name!r}]", f"shape {array.shape}", wants)
        full = np.broadcast_to(array.ravel() if array.ndim else array, (block.size,))
        found |= dict(zip(block.states, full.tolist(), strict=True))
    return found


def states_over_time(problem: Problem, ds: xr.Dataset, before: str = "") -> Array:
    """The states in a Dataset, a column each, over its times."""
    names = [(block.name, block.dims) for block in problem.blocks]
    if not all(f"{before}{name}" in ds for name, _ in names) or not names:
        names = [(state, ()) for state in problem.state]
    missing = [name for name, _ in names if f"{before}{name}" not in ds]
    if missing:
        raise bad("orbit", list(map(str, ds.data_vars)), f"the states {', '.join(missing)} too")
    columns = []
    for name, dims in names:
        array = ds.variables[f"{before}{name}"]
        over = tuple(dim for dim in array.dims if dim not in dims)
        values = array.transpose(*over, *dims).values.astype(float)
        columns.append(values.reshape(*values.shape[: len(over)], -1))
    return np.concatenate(columns, axis=-1)


def fields_of(problem: Problem, x: Array) -> dict[str, xr.DataArray]:
    """Fields by name, of states at points (rows)."""
    found, first = {}, 0
    for block in problem.blocks:
        values = x[:, first : first + block.size].reshape(len(x), *block.shape)
        coords = {dim: problem.coords[dim] for dim in block.dims if dim in problem.coords}
        attrs = dict(problem.words.get(block.name, {}))
        found[block.name] = xr.DataArray(values, coords, ("point", *block.dims), attrs=attrs)
        first += block.size
    return found
