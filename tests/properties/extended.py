"""V' and V'' at doubles to about 1e-30 of their terms, vectorised and on any platform.

Numbers are sums of two doubles (a pair). For sin and cos the nodes k/32 come from mpmath; the rest
is a double of at most 1/64, without rounding, and takes its Taylor series.
"""

from __future__ import annotations

import numpy as np
from mpmath import mp, mpf
from numpy.typing import NDArray

Array = NDArray[np.float64]
Pair = tuple[Array, Array]


def pair(x: mpf) -> tuple[float, float]:
    with mp.workdps(50):
        return float(x), float(x - mpf(float(x)))


def _table() -> tuple[Array, Array]:
    with mp.workdps(50):
        nodes = [mp.cos_sin(mpf(k) / 32) for k in range(-102, 103)]
        values = np.array([[pair(x) for x in node] for node in nodes])
    return values[..., 0], values[..., 1]


HIGH, LOW = _table()
with mp.workdps(50):
    INVERSE = {n: pair(1 / mpf(n)) for n in (m * (m - 1) for m in range(2, 24))}


def two_sum(x: Array, y: Array) -> Pair:
    total = x + y
    part = total - x
    return total, (x - (total - part)) + (y - part)


def split(x: Array) -> Pair:
    big = 134217729.0 * x  # 2^27 + 1
    high = big - (big - x)
    return high, x - high


def two_product(x: Array, y: Array) -> Pair:
    product = x * y
    (a, b), (c, d) = split(x), split(y)
    return product, ((a * c - product) + a * d + b * c) + b * d


def add(x: Pair, y: Pair) -> Pair:
    high, low = two_sum(x[0], y[0])
    return two_sum(high, low + (x[1] + y[1]))


def multiply(x: Pair, y: Pair) -> Pair:
    high, low = two_product(x[0], y[0])
    return two_sum(high, low + (x[0] * y[1] + x[1] * y[0]))


def series(rest: Array, start: int) -> Pair:
    """Return the Taylor series of cos (start 0) or sin (start 1)."""
    zero = np.zeros_like(rest)
    minus_square = multiply((-rest, zero), (rest, zero))
    total = term = (rest, zero) if start else (zero + 1, zero)
    for n in range(start + 2, start + 20, 2):
        term = multiply(multiply(term, minus_square), INVERSE[n * (n - 1)])
        total = add(total, term)
    return total


def cos_sin(phi: Array) -> tuple[Pair, Pair]:
    """Return cos and sin of doubles in [-pi, pi]."""
    k = np.rint(phi * 32).astype(int)
    rest = phi - k / 32
    cos, sin = ((HIGH[k + 102, i], LOW[k + 102, i]) for i in (0, 1))
    rest_cos, rest_sin = series(rest, 0), series(rest, 1)
    minus_sin = (-rest_sin[0], -rest_sin[1])
    return (
        add(multiply(cos, rest_cos), multiply(sin, minus_sin)),
        add(multiply(sin, rest_cos), multiply(cos, rest_sin)),
    )


def derivatives(A: Array, B: Array, C: Array, phi: Array) -> tuple[Array, Array, Array]:
    """Return V', V'' and the sum of the sizes of the terms of V', of coefficients of size 1."""
    cos, sin = cos_sin(phi)
    zero = np.zeros_like(phi)
    a, b, c = (A, zero), (B, zero), (-C, zero)
    product = multiply(sin, cos)
    first = add(add(multiply(b, sin), multiply(c, cos)), multiply((-A, zero), product))
    minus = (-sin[0], -sin[1])
    double = add(multiply(cos, cos), multiply(sin, minus))
    minus_a = (-a[0], zero)
    second = add(add(multiply(b, cos), multiply((C, zero), sin)), multiply(minus_a, double))
    size = np.abs(B * sin[0]) + np.abs(A * product[0]) + np.abs(C * cos[0])
    return first[0], second[0], size
