"""Every real root of a polynomial with rational coefficients, by exact arithmetic.

In [0, 1] by Descartes' rule of signs on the Bernstein coefficients: it tells for an interval that
it holds no root or exactly one; intervals for which it does not decide are halved [Basu2006]. That
takes a tenth of the time that all complex roots take. On the whole line by balls about these
[Johansson2017].
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from fractions import Fraction
from functools import partial
from typing import Any

from flint import arb, fmpq, fmpq_poly, fmpz_poly

from phasekit.numerics.intervals.balls import at_precision

#: Intervals are halved down to 2^-DEPTH.
DEPTH = 60


def rational(x: Fraction | int | fmpq) -> fmpq:
    """A number for exact arithmetic with polynomials."""
    return fmpq(x.numerator, x.denominator) if isinstance(x, Fraction) else fmpq(x)


def whole(polynomial: fmpq_poly) -> list[int]:
    """Coefficients of a positive multiple, coprime integers, the constant term first.

    >>> whole(fmpq_poly([1, fmpq(3, 2), 0]))
    [2, 3]
    """
    integers = list(map(int, polynomial.numer().coeffs()))
    divisor = math.gcd(*integers)
    return [c // divisor for c in integers]


def interpolate(values: Sequence[fmpq]) -> fmpq_poly:
    """The polynomial with these values at 0, 1, 2, ...

    >>> interpolate([fmpq(v) for v in (1, 2, 5)])
    x^2 + 1
    """
    found, product = fmpq_poly([0]), fmpq_poly([1])
    for k, value in enumerate(values):
        found += product * ((value - found(k)) / product(k))
        product *= fmpq_poly([-k, 1])
    return found


def unit_roots(polynomial: fmpq_poly, finest: int = DEPTH) -> list[Fraction]:
    """Distinct real roots in [0, 1], in rising order, to 2^-finest each.

    Roots that lie closer together than that may count as one. The zero polynomial has none.
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
        signs = [v > 0 for v in part if v]
        changes = sum(a != b for a, b in zip(signs, signs[1:], strict=False))
        if changes == 1:
            roots.append(_bisect(power, place, depth, finest, signs[0]))
        elif changes > 1 and depth >= finest:
            roots.append(Fraction(2 * place + 1, 2 << depth))
        elif changes > 1:
            left, right = _halves(part)
            if right[0] == 0:
                roots.append(Fraction(2 * place + 1, 2 << depth))
            stack += [(left, 2 * place, depth + 1), (right, 2 * place + 1, depth + 1)]
    return sorted(set(roots))


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


def nearest_roots(polynomial: fmpq_poly) -> list[tuple[float, int]]:
    """All real roots as the nearest doubles, rising, with their multiplicities."""
    found = []
    for factor, times in polynomial.numer().factor_squarefree()[1]:
        found += [(x, times) for x in _simple_roots(factor)]
    return sorted(found)


def _simple_roots(polynomial: fmpz_poly, bits: int = 80) -> list[float]:
    """Nearest doubles of the real roots of a polynomial without multiple ones."""
    roots: list[Any] = []
    at_precision(bits, [partial(roots.extend, map(fmpz_poly.complex_roots, [polynomial]))])
    reals = [c.real for c, _ in roots[0] if c.imag.is_zero()]
    ends: list[Any] = []
    at_precision(
        bits,
        [partial(ends.extend, map(arb.lower, reals)), partial(ends.extend, map(arb.upper, reals))],
    )
    found = []
    for low, high in zip(ends[: len(reals)], ends[len(reals) :], strict=True):
        a, b = float(low), float(high)
        if a != b:
            # Half-way between two doubles, or next to it.
            halfway = (Fraction(a) + Fraction(b)) / 2
            if polynomial(rational(halfway)) != 0:
                return _simple_roots(polynomial, 2 * bits)
            a = float(halfway)
        found.append(a)
    return found
