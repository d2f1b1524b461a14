"""A system along one parameter: every value at which its equilibria change, by exact arithmetic.

With A, B and C polynomials of the parameter (`phasekit.laws.trigonometric`), equilibria merge at
the real roots of Delta = (B^2 + C^2 - A^2)^3 + 27 A^2 B^2 C^2, labels change hands at those of B
and C, and without force, where A, B and C have a common root, everything is an equilibrium.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from fractions import Fraction
from functools import cached_property

from phasekit.bifurcation.exact.real_roots import (
    Polynomial,
    Rational,
    add,
    common_divisor,
    interpolate,
    multiply,
    quotient,
    value,
    whole,
)
from phasekit.laws.trigonometric import Factor, Trigonometric, Values, exact


@dataclass(frozen=True)
class Path:
    """A law with one parameter running over a span; `values` holds the others."""

    law: Trigonometric
    values: Values
    parameter: str
    span: tuple[float, float]

    @cached_property
    def products(self) -> tuple[list[int], list[int], list[int]]:
        """A, B, C as polynomials of x in [0, 1] along the span, up to a common positive factor."""
        parts = [quotient(p, self.common) for p in self._products]
        unit = math.lcm(*(c.denominator for p in parts for c in p))
        A, B, C = ([int(c * unit) for c in p] for p in parts)
        return A, B, C

    @cached_property
    def common(self) -> list[int]:
        """The divisor that A, B and C had in common; where it vanishes there is no force."""
        divisor = common_divisor(*self._products)
        return divisor if len(divisor) > 1 else [1]

    @cached_property
    def discriminant(self) -> list[int]:
        """Delta, negative where four equilibria exist; of the parts that vanish only a factor."""
        a, b, c = (multiply(p, p) for p in self.products)
        sum_ = add(add(b, c), a, -1)
        if not any(b) or not any(c):
            return whole(sum_)  # Delta is its cube
        product = multiply(multiply(a, b), c)
        return whole(add(multiply(multiply(sum_, sum_), sum_), product, 27))

    @cached_property
    def _products(self) -> list[Polynomial]:
        def place(i: int) -> Polynomial:
            return self.polynomial(lambda v: self.law.products(v)[i])

        return [place(i) for i in range(3)]

    def polynomial(self, factor: Factor) -> Polynomial:
        """Return a factor of the law as a polynomial of x."""
        fixed = exact(self.law.turned({**self.values, self.parameter: self.span[0]}))
        low, high = (Fraction(end) for end in self._ends)
        values = []
        for k in range(self.law.degree(self.parameter) + 1):
            u = low + (high - low) * k
            here = self.law.half_angle(self.parameter, u) if self._turns else u
            values.append(Fraction(factor({**fixed, self.parameter: here})))
        return interpolate([Fraction(v) for v in values])

    def at(self, x: Fraction) -> float:
        """Return the parameter at x."""
        low, high = self._ends
        u = float(Fraction(low) + (Fraction(high) - Fraction(low)) * x)
        if self._turns:
            u = self.law.middle(self.parameter) + 2.0 * math.atan(u)
        return min(max(u, self.span[0]), self.span[1])

    def value(self, polynomial: Sequence[Rational], x: Fraction) -> Fraction:
        """Return a polynomial at x relative to the largest of its kind, exactly."""
        top = max(abs(Fraction(value(p, x))) for p in self.products)
        return Fraction(value(polynomial, x)) / top if top else Fraction(0)

    def sign(self, polynomial: Sequence[Rational], x: Fraction) -> int:
        """Return the sign of a polynomial at x, exactly."""
        result = value(polynomial, x)
        return (result > 0) - (result < 0)

    @property
    def _ends(self) -> tuple[float, float]:
        low, high = self.span
        if not self._turns:
            return low, high
        middle = self.law.middle(self.parameter)
        return math.tan(0.5 * (low - middle)), math.tan(0.5 * (high - middle))

    @property
    def _turns(self) -> bool:
        return self.parameter in self.law.angles
