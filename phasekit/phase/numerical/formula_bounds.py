"""Bounds of a potential and its slopes: over stretches, of what rounding does, and in the plane.

A function that stays within M on an ellipse about a stretch has a Chebyshev series there whose
terms fall at least as fast as M rho^-k [Trefethen2013], so samples at a few nodes show all of it:
nothing narrow can hide between them.
"""

from __future__ import annotations

import functools

import numpy as np

from phasekit.arrays import Array, Flags
from phasekit.arrays import Ints as Index
from phasekit.numerics.intervals.bounds import ULPS, Bounds
from phasekit.numerics.intervals.plane import Regions
from phasekit.numerics.intervals.program import NoRule
from phasekit.phase.numerical.formula import Formula, Shape
from phasekit.phase.numerical.systems import Systems

_EPS = float(np.finfo(float).eps)
#: Bounds give a sum a unit in the last place to either side, of which rounding takes half of one.
_SHARE = 0.25
#: Units in the last place by which SciPy's special functions may be off.
_SCIPY = 64.0
#: Half the width and the height of the ellipse with rho = 3, in halves of the stretch.
_WIDTH, _HEIGHT = 5.0 / 3.0, 4.0 / 3.0
#: How much larger than the samples the bounds may be: they are larger than the function as well.
GROWTH = 1e4


@functools.lru_cache(maxsize=256)
def _bounds(formula: Formula, orders: tuple[int, ...], rounding: bool) -> Bounds | None:
    """Bounds of V or derivatives of it: what they may be, or what rounding usually makes of them.

    None where a function has no rule, or there is no expression.
    """
    if formula.expression is None:
        return None
    ulps = (1.0, _SCIPY) if rounding else (ULPS, 0.0)
    try:
        return Bounds(*formula.expressions(*orders), *ulps)
    except NoRule:
        return None


def slope_bounds(formula: Formula) -> Bounds | None:
    """Bounds of V' and V'' over boxes of (x, parameters); None where a function has no rule."""
    return _bounds(formula, (1, 2), False)


def bounds_on(
    systems: Systems, row: Index, low: Array, high: Array
) -> tuple[Array, Array, Array, Array, Flags]:
    """Bounds of V' and V'' on stretches of rows, and where either may be undefined."""
    bounds = slope_bounds(systems.formula)
    assert bounds is not None
    (slope, bend), undefined = bounds((low, high), *((p[row], p[row]) for p in systems.parameters))
    return (*slope, *bend, undefined)


# ------------------------------------------------------------------------- rounding


def noise(systems: Systems, x: Array, height: Array) -> Array:
    """Rounding of V at x, shape (systems, ...), where it is `height`.

    By the terms that the formula adds up, where there are bounds of its functions.
    """
    return _rounding(systems, x, 0, 2.0 * _EPS * np.abs(height))


def slope_noise(systems: Systems, x: Array, slope: Array) -> Array:
    """Rounding of V' at x, where it is `slope`, in the same way."""
    rough = 2.0 * _EPS * (np.abs(slope) + np.abs(systems.bend(x) * x))
    return _rounding(systems, x, 1, rough)


def bend_noise(systems: Systems, x: Array, bend: Array) -> Array:
    """Rounding of V'' at x, where it is `bend`, in the same way."""
    return _rounding(systems, x, 2, 4.0 * _EPS * np.abs(bend))


def _rounding(systems: Systems, x: Array, order: int, rough: Array) -> Array:
    bounds = _bounds(systems.formula, (order,), True)
    if bounds is None:
        return rough
    ((low, high),), undefined = bounds(*((a, a) for a in (x, *systems.beside(x))))
    with np.errstate(all="ignore"):
        found = _SHARE * (high - low)
    return np.where(~undefined & np.isfinite(found), found, rough)


# ------------------------------------------------------------------------- smoothness


@functools.lru_cache(maxsize=128)
def slope_regions(formula: Formula) -> Regions | None:
    """Bounds of V' in the plane; None where a function has no rule, or there is no expression."""
    if formula.expression is None:
        return None
    (slope,), (x, *parameters) = formula.expressions(1)
    try:
        return Regions(slope, x, parameters)
    except NoRule:
        return None


def smooth(systems: Systems, row: Index, low: Array, high: Array, size: Array) -> Flags:
    """Whether V' is on stretches of rows what samples of at most `size` show.

    True where nothing can be said: of polynomials and Fourier sums, whose degree bounds them, and
    of functions without rules.
    """
    regions = slope_regions(systems.formula) if systems.formula.shape is Shape.GENERAL else None
    if regions is None:
        return np.ones(low.shape, dtype=bool)
    middle, half = 0.5 * (low + high), 0.5 * np.abs(high - low)
    real = (middle - _WIDTH * half, middle + _WIDTH * half)
    imaginary = (-_HEIGHT * half, _HEIGHT * half)
    beside = [(p[row], p[row]) for p in systems.parameters]
    return np.asarray(regions.largest(real, imaginary, *beside) <= GROWTH * size)
