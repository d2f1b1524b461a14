"""Programs on boxes: the compiled rules of elementary functions, every bound rounded outward.

What a bound excludes is excluded, which no sampling can do [MooreKearfottCloud2009]. Sums, products
and quotients are rounded by the next double; functions of the C library by `ulps` units in the last
place, where it promises one or two.
"""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt

from phasekit.arrays import Array
from phasekit.numerics.compile import inline, kernel, routine
from phasekit.numerics.intervals.program import ELEMENTARY

INF = math.inf
MOST = 1.7976931348623157e308
EPS = 2.0**-52
# x less (or plus) this part of itself and the least double is the next double, or the one after.
PART = 2.0**-53 * (1.0 + 2.0**-52)
LEAST = 5e-324
PI = math.pi
#: Beyond these exp, and sinh and cosh, are larger than all doubles.
EXP_MOST, COSH_MOST = 709.78, 710.47
#: How much more the complementary error function may be off than others: it squares its argument.
SQUARED = 16.0

#: What is known of the place of a box: in the domain, across its edge or a pole, outside of it.
DEFINED, DOUBTFUL, NOWHERE = range(3)

#: Numbers of the operations.
NUMBER, NEGATIVE, ADD, MULTIPLY, POWER, ROOT, SIDE = range(7)
(
    EXP, LOG, SIN, COS, TAN, SINH, COSH, TANH, SECH, ASIN, ACOS, ATAN, ASINH, ACOSH, ATANH,
    ERF, ERFC, ABS,
) = range(7, 7 + len(ELEMENTARY))  # fmt: skip
OPERATIONS = {
    name: number
    for number, name in enumerate(
        ["number", "negative", "add", "multiply", "power", "root", "side", *ELEMENTARY]
    )
}


@inline
def below(x: float) -> float:
    """The next double below, or the one after; the largest double below infinity."""
    return MOST if x == INF else x - (abs(x) * PART + LEAST)


@inline
def above(x: float) -> float:
    """The next double above, or the one after."""
    return -MOST if x == -INF else x + (abs(x) * PART + LEAST)


@inline
def lower(x: float, ulps: float) -> float:
    """Below what a function that is off by so many units may be."""
    x = MOST if x == INF else x
    return below(x - ulps * EPS * abs(x))


@inline
def upper(x: float, ulps: float) -> float:
    """Above what a function that is off by so many units may be."""
    x = -MOST if x == -INF else x
    return above(x + ulps * EPS * abs(x))


@inline
def times(x: float, y: float) -> float:
    """A product; 0 times infinity is 0."""
    return 0.0 if x == 0.0 or y == 0.0 else x * y


@routine
def multiply(a: float, b: float, c: float, d: float) -> tuple[float, float]:
    """Bounds of a product."""
    p, q, r, s = times(a, c), times(a, d), times(b, c), times(b, d)
    return below(min(min(p, q), min(r, s))), above(max(max(p, q), max(r, s)))


@routine
def reciprocal(a: float, b: float) -> tuple[float, float, int]:
    """Bounds of 1 over it, and whether it holds 0."""
    if a > 0.0 or b < 0.0:
        return below(1.0 / b), above(1.0 / a), DEFINED
    low = below(1.0 / b) if a == 0.0 and b > 0.0 else -INF
    high = above(1.0 / a) if b == 0.0 and a < 0.0 else INF
    return low, high, DOUBTFUL


@routine
def whole_power(a: float, b: float, n: int, ulps: float) -> tuple[float, float]:
    """Bounds of a power n > 1."""
    if n == 2:
        p, q = a * a, b * b
        margin = 0.0
    else:
        p, q = np.float64(a) ** float(n), np.float64(b) ** float(n)
        margin = ulps
    if n % 2 == 1:
        return lower(p, margin), upper(q, margin)
    if a <= 0.0 <= b:
        return 0.0, upper(max(p, q), margin)
    return max(lower(min(p, q), margin), 0.0), upper(max(p, q), margin)


@routine
def real_power(a: float, b: float, p: float, q: float, ulps: float) -> tuple[float, float, int]:
    """Bounds of powers with exponents in [p, q], of what is not negative; whether it may be."""
    bad = DOUBTFUL if a < 0.0 or (a <= 0.0 and p < 0.0) else DEFINED
    bad = NOWHERE if b < 0.0 else bad
    a, b = np.float64(max(a, 0.0)), np.float64(max(b, 0.0))
    if p == q == 0.5:
        return max(below(math.sqrt(a)), 0.0), above(math.sqrt(b)), bad
    s, u = a**p, b**p
    low, high = min(s, u), max(s, u)
    if p != q:
        t, v = a**q, b**q
        low, high = min(low, min(t, v)), max(high, max(t, v))
    return max(lower(low, ulps), 0.0), upper(high, ulps), bad


@routine
def sine(a: float, b: float, cosine: bool, ulps: float) -> tuple[float, float]:
    """Bounds of a sine or cosine."""
    size = max(abs(a), abs(b))
    if not (b - a < 2.0 * PI and size < 1e9):
        return -1.0, 1.0
    p, q = (math.cos(a), math.cos(b)) if cosine else (math.sin(a), math.sin(b))
    # Quarters of a turn, so that an extreme is rather seen than missed.
    slack = 8.0 * EPS * (1.0 + size)
    first = math.floor((a - slack) * (2.0 / PI)) + 1 + cosine
    last = math.floor((b + slack) * (2.0 / PI)) + cosine
    low, high = -1.0, 1.0
    if first + (3 - first) % 4 > last:
        low = max(lower(min(p, q), ulps), -1.0)
    if first + (1 - first) % 4 > last:
        high = min(upper(max(p, q), ulps), 1.0)
    return low, high


@routine
def tangent(a: float, b: float, ulps: float) -> tuple[float, float, int]:
    """Bounds of a tangent, and whether it may have a pole."""
    if not (b - a < PI and max(abs(a), abs(b)) < 1e15):
        return -INF, INF, DOUBTFUL
    slack = 8.0 * EPS * (1.0 + max(abs(a), abs(b)))
    first = math.ceil((a - 0.5 * PI - slack) / PI)
    if first <= math.floor((b - 0.5 * PI + slack) / PI):
        return -INF, INF, DOUBTFUL
    return lower(math.tan(a), ulps), upper(math.tan(b), ulps), DEFINED


# Functions beyond the range of doubles, where the C library's raise in Python.


@inline
def exp(x: float) -> float:
    """The exponential."""
    return INF if x > EXP_MOST else math.exp(x)


@inline
def sinh(x: float) -> float:
    """The hyperbolic sine."""
    return math.copysign(INF, x) if abs(x) > COSH_MOST else math.sinh(x)


@inline
def cosh(x: float) -> float:
    """The hyperbolic cosine."""
    return INF if abs(x) > COSH_MOST else math.cosh(x)


@inline
def log(x: float) -> float:
    """The logarithm of what is not negative."""
    return -INF if x <= 0.0 else (INF if x == INF else math.log(x))


@inline
def atanh(x: float) -> float:
    """The inverse of tanh on [-1, 1]."""
    return math.copysign(INF, x) if abs(x) >= 1.0 else math.atanh(x)


@inline
def acosh(x: float) -> float:
    """The inverse of cosh from 1 on."""
    return INF if x == INF else math.acosh(x)


@inline
def asinh(x: float) -> float:
    """The inverse of sinh."""
    return x if abs(x) == INF else math.asinh(x)


@routine
def monotone(op: int, x: float) -> float:
    """Functions that rise, or fall, in their domains."""
    if op == EXP:
        return exp(x)
    if op == TANH:
        return math.tanh(x)
    if op == ERF:
        return math.erf(x)
    if op == ERFC:
        return math.erfc(x)
    if op == ATAN:
        return math.atan(x)
    if op == SINH:
        return sinh(x)
    if op == ASINH:
        return asinh(x)
    if op == LOG:
        return log(max(x, 0.0))
    if op == ACOSH:
        return acosh(max(x, 1.0))
    if op == ASIN:
        return math.asin(min(max(x, -1.0), 1.0))
    if op == ACOS:
        return math.acos(min(max(x, -1.0), 1.0))
    return atanh(min(max(x, -1.0), 1.0))


@routine
def image(op: int) -> tuple[float, float]:
    """What values of a function lie between."""
    if op == EXP:
        return 0.0, INF
    if op == TANH or op == ERF:
        return -1.0, 1.0
    if op == ERFC:
        return 0.0, 2.0
    return -INF, INF


@routine
def domain(op: int) -> tuple[float, float]:
    """Where a function is defined."""
    if op == LOG:
        return 0.0, INF
    if op == ACOSH:
        return 1.0, INF
    if op == ASIN or op == ACOS or op == ATANH:
        return -1.0, 1.0
    return -INF, INF


@routine
def function(op: int, a: float, b: float, ulps: float) -> tuple[float, float, int]:
    """Bounds of a function, and whether it may be undefined or have a pole."""
    if op == SIN or op == COS:
        low, high = sine(a, b, op == COS, ulps)
        return low, high, DEFINED
    if op == TAN:
        return tangent(a, b, ulps)
    if op == ABS or op == COSH or op == SECH:
        near, far = min(abs(a), abs(b)), max(abs(a), abs(b))
        near = 0.0 if a <= 0.0 <= b else near
        if op == ABS:
            return near, far, DEFINED
        if op == COSH:
            return max(lower(cosh(near), ulps), 1.0), upper(cosh(far), ulps), DEFINED
        low, high = 1.0 / upper(cosh(far), ulps), 1.0 / max(lower(cosh(near), ulps), 1.0)
        return max(below(low), 0.0), min(above(high), 1.0), DEFINED
    start, stop = domain(op)
    low, high = monotone(op, a), monotone(op, b)
    bad = DOUBTFUL if a < start or b > stop or (abs(low) == INF and abs(a) < INF) else DEFINED
    bad = NOWHERE if b < start or a > stop else bad
    if op == ERFC or op == ACOS:
        low, high = high, low
    margin = SQUARED * ulps if op == ERFC else ulps
    least, most = image(op)
    return max(lower(low, margin), least), min(upper(high, margin), most), bad


@routine
def operate(
    code: npt.NDArray[np.int64], numbers: Array, ulps: float, begin: int, end: int, low: Array,
    high: Array, i: int,
) -> int:  # fmt: skip
    """Fill the entries of operations begin to end, of box i; where it is of all their domains.

    Rows of `code` are the operation, places of what it takes, and its number or exponent.
    """
    inputs = low.shape[1] - code.shape[0]
    worst = DEFINED
    for k in range(begin, end):
        op, first, second, own = code[k, 0], code[k, 1], code[k, 2], code[k, 3]
        bad = DEFINED
        if op == NUMBER:
            x, y = numbers[own, 0], numbers[own, 1]
        elif op == NEGATIVE:
            x, y = -high[i, first], -low[i, first]
        elif op == ADD:
            x = below(low[i, first] + low[i, second])
            y = above(high[i, first] + high[i, second])
        elif op == MULTIPLY:
            x, y = multiply(low[i, first], high[i, first], low[i, second], high[i, second])
        elif op == POWER:
            x, y = low[i, first], high[i, first]
            if abs(own) > 1:
                x, y = whole_power(x, y, abs(own), ulps)
            if own < 0:
                x, y, bad = reciprocal(x, y)
        elif op == ROOT:
            p, q = numbers[own, 0], numbers[own, 1]
            x, y, bad = real_power(low[i, first], high[i, first], p, q, ulps)
        elif op == SIDE:  # of 0 on which the middle lies, 1 or -1
            x = y = math.copysign(1.0, low[i, first] + high[i, first])
        else:
            x, y, bad = function(op, low[i, first], high[i, first], ulps)
        # What is not a number stands for any.
        low[i, inputs + k] = -INF if math.isnan(x) else x
        high[i, inputs + k] = INF if math.isnan(y) else y
        worst = max(worst, bad)
    return worst


@kernel
def evaluate(
    code: npt.NDArray[np.int64],
    numbers: npt.NDArray[np.float64],
    ulps: float,
    begin: int,
    end: int,
    start: int,
    stop: int,
    boxes: tuple[npt.NDArray[np.float64], npt.NDArray[np.float64], npt.NDArray[np.int8]],
) -> None:
    """Fill the entries of operations begin to end, of the boxes start to stop."""
    low, high, undefined = boxes
    for i in range(start, stop):
        bad = operate(code, numbers, ulps, begin, end, low, high, i)
        undefined[i] = max(undefined[i], bad)
