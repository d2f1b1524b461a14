"""The files of a Zarr store: read, listed and written under their keys, as they are.

zarr's arrays are the way to values. This is for what has no array (the plan), for many small files
at once (the marks of tiles), and for files whose bytes are looked at (checksums).
"""

from __future__ import annotations

import contextlib
import os
from collections.abc import Iterable, Iterator, Mapping
from pathlib import Path
from typing import Any


def read(store: Any, key: str) -> bytes | None:
    """Return what is stored under a key, None if nothing is."""
    return dict(read_all(store, [key]))[key]


def read_all(store: Any, keys: Iterable[str]) -> Iterator[tuple[str, bytes | None]]:
    """Return what is stored under keys, one after the other; None where nothing is."""
    root = _root(store)
    if root is None:
        from zarr.core.buffer import default_buffer_prototype
        from zarr.core.sync import sync

        prototype = default_buffer_prototype()
        sync(store._ensure_open())  # which zip files need
        for key in keys:
            found = sync(store.get(key, prototype))
            yield key, None if found is None else found.to_bytes()
        return
    for key in keys:
        data = None
        with contextlib.suppress(FileNotFoundError, NotADirectoryError, IsADirectoryError):
            data = (root / key).read_bytes()
        yield key, data


def sizes(store: Any, folder: str) -> dict[str, int | None]:
    """Return the files in a folder of the store, with their bytes where that costs nothing."""
    root = _root(store)
    if root is None:
        from zarr.core.sync import sync

        async def names() -> list[str]:
            await store._ensure_open()
            return [name async for name in store.list_dir(folder)]

        return dict.fromkeys(sync(names()))
    found: dict[str, int | None] = {}
    with (
        contextlib.suppress(FileNotFoundError, NotADirectoryError),
        os.scandir(root / folder) as entries,
    ):
        for entry in entries:
            with contextlib.suppress(OSError):  # a link to nothing, or gone meanwhile
                if entry.is_file():
                    found[entry.name] = entry.stat().st_size
    return found


def every_key(store: Any) -> list[str]:
    """Return the keys of all that lies in a store, links and empty folders of a disk as well."""
    root = _root(store)
    if root is None:
        from zarr.core.sync import sync

        async def keys() -> list[str]:
            await store._ensure_open()
            return [key async for key in store.list()]

        return sync(keys())
    return [entry.relative_to(root).as_posix() for entry in walk(root)]


def walk(folder: Path) -> Iterator[Path]:
    """Return all that is no folder, and folders that hold nothing."""
    with os.scandir(folder) as entries:
        for entry in entries:
            path = Path(entry.path)
            if entry.is_dir(follow_symlinks=False):
                below = iter(walk(path))
                first = next(below, None)
                yield path if first is None else first
                yield from below
            else:
                yield path


def put(store: Any, documents: Mapping[str, bytes | None]) -> None:
    """Write files, each in one piece, where they are not there already; remove those of None."""
    from zarr.core.buffer import default_buffer_prototype
    from zarr.core.sync import sync

    buffer = default_buffer_prototype().buffer
    for key, document in documents.items():
        there = read(store, key)
        if document is None:
            if there is not None:
                sync(store.delete(key))
        elif there != document:
            sync(store.set(key, buffer.from_bytes(document)))


def remove(store: Any, keys: Iterable[str]) -> None:
    """Remove files, where they are there, and folders that have taken their places."""
    from zarr.core.sync import sync

    for key in keys:
        sync(store.delete(key))


def remove_folder(store: Any, folder: str) -> None:
    """Remove a folder of the store with all that is in it."""
    from zarr.core.sync import sync

    sync(store.delete_dir(folder))


def _root(store: Any) -> Path | None:
    """Return the folder of a store on a disk."""
    from zarr.storage import LocalStore

    store = getattr(store, "_store", store)  # of one that only records
    return store.root if type(store) is LocalStore else None
