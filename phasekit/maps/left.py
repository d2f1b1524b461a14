"""What is left of a part of a stored map: which tiles, and what is needed to compute them."""

from __future__ import annotations

import itertools
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from math import prod
from typing import Any

import numpy as np

from phasekit.cells.request import Request, fitted, needs_of, passes_of
from phasekit.errors import StoreError
from phasekit.labels.grid import cut
from phasekit.maps.marks import Index, Inputs, Marks
from phasekit.maps.parts import StoredPart
from phasekit.maps.place import Place
from phasekit.maps.plan import Plan
from phasekit.maps.tile import Tile
from phasekit.table.quantities import TABLE
from phasekit.table.row import Pass

#: Bytes that a file takes at least.
FILE_BYTES = 4096


@dataclass(frozen=True)
class Left:
    """The tiles of a part that are not done: counted and found without a list of them."""

    plan: Plan
    part: StoredPart
    marks: Marks

    @property
    def sizes(self) -> Mapping[str, int]:
        """Sizes of the map's dims."""
        return self.plan.sizes

    @cached_property
    def grid(self) -> tuple[int, ...]:
        """Number of tiles along each dim."""
        return self.part.grid(self.sizes)

    @cached_property
    def _done(self) -> Any:
        """Places of the tiles that are done, counted row by row."""
        places = [_place_of(index, self.grid) for index in self.marks.done]
        return np.sort(np.array(places, np.int64))

    def __len__(self) -> int:
        """Return the number of tiles."""
        return prod(self.grid) - len(self._done)

    @cached_property
    def cells(self) -> int:
        """Number of cells."""
        done = (self.part.region(index, self.sizes) for index in self.marks.done)
        cells: int = sum(prod(piece.stop - piece.start for piece in region) for region in done)
        return self.part.cells(self.sizes) - cells

    def tile(self, number: int) -> Index:
        """Return one of the tiles, by its place among those that are left."""
        before = self._done - np.arange(len(self._done))  # tiles that are left before each
        return _index_of(number + int(np.searchsorted(before, number, side="right")), self.grid)

    def indices(self) -> Iterator[Index]:
        """Return the tiles, row by row."""
        for index in itertools.product(*map(range, self.grid)):
            if index not in self.marks.done:
                yield index

    @property
    def raw(self) -> int:
        """Bytes before compression."""
        return self.cells * self.part.cell_bytes

    @property
    def overhead(self) -> int:
        """Bytes that files and folders take beside what is in them, at most."""
        rows = len(self.part.quantities)
        return FILE_BYTES * (len(self) * (rows + 1) + 2 * rows)

    def samples(self, place: Place, request: Request, most: int) -> list[Tile]:
        """Return at most so many tiles, evenly over those that are left."""
        count = len(self)
        chosen = sorted({i * (count - 1) // max(most - 1, 1) for i in range(most)})
        return list(self.tiles(place, request, map(self.tile, chosen)))

    def tiles(
        self, place: Place, request: Request, indices: Iterable[Index] | None = None
    ) -> Iterator[Tile]:
        """Return tiles with what is needed to compute them; by default all that are left."""
        part, grid = self.part, request.grid
        rows = part.rows
        passes: Sequence[Pass] = passes_of(request.system, rows, table=request.table)
        if request.is_open and request.table is TABLE:
            passes = fitted(request.system, rows, passes)[1]
        names = {
            name for needs in needs_of(request.system, tuple(passes)).values() for name in needs
        }
        missing = sorted(names - grid.inputs.keys())
        if missing:
            raise StoreError(
                f"store: {', '.join(part.quantities)} are not complete and need "
                f"{', '.join(missing)}; make the call as it was"
            )
        arrays = {name: grid.aligned(name, part.dims) for name in sorted(names)}
        made_of = Inputs(self.plan, part, grid.inputs)
        marked = self.marks.others | self.marks.shorter.keys() | self.marks.uneven.keys()
        for index in self.indices() if indices is None else indices:
            region = part.region(index, self.sizes)
            yield Tile(
                place,
                self.plan.generation,
                part.name,
                index,
                made_of.digest(index, self.sizes),
                index in marked,
                region,
                type(request.system),
                tuple(passes),
                rows,
                {name: np.array(cut(array, region)) for name, array in arrays.items()},
                part.chunks,
                part.columns or {},
                self.marks.uneven.get(index),
            )


def _place_of(index: Index, grid: Sequence[int]) -> int:
    place = 0
    for i, n in zip(index, grid, strict=True):
        place = place * n + i
    return place


def _index_of(place: int, grid: Sequence[int]) -> Index:
    found = []
    for n in reversed(grid):
        place, i = divmod(place, n)
        found.append(i)
    return tuple(reversed(found))
