"""All that opening a finished map takes, in one file: its documents, and the marks of its tiles.

Where each file is a request to another machine, a map of many tiles opens by this file alone. The
plan names it by its digest, in the same write that says that the map is complete; what changes the
map writes a plan without it first. Whatever it holds is in files of its own as well.
"""

from __future__ import annotations

import base64
import hashlib
import json
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from math import prod
from typing import Any

import numpy as np

from phasekit.maps import files
from phasekit.maps.keys import DOCUMENT, PACKED
from phasekit.maps.marks import Chunk, Index, Mark
from phasekit.maps.parts import StoredPart
from phasekit.maps.plan import Plan

#: What is packed of a chunk; a size of 0 is that of one that is not written.
_CHUNK = np.dtype([("size", "<u4"), ("checksum", "u1", 4)])


class PackedMarks(Mapping[Index, Mark]):
    """The marks of all tiles of a part, made when they are asked for."""

    def __init__(self, part: StoredPart, grid: tuple[int, ...], chunks: Any) -> None:
        self.names, self.grid, self.chunks = tuple(part.quantities), grid, chunks

    def __getitem__(self, index: Index) -> Mark:
        """Return the mark of a tile; its inputs were compared when it was packed."""
        if len(index) != len(self.grid) or any(
            not 0 <= i < n for i, n in zip(index, self.grid, strict=True)
        ):
            raise KeyError(index)
        row = self.chunks[index]
        return Mark("", {name: _chunk(one) for name, one in zip(self.names, row, strict=True)})

    def __iter__(self) -> Iterator[Index]:
        """Return the tiles, row by row."""
        return np.ndindex(*self.grid)

    def __len__(self) -> int:
        """Return the number of tiles."""
        return prod(self.grid)


def _chunk(found: Any) -> Chunk | None:
    size = int(found["size"])
    return Chunk(size, found["checksum"].tobytes().hex()) if size else None


@dataclass(frozen=True)
class Packed:
    """What the file holds."""

    documents: Mapping[str, bytes]  # of arrays and coordinates, and the store's own
    marks: Mapping[str, Mapping[Index, Mark]]  # by part


def may_be_packed(plan: Plan) -> bool:
    """Whether all of a map is there and has checksums."""
    return (
        plan.ready
        and not plan.before
        and bool(plan.parts and plan.root)
        and all(part.complete and part.checked for part in plan.parts)
    )


def packed_bytes(
    plan: Plan, documents: Mapping[str, Any], marks: Mapping[str, Mapping[Index, Mark]]
) -> bytes | None:
    """Return the file of a complete map; None where a tile has no mark."""
    chunks = {}
    for part in plan.parts:
        grid = part.grid(plan.sizes)
        known = marks[part.name]
        if len(known) != prod(grid):
            return None
        found = np.zeros((*grid, len(part.quantities)), _CHUNK)
        for index, mark in known.items():
            for place, name in enumerate(part.quantities):
                chunk = mark.chunks[name]
                if chunk is not None:
                    found[(*index, place)] = chunk.size, list(bytes.fromhex(chunk.checksum))
        chunks[part.name] = _text(found.tobytes())
    kept = {key: _text(documents[key]) for key in sorted({*plan.documents, DOCUMENT})}
    attributes = {"documents": kept, "chunks": chunks}
    # A group of Zarr, so that other readers know what they see.
    group = {"zarr_format": 3, "node_type": "group", "attributes": attributes}
    return json.dumps(group, separators=(",", ":")).encode()


def _text(data: bytes) -> str:
    return base64.b64encode(data).decode()


def digest_of(data: bytes) -> str:
    """Return what the plan records of the file."""
    return hashlib.sha256(data).hexdigest()


def read_packed(store: Any, plan: Plan) -> Packed | None:
    """Return what the file of a map holds; None if there is none, or it is not what was written."""
    if not plan.packed or not may_be_packed(plan):
        return None
    data = files.read(store, PACKED)
    if data is None or digest_of(data) != plan.packed:
        return None
    try:
        found = json.loads(data)["attributes"]
        documents = {
            key: base64.b64decode(found["documents"][key], validate=True)
            for key in (*plan.documents, DOCUMENT)
        }
        marks = {}
        for part in plan.parts:
            grid = part.grid(plan.sizes)
            chunks = base64.b64decode(found["chunks"][part.name], validate=True)
            shape = (*grid, len(part.quantities))
            marks[part.name] = PackedMarks(part, grid, np.frombuffer(chunks, _CHUNK).reshape(shape))
    except (ValueError, TypeError, KeyError, AttributeError, RecursionError, OverflowError):
        return None
    return Packed(documents, marks)
