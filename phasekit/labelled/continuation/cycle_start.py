"""Where branches of periodic orbits begin: an orbit, a Hopf point, a special point of cycles."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
import numpy.typing as npt
import xarray as xr

from phasekit.bifurcation.continuation.curve import Stop
from phasekit.bifurcation.continuation.fields import SymbolicField
from phasekit.bifurcation.continuation.options import ContinuationOptions
from phasekit.bifurcation.continuation.periodic import collocation, starts
from phasekit.bifurcation.continuation.periodic.cycles import Cycles, Orbit, Solution
from phasekit.bifurcation.continuation.periodic.family import run
from phasekit.bifurcation.continuation.periodic.trace import Point, point_of
from phasekit.errors import ConvergenceError
from phasekit.labelled.continuation.continuation import check_options, check_parameter, check_span
from phasekit.labelled.continuation.cycle_branch import CycleBranch, make_cycles
from phasekit.labelled.continuation.cycle_points import orbit_dataset
from phasekit.labelled.continuation.cycle_special import CyclePoint
from phasekit.labelled.continuation.special_point import SpecialPoint
from phasekit.labels.arguments import bad
from phasekit.systems.problem import Problem

FloatArray = npt.NDArray[np.float64]


def clock_code(problem: Problem, active: tuple[int, ...]) -> int:
    """Machine code of the period of the forcing, with its derivatives; 0 without forcing."""
    if problem.time is None:
        return 0
    field = SymbolicField((problem.period,), (), (*problem.parameters, problem.time))
    return field.first(active)


def cycles_of(
    problem: Problem,
    free: Sequence[str],
    spans: Sequence[tuple[float, float]],
    scale: FloatArray,
    turns: FloatArray,
    options: ContinuationOptions,
    multiple: int = 1,
) -> Cycles:
    """The periodic orbits of a problem over some of its parameters."""
    names = list(problem.parameters)
    active = tuple(names.index(name) for name in free)
    par = np.array(list(problem.parameters.values()))
    forced = problem.time is not None
    period = np.array([problem.periods.get(name, 0.0) for name in problem.state])
    scale = np.where(period > 0.0, period / (2.0 * np.pi), scale)
    for i, name in enumerate(problem.state):
        scale[i] = options.scales.get(name, scale[i])
    low, high = np.array(spans, dtype=float).T
    return Cycles(
        problem.field, np.append(par, 0.0) if forced else par, active, forced,
        clock_code(problem, active), multiple, turns, scale, high - low, low, high, period,
        options,
    )  # fmt: skip


def scale_of(x: FloatArray) -> FloatArray:
    """Sizes of the states along an orbit."""
    size = np.max(np.abs(x), axis=0)
    top = float(np.max(size))
    return np.asarray(np.where(size > 1e-6 * top, size, top if top > 0.0 else 1.0))


def from_hopf(point: SpecialPoint, options: ContinuationOptions | None) -> CycleBranch:
    """The periodic orbits that a Hopf point gives rise to."""
    if point.kind != "hopf":
        raise bad("point", point.kind, "a Hopf point")
    if point.branch.kind != "equilibrium":
        raise bad("point", point.branch.kind, "a Hopf point of a branch of equilibria")
    curve, problem = point.branch.known()
    options = curve.options if options is None else check_options(options)
    n, name = curve.n, point.branch.parameter
    span = float(curve.low[n]), float(curve.high[n])
    cycles = cycles_of(problem, [name], [span], curve.scale[:n].copy(), np.zeros(n), options)
    slopes = curve.at(point.special.u)[1][:, :n]
    values, vectors = np.linalg.eig(slopes)
    pairs = np.flatnonzero(values.imag > 0.0)
    if not len(pairs):
        raise bad("point", "no pair of complex eigenvalues", "a Hopf point that has converged")
    k = pairs[np.argmin(np.abs(values.real[pairs]))]
    p = point.parameters[name]
    found = starts.from_hopf(cycles, point.special.u[:n], p, float(values.imag[k]), vectors[:, k])
    start = _start(cycles, found, f"near the Hopf point at {name} = {p:.9g}")
    origin = Stop("hopf", f"the Hopf point at {name} = {p:.12g}")
    tracks = (None, run(cycles, start, "forward")[1])
    return make_cycles(problem, cycles, start, tracks, {}, origin)


def _start(cycles: Cycles, found: Solution, where: str) -> Point:
    if not found.converged:
        raise ConvergenceError(f"no periodic orbit was found {where}: {found.message}")
    return point_of(cycles, found, 0.0, 0.0)


def continue_orbit(
    problem: Problem,
    parameter: str,
    orbit: Any,
    span: Sequence[float],
    record: Mapping[str, Callable[..., Any]],
    options: ContinuationOptions,
) -> CycleBranch:
    """Follow the family of a periodic orbit along a parameter."""
    low, high = check_span(span)
    value = problem.parameters[check_parameter(problem, parameter)]
    if not low <= value <= high:
        raise bad(
            "span", (low, high), f"a span that holds the problem's own {parameter} = {value:.9g}"
        )
    guess, turns, multiple = given_orbit(problem, orbit, value, options.degree)
    cycles = cycles_of(
        problem, [parameter], [(low, high)], scale_of(guess.x), turns, options, multiple
    )
    found = starts.settled(cycles, guess)
    start = _start(cycles, found, f"from the orbit given at {parameter} = {value:.9g}")
    if start.dy[1] < 0.0:
        start = start.flipped()
    return make_cycles(problem, cycles, start, run(cycles, start, options.directions), record)


def given_orbit(
    problem: Problem, orbit: Any, value: float, m: int
) -> tuple[Orbit, FloatArray, int]:
    """An orbit that `periodic_orbit` or `Branch.orbit` returned, as a guess."""
    if not isinstance(orbit, xr.Dataset) or "time" not in orbit.dims or "period" not in orbit:
        raise bad("orbit", orbit, "what pk.periodic_orbit or branch.orbit(i) returns")
    missing = [name for name in problem.state if name not in orbit]
    if missing:
        raise bad("orbit", list(map(str, orbit.data_vars)), f"the states {', '.join(missing)} too")
    period = float(orbit["period"])
    at = np.asarray(orbit["time"].values, dtype=float) / period
    x = np.stack([np.asarray(orbit[name].values, dtype=float) for name in problem.state], axis=1)
    return sampled(problem, at - at[0], x, period, value, m)


def sampled(
    problem: Problem, at: FloatArray, x: FloatArray, period: float, value: float, m: int
) -> tuple[Orbit, FloatArray, int]:
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


def orbit_of(cycles: Cycles, problem: Problem, found: Solution, where: str) -> xr.Dataset:
    """The Dataset of an orbit that Newton's method found."""
    return orbit_dataset(problem, cycles, _start(cycles, found, where))


def switched(point: CyclePoint, direction: int, options: Any) -> CycleBranch:
    """The other branch at a period doubling or a branch point of cycles."""
    if point.kind not in ("period_doubling", "cycle_branch_point"):
        raise bad("point", point.kind, "a period doubling or a branch point of cycles")
    if point.status != "converged":
        raise bad("point", point.status, "a point that has converged", point.message)
    cycles, problem = point.branch.known()
    options = cycles.options if options is None else check_options(options)
    if isinstance(direction, bool) or direction != 0:
        raise bad("direction", direction, "0: there is one other branch")
    cycles = cycles.replace(options=options)
    here = point.special.point
    name = point.branch.parameter
    where = f"the {point.kind.replace('_', ' ')} at {name} = {point.parameters[name]:.12g}"
    checked = cycles.looked_at(here.orbit, here.dx, here.dy)
    size = options.initial_step
    if point.kind == "period_doubling":
        cycles, orbit, dx = starts.doubled(cycles, here.orbit, checked.W)
        start = _start(cycles, starts.off(cycles, orbit, dx, size), f"beside {where}")
        forward = run(cycles, start, "forward")[1]
        origin = Stop("period_doubling", where)
        return make_cycles(problem, cycles, start, (None, forward), point.branch.record, origin)
    dx = starts.null_vector(cycles, here.orbit, checked.W, 1.0, (here.dx, here.dy))
    sides = [starts.off(cycles, here.orbit, k * dx, size) for k in (1.0, -1.0)]
    one, two = (_start(cycles, side, f"beside {where}").orbit for side in sides)
    mesh = here.orbit.mesh
    one, two = cycles.on(mesh, one)[0], cycles.on(mesh, two)[0]
    dx, dy = one.x - two.x, one.y - two.y
    length = np.sqrt(cycles.inner(mesh, dx, dx, dy, dy))
    start = replace(here, dx=dx / length, dy=dy / length, sign=0.0, arclength=0.0, step=0.0)
    tracks = run(cycles, start, options.directions)
    return make_cycles(problem, cycles, start, tracks, point.branch.record)


def point_curve(point: CyclePoint, parameter: str, span: Any, options: Any) -> Any:
    """The curve of such points in two parameters."""
    raise bad("point", point.kind, "a fold, period doubling or torus point of cycles")
