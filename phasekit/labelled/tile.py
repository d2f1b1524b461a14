"""One tile of a stored map: computed into buffers that are used again, written, then marked.

This is what runs in worker processes, here and on clusters. A tile carries the inputs of its own
cells and the place of the store, and leaves nothing but what it wrote there.
"""

from __future__ import annotations

import asyncio
import contextlib
import threading
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from math import prod
from typing import Any

import numpy as np

from phasekit.errors import StoreError
from phasekit.labelled.arguments import FloatArray
from phasekit.labelled.evaluate import fill
from phasekit.labelled.place import Place
from phasekit.labelled.quantities import Pass, Quantity
from phasekit.labelled.system import Model
from phasekit.labelled.tiling import tiles

#: The group of a store that holds the plan, and for each part an array with a 1 for each tile that
#: is done, each in a file of its own.
GROUP = "sweep"

#: Cells that are computed at a time: their results stay in the processor's cache, and memory for
#: them is used again.
PIECE = 1 << 14

#: Seconds at most to wait for files that are being written.
WRITING = 2.0

_local = threading.local()


@dataclass(frozen=True)
class Tile:
    """What is needed to compute one tile, anywhere."""

    place: Place
    generation: str  # of the store's arrays: another one has other shapes
    part: str
    index: tuple[int, ...]
    region: tuple[slice, ...]
    model: type[Model]
    passes: tuple[Pass, ...]
    rows: tuple[Quantity, ...]
    inputs: Mapping[str, FloatArray]

    @property
    def shape(self) -> tuple[int, ...]:
        """Number of cells along each dim."""
        return tuple(part.stop - part.start for part in self.region)

    @property
    def cells(self) -> int:
        """Number of cells."""
        return prod(self.shape)


def compute(tile: Tile) -> None:
    """Compute a tile, write it, and record that it is done.

    Raises
    ------
    StoreError
        If anything fails, with the tile; its data may be written, its mark is not.
    """
    from phasekit.kernels.launch import one_thread

    try:
        with one_thread():
            results = compute_cells(tile.model, tile.passes, tile.rows, tile.inputs, tile.shape)
        arrays, marks = _arrays(tile)
        for name, result in results.items():
            arrays[name][(*tile.region, ...)] = result
        marks[tile.index] = 1
    except Exception as error:
        where = ", ".join(f"{part.start}:{part.stop}" for part in tile.region)
        raise StoreError(
            f"the tile [{where}] of {', '.join(row.name for row in tile.rows[:3])}"
            f"{', ...' if len(tile.rows) > 3 else ''} failed: {type(error).__name__}: {error}"
        ) from error


def is_marked(tile: Tile) -> bool:
    """Whether the store says that a tile is done."""
    with contextlib.suppress(Exception):  # it is not, where the store cannot be read
        return bool(_arrays(tile)[1][tile.index] == 1)
    return False


def finish_writing() -> None:
    """Wait for what zarr still writes in its own thread after an error or an interrupt."""
    from zarr.core.sync import sync

    async def others() -> None:
        tasks = asyncio.all_tasks() - {asyncio.current_task()}
        if tasks:
            await asyncio.wait(tasks, timeout=WRITING)

    sync(others())


def compute_cells(
    model: type[Model],
    passes: Sequence[Pass],
    rows: Sequence[Quantity],
    inputs: Mapping[str, FloatArray],
    shape: tuple[int, ...],
) -> dict[str, Any]:
    """Compute a box of cells into this thread's buffers, which the next call uses again."""
    results = {row.name: _buffer(row.name, shape + row.label_shape, row.dtype) for row in rows}
    floats = [results[row.name] for row in rows if row.dtype.startswith("float")]
    for part in tiles(shape, PIECE):
        fill(model, passes, inputs, results, part)
        for result in floats:
            # NaN has many bit patterns, and which one comes out depends on how it was computed.
            np.copyto(result[part], np.nan, where=np.isnan(result[part]))
    return results


def _buffer(name: str, shape: tuple[int, ...], dtype: str) -> Any:
    buffers: dict[str, Any] = _local.__dict__.setdefault("buffers", {})
    size = prod(shape)
    kept = buffers.get(name)
    if kept is None or kept.size < size or kept.dtype != dtype:
        kept = buffers[name] = np.empty(size, dtype)
    return kept[:size].reshape(shape)


def release_buffers() -> None:
    """Give the memory of this thread's buffers back."""
    _local.__dict__.clear()


def _arrays(tile: Tile) -> tuple[Mapping[str, Any], Any]:
    """Return the store's arrays, opened once a thread: each tile takes the same ones."""
    key = (tile.place.key, tile.generation, tile.part)
    if _local.__dict__.get("key") != key:
        import zarr

        group = zarr.open_group(tile.place.open(read_only=False), mode="r+", zarr_format=3)
        _local.arrays = {row.name: group[row.name] for row in tile.rows}
        _local.marks = group[f"{GROUP}/{tile.part}"]
        _local.key = key
    return _local.arrays, _local.marks
