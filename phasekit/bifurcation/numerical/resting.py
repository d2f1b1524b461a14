"""Equilibria that do not move along a line of parameters, by symmetry or else, and their crossings.

There V' = (x - x0) W, and each crossing of another equilibrium with x0 is a double zero of V',
which no box decides. Where W and W_x are not both zero nothing merges beside x0. Their bounds are
those of V'' and V'''/2 over all points between x0 and x, and so on for their derivatives.
"""

from __future__ import annotations

import functools
from dataclasses import dataclass
from fractions import Fraction
from typing import Any

import numpy as np

from phasekit.arrays import Array
from phasekit.bifurcation.numerical.boxes import (
    Boxes,
    Merger,
    bounds_of,
    enclosed,
    exact,
    zeros_along,
)
from phasekit.bifurcation.numerical.line import Line
from phasekit.laws.ladder import is_turn
from phasekit.numerics.intervals.krawczyk import krawczyk

#: Half widths of strips as parts of the window: the first, by which they shrink, and the last.
_WIDE, _SHRINK, _NARROW = 2.0**-6, 0.25, 2.0**-24
#: Cells of a strip at most, and halvings of them.
_CELLS, _HALVINGS = 2048, 44
#: Largest denominator of a part of a turn that is tried, and of a number.
_PARTS, _WHOLE = 48, 10**6
#: Longest formula that is simplified to see whether it vanishes.
_LONG = 400
_ORDERS = ((2, 0), (3, 0), (4, 0), (2, 1), (3, 1))


@dataclass(frozen=True)
class Resting:
    """An equilibrium that does not move: exactly, between two doubles, and whether V is even."""

    x: Any
    low: float
    high: float
    even: bool

    @property
    def middle(self) -> float:
        """The double next to it."""
        return float(self.x)


def resting_points(line: Line) -> list[Resting]:
    """All equilibria of a line that do not move, as far as formulas tell, from left to right."""
    terms = line.terms
    numbers = tuple((symbol, exact(value)) for symbol, value in line.numbers.items())
    return vanishing(line, terms.slope, terms.x, numbers)


def vanishing(
    line: Line, slope: Any, x: Any, numbers: tuple[tuple[Any, Any], ...]
) -> list[Resting]:
    """Equilibria of a line at which a slope vanishes, whatever its symbols, but these numbers."""
    span = np.array(line.span)
    places = span[0] + (span[1] - span[0]) * np.array([0.4642, 0.0931, 0.3197, 0.7439])
    points = line.equilibria(places[:1]).phi[0]
    own = [p[:, None] for p in line.parameters(places)]
    found: list[Resting] = []
    for place in map(float, points[np.isfinite(points)]):
        # The slope beside it sets the scale on which it vanishes.
        step = 1e-3 * (line.circle or 1.0 + abs(place))
        here, left, right = line.formula.slopes(place + step * np.array([0.0, -1.0, 1.0]), *own).T
        if not np.all(np.abs(here) <= 1e-9 * (np.abs(left) + np.abs(right))):
            continue
        for candidate in _candidates(line, place):
            # For all numbers, which is told once, or for these.
            known = next((n for n in ((), numbers) if vanishes(slope, x, candidate, 0, n)), None)
            if known is not None:
                even = any(vanishes(slope, x, candidate, 2, n) for n in ((), numbers))
                value = float(candidate)
                ends = [float(np.nextafter(value, way)) for way in (-np.inf, np.inf)]
                low, high = [value, value] if exact(value) == candidate else ends
                found.append(Resting(candidate, low, high, even))
                break
    return found


def _candidates(line: Line, x: float) -> list[Any]:
    """Exact numbers that a double may stand for."""
    import sympy as sp

    found: list[Any] = [sp.Integer(0)] if abs(x) <= 1e-12 * (line.circle or 1.0) else []
    if line.circle is not None:
        part = Fraction(x / line.circle).limit_denominator(_PARTS)
        if abs(float(part) - x / line.circle) <= 1e-13:
            turn = 2 * sp.pi if is_turn(line.circle) else exact(line.circle)
            found.append(turn * sp.Rational(part.numerator, part.denominator))
    part = Fraction(x).limit_denominator(_WHOLE)
    if abs(float(part) - x) <= 1e-14 * abs(x):
        found.append(sp.Rational(part.numerator, part.denominator))
    return [*found, exact(x)]


@functools.lru_cache(maxsize=1024)
def vanishes(
    slope: Any, x: Any, place: Any, order: int, numbers: tuple[tuple[Any, Any], ...]
) -> bool:
    """Whether a derivative of a formula is zero at a place, as far as simplifying tells."""
    import sympy as sp

    found = (slope.diff(x, order) if order else slope).xreplace(dict(numbers)).subs(x, place)
    if found == 0:
        return True
    if found.count_ops() > _LONG:
        return False
    # At some numbers it shows sooner that it is not: beside its terms, whose size is the law's.
    some = {one: 0.37 + 0.0931 * k for k, one in enumerate(sorted(found.free_symbols, key=str))}
    terms = [term.evalf(subs=some) for term in sp.Add.make_args(found)]
    value = found.evalf(subs=some)
    if value.is_number and abs(value) > 1e-9 * sum(map(abs, terms)):
        return False
    return bool(sp.simplify(found) == 0)


def strip(
    line: Line, point: Resting, low: float, high: float
) -> tuple[list[Merger], list[Boxes], float]:
    """What happens in a strip about one: mergers, what is not decided, and its half width."""
    terms, size = line.terms, high - low
    crossings, lost = zeros_along(line, terms.derivative(2).subs(terms.x, point.x), point.middle)
    found = [_crossing(line, point, s, error) for s, error in crossings]
    half = _WIDE * size
    while True:
        beside, open_ = _beside(line, point, half)
        if not open_ or half <= _NARROW * size:
            break
        half *= _SHRINK
    at = [merger.at for merger in found]
    width = line.span[1] - line.span[0]
    for (u, s), (_, error) in beside:
        if abs(u) > 1e-9 * size and not any(abs(s - t) <= 1e-12 * width for t in at):
            found.append(Merger(float(s), point.middle + float(u), "fold", float(error)))
    if open_:
        ends = np.array(open_)
        x = np.full(len(ends), point.middle)
        corners = [np.column_stack([x + half * (2 * i - 1), ends[:, i]]) for i in (0, 1)]
        lost.append((corners[0], corners[1]))
    return found, lost, half


def _crossing(line: Line, point: Resting, s: float, error: float) -> Merger:
    """A crossing with it: a pitchfork where the third derivative vanishes as well."""
    x = point.middle
    third = abs(line.derivative(3, 0, s, x))
    bounds = bounds_of(line.formula, tuple(line.moving), ((3, 0),))
    ((low, high),), _ = enclosed(bounds, [(point.low, point.high), (s, s)], line.numbers)
    flat = point.even or (low <= 0.0 <= high and third <= 2.0 * (high - low))
    return Merger(s, x, "pitchfork" if flat else "transcritical", error)


def _beside(line: Line, point: Resting, half: float) -> tuple[list[Any], list[tuple[float, float]]]:
    """Zeros (u, place) of W and W_x in a strip, with radii; and places that nothing decides."""
    bounds = bounds_of(line.formula, tuple(line.moving), _ORDERS)
    low, high = (np.array([end]) for end in line.span)
    width = high[0] - low[0]
    found: list[Any] = []
    for _ in range(_HALVINGS):
        around = 0.05 * (high - low) + 1e-15 * width
        a, b = low - around, high + around
        wide = _forms(bounds, line, (point.low - half, point.high + half), a, b)
        middle = 0.5 * (low + high)
        there = _forms(bounds, line, (point.low, point.high), middle, middle)
        values, slopes, defined = wide[0], wide[1], wide[2] & there[2]
        empty = np.any((values[0] > 0.0) | (values[1] < 0.0), axis=1) & wide[2]
        reach = np.column_stack([np.full(low.size, half), np.maximum(b - middle, middle - a)])
        image = krawczyk(np.column_stack([0.0 * middle, middle]), reach, there[0], slopes)
        corners = (
            np.column_stack([np.full(low.size, -half), a]),
            np.column_stack([np.full(low.size, half), b]),
        )
        one = defined & image.usable & ~empty
        one &= np.all((image.low > corners[0]) & (image.high < corners[1]), axis=1)
        found += zip(image.middle[one], image.radius[one], strict=True)
        rest = ~(empty | one)
        low, high, middle = low[rest], high[rest], middle[rest]
        if not low.size:
            return found, []
        if 2 * low.size > _CELLS or np.max(high - low) <= 1e-13 * width:
            break
        low, high = np.concatenate([low, middle]), np.concatenate([middle, high])
    return found, list(zip(low.tolist(), high.tolist(), strict=True))


def _forms(bounds: Any, line: Line, x: tuple[float, float], low: Array, high: Array) -> Any:
    """Bounds of W and W_x, and of their derivatives, between x0 and x; and where they are known."""
    ends = [np.full(low.shape, end) for end in x]
    found, undefined = enclosed(bounds, [(ends[0], ends[1]), (low, high)], line.numbers)
    two, three, four, two_s, three_s = (np.stack(one) for one in found)
    values = np.stack([two, 0.5 * three], axis=2)
    slopes = np.stack(
        [np.stack([0.5 * three, two_s], axis=2), np.stack([four / 3.0, 0.5 * three_s], axis=2)],
        axis=2,
    )
    known = ~undefined & np.isfinite(slopes).all(axis=(0, 2, 3))
    return values, slopes, known
