"""Where formulas have kinks and jumps: at zeros of what their branches ask for."""

from __future__ import annotations

import functools
import math
import random
from collections.abc import Callable, Iterable, Iterator
from typing import Any

import numpy as np

from phasekit.arrays import Array
from phasekit.laws.formulas import symbols_of
from phasekit.laws.kept_formulas import KeptFormulas
from phasekit.laws.ladder import Trait

#: Places at which the branches of a formula are compared, and steps of Newton's method to each.
PLACES, STEPS = 8, 60
#: Places that are tried at most: a formula may have no value at many of them.
TRIALS = 64
#: Differences of two branches, and of their derivatives, relative to their size, that are no jump
#: and no kink: as where ``x/(exp(x) - 1)`` is written as 1 next to 0.
NO_JUMP, SAME = 1e-5, 1e-7
#: Of a function that jumps: the share of the difference over an interval, and of the values, that
#: stays however short it is; and the growth of the values towards a pole.
JUMP, ROUNDING, POLE = 0.01, 1e-9, 1e3
#: Part of a state's size within which a function is looked at; of its values that is no jump.
NEAR, SLIGHT = 1e-6, 1e-7
#: What is written in place of a jump.
SMOOTH = "tanh(v/width) in place of sign(v), (1 + tanh(x/width))/2 in place of Heaviside(x)"


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


@functools.lru_cache(maxsize=1024)
def jumps(formula: Any, moving: tuple[Any, ...]) -> bool:
    """Whether a formula has jumps as symbols of it move.

    >>> import sympy
    >>> v = sympy.symbols("v", real=True)
    >>> jumps(sympy.sign(v), (v,)), jumps(sympy.Abs(v) * v, (v,))
    (True, False)
    """
    import sympy as sp

    branched = formula.has(sp.Abs, sp.sign, sp.Heaviside, sp.Piecewise)
    return branched and bool(roughness(formula, moving) & Trait.JUMPING)


def any_jumps(formulas: Any, states: Iterable[str]) -> bool:
    """Whether some of formulas, which may be kept, jump as states change."""
    names = tuple(states)
    if isinstance(formulas, KeptFormulas):
        find = lambda: (any_jumps(formulas.expressions, names), ())  # noqa: E731
        return bool(formulas.answer(("jumps", names), find)[0])
    moving = tuple(symbols_of(names).values())
    return any(jumps(formula, moving) for formula in formulas)


def is_jump(
    along: Callable[[float], float], a: float, b: float, fa: float, fb: float, least: float = 0.0
) -> bool:
    """Whether a function jumps between two numbers, by more than is given.

    The interval is halved where more of the difference over it is, until no number lies between: of
    a continuous function nothing is left then.
    """
    least, most = max(least, JUMP * abs(fb - fa)), POLE * (abs(fa) + abs(fb))
    while max(least, ROUNDING * (abs(fa) + abs(fb))) < abs(fb - fa) < most:
        x = 0.5 * (a + b)
        if not a < x < b:
            return True
        fx = along(x)
        left = abs(fx - fa) > abs(fb - fx)
        a, b, fa, fb = (a, x, fa, fx) if left else (x, b, fx, fb)
    return False


def jump_beside(f: Callable[[Array], Array], x: Array, near: Array | float = 0.0) -> int | None:
    """The state along which a function jumps next to a place, or as near as that is; or None.

    >>> step = lambda x: np.sign(x - 1.0)
    >>> jump_beside(step, np.array([3.0, 1.0])), jump_beside(np.tanh, np.zeros(2))
    (1, None)
    """
    for i in range(len(x)):

        def values(place: float, i: int = i) -> Array:
            there = np.array(x, float)
            there[i] = place
            return np.asarray(f(there), float)

        size = max(abs(float(x[i])), 1e-3)
        around = max(NEAR * size, float(np.broadcast_to(near, len(x))[i]))
        a, b = float(x[i]) - around, float(x[i]) + around
        fa, fb, far = values(a), values(b), np.abs(values(float(x[i]) + size))
        for k in np.flatnonzero(np.abs(fb - fa) > SLIGHT * far).tolist():

            def value(place: float, k: int = k, f: Callable[[float], Array] = values) -> float:
                return float(f(place)[k])

            if is_jump(value, a, b, float(fa[k]), float(fb[k]), SLIGHT * float(far[k])):
                return i
    return None


def jumps_in_time(f: Callable[[float, Array], Array], t: float, x: Array, span: float) -> bool:
    """Whether a function of time and state jumps at a time, among times that span so much.

    >>> relay = lambda t, x: np.array([1e9 * (t > 2.0)])
    >>> [jumps_in_time(relay, t, np.zeros(1), 5.0) for t in (1.0, 2.0)]
    [False, True]
    """
    around = NEAR * max(abs(t), 1e-3 * span)
    a, b = t - around, t + around

    def along(k: int) -> Callable[[float], float]:
        return lambda time: float(f(time, x)[k])

    ends = np.stack([f(a, x), f(b, x)], axis=1).tolist()
    return any(is_jump(along(k), a, b, *pair) for k, pair in enumerate(ends))


def _branches(formula: Any) -> Iterator[tuple[Any, Any, Any]]:
    """What decides between two branches by its sign, and the formula on both sides of its zero.

    What asks for the same, as ``x > 1`` and ``sign(1 - x)``, is decided at once.
    """
    import sympy as sp

    sides: dict[Any, tuple[dict[Any, Any], dict[Any, Any], dict[Any, Any]]] = {}
    for part in formula.atoms(sp.Abs, sp.sign, sp.core.relational.Relational):
        related = isinstance(part, sp.core.relational.Relational)
        border = sp.expand(part.lhs - part.rhs if related else part.args[0])
        if not border.free_symbols:
            continue
        border = border.primitive()[1]
        turned = border.could_extract_minus_sign()
        border = sp.expand(-border) if turned else border
        signs = (-1, 1) if turned else (1, -1)
        after, before, there = sides.setdefault(border, ({}, {}, {}))
        for side, sign in ((after, signs[0]), (before, signs[1]), (there, 0)):
            if related:
                side[part] = sp.sympify(bool(part.func(sign, 0)))
            elif sign:
                side[part] = sp.Integer(sign) * (1 if part.func is sp.sign else part.args[0])
    for border, (after, before, there) in sides.items():
        one, other = formula.xreplace(after), formula.xreplace(before)
        yield border, one, other
        if any(isinstance(part, (sp.Eq, sp.Ne)) for part in there):
            yield border, one, formula.xreplace(there).xreplace(after)


def _compiled(symbols: Any, formulas: Any) -> Callable[..., list[float]]:
    """A function of numbers, by mpmath where the standard library lacks a function."""
    import sympy as sp

    formulas = [one.replace(sp.DiracDelta, lambda *_: sp.Integer(0)) for one in formulas]
    called = {type(part).__name__ for one in formulas for part in one.atoms(sp.Function)}
    lacks = called - {*dir(math), "Abs", "sign", "Piecewise"}
    found: Callable[..., list[float]] = sp.lambdify(
        symbols, formulas, "mpmath" if lacks else "math"
    )
    return found


def _size(formulas: Callable[..., list[float]], at: list[float]) -> float:
    """Size of formulas at a place; 1 where they have no value, or are 0."""
    try:
        size = sum(abs(float(value)) for value in formulas(*at))
    except (ArithmeticError, ValueError, TypeError, NameError):
        return 1.0
    return size if 0.0 < size < math.inf else 1.0


def _between(border: Any, one: Any, other: Any, states: set[Any]) -> Trait:
    """What happens where a border is crossed, at some places of it."""
    import sympy as sp

    chance, found = random.Random(1), Trait(0)
    symbols = sorted(one.free_symbols | other.free_symbols | border.free_symbols, key=str)
    ways = []
    for across in sorted(border.free_symbols & states, key=str):
        newton = _compiled(symbols, [border, border.diff(across)])
        slopes = _compiled(symbols, [one.diff(across), other.diff(across)])
        ways.append((symbols.index(across), newton, slopes))
    apart = _compiled(symbols, [one, other])
    met, known = 0, 0
    # Whether branches meet at a border may depend on other conditions, so on the place.
    enough = TRIALS if one.has(sp.Piecewise) or other.has(sp.Piecewise) else PLACES
    for trial in range(TRIALS):
        if known == enough:
            break
        place, newton, slopes = ways[trial % len(ways)]
        at = [chance.uniform(0.3, 1.7) for _ in symbols]
        at[place] = chance.uniform(-3.0, 3.0)
        if trial >= PLACES:  # where it has no value, or is not reached, far from 1 and below 0
            sizes = (10.0 ** chance.uniform(-1.0, 2.0) for _ in symbols)
            at = [chance.choice((-1.0, 1.0)) * size for size in sizes]
        # Branches that meet in 0 differ there by rounding of what they are elsewhere.
        aside, turned = _size(apart, at), _size(slopes, at)
        try:
            for _ in range(STEPS):
                value, rate = newton(*at)
                at[place] -= float(value / rate)
            if abs(newton(*at)[0]) > 1e-9:
                continue
            met += 1
            a, b = map(float, apart(*at))
            if NO_JUMP * (abs(a) + abs(b) + 1e-3 * aside) < abs(a - b) < math.inf:
                found |= Trait.JUMPING
                known += 1
                continue
            da, db = map(float, slopes(*at))
        except (ArithmeticError, ValueError, TypeError, NameError):
            continue
        if not all(map(math.isfinite, (a, b, da, db))):
            continue
        known += 1
        if abs(da - db) > SAME * (abs(da) + abs(db) + 1e-3 * turned):
            found |= Trait.KINKED
    # Where a branch or its derivative has no value at the border, as that of a root, it has a kink.
    return found if known or not met else Trait.KINKED
