"""Where families of periodic orbits lead on to: other families, curves in two parameters."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from phasekit.bifurcation.continuation.curve import Stop
from phasekit.bifurcation.continuation.options import ContinuationOptions
from phasekit.bifurcation.continuation.walk import run
from phasekit.cycles import starts
from phasekit.cycles.bounded_folds import FOLD, folds_of
from phasekit.cycles.crossings import BRANCHING, UNFOLDED, crossings_of
from phasekit.cycles.cycle_walk import CycleWalk
from phasekit.cycles.cycles import Cycles, Solution
from phasekit.cycles.extended import Extended, extended
from phasekit.cycles.linear import lacking_memory
from phasekit.cycles.point import Point
from phasekit.errors import ConvergenceError
from phasekit.labelled.continuation.branch import branch_of
from phasekit.labelled.continuation.checks import (
    check_more,
    check_options,
    first_span,
    refuse_guess,
    refuse_kind,
)
from phasekit.labelled.continuation.cycle_branch import CycleBranch
from phasekit.labelled.continuation.cycle_points import CyclePoint
from phasekit.labels.arguments import bad
from phasekit.numerics.waits import notice
from phasekit.systems.cycle_families import clock_code, first_point
from phasekit.systems.problem import Problem

#: Special points that have curves in more parameters.
CURVES = ("fold_of_cycles", "period_doubling", "torus", BRANCHING)


def switched(
    point: CyclePoint[CycleBranch], direction: int, options: Any, kind: str | None = None
) -> CycleBranch:
    """The other branch at a period doubling or a branch point of cycles."""
    refuse_kind(point.kind, kind)
    with notice(f"following periodic orbits along {point.branch.parameter}"):
        return _switched(point, direction, options)


def _switched(point: CyclePoint[CycleBranch], direction: int, options: Any) -> CycleBranch:
    if point.kind not in ("period_doubling", "cycle_branch_point", "branch_point"):
        raise bad("point", point.kind, "a period doubling or a branch point")
    refuse_guess(point)
    cycles, problem = point.branch.curve, point.branch.problem
    options = _options(cycles, options)
    if isinstance(direction, bool) or direction != 0:
        raise bad("direction", direction, "0: there is one other branch")
    cycles = cycles.replace(options=options, ends=())
    here = point.special.point
    name = point.branch.parameter
    where = f"the {point.kind.replace('_', ' ')} at {name} = {point.parameters[name]:.12g}"
    checked = cycles.looked_at(here.orbit, here.dx, here.dy)
    size = options.initial_step
    if point.kind == "period_doubling":
        cycles, orbit, dx = starts.doubled(cycles, here.orbit, checked.W)
        start = first_point(cycles, starts.off(cycles, orbit, dx, size), f"beside {where}")
        walker = CycleWalk(cycles)
        tracks, origin = run(walker, start, "forward"), Stop("period_doubling", where)
        return branch_of(CycleBranch, problem, walker, start, point.branch.record, tracks, origin)
    dx, _ = starts.other_tangent(cycles, here.orbit, checked.W, (here.dx, here.dy))
    sides = [starts.off(cycles, here.orbit, k * dx, size) for k in (1.0, -1.0)]
    one, two = (first_point(cycles, side, f"beside {where}").orbit for side in sides)
    mesh = here.orbit.mesh
    one, two = cycles.on(mesh, one)[0], cycles.on(mesh, two)[0]
    dx, dy = one.x - two.x, one.y - two.y
    length = np.sqrt(cycles.inner(mesh, dx, dx, dy, dy))
    start = replace(here, dx=dx / length, dy=dy / length, sign=0.0, arclength=0.0, step=0.0)
    return branch_of(CycleBranch, problem, CycleWalk(cycles), start, point.branch.record)


def point_curve(
    point: CyclePoint[CycleBranch], parameter: str | Sequence[str], span: Any, options: Any
) -> CycleBranch:
    """The curve of folds, period doublings or tori of cycles through one, in two parameters.

    Of solutions of boundary value problems that of folds; branch points of cycles that a second
    parameter destroys form one in three.
    """
    branch = point.branch
    kinds = (FOLD,) if branch.kind == "boundary" else CURVES
    if branch.kind not in ("cycle", "boundary"):
        raise bad("point", branch.kind, "a point of a branch of periodic orbits")
    if point.kind not in kinds:
        raise bad("point", point.kind, f"one of {', '.join(kinds)}" if kinds[1:] else kinds[0])
    if branch.kind == "cycle" and len(branch.free) != 1:
        raise bad("point", branch.kind, "a point of a branch of periodic orbits")
    refuse_guess(point)
    cycles, problem = branch.curve, branch.problem
    lacking = lacking_memory(cycles, point.special.point.orbit.intervals)
    if lacking:
        raise bad("point", f"one of {cycles.n:,} states", "one of fewer states", lacking)
    more, spans = check_more(point, parameter, span)
    cycles = cycles.replace(options=_options(cycles, options))
    here = point.special.point
    if point.kind == BRANCHING:
        return _crossings_from(problem, cycles, here, more, spans, branch.record)
    if branch.kind == "boundary":
        return _folds_from(problem, cycles, here, more[0], spans[0], branch.record)
    return curve_from(problem, cycles, here, point.kind, more[0], spans[0], branch.record)


def _crossings_from(
    problem: Problem, cycles: Cycles, here: Point, more: list[str],
    spans: list[tuple[float, float]], record: Any,
) -> CycleBranch:  # fmt: skip
    """The curve of branch points of cycles through one, over one or two more parameters."""
    names = list(problem.parameters)
    places = {names.index(name): problem.parameters[name] for name in more}
    clock = clock_code(problem, (cycles.active[0], *places))
    made, guess = crossings_of(
        cycles, here, places, [first_span(cycles, cycles.options), *spans], clock
    )
    # One parameter is held: the one that moves the most along the curve.
    found = [starts.settled(made, guess, held=k) for k in range(len(made.active), 0, -1)]
    good = [one for one in found if one.converged]
    where = f"of the curve of cycle_branch_point points at {_values_of(problem, more)}"
    if not good:
        first_point(made, found[0], where)
    width = made.width[: len(made.active)]
    best = max(good, key=lambda one: float(np.max(np.abs(one.dy[1 : 1 + len(width)]) / width)))
    if made.unfolds and made.apart(best.orbit, best.dy) > UNFOLDED:
        raise ConvergenceError(
            f"curve: no curve of cycle_branch_point points leads on {where}: without a symmetry, "
            "a second parameter destroys a branch point; curve([second, third], [span, span]) "
            "frees one more"
        )
    return _walked(problem, made, first_point(made, best, where), record)


def _values_of(problem: Problem, names: Sequence[str]) -> str:
    """Parameters with their values, in words."""
    return ", ".join(f"{name} = {problem.parameters[name]:.12g}" for name in names)


def _folds_from(
    problem: Problem, family: Any, here: Point, parameter: str, span: tuple[float, float],
    record: Any,
) -> CycleBranch:  # fmt: skip
    """The curve of folds of boundary value problems through one, over a second parameter."""
    spans = [first_span(family, family.options), span]
    place, value = list(problem.parameters).index(parameter), problem.parameters[parameter]
    made, guess = folds_of(family, here, place, value, spans)
    found = starts.settled(made, guess, held=2)
    where = f"of the curve of folds at {parameter} = {value:.12g}"
    return _walked(problem, made, first_point(made, found, where), record)


def _walked(problem: Problem, made: Cycles, start: Point, record: Any) -> CycleBranch:
    """The curve through a point of it, to both sides, first to lower values of the second."""
    if start.dy[2] < 0.0:
        start = start.flipped()
    return branch_of(CycleBranch, problem, CycleWalk(made), start, record)


def curve_from(
    problem: Problem, cycles: Cycles, here: Point, kind: str, parameter: str,
    span: tuple[float, float], record: Any,
) -> CycleBranch:  # fmt: skip
    """The curve of critical orbits of a kind through one of a family, over a second parameter."""
    made, found = critical_orbit(problem, cycles, here, kind, parameter, span)
    start = first_point(
        made, found,
        f"of the curve of {kind} points at {parameter} = {problem.parameters[parameter]:.12g}",
    )  # fmt: skip
    return _walked(problem, made, start, record)


def critical_orbit(
    problem: Problem, cycles: Cycles, here: Point, kind: str, parameter: str,
    span: tuple[float, float],
) -> tuple[Extended, Solution]:  # fmt: skip
    """A critical orbit with its function, and how it goes on as a second parameter changes."""
    value = problem.parameters[parameter]
    first = first_span(cycles, cycles.options)
    place = list(problem.parameters).index(parameter)
    clock = clock_code(problem, (cycles.active[0], place))
    made = extended(cycles, kind, place, span, clock, first)
    guess = starts.with_function(made, cycles, here, value)
    return made, starts.settled(made, guess, held=2)


def _options(cycles: Cycles, options: Any) -> ContinuationOptions:
    """Options of a branch that goes on from another one: its own, or others of the same degree."""
    if options is None:
        return cycles.options
    options = check_options(options)
    if options.degree != cycles.m:
        raise bad("options", options.degree, f"the degree of the branch, {cycles.m}")
    return options  # type: ignore[no-any-return]
