"""What a `Problem` is made of: its names, values and formulas, checked, and its right-hand side."""

from __future__ import annotations

import inspect
import keyword
from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import Any

import numpy as np

from phasekit.bifurcation.continuation.code_fields import CompiledField, PythonField
from phasekit.bifurcation.continuation.fields import Field, SymbolicField
from phasekit.errors import ParameterError
from phasekit.labelled.arguments import bad, number, unknown

#: Coefficients (A, B, C) of the models as formulas of their parameters.
FORMULAS: dict[str, tuple[str, str, str]] = {
    "Coefficients": ("A", "B", "C"),
    "Reduced": ("Omega_sq", "lam*Omega_sq", "psi*Omega_sq"),
    "GyroRotorDisk": (
        "omega1**2*(2*e*sin(beta) - r*cos(beta))*(2*e*sin(beta) + r*cos(beta))/N",
        "4*g*e*sin(beta)/N",
        "4*omega1**2*a*e*sin(beta)/N",
    ),
    "ParticleOnCircle": (
        "(omega*cos(tilt))**2",
        "(g*cos(tilt) + omega**2*normal_offset*sin(tilt))/radius",
        "omega**2*offset/radius",
    ),
    "Pendulum": ("0", "g/length", "0"),
    "StonerWohlfarth": ("-2*K", "h_x", "h_y"),
}
INERTIA = "(4*e**2*sin(beta)**2 + r**2*(1 + sin(beta)**2))"


def names_of(argument: str, given: Any) -> tuple[str, ...]:
    """Names that can be states or parameters."""
    try:
        names = tuple(given)
    except TypeError:
        raise bad(argument, given, "names") from None
    for name in names:
        if not isinstance(name, str) or not name.isidentifier() or keyword.iskeyword(name):
            raise bad(argument, name, "names that are Python identifiers and no keywords")
    if not names:
        raise bad(argument, given, "at least one name")
    if len(set(names)) < len(names):
        raise bad(argument, given, "names that differ")
    return names


def values_of(argument: str, given: Any) -> dict[str, float]:
    """Names with finite numbers."""
    if not isinstance(given, Mapping):
        raise bad(argument, given, "a mapping from names to numbers")
    if given:
        names_of(argument, given)
    values = {}
    for name, value in given.items():
        values[name] = number(f"{argument}[{name!r}]", value, "a number, finite", None)
    return values


def expressions_of(given: Iterable[Any], names: Sequence[str], argument: str) -> list[Any]:
    """Formulas as sympy expressions of real symbols."""
    import sympy

    from phasekit.bifurcation.continuation.expressions import parse, symbols_of

    symbols = symbols_of(names)
    found = []
    for one in given:
        if isinstance(one, str):
            found.append(parse(one, symbols, argument))
            continue
        wants = "formulas: strings or sympy expressions"
        if isinstance(one, sympy.Basic):
            expression: Any = one
        else:
            expression = sympy.sympify(number(argument, one, wants))
        if not isinstance(expression, sympy.Expr):
            raise bad(argument, one, wants)
        replaced = {}
        for symbol in expression.free_symbols:
            if str(symbol) not in symbols:
                raise ParameterError(
                    f"{argument}: got the symbol {symbol} in {expression}, wants one of "
                    f"{', '.join(symbols)}; declare it in state or parameters"
                )
            replaced[symbol] = symbols[str(symbol)]
        found.append(expression.xreplace(replaced))
    return found


def make_field(
    f: Any, jac: Callable[..., Any] | None, states: tuple[str, ...], names: tuple[str, ...]
) -> tuple[Field, Any]:
    """The right-hand side in the form that the stepping code takes, and f as it is kept."""
    if isinstance(f, Mapping):
        for name in f:
            if name not in states:
                raise unknown("f: state", name, states)
        missing = [name for name in states if name not in f]
        if missing:
            raise bad("f", list(f), f"a formula for {', '.join(missing)} as well")
        f = [f[name] for name in states]
    is_one = isinstance(f, str) or hasattr(f, "free_symbols")
    if is_one or (isinstance(f, (list, tuple)) or (hasattr(f, "tolist") and np.ndim(f) > 0)):
        if jac is not None:
            raise bad("jac", jac, "None with formulas, whose derivatives are exact")
        given = [f] if is_one and not hasattr(f, "tolist") else list(f)
        if len(given) != len(states):
            raise bad("f", given, f"{len(states)} formulas, one for each of {', '.join(states)}")
        expressions = tuple(expressions_of(given, [*states, *names], "f"))
        return SymbolicField(expressions, states, names), expressions
    if not callable(f):
        raise bad(
            "f", f, "a function f(x, **parameters), formulas as strings, or sympy expressions"
        )
    inner = getattr(f, "py_func", None)
    if inner is not None and hasattr(f, "signatures"):
        arguments = list(inspect.signature(inner).parameters)[1:]
        if sorted(arguments) != sorted(names):
            raise bad("parameters", list(names), f"the arguments of f after the state: {arguments}")
        if jac is not None:
            raise bad("jac", jac, "None with a compiled f, whose derivatives are compiled as well")
        return CompiledField(f, arguments, states, names), f
    _check_call("f", f, names)
    if jac is not None:
        _check_call("jac", jac, names)
    return PythonField(f, jac, states, names), f


def _check_call(argument: str, function: Any, names: Sequence[str]) -> None:
    try:
        signature = inspect.signature(function)
    except (TypeError, ValueError):
        return
    try:
        signature.bind(np.zeros(1), **dict.fromkeys(names, 0.0))
    except TypeError as error:
        raise ParameterError(
            f"{argument}: got a function with the arguments {signature}, wants one to be called "
            f"as {argument}(x, {', '.join(f'{n}=...' for n in names)}): {error}"
        ) from None
