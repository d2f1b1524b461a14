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

from phasekit.cells.evaluate import fill
from phasekit.errors import StoreError
from phasekit.labels.arguments import FloatArray
from phasekit.labels.grid import tiles
from phasekit.maps import files
from phasekit.maps.marks import Mark, key_of
from phasekit.maps.place import Place
from phasekit.maps.plan_file import GROUP, PLAN_KEY, plan_from
from phasekit.systems.system import Model
from phasekit.table.row import Pass, Quantity

#: Cells that are computed at a time: their results stay in the processor's cache, and memory for
#: them is used again.
PIECE = 1 << 14

#: Seconds at most to wait for files that are being written.
WRITING = 2.0

#: Bytes of a block whose release makes glibc keep what is freed after it. Otherwise temporary
#: arrays of a piece are given back to the system, page by page, and asked for again.
KEPT = 1 << 25

_local = threading.local()


@dataclass(frozen=True)
class Tile:
    """What is needed to compute one tile, anywhere."""

    place: Place
    generation: str  # of the plan: what is computed for one is not written into another
    part: str
    index: tuple[int, ...]
    made_of: str  # digest of its inputs, for its mark
    marked: bool  # whether there is a mark, which does not hold
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
    from phasekit.numerics.launch import one_thread

    try:
        with one_thread():
            results = compute_cells(tile.model, tile.passes, tile.rows, tile.inputs, tile.shape)
        _write(tile, results)
    except Exception as error:
        where = ", ".join(f"{part.start}:{part.stop}" for part in tile.region)
        raise StoreError(
            f"the tile [{where}] of {', '.join(row.name for row in tile.rows[:3])}"
            f"{', ...' if len(tile.rows) > 3 else ''} failed: {type(error).__name__}: {error}"
        ) from error


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
    if "buffers" not in _local.__dict__:
        np.empty(KEPT - (1 << 16), np.uint8)
        _local.buffers = {}
    buffers: dict[str, Any] = _local.buffers
    size = prod(shape)
    kept = buffers.get(name)
    if kept is None or kept.size < size or kept.dtype != dtype:
        kept = buffers[name] = np.empty(size, dtype)
    return kept[:size].reshape(shape)


def release_buffers() -> None:
    """Give the memory of this thread's buffers back."""
    _local.__dict__.clear()


def _write(tile: Tile, results: Mapping[str, Any]) -> None:
    """Write a tile's chunks, then its mark, unless the map is another one by now."""
    store, arrays, marks = _arrays(tile)
    store.written.clear()
    _refuse_other(store, tile)
    if tile.marked:  # nothing of what it says is to be trusted, nor to be read and merged
        files.remove(store, [f"{GROUP}/{tile.part}/{key_of(tile.index)}", *_keys(tile)])
    for name, result in results.items():
        arrays[name][(*tile.region, ...)] = result
    try:
        _refuse_other(store, tile)
    except StoreError:
        if files.read(store, PLAN_KEY) is None:  # removed meanwhile: nothing is left of it
            files.remove(store, store.written)
        raise
    chunks = {
        row.name: store.written.get(key) for row, key in zip(tile.rows, _keys(tile), strict=True)
    }
    marks[tile.index] = Mark(tile.made_of, chunks).text() if tile.made_of else 1


def _keys(tile: Tile) -> list[str]:
    """Return the files of a tile's chunks, one for each row."""
    return [f"{row.name}/{key_of((*tile.index, *(0,) * len(row.dims)))}" for row in tile.rows]


def _refuse_other(store: Any, tile: Tile) -> None:
    data = files.read(store, PLAN_KEY)
    if data is None:
        raise StoreError("the map was removed while it was being made; nothing is written any more")
    if data != _local.__dict__.get("plan"):  # read only where it is not what it was
        if plan_from(data).generation != tile.generation:
            raise StoreError("the map was replaced, or made longer, by another sweep meanwhile")
        _local.plan = data


def is_marked(tile: Tile) -> bool:
    """Whether the store says that a tile is done."""
    with contextlib.suppress(Exception):  # it is not, where the store cannot be read
        found = _arrays(tile)[2][tile.index]
        return bool(found == 1 if not tile.made_of else tile.made_of in str(found))
    return False


def _arrays(tile: Tile) -> tuple[Any, Mapping[str, Any], Any]:
    """Return the store and its arrays, opened once a thread: each tile takes the same ones."""
    key = (tile.place.key, tile.generation, tile.part)
    if _local.__dict__.get("key") != key:
        import zarr

        from phasekit.maps.checked import Recording

        _local.__dict__.pop("plan", None)
        _local.store = Recording(tile.place.open(read_only=False))
        group = zarr.open_group(_local.store, mode="r+", zarr_format=3)
        _local.arrays = {row.name: group[row.name] for row in tile.rows}
        _local.marks = group[f"{GROUP}/{tile.part}"]
        _local.key = key
    return _local.store, _local.arrays, _local.marks
