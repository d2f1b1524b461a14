"""Running tiles: in this process, or in worker processes.

Each takes tiles from an iterator as workers come free, so that a map of any number of tiles needs
no list of them, and yields each tile that is done.
"""

from __future__ import annotations

import contextlib
import multiprocessing
import pickle
import sys
import types
from collections import Counter
from collections.abc import Generator, Iterable, Iterator
from multiprocessing.connection import wait
from multiprocessing.context import SpawnProcess
from typing import Any

from phasekit.errors import StoreError
from phasekit.maps.tile import Tile, compute, release_buffers
from phasekit.maps.worker_process import work
from phasekit.numerics.interrupts import deferred_interrupts, unheard

#: How often a tile is begun again whose worker process ended, or a process that did not get to one.
RESTARTS = 3

#: Seconds between two looks for Ctrl-C.
LOOK = 0.2


def in_this_process(tiles: Iterable[Tile]) -> Generator[Tile, None, None]:
    """Compute tiles one after the other."""
    try:
        for tile in tiles:
            compute(tile)
            yield tile
    finally:
        release_buffers()


# ------------------------------------------------------------------------------ processes


def in_processes(tiles: Iterable[Tile], workers: int) -> Generator[Tile, None, None]:
    """Compute tiles in processes of their own, as `Staff` does."""
    with hired(workers) as staff:
        yield from staff.compute(tiles)


@contextlib.contextmanager
def hired(workers: int) -> Iterator[Staff]:
    """Start worker processes, which load what they need while the caller is not ready."""
    staff = Staff()
    try:
        for _ in range(workers):
            staff.hire()
        yield staff
    finally:
        with deferred_interrupts():
            staff.dismiss()


class Staff:
    """Worker processes."""

    def __init__(self) -> None:
        self._workers: dict[Any, _Worker] = {}

    def hire(self) -> None:
        """Start one."""
        worker = _Worker()
        self._workers[worker.pipe] = worker

    def dismiss(self) -> None:
        """End them all."""
        for pipe in list(self._workers):
            self._workers.pop(pipe).end()

    def compute(self, tiles: Iterable[Tile]) -> Generator[Tile, None, None]:
        """Compute tiles, once; processes that are killed are replaced.

        After an error, the tiles under way are finished; after an interrupt, they are lost.
        """
        source, staff = iter(tiles), self._workers
        again: list[Tile] = []
        losses: Counter[object] = Counter()
        error = ""
        with deferred_interrupts() as interrupts:
            while staff:
                interrupts.act()
                for pipe in wait(list(staff), LOOK):
                    worker = staff[pipe]
                    tile, answer = worker.tile, worker.answer()
                    key = None if tile is None else (tile.part, tile.index)
                    if answer is None:
                        staff.pop(pipe).end()
                        losses[key] += 1
                        if tile is not None:
                            again.append(tile)
                        if losses[key] > RESTARTS:
                            error = error or _ended(losses[key])
                        if not error:
                            self.hire()
                        continue
                    losses.pop(key, None)
                    error = error or answer
                    if tile is not None and not answer:
                        yield tile
                    tile = None if error else again.pop() if again else next(source, None)
                    if tile is None:
                        staff.pop(pipe).end()
                    else:
                        worker.begin(tile)
        if error:
            raise StoreError(error)


def _ended(times: int) -> str:
    return (
        f"worker processes ended {times} times before a tile was done; they were killed, or there "
        "was no memory left: take fewer workers= or smaller chunks="
    )


class _Worker:
    """A process that computes a tile at a time, seen from here."""

    def __init__(self) -> None:
        self.pipe, theirs = multiprocessing.Pipe()
        self.tile: Tile | None = None
        self.process = SpawnProcess(target=work, args=(theirs,), daemon=True)
        with theirs, unheard(), _no_main():
            self.process.start()

    def begin(self, tile: Tile) -> None:
        """Hand it a tile."""
        self.tile = tile
        with contextlib.suppress(OSError):  # it has ended: `answer` will say so
            self.pipe.send(tile)

    def answer(self) -> str | None:
        """Return what failed, nothing if nothing did, None if the process has ended."""
        try:
            answer: str = self.pipe.recv()
        except (EOFError, OSError):
            return None
        self.tile = None
        return answer

    def end(self) -> None:
        """Kill it; what it has not answered for is lost."""
        self.process.kill()
        self.process.join()
        self.pipe.close()


@contextlib.contextmanager
def _no_main() -> Iterator[None]:
    """Start processes that do not run the caller's script again.

    Python's own would import it, so that each script that makes a map needed a guard
    ``if __name__ == "__main__"``. Tiles need nothing of it.
    """
    kept = sys.modules["__main__"]
    sys.modules["__main__"] = types.ModuleType("__main__")
    try:
        yield
    finally:
        sys.modules["__main__"] = kept


def keeps_here(tile: Tile) -> str | None:
    """Return why other processes cannot take over a tile, or None where they can."""
    try:
        data = pickle.dumps(tile)
    except Exception as error:
        return str(error)
    if b"__main__" in data:
        return "it needs something that is defined in the script that runs; move it into a module"
    return None
