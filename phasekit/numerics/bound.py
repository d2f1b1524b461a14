"""Native functions with data of their own: code that is compiled once, bound to what it works on.

Kernels call machine code by an address, with four arrays. A function here takes two more before
them, whole numbers and sizes; a few instructions of machine code that are made for each pair of
such arrays hand them on.
"""

from __future__ import annotations

import functools
from collections.abc import Callable
from functools import partial
from typing import Any

import numba
import numpy as np
import numpy.typing as npt
from llvmlite import ir
from numba import types

from phasekit.numerics.cache import kept
from phasekit.numerics.machine_code import machine_code, new_module


@functools.cache
def _compiled(function: Callable[..., Any]) -> Any:
    """The function as machine code, kept on disk where that can be."""
    reals: Any = types.CPointer(types.float64)  # type: ignore[no-untyped-call]
    wholes: Any = types.CPointer(types.int64)  # type: ignore[no-untyped-call]
    signature = types.void(wholes, reals, reals, reals, reals, reals)
    make: Any = partial(_cfunc, signature)
    return kept(make, function)


def _cfunc(signature: Any, function: Callable[..., Any], *, cache: bool) -> Any:
    cfunc: Any = numba.cfunc
    return cfunc(signature, cache=cache, error_model="numpy")(function)


def bound(
    function: Callable[..., Any], numbers: npt.NDArray[np.int64], sizes: npt.NDArray[np.float64]
) -> int:
    """Address of ``void (double *x, double *p, double *z, double *out)``.

    Parameters
    ----------
    function : callable
        Of pointers to the numbers, the sizes and these four; it is compiled.
    numbers, sizes : ndarray
        Must outlast the calls; what they hold may change between these.
    """
    real, whole, void = ir.DoubleType().as_pointer(), ir.IntType(64).as_pointer(), ir.VoidType()
    module = new_module()
    outer = ir.Function(module, ir.FunctionType(void, [real] * 4), name="fill")
    builder = ir.IRBuilder(outer.append_basic_block())
    inner = ir.FunctionType(void, [whole, *[real] * 5]).as_pointer()

    def pointer(address: int, kind: Any) -> Any:
        return builder.inttoptr(ir.Constant(ir.IntType(64), address), kind)

    builder.call(
        pointer(int(_compiled(function).address), inner),
        [pointer(numbers.ctypes.data, whole), pointer(sizes.ctypes.data, real), *outer.args],
    )
    builder.ret_void()
    return machine_code(str(module), host=False)
