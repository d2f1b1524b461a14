"""Formulas written on a `Tape`, each part of them once."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, Any

from phasekit.errors import ParameterError
from phasekit.numerics.later import later
from phasekit.numerics.machine_code import COMPARISONS, LIBRARY, LONGEST_POWER
from phasekit.numerics.tape import Node, Tape

if TYPE_CHECKING:
    import sympy
else:
    sympy = later("sympy")


def write(tape: Tape, expressions: Sequence[Any]) -> list[Node]:
    """The places of expressions, which are written on the tape."""
    return _Reader(tape).read(expressions)


def parts(expressions: Sequence[Any]) -> list[Any]:
    """All parts of expressions, each once and after its own; without recursion: they may be deep.

    Parts are told apart by what they are, not by what they equal, which is dear to ask.
    """
    found: dict[int, Any] = {}
    left = [(e, False) for e in reversed(expressions)]
    while left:
        e, ready = left.pop()
        if id(e) in found:
            continue
        if ready or not e.args:
            found[id(e)] = e
        else:
            left.append((e, True))
            left += [(a, False) for a in reversed(e.args) if id(a) not in found]
    return list(found.values())


class _Reader:
    """Writes expressions on a tape."""

    def __init__(self, tape: Tape) -> None:
        self.tape = tape
        # Numbers wait for who takes them: sympy evaluates what is made of numbers alone, with all
        # digits.
        self.made: dict[int, Any] = {}

    def read(self, expressions: Sequence[Any]) -> list[Node]:
        """The places of expressions."""
        for e in parts(expressions):
            self.made[id(e)] = self._written(e)
        return [self._node(e) for e in expressions]

    def _node(self, e: Any) -> Node:
        made = self.made[id(e)]
        if isinstance(made, int):
            return made
        try:
            return self.tape.number(float(made))
        except TypeError:  # it is complex
            return self.tape.number(math.nan)

    def _written(self, e: Any) -> Any:
        """The place of an expression whose arguments are there, or itself if it is a number."""
        t = self.tape
        if e.is_Symbol:
            return t.argument(*t.inputs[e])
        if e is sympy.true or e is sympy.false:
            return t.number(float(bool(e)))
        if isinstance(e, sympy.Expr) and not any(isinstance(self.made[id(a)], int) for a in e.args):
            return e
        if e.is_Add:
            total = self._node(e.args[0])
            for term in e.args[1:]:
                total = t.add(total, self._node(term))
            return total
        if e.is_Mul:
            return self._product(e)
        if e.is_Pow:
            return self._power(e)
        name = type(e).__name__
        if name == "ExprCondPair":
            return 0  # both are there; the function that holds it takes them
        args = [] if name == "Piecewise" else [self._node(a) for a in e.args]
        if name in LIBRARY:
            return t.entry(LIBRARY[name], *args)
        make = _FUNCTIONS.get(name)
        if make is not None:
            return make(t, *args)
        if name == "Piecewise":
            value = t.number(math.nan)
            for part, condition in reversed(e.args):
                value = t.select(self._node(condition), self._node(part), value)
            return value
        if type(e).__name__ in COMPARISONS:
            return t.entry(COMPARISONS[type(e).__name__], *args)
        what = "function" if isinstance(e, sympy.Expr) else "condition"
        raise ParameterError(
            f"f: got the {what} {name}, wants elementary functions and comparisons; "
            "a Python or numba-compiled f may hold any"
        )

    def _product(self, e: Any) -> Node:
        t = self.tape
        above, below = None, None
        minus = e.args[0] == -1
        for factor in e.args[1:] if minus else e.args:
            turned = factor.is_Pow and factor.exp.is_Number and factor.exp.is_negative
            if turned and isinstance(self.made[id(factor)], int):
                one = self._raised(self._node(factor.base), -factor.exp)
                below = one if below is None else t.multiply(below, one)
            else:
                one = self._node(factor)
                above = one if above is None else t.multiply(above, one)
        value = t.number(1.0) if above is None else above
        value = value if below is None else t.divide(value, below)
        return t.negative(value) if minus else value

    def _power(self, e: Any) -> Node:
        t = self.tape
        if e.base is sympy.E:
            return t.entry("exp", self._node(e.exp))
        base = self._node(e.base)
        if e.exp.is_Number and e.exp.is_negative:
            simple = e.exp.is_Integer or (e.exp.is_Rational and e.exp.q == 2)
            if simple and abs(e.exp.p) <= LONGEST_POWER:
                return t.divide(t.number(1.0), self._raised(base, -e.exp))
        if e.exp.is_Number:
            return self._raised(base, e.exp)
        return t.entry("pow", base, self._node(e.exp))

    def _raised(self, base: Node, exponent: Any) -> Node:
        """A power whose exponent is a number."""
        t = self.tape
        if exponent.is_Integer and 0 < exponent <= LONGEST_POWER:
            return t.power(base, int(exponent))
        if exponent.is_Rational and exponent.q == 2 and 0 < exponent.p <= LONGEST_POWER:
            return t.power(t.entry("sqrt", base), int(exponent.p))
        return t.entry("pow", base, t.number(float(exponent)))


def _chosen(name: str) -> Callable[..., Node]:
    def make(t: Tape, first: Node, *others: Node) -> Node:
        for other in others:
            first = t.entry(name, first, other)
        return first

    return make


def _any(t: Tape, *conditions: Node) -> Node:
    one = t.number(1.0)
    found = t.number(0.0)
    for condition in conditions:
        found = t.select(condition, one, found)
    return found


def _all(t: Tape, *conditions: Node) -> Node:
    zero = t.number(0.0)
    found = t.number(1.0)
    for condition in conditions:
        found = t.select(condition, found, zero)
    return found


#: Functions that are made of several operations, or have names of their own.
_FUNCTIONS: dict[str, Callable[..., Node]] = {
    "atan2": lambda t, y, x: t.entry("atan2", y, x),
    "Abs": lambda t, a: t.size(a),
    "sign": lambda t, a: t.step(a, -1.0, 0.0),
    "Heaviside": lambda t, a, *_: t.step(a, 0.0, 0.5),
    "Max": _chosen("max"),
    "Min": _chosen("min"),
    "And": _all,
    "Or": _any,
    "Not": lambda t, a: t.select(a, t.number(0.0), t.number(1.0)),
}
