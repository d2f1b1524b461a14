"""Sums of products whose bits do not depend on where in an array, or in how large a one, they are.

BLAS takes other paths for other shapes, and pairwise sums group by the width of an array.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from phasekit.arrays import Array


def contract(values: Any, matrix: Any) -> Any:
    """Contract the last axis of values with the last of a matrix, or of a vector."""
    into = "...j,j->..." if matrix.ndim == 1 else "...j,kj->...k"
    return np.asarray(np.einsum(into, np.ascontiguousarray(values), np.ascontiguousarray(matrix)))


def row_sums(values: Array) -> Array:
    """Sum the last axis from the first term to the last; zeros at its end change nothing."""
    if not values.shape[-1]:
        return np.zeros(values.shape[:-1])
    return np.asarray(np.cumsum(values, axis=-1)[..., -1])
