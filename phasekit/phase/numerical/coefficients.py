"""Coefficients of V' of polynomials and Fourier sums: without rounding, and what rounding may do.

Where parameters cancel in a coefficient, even its sign may be lost.
"""

from __future__ import annotations

import functools
from typing import Any

import numpy as np
import numpy.typing as npt

from phasekit.arrays import Array
from phasekit.numerics.intervals.bounds import Bounds
from phasekit.numerics.intervals.program import NoRule
from phasekit.phase.numerical.formula import Formula, shape_of
from phasekit.phase.numerical.systems import Systems


@functools.lru_cache(maxsize=128)
def slope_coefficients(formula: Formula) -> list[Any] | None:
    """Coefficients of V', as `Formula` has them, with every number as what it is."""
    import sympy as sp

    x = sp.Symbol(formula.coordinate, real=True)
    return shape_of(sp.diff(formula.expression, x), x, formula.period)[1]


def spreads(systems: Systems, coefficients: npt.NDArray[Any]) -> Array:
    """How far rounding may have moved coefficients of V' that are sums, or functions, of others.

    0 for products, whose rounding is a part of them, and where a function in one has no bounds.
    """
    spread = np.zeros(coefficients.shape)
    found = _bounds(systems.formula)
    if found is None:
        return spread
    columns, bounds = found
    parts, undefined = bounds(*((p, p) for p in systems.parameters))
    values = np.stack([coefficients.real, coefficients.imag], axis=-1)
    with np.errstate(all="ignore"):
        for (column, part), (low, high) in zip(columns, parts, strict=True):
            value = values[:, column, part]
            off = np.fmax(high - value, value - low)
            spread[:, column] += np.where(undefined | ~np.isfinite(off), np.inf, off)
    return spread


@functools.lru_cache(maxsize=128)
def _bounds(formula: Formula) -> tuple[list[tuple[int, int]], Bounds] | None:
    """Bounds of those that are not products: numbers of coefficients, 0 real and 1 imaginary."""
    import sympy as sp

    symbols = [sp.Symbol(name, real=True) for name in formula.names]
    if formula.expression is None or not symbols:
        return None
    columns: list[tuple[int, int]] = []
    expressions = []
    for column, coefficient in enumerate(slope_coefficients(formula) or ()):
        for part, expression in enumerate(coefficient.as_real_imag()):
            if not _is_product(expression):
                columns.append((column, part))
                expressions.append(expression)
    try:
        return (columns, Bounds(expressions, symbols)) if columns else None
    except NoRule:
        return None


def _is_product(expression: Any) -> bool:
    """Whether it is made of numbers, symbols and their whole powers by multiplication alone."""
    return all(
        factor.is_Symbol
        or not factor.free_symbols
        or (factor.is_Pow and factor.base.is_Symbol and factor.exp.is_Integer)
        for factor in expression.as_ordered_factors()
    )
