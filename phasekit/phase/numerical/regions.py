"""Bounds of formulas over rectangles of the complex plane: how smooth a formula is on a stretch.

A function that stays within M on an ellipse about a stretch has a Chebyshev series there whose
terms fall at least as fast as M rho^-k [Trefethen2013], so samples at a few nodes show all of it:
nothing narrow can hide between them. Where it grows beyond what the samples show, or is not
analytic, the stretch is too long. Rectangles are pairs of the intervals of `intervals`.
"""

from __future__ import annotations

import functools
from collections.abc import Callable, Mapping
from typing import Any, TypeAlias

import numpy as np
import numpy.typing as npt

from phasekit.phase.numerical import intervals as real
from phasekit.phase.numerical.formula import Formula, Shape
from phasekit.phase.numerical.intervals import Bounds, NoRule, point
from phasekit.phase.numerical.rounding import Interval
from phasekit.phase.numerical.systems import Index, Systems

Array = npt.NDArray[np.float64]
Flags = npt.NDArray[np.bool_]
#: Bounds of the real and of the imaginary part.
Box: TypeAlias = tuple[Interval, Interval]

#: Half the width and the height of the ellipse with rho = 3, in halves of the stretch.
_WIDTH, _HEIGHT = 5.0 / 3.0, 4.0 / 3.0
#: How much larger than the samples the bounds may be: they are larger than the function as well.
GROWTH = 1e4


def _sized(box: Box) -> Any:
    re, im = (np.maximum(np.abs(part[0]), np.abs(part[1])) for part in box)
    return np.hypot(re, im)


def _negative(a: Interval) -> Interval:
    return -np.asarray(a[1]), -np.asarray(a[0])


def _sum(undefined: Flags, a: Box, b: Box) -> Box:
    return real.add(undefined, a[0], b[0]), real.add(undefined, a[1], b[1])


def _product(undefined: Flags, a: Box, b: Box) -> Box:
    if b[1] is NOTHING:
        a, b = b, a
    times = functools.partial(real.multiply, undefined)
    if a[1] is NOTHING:
        return times(a[0], b[0]), b[1] if b[1] is NOTHING else times(a[0], b[1])
    plus = functools.partial(real.add, undefined)
    return (
        plus(times(a[0], b[0]), _negative(times(a[1], b[1]))),
        plus(times(a[0], b[1]), times(a[1], b[0])),
    )


def _square(undefined: Flags, a: Box) -> Box:
    times, square = functools.partial(real.multiply, undefined), real.whole_power(2)
    re = real.add(undefined, square(undefined, a[0]), _negative(square(undefined, a[1])))
    return re, times((2.0, 2.0), times(a[0], a[1]))


def _reciprocal(undefined: Flags, a: Box) -> Box:
    square = real.whole_power(2)
    size = real.add(undefined, square(undefined, a[0]), square(undefined, a[1]))
    inverse = real.whole_power(-1)(undefined, size)
    times = functools.partial(real.multiply, undefined)
    return times(a[0], inverse), _negative(times(a[1], inverse))


def _whole_power(n: int) -> Callable[..., Box]:
    def power(undefined: Flags, a: Box) -> Box:
        result, factor, left = None, a, abs(n)
        while left:
            if left % 2:
                result = factor if result is None else _product(undefined, result, factor)
            left //= 2
            factor = _square(undefined, factor) if left else factor
        assert result is not None
        return result if n > 0 else _reciprocal(undefined, result)

    return power


def _exp(undefined: Flags, a: Box) -> Box:
    size = real.RULES["exp"](undefined, a[0])
    cos, sin = (real.RULES[name](undefined, a[1]) for name in ("cos", "sin"))
    return real.multiply(undefined, size, cos), real.multiply(undefined, size, sin)


def _log(undefined: Flags, a: Box) -> Box:
    """In the right half of the plane; elsewhere it is taken for undefined."""
    undefined |= ~(np.asarray(a[0][0]) > 0.0)
    square = real.whole_power(2)
    size = real.add(undefined, square(undefined, a[0]), square(undefined, a[1]))
    ratio = real.multiply(undefined, a[1], real.whole_power(-1)(undefined, a[0]))
    half = real.multiply(undefined, (0.5, 0.5), real.RULES["log"](undefined, size))
    return half, real.RULES["atan"](undefined, ratio)


def _real_power(exponent: Interval) -> Callable[..., Box]:
    def power(undefined: Flags, a: Box) -> Box:
        return _exp(undefined, _product(undefined, (exponent, NOTHING), _log(undefined, a)))

    return power


def _turned(a: Box) -> Box:
    """I times a."""
    return _negative(a[1]), a[0]


def _wave(first: tuple[str, str], second: tuple[str, str], sign: float) -> Callable[..., Box]:
    """Rule for f(x + iy) = f1(x) f2(y) + i sign f3(x) f4(y)."""

    def rule(undefined: Flags, a: Box) -> Box:
        re, im = (
            real.multiply(
                undefined, real.RULES[one](undefined, a[0]), real.RULES[two](undefined, a[1])
            )
            for one, two in (first, second)
        )
        return re, im if sign > 0.0 else _negative(im)

    return rule


def _mirrored(rule: Callable[..., Box], odd: bool) -> Callable[..., Box]:
    """Rule for an odd or even function from that on the right half of the plane."""

    def whole(undefined: Flags, a: Box) -> Box:
        left = np.asarray(a[0][0]) + np.asarray(a[0][1]) < 0.0

        def flip(part: Interval) -> Interval:
            low, high = np.asarray(part[0]), np.asarray(part[1])
            return np.where(left, -high, low), np.where(left, -low, high)

        re, im = rule(undefined, (flip(a[0]), flip(a[1])))
        return (flip(re), flip(im)) if odd else (re, im)

    return whole


_odd = functools.partial(_mirrored, odd=True)


def _tanh(undefined: Flags, a: Box) -> Box:
    q = _exp(undefined, _product(undefined, ((-2.0, -2.0), NOTHING), a))
    over = _sum(undefined, _ONE, (_negative(q[0]), _negative(q[1])))
    return _product(undefined, over, _reciprocal(undefined, _sum(undefined, _ONE, q)))


def _sech(undefined: Flags, a: Box) -> Box:
    near_pole, far_pole = np.zeros((2, *undefined.shape), dtype=bool)
    near = _reciprocal(near_pole, _RULES["cosh"](near_pole, a))
    root = _exp(far_pole, (_negative(a[0]), _negative(a[1])))
    below = _reciprocal(far_pole, _sum(far_pole, _ONE, _square(far_pole, root)))
    far = _product(far_pole, ((2.0, 2.0), NOTHING), _product(far_pole, root, below))
    steep = np.asarray(a[0][1]) > 20.0  # where cosh is about to overflow
    undefined |= np.where(steep, far_pole, near_pole)
    re, im = (
        (np.where(steep, f[0], n[0]), np.where(steep, f[1], n[1]))
        for f, n in zip(far, near, strict=True)
    )
    return re, im


def _asinh(undefined: Flags, a: Box) -> Box:
    root = _real_power((0.5, 0.5))(undefined, _sum(undefined, _ONE, _square(undefined, a)))
    return _log(undefined, _sum(undefined, a, root))


def _atanh(undefined: Flags, a: Box) -> Box:
    minus = _negative(a[0]), _negative(a[1])
    one, two = (_log(undefined, _sum(undefined, _ONE, part)) for part in (a, minus))
    both = _sum(undefined, one, (_negative(two[0]), _negative(two[1])))
    return _product(undefined, ((0.5, 0.5), NOTHING), both)


def _back(rule: Callable[..., Box]) -> Callable[..., Box]:
    """Rule for -i f(i z)."""

    def turned(undefined: Flags, a: Box) -> Box:
        re, im = rule(undefined, _turned(a))
        return im, _negative(re)

    return turned


def _acosh(undefined: Flags, a: Box) -> Box:
    lower = _sum(undefined, ((-1.0, -1.0), NOTHING), _square(undefined, a))
    return _log(undefined, _sum(undefined, a, _real_power((0.5, 0.5))(undefined, lower)))


def _acos(undefined: Flags, a: Box) -> Box:
    re, im = _back(_odd(_asinh))(undefined, a)
    return real.add(undefined, (1.5707963, 1.5707964), _negative(re)), _negative(im)


def _erf(undefined: Flags, a: Box) -> Box:
    re = real.RULES["erf"](undefined, a[0])
    away = np.maximum(np.abs(a[1][0]), np.abs(a[1][1]))
    near = np.where(a[0][0] * a[0][1] <= 0.0, 0.0, np.minimum(np.abs(a[0][0]), np.abs(a[0][1])))
    off = 1.1284 * away * np.exp(away**2 - near**2)
    return (re[0] - off, re[1] + off), (-off, off)


def _erfc(undefined: Flags, a: Box) -> Box:
    re, im = _erf(undefined, a)
    return _sum(undefined, _ONE, (_negative(re), _negative(im)))


NOTHING: Interval = (0.0, 0.0)
_ONE: Box = ((1.0, 1.0), NOTHING)
_RULES: dict[str, Callable[..., Box]] = {
    "exp": _exp,
    "log": _log,
    "sin": _wave(("sin", "cosh"), ("cos", "sinh"), 1.0),
    "cos": _wave(("cos", "cosh"), ("sin", "sinh"), -1.0),
    "sinh": _wave(("sinh", "cos"), ("cosh", "sin"), 1.0),
    "cosh": _wave(("cosh", "cos"), ("sinh", "sin"), 1.0),
    "tanh": _odd(_tanh),
    "sech": _mirrored(_sech, odd=False),
    "tan": _back(_odd(_tanh)),
    "asinh": _odd(_asinh),
    "asin": _back(_odd(_asinh)),
    "acos": _acos,
    "acosh": _acosh,
    "atanh": _atanh,
    "atan": _back(_atanh),
    "erf": _erf,
    "erfc": _erfc,
}


class Regions(Bounds):
    """Bounds over rectangles of the complex plane; called as `Bounds` is, with boxes."""

    _constant = staticmethod(lambda expression: (real.constant_bounds(expression), NOTHING))
    _sum = staticmethod(_sum)
    _product = staticmethod(_product)
    _whole_power = staticmethod(_whole_power)
    _real_power = staticmethod(_real_power)
    _rules = _RULES
    _of_an_order: Mapping[str, Callable[[int], Any]] = {}

    def _lay_out(self, expression: Any) -> int:
        import sympy as sp

        base, exponent = expression.as_base_exp()
        if isinstance(base, sp.cosh) and exponent.is_Integer and exponent < 0:
            # cosh overflows where its reciprocal is nearly 0
            place = self._compile(sp.sech(base.args[0], evaluate=False))
            return self._add(self._whole_power(-int(exponent)), place) if exponent < -1 else place
        return super()._lay_out(expression)

    def largest(self, *boxes: Box) -> Array:
        """Largest absolute value of the first expression; infinite where it is not analytic."""
        shape = np.broadcast_shapes(*(np.shape(box[0][0]) for box in boxes))
        undefined = np.zeros(shape, dtype=bool)
        values: list[Any] = list(boxes)
        with np.errstate(all="ignore"):
            for step, arguments in self._steps:
                values.append(step(undefined, *(values[i] for i in arguments)))
            size = np.broadcast_to(_sized(values[self._outputs[0]]), shape)
        return np.where(undefined | np.isnan(size), np.inf, size)


@functools.lru_cache(maxsize=128)
def slope_regions(formula: Formula) -> Regions | None:
    """Bounds of V' over rectangles of (x, parameters); None where a function has no rule.

    One that is not given by an expression has none.
    """
    import sympy as sp

    from phasekit.laws.derivatives import derivative

    if formula.expression is None:
        return None
    x, *parameters = (sp.Symbol(n, real=True) for n in (formula.coordinate, *formula.names))
    try:
        return Regions((derivative(formula.expression, x),), (x, *parameters))
    except NoRule:
        return None


def smooth(systems: Systems, row: Index, low: Array, high: Array, size: Array) -> Flags:
    """Whether V' is on stretches of rows what samples of at most `size` show.

    True where nothing can be said: of polynomials and Fourier sums, whose degree bounds them, and
    of functions without rules.
    """
    bounds = slope_regions(systems.formula) if systems.formula.shape is Shape.GENERAL else None
    if bounds is None:
        return np.ones(low.shape, dtype=bool)
    middle, half = 0.5 * (low + high), 0.5 * np.abs(high - low)
    box = (
        (middle - _WIDTH * half, middle + _WIDTH * half),
        (-_HEIGHT * half, _HEIGHT * half),
    )
    beside = [(point(p[row]), NOTHING) for p in systems.parameters]
    return np.asarray(bounds.largest(box, *beside) <= GROWTH * size)
