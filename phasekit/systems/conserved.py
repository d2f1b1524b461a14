"""Sums of amounts that no reaction changes: the left null space of a stoichiometry, exact."""

from __future__ import annotations

import math
from collections.abc import Sequence
from fractions import Fraction
from typing import TypeAlias

Row: TypeAlias = tuple[Fraction, ...]

#: Most rows that are kept while sums without differences are looked for.
MOST = 2000


def conserved_sums(stoichiometry: Sequence[Sequence[Fraction | int]]) -> list[Row]:
    """A basis of the rows g with g N = 0.

    They are sums with coefficients >= 0 where these span the space, as those of conserved moieties
    do [SchusterHofer1991]; the shortest come first.

    A row of N a species, a column a reaction.

    >>> binding = [[-1, 1], [-1, 1], [1, -1]]  # A + B <-> AB
    >>> [[int(x) for x in row] for row in conserved_sums(binding)]
    [[1, 0, 1], [0, 1, 1]]
    """
    rows = [tuple(map(Fraction, row)) for row in stoichiometry]
    count = len(rows)
    width = len(rows[0]) if rows else 0
    columns = [[row[k] for row in rows] for k in range(width)]
    free = _null_space(columns, count)
    found = sorted(_without_differences(rows), key=lambda g: (sum(x != 0 for x in g), _order(g)))
    chosen: list[Row] = []
    for row in (*found, *free):
        if len(chosen) < len(free) and len(_reduced([*chosen, row])[1]) > len(chosen):
            chosen.append(row)
    return chosen


def dependent_places(sums: Sequence[Row]) -> list[int]:
    """Places whose values the sums give, as many as sums: the last that can be."""
    turned = [tuple(reversed(row)) for row in sums]
    return [len(turned[0]) - 1 - pivot for pivot in _reduced(turned)[1]] if sums else []


def _order(row: Row) -> tuple[int, ...]:
    return tuple(i for i, x in enumerate(row) if x)


def _reduced(rows: Sequence[Sequence[Fraction]]) -> tuple[list[list[Fraction]], list[int]]:
    """The reduced row echelon form, and the places of its pivots."""
    left = [list(row) for row in rows]
    pivots: list[int] = []
    for column in range(len(left[0]) if left else 0):
        at = len(pivots)
        place = next((i for i in range(at, len(left)) if left[i][column]), None)
        if place is None:
            continue
        left[at], left[place] = left[place], left[at]
        head = left[at][column]
        left[at] = [x / head for x in left[at]]
        for i, row in enumerate(left):
            if i != at and row[column]:
                by = row[column]
                left[i] = [x - by * y for x, y in zip(row, left[at], strict=True)]
        pivots.append(column)
    return left, pivots


def _null_space(rows: Sequence[Sequence[Fraction]], count: int) -> list[Row]:
    """A basis of the solutions of so many unknowns."""
    reduced, pivots = _reduced(rows)
    found = []
    for free in (j for j in range(count) if j not in pivots):
        row = [Fraction(0)] * count
        row[free] = Fraction(1)
        for i, pivot in enumerate(pivots):
            row[pivot] = -reduced[i][free]
        found.append(_whole(row))
    return found


def _whole(row: Sequence[Fraction]) -> Row:
    """A row as whole numbers without a common factor."""
    below = math.lcm(*(x.denominator for x in row))
    common = math.gcd(*(int(x * below) for x in row)) or 1
    return tuple(x * below / common for x in row)


def _without_differences(rows: Sequence[Row]) -> list[Row]:
    """Rows g >= 0 with g N = 0 and few entries: column by column, from pairs that cancel there."""
    count = len(rows)
    units = [tuple(Fraction(int(i == j)) for j in range(count)) for i in range(count)]
    table = list(zip(rows, units, strict=True))
    for column in range(len(rows[0]) if rows else 0):
        kept = [pair for pair in table if not pair[0][column]]
        above = [pair for pair in table if pair[0][column] > 0]
        below = [pair for pair in table if pair[0][column] < 0]
        for a, g in above:
            for b, h in below:
                p, q = -b[column], a[column]
                sum_ = tuple(p * x + q * y for x, y in zip(g, h, strict=True))
                rest = tuple(p * x + q * y for x, y in zip(a, b, strict=True))
                own = {i for i, x in enumerate(sum_) if x}
                if any({i for i, x in enumerate(other) if x} <= own for _, other in kept):
                    continue
                kept = [pair for pair in kept if not own < {i for i, x in enumerate(pair[1]) if x}]
                kept.append((rest, sum_))
                if len(kept) > MOST:
                    return []
        table = kept
    return [_whole(g) for _, g in table]
