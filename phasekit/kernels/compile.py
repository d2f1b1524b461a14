"""How the kernels are compiled.

``kernel`` marks what Python calls: compiled on first use, cached on disk, running without the
GIL. ``inline`` marks the arithmetic inside: always inlined, so that a loop over it vectorises.
``compose`` marks what only strings such functions together. Division by zero gives inf or NaN, as
in NumPy. Fast-math stays off: the exact steps need IEEE arithmetic, and a result must not depend
on how a loop was vectorised.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, TypeVar, cast

import numpy as np
import numpy.typing as npt
from numba import njit

Array = npt.NDArray[np.float64]
Outputs = tuple[npt.NDArray[Any], ...]

Function = TypeVar("Function", bound=Callable[..., Any])


def kernel(function: Function) -> Function:
    """Compile on first use, cache on disk, release the GIL."""
    return cast(Function, njit(cache=True, nogil=True, error_model="numpy")(function))


def inline(function: Function) -> Function:
    """Compile as part of each caller, always inlined by LLVM."""
    return cast(Function, njit(forceinline=True, error_model="numpy")(function))


def compose(function: Function) -> Function:
    """Paste into the caller before compilation: for what only strings functions together."""
    return cast(Function, njit(inline="always", error_model="numpy")(function))
