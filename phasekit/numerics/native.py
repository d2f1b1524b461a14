"""Calls of native functions by their address, and linear algebra on pieces of a flat work array.

A kernel that takes the right-hand side of a system as the address of its machine code is compiled
once, for all systems. The same kernel interpreted (`py_func`) takes a Python function instead.
Helpers have two bodies by `twin`: NumPy for the interpreter, loops for the compiler. Vectors and
matrices are pieces of one flat array ``w``, named by the place where they begin.
"""

from __future__ import annotations

import functools
from collections.abc import Callable
from typing import Any, cast

import numpy as np

from phasekit.arrays import Array
from phasekit.numerics.compile import routine
from phasekit.numerics.compile import twin as twin
from phasekit.numerics.pointers import invoke, lapack_gesv

#: Unknowns of systems up to which elimination as written here is faster than LAPACK.
OWN = 32
#: Unknowns up to which Python's own numbers are faster than NumPy's arrays.
FEW = 6


def _call(function: Any, w: Array, x: int, p: Array, z: int, out: int) -> None:
    invoke(function, w[x:], p, w[z:], w[out:])


@twin(_call)
def call(function: Any, w: Array, x: int, p: Array, z: int, out: int) -> None:
    """Call ``function(x, p, z, out)``, a Python function or the address of a native one."""
    function(w[x:], p, w[z:], w[out:])


@routine
def eliminate_large(w: Array, a: int, b: int, n: int) -> float:
    """Solve as `solve` does, by LAPACK."""
    for i in range(n * n):
        if not np.isfinite(w[a + i]):
            return 0.0
    for i in range(n):  # LAPACK holds matrices by columns
        for j in range(i):
            value = w[a + i * n + j]
            w[a + i * n + j] = w[a + j * n + i]
            w[a + j * n + i] = value
    matrix, right, swapped = w[a : a + n * n], np.empty(2 * n), np.empty(n, np.int32)
    for i in range(n):
        right[i] = w[b + 2 * i]
        right[n + i] = w[b + 2 * i + 1]
    if lapack_gesv(n, 2, matrix, swapped, right) != 0:
        return 0.0
    sign = 1.0
    for i in range(n):
        w[b + 2 * i] = right[i]
        w[b + 2 * i + 1] = right[n + i]
        if (swapped[i] != i + 1) != (w[a + i * n + i] < 0.0):
            sign = -sign
    return sign


def _solve(w: Array, a: int, b: int, n: int) -> float:
    if n > OWN:
        return eliminate_large(w, a, b, n)
    sign = 1.0
    for j in range(n):
        pivot = j
        size = abs(w[a + j * n + j])
        for i in range(j + 1, n):
            if abs(w[a + i * n + j]) > size:
                size = abs(w[a + i * n + j])
                pivot = i
        if not size > 0.0:
            return 0.0
        if pivot != j:
            sign = -sign
            for k in range(j, n):
                value = w[a + j * n + k]
                w[a + j * n + k] = w[a + pivot * n + k]
                w[a + pivot * n + k] = value
            for k in range(b, b + 2):
                value = w[k + 2 * j]
                w[k + 2 * j] = w[k + 2 * pivot]
                w[k + 2 * pivot] = value
        if w[a + j * n + j] < 0.0:
            sign = -sign
        inverse = 1.0 / w[a + j * n + j]
        for i in range(j + 1, n):
            factor = w[a + i * n + j] * inverse
            if factor != 0.0:
                for k in range(j + 1, n):
                    w[a + i * n + k] -= factor * w[a + j * n + k]
                w[b + 2 * i] -= factor * w[b + 2 * j]
                w[b + 2 * i + 1] -= factor * w[b + 2 * j + 1]
    for i in range(n - 1, -1, -1):
        first = w[b + 2 * i]
        second = w[b + 2 * i + 1]
        for j in range(i + 1, n):
            first -= w[a + i * n + j] * w[b + 2 * j]
            second -= w[a + i * n + j] * w[b + 2 * j + 1]
        inverse = 1.0 / w[a + i * n + i]
        w[b + 2 * i] = first * inverse
        w[b + 2 * i + 1] = second * inverse
    return sign


@twin(_solve)
def solve(w: Array, a: int, b: int, n: int) -> float:
    """Solve for two right sides, in their place; the determinant's sign, 0 if it is singular."""
    right = w[b : b + 2 * n].reshape(n, 2)
    factors, swapped, solved, singular = _lapack()(w[a : a + n * n].reshape(n, n), right)
    if singular:
        return 0.0
    right[:] = solved
    negative = np.count_nonzero(swapped != _places(n)) + np.count_nonzero(factors.diagonal() < 0.0)
    return -1.0 if negative % 2 else 1.0


@functools.cache
def _lapack() -> Callable[..., Any]:
    """Elimination that gives its factors as well."""
    from scipy.linalg.lapack import dgesv

    return cast(Callable[..., Any], dgesv)


@functools.lru_cache(maxsize=16)
def _places(n: int) -> Any:
    return np.arange(n)


def _inner(w: Array, weight: int, x: int, y: int, n: int) -> float:
    total = 0.0
    for i in range(n):
        total += w[weight + i] * w[x + i] * w[y + i]
    return total


@twin(_inner)
def inner(w: Array, weight: int, x: int, y: int, n: int) -> float:
    """Sum of weight * x * y over n entries."""
    return float(np.dot(w[weight : weight + n] * w[x : x + n], w[y : y + n]))


def _copy(w: Array, source: int, target: int, n: int) -> None:
    for i in range(n):
        w[target + i] = w[source + i]


@twin(_copy)
def copy(w: Array, source: int, target: int, n: int) -> None:
    """Copy n entries."""
    w[target : target + n] = w[source : source + n]


def _keep(row: Array, w: Array, source: int, n: int) -> None:
    for i in range(n):
        row[i] = w[source + i]


@twin(_keep)
def keep(row: Array, w: Array, source: int, n: int) -> None:
    """Copy n entries to the beginning of another array."""
    row[:n] = w[source : source + n]


def _divide(w: Array, x: int, by: float, n: int) -> None:
    for i in range(n):
        w[x + i] /= by


@twin(_divide)
def divide(w: Array, x: int, by: float, n: int) -> None:
    """Divide n entries by a number."""
    w[x : x + n] /= by


def _dot(w: Array, x: int, y: int, n: int) -> float:
    total = 0.0
    for i in range(n):
        total += w[x + i] * w[y + i]
    return total


@twin(_dot)
def dot(w: Array, x: int, y: int, n: int) -> float:
    """Sum of x * y over n entries."""
    return float(np.dot(w[x : x + n], w[y : y + n]))
