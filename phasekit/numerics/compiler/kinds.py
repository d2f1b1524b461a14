"""Kinds of values in compiled kernels, and what stands for them in LLVM's language.

A value is held by a number of registers, its parts: a scalar by one, a complex number by two, an
array by its address, its lengths and, unless it lies in one piece, its strides in bytes.
"""

from __future__ import annotations

import math
import struct
from dataclasses import dataclass
from typing import Any, NamedTuple, TypeAlias

import numpy as np


@dataclass(frozen=True)
class Scalar:
    """A number, a truth, a pointer, or nothing."""

    name: str
    types: tuple[str, ...]


FLOAT, INT, BOOL = Scalar("float", ("double",)), Scalar("int", ("i64",)), Scalar("bool", ("i1",))
COMPLEX = Scalar("complex", ("double", "double"))
NONE = Scalar("None", ())
#: A pointer to doubles, and one to 64-bit integers, as functions called by their address take.
DOUBLES, LONGS = Scalar("doubles", ("ptr",)), Scalar("longs", ("ptr",))
#: What only the compiler sees: a function, a module, a type.
OBJECT = Scalar("object", ())


@dataclass(frozen=True)
class Element:
    """How an entry of an array is stored."""

    code: str
    stored: str
    size: int
    kind: Scalar


ELEMENTS = {
    element.code: element
    for element in (
        Element("f8", "double", 8, FLOAT),
        Element("f4", "float", 4, FLOAT),
        Element("i8", "i64", 8, INT),
        Element("i4", "i32", 4, INT),
        Element("i2", "i16", 2, INT),
        Element("i1", "i8", 1, INT),
        Element("u1", "i8", 1, INT),
        Element("b1", "i8", 1, BOOL),
        Element("c16", "{double, double}", 16, COMPLEX),
    )
}


@dataclass(frozen=True)
class Array:
    """An array; `whole` where it lies in one piece, its last axis first."""

    code: str
    ndim: int
    whole: bool = True

    @property
    def types(self) -> tuple[str, ...]:
        """Types of its parts."""
        return ("ptr", *["i64"] * (self.ndim if self.whole else 2 * self.ndim))

    @property
    def element(self) -> Element:
        """How its entries are stored."""
        return ELEMENTS[self.code]


@dataclass(frozen=True)
class Tuple:
    """A tuple of values, each of its own kind, and their names if they have any."""

    kinds: tuple[Any, ...]
    names: tuple[str, ...] = ()

    @property
    def types(self) -> tuple[str, ...]:
        """Types of its parts."""
        return tuple(t for kind in self.kinds for t in kind.types)


Kind: TypeAlias = Scalar | Array | Tuple

#: In place of a constant: the value is known only when the code runs.
UNKNOWN: Any = type("Unknown", (), {"__repr__": lambda self: "UNKNOWN"})()


class Value(NamedTuple):
    """A value: its kind, the registers that hold it, and what it is where the compiler knows."""

    kind: Kind
    parts: tuple[str, ...]
    constant: Any = UNKNOWN


NOTHING = Value(NONE, (), None)


class CompileError(Exception):
    """A kernel holds what this compiler does not translate."""


def element_of(dtype: Any) -> Element:
    """How NumPy stores entries of a type."""
    dtype = np.dtype(dtype)
    element = ELEMENTS.get(f"{dtype.kind}{dtype.itemsize}")
    if element is None or not dtype.isnative:
        raise CompileError(f"arrays of {dtype} are not supported")
    return element


def joined(one: Kind, other: Kind) -> Kind:
    """The kind that holds values of both."""
    if one == other:
        return one
    if isinstance(one, Scalar) and isinstance(other, Scalar):
        order = (BOOL, INT, FLOAT, COMPLEX)
        if one in order and other in order:
            return max(one, other, key=order.index)
    if isinstance(one, Array) and isinstance(other, Array):
        if (one.code, one.ndim) == (other.code, other.ndim):
            return Array(one.code, one.ndim, whole=False)
    if isinstance(one, Tuple) and isinstance(other, Tuple) and len(one.kinds) == len(other.kinds):
        return Tuple(tuple(map(joined, one.kinds, other.kinds)), one.names)
    raise CompileError(
        f"a variable is {described(one)} at one place and {described(other)} at another"
    )


def split(kind: Tuple, parts: tuple[str, ...]) -> list[Value]:
    """The values of a tuple."""
    values, start = [], 0
    for one in kind.kinds:
        stop = start + len(one.types)
        values.append(Value(one, parts[start:stop], None if one == NONE else UNKNOWN))
        start = stop
    return values


def tuple_of(values: list[Value], names: tuple[str, ...] = ()) -> Value:
    """A tuple of values."""
    kind = Tuple(tuple(value.kind for value in values), names)
    constants = [value.constant for value in values]
    known = not any(constant is UNKNOWN for constant in constants)
    parts = tuple(part for value in values for part in value.parts)
    return Value(kind, parts, tuple(constants) if known else UNKNOWN)


def described(kind: Kind) -> str:
    """A kind in words, which also names it among the compiled forms of a kernel."""
    if isinstance(kind, Scalar):
        return kind.name
    if isinstance(kind, Tuple):
        return f"({', '.join([*map(described, kind.kinds), *kind.names])})"
    return f"{kind.code}[{', '.join(':' * kind.ndim)}]{'' if kind.whole else ' with strides'}"


def number(value: float) -> str:
    """A double as text, every bit of it."""
    value = math.nan if math.isnan(value) else value
    return f"0x{struct.unpack('>Q', struct.pack('>d', value))[0]:016x}"
