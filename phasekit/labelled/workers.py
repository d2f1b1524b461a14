"""Running tiles: in this process, in worker processes, or on the workers of a dask cluster.

Each takes tiles from an iterator as workers come free, so that a map of any number of tiles needs
no list of them, and yields each tile that is done.
"""

from __future__ import annotations

import concurrent.futures
import contextlib
import multiprocessing
import os
import pickle
import signal
import sys
import threading
import types
from collections.abc import Generator, Iterable, Iterator
from concurrent.futures.process import BrokenProcessPool
from itertools import islice
from multiprocessing.context import SpawnContext, SpawnProcess
from typing import Any

from phasekit.errors import StoreError
from phasekit.labelled.arguments import bad
from phasekit.labelled.tile import Tile, compute, release_buffers

#: How often worker processes are started again without a tile done in between.
RESTARTS = 3


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
    """Compute tiles in processes of their own; one that is killed is replaced.

    Raises
    ------
    StoreError
        If processes end again and again before a tile is done.
    """
    source = iter(tiles)
    again: list[Tile] = []
    broken = 0
    while True:
        pool = concurrent.futures.ProcessPoolExecutor(workers, _Context(), initializer=_start)
        running: dict[concurrent.futures.Future[None], Tile] = {}
        try:
            while True:
                while len(running) < 2 * workers:
                    tile = again.pop() if again else next(source, None)
                    if tile is None:
                        break
                    try:
                        running[pool.submit(compute, tile)] = tile
                    except BrokenProcessPool:
                        again.append(tile)
                        raise
                if not running:
                    return
                for future in sorted(_first(running), key=_failed):
                    future.result()
                    broken = 0
                    yield running.pop(future)
        except BrokenProcessPool as error:
            again.extend(running.values())
            broken += 1
            if broken > RESTARTS:
                raise StoreError(
                    f"worker processes ended {broken} times before a tile was done; they were "
                    "killed, or there was no memory left: take fewer workers= or smaller chunks="
                ) from error
        finally:
            pool.shutdown(cancel_futures=True)  # tiles under way are finished


def _first(running: Iterable[concurrent.futures.Future[None]]) -> Any:
    wait = concurrent.futures.wait
    return wait(running, return_when=concurrent.futures.FIRST_COMPLETED).done


def _failed(future: concurrent.futures.Future[None]) -> bool:
    return future.exception() is not None


def _start() -> None:
    """Prepare a worker: it ends with its parent, however that ends, and leaves Ctrl-C to it."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    parent = multiprocessing.parent_process()
    if parent is not None:
        threading.Thread(target=_end_with, args=(parent,), daemon=True).start()


def _end_with(parent: Any) -> None:
    parent.join()
    os._exit(1)


class _Process(SpawnProcess):
    """A process that does not run the caller's script again.

    Python's own would import it, so that each script that makes a map needed a guard
    ``if __name__ == "__main__"``. Tiles need nothing of it.
    """

    @staticmethod
    def _Popen(process_obj: Any) -> Any:
        with _no_main():
            return SpawnProcess._Popen(process_obj)


class _Context(SpawnContext):
    Process = _Process


@contextlib.contextmanager
def _no_main() -> Iterator[None]:
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


# ------------------------------------------------------------------------------ clusters


@contextlib.contextmanager
def connected(client: Any) -> Iterator[Any]:
    """Give a dask client for a client or the address of a scheduler."""
    try:
        import distributed
    except ImportError:
        raise StoreError(
            "client: clusters need dask: pip install 'phasekit[distributed]'"
        ) from None
    if isinstance(client, distributed.Client):
        if client.status != "running":
            raise StoreError(f"client: it is {client.status}, wants one that is connected")
        yield client
        return
    if not isinstance(client, str) or not client:
        raise bad("client", client, "a dask.distributed.Client or the address of a scheduler")
    try:
        made: Any = distributed.Client(client, timeout=10, set_as_default=False)  # type: ignore[no-untyped-call]
    except (OSError, ValueError) as error:
        raise StoreError(f"client: no scheduler answers at {client}: {error}") from error
    try:
        yield made
    finally:
        made.close()


def on_cluster(tiles: Iterable[Tile], client: Any) -> Generator[Tile, None, None]:
    """Compute tiles on the workers of a dask cluster, which gives those of a lost one to others."""
    import distributed

    source = iter(tiles)
    running: dict[str, tuple[Any, Tile]] = {}
    finished: Any = distributed.as_completed(loop=client.loop)  # type: ignore[no-untyped-call]

    def feed() -> None:
        enough = 2 * max(sum(client.nthreads().values()), 1)
        for tile in islice(source, max(enough - len(running), 0)):
            future = client.submit(compute, tile, pure=False)
            running[future.key] = future, tile
            finished.add(future)

    try:
        feed()
        for future in finished:
            future.result()
            yield running.pop(future.key)[1]
            feed()
    except StoreError:  # of a tile
        raise
    except (concurrent.futures.CancelledError, OSError) as error:
        raise StoreError(f"the connection to the scheduler was lost: {error}") from error
    except distributed.KilledWorker as error:
        raise StoreError(
            f"workers of the cluster were killed, or had no memory left: {error}; take smaller "
            "chunks= or workers with more memory"
        ) from error
    finally:
        with contextlib.suppress(Exception):  # the scheduler may be gone
            client.cancel([future for future, _ in running.values()])
