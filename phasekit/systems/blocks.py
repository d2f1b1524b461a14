"""Fields of many states: how many each has, and on which dims with which coordinates they lie."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import xarray as xr

from phasekit.inputs import is_whole
from phasekit.labels.arguments import bad
from phasekit.laws.formulas import NAME, is_name

#: The field that a number of states is, and the dim of fields whose places have no coordinates.
FIELD, CELL = "u", "cell"


@dataclass(frozen=True, eq=False)
class Block:
    """A field of states: its name, how many there are, its dims and the sizes of these."""

    name: str
    size: int
    dims: tuple[str, ...]
    shape: tuple[int, ...]

    @property
    def states(self) -> tuple[str, ...]:
        """Names of its states, one by one."""
        return tuple(f"{self.name}_{i}" for i in range(self.size))


def blocks_of(state: Any, coords: Mapping[str, xr.DataArray]) -> tuple[Block, ...]:
    """The fields of states, on the coordinates whose sizes fit."""
    pairs = [(FIELD, state)] if is_whole(state) else list(state)
    for name, count in pairs:
        if not is_name(name):
            raise bad("state", name, f"names that are identifiers, of at most {NAME} letters")
        if not count >= 1:
            raise bad("state", count, f"a number of states >= 1 of {name}")
    names = [name for name, _ in pairs]
    if len(set(names)) < len(names):
        raise bad("state", names, "names that differ")
    for name in coords:
        if name in names:
            raise bad("coords", name, "names of dims that are no states")
    shape = tuple(one.size for one in coords.values())
    alike = len({int(count) for _, count in pairs}) == 1
    blocks: list[Block] = []
    used: set[str] = set()
    for name, count in pairs:
        dims: tuple[str, ...] = (CELL if alike else f"{name}_{CELL}",)
        sizes: tuple[int, ...] = (int(count),)
        if coords and count == math.prod(shape):
            dims, sizes = tuple(coords), shape
        elif count in shape:
            dims = (list(coords)[shape.index(count)],)
        used.update(dims)
        blocks.append(Block(name, int(count), dims, sizes))
    unused = [name for name in coords if name not in used]
    if unused:
        name = unused[0]
        raise bad(
            "coords", f"{coords[name].size} values of {name}",
            f"as many as a field has states, or a product of them: {dict(pairs)}",
        )  # fmt: skip
    return tuple(blocks)


def coordinates_of(coords: Any) -> dict[str, xr.DataArray]:
    """Coordinates of the places of states, by dim."""
    if not isinstance(coords, Mapping):
        raise bad("coords", coords, "a mapping from names of dims to 1-D arrays")
    found = {}
    for name, values in coords.items():
        if not is_name(name):
            raise bad("coords", name, f"names that are identifiers, of at most {NAME} letters")
        wants = "a 1-D array of finite numbers"
        attrs = dict(values.attrs) if isinstance(values, xr.DataArray) else {}
        try:
            array = np.array(values, dtype=float)
        except (TypeError, ValueError):
            raise bad(f"coords[{name!r}]", values, wants) from None
        if array.ndim != 1 or not len(array) or not np.isfinite(array).all():
            raise bad(f"coords[{name!r}]", values, wants)
        array.flags.writeable = False
        found[name] = xr.DataArray(array, dims=name, attrs=attrs)
    return found


def states_of(blocks: Sequence[Block]) -> tuple[str, ...]:
    """Names of all states."""
    return tuple(name for block in blocks for name in block.states)
