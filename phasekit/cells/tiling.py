"""Tiles of a box of cells, and running work on them in threads with a progress bar."""

from __future__ import annotations

import itertools
import warnings
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor, as_completed
from typing import Any

from phasekit.labels.arguments import FloatArray
from phasekit.numerics.waits import watched

#: Cells of a tile: large enough that calls cost nothing, small enough to stay in the cache.
TILE_CELLS = 1 << 16

#: Seconds between two states of a progress bar in a log.
LOG_SECONDS = 30.0


def cut(array: FloatArray, tile: tuple[slice, ...]) -> FloatArray:
    """Return a tile of an array whose axes of length 1 stand for whole dims."""
    return array[
        tuple(
            part if size > 1 else slice(None) for part, size in zip(tile, array.shape, strict=True)
        )
    ]


def tiles(shape: Sequence[int], cells: int = TILE_CELLS) -> Iterator[tuple[slice, ...]]:
    """Cut a box of cells into even tiles of at most `cells`, whole along the last axes.

    >>> [tuple((s.start, s.stop) for s in tile) for tile in tiles((3, 2), 4)]
    [((0, 2), (0, 2)), ((2, 3), (0, 2))]
    """
    steps, room = [], max(cells, 1)
    for size in reversed(shape):
        parts = -(-size // max(min(size, room), 1))
        step = -(-size // max(parts, 1))
        steps.append(step)
        room //= step
    cuts = [
        [slice(i, min(i + step, size)) for i in range(0, size, step)]
        for size, step in zip(shape, reversed(steps), strict=True)
    ]
    return itertools.product(*cuts)


def run_tasks(tasks: Sequence[tuple[Callable[[], None], int]], progress: bool | None) -> None:
    """Run tasks in threads (the kernels release the interpreter), with a bar that counts cells."""
    if len(tasks) <= 1 and progress is not True:
        for task, _ in tasks:
            task()
        return
    from phasekit.numerics.launch import cpus  # here, because it loads the kernels

    with progress_bar(sum(cells for _, cells in tasks), progress) as bar:
        pool = ThreadPoolExecutor(max_workers=max(1, min(cpus(), len(tasks))))
        try:
            futures = {pool.submit(task): cells for task, cells in tasks}
            for future in as_completed(futures):
                future.result()
                bar.update(futures[future])
        finally:
            pool.shutdown(cancel_futures=True)


class _NoBar:
    def __enter__(self) -> _NoBar:
        return self

    def __exit__(self, *_: object) -> None:
        pass

    def update(self, cells: int) -> None:
        pass


def progress_bar(cells: int, progress: bool | None, done: int = 0) -> Any:
    """Return a bar that counts cells, with their rate and the time left; quiet unless asked for.

    None shows it in a terminal and in notebooks alone, and if it takes longer than a second.
    """
    if progress is False:
        return _NoBar()
    # A log gets a line in a while.
    quick = watched()
    if progress is None and not quick:
        return _NoBar()
    return _tqdm()(
        total=cells,
        initial=done,
        unit="cell",
        unit_scale=True,
        delay=1.0 if progress is None else 0.0,
        mininterval=0.1 if quick else LOG_SECONDS,
        desc="phasekit",
    )


def _tqdm() -> Any:
    """Return the bar of notebooks in a notebook that can show it, else that of terminals."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # that a notebook has no widgets
        from tqdm.auto import tqdm
    return tqdm
