"""Equality of results: dataclasses, mappings and arrays by what they hold."""

from __future__ import annotations

from collections.abc import Container, Mapping
from dataclasses import fields, is_dataclass
from types import FunctionType
from typing import Any

import numpy as np
import xarray as xr

#: Real numbers that may have come back from a file as the others.
_NUMBERS = (float, np.floating)


def equal(left: Any, right: Any, without: Container[str] = ()) -> bool:
    """Whether two values are the same: NaN equals NaN, some fields of dataclasses do not count.

    >>> equal({"a": (1.0, np.array([np.nan]))}, {"a": (1.0, np.array([np.nan]))})
    True
    >>> equal((1.0, 2.0), (1.0,)), equal(np.zeros(2), np.zeros(1))
    (False, False)
    """
    if left is right:
        return True
    if isinstance(left, Mapping) and isinstance(right, Mapping):
        return left.keys() == right.keys() and all(
            equal(value, right[name], without) for name, value in left.items()
        )
    if isinstance(left, _NUMBERS) and isinstance(right, _NUMBERS):  # of numpy or of Python
        return bool(left == right or (left != left and right != right))
    if type(left) is not type(right):
        return False
    if is_dataclass(left):
        return same_fields(left, right, without)
    if isinstance(left, (tuple, list)):
        return len(left) == len(right) and all(
            equal(x, y, without) for x, y in zip(left, right, strict=True)
        )
    if isinstance(left, (xr.Dataset, xr.DataArray, xr.Variable)):
        return bool(left.identical(right))
    if isinstance(left, (np.ndarray, np.generic, float, complex)):
        return np.array_equal(left, right, equal_nan=np.asarray(left).dtype.kind in "fc")
    return bool(left == right) or _same_code(left, right)


def _same_code(left: Any, right: Any) -> bool:
    """Whether two functions, compiled ones too, are the same code with the same values bound."""
    one, other = (getattr(function, "py_func", function) for function in (left, right))
    return (
        isinstance(one, FunctionType)
        and isinstance(other, FunctionType)
        and (one.__module__, one.__qualname__) == (other.__module__, other.__qualname__)
        and one.__code__ == other.__code__
        and equal(_bound(one), _bound(other))
    )


def _bound(function: FunctionType) -> tuple[Any, ...]:
    cells = tuple(cell.cell_contents for cell in function.__closure__ or ())
    return function.__defaults__, function.__kwdefaults__, cells


def same_fields(left: Any, right: Any, without: Container[str] = ()) -> bool:
    """Whether two dataclasses of one type hold the same, in the fields that count."""
    return type(left) is type(right) and all(
        equal(getattr(left, one.name), getattr(right, one.name), without)
        for one in fields(left)
        if one.name not in without
    )
