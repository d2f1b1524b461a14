"""What is stored in one go, netCDF maps and branches; and maps read back as they were."""

from __future__ import annotations

import contextlib
import json
import os
from collections.abc import Iterator
from os import PathLike
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr

from phasekit.cells.schema import restore
from phasekit.errors import ParameterError, StoreError
from phasekit.inputs import call_checked
from phasekit.labels.arguments import bad, flag
from phasekit.labels.grid import tiles
from phasekit.maps import files, netcdf, replacing
from phasekit.maps.keys import DOCUMENT
from phasekit.maps.place import NETCDF, ZARR, Place, place_of
from phasekit.maps.stored_arrays import read_plan, reason, refuse_strange, zarr_group
from phasekit.maps.unfinished import open_stored
from phasekit.systems.identity import MODEL, model_name


class WholeTarget:
    """A local name for a Dataset; everything that can be refused is refused before it is made."""

    def __init__(self, place: Place, *, overwrite: bool = False) -> None:
        if place.path is None:
            raise StoreError(f"store: {place.name} is no local path, which this is written to")
        self.path = place.path
        self.overwrite = overwrite
        if not self.path.parent.is_dir():
            raise StoreError(f"store: the folder {self.path.parent} does not exist; make it first")
        if not os.access(self.path.parent, os.W_OK):
            raise StoreError(f"store: the folder {self.path.parent} cannot be written to")
        if place.is_netcdf:
            netcdf.need_h5netcdf()
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
        if self.path.is_dir():
            refuse_strange(
                Place(str(self.path), path=self.path).open(read_only=True), str(self.path)
            )

    def write(self, ds: xr.Dataset) -> None:
        """Write a Dataset in one go; the name appears only when it is complete."""
        try:
            replacing.sweep(self.path)
            with replacing.scratch(self.path) as folder:
                fresh, ds = folder / self.path.name, files.with_texts(ds)
                if self.path.suffix == ZARR:
                    from phasekit.maps.seal import write_seal  # here: it loads zarr

                    ds.to_zarr(fresh, mode="w-", zarr_format=3, consolidated=False)
                    documents = {
                        file.relative_to(fresh).as_posix(): file.read_bytes()
                        for file in fresh.rglob(DOCUMENT)
                    }
                    (fresh / DOCUMENT).write_bytes(files.gathered(documents))
                    write_seal(fresh)
                else:
                    netcdf.write(ds, fresh)
                self._refuse_existing()  # it may have appeared while the map was computed
                replacing.put(fresh, self.path)
        except (OSError, MemoryError) as error:
            if isinstance(error, StoreError):
                raise
            why = error if isinstance(error, OSError) else reason(error)
            raise StoreError(f"store: {self.path} was not written: {why}") from error


def target_of(store: Any) -> Place:
    """Return the place for a map, which is a name that ends in .zarr or .nc, a URL or a store."""
    place = place_of(store)
    if place.path is not None and place.path.suffix not in (ZARR, NETCDF):
        raise bad("store", os.fspath(store), "a path that ends in .zarr or .nc")
    return place


@call_checked
def open_map(
    store: str | PathLike[str] | Any, *, chunks: Any = None, verify: bool = False
) -> xr.Dataset:
    """Open a stored map, with its dtypes and attributes.

    Coordinates and metadata are compared with what was written, of netCDF files all but arrays of
    numbers, and of each finished tile of a Zarr store the presence and size of its files; values
    when they are read, by checksums.

    Parameters
    ----------
    store : path, URL or zarr store
        A Zarr store (a folder, or what fsspec or zarr know) or a netCDF file (``.nc``) that
        phasekit wrote, or that holds a Dataset of phasekit.
    chunks : optional
        Chunks of dask arrays, as in `xarray.open_dataset`. Default: no dask; values are read
        when they are used.
    verify : bool, default False
        Read all files at once and compare their checksums. Files of phasekit before checksums are
        only read through.

    Returns
    -------
    xarray.Dataset
        The map; `xarray.Dataset.load` reads it whole, `xarray.Dataset.close` closes the file.
        A map that `sweep` has not finished, or is writing now, has a variable ``computed`` on its
        dims: whether all quantities of a cell are there. Where they are not, floats are NaN and
        codes not_computed; it is the map as it was when it was opened.

    Raises
    ------
    StoreError
        If there is nothing, what is there is not a map of phasekit, or it is damaged: with what
        and where. Values of a Dataset that is open raise it as well, when they are read.

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
    flag("verify", verify)
    place = place_of(store)
    if place.path is not None and not place.path.exists():
        raise StoreError(f"store: {place.name} does not exist")
    with _as_store_error(place.name):
        if place.path is not None and not place.path.is_dir():
            netcdf.refuse_no_netcdf(place.path)
            ds = netcdf.open_netcdf(place.path, chunks, verify=verify)
            plan = None
        else:
            source = place.open(read_only=True)
            plan = read_plan(source)
            if plan is None:
                ds = _whole(source, place.name, chunks)
            else:
                ds = open_stored(source, plan, place.name, chunks, verify=verify)
        model_name(ds)
        if verify and plan is None:
            for variable in ds.variables.values():
                for tile in tiles(variable.shape, 1 << 24):
                    np.asarray(variable[tile])
        return restore(ds)


def _whole(source: Any, name: str, chunks: Any) -> xr.Dataset:
    """Open a store that was written in one go."""
    from phasekit.maps.seal import sealed  # here: it loads zarr

    store = sealed(source, name)
    if store is not None:
        store.refuse_documents()
        source = store
    ds: xr.Dataset = xr.open_zarr(source, consolidated=False, chunks=chunks, zarr_format=3)
    group = zarr_group(source)
    encodings = (group[name].metadata.chunk_key_encoding for name in ds.data_vars)
    if any(getattr(encoding, "separator", "/") == "." for encoding in encodings):
        raise StoreError(
            f"store: {name} is damaged: its group sweep is gone, which says what is computed; put "
            "it back, or pass overwrite=True to sweep"
        )
    # A sweep that began after the look for a plan has written coordinates by now, and no data yet.
    if not ds.variables or read_plan(source) is not None:
        raise StoreError(
            f"store: {name} cannot be opened: its arrays are being created, or their creation was "
            f"interrupted; wait, or repeat the call of sweep"
        )
    return ds


@contextlib.contextmanager
def _as_store_error(name: str) -> Iterator[None]:
    try:
        yield
    except ParameterError as error:
        raise StoreError(f"store: {name} is not a map of phasekit: {error}") from error
    except StoreError:
        raise
    except FileNotFoundError as error:
        raise StoreError(
            f"store: {name} cannot be read: there is no map, or not yet; Zarr is read in format 3"
        ) from error
    except Exception as error:  # whatever is made of files that are not what they were
        raise StoreError(f"store: {name} cannot be read: {reason(error)}") from error


def _is_map_file(path: Path) -> bool:
    """Whether overwriting may remove it: a store that says which model of phasekit made it."""
    if path.is_symlink():
        return False
    try:
        if path.suffix == ZARR:
            return MODEL in json.loads((path / "zarr.json").read_bytes())["attributes"]
        import h5netcdf

        netcdf.refuse_endless(path)
        with h5netcdf.File(path, "r") as file:
            return MODEL in file.attrs
    except (OSError, ValueError, KeyError, TypeError, StoreError):
        return False
