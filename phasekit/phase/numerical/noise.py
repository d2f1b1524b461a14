"""How far rounding may have moved V, V' and V''."""

from __future__ import annotations

import functools
from collections.abc import Callable

import numpy as np
import numpy.typing as npt

from phasekit.phase.numerical.formula import Formula
from phasekit.phase.numerical.intervals import RULES, Bounds, NoRule, real_power, whole_power
from phasekit.phase.numerical.rounding import Flags, Interval
from phasekit.phase.numerical.systems import Systems

Array = npt.NDArray[np.float64]

_EPS = float(np.finfo(float).eps)
#: Bounds give a sum a unit in the last place to either side, of which rounding takes half of one.
_SHARE = 0.25


def _usual(rule: Callable[..., Interval]) -> Callable[..., Interval]:
    """A rule by what functions usually are off, one unit in the last place, not by what may be."""

    def narrower(undefined: Flags, a: Interval) -> Interval:
        low, high = rule(undefined, a)
        size = _EPS * np.maximum(np.abs(low), np.abs(high))
        half = 0.5 * np.maximum(high - low - 6.0 * size, 2.0 * size)
        middle = 0.5 * (low + high)
        return middle - half, middle + half

    return narrower


class _Terms(Bounds):
    """Bounds at points, as wide as rounding usually makes values."""

    _whole_power = staticmethod(lambda n: _usual(whole_power(n)))
    _real_power = staticmethod(lambda exponent: _usual(real_power(exponent)))
    _rules = {**Bounds._rules, **{k: _usual(rule) for k, rule in RULES.items() if k != "Abs"}}


@functools.lru_cache(maxsize=256)
def _bounds(formula: Formula, order: int) -> _Terms | None:
    """Bounds of V, V' or V'' of (x, parameters); None where a function has no rule."""
    import sympy as sp

    from phasekit.laws.derivatives import derivative

    if formula.expression is None:
        return None
    x, *parameters = (sp.Symbol(n, real=True) for n in (formula.coordinate, *formula.names))
    expression = formula.expression
    for _ in range(order):
        expression = derivative(expression, x)
    try:
        return _Terms((expression,), (x, *parameters))
    except NoRule:
        return None


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
    bounds = _bounds(systems.formula, order)
    if bounds is None:
        return rough
    ((low, high),), undefined = bounds(*((a, a) for a in (x, *systems.beside(x))))
    with np.errstate(all="ignore"):
        found = _SHARE * (high - low)
    return np.where(~undefined & np.isfinite(found), found, rough)
