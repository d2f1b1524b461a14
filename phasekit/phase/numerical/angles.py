"""The angle variable of states in any potential: the time since the orbit's origin, found back.

A libration begins at its greatest coordinate, a rotation at the lowest center. The state is looked
for among states on a coarse grid of times, where the coordinate is monotone, then by Newton's
method on the exact motion: in the direction of the flow, which vanishes at no state of an orbit.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from phasekit.arrays import Array, Ints
from phasekit.errors import EquilibriumKind, OrbitKind
from phasekit.phase.numerical.differences import Ground
from phasekit.phase.numerical.families import codes_of
from phasekit.phase.numerical.motion import MotionWithErrors, flow
from phasekit.phase.numerical.orbits import Orbits, orbits

#: Times of the coarse grid over half a libration, or one turn.
_GRID = 16
_STEPS = 8
#: Angles whose error may be larger than this are not given, rad.
WORST = 1e-7


class AnglesWithErrors(NamedTuple):
    """Angle variables; twist is known in closed form alone."""

    orbit_family: npt.NDArray[np.integer[Any]]
    """Code of the family: the sum of 2^k over the numbers k of its centers, or of a rotation."""
    angle: Array
    twist: Array
    angle_error: Array


def angles(ground: Ground, x: Array, v: Array) -> AnglesWithErrors:
    """Angle variables of states, one row of `ground` each."""
    orbit = orbits(ground, x, v)
    angle, error = np.full(x.shape, np.nan), np.full(x.shape, np.nan)
    center = (orbit.orbit_kind == OrbitKind.EQUILIBRIUM) & np.isfinite(orbit.period)
    angle[center], error[center] = 0.0, 0.0
    moving = np.isin(orbit.orbit_kind, (OrbitKind.LIBRATION, OrbitKind.ROTATION))
    rows = np.flatnonzero(moving & np.isfinite(orbit.period) & (orbit.period > 0.0))
    if rows.size:
        few = Orbits._make(field[rows] for field in orbit)
        angle[rows], error[rows] = _angles(ground.take(rows), few, x[rows], v[rows])
    family = codes_of(ground, orbit, v)
    return AnglesWithErrors(family, angle, np.full(x.shape, np.nan), error)


def _angles(ground: Ground, orbit: Orbits, x: Array, v: Array) -> tuple[Array, Array]:
    turns = orbit.orbit_kind == OrbitKind.ROTATION
    start, speed = _origins(ground, orbit, x, v)
    # The second half of a libration is the first one backwards.
    target = np.where(turns, v, -np.abs(v))
    whole = np.where(turns, orbit.period, 0.5 * orbit.period)
    size, rows = x.size, np.arange(x.size)

    def motion(owner: Ints, times: Array) -> MotionWithErrors:
        return flow(ground, start, speed, owner, times)

    grid = np.linspace(0.0, 1.0, _GRID + 1)
    owner = np.repeat(rows, grid.size)
    places = motion(owner, (whole[:, None] * grid).reshape(-1))[0].reshape(size, grid.size)
    sense = np.where(turns & (v > 0.0), 1.0, -1.0)[:, None]
    passed = np.clip(np.sum(sense * (places - x[:, None]) <= 0.0, axis=1) - 1, 0, _GRID - 1)
    first, last = places[rows, passed], places[rows, passed + 1]
    with np.errstate(all="ignore"):
        share = np.clip(np.nan_to_num((x - first) / (last - first)), 0.0, 1.0)
        low, high = whole * grid[passed], whole * grid[passed + 1]
        time = low + share * (high - low)
        pace = 2.0 * np.pi / orbit.period
        step, going = np.zeros(size), rows
        for _ in range(_STEPS):
            here, rate, *_ = motion(going, time[going])
            push, tempo = -ground.systems.take(going).slope(here), pace[going]
            off = (tempo * (x[going] - here), target[going] - rate)
            pull = np.hypot(tempo * rate, push)  # whose square may not be a double
            step[going] = np.nan_to_num(
                off[0] / pull * (tempo * rate / pull) + off[1] / pull * (push / pull)
            )
            time[going] = np.clip((time + step)[going], low[going], high[going])
            going = going[np.abs(pace * step)[going] > 4e-15]
            if not going.size:
                break
        here, rate, *blurs = motion(rows, time)
        left = pace * np.abs(x - here) + np.abs(target - rate)
        size_of = np.hypot(pace * rate, ground.systems.slope(here))
        left = left + pace * blurs[0] + blurs[1]
        # What is not known of the energy changes the time from its origin.
        late = orbit.period_error / orbit.period
        error = pace * left / size_of + np.abs(pace * step) + 2.0 * np.pi * late
    angle = pace * time
    back = ~turns & (v > 0.0)
    angle = np.where(back, 2.0 * np.pi - angle, angle) % (2.0 * np.pi)
    return np.where(error <= WORST, angle, np.nan), error


def _origins(ground: Ground, orbit: Orbits, x: Array, v: Array) -> tuple[Array, Array]:
    """Where the angle is 0: at rest at the greatest coordinate, or on the way past a center."""
    points, period = ground.points, ground.systems.formula.period
    if period is None or not (orbit.orbit_kind == OrbitKind.ROTATION).any():
        return orbit.phi_max, np.zeros(x.shape)
    centers = np.where(points.kind == EquilibriumKind.CENTER, points.energy, np.inf)
    column = np.argmin(centers, axis=1)
    rows = np.arange(x.size)
    center, bottom = points.phi[rows, column], points.energy[rows, column]
    way = np.sign(v) * (x - center) % period
    speed = np.sign(v) * np.sqrt(2.0 * (orbit.orbit_energy - bottom))
    turns = orbit.orbit_kind == OrbitKind.ROTATION
    start = np.where(turns, x - np.sign(v) * way, orbit.phi_max)
    return start, np.where(turns, speed, 0.0)
