"""From coefficient arrays to result arrays: broadcasting, threads, and exact decisions."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from typing import Any

import numpy as np
import numpy.typing as npt

from phasekit.errors import ParameterError
from phasekit.kernels.equilibria import UNDECIDED
from phasekit.kernels.exact import exact_discriminant

# A kernel takes seconds to compile when it is not in numba's cache, and half a millisecond a
# system when interpreted. So small inputs are interpreted, until a process has interpreted so
# many systems by one kernel that compiling it has paid.
INTERPRETED_AT_MOST = 4_000
THREADS_FROM = 100_000
_interpreted: dict[Callable[..., None], int] = {}

Arrays = tuple[npt.NDArray[Any], ...]
Shapes = tuple[tuple[tuple[int, ...], Any], ...]


def solve(
    kernel: Callable[..., None],
    shapes: tuple[Shapes, ...],
    count: int,
    coefficients: tuple[npt.ArrayLike, npt.ArrayLike, npt.ArrayLike],
    threads: int | None,
) -> Iterator[Arrays]:
    """Run a kernel over broadcast coefficients.

    ``shapes`` gives, for each group of outputs, the trailing shape and dtype of its arrays, and
    ``count`` the place of n_equilibria in the first group. ``threads`` defaults to all cores.
    """
    check_threads(threads)
    arrays = [np.asarray(value, dtype=float) for value in coefficients]
    shape = np.broadcast_shapes(*(array.shape for array in arrays))
    # Copies: numba compiles a kernel anew for arrays that are read-only or not contiguous.
    flat = tuple(np.array(np.broadcast_to(array, shape)).reshape(-1) for array in arrays)
    groups = _allocate(flat[0].size, shapes)
    launch(kernel, (*flat, np.empty(0)), flat[0].size, groups, threads)
    undecided = np.flatnonzero(groups[0][count] == UNDECIDED)
    if undecided.size:
        few = tuple(array[undecided] for array in flat)
        exact = np.array([exact_discriminant(*abc) for abc in zip(*few, strict=True)])
        decided = _allocate(undecided.size, shapes)
        launch(kernel, (*few, exact), undecided.size, decided, threads)
        for group, part in zip(groups, decided, strict=True):
            for array, values in zip(group, part, strict=True):
                array[undecided] = values
    return (tuple(array.reshape(shape + array.shape[1:]) for array in group) for group in groups)


def cpus() -> int:
    """Number of cores that this process may use, not that the machine has."""
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1


def _allocate(size: int, shapes: tuple[Shapes, ...]) -> list[Arrays]:
    return [tuple(np.empty((size, *tail), dtype) for tail, dtype in group) for group in shapes]


def launch(
    kernel: Callable[..., None],
    arrays: tuple[Any, ...],
    size: int,
    groups: Sequence[Arrays],
    threads: int | None,
) -> None:
    """Run a kernel over the cells 0 to size: interpreted, compiled, or compiled in threads."""
    spent = _interpreted.get(kernel, 0) + size
    if spent <= INTERPRETED_AT_MOST and hasattr(kernel, "py_func"):
        _interpreted[kernel] = spent
        with np.errstate(all="ignore"):
            kernel.py_func(*arrays, 0, size, *groups)
        return
    workers = (threads or cpus()) if size >= THREADS_FROM else 1
    if workers == 1:
        kernel(*arrays, 0, size, *groups)
        return
    edges = [size * part // workers for part in range(workers + 1)]
    with ThreadPoolExecutor(workers) as pool:
        jobs = [
            pool.submit(kernel, *arrays, start, stop, *groups)
            for start, stop in zip(edges[:-1], edges[1:], strict=True)
        ]
    for job in jobs:
        job.result()


def check_threads(threads: int | None) -> None:
    """Refuse a number of threads that is none."""
    if threads is not None and (not isinstance(threads, int) or threads < 1):
        raise ParameterError(f"threads: got {threads!r}, wants a number of threads >= 1, or None")
