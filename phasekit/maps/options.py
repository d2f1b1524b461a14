"""Options of stored sweeps: chunks, dtypes, workers; read, or refused before any work."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from phasekit.cells.request import Request
from phasekit.errors import ParameterError
from phasekit.inputs import is_whole
from phasekit.labels.arguments import bad, unknown, whole
from phasekit.table.numerical import NUMERICAL_ROWS
from phasekit.table.row import Quantity


@dataclass(frozen=True)
class StoreOptions:
    """How a map is put into a Zarr store, as a call asks for it: checked against its request."""

    chunks: Mapping[str, int] = field(default_factory=dict)  # by dims; -1: the whole dim
    dtypes: Mapping[str, str] = field(default_factory=dict)  # by the names of quantities
    workers: int | None = None
    client: Any = None
    overwrite: bool = False
    force: bool = False
    compressor: str = "lz4"  # one of blosc's

    @classmethod
    def from_request(
        cls,
        request: Request,
        chunks: Any = None,
        dtype: Any = None,
        workers: Any = None,
        client: Any = None,
        *,
        overwrite: bool = False,
        force: bool = False,
    ) -> StoreOptions:
        """Check what a call asks for."""
        rows = request.rows
        if request.is_open:  # bounds of errors, which go along, keep all digits
            rows = tuple(row for row in rows if row.name not in BOUNDS)
        dtypes = check_dtypes(dtype, rows)
        tiles = check_chunks(chunks, request.grid.sizes)
        number = check_workers(workers, client)
        return cls(tiles, dtypes, number, client, overwrite, force)


#: What results in any potential say besides.
BOUNDS = {row.name for rows in NUMERICAL_ROWS.values() for row in rows}

#: What numbers can be stored as.
FLOATS = ("float32", "float64")


def check_dtypes(dtype: Any, rows: Sequence[Quantity]) -> dict[str, str]:
    """Return the dtypes that a call asks for, by the names of quantities."""
    floats = [row.name for row in rows if row.dtype in FLOATS]
    if dtype is None:
        return {}
    if not isinstance(dtype, Mapping):
        return dict.fromkeys(floats, _float("dtype", dtype))
    for name in dtype:
        if name in floats:
            continue
        if any(row.name == name for row in rows):
            raise ParameterError(
                f"dtype: got one for {name!r}, which holds codes; wants names of quantities that "
                "hold real numbers"
            )
        raise unknown("dtype: the quantity", name, floats)
    return {name: _float(f"dtype of {name}", value) for name, value in dtype.items()}


def _float(what: str, value: Any) -> str:
    try:
        name = str(np.dtype(value).name) if value is not None else ""
    except TypeError:
        name = ""
    if name not in FLOATS:
        raise bad(what, value, " or ".join(map(repr, FLOATS)))
    return name


def check_chunks(chunks: Any, sizes: Mapping[str, int]) -> dict[str, int]:
    """Return the sizes of tiles that a call asks for, by dims; -1 means all."""
    if chunks is None:
        return {}
    given = dict(chunks) if isinstance(chunks, Mapping) else dict.fromkeys(sizes, chunks)
    wants = "a number of cells >= 1 or -1 (all), or such numbers by the names of dims"
    for dim, size in given.items():
        if dim not in sizes:
            raise unknown("chunks: dim", dim, sizes)
        if not is_whole(size):
            raise bad("chunks", size if isinstance(chunks, Mapping) else chunks, wants)
        if size != -1 and size < 1:
            raise bad("chunks", size, wants)
    return {dim: int(size) for dim, size in given.items()}


def check_workers(workers: Any, client: Any) -> int | None:
    """Return a number of processes, or None."""
    if workers is None:
        return None
    number = whole("workers", workers, "a number of processes >= 1")
    if client is not None:
        raise ParameterError(
            "workers: got it together with client=, wants one of them: a cluster has its own"
        )
    return number


def without_store(option: str, value: Any) -> ParameterError:
    """Return the error for an option that only a Zarr store has; the caller raises it."""
    return bad(
        option,
        value,
        "None, for what is not put into a Zarr store tile by tile: maps without a store, or in a "
        ".nc file",
        "give store='map.zarr', or leave it out",
    )
