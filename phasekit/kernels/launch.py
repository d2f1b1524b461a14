"""Running kernels over cells: interpreted, compiled, or compiled in threads."""

from __future__ import annotations

import os
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from typing import Any

import numpy as np
import numpy.typing as npt

from phasekit.errors import ParameterError

# A kernel takes seconds to compile when it is not in numba's cache, and half a millisecond a
# system when interpreted. So small inputs are interpreted, until a process has interpreted so
# many systems by one kernel that compiling it has paid.
INTERPRETED_AT_MOST = 4_000
THREADS_FROM = 100_000
_interpreted: dict[Callable[..., None], int] = {}

Arrays = tuple[npt.NDArray[Any], ...]


def cpus() -> int:
    """Number of cores that this process may use, not that the machine has."""
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1


def launch(
    kernel: Callable[..., None],
    arrays: tuple[Any, ...],
    size: int,
    groups: Sequence[Arrays],
    threads: int | None,
    weight: int = 1,
) -> None:
    """Run a kernel over the cells 0 to size: interpreted, compiled, or compiled in threads.

    ``weight`` says how many times the usual work a cell takes.
    """
    check_threads(threads)
    spent = _interpreted.get(kernel, 0) + size * weight
    if spent <= INTERPRETED_AT_MOST and hasattr(kernel, "py_func"):
        _interpreted[kernel] = spent
        with np.errstate(all="ignore"):
            kernel.py_func(*arrays, 0, size, *groups)
        return
    workers = (threads or cpus()) if size * weight >= THREADS_FROM else 1
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
