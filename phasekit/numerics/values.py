"""Values as compiled code takes them: their kinds, and the numbers and addresses that hold them."""

from __future__ import annotations

import struct
from collections.abc import Iterator
from typing import Any

import numpy as np

from phasekit.numerics.compiler.entry import code_of
from phasekit.numerics.compiler.kinds import (
    BOOL,
    COMPLEX,
    FLOAT,
    INT,
    NONE,
    Array,
    Kind,
    Tuple,
    described,
)

_SCALARS: tuple[tuple[Any, Any, Any], ...] = (
    (BOOL, bool, (bool, np.bool_)),
    (INT, int, (int, np.integer)),
    (FLOAT, float, (float, np.floating)),
    (COMPLEX, complex, (complex, np.complexfloating)),
)


def normal(x: Any, annotation: str = "") -> tuple[Any, Kind]:
    """A value as compiled code takes it, and its kind; whole numbers as floats where due."""
    if isinstance(x, np.ndarray):
        array = np.asarray(x)
        code = code_of(array.dtype)
        if code is None or not array.flags.aligned:
            raise TypeError(f"a kernel got an array of {array.dtype}, wants aligned numbers")
        if array.dtype.num != np.dtype(code).num:  # another name of the same type
            array = array.view(code)
        return array, Array(code, array.ndim, bool(array.flags.c_contiguous))
    if isinstance(x, tuple):
        values = [normal(one) for one in x]
        kinds = tuple(kind for _, kind in values)
        return tuple(one for one, _ in values), Tuple(kinds, getattr(x, "_fields", ()))
    if x is None:
        return None, NONE
    for kind, type_, types in _SCALARS:
        if isinstance(x, types):
            if annotation == "float" and kind in (BOOL, INT):
                return float(x), FLOAT
            if annotation == "int" and kind == BOOL:
                return int(x), INT
            return type_(x), kind
    raise TypeError(f"a kernel got {type(x).__name__}, wants numbers and arrays")


def numbers_of(x: Any, kind: Kind) -> Iterator[int]:
    """The numbers that hold a value, each as the whole number with its bits."""
    if isinstance(kind, Tuple):
        for one, own in zip(x, kind.kinds, strict=True):
            yield from numbers_of(one, own)
    elif isinstance(kind, Array):
        yield x.ctypes.data
        yield from x.shape
        if not kind.whole:
            yield from x.strides
    elif kind in (FLOAT, COMPLEX):
        for part in (x,) if kind == FLOAT else (x.real, x.imag):
            yield struct.unpack("q", struct.pack("d", part))[0]
    elif kind != NONE:
        yield int(x)


def value_of(kind: Kind, numbers: Iterator[int]) -> Any:
    """The value that numbers hold."""
    if isinstance(kind, Tuple):
        return tuple(value_of(own, numbers) for own in kind.kinds)
    if kind == NONE:
        return None
    if kind in (FLOAT, COMPLEX):
        parts = [
            struct.unpack("d", struct.pack("q", next(numbers)))[0]
            for _ in range(2 if kind == COMPLEX else 1)
        ]
        return complex(*parts) if kind == COMPLEX else parts[0]
    if kind in (INT, BOOL):
        return (bool if kind == BOOL else int)(next(numbers))
    raise TypeError(f"a kernel returns {described(kind)}")
