"""Expressions as JavaScript, by a printer that knows a few nodes and no text.

Symbols are written as the printer's caller calls them, never by their own names, so that nothing
of what a user or a file wrote becomes code.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from phasekit.errors import ParameterError

#: Functions that the page has besides those of JavaScript, and those whose order is whole.
SPECIAL = (
    "erf erfc erfi erfinv gamma loggamma polygamma airyai airyaiprime airybi airybiprime LambertW "
    "Si Ci Ei fresnels fresnelc elliptic_k elliptic_e besselj bessely besseli besselk"
).split()
ORDERED = "besselj bessely besseli besselk polygamma".split()
#: Functions by the names of their classes in sympy.
FUNCTIONS = {
    **{name: f"Math.{name}" for name in "sin cos tan sinh cosh tanh exp log".split()},
    **{name: f"Math.{name}" for name in "asin acos atan asinh acosh atanh atan2".split()},
    **{"Abs": "Math.abs", "Max": "Math.max", "Min": "Math.min", "sign": "Math.sign"},
    "Heaviside": "special.heaviside",
    **{name: f"special.{name}" for name in SPECIAL},
}
_COMPARISONS = {
    "StrictLessThan": "<",
    "LessThan": "<=",
    "StrictGreaterThan": ">",
    "GreaterThan": ">=",
    "Equality": "===",
    "Unequality": "!==",
}


def function(
    expressions: Sequence[Any], names: Mapping[Any, str], arguments: str, into: str = ""
) -> str:
    """Write expressions of symbols as one JavaScript function, which returns one value or a list.

    ``names`` is the JavaScript of each symbol; with ``into``, the argument that takes the values,
    nothing is returned.

    >>> from sympy.abc import x, y
    >>> function([x**2 + y, 2.5 * x], {x: "x", y: "p[0]"}, "x, p")
    '(x, p) => { return [p[0]+(x*x), 2.5*x]; }'
    >>> function([x**2 + y, 2.5 * x], {x: "x", y: "p[0]"}, "x, p, out", "out")
    '(x, p, out) => { out[0] = p[0]+(x*x); out[1] = 2.5*x; }'
    """
    import sympy as sp

    known = dict(names)
    lines = []
    shared, rest = sp.cse(list(expressions), symbols=sp.numbered_symbols("shared", sp.Dummy))
    for i, (symbol, part) in enumerate(shared):
        lines.append(f"const t{i} = {write(part, known)}; ")
        known[symbol] = f"t{i}"
    values = [write(part, known) for part in rest]
    if into:
        lines += [f"{into}[{i}] = {value}; " for i, value in enumerate(values)]
        return f"({arguments}) => {{ {''.join(lines)}}}"
    result = values[0] if len(values) == 1 else f"[{', '.join(values)}]"
    return f"({arguments}) => {{ {''.join(lines)}return {result}; }}"


def write(node: Any, names: Mapping[Any, str]) -> str:
    """Write one expression.

    >>> import sympy
    >>> x = sympy.Symbol("x")
    >>> write(sympy.sin(x) / 3 - sympy.sqrt(x), {x: "x"})
    '(-(Math.sqrt(x)))+(1/3)*Math.sin(x)'
    """
    if node in names:
        return names[node]
    if node.is_Number or node.is_NumberSymbol:
        return _number(node)
    if node.is_Boolean or node.is_Relational:
        return _condition(node, names)
    if node.is_Add:
        return "+".join(_bracketed(arg, names, sums=False) for arg in node.args)
    if node.is_Mul:
        return _product(node, names)
    if node.is_Pow:
        return _power(node.base, node.exp, names)
    kind = type(node).__name__
    if kind == "exp":
        return f"Math.exp({write(node.args[0], names)})"
    if kind == "Piecewise":
        return _piecewise(node, names)
    if kind in ORDERED and not node.args[0].is_Integer:
        raise ParameterError(
            f"system: got a formula with {kind} of the order {node.args[0]}, wants a whole order "
            "for the page; the library itself takes any"
        )
    if kind == "DiracDelta":  # the slope of a jump, beside it
        return "0"
    if kind in FUNCTIONS:
        arguments = node.args[:1] if kind == "Heaviside" else node.args
        return f"{FUNCTIONS[kind]}({', '.join(write(arg, names) for arg in arguments)})"
    raise ParameterError(
        f"system: got a formula with {kind}, wants one of the functions that a page has: "
        f"{', '.join(sorted(FUNCTIONS))}"
    )


def number(value: float) -> str:
    """Write a double so that JavaScript reads the same.

    >>> number(0.1), number(-float("inf"))
    ('0.1', '-Infinity')
    """
    text = repr(float(value))
    return text.replace("inf", "Infinity").replace("nan", "NaN")


def _number(node: Any) -> str:
    if node.is_Integer and abs(node.p) < 2**53:
        return str(node.p) if node.p >= 0 else f"({node.p})"
    if node.is_Rational and max(abs(node.p), node.q) < 2**53:
        return f"({node.p}/{node.q})"
    text = number(float(node))
    return text if text[0] != "-" else f"({text})"


def _bracketed(node: Any, names: Mapping[Any, str], *, sums: bool = True) -> str:
    """Write what stands beside an operator."""
    text = write(node, names)
    compound = node not in names and not node.is_Number
    negative = text.startswith("-")
    return f"({text})" if negative or (compound and (node.is_Add and sums or node.is_Pow)) else text


def _product(node: Any, names: Mapping[Any, str]) -> str:
    above, below = [], []
    coefficient, factors = node.as_coeff_mul()
    for factor in factors:
        if factor.is_Pow and factor.exp.is_Number and factor.exp.is_negative:
            below.append(f"({_power(factor.base, -factor.exp, names)})")
        else:
            above.append(_bracketed(factor, names))
    sign = "-" if coefficient == -1 else ""
    if coefficient not in (1, -1):
        above.insert(0, _number(coefficient))
    text = "*".join(above) or "1"
    for part in below:
        text = f"{text}/{part}"
    return sign + text


def _power(base: Any, exponent: Any, names: Mapping[Any, str]) -> str:
    import sympy as sp

    if base is sp.E:
        return f"Math.exp({write(exponent, names)})"
    text = write(base, names)
    if exponent == sp.Rational(1, 2):
        return f"Math.sqrt({text})"
    if exponent.is_Number and exponent.is_negative:
        return f"1/({_power(base, -exponent, names)})"
    if exponent.is_Integer:
        simple = base in names
        if simple and exponent <= 4:
            return "*".join([text] * int(exponent))
        return text if exponent == 1 else f"special.power({text}, {int(exponent)})"
    return f"Math.pow({text}, {write(exponent, names)})"


def _piecewise(node: Any, names: Mapping[Any, str]) -> str:
    text = "NaN"
    for value, condition in reversed(node.args):
        text = f"({_condition(condition, names)} ? {write(value, names)} : {text})"
    return text


def _condition(node: Any, names: Mapping[Any, str]) -> str:
    if node in names:
        return names[node]
    kind = type(node).__name__
    if kind in ("BooleanTrue", "BooleanFalse"):
        return "true" if kind == "BooleanTrue" else "false"
    if kind in _COMPARISONS:
        left, right = (write(arg, names) for arg in node.args)
        return f"(({left}) {_COMPARISONS[kind]} ({right}))"
    if kind in ("And", "Or"):
        join = " && " if kind == "And" else " || "
        return f"({join.join(_condition(arg, names) for arg in node.args)})"
    if kind == "Not":
        return f"(!{_condition(node.args[0], names)})"
    raise ParameterError(f"system: got a formula with the condition {kind}, wants comparisons")
