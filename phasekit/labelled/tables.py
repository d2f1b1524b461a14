"""Results as tables for reading: names for codes, units in the head, a row for what is there."""

from __future__ import annotations

from collections import Counter
from typing import TYPE_CHECKING, Any

import numpy as np
import xarray as xr

if TYPE_CHECKING:
    import pandas as pd

#: Codes of what is not there.
_NOTHING = ("absent", "not_computed")


def table_of(ds: xr.Dataset) -> pd.DataFrame:
    """Return the variables of a Dataset that share the dims which most of them have.

    Of dims that as many have, the more count. What has the states beside has a column for each:
    the states themselves by their names. Rows of what is absent are left out.
    """
    import pandas as pd

    counts = Counter(frozenset(values.dims) for values in ds.data_vars.values())
    dims = max(counts, key=lambda dims: (counts[dims], len(dims)), default=frozenset())
    order = [dim for dim in ds.sizes if dim in dims]
    names = [name for name in ds.data_vars if frozenset(ds[name].dims) == dims]
    beside = [
        name for name, coord in ds.coords.items()
        if name not in ds.dims and coord.dims and dims.issuperset(coord.dims)
    ]  # fmt: skip
    index = None
    if order:
        labels = [_plain(ds.coords[dim].values) if dim in ds.coords else range(ds.sizes[dim])
                  for dim in order]  # fmt: skip
        heads = [_head(dim, ds.coords.get(dim)) for dim in order]
        index = pd.MultiIndex.from_product(labels, names=heads)
        index = index.get_level_values(0) if len(order) == 1 else index
    sizes = {dim: ds.sizes[dim] for dim in order}
    columns = {
        _head(name, ds[name]): _spread(_words(ds[name]), sizes) for name in [*beside, *names]
    }
    for name in ds.data_vars:
        if "state" in ds.coords and frozenset(ds[name].dims) == dims | {"state"} != dims:
            for state in ds.coords["state"].values:
                head = str(state) if name == "x" else f"{name} {state}"
                columns.setdefault(head, _spread(_words(ds[name].sel(state=state)), sizes))
    there = np.zeros(int(np.prod(list(sizes.values()), dtype=int)), bool)
    for name in names:
        there |= _there(columns[_head(name, ds[name])])
    return pd.DataFrame(columns, index)[there] if columns else pd.DataFrame()


def _head(name: Any, values: xr.DataArray | None) -> str:
    units = "1" if values is None else str(values.attrs.get("units", "1"))
    return str(name) if units in ("", "1") else f"{name} ({units})"


def _words(values: xr.DataArray) -> xr.Variable:
    """Codes by their names."""
    variable: xr.Variable = values.variable
    if "flag_meanings" not in values.attrs or "flag_values" not in values.attrs:
        return xr.Variable(variable.dims, _plain(variable.values))
    meanings = str(values.attrs["flag_meanings"]).split()
    codes = np.atleast_1d(values.attrs["flag_values"]).tolist()
    known = dict(zip(codes, meanings, strict=False))
    words = [known.get(code, str(code)) for code in variable.values.ravel().tolist()]
    return xr.Variable(variable.dims, np.array(words, object).reshape(variable.shape))


def _spread(values: xr.Variable, sizes: dict[Any, int]) -> Any:
    whole: xr.Variable = values.set_dims(sizes)  # type: ignore[no-untyped-call]
    return whole.transpose(*sizes).values.ravel()


def _plain(values: Any) -> Any:
    """Strings as objects, which every pandas takes."""
    return values if values.dtype.kind in "biufM" else values.astype(object)


def _there(column: Any) -> Any:
    if column.dtype.kind == "f":
        return ~np.isnan(column)
    if column.dtype == object:
        return ~np.isin(column.astype(str), _NOTHING)
    return np.zeros(column.shape, bool) if column.dtype.kind == "b" else np.ones(column.shape, bool)
