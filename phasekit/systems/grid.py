"""Grids on which fields live: places along axes, and differences for derivatives there."""

from __future__ import annotations

import functools
import math
import operator
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from numbers import Real
from types import MappingProxyType
from typing import Any

import numpy as np

from phasekit.arrays import Array
from phasekit.inputs import is_whole
from phasekit.labels.arguments import bad, call_checked, number, one_of, whole
from phasekit.laws.formulas import is_name, keyword_hint, write_formula

DIRICHLET, NEUMANN, PERIODIC = KINDS = ("dirichlet", "neumann", "periodic")
#: Distance of the first place from an end, in steps of the grid.
OFFSET = {DIRICHLET: 1.0, NEUMANN: 0.5}
LEAST = 3  # places of an axis


@dataclass(frozen=True, repr=False)
class Axis:
    """One axis of a grid; `grid` makes it."""

    #: What formulas and results call the coordinate.
    name: str
    #: Its ends.
    low: float
    high: float
    #: Number of places.
    n: int
    #: What holds at the low and the high end.
    boundary: tuple[str, str]
    #: For a field what it is at the ends, or at ends of the kind "neumann" its slope; 0 of others.
    values: Mapping[str, tuple[Any, Any]] = field(default_factory=dict, hash=False)

    def __repr__(self) -> str:
        """Write the call that makes it."""
        one, other = self.boundary
        parts = [f"{self.name!r}, {self.low!r}, {self.high!r}, {self.n}"]
        parts.append(f"boundary={(one if one == other else self.boundary)!r}")
        parts += [f"values={dict(self.values)!r}"] * bool(self.values)
        return f"grid({', '.join(parts)})"

    @property
    def periodic(self) -> bool:
        """Whether the ends are one place."""
        return self.boundary[0] == PERIODIC

    @property
    def step(self) -> float:
        """The distance of places."""
        if self.periodic:
            return (self.high - self.low) / self.n
        return (self.high - self.low) / (self.n - 1 + sum(OFFSET[kind] for kind in self.boundary))

    @property
    def coordinates(self) -> Array:
        """The places."""
        offset = 0.0 if self.periodic else OFFSET[self.boundary[0]]
        return np.asarray(self.low + self.step * (offset + np.arange(self.n)))

    @property
    def ends(self) -> tuple[float, ...]:
        """The coordinates of the ends at which something holds."""
        return () if self.periodic else (self.low, self.high)

    def stated(self) -> dict[str, Any]:
        """It as plain values, which `from_stated` takes."""
        values = {name: [_plain(one) for one in two] for name, two in self.values.items()}
        return {
            "name": self.name, "low": self.low, "high": self.high, "n": self.n,
            "boundary": list(self.boundary), "values": values,
        }  # fmt: skip

    @classmethod
    def from_stated(cls, given: Mapping[str, Any]) -> Axis:
        """The axis that `stated` gave."""
        made: Axis = grid(**{**given, "values": given["values"] or None})
        return made

    def __reduce__(self) -> tuple[Any, ...]:
        """Pickles hold plain values."""
        return type(self), (
            self.name, self.low, self.high, self.n, self.boundary, dict(self.values),
        )  # fmt: skip

    def differences(self, order: int, parity: int = 1) -> tuple[Any, list[Array]]:
        """The matrix of the first or second derivative, and its columns for the two ends.

        Those multiply the value beyond the end, or of the kind "neumann" the slope. What is odd
        there, such as a slope, has parity -1.
        """
        from scipy.sparse import diags_array

        h, n = self.step, self.n
        below, middle, above = {
            1: (-0.5 / h, 0.0, 0.5 / h), 2: (1.0 / h**2, -2.0 / h**2, 1.0 / h**2),
        }[order]  # fmt: skip
        matrix = diags_array(
            [np.full(n - 1, below), np.full(n, middle), np.full(n - 1, above)], offsets=[-1, 0, 1]
        ).tolil()
        if self.periodic:
            matrix[0, n - 1] += below
            matrix[n - 1, 0] += above
            return matrix.tocsr(), []
        columns = []
        for place, part, kind, out in (
            (0, below, self.boundary[0], -1.0), (n - 1, above, self.boundary[1], 1.0),
        ):  # fmt: skip
            column = np.zeros(n)
            column[place] = part
            if kind == NEUMANN:  # beyond the end it is the same, but for the slope
                matrix[place, place] += parity * part
                column[place] = part * out * h
            columns.append(column)
        return matrix.tocsr(), columns


@call_checked
def grid(
    name: str, low: float, high: float, n: int, *, boundary: str | tuple[str, str] = DIRICHLET,
    values: Mapping[str, Any] | None = None,
) -> Axis:  # fmt: skip
    """One axis of a grid, on which fields of a `Problem` live.

    Parameters
    ----------
    name : str
        What formulas and results call the coordinate, such as x.
    low, high : float
        The ends.
    n : int
        Number of places, at least 3.
    boundary : str or (str, str), default "dirichlet"
        What holds at both ends, or at each: "dirichlet", fields have a value there; "neumann",
        they have a slope; "periodic", the ends are one place.
    values : mapping of str to float, formula or pair of these, optional
        By field its value at the ends, or of "neumann" its slope, a number or a formula of the
        parameters, one for both ends or a pair. Others are 0.

    Returns
    -------
    Axis
        For ``Problem(..., grid=...)``; several make a grid of more dimensions.

    Notes
    -----
    Places have equal distances h. The first is at a distance h from an end where fields have a
    value, h/2 from one where they have a slope, and 0 of a periodic axis. Derivatives are central
    differences with errors of the order h^2 ([LeVeque2007] chapter 2).

    Examples
    --------
    >>> import phasekit as pk
    >>> axis = pk.grid("x", 0.0, 1.0, 4)
    >>> axis.coordinates.round(3).tolist(), axis.step
    ([0.2, 0.4, 0.6, 0.8], 0.2)
    >>> pk.grid("x", 0.0, 1.0, 4, boundary="neumann").coordinates.tolist()
    [0.125, 0.375, 0.625, 0.875]
    >>> bratu = pk.Problem({"u": "lap(u) + r*exp(u)"}, parameters={"r": 0.5}, grid=axis)
    >>> bratu([0.0, 0.0, 0.0, 0.0]).tolist()
    [0.5, 0.5, 0.5, 0.5]
    """
    if not is_name(name):
        raise bad("name", name, "a name that is a Python identifier", keyword_hint(name))
    low, high = number("low", low, "a finite number", None), number("high", high, "a number", None)
    if not low < high:
        raise bad("high", high, f"a number > low = {low:g}")
    n = whole("n", n, f"a whole number >= {LEAST}", LEAST)
    pair = (boundary, boundary) if isinstance(boundary, str) else boundary
    if not (isinstance(pair, (tuple, list)) and len(pair) == 2):
        raise bad("boundary", boundary, f"one of {', '.join(KINDS)}, or a pair of them")
    kinds = (KINDS[one_of("boundary", pair[0], KINDS)], KINDS[one_of("boundary", pair[1], KINDS)])
    if PERIODIC in kinds and kinds[0] != kinds[1]:
        raise bad("boundary", boundary, f"{PERIODIC!r} at both ends, or at none")
    if values is not None and not isinstance(values, Mapping):
        raise bad("values", values, "a mapping from fields to values or formulas")
    if values and PERIODIC in kinds:
        raise bad("values", dict(values), "None on a periodic axis, which has no ends")
    ends = {}
    for key, given in (values or {}).items():
        two = given if isinstance(given, (tuple, list)) else (given, given)
        if len(two) != 2:
            raise bad(f"values[{key!r}]", given, "a number or formula, or a pair of them")
        first, second = (_plain(one) if hasattr(one, "free_symbols") else one for one in two)
        ends[key] = (first, second)
    return Axis(name, low, high, n, kinds, MappingProxyType(ends))


def _plain(value: Any) -> Any:
    """A number or formula as a plain value."""
    if isinstance(value, str):
        return value
    if is_whole(value):
        return int(value)
    return float(value) if isinstance(value, Real) else write_formula(value)


def axes_of(given: Any) -> tuple[Axis, ...]:
    """The axes of a grid."""
    axes = (given,) if isinstance(given, Axis) else given
    wants = "pk.grid(name, low, high, n), or a sequence of these, one an axis"
    if not isinstance(axes, (tuple, list)) or not axes:
        raise bad("grid", given, wants)
    for axis in axes:
        if not isinstance(axis, Axis):
            raise bad("grid", axis, wants)
    names = [axis.name for axis in axes]
    if len(set(names)) < len(names):
        raise bad("grid", names, "axes with names that differ")
    return tuple(axes)


def _along(axes: Sequence[Axis], place: int, order: int, parity: int) -> Any:
    """The derivative along an axis, from values at all places and beyond all ends, to places.

    Those beyond ends follow the others, axis by axis, the low end first.
    """
    from scipy.sparse import csr_array, eye_array, hstack, kron

    sizes = [axis.n for axis in axes]
    before, after = eye_array(math.prod(sizes[:place])), eye_array(math.prod(sizes[place + 1 :]))

    def across(one: Any) -> Any:
        return kron(kron(before, one), after).tocsr()

    matrix, columns = axes[place].differences(order, parity)
    parts = [across(matrix)]
    for k, axis in enumerate(axes):
        beside = math.prod(sizes) // axis.n
        for column in columns if k == place else [None] * len(axis.ends):
            empty = csr_array((math.prod(sizes), beside))
            parts.append(empty if column is None else across(csr_array(column[:, None])))
    return hstack(parts).tocsr()


def derivative(axes: tuple[Axis, ...], word: str, parity: Sequence[int]) -> Any:
    """The matrix of an operator: ``lap``, or ``dx`` and ``dxx`` along an axis x.

    From values at all places and beyond all ends to those at places; of what is even or odd
    beyond the ends of each axis.
    """
    orders = enumerate(orders_of(axes, word))
    parts = (_along(axes, k, order, parity[k]) for k, order in orders if order)
    return functools.reduce(operator.add, parts)


def orders_of(axes: Sequence[Axis], word: str) -> tuple[int, ...]:
    """Of an operator the order of derivatives along each axis."""
    if word == "lap":
        return (2,) * len(axes)
    return tuple({axis.name: 1, 2 * axis.name: 2}.get(word[1:], 0) for axis in axes)


def operators(axes: Sequence[Axis]) -> tuple[str, ...]:
    """Names of the derivatives that formulas may take on a grid."""
    return ("lap", *(f"d{order * axis.name}" for axis in axes for order in (1, 2)))
