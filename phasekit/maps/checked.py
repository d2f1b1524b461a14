"""Zarr stores that look at what passes through them: what was written, and whether it is read.

What is written is recorded with its checksum, in the mark of its tile. What is read is compared
with that, so that a file that is gone, was changed or stands in the place of another raises, and
never gives values.
"""

from __future__ import annotations

import hashlib
from collections.abc import AsyncIterator, Iterable, Iterator, Mapping
from typing import Any

from zarr.storage import WrapperStore

from phasekit.errors import StoreError
from phasekit.labels.coordinates import LABELS
from phasekit.maps import files
from phasekit.maps.damage import AGAIN, damage, tile_words
from phasekit.maps.keys import DOCUMENT, GROUP
from phasekit.maps.marks import Index, Mark
from phasekit.maps.packed import Packed
from phasekit.maps.plan import DEFINITION, WHOLE, Plan, root_digests


class Holding(WrapperStore[Any]):
    """A store that holds what zarr writes, so that it can go to its place all at once."""

    def __init__(self, store: Any) -> None:
        super().__init__(store)
        self.inner = store
        self.held: dict[str, Any] = {}

    async def set(self, key: str, value: Any) -> None:
        """Hold it."""
        self.held[key] = value

    def take(self) -> dict[str, Any]:
        """Return what is held, and hold it no more."""
        held, self.held = self.held, {}
        return held


class Checked(WrapperStore[Any]):
    """A store for reading a map, which raises a `StoreError` where it is not what was written.

    Files that the plan knows as they were before a change are given as they were; ``verify``
    compares the versions of libraries as well. With ``packed``, the documents in one piece, nothing
    is asked but chunks.
    """

    def __init__(
        self,
        store: Any,
        plan: Plan,
        name: str,
        *,
        verify: bool = False,
        packed: Packed | None = None,
    ) -> None:
        super().__init__(store)
        self.plan, self.name, self.verify, self.packed = plan, name, verify, packed
        self.parts = plan.quantities
        self.marks: dict[str, Mapping[Index, Mark]] = {}  # by part
        self.kept = dict(self._documents())
        self.known = {key.split("/")[0] for key in plan.documents} | {GROUP, "zarr.json"}
        self.known |= {*plan.quantities, *plan.arrays, *plan.scalars, *LABELS}

    def with_read_only(self, read_only: bool = False) -> Checked:
        """Return itself: it only reads."""
        return self

    async def get(self, key: str, prototype: Any = None, byte_range: Any = None) -> Any:
        """Return what is stored, if it is what was written."""
        if prototype is None:
            prototype = files.default_buffer()
        if key in self.kept:
            kept = self.kept[key]
            return None if kept is None else prototype.buffer.from_bytes(kept)
        chunk = self._chunk(key)
        if chunk is not None:
            return await self._result(key, *chunk, prototype)
        return await self._store.get(key, prototype, byte_range)

    def _documents(self) -> Iterator[tuple[str, bytes | None]]:
        """Read what is known beforehand, here: what zarr's tasks raise is told twice."""
        yield from self.plan.before.items()
        expected = self.plan.documents
        for key, data in self._read(expected.keys() - self.plan.before.keys()):
            right = data is not None and hashlib.sha256(data).hexdigest() == expected[key]
            yield key, self._right(key, data, right)
        if self.plan.root and DOCUMENT not in self.plan.before:
            data = dict(self._read([DOCUMENT]))[DOCUMENT]
            found = {} if data is None else root_digests(data)
            which = WHOLE if self.verify else DEFINITION
            right = found.get(which) == self.plan.root[which]
            yield DOCUMENT, self._right(DOCUMENT, data, right)

    def _read(self, keys: Iterable[str]) -> Iterator[tuple[str, bytes | None]]:
        if self.packed is None:
            return files.read_all(self._store, keys)
        return ((key, self.packed.documents[key]) for key in keys)

    def _right(self, key: str, data: bytes | None, right: bool) -> bytes | None:
        """Return a document, or raise where it is not what was written."""
        if right:
            return data
        wrong = "is gone" if data is None else "has changed since it was written"
        raise StoreError(
            f"store: {self.name} is damaged: {key} {wrong}; restore the file, choose another "
            f"name, or pass overwrite=True"
        )

    def _chunk(self, key: str) -> tuple[str, Index] | None:
        """Return the quantity and the tile of a chunk's file."""
        name, _, file = key.partition("/")
        part = self.parts.get(name)
        if part is None or not (file == "c" or file.startswith("c.")):
            return None
        return name, tuple(map(int, file.split(".")[1 : 1 + len(part.dims)]))

    async def _result(self, key: str, name: str, index: Index, prototype: Any) -> Any:
        part = self.parts[name]
        mark = self.marks.get(part.name, {}).get(index)
        if mark is None:
            return None  # not computed: it may be half written
        try:
            found = await self._store.get(key, prototype)
        except OSError as error:  # of the disk
            raise StoreError(f"store: {self.name}: {key} cannot be read: {error}") from error
        wrong = await damage(found, mark, name, prototype)
        if wrong is not None:
            raise StoreError(
                f"store: {self.name} is damaged, or was changed after it was opened: {name} in "
                f"the tile {tile_words(part, index, self.plan.sizes)} {wrong}; {AGAIN}, and open "
                "the map again"
            )
        return found

    async def _get_many(self, requests: Iterable[Any]) -> Any:
        for key, prototype, byte_range in requests:
            yield key, await self.get(key, prototype, byte_range)

    def list_dir(self, prefix: str) -> AsyncIterator[str]:
        """List what belongs to the map."""
        if self.packed is not None and not prefix.strip("/"):
            return self._packed_names()
        listed = super().list_dir(prefix)
        return listed if prefix.strip("/") or not self.plan.documents else self._own(listed)

    async def _packed_names(self) -> AsyncIterator[str]:
        for name in sorted({key.split("/")[0] for key in self.kept} - {GROUP}):
            yield name

    async def _own(self, listed: AsyncIterator[str]) -> AsyncIterator[str]:
        async for name in listed:
            if name in self.known:
                yield name
