"""Equations with the same zeros of which as many as can be are affine in the states.

Rates share terms: what one substance loses another one gains. Intervals do not see that such terms
cancel, so that zeros of the rates by turns look as if they were zeros of all of them.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

from phasekit.numerics.later import later

if TYPE_CHECKING:
    import sympy as sp
else:
    sp = later("sympy")

#: Operations of formulas, or terms of them without brackets, beyond which they stay as they are.
LONG = 400


def affine_rows(f: Sequence[Any], states: Sequence[Any], values: Mapping[Any, float]) -> list[Any]:
    """As many formulas with the same zeros, some of them sums of the given ones.

    A sum stands for the last of its formulas that has a part in it, where all that is not affine
    in the states cancels; values are those of the symbols that are numbers, taken exactly.
    """
    rows = list(f)
    if len(f) < 2 or sum(sp.count_ops(one) for one in f) > LONG:
        return rows
    if sum(_spread(one)[1] for one in f) > LONG:
        return rows
    exact = {symbol: sp.Rational(value) for symbol, value in values.items()}
    spread = [sp.expand(_exact(one).xreplace(exact)) for one in f]
    terms: dict[Any, list[Any]] = {}
    for i, one in enumerate(spread):
        for term in sp.Add.make_args(one):
            number, rest = term.as_coeff_Mul()
            _, moving = rest.as_independent(*states, as_Add=False)
            if moving != 1 and moving not in states:
                terms.setdefault(rest, [0] * len(f))[i] += number
    if not terms:
        return rows
    weights = sp.Matrix([list(row) for row in terms.values()]).nullspace()
    if not weights or len(weights) == len(f):
        return rows
    # From the last formula on, each sum has one of its own.
    free, places = sp.Matrix([list(w)[::-1] for w in weights]).rref()
    for row, place in enumerate(places):
        own = len(f) - 1 - place
        total = sum(w * one for w, one in zip(list(free.row(row))[::-1], spread, strict=True))
        rows[own] = sp.expand(total)
    return rows


def _spread(e: Any) -> tuple[int, int]:
    """How many terms a formula has at most without brackets, and it or any part of it."""
    parts = [_spread(part) for part in e.args]
    terms, most = 1, max((number for _, number in parts), default=1)
    if e.is_Add:
        terms = sum(number for number, _ in parts)
    elif e.is_Mul:
        terms = math.prod(number for number, _ in parts)
    elif e.is_Pow and e.exp.is_Number and e.exp.is_finite:
        power = abs(int(e.exp))
        spread = math.comb(parts[0][0] + power - 1, power)
        terms, most = spread if e.exp.is_positive else 1, max(most, spread)
    return terms, max(most, terms)


def _exact(expression: Any) -> Any:
    """A formula whose decimal numbers are the doubles that they are."""
    return expression.xreplace({one: sp.Rational(one) for one in expression.atoms(sp.Float)})
