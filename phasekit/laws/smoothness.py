"""Where formulas have kinks and jumps: at zeros of what their branches ask for."""

from __future__ import annotations

import random
from collections.abc import Iterable, Iterator
from typing import Any

from phasekit.laws.ladder import Trait

#: Places at which the branches of a formula are compared, and steps of Newton's method to each.
PLACES, STEPS = 8, 60
#: Difference of two branches, relative to their size, that is rounding.
SAME = 1e-7


def roughness(formula: Any, moving: Iterable[Any]) -> Trait:
    """Whether a formula has jumps or kinks as symbols of it move; no trait where it is smooth.

    A function with a continuous derivative counts as smooth, as ``Abs(v)*v`` is.

    >>> import sympy
    >>> x, v, k = sympy.symbols("x v k", real=True)
    >>> roughness(-k * sympy.sign(v), (x, v)), roughness(k * sympy.Max(x - 1, 0), (x, v))
    (<Trait.JUMPING: ...>, <Trait.KINKED: ...>)
    >>> bool(roughness(-k * sympy.Abs(v) * v + sympy.tanh(x), (x, v)))
    False
    """
    import sympy as sp

    found, states = Trait(0), set(moving)
    formula = formula.rewrite(sp.Heaviside, sp.sign) if formula.has(sp.Heaviside) else formula
    if formula.has(sp.Max, sp.Min):
        formula = formula.rewrite((sp.Max, sp.Min), sp.Abs)
    for border, one, other in _branches(formula):
        if border.free_symbols & states:
            found |= _between(border, one, other, states)
    return found


def _branches(formula: Any) -> Iterator[tuple[Any, Any, Any]]:
    """What decides between two branches by its sign, and the formula on both sides."""
    import sympy as sp

    for part in formula.atoms(sp.Abs):
        inner = part.args[0]
        yield inner, formula.xreplace({part: inner}), formula.xreplace({part: -inner})
    for part in formula.atoms(sp.sign):
        one, other = (formula.xreplace({part: sp.Integer(s)}) for s in (1, -1))
        yield part.args[0], one, other
    for part in formula.atoms(sp.Piecewise):
        for k in range(len(part.args) - 1):
            for relation in part.args[k].cond.atoms(sp.core.relational.Relational):
                one, other = (
                    formula.xreplace({part: piece.expr}) for piece in part.args[k : k + 2]
                )
                yield relation.lhs - relation.rhs, one, other


def _between(border: Any, one: Any, other: Any, states: set[Any]) -> Trait:
    """What happens where a border is crossed, at some places of it."""
    import sympy as sp

    chance, found = random.Random(1), Trait(0)
    symbols = sorted(one.free_symbols | other.free_symbols | border.free_symbols, key=str)
    across = sorted(border.free_symbols & states, key=str)[0]
    slope = border.diff(across)
    apart = sp.lambdify(symbols, [one, other, one.diff(across), other.diff(across)], "math")
    newton = sp.lambdify(symbols, [border, slope], "math")
    place, met, known = symbols.index(across), 0, 0
    for _ in range(PLACES):
        at = [chance.uniform(0.3, 1.7) for _ in symbols]
        at[place] = chance.uniform(-3.0, 3.0)
        try:
            for _ in range(STEPS):
                value, rate = newton(*at)
                at[place] -= value / rate
            if abs(newton(*at)[0]) > 1e-9:
                continue
            met += 1
            a, b, da, db = map(float, apart(*at))
        except (ArithmeticError, ValueError, TypeError):
            continue
        known += 1
        if abs(a - b) > SAME * (abs(a) + abs(b) + 1e-3):
            found |= Trait.JUMPING
        elif abs(da - db) > SAME * (abs(da) + abs(db) + 1e-3):
            found |= Trait.KINKED
    # Where a branch or its derivative has no value at the border, as that of a root, it has a kink.
    return found if known or not met else Trait.KINKED
