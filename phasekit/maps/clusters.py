"""Running tiles on the workers of a dask cluster."""

from __future__ import annotations

import concurrent.futures
import contextlib
import gc
import math
import time
from collections.abc import Generator, Iterable, Iterator, Sequence
from itertools import islice
from typing import Any

from phasekit.errors import StoreError
from phasekit.labels.arguments import bad
from phasekit.maps.tile import Tile, compute

#: Seconds that a task takes, if its tiles are small, and how many of them it takes at most. A task
#: that is cancelled goes on to its end.
TASK, MOST = 0.5, 512

#: Seconds between two looks at how many workers there are.
LOOK = 2.0


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
    made: Any = None
    try:
        made = distributed.Client(client, timeout=10, set_as_default=False)  # type: ignore[no-untyped-call]
    except (OSError, ValueError) as error:
        because = str(error)
    if made is None:
        # Its client joins the thread of its event loop when it is collected: here, for in a thread
        # of another event loop, where the garbage collection may run, that waits for ever.
        gc.collect()
        raise StoreError(f"client: no scheduler answers at {client}: {because}")
    try:
        yield made
    finally:
        made.close()


def compute_several(tiles: Sequence[Tile]) -> float:
    """Compute tiles one after the other; return the seconds that it took."""
    began = time.perf_counter()
    for tile in tiles:
        compute(tile)
    return time.perf_counter() - began


def on_cluster(tiles: Iterable[Tile], client: Any) -> Generator[Tile, None, None]:
    """Compute tiles on the workers of a dask cluster, which gives those of a lost one to others.

    A task takes the scheduler some milliseconds, whatever it does: small tiles go several a task.
    """
    import distributed

    source = iter(tiles)
    running: dict[str, tuple[Any, list[Tile]]] = {}
    finished: Any = distributed.as_completed(loop=client.loop, with_results=True)  # type: ignore[no-untyped-call]
    several, enough, looked = 1, 0, -math.inf

    def feed() -> None:
        nonlocal enough, looked
        if time.monotonic() - looked > LOOK:  # clusters grow and shrink
            enough, looked = 2 * max(sum(client.nthreads().values()), 1), time.monotonic()
        while len(running) < enough and (batch := list(islice(source, several))):
            future = client.submit(compute_several, batch, pure=False)
            running[future.key] = future, batch
            finished.add(future)

    try:
        feed()
        for future, seconds in finished:
            if isinstance(seconds, BaseException):  # the task was cancelled
                raise seconds
            batch = running.pop(future.key)[1]
            each = max(seconds, 1e-9) / len(batch)
            several = min(max(int(TASK / each), 1), 4 * len(batch), MOST)
            yield from batch
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
