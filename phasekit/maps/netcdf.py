"""Maps and branches in netCDF files, with checksums of all that they hold.

Arrays of numbers have those of HDF5, which reading compares. HDF5 has none for the rest: a digest
of attributes, dims, scalars and texts stands in a group of the file, which other readers pass over.
"""

from __future__ import annotations

import hashlib
import os
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr
from xarray.backends import H5NetCDFStore
from xarray.backends.h5netcdf_ import H5NetCDFArrayWrapper
from xarray.core.indexing import LazilyIndexedArray

from phasekit.errors import StoreError

#: The group and its attribute.
GROUP, DIGEST = "phasekit", "digest"


def need_h5netcdf() -> None:
    """Raise a `StoreError` where netCDF files cannot be read and written."""
    try:
        import h5netcdf  # noqa: F401
    except ImportError:
        raise StoreError(
            "store: netCDF needs h5netcdf and h5py: pip install 'phasekit[netcdf]'; "
            "or use a name that ends in .zarr"
        ) from None


def write(ds: xr.Dataset, path: Path) -> None:
    """Write a Dataset, with its digest last."""
    import h5netcdf

    ds = ds.copy()
    for variable in ds.variables.values():
        if variable.size and variable.ndim and _is_numeric(variable.dtype):
            variable.encoding = {**variable.encoding, "fletcher32": True}
    ds.to_netcdf(path, mode="w", format="NETCDF4", engine="h5netcdf")
    with h5netcdf.File(path, "a", decode_vlen_strings=True) as file:  # as xarray reads it
        found = digest(file)
        file.create_group(GROUP).attrs[DIGEST] = found


def digest(file: Any) -> str:
    """Return the digest of what has no checksum in HDF5: all but the values of numeric arrays."""
    found = hashlib.sha256(repr(sorted((k, d.size) for k, d in file.dimensions.items())).encode())
    _attributes(found, file)
    for name, variable in sorted(file.variables.items()):
        found.update(repr((name, variable.dimensions, variable.shape)).encode())
        found.update(str(variable.dtype).encode())
        _attributes(found, variable)
        if variable.ndim == 0 or not _is_numeric(variable.dtype):
            _value(found, variable[...])
    return found.hexdigest()


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


class _Array(H5NetCDFArrayWrapper):
    """An array of a file; a checksum that is wrong raises a `StoreError` when it is read."""

    def _getitem(self, key: Any) -> Any:
        try:
            return super()._getitem(key)  # type: ignore[no-untyped-call]
        except OSError as error:
            raise StoreError(
                f"store: {self.datastore.path} is damaged: {self.variable_name} cannot be read: "
                f"{error}; put the file back, or make it anew"
            ) from error


class _Store(H5NetCDFStore):
    """A file whose arrays say what is wrong with it."""

    path: Path
    written: int  # so that dask tells a file from one that stood there before

    def open_store_variable(self, name: str, var: Any) -> xr.Variable:
        variable = super().open_store_variable(name, var)  # type: ignore[no-untyped-call]
        data = LazilyIndexedArray(_Array(name, self))  # type: ignore[no-untyped-call]
        return xr.Variable(variable.dims, data, variable.attrs, variable.encoding)


def open_netcdf(path: Path, chunks: Any = None) -> xr.Dataset:
    """Open a file; its digest is compared if it has one, checksums of arrays when they are read."""
    need_h5netcdf()
    store = _Store.open(os.path.abspath(path))
    store.path, store.written = path, path.stat().st_mtime_ns
    try:
        file = store.ds
        if GROUP in file.groups and file[GROUP].attrs.get(DIGEST) != digest(file):
            raise StoreError(
                f"store: {path} is damaged: its attributes, scalars or texts are not what they "
                "were when it was written; put the file back, or make it anew"
            )
        return xr.open_dataset(store, chunks=chunks)
    except BaseException:
        store.close()
        raise
