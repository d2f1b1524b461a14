"""Where branches of periodic orbits begin: an orbit, a Hopf point, a special point of cycles."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
import numpy.typing as npt
import xarray as xr

from phasekit.bifurcation.continuation.curve import Stop
from phasekit.bifurcation.continuation.options import ContinuationOptions
from phasekit.bifurcation.continuation.periodic import collocation, starts
from phasekit.bifurcation.continuation.periodic.cycles import Cycles, Orbit, Solution
from phasekit.bifurcation.continuation.periodic.extended import extended
from phasekit.bifurcation.continuation.periodic.family import run
from phasekit.bifurcation.continuation.periodic.point import Point, point_of
from phasekit.errors import ConvergenceError
from phasekit.labelled.continuation.branch import Branch
from phasekit.labelled.continuation.checks import check_options, check_parameter, check_span
from phasekit.labelled.continuation.cycle_branch import CycleBranch, make_cycles
from phasekit.labelled.continuation.cycle_events import orbit_events_of, try_events
from phasekit.labelled.continuation.cycle_points import clock_code, orbit_dataset
from phasekit.labelled.continuation.cycle_special import CyclePoint
from phasekit.labelled.continuation.special_point import SpecialPoint
from phasekit.labels.arguments import bad
from phasekit.laws.formulas import symbols_of
from phasekit.systems.problem import Problem

#: The parameter that unfolds conservative families, and stays zero.
UNFOLDING = "unfolding"
#: Special points that have curves in two parameters.
CURVES = ("fold_of_cycles", "period_doubling", "torus")

FloatArray = npt.NDArray[np.float64]


def cycles_of(
    problem: Problem,
    free: Sequence[str],
    spans: Sequence[tuple[float, float]],
    scale: FloatArray,
    turns: FloatArray,
    options: ContinuationOptions,
    multiple: int = 1,
    fixed: bool = False,
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
        options, fixed,
    )  # fmt: skip


def scale_of(x: FloatArray) -> FloatArray:
    """Sizes of the states along an orbit."""
    size = np.max(np.abs(x), axis=0)
    top = float(np.max(size))
    return np.asarray(np.where(size > 1e-6 * top, size, top if top > 0.0 else 1.0))


def grown(scale: FloatArray, q: FloatArray, form: Mapping[str, float], width: float) -> FloatArray:
    """Sizes of the states at rest or, where they are larger, of the orbits from a Hopf point.

    A state may rest next to zero and swing all the more. By the normal form the amplitudes are
    ``2 |q| sqrt(d width/(omega |l1|))``. They are less where l1 is small, so that this only brings
    the sizes in line with each other: it ends where no state would swing by less than its size.
    """
    with np.errstate(all="ignore"):
        swing = 2.0 * np.sqrt(np.abs(form["d"] * width / (form["omega"] * form["l1"])))
        most = np.max(scale / q)
    swing = np.fmin(swing, most)
    return np.maximum(scale, swing * q) if np.isfinite(swing) else scale.copy()


def from_hopf(point: SpecialPoint[Branch], options: ContinuationOptions | None) -> CycleBranch:
    """The periodic orbits that a Hopf point gives rise to."""
    if point.kind != "hopf":
        raise bad("point", point.kind, "a Hopf point")
    if point.branch.kind != "equilibrium":
        raise bad("point", point.branch.kind, "a Hopf point of a branch of equilibria")
    curve, problem = point.branch.known()
    options = curve.options if options is None else check_options(options)
    n, name = curve.n, point.branch.parameter
    span = float(curve.low[n]), float(curve.high[n])
    slopes = curve.at(point.special.u)[1][:, :n]
    values, vectors = np.linalg.eig(slopes)
    pairs = np.flatnonzero(values.imag > 0.0)
    if not len(pairs):
        raise bad("point", "no pair of complex eigenvalues", "a Hopf point that has converged")
    k = pairs[np.argmin(np.abs(values.real[pairs]))]
    scale = grown(curve.scale[:n], np.abs(vectors[:, k]), point.normal_form, span[1] - span[0])
    cycles = cycles_of(problem, [name], [span], scale, np.zeros(n), options)
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
    parameter: str | Sequence[str],
    orbit: Any,
    span: Any,
    record: Mapping[str, Callable[..., Any]],
    options: ContinuationOptions,
    fix: str | None = None,
    events: Any = None,
) -> CycleBranch:
    """Follow the family of a periodic orbit along a parameter, or along two at a fixed period."""
    asked = orbit_events_of(problem, events)
    if problem.conservative:
        options = _by_period(parameter, span, options)
        problem, parameter = unfolded(problem), UNFOLDING
    free = _free(problem, parameter, fix)
    family = parameter == UNFOLDING
    spans = [(-np.inf, np.inf)] if family else _spans(problem, free, span)
    value = problem.parameters[free[0]]
    guess, turns, multiple = given_orbit(problem, orbit, value, options.degree)
    scale = scale_of(guess.x)
    cycles = cycles_of(problem, free[:1], spans[:1], scale, turns, options, multiple)
    found = starts.settled(cycles, guess)
    if family or not found.converged:
        # In a conservative family the parameter is no coordinate; it stays when it is free.
        other = starts.kept(cycles, guess)
        stays = abs(other.orbit.y[1] - value) <= 1e-9 * max(1.0, abs(value))
        found = other if other.converged and stays else found
    start = _start(cycles, found, f"from the orbit given at {free[0]} = {value:.9g}")
    if fix is not None:
        cycles = cycles_of(problem, free, spans, scale, turns, options, multiple, fixed=True)
        y = np.append(start.orbit.y, problem.parameters[free[1]])
        found = starts.settled(cycles, Orbit(start.orbit.mesh, start.orbit.x, y), second=True)
        start = _start(cycles, found, f"with the period {y[0]:.9g}")
    lead = start.dy[0] if cycles.vertical(start.dy) else start.dy[1]
    if lead < 0.0:
        start = start.flipped()
    cycles = cycles.replace(events=asked)
    try_events(cycles, start.orbit)
    return make_cycles(problem, cycles, start, run(cycles, start, options.directions), record)


def _by_period(parameter: Any, span: Any, options: ContinuationOptions) -> ContinuationOptions:
    """Options that bound the period of a conservative family, which is what varies."""
    if parameter != "period":
        raise bad(
            "parameter", parameter, "'period' of a conservative problem, with the span of it",
            "its orbits form families at fixed parameters",
        )  # fmt: skip
    return replace(options, bounds={**options.bounds, "period": check_span(span)})


def unfolded(problem: Problem) -> Problem:
    """A conservative problem with a term that takes energy, times a parameter that stays zero.

    The term is that of a damping: each velocity, in its own equation.
    """
    n = len(problem.state)
    x = np.random.default_rng(3).uniform(0.3, 0.9, n)
    f = problem(x)
    velocity = [int(np.argmin(np.abs(x - v))) for v in f]
    moving = sorted({j for j, v in zip(velocity, f, strict=True) if x[j] == v}) or list(range(n))
    mask = np.zeros(n)
    mask[moving] = 1.0
    values = {**problem.parameters, UNFOLDING: 0.0}
    periods = dict(problem.periods)
    if problem.kind == "symbolic":
        names = symbols_of([*problem.state, UNFOLDING])
        formulas = [
            e + names[UNFOLDING] * names[name] if mask[i] else e
            for i, (e, name) in enumerate(zip(problem.f, problem.state, strict=True))
        ]
        return Problem(formulas, problem.state, values, periods=periods)

    def with_damping(x: FloatArray, **parameters: float) -> FloatArray:
        part = parameters.pop(UNFOLDING)
        return np.asarray(problem.f(x, **parameters), dtype=float) + part * (mask * x.T).T

    return Problem(with_damping, problem.state, values, periods=periods)


def _free(problem: Problem, parameter: Any, fix: Any) -> list[str]:
    """The names of the free parameters: one, or two at a fixed period."""
    if fix not in (None, "period"):
        raise bad("fix", fix, "None or 'period'")
    given = [parameter] if isinstance(parameter, str) else list(parameter)
    names = [check_parameter(problem, name) for name in given]
    if fix is None and len(names) != 1:
        raise bad("parameter", parameter, "one parameter, or two with fix='period'")
    if fix is not None and problem.time is not None:
        raise bad("fix", fix, "None of a forced system, whose period is that of the forcing")
    if fix is not None and len(names) == 1:
        others = [name for name in problem.parameters if name != names[0]]
        if len(others) != 1:
            raise bad("parameter", parameter, f"two parameters: {names[0]} and one of {others}")
        names += others
    if len(set(names)) != len(names) or len(names) > 2:
        raise bad("parameter", parameter, "two different parameters")
    return names


def _spans(problem: Problem, free: list[str], span: Any) -> list[tuple[float, float]]:
    """The span of each free parameter; that of a second one is as wide as the first by default."""
    pairs = span if np.ndim(span) == 2 else [span]
    spans = [check_span(one) for one in pairs]
    for name, (low, high) in zip(free, spans, strict=False):
        value = problem.parameters[name]
        if not low <= value <= high:
            raise bad(
                "span", (low, high), f"a span that holds the problem's own {name} = {value:.9g}"
            )
    if len(spans) < len(free):
        value = problem.parameters[free[1]]
        reach = 10.0 * max(abs(value), spans[0][1] - spans[0][0])
        spans.append((value - reach, value + reach))
    return spans


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


def switched(point: CyclePoint[CycleBranch], direction: int, options: Any) -> CycleBranch:
    """The other branch at a period doubling or a branch point of cycles."""
    if point.kind not in ("period_doubling", "cycle_branch_point"):
        raise bad("point", point.kind, "a period doubling or a branch point of cycles")
    if point.status != "converged":
        raise bad("point", point.status, "a point that has converged", point.message)
    cycles, problem = point.branch.known()
    options = _options(cycles, options)
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
    dx, _ = starts.other_tangent(cycles, here.orbit, checked.W, (here.dx, here.dy))
    sides = [starts.off(cycles, here.orbit, k * dx, size) for k in (1.0, -1.0)]
    one, two = (_start(cycles, side, f"beside {where}").orbit for side in sides)
    mesh = here.orbit.mesh
    one, two = cycles.on(mesh, one)[0], cycles.on(mesh, two)[0]
    dx, dy = one.x - two.x, one.y - two.y
    length = np.sqrt(cycles.inner(mesh, dx, dx, dy, dy))
    start = replace(here, dx=dx / length, dy=dy / length, sign=0.0, arclength=0.0, step=0.0)
    tracks = run(cycles, start, options.directions)
    return make_cycles(problem, cycles, start, tracks, point.branch.record)


def point_curve(
    point: CyclePoint[CycleBranch], parameter: str, span: Any, options: Any
) -> CycleBranch:
    """The curve of folds, period doublings or tori of cycles through one, in two parameters."""
    if point.kind not in CURVES:
        raise bad("point", point.kind, f"one of {', '.join(CURVES)}")
    if point.branch.kind != "cycle" or len(point.branch.free) != 1:
        raise bad("point", point.branch.kind, "a point of a branch of periodic orbits")
    if point.status != "converged":
        raise bad("point", point.status, "a point that has converged", point.message)
    cycles, problem = point.branch.known()
    check_parameter(problem, parameter)
    if parameter == point.branch.parameter:
        raise bad("parameter", parameter, "another one than that of the branch")
    low, high = check_span(span)
    value = problem.parameters[parameter]
    if not low <= value <= high:
        raise bad("span", (low, high), f"a span that holds {parameter} = {value:.9g}")
    options = _options(cycles, options)
    first = float(cycles.low[0]), float(cycles.high[0])
    reach = 10.0 * (first[1] - first[0])
    first = options.bounds.get(point.branch.parameter, (first[0] - reach, first[1] + reach))
    place = list(problem.parameters).index(parameter)
    clock = clock_code(problem, (cycles.active[0], place))
    made = extended(cycles.replace(options=options), point.kind, place, (low, high), clock, first)
    here = point.special.point
    guess = starts.with_function(made, cycles, here, value)
    found = starts.settled(made, guess, second=True)
    start = _start(made, found, f"of the curve of {point.kind} points at {parameter} = {value:.9g}")
    if start.dy[2] < 0.0:
        start = start.flipped()
    tracks = run(made, start, options.directions)
    return make_cycles(problem, made, start, tracks, point.branch.record, kind=point.kind)


def _options(cycles: Cycles, options: Any) -> ContinuationOptions:
    """Options of a branch that goes on from another one: its own, or others of the same degree."""
    if options is None:
        return cycles.options
    options = check_options(options)
    if options.degree != cycles.m:
        raise bad("options", options.degree, f"the degree of the branch, {cycles.m}")
    return options  # type: ignore[no-any-return]
