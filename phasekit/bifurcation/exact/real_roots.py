"""Every real root of a polynomial with rational coefficients, by exact arithmetic.

A polynomial is a list of integers or fractions, the constant term first. Descartes' rule of signs
on the Bernstein coefficients tells for an interval that it holds no root or exactly one; intervals
for which it does not decide are halved [Basu2006]. So no root is missed and none is invented.
"""

from __future__ import annotations

import functools
import math
from collections.abc import Sequence
from fractions import Fraction

Rational = int | Fraction
Polynomial = list[Rational]

#: Intervals are halved down to 2^-DEPTH.
DEPTH = 60


def unit_roots(polynomial: Sequence[Rational], finest: int = DEPTH) -> list[Fraction]:
    """Distinct real roots in [0, 1], in rising order, to 2^-finest each.

    Roots that lie closer together than that may count as one. The zero polynomial has none.

    Examples
    --------
    >>> [float(x) for x in unit_roots([-1, 9, -26, 24])]
    [0.25, 0.3333333333333333, 0.5]
    >>> unit_roots([1, -2, 4])
    []
    """
    power = whole(polynomial)
    n = len(power) - 1
    if n < 1:
        return []
    top = math.lcm(*(math.comb(n, j) for j in range(n + 1)))
    scaled = [c * (top // math.comb(n, j)) for j, c in enumerate(power)]
    bernstein = [
        sum(math.comb(i, j) * c for j, c in enumerate(scaled[: i + 1])) for i in range(n + 1)
    ]
    roots = [Fraction(end) for end, value in ((0, bernstein[0]), (1, bernstein[-1])) if value == 0]
    stack = [(bernstein, 0, 0)]  # on [place, place + 1] / 2^depth
    while stack:
        part, place, depth = stack.pop()
        changes = sign_changes(part)
        if changes == 1:
            roots.append(_bisect(power, place, depth, finest, _first_sign(part)))
        elif changes > 1 and depth >= finest:
            roots.append(Fraction(2 * place + 1, 2 << depth))
        elif changes > 1:
            left, right = _halves(part)
            if right[0] == 0:
                roots.append(Fraction(2 * place + 1, 2 << depth))
            stack += [(left, 2 * place, depth + 1), (right, 2 * place + 1, depth + 1)]
    return sorted(set(roots))


def whole(polynomial: Sequence[Rational]) -> list[int]:
    """Return a positive multiple with coprime integer coefficients, without leading zeros.

    >>> whole([Fraction(1, 2), Fraction(3, 4), 0])
    [2, 3]
    """
    fractions = [Fraction(c) for c in polynomial]
    while fractions and fractions[-1] == 0:
        fractions.pop()
    common = math.lcm(*(c.denominator for c in fractions)) if fractions else 1
    integers = [c.numerator * (common // c.denominator) for c in fractions]
    divisor = math.gcd(*integers) if integers else 1
    return [c // divisor for c in integers]


def multiply(first: Sequence[Rational], second: Sequence[Rational]) -> Polynomial:
    """Product of two polynomials."""
    if not first or not second:
        return []
    product: Polynomial = [0] * (len(first) + len(second) - 1)
    for i, a in enumerate(first):
        for j, b in enumerate(second):
            product[i + j] += a * b
    return product


def add(first: Sequence[Rational], second: Sequence[Rational], factor: int = 1) -> Polynomial:
    """``first + factor second``."""
    longer = max(len(first), len(second))
    a = [*first, *[0] * (longer - len(first))]
    b = [*second, *[0] * (longer - len(second))]
    return [x + factor * y for x, y in zip(a, b, strict=True)]


def value(polynomial: Sequence[Rational], x: Rational) -> Rational:
    """Value at x, exactly."""
    total: Rational = 0
    for c in reversed(polynomial):
        total = total * x + c
    return total


def common_divisor(*polynomials: Sequence[Rational]) -> list[int]:
    """Greatest common divisor of polynomials; [1] if all are zero.

    >>> common_divisor([0, 1, 1], [0, 2], [])
    [0, 1]
    """
    divisor: list[int] = []
    for polynomial in polynomials:
        a, b = divisor, whole(polynomial)
        while b:
            a, b = b, whole(_divide(a, b)[1])
        divisor = a
    return divisor or [1]


def quotient(polynomial: Sequence[Rational], divisor: Sequence[Rational]) -> Polynomial:
    """Quotient of a division without remainder."""
    return _divide(polynomial, divisor)[0]


def interpolate(values: Sequence[Fraction]) -> Polynomial:
    """Coefficients of the polynomial with these values at 0, 1, 2, ...

    >>> [int(c) for c in interpolate([Fraction(v) for v in (1, 2, 5)])]
    [1, 0, 1]
    """
    basis, scale = _basis(len(values))
    common = math.lcm(*(v.denominator for v in values))
    weights = [v.numerator * (common // v.denominator) for v in values]
    sums = (sum(w * p[j] for w, p in zip(weights, basis, strict=True)) for j in range(len(values)))
    return [Fraction(total, scale * common) for total in sums]


@functools.cache
def _basis(n: int) -> tuple[list[list[int]], int]:
    """Polynomials that are 1 at one of 0, ..., n - 1 and 0 at the others, times a number."""
    scale = math.factorial(n - 1)
    basis = []
    for k in range(n):
        polynomial: Polynomial = [1]
        for j in range(n):
            if j != k:
                polynomial = multiply(polynomial, [-j, 1])
        rest = math.prod(k - j for j in range(n) if j != k)
        basis.append([int(Fraction(c) * scale / rest) for c in polynomial])
    return basis, scale


def sign_changes(values: Sequence[int]) -> int:
    """Number of changes of sign, zeros left out."""
    signs = [v > 0 for v in values if v]
    return sum(a != b for a, b in zip(signs, signs[1:], strict=False))


def _first_sign(values: Sequence[int]) -> bool:
    return next(v > 0 for v in values if v)


def _halves(b: list[int]) -> tuple[list[int], list[int]]:
    """Bernstein coefficients on both halves of the interval, times 2^n."""
    n = len(b) - 1
    left, right = [b[0] << n], [b[-1] << n]
    for k in range(1, n + 1):
        b = [x + y for x, y in zip(b, b[1:], strict=False)]
        left.append(b[0] << (n - k))
        right.append(b[-1] << (n - k))
    return left, right[::-1]


def _bisect(power: list[int], place: int, depth: int, finest: int, positive: bool) -> Fraction:
    """Root of the open interval that holds one; `positive` at its left end."""
    while depth < finest:
        place, depth = 2 * place + 1, depth + 1  # the middle
        total, scale = 0, 1
        for c in reversed(power):
            total = total * place + c * scale
            scale <<= depth
        if total == 0:
            return Fraction(place, 1 << depth)
        if (total > 0) != positive:
            place -= 1
    return Fraction(2 * place + 1, 2 << depth)


def _divide(a: Sequence[Rational], b: Sequence[Rational]) -> tuple[Polynomial, Polynomial]:
    rest: Polynomial = [Fraction(c) for c in a]
    ratio: Polynomial = [Fraction(0)] * max(len(rest) - len(b) + 1, 0)
    for k in reversed(range(len(ratio))):
        ratio[k] = Fraction(rest[k + len(b) - 1]) / b[-1]
        for j, c in enumerate(b):
            rest[k + j] -= ratio[k] * c
    return ratio, rest[: len(b) - 1]
