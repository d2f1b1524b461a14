"""From a special point onwards: the other branch, and the curve in two parameters."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from phasekit.bifurcation.continuation.curve import Curve, Stop, Track
from phasekit.bifurcation.continuation.curve_walk import CurveWalk
from phasekit.bifurcation.continuation.kernels.defining import (
    BRANCH,
    EVENT,
    FLIP,
    FOLD,
    HOPF,
    TORUS,
)
from phasekit.bifurcation.continuation.options import ContinuationOptions
from phasekit.bifurcation.continuation.path import Sample, join
from phasekit.bifurcation.continuation.specials import find
from phasekit.bifurcation.continuation.two_parameters import two_parameter_curve
from phasekit.bifurcation.continuation.walk import run
from phasekit.bifurcation.special_points import KINDS
from phasekit.errors import ConvergenceError
from phasekit.labelled.continuation.branch import Branch, branch_of
from phasekit.labelled.continuation.checks import (
    check_more,
    check_options,
    first_span,
    refuse_held,
    refuse_kind,
)
from phasekit.labelled.continuation.special_point import SpecialPoint
from phasekit.labels.arguments import bad
from phasekit.numerics.waits import notice
from phasekit.systems.problem import Problem

#: Defining systems of curves, by what special points say of theirs.
_CURVES = {
    "fold": FOLD, "hopf": HOPF, "branch_point": BRANCH, "period_doubling": FLIP, "torus": TORUS,
    "event": EVENT,
}  # fmt: skip


def point_curve(
    point: SpecialPoint[Branch],
    parameter: str | Sequence[str],
    span: Sequence[Any],
    options: ContinuationOptions | None = None,
) -> Branch:
    """The curve of points of one kind through one, in two parameters; of branch points in three."""
    refuse_held(point)
    along = KINDS[point.kind].curve
    if along not in _CURVES:
        valid = [kind.name for kind in KINDS.values() if kind.curve in _CURVES]
        raise bad("point", point.kind, f"one of {', '.join(valid)}")
    if point.branch.kind != "equilibrium":
        raise bad("point", point.branch.kind, "a point of a branch of equilibria")
    curve, problem = point.branch.curve, point.branch.problem
    if point.corank > 1:
        raise bad("point", f"a branch point of corank {point.corank}", "one of corank 1")
    if (point.special.extra is None and along != "event") or point.status != "converged":
        raise bad("point", point.status, "a point that has converged", point.message)
    more, spans = check_more(point, parameter, span)
    options = check_options(options, curve.options)
    n = curve.n
    names = list(problem.parameters)
    low, high = np.array([first_span(curve, options, n), *spans]).T
    made = curve.replace(
        active=(curve.active[0], *(names.index(name) for name in more)),
        scale=np.append(curve.scale[: n + 1], (high - low)[1:]),
        period=np.append(curve.period[: n + 1], np.zeros(len(more))),
        low=np.append(curve.low[:n], low),
        high=np.append(curve.high[:n], high),
        options=options,
        **_holding(curve, point),
    )
    begun = two_parameter_curve(made, point.special, _CURVES[along])
    if begun is None:
        why = (
            "without a symmetry, a second parameter destroys a branch point; "
            "curve([second, third], [span, span]) frees one more"
        )
        if point.kind == "event":
            why = "its function touches zero there, with all derivatives zero, or its curves cross"
        raise ConvergenceError(
            f"curve: no curve of {point.kind} points leads on from {point!r} when "
            f"{' and '.join(more)} moves; {why}"
        )
    made, start = begun
    return branch_of(Branch, problem, CurveWalk(made), start, {})


def _holding(curve: Curve, point: SpecialPoint[Branch]) -> dict[str, Any]:
    """What a curve of events holds at zero, and looks for and ends at no more."""
    if point.kind != "event":
        return {}
    (held,) = (event for event in curve.events if event.name == point.name)
    if held.condition:
        raise bad(
            "point", f"the event {point.name!r}, which says yes or no", "a function that vanishes",
            "give a difference that changes its sign, such as x[0] - 1, as an event",
        )  # fmt: skip
    return {
        "held": held,
        "events": tuple(event for event in curve.events if event is not held),
        "ends": tuple(name for name in curve.ends if name not in (held.name, "event", "UZ")),
    }


def doubled(point: SpecialPoint[Branch], options: ContinuationOptions | None) -> Branch:
    """The orbit of period 2 that begins at a period doubling of a map, followed to one side.

    The other side is the same orbit from its other point.
    """
    curve, problem = point.branch.curve, point.branch.problem
    if point.status != "converged" or point.special.extra is None:
        raise bad("point", point.status, "a point that has converged", point.message)
    options = check_options(options, curve.options)
    twice = problem.iterated(2)
    curve = curve.replace(options=options, field=twice.field)
    tangent = np.append(point.special.extra, 0.0)
    tangent = tangent / curve.length(tangent)
    start = Sample(point.special.u, tangent, curve.evaluate(point.special.u)[1])
    _, forward = run(CurveWalk(curve), start, "forward")
    assert forward is not None
    curve, forward = _to_other_end(curve, problem, start, forward)
    tracks = None, forward
    return branch_of(Branch, twice, CurveWalk(curve), start, point.branch.record, tracks)


def _to_other_end(
    curve: Curve, problem: Problem, start: Sample, track: Track
) -> tuple[Curve, Track]:
    """A track of orbits of period 2 up to where their two points meet again, if they do.

    Beyond it runs back along the other point.
    """
    once = curve.replace(field=problem.field)
    passed = []
    for one in find(curve, join(curve, start, None, track)).placed:
        special = one.special
        away = curve.length(special.u - start.u) > 1e-6
        if KINDS[special.kind].label != "BP" or not away:
            continue
        residual = once.residuals(special.u[None], once.evaluate(special.u)[1][None])
        if np.max(np.abs(residual)) < 1e-9:
            name = special.kind
            at = f"{_free(curve)} = {special.u[curve.n]:.9g}"
            stop = Stop(name, f"the orbit ends at {at}, at another period doubling")
            if name not in passed:  # the curve ends on the first of its kind
                curve = curve.replace(ends=(*curve.ends, name))
            count = one.index + 1
            return curve, Track(track.record[:count], track.slopes[:count], track.state, stop)
        passed.append(special.kind)
    return curve, track


def _free(curve: Curve) -> str:
    """The free parameter of a branch."""
    return curve.field.parameters[curve.active[0]]


def leave(
    point: SpecialPoint[Branch], direction: int, options: ContinuationOptions | None,
    kind: str | None = None,
) -> Branch:  # fmt: skip
    """What begins at a point: its other branch, a doubled orbit of a map, periodic orbits.

    At a point of codimension two a curve of a kind.
    """
    refuse_held(point)
    if KINDS[point.kind].curve is None and point.kind != "end":
        from phasekit.labelled.continuation.codimension_two import begun

        with notice(f"following what begins at a {point.kind} point"):
            return begun(point, kind, direction, options)
    refuse_kind(point.kind, kind)
    if point.kind == "period_doubling":
        return doubled(point, options)
    if point.kind != "hopf":
        return switch(point, direction, options)
    from phasekit.labelled.continuation.cycle_start import from_hopf

    with notice(f"following periodic orbits along {point.branch.parameter}"):
        return from_hopf(point, options, direction)


def switch(
    point: SpecialPoint[Branch], direction: int = 0, options: ContinuationOptions | None = None
) -> Branch:
    """Another branch through a branch point, followed to both sides."""
    if KINDS[point.kind].label != "BP":
        raise bad("point", point.kind, "a branch point, pitchfork or transcritical point")
    curve, problem = point.branch.curve, point.branch.problem
    others = point.special.others
    if not others:
        raise bad("point", point.status, "a branch point whose directions are known", point.message)
    whole = isinstance(direction, (int, np.integer)) and not isinstance(direction, bool)
    if not whole or not 0 <= direction < len(others):
        raise bad("direction", direction, f"a whole number from 0 to {len(others) - 1}")
    options = check_options(options, curve.options)
    curve = curve.replace(options=options)
    start = Sample(point.special.u, others[direction], curve.evaluate(point.special.u)[1])
    return branch_of(Branch, problem, CurveWalk(curve), start, point.branch.record)
