"""The files of a Zarr store: read, listed and written under their keys, as they are.

zarr's arrays are the way to values. This is for what has no array (the plan), for many small files
at once (the marks of tiles), and for files whose bytes are looked at (checksums).
"""

from __future__ import annotations

import asyncio
import contextlib
import json
import os
from collections.abc import Coroutine, Iterable, Iterator, Mapping, Sequence
from itertools import islice
from pathlib import Path
from typing import Any, TypeVar, cast

import xarray as xr

from phasekit.maps.keys import DOCUMENT, GROUP

T = TypeVar("T")

#: Files that are asked for at once where each is a request to another machine.
AT_ONCE = 64


def run(work: Coroutine[Any, Any, T]) -> T:
    """Run a coroutine in zarr's event loop, to which its stores may be bound."""
    try:
        from zarr.core.sync import sync
    except ImportError:  # zarr does not publish the name
        from phasekit.maps.courier import run_in_zarr

        return run_in_zarr(work)
    return sync(work)


def default_buffer() -> Any:
    """Return what zarr reads into."""
    from zarr.buffer import default_buffer_prototype

    return default_buffer_prototype()


def read(store: Any, key: str) -> bytes | None:
    """Return what is stored under a key, None if nothing is."""
    return dict(read_all(store, [key]))[key]


def read_all(store: Any, keys: Iterable[str]) -> Iterator[tuple[str, bytes | None]]:
    """Return what is stored under keys, in their order; None where nothing is."""
    root = folder_of(store)
    if root is None:
        wanted = iter(keys)
        while several := list(islice(wanted, AT_ONCE)):
            yield from zip(several, run(_get_all(store, several)), strict=True)
        return
    for key in keys:
        data = None
        with contextlib.suppress(FileNotFoundError, NotADirectoryError, IsADirectoryError):
            data = (root / key).read_bytes()
        yield key, data


async def _get(store: Any, key: str) -> bytes | None:
    found = await store.get(key, default_buffer())
    return None if found is None else bytes(found.to_bytes())


async def _get_all(store: Any, keys: Sequence[str]) -> list[bytes | None]:
    await _opened(store)
    return await asyncio.gather(*(_get(store, key) for key in keys))


async def _opened(store: Any) -> None:
    """Open a store that is not yet open, where zarr has stores of which that matters."""
    if hasattr(store, "_ensure_open"):
        await store._ensure_open()


async def _ready_to_list(store: Any) -> None:
    """Open a store, and let fsspec forget what it listed: other machines may have written since."""
    await _opened(store)
    system = getattr(getattr(store, "_store", store), "fs", None)
    if system is not None:
        system.invalidate_cache()


def sizes(store: Any, folder: str) -> dict[str, int | None]:
    """Return the files in a folder of the store, with their bytes where that costs nothing."""
    root = folder_of(store)
    if root is None:

        async def names() -> list[str]:
            await _ready_to_list(store)
            return [name async for name in store.list_dir(folder)]

        return dict.fromkeys(run(names()))
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
    root = folder_of(store)
    if root is None:

        async def keys() -> list[str]:
            await _ready_to_list(store)
            return [key async for key in store.list()]

        return run(keys())
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
    buffer = default_buffer().buffer
    for key, document in documents.items():
        there = read(store, key)
        if document is None:
            if there is not None:
                run(store.delete(key))
        elif there != document:
            run(store.set(key, buffer.from_bytes(document)))


def gathered(documents: Mapping[str, bytes | None]) -> bytes:
    """Return the document of a store's root with those of its arrays in it.

    Others open the store by this one file, as zarr's consolidated metadata.
    """
    root: dict[str, Any] = json.loads(documents[DOCUMENT] or b"{}")
    arrays = {
        name: json.loads(data)
        for key, data in sorted(documents.items())
        for name, _, file in [key.partition("/")]
        if file == DOCUMENT and data is not None and name != GROUP
    }
    root["consolidated_metadata"] = {
        "kind": "inline",
        "must_understand": False,
        "metadata": arrays,
    }
    return json.dumps(root, indent=2).encode()


def with_texts(ds: xr.Dataset) -> xr.Dataset:
    """Return a Dataset whose texts are objects, which all of xarray's versions write as strings."""
    texts = {name: v.astype(object) for name, v in ds.variables.items() if v.dtype.kind in "TU"}
    coords = {name: v for name, v in texts.items() if name in ds.coords}
    return ds.assign_coords(coords).assign(
        {name: v for name, v in texts.items() if name not in coords}
    )


def write_all(
    store: Any, buffers: Mapping[str, Any], *, besides: str | None = None
) -> bytes | None:
    """Write buffers of zarr under their keys, all at once, and read the file `besides` meanwhile.

    What is read is returned. After an error nothing is being written any more.
    """

    async def write() -> bytes | None:
        jobs = [store.set(key, value) for key, value in buffers.items()]
        if besides is not None:
            jobs.append(_get(store, besides))
        done = await asyncio.gather(*jobs, return_exceptions=True)
        for one in done:
            if isinstance(one, BaseException):
                raise one
        return cast(bytes | None, done[-1] if besides is not None else None)

    return run(write())


def remove(store: Any, keys: Iterable[str]) -> None:
    """Remove files, all at once, where they are there, and folders in their places."""

    async def delete() -> None:
        await asyncio.gather(*(store.delete(key) for key in keys))

    run(delete())


def remove_folder(store: Any, folder: str) -> None:
    """Remove a folder of the store with all that is in it."""
    run(store.delete_dir(folder))


def folder_of(store: Any) -> Path | None:
    """Return the folder of a store on a disk."""
    from zarr.storage import LocalStore

    store = getattr(store, "_store", store)  # of one that only records
    return store.root if type(store) is LocalStore else None
