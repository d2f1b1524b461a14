"""The grammar of formulas: from text to nodes, without evaluating anything.

What a formula may be is what this parser accepts, and nothing else: numbers, names, ``+ - * /``,
``**`` or ``^``, calls of named functions, and conditions made of comparisons with ``& | ~``.
Precedence is Python's, but ``^`` is a power. Python's own parser is not asked, for it takes far
more, warns, and ends the process on some texts.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Sequence
from typing import Any, NamedTuple, NoReturn, Protocol

#: Deepest nesting of parentheses, calls and powers.
DEPTH = 64

_TOKEN = re.compile(
    r"\s*(?:(?P<number>(?:[0-9]+\.?[0-9]*|\.[0-9]+)(?:[eE][-+]?[0-9]+)?)"
    r"|(?P<name>[^\W\d]\w*)"
    r"|(?P<sign>\*\*|<=|>=|==|!=|[-+*/^()<>,&|~]))"
)
#: Signs of comparisons.
COMPARISONS = ("<", "<=", ">", ">=", "==", "!=")


class FormulaError(ValueError):
    """A text is no formula; the message says what is wrong with it."""


class Builder(Protocol):
    """What makes nodes; it refuses what cannot be, or is too large, by a `FormulaError`."""

    def number(self, text: str) -> Any:
        """A number as it is written."""

    def name(self, name: str) -> Any:
        """A symbol or constant."""

    def call(self, name: str, arguments: Sequence[Any]) -> Any:
        """A function of arguments; two values in parentheses are one argument, a tuple."""

    def add(self, terms: Sequence[Any]) -> Any:
        """A sum."""

    def multiply(self, factors: Sequence[Any]) -> Any:
        """A product."""

    def power(self, base: Any, exponent: Any) -> Any:
        """A power."""

    def compare(self, sign: str, left: Any, right: Any) -> Any:
        """A comparison."""

    def join(self, sign: str, conditions: Sequence[Any]) -> Any:
        """Conditions joined by ``&`` or ``|``, or one denied by ``~``."""


class Token(NamedTuple):
    """A part of a text."""

    kind: str | None  # None after the last one
    text: str
    place: int


def tokens(text: str) -> list[Token]:
    """The parts of a text: numbers, names and signs."""
    found: list[Token] = []
    place, end = 0, len(text.rstrip())
    while place < end:
        match = _TOKEN.match(text, place)
        if match is None:
            rest = text[place:].lstrip()
            at = text.index(rest, place) + 1
            attribute = re.match(r"\.([^\W\d]\w*)", rest)
            if attribute and found and found[-1].kind == "name":
                got = f"{found[-1].text}.{attribute[1]}"
                write = f"write {attribute[1]}" + "(...)" * rest[attribute.end() :].startswith("(")
                raise FormulaError(f"{got} at character {found[-1].place + 1}; {write}")
            raise FormulaError(f"{rest[:1]!r} at character {at}{_instead(rest)}")
        kind = str(match.lastgroup)
        found.append(Token(kind, match[kind], match.start(kind)))
        place = match.end()
    return [*found, Token(None, "", end)]


#: What other languages write, and what to write for it.
INSTEAD = {
    ".^": "write ^", ".*": "write *", "./": "write /", "\\": "LaTeX is not read",
    "=": "write the right-hand side alone; a comparison is ==",
}  # fmt: skip


def _instead(rest: str) -> str:
    """What to write for the sign that a text begins with, or nothing."""
    return next((f"; {hint}" for sign, hint in INSTEAD.items() if rest.startswith(sign)), "")


def parse(text: str, build: Builder) -> Any:
    """Read a formula; the builder makes its nodes from the leaves up."""
    return Parser(tokens(text), build).whole()


class Parser:
    """Reads tokens by precedence, from loose to tight."""

    def __init__(self, tokens: list[Token], build: Builder) -> None:
        self.tokens, self.build = tokens, build
        self.place = self.depth = 0

    @property
    def next(self) -> Token:
        """The token that comes next."""
        return self.tokens[self.place]

    def take(self, *signs: str) -> str | None:
        """Go past the next token if it is one of some signs, and return it."""
        token = self.next
        if token.kind == "sign" and token.text in signs:
            self.place += 1
            return token.text
        return None

    def fail(self, wants: str) -> NoReturn:
        """Refuse the next token."""
        token = self.next
        got = "its end" if token.kind is None else f"{token.text[:40]!r}"
        factor = wants.startswith("an operator") and (token.kind != "sign" or token.text == "(")
        hint = "; a product is written with *" if factor and token.kind else ""
        raise FormulaError(f"{got} at character {token.place + 1} where {wants} belongs{hint}")

    def deeper(self) -> None:
        """Count a level of parentheses and powers."""
        self.depth += 1
        if self.depth > DEPTH:
            raise FormulaError(f"more than {DEPTH} levels of parentheses and powers")

    def whole(self) -> Any:
        """The formula to its end."""
        result = self.condition()
        if self.next.kind is not None:
            self.fail("an operator")
        return result

    def condition(self, level: int = 0) -> Any:
        """A comparison (level 0), conditions joined by | (1) or by & (2), or a sum of terms (3)."""
        if level == 3:
            terms = [self.product(1)]
            while sign := self.take("+", "-"):
                terms.append(self.product(1 if sign == "+" else -1))
            return terms[0] if len(terms) == 1 else self.build.add(terms)
        left = self.condition(level + 1)
        signs = (COMPARISONS, ("|",), ("&",))[level]
        sign = self.take(*signs)
        if sign is None:
            return left
        if level == 0:
            return self.comparison(left, sign)
        conditions = [left, self.condition(level + 1)]
        while self.take(sign):
            conditions.append(self.condition(level + 1))
        return self.build.join(sign, conditions)

    def comparison(self, left: Any, sign: str | None) -> Any:
        """A chain of comparisons, ``0 < x < 1``, of which all must hold."""
        found = []
        while sign is not None:
            right = self.condition(1)
            found.append(self.build.compare(sign, left, right))
            left, sign = right, self.take(*COMPARISONS)
        return found[0] if len(found) == 1 else self.build.join("&", found)

    def signs(self) -> int:
        """Signs before a term or factor, as one."""
        sign = 1
        while found := self.take("+", "-"):
            sign = sign if found == "+" else -sign
        return sign

    def product(self, sign: int) -> Any:
        """A term of a sum, with its sign as one of the factors."""
        sign *= self.signs()
        factors = [self.power()]
        while operator := self.take("*", "/"):
            sign *= self.signs()
            factor = self.power()
            if operator == "/":
                factor = self.build.power(factor, self.build.number("-1"))
            factors.append(factor)
        if sign < 0:
            factors.insert(0, self.build.number("-1"))
        return factors[0] if len(factors) == 1 else self.build.multiply(factors)

    def power(self) -> Any:
        """A power, those of powers from the right."""
        if self.take("~"):
            self.deeper()
            denied = self.build.join("~", [self.power()])
            self.depth -= 1
            return denied
        base = self.primary()
        if not self.take("**", "^"):
            return base
        self.deeper()
        sign = self.signs()
        exponent = self.power()
        if sign < 0:
            exponent = self.build.multiply([self.build.number("-1"), exponent])
        self.depth -= 1
        return self.build.power(base, exponent)

    def primary(self) -> Any:
        """A number, a name, a call, or what stands in parentheses."""
        token = self.next
        if token.kind == "number":
            self.place += 1
            return self.build.number(token.text)
        if token.kind == "name":
            self.place += 1
            if self.take("("):
                return self.build.call(token.text, self.inside())
            return self.build.name(token.text)
        if not self.take("("):
            self.fail("a number, a name or a parenthesis")
        values = self.inside()
        if not 1 <= len(values) <= 2:
            self.place -= 1
            self.fail("a formula, or (value, condition) in a Piecewise,")
        return values[0] if len(values) == 1 else tuple(values)

    def inside(self) -> list[Any]:
        """What stands between parentheses, the first of which is taken already."""
        self.deeper()
        values = []
        while not self.take(")"):
            values.append(self.condition())
            if not self.take(",") and not (self.next.kind == "sign" and self.next.text == ")"):
                self.fail("an operator or a closing parenthesis")
        self.depth -= 1
        return values


class Quoting(Parser):
    """Reads formulas in which the text between the parentheses of one name is kept as it is.

    ``make`` makes a node of it.
    """

    def __init__(self, text: str, build: Builder, name: str, make: Callable[[str], Any]) -> None:
        super().__init__(tokens(text), build)
        self.text, self.name, self.make = text, name, make

    def primary(self) -> Any:
        """As of all formulas, or what stands behind the name."""
        named = self.next.text == self.name and self.tokens[self.place + 1].text == "("
        if not named:
            return super().primary()
        self.place += 2
        start, depth = self.next.place, 1
        while self.next.kind is not None:
            depth += {"(": 1, ")": -1}.get(self.next.text, 0)
            if depth == 0:
                break
            self.place += 1
        end = self.next.place
        if not self.take(")"):
            self.fail("a closing parenthesis")
        return self.make(self.text[start:end])
