"""xarray's store of netCDF files, whose arrays say what is wrong with them.

By names that xarray does not publish: `phasekit.maps.netcdf` does without this module where one of
them is gone.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import xarray as xr
from xarray.backends import H5NetCDFStore
from xarray.backends.h5netcdf_ import H5NetCDFArrayWrapper
from xarray.core.indexing import LazilyIndexedArray

from phasekit.errors import StoreError


class Array(H5NetCDFArrayWrapper):
    """An array of a file; a checksum that is wrong raises a `StoreError` when it is read."""

    def _getitem(self, key: Any) -> Any:
        try:
            return super()._getitem(key)  # type: ignore[no-untyped-call]
        except OSError as error:
            raise StoreError(
                f"store: {self.datastore.path} is damaged: {self.variable_name} cannot be read: "
                f"{error}; restore the file, or compute it again"
            ) from error


class Store(H5NetCDFStore):
    """A file whose arrays say what is wrong with it."""

    path: Path
    written: int  # so that dask tells a file from one that stood there before

    def open_store_variable(self, name: str, var: Any) -> xr.Variable:
        """Return a variable whose values are read by `Array`."""
        variable = super().open_store_variable(name, var)  # type: ignore[no-untyped-call]
        data = LazilyIndexedArray(Array(name, self))  # type: ignore[no-untyped-call]
        return xr.Variable(variable.dims, data, variable.attrs, variable.encoding)
