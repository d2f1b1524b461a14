"""V and its derivatives with the digits that doubles lose where terms cancel.

Sums, products and whole powers in double-double arithmetic, arrays at once; other formulas in ball
arithmetic, point by point.
"""

from __future__ import annotations

import functools
from collections.abc import Callable
from fractions import Fraction
from typing import Any, NamedTuple

import numpy as np

from phasekit.arrays import Array
from phasekit.numerics.double_double import dd_add, dd_divide, dd_multiply
from phasekit.numerics.intervals import balls
from phasekit.numerics.intervals.program import NoRule, Program, real_program
from phasekit.phase.numerical.formula import Formula
from phasekit.phase.numerical.systems import Systems

_ONE = (1.0, 0.0)
#: Bits of balls, and points that are computed in one call.
BITS = 192
_AT_ONCE = 512


class Digits(NamedTuple):
    """A value as the sum of two doubles, and how far it may be from that.

    In double-double arithmetic nothing is said of that: `off` is 0.
    """

    high: Array
    low: Array
    off: Array


@functools.lru_cache(maxsize=128)
def _program(formula: Formula, orders: tuple[int, ...], functions: frozenset[str]) -> Any:
    if formula.expression is None:
        return None
    try:
        return real_program(*formula.expressions(*orders), functions)
    except NoRule:
        return None


@functools.lru_cache(maxsize=128)
def _doubled(formula: Formula, orders: tuple[int, ...]) -> Callable[..., list[Any]] | None:
    """The program in double-double arithmetic; None where a function has no rule."""
    program = _program(formula, orders, frozenset())
    try:
        return None if program is None else _DoubleDoubles(program)
    except (NoRule, TypeError, OverflowError):  # powers, or no number that a double holds
        return None


def doubled(systems: Systems, x: Array, *orders: int) -> list[Digits] | None:
    """V or derivatives of it at x, one place of each system; None but for sums and products."""
    function = _doubled(systems.formula, orders)
    if function is None:
        return None
    zero = np.zeros(x.shape)
    with np.errstate(all="ignore"):
        found = function([(x, zero), *((p, zero) for p in systems.parameters)])
    wide = [[np.broadcast_to(part, x.shape) for part in pair] for pair in found]
    return [Digits(high, low, zero) for high, low in wide]


def values(systems: Systems, x: Array, *orders: int) -> list[Digits] | None:
    """V or derivatives of it at x, one place of each system; None where a function has no rule."""
    found = doubled(systems, x, *orders)
    program = _program(systems.formula, orders, balls.NAMES) if found is None else None
    if program is None:
        return found
    out = np.full((len(orders), 3, x.size), np.nan)
    usable = np.flatnonzero(np.isfinite(x) & systems.finite)
    for start in range(0, usable.size, _AT_ONCE):
        rows = usable[start : start + _AT_ONCE]
        columns = [x[rows], *(p[rows] for p in systems.parameters)]
        for parts, results in zip(
            out, balls.run(program, [balls.balls(c, c) for c in columns], BITS), strict=True
        ):
            parts[:, rows] = balls.double_doubles(results, BITS)
    return [Digits(*parts) for parts in out]


class _DoubleDoubles:
    """A program of sums, products and whole powers, on pairs of arrays."""

    def __init__(self, program: Program) -> None:
        self.program = program
        self._steps = [(_operation(name, own), places) for name, places, own in program.operations]

    def __call__(self, inputs: list[Any]) -> list[Any]:
        """Return the results for inputs that are pairs."""
        entries = list(inputs)
        for step, places in self._steps:
            entries.append(step(*(entries[place] for place in places)))
        return [entries[place] for place in self.program.outputs]


def _operation(name: str, own: Any) -> Callable[..., Any]:
    if name == "number":
        number = _number(own)
        return lambda: number
    if name == "negative":
        return lambda a: (-a[0], -a[1])
    if name == "power":
        return functools.partial(_whole_power, own)
    if name == "root":
        raise NoRule(f"power of {own}")
    join = dd_add if name == "add" else dd_multiply
    return lambda a, b: join(*a, *b)


def _number(value: Any) -> tuple[float, float]:
    import sympy as sp

    number = sp.Rational(value if value.is_Rational else value.evalf(40))
    exact = Fraction(int(number.p), int(number.q))
    high = float(exact)
    return high, float(exact - Fraction(high))


def _whole_power(n: int, a: Any) -> Any:
    result, factor, left = _ONE, a, abs(n)
    while left:
        if left % 2:
            result = factor if result is _ONE else dd_multiply(*result, *factor)
        left //= 2
        factor = dd_multiply(*factor, *factor) if left else factor
    return result if n > 0 else dd_divide(*_ONE, *result)
