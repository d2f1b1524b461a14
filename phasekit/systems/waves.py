"""The period of formulas in time, where time enters through sines and cosines alone."""

from __future__ import annotations

import cmath
import math
from collections.abc import Iterable
from fractions import Fraction
from typing import Any

#: Largest whole numbers whose ratio two frequencies may have.
MOST = 64
#: Part of its size by which a formula that repeats itself may differ.
SAME = 1e-9
#: Rounding of a number of turns in a period that is a double.
TURN = 8.0 * 2.0**-52


def period_in_time(formulas: Iterable[Any], t: Any) -> Any:
    """The common period of formulas in a symbol; None where none is found.

    >>> import sympy
    >>> t, w = sympy.symbols("t w", real=True)
    >>> period_in_time([sympy.sin(w * t), sympy.cos(3 * w * t / 2) ** 2], t)
    2*pi/w
    >>> period_in_time([sympy.exp(-t)], t)
    """
    import sympy as sp

    rates: list[Any] = []
    queue = [one for one in formulas if t in one.free_symbols]
    while queue:
        node = queue.pop()
        if node == t:
            return None
        even = node.is_Pow and node.exp.is_Integer and node.exp % 2 == 0
        wave = node.base if even else node
        if wave.func in (sp.sin, sp.cos):
            rate = wave.args[0].diff(t) * (2 if even else 1)
            if t not in rate.free_symbols and rate != 0:
                rates.append(rate)
                continue
        queue += [part for part in node.args if t in part.free_symbols]
    if not rates:
        return None
    ratios = [_ratio(rate / rates[0]) for rate in rates]
    if any(ratio is None for ratio in ratios):
        return None
    known = [abs(ratio) for ratio in ratios if ratio is not None]
    below = math.lcm(*(ratio.denominator for ratio in known))
    greatest = Fraction(math.gcd(*(int(ratio * below) for ratio in known)), below)
    slowest = rates[0] * sp.Rational(greatest.numerator, greatest.denominator)
    if slowest.is_number and slowest < 0 or slowest.could_extract_minus_sign():
        slowest = -slowest
    return 2 * sp.pi / slowest


def _ratio(ratio: Any) -> Fraction | None:
    """A ratio of frequencies as a fraction of small numbers."""
    ratio = ratio.cancel() if not ratio.is_number else ratio
    if not ratio.is_number:
        return None
    value = float(ratio)
    near = Fraction(value).limit_denominator(MOST)
    is_near = near != 0 and abs(float(near) / value - 1.0) < 1e-12
    return near if is_near and near.numerator <= MOST else None


def least_period(period: Any, f: Any, time: str | None) -> Any:
    """The part of a period after which the circular functions in formulas are the same again.

    Their arguments grow in it by whole turns; by half turns where signs cancel.
    """
    if not isinstance(f, tuple):
        return period
    import sympy
    from sympy.functions.elementary.trigonometric import TrigonometricFunction

    t = next((one for one in sympy.Tuple(*f).free_symbols if one.name == time), None)
    waves = [one for one in sympy.Tuple(*f).atoms(TrigonometricFunction) if t in one.free_symbols]
    rest = dict(zip(waves, sympy.symbols(f"_:{len(waves)}", cls=sympy.Dummy), strict=True))
    if not waves or any(t in one.xreplace(rest).free_symbols for one in f):
        return period
    turns = []
    for wave in waves:
        count = wave.args[0].diff(t) * period / (2 * sympy.pi)
        count = count if count.is_number else sympy.cancel(count)
        if not count.is_number or not abs(count - round(count)) <= TURN * abs(count):
            return period
        turns.append(abs(int(round(count))))
    common = math.gcd(*turns)
    if not common:  # nothing turns
        return period
    half = {
        wave: -wave
        for wave, count in zip(waves, turns, strict=True)
        if count // common % 2 and not isinstance(wave, (sympy.tan, sympy.cot))
    }
    if all(one.xreplace(half) == one for one in f):
        common *= 2
    return period / common if common > 1 else period


def repeats(formula: Any, period: Any, t: str | None) -> bool:
    """Whether a formula has the same value a period later, at some values of what else is in it."""
    import sympy

    later = {one: one + period for one in formula.free_symbols if one.name == t}
    if not later:
        return True
    moved = formula.xreplace(later)
    symbols = sorted(moved.free_symbols, key=str)
    gap, size = 0.0, 0.0
    for seed in range(3):
        at = {one: sympy.Float(math.sqrt(k + seed + 0.3)) for k, one in enumerate(symbols)}
        here, there = (complex(one.subs(at)) for one in (formula, moved))
        if cmath.isfinite(here) and cmath.isfinite(there):
            gap, size = max(gap, abs(here - there)), max(size, abs(here), abs(there))
    return gap <= SAME * size
