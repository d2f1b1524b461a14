"""Reductions of many short rows: NumPy's own run along the rows, these across them."""

from __future__ import annotations

from typing import Any

import numpy as np


def across(ufunc: np.ufunc, values: Any, **more: Any) -> Any:
    """``ufunc.reduce`` over the last axis."""
    return ufunc.reduce(np.ascontiguousarray(values.T), **more).T


def largest(values: Any) -> Any:
    """Largest sizes over the last axis."""
    return across(np.maximum, np.abs(values))


def largest_entry(matrices: Any) -> Any:
    """Largest sizes over the last two axes."""
    return largest(matrices.reshape(*matrices.shape[:-2], -1))


def count(true: Any) -> Any:
    """How many are true, over the last axis."""
    return across(np.add, true, dtype=np.int64)
