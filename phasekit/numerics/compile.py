"""How the kernels are compiled.

``kernel`` marks what Python calls: compiled on first use, cached on disk, running without the
GIL; its ``py_func`` is the same code interpreted, which gives the same bits and is the faster way
to a first result. ``inline`` marks the arithmetic inside: an ordinary function in Python, always
inlined when compiled, so that a loop over it vectorises. ``routine`` marks what is only called,
not inlined. ``compose`` marks what only strings such functions together. Division by zero gives
inf or NaN, as in NumPy. Fast-math stays off: the exact steps need IEEE arithmetic, and a result
must not depend on how a loop was vectorised.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import Any, TypeVar, cast

import numpy as np
import numpy.typing as npt
from numba import njit
from numba.extending import overload

from phasekit.numerics import compiling as compiling  # says so to who waits for it
from phasekit.numerics import linked
from phasekit.numerics.cache import kept

Array = npt.NDArray[np.float64]
Outputs = tuple[npt.NDArray[Any], ...]
Function = TypeVar("Function", bound=Callable[..., Any])

#: No second entry for callers in C, which takes a tenth of the time to compile: nobody calls it.
OPTIONS: Any = {"error_model": "numpy", **linked.understood({"no_cfunc_wrapper": True})}


def kernel(function: Function) -> Function:
    """Compile on first use, cache on disk, release the GIL."""
    return cast(Function, kept(partial(njit, nogil=True, **OPTIONS), function))


def inline(function: Function) -> Function:
    """Compile as part of each caller, always inlined; integer literals are constants inside."""
    linked.link(function, function, literal=True, forceinline=True, **OPTIONS)
    return function


def routine(function: Function) -> Function:
    """Compile as a function of its own: for what is long, or called at several places."""
    linked.link(function, function, forceinline=False, **OPTIONS)
    return function


def compose(function: Function) -> Function:
    """Paste into the caller before compilation: for what only strings functions together."""
    options: Any = {**linked.OPTIONS, **OPTIONS}
    overload(function, jit_options=options, inline="always", strict=False)(lambda *args: function)
    return function
