"""Errors of orbits: bounds of those of turning points, and what those of the energy do.

Where V differs from the energy by more than rounding may have moved either, on the inner side
below and on the outer side above, the turning point lies between. Flat tails of V and the
neighborhood of saddles ask for wide brackets.

Next to a saddle of exponent k, passed or approached with the energy e above or below it, an orbit
spends the time ``-log|e|/k`` and what is regular in e. So an error of e changes the period by
``1/(k |e|)`` of it, and the action by the period over 2 pi.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt

from phasekit.arrays import Array
from phasekit.errors import EquilibriumKind, OrbitKind
from phasekit.numerics.contract import row_sums
from phasekit.phase.numerical.differences import Ground
from phasekit.phase.numerical.formula_bounds import noise, slope_noise
from phasekit.phase.numerical.turning_points import End, distances

_EPS = float(np.finfo(float).eps)
#: What underflow may take from a sum of a few products.
_TINY = 64.0 * 5e-324
#: How often a bracket is widened; then nothing is known.
_TRIES = 150


def turning_errors(
    ground: Ground, states: Any, kind: Any, ends: Any, rests: Any
) -> tuple[Array, Array]:
    """Bounds of the errors of the least and greatest coordinate of orbits.

    Ground and states have one row for each orbit; ends are left and right; rests tell for each side
    which orbits come to rest, and the column of the equilibrium.
    """
    x, points = states.x, ground.points
    here = np.max(np.where(points.phi == x[:, None], _place_errors(points), 0.0), 1, initial=0.0)
    given = _EPS * (np.abs(x) + np.where(states.turns == 0.0, 0.0, np.abs(states.turns + x)))
    found = []
    for side, end, (rest, column) in zip((-1.0, 1.0), ends, rests, strict=True):
        rows = np.flatnonzero(~rest & (kind >= OrbitKind.LIBRATION))
        error = np.zeros(x.shape)
        error[rows] = _bracket(ground.take(rows), _rows(states, rows), end.take(rows), side)
        rows = np.flatnonzero(rest)
        error[rows] = _rest(ground.take(rows), _rows(states, rows), column[rows])
        error = np.where(kind == OrbitKind.EQUILIBRIUM, here, error)
        # Given states are exact, but for what wrapping takes from them.
        given_ = np.where(end.offset == 0.0, given - _EPS * np.abs(x), given)
        size = np.where(np.isfinite(end.offset), np.abs(x) + np.abs(end.offset), 0.0)
        error = error + np.where(kind == OrbitKind.EQUILIBRIUM, 0.0, given_)
        error = error + np.where(end.offset > 0.0, 4.0 * _EPS * size, 0.0)
        absent = (kind == OrbitKind.ROTATION) | (kind == OrbitKind.NOT_COMPUTED)
        found.append(np.where(absent, np.nan, error))
    return found[0], found[1]


def _place_errors(points: Any) -> Array:
    """How far off equilibria are, as what is at rest in their place is: on its other side."""
    return np.asarray(np.where(points.kind == EquilibriumKind.CENTER, 2.0, 1.0) * points.phi_error)


def _rows(states: Any, rows: Any) -> Any:
    return states._make(field[rows] for field in states)


def _rest(ground: Ground, states: Any, column: Array) -> Array:
    """Errors of ends at saddles: orbits that rounding does not tell from it turn before."""
    rows, points = np.arange(len(column)), ground.points
    error = (states.error + states.blur + np.abs(states.excess))[rows, column]
    bend = np.abs(points.curvature[rows, column])
    return np.asarray(points.phi_error[rows, column] + np.sqrt(2.0 * error / bend))


def _bracket(ground: Ground, states: Any, end: End, side: float) -> Array:
    """Half the width of stretches round turning points at whose ends V is certain."""
    anchor, u = end.anchor, end.u
    systems, far = anchor.systems, ~np.isfinite(end.offset)
    limit = systems.formula.ends[1 if side > 0.0 else 0] - anchor.at
    u = np.where(far, limit, u)
    same = ground.points.phi == anchor.at[:, None]
    slope = np.max(np.where(same, ground.slope, 0.0), axis=1, initial=0.0)
    own = np.max(np.where(same, states.error, 0.0), axis=1, initial=0.0)
    energy = 2.0 * np.where(same.any(axis=1), own, 2.0 * _EPS * states.kinetic)
    energy = energy + _EPS * np.abs(end.excess) + _TINY

    def over(u: Array) -> tuple[Array, Array]:
        """V above the energy, and by how much that may be wrong."""
        place, near = anchor.at + u, np.abs(u) < anchor.near
        size = 8.0 * _EPS * u * u * (np.abs(systems.bend(anchor.at)) + np.abs(systems.bend(place)))
        wide = sum(noise(systems, at, systems.potential(at)) for at in (anchor.at, place))
        rise = anchor.rise(u)
        off = np.where(near, size + _EPS * np.abs(rise), 2.0 * wide)
        return rise - end.excess, off + energy + slope * np.abs(u)

    value, off = over(u)
    never = np.isinf(limit) | (value < -off)  # no end, certainly: that V falls for ever is proved
    width = np.maximum(1.1 * off / np.abs(anchor.slope(u)), 2.0 * np.spacing(np.abs(anchor.at + u)))
    found = np.where(far, np.where(never, 0.0, np.inf), np.nan)
    start = np.abs(systems.slope(states.x))
    sure = start > 2.0 * slope_noise(systems, states.x, start)
    resting = (end.offset == 0.0) & (states.kinetic == 0.0)
    found = np.where(resting, np.where(sure, 0.0, np.inf), found)
    for _ in range(_TRIES):
        if not np.isnan(found).any():
            break
        (outer, more), (inner, less) = over(u + side * width), over(u - side * width)
        good = (outer > more) & ((inner < -less) | (width >= end.offset))
        found = np.where(np.isnan(found) & good, width, found)
        width = 1.5 * width
    return np.where(np.isnan(found), np.inf, found)


def faint(ground: Ground, states: Any, v: Array) -> npt.NDArray[np.bool_]:
    """Orbits whose energies no doubles hold: too large, or too small next to a flat place."""
    systems, points, x = ground.systems, ground.points, states.x
    shown = (systems.potential(x), systems.slope(x), systems.bend(x), states.kinetic)
    lost = ~np.isfinite(np.sum(np.abs(shown), axis=0))
    lost |= np.any(np.isinf(states.excess) | np.isinf(states.blur), axis=1)
    away = np.abs(x[:, None] - points.phi)
    if systems.formula.period is not None:
        away = np.minimum(away, systems.formula.period - away)
    nearest = np.nanmin(np.where(np.isnan(away), np.inf, away), axis=1, initial=np.inf)
    own = (away == nearest[:, None]) & (points.kind != EquilibriumKind.CENTER)
    least = float(np.finfo(float).tiny)
    small = own & (np.abs(states.excess) < least) & (states.kinetic < least)[:, None]
    moved = (nearest > 0.0) | (v != 0.0)
    return np.asarray(lost | (moved & small.any(axis=1)))


def errors_of_energies(
    ground: Ground, states: Any, left: End, right: End, period: Array
) -> tuple[Array, Array]:
    """Errors of the periods and actions of librations and rotations, by those of their energies.

    One row of `ground` for each orbit; its `States`, ends and period.
    """
    points, turned = ground.points, left.turned & right.turned
    (near, away), (other, beyond) = (_end_errors(ground, states, end) for end in (left, right))
    ends = np.maximum(near, other)
    whole = np.where(turned, np.fmin.reduce(states.error, axis=1, initial=np.inf), ends)
    visits = np.where(turned[:, None], 1.0, _visits(ground, states.x, left, right))
    error = np.where(visits > 0.0, states.error + away + beyond, 0.0)
    size = np.abs(states.excess)
    part = np.where(error > 0.0, error / size, 0.0)
    saddle = points.kind == EquilibriumKind.SADDLE
    flat = points.kind == EquilibriumKind.DEGENERATE
    time = np.where(saddle, visits * part / points.exponent, 0.0)
    time += np.where(flat, part * period[:, None], 0.0)
    center = (points.kind == EquilibriumKind.CENTER) & (visits > 0.0)
    depth = np.min(np.where(center, size, np.inf), axis=1, initial=np.inf)
    regular = np.where(whole > 0.0, whole / depth, 0.0) * period
    regular *= np.where(turned, 1.0, _bent(ground, states.x, left, right))
    return np.asarray(row_sums(time) + regular), whole * period / (2.0 * np.pi)


def _end_errors(ground: Ground, states: Any, end: End) -> tuple[Array, Array]:
    """Errors of the energies at turning points, and what of it differences of V do to whose."""
    same = ground.points.phi == end.anchor.at[:, None]
    own = 2.0 * _EPS * states.kinetic  # of the state itself
    error = np.where(same.any(axis=1), np.max(np.where(same, states.error, 0.0), 1, initial=0), own)
    away = np.zeros(own.shape)
    rows = np.flatnonzero(~(np.abs(end.u) < end.anchor.near) & np.isfinite(end.u))
    if rows.size:
        few = end.anchor.take(rows)
        for place in (few.at, few.at + end.u[rows]):
            away[rows] += noise(few.systems, place, few.systems.potential(place))
    return error + away, np.where(same, away[:, None], 0.0)


def _visits(ground: Ground, x: Array, left: End, right: End) -> Array:
    """How often a round of a libration passes, or approaches, each equilibrium."""
    visits = np.zeros(ground.points.phi.shape)
    inside = ground.points.phi == x[:, None]
    for side, end in ((-1.0, left), (1.0, right)):
        way = distances(ground, x, side)
        way = np.where((way > 0.0) & np.isfinite(way), way, np.inf)
        passed = way <= end.offset[:, None]
        inside |= passed
        beyond = np.where(passed, np.inf, way)
        next_ = np.min(beyond, axis=1, initial=np.inf)
        visits += np.isfinite(beyond) & (beyond == next_[:, None])
    return np.where(inside, 2.0, visits)


def _bent(ground: Ground, x: Array, left: End, right: End) -> Array:
    """By how much V'' changes over arcs, as part of it, at most 1: without it no period changes."""
    systems = ground.systems
    here, low, high = (
        systems.bend(np.where(np.isfinite(place), place, x))
        for place in (x, x - left.offset, x + right.offset)
    )
    most, least = np.maximum(np.maximum(here, low), high), np.minimum(np.minimum(here, low), high)
    return np.where(least > 0.0, np.minimum((most - least) / least, 1.0), 1.0)
