"""Interval arithmetic on formulas: bounds of their values over whole stretches of the coordinate.

Every bound is rounded outward, so what it excludes is excluded, which no sampling can do
[MooreKearfottCloud2009]. A formula becomes a list of operations, and each of them works on the
arrays of all stretches at once.
"""

from __future__ import annotations

import functools
from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np
import numpy.typing as npt

from phasekit.phase.numerical import special_bounds
from phasekit.phase.numerical.rounding import Flags, Interval, outward, rising, wide

_EPS = float(np.finfo(float).eps)


class NoRule(Exception):
    """A formula holds a function of which no bounds are known; the argument names it."""


def point(x: npt.ArrayLike) -> Interval:
    """The interval of one number."""
    return x, x


def constant_bounds(expression: Any) -> Interval:
    """Bounds of an expression without symbols."""
    if expression.is_Float:
        return point(float(expression))
    value = float(expression)
    if not np.isfinite(value):
        raise NoRule(str(expression))
    if expression.is_Rational:
        from fractions import Fraction

        exact = Fraction(int(expression.p), int(expression.q))
        if Fraction(value) == exact:
            return point(value)
        return outward(value, value)
    return outward(value, value)


def add(_: Flags, a: Interval, b: Interval) -> Interval:
    """Bounds of a sum."""
    return outward(a[0] + b[0], a[1] + b[1])


def multiply(_: Flags, a: Interval, b: Interval) -> Interval:
    """Bounds of a product."""
    for one, other in ((a, b), (b, a)):
        if isinstance(one[0], float) and one[0] == one[1]:
            if abs(one[0]) == 1.0:  # exact
                return other if one[0] > 0.0 else (-other[1], -other[0])
            ends = (one[0] * other[0], one[0] * other[1])
            return outward(*(ends if one[0] > 0.0 else ends[::-1]))
    products = np.stack(np.broadcast_arrays(a[0] * b[0], a[0] * b[1], a[1] * b[0], a[1] * b[1]))
    products = np.where(np.isnan(products), 0.0, products)  # 0 times infinity
    return outward(products.min(axis=0), products.max(axis=0))


def _reciprocal(undefined: Flags, a: Interval) -> Interval:
    low, high = a
    through = (low <= 0.0) & (high >= 0.0)
    undefined |= through
    left, right = outward(1.0 / np.asarray(high), 1.0 / np.asarray(low))
    left = np.where(through, np.where((low == 0.0) & (high > 0.0), left, -np.inf), left)
    right = np.where(through, np.where((high == 0.0) & (low < 0.0), right, np.inf), right)
    return left, right


def whole_power(n: int) -> Callable[..., Interval]:
    """Rule for a power with a whole exponent, not 0."""

    def power(undefined: Flags, a: Interval) -> Interval:
        if n < 0:
            return _reciprocal(undefined, positive(undefined, a))
        return positive(undefined, a)

    def positive(_: Flags, a: Interval) -> Interval:
        m = abs(n)
        if m == 1:
            return a
        low = high = np.power(np.asarray(a[0], dtype=float), m)
        if a[1] is not a[0]:
            high = np.power(np.asarray(a[1], dtype=float), m)
        if m % 2:
            return wide(low, high)
        through = (np.asarray(a[0]) <= 0.0) & (np.asarray(a[1]) >= 0.0)
        least, most = wide(np.minimum(low, high), np.maximum(low, high))
        return np.where(through, 0.0, np.maximum(least, 0.0)), most

    return power


def real_power(exponent: Interval) -> Callable[..., Interval]:
    """Rule for a power with a real exponent, of a base that is not negative."""

    def power(undefined: Flags, a: Interval) -> Interval:
        undefined |= np.asarray(a[0]) < 0.0
        low, high = np.maximum(a[0], 0.0), np.maximum(a[1], 0.0)
        if exponent[0] < 0.0:
            undefined |= low == 0.0
        ends = [np.power(end, p) for end in (low, high) for p in set(exponent)]
        least, most = np.minimum.reduce(ends), np.maximum.reduce(ends)
        least, most = wide(least, most)
        return np.maximum(least, 0.0), most

    return power


def _falling(rule: Callable[..., Interval]) -> Callable[..., Interval]:
    """Turn a rule for f into that for f(-x)."""
    return lambda undefined, a: rule(undefined, (-a[1], -a[0]))


def _cosh(_: Flags, a: Interval) -> Interval:
    low, high = np.cosh(a[0]), np.cosh(a[1])
    through = (np.asarray(a[0]) <= 0.0) & (np.asarray(a[1]) >= 0.0)
    least, most = wide(np.minimum(low, high), np.maximum(low, high))
    return np.where(through, 1.0, np.maximum(least, 1.0)), most


def _abs(_: Flags, a: Interval) -> Interval:
    low, high = np.abs(a[0]), np.abs(a[1])
    through = (np.asarray(a[0]) <= 0.0) & (np.asarray(a[1]) >= 0.0)
    return np.where(through, 0.0, np.minimum(low, high)), np.maximum(low, high)


def _wave(function: Callable[[Any], Any], top: float) -> Callable[..., Interval]:
    """Rule for a sine whose maxima lie at ``top + 2 pi k``."""

    def rule(_: Flags, a: Interval) -> Interval:
        low, high = (np.asarray(end, dtype=float) for end in a)
        ends = function(low), function(high)
        least, most = wide(np.minimum(*ends), np.maximum(*ends))
        # The number of a turn is rounded so that a maximum is rather seen than missed.
        slack = 8.0 * _EPS * (1.0 + np.maximum(np.abs(low), np.abs(high)))
        for place, bound in ((top, 1.0), (top + np.pi, -1.0)):
            first = np.ceil((low - place - slack) / (2.0 * np.pi))
            last = np.floor((high - place + slack) / (2.0 * np.pi))
            held = ~(first > last)  # infinite ends hold it as well
            if bound > 0.0:
                most = np.where(held, 1.0, np.minimum(most, 1.0))
            else:
                least = np.where(held, -1.0, np.maximum(least, -1.0))
        return least, most

    return rule


def _tan(undefined: Flags, a: Interval) -> Interval:
    low, high = (np.asarray(end, dtype=float) for end in a)
    slack = 8.0 * _EPS * (1.0 + np.maximum(np.abs(low), np.abs(high)))
    first = np.ceil((low - 0.5 * np.pi - slack) / np.pi)
    pole = ~(first > np.floor((high - 0.5 * np.pi + slack) / np.pi))
    undefined |= pole
    least, most = wide(np.tan(low), np.tan(high))
    return np.where(pole, -np.inf, least), np.where(pole, np.inf, most)


def _erf(x: Any) -> Any:
    from scipy.special import erf

    return erf(x)


def _erfc(x: Any) -> Any:
    from scipy.special import erfc

    return erfc(-np.asarray(x))


RULES: dict[str, Callable[..., Interval]] = {
    "exp": rising(np.exp, image=(0.0, np.inf)),
    "log": rising(np.log, domain=(0.0, np.inf)),
    "sin": _wave(np.sin, 0.5 * np.pi),
    "cos": _wave(np.cos, 0.0),
    "tan": _tan,
    "sinh": rising(np.sinh),
    "cosh": _cosh,
    "tanh": rising(np.tanh, image=(-1.0, 1.0)),
    "asin": rising(np.arcsin, domain=(-1.0, 1.0)),
    "acos": _falling(rising(lambda x: np.arccos(-x), domain=(-1.0, 1.0))),
    "atan": rising(np.arctan),
    "asinh": rising(np.arcsinh),
    "acosh": rising(np.arccosh, domain=(1.0, np.inf)),
    "atanh": rising(np.arctanh, domain=(-1.0, 1.0)),
    "erf": rising(_erf, image=(-1.0, 1.0)),
    "erfc": _falling(special_bounds.of_squares(_erfc, 0.0, 2.0)),
    "Abs": _abs,
}
_REWRITTEN: dict[str, Callable[[Any, Any], Any]] = {
    "sec": lambda sp, x: 1 / sp.cos(x),
    "csc": lambda sp, x: 1 / sp.sin(x),
    "cot": lambda sp, x: sp.cos(x) / sp.sin(x),
    "sech": lambda sp, x: 1 / sp.cosh(x),
    "csch": lambda sp, x: 1 / sp.sinh(x),
    "coth": lambda sp, x: sp.cosh(x) / sp.sinh(x),
}


class Bounds:
    """Bounds of some expressions over boxes of their symbols.

    Parameters
    ----------
    expressions : sequence of sympy expressions
    symbols : sequence of sympy symbols

    Raises
    ------
    NoRule
        If an expression holds a function that has no rule here.
    """

    _constant: Callable[[Any], Any] = staticmethod(constant_bounds)
    _sum: Callable[..., Any] = staticmethod(add)
    _product: Callable[..., Any] = staticmethod(multiply)
    _whole_power: Callable[[int], Callable[..., Any]] = staticmethod(whole_power)
    _real_power: Callable[[Interval], Callable[..., Any]] = staticmethod(real_power)
    _rules: Mapping[str, Callable[..., Any]] = {**special_bounds.RULES, **RULES}
    _of_an_order: Mapping[str, Callable[[int], Any]] = special_bounds.OF_AN_ORDER

    def __init__(self, expressions: Sequence[Any], symbols: Sequence[Any]) -> None:
        self._steps: list[tuple[Callable[..., Interval], tuple[int, ...]]] = []
        self._place: dict[Any, int] = {symbol: i for i, symbol in enumerate(symbols)}
        self._inputs = len(symbols)
        self._outputs = [self._compile(expression) for expression in expressions]

    def __call__(self, *inputs: Interval) -> tuple[list[Interval], Flags]:
        """Return the bounds of each expression, and where one may be undefined or have a pole.

        Bounds of infinite size stand for any value.
        """
        shape = np.broadcast_shapes(*(np.shape(low) for low, _ in inputs))
        undefined = np.zeros(shape, dtype=bool)
        values: list[Any] = list(inputs)
        with np.errstate(all="ignore"):
            for step, arguments in self._steps:
                values.append(step(undefined, *(values[i] for i in arguments)))
        found = []
        for i in self._outputs:
            low, high = (np.broadcast_to(end, shape) for end in values[i])
            low, high = (
                np.where(np.isnan(low), -np.inf, low),
                np.where(np.isnan(high), np.inf, high),
            )
            found.append((low, high))
        return found, undefined

    def _add(self, step: Callable[..., Interval], *arguments: int) -> int:
        self._steps.append((step, arguments))
        return self._inputs + len(self._steps) - 1

    def _compile(self, expression: Any) -> int:
        if expression not in self._place:
            self._place[expression] = self._lay_out(expression)
        return self._place[expression]

    def _lay_out(self, expression: Any) -> int:
        import sympy as sp

        if not expression.free_symbols:
            constant = self._constant(expression)
            return self._add(lambda _: constant)
        if expression.is_Symbol:
            raise NoRule(str(expression))
        arguments = expression.args
        name = type(expression).__name__
        if expression.is_Add or expression.is_Mul:
            join = self._sum if expression.is_Add else self._product
            place = self._compile(arguments[0])
            for argument in arguments[1:]:
                place = self._add(join, place, self._compile(argument))
            return place
        if expression.is_Pow:
            base, exponent = arguments
            if exponent.is_Integer:
                return self._add(self._whole_power(int(exponent)), self._compile(base))
            if not exponent.free_symbols:
                return self._add(self._real_power(constant_bounds(exponent)), self._compile(base))
            return self._compile(sp.exp(exponent * sp.log(base), evaluate=False))
        if name in self._rules and len(arguments) == 1:
            return self._add(self._rules[name], self._compile(arguments[0]))
        if name in self._of_an_order and arguments[0].is_Integer and arguments[0] >= 0:
            rule = self._of_an_order[name](int(arguments[0]))
            return self._add(rule, self._compile(arguments[1]))
        if name in _REWRITTEN and len(arguments) == 1:
            return self._compile(_REWRITTEN[name](sp, arguments[0]))
        raise NoRule(name)


@functools.lru_cache(maxsize=128)
def bounds_of_slopes(potential: Any, names: tuple[str, ...]) -> Bounds | str:
    """Bounds of V' and V'' of an expression in the named variables, the coordinate being the first.

    Where a function in it has no rule, its name.
    """
    import sympy as sp

    from phasekit.laws.derivatives import derivative

    symbols = [sp.Symbol(name, real=True) for name in names]
    slopes = [derivative(potential, symbols[0], order) for order in (1, 2)]
    try:
        return Bounds(slopes, symbols)
    except NoRule as missing:
        return str(missing)
