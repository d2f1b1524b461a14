"""How far equilibria may be from where they are found, and the digits that rounding of V' hides.

Bounds of V' at a place hold its rounding, and the residual; over |V''| they are the error of the
place, as long as V'' does not change over it. Where it does, next to others or at a degenerate
equilibrium, the error is how far the nearest points lie at which the sign of V' is known.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple, TypeAlias

import numpy as np

from phasekit.arrays import Array
from phasekit.arrays import Ints as Index
from phasekit.phase.numerical.digits import values
from phasekit.phase.numerical.formula_bounds import bounds_on, slope_bounds
from phasekit.phase.numerical.systems import Systems

#: Bounds of V' and of V'': low and high of each.
Ends: TypeAlias = tuple[Array, Array, Array, Array]

_EPS = float(np.finfo(float).eps)
#: What is left of the rounding of doubles in double-double arithmetic, with some bits to spare.
_FINER = 2.0**-45
#: Below this the products of double-doubles lose their second half.
_TINY = 1e-250
#: Units in the last place that a place may be off before its digits are looked for, and how often.
_POOR = 16.0
_STEPS = 6


class Places(NamedTuple):
    """Zeros of V', one of each of some systems."""

    systems: Systems
    x: Array
    sign: Array
    """Sign of V''; 0 where zeros have merged."""
    row: Index
    """The row of `all` in which the zeros of the same system are."""
    all: Array

    def take(self, rows: Index) -> Places:
        """Some of them."""
        systems = self.systems.take(rows)
        return Places(systems, self.x[rows], self.sign[rows], self.row[rows], self.all)

    def next(self, side: float) -> Array:
        """How far it is to the next zero on one side; infinite where there is none."""
        way = side * (self.all[self.row] - self.x[:, None])
        period = self.systems.formula.period
        way = way if period is None else way % period
        return np.asarray(np.min(np.where(way > 0.0, way, np.inf), axis=1, initial=np.inf))


def located(places: Places) -> tuple[Array, Array]:
    """Places with all digits that V' has, and bounds of their errors."""
    with np.errstate(all="ignore"):
        ends = _bounds(places.systems, places.x)
        error = _errors(places, ends, _bounds)
        poor = np.flatnonzero((error > _POOR * np.spacing(np.abs(places.x))) & (places.sign != 0.0))
        few = places.take(poor)
        if not poor.size or values(few.systems, few.x, 1, 2) is None:
            return places.x, error
        fresh = few._replace(x=_newton(few.systems, few.x))
        found = _errors(fresh, _fine(fresh.systems, fresh.x), _fine)
        better = (found < error[poor]) & (np.abs(fresh.x - few.x) <= error[poor])
        x = places.x.copy()
        x[poor[better]], error[poor[better]] = fresh.x[better], found[better]
    return x, error


def _errors(places: Places, ends: Ends, look: Callable[[Systems, Array], Ends]) -> Array:
    """Bounds of the errors of places, at least half a unit in the last place."""
    systems, x, sign, *_ = places
    low, high, least, most = ends
    bend = np.where(sign == 0.0, 0.0, np.where(sign > 0.0, least, -most))
    reach = np.maximum(np.abs(low), np.abs(high)) / bend
    here = systems.bend(x)
    change = np.maximum(*(np.abs(systems.bend(x + s * 2.0 * reach) - here) for s in (1.0, -1.0)))
    sure = (bend > 0.0) & (change < 0.5 * bend)
    error = np.where(sure, reach / (1.0 - change / bend), np.inf)
    rest = np.flatnonzero(~sure)
    if rest.size:
        few = places.take(rest)
        error[rest] = np.maximum(_searched(few, look, -1.0), _searched(few, look, 1.0))
    half = np.maximum(0.5 * np.spacing(np.abs(x)), np.nextafter(0.0, 1.0))
    return np.asarray(np.maximum(error * (1.0 + 1e-12), half))


def _searched(places: Places, look: Callable[[Systems, Array], Ends], side: float) -> Array:
    """How far to one side the sign of V' is known, and what it is beside a zero.

    Past another zero any sign will do: between the two V' cannot be told from 0.
    """
    systems, x, sign, *_ = places
    formula = systems.formula
    start, stop = formula.ends
    # On a line no zero beyond the end of the interval counts.
    limit = np.full(x.shape, 0.5 * (stop - start))
    if formula.period is None:
        limit = x - start if side < 0.0 else stop - x
    other = places.next(side)
    reach = np.maximum(np.spacing(np.abs(x)), min(stop - start, 1.0) * 1e-20)
    found = np.full(x.shape, np.inf)
    rows = np.arange(x.size)
    while rows.size:
        way = reach[rows]
        low, high, *_ = look(systems.take(rows), x[rows] + side * way)
        known = np.where(low > 0.0, 1.0, np.where(high < 0.0, -1.0, 0.0))
        done = (known != 0.0) & ((sign[rows] * known * side >= 0.0) | (way > other[rows]))
        past = ~done & (way >= limit[rows])
        found[rows[done]] = way[done]
        found[rows[past]] = way[past] if formula.period is None else np.inf
        rows = rows[~done & ~past & np.isfinite(way)]
        reach[rows] *= 2.0
    return found


# ------------------------------------------------------------------------- V' and V''


def _bounds(systems: Systems, x: Array) -> Ends:
    """Bounds in doubles; by what V' scatters where a function in it has none."""
    if slope_bounds(systems.formula) is None:
        return _scattered(systems, x)
    *found, undefined = bounds_on(systems, np.arange(systems.size), x, x)
    low, high, least, most = (
        np.where(undefined, end, value)
        for end, value in zip((-np.inf, np.inf) * 2, found, strict=True)
    )
    return low, high, least, most


def _scattered(systems: Systems, x: Array) -> Ends:
    """What V' and V'' may be, by how V' scatters about a line between neighboring doubles."""
    slope, bend = systems.slope(x), systems.bend(x)
    step = 16.0 * np.maximum(np.spacing(np.abs(x)), _TINY)[:, None] * np.arange(-8.0, 9.0)
    line = slope[:, None] + bend[:, None] * step
    off = np.max(np.abs(systems.slope(x[:, None] + step) - line), axis=1)
    off = 4.0 * off + 4.0 * _EPS * (np.abs(slope) + np.abs(bend * x))
    return slope - off, slope + off, bend, bend


def _fine(systems: Systems, x: Array) -> Ends:
    """Bounds with all digits, where there are more than doubles have."""
    ends, inner = _bounds(systems, x), values(systems, x, 1, 2)
    assert inner is not None
    found: list[Array] = []
    for (value, rest, off), low, high in zip(inner, ends[::2], ends[1::2], strict=True):
        width = high - low
        off = np.maximum(_FINER * width, off) + _EPS * np.abs(value)
        usable = (width > _TINY) & np.isfinite(off + rest)
        found += [np.where(usable, value - off, low), np.where(usable, value + off, high)]
    return found[0], found[1], found[2], found[3]


def _newton(systems: Systems, x: Array) -> Array:
    """Newton's method with all digits of V' and V''."""
    x, rows = x.copy(), np.arange(x.size)
    for _ in range(_STEPS):
        inner = values(systems.take(rows), x[rows], 1, 2)
        assert inner is not None
        (slope, *_), (bend, *_) = inner
        step = slope / bend
        step = np.where(np.isfinite(step), step, 0.0)
        x[rows] -= step
        rows = rows[np.abs(step) > 2.0 * np.spacing(np.abs(x[rows]))]
        if not rows.size:
            break
    return x
