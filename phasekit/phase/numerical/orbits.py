"""Period, action and turning points of orbits, by quadrature over their arcs."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from phasekit.arrays import Array, Ints
from phasekit.errors import EquilibriumKind, OrbitKind
from phasekit.phase.numerical.circle import wrapped
from phasekit.phase.numerical.differences import Anchor, Ground
from phasekit.phase.numerical.formula_bounds import noise
from phasekit.phase.numerical.orbit_errors import errors_of_energies, faint, turning_errors
from phasekit.phase.numerical.periods import WORST, librations, rotations
from phasekit.phase.numerical.systems import Systems
from phasekit.phase.numerical.turning_points import End, find_end

_EPS = float(np.finfo(float).eps)


class Orbits(NamedTuple):
    """Orbits of systems, as of `phasekit.phase.exact.orbits`, with estimates of errors."""

    orbit_kind: npt.NDArray[np.int8]
    """`OrbitKind`."""
    orbit_energy: Array
    period: Array
    frequency: Array
    action: Array
    phi_min: Array
    phi_max: Array
    amplitude: Array
    period_error: Array
    """Estimated error of the period, by its quadrature; 0 where the period is infinite."""
    action_error: Array
    phi_min_error: Array
    """Bound of the error of the least coordinate; infinite where rounding hides where it is."""
    phi_max_error: Array


class States(NamedTuple):
    """Where orbits are: one row each."""

    x: Array
    """Coordinate; on a circle wrapped to its ends."""
    turns: Array
    """What wrapping has taken away."""
    kinetic: Array
    """v^2/2."""
    excess: Array
    """Energy above each equilibrium, shape (orbits, equilibria)."""
    blur: Array
    """What rounding of the state may have done to that."""
    error: Array
    """What rounding on the way to it may have done."""


@np.errstate(all="ignore")  # of energies beyond all doubles
def states_of(ground: Ground, x: Array, v: Array) -> States:
    """Lay out states; the energy above an equilibrium next to a state keeps its digits."""
    home, turns = _wrapped(ground, x)
    kinetic = 0.5 * v * v
    points, systems = ground.points, ground.systems
    height = systems.potential(home)
    # The digits that a state shares with an equilibrium are not lost in their energy.
    excess = kinetic[:, None] + (height[:, None] - points.energy)
    slope = np.abs(systems.slope(home) * home)
    blur = 2.0 * _EPS * (2.0 * kinetic + slope)[:, None] + 4.0 * _EPS * np.maximum(
        np.abs(height)[:, None], np.abs(points.energy)
    )
    away = noise(systems, home, height) + _EPS * np.where(turns == 0.0, 0.0, slope)
    error = (away + _EPS * kinetic)[:, None] + _EPS * np.abs(excess) + ground.blur
    if points.phi.shape[1]:
        offset = home[:, None] - points.phi
        period = systems.formula.period
        if period is not None:
            offset = offset - period * np.round(offset / period)
        rows, columns = np.nonzero(np.abs(offset) < ground.near)
        if rows.size:
            at, near = points.phi[rows, columns], ground.near[rows, columns]
            few, u = systems.take(rows), offset[rows, columns]
            excess[rows, columns] = kinetic[rows] + Anchor(few, at, near).rise(u)
            size = u * u * (np.abs(few.bend(at)) + np.abs(few.bend(at + u)))
            blur[rows, columns] = 2.0 * _EPS * ((2.0 * kinetic + slope)[rows] + size)
            off = 2.0 * _EPS * (kinetic[rows] + size)
            error[rows, columns] = off + np.abs(u) * ground.slope[rows, columns]
    return States(home, turns, kinetic, excess, blur, error)


def _wrapped(ground: Ground, x: Array) -> tuple[Array, Array]:
    period = ground.systems.formula.period
    if period is None:
        low, high = ground.systems.formula.ends
        return np.where((x >= low) & (x <= high), x, np.nan), np.zeros(x.shape)
    return wrapped(x, period)


def orbits(ground: Ground, x: Array, v: Array) -> Orbits:
    """Orbits through states; one row of `ground` for each."""
    return orbits_of(ground, states_of(ground, x, v), v)


def orbits_of(ground: Ground, states: States, v: Array) -> Orbits:
    """Orbits of states whose energies above the equilibria are given."""
    x, points, systems = states.x, ground.points, ground.systems
    with np.errstate(all="ignore"):
        left = find_end(ground, x, states.kinetic, states.excess, -1.0)
        right = find_end(ground, x, states.kinetic, states.excess, 1.0)
        valid = np.isfinite(x) & np.isfinite(v) & (points.n_equilibria >= 0)
        valid &= ~faint(ground, states, v)
        at_rest = (v == 0.0) & (
            (ground.systems.slope(x) == 0.0) | np.any(points.phi == x[:, None], axis=1)
        )
        ends = resting_ends(ground, states)
        rests = []
        for (column, distance), end in zip(ends, (left, right), strict=True):
            rests.append((column >= 0) & ~_turned_back(states, end.offset, distance))
        reached = rests[0] | rests[1]
        kind = np.select(
            [~valid, at_rest, reached, left.turned & right.turned,
             np.isinf(left.offset) | np.isinf(right.offset)],
            [OrbitKind.NOT_COMPUTED, OrbitKind.EQUILIBRIUM, OrbitKind.ASYMPTOTIC,
             OrbitKind.ROTATION, OrbitKind.UNBOUNDED],
            OrbitKind.LIBRATION,
        ).astype(np.int8)  # fmt: skip
        found = np.full((4, *x.shape), np.nan)
        period, action, period_error, action_error = found
        rows = np.flatnonzero(kind == OrbitKind.LIBRATION)
        if rows.size:
            found[:, rows] = librations(
                ground.take(rows), x[rows], states.excess[rows], left.take(rows), right.take(rows)
            )
            lost = rows[np.isnan(left.offset[rows] + right.offset[rows])]
            found[:2, lost], found[2:, lost] = np.nan, np.inf
            # The double next to a center: no arc is left, and the period is that of the center.
            still = rows[~(left.offset[rows] + right.offset[rows] > 0.0)]
            bend = ground.systems.take(still).bend(x[still])
            period[still], action[still] = 2.0 * np.pi / np.sqrt(bend), 0.0
            period_error[still], action_error[still] = 4.0 * _EPS * period[still], 0.0
        rows = np.flatnonzero(kind == OrbitKind.ROTATION)
        if rows.size:
            found[:, rows] = rotations(
                ground.take(rows), x[rows], states.kinetic[rows], states.excess[rows]
            )
        rows = np.flatnonzero(
            ((kind == OrbitKind.LIBRATION) | (kind == OrbitKind.ROTATION)) & np.isfinite(period)
        )
        if rows.size:
            off = np.stack(errors_of_energies(ground, states, left, right, period))
            found[2:, rows] += off[:, rows]
            found[:2][~(found[2:] <= WORST * found[:2])] = np.nan
        bend = ground.systems.bend(x)
        degenerate = np.any(
            (points.phi == x[:, None]) & (points.kind == EquilibriumKind.DEGENERATE), axis=1
        )
        small = np.where(degenerate | (bend <= 0.0), np.inf, 2.0 * np.pi / np.sqrt(bend))
        endless = (kind == OrbitKind.ASYMPTOTIC) | (kind == OrbitKind.UNBOUNDED)
        period = np.where(at_rest & valid, small, np.where(endless, np.inf, period))
        center = at_rest & np.isfinite(small) & valid
        action = np.where(center, 0.0, action)
        period_error = np.where(center, 4.0 * _EPS * small, period_error)
        period_error = np.where(np.isinf(period), 0.0, period_error)
        action_error = np.where(center, 0.0, action_error)
        energy = np.where(valid, states.kinetic + ground.systems.potential(x), np.nan)
        low, high = (
            np.where(rest, distance, end.offset)
            for rest, (_, distance), end in zip(rests, ends, (left, right), strict=True)
        )
        low, high = (
            states.turns + _turning_point(x, side * np.where(at_rest, 0.0, reach), end, systems)
            for side, reach, end in ((-1.0, low, left), (1.0, high, right))
        )
        columns = [(rest, column) for rest, (column, _) in zip(rests, ends, strict=True)]
        errors = turning_errors(ground, states, kind, (left, right), columns)
        round_ = (kind == OrbitKind.ROTATION) | ~valid
        low, high = np.where(round_, np.nan, low), np.where(round_, np.nan, high)
        # Where rounding hides whether a motion turns back in a flat tail, which is above it.
        unseen = (kind == OrbitKind.UNBOUNDED) & np.isinf(errors)
        if unseen.any():
            tails = [systems.potential(np.full(x.shape, end)) for end in systems.formula.ends]
            unseen &= np.array(tails) > energy
        unseen = unseen.any(axis=0)
        period = np.where(unseen, np.nan, period)
        period_error = np.where(unseen, np.inf, period_error)
        frequency = 2.0 * np.pi / period
    reach = 0.5 * (high - low)
    return Orbits(
        kind, energy, period, frequency, action, low, high, reach, period_error, action_error,
        *errors,
    )  # fmt: skip


def _turning_point(x: Array, way: Array, end: End, systems: Systems) -> Array:
    """Where an arc ends: from the start, or from the end's anchor, which may be nearer."""
    place = end.anchor.at + end.u
    if systems.formula.period is not None:
        place = place + systems.formula.period * np.round(
            (x + way - place) / systems.formula.period
        )
    same = np.abs(place - (x + way)) <= 1e-9 * np.abs(way)
    return np.where(same & (np.abs(end.u) < np.abs(way)), place, x + way)


def _ways(ground: Ground, x: Array, side: float) -> Array:
    """How far each equilibrium lies on one side, 0 at x itself."""
    way = side * (ground.points.phi - x[:, None])
    period = ground.systems.formula.period
    return way if period is None else way % period


def resting_ends(ground: Ground, states: States) -> list[tuple[Ints, Array]]:
    """For each side (left, right), the equilibrium at which an orbit comes to rest, and how far.

    -1 where there is none before something turns the orbit back.
    """
    level = (ground.points.kind != EquilibriumKind.CENTER) & (np.abs(states.excess) <= states.blur)
    higher = states.excess < -states.blur
    ends = []
    for side in (-1.0, 1.0):
        way = _ways(ground, states.x, side)
        # On a line what lies on the other side has a negative way.
        way = np.where(way >= 0.0, way, np.inf)
        ways = np.where(level, way, np.inf)
        wall = np.min(np.where(higher, way, np.inf), axis=1, initial=np.inf)
        nearest = np.min(ways, axis=1, initial=np.inf)
        column = np.argmin(ways, axis=1) if ways.shape[1] else np.zeros(len(way), np.intp)
        ends.append(
            (np.where(nearest < wall, column, -1), np.where(nearest < wall, nearest, np.inf))
        )
    return ends


def _turned_back(states: States, offset: Array, distance: Array) -> npt.NDArray[np.bool_]:
    """Whether the orbit turns clearly before a distance."""
    return np.asarray(offset < distance - 1e-6 * (1.0 + np.abs(states.x)))
