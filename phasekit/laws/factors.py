"""Products of named numbers that remember their factors.

A law that is written as products is called once with these in place of numbers, and then tells
by which factors its coefficients vanish or change sign, on which parameters it depends and of
which degree it is in each.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from fractions import Fraction
from typing import Any

Number = int | float | Fraction

#: Why some are refused.
NO_QUOTIENTS = "a polynomial has whole powers >= 0; multiply all four by what is divided by"


@dataclass(frozen=True)
class Name:
    """A parameter, or one entry of an angle's sine, cosine and radius."""

    name: str
    entry: int | None = None

    def __call__(self, values: Mapping[str, Any]) -> Any:
        """Value, where angles are given by their three entries."""
        value = values[self.name]
        return value if self.entry is None else value[self.entry]

    def degree(self, name: str) -> int:
        """Degree in a parameter, in an angle's half-angle tangent."""
        if name != self.name:
            return 0
        return 1 if self.entry is None else 2

    def degrees(self, angle: str) -> set[int]:
        """Degrees in an angle's sine, cosine and radius together, of each term."""
        return {int(self.name == angle and self.entry is not None)}

    def names(self) -> Iterator[str]:
        """Names of the parameters."""
        yield self.name


@dataclass(frozen=True)
class Sum:
    """A sum of products that have no factor in common."""

    terms: tuple[Product, ...]

    def __call__(self, values: Mapping[str, Any]) -> Any:
        """Value."""
        first, *rest = (term(values) for term in self.terms)
        for value in rest:
            first = first + value
        return first

    def degree(self, name: str) -> int:
        """Degree in a parameter, in an angle's half-angle tangent."""
        return max(term.degree(name) for term in self.terms)

    def degrees(self, angle: str) -> set[int]:
        """Degrees in an angle's sine, cosine and radius together, of each term."""
        return set().union(*(term.degrees(angle) for term in self.terms))

    def names(self) -> Iterator[str]:
        """Names of the parameters."""
        for term in self.terms:
            yield from term.names()


Atom = Name | Sum


@dataclass(frozen=True)
class Product:
    """A number times powers of names and sums."""

    number: Number = 1
    powers: tuple[tuple[Atom, int], ...] = ()

    @property
    def atoms(self) -> tuple[Atom, ...]:
        """The factors, each once."""
        return tuple(atom for atom, _ in self.powers)

    def __call__(self, values: Mapping[str, Any]) -> Any:
        """Value."""
        result: Any = self.number
        for atom, power in self.powers:
            for _ in range(power):
                result = result * atom(values)
        return result

    def degree(self, name: str) -> int:
        """Degree in a parameter, in an angle's half-angle tangent."""
        return sum(power * atom.degree(name) for atom, power in self.powers)

    def degrees(self, angle: str) -> set[int]:
        """Degrees in an angle's sine, cosine and radius together, of each term; none of zero."""
        found = {0} if self.number else set()
        for atom, power in self.powers:
            for _ in range(power):
                found = {before + more for before in found for more in atom.degrees(angle)}
        return found

    def names(self) -> Iterator[str]:
        """Names of the parameters."""
        for atom in self.atoms:
            yield from atom.names()

    def __mul__(self, other: Product | Number) -> Product:
        """Product, equal factors as powers."""
        if not isinstance(other, Product):
            other = Product(other)
        powers = dict(self.powers)
        for atom, power in other.powers:
            powers[atom] = powers.get(atom, 0) + power
        number = self.number * other.number
        return Product(number, tuple(powers.items()) if number else ())

    __rmul__ = __mul__

    def __neg__(self) -> Product:
        """Return the negative."""
        return self * -1

    def __truediv__(self, other: Product | Number) -> Product:
        """Quotient by a number."""
        if isinstance(other, Product):
            raise TypeError(NO_QUOTIENTS)
        return self * (Fraction(1, other) if isinstance(other, int) else 1 / other)

    def __rtruediv__(self, other: Number) -> Product:
        """Refuse what is no polynomial."""
        raise TypeError(NO_QUOTIENTS)

    def __pow__(self, power: int) -> Product:
        """Return a power with a whole exponent >= 0."""
        if not isinstance(power, int) or power < 0:
            raise TypeError(f"power {power}: {NO_QUOTIENTS}")
        return Product(self.number**power, tuple((a, p * power) for a, p in self.powers if power))

    def __add__(self, other: Product | Number) -> Product:
        """Sum, common factors in front of it."""
        if not isinstance(other, Product):
            other = Product(other)
        if not self.number or not other.number:
            return self if self.number else other
        theirs = dict(other.powers)
        shared = tuple((a, min(p, theirs[a])) for a, p in self.powers if a in theirs)
        front = Product(1, shared)
        terms: dict[tuple[tuple[Atom, int], ...], Number] = {}
        for part in (*_terms(self._without(shared)), *_terms(other._without(shared))):
            key = tuple(sorted(part.powers, key=repr))
            terms[key] = terms.get(key, 0) + part.number
        kept = [Product(number, key) for key, number in terms.items() if number]
        if len(kept) < 2:
            return front * (kept[0] if kept else 0)
        if kept[0].number < 0:  # a sum and its negative are the same factor
            return front * -1 * Product(1, ((Sum(tuple(-term for term in kept)), 1),))
        return front * Product(1, ((Sum(tuple(kept)), 1),))

    __radd__ = __add__

    def __sub__(self, other: Product | Number) -> Product:
        """Difference."""
        return self + other * -1

    def __rsub__(self, other: Product | Number) -> Product:
        """Difference."""
        return other + self * -1

    def _without(self, shared: tuple[tuple[Atom, int], ...]) -> Product:
        less = dict(shared)
        left = ((atom, power - less.get(atom, 0)) for atom, power in self.powers)
        return Product(self.number, tuple((atom, power) for atom, power in left if power))


def _terms(product: Product) -> tuple[Product, ...]:
    """The terms of a product that is but a sum times a number."""
    if len(product.powers) == 1:
        atom, power = product.powers[0]
        if isinstance(atom, Sum) and power == 1:
            return tuple(product.number * term for term in atom.terms)
    return (product,)


def named(name: str) -> Product:
    """Return a parameter.

    Examples
    --------
    >>> product = 2 * named("a") * named("b") - named("a") ** 2
    >>> [sorted(set(atom.names())) for atom in product.atoms]
    [['a'], ['a', 'b']]
    >>> product({"a": 3, "b": 5}), product.degree("a")
    (21, 2)
    """
    return Product(1, ((Name(name), 1),))


def entries(name: str) -> tuple[Product, Product, Product]:
    """Return sine, cosine and radius of an angle."""
    sine, cosine, radius = (Product(1, ((Name(name, i), 1),)) for i in range(3))
    return sine, cosine, radius
