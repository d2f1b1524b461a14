"""Work in zarr's event loop by its published names alone: opening a group asks a store, there."""

from __future__ import annotations

from collections.abc import Coroutine
from typing import Any, TypeVar

import zarr
from zarr.storage import MemoryStore, WrapperStore

T = TypeVar("T")

_GROUP = b'{"zarr_format": 3, "node_type": "group", "attributes": {}}'


def run_in_zarr(work: Coroutine[Any, Any, T]) -> T:
    """Run a coroutine in zarr's event loop; slower than by the name that zarr does not publish."""
    courier = _Courier(work)
    zarr.open_group(courier, mode="r+", zarr_format=3)
    if courier.error is not None:
        raise courier.error
    result: T = courier.result
    return result


class _Courier(WrapperStore[Any]):
    """A store with an empty group, that does some work when it is first asked for it."""

    def __init__(self, work: Coroutine[Any, Any, Any]) -> None:
        super().__init__(MemoryStore())
        self.work: Coroutine[Any, Any, Any] | None = work
        self.result: Any = None
        self.error: BaseException | None = None

    async def get(self, key: str, prototype: Any = None, byte_range: Any = None) -> Any:
        """Do the work, and give the group."""
        work, self.work = self.work, None
        if work is not None:
            try:
                self.result = await work
            except Exception as error:
                self.error = error
        return prototype.buffer.from_bytes(_GROUP) if key == "zarr.json" else None
