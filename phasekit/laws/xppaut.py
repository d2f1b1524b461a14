"""The formulas of XPPAUT's files: their own grammar, and the same nodes as all formulas.

They differ from ours: letters are not told apart by case, powers of powers are read from the left,
comparisons are numbers, 0 or 1, and bind more tightly than ``&`` and ``|``, and there are
``if(..)then(..)else(..)`` and ``sum(..,..)of(..)``.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Sequence
from typing import Any

from phasekit.laws.grammar import COMPARISONS, Builder, FormulaError, Parser, tokens

#: Functions whose names or arguments differ from ours.
RENAMED = {"ln": "log", "lgamma": "loggamma"}
#: Functions of which a flow cannot be made, and why.
REFUSED = {
    "delay": "a delay: rates depend on the present state alone",
    "del_shft": "a delay: rates depend on the present state alone",
    "int": "an integral over the past: rates depend on the present state alone",
    "ran": "random numbers; 'wiener' is noise",
    "normal": "random numbers; 'wiener' is noise",
    "flr": "a function with jumps at all whole numbers",
    "ceil": "a function with jumps at all whole numbers",
    "mod": "a function with jumps at all multiples",
    "hom_bcs": "a condition of XPPAUT's own",
}
#: In place of the index i' of sums.
INDEX = "sum_index"
#: Most terms of a sum.
TERMS = 1000


def parser(shift: Callable[[str, int], str]) -> Callable[[str, Builder], Any]:
    """A function that reads a formula as XPPAUT does.

    Parameters
    ----------
    shift : callable
        The name of the state so many places after another.
    """
    return lambda text, build: _Xppaut(text, build, shift).whole()


def _is_condition(node: Any) -> bool:
    from sympy import Expr
    from sympy.logic.boolalg import Boolean

    return isinstance(node, Boolean) and not isinstance(node, Expr)


class _Values:
    """Makes nodes as another builder does, of numbers: conditions among them are 0 or 1."""

    def __init__(self, build: Any) -> None:
        self.build = build

    def __getattr__(self, name: str) -> Any:
        return getattr(self.build, name)

    def value(self, node: Any) -> Any:
        """A condition as 0 or 1."""
        if not _is_condition(node):
            return node
        one, zero = self.number("1"), self.number("0")
        return self.call("Piecewise", [(one, node), (zero, self.name("True"))])

    def add(self, terms: Sequence[Any]) -> Any:
        return self.build.add([self.value(term) for term in terms])

    def multiply(self, factors: Sequence[Any]) -> Any:
        return self.build.multiply([self.value(factor) for factor in factors])

    def power(self, base: Any, exponent: Any) -> Any:
        return self.build.power(self.value(base), self.value(exponent))

    def compare(self, sign: str, left: Any, right: Any) -> Any:
        return self.build.compare(sign, self.value(left), self.value(right))


class _Xppaut(Parser):
    build: _Values

    def __init__(self, text: str, build: Builder, shift: Callable[[str, int], str]) -> None:
        if found := re.search(r"[#{}\[\]$]", text):
            raise FormulaError(f"{found[0]!r} at character {found.start() + 1}")
        super().__init__(tokens(re.sub(r"\bi'", INDEX, text.lower())), _Values(build))
        self.shift = shift
        self.index: int | None = None

    def whole(self) -> Any:
        result = self.build.value(self.condition())
        if self.next.kind is not None:
            self.fail("an operator")
        return result

    def truth(self, node: Any) -> Any:
        """A number as the condition that it is not 0."""
        if _is_condition(node):
            return node
        return self.build.compare("!=", node, self.build.number("0"))

    # ------------------------------------------------------------------ from loose to tight

    def condition(self, level: int = 0) -> Any:
        """Conditions joined by | (level 0) or by & (1), or comparisons from the left (2)."""
        if level == 2:
            return self.comparisons()
        sign, found = "|&"[level], self.condition(level + 1)
        while self.take(sign):
            found = self.build.join(
                sign, [self.truth(found), self.truth(self.condition(level + 1))]
            )
        return found

    def comparisons(self) -> Any:
        left = super().condition(3)
        while sign := self.take(*COMPARISONS):
            left = self.build.compare(sign, left, super().condition(3))
        return left

    def power(self) -> Any:
        """Powers of powers from the left: 2^3^2 is 64."""
        found = self.primary()
        while self.take("**", "^"):
            sign, exponent = self.signs(), self.primary()
            if sign < 0:
                exponent = self.build.multiply([self.build.number("-1"), exponent])
            found = self.build.power(found, exponent)
        return found

    def primary(self) -> Any:
        token = self.next
        if token.kind == "name":
            self.place += 1
            if token.text == INDEX:
                if self.index is None:
                    raise FormulaError("i' outside of a sum")
                return self.build.number(str(self.index))
            special = {"if": self.choice, "sum": self.series, "shift": self.shifted}
            if self.next.text == "(" and self.next.kind == "sign":
                if token.text in special:
                    return special[token.text]()
                self.take("(")
                return self.function(token.text, [self.build.value(x) for x in self.inside()])
            return self.build.name(token.text)
        if token.kind == "number" or self.next.text != "(":
            return super().primary()
        return self.parenthesis()

    def parenthesis(self) -> Any:
        """What stands in a pair of parentheses."""
        if not self.take("("):
            self.fail("a parenthesis")
        found = self.inside()
        if len(found) != 1:
            self.place -= 1
            self.fail("a formula")
        return found[0]

    # ------------------------------------------------------------------ functions

    def function(self, name: str, given: Sequence[Any]) -> Any:
        known = getattr(self.build, "symbols", {})
        if name in REFUSED and name not in known:
            raise FormulaError(f"{name}(...), {REFUSED[name]}")
        if name not in known:
            if name == "heav" and len(given) == 1:
                return self.build.value(self.build.compare(">=", given[0], self.build.number("0")))
            if name == "not" and len(given) == 1:
                return self.build.value(self.build.join("~", [self.truth(given[0])]))
            if name == "log10" and len(given) == 1:
                return self.build.call("log", [*given, self.build.number("10")])
        return self.build.call(RENAMED.get(name, name) if name not in known else name, given)

    def word(self, word: str) -> None:
        if self.next.text != word:
            self.fail(f"{word}(...)")
        self.place += 1

    def choice(self) -> Any:
        """if(condition)then(value)else(value)."""
        condition = self.truth(self.parenthesis())
        self.word("then")
        first = self.build.value(self.parenthesis())
        self.word("else")
        second = self.build.value(self.parenthesis())
        pairs = [(first, condition), (second, self.build.name("True"))]
        return self.build.call("Piecewise", pairs)

    def series(self) -> Any:
        """sum(first, last)of(formula of i')."""
        self.take("(")
        limits = self.inside()
        if len(limits) != 2:
            raise FormulaError("sum(...) of other than two limits; write sum(0,3)of(...)")
        first, last = (self.whole_number(limit, "a limit of a sum") for limit in limits)
        self.word("of")
        if last - first >= TERMS:
            raise FormulaError(f"a sum of {last - first + 1} terms; at most {TERMS}")
        if self.index is not None:
            raise FormulaError("a sum within a sum")
        begun, terms = self.place, []
        for self.index in range(first, last + 1):
            self.place = begun
            terms.append(self.parenthesis())
        self.index = None
        if not terms:
            raise FormulaError(f"a sum from {first} to {last}, of nothing")
        return self.build.add(terms)

    def shifted(self) -> Any:
        """shift(state, number): the state so many places after it."""
        self.take("(")
        name = self.next.text
        self.place += 1
        if not self.take(","):
            raise FormulaError("shift(...) of other than a state and a number")
        by = self.whole_number(self.condition(), "the second argument of shift")
        if not self.take(")"):
            self.fail("a closing parenthesis")
        return self.build.name(self.shift(name, by))

    def whole_number(self, node: Any, what: str) -> int:
        """A constant as a whole number, cut as XPPAUT cuts it."""
        node = self.build.value(node)
        if not node.is_number:
            raise FormulaError(f"{node} as {what}, which has to be a number")
        return int(node)
