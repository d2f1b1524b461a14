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
from collections.abc import Iterable, Mapping
from typing import TYPE_CHECKING, Any

from phasekit.errors import ParameterError
from phasekit.laws.grammar import FormulaError, parse

if TYPE_CHECKING:
    import sympy

#: Longest formula, in letters, and longest name.
LENGTH, NAME = 50_000, 100


def is_name(name: object) -> bool:
    """Whether it can name a symbol: a Python identifier as Python writes it, and no keyword.

    Examples
    --------
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
    import sympy

    return {name: sympy.Symbol(name, real=True) for name in names}


def read_formula(
    text: str, symbols: Mapping[str, sympy.Symbol], argument: str = "f", declare: str = ""
) -> sympy.Expr:
    """Read a formula.

    Numbers, names, ``+ - * /``, ``**`` or ``^`` for powers, known functions and constants, and
    ``Piecewise((value, condition), ...)`` with comparisons joined by ``&``, ``|`` and ``~``.
    Whole numbers and their quotients are exact, other numbers are doubles.

    Parameters
    ----------
    text : str
        The formula.
    symbols : mapping of str to sympy.Symbol
        The names in it that are symbols; a constant of the same name is hidden.
    argument : str
        What messages call the formula.
    declare : str, optional
        What messages say of names that are not known.

    Raises
    ------
    ParameterError
        If it is no formula, has an unknown name, or is too large. In bounded time.

    Examples
    --------
    >>> x, mu = symbols_of(["x", "mu"]).values()
    >>> read_formula("mu*x - x^3/3", {"x": x, "mu": mu})
    mu*x - x**3/3
    """
    from phasekit.laws.nodes import CONSTANTS, FUNCTIONS, Nodes, values

    if len(text) > LENGTH:
        raise ParameterError(
            f"{argument}: got {len(text)} letters, wants a formula of at most {LENGTH}"
        )

    def unknown(name: str, called: bool) -> ParameterError:
        valid = list(FUNCTIONS) if called else [*symbols, *CONSTANTS]
        near = [one for one in valid if one.lower() == name.lower()]
        near = near or difflib.get_close_matches(name[:NAME], valid, n=1, cutoff=0.5)
        if near:
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
        found = parse(text, Nodes(unknown, symbols))
        values([found])
        return _known(found, symbols, argument)
    except FormulaError as error:
        raise ParameterError(
            f"{argument}: got {_cut(text)}, wants a formula that sympy reads, such as "
            f"'x^4/4 - x^2/2': {error}"
        ) from None
    except ParameterError:
        raise
    except Exception as error:  # whatever sympy and mpmath make of numbers
        reason = "nested too deeply" if isinstance(error, RecursionError) else str(error)
        raise ParameterError(
            f"{argument}: got {_cut(text)}, wants a formula that sympy can keep: {reason}"
        ) from None


def take_formula(
    expression: Any, symbols: Mapping[str, sympy.Symbol], argument: str = "f", declare: str = ""
) -> sympy.Expr:
    """Take a formula: a string, a number or a sympy expression, whose symbols go by their names.

    Raises
    ------
    ParameterError
        If it is none of these, or holds what `read_formula` would not read.
    """
    import sympy

    from phasekit.laws.nodes import bounded

    if isinstance(expression, str):
        return read_formula(expression, symbols, argument, declare)
    if not isinstance(expression, sympy.Basic):
        return _number(expression, argument)
    if not isinstance(expression, sympy.Expr):
        raise ParameterError(
            f"{argument}: got a sympy {type(expression).__name__}, wants an expression of one value"
        )
    replaced: dict[Any, Any] = {x: sympy.Float(float(x)) for x in expression.atoms(sympy.Float)}
    for symbol in expression.free_symbols:
        name = str(getattr(symbol, "name", symbol))
        if name in symbols:
            replaced[symbol] = symbols[name]
        else:
            raise ParameterError(
                f"{argument}: got the symbol {name} in {_cut(str(expression))}, wants one of "
                f"{', '.join(symbols)}{declare and '; ' + declare}"
            )
    try:
        found = _known(expression.xreplace(replaced), symbols, argument)
        bounded(found)
        return found
    except FormulaError as error:
        raise ParameterError(f"{argument}: got a sympy expression with {error}") from None
    except RecursionError:
        raise ParameterError(
            f"{argument}: got a sympy expression that is nested too deeply, wants a shorter one"
        ) from None


def write_formula(expression: Any) -> str:
    """Write an expression so that reading it gives the same, every digit of its numbers.

    Examples
    --------
    >>> import sympy
    >>> write_formula(sympy.Float(0.1) * sympy.Symbol("x") * sympy.E)
    '0.1*exp(1)*x'
    """
    return str(_printer().doprint(expression))


def short_formula(expression: Any) -> str:
    """Write an expression for a message that must stay one readable line."""
    text = write_formula(expression)
    return text if len(text) <= 120 else f"{text[:80]}... ({len(text)} letters)"


@functools.cache
def _printer() -> Any:
    from sympy.printing.str import StrPrinter

    class Exact(StrPrinter):  # type: ignore[misc]
        def _print_Float(self, number: Any) -> str:
            return repr(float(number))

        def _print_Exp1(self, constant: Any) -> str:
            return "exp(1)"  # E may be a symbol

    return Exact()


def _number(value: Any, argument: str) -> Any:
    import numbers

    import sympy

    if isinstance(value, bool) or not isinstance(value, numbers.Real):
        raise ParameterError(
            f"{argument}: got {value!r:.80}, wants a formula as a string or a sympy expression"
        )
    try:
        finite = abs(float(value)) <= 1e308
    except OverflowError:
        finite = False
    if not finite:
        raise ParameterError(f"{argument}: got a number that no double holds, wants a formula")
    number: Any = value
    whole = isinstance(value, numbers.Integral)
    return sympy.Integer(int(number)) if whole else sympy.Float(float(number))


def _known(found: Any, symbols: Mapping[str, Any], argument: str) -> Any:
    """Return what was read or given, if nothing in it is foreign to formulas."""
    import sympy

    from phasekit.laws.nodes import CONSTANTS, FUNCTIONS, foreign

    strange = foreign(found, symbols.values())
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
