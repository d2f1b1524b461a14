"""Expressions as functions of arrays, by code that sympy writes for NumPy and SciPy.

sympy's lambdify runs the code that it prints. All that enters that code is known here: the
functions and numbers that `phasekit.laws.formulas` lets through, and names that are identifiers
and mean nothing else in it. No text of a user or of a file is part of it.
"""

from __future__ import annotations

import builtins
import functools
import re
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from phasekit.laws.formulas import is_name

#: Names that sympy gives to common parts, and dummies.
_GIVEN = re.compile(r"_|x\d+$")

#: What SciPy has but sympy does not print, or prints otherwise.
_SCIPY = {
    "erfi": "erfi",
    "erfinv": "erfinv",
    "elliptic_k": "ellipk",
    "elliptic_e": "ellipe",
    "Ei": "expi",
}


class Literals:
    """Symbols that stand for the numbers of many digits in formulas, and are written as these.

    sympy would multiply such numbers into sums, where c (x - a) has digits that c x - c a loses.
    """

    def __init__(self) -> None:
        self.symbols: dict[str, Any] = {}
        self._numbers: dict[Any, Any] = {}

    def instead(self, e: Any) -> Any:
        """A formula with symbols for factors and terms that are such numbers."""
        from phasekit.laws.nodes import wide

        own = e.is_Add or e.is_Mul
        parts = [
            self._symbol(part) if own and part.is_Rational and wide(part) else self.instead(part)
            for part in e.args
        ]
        same = all(a is b for a, b in zip(parts, e.args, strict=True))
        return e if same else e.func(*parts)

    def back(self, e: Any) -> Any:
        """A formula with the numbers again."""
        return e.xreplace({symbol: symbol.number for symbol in self.symbols.values()})

    def _symbol(self, number: Any) -> Any:
        size = abs(number)
        if size not in self._numbers:
            name = f"_c{len(self._numbers)}"
            self._numbers[size] = self.symbols[name] = _literal_class()(name, size)
        return self._numbers[size] if number > 0 else -self._numbers[size]


@functools.cache
def _literal_class() -> Any:
    import sympy as sp

    class Literal(sp.Dummy):  # type: ignore[misc]
        """A number > 0 that sympy takes for a symbol."""

        __slots__ = ("number",)

        def __new__(cls, name: str, number: Any) -> Any:
            made = super().__new__(cls, name, positive=True)
            made.number = number
            return made

    return Literal


def array_code(symbols: Sequence[Any], expression: Any, cse: Any = True) -> Callable[..., Any]:
    """Return a function of arrays that broadcast, in the order of the symbols."""
    import sympy as sp

    assert all(is_name(symbol.name) for symbol in symbols)
    safe = {s: sp.Symbol(f"_p{i}", real=True) for i, s in enumerate(symbols) if _taken(s.name)}
    if safe:
        symbols = [safe.get(symbol, symbol) for symbol in symbols]
        if isinstance(expression, list):
            expression = [part.xreplace(safe) for part in expression]
        else:
            expression = expression.xreplace(safe)
    made: Callable[..., Any] = sp.lambdify(
        symbols, expression, modules="numpy", printer=_printer(), cse=cse
    )
    return made


def _taken(name: str) -> bool:
    return bool(_GIVEN.match(name)) or hasattr(np, name) or hasattr(builtins, name)


@functools.cache
def _printer_class() -> Any:
    from sympy.printing.numpy import SciPyPrinter

    class Exact(SciPyPrinter):  # type: ignore[misc]
        """With all digits of numbers, where sympy keeps 15, and no whole number beyond int64."""

        _kf = {**SciPyPrinter._kf, **{name: f"scipy.special.{f}" for name, f in _SCIPY.items()}}

        def _print_Float(self, number: Any) -> str:
            return repr(float(number))

        def _print_Integer(self, number: Any) -> str:
            return str(number.p) if abs(number.p) < 2**53 else repr(float(number.p))

        def _print_Rational(self, number: Any) -> str:
            large = max(abs(number.p), number.q) >= 2**53
            return repr(float(number)) if large else f"{number.p}/{number.q}"

        def _print_Literal(self, literal: Any) -> str:
            return repr(float(literal.number))

        def _print_special(self, node: Any) -> str:
            name = self._module_format(self._kf[type(node).__name__])
            return f"{name}({', '.join(map(self._print, node.args))})"

        def _print_SphericalJ0(self, node: Any, order: int = 0) -> str:
            name = self._module_format("scipy.special.spherical_jn")
            return f"{name}({order}, {self._print(node.args[0])})"

        def _print_SphericalJ1(self, node: Any) -> str:
            return self._print_SphericalJ0(node, 1)

        def _print_loggamma(self, node: Any) -> str:
            # log|gamma|, as the machine code of continuation has it.
            return f"{self._module_format('scipy.special.gammaln')}({self._print(node.args[0])})"

    for name in _SCIPY:
        setattr(Exact, f"_print_{name}", Exact._print_special)
    return Exact


def _printer() -> Any:
    # A printer keeps what its code must import, so each code has its own.
    return _printer_class()(
        {"fully_qualified_modules": False, "inline": True, "allow_unknown_functions": False}
    )
