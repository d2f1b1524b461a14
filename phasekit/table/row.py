"""What the table is made of: rows, what is computed, and passes, by which function and from what.

In derived units the radian is 1 and left out: angles are in rad, rates in s-1, energies (per unit
of inertia about the shaft) in s-2, areas of the phase plane and actions in s-1.
"""

from __future__ import annotations

import importlib
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from enum import IntEnum
from typing import Any

import numpy as np

from phasekit.labels.coordinates import LABELS, Labels
from phasekit.laws.ladder import Law
from phasekit.laws.trigonometric import Trigonometric

#: Among the inputs of a pass: the law, and its parameters.
LAW = "law"

#: Inputs that many passes take: the coefficients, and a state.
ABC = ("A", "B", "C")
STATE = ("state_phi", "state_dphi")

#: Dims that many rows have.
BRANCHES = ("equilibrium",)
SADDLES = ("saddle",)
SIDES = ("saddle", "side")

#: Sources that many rows have.
FROM_ENERGY = "[Veljovic2015] (14), corrected coefficients"
FROM_MOTION = "[Veljovic2015] (12), corrected coefficients"

#: Every row by its name; filled where the table is put together.
REGISTERED: dict[str, Quantity] = {}


@dataclass(frozen=True, slots=True)
class Quantity:
    """One row: a variable of a labelled result."""

    name: str
    group: str
    dims: tuple[str, ...]
    dtype: str
    units: str
    long_name: str
    equation: str
    source: str
    flags: type[IntEnum] | None = None
    #: The most general rung of the ladder of laws on which it is computed.
    of: type[Law] = Law
    #: The equation in any potential, where `equation` is that of (A, B, C).
    general: str = ""
    #: Labels of the row's dims where they are not those of the table.
    labels: Mapping[str, Labels] | None = field(default=None, compare=False)

    @property
    def attrs(self) -> dict[str, Any]:
        """Attributes of the variable, as they stand in every Dataset."""
        attrs: dict[str, Any] = {
            "long_name": self.long_name,
            "units": self.units,
            "equation": self.equation,
            "source": self.source,
        }
        if self.flags is not None:
            attrs["flag_values"] = np.array([flag.value for flag in self.flags], dtype=np.int8)
            attrs["flag_meanings"] = " ".join(flag.name.lower() for flag in self.flags)
        return attrs

    @property
    def label_shape(self) -> tuple[int, ...]:
        """Lengths of the label dims."""
        labels = self.labels or LABELS
        return tuple(len(labels[dim][0]) for dim in self.dims)

    def labels_of(self, dim: str) -> Labels:
        """Labels of a dim, with its long name."""
        return (self.labels or LABELS)[dim]

    @property
    def cell_bytes(self) -> int:
        """Bytes that one cell of a map takes."""
        return int(np.prod(self.label_shape, dtype=int)) * np.dtype(self.dtype).itemsize


@dataclass(frozen=True, slots=True)
class Pass:
    """One call of an array function, which computes whole groups at once.

    `inputs` are coefficients (A, B, C), parameters, states, or quantities of other groups; those
    come with their label axes last. `LAW` among them is the law itself, with its parameters after
    it. The function returns one result a group, each a NamedTuple whose fields are named as the
    quantities, or arrays in the order of the group's rows.
    """

    function: str | Callable[..., Any]  # "module:name", imported when it is first needed
    inputs: tuple[str, ...]
    groups: tuple[str, ...]
    #: The rung of the ladder of laws for which it holds.
    of: type[Law] = Trigonometric
    #: Keywords that a call has to say: numbers of a center or saddle, a side.
    options: tuple[str, ...] = ()
    #: States that it can do without, with their keywords.
    optional: tuple[tuple[str, str], ...] = ()

    @property
    def resolved(self) -> Callable[..., Any]:
        """The function."""
        if not isinstance(self.function, str):
            return self.function
        module, _, name = self.function.partition(":")
        function: Callable[..., Any] = getattr(importlib.import_module(module), name)
        return function

    def call(self, *arrays: Any) -> dict[str, Any]:
        """Return the arrays by the names of the quantities."""
        result = self.resolved(*arrays)
        results = result if len(self.groups) > 1 else (result,)
        named: dict[str, Any] = {}
        for group, part in zip(self.groups, results, strict=True):
            names = [row.name for row in REGISTERED.values() if row.group == group]
            if names[0] in getattr(part, "_fields", ()):
                named.update(part._asdict())
            else:
                named.update(zip(names, part if isinstance(part, tuple) else (part,), strict=True))
        return named
