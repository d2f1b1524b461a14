"""A system along one parameter: every value at which its equilibria change, by exact arithmetic.

With A, B and C polynomials of the parameter (`phasekit.laws.trigonometric`), equilibria merge at
the real roots of Delta = (B^2 + C^2 - A^2)^3 + 27 A^2 B^2 C^2, labels change hands at those of B
and C, and without force, where A, B and C have a common root, everything is an equilibrium.
"""

from __future__ import annotations

import functools
import math
from dataclasses import dataclass
from fractions import Fraction
from functools import cached_property

from flint import fmpq, fmpq_poly

from phasekit.laws.trigonometric import Factor, Trigonometric, Values, exact
from phasekit.numerics.real_roots import interpolate, rational


@dataclass(frozen=True)
class Path:
    """A law with one parameter running over a span; `values` holds the others."""

    law: Trigonometric
    values: Values
    parameter: str
    span: tuple[float, float]

    @cached_property
    def products(self) -> tuple[fmpq_poly, fmpq_poly, fmpq_poly]:
        """A, B, C as polynomials of x in [0, 1] along the span, up to a common positive factor."""
        A, B, C = (p // self.common for p in self._products)
        return A, B, C

    @cached_property
    def common(self) -> fmpq_poly:
        """The divisor that A, B and C had in common; where it vanishes there is no force."""
        divisor = functools.reduce(fmpq_poly.gcd, self._products)
        return divisor if divisor.degree() > 0 else fmpq_poly([1])

    @cached_property
    def discriminant(self) -> fmpq_poly:
        """Delta, negative where four equilibria exist; of the parts that vanish only a factor."""
        a, b, c = (p * p for p in self.products)
        sum_ = b + c - a
        if not b or not c:
            return sum_  # Delta is its cube
        return sum_**3 + 27 * a * b * c

    @cached_property
    def _products(self) -> list[fmpq_poly]:
        def product(i: int) -> fmpq_poly:
            return self.polynomial(lambda v: self.law.products(v)[i])

        return [product(i) for i in range(3)]

    def polynomial(self, factor: Factor) -> fmpq_poly:
        """Return a factor of the law as a polynomial of x."""
        fixed = exact(self.law.turned({**self.values, self.parameter: self.span[0]}))
        low, high = (Fraction(end) for end in self._ends)
        values = []
        for k in range(self.law.degree(self.parameter) + 1):
            u = low + (high - low) * k
            here = self.law.half_angle(self.parameter, u) if self._turns else u
            values.append(Fraction(factor({**fixed, self.parameter: here})))
        return interpolate([rational(v) for v in values])

    def along(self, x: Fraction) -> float:
        """Return the parameter at x."""
        low, high = self._ends
        u = float(Fraction(low) + (Fraction(high) - Fraction(low)) * x)
        if self._turns:
            u = self.law.middle(self.parameter) + 2.0 * math.atan(u)
        return min(max(u, self.span[0]), self.span[1])

    def value(self, polynomial: fmpq_poly, x: Fraction) -> fmpq:
        """Return a polynomial at x relative to the largest of its kind, exactly."""
        top = max(abs(p(rational(x))) for p in self.products)
        return polynomial(rational(x)) / top if top else fmpq(0)

    def sign(self, polynomial: fmpq_poly, x: Fraction) -> int:
        """Return the sign of a polynomial at x, exactly."""
        result = polynomial(rational(x))
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
