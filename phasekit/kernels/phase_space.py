"""Drivers of the steps: every step over a block of systems, block after block.

Each fills cells ``start`` to ``stop`` of the output arrays. A count of ``UNDECIDED`` asks for the
discriminant from exact arithmetic, which a second call takes as ``exact`` (empty: none).
"""

from __future__ import annotations

import numpy as np

from phasekit.kernels import equilibria as eq
from phasekit.kernels import separatrices as sx
from phasekit.kernels.compile import Array, Outputs, compose, kernel

# The root finders are specialised to these, which must be globals here to count as literals.
from phasekit.kernels.equilibria import LOWER_CENTER, LOWER_SADDLE, UPPER_CENTER, UPPER_SADDLE


@compose
def solve(a: Array, b: Array, c: Array, exact: Array, first: int, n: int, w: Array) -> None:
    """Results of n systems in the columns of a block."""
    for i in range(n):
        w[eq.A0 + i] = a[first + i]
        w[eq.B0 + i] = b[first + i]
        w[eq.C0 + i] = c[first + i]
    for i in range(n):
        eq.reduce(i, w)
    for i in range(n):
        eq.discriminate(i, w)
    if exact.size > 0:
        for i in range(n):
            w[eq.DELTA + i] = exact[first + i]
    for i in range(n):
        eq.count(i, w)
    for i in range(n):
        eq.find_outer(LOWER_CENTER, i, w)
    for i in range(n):
        eq.find_outer(UPPER_SADDLE, i, w)
    most = 0.0
    for i in range(n):
        most = w[eq.COUNT + i] if w[eq.COUNT + i] > most else most
    if most > 2.0:
        for i in range(n):
            eq.find_inner(LOWER_SADDLE, i, w)
        for i in range(n):
            eq.find_inner(UPPER_CENTER, i, w)
    for j in range(4):
        for i in range(n):
            eq.classify(j, i, w)
        for i in range(n):
            eq.place(j, i, w)
        for i in range(n):
            eq.measure(j, i, w)


@kernel
def equilibria(
    a: Array, b: Array, c: Array, exact: Array, start: int, stop: int, points: Outputs
) -> None:
    """Equilibria of systems with the coefficients a, b, c."""
    w = np.zeros(eq.SIZE)
    for first in range(start, stop, eq.BLOCK):
        n = min(eq.BLOCK, stop - first)
        solve(a, b, c, exact, first, n, w)
        for i in range(n):
            eq.write(i, first + i, w, points)


@kernel
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
    w = np.zeros(sx.SIZE)
    for first in range(start, stop, eq.BLOCK):
        n = min(eq.BLOCK, stop - first)
        solve(a, b, c, exact, first, n, w)
        for i in range(n):
            sx.turn(i, w)
        for i in range(n):
            sx.measure_lobes(i, w)
        for i in range(n):
            sx.measure_winding(i, w)
        for i in range(n):
            sx.shape(i, w)
        for j in range(2):
            for i in range(n):
                sx.describe(j, i, w)
        for j in range(2):
            for i in range(n):
                sx.arrange(j, i, w)
        for i in range(n):
            eq.write(i, first + i, w, points)
        for i in range(n):
            sx.write(i, first + i, w, loops)
