"""How large a stored map will be, and how long it will take, from a sample of its cells."""

from __future__ import annotations

import time
from collections.abc import Sequence
from dataclasses import dataclass
from math import prod
from typing import Any

from phasekit.errors import StoreError
from phasekit.labels.grid import cut
from phasekit.maps.left import Left
from phasekit.maps.place import Place
from phasekit.maps.stored_arrays import codecs
from phasekit.maps.tile import Tile, columns_for, compute_cells, release_buffers
from phasekit.numerics.memory import human
from phasekit.table.row import Quantity

#: Cells of the first sample, more than are ever computed without compiling the kernels. Those that
#: are timed follow, evenly over the tiles that are left, as large as takes `SAMPLE_SECONDS`.
SAMPLE_CELLS = 1 << 14
SAMPLES = 4
SAMPLE_SECONDS = 0.1
#: Of tiles that are small, because each cell takes long, a part is a sample.
SAMPLE_CELLS_OF_TILE = 8
LEAST_CELLS, MOST_CELLS = 1 << 13, 1 << 17


@dataclass(frozen=True)
class Estimate:
    """What is left of a map to compute."""

    cells: int
    tiles: int
    raw: int  # bytes of the results
    stored: int  # bytes on the disk
    seconds: float  # of one process

    def describe(self, workers: int) -> str:
        """Say it in a line, with the time that a number of processes takes."""
        workers = max(min(workers, self.tiles), 1)
        return (
            f"about {human(self.stored)} ({human(self.raw)} before compression) and "
            f"{duration(self.seconds / workers)} on {workers} "
            f"{'process' if workers == 1 else 'processes'}"
        )


def duration(seconds: float) -> str:
    """Write a time as people say it.

    >>> duration(0.2), duration(100.0), duration(7200.0), duration(400_000.0)
    ('less than 1 s', '1.7 min', '2 h', '4.6 days')
    """
    if seconds < 1.0:
        return "less than 1 s"
    for unit, length in (("days", 86400.0), ("h", 3600.0), ("min", 60.0)):
        if seconds >= 1.5 * length:
            return f"{seconds / length:.2g} {unit}"
    return f"{seconds:.0f} s"


def estimate(shares: Sequence[tuple[Left, Sequence[Tile]]]) -> Estimate:
    """Estimate what is left of parts, each with samples of its tiles."""
    stored = seconds = 0.0
    for left, samples in shares:
        ratio, rate = _sample(samples)
        stored += left.raw * ratio + left.overhead
        seconds += left.cells * rate
    return Estimate(
        sum(left.cells for left, _ in shares),
        sum(len(left) for left, _ in shares),
        sum(left.raw for left, _ in shares),
        int(stored),
        seconds,
    )


def sample_cells(rows: Sequence[Quantity]) -> int:
    """Return how many cells are a sample that takes no long time."""
    least = min(row.most_cells for row in rows)
    return SAMPLE_CELLS if least > SAMPLE_CELLS else max(least // SAMPLE_CELLS_OF_TILE, 1)


def _sample(chosen: Sequence[Tile]) -> tuple[float, float]:
    """Return the compressed part of the bytes, and seconds a cell, of some cells of tiles."""
    from phasekit.numerics.launch import one_thread

    bytes_written = raw = cells = 0
    seconds = 0.0
    with one_thread():
        few = sample_cells(chosen[0].rows)
        _timed(chosen[0], few)  # loads or compiles the kernels
        took, _, taken = _timed(chosen[0], few)
        room = int(taken * SAMPLE_SECONDS / max(took, 1e-9))
        for tile in chosen:
            took, results, taken = _timed(tile, min(max(room, min(LEAST_CELLS, few)), MOST_CELLS))
            seconds += took
            for row in tile.rows:
                size, took = _written(row, results[row.name])
                bytes_written += size
                seconds += took
                raw += results[row.name].nbytes
            cells += taken
    release_buffers()
    return bytes_written / max(raw, 1), seconds / max(cells, 1)


def _timed(tile: Tile, most: int) -> tuple[float, dict[str, Any], int]:
    """Compute some cells in the middle of a tile; return the seconds, the results, how many."""
    box = _middle(tile.shape, most)
    shape = tuple(part.stop - part.start for part in box)
    inputs = {name: cut(array, box) for name, array in tile.inputs.items()}
    start = time.perf_counter()
    found = columns_for(tile, shape)
    results = compute_cells(tile.model, tile.passes, tile.rows, inputs, shape, found)
    return time.perf_counter() - start, results, prod(shape)


def _middle(shape: tuple[int, ...], most: int) -> tuple[slice, ...]:
    """Return a box of at most so many cells in the middle of a tile, whole along the last dims."""
    room, parts = most, []
    for size in reversed(shape):
        taken = max(min(size, room), 1)
        room //= taken
        start = (size - taken) // 2
        parts.append(slice(start, start + taken))
    return tuple(reversed(parts))


def _written(row: Quantity, result: Any) -> tuple[int, float]:
    """Return the bytes that a result takes when it is compressed, and the seconds."""
    import zarr
    from zarr.storage import MemoryStore

    kept: dict[str, Any] = {}
    array = zarr.create_array(
        MemoryStore(kept),
        shape=result.shape,
        chunks=tuple(max(n, 1) for n in result.shape),
        dtype=row.dtype,
        compressors=codecs(),
        config={"write_empty_chunks": True},
    )
    before = sum(len(value) for value in kept.values())
    start = time.perf_counter()
    array[...] = result
    took = time.perf_counter() - start
    return sum(len(value) for value in kept.values()) - before, took


def refuse_too_large_for(place: Place, needed: Estimate, freed: int = 0) -> None:
    """Refuse a map that will not fit on the disk."""
    free = place.free_bytes()
    if free is None or needed.stored <= free + freed:
        return
    raise StoreError(
        f"store: the map will not fit: it takes about {human(needed.stored)} more "
        f"({human(needed.raw)} before compression), and {place.name} lies on a disk that has "
        f"{human(free + freed)} left; make room, name fewer quantities in of=, take "
        "dtype='float32' or coarser axes, or pass force=True to begin nevertheless"
    )
