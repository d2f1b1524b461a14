"""Equilibria of any formula on a stretch, proved one by one with interval arithmetic.

A piece of the stretch on which the bounds of V' exclude 0 has no equilibrium; one on which those of
V'' exclude 0 has one at most, which the signs of V' at its ends tell. Any other piece is halved
[MooreKearfottCloud2009]. What is left at the end, where V' and V'' vanish within rounding, is not
proved, and is reported as such.
"""

from __future__ import annotations

import itertools
from dataclasses import dataclass
from typing import NamedTuple, TypeAlias

import numpy as np
import numpy.typing as npt

from phasekit.errors import ConvergenceError
from phasekit.phase.numerical.formula import Formula
from phasekit.phase.numerical.intervals import Bounds, bounds_of_slopes, point
from phasekit.phase.numerical.systems import Index, Systems

Array = npt.NDArray[np.float64]
Flags = npt.NDArray[np.bool_]

_FIRST = 64  # pieces with which a stretch is begun
#: Pieces of one system that may wait at once.
_WAITING = 1 << 15
#: Pieces are halved down to this part of the stretch, or to two neighboring doubles.
_FINEST = 2.0**-70
_AT_ONCE = 64
_HALVE = np.int8(3)
#: The widest stretch that stands for one merged equilibrium, as a part of the whole.
_MERGED = 2.0**-6


#: A bracket, the place (NaN where still to be found in it), and the sign of V''.
Found: TypeAlias = tuple[float, float, float, float]


class Isolated(NamedTuple):
    """Equilibria of systems, one row each; from left to right, NaN beyond those that there are."""

    phi: Array
    sign: Array
    """Sign of V''; 0 where it vanishes within rounding, at equilibria that have merged."""
    complete: Flags
    """Whether every piece is proved to hold these equilibria and no other."""
    unproved: list[list[tuple[float, float]]]
    """For each row the stretches that could not be excluded and stand for no equilibrium."""


def slope_bounds(formula: Formula) -> Bounds | None:
    """Bounds of V' and V'' over boxes of (x, parameters); None where a function has no rule."""
    found = bounds_of_slopes(formula.expression, (formula.coordinate, *formula.names))
    return found if isinstance(found, Bounds) else None


@dataclass
class _Pieces:
    """Pieces [low, high] of rows; `verdict` 1 and -1: V'' has that sign, 2 and -2: V' has.

    `left` and `right` are the signs of V' at the ends, 0 where not known.
    """

    row: Index
    low: Array
    high: Array
    verdict: npt.NDArray[np.int8]
    left: npt.NDArray[np.int8]
    right: npt.NDArray[np.int8]

    def take(self, which: Index | Flags) -> _Pieces:
        return _Pieces(*(field[which] for field in vars(self).values()))


def isolate(systems: Systems) -> Isolated:
    """Find the equilibria of systems of a formula on its interval or circle.

    Raises
    ------
    ConvergenceError
        If a potential has a pole or kink, or takes too many pieces.
    """
    parts = [
        _isolate(systems.take(np.arange(first, min(first + _AT_ONCE, systems.size))))
        for first in range(0, systems.size, _AT_ONCE)
    ]
    most = max((part.phi.shape[1] for part in parts), default=0)

    def padded(values: Array) -> Array:
        return np.pad(values, ((0, 0), (0, most - values.shape[1])), constant_values=np.nan)

    if not parts:
        return Isolated(np.empty((0, 0)), np.empty((0, 0)), np.empty(0, dtype=bool), [])
    return Isolated(
        np.concatenate([padded(part.phi) for part in parts]),
        np.concatenate([padded(part.sign) for part in parts]),
        np.concatenate([part.complete for part in parts]),
        [gaps for part in parts for gaps in part.unproved],
    )


def _isolate(systems: Systems) -> Isolated:
    pieces = _divide(systems)
    order = np.lexsort((pieces.low, pieces.row))
    pieces = pieces.take(order)
    firsts = np.searchsorted(pieces.row, np.arange(systems.size + 1))
    rows: list[list[Found]] = []
    complete = np.ones(systems.size, dtype=bool)
    unproved: list[list[tuple[float, float]]] = []
    for i in range(systems.size):
        own = pieces.take(np.arange(firsts[i], firsts[i + 1]))
        found, gaps, sure = _read(systems.take(np.array([i])), own)
        rows.append(found)
        complete[i] = sure
        unproved.append(gaps)
    most = max(map(len, rows), default=0)
    table = np.full((4, systems.size, most), np.nan)
    for i, found in enumerate(rows):
        table[:, i, : len(found)] = np.array(found).reshape(-1, 4).T
    cell, slot = np.nonzero(np.isfinite(table[0]))
    low, high, at, sign = table[:, cell, slot]
    simple = np.isnan(at)
    if simple.any():
        at[simple] = bracketed(systems.take(cell[simple]), low[simple], high[simple])
    phi, signs = table[2], table[3]
    phi[cell, slot] = at
    return Isolated(phi, signs, complete, unproved)


# ------------------------------------------------------------------------- pieces


def bounds_on(
    systems: Systems, row: Index, low: Array, high: Array
) -> tuple[Array, Array, Array, Array, Flags]:
    """Bounds of V' and V'' on pieces: low and high of each, and where they may be undefined."""
    bounds = slope_bounds(systems.formula)
    assert bounds is not None
    beside = [point(p[row]) for p in systems.parameters]
    (slope, bend), undefined = bounds((low, high), *beside)
    return (*slope, *bend, undefined)


def _divide(systems: Systems) -> _Pieces:
    """Pieces with verdicts, 0 where there is none down to rounding."""
    formula = systems.formula
    start, stop = formula.ends
    span = stop - start
    valid = np.flatnonzero(systems.finite)
    edges = np.linspace(start, stop, _FIRST + 1)
    if formula.period is not None:
        edges += 0.2764 * span / _FIRST  # the cut lies at no point of symmetry
    low, high = np.tile(edges[:-1], valid.size), np.tile(edges[1:], valid.size)
    row = np.repeat(valid, _FIRST)
    done = [_Pieces(row[:0], low[:0], high[:0], *(np.empty(0, np.int8) for _ in range(3)))]
    while row.size:
        if row.size > _WAITING and np.max(np.bincount(row)) > _WAITING:
            raise ConvergenceError(
                f"{formula.text} has too many equilibria between {start:.6g} and {stop:.6g}, or is "
                "not smooth enough: between "
                f"{np.min(low):.6g} and {np.max(high):.6g} there are {row.size} pieces for which "
                "it is not known how many equilibria they have; take a shorter interval"
            )
        looked, bad = _judge(systems, row, low, high)
        if bad.any():
            raise ConvergenceError(
                f"{formula.text} is not smooth and finite between {start:.6g} and {stop:.6g}: not "
                f"at {0.5 * (low + high)[bad][0]:.6g}; take an interval on which it is"
            )
        over = looked.verdict != _HALVE
        done.append(looked.take(over))
        row, low, high = row[~over], low[~over], high[~over]
        middle = low + 0.5 * (high - low)
        row = np.concatenate([row, row])
        low, high = np.concatenate([low, middle]), np.concatenate([middle, high])
    return _Pieces(
        *(np.concatenate(parts) for parts in zip(*(vars(d).values() for d in done), strict=True))
    )


def _judge(systems: Systems, row: Index, low: Array, high: Array) -> tuple[_Pieces, Flags]:
    """Give pieces their verdicts, `_HALVE` among them; and where V is found not to be smooth."""
    formula = systems.formula
    start, stop = formula.ends
    span, n = stop - start, row.size
    middle = low + 0.5 * (high - low)
    slope_low, slope_high, bend_low, bend_high, undefined = bounds_on(
        systems,
        np.tile(row, 4),
        np.concatenate([low, middle, low, high]),
        np.concatenate([high, middle, low, high]),
    )
    slope_low, slope_high, bend_low, bend_high = (
        end.reshape(4, n) for end in (slope_low, slope_high, bend_low, bend_high)
    )
    nowhere = undefined[n : 2 * n]
    undefined = undefined[:n]
    with np.errstate(all="ignore"):
        # V'(middle) + V''(piece) (piece - middle), rounded outward.
        half = np.nextafter(np.maximum(middle - low, high - middle), np.inf)
        sway = np.maximum(np.abs(bend_low[0]), np.abs(bend_high[0])) * half * (1.0 + 1e-15)
        least = np.fmax(slope_low[0], np.nextafter(slope_low[1] - sway, -np.inf))
        most = np.fmin(slope_high[0], np.nextafter(slope_high[1] + sway, np.inf))
    verdict = np.select(
        [least > 0.0, most < 0.0, bend_low[0] > 0.0, bend_high[0] < 0.0], [2, -2, 1, -1], _HALVE
    ).astype(np.int8)
    wall = verdict
    verdict = np.where(undefined, _HALVE, verdict)
    # Neither V' nor V'' is known at the middle or an end: shorter pieces would not tell.
    blind = np.isfinite(slope_high[1:] - slope_low[1:]).all(axis=0) & ~undefined
    for lower, upper in ((slope_low, slope_high), (bend_low, bend_high)):
        blind &= np.all((lower[1:] <= 0.0) & (upper[1:] >= 0.0), axis=0)
    finest = (high - low <= _FINEST * span) | (middle <= low) | (middle >= high)
    open_ = verdict == _HALVE
    verdict[open_ & (finest | (blind & (high - low <= _MERGED * span)))] = 0
    # At an end V may rise or fall beyond all bounds: a wall, which is no equilibrium.
    at_end = (low == start) | (high == stop)
    walled = finest & undefined & at_end & (np.abs(wall) == 2) & (formula.period is None)
    verdict[walled] = wall[walled]
    left, right = (
        np.where(slope_low[k] > 0.0, 1, np.where(slope_high[k] < 0.0, -1, 0)).astype(np.int8)
        for k in (2, 3)
    )
    left, right = (
        np.where(np.abs(verdict) == 2, verdict // 2, sign).astype(np.int8) for sign in (left, right)
    )
    bad = (finest & undefined & ~walled) | nowhere
    return _Pieces(row, low, high, verdict, left, right), bad


# ------------------------------------------------------------------------- reading


@dataclass(eq=False)
class _Run:
    """Neighboring pieces of one verdict; signs of V' at both ends, 0 where not known."""

    low: float
    high: float
    verdict: int
    left: int
    right: int


def _runs(pieces: _Pieces) -> list[_Run]:
    change = np.flatnonzero(np.diff(pieces.verdict)) + 1
    first, last = [0, *change], [*(change - 1), pieces.low.size - 1]
    runs = [
        _Run(
            float(pieces.low[a]),
            float(pieces.high[b]),
            int(pieces.verdict[a]),
            int(pieces.left[a]),
            int(pieces.right[b]),
        )
        for a, b in zip(first, last, strict=True)
    ]
    # What is known on one side of a knot is known on the other.
    for one, two in itertools.pairwise(runs):
        one.right = two.left = one.right or two.left
    return runs


def _read(system: Systems, pieces: _Pieces) -> tuple[list[Found], list[tuple[float, float]], bool]:
    """Equilibria of one system from its pieces, what was not excluded, whether all is proved."""
    if not pieces.row.size:
        return [], [], True
    runs = _runs(pieces)
    for run in [run for run in runs if run.verdict == 0]:
        if run in runs:
            _widen(system, runs, runs.index(run))
    start, stop = runs[0].low, runs[-1].high
    found: list[Found] = []
    gaps: list[tuple[float, float]] = []
    for run in runs:
        ends = run.left or run.low == start, run.right or run.high == stop
        if run.verdict == 0 and all(ends) and run.high - run.low <= _MERGED * (stop - start):
            at = 0.5 * (run.low + run.high)
            if not run.left or not run.right:
                at = run.high if run.left else run.low
            elif run.low < 0.0 < run.high:
                at = 0.0
            found.append((run.low, run.high, at, 0.0))
        elif run.verdict == 0:
            gaps.append((run.low, run.high))
        elif abs(run.verdict) == 1 and run.left * run.right < 0:
            found.append((run.low, run.high, np.nan, float(run.verdict)))
    if system.formula.period is None:
        for run, at in ((runs[0], start), (runs[-1], stop)):
            if run.verdict != 0 and not any(low <= at <= high for low, high, *_ in found):
                # The ends belong to the interval, and what lies within rounding of them.
                slope, bend = (f(np.array([at]))[0] for f in (system.slope, system.bend))
                if np.isfinite(bend) and abs(slope) <= abs(bend) * np.spacing(abs(at)):
                    found.append((at, at, at, float(np.sign(bend))))
    return sorted(found), gaps, all(run.verdict != 0 for run in runs)


def _widen(system: Systems, runs: list[_Run], k: int) -> None:
    """Widen a run without verdict over its neighbors to points where the sign of V' is known."""
    run = runs[k]
    for side, sign, step in ((0, "left", -1), (1, "right", 1)):
        while not getattr(run, sign) and 0 <= k + step < len(runs):
            beside = runs[k + step]
            at, end = (run.low, beside.low) if side == 0 else (run.high, beside.high)
            width = max(run.high - run.low, 4.0 * float(np.spacing(abs(at))))
            places: Array = at + step * width * 2.0 ** np.arange(64.0)
            places = np.append(places[np.abs(places - at) < abs(end - at)], end)
            low, high, *_ = bounds_on(system, np.zeros(places.size, np.intp), places, places)
            known = np.where(low > 0.0, 1, np.where(high < 0.0, -1, 0))
            first = int(np.argmax(known != 0)) if known.any() else places.size - 1
            place, value = float(places[first]), int(known[first])
            if side:
                run.high, run.right, beside.low, beside.left = place, value, place, value
            else:
                run.low, run.left, beside.high, beside.right = place, value, place, value
            if first == places.size - 1:  # nothing is left of the neighbor
                del runs[k + step]
                k -= side == 0


def bracketed(systems: Systems, low: Array, high: Array) -> Array:
    """Zeros of V' between points where it has opposite signs: Newton's method, safeguarded."""
    rising = systems.slope(high) > 0.0
    x = 0.5 * (low + high)
    found = np.full(x.shape, np.nan)
    rows = np.arange(x.size)
    for _ in range(200):
        slope = systems.slope(x)
        under = (slope < 0.0) == rising
        low, high = np.where(under, x, low), np.where(under, high, x)
        step = x - slope / systems.bend(x)
        middle = 0.5 * (low + high)
        inside = (step > low) & (step < high)
        fresh = np.where(slope == 0.0, x, np.where(inside, step, middle))
        # Newton's method may creep from one side; then the bracket is halved.
        slow = np.abs(fresh - x) > 0.5 * (high - low)
        fresh = np.where(slow, middle, fresh)
        still = (fresh == x) | (high - low <= np.spacing(np.abs(x))) | np.isnan(x)
        found[rows] = fresh
        going = np.flatnonzero(~still)
        if not going.size:
            break
        rows, systems, x = rows[going], systems.take(going), fresh[going]
        low, high, rising = low[going], high[going], rising[going]
    return found
