"""What compiled code does with addresses: views of memory, calls of native functions.

The compiler of kernels knows these functions by name and writes the instructions. Interpreted,
kernels have no use for them: they call Python functions on slices of arrays.
"""

from __future__ import annotations

from typing import Any


def carray(pointer: Any, shape: Any) -> Any:
    """An array at an address, in compiled code."""
    raise TypeError("carray: got called by the interpreter, wants compiled code")


def invoke(address: Any, *arrays: Any) -> Any:
    """Call ``void (double *, ...)`` at an address, with whole arrays; or a Python function."""
    if not callable(address):
        raise TypeError("invoke: got an address in the interpreter, wants a Python function there")
    address(*arrays)


def lapack_gesv(n: int, many: int, matrix: Any, swapped: Any, right: Any) -> int:
    """Eliminate by LAPACK's dgesv, matrices by columns, in compiled code; 0 unless singular."""
    raise TypeError("lapack_gesv: got called by the interpreter, wants compiled code")
