"""The trigonometric law, phi'' + B sin phi - A sin phi cos phi - C cos phi = 0, of any system.

A system says one thing: the products A N, B N, C N and N > 0 of its parameters, polynomials in
each parameter and in sine, cosine and radius of an angle. The same few lines are run with floats,
arrays, complex numbers (whose imaginary part carries derivatives), fractions and symbols; the
coefficients, the formulas, the factors with which a coefficient vanishes and the degrees all
follow from them.
"""

from __future__ import annotations

import cmath
import functools
import math
from collections.abc import Callable, Container, Iterable, Iterator, Mapping
from dataclasses import dataclass, field
from fractions import Fraction
from functools import cached_property
from typing import Any, ClassVar

import numpy as np

from phasekit.errors import ParameterError
from phasekit.inputs import describe
from phasekit.laws.ladder import Conservative

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


#: Sine, cosine and radius of an angle, up to a common factor.
Turn = tuple[Any, Any, Any]
Values = Mapping[str, Any]
#: A polynomial of the parameters; angles among them are given as a `Turn`.
Factor = Callable[[Values], Any]
#: A N, B N, C N and N > 0 of parameters by name; angles among them are given as a `Turn`.
Products = Callable[[Values], tuple[Any, Any, Any, Any]]

SINE, COSINE, RADIUS = 0, 1, 2


@dataclass(frozen=True)
class Zero:
    """A factor with which B, C or both vanish, and A need not."""

    factor: Factor
    of_B: bool = False
    of_C: bool = False


@dataclass(frozen=True)
class Trigonometric(Conservative):
    """One system's law, with V = -B cos phi + (A/2) cos^2 phi - C sin phi.

    Attributes
    ----------
    products : callable
        A N, B N, C N and N > 0.
    domains : mapping
        Parameter -> its least and greatest value, in the order in which they are declared.
    angles : iterable of str
        Parameters that are angles, in rad.
    """

    called: ClassVar[str] = "a system with coefficients (A, B, C)"
    derived: ClassVar[tuple[str, ...]] = ("A", "B", "C")
    labels_fixed: ClassVar[bool] = True
    default: ClassVar[Mapping[str, str]] = {
        "center": "lower_center",
        "saddle": "lower where there is one, else upper",
    }

    coordinate = "phi"
    period = 2.0 * math.pi
    text = "-B cos φ + (A/2) cos² φ - C sin φ"

    products: Products
    domains: Mapping[str, tuple[float, float]]
    angles: frozenset[str] = field(default=frozenset())

    # ---------------------------------------------------------------- values

    def turned(self, values: Values) -> dict[str, Any]:
        """Return the values with angles as a `Turn`."""
        return {
            name: turn(value) if name in self.angles else value for name, value in values.items()
        }

    def __call__(self, values: Values) -> tuple[Any, Any, Any, Any]:
        """A N, B N, C N and N at plain values."""
        return self.products(self.turned(values))

    def coefficients(self, values: Values) -> tuple[Any, Any, Any]:
        """A, B and C from floats or arrays that broadcast; NaN where N is not positive."""
        *products, scale = self.products(self.turned(values))
        scale = np.where(np.asarray(scale) > 0, scale, np.nan)
        A, B, C = (np.asarray(product / scale) for product in products)
        return A, B, C

    def formulas(self, symbols: Values) -> tuple[Any, Any, Any]:
        """A, B and C as sympy expressions of symbols."""
        import sympy

        turned = {
            name: (sympy.sin(x), sympy.cos(x), sympy.Integer(1)) if name in self.angles else x
            for name, x in symbols.items()
        }
        *products, scale = self.products(turned)
        A, B, C = (sympy.sympify(product) / scale for product in products)
        return A, B, C

    def gradient_formula(self, symbols: Values) -> Any:
        """V' as a sympy expression of symbols, [Veljovic2015] (12)."""
        import sympy

        A, B, C = self.formulas({name: symbols[name] for name in self.parameters})
        sine, cosine = sympy.sin(symbols["phi"]), sympy.cos(symbols["phi"])
        return (B - A * cosine) * sine - C * cosine

    # ---------------------------------------------------------------- half-angles

    def middle(self, angle: str) -> float:
        """The middle of an angle's range, from which its half-angle is measured."""
        low, high = self.domains[angle]
        return 0.5 * (low + high) if math.isfinite(high - low) else 0.0

    def half_angle(self, angle: str, tangent: Any) -> Turn:
        """Return the `Turn` of ``middle + 2 atan(tangent)``, without division."""
        sine, cosine = 2 * tangent, 1 - tangent * tangent
        radius = 1 + tangent * tangent
        return (cosine, -sine, radius) if self.middle(angle) else (sine, cosine, radius)

    # ---------------------------------------------------------------- what follows

    @cached_property
    def symbolic(self) -> tuple[Product, Product, Product, Product]:
        """The products as what remembers its factors."""
        A, B, C, N = self.products(_factors(self.domains, self.angles))
        return _product(A), _product(B), _product(C), _product(N)

    @cached_property
    def parameters(self) -> tuple[str, ...]:
        """Names of the parameters on which the coefficients depend, as they are declared."""
        used = {name for product in self.symbolic for name in product.names()}
        return tuple(name for name in self.domains if name in used)

    def degree(self, parameter: str) -> int:
        """Greatest degree of A N, B N and C N in a parameter or its half-angle tangent."""
        return max(product.degree(parameter) for product in self.symbolic[:3])

    @cached_property
    def sign_changes(self) -> tuple[Factor, ...]:
        """Factors with which A changes sign."""
        powers = self.symbolic[0].powers
        return tuple(atom for atom, power in powers if power % 2 and not self._keeps_sign(atom))

    @cached_property
    def zeros(self) -> tuple[Zero, ...]:
        """Factors with which B, C or both vanish, and A need not."""
        A, B, C, _ = (product.atoms for product in self.symbolic)
        found = [
            Zero(atom, atom in B, atom in C)
            for atom in dict.fromkeys((*B, *C))
            if atom not in A and not self._never_zero(atom)
        ]
        return tuple(sorted(found, key=lambda zero: zero.of_B and zero.of_C))

    def _keeps_sign(self, atom: Atom) -> bool:
        if not isinstance(atom, Name):
            return False
        low, high = self.domains[atom.name]
        if atom.entry is None:
            return low >= 0.0 or high <= 0.0
        if atom.entry == SINE:
            return low >= 0.0 and high <= math.pi
        return atom.entry == RADIUS or (low >= -math.pi / 2 and high <= math.pi / 2)

    def _never_zero(self, atom: Atom) -> bool:
        if not isinstance(atom, Name):
            return False
        low, high = self.domains[atom.name]
        return atom.entry == RADIUS or (atom.entry is None and (low > 0.0 or high < 0.0))


def turn(angle: Any) -> Turn:
    """Sine, cosine and radius 1 of an angle; the sine of the double nearest to pi is 0."""
    if isinstance(angle, complex):
        return cmath.sin(angle), cmath.cos(angle), 1.0
    if hasattr(angle, "free_symbols"):
        import sympy

        return sympy.sin(angle), sympy.cos(angle), sympy.Integer(1)
    if isinstance(angle, np.ndarray):
        return np.where(angle == np.pi, 0.0, np.sin(angle)), np.cos(angle), 1.0
    return 0.0 if angle == math.pi else math.sin(angle), math.cos(angle), 1.0


def exact(values: Values) -> dict[str, Any]:
    """Return turned values as fractions."""
    return {
        name: tuple(map(Fraction, value)) if isinstance(value, tuple) else Fraction(value)
        for name, value in values.items()
    }


def _factors(names: Iterable[str], angles: Container[str]) -> dict[str, Any]:
    return {name: entries(name) if name in angles else named(name) for name in names}


def _product(value: Any) -> Product:
    return value if isinstance(value, Product) else Product(value)


def checked_products(model: str, products: Products, units: Mapping[str, str]) -> Products:
    """Return a law of the parameters that have these units, which refuses other arguments."""
    wants = (
        "A N, B N, C N and N as polynomials of the declared parameters, an angle as its sine, "
        "cosine and radius"
    )
    angles = [name for name, unit in units.items() if unit == "rad"]
    try:
        A, B, C, N = map(_product, products(_factors(units, angles)))
    except Exception as error:
        text = f"products of {model}: got {type(error).__name__}: {error}; wants {wants}"
        if isinstance(error, TypeError):  # something else than sums and products
            text += "; of a root make the parameter; pk.Potential takes any formula"
        raise ParameterError(text) from error
    if not any(product.powers for product in (A, B, C, N)):
        raise ParameterError(f"products of {model}: got numbers alone, wants {wants}")
    for angle in angles:
        degrees = set().union(*(product.degrees(angle) for product in (A, B, C)))
        if len(degrees) > 1:
            raise ParameterError(
                f"products of {model}: got terms of the degrees {sorted(degrees)} in the sine, "
                f"cosine and radius of {angle}, wants all of one degree; multiply those of a lower "
                "degree by the radius"
            )

    @functools.wraps(products)
    def checked(v: Values) -> Any:
        try:
            return products(v)
        except Exception as error:
            raise ParameterError(
                f"v: got {describe(v)}, wants the parameters by name, angles as (sine, cosine, "
                f"radius): {type(error).__name__}: {error}"
            ) from error

    return checked


@functools.cache
def law(products: Products, parameters: tuple[tuple[str, str, float, float], ...]) -> Trigonometric:
    """Make a law of its products and its parameters: name, units, least and greatest value.

    >>> ball = law(lambda v: (v["w"] * v["w"], v["g"], 0 * v["g"], v["R"]),
    ...     (("w", "s-1", -math.inf, math.inf), ("g", "m s-2", -math.inf, math.inf),
    ...      ("R", "m", math.ulp(0.0), math.inf)))
    >>> ball.parameters, ball.degree("w"), len(ball.sign_changes), len(ball.zeros)
    (('w', 'g', 'R'), 2, 0, 1)
    """
    return Trigonometric(
        products,
        {name: (low, high) for name, _, low, high in parameters},
        frozenset(name for name, units, _, _ in parameters if units == "rad"),
    )
