"""Stored maps: written whole under a temporary name and renamed, read back as they were."""

from __future__ import annotations

import contextlib
import json
import os
import tempfile
from collections.abc import Iterator
from os import PathLike
from pathlib import Path
from typing import Any

import xarray as xr

from phasekit.errors import ParameterError, StoreError
from phasekit.labelled.arguments import bad, flag
from phasekit.labelled.schema import MODEL, model_name, restore

ZARR, NETCDF = ".zarr", ".nc"


class StoreTarget:
    """A place for a map; everything that can be refused is refused before the map is made."""

    def __init__(self, store: str | PathLike[str], *, overwrite: bool = False) -> None:
        flag("overwrite", overwrite)
        self.path = _path(store)
        self.overwrite = overwrite
        if not self.path.parent.is_dir():
            raise StoreError(f"store: the folder {self.path.parent} does not exist; make it first")
        if not os.access(self.path.parent, os.W_OK):
            raise StoreError(f"store: the folder {self.path.parent} cannot be written to")
        if self.path.suffix == NETCDF:
            _need_h5netcdf()
        self._refuse_existing()

    def _refuse_existing(self) -> None:
        if not os.path.lexists(self.path):
            return
        if not self.overwrite:
            raise StoreError(
                f"store: {self.path} exists; choose another name, or pass overwrite=True"
            )
        if not _is_map_file(self.path):
            raise StoreError(
                f"store: {self.path} exists and is not a map, so it is not overwritten; "
                "choose another name"
            )

    def write(self, ds: xr.Dataset) -> None:
        """Write a Dataset in one go; the name appears only when the map is complete."""
        folder = self.path.parent
        try:
            with tempfile.TemporaryDirectory(prefix=f".{self.path.name}.", dir=folder) as scratch:
                fresh = Path(scratch) / self.path.name
                if self.path.suffix == ZARR:
                    ds.to_zarr(fresh, mode="w-", zarr_format=3, consolidated=False)
                else:
                    ds.to_netcdf(fresh, mode="w", format="NETCDF4", engine="h5netcdf")
                self._refuse_existing()  # it may have appeared while the map was computed
                if self.path.is_dir():
                    _replace_folder(fresh, self.path, Path(scratch) / "replaced")
                else:
                    fresh.replace(self.path)
        except OSError as error:
            if isinstance(error, StoreError):
                raise
            raise StoreError(f"store: {self.path} was not written: {error}") from error


def _replace_folder(fresh: Path, path: Path, aside: Path) -> None:
    """Put a folder in the place of another, which a rename alone does not do."""
    path.rename(aside)
    try:
        fresh.rename(path)
    except OSError:
        aside.rename(path)
        raise


def open_map(store: str | PathLike[str], *, chunks: Any = None) -> xr.Dataset:
    """Open a stored map as it was when it was written, dtypes and attributes included.

    Parameters
    ----------
    store : path
        A Zarr store (a folder) or a netCDF file (``.nc``) that phasekit wrote, or that holds a
        Dataset of phasekit.
    chunks : optional
        Chunks of dask arrays, as in `xarray.open_dataset`. Default: no dask; values are read
        when they are used.

    Returns
    -------
    xarray.Dataset
        The map; `xarray.Dataset.load` reads it whole, `xarray.Dataset.close` closes the file.

    Raises
    ------
    StoreError
        If there is nothing, or what is there is not a map of phasekit.

    Examples
    --------
    >>> import tempfile
    >>> import phasekit as pk
    >>> disk = pk.GyroRotorDisk(beta=0.3, e=0.001153, a=0.002, r=0.2, omega1=2.518)
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     ds = pk.sweep(disk, beta=[0.1, 0.2], store=f"{folder}/map.zarr")
    ...     pk.open_map(f"{folder}/map.zarr").identical(ds)
    True
    """
    path = _path(store, suffix=False)
    if not path.exists():
        raise StoreError(f"store: {path} does not exist")
    with _as_store_error(path):
        if path.is_dir():
            ds = xr.open_zarr(path, consolidated=False, chunks=chunks)
        else:
            _need_h5netcdf()
            ds = xr.open_dataset(path, engine="h5netcdf", chunks=chunks)
        model_name(ds)
        return restore(ds)


@contextlib.contextmanager
def _as_store_error(path: Path) -> Iterator[None]:
    try:
        yield
    except ParameterError as error:
        raise StoreError(f"store: {path} is not a map of phasekit: {error}") from error
    except (OSError, ValueError, KeyError) as error:
        if isinstance(error, StoreError):
            raise
        raise StoreError(f"store: {path} cannot be read: {error}") from error


def _path(store: Any, *, suffix: bool = True) -> Path:
    if not isinstance(store, (str, PathLike)) or not os.fspath(store):
        raise bad("store", store, "a path that ends in .zarr or .nc")
    try:
        path = Path(store).expanduser()
    except RuntimeError as error:  # no such user
        raise bad("store", os.fspath(store), f"a path that can exist: {error}") from None
    if "\0" in os.fspath(store):
        raise bad("store", os.fspath(store), "a path without null bytes")
    if "://" in os.fspath(store):
        raise StoreError(f"store: {os.fspath(store)} is a URL; maps are written to local paths")
    if suffix and path.suffix not in (ZARR, NETCDF):
        raise bad("store", os.fspath(store), "a path that ends in .zarr or .nc")
    return path


def _is_map_file(path: Path) -> bool:
    """Whether overwriting may remove it: a store that says which model of phasekit made it."""
    if path.is_symlink():
        return False
    try:
        if path.suffix == ZARR:
            return MODEL in json.loads((path / "zarr.json").read_bytes())["attributes"]
        import h5netcdf

        with h5netcdf.File(path, "r") as file:
            return MODEL in file.attrs
    except (OSError, ValueError, KeyError, TypeError):
        return False


def _need_h5netcdf() -> None:
    try:
        import h5netcdf  # noqa: F401
    except ImportError:
        raise StoreError(
            "store: netCDF needs h5netcdf and h5py: pip install 'phasekit[netcdf]'; "
            "or use a name that ends in .zarr"
        ) from None
