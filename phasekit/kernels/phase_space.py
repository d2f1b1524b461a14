"""Drivers of the steps: one system after the other, or block by block.

Both run the same arithmetic and give the same bits. The first compiles in half the time, the
second runs several times as fast. Each fills cells ``start`` to ``stop`` of the output arrays.
A count of ``UNDECIDED`` asks for the discriminant from exact arithmetic, which the first takes
as ``exact`` (empty: none). ``w`` is a work array of the size that the steps name.
"""

from __future__ import annotations

from phasekit.kernels import equilibria as eq
from phasekit.kernels import separatrices as sx
from phasekit.kernels.compile import Array, Outputs, compose, kernel

# The root finders are specialised to these, which must be globals here to count as literals.
from phasekit.kernels.equilibria import LOWER_CENTER, LOWER_SADDLE, UPPER_CENTER, UPPER_SADDLE


@compose
def solve_one(a: Array, b: Array, c: Array, exact: Array, k: int, w: Array) -> None:
    """Results of system k in column 0."""
    w[eq.A0] = a[k]
    w[eq.B0] = b[k]
    w[eq.C0] = c[k]
    eq.reduce(0, w)
    eq.discriminate(0, w)
    if exact.size > 0:
        w[eq.DELTA] = exact[k]
    eq.count(0, w)
    for j in eq.OUTER:
        eq.find_outer(j, 0, w)
    for j in eq.INNER:
        eq.find_inner(j, 0, w)
    for j in range(4):
        eq.classify(j, 0, w)
        eq.place(j, 0, w)
        eq.measure(j, 0, w)


@compose
def solve_block(a: Array, b: Array, c: Array, first: int, n: int, w: Array) -> None:
    """Results of n systems in the columns of a block."""
    for i in range(n):
        w[eq.A0 + i] = a[first + i]
        w[eq.B0 + i] = b[first + i]
        w[eq.C0 + i] = c[first + i]
    for i in range(n):
        eq.reduce(i, w)
    for i in range(n):
        eq.discriminate(i, w)
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
def equilibria_one_by_one(
    a: Array, b: Array, c: Array, exact: Array, start: int, stop: int, points: Outputs, w: Array
) -> None:
    """Equilibria of each system in turn."""
    for k in range(start, stop):
        solve_one(a, b, c, exact, k, w)
        eq.write(0, k, w, points)


@kernel
def equilibria_in_blocks(
    a: Array, b: Array, c: Array, start: int, stop: int, points: Outputs, w: Array
) -> None:
    """Equilibria, a block at a time."""
    for first in range(start, stop, eq.BLOCK):
        n = eq.BLOCK if stop - first > eq.BLOCK else stop - first
        solve_block(a, b, c, first, n, w)
        for i in range(n):
            eq.write(i, first + i, w, points)


@kernel
def phase_space_one_by_one(
    a: Array,
    b: Array,
    c: Array,
    exact: Array,
    start: int,
    stop: int,
    points: Outputs,
    loops: Outputs,
    w: Array,
) -> None:
    """Equilibria and separatrices of each system in turn."""
    for k in range(start, stop):
        solve_one(a, b, c, exact, k, w)
        eq.write(0, k, w, points)
        sx.turn(0, w)
        sx.measure_lobes(0, w)
        sx.measure_winding(0, w)
        sx.shape(0, w)
        for j in range(2):
            sx.describe(j, 0, w)
        for j in range(2):
            sx.arrange(j, 0, w)
        sx.write(0, k, w, loops)


@kernel
def phase_space_in_blocks(
    a: Array, b: Array, c: Array, start: int, stop: int, points: Outputs, loops: Outputs, w: Array
) -> None:
    """Equilibria and separatrices, a block at a time."""
    for first in range(start, stop, eq.BLOCK):
        n = eq.BLOCK if stop - first > eq.BLOCK else stop - first
        solve_block(a, b, c, first, n, w)
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
