"""Keeps xarray from loading dask to learn that an array is none of dask's.

xarray asks that of almost every array, and where dask is installed loads all of it for the answer,
a third of a second. Arrays of a module that is not loaded there are none. What xarray does with
those of dask stays as it is; without the names used here, which are not published, dask is loaded.
"""

from __future__ import annotations

import sys
from collections.abc import Callable
from typing import Any


class _DaskArrays:
    """Stands in xarray for what it holds of dask, of which all but the type loads dask."""

    def __init__(self, load: Callable[[str], Any]) -> None:
        self._load = load

    @property
    def type(self) -> tuple[Any, ...]:
        """The class of dask's arrays, none as long as dask.array is not loaded."""
        found = getattr(sys.modules.get("dask.array"), "Array", None)
        return () if found is None else (found,)

    def __getattr__(self, name: str) -> Any:
        if name.startswith("_"):  # asked for by machines
            raise AttributeError(name)
        return getattr(self._load("dask"), name)


def load_dask_later() -> None:
    """Let xarray load dask when there are arrays of dask's."""
    try:
        from xarray.namedarray import utils
        from xarray.namedarray.pycompat import DuckArrayModule, _cached_duck_array_modules
        from xarray.namedarray.utils import is_dask_collection
    except ImportError:
        return
    kept: dict[str, Any] = _cached_duck_array_modules  # type: ignore[assignment]
    if "dask" in kept:
        return
    kept["dask"] = _DaskArrays(DuckArrayModule)  # type: ignore[arg-type]

    # Without a graph dask says no as well.
    is_of_dask: Any = lambda x: hasattr(x, "__dask_graph__") and is_dask_collection(x)  # noqa: E731
    utils.is_dask_collection = is_of_dask
