"""Bounds of formulas over rectangles of the complex plane, as programs on real and imaginary parts.

The parts of a function of x + iy are real formulas of x and y, which the compiled `kernel` bounds.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, Any, TypeAlias

import numpy as np

from phasekit.arrays import Array
from phasekit.numerics.intervals.bounds import Evaluator, Interval
from phasekit.numerics.intervals.program import NoRule, Program, Reader
from phasekit.numerics.later import later

if TYPE_CHECKING:
    import sympy as sp
else:
    sp = later("sympy")

#: Entries of the real and of the imaginary part; None where this is 0.
Pair: TypeAlias = tuple[int, int | None]


class _PlaneReader(Reader[Pair]):
    """Writes the program of real and imaginary parts."""

    def __init__(self, variable: Any, parameters: Sequence[Any]) -> None:
        known: dict[Any, Pair] = {variable: (0, 1)}
        known |= {symbol: (i, None) for i, symbol in enumerate(parameters, start=2)}
        super().__init__(known)
        self.program = Program(2 + len(parameters))

    # -- real entries ------------------------------------------------------------------------------

    def _times(self, *places: int) -> int:
        product = places[0]
        for place in places[1:]:
            product = self.program.multiply(product, place)
        return product

    def _plus(self, a: int | None, b: int | None) -> int | None:
        if a is None or b is None:
            return b if a is None else a
        return self.program.add(a, b)

    def _minus(self, a: int | None) -> int | None:
        return None if a is None else self.program.negative(a)

    def _f(self, name: str, a: int) -> int:
        return self.program.entry(name, a)

    def _over(self, a: int, b: int) -> int:
        return self._times(a, self.program.power(b, -1))

    # -- complex ones ------------------------------------------------------------------------------

    def number(self, value: Any) -> Pair:
        return self.program.entry("number", own=value), None

    def add(self, a: Pair, b: Pair) -> Pair:
        return self.program.add(a[0], b[0]), self._plus(a[1], b[1])

    def multiply(self, a: Pair, b: Pair) -> Pair:
        (p, q), (r, s) = a, b
        if q is None or s is None:
            (p, _), (r, s) = (a, b) if q is None else (b, a)
            return self._times(p, r), None if s is None else self._times(p, s)
        re = self.program.add(self._times(p, r), self.program.negative(self._times(q, s)))
        return re, self.program.add(self._times(p, s), self._times(q, r))

    def power(self, a: Pair, n: int) -> Pair:
        if a[1] is None:
            return self.program.power(a[0], n), None
        result, factor, left = None, a, abs(n)
        while left:
            if left % 2:
                result = factor if result is None else self.multiply(result, factor)
            left //= 2
            factor = self._square(factor) if left else factor
        assert result is not None
        return result if n > 0 else self._inverse(result)

    def _square(self, a: Pair) -> Pair:
        p, q = a
        assert q is not None
        re = self.program.add(self.program.power(p, 2), self.program.negative(self._squared(q)))
        return re, self._times(self.number(sp.Integer(2))[0], p, q)

    def _squared(self, a: int) -> int:
        return self.program.power(a, 2)

    def _inverse(self, a: Pair) -> Pair:
        p, q = a
        assert q is not None
        inverse = self.program.power(self.program.add(self._squared(p), self._squared(q)), -1)
        return self._times(p, inverse), self._minus(self._times(q, inverse))

    def root(self, a: Pair, exponent: Any) -> Pair:
        if a[1] is None:
            return self.program.entry("root", a[0], own=exponent), None
        return self._exp(self.multiply(self.number(exponent), self._log(a)))

    def call(self, name: str, a: Pair, order: int | None = None) -> Pair:
        rule = getattr(self, f"_{name}", None) if order is None else None
        if rule is None:
            raise NoRule(name)
        if a[1] is None:
            return self._f(name, a[0]), None
        found: Pair = rule(a)
        return found

    def _exp(self, a: Pair) -> Pair:
        size = self._f("exp", a[0])
        if a[1] is None:
            return size, None
        return self._times(size, self._f("cos", a[1])), self._times(size, self._f("sin", a[1]))

    def _log(self, a: Pair) -> Pair:
        """In the right half of the plane; elsewhere it is undefined."""
        p, q = a
        assert q is not None
        self._f("log", p)  # is undefined where the real part may be 0
        size = self.program.add(self._squared(p), self._squared(q))
        half = self._times(self.number(sp.S.Half)[0], self._f("log", size))
        return half, self._f("atan", self._over(q, p))

    def _waves(self, a: Pair, first: str, second: str, third: str, fourth: str) -> tuple[int, int]:
        p, q = a
        assert q is not None
        re = self._times(self._f(first, p), self._f(second, q))
        return re, self._times(self._f(third, p), self._f(fourth, q))

    def _sin(self, a: Pair) -> Pair:
        return self._waves(a, "sin", "cosh", "cos", "sinh")

    def _cos(self, a: Pair) -> Pair:
        re, im = self._waves(a, "cos", "cosh", "sin", "sinh")
        return re, self._minus(im)

    def _sinh(self, a: Pair) -> Pair:
        return self._waves(a, "sinh", "cos", "cosh", "sin")

    def _cosh(self, a: Pair) -> Pair:
        return self._waves(a, "cosh", "cos", "sinh", "sin")

    def _tanh(self, a: Pair) -> Pair:
        """(tanh x + i sin y cos y sech(x)^2)/(1 - sin(y)^2 sech(x)^2)."""
        p, q = a
        assert q is not None
        s, c, fall = self._f("sin", q), self._f("cos", q), self._f("sech", p)
        below = self._beside_sech(s, fall)
        return (
            self._over(self._f("tanh", p), below),
            self._over(self._times(s, c, self._squared(fall)), below),
        )

    def _beside_sech(self, s: int, fall: int) -> int:
        """|cosh(x + iy)|^2/cosh(x)^2, by the sine of y and sech x, neither of which overflows."""
        part = self._squared(self._times(s, fall))
        return self.program.add(self.number(sp.S.One)[0], self.program.negative(part))

    def _sech(self, a: Pair) -> Pair:
        """(cos y - i tanh x sin y) sech x/(1 - sin(y)^2 sech(x)^2)."""
        p, q = a
        assert q is not None
        s, c, fall = self._f("sin", q), self._f("cos", q), self._f("sech", p)
        below = self._over(fall, self._beside_sech(s, fall))
        return self._times(c, below), self._minus(self._times(self._f("tanh", p), s, below))

    def _turned(self, rule: Callable[[Pair], Pair], a: Pair) -> Pair:
        """-i f(i z)."""
        p, q = a
        assert q is not None
        re, im = rule((self.program.negative(q), p))
        assert im is not None
        return im, self.program.negative(re)

    def _tan(self, a: Pair) -> Pair:
        return self._turned(self._tanh, a)

    def _asinh(self, a: Pair) -> Pair:
        """log(z + sqrt(1 + z^2)), which is odd, in the right half of the plane."""
        side = (self._f("side", a[0]), None)
        a = self.multiply(side, a)
        root = self.root(self.add(self.number(sp.S.One), self._square(a)), sp.S.Half)
        return self.multiply(side, self._log(self.add(a, root)))

    def _asin(self, a: Pair) -> Pair:
        return self._turned(self._asinh, a)

    def _acos(self, a: Pair) -> Pair:
        re, im = self._asin(a)
        quarter = self.number(sp.pi / 2)[0]
        return self.program.add(quarter, self.program.negative(re)), self._minus(im)

    def _acosh(self, a: Pair) -> Pair:
        below = self.add(self.number(sp.Integer(-1)), self._square(a))
        return self._log(self.add(a, self.root(below, sp.S.Half)))

    def _atanh(self, a: Pair) -> Pair:
        one = self.number(sp.S.One)
        minus = self.program.negative(a[0]), self._minus(a[1])
        right, left = self._log(self.add(one, a)), self._log(self.add(one, minus))
        both = self.program.add(right[0], self.program.negative(left[0]))
        imaginary = self._plus(right[1], self._minus(left[1]))
        return self.multiply(self.number(sp.S.Half), (both, imaginary))

    def _atan(self, a: Pair) -> Pair:
        return self._turned(self._atanh, a)

    def _erf(self, a: Pair) -> Pair:
        """Differs from erf(x) by less than 2/sqrt(pi) |y| exp(y^2 - x^2)."""
        p, q = a
        assert q is not None
        fall = self.program.add(self._squared(q), self.program.negative(self._squared(p)))
        either = self.program.entry("number", own=(-1.1284, 1.1284))
        off = self._times(either, q, self._f("exp", fall))
        return self.program.add(self._f("erf", p), off), off

    def _erfc(self, a: Pair) -> Pair:
        re, im = self._erf(a)
        minus = self.program.negative(re), self._minus(im)
        return self.add(self.number(sp.S.One), minus)


class Regions:
    """Bounds of an expression over rectangles of the complex plane of one variable."""

    def __init__(self, expression: Any, variable: Any, parameters: Sequence[Any] = ()) -> None:
        reader = _PlaneReader(variable, parameters)
        re, im = reader.read(expression)
        reader.program.outputs = [re] if im is None else [re, im]
        self._evaluate = Evaluator(reader.program)

    def largest(self, re: Interval, im: Interval, *parameters: Interval) -> Array:
        """Largest absolute value over rectangles; infinite where it may not be analytic."""
        parts, undefined = self._evaluate((re, im, *parameters))
        sizes = [np.maximum(np.abs(low), np.abs(high)) for low, high in parts]
        size = np.hypot(sizes[0], sizes[-1] if len(sizes) > 1 else 0.0)
        return np.where((undefined > 0) | np.isnan(size), np.inf, size)
