"""Formulas of sums, products and whole powers in double-double arithmetic, with 32 digits.

What cancels in doubles keeps its digits: zeros of expanded polynomials far from 0.
"""

from __future__ import annotations

import functools
from collections.abc import Callable, Mapping
from fractions import Fraction
from typing import Any

import numpy as np
import numpy.typing as npt

from phasekit.numerics.double_double import dd_add, dd_divide, dd_multiply
from phasekit.phase.numerical.formula import Formula
from phasekit.phase.numerical.intervals import Bounds, NoRule
from phasekit.phase.numerical.rounding import Interval
from phasekit.phase.numerical.systems import Systems

Array = npt.NDArray[np.float64]

_ONE = (1.0, 0.0)


def _constant(expression: Any) -> Interval:
    import sympy as sp

    try:
        number = sp.Rational(expression if expression.is_Rational else expression.evalf(40))
        value = Fraction(int(number.p), int(number.q))
        high = float(value)
    except (TypeError, OverflowError):
        raise NoRule(str(expression)) from None
    return high, float(value - Fraction(high))


def _whole_power(n: int) -> Callable[..., Interval]:
    def power(_: Any, a: Interval) -> Interval:
        result, factor, left = _ONE, a, abs(n)
        while left:
            if left % 2:
                result = factor if result is _ONE else dd_multiply(*result, *factor)
            left //= 2
            factor = dd_multiply(*factor, *factor) if left else factor
        return result if n > 0 else dd_divide(*_ONE, *result)

    return power


def _no_power(exponent: Interval) -> Any:
    raise NoRule(f"power of {exponent[0]:.6g}")


class Extended(Bounds):
    """Values of expressions as sums of two doubles; called as `Bounds` is."""

    _constant = staticmethod(_constant)
    _sum = staticmethod(lambda _, a, b: dd_add(*a, *b))
    _product = staticmethod(lambda _, a, b: dd_multiply(*a, *b))
    _whole_power = staticmethod(_whole_power)
    _real_power = staticmethod(_no_power)
    _rules: Mapping[str, Callable[..., Any]] = {}
    _of_an_order: Mapping[str, Callable[[int], Any]] = {}


@functools.lru_cache(maxsize=128)
def extended(formula: Formula, orders: tuple[int, ...]) -> Extended | None:
    """V or derivatives of it, of (x, parameters); None where a function has no rule."""
    import sympy as sp

    from phasekit.laws.derivatives import derivative

    potential = formula.expression
    if potential is None or any(part.free_symbols for part in potential.atoms(sp.Function)):
        return None
    x, *parameters = (sp.Symbol(n, real=True) for n in (formula.coordinate, *formula.names))
    found = [derivative(potential, x, order) if order else potential for order in orders]
    try:
        return Extended(found, (x, *parameters))
    except NoRule:
        return None


def values(systems: Systems, x: Array, *orders: int) -> list[Interval] | None:
    """V or derivatives of it at x, one place of each system, as sums of two doubles."""
    function = extended(systems.formula, orders)
    if function is None:
        return None
    zero = np.zeros(x.shape)
    return function((x, zero), *((p, zero) for p in systems.parameters))[0]
