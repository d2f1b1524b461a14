"""Drivers of the steps: every step over a block of systems, block after block.

Each fills cells ``start`` to ``stop`` of the output arrays. A count of ``UNDECIDED`` asks for the
discriminant from exact arithmetic, which a second call takes as ``exact`` (empty: none).
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from phasekit.numerics.compile import Array, Outputs, compose, vector_kernel
from phasekit.phase.exact.kernels import equilibria as eq
from phasekit.phase.exact.kernels import separatrices as sx

# The root finders are specialised to these, which must be globals here to count as literals.
from phasekit.phase.exact.kernels.equilibria import (
    LOWER_CENTER,
    LOWER_SADDLE,
    UPPER_CENTER,
    UPPER_SADDLE,
)


@compose
def count(a: Array, b: Array, c: Array, exact: Array, first: int, n: int, v: Array) -> None:
    """Reduced system and number of equilibria of n systems, in the columns of a block."""
    for i in range(n):
        v[eq.A0 + i] = a[first + i]
        v[eq.B0 + i] = b[first + i]
        v[eq.C0 + i] = c[first + i]
    for i in range(n):
        eq.reduce(i, v)
    for i in range(n):
        eq.discriminate(i, v)
    if exact.size > 0:
        for i in range(n):
            v[eq.DELTA + i] = exact[first + i]
    for i in range(n):
        eq.count(i, v)


@compose
def partition(n: int, v: Array, order: npt.NDArray[np.int64], w: Array) -> int:
    """Copy the columns of v to w, first those with inner points; their number.

    So the steps for inner points and lobes run over full vectors of systems that have them.
    ``order`` has a place more than columns: each index is written before it is known to count.
    """
    m = 0
    for i in range(n):
        order[m] = i
        m += 1 if v[eq.COUNT + i] > 2.0 else 0
    k = m
    for i in range(n):
        order[k] = i
        k += 0 if v[eq.COUNT + i] > 2.0 else 1
    for row in range(0, eq.SYSTEM_ROWS * eq.BLOCK, eq.BLOCK):
        for i in range(n):
            w[row + i] = v[row + order[i]]
    return m


@compose
def solve(n: int, m: int, w: Array) -> None:
    """Equilibria of the n systems of a block, of which the first m have inner points."""
    for i in range(n):
        eq.find_outer(LOWER_CENTER, i, w)
    for i in range(n):
        eq.find_outer(UPPER_SADDLE, i, w)
    for i in range(m):
        eq.find_inner(LOWER_SADDLE, i, w)
    for i in range(m):
        eq.find_inner(UPPER_CENTER, i, w)
    for j in range(4):
        stop = m if j == LOWER_SADDLE or j == UPPER_CENTER else n
        for i in range(n):
            eq.classify(j, i, w)
        for i in range(stop):
            eq.put_back(j, i, w)
        for i in range(stop):
            eq.measure(j, i, w)
        for i in range(stop, n):
            eq.leave_out(j, i, w)


@compose
def enclose(n: int, m: int, w: Array) -> None:
    """Separatrices of the n systems of a block, of which the first m may have lobes."""
    for i in range(m):
        sx.turn(i, w)
    for i in range(m):
        sx.measure_lobes(i, w)
    for i in range(n):
        sx.measure_winding(i, w)
    for i in range(n):
        sx.shape(i, w)
    for j in range(2):
        for i in range(n):
            sx.describe(j, i, w)
    for j in range(2):
        for i in range(m):
            sx.arrange(j, i, w)
        for i in range(m, n):
            sx.leave_out(j, i, w)


@vector_kernel
def equilibria(
    a: Array, b: Array, c: Array, exact: Array, start: int, stop: int, points: Outputs
) -> None:
    """Equilibria of systems with the coefficients a, b, c."""
    v = np.zeros(eq.SYSTEM_ROWS * eq.BLOCK)
    w = np.zeros(eq.SIZE)
    order = np.zeros(eq.BLOCK + 1, np.int64)
    for first in range(start, stop, eq.BLOCK):
        n = min(eq.BLOCK, stop - first)
        count(a, b, c, exact, first, n, v)
        m = partition(n, v, order, w)
        solve(n, m, w)
        for i in range(n):
            eq.write(i, first + order[i], w, points)


@vector_kernel
def phase_space(
    a: Array,
    b: Array,
    c: Array,
    exact: Array,
    start: int,
    stop: int,
    points: Outputs,
    loops: Outputs,
) -> None:
    """Equilibria and separatrices of systems with the coefficients a, b, c."""
    v = np.zeros(eq.SYSTEM_ROWS * eq.BLOCK)
    w = np.zeros(sx.SIZE)
    order = np.zeros(eq.BLOCK + 1, np.int64)
    for first in range(start, stop, eq.BLOCK):
        n = min(eq.BLOCK, stop - first)
        count(a, b, c, exact, first, n, v)
        m = partition(n, v, order, w)
        solve(n, m, w)
        enclose(n, m, w)
        for i in range(n):
            eq.write(i, first + order[i], w, points)
        for i in range(n):
            sx.write(i, first + order[i], w, loops)
