"""Where equilibria of a potential merge, cross or leave along a line of parameters.

Equilibria merge where V' = V'' = 0: the zeros of two formulas in a box of the coordinate and the
place on the line, all of which are proved. The crossings with an equilibrium that rests are found
by `phasekit.bifurcation.numerical.resting`, in strips that the boxes leave out.
"""

from __future__ import annotations

import functools
import math
from collections.abc import Sequence
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np

from phasekit.arrays import Array
from phasekit.bifurcation.numerical.boxes import Boxes, Merger, enclosed, exact, folds, zeros_along
from phasekit.bifurcation.numerical.line import Line, terms_of
from phasekit.bifurcation.numerical.resting import resting_points, strip
from phasekit.errors import EquilibriumKind
from phasekit.numerics.intervals.bounds import Bounds
from phasekit.numerics.intervals.program import NoRule
from phasekit.numerics.intervals.zeros import zeros_in_box
from phasekit.phase.numerical.formula import Formula, Shape

#: Places, and coordinates, that are one, as parts of the line and of the window.
SAME, BESIDE = 1e-10, 1e-7
#: Widest place, as a part of the line, at which something undecided counts as one point.
POINT = 1e-6
#: Places at which a potential is tried of which nothing is proved.
TRIALS = 257
#: Pieces of a line, each with a bound of its own on how far out equilibria lie.
_PIECES = 64
#: A turn begins here, where no symmetry has anything, and is this much wider than it is.
_CUT, _MARGIN = 0.0137, 1e-9


class Mergers(NamedTuple):
    """All of them along a line, in order; why there may be others, empty where there are none."""

    found: list[Merger]
    missing: str


def mergers(line: Line) -> Mergers:
    """All points of a line at which the number of equilibria changes, or they cross."""
    if not line.terms.slope.has(line.terms.x):
        return Mergers([], "")
    try:
        found, lost, cuts = list[Merger](), list[Boxes](), list[float]()
        low, high = window(line)
        for point in resting_points(line):
            here, undecided, half = strip(line, point, low, high)
            found += here
            lost += undecided
            cuts += [point.low - half, point.high + half]
        inner, around = _in_window(line, [low, *sorted(cuts), high])
        found += inner
        lost += around
        for part in (_far_out(line, low, high), _exits(line)):
            found += part[0]
            lost += part[1]
    except NoRule as rule:
        return Mergers(sampled(line, *line.span), f"no bounds of {rule} are known")
    missing = ""
    if lost:
        ends = (np.concatenate([part[i][:, 1] for part in lost]) for i in (0, 1))
        first, last = (pick(end) for pick, end in zip((np.min, np.max), ends, strict=True))
        missing = f"it is undecided from {first:.6g} to {last:.6g}, by rounding or a merger of more"
        found += _undecided(line, lost)
    return Mergers(_once(line, found), missing)


def window(line: Line) -> tuple[float, float]:
    """Coordinates between which boxes lie: one turn, the interval, or what holds most of it."""
    formula = line.formula
    if formula.period is not None:
        low = formula.period * (_CUT - 0.5)
        return low, low + formula.period
    if formula.interval is not None:
        return formula.interval
    reach = _reaches(line)
    most = float(np.max(reach[np.isfinite(reach)], initial=1.0))
    return -most, most


def _in_window(line: Line, cuts: Sequence[float]) -> tuple[list[Merger], list[Boxes]]:
    terms, found, lost = line.terms, list[Merger](), list[Boxes]()
    f = [terms.slope, terms.derivative(2)]
    margin = _MARGIN * (cuts[-1] - cuts[0]) if line.circle else 0.0
    for low, high in zip(cuts[::2], cuts[1::2], strict=True):
        if low < high:
            first, last = [low - margin, line.span[0]], [high + margin, line.span[1]]
            box = zeros_in_box(f, [terms.x, terms.s], line.numbers, first, last)
            found += folds(line, box)
            lost += [] if box.complete else [box.undecided]
    return found, lost


# ------------------------------------------------------------------------- far out, and at ends


def _exits(line: Line) -> tuple[list[Merger], list[Boxes]]:
    """Where an equilibrium passes an end of the interval."""
    found, lost, terms = list[Merger](), list[Boxes](), line.terms
    for end in line.formula.interval or ():
        there = terms.slope.subs(terms.x, exact(end))
        places, undecided = zeros_along(line, there, end)
        found += [Merger(s, end, "exit", error) for s, error in places]
        lost += undecided
    return found, lost


@functools.lru_cache(maxsize=64)
def _coefficients(formula: Formula, moving: tuple[str, ...]) -> tuple[list[Any], Bounds]:
    """Coefficients of a polynomial V', the highest first, and their bounds along a line."""
    import sympy as sp

    terms = terms_of(formula, moving)
    parts = sp.Poly(sp.expand(terms.slope), terms.x).all_coeffs()
    return parts, Bounds(parts, [terms.s, *terms.parameters])


def _is_open(line: Line) -> bool:
    return line.formula.shape is Shape.POLYNOMIAL and not line.formula.bounded


def _reaches(line: Line) -> Array:
    """Beyond what equilibria cannot lie, piece by piece; infinite where one may be anywhere.

    Fujiwara's bound of the roots of a polynomial.
    """
    parts, bounds = _coefficients(line.formula, tuple(line.moving))
    ends = np.linspace(*line.span, _PIECES + 1)
    found, _ = enclosed(bounds, [(ends[:-1], ends[1:])], line.numbers)
    most = [np.maximum(np.abs(low), np.abs(high)) for low, high in found]
    low, high = found[0]
    least = np.where(low * high > 0.0, np.minimum(np.abs(low), np.abs(high)), 0.0)
    reach = np.zeros(_PIECES)
    with np.errstate(all="ignore"):
        for k in range(1, len(parts)):
            part = np.where(most[k] > 0.0, (most[k] / least) ** (1.0 / k), 0.0)
            reach = np.maximum(reach, 2.0 * part)
    return np.where(least > 0.0, reach * (1.0 + 1e-9), np.inf)


def _far_out(line: Line, low: float, high: float) -> tuple[list[Merger], list[Boxes]]:
    """What happens beyond a window of the line, by u = 1/x; equilibria that come from infinity."""
    import sympy as sp

    if not _is_open(line) or np.isfinite(_reaches(line)).all():
        return [], []
    terms, (parts, _) = line.terms, _coefficients(line.formula, tuple(line.moving))
    u = sp.Symbol("_u", real=True)
    f = sum(part * u**k for k, part in enumerate(parts))
    first, last = [1.0 / low, line.span[0]], [1.0 / high, line.span[1]]
    box = zeros_in_box([f, f.diff(u)], [u, terms.s], line.numbers, first, last)
    found = [replace(m, x=1.0 / m.x) for m in folds(line, box) if m.x]
    lost: list[Boxes] = []
    if not box.complete:
        ends = [np.column_stack([np.full(len(e), math.copysign(math.inf, 1.0)), e[:, 1]])
                for e in box.undecided]  # fmt: skip
        lost.append((ends[0], ends[1]))
    at, more = zeros_along(line, parts[0], math.inf)
    found += [Merger(s, math.inf, "exit", error) for s, error in at]
    return found, [*lost, *more]


# ------------------------------------------------------------------------- what is not decided


def _undecided(line: Line, lost: list[Boxes]) -> list[Merger]:
    """What is not decided, as points where it is narrow; else what samples show there."""
    low, high = (np.concatenate([part[i] for part in lost]) for i in (0, 1))
    order = np.argsort(low[:, 1], kind="stable")
    low, high = low[order], high[order]
    width = line.span[1] - line.span[0]
    found: list[Merger] = []
    ends = np.maximum.accumulate(high[:, 1])
    new = np.flatnonzero(low[1:, 1] > ends[:-1] + SAME * width) + 1
    for first, last in zip([0, *new], [*new, len(low)], strict=True):
        a, b = low[first:last, 1].min(), high[first:last, 1].max()
        if b - a > POINT * width or not np.isfinite(low[first:last, 0]).all():
            found += sampled(line, float(a), float(b))
            continue
        for left, right in _groups(low[first:last, 0], high[first:last, 0], line):
            x, reach = 0.5 * (left + right), 0.5 * (right - left)
            found.append(Merger(0.5 * (a + b), x, "branch_point", 0.5 * (b - a), reach))
    return found


def _groups(low: Array, high: Array, line: Line) -> list[tuple[float, float]]:
    """Stretches of the coordinate that overlap, each as one."""
    order = np.argsort(low, kind="stable")
    low, high = low[order], np.maximum.accumulate(high[order])
    first, last = window(line)
    new = np.flatnonzero(low[1:] > high[:-1] + BESIDE * (last - first)) + 1
    return [
        (float(low[i]), float(high[j - 1]))
        for i, j in zip([0, *new], [*new, len(low)], strict=True)
    ]


def sampled(line: Line, low: float, high: float) -> list[Merger]:
    """Where samples show that the number of equilibria changes; to rounding."""
    found = []
    s = np.linspace(low, high, TRIALS)
    number = line.equilibria(s).n_equilibria
    for i in np.flatnonzero(number[1:] != number[:-1]):
        a, b = s[i], s[i + 1]
        while True:
            parts = np.linspace(a, b, 9)
            if not (np.diff(parts) > 0.0).all():
                break
            here = line.equilibria(parts).n_equilibria
            k = int(np.flatnonzero(here[1:] != here[0])[0])
            a, b = parts[k], parts[k + 1]
        found.append(_between(line, float(a), float(b)))
    return found


def _between(line: Line, a: float, b: float) -> Merger:
    """What merges between two neighboring places: a degenerate equilibrium, or the closest two."""
    points = [line.equilibria(np.array([s])) for s in (a, b)]
    many = max(points, key=lambda p: int(p.n_equilibria[0]))
    there = np.isfinite(many.phi[0])
    x, kind = many.phi[0][there], many.kind[0][there]
    gap = np.diff(x, append=x[:1] + (line.circle or np.inf))
    merged = kind == EquilibriumKind.DEGENERATE
    j = int(np.argmax(merged) if merged.any() else np.argmin(gap))
    at = float(x[j] if merged.any() or not np.isfinite(gap[j]) else x[j] + 0.5 * gap[j])
    s, d = 0.5 * (a + b), line.derivative
    turns, crosses = abs(d(1, 1, s, at) * d(3, 0, s, at)), d(2, 1, s, at) ** 2
    name = "fold" if turns > BESIDE * (turns + crosses) else "branch_point"
    return Merger(s, at, name, 0.5 * (b - a), BESIDE if name == "fold" else 0.0)


def _once(line: Line, found: list[Merger]) -> list[Merger]:
    """Each once, in order; a point on the border of two boxes is found in both."""
    low, high = window(line)
    width, size = line.span[1] - line.span[0], high - low
    kept: list[Merger] = []
    for one in sorted(found, key=lambda m: (m.at, m.x)):
        same = [
            other
            for other in kept
            if abs(other.at - one.at) <= SAME * width
            and apart(line, other.x, one.x) <= BESIDE * size
        ]
        if not same:
            kept.append(one)
    return kept


def apart(line: Line, x: float, y: float) -> float:
    """Distance of two coordinates."""
    if x == y:
        return 0.0
    way = abs(x - y)
    return way if line.circle is None else abs(way - line.circle * round(way / line.circle))
