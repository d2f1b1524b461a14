"""Orbits as they were given or found: what Newton's method starts from, and what it leaves."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
import xarray as xr

from phasekit.arrays import Array
from phasekit.cycles import collocation, starts
from phasekit.cycles.cycles import Cycles, Orbit, Solution
from phasekit.labelled.continuation.cycle_points import orbit_dataset
from phasekit.labels.arguments import bad
from phasekit.numerics.balance import balanced
from phasekit.systems.cycle_families import first_point
from phasekit.systems.field_arrays import states_over_time
from phasekit.systems.problem import Problem

RESTS = 1e-6  # size beside the largest state

#: A guess, its turns, and of a forced system how many periods of the forcing it takes.
Given = tuple[Orbit, Array, int]


def units_of(problem: Problem, x: Array) -> Array:
    """Sizes that one size of all states has in their units, as far as f tells: 1 for the largest.

    In those the slopes of f are balanced, each state's row against its column.
    """
    with np.errstate(all="ignore"):
        slopes = problem.derivatives(x)[1]
    if not np.isfinite(slopes).all():
        return np.ones(len(x))
    units = balanced(slopes[None])[1][0]
    return np.asarray(units / np.max(units))


def scale_of(x: Array, units: Array) -> Array:
    """Sizes of the states along an orbit; `ContinuationOptions.scales` knows better.

    A state beside which another one is a million times as large, in those units, may be one that
    rests at 0 but for the errors of a simulation: of the same size as that.
    """
    size = np.max(np.abs(x), axis=0)
    top = float(np.max(size / units))
    return np.asarray(np.where(size > RESTS * top * units, size, (top or 1.0) * units))


def given_orbit(problem: Problem, orbit: Any, value: float, m: int) -> Given:
    """An orbit that `periodic_orbit` or `Branch.orbit` returned, as a guess."""
    if not isinstance(orbit, xr.Dataset) or "time" not in orbit.dims or "period" not in orbit:
        raise bad("orbit", orbit, "what pk.periodic_orbit or branch.orbit(i) returns")
    x = states_over_time(problem, orbit)
    period = float(orbit["period"])
    at = np.asarray(orbit["time"].values, dtype=float) / period
    return sampled(problem, at - at[0], x, period, value, m)


def sampled(problem: Problem, at: Array, x: Array, period: float, value: float, m: int) -> Given:
    """A guess through samples over a period, with its turns and periods of the forcing."""
    from scipy.interpolate import PchipInterpolator

    turns = np.zeros(x.shape[1])
    if at[-1] < 1.0 - 1e-9:
        step = at[-1] - at[-2]
        if step < 1.0 - at[-1] - 1e-9:
            last = x[-1] + (x[-1] - x[-2]) * (1.0 - at[-1]) / step
        else:
            last = x[-1]
        ends = last
    else:
        ends = x[-1]
    for i, name in enumerate(problem.state):
        angle = problem.periods.get(name, 0.0)
        if angle > 0.0:
            turns[i] = angle * np.round((ends[i] - x[0, i]) / angle)
    if at[-1] < 1.0 - 1e-9:
        at, x = np.append(at, 1.0), np.vstack([x, x[0] + turns])
    else:
        x = x.copy()
        x[-1] = x[0] + turns
    count = int(np.clip(len(at) // (4 * m), starts.FIRST, 200))
    # Mesh points where the samples are dense.
    mesh = np.interp(np.linspace(0.0, 1.0, count + 1), np.linspace(0.0, 1.0, len(at)), at)
    mesh[0], mesh[-1] = 0.0, 1.0
    values = PchipInterpolator(at, x, axis=0)(collocation.times(mesh, m))
    multiple = 1
    if problem.time is not None:
        multiple = max(1, round(period / problem.forcing_period))
    return Orbit(mesh, np.ascontiguousarray(values), np.array([period, value])), turns, multiple


def orbit_of(
    cycles: Cycles, problem: Problem, found: Solution, where: str, record: Mapping[str, Any]
) -> xr.Dataset:
    """The Dataset of an orbit that Newton's method found."""
    return orbit_dataset(problem, cycles, first_point(cycles, found, where), record=record)
