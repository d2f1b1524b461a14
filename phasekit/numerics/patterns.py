"""Patterns of sparse derivatives, and which columns one difference takes together."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from phasekit.errors import ParameterError
from phasekit.numerics.later import later

if TYPE_CHECKING:
    import scipy.sparse as sp
else:
    sp = later("scipy.sparse")


def pattern_of(jac: Any, n: int) -> Any:
    """The pattern that ``jac`` is, by columns; None if it is none."""
    kind = getattr(getattr(jac, "dtype", None), "kind", "")
    if callable(jac) or kind != "b":
        return None
    pattern = sp.csc_array(jac)
    if pattern.shape != (n, n):
        raise ParameterError(f"jac: got a pattern of shape {pattern.shape}, wants {(n, n)}")
    pattern.eliminate_zeros()
    pattern.sort_indices()
    return pattern


def groups_of(pattern: Any) -> npt.NDArray[np.int64]:
    """Numbers of groups of columns that share no row, so that one difference takes them all."""
    n = pattern.shape[1]
    columns = pattern.indptr.tolist()
    rows = pattern.indices.tolist()
    across = sp.csr_array(pattern)
    ends, members = across.indptr.tolist(), across.indices.tolist()
    group = [-1] * n
    for j in range(n):
        taken = {
            group[k]
            for i in rows[columns[j] : columns[j + 1]]
            for k in members[ends[i] : ends[i + 1]]
        }
        number = 0
        while number in taken:
            number += 1
        group[j] = number
    return np.array(group, dtype=np.int64)
