"""From a problem of fields of states to a branch of its equilibria."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from phasekit.arrays import Array
from phasekit.bifurcation.continuation.kernels.defining import EQUILIBRIUM
from phasekit.bifurcation.continuation.large.begin import settle, start_along, start_at
from phasekit.bifurcation.continuation.large.curve import LargeCurve
from phasekit.bifurcation.continuation.large.extended import point_curve as along
from phasekit.bifurcation.continuation.large.multiple import kernel_part
from phasekit.bifurcation.continuation.large.walk import LargeWalk
from phasekit.bifurcation.continuation.options import ContinuationOptions
from phasekit.bifurcation.special_points import KINDS
from phasekit.errors import ConvergenceError
from phasekit.inputs import is_whole
from phasekit.labelled.continuation.branch import Branch, Record, branch_of
from phasekit.labelled.continuation.checks import (
    check_options,
    check_parameter,
    check_span,
    first_span,
    refuse_kind,
)
from phasekit.labelled.continuation.large_branch import LargeBranch
from phasekit.labels.arguments import bad, numeric, unknown
from phasekit.numerics.memory import human, room_short_of
from phasekit.numerics.waits import notice
from phasekit.systems.problem import Problem

CURVES = ("fold", "hopf")  # points that form curves
STEPS = 30  # of Newton's method onto the start of one
FEW = 7  # numbers from which an error shows their shape
COPIES = 3  # of a point: in its track, on its path, in the Dataset


def continue_fields(
    problem: Problem, parameter: str, x0: Any, span: tuple[float, float], record: Record,
    options: ContinuationOptions, ends: tuple[str, ...],
) -> Branch:  # fmt: skip
    """Follow equilibria of fields of states along a parameter."""
    guess = state_of(problem, x0)
    refuse_record(len(guess), options)
    curve = field_curve(problem, parameter, span, options, ends)
    with notice(f"following equilibria of {curve.n:,} states along {parameter}"):
        u = np.append(guess, problem.parameters[parameter])
        curve, u = settle(
            curve, u, {n: options.scales[n] for n in curve.places if n in options.scales}
        )
        start = start_at(curve, u)
        return branch_of(LargeBranch, problem, LargeWalk(curve), start, record)


def refuse_record(n: int, options: ContinuationOptions) -> None:
    """Refuse points that no memory would hold, before the first is made.

    Raises
    ------
    ParameterError
    """
    sides = 2 if options.directions == "both" else 1
    point = COPIES * 8 * (n + 1)
    needed = point * sides * options.max_points
    room = room_short_of(needed)
    if room is not None:
        most = room // (point * sides)
        raise bad(
            "max_points", options.max_points, f"at most {most:,} of {n:,} states",
            f"all of them would take {human(needed)}; {human(room)} are free; "
            "extend() goes on from an end",
        )  # fmt: skip


def state_of(problem: Problem, x0: Any, argument: str = "x0") -> Array:
    """All states, or each field by name, a number or an array over its places.

    Raises
    ------
    ParameterError
        If it is none.
    """
    n = len(problem.state)
    if x0 is None:
        return np.array([problem.start.get(name, 0.0) for name in problem.state])
    blocks = {block.name: block for block in problem.blocks}
    if isinstance(x0, Mapping):
        for name in x0:
            if name not in blocks:
                raise unknown(f"{argument}: field", name, blocks)
        missing = [name for name in blocks if name not in x0]
        if missing:
            raise bad(argument, list(x0), f"a value for each of {', '.join(blocks)}")
        return np.concatenate([
            _filled(f"{argument}[{name!r}]", x0[name], one.shape) for name, one in blocks.items()
        ])  # fmt: skip
    return _filled(argument, x0, (n,))


def _filled(argument: str, value: Any, shape: tuple[int, ...]) -> Array:
    size = int(np.prod(shape))
    wants = f"finite numbers: one, or an array of shape {shape}"
    given = np.asarray(numeric(argument, np.ravel(np.asarray(value)), None, wants))
    if (np.ndim(value) and given.size != size) or not np.isfinite(given).all():
        raise bad(argument, value if given.size < FEW else np.shape(value), wants)
    return np.broadcast_to(given, (size,)).astype(float)


def field_curve(
    problem: Problem, parameter: str, span: tuple[float, float], options: ContinuationOptions,
    ends: tuple[str, ...],
) -> LargeCurve:  # fmt: skip
    """The curve of equilibria in one parameter, its fields not yet scaled."""
    n, names = len(problem.state), list(problem.parameters)
    places = {block.name: block.size for block in problem.blocks}
    for name in (*options.bounds, *options.scales):
        if name not in places and name not in names:
            raise unknown("bounds and scales: field", name, [*places, *names])
    low, high = np.full(n + 1, -np.inf), np.full(n + 1, np.inf)
    first = 0
    for name, count in places.items():
        pair = options.bounds.get(name, (-np.inf, np.inf))
        low[first : first + count], high[first : first + count] = pair
        first += count
    low[n], high[n] = span
    return LargeCurve(
        field=problem.field, kind=EQUILIBRIUM, par=np.array(list(problem.parameters.values())),
        active=(names.index(parameter),), scale=np.append(np.ones(n), span[1] - span[0]),
        period=np.zeros(n + 1), low=low, high=high, options=options, ends=ends,
        blocks=tuple(places.items()),
    )  # fmt: skip


def switch(
    point: Any, direction: Any = 0, options: ContinuationOptions | None = None,
    kind: str | None = None,
) -> Branch:  # fmt: skip
    """Another branch through a branch point of fields of states, or orbits of a Hopf point.

    Raises
    ------
    ParameterError
        If it is neither, or the direction of the other branch is not known.
    """
    refuse_kind(point.kind, kind)
    if point.kind == "hopf":
        from phasekit.labelled.continuation.cycle_start import from_hopf

        with notice(f"following periodic orbits along {point.branch.parameter}"):
            return from_hopf(point, options, direction)
    if KINDS[point.kind].label != "BP":
        raise bad("point", point.kind, "a branch point, pitchfork, transcritical or Hopf point")
    tangent = _tangent(point, direction)
    curve = point.branch.curve
    curve = curve.replace(options=check_options(options, curve.options))
    u = point.special.u
    with notice(f"following equilibria of {curve.n:,} states along {curve.free}"):
        walker = LargeWalk(curve, singular=True)
        start = start_along(curve, u, tangent)
        return branch_of(LargeBranch, point.branch.problem, walker, start, point.branch.record)


def _tangent(point: Any, direction: Any) -> Array:
    """The direction of a branch at a branch point: one of its own, or along states that are given.

    Raises
    ------
    ParameterError
        If there is none of that number, or the states have no part among the null vectors.
    """
    others: tuple[Array, ...] = point.special.others
    kernel = point.special.extra if point.corank > 1 else None
    if kernel is not None and (np.ndim(direction) > 0 or isinstance(direction, Mapping)):
        along = state_of(point.branch.problem, direction, "direction")
        found = kernel_part(point.branch.curve, kernel, along)
        if found is None:
            wants = "states with a part along the null vectors of f_x there"
            raise bad("direction", direction, wants)
        return found
    if not others:
        raise bad("point", point.status, "a branch point whose directions are known", point.message)
    if not is_whole(direction) or not 0 <= direction < len(others):
        raise bad("direction", direction, f"a whole number from 0 to {len(others) - 1}")
    chosen: Array = others[direction]
    return chosen


def point_curve(
    point: Any, parameter: Any, span: Any, options: ContinuationOptions | None = None
) -> Branch:
    """The curve of folds or Hopf points of fields through one, in two parameters.

    Raises
    ------
    ParameterError
        If an argument is unusable or the point cannot be continued.
    ConvergenceError
        If no curve leads on from the point.
    """
    branch = point.branch
    if point.kind not in CURVES:
        raise bad("point", point.kind, f"one of {', '.join(CURVES)} of fields of states")
    if branch.kind != "equilibrium":
        raise bad("point", branch.kind, "a point of a branch of equilibria")
    if point.status != "converged" or not np.isfinite([*point.normal_form.values()]).all():
        raise bad("point", point.status, "a point that has converged", point.message)
    problem, curve = branch.problem, branch.curve
    other, ends = check_parameter(problem, parameter), check_span(span)
    if other == branch.parameter:
        raise bad("parameter", other, "another one than that of the branch")
    if not ends[0] <= problem.parameters[other] <= ends[1]:
        value = problem.parameters[other]
        raise bad("span", ends, f"a span that holds {other} = {value:.9g}")
    if "omega" in (*problem.parameters, *curve.places) and point.kind == "hopf":
        raise bad("parameter", other, "no parameter or field that is called omega")
    options = check_options(options, curve.options)
    bounds = first_span(curve, options, curve.n)
    with notice(f"following {point.kind} points of {curve.n:,} states along {other}"):
        made, u = along(curve.replace(options=options), point.special, other, bounds, ends)
        refuse_record(made.n, options)
        row = np.zeros(made.n + 1)
        row[made.n] = 1.0
        begun = made.correct(u, row, float(u[made.n]), made.scale, STEPS)
        if isinstance(begun, int):
            raise ConvergenceError(
                f"curve: no curve of {point.kind} points leads on from {point!r} when {other} moves"
            )
        walker = LargeWalk(made, of=point.kind)
        start = start_at(made, begun.u)
        return branch_of(LargeBranch, problem, walker, start, {})


def sensitivity(point: Any) -> Any:
    """Refuse derivatives of points of fields of states, which are not computed."""
    raise bad("point", point.kind, "a point of a branch of few states")
