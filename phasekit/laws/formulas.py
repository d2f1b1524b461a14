"""Formulas as text: read without evaluating anything, and written so that they read the same.

Everything that a user, a stored map, a saved branch or a recipe gives as a formula comes through
here. Text is parsed by `phasekit.laws.grammar` and made into sympy's nodes one by one, by
`phasekit.laws.nodes`; no part of it is ever run as Python. What leaves this module holds only
known functions of known symbols, so that code can be generated from it.
"""

from __future__ import annotations

import difflib
import functools
import keyword
import unicodedata
from collections.abc import Callable, Iterable, Mapping
from fractions import Fraction
from typing import TYPE_CHECKING, Any

from phasekit.errors import ParameterError
from phasekit.inputs import is_real
from phasekit.laws.grammar import FormulaError, parse
from phasekit.numerics.later import imported

if TYPE_CHECKING:
    import sympy

#: Derivatives along the axes of a grid, as they are written.
DERIVATIVES = ("lap", "dx", "dxx", "dy", "dyy", "dz", "dzz")

#: Longest formula, in letters, and longest name.
LENGTH, NAME = 50_000, 100


def keyword_hint(name: object) -> str:
    """What to write in place of a name that is a keyword of Python; empty for any other name."""
    if not isinstance(name, str) or not keyword.iskeyword(name):
        return ""
    other = "lam" if name == "lambda" else f"{name}_"
    return f"{name} is a keyword of Python: use {other}"


def is_name(name: object) -> bool:
    """Whether it can name a symbol: a Python identifier as Python writes it, and no keyword.

    >>> is_name("omega_1"), is_name("lambda"), is_name("__class__"), is_name("x; y")
    (True, False, False, False)
    """
    return (
        isinstance(name, str)
        and len(name) <= NAME
        and name.isidentifier()
        and not keyword.iskeyword(name)
        and not name.startswith("__")
        and unicodedata.normalize("NFKC", name) == name
    )


def symbols_of(names: Iterable[str]) -> dict[str, sympy.Symbol]:
    """Real symbols by name."""
    sympy = imported("sympy")
    return {name: sympy.Symbol(name, real=True) for name in names}


def read_formula(
    text: str,
    symbols: Mapping[str, sympy.Symbol],
    argument: str = "f",
    declare: str = "",
    *,
    exact: bool = False,
    read: Callable[[str, Any], Any] = parse,
) -> sympy.Expr:
    """Read a formula.

    Numbers, names, ``+ - * /``, ``**`` or ``^`` for powers, known functions and constants, and
    ``Piecewise((value, condition), ...)`` with comparisons joined by ``&``, ``|`` and ``~``.
    Whole numbers and their quotients are exact, other numbers are doubles.

    ``symbols`` are the names in it, which may stand for formulas or functions of symbols and hide
    constants; ``argument`` is what messages call the formula, ``declare`` what they say of unknown
    names. ``exact`` takes doubles as the fractions that they are, so that nothing is rounded before
    code is written. ``read`` is the grammar: it makes nodes of a text by a builder.

    >>> x, mu = symbols_of(["x", "mu"]).values()
    >>> read_formula("mu*x - x^3/3", {"x": x, "mu": mu})
    mu*x - x**3/3
    """
    from phasekit.laws.nodes import CONSTANTS, FUNCTIONS, Nodes, exact_numbers, values

    if len(text) > LENGTH:
        raise ParameterError(
            f"{argument}: got {len(text)} letters, wants a formula of at most {LENGTH}"
        )

    def unknown(name: str, called: bool) -> ParameterError:
        if reserved := keyword_hint(name):
            return ParameterError(f"{argument}: got the name {name!r} in {_cut(text)}; {reserved}")
        valid = list(FUNCTIONS) if called else [*symbols, *CONSTANTS]
        near = [one for one in valid if one.lower() == name.lower()]
        near = near or difflib.get_close_matches(name[:NAME], valid, n=1, cutoff=0.5)
        if called and name in DERIVATIVES:
            hint = "; it is a derivative along an axis, which grid=pk.grid(...) of a Problem makes"
        elif near:
            hint = f"; did you mean {near[0]!r}?"
        else:
            hint = f"; wants one of {', '.join(sorted(valid) if called else valid)}"
        if not name.isascii():
            hint += f" ({name[:NAME]} is written {ascii(name[:NAME])})"
        if called:
            got = f"the unknown function {name}(...), as in {_cut(text, name)}"
            return ParameterError(f"{argument}: got {got}{hint}")
        got = f"the unknown symbol {name} (the name {name!r} in {_cut(text, name)})"
        return ParameterError(f"{argument}: got {got}{hint}{declare and '; ' + declare}")

    try:
        found = read(text, Nodes(unknown, symbols, exact))
        values([found])
        found = exact_numbers(found) if exact else found  # gamma functions of fractions are doubles
        return _free_of_foreign(found, symbols, argument)
    except FormulaError as error:
        raise ParameterError(
            f"{argument}: got {_cut(text)}, wants a formula such as 'x^4/4 - x^2/2': {error}"
        ) from None
    except ParameterError:
        raise
    except Exception as error:  # whatever sympy and mpmath make of numbers
        reason = "nested too deeply" if isinstance(error, RecursionError) else str(error)
        raise ParameterError(
            f"{argument}: got {_cut(text)}, wants a formula that sympy can keep: {reason}"
        ) from None


def take_formula(
    expression: Any,
    symbols: Mapping[str, sympy.Symbol],
    argument: str = "f",
    declare: str = "",
    *,
    exact: bool = False,
) -> sympy.Expr:
    """Take a formula: a string, a number or a sympy expression, whose symbols go by their names."""
    import sympy

    from phasekit.laws.nodes import bounded, fraction

    double = fraction if exact else sympy.Float
    if isinstance(expression, str):
        return read_formula(expression, symbols, argument, declare, exact=exact)
    if not isinstance(expression, sympy.Basic):
        return _number(expression, argument, double)
    if not isinstance(expression, sympy.Expr):
        raise ParameterError(
            f"{argument}: got a sympy {type(expression).__name__}, wants an expression of one value"
        )
    replaced: dict[Any, Any] = {x: double(float(x)) for x in expression.atoms(sympy.Float)}
    for symbol in expression.free_symbols:
        name = str(getattr(symbol, "name", symbol))
        if symbol == symbols.get(name):
            continue  # what is not replaced is not made anew
        if name in symbols:
            replaced[symbol] = symbols[name]
        else:
            raise ParameterError(
                f"{argument}: got the symbol {name} in {_cut(str(expression))}, wants one of "
                f"{', '.join(symbols)}{declare and '; ' + declare}"
            )
    try:
        found = _free_of_foreign(expression.xreplace(replaced), symbols, argument)
        bounded(found)
        return found
    except FormulaError as error:
        raise ParameterError(f"{argument}: got a sympy expression with {error}") from None
    except RecursionError:
        raise ParameterError(
            f"{argument}: got a sympy expression that is nested too deeply, wants a shorter one"
        ) from None


def write_formula(expression: Any, *, exact: bool = False) -> str:
    """Write an expression so that reading it gives the same, every digit of its numbers.

    With `exact`, fractions of doubles as these, for `read_formula` with `exact`.

    >>> import sympy
    >>> write_formula(sympy.Float(0.1) * sympy.Symbol("x") * sympy.E)
    '0.1*exp(1)*x'
    """
    return str(_printers()[exact].doprint(expression))


def short_formula(expression: Any) -> str:
    """Write an expression for a message that must stay one readable line."""
    text = write_formula(expression)
    return text if len(text) <= 120 else f"{text[:80]}... ({len(text)} letters)"


@functools.cache
def _printers() -> tuple[Any, Any]:
    from sympy.printing.precedence import PRECEDENCE
    from sympy.printing.str import StrPrinter

    class Plain(StrPrinter):  # type: ignore[misc]
        def _print_Float(self, number: Any) -> str:
            return repr(float(number))

        def _print_Exp1(self, constant: Any) -> str:
            return "exp(1)"  # E may be a symbol

    class Exact(Plain):
        def _print_Rational(self, number: Any) -> str:
            size, below = _fraction_text(abs(number))
            return ("-" if number < 0 else "") + size + below

        _print_Integer = _print_Rational

        def _print_Mul(self, product: Any) -> str:
            number, rest = product.as_coeff_Mul()
            size, below = _fraction_text(abs(number)) if number.is_Rational else ("", "")
            plain = not size.strip("0123456789") and not below.strip("/0123456789")
            if plain or any(factor.is_Number for factor in product.args[1:]):
                return str(super()._print_Mul(product))
            factors = rest.is_Mul
            text = self._print(rest) if factors else self.parenthesize(rest, PRECEDENCE["Mul"])
            text = text[1:] if text.startswith("1/") else f"*{text}"
            text = text[1:] if size == "1" and text[0] == "*" else size + text
            return ("-" if number < 0 else "") + text + below

        def parenthesize(self, item: Any, level: int, strict: bool = False) -> str:
            if item.is_Rational and item >= 0 and set(text := self._print(item)).isdisjoint("/( "):
                return str(text)
            return str(super().parenthesize(item, level, strict))

    return Plain(), Exact()


def _fraction_text(number: Any) -> tuple[str, str]:
    """A fraction >= 0 as text of a factor and a divisor: of doubles, where these are shorter."""
    from phasekit.laws.nodes import BITS, shifts

    above, below = int(number.p), int(number.q)
    odd = below // (below & -below)
    wanted, usable = (above & -above).bit_length() - 1 if odd >= 2**53 else 0, shifts(number)
    shift = Fraction(2) ** max(min(wanted, usable.stop - 1), usable.start)
    factor = _doubles_text(Fraction(above * odd, below) / shift)
    divisor = _doubles_text(odd / shift)
    found = (factor, f"/{divisor}" if divisor != "1" else "")
    plain = (str(above), f"/{below}" if below != 1 else "")
    # Whole numbers beyond all doubles are not read.
    long = max(above, below).bit_length() > BITS
    return found if long or len("".join(found)) < len("".join(plain)) else plain


def _doubles_text(number: Fraction) -> str:
    """A fraction without odd divisors as a whole number or the sum of doubles that it is."""
    if number.denominator == 1 and number.numerator < 10**15:
        return str(number)
    doubles = []
    while number:
        double = float(number)
        if not double:  # below all doubles
            break
        doubles.append(double)
        number -= Fraction(double)
    text = " + ".join(map(repr, doubles)).replace("+ -", "- ")
    return f"({text})" if len(doubles) > 1 else text


def _number(value: Any, argument: str, double: Callable[[float], Any]) -> Any:
    import numbers

    import sympy

    if not is_real(value):
        raise ParameterError(
            f"{argument}: got {value!r:.80}, wants a formula as a string or a sympy expression"
        )
    try:
        finite = abs(float(value)) <= 1e308
    except OverflowError:
        finite = False
    if not finite:
        raise ParameterError(
            f"{argument}: got a number outside the range of doubles, wants a formula"
        )
    number: Any = value
    whole = isinstance(value, numbers.Integral)
    return sympy.Integer(int(number)) if whole else double(float(number))


def _free_of_foreign(found: Any, symbols: Mapping[str, Any], argument: str) -> Any:
    """Return what was read or given, if nothing in it is foreign to formulas."""
    import sympy

    from phasekit.laws.nodes import CONSTANTS, FUNCTIONS, foreign

    # A name may stand for a formula of the symbols, or for a function.
    own = {symbol for value in symbols.values() for symbol in value.free_symbols}
    strange = foreign(found, own)
    if strange is not None:
        raise ParameterError(
            f"{argument}: got {_cut(str(strange))}, of the kind {type(strange).__name__}, wants "
            f"+ - * / **, the functions {', '.join(sorted(FUNCTIONS))} and the constants "
            f"{', '.join(CONSTANTS)}"
        )
    if found.has(sympy.I, sympy.zoo, sympy.nan, sympy.oo):
        raise ParameterError(
            f"{argument}: got {_cut(str(found))}, wants a real function of real symbols, finite "
            "but for single points"
        )
    used = {type(part).__name__ for part in found.atoms(sympy.Function)}
    used.update(name for name, value in CONSTANTS.items() if name != "E" and found.has(value))
    for name in used.intersection(symbols):
        raise ParameterError(
            f"{argument}: got {name} as a symbol and with its own meaning in one formula; wants "
            "another name for the symbol"
        )
    return found


def _cut(text: str, name: str = "") -> str:
    """Write a formula for a message that must stay readable, around a name in it."""
    if len(text) <= 120:
        return repr(text)
    start = max(0, text.find(name) - 40) if name else 0
    return f"{text[start : start + 80]!r}... ({len(text)} letters)"
