"""The nodes that formulas are made of: which there are, and how large they may be.

sympy computes with numbers exactly and at once, so that ``9^9^9`` or ``gamma(10^9)`` would never
end. Here every number must fit in a double, powers and nesting are bounded, and what a node would
cost is known before it is made.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Sequence
from typing import Any

import sympy as sp

from phasekit.laws.grammar import FormulaError

#: Largest exponent that is a number, and most bits of a number: those of the range of doubles.
POWER, BITS = 1000, 1024
#: Most bits of a number that exact arithmetic makes of doubles, each of which has 53 of its own.
EXACT = 16 * BITS
#: Bits beyond which a number is not multiplied into a sum.
WIDE = 16
_LEAST = 2.3e-308  # doubles with all digits are larger
#: Most arguments of Max and Min, levels of functions with branches, and nodes of a formula.
ARGUMENTS, LEVELS, NODES = 16, 8, 100_000
#: Largest constants that a special function takes: as an order, of a gamma function, else.
ORDER, FACTORIAL, FAR = 20, 171, 1e4

CONSTANTS = {
    name: getattr(sp, name) for name in ("pi", "E", "EulerGamma", "GoldenRatio", "Catalan")
}
_ELEMENTARY = "sin cos tan asin acos atan sinh cosh tanh asinh acosh atanh exp log".split()
_BRANCHED = "Abs sign Heaviside Max Min Piecewise".split()
#: Functions of one argument, and of an order and one argument, that SciPy has.
_SPECIAL = (
    "erf erfc erfi erfinv gamma loggamma airyai airyaiprime airybi airybiprime LambertW "
    "Si Ci Ei fresnels fresnelc elliptic_k elliptic_e"
).split()
_OF_AN_ORDER = "besselj bessely besseli besselk polygamma".split()

_COMPARISONS = {"<": sp.Lt, "<=": sp.Le, ">": sp.Gt, ">=": sp.Ge, "==": sp.Eq, "!=": sp.Ne}
_JOINS = {"&": sp.And, "|": sp.Or, "~": sp.Not}


def _cbrt(x: Any) -> Any:
    return sp.sign(x) * sp.Abs(x) ** sp.Rational(1, 3)


def _over(one: Callable[[Any], Any]) -> Callable[[Any], Any]:
    return lambda x: 1 / one(x)


#: Functions by name: what makes a node, with its least and largest number of arguments.
FUNCTIONS: dict[str, tuple[Any, int, int]] = {
    **{n: (getattr(sp, n), 1, 1) for n in (*_ELEMENTARY, *_SPECIAL, "sqrt", "sign", "Heaviside")},
    **{name: (getattr(sp, name), 2, 2) for name in (*_OF_AN_ORDER, "atan2")},
    **{name: (sp.Abs, 1, 1) for name in ("Abs", "abs")},
    **{name: (sp.Max, 1, ARGUMENTS) for name in ("Max", "max")},
    **{name: (sp.Min, 1, ARGUMENTS) for name in ("Min", "min")},
    **{f"arc{n}": (getattr(sp, f"a{n}"), 1, 1) for n in ("sin", "cos", "tan")},
    **{f"arc{n}": (getattr(sp, f"a{n}"), 1, 1) for n in ("sinh", "cosh", "tanh")},
    "arctan2": (sp.atan2, 2, 2),
    "log": (sp.log, 1, 2),
    "ln": (sp.log, 1, 1),
    "cbrt": (_cbrt, 1, 1),
    "sec": (_over(sp.cos), 1, 1),
    "csc": (_over(sp.sin), 1, 1),
    "cot": (_over(sp.tan), 1, 1),
    "sech": (_over(sp.cosh), 1, 1),
    "csch": (_over(sp.sinh), 1, 1),
    "coth": (_over(sp.tanh), 1, 1),
    "digamma": (lambda x: sp.polygamma(0, x), 1, 1),
    "trigamma": (lambda x: sp.polygamma(1, x), 1, 1),
    "Rational": (lambda p, q: p / q, 2, 2),
    "Piecewise": (sp.Piecewise, 1, 50),
    **{name: (getattr(sp, name), 2, 2) for name in ("Lt", "Le", "Gt", "Ge", "Eq", "Ne")},
    **{name: (getattr(sp, name), 2, 50) for name in ("And", "Or")},
    "Not": (sp.Not, 1, 1),
}
_BRANCHES = tuple(getattr(sp, name) for name in _BRANCHED)
_FAR_CLASSES = tuple(getattr(sp, name) for name in (*_SPECIAL, *_OF_AN_ORDER))
_CONDITIONS = tuple(getattr(sp, name) for name in ("Lt", "Le", "Gt", "Ge", "Eq", "Ne"))
_LOGICAL = (sp.And, sp.Or, sp.Not)
#: Classes whose nodes a formula may hold, beside symbols, numbers and constants.
CLASSES = {
    *(getattr(sp, name) for name in (*_ELEMENTARY, *_BRANCHED, *_SPECIAL, *_OF_AN_ORDER)),
    *(sp.Add, sp.Mul, sp.Pow, sp.atan2, sp.functions.elementary.piecewise.ExprCondPair),
    *_CONDITIONS,
    *_LOGICAL,
}
_NOT_FINITE = (sp.zoo, sp.nan, sp.oo, -sp.oo)
_LEAVES = {sp.true, sp.false, sp.I, *_NOT_FINITE, *CONSTANTS.values()}


class Nodes:
    """Makes the nodes of formulas in some symbols; each is checked before it is used."""

    def __init__(
        self, unknown: Callable[[str, bool], Exception], symbols: Any, exact: bool = False
    ) -> None:
        self.unknown, self.symbols, self.exact = unknown, symbols, exact
        self.levels: dict[Any, int] = {}  # of branched functions inside each other

    def number(self, text: str) -> Any:
        """A whole number exactly, any other as a double, or as the fraction that this is."""
        if text.lstrip("-").isdigit():
            if len(text) > 320:
                raise FormulaError(f"a number of {len(text)} digits")
            return checked(sp.Integer(int(text)))
        value = float(text)
        if not math.isfinite(value) or (not value and _nonzero(text)):
            raise FormulaError(f"the number {text[:40]}, which is outside the range of doubles")
        return fraction(value) if self.exact else sp.Float(value)

    def name(self, name: str) -> Any:
        """A symbol, or else a constant."""
        if name in self.symbols:
            if isinstance(self.symbols[name], sp.Lambda):
                raise FormulaError(f"{name}, a function, without its arguments; write {name}(...)")
            return self.symbols[name]
        if name in ("True", "False"):
            return sp.true if name == "True" else sp.false
        if name not in CONSTANTS:
            raise self.unknown(name, False)
        return CONSTANTS[name]

    def call(self, name: str, arguments: Sequence[Any]) -> Any:
        """A function of its arguments."""
        own = self.symbols.get(name)
        if isinstance(own, sp.Lambda):
            values(arguments)
            if len(arguments) != len(own.variables):
                takes = len(own.variables)
                raise FormulaError(f"{name} with {len(arguments)} arguments; it takes {takes}")
            return checked(own(*arguments))
        if name in self.symbols:
            raise FormulaError(
                f"{name}(...) although {name} is a symbol; for a product write {name}*(...), for "
                "the function give the symbol another name"
            )
        if name not in FUNCTIONS:
            raise self.unknown(name, True)
        make, least, most = FUNCTIONS[name]
        if not least <= len(arguments) <= most:
            count = str(least) if least == most else f"{least} to {most}"
            raise FormulaError(f"{name} with {len(arguments)} arguments; it takes {count}")
        if make is sp.Piecewise:
            for pair in arguments:
                if not isinstance(pair, tuple):
                    raise FormulaError("a Piecewise of other than (value, condition) pairs")
                values(pair[:1])
                conditions(pair[1:])
        else:
            (conditions if make in _LOGICAL else values)(arguments)
        if make in (sp.Max, sp.Min):
            if sum(len(x.args) if type(x) is make else 1 for x in arguments) > ARGUMENTS:
                raise FormulaError(f"{name} with more than {ARGUMENTS} arguments")
        elif make is sp.exp:
            arguments = [_apart(arguments[0])]
        elif make in _FAR_CLASSES or "gamma" in name:
            arguments = _near(name, arguments)
        elif name == "Rational" and not all(x.is_Integer for x in arguments):
            raise FormulaError("Rational of other than two whole numbers")
        level = self._level(arguments) + 1 if make in _BRANCHES or name == "cbrt" else 0
        if level > LEVELS:
            raise FormulaError(f"more than {LEVELS} of {', '.join(_BRANCHED)} in each other")
        found = checked(make(*arguments))
        if level:
            self.levels[found] = level
        return found

    def _level(self, arguments: Sequence[Any]) -> int:
        if not self.levels:
            return 0
        inner = sp.Tuple(*(sp.Tuple(*x) if isinstance(x, tuple) else x for x in arguments))
        return max((self.levels.get(x, 1) for x in inner.atoms(*_BRANCHES)), default=0)

    def add(self, terms: Sequence[Any]) -> Any:
        """A sum, made at once: term by term its cost would be the square."""
        values(terms)
        # Sums of fractions multiply their denominators.
        fractions = (term.as_coeff_Mul()[0] for term in terms)
        _bounded_bits(_odd(f.q).bit_length() for f in fractions if f.is_Rational and f.q > 1)
        return checked(sp.Add(*terms))

    def multiply(self, factors: Sequence[Any]) -> Any:
        """A product, made at once."""
        values(factors)
        numbers = [factor.as_coeff_Mul()[0] for factor in factors]
        _bounded_bits((_bits(number) for number in numbers if number not in (1, -1)), EXACT)
        product = sp.Mul(*factors)
        if self.exact and product.is_Add:
            number, rest = sp.Mul(*numbers), sp.Mul(*(f.as_coeff_Mul()[1] for f in factors))
            if rest.is_Add and wide(number):
                # As it is written: its terms would have numbers that no double is.
                product = sp.Mul(checked(number), rest, evaluate=False)
        return checked(product)

    def power(self, base: Any, exponent: Any) -> Any:
        """A power whose exponent, if it is a number, is bounded."""
        values((base, exponent))
        if base.is_Rational and exponent == -1 and base.p:
            return sp.Rational(base.q, base.p)  # as sympy's power would, but at once
        if exponent.is_number:
            size = abs(float(_approximate(exponent)))
            if size > POWER:
                raise FormulaError(f"the exponent {_short(exponent)}, beyond {POWER}")
            number = base.as_coeff_Mul()[0]
            known = number.is_Rational and number.p  # its logarithm to the base 2, within one
            log = abs(number.p).bit_length() - number.q.bit_length() if known else 0
            if abs(log) * size > BITS + POWER:
                raise FormulaError(f"a power of {_short(base)} outside the range of doubles")
            _bounded_bits((int(_bits(number) * size),), EXACT)
            if base.is_zero and exponent.is_negative:
                raise FormulaError("a division by zero")
        return checked(sp.Pow(base, exponent))

    def compare(self, sign: str, left: Any, right: Any) -> Any:
        """A comparison; ``==`` is of values, not of formulas."""
        values((left, right))
        return _COMPARISONS[sign](left, right)

    def join(self, sign: str, operands: Sequence[Any]) -> Any:
        """Conditions that all hold, one of which holds, or one that does not."""
        conditions(operands, hint=f"; {sign} joins conditions, each in parentheses")
        if len(operands) > 50:
            raise FormulaError("more than 50 conditions in one")
        return _JOINS[sign](*operands)


def _apart(exponent: Any) -> Any:
    """An exponent with large doubles as the fractions that they are.

    sympy makes exp(x + 1000.0) the product of exp(x) and a number, which no double may hold.
    """
    large = [t for t in exponent.args if t.is_Float and abs(t) > 64] if exponent.is_Add else []
    fractions = {t: sp.Rational(*float(t).as_integer_ratio()) for t in large}
    return sp.Add(*(fractions.get(t, t) for t in exponent.args)) if large else exponent


def _nonzero(text: str) -> bool:
    """Whether a number as it is written is other than zero."""
    return any(digit in "123456789" for digit in text.lower().partition("e")[0])


def values(nodes: Iterable[Any]) -> None:
    """Raise unless all are values, not conditions or pairs."""
    for node in nodes:
        if not isinstance(node, sp.Expr):
            got = "a pair" if isinstance(node, tuple) else f"the condition {_short(node)}"
            raise FormulaError(f"{got} where a value belongs")


def conditions(nodes: Iterable[Any], hint: str = "") -> None:
    """Raise unless all are conditions."""
    for node in nodes:
        if not isinstance(node, sp.logic.boolalg.Boolean) or isinstance(node, sp.Expr):
            raise FormulaError(f"{_short(node)} where a condition belongs{hint}")


def checked(node: Any) -> Any:
    """Return a node whose parts are checked already, if its own numbers can be used."""
    if isinstance(node, sp.logic.boolalg.Boolean) and not isinstance(node, sp.Expr):
        return node
    if node in _NOT_FINITE:
        raise FormulaError("a division by zero, or another value that is not finite")
    if node.is_Number or not node.is_number:
        for part in (node, *node.args):
            if part.is_Mul or part.is_Number:
                _approximate(part.as_coeff_Mul()[0])
            elif part.is_Pow and part.exp.is_number and abs(_approximate(part.exp)) > POWER:
                raise FormulaError(f"the power {_short(part)}, beyond {POWER}")
    else:
        _approximate(node)
    return node


def foreign(expression: Any, symbols: Iterable[Any], also: Iterable[Any] = ()) -> Any:
    """Return the first node that no formula in some symbols, `also` of some classes, may hold."""
    classes = CLASSES.union(also)
    known, seen, queue = set(symbols), set(), [expression]
    while queue:
        node = queue.pop()
        if node in seen:
            continue
        seen.add(node)
        if len(seen) > NODES:
            raise FormulaError(f"more than {NODES} different parts")
        if type(node) is sp.Heaviside and node.args[1] != sp.S.Half:
            return node  # there is no writing the value at the jump
        if not (
            node in known
            or (isinstance(node, sp.Number) and node.is_finite)
            or node in _LEAVES
            or (node.args and type(node) in classes)
        ):
            return node
        queue.extend(node.args)
    return None


def bounded(expression: Any) -> None:
    """Refuse an expression that `Nodes` would not have made, because of the size of its numbers."""
    seen, queue = set(), [expression]
    while queue:
        node = queue.pop()
        if node in seen:
            continue
        seen.add(node)
        checked(node)
        if type(node) in _FAR_CLASSES:
            _near(type(node).__name__, node.args)
        queue.extend(node.args)


def _near(name: str, arguments: Sequence[Any]) -> list[Any]:
    """Arguments of a special function, as doubles where they make exact arithmetic costly."""
    found = []
    for i, argument in enumerate(arguments):
        if argument.is_number:
            value = _approximate(argument)
            is_order = i == 0 and name in _OF_AN_ORDER
            far = ORDER if is_order else FACTORIAL if name == "gamma" else FAR
            if abs(value) > far:
                raise FormulaError(f"{name} of {_short(argument)}; it takes constants to {far:g}")
            small = abs(value) <= FACTORIAL and (not argument.is_Rational or argument.q <= 2)
            if "gamma" in name and not small:
                argument = sp.Float(float(value))
        found.append(argument)
    return found


def _approximate(constant: Any) -> Any:
    """The value of a constant formula; it must fit in a double."""
    value = constant if constant.is_Number else constant.evalf(17)
    if not (value.is_Rational or value.is_Float):
        raise FormulaError(
            f"the constant {_short(constant)}, which is not real, where a real function belongs"
        )
    _bounded_bits((_bits(value),), EXACT)
    try:
        number = int(value.p) / int(value.q) if value.is_Rational else float(value)
        held = math.isfinite(number)
        # Next to 0 doubles have few digits or none: a term would change, or be gone.
        held &= abs(number) > _LEAST or abs(sp.Rational(number) - value) <= 1e-15 * abs(value)
    except OverflowError:
        held = False
    if not held:
        got = f"the constant {_short(constant)}"
        raise FormulaError(f"{got}, which is outside the range of doubles")
    if value.is_Rational and not shifts(value):
        raise FormulaError("numbers with too many digits to compute with exactly")
    return value


def shifts(number: Any) -> range:
    """Which n keep a fraction times d, and d, sums of doubles; d is its odd divisor over 2^n."""
    above, below = abs(int(number.p)) or 1, int(number.q)
    twos, halves = ((n & -n).bit_length() - 1 for n in (above, below))
    odd = below.bit_length() - halves
    least = max(odd, above.bit_length() - halves + 1) - BITS + 1
    return range(least, BITS + 51 + min(0, twos - halves))


def fraction(value: float) -> Any:
    """The fraction that a double is."""
    return sp.Rational(*value.as_integer_ratio())


def exact_numbers(expression: Any) -> Any:
    """An expression with the fractions that its doubles are: sympy rounds what it makes of them."""
    return expression.xreplace({f: fraction(float(f)) for f in expression.atoms(sp.Float)})


def wide(number: Any) -> bool:
    """Whether a fraction has too many digits to be multiplied into sums."""
    return _bits(number) > WIDE


def _odd(whole: int) -> int:
    """A whole number > 0 without its factors 2, which exact arithmetic does not multiply."""
    return int(whole) // (int(whole) & -int(whole))


def _bits(number: Any) -> int:
    if number.is_Rational:
        return int(max(abs(number.p).bit_length(), number.q.bit_length()))
    return 0


def _bounded_bits(sizes: Iterable[int], most: int = 4 * BITS) -> None:
    if sum(sizes) > most:
        raise FormulaError("numbers with too many digits to compute with exactly")


def _short(node: Any) -> str:
    if isinstance(node, tuple):
        return "a pair"
    if node.is_Rational and _bits(node) > 200:
        return f"a number of {_bits(node)} bits"
    text = str(node)
    return text if len(text) <= 60 else f"{text[:57]}..."
