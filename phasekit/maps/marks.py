"""Marks of tiles that are done: of what they were computed, and the checksums of what was written.

Each mark is a file of its own, a chunk of an array of strings. It names the quantities' chunks of
its tile with their bytes and checksums, so that one that is missing, was changed, or belongs to
another tile is noticed; and a digest of the tile's inputs, so that one of another map is no mark.
"""

from __future__ import annotations

import functools
import hashlib
import json
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
import xarray as xr
from google_crc32c import value as crc32c

from phasekit.maps import files
from phasekit.maps.keys import GROUP
from phasekit.maps.parts import StoredPart
from phasekit.maps.plan import Plan

#: Bytes of the checksum at the end of what zarr's codec crc32c wrote.
TAIL = 4

#: Bytes before a text where zarr's codec vlen-utf8 stores one: their number, and its length.
_HEAD = 8

Index = tuple[int, ...]


@dataclass(frozen=True)
class Chunk:
    """A file of a finished tile."""

    size: int
    checksum: str

    @classmethod
    def from_bytes(cls, data: Any) -> Chunk:
        """Return what is recorded of bytes that end with a checksum."""
        return cls(len(data), bytes(data[-TAIL:]).hex())


@dataclass(frozen=True)
class Mark:
    """What was recorded of a tile; without chunks where they have no checksums."""

    inputs: str  # digest
    chunks: Mapping[str, Chunk | None]  # None where zarr writes nothing, for all is its fill value
    columns: Mapping[str, int] = field(default_factory=dict)  # that its chunks have
    unproved: tuple[float, ...] = ()  # where more equilibria may be: as `numbered.unproved` says

    def text(self) -> str:
        """Write it as a line."""
        chunks = {
            name: chunk and [chunk.size, chunk.checksum] for name, chunk in self.chunks.items()
        }
        stored: dict[str, Any] = {"inputs": self.inputs, "chunks": chunks}
        stored |= {"columns": dict(self.columns)} if self.columns else {}
        stored |= {"unproved": list(self.unproved)} if self.unproved else {}
        return json.dumps(stored, separators=(",", ":"))


def sound(data: Any) -> bool:
    """Whether bytes, or an array of them, end with the checksum of those before."""
    tail = int.from_bytes(bytes(data[-TAIL:]), "little")
    return len(data) >= TAIL and crc32c(data[:-TAIL]) == tail


def key_of(index: Sequence[int]) -> str:
    """Return the name of the file of a chunk."""
    return ".".join(("c", *map(str, index)))


def read_marks(store: Any, part: StoredPart) -> dict[Index, Mark]:
    """Return the marks of a part; what cannot be read is none."""
    folder = f"{GROUP}/{part.name}"
    found = {}
    names = [name for name in files.sizes(store, folder) if name.split(".")[0] == "c"]
    for key, data in files.read_all(store, (f"{folder}/{name}" for name in names)):
        try:
            index = tuple(map(int, key.rpartition("/")[2].split(".")[1:]))
            mark = None if data is None else _mark_of(data, part)
        except (ValueError, TypeError, KeyError, AttributeError):
            continue
        own = key == f"{folder}/{key_of(index)}" and min(index, default=0) >= 0
        if mark is not None and own and len(index) == len(part.dims):
            found[index] = mark
    return found


def _mark_of(data: bytes, part: StoredPart) -> Mark | None:
    if not sound(data):
        return None
    if not part.checked:
        return Mark("", {}) if data[:-TAIL] == b"\1" else None
    stored = json.loads(data[_HEAD:-TAIL])
    chunks = ((name, stored["chunks"][name]) for name in part.quantities)
    columns = {dim: int(n) for dim, n in stored.get("columns", {}).items()}
    unproved = tuple(map(float, stored.get("unproved", ())))
    read = {name: chunk and Chunk(*chunk) for name, chunk in chunks}
    return Mark(stored["inputs"], read, columns, unproved)


class Inputs:
    """Digests of what the tiles of a part are computed from: inputs, quantities, place."""

    def __init__(self, plan: Plan, part: StoredPart, values: Mapping[str, xr.Variable]) -> None:
        self.part = part
        made = [plan.model, part.dims, part.chunks, sorted(part.quantities.items())]
        self.seed = json.dumps([*made, part.inputs]).encode()
        self.values = []
        for name in part.inputs or ():
            ordered = values[name].transpose(*(d for d in part.dims if d in values[name].dims))
            places = tuple(part.dims.index(str(dim)) for dim in ordered.dims)
            self.values.append((np.asarray(ordered.data, np.float64), places))
        self._piece = functools.cache(self._digest)

    def digest(self, index: Index, sizes: Mapping[str, int]) -> str:
        """Return the digest of a tile of a map of these sizes."""
        if not self.part.checked:
            return ""
        bounds = [(piece.start, piece.stop) for piece in self.part.region(index, sizes)]
        found = hashlib.sha256(self.seed + repr(bounds).encode())
        for number, (_, places) in enumerate(self.values):
            found.update(self._piece(number, tuple(bounds[place] for place in places)))
        return found.hexdigest()[:32]

    def _digest(self, number: int, bounds: tuple[tuple[int, int], ...]) -> bytes:
        piece = self.values[number][0][tuple(slice(*both) for both in bounds)]
        return hashlib.sha256(np.ascontiguousarray(piece, "<f8").tobytes()).digest()


@dataclass(frozen=True)
class Marks:
    """The marks of a part, sorted by whether they hold for its map."""

    done: dict[Index, Mark]  # whole tiles
    #: Tiles at the end of a map that has been made longer, and the sizes that it had.
    shorter: dict[Index, tuple[Mark, Mapping[str, int]]]
    others: frozenset[Index]
    #: Tiles whose chunks have other numbers of columns than the arrays.
    uneven: dict[Index, Mark] = field(default_factory=dict)

    def computed(self) -> dict[Index, Mark]:
        """Return what is recorded of each tile that is done, or was when the map was shorter."""
        return {**{index: mark for index, (mark, _) in self.shorter.items()}, **self.done}

    def without(self, damaged: Iterable[Index]) -> Marks:
        """Return them as if some tiles were not done."""
        gone = frozenset(damaged)
        done = {index: mark for index, mark in self.done.items() if index not in gone}
        return replace(self, done=done, others=self.others | gone)


def marks_of(
    store: Any,
    plan: Plan,
    part: StoredPart,
    values: Mapping[str, xr.Variable],
    old: Plan | None = None,
) -> Marks:
    """Return the marks of a part; those without checksums hold if the map was not shorter (old)."""
    inputs = Inputs(plan, part, values)
    done: dict[Index, Mark] = {}
    shorter: dict[Index, tuple[Mark, Mapping[str, int]]] = {}
    others = []
    uneven: dict[Index, Mark] = {}
    for index, mark in read_marks(store, part).items():
        even = mark.columns == (part.columns or {})
        if mark.inputs == _expected(inputs, index, plan.sizes, old):
            (done if even else uneven)[index] = mark
            continue
        for sizes in reversed(plan.earlier):
            if (
                even
                and part.checked
                and mark.inputs == _expected(inputs, index, {**plan.sizes, **sizes})
            ):
                shorter[index] = mark, {**plan.sizes, **sizes}
                break
        else:
            others.append(index)
    return Marks(done, shorter, frozenset(others), uneven)


def _expected(
    inputs: Inputs, index: Index, sizes: Mapping[str, int], old: Plan | None = None
) -> str | None:
    """Return the digest that a tile's mark must have; None where no mark can be."""
    part = inputs.part
    if any(i >= n for i, n in zip(index, part.grid(sizes), strict=True)):
        return None
    if not part.checked and old is not None:
        for i, n, dim in zip(index, part.chunks, part.dims, strict=True):
            if sizes[dim] > old.sizes[dim] and i >= old.sizes[dim] // n:
                return None
    return inputs.digest(index, sizes)
