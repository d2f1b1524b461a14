"""Looking for damage: what is recorded of finished tiles, against the files that are there."""

from __future__ import annotations

import asyncio
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from itertools import islice
from math import prod
from types import SimpleNamespace
from typing import Any

import numpy as np

from phasekit.errors import StoreError
from phasekit.maps import files
from phasekit.maps.marks import Chunk, Index, Mark, Marks, key_of, sound
from phasekit.maps.parts import StoredPart
from phasekit.maps.stored_arrays import codec

AGAIN = "repeat the call of sweep, which computes these tiles again"

#: Bytes of the header of what blosc compressed, whose last number is the length of all.
_BLOSC = 16

#: Files that are read at a time, and tiles that a message names.
AT_ONCE = 8
NAMED = 3


async def damage(found: Any, mark: Mark, name: str, prototype: Any) -> str | None:
    """Say what is wrong with a quantity's chunk of a finished tile; None: nothing."""
    if not mark.chunks:  # made without checksums
        return await _undecodable(found, prototype)
    chunk = mark.chunks[name]
    if chunk is None:
        return None if found is None else "has data where none were written"
    if found is None:
        return "is gone"
    if len(found) != chunk.size:
        return f"has {len(found)} bytes in place of {chunk.size}"
    data = found.as_numpy_array()
    if not sound(data):
        return "has another checksum than its data"
    if Chunk.from_bytes(data) != chunk:
        return "has other data than were written there"
    return None


async def _undecodable(found: Any, prototype: Any) -> str | None:
    if found is None:  # nothing is written where all is the fill value
        return None
    data = found.as_numpy_array()
    if len(data) < _BLOSC or int.from_bytes(bytes(data[_BLOSC - 4 : _BLOSC]), "little") != len(
        data
    ):
        return "is not as long as it says"
    spec: Any = SimpleNamespace(prototype=prototype)
    try:
        await codec().decode([(found, spec)])
    except MemoryError:  # says nothing of the data
        raise
    except Exception:  # whatever the codec makes of it
        return "cannot be decoded"
    return None


def tile_words(part: Any, index: Index, sizes: Mapping[str, int]) -> str:
    """Write where a tile lies, as messages do."""
    bounds = (f"{piece.start}:{piece.stop}" for piece in part.region(index, sizes))
    return f"[{', '.join(bounds)}]"


@dataclass(frozen=True)
class Damage:
    """A tile that is not what was written."""

    part: StoredPart
    index: Index
    what: str  # is wrong


def lost_tiles(part: StoredPart, marks: Marks, sizes: Mapping[str, int]) -> list[Damage]:
    """Return the tiles of a part that is said to be complete which have no mark."""
    if not part.complete or len(marks.done) == prod(part.grid(sizes)):
        return []
    every = map(tuple, np.ndindex(*part.grid(sizes)))
    lost = islice((index for index in every if index not in marks.done), 10_000)
    return [Damage(part, index, "has no mark that it is done") for index in lost]


def at_a_glance(store: Any, part: StoredPart, known: Mapping[Index, Mark]) -> list[Damage]:
    """Return the finished tiles whose files are gone or have another size."""
    found: dict[Index, Damage] = {}
    for row in part.rows:
        there = files.sizes(store, row.name) if known else {}
        zeros = (0,) * len(row.dims)
        for index, mark in known.items():
            if not mark.chunks:
                continue
            name, chunk = key_of((*index, *zeros)), mark.chunks[row.name]
            what = None
            if chunk is None:
                what = "holds {}, of which nothing was written" if name in there else None
            elif name not in there:
                what = "lacks {}"
            elif there[name] not in (None, chunk.size):
                what = f"has {there[name]} bytes of {{}} in place of {chunk.size}"
            if what is not None:
                found.setdefault(index, Damage(part, index, what.format(row.name)))
    return list(found.values())


def in_full(store: Any, part: StoredPart, known: Mapping[Index, Mark]) -> list[Damage]:
    """Return the finished tiles whose files are not what was written; all are read."""
    prototype = files.default_buffer()
    wanted = (
        (index, row.name, f"{row.name}/{key_of((*index, *(0,) * len(row.dims)))}", mark)
        for index, mark in known.items()
        for row in part.rows
    )

    async def look(index: Index, name: str, key: str, mark: Mark) -> Damage | None:
        found = await store.get(key, prototype)
        wrong = await damage(found, mark, name, prototype)
        return None if wrong is None else Damage(part, index, f"is wrong: {name} {wrong}")

    async def look_at(several: Iterable[Any]) -> list[Damage | None]:
        return list(await asyncio.gather(*(look(*one) for one in several)))

    damaged: dict[Index, Damage] = {}
    while several := list(islice(wanted, AT_ONCE)):
        for one in files.run(look_at(several)):
            if one is not None:
                damaged.setdefault(one.index, one)
    return list(damaged.values())


def refuse(name: str, damaged: Sequence[Damage], sizes: Mapping[str, int]) -> None:
    """Raise a `StoreError` that names damaged tiles."""
    if damaged:
        raise StoreError(
            f"store: {name} is damaged: {describe(damaged, sizes)}; {AGAIN}, or put the files back"
        )


def describe(damaged: Sequence[Damage], sizes: Mapping[str, int]) -> str:
    """Name damaged tiles."""
    named = [
        f"the tile {tile_words(one.part, one.index, sizes)} of {_few_names(one.part)} {one.what}"
        for one in damaged[:NAMED]
    ]
    more = len(damaged) - len(named)
    return "; ".join(named) + (f"; and {more} more tiles" if more else "")


def _few_names(part: StoredPart) -> str:
    names = list(part.quantities)
    return ", ".join(names[:3]) + (", ..." if names[3:] else "")
