"""Families of orbits in any potential, by the wells that they go round, and orbits by their action.

A family has a code: the sum of 2^k over the numbers k of its centers among the equilibria, or -1
and -2 for rotations forward and backward. Within a family the action rises with the energy, from
the highest saddle that its orbits pass to the lowest one that bounds them.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from phasekit.arrays import Array, Flags, Index, Ints
from phasekit.errors import EquilibriumKind, OrbitKind
from phasekit.phase.numerical.circle import wrapped
from phasekit.phase.numerical.differences import Ground
from phasekit.phase.numerical.motion import flow
from phasekit.phase.numerical.orbits import Orbits, States, orbits_of

FORWARD, BACKWARD = -1, -2
#: Greatest number of a center that a code holds.
MOST = 52
#: Steps of Newton's method at most, and what an action may miss of the one that is asked for.
_STEPS, FOUND_TO = 200, 1e-9
#: Parts of a width up to which a state may be wrong.
_WORST = 1e-7
_EPS = float(np.finfo(float).eps)


class Range(NamedTuple):
    """Energies of a family above its deepest center, one row a system; NaN where it is absent."""

    column: Ints
    low: Array
    high: Array


class StateWithErrors(NamedTuple):
    """States, with estimates of their errors."""

    phi_of_angle: Array
    dphi_of_angle: Array
    phi_of_angle_error: Array
    dphi_of_angle_error: Array


def numbers_of(code: int) -> tuple[int, ...]:
    """The numbers of the centers of a family of librations."""
    return tuple(k for k in range(MOST + 1) if code >> k & 1)


def codes_of(ground: Ground, orbit: Orbits, v: Array) -> Index:
    """Index of the families of orbits, one row of `ground` each; 0 for what is in none."""
    points, period = ground.points, ground.systems.formula.period
    place = points.phi - orbit.phi_min[:, None]
    if period is not None:
        place = place % period
    number = np.arange(points.phi.shape[1])
    with np.errstate(invalid="ignore"):
        inside = (place > 0.0) & (place < (orbit.phi_max - orbit.phi_min)[:, None])
    inside &= (points.kind == EquilibriumKind.CENTER) & (number <= MOST)
    inside &= (orbit.orbit_kind == OrbitKind.LIBRATION)[:, None]
    found = np.sum(inside.astype(np.int64) << np.minimum(number, MOST), axis=1)
    turns = orbit.orbit_kind == OrbitKind.ROTATION
    return np.where(turns, np.where(v > 0.0, FORWARD, BACKWARD), found).astype(np.int64)


def range_of(ground: Ground, code: int) -> Range:
    """Energies of a family in each system."""
    size, width = ground.points.phi.shape
    nothing = Range(np.zeros(size, np.intp), np.full(size, np.nan), np.full(size, np.nan))
    if not width or code == 0:
        return nothing
    if code < 0:
        return _rotations(ground) if ground.systems.formula.period is not None else nothing
    found = nothing
    for columns in ground.columns_of(numbers_of(code)):
        one = _librations(ground, columns)
        better = np.isnan(found.low)
        found = Range._make(np.where(better, x, y) for x, y in zip(one, found, strict=True))
    return found


def _rotations(ground: Ground) -> Range:
    """Those that pass every equilibrium, by their energies above the lowest center."""
    points = ground.points
    centers = points.kind == EquilibriumKind.CENTER
    column = np.argmin(np.where(centers, points.energy, np.inf), axis=1)
    rise = -ground.above(column)
    low = np.max(np.where(np.isfinite(rise), rise, -np.inf), axis=1)
    low = np.where(centers.any(axis=1), low, np.nan)
    return Range(column, low, np.where(np.isnan(low), np.nan, np.inf))


def _librations(ground: Ground, columns: Ints) -> Range:
    """Those round centers in some columns, where there are these and they are neighbors."""
    points, rows = ground.points, np.arange(len(columns))[:, None]
    centers = points.kind == EquilibriumKind.CENTER
    there = ((columns >= 0) & centers[rows, columns]).all(axis=1)
    member = np.zeros(centers.shape, dtype=bool)
    member[rows, columns] = there[:, None]
    column = np.argmin(np.where(member, points.energy, np.inf), axis=1)
    low, high = _walls(ground, member, centers, -ground.above(column), column)
    there &= low < high
    low, high = (np.where(there, x, np.nan) for x in (low, high))
    return Range(np.where(there, column, 0), low, high)


def _walls(
    ground: Ground, member: Flags, centers: Flags, rise: Array, column: Ints
) -> tuple[Array, Array]:
    """The highest barrier between the members, and the lowest one around them."""
    right, beside = _barriers(ground, centers, rise, column, 1)
    left, _ = _barriers(ground, centers, rise, column, -1)
    rows = np.arange(len(member))
    following = np.where(beside >= 0, member[rows[:, None], beside], False)
    last = member & ~following
    # The first ones, whose center before is none of them: as many as last ones.
    before = np.zeros(member.shape, dtype=bool)
    cell, slot = np.nonzero(member & (beside >= 0))
    before[cell, beside[cell, slot]] = True
    first = member & ~before
    low = np.max(np.where(member & following, right, 0.0), axis=1, initial=0.0)
    high = np.min(np.where(last, right, np.inf), axis=1)
    high = np.minimum(high, np.min(np.where(first, left, np.inf), axis=1))
    # All round the circle the highest barrier is the one that is not passed.
    whole = ~last.any(axis=1)
    inner = np.sort(np.where(member, right, -np.inf), axis=1)
    low = np.where(whole, np.maximum(inner[:, -2], 0.0) if inner.shape[1] > 1 else 0.0, low)
    high = np.where(whole, inner[:, -1], high)
    apart = last.sum(axis=1) > 1
    return low, np.where(apart, -np.inf, high)


def _barriers(
    ground: Ground, centers: Flags, rise: Array, column: Ints, side: int
) -> tuple[Array, Ints]:
    """The highest point from each center to the next one on a side, and the column of that, or -1.

    On a line the last one is bounded by what V rises to at the end.
    """
    points = ground.points
    size, width = rise.shape
    run, last = rise_at_end(ground, column, side), np.full(size, -1)
    barrier, beside = np.full(rise.shape, np.nan), np.full((size, width), -1)
    order = range(width)[::-side]
    for _ in range(1 if ground.systems.formula.period is None else 2):
        for j in order:
            there, center = np.isfinite(points.phi[:, j]), centers[:, j]
            barrier[:, j] = np.where(center, run, barrier[:, j])
            beside[:, j] = np.where(center, last, beside[:, j])
            run = np.where(center, -np.inf, np.where(there, np.maximum(run, rise[:, j]), run))
            last = np.where(center, j, last)
    return barrier, beside


def rise_at_end(ground: Ground, column: Ints, side: int) -> Array:
    """What V rises to at the end of the line above the deepest center; -inf where it falls."""
    points, systems = ground.points, ground.systems
    formula, rows = systems.formula, np.arange(column.size)
    if formula.period is not None:
        return np.full(rows.shape, -np.inf)
    end = formula.ends[0 if side < 0 else 1]
    if np.isfinite(end):
        at = np.full(rows.shape, end)
        return np.asarray(systems.potential(at) - points.energy[rows, column])
    outer = np.fmax.reduce(side * points.phi, axis=1)
    beyond = side * (outer + 1.0 + np.abs(outer))
    return np.where(side * systems.slope(beyond) > 0.0, np.inf, -np.inf)


def at_rise(ground: Ground, column: Ints, rise: Array) -> Orbits:
    """Orbits of energies above a center of each system."""
    return above_anchor(ground, column, column, rise)


def above_anchor(ground: Ground, column: Ints, anchor: Ints, gap: Array) -> Orbits:
    """Orbits round a center of each system, by their energies above another equilibrium."""
    rows = np.arange(column.size)
    excess = gap[:, None] + ground.above(anchor)
    error = ground.blur + ground.blur[rows, anchor][:, None] + _EPS * np.abs(excess)
    error[rows, anchor] = 0.0
    x, still, rise = ground.points.phi[rows, column], np.zeros(gap.shape), excess[rows, column]
    states = States(x, still, rise, excess, np.zeros(excess.shape), error)
    return orbits_of(ground, states, np.sqrt(2.0 * rise))


def rise_of_action(ground: Ground, span: Range, action: Array) -> tuple[Array, Orbits]:
    """Energies above the deepest center of orbits that have an action, and these orbits.

    Newton's method, as the action rises with the energy by one over the frequency. NaN where the
    family has no such orbit.
    """
    low, high = span.low.copy(), span.high.copy()
    with np.errstate(all="ignore"):
        bend = np.sqrt(ground.points.curvature[np.arange(low.size), span.column])
        guess = np.maximum(low, 0.0) + action * bend
        inside = (guess > low) & (guess < high)
        finite = np.where(np.isfinite(high), 0.5 * (low + high), 2.0 * low + 1.0)
        rise = np.where(inside, guess, finite)
    rise = np.where(np.isfinite(action) & (action > 0.0), rise, np.nan)
    best, going = np.full(rise.shape, np.nan), np.flatnonzero(np.isfinite(rise))
    for _ in range(_STEPS):
        if not going.size:
            break
        orbit = at_rise(ground.take(going), span.column[going], rise[going])
        with np.errstate(all="ignore"):
            missed = action[going] - orbit.action
            step = missed * orbit.frequency
            over = ~(missed > 0.0)  # next to the separatrix, where it is not known, as well
            high[going] = np.where(over, rise[going], high[going])
            low[going] = np.where(over, low[going], rise[going])
            fresh = rise[going] + step
            a, b = low[going], high[going]
            middle = np.where(np.isfinite(b), 0.5 * (a + b), 2.0 * rise[going])
            fresh = np.where((fresh > a) & (fresh < b), fresh, middle)
            known = np.fmax(orbit.action_error, 4.0 * _EPS * action[going])
            found = np.abs(missed) <= known
            still = found | ~(np.abs(fresh - rise[going]) > 2.0 * _EPS * fresh)
        rise[going] = np.where(found, rise[going], fresh)
        best[going[still]] = rise[going[still]]
        going = going[~still]
    orbit = at_rise(ground, span.column, np.where(np.isnan(best), 0.0, best))
    with np.errstate(invalid="ignore"):
        good = np.abs(orbit.action - action) <= FOUND_TO * action
    return np.where(good, best, np.nan), orbit


def states_of_action(ground: Ground, action: Array, angle: Array, family: Array) -> StateWithErrors:
    """States by action, angle variable and code of the family, one row of `ground` each."""
    out = np.full((4, action.size), np.nan)
    if not ground.points.phi.shape[1]:
        return StateWithErrors._make(out)
    code = np.where(np.isfinite(family), family, 0.0)
    for one in np.unique(code[code == np.round(code)]):
        rows = np.flatnonzero(code == one)
        out[:, rows] = _states(ground.take(rows), action[rows], angle[rows], int(one))
    return StateWithErrors._make(out)


def _states(ground: Ground, action: Array, angle: Array, code: int) -> Array:
    span = range_of(ground, code)
    rise, orbit = rise_of_action(ground, span, action)
    points, own = ground.points, (np.arange(action.size), span.column)
    center, still = points.phi[own], np.zeros(action.shape)
    resting = (action == 0.0) & (span.low == 0.0) & np.isfinite(angle) & (code > 0)
    out = np.where(resting, np.stack([center, still, points.phi_error[own], still]), np.nan)
    some = np.flatnonzero(np.isfinite(rise) & np.isfinite(angle) & ~resting)
    if not some.size:
        return out
    orbit = Orbits._make(field[some] for field in orbit)
    few, sense = ground.take(some), 1.0 if code == FORWARD else -1.0
    start, speed = orbit.phi_max, np.zeros(some.size)
    if code < 0:
        start, speed = center[some], sense * np.sqrt(2.0 * rise[some])
    turn = 2.0 * np.pi
    part = angle[some] / turn - np.round(angle[some] / turn)
    found = flow(few, start, speed, np.arange(some.size), part * orbit.period)
    x, v, x_error, v_error = found
    with np.errstate(all="ignore"):
        off = orbit.frequency * (np.abs(orbit.action - action[some]) + orbit.action_error)
        late = np.abs(part) * orbit.period_error + turn * _EPS / orbit.frequency
        swing = np.sqrt(2.0 * rise[some])
        push = np.abs(few.systems.slope(orbit.phi_max)) if code > 0 else orbit.frequency * swing
        x_error = x_error + off / push + np.abs(v) * late
        v_error = v_error + off / swing + np.abs(few.systems.slope(x)) * late
        size = orbit.phi_max - orbit.phi_min if code > 0 else ground.circle or 1.0
        known = (x_error <= _WORST * size) & (v_error <= _WORST * swing)
    if ground.circle is not None:
        x = wrapped(x, ground.circle)[0]
    x, v = (np.where(known, value, np.nan) for value in (x, v))
    out[:, some] = x, v, *(np.where(np.isnan(error), np.inf, error) for error in (x_error, v_error))
    return out
