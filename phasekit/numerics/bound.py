"""Native functions with data of their own: code that is compiled once, bound to what it works on.

Kernels call machine code by an address, with four arrays. A function here takes two more before
them, whole numbers and sizes; a few instructions of machine code that are made for each pair of
such arrays hand them on.
"""

from __future__ import annotations

import functools
from collections.abc import Callable
from typing import Any

import numpy as np
import numpy.typing as npt

from phasekit.numerics.machine_code import machine_code


@functools.cache
def _compiled(function: Callable[..., Any]) -> int:
    """The address of the function, kept on disk where that can be."""
    from phasekit.numerics.compiler.kinds import DOUBLES, LONGS
    from phasekit.numerics.forms import native_function

    return native_function(function, (LONGS, *[DOUBLES] * 5))


def bound(
    function: Callable[..., Any], numbers: npt.NDArray[np.int64], sizes: npt.NDArray[np.float64]
) -> int:
    """Address of ``void (double *x, double *p, double *z, double *out)``.

    The function, of pointers to the numbers, the sizes and these four, is compiled. Numbers and
    sizes must outlast the calls; what they hold may change between these.
    """
    own = ", ".join(f"ptr inttoptr (i64 {array.ctypes.data} to ptr)" for array in (numbers, sizes))
    return machine_code(
        "define void @fill(ptr %x, ptr %p, ptr %z, ptr %out) {\n"
        f"  call void inttoptr (i64 {_compiled(function)} to ptr)"
        f"({own}, ptr %x, ptr %p, ptr %z, ptr %out)\n"
        "  ret void\n}\n",
        host=False,
    )
