"""Formula trees as programs: lists of operations, each part of the formulas once.

One reader for all arithmetics: intervals of doubles (`phasekit.numerics.intervals.bounds`), balls
of any precision (`.balls`), rectangles of the complex plane (`.plane`).
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, Generic, TypeVar

Place = TypeVar("Place")

#: Functions of one argument that intervals of doubles know.
ELEMENTARY = (
    "exp log sin cos tan sinh cosh tanh sech asin acos atan asinh acosh atanh erf erfc Abs"
).split()
#: Functions by those of the list above.
_REWRITTEN = {
    "sec": lambda sp, x: 1 / sp.cos(x),
    "csc": lambda sp, x: 1 / sp.sin(x),
    "cot": lambda sp, x: sp.cos(x) / sp.sin(x),
    "csch": lambda sp, x: 1 / sp.sinh(x),
    "coth": lambda sp, x: sp.cosh(x) / sp.sinh(x),
}
_OF_AN_ORDER = {"besselj", "bessely", "besseli", "besselk", "polygamma"}


class NoRule(Exception):
    """A formula holds a function of which no bounds are known; the argument names it."""


class Program:
    """Operations on entries that stand before them; the first entries are the inputs.

    Attributes
    ----------
    inputs : int
    operations : list of (name, places, own)
        What each entry beyond the inputs is made of; `own` is the number, exponent or order.
    outputs : list of int
        Places of the results.
    """

    def __init__(self, inputs: int) -> None:
        self.inputs = inputs
        self.operations: list[tuple[str, tuple[int, ...], Any]] = []
        self.outputs: list[int] = []
        self._places: dict[Any, int] = {}

    def first(self, count: int) -> Program:
        """The program of so many of its results, with no operation that later ones alone need."""
        few = Program(self.inputs)
        few.outputs = self.outputs[:count]
        few.operations = self.operations[: max(few.outputs, default=-1) + 1 - self.inputs]
        return few

    def entry(self, name: str, *places: int, own: Any = None) -> int:
        """The place of an operation, which is made if it is new."""
        operation = (name, places, own)
        if operation not in self._places:
            self._places[operation] = self.inputs + len(self.operations)
            self.operations.append(operation)
        return self._places[operation]

    def number(self, place: int) -> Any:
        """The number that an entry is, if it is one."""
        if place < self.inputs:
            return None
        name, _, own = self.operations[place - self.inputs]
        return own if name == "number" else None

    def negative(self, a: int) -> int:
        """The entry with the other sign, which is exact."""
        return self.entry("negative", a)

    def add(self, a: int, b: int) -> int:
        """The sum."""
        return self.entry("add", a, b)

    def multiply(self, a: int, b: int) -> int:
        """The product; that with 1 or -1 is exact."""
        for factor, other in ((a, b), (b, a)):
            if self.number(factor) in (1, -1):
                return other if self.number(factor) == 1 else self.negative(other)
        return self.entry("multiply", a, b)

    def power(self, a: int, n: int) -> int:
        """A whole power, not 0."""
        return a if n == 1 else self.entry("power", a, own=n)


class Reader(Generic[Place]):
    """Reads formula trees; subclasses say what numbers, sums, products and functions are."""

    def __init__(self, known: dict[Any, Place]) -> None:
        self._known = known

    def number(self, value: Any) -> Place:
        """An expression without symbols."""
        raise NotImplementedError

    def add(self, a: Place, b: Place) -> Place:
        """A sum of two."""
        raise NotImplementedError

    def multiply(self, a: Place, b: Place) -> Place:
        """A product of two."""
        raise NotImplementedError

    def power(self, a: Place, n: int) -> Place:
        """A power with a whole exponent, not 0."""
        raise NotImplementedError

    def root(self, a: Place, exponent: Any) -> Place:
        """A power with a real exponent, an expression without symbols."""
        raise NotImplementedError

    def call(self, name: str, a: Place, order: int | None = None) -> Place:
        """A function of one argument, and perhaps of a whole order."""
        raise NotImplementedError

    def read(self, expression: Any) -> Place:
        """Where the value of an expression stands.

        NoRule is raised of a function without a rule, or an unknown symbol.
        """
        if expression not in self._known:
            self._known[expression] = self._read(expression)
        return self._known[expression]

    def _read(self, e: Any) -> Place:
        import sympy as sp

        if self.is_number(e):
            return self.number(e)
        name, arguments = type(e).__name__, e.args
        if e.is_Symbol:
            raise NoRule(str(e))
        if e.is_Add or e.is_Mul:
            join = self.add if e.is_Add else self.multiply
            place = self.read(arguments[0])
            for argument in arguments[1:]:
                place = join(place, self.read(argument))
            return place
        if e.is_Pow:
            return self._power(*arguments)
        if len(arguments) == 1:
            if name in _REWRITTEN:
                return self.read(_REWRITTEN[name](sp, arguments[0]))
            return self.call(name, self.read(arguments[0]))
        if name in _OF_AN_ORDER and arguments[0].is_Integer and arguments[0] >= 0:
            return self.call(name, self.read(arguments[1]), int(arguments[0]))
        raise NoRule(name)

    def is_number(self, e: Any) -> bool:
        """Whether an expression is taken as one number."""
        return not e.free_symbols

    def _power(self, base: Any, exponent: Any) -> Place:
        import sympy as sp

        if exponent.is_Integer:
            if isinstance(base, sp.cosh) and exponent < 0:
                # cosh overflows where its reciprocal is nearly 0
                return self.power(self.read(sp.sech(base.args[0], evaluate=False)), -int(exponent))
            return self.power(self.read(base), int(exponent))
        if not exponent.free_symbols:
            return self.root(self.read(base), exponent)
        return self.read(sp.exp(exponent * sp.log(base), evaluate=False))


class RealReader(Reader[int]):
    """Writes a program whose entries are reals, by `functions` that its arithmetic knows."""

    def __init__(self, symbols: Sequence[Any], functions: frozenset[str]) -> None:
        super().__init__({symbol: i for i, symbol in enumerate(symbols)})
        self.program = Program(len(symbols))
        self.functions = functions

    def number(self, value: Any) -> int:
        """A number of its own."""
        return self.program.entry("number", own=value)

    def add(self, a: int, b: int) -> int:
        """A sum of two."""
        return self.program.add(a, b)

    def multiply(self, a: int, b: int) -> int:
        """A product of two."""
        return self.program.multiply(a, b)

    def power(self, a: int, n: int) -> int:
        """A whole power."""
        return self.program.power(a, n)

    def root(self, a: int, exponent: Any) -> int:
        """A real power of what is not negative."""
        return self.program.entry("root", a, own=exponent)

    def call(self, name: str, a: int, order: int | None = None) -> int:
        """A function that the arithmetic knows."""
        if name not in self.functions:
            raise NoRule(name)
        return self.program.entry(name, a, own=order)


def real_program(
    expressions: Sequence[Any], symbols: Sequence[Any], functions: frozenset[str]
) -> Program:
    """The program of some expressions in some symbols.

    NoRule is raised of a function other than those.
    """
    reader = RealReader(symbols, functions)
    reader.program.outputs = [reader.read(expression) for expression in expressions]
    return reader.program
