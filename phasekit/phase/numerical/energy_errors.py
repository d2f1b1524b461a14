"""What errors of the energy do to periods and actions.

Next to a saddle of exponent k, passed or approached with the energy e above or below it, an orbit
spends the time ``-log|e|/k`` and what is regular in e. So an error of e changes the period by
``1/(k |e|)`` of it, and the action by the period over 2 pi.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt

from phasekit.errors import EquilibriumKind
from phasekit.numerics.contract import row_sums
from phasekit.phase.numerical.differences import Ground
from phasekit.phase.numerical.formula_bounds import noise
from phasekit.phase.numerical.turning_points import End, distances

Array = npt.NDArray[np.float64]
_EPS = float(np.finfo(float).eps)


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
