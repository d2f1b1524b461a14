"""What an argument may be, and the messages for what it may not.

Every message says which argument, what it got, what it wants, and what to do next. Model
parameters and states share `numeric`; a parameter's own domain is checked where it is declared
(`phasekit.labelled.system`).
"""

from __future__ import annotations

import difflib
import numbers
from collections.abc import Iterable, Mapping, Sequence
from typing import Any, TypeAlias

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from phasekit.errors import ParameterError

FloatArray: TypeAlias = NDArray[np.float64]
#: What a user may pass for a number: a scalar, a 1-D list or array, or a DataArray.
NumberLike: TypeAlias = float | Sequence[float] | NDArray[Any] | xr.DataArray
#: What is kept of it: a float, a read-only 1-D array, or a DataArray of float64.
Value: TypeAlias = float | FloatArray | xr.DataArray

#: Largest number of elements that a description or a representation writes out.
SHOWN = 5


def describe(value: object) -> str:
    """Say what a value is, on one line.

    >>> describe(30), describe([[1, 2], [3, 4]]), describe(None)
    ('30', 'a 2-D list of shape (2, 2)', 'None')
    """
    if isinstance(value, (np.ndarray, xr.DataArray)) and value.ndim == 0:
        value = value.item()
    if isinstance(value, xr.DataArray):
        return f"a DataArray with dims {tuple(value.dims)} and dtype {value.dtype}"
    if isinstance(value, (list, tuple, range, np.ndarray)) and np.ndim(_plain(value)) > 0:
        array = _plain(value)
        if array.ndim == 1 and array.size <= SHOWN:
            return repr(tuple(array.tolist()) if isinstance(value, tuple) else array.tolist())
        kind = "array" if isinstance(value, np.ndarray) else type(value).__name__
        return f"a {array.ndim}-D {kind} of shape {array.shape}"
    if isinstance(value, np.generic):
        value = value.item()
    if isinstance(value, int) and value.bit_length() > 1024:  # repr refuses thousands of digits
        return f"a whole number of {value.bit_length()} bits"
    text = repr(value)
    if isinstance(value, (numbers.Number, str, type(None), tuple, list)) and len(text) <= 60:
        return text
    name = value.__name__ if isinstance(value, type) else type(value).__name__
    return f"the class {name}" if isinstance(value, type) else f"an object of type {name}"


def _plain(value: Any) -> NDArray[Any]:
    try:
        return np.asarray(value)
    except ValueError:  # ragged
        return np.asarray(value, dtype=object)


def bad(argument: str, got: object, wants: str, hint: str = "") -> ParameterError:
    """Return the error for an unusable argument; the caller raises it."""
    text = f"{argument}: got {describe(got)}, wants {wants}"
    return ParameterError(f"{text}; {hint}" if hint else text)


def unknown(what: str, name: object, valid: Iterable[str]) -> ParameterError:
    """Return the error for a name that is not one of `valid`, with the nearest of them.

    >>> print(unknown("axis", "bata", ["beta", "e"]))
    axis 'bata' is unknown; did you mean 'beta'? Valid are: beta, e
    """
    names = list(dict.fromkeys(valid))
    text = f"{what} {name!r} is unknown"
    near = difflib.get_close_matches(name, names, n=1) if isinstance(name, str) else []
    text += f"; did you mean {near[0]!r}? Valid are: " if near else "; valid are: "
    return ParameterError(text + ", ".join(names))


def flag(argument: str, value: object) -> None:
    """Raise a `ParameterError` unless `value` is True or False."""
    if not isinstance(value, (bool, np.bool_)):
        raise bad(argument, value, "True or False")


def one_of(argument: str, value: object, names: Sequence[str]) -> int:
    """Return the place of a name among those that an argument may take.

    >>> one_of("side", "right", ("left", "right"))
    1
    """
    if not isinstance(value, str) or value not in names:
        raise bad(argument, value, f"one of {', '.join(names)}")
    return list(names).index(value)


def numeric(argument: str, value: Any) -> Value:
    """Return `value` as a float, a read-only 1-D float64 array or a float64 DataArray.

    Parameters
    ----------
    argument : str
        Name used in messages.
    value : float, 1-D array_like or xarray.DataArray
        Real numbers. Bools, strings, None, complex numbers, bare arrays of two and more
        dimensions and empty arrays are refused. A scalar must be finite; an array may hold
        NaN and infinity, which become invalid cells.

    Raises
    ------
    ParameterError
    """
    wants = "a real number, a 1-D list or array of them, or a DataArray"
    if isinstance(value, xr.DataArray):
        return _data_array(argument, value, wants)
    if isinstance(value, np.ma.MaskedArray) and value.dtype.kind in "iuf":
        value = np.ma.filled(value.astype(np.float64), np.nan)
    if isinstance(value, (bool, np.bool_, str, bytes)) or value is None:
        raise bad(argument, value, wants)
    if isinstance(value, (numbers.Real, np.floating, np.integer)):
        return _finite(argument, value)
    if isinstance(value, (complex, np.complexfloating)):
        raise bad(argument, value, wants)
    if isinstance(value, (list, tuple)) and any(isinstance(v, (bool, np.bool_)) for v in value):
        raise bad(argument, value, wants, "it holds a bool")
    if isinstance(value, (xr.Dataset, Mapping)):
        raise bad(argument, value, wants, "name one variable of it")
    array = _plain(value)
    if array.dtype.kind not in "iuf":
        raise bad(argument, value, wants)
    if array.ndim == 0:
        return _finite(argument, array[()])
    if array.ndim > 1:
        raise bad(
            argument,
            value,
            wants,
            f"name the dimensions: xr.DataArray({argument}, dims=(...))",
        )
    if array.size == 0:
        raise bad(argument, value, "at least one value")
    array = array.astype(np.float64)  # a copy, also of float64: the caller may change theirs
    array.flags.writeable = False
    return array


def _finite(argument: str, value: Any) -> float:
    try:
        number = float(value)
    except OverflowError:
        number = np.inf
    if not np.isfinite(number):
        raise bad(argument, value, "a finite number")
    return number


def _data_array(argument: str, value: xr.DataArray, wants: str) -> Value:
    if value.dtype.kind not in "iuf":
        raise bad(argument, value, wants)
    if value.ndim == 0:
        return _finite(argument, value.values[()])
    if value.size == 0:
        raise bad(argument, value, "at least one value")
    if not all(isinstance(dim, str) for dim in value.dims):
        raise bad(argument, value, "dims that are strings")
    if len(set(value.dims)) < value.ndim:
        raise bad(argument, value, "dims that differ")
    # Only the coordinates of its own dims travel on: others (the fixed parameters of the map
    # that it was taken from, say) would contradict the system that it is put into.
    keep = {dim: value.coords[dim] for dim in value.dims if _is_plain_axis(value, dim)}
    return xr.DataArray(value.variable.astype(np.float64), coords=keep, name=argument)


def _is_plain_axis(value: xr.DataArray, dim: Any) -> bool:
    return dim in value.xindexes and len(value.xindexes.get_all_coords(dim)) == 1


def same(left: Value | None, right: Value | None) -> bool:
    """Whether two kept values are equal: NaN equals NaN, dims and coordinates count.

    >>> same(np.array([1.0, np.nan]), np.array([1.0, np.nan])), same(1.0, np.array([1.0]))
    (True, False)
    """
    if isinstance(left, xr.DataArray) and isinstance(right, xr.DataArray):
        return bool(left.equals(right))
    if isinstance(left, np.ndarray) and isinstance(right, np.ndarray):
        return np.array_equal(left, right, equal_nan=True)
    if isinstance(left, (xr.DataArray, np.ndarray)) or isinstance(
        right, (xr.DataArray, np.ndarray)
    ):
        return False
    return left == right


def brief(value: Value) -> str:
    """Write a kept value for a representation: short arrays in full, long ones by their ends."""
    if isinstance(value, float):
        return repr(value)
    if isinstance(value, np.ndarray):
        if value.size <= SHOWN:
            return repr(value.tolist())
        return f"<{value.size} values, {value[0]:.6g} to {value[-1]:.6g}>"
    sizes = ", ".join(f"{dim}: {size}" for dim, size in value.sizes.items())
    return f"<{'lazy ' if value.chunks is not None else ''}DataArray ({sizes})>"
