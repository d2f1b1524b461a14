"""From coefficient arrays to result arrays: broadcasting, threads, and exact decisions."""

from __future__ import annotations

import os
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from typing import Any

import numpy as np
import numpy.typing as npt

from phasekit.kernels.equilibria import UNDECIDED
from phasekit.kernels.exact import exact_discriminant
from phasekit.kernels.separatrices import SIZE

# The block kernel takes seconds to compile on first use; below this size it would not pay.
BLOCKS_FROM = 10_000
THREADS_FROM = 100_000

Kernel = Callable[..., None]
Shapes = tuple[tuple[tuple[int, ...], Any], ...]


def solve(
    one_by_one: Kernel,
    in_blocks: Kernel,
    shapes: tuple[Shapes, ...],
    count: int,
    coefficients: tuple[npt.ArrayLike, npt.ArrayLike, npt.ArrayLike],
    threads: int | None,
) -> list[tuple[npt.NDArray[Any], ...]]:
    """Run a kernel over broadcast coefficients.

    ``shapes`` gives, for each group of outputs, the trailing shape and dtype of its arrays, and
    ``count`` the place of n_equilibria in the first group. ``threads`` defaults to all cores.
    """
    arrays = np.broadcast_arrays(*(np.asarray(value, dtype=float) for value in coefficients))
    shape = arrays[0].shape
    a, b, c = (np.ascontiguousarray(array).reshape(-1) for array in arrays)
    size = a.size
    groups = [tuple(np.empty((size, *tail), dtype) for tail, dtype in group) for group in shapes]
    nothing = np.empty(0)
    if size < BLOCKS_FROM:
        one_by_one(a, b, c, nothing, 0, size, *groups, np.empty(SIZE))
    else:
        workers = (threads or os.cpu_count() or 1) if size >= THREADS_FROM else 1
        edges = [size * j // workers for j in range(workers + 1)]
        parts = zip(edges[:-1], edges[1:], strict=True)
        with ThreadPoolExecutor(workers) as pool:
            jobs = [
                pool.submit(in_blocks, a, b, c, *part, *groups, np.empty(SIZE)) for part in parts
            ]
        for job in jobs:
            job.result()
    open_cells = np.flatnonzero(groups[0][count] == UNDECIDED)
    if open_cells.size:
        a, b, c = a[open_cells], b[open_cells], c[open_cells]
        exact = np.array([exact_discriminant(*abc) for abc in zip(a, b, c, strict=True)])
        decided = [
            tuple(np.empty((a.size, *tail), dtype) for tail, dtype in group) for group in shapes
        ]
        one_by_one(a, b, c, exact, 0, a.size, *decided, np.empty(SIZE))
        for group, part in zip(groups, decided, strict=True):
            for array, values in zip(group, part, strict=True):
                array[open_cells] = values
    return [tuple(array.reshape(shape + array.shape[1:]) for array in group) for group in groups]
