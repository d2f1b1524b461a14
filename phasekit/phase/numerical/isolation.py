"""Equilibria of any formula on a stretch, proved one by one with interval arithmetic.

A piece of the stretch on which the bounds of V' exclude 0 has no equilibrium; one on which those of
V'' exclude 0 has one at most, which the signs of V' at its ends tell. Any other piece is halved
[MooreKearfottCloud2009]. What is left at the end, where V' and V'' vanish within rounding, is not
proved, and is reported as such.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any, NamedTuple, TypeAlias

import numpy as np
import numpy.typing as npt

from phasekit.arrays import Array, Flags
from phasekit.arrays import Ints as Index
from phasekit.errors import ConvergenceError
from phasekit.phase.numerical.formula_bounds import bounds_on
from phasekit.phase.numerical.systems import Systems

#: Pieces with which a stretch is begun, and of one system that may wait at once.
_FIRST, _WAITING = 16, 1 << 15
#: Pieces are halved down to this part of the stretch, or to two neighboring doubles.
_FINEST = 2.0**-70
#: Systems that are looked at together.
_AT_ONCE = 512
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


@dataclass
class _Pieces:
    """Pieces [low, high] of rows; `verdict` 1 and -1: V'' has that sign, 2 and -2: V' has."""

    row: Index
    low: Array
    high: Array
    verdict: npt.NDArray[np.int8]

    def take(self, which: Index | Flags) -> _Pieces:
        return _Pieces(*(field[which] for field in vars(self).values()))


def isolate(systems: Systems) -> Isolated:
    """Find the equilibria of systems of a formula on its interval or circle."""
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
    runs = _joined(systems, _divide(systems))
    start, stop = systems.formula.ends
    firsts = np.searchsorted(runs.row, np.arange(systems.size + 1))
    at_ends = _resting_ends(systems)
    rows: list[list[Found]] = []
    complete = np.ones(systems.size, dtype=bool)
    unproved: list[list[tuple[float, float]]] = []
    for i in range(systems.size):
        own = [_Run(*values) for values in runs.runs(slice(firsts[i], firsts[i + 1]))]
        if any(run.verdict == 0 for run in own):
            single = systems.take(np.array([i]))
            for run in [run for run in own if run.verdict == 0]:
                if run in own:
                    _widen(single, own, own.index(run))
        found, gaps = _read(own, stop - start)
        outer = (own[0].verdict, own[-1].verdict) if own else ()
        for at, sign, verdict in zip((start, stop), at_ends[i], outer, strict=False):
            known = any(low <= at <= high for low, high, *_ in found)
            if np.isfinite(sign) and verdict != 0 and not known:
                found.append((at, at, at, float(sign)))
        rows.append(sorted(found))
        complete[i] = all(run.verdict != 0 for run in own)
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
    done = [_Pieces(row[:0], low[:0], high[:0], np.empty(0, np.int8))]
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
    span, middle = stop - start, low + 0.5 * (high - low)
    slope_low, slope_high, bend_low, bend_high, undefined = bounds_on(systems, row, low, high)
    wall = np.select([slope_low > 0.0, slope_high < 0.0], [2, -2], _HALVE)
    verdict = np.select([wall != _HALVE, bend_low > 0.0, bend_high < 0.0], [wall, 1, -1], _HALVE)
    verdict[undefined] = _HALVE
    bad = np.zeros(row.size, dtype=bool)
    few = np.flatnonzero(verdict == _HALVE)  # of which the middle is looked at
    least, most, lower, upper, bad[few] = bounds_on(systems, row[few], middle[few], middle[few])
    with np.errstate(all="ignore"):
        # V'(middle) + V''(piece) (piece - middle), rounded outward.
        half = np.nextafter(np.maximum(middle - low, high - middle)[few], np.inf)
        sway = np.maximum(np.abs(bend_low), np.abs(bend_high))[few] * half * (1.0 + 1e-15)
        above = np.nextafter(least - sway, -np.inf) > 0.0
        below = np.nextafter(most + sway, np.inf) < 0.0
    wall[few] = np.select([above, below], [2, -2], wall[few])
    verdict[few] = np.where(undefined[few], _HALVE, wall[few])
    # Neither V' nor V'' is known at the middle or an end: shorter pieces would not tell.
    blind = np.zeros(row.size, dtype=bool)
    blind[few] = _unknown(least, most, lower, upper) & ~undefined[few]
    blind &= (verdict == _HALVE) & (high - low <= _MERGED * span)
    for end in (low, high):
        few = np.flatnonzero(blind)
        blind[few] = _unknown(*bounds_on(systems, row[few], end[few], end[few])[:4])
    finest = (high - low <= _FINEST * span) | (middle <= low) | (middle >= high)
    verdict[(verdict == _HALVE) & (finest | blind)] = 0
    # At an end V may rise or fall beyond all bounds: a wall, which is no equilibrium.
    at_end = (low == start) | (high == stop)
    walled = finest & undefined & at_end & (wall != _HALVE) & (formula.period is None)
    verdict[walled] = wall[walled]
    bad |= finest & undefined & ~walled
    return _Pieces(row, low, high, verdict.astype(np.int8)), bad


def _unknown(least: Array, most: Array, lower: Array, upper: Array) -> Flags:
    """Whether bounds of V' are finite, and neither these nor those of V'' exclude 0."""
    with np.errstate(all="ignore"):
        finite = np.isfinite(most - least)
    return finite & (least <= 0.0) & (most >= 0.0) & (lower <= 0.0) & (upper >= 0.0)


# ------------------------------------------------------------------------- reading


@dataclass(eq=False)
class _Run:
    """Neighboring pieces of one verdict; signs of V' at both ends, 0 where not known."""

    low: float
    high: float
    verdict: int
    left: int
    right: int


class _Runs(NamedTuple):
    """Fields of all runs, in the order of rows and from left to right."""

    row: Index
    low: Array
    high: Array
    verdict: npt.NDArray[np.int8]
    left: npt.NDArray[np.int8]
    right: npt.NDArray[np.int8]

    def runs(self, part: slice) -> Iterator[tuple[Any, ...]]:
        """The runs of a row."""
        return zip(*(field[part].tolist() for field in self[1:]), strict=True)


def _joined(systems: Systems, pieces: _Pieces) -> _Runs:
    """Neighboring pieces of one verdict as one."""
    pieces = pieces.take(np.lexsort((pieces.low, pieces.row)))
    row, verdict = pieces.row, pieces.verdict
    fresh = (np.diff(row) != 0) | (np.diff(verdict) != 0)
    first = np.flatnonzero(np.append(row.size > 0, fresh))
    last = np.flatnonzero(np.append(fresh, row.size > 0))
    row, verdict, low, high = row[first], verdict[first], pieces.low[first], pieces.high[last]
    known = np.where(np.abs(verdict) == 2, verdict // 2, 0).astype(np.int8)
    left, right = known.copy(), known.copy()
    # What is known on one side of a knot is known on the other.
    same = np.flatnonzero(row[1:] == row[:-1])
    left[same + 1] = np.where(known[same + 1] == 0, known[same], known[same + 1])
    right[same] = np.where(known[same] == 0, known[same + 1], known[same])
    for sign, place in ((left, low), (right, high)):
        few = np.flatnonzero(sign == 0)
        sign[few] = _signs(systems, row[few], place[few])
    return _Runs(row, low, high, verdict, left, right)


def _signs(systems: Systems, row: Index, x: Array) -> npt.NDArray[np.int8]:
    """Signs of V' at places, 0 where not known."""
    low, high, *_ = bounds_on(systems, row, x, x)
    return np.where(low > 0.0, 1, np.where(high < 0.0, -1, 0)).astype(np.int8)


def _read(runs: list[_Run], span: float) -> tuple[list[Found], list[tuple[float, float]]]:
    """Equilibria of one system from its runs, and what was not excluded."""
    found: list[Found] = []
    gaps: list[tuple[float, float]] = []
    for run in runs:
        ends = run.left or run is runs[0], run.right or run is runs[-1]
        if run.verdict == 0 and all(ends) and run.high - run.low <= _MERGED * span:
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
    return found, gaps


def _resting_ends(systems: Systems) -> Array:
    """Signs of V'' at the ends where V' vanishes within their rounding, else NaN.

    The ends belong to an interval, and what lies within rounding of them.
    """
    if systems.formula.period is not None:
        return np.full((systems.size, 2), np.nan)
    ends = np.array(systems.formula.ends)
    at = np.broadcast_to(ends, (systems.size, 2))
    slope, bend = systems.slope(at), systems.bend(at)
    with np.errstate(all="ignore"):
        rests = np.isfinite(bend) & (np.abs(slope) <= np.abs(bend) * np.spacing(np.abs(ends)))
    return np.where(rests, np.sign(bend), np.nan)


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
            known = _signs(system, np.zeros(places.size, np.intp), places)
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
