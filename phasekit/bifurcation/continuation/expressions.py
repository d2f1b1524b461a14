"""Formulas as text, read without evaluating anything: a safe way from a string to sympy."""

from __future__ import annotations

import ast
from collections.abc import Iterable, Mapping
from typing import Any

import sympy

from phasekit.errors import ParameterError

_NAMES = (
    "sin cos tan asin acos atan atan2 sinh cosh tanh asinh acosh atanh exp log sqrt erf erfc "
    "gamma loggamma Abs sign Max Min Heaviside"
).split()
_FUNCTIONS: dict[str, Any] = {name: getattr(sympy, name) for name in _NAMES} | {
    "abs": sympy.Abs,
    "max": sympy.Max,
    "min": sympy.Min,
    "ln": sympy.log,
    "arcsin": sympy.asin,
    "arccos": sympy.acos,
    "arctan": sympy.atan,
    "arctan2": sympy.atan2,
    "cbrt": lambda x: sympy.sign(x) * sympy.Abs(x) ** sympy.Rational(1, 3),
}
_OPERATORS: dict[type[ast.AST], Any] = {
    ast.Add: lambda a, b: a + b,
    ast.Sub: lambda a, b: a - b,
    ast.Mult: lambda a, b: a * b,
    ast.Div: lambda a, b: a / b,
    ast.Pow: lambda a, b: a**b,
    ast.BitXor: lambda a, b: a**b,
}


def symbols_of(names: Iterable[str]) -> dict[str, sympy.Symbol]:
    """Real symbols by name."""
    return {name: sympy.Symbol(name, real=True) for name in names}


def parse(text: str, symbols: Mapping[str, sympy.Symbol], where: str = "f") -> sympy.Expr:
    """Read a formula in Python's syntax; ``^`` is a power as well.

    Raises
    ------
    ParameterError
        If it is no formula, or holds a name that is neither declared nor a function.

    Examples
    --------
    >>> x, mu = sympy.symbols("x mu", real=True)
    >>> parse("mu*x - x^3", {"x": x, "mu": mu})
    mu*x - x**3
    """
    try:
        # ^ binds weaker than + in Python: it is replaced before parsing.
        tree = ast.parse(text.replace("^", "**").strip(), mode="eval").body
    except SyntaxError as error:
        raise ParameterError(f"{where}: got {text!r}, wants a formula: {error.msg}") from None

    def read(node: ast.AST) -> Any:
        if isinstance(node, ast.Constant) and type(node.value) in (int, float):
            return sympy.Integer(node.value) if type(node.value) is int else sympy.Float(node.value)
        if isinstance(node, ast.Name):
            if node.id in symbols:
                return symbols[node.id]
            if node.id == "pi":
                return sympy.pi
            raise ParameterError(
                f"{where}: got the name {node.id!r} in {text!r}, wants one of "
                f"{', '.join(symbols)} (declare it in state or parameters) or pi"
            )
        if isinstance(node, ast.UnaryOp) and isinstance(node.op, (ast.USub, ast.UAdd)):
            value = read(node.operand)
            return -value if isinstance(node.op, ast.USub) else value
        if isinstance(node, ast.BinOp) and type(node.op) in _OPERATORS:
            return _OPERATORS[type(node.op)](read(node.left), read(node.right))
        if (
            isinstance(node, ast.Call)
            and isinstance(node.func, ast.Name)
            and node.func.id in _FUNCTIONS
            and not node.keywords
        ):
            return _FUNCTIONS[node.func.id](*(read(argument) for argument in node.args))
        raise ParameterError(
            f"{where}: got {ast.unparse(node)!r} in {text!r}, wants + - * / ** and the functions "
            f"{', '.join(sorted(_FUNCTIONS))}"
        )

    return sympy.sympify(read(tree))
