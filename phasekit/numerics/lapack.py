"""LAPACK's elimination for compiled code, found in SciPy when it is first called."""

from __future__ import annotations

import ctypes
import functools
from typing import Any

_GESV = ctypes.CFUNCTYPE(None, *[ctypes.c_void_p] * 8)


_SLOTS: list[int] = []  # where compiled code looks for the address


def fill_slot(address: int) -> None:
    """Put the address of dgesv, or of what finds it, where compiled code looks for it."""
    _SLOTS.append(address)
    known = _dgesv if _dgesv.cache_info().currsize else _finding
    _put(address, known())


def _put(address: int, function: Any) -> None:
    ctypes.c_void_p.from_address(address).value = ctypes.cast(function, ctypes.c_void_p).value


@functools.cache
def _finding() -> Any:
    """What stands in for dgesv until it is first called."""

    def call(*arguments: int | None) -> None:
        for address in _SLOTS:
            _put(address, _dgesv())
        _dgesv()(*arguments)

    return _GESV(call)


@functools.cache
def _dgesv() -> Any:
    from scipy.linalg import cython_lapack

    capsule = cython_lapack.__pyx_capi__["dgesv"]
    name, pointer = ctypes.pythonapi.PyCapsule_GetName, ctypes.pythonapi.PyCapsule_GetPointer
    name.restype, name.argtypes = ctypes.c_char_p, (ctypes.py_object,)
    pointer.restype, pointer.argtypes = ctypes.c_void_p, (ctypes.py_object, ctypes.c_char_p)
    return _GESV(pointer(capsule, name(capsule)))
