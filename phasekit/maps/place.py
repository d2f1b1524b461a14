"""Places of stored maps: local folders, URLs that fsspec knows, and zarr's own store objects.

Only a local folder has a disk that can be full, files that a killed process left half written, and
a lock; of all else nothing is asked but to keep what it was given under a key.
"""

from __future__ import annotations

import contextlib
import os
import re
import shutil
import stat
import uuid
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any
from urllib.parse import urlsplit
from urllib.request import url2pathname

from phasekit.errors import StoreError
from phasekit.labels.arguments import bad
from phasekit.maps import files
from phasekit.maps.keys import GROUP
from phasekit.maps.replacing import put_back, sweep

if TYPE_CHECKING:
    from zarr.abc.store import Store

ZARR, NETCDF = ".zarr", ".nc"

#: What s3fs is told: one request for a file, where it would ask for the size first.
_OPTIONS = dict.fromkeys(("s3", "s3a"), {"max_concurrency": 1})

#: Files that zarr writes before it renames them; one stays behind where its writer was killed.
_PARTIAL = re.compile(r"\.[0-9a-f]{32}\.partial$")


@dataclass(frozen=True)
class Place:
    """Where a Zarr store is, or will be."""

    name: str  # as messages call it
    path: Path | None = None  # of a local folder
    url: str | None = None
    store: Any = None  # a zarr store that the caller made
    key: str = field(default_factory=lambda: uuid.uuid4().hex)  # tells it from others

    def open(self, *, read_only: bool) -> Store:
        """Return the zarr store."""
        from zarr.storage import FsspecStore, LocalStore

        if self.path is not None:
            return LocalStore(self.path, read_only=read_only)
        if self.url is None:
            store: Store = self.store
            if not read_only and store.read_only:
                raise StoreError(f"store: {self.name} was opened for reading; open it for writing")
            if not store.read_only and not store.supports_deletes:  # nor are values replaced there
                raise StoreError(
                    f"store: {self.name} is of a kind that cannot be changed once it is written, "
                    "so that a sweep could not go on; take a folder, a URL or another store"
                )
            return store.with_read_only(True) if read_only and not store.read_only else store
        try:
            options = _OPTIONS.get(urlsplit(self.url).scheme)
            return FsspecStore.from_url(self.url, options, read_only=read_only)
        except (ImportError, ValueError) as error:
            raise StoreError(
                f"store: {self.name} cannot be reached: {error}; URLs need fsspec and the package "
                "for their protocol, such as s3fs for s3://"
            ) from error

    @property
    def shared(self) -> bool:
        """Whether other processes find the same store there."""
        if self.url is not None:
            return urlsplit(self.url).scheme != "memory"
        return self.path is not None or not _in_memory(self.store)

    @property
    def is_netcdf(self) -> bool:
        """Whether it is a file, which is written in one go."""
        return self.path is not None and self.path.suffix == NETCDF

    @property
    def empty(self) -> bool:
        """Whether nothing is there; only a local folder can tell before it is opened.

        Empty folders are nothing, nor is what a killed process left half written.
        """
        if self.path is None:
            return False
        return not os.path.lexists(self.path) or (
            self.path.is_dir()
            and all(
                _PARTIAL.search(entry.name) or (entry.is_dir() and not entry.is_symlink())
                for entry in files.walk(self.path)
            )
        )

    def free_bytes(self) -> int | None:
        """Return the bytes that are free on the disk, or None where no disk is known."""
        if self.path is None:
            return None
        folder = self.path if self.path.is_dir() else self.path.parent
        return shutil.disk_usage(folder).free

    def size(self) -> int | None:
        """Return the bytes that the store takes, None where that is not known."""
        if self.path is None:
            return None
        return sum(entry.lstat().st_size for entry in files.walk(self.path))

    def refuse_file(self) -> None:
        """Raise a `StoreError` where a file is in the way."""
        if self.path is not None and self.path.exists() and not self.path.is_dir():
            raise StoreError(
                f"store: {self.name} is a file, not a folder of Zarr; choose another name"
            )

    def unwritable(self) -> str | None:
        """Return why nothing can be written, or None where it can."""
        if self.path is None:
            try:
                self.open(read_only=False)
            except StoreError as error:
                return str(error)
            return None
        folder = self.path if self.path.is_dir() else self.path.parent
        if not folder.is_dir():
            return f"store: the folder {folder} does not exist; make it first"
        if not os.access(folder, os.W_OK | os.X_OK):
            return f"store: the folder {folder} cannot be written to"
        return None

    @contextlib.contextmanager
    def locked(self) -> Iterator[None]:
        """Keep other sweeps out of a local folder, which is made, and removed if it stays empty.

        The lock is the system's and ends with the process, however that ends.
        """
        self._refuse_links()
        if self.path is None:
            yield
            return
        try:
            made = not self.path.exists()
            self.path.mkdir(exist_ok=True)
        except OSError as error:
            raise StoreError(f"store: {self.name} cannot be made: {error}") from error
        with _lock(self.path, self.name):
            try:
                yield
            finally:
                with contextlib.suppress(OSError):  # what ended the work is said, not this
                    if made and self.path.is_dir() and not any(self.path.iterdir()):
                        self.path.rmdir()

    def _refuse_links(self) -> None:
        """Raise a `StoreError` where a folder of the store is a link: nothing is written elsewhere.

        Links to files stay: they are replaced, and what they lead to is not touched.
        """
        root = self.path or (None if self.store is None else files.folder_of(self.store))
        for folder in () if root is None else (root, root / GROUP):
            with (
                contextlib.suppress(FileNotFoundError, NotADirectoryError),
                os.scandir(folder) as entries,
            ):
                for entry in entries:
                    if _leads_elsewhere(entry):
                        here = Path(entry.path).relative_to(root or "").as_posix()
                        raise StoreError(
                            f"store: {self.name} holds a link, {here}, wants a folder there: what "
                            "is written would come to lie elsewhere; put the files that it leads "
                            "to in its place"
                        )

    def clear(self, instead: Mapping[str, bytes]) -> None:
        """Remove the map that is there; what says that it is a map goes last.

        Parameters
        ----------
        instead : mapping of str to bytes
            Files that say that it is being removed, which are written first.
        """
        if self.path is None:
            import zarr

            store = self.open(read_only=False)
            with contextlib.suppress(FileNotFoundError):
                group = zarr.open_group(store, mode="r+", zarr_format=3, use_consolidated=False)
                files.put(store, instead)
                for name in sorted(group, key=instead.__contains__):
                    del group[name]
            return
        if not self.empty:
            for key, document in instead.items():
                self._write(self.path / key, document)
        last = [*(key.split("/")[0] for key in instead), "zarr.json"]
        for entry in sorted(
            self.path.iterdir(), key=lambda e: last.index(e.name) + 1 if e.name in last else 0
        ):
            if entry.is_dir() and not entry.is_symlink():
                shutil.rmtree(entry)
            else:
                entry.unlink()

    @staticmethod
    def _write(path: Path, document: bytes) -> None:
        path.parent.mkdir(exist_ok=True)
        fresh = path.with_suffix(f".{uuid.uuid4().hex}.partial")
        try:
            fresh.write_bytes(document)
            fresh.replace(path)
        finally:
            fresh.unlink(missing_ok=True)

    def sweep_leftovers(self) -> None:
        """Remove what killed processes left half written."""
        if self.path is None:
            return
        sweep(self.path)
        for entry in files.walk(self.path):
            if _PARTIAL.search(entry.name):
                entry.unlink(missing_ok=True)


def _leads_elsewhere(entry: os.DirEntry[str]) -> bool:
    """Whether it is a link, but one to a file, or what is one on Windows."""
    if entry.is_symlink():
        return not entry.is_file()
    tag = getattr(entry.stat(follow_symlinks=False), "st_reparse_tag", 0)
    return tag != 0 and tag == getattr(stat, "IO_REPARSE_TAG_MOUNT_POINT", None)


def place_of(store: Any) -> Place:
    """Return the place that an argument names."""
    if not isinstance(store, (str, os.PathLike)):
        if _is_zarr_store(store):
            return Place(str(store), store=store)
        raise bad("store", store, "a path that ends in .zarr or .nc, a URL or a zarr store")
    text = os.fspath(store)
    if not isinstance(text, str) or not text or "\0" in text:
        raise bad("store", text, "a path that ends in .zarr or .nc, without null bytes")
    if "://" in text or "::" in text:
        parts = urlsplit(text)
        if parts.scheme not in ("file", "local"):
            return Place(text, url=text, key=text)
        if parts.netloc not in ("", "localhost"):
            raise bad("store", text, "file:///path, with three slashes: a file of this machine")
        text = url2pathname(parts.path)
    path = path_at(text, "store")
    return Place(str(path), path=path.absolute(), key=str(path.absolute()))


def path_at(text: str, argument: str) -> Path:
    """The path that a text names, where what an interrupted replacement left is put back."""
    try:
        path = Path(text).expanduser()
        with contextlib.suppress(FileNotFoundError, NotADirectoryError):
            path.stat()  # which tells more than exists()
            return path
        put_back(path.absolute(), argument)
    except RuntimeError as error:  # no such user
        raise bad(argument, text, f"a path that can exist: {error}") from None
    except StoreError:
        raise
    except OSError as error:  # a name that is too long, or a folder that may not be looked into
        raise StoreError(f"{argument}: {text:.80} cannot be reached: {error.strerror}") from error
    return path


def _is_zarr_store(store: object) -> bool:
    """Whether it is a zarr store, without loading zarr for what is not."""
    if not any(cls.__module__.startswith("zarr.") for cls in type(store).__mro__):
        return False
    from zarr.abc.store import Store

    return isinstance(store, Store)


def _in_memory(store: Any) -> bool:
    from zarr.storage import MemoryStore

    return isinstance(store, MemoryStore) or isinstance(getattr(store, "_store", None), MemoryStore)


@contextlib.contextmanager
def _lock(folder: Path, name: str) -> Iterator[None]:
    try:
        import fcntl
    except ImportError:  # Windows has no locks on folders
        yield
        return
    handle = os.open(folder, os.O_RDONLY)
    try:
        try:
            fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            raise StoreError(
                f"store: another sweep is writing to {name}; wait for it or choose another name"
            ) from None
        except OSError:  # a file system without locks
            pass
        yield
    finally:
        os.close(handle)
