"""Results as tables for reading: names for codes, units in the head, a row for what is there."""

from __future__ import annotations

import math
import re
from collections import Counter
from collections.abc import Iterator
from typing import TYPE_CHECKING, Any

import numpy as np
import xarray as xr

if TYPE_CHECKING:
    import pandas as pd

#: Codes of what is not there.
_NOTHING = ("absent", "not_computed")
#: Dims along which a row has a column for each label.
_BESIDE = ("state", "eigenvalue_number", "multiplier", "multiplier_number", "unknown")


def table_of(ds: xr.Dataset, dims: frozenset[Any] | None = None) -> pd.DataFrame:
    """Return the variables of a Dataset that share some dims, by default those of most of them.

    Of dims that as many have, the more count; dims without rows come last. What has the states,
    eigenvalues or multipliers beside has a column for each: the states themselves by their names.
    A place that stands under the name of the system's coordinate does not stand as phi again.
    Rows of what is absent are left out.
    """
    import pandas as pd

    ds = _by_coordinate(ds)
    if dims is None:
        exact: Counter[frozenset[Any]] = Counter(
            frozenset(values.dims) for values in ds.data_vars.values()
        )
        own, spread = Counter[frozenset[Any]](), Counter[frozenset[Any]]()
        for values in ds.data_vars.values():
            rows = frozenset(values.dims) - {*_BESIDE}
            own[rows] += 1
            spread[rows] += math.prod(ds.sizes[dim] for dim in values.dims if dim in _BESIDE)
        counts = {one: max(exact[one], own[one]) for one in {*exact, *own}}
        single = counts.pop(frozenset(), 0)
        wide = {one: one & {*_BESIDE} for one in counts}
        ranked = sorted(
            counts,
            key=lambda one: (
                counts[one],
                len(one - wide[one]),
                -len(wide[one]),
                sorted(map(str, one)),
            ),
        )
        # Numbers without dims come first where they are more than what the rows would show.
        place = len(ranked) if not ranked or single > spread[ranked[-1] - {*_BESIDE}] else 0
        ranked.insert(place, frozenset())
        tables = (table_of(ds, one) for one in reversed(ranked))
        first = next(tables, pd.DataFrame())
        return next((one for one in (first, *tables) if len(one)), first)
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
    there = np.zeros(int(np.prod(list(sizes.values()), dtype=int)), bool)
    for name in names:
        there |= _there(columns[_head(name, ds[name])])
    for head, values in _spread_beside(ds, dims):
        columns.setdefault(head, _spread(_words(values), sizes))
        there |= _there(columns[head])
    for name, turn in (("natural_frequency", 1.0), ("eigenvalue", 1j)):
        if name in ds and not columns.keys() & {"period", "period (s)"}:
            columns |= _small_period(ds[name], dims, sizes, turn)
    return pd.DataFrame(columns, index)[there] if columns else pd.DataFrame()


def _by_coordinate(ds: xr.Dataset) -> xr.Dataset:
    """The Dataset with places called phi under the name that the coordinate has, and no more."""
    renamed = {}
    for name, values in ds.variables.items():
        parts = re.fullmatch(r"(|.*_)(d*)phi(|_.*)", str(name))
        form = re.compile(rf"{parts[1]}{parts[2]}(\w+){parts[3]}") if parts else None
        for other, one in ds.coords.items() if form else ():
            fits = form.fullmatch(str(other)) if form and other != name else None
            if fits and one.variable.identical(values):
                renamed[name], coordinate = other, fits[1]
                break
    if not renamed:
        return ds
    beside = {
        name: re.sub(r"phi(?=(_\w+)?_error$)", coordinate, str(name)) for name in ds.data_vars
    }
    beside = {name: new for name, new in beside.items() if new != name and new not in ds}
    places = {name: new for name, new in renamed.items() if name in ds.data_vars}
    kept = ds.drop_vars([*renamed, *places.values()])
    order = [places.get(name, beside.get(name, name)) for name in ds.data_vars]
    moved = {new: ds[name].variable for name, new in {**places, **beside}.items()}
    return kept.drop_vars(list(beside)).assign(moved)[order]


def _spread_beside(ds: xr.Dataset, dims: frozenset[Any]) -> Iterator[tuple[str, xr.DataArray]]:
    """The columns of what has one dim more than a row, one of `_BESIDE`."""
    numbers = [dim for dim in _BESIDE if dim in ds.coords and ds[dim].dtype.kind in "fc"]
    for name in (*ds.data_vars, *numbers):
        values = ds[name]
        for dim in frozenset(values.dims) - dims:
            if dim in _BESIDE and frozenset(values.dims) == dims | {dim} != dims:
                own = dim in ds.coords and ds[dim].dtype.kind not in "iufc"
                labels = ds[dim].values if own else range(1, ds.sizes[dim] + 1)
                for place, label in enumerate(labels):
                    states = name == "x" and dim == "state"
                    head = str(label) if states else f"{name} {label}"
                    yield head, values.isel({dim: place}, drop=True)


def _small_period(
    values: xr.DataArray, dims: frozenset[Any], sizes: dict[Any, int], turn: complex
) -> dict[str, Any]:
    """The period of small oscillations: of centers, and of the slowest decay that turns."""
    rates = values.variable
    more = [dim for dim in rates.dims if dim not in dims]
    if not dims.issubset(rates.dims) or len(more) > 1:
        return {}
    speed = np.abs(np.imag(rates.values)) if turn == 1j else rates.values
    if more:
        axis = rates.dims.index(more[0])
        real = np.where(speed > 0, np.real(rates.values), -np.inf)
        slowest = np.expand_dims(np.argmax(real, axis=axis), axis)
        speed = np.take_along_axis(speed, slowest, axis).squeeze(axis)
    kept = tuple(dim for dim in rates.dims if dim not in more)
    with np.errstate(all="ignore"):
        period = 2 * np.pi / speed
    period = np.where(np.isfinite(period), period, np.nan)
    if not np.isfinite(period).any():
        return {}
    units = "" if values.attrs.get("units", "1") in ("", "1") else " (s)"
    return {f"small_period{units}": _spread(xr.Variable(kept, period), sizes)}


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
    return values if values.dtype.kind in "biufcM" else values.astype(object)


def _there(column: Any) -> Any:
    if column.dtype.kind in "fc":
        return ~np.isnan(column)
    if column.dtype == object:
        return ~np.isin(column.astype(str), _NOTHING)
    return np.zeros(column.shape, bool) if column.dtype.kind == "b" else np.ones(column.shape, bool)
