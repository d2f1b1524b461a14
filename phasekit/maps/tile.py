"""One tile of a stored map: computed into buffers that are used again, written, then marked.

This is what runs in worker processes, here and on clusters. A tile carries the inputs of its own
cells and the place of the store, and leaves nothing but what it wrote there.
"""

from __future__ import annotations

import asyncio
import contextlib
import threading
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from math import prod
from typing import Any

import numpy as np

from phasekit.cells.evaluate import fill
from phasekit.cells.numbered import PIECE as NUMBERED_PIECE
from phasekit.cells.numbered import Columns, greatest, is_numbered, resized, unproved
from phasekit.errors import StoreError
from phasekit.labels.arguments import FloatArray
from phasekit.labels.grid import tiles
from phasekit.maps import files
from phasekit.maps.keys import GROUP
from phasekit.maps.marks import Chunk, Mark, key_of, sound
from phasekit.maps.place import Place
from phasekit.maps.plan import PLAN_KEY, plan_from
from phasekit.systems.system import System
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
    model: type[System]
    passes: tuple[Pass, ...]
    rows: tuple[Quantity, ...]
    inputs: Mapping[str, FloatArray]
    chunks: tuple[int, ...] = ()  # cells of a whole tile
    columns: Mapping[str, int] = field(default_factory=dict)  # that arrays have, where numbered
    uneven: Mark | None = None  # of results that are there, with other numbers of columns

    @property
    def shape(self) -> tuple[int, ...]:
        """Number of cells along each dim."""
        return tuple(part.stop - part.start for part in self.region)

    @property
    def cells(self) -> int:
        """Number of cells."""
        return prod(self.shape)


def compute(tile: Tile) -> None:
    """Compute a tile, write it, and record that it is done."""
    from phasekit.numerics.launch import one_thread

    try:
        with one_thread():
            results = None if tile.uneven is None else _evened(tile, tile.uneven)
            open_ = () if tile.uneven is None else tile.uneven.unproved
            if results is None:
                given = (tile.model, tile.passes, tile.rows, tile.inputs, tile.shape)
                found = columns_for(tile, tile.shape)
                results = compute_cells(*given) if found is None else compute_cells(*given, found)
                open_ = () if found is None else unproved(found.stretches)
        _write(tile, results, open_)
    except Exception as error:
        where = ", ".join(f"{part.start}:{part.stop}" for part in tile.region)
        raise StoreError(
            f"the tile [{where}] of {', '.join(row.name for row in tile.rows[:3])}"
            f"{', ...' if len(tile.rows) > 3 else ''} failed: {type(error).__name__}: {error}"
        ) from error


def finish_writing() -> None:
    """Wait for what zarr still writes in its own thread after an error or an interrupt."""

    async def others() -> None:
        tasks = asyncio.all_tasks() - {asyncio.current_task()}
        if tasks:
            await asyncio.wait(tasks, timeout=WRITING)

    files.run(others())


def compute_cells(
    model: type[System],
    passes: Sequence[Pass],
    rows: Sequence[Quantity],
    inputs: Mapping[str, FloatArray],
    shape: tuple[int, ...],
    found: Columns | None = None,
) -> dict[str, Any]:
    """Compute a box of cells into this thread's buffers, which the next call uses again.

    Numbered equilibria are `found`: they have as many columns as the rows, or more if need be.
    """
    wide = () if found is None else found.rows
    results = {
        row.name: _buffer(row.name, shape + row.label_shape, row.dtype)
        for row in rows
        if row not in wide
    }
    for part in tiles(shape, PIECE if found is None else NUMBERED_PIECE):
        fill(model, passes, inputs, results, part, found)
    if found is not None:
        results |= found.joined(greatest([found.widths, *map(_widths, wide)]))
    for row in rows:
        if row.dtype.startswith("float"):
            # NaN has many bit patterns, and which one comes out depends on how it was computed.
            np.copyto(results[row.name], np.nan, where=np.isnan(results[row.name]))
    return results


def columns_for(tile: Tile, shape: tuple[int, ...]) -> Columns | None:
    """Return columns for a box of cells of a tile, if equilibria are numbered there."""
    if tile.model.rung.labels_fixed:
        return None
    rows = tuple(filter(is_numbered, tile.rows))
    return Columns(rows, dict(zip(map(str, range(len(shape))), shape, strict=True)))


def _widths(row: Quantity) -> dict[str, int]:
    return dict(zip(row.dims, row.label_shape, strict=True))


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


def _write(tile: Tile, results: Mapping[str, Any], open_: tuple[float, ...] = ()) -> None:
    """Write a tile's chunks, then its mark, unless the map is another one by now.

    In two round trips, for each may be long: all chunks at once, while the plan is read; the mark.
    """
    holding, arrays, marks = _arrays(tile)
    store = holding.inner
    holding.take()  # what an error or an interrupt left
    local = tile.place.path is not None  # where asking takes no time: it is asked before and after
    if tile.marked or local:
        _refuse_other(files.read(store, PLAN_KEY), tile)
    if tile.marked:  # nothing of what it says is to be trusted, nor to be read and merged
        files.remove(store, [f"{GROUP}/{tile.part}/{key_of(tile.index)}"])
        files.remove(store, _keys(tile))
    for row, key in zip(tile.rows, _keys(tile), strict=True):
        result = results[row.name]
        if tile.columns and is_numbered(row):
            chunk = _Chunk(tile, row, arrays[row.name], result.shape[len(tile.shape) :])
            holding.held |= chunk.written(key, result)
        else:
            arrays[row.name][(*tile.region, ...)] = result
    held = holding.take()
    plan = files.write_all(store, held, besides=PLAN_KEY)
    plan = files.read(store, PLAN_KEY) if local else plan
    try:
        _refuse_other(plan, tile)
    except StoreError:
        if plan is None:  # removed meanwhile: nothing is left of it
            files.remove(store, held)
        raise
    written = {key: Chunk.from_bytes(value.as_numpy_array()) for key, value in held.items()}
    chunks = {row.name: written.get(key) for row, key in zip(tile.rows, _keys(tile), strict=True)}
    mark = Mark(tile.made_of, chunks, _columns(tile, results), open_)
    marks[tile.index] = mark.text() if tile.made_of else 1
    files.write_all(store, holding.take())


def _columns(tile: Tile, results: Mapping[str, Any]) -> dict[str, int]:
    """Return the numbers of columns that results have, where equilibria are numbered."""
    found = {
        dim: n
        for row in tile.rows
        for dim, n in zip(row.dims, results[row.name].shape[len(tile.shape) :], strict=True)
    }
    return {dim: found[dim] for dim in tile.columns}


def _evened(tile: Tile, mark: Mark) -> dict[str, Any] | None:
    """Return what is stored of a tile, with as many columns as the arrays have.

    None where it is not what was written.
    """
    holding, arrays, _ = _arrays(tile)
    results = {}
    stored = (data for _, data in files.read_all(holding.inner, _keys(tile)))
    for data, row in zip(stored, tile.rows, strict=True):
        recorded = mark.chunks[row.name]
        if (data is None) != (recorded is None):
            return None
        if data is not None and not (sound(data) and Chunk.from_bytes(data) == recorded):
            return None
        had = tuple(
            mark.columns.get(dim, n) for dim, n in zip(row.dims, row.label_shape, strict=True)
        )
        values = _Chunk(tile, row, arrays[row.name], had).read(data)
        results[row.name] = resized(values, row, row.label_shape)
    return results


class _Chunk:
    """A chunk of an array as if that had other numbers of columns."""

    def __init__(self, tile: Tile, row: Quantity, array: Any, tail: tuple[int, ...]) -> None:
        import zarr
        from zarr.storage import MemoryStore

        self.kept: dict[str, Any] = {}
        self.cells = tuple(slice(n) for n in tile.shape)
        self.key = key_of((0,) * (len(tile.chunks) + len(tail)))
        self.array: Any = zarr.create_array(
            MemoryStore(self.kept),
            shape=tile.chunks + tail,
            chunks=tile.chunks + tuple(max(n, 1) for n in tail),
            dtype=row.dtype,
            fill_value=array.fill_value,
            compressors=array.compressors,
            chunk_key_encoding={"name": "default", "separator": "."},
        )

    def written(self, key: str, values: Any) -> dict[str, Any]:
        """Return the file of some values, under a key; none where all are the fill value."""
        self.array[(*self.cells, ...)] = values
        return {key: self.kept[self.key]} if self.key in self.kept else {}

    def read(self, data: bytes | None) -> Any:
        """Return the values of a file."""
        if data is not None:
            self.kept[self.key] = files.default_buffer().buffer.from_bytes(data)
        return self.array[(*self.cells, ...)]


def _keys(tile: Tile) -> list[str]:
    """Return the files of a tile's chunks, one for each row."""
    return [f"{row.name}/{key_of((*tile.index, *(0,) * len(row.dims)))}" for row in tile.rows]


def _refuse_other(data: bytes | None, tile: Tile) -> None:
    """Raise a `StoreError` where a plan is not that of the map of which a tile is."""
    if data is None:
        raise StoreError("the map was removed while it was being computed; nothing more is written")
    if data != _local.__dict__.get("plan"):  # read only where it is not what it was
        if plan_from(data).generation != tile.generation:
            raise StoreError(
                "the map was replaced or extended by another sweep while it was being computed"
            )
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

        from phasekit.maps.checked import Holding

        _local.__dict__.pop("plan", None)
        _local.store = Holding(tile.place.open(read_only=False))
        group = zarr.open_group(_local.store, mode="r+", zarr_format=3, use_consolidated=False)
        _local.arrays = {row.name: group[row.name] for row in tile.rows}
        _local.marks = group[f"{GROUP}/{tile.part}"]
        _local.key = key
    return _local.store, _local.arrays, _local.marks
