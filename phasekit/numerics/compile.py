"""How the kernels are compiled.

``kernel`` marks what Python calls: compiled when it pays, kept on disk, running without the GIL;
its ``py_func`` is the same code interpreted, which gives the same bits and is the faster way to a
first result. ``inline`` marks the arithmetic inside: an ordinary function in Python, always inlined
when compiled, so that a loop over it vectorises. ``routine`` marks what is only called, not
inlined. ``twin`` gives a function another body for the compiler. Division by zero gives inf or NaN,
as in NumPy. Nothing is rearranged: the exact steps need IEEE arithmetic, and a result must not
depend on how a loop was vectorised.

`phasekit.numerics.compiler` translates them; its statements are few: numbers, tuples and arrays,
loops over ranges, functions marked here and those of `math` and NumPy on numbers.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, TypeVar, cast

import numpy.typing as npt

from phasekit.numerics.kernels import Kernel
from phasekit.numerics.marks import lanes as lanes
from phasekit.numerics.marks import mark

Outputs = tuple[npt.NDArray[Any], ...]
Function = TypeVar("Function", bound=Callable[..., Any])


def kernel(function: Function) -> Function:
    """Compile when it pays, keep on disk, release the GIL."""
    return cast(Function, Kernel(function, effort=1))


def vector_kernel(function: Function) -> Function:
    """The same, of loops over many numbers, several at once: takes three times as long."""
    return cast(Function, Kernel(function, effort=2))


def inline(function: Function) -> Function:
    """Compile as part of each caller, always inlined."""
    mark(function, function, inlined=True)
    return function


def routine(function: Function) -> Function:
    """Compile as a function of its own: for what is long, or called at several places."""
    mark(function, function, inlined=False)
    return function


#: For what only strings functions together.
compose = inline


def twin(compiled: Callable[..., Any]) -> Callable[[Function], Function]:
    """Give a function that is interpreted as it stands another body for the compiler."""

    def decorate(function: Function) -> Function:
        mark(function, compiled, inlined=False)
        return function

    return decorate
