"""Maps and branches in netCDF files, with checksums of all that they hold.

Arrays of numbers have those of HDF5, which reading compares. HDF5 has none for the rest: a digest
of attributes, dims, scalars and texts stands in a group of the file, which other readers pass over.
"""

from __future__ import annotations

import hashlib
import math
import mmap
import os
import struct
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr

from phasekit.errors import StoreError
from phasekit.labels.grid import LABEL_DTYPE

#: The group and its attributes.
GROUP, DIGEST, NUMBERS = "phasekit", "digest", "numbers"
#: Most numbers of an array that are held at once to make their digest.
MOST_HELD = 1 << 23
#: How a heap of texts and references begins, in version 1 of the format of HDF5, its only one.
HEAP = b"GCOL\x01\0\0\0"


def need_h5netcdf() -> None:
    """Raise a `StoreError` where netCDF files cannot be read and written."""
    try:
        import h5netcdf  # noqa: F401
    except ImportError:
        raise StoreError(
            "store: netCDF needs h5netcdf and h5py: pip install 'phasekit[netcdf]'; "
            "or use a name that ends in .zarr"
        ) from None


def refuse_no_netcdf(path: Path) -> None:
    """Raise a `StoreError` where a file is not of HDF5, as netCDF-4 is."""
    need_h5netcdf()
    import h5py

    if not h5py.is_hdf5(path):
        raise StoreError(
            f"store: {path} cannot be read: it is a file, but no netCDF-4; a map is one, or "
            "a folder of Zarr"
        )


def write(ds: xr.Dataset, path: Path) -> None:
    """Write a Dataset, with its digest last."""
    import h5netcdf

    # How xarray learns that objects are texts depends on pandas' version; these are written alike.
    texts = {name: v for name, v in ds.variables.items() if v.dtype == LABEL_DTYPE}
    ds = ds.assign({name: variable.astype(str) for name, variable in texts.items()})
    for variable in ds.variables.values():
        if variable.size and variable.ndim and _is_numeric(variable.dtype):
            variable.encoding = {**variable.encoding, "fletcher32": True}
    ds.to_netcdf(path, mode="w", format="NETCDF4", engine="h5netcdf")
    with h5netcdf.File(path, "a", decode_vlen_strings=True) as file:  # as xarray reads it
        found, numbers = digest(file), digest_of_numbers(file)
        group = file.create_group(GROUP)
        group.attrs[DIGEST], group.attrs[NUMBERS] = found, numbers


def digest(file: Any) -> str:
    """Return the digest of what has no checksum in HDF5: all but the values of numeric arrays."""
    sizes = _sizes(file)
    found = hashlib.sha256(repr(sorted(sizes.items())).encode())
    _attributes(found, file)
    for name, variable in sorted(file.variables.items()):
        dims, dtype = variable.dimensions, variable.dtype
        found.update(repr((name, dims, tuple(sizes[dim] for dim in dims))).encode())
        found.update(str(dtype).encode())
        _attributes(found, variable)
        if not dims or not _is_numeric(dtype):
            _value(found, variable[...])
    return found.hexdigest()


def digest_of_numbers(file: Any) -> str:
    """Return the digest of numeric arrays, whose checksums do not tell where each part belongs."""
    found, sizes = hashlib.sha256(), _sizes(file)
    for name, variable in sorted(file.variables.items()):
        dims = variable.dimensions
        if dims and _is_numeric(variable.dtype):
            found.update(repr(name).encode())
            count, *others = (sizes[dim] for dim in dims)
            rows = max(1, MOST_HELD // max(1, math.prod(others)))
            for first in range(0, count, rows):
                found.update(np.ascontiguousarray(variable[first : first + rows]).tobytes())
    return found.hexdigest()


def _sizes(file: Any) -> dict[str, int]:
    """Sizes of a file's dims: h5netcdf opens each dim of an array to tell its shape."""
    return {name: dim.size for name, dim in file.dimensions.items()}


def has_digest(path: Path) -> bool:
    """Whether a file has a digest; its arrays have checksums then."""
    import h5netcdf

    with h5netcdf.File(path, "r") as file:
        return GROUP in file.groups and DIGEST in file[GROUP].attrs


def _attributes(found: Any, owner: Any) -> None:
    for name, value in sorted(owner.attrs.items()):
        found.update(repr(name).encode())
        _value(found, value)


def _value(found: Any, value: Any) -> None:
    array = np.asarray(value)
    found.update(repr((array.dtype.kind, array.shape)).encode())
    found.update(array.tobytes() if _is_numeric(array.dtype) else repr(array.tolist()).encode())


def _is_numeric(dtype: np.dtype[Any]) -> bool:
    return dtype.kind in "biuf"


def refuse_endless(path: Path) -> None:
    """Raise a `StoreError` where HDF5 would read a file for ever.

    It goes from object to object of a heap by their sizes, one of which damage may have made 0.
    """
    if not path.stat().st_size:
        return
    with path.open("rb") as file, mmap.mmap(file.fileno(), 0, access=mmap.ACCESS_READ) as data:
        heap = data.find(HEAP)
        while heap >= 0:
            if not _comes_to_its_end(data, heap):
                raise StoreError(
                    f"store: {path} is damaged: a heap of its texts has no end; restore the file, "
                    "or compute it again"
                )
            heap = data.find(HEAP, heap + len(HEAP))


def _comes_to_its_end(data: mmap.mmap, heap: int) -> bool:
    """Whether the sizes of a heap's objects lead to its end."""
    at = heap + 16
    if at > len(data):
        return True
    end = min(heap + struct.unpack_from("<Q", data, heap + 8)[0], len(data))
    while at + 16 <= end:
        number, size = struct.unpack_from("<H6xQ", data, at)
        # Of free space, which has no number, the size is that of all; of others that of the rest.
        taken = 16 + (size + 7) // 8 * 8 if number else size
        if not taken:
            return False
        at += taken
    return True


def _refuse_others(path: Path) -> None:
    """Raise a `StoreError` where values of a file are read from others, or parts of them lost."""
    import h5py

    def look(name: str, link: Any) -> str | None:
        if isinstance(link, h5py.ExternalLink):
            return name
        if isinstance(link, h5py.HardLink):
            found = file[name]
            if isinstance(found, h5py.Dataset) and (found.external or found.is_virtual):
                return name
        return None

    with h5py.File(path, "r") as file:
        other = file.visititems_links(look)
        lost = file.visititems(_lacks_chunks) if other is None and GROUP in file else None
    if lost is not None:
        raise StoreError(
            f"store: {path} is damaged: parts of {lost} are gone; restore the file, or compute it "
            "again"
        )
    if other is not None:
        raise StoreError(
            f"store: {path} is refused: the values of {other} are in another file, wants them here"
        )


def _lacks_chunks(name: str, found: Any) -> str | None:
    """The name of an array of which HDF5 would give zeros, since its index of chunks lost some."""
    chunks = getattr(found, "chunks", None)
    if chunks is None:
        return None
    whole = math.prod(-(-size // part) for size, part in zip(found.shape, chunks, strict=True))
    return name if found.id.get_num_chunks() != whole else None


def open_netcdf(path: Path, chunks: Any = None, *, verify: bool = False) -> xr.Dataset:
    """Open a file; its digest is compared if it has one, checksums of arrays when they are read.

    With `verify` all numbers are read and compared as well.
    """
    need_h5netcdf()
    refuse_endless(path)
    _refuse_others(path)
    try:
        from phasekit.maps.netcdf_store import Store
    except ImportError:  # a name is gone: HDF5 says in its own words which array is damaged
        import h5netcdf

        with h5netcdf.File(path, "r", decode_vlen_strings=True) as file:
            _refuse_damaged(file, path, verify)
        return xr.open_dataset(path, engine="h5netcdf", chunks=chunks)
    store = Store.open(os.path.abspath(path))
    store.path, store.written = path, path.stat().st_mtime_ns
    try:
        _refuse_damaged(store.ds, path, verify)
        return xr.open_dataset(store, chunks=chunks)
    except BaseException:
        store.close()
        raise


def _refuse_damaged(file: Any, path: Path, verify: bool) -> None:
    """Raise a `StoreError` where a file's digests are not those of what it holds."""
    if GROUP not in file.groups:
        return
    given = file[GROUP].attrs
    if verify and given.get(NUMBERS) not in (None, digest_of_numbers(file)):
        raise StoreError(
            f"store: {path} is damaged: numbers have changed since it was written; restore the "
            "file, or compute it again"
        )
    if given.get(DIGEST) != digest(file):
        raise StoreError(
            f"store: {path} is damaged: its attributes, scalars or texts have changed since it "
            f"was written; restore the file, or compute it again"
        )
