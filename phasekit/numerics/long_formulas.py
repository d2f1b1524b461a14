"""Formulas of many operations: machine code for them and their derivatives, in linear time."""

from __future__ import annotations

import functools
from collections.abc import Mapping, Sequence
from math import comb
from typing import Any

LONG = 200  # operations from which it takes sympy long to differentiate formulas
GROWN = 20_000  # parts of third derivatives from which it does: of formulas inside formulas


def long_formulas(
    expressions: Sequence[Any], places: Mapping[Any, tuple[int, int]], unknowns: Sequence[Any]
) -> LongFormulas | None:
    """Formulas of many operations, or whose derivatives have many; None where there are few.

    places: symbol -> (which array: 0 x, 1 p; place in it); unknowns: those by which derivatives
    are taken, in the order of the array x.
    """
    found = LongFormulas(expressions, places, len(unknowns))
    return found if found.operations > LONG or derived_parts(expressions) > GROWN else None


def derived_parts(expressions: Sequence[Any]) -> float:
    """About how many parts third derivatives have as sympy writes them, for whom nothing is shared.

    Examples
    --------
    >>> from sympy.abc import x
    >>> flat, deep = x + 2 * x**3 * (x + 1), x
    >>> for _ in range(9):
    ...     deep = deep * (1 - deep)
    >>> derived_parts([flat]) < 300, derived_parts([deep]) > 1e6
    (True, True)
    """
    from phasekit.numerics.tape_formulas import parts

    sizes: dict[int, list[float]] = {}  # of a part and its derivatives; 0 where they vanish
    for e in parts(expressions):
        inner = [sizes[id(a)] for a in e.args if any(sizes[id(a)])]
        if not e.args:
            size = [1.0, 1.0 if e.is_Symbol else 0.0, 0.0, 0.0]
        elif e.is_Mul:
            size = functools.reduce(_product, inner)
        else:
            size = [1.0 + sum(one[0] for one in inner)]
            size += [sum(one[k] for one in inner) for k in (1, 2, 3)]
            if not e.is_Add and size[1]:  # by the chain rule
                s, first, second, third = size
                size = [
                    s,
                    s + first,
                    2.0 * s + first + second,
                    3.0 * s + 2.0 * first + 2.0 * second + third,
                ]
        sizes[id(e)] = size
    return sum(sizes[id(e)][3] for e in expressions)


def _product(a: list[float], b: list[float]) -> list[float]:
    """The sizes of a product and its derivatives."""
    return [
        sum(comb(k, j) * (a[j] + b[k - j] + 1.0) for j in range(k + 1) if a[j] and b[k - j])
        for k in range(4)
    ]


class LongFormulas:
    """Formulas as a tape; what is compiled has the form that a `Field` gives."""

    def __init__(
        self, expressions: Sequence[Any], places: Mapping[Any, tuple[int, int]], m: int
    ) -> None:
        from phasekit.numerics.tape import Tape
        from phasekit.numerics.tape_formulas import write

        self.tape, self.m = Tape(places), m
        self.values = write(self.tape, expressions)
        self.u = [self.tape.argument(0, j) for j in range(m)]

    @property
    def operations(self) -> int:
        """How many there are, each counted once."""
        return sum(not self.tape.atom(k) for k in self.tape.needed(self.values))

    def first(self) -> int:
        """Address of f and its derivatives, row by row."""
        return self._compiled(*self._jet())

    def second(self) -> int:
        """Address of f, its derivatives and those of f_u z."""
        entries, count = self._jet()
        return self._compiled(*self._rows(self._along(self.values, 0), entries, count))

    def third(self) -> int:
        """Address of the third derivative along the three directions that z holds."""
        return self.derivative(3)

    def derivative(self, order: int) -> int:
        """Address of the derivative of an order along as many directions, which z holds."""
        along = self.values
        for k in range(order):
            along = self._along(along, k * self.m)
        return self._compiled(dict(enumerate(along)), len(along))

    def terms(self) -> int:
        """Address of f and of the sums of the sizes of its terms."""
        both = [*self.values, *map(self.tape.magnitude, self.values)]
        return self._compiled(dict(enumerate(both)), len(both))

    def event(self) -> int:
        """Address of a value, the sum of the sizes of its terms, and its derivatives."""
        (value,) = self.values
        entries = {0: value, 1: self.tape.magnitude(value)}
        return self._compiled(*self._rows([value], entries, 2))

    def _jet(self) -> tuple[dict[int, int], int]:
        """F and its derivatives by their places, and how many there are."""
        return self._rows(self.values, dict(enumerate(self.values)), len(self.values))

    def _rows(
        self, nodes: Sequence[int], entries: dict[int, int], count: int
    ) -> tuple[dict[int, int], int]:
        """The gradients of nodes, one a row, after so many entries."""
        for k in nodes:
            for j, slope in self.tape.gradient(k, self.u).items():
                entries[count + j] = slope
            count += self.m
        return entries, count

    def _along(self, nodes: Sequence[int], place: int) -> list[int]:
        """Derivatives along the direction that begins at a place of z."""
        z = [self.tape.argument(2, place + j) for j in range(self.m)]
        return self.tape.tangent(nodes, dict(zip(self.u, z, strict=True)))

    def _compiled(self, entries: Mapping[int, int], count: int) -> int:
        from phasekit.numerics.tape_code import compile_tape

        return compile_tape(self.tape, entries, count)
