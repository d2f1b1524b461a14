"""Taylor coefficients of expressions along a motion, as instructions on eight doubles.

Sums, products, powers, and functions that solve a differential equation of their own have
recurrences: a coefficient follows from those of the arguments, and its own of lower orders.
[HairerNorsettWanner1993] section I.8, [JorbaZou2005] section 2.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import TYPE_CHECKING, Any, TypeAlias

from phasekit.numerics.lanes import LaneWriter
from phasekit.numerics.later import later

if TYPE_CHECKING:
    import sympy as sp
else:
    sp = later("sympy")

#: Each function with that which stands in its slope, and the sign of that slope.
_PARTNERS = {
    "exp": ("exp", 1),
    "sin": ("cos", 1),
    "cos": ("sin", -1),
    "sinh": ("cosh", 1),
    "cosh": ("sinh", 1),
}
#: Functions with a recurrence.
FUNCTIONS = {*_PARTNERS, "tanh", "log"}
#: Greatest power that is a product.
POWER = 16

#: A value in the lanes; None for zero.
Term: TypeAlias = Any


def has_series(expression: Any, varying: set[Any]) -> bool:
    """Whether there is a recurrence for all that varies in an expression."""
    if expression in varying or not expression.free_symbols & varying:
        return True
    if expression.is_Pow:
        power = expression.exp
        # Products alone hold at zeros of the base.
        if power.free_symbols & varying or (power.is_Integer and power > POWER):
            return False
    elif not (expression.is_Add or expression.is_Mul or type(expression).__name__ in FUNCTIONS):
        return False
    return all(has_series(part, varying) for part in expression.args)


class Series:
    """Coefficients of expressions in symbols whose own coefficients are known in time.

    The writer writes instructions, and values of what does not vary. What varies is a function of
    an order k, which may ask for coefficients of the expressions up to k - 1. Shared parts of
    expressions are each made of those before it.
    """

    def __init__(
        self,
        writer: LaneWriter,
        varying: Mapping[Any, Callable[[int], Term]],
        shared: Iterable[tuple[Any, Any]] = (),
    ) -> None:
        self.writer, self.varying = writer, dict(varying)
        self.known: dict[Any, Term] = {}
        self.moving: dict[Any, bool] = {}  # whether expressions vary
        for symbol, expression in shared:
            if self._varies(expression):
                self.varying[symbol] = lambda k, e=expression: self.term(e, k)
            else:
                writer.values[symbol] = writer.write(expression)

    def term(self, expression: Any, k: int) -> Term:
        """Coefficient of order k."""
        return self._once(expression, k, lambda: self._term(expression, k))

    def _once(self, name: Any, k: int, make: Callable[[], Term]) -> Term:
        if (name, k) not in self.known:
            self.known[name, k] = make()
        return self.known[name, k]

    def _varies(self, e: Any) -> bool:
        if e not in self.moving:
            self.moving[e] = not self.varying.keys().isdisjoint(e.free_symbols)
        return self.moving[e]

    def _term(self, e: Any, k: int) -> Term:
        if e in self.varying:
            return self.varying[e](k)
        if not self._varies(e):
            return self.writer.write(e) if k == 0 else None
        if e.is_Add:
            return self.total([self.term(part, k) for part in e.args])
        if e.is_Mul:
            return self._product(e, k)
        if e.is_Pow:
            if not (e.exp.is_Integer and e.exp > 0):
                return self._power(e, k)
            if e.exp % 2:
                return self._convolved(e.base ** (e.exp - 1), e.base, k)
            return self._square(e.base ** (e.exp / 2), k)
        return self._function(e, k)

    def _product(self, e: Any, k: int) -> Term:
        moving = [part for part in e.args if self._varies(part)]
        still = [part for part in e.args if not self._varies(part)]
        if still:
            return self.scaled(self.writer.write(sp.Mul(*still)), self.term(sp.Mul(*moving), k))
        return self._convolved(sp.Mul(*moving[:-1]), moving[-1], k)

    def _function(self, e: Any, k: int) -> Term:
        (u,) = e.args
        if k == 0:
            return self.writer.library(type(e).__name__, self._value(u))
        if type(e) is sp.log:  # u times its slope is u'
            rest = self.over(self._integrated(e, lambda j: self.term(u, j), k, k - 1), k)
            change = self.total([self.term(u, k), self.negative(rest)])
            return self.scaled(change, self._reciprocal(u))
        if type(e) is sp.tanh:  # its slope is 1 - tanh(u)^2
            first, rest = self._slope(u, k), self._integrated(u, lambda j: self._square(e, j), k)
            return self.over(self.total([first, self.negative(rest)]), k)
        name, sign = _PARTNERS[type(e).__name__]
        partner = getattr(sp, name)
        found = self.over(self._integrated(u, lambda j: self.term(partner(u), j), k), k)
        return found if sign > 0 else self.negative(found)

    def _power(self, e: Any, k: int) -> Term:
        """A coefficient of p = u^a, whose slope times u is a p u'."""
        u, writer = e.base, self.writer
        if k == 0:
            return writer.power(self._value(u), e)
        terms = []
        for j in sorted(range(1, k + 1), key=lambda j: max(j, k - j)):
            factor = writer.write((e.exp * j - (k - j)) / sp.Integer(k))
            terms.append(self.scaled(factor, self.scaled(self.term(u, j), self.term(e, k - j))))
        return self.scaled(self.total(terms), self._reciprocal(u))

    def _value(self, u: Any) -> Term:
        value = self.term(u, 0)
        return self.writer.constant(0.0) if value is None else value

    def _reciprocal(self, u: Any) -> Term:
        one = self.writer.constant(1.0)
        return self._once(
            ("reciprocal", u), 0, lambda: self.writer.builder.fdiv(one, self._value(u))
        )

    # Coefficients for which others wait come last in the sums.

    def _convolved(self, f: Any, g: Any, k: int) -> Term:
        order = sorted(range(k + 1), key=lambda j: max(j, k - j))
        return self.total([self.scaled(self.term(f, j), self.term(g, k - j)) for j in order])

    def _square(self, f: Any, k: int) -> Term:
        def make() -> Term:
            pairs = range((k + 1) // 2 - 1, -1, -1)
            half = self.total([self.scaled(self.term(f, j), self.term(f, k - j)) for j in pairs])
            middle = self.term(f, k // 2) if k % 2 == 0 else None
            return self.total([half, half, self.scaled(middle, middle)])

        return self._once(("square", f), k, make)

    def _integrated(
        self, u: Any, rate: Callable[[int], Term], k: int, last: int | None = None
    ) -> Term:
        """K times the coefficient of what changes at a rate times u', of its terms up to a last."""
        order = sorted(range(1, (k if last is None else last) + 1), key=lambda j: max(j, k - j))
        return self.total([self.scaled(self._slope(u, j), rate(k - j)) for j in order])

    def _slope(self, u: Any, j: int) -> Term:
        return self._once(
            ("slope", u), j, lambda: self.scaled(self.writer.constant(float(j)), self.term(u, j))
        )

    def over(self, x: Term, k: int) -> Term:
        """X over a number."""
        return self.scaled(self.writer.constant(1.0 / k), x)

    def scaled(self, x: Term, y: Term) -> Term:
        """X y."""
        if x is None or y is None:
            return None
        return self.writer.builder.fmul(x, y, flags=self.writer.flags)

    def negative(self, x: Term) -> Term:
        """-x."""
        return None if x is None else self.writer.builder.fneg(x)

    def total(self, terms: Sequence[Term]) -> Term:
        """Sum."""
        found = None
        for x in terms:
            if found is None or x is None:
                found = x if found is None else found
            else:
                found = self.writer.builder.fadd(found, x, flags=self.writer.flags)
        return found
