"""Running kernels over cells: interpreted, compiled, or compiled in threads."""

from __future__ import annotations

import contextlib
import os
import time
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextvars import ContextVar
from typing import Any

import numpy as np
import numpy.typing as npt

from phasekit.errors import ParameterError

# A compiled kernel is there after tens of milliseconds at the earliest; interpreted, a system takes
# half a millisecond, but some take a thousand times as long as most. So small inputs are
# interpreted, until a process has interpreted so many systems by one kernel, or for so long.
INTERPRETED_AT_MOST = 4_000
INTERPRETED_SECONDS = 0.2
AT_A_TIME = 32
THREADS_FROM = 100_000
#: Seconds that a quick form runs before it is judged again.
SLICE = 0.1
#: Seconds that any form runs before it is asked whether to go on.
LONGEST = 0.5
_interpreted: dict[Callable[..., None], int] = {}
_seconds: dict[Callable[..., None], float] = {}

Arrays = tuple[npt.NDArray[Any], ...]

_default_threads: ContextVar[int | None] = ContextVar("default_threads", default=None)


def cpus() -> int:
    """Number of cores that this process may use, not that the machine has."""
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1


@contextlib.contextmanager
def one_thread() -> Iterator[None]:
    """Let kernels called in this context run in one thread, unless they are told a number."""
    token = _default_threads.set(1)
    try:
        yield
    finally:
        _default_threads.reset(token)


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
    if threads is not None:
        check_threads(threads)
    first = _interpret(kernel, arrays, size, groups, weight)
    workers = (threads or _default_threads.get() or cpus()) if size * weight >= THREADS_FROM else 1
    count = min(size - first, AT_A_TIME)  # of which only the first shows what form runs
    while first < size:
        began = time.perf_counter()
        _run(kernel, arrays, first, first + count, groups, workers)
        seconds = (time.perf_counter() - began) / count
        first += count
        count = size - first
        form = _quick_form(kernel)
        if form is not None and count:
            form.consider(seconds * count)
            count = min(count, max(AT_A_TIME, int(SLICE / max(seconds, 1e-9))))
        # What interrupts a process is seen between calls alone.
        count = min(count, max(AT_A_TIME, int(LONGEST / max(seconds, 1e-12))))


def _quick_form(kernel: Any) -> Any:
    """The form by which a kernel ran last, where it was compiled without effort."""
    from phasekit.numerics.kernels import Kernel, QuickForm

    form = kernel.last if isinstance(kernel, Kernel) else None
    return form if isinstance(form, QuickForm) else None


def _run(
    kernel: Callable[..., None],
    arrays: tuple[Any, ...],
    first: int,
    size: int,
    groups: Sequence[Arrays],
    workers: int,
) -> None:
    """Run a kernel over cells, compiled, in so many threads."""
    workers = min(workers, size - first)
    if workers == 1:
        kernel(*arrays, first, size, *groups)
        return
    edges = [first + (size - first) * part // workers for part in range(workers + 1)]
    with ThreadPoolExecutor(workers) as pool:
        jobs = [
            pool.submit(kernel, *arrays, start, stop, *groups)
            for start, stop in zip(edges[:-1], edges[1:], strict=True)
        ]
    for job in jobs:
        job.result()


def _interpret(
    kernel: Callable[..., None],
    arrays: tuple[Any, ...],
    size: int,
    groups: Sequence[Arrays],
    weight: int,
) -> int:
    """Run a kernel by the interpreter while that pays; return the first cell that is left."""
    spent = _interpreted.get(kernel, 0) + size * weight
    if spent > INTERPRETED_AT_MOST or not hasattr(kernel, "py_func"):
        return 0
    _interpreted[kernel] = spent
    for start in range(0, size, AT_A_TIME):
        if _seconds.get(kernel, 0.0) > INTERPRETED_SECONDS:
            return start
        began = time.perf_counter()
        with np.errstate(all="ignore"):
            kernel.py_func(*arrays, start, min(start + AT_A_TIME, size), *groups)
        _seconds[kernel] = _seconds.get(kernel, 0.0) + time.perf_counter() - began
    return size


def check_threads(threads: int) -> None:
    """Refuse a number of threads that is none."""
    if not isinstance(threads, int) or threads < 1:
        raise ParameterError(f"threads: got {threads!r}, wants a number of threads >= 1, or None")
