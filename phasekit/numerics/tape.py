"""Formulas as a list of operations, each written once, and the derivatives of such lists.

sympy's derivative of a formula is a tree in which what terms share stands many times, and looking
for it again takes far longer than computing it. Here a derivative is made operation by operation
of what is there already, so that it is a few times as long as the formula, whatever its shape
([Griewank2008] chapters 3 and 4). An operation is known by what it does and to which entries: what
is equal is made once.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import Any

from phasekit.errors import ParameterError
from phasekit.numerics.machine_code import COMPARISONS

Node = int  # the place of an entry
_TWO_OVER_ROOT_PI = 2.0 / math.sqrt(math.pi)
#: Operations whose value may jump: of these the size is all that rounding is measured by.
_KINKED = {"abs", "max", "min", "select", *COMPARISONS.values()}


class Tape:
    """A list of operations: entries are made by its methods, and named by their places.

    Attributes
    ----------
    operations : list
        Of each entry what it does and the entries that it takes: ``("x", which, place)`` for an
        argument, ``("number", value)``, else a name and entries.
    """

    def __init__(self, inputs: Mapping[Any, tuple[int, int]]) -> None:
        """Take the symbols that are arguments: which array, and their places in it."""
        self.operations: list[tuple[Any, ...]] = []
        self.inputs = inputs
        self._places: dict[tuple[Any, ...], Node] = {}
        self._sizes: dict[Node, Node] = {}  # entries and the sums of the sizes of their terms
        self._products: set[Node] = set()  # of arguments, which hold no sums

    def entry(self, *operation: Any) -> Node:
        """The place of an operation, which is made if it is new."""
        place = self._places.get(operation)
        if place is None:
            place = self._places[operation] = len(self.operations)
            self.operations.append(operation)
        return place

    # -- arithmetic, in which zeros and ones vanish ------------------------------------------------

    def number(self, value: float) -> Node:
        """A constant."""
        return self.entry("number", float(value) + 0.0)

    def argument(self, which: int, place: int) -> Node:
        """An entry of an array of arguments."""
        return self.entry("x", which, place)

    def value(self, a: Node) -> float | None:
        """The number that an entry is, if it is one."""
        operation = self.operations[a]
        return operation[1] if operation[0] == "number" else None

    def add(self, a: Node, b: Node) -> Node:
        """The sum."""
        x, y = self.value(a), self.value(b)
        if x == 0.0:
            return b
        if y == 0.0:
            return a
        if x is not None and y is not None:
            return self.number(x + y)
        if self.operations[b][0] == "neg":
            return self.subtract(a, self.operations[b][1])
        if self.operations[a][0] == "neg":
            return self.subtract(b, self.operations[a][1])
        return self.entry("add", min(a, b), max(a, b))

    def subtract(self, a: Node, b: Node) -> Node:
        """The difference."""
        x, y = self.value(a), self.value(b)
        if y == 0.0:
            return a
        if x == 0.0:
            return self.negative(b)
        if x is not None and y is not None:
            return self.number(x - y)
        if self.operations[b][0] == "neg":
            return self.add(a, self.operations[b][1])
        return self.entry("sub", a, b)

    def negative(self, a: Node) -> Node:
        """The negative."""
        x = self.value(a)
        if x is not None:
            return self.number(-x)
        operation = self.operations[a]
        return int(operation[1]) if operation[0] == "neg" else self.entry("neg", a)

    def multiply(self, a: Node, b: Node) -> Node:
        """The product."""
        x, y = self.value(a), self.value(b)
        if x is not None and y is not None:
            return self.number(x * y)
        for known, other in ((x, b), (y, a)):
            if known == 0.0:
                return self.number(0.0)
            if known == 1.0:
                return other
            if known == -1.0:
                return self.negative(other)
        if self.operations[a][0] == "neg":
            return self.negative(self.multiply(self.operations[a][1], b))
        if self.operations[b][0] == "neg":
            return self.negative(self.multiply(a, self.operations[b][1]))
        return self.entry("mul", min(a, b), max(a, b))

    def divide(self, a: Node, b: Node) -> Node:
        """The quotient."""
        x, y = self.value(a), self.value(b)
        if x == 0.0 or y == 1.0:
            return a
        if x is not None and y is not None and y != 0.0:
            return self.number(x / y)
        return self.entry("div", a, b)

    def power(self, a: Node, times: int) -> Node:
        """A whole power > 0, by squares."""
        result = None
        while True:
            if times & 1:
                result = a if result is None else self.multiply(result, a)
            times >>= 1
            if not times:
                assert result is not None
                return result
            a = self.multiply(a, a)

    def select(self, condition: Node, a: Node, b: Node) -> Node:
        """One of two values; a condition holds where it is not zero."""
        known = self.value(condition)
        if known is not None:
            return a if known else b
        return a if a == b else self.entry("select", condition, a, b)

    def step(self, a: Node, below: float, there: float) -> Node:
        """A number where a is negative, another where it is 0, and 1 where it is positive."""
        zero = self.number(0.0)
        other = self.select(self.entry("<", a, zero), self.number(below), self.number(there))
        return self.select(self.entry(">", a, zero), self.number(1.0), other)

    # -- derivatives -------------------------------------------------------------------------------

    def needed(self, nodes: Iterable[Node]) -> list[Node]:
        """All entries that some are made of, these included, in the order of the list."""
        found: set[Node] = set()
        left = list(nodes)
        while left:
            node = left.pop()
            if node not in found:
                found.add(node)
                left += arguments(self.operations[node])
        return sorted(found)

    def tangent(self, nodes: Sequence[Node], along: Mapping[Node, Node]) -> list[Node]:
        """The derivatives of entries along a direction: arguments, and how these change."""
        zero = self.number(0.0)
        slopes: dict[Node, Node] = dict(along)
        for node in self.needed(nodes):
            operation = self.operations[node]
            if node in slopes or not any(one in slopes for one in arguments(operation)):
                continue
            if operation[0] == "select":
                _, condition, a, b = operation
                slope = self.select(condition, slopes.get(a, zero), slopes.get(b, zero))
            else:
                slope = zero
                for one, partial in self._partials(node, slopes):
                    slope = self.add(slope, self.multiply(partial, slopes[one]))
            if slope != zero:
                slopes[node] = slope
        return [slopes.get(node, zero) for node in nodes]

    def gradient(self, node: Node, unknowns: Sequence[Node]) -> dict[int, Node]:
        """The derivatives of an entry by arguments: those that do not vanish, by their places."""
        needed = self.needed([node])
        zero, one = self.number(0.0), self.number(1.0)
        moving = set(unknowns)
        for k in needed:
            operation = self.operations[k]
            if any(a in moving for a in arguments(operation)):
                moving.add(k)
            if operation[0] == "select" and not moving.isdisjoint(operation[2:]):
                # Backward, what is not selected would be multiplied by 0, which ends no NaN.
                found = {j: self.tangent([node], {u: one})[0] for j, u in enumerate(unknowns)}
                return {j: slope for j, slope in found.items() if slope != zero}
        weights: dict[Node, Node] = {node: one}
        for k in reversed(needed):
            weight = weights.get(k)
            if weight is None or k not in moving:
                continue
            for a, partial in self._partials(k, moving):
                part = self.multiply(weight, partial)
                before = weights.get(a)
                weights[a] = part if before is None else self.add(before, part)
        found = {j: weights.get(u, zero) for j, u in enumerate(unknowns)}
        return {j: slope for j, slope in found.items() if slope != zero}

    def _partials(self, node: Node, moving: Any) -> list[tuple[Node, Node]]:
        """The entries that an entry takes and its derivatives by them, of those that move."""
        name, *args = self.operations[node]
        if name in ("x", "number") or name in COMPARISONS.values():
            return []
        rules: Any = _SLOPES.get(name)
        if rules is None:
            raise ParameterError(
                f"f: got the function {name}, whose derivative has no machine code; "
                "a Python or numba-compiled f may hold any"
            )
        return [
            (a, rule(self, node, *args)) for a, rule in zip(args, rules, strict=True) if a in moving
        ]

    # -- rounding ----------------------------------------------------------------------------------

    def magnitude(self, node: Node) -> Node:
        """An entry with the sizes of all terms of its sums added up, those inside functions too."""
        known = self._sizes
        for k in self.needed([node]):
            if k in known:
                continue
            operation = self.operations[k]
            if self.atom(k) or (
                operation[0] in ("mul", "div", "neg", "sqrt")
                and self._products.issuperset(operation[1:])
            ):
                self._products.add(k)
            known[k] = self._magnitude(k)
        return known[node]

    def _magnitude(self, node: Node) -> Node:
        name, *args = self.operations[node]
        if name in ("x", "number") or name in _KINKED:
            return self.size(node)
        inner = [self._sizes[a] for a in args]
        if name in ("add", "sub"):
            return self.add(*inner)
        if name == "mul":
            return self.multiply(*inner)
        if name == "neg":
            return inner[0]
        if name == "div":
            one = self.number(1.0)
            inverse = self.divide(one, args[1])
            total = self.size(inverse)
            if args[1] not in self._products:
                slope = self.size(self.divide(inverse, args[1]))
                total = self.add(total, self.multiply(slope, inner[1]))
            return self.multiply(inner[0], total)
        total = self.size(node)
        if name not in _SLOPES:
            return total
        moving = {a for a in args if not self.atom(a)}
        for a, slope in self._partials(node, moving):
            total = self.add(total, self.multiply(self.size(slope), self._sizes[a]))
        return total

    def size(self, a: Node) -> Node:
        """The absolute value."""
        x = self.value(a)
        if x is not None:
            return self.number(abs(x))
        name, *args = self.operations[a]
        if name == "abs":
            return a
        return self.size(args[0]) if name == "neg" else self.entry("abs", a)

    def atom(self, a: Node) -> bool:
        """Whether an entry is an argument or a number."""
        return self.operations[a][0] in ("x", "number")


def arguments(operation: tuple[Any, ...]) -> tuple[Node, ...]:
    """The entries that an operation takes."""
    return () if operation[0] in ("x", "number") else operation[1:]


def _one_over(t: Tape, a: Node) -> Node:
    return t.divide(t.number(1.0), a)


def _one_less(t: Tape, a: Node) -> Node:
    return t.subtract(t.number(1.0), t.multiply(a, a))


def _one_more(t: Tape, a: Node) -> Node:
    return t.add(t.number(1.0), t.multiply(a, a))


def _acosh(t: Tape, v: Node, a: Node) -> Node:
    one = t.number(1.0)
    roots = (t.entry("sqrt", t.subtract(a, one)), t.entry("sqrt", t.add(a, one)))
    return _one_over(t, t.multiply(*roots))


def _bell(t: Tape, a: Node) -> Node:
    return t.multiply(t.number(_TWO_OVER_ROOT_PI), t.entry("exp", t.negative(t.multiply(a, a))))


def _base(t: Tape, v: Node, a: Node, b: Node) -> Node:
    return t.multiply(b, t.entry("pow", a, t.subtract(b, t.number(1.0))))


def _radius(t: Tape, y: Node, x: Node) -> Node:
    return t.add(t.multiply(x, x), t.multiply(y, y))


#: Of each operation its derivatives by the entries that it takes; v is what it gives.
_SLOPES: dict[str, tuple[Callable[..., Node], ...]] = {
    "add": (lambda t, v, a, b: t.number(1.0), lambda t, v, a, b: t.number(1.0)),
    "sub": (lambda t, v, a, b: t.number(1.0), lambda t, v, a, b: t.number(-1.0)),
    "neg": (lambda t, v, a: t.number(-1.0),),
    "mul": (lambda t, v, a, b: b, lambda t, v, a, b: a),
    "div": (
        lambda t, v, a, b: _one_over(t, b),
        lambda t, v, a, b: t.negative(t.divide(v, b)),
    ),
    "sqrt": (lambda t, v, a: t.divide(t.number(0.5), v),),
    "pow": (_base, lambda t, v, a, b: t.multiply(v, t.entry("log", a))),
    "exp": (lambda t, v, a: v,),
    "log": (lambda t, v, a: _one_over(t, a),),
    "sin": (lambda t, v, a: t.entry("cos", a),),
    "cos": (lambda t, v, a: t.negative(t.entry("sin", a)),),
    "tan": (lambda t, v, a: _one_more(t, v),),
    "asin": (lambda t, v, a: _one_over(t, t.entry("sqrt", _one_less(t, a))),),
    "acos": (lambda t, v, a: t.negative(_one_over(t, t.entry("sqrt", _one_less(t, a)))),),
    "atan": (lambda t, v, a: _one_over(t, _one_more(t, a)),),
    "sinh": (lambda t, v, a: t.entry("cosh", a),),
    "cosh": (lambda t, v, a: t.entry("sinh", a),),
    "tanh": (lambda t, v, a: _one_less(t, v),),
    "asinh": (lambda t, v, a: _one_over(t, t.entry("sqrt", _one_more(t, a))),),
    "acosh": (_acosh,),
    "atanh": (lambda t, v, a: _one_over(t, _one_less(t, a)),),
    "erf": (lambda t, v, a: _bell(t, a),),
    "erfc": (lambda t, v, a: t.negative(_bell(t, a)),),
    "atan2": (
        lambda t, v, y, x: t.divide(x, _radius(t, y, x)),
        lambda t, v, y, x: t.negative(t.divide(y, _radius(t, y, x))),
    ),
    "abs": (lambda t, v, a: t.step(a, -1.0, 0.0),),
    "max": (
        lambda t, v, a, b: t.step(t.subtract(a, b), 0.0, 0.5),
        lambda t, v, a, b: t.step(t.subtract(b, a), 0.0, 0.5),
    ),
    "min": (
        lambda t, v, a, b: t.step(t.subtract(b, a), 0.0, 0.5),
        lambda t, v, a, b: t.step(t.subtract(a, b), 0.0, 0.5),
    ),
}  # fmt: skip
