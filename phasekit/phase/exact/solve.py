"""From coefficient arrays to result arrays: broadcasting, and exact decisions."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import Any

import numpy as np
import numpy.typing as npt

from phasekit.numerics.launch import Arrays, launch
from phasekit.phase.exact.kernels.equilibria import UNDECIDED, exact_discriminant

Array = npt.NDArray[np.float64]
Shapes = tuple[tuple[tuple[int, ...], Any], ...]

NOTHING: Array = np.empty(0)


def solve(
    kernel: Callable[..., None],
    shapes: tuple[Shapes, ...],
    count: int,
    coefficients: tuple[npt.ArrayLike, npt.ArrayLike, npt.ArrayLike],
    threads: int | None,
    exact: Array = NOTHING,
) -> Iterator[Arrays]:
    """Run a kernel over broadcast coefficients.

    ``shapes`` gives, for each group of outputs, the trailing shape and dtype of its arrays, and
    ``count`` the place of n_equilibria in the first group. ``threads`` defaults to all cores.
    Where the kernel leaves a number open, it is called again with the ``exact`` discriminants.
    """
    arrays = [np.asarray(value, dtype=float) for value in coefficients]
    shape = np.broadcast_shapes(*(array.shape for array in arrays))
    # Copies: numba compiles a kernel anew for arrays that are read-only or not contiguous.
    flat = tuple(np.array(np.broadcast_to(array, shape)).reshape(-1) for array in arrays)
    size = flat[0].size
    groups = [tuple(np.empty((size, *tail), dtype) for tail, dtype in group) for group in shapes]
    launch(kernel, (*flat, exact), size, groups, threads)
    undecided = np.flatnonzero(groups[0][count] == UNDECIDED)
    if undecided.size:
        A, B, C = (array[undecided] for array in flat)
        exact = np.array([exact_discriminant(*abc) for abc in zip(A, B, C, strict=True)])
        decided = solve(kernel, shapes, count, (A, B, C), threads, exact)
        for group, part in zip(groups, decided, strict=True):
            for array, values in zip(group, part, strict=True):
                array[undecided] = values
    return (tuple(array.reshape(shape + array.shape[1:]) for array in group) for group in groups)
