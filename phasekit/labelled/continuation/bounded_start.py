"""Where branches of solutions with conditions at both ends begin."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
import xarray as xr

from phasekit.arrays import Array
from phasekit.bifurcation.continuation.options import ContinuationOptions
from phasekit.cycles import collocation, starts
from phasekit.cycles.bounded import Bounded, Condition
from phasekit.cycles.cycle_walk import CycleWalk
from phasekit.cycles.cycles import Orbit
from phasekit.errors import ConvergenceError
from phasekit.labelled.continuation.branch import branch_of
from phasekit.labelled.continuation.checks import check_parameter
from phasekit.labelled.continuation.cycle_branch import CycleBranch
from phasekit.labelled.continuation.cycle_events import orbit_events_of, orbit_stop_of, try_events
from phasekit.labelled.continuation.held_start import Asked, held_of, spans_of
from phasekit.labelled.continuation.orbit_guess import scale_of
from phasekit.labels.arguments import bad, list_names, reals
from phasekit.systems.cycle_families import first_point
from phasekit.systems.problem import Problem

FIRST = 20  # intervals of a first mesh


def bounded_of(
    problem: Problem, free: Sequence[str], spans: Sequence[tuple[float, float]],
    scale: Array, options: ContinuationOptions, conditions: tuple[Condition, ...],
    **more: Any,
) -> Bounded:  # fmt: skip
    """Solutions of a problem over some of its parameters."""
    names = list(problem.parameters)
    low, high = np.array(spans, dtype=float).T
    scale = np.array(
        [options.scales.get(s, one) for s, one in zip(problem.state, scale, strict=True)]
    )
    return Bounded(
        problem.field, np.array(list(problem.parameters.values()), dtype=float),
        tuple(names.index(name) for name in free), False, 0, 1, np.zeros(len(scale)), scale,
        high - low, low, high, np.zeros(len(scale)), options, conditions=conditions, **more,
    )  # fmt: skip


def conditions_of(problem: Any) -> tuple[Condition, ...]:
    """What a problem says of its solutions."""
    return tuple(one for one in (problem.ends, problem.means) if one.count)


def continue_solution(
    problem: Any,
    parameter: str | Sequence[str],
    guess: Any,
    span: Any,
    record: Mapping[str, Callable[..., Any]],
    options: ContinuationOptions,
    events: Any = None,
    stop: Any = None,
    held: Sequence[Asked] = (),
) -> CycleBranch:
    """Follow the solutions of a boundary value problem from one near a guess."""
    free = _free(problem, parameter, len(held))
    asked = orbit_events_of(problem, events)
    asked, ends = orbit_stop_of(problem, stop, asked, critical=True)
    spans = spans_of(problem, free, span)
    values = [problem.parameters[name] for name in free]
    orbit = guess_of(problem, guess, values, options)
    scale = scale_of(orbit.x, np.ones(len(problem.state)))
    own = slice(problem.freed)
    made = bounded_of(problem, free[own], spans[own], scale, options, conditions_of(problem))
    found = starts.settled(made, replace(orbit, y=orbit.y[: made.q]), held=1)
    if not found.converged:
        raise ConvergenceError(
            f"no solution was found from the guess at {free[0]} = {values[0]:.9g}: "
            f"{found.message}; x0= takes another one"
        )
    scale = scale_of(found.orbit.x, np.ones(len(scale)))
    numbers = held_of(problem, held, made, found.orbit)
    made = bounded_of(
        problem, free, spans, scale, options, conditions_of(problem), holds=numbers
    )  # fmt: skip
    y = np.append(found.orbit.y, values[len(found.orbit.y) - 1 :])
    found = starts.settled(made, replace(found.orbit, y=y), held=1)
    start = first_point(made, found, f"from the guess at {free[0]} = {values[0]:.9g}")
    if start.dy[1] < 0.0:
        start = start.flipped()
    family = made.replace(events=asked, ends=ends)
    try_events(family, start.orbit)
    return branch_of(CycleBranch, problem, CycleWalk(family), start, record)


def _free(problem: Any, parameter: Any, more: int) -> list[str]:
    given = [parameter] if isinstance(parameter, str) else parameter
    if not isinstance(given, (list, tuple)):
        raise bad("parameter", parameter, "a name, or names")
    names = [check_parameter(problem, name) for name in given]
    count = problem.freed + more
    if len(set(names)) != len(names) or len(names) != count:
        one = "one name" if count == 1 else f"{count} different names"
        raise bad(
            "parameter", parameter, one,
            f"{problem.ends.count + problem.means.count} conditions and integrals on "
            f"{len(problem.state)} states free {problem.freed}"
            f"{f', and what is held {more} more' if more else ''}",
        )  # fmt: skip
    return names


def guess_of(problem: Problem, x0: Any, values: Sequence[float], options: Any) -> Orbit:
    """A solution to begin with: one state, samples even in time, a function of s, or a Dataset."""
    n = len(problem.state)
    names = list_names(problem.state)
    wants = f"{n} numbers ({names}), samples of shape (samples, {n}), or a function of s in [0, 1]"
    mesh = np.linspace(0.0, 1.0, (options.intervals or FIRST) + 1)
    if x0 is None:
        x0 = [problem.start.get(name, 0.0) for name in problem.state]
    if isinstance(x0, xr.Dataset):
        missing = [name for name in problem.state if name not in x0]
        if missing or "time" not in x0.coords:
            raise bad("x0", list(map(str, x0.data_vars)), f"the states {names} on 'time'")
        time = np.asarray(x0["time"].values, dtype=float)
        s = (time - time[0]) / (time[-1] - time[0])
        x = np.stack([np.asarray(x0[name].values, float) for name in problem.state], axis=1)
        rows = np.linspace(0.0, len(s) - 1.0, len(mesh))
        mesh = np.interp(rows, np.arange(len(s)), s)
    elif callable(x0):
        s = collocation.times(mesh, options.degree)
        given = [np.ravel(x0(float(one))) for one in s]
        x = np.atleast_2d(reals("x0", np.array(given), wants))
    else:
        if isinstance(x0, Mapping):
            missing = [name for name in problem.state if name not in x0]
            if missing or len(x0) != n:
                raise bad("x0", list(x0), f"a value for each of {names}")
            x0 = [x0[name] for name in problem.state]
        x = np.atleast_1d(reals("x0", x0, wants))
        x = x[None] if x.ndim == 1 else x
        s = np.linspace(0.0, 1.0, len(x))
    if x.ndim != 2 or x.shape[1] != n or not np.isfinite(x).all():
        raise bad("x0", x0, wants)
    places = collocation.times(mesh, options.degree)
    if len(x) > 3:
        from scipy.interpolate import CubicSpline

        at = CubicSpline(s, x)(places)
    else:
        at = np.stack([np.interp(places, s, column) for column in x.T], axis=1)
    return Orbit(mesh, np.ascontiguousarray(at), np.array([1.0, *values]))
