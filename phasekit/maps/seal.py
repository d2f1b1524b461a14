"""Checksums of what is written to Zarr in one go: of each file, in a group beside the arrays.

Other readers pass over the group. What is stored without one, as by earlier versions or by xarray
alone, opens as before; nothing is promised for it.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import AsyncIterator, Iterable, Mapping
from pathlib import Path
from typing import Any

from zarr.storage import WrapperStore

from phasekit.errors import StoreError
from phasekit.maps import files
from phasekit.maps.keys import DOCUMENT, SEAL

#: The attributes of the group.
_FILES, _DIGEST = "files", "sha256"

_WAYS = f"put its files back, compute it again, or remove {SEAL} in it to read it as it is"


def write_seal(folder: Path) -> None:
    """Record the checksums of all files in a folder of Zarr."""
    import zarr
    from zarr.storage import MemoryStore

    found = {
        file.relative_to(folder).as_posix(): hashlib.sha256(file.read_bytes()).hexdigest()
        for file in sorted(files.walk(folder))
        if file.is_file()
    }
    kept: dict[str, Any] = {}
    attributes = {_FILES: found, _DIGEST: _digest(found)}
    zarr.create_group(MemoryStore(kept), attributes=attributes, zarr_format=3)
    (folder / SEAL).parent.mkdir()
    (folder / SEAL).write_bytes(kept[DOCUMENT].to_bytes())


def sealed(store: Any, name: str) -> Sealed | None:
    """Return a store that compares what is read with its checksums; None if it has none."""
    data = files.read(store, SEAL)
    if data is None:
        return None
    try:
        attributes = json.loads(data)["attributes"]
        found = {str(key): str(digest) for key, digest in attributes[_FILES].items()}
        right = attributes[_DIGEST] == _digest(found)
    except (ValueError, TypeError, KeyError, AttributeError, RecursionError):
        right = False
    if not right:
        raise StoreError(
            f"store: {name} is damaged: {SEAL}, its checksums, has changed since it was written; "
            f"{_WAYS}"
        )
    return Sealed(store, found, name)


def _digest(found: Mapping[str, str]) -> str:
    return hashlib.sha256(json.dumps(found, sort_keys=True).encode()).hexdigest()


class Sealed(WrapperStore[Any]):
    """A store for reading, which raises a `StoreError` where it is not what was written.

    ``expected`` are the checksums of its files by name; no path is made of these names.
    """

    def __init__(self, store: Any, expected: Mapping[str, str], name: str) -> None:
        super().__init__(store)
        self.expected, self.name = dict(expected), name
        there = set(files.every_key(store))
        gone = sorted(self.expected.keys() - there)
        if gone:
            raise self._damaged(gone[0], "is gone")
        # Read here: what zarr's tasks raise is told twice.
        documents = sorted(key for key in there if key.split("/")[-1] == DOCUMENT and key != SEAL)
        self.kept = dict(files.read_all(store, documents))

    def refuse_documents(self) -> None:
        """Raise a `StoreError` where what describes the arrays is not what was written."""
        for key, data in self.kept.items():
            self._compare(key, data)

    def with_read_only(self, read_only: bool = False) -> Sealed:
        """Return itself: it only reads."""
        return self

    async def get(self, key: str, prototype: Any = None, byte_range: Any = None) -> Any:
        """Return what is stored, if it is what was written."""
        if prototype is None:
            prototype = files.default_buffer()
        if byte_range is None and self.kept.get(key) is not None:
            return prototype.buffer.from_bytes(self.kept[key])
        try:
            found = await self._store.get(key, prototype)
        except OSError as error:  # of the disk
            raise StoreError(f"store: {self.name}: {key} cannot be read: {error}") from error
        if key.split("/")[-1] != DOCUMENT:  # those are looked at all at once
            self._compare(key, None if found is None else found.as_numpy_array())
        return found if byte_range is None else await self._store.get(key, prototype, byte_range)

    async def list_dir(self, prefix: str) -> AsyncIterator[str]:
        """List what was written with it; files of others may lie there, too."""
        folder = f"{prefix.strip('/')}/".lstrip("/")
        known = {
            key[len(folder) :].split("/")[0] for key in self.expected if key.startswith(folder)
        }
        async for name in super().list_dir(prefix):
            if name in known:
                yield name

    async def _get_many(self, requests: Iterable[Any]) -> Any:
        for key, prototype, byte_range in requests:
            yield key, await self.get(key, prototype, byte_range)

    def _compare(self, key: str, data: Any) -> None:
        expected = self.expected.get(key)
        if data is None and expected is not None:
            raise self._damaged(key, "is gone")
        if data is not None and expected is None:
            raise self._damaged(key, "was not written with it")
        if data is not None and hashlib.sha256(data).hexdigest() != expected:
            raise self._damaged(key, "has changed since it was written")

    def _damaged(self, key: str, what: str) -> StoreError:
        return StoreError(f"store: {self.name} is damaged: {key} {what}; {_WAYS}")
