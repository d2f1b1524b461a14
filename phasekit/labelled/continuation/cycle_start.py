"""Where branches of periodic orbits begin: an orbit, a Hopf point, a special point of cycles."""

from __future__ import annotations

import contextlib
from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np

from phasekit.bifurcation.continuation.curve import Stop
from phasekit.bifurcation.continuation.options import ContinuationOptions
from phasekit.bifurcation.continuation.points.hopf_families import Family
from phasekit.bifurcation.continuation.walk import run
from phasekit.cycles import starts
from phasekit.cycles.cycle_walk import CycleWalk
from phasekit.cycles.cycles import Cycles, Orbit
from phasekit.cycles.functionals import Functional
from phasekit.cycles.point import Point
from phasekit.errors import ConvergenceError
from phasekit.inputs import is_whole
from phasekit.labelled.continuation.branch import Branch, branch_of
from phasekit.labelled.continuation.checks import check_options, check_parameter
from phasekit.labelled.continuation.cycle_branch import CycleBranch
from phasekit.labelled.continuation.cycle_events import orbit_events_of, orbit_stop_of, try_events
from phasekit.labelled.continuation.held_start import (
    Asked,
    asked_of,
    free_of,
    held_of,
    period_is,
    spans_of,
)
from phasekit.labelled.continuation.orbit_guess import Given, given_orbit, scale_of, units_of
from phasekit.labelled.continuation.special_point import SpecialPoint
from phasekit.labelled.continuation.unfolding import (
    UNFOLDING,
    beside_unfolding,
    by_period,
    unfolded,
)
from phasekit.labels.arguments import bad
from phasekit.systems.cycle_families import cycles_of, first_point, hopf_families, hopf_family
from phasekit.systems.problem import Problem

SAME = 1e-9  # part of its span by which a parameter that is free has moved by rounding


def from_hopf(
    point: SpecialPoint[Branch], options: ContinuationOptions | None, direction: int = 0
) -> CycleBranch:
    """The periodic orbits that a Hopf point gives rise to."""
    if point.kind != "hopf":
        raise bad("point", point.kind, "a Hopf point")
    if point.branch.kind != "equilibrium":
        raise bad("point", point.branch.kind, "a Hopf point of a branch of equilibria")
    curve, problem = point.branch.curve, point.branch.problem
    options = check_options(options, curve.options)
    name, p = point.branch.parameter, float(point.special.u[curve.n])
    choice, said = _families(point)
    if not is_whole(direction) or not 0 <= direction < len(choice):
        wanted = f"a whole number from 0 to {len(choice) - 1}" if len(choice) > 1 else ""
        raise bad("direction", direction, wanted or "0: one family begins at this Hopf point")
    cycles, start = hopf_family(problem, curve, point.special, choice[direction], options)
    message = "; ".join([f"the Hopf point at {name} = {p:.12g}", *said])
    walker = CycleWalk(cycles)
    tracks, origin = run(walker, start, "forward"), Stop("hopf", message)
    return branch_of(CycleBranch, problem, walker, start, {}, tracks, origin)


def _families(point: SpecialPoint[Branch]) -> tuple[list[Family], list[str]]:
    """The families at a Hopf point, and of several what is to be said."""
    found, said = hopf_families(point.branch.curve, point.special.u)
    if not found:
        raise ConvergenceError(
            f"switch: no family of periodic orbits can be told at {point!r}: {'; '.join(said)}"
        )
    return found, said


def continue_orbit(
    problem: Problem,
    parameter: str | Sequence[str],
    orbit: Any,
    span: Any,
    record: Mapping[str, Callable[..., Any]],
    options: ContinuationOptions,
    fix: Any = None,
    events: Any = None,
    stop: Any = None,
    constraints: Any = None,
) -> CycleBranch:
    """Follow the family of a periodic orbit along a parameter, or more where numbers are held."""
    held = asked_of(fix, constraints)
    asked = orbit_events_of(problem, events)
    asked, ends = orbit_stop_of(problem, stop, asked, critical=not held)
    if held and (fix != "period" or constraints is not None):
        if problem.conservative:
            raise bad("fix", fix, "None or 'period' of a conservative problem")
        cycles, start = _held(problem, parameter, orbit, span, options, held)
        return _run(problem, cycles.replace(events=asked, ends=ends), start, record)
    if problem.conservative:
        if fix is None:
            options = by_period(parameter, span, options)
        problem = unfolded(problem)
        parameter = UNFOLDING if fix is None else beside_unfolding(problem, parameter)
    free = _free(problem, parameter, fix)
    family = parameter == UNFOLDING
    spans = [(-np.inf, np.inf)] if family else spans_of(problem, free, span)
    value = problem.parameters[free[0]]
    given = given_orbit(problem, orbit, value, options.degree)
    if fix is not None and free[1] == UNFOLDING:
        cycles, start = _at_period(problem, free, spans, given, options, held=1)
    elif fix is not None:
        cycles, start = _of_long_period(problem, free, spans, given, options)
    else:
        cycles, start = _first(problem, free[:1], spans[:1], given, options, family)
    return _run(problem, cycles.replace(events=asked, ends=ends), start, record)


def _run(problem: Problem, cycles: Cycles, start: Point, record: Any) -> CycleBranch:
    """The family from its first point to both sides."""
    lead = start.dy[0] if cycles.vertical(start.dy) else start.dy[1]
    if lead < 0.0:
        start = start.flipped()
    try_events(cycles, start.orbit)
    return branch_of(CycleBranch, problem, CycleWalk(cycles), start, record)


def _held(
    problem: Problem, parameter: Any, orbit: Any, span: Any, options: Any, held: list[Asked]
) -> tuple[Cycles, Point]:
    """The orbits along which numbers are held, and the first one, at its value of a parameter."""
    free = free_of(problem, parameter, len(held))
    spans = spans_of(problem, free, span)
    values = [problem.parameters[name] for name in free]
    given = given_orbit(problem, orbit, values[0], options.degree)
    alone, start = _first(problem, free[:1], spans[:1], given, options, family=False)
    numbers = held_of(problem, held, alone, start.orbit)
    given = (start.orbit, *given[1:])
    cycles = _family(problem, free, spans, given, options, numbers)
    y = np.append(start.orbit.y, values[1:])
    found = starts.settled(cycles, Orbit(start.orbit.mesh, start.orbit.x, y), held=1)
    where = f"with {', '.join(one.name for one in numbers)} at {free[0]} = {values[0]:.9g}"
    return cycles, first_point(cycles, found, where)


def _family(
    problem: Problem, free: list[str], spans: list[Any], given: Given, options: Any,
    held: tuple[Functional, ...] = (),
) -> Cycles:  # fmt: skip
    guess, turns, multiple = given
    scale = scale_of(guess.x, units_of(problem, guess.x[0]))
    return cycles_of(problem, free, spans, scale, turns, options, multiple, held)


def _first(
    problem: Problem, free: list[str], spans: list[Any], given: Given, options: Any, family: bool
) -> tuple[Cycles, Point]:
    """The family over one parameter, and its point at the problem's own value."""
    guess, value = given[0], problem.parameters[free[0]]
    cycles = _family(problem, free, spans, given, options)
    found = starts.settled(cycles, guess)
    if family or not found.converged:
        # In a conservative family the parameter is no coordinate; it stays when it is free.
        other = starts.kept(cycles, guess)
        stays = other.converged and _stays(cycles, other.orbit, value)
        found = other if stays else found
    where = f"from the orbit given at {free[0]} = {value:.9g}"
    return cycles, first_point(cycles, found, where)


def _stays(cycles: Cycles, orbit: Orbit, value: float) -> bool:
    """Whether the first parameter keeps its value, beside its span.

    What unfolds a conservative family, which has no span, is a rate.
    """
    width = float(cycles.width[0])
    width = width if np.isfinite(width) else 1.0 / float(orbit.y[0])
    return bool(abs(orbit.y[1] - value) <= SAME * width)


def _of_long_period(
    problem: Problem, free: list[str], spans: list[Any], given: Given, options: Any
) -> tuple[Cycles, Point]:
    """The orbits of one period over two parameters, and the first one.

    A parameter next to a homoclinic orbit says nothing of the period: that is the one given. If the
    orbit given belongs to other parameters, it is the period at those of the problem.
    """
    value = problem.parameters[free[0]]
    with contextlib.suppress(ConvergenceError):
        cycles, start = _at_period(problem, free, spans, given, options, held=2)
        if _stays(cycles, start.orbit, value):
            return cycles, start
    _, start = _first(problem, free[:1], spans[:1], given, options, family=False)
    moved = (start.orbit, *given[1:])
    return _at_period(problem, free, spans, moved, options, held=2)


def _at_period(
    problem: Problem, free: list[str], spans: list[Any], given: Given, options: Any, held: int
) -> tuple[Cycles, Point]:
    """The orbits of one period over two parameters, and the one given, at its value of one."""
    guess = given[0]
    held_at = (period_is(problem, float(guess.y[0])),)
    cycles = _family(problem, free, spans, given, options, held_at)
    y = np.append(guess.y, problem.parameters[free[1]])
    found = starts.settled(cycles, Orbit(guess.mesh, guess.x, y), held=held)
    where = f"with the period {y[0]:.9g} at {free[held - 1]} = {y[held]:.9g}"
    return cycles, first_point(cycles, found, where)


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
