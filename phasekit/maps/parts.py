"""The parts of a stored map: quantities on the same dims, and how they are cut into tiles."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace
from math import prod

from phasekit.cells.numbered import NUMBERED, sized
from phasekit.cells.request import Part
from phasekit.errors import ParameterError
from phasekit.numerics.memory import SHARE, human, room_short_of
from phasekit.table.numerical import NUMERICAL_ROWS
from phasekit.table.quantities import ROWS
from phasekit.table.row import Quantity

#: Cells of a tile, where its results stay below `MOST_BYTES`. Small maps are cut as well, so that
#: there is work for several processes, but not into tiles below `FEWEST_CELLS`.
MOST_CELLS = 1 << 20
FEWEST_CELLS = 1 << 16
FEWEST_TILES = 16
MOST_BYTES = 1 << 27

#: A map that is made longer is cut again if its tiles are more than so many, and than so many
#: times those that it would have if it were new, and at most a quarter of it is there.
MANY_TILES = 1 << 10
TOO_SMALL = 16


def rows_of(*, is_open: bool) -> Mapping[str, Quantity]:
    """Return the rows that maps may hold, by name; where equilibria are numbered, more of them."""
    more = (row for rows in NUMERICAL_ROWS.values() for row in rows)
    return {**ROWS, **{row.name: row for row in more}} if is_open else ROWS


@dataclass(frozen=True)
class StoredPart:
    """A part as a store has it: its name there, its tiles, and how its quantities are kept."""

    name: str
    dims: tuple[str, ...]
    chunks: tuple[int, ...]
    quantities: dict[str, str]  # name -> dtype
    complete: bool = False
    #: Parameters and states from which it is computed; None in stores that have no checksums.
    inputs: tuple[str, ...] | None = None
    #: How many equilibria and saddles the arrays hold, where these are numbered; else None.
    columns: dict[str, int] | None = None
    #: Rows that are those of one system and not of the table.
    own: tuple[Quantity, ...] = ()

    @property
    def checked(self) -> bool:
        """Whether its chunks carry checksums, and the marks of its tiles record them."""
        return self.inputs is not None

    @property
    def rows_by_name(self) -> Mapping[str, Quantity]:
        """Rows that it may hold, by name."""
        rows = rows_of(is_open=self.columns is not None)
        return {**rows, **{row.name: row for row in self.own}} if self.own else rows

    @property
    def rows(self) -> tuple[Quantity, ...]:
        """The rows of the table, with the dtypes that are stored."""
        known = self.rows_by_name
        rows = tuple(replace(known[name], dtype=dtype) for name, dtype in self.quantities.items())
        return rows if self.columns is None else sized(rows, self.columns)

    def chunk_of(self, row: Quantity) -> tuple[int, ...]:
        """Return the lengths of a quantity's chunks."""
        return self.chunks + tuple(max(n, 1) for n in row.label_shape)

    def with_columns(self, columns: Mapping[str, int]) -> StoredPart:
        """Return it with arrays for so many equilibria and saddles."""
        own = None if self.columns is None else {dim: columns[dim] for dim in self.columns}
        return self if own == self.columns else replace(self, columns=own, complete=False)

    @property
    def cell_bytes(self) -> int:
        """Bytes of a cell, uncompressed."""
        return sum(row.cell_bytes for row in self.rows)

    def grid(self, sizes: Mapping[str, int]) -> tuple[int, ...]:
        """Return the number of tiles along each dim."""
        return tuple(-(-sizes[dim] // n) for dim, n in zip(self.dims, self.chunks, strict=True))

    def cells(self, sizes: Mapping[str, int]) -> int:
        """Return the number of cells."""
        return prod(sizes[dim] for dim in self.dims)

    def region(self, index: Iterable[int], sizes: Mapping[str, int]) -> tuple[slice, ...]:
        """Return where a tile lies."""
        return tuple(
            slice(i * n, min((i + 1) * n, sizes[dim]))
            for i, n, dim in zip(index, self.chunks, self.dims, strict=True)
        )


def new_part(
    name: str,
    part: Part,
    sizes: Mapping[str, int],
    chunks: Mapping[str, int],
    *,
    is_open: bool = False,
) -> StoredPart:
    """Cut the dims that the call leaves open into tiles that are about as long in each."""
    quantities = {row.name: row.dtype for row in part.rows}
    whole = prod(sizes[dim] for dim in part.dims)
    if whole * max(prod(row.label_shape) for row in part.rows) >= 2**63:
        axes = " x ".join(f"{dim} {sizes[dim]}" for dim in part.dims)
        raise ParameterError(
            f"axes: got {axes} = {whole:.3g} cells, wants fewer than 2^63 numbers in an array "
            "(9.2e18): such a map fits nowhere; take coarser axes or fewer of them"
        )
    cells = min(
        MOST_CELLS,
        MOST_BYTES // max(sum(row.cell_bytes for row in part.rows), 1),
        max(FEWEST_CELLS, whole // FEWEST_TILES),
        *(row.most_cells for row in part.rows),
    )
    found = {
        dim: sizes[dim] if chunks[dim] == -1 else chunks[dim] for dim in part.dims if dim in chunks
    }
    room = max(cells // prod(found.values()), 1)
    open_dims = sorted((dim for dim in part.dims if dim not in found), key=lambda dim: sizes[dim])
    for place, dim in enumerate(open_dims):  # the shortest first: what it leaves, others take
        step = max(int(room ** (1.0 / (len(open_dims) - place)) + 1e-9), 1)
        pieces = -(-sizes[dim] // step)
        found[dim] = -(-sizes[dim] // pieces)
        room = max(room // found[dim], 1)
    chunks_of = tuple(found[dim] for dim in part.dims)
    columns = {
        dim: n
        for row in part.rows
        for dim, n in zip(row.dims, row.label_shape, strict=True)
        if dim in NUMBERED
    }
    titles = {row.name for one in part.passes for row in one.rows}
    stored = StoredPart(
        name,
        part.dims,
        chunks_of,
        quantities,
        inputs=tuple(sorted(part.inputs)),
        columns=columns if is_open else None,
        own=tuple(row for row in part.rows if row.name in titles),
    )
    _refuse_large_tiles(stored)
    return stored


def cut_again(
    part: StoredPart,
    names: Iterable[str],
    before: Mapping[str, int],
    sizes: Mapping[str, int],
    chunks: Mapping[str, int],
) -> StoredPart:
    """Return a part of a map that is made longer, cut as if it were new if its tiles are too small.

    ``before`` and ``sizes`` are those of the dims as they were and as they will be; ``chunks`` are
    those that the call asks for, which stay as they are.
    """
    tiles = prod(part.grid(sizes))
    if tiles <= MANY_TILES or 4 * part.cells(before) > part.cells(sizes):
        return part
    if not chunks.keys().isdisjoint(part.dims):
        return part
    own = Part(part.dims, (), part.rows, tuple(names))
    fresh = new_part(part.name, own, sizes, {}, is_open=part.columns is not None)
    fresh = replace(fresh, own=part.own)
    return fresh if tiles > TOO_SMALL * prod(fresh.grid(sizes)) else part


def _refuse_large_tiles(part: StoredPart) -> None:
    """Refuse tiles that no process could hold; those cut here are never as large."""
    needed = prod(part.chunks) * part.cell_bytes
    room = room_short_of(needed) if needed > MOST_BYTES else None
    if room is None:
        return
    tile = " x ".join(f"{dim} {n}" for dim, n in zip(part.dims, part.chunks, strict=True))
    raise ParameterError(
        f"chunks: got tiles of {tile} cells, {human(needed)} of results, wants at most "
        f"{human(room)}, {SHARE:.0%} of the memory that is free; chunks= is the "
        "length of a tile along each dim: take a smaller one, or leave it out"
    )
