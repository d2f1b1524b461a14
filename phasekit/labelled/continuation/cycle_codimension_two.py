"""What begins at points of codimension two of cycles: curves of cycles of twice the period.

Such a curve begins where the doubled cycles have amplitude zero, at which its equations are
singular. So the family of a point beside it is followed to its period doubling, the doubled cycles
to their first fold or torus, and the curve of these from there to both sides.
"""

from __future__ import annotations

import contextlib
from collections.abc import Iterator
from dataclasses import replace
from typing import Any

import numpy as np
import xarray as xr

from phasekit.bifurcation.continuation.options import ContinuationOptions
from phasekit.bifurcation.special_points import KINDS
from phasekit.cycles.cycles import Orbit
from phasekit.errors import ConvergenceError, ParameterError
from phasekit.labelled.continuation.checks import check_options
from phasekit.labelled.continuation.cycle_branch import CycleBranch
from phasekit.labelled.continuation.cycle_onward import curve_from, point_curve, switched
from phasekit.labelled.continuation.cycle_special import CyclePoint
from phasekit.labelled.continuation.cycle_start import continue_orbit
from phasekit.labels.arguments import bad
from phasekit.numerics.waits import notice
from phasekit.systems.problem import Problem

#: The curves of doubled cycles that begin at points of a kind.
BEGINS = {
    "generalized_flip": "fold_of_cycles", "resonance_2": "torus", "fold_flip": "torus",
}  # fmt: skip
#: What begins where nothing is followed.
NONE = {
    "cusp": "the two curves of folds that meet there are the curve itself",
    "resonance_1": "a curve of tori, and homoclinic tangles beside it: the torus curve ends there "
    "itself, tangles are not followed",
    "resonance_3": "saddle cycles of three times the period, on both sides of the point, and "
    "homoclinic tangles: no curve of cycles begins there",
    "resonance_4": "cycles of four times the period, whose folds are not followed",
    "chenciner": "a curve on which two tori merge: tori are not followed",
}
FEW = 60  # points of a family within which something is looked for
AWAY = (1, 4, 7)  # points of the curve to each side from which it is looked for
SHORT = 10  # points of doubled cycles until they are followed over the other parameter
APART = 0.25  # part of the spans within which what is found belongs to the point


def leave(
    point: CyclePoint[CycleBranch], direction: int, options: Any, kind: Any = None
) -> CycleBranch:
    """What begins at a special point of cycles: the other branch, or a curve of doubled cycles."""
    critical = KINDS[point.kind].curve is None and point.kind in (*BEGINS, *NONE)
    if not critical or len(point.branch.free) != 2:
        return switched(point, direction, options, kind)
    with notice(f"following what begins at a {point.kind} point"):
        return begun(point, kind, direction, options)


def begun(point: CyclePoint[CycleBranch], kind: Any, direction: int, options: Any) -> CycleBranch:
    """The curve in two parameters that begins at a point of codimension two of cycles."""
    if point.kind in NONE:
        raise bad("point", point.kind, "a point at which another curve begins", NONE[point.kind])
    along = BEGINS[point.kind]
    if kind not in (None, along):
        raise bad("kind", kind, repr(along), f"at a {point.kind} point")
    if isinstance(direction, bool) or direction != 0:
        raise bad("direction", direction, "0: there is one such curve")
    options = point.branch.curve.options if options is None else check_options(options)
    first, second = point.branch.free
    curve = point.branch.curve
    spans = {
        name: (float(curve.low[i]), float(curve.high[i])) for i, name in enumerate((first, second))
    }
    label = KINDS[along].label
    for there, orbit in _beside(point):
        for one in _doubled(there, orbit, spans, label):
            if _near(point, one, spans):
                (other,) = set(spans) - {one.branch.parameter}
                return point_curve(one, other, spans[other], options)
    raise ConvergenceError(
        f"switch: beside {point!r} no {label} point was found on cycles of twice the period"
    )


def _beside(point: CyclePoint[CycleBranch]) -> Iterator[tuple[Problem, xr.Dataset]]:
    """Orbits of the curve beside a point, the nearest first, with the problem at each.

    Of a curve of folds those of the curve of period doublings that crosses it there.
    """
    branch, index = point.branch, point.index
    if branch.kind == "fold_of_cycles":
        branch = _doublings(point)
        gaps = np.abs(branch.points[branch.free[1]].values - point.parameters[branch.free[1]])
        index = int(np.argmin(gaps))
    last = len(branch.path) - 1
    for away in AWAY:
        for i in (index - away, index + away):
            if 0 <= i <= last:
                orbit = branch.orbit(i)
                values = {name: float(orbit[name]) for name in branch.free}
                yield branch.problem.replace(**values), orbit


def _doublings(point: CyclePoint[CycleBranch]) -> CycleBranch:
    """The curve of period doublings through a point of a curve of folds."""
    curve, problem = point.branch.curve, point.branch.problem
    here, n = point.special.point, curve.own
    first, second = point.branch.free
    values = {name: point.parameters[name] for name in (first, second)}
    alone = Orbit(here.orbit.mesh, here.orbit.x[:, :n].copy(), here.orbit.y[:2].copy())
    fold = replace(here, orbit=alone, dx=here.orbit.x[:, n:].copy(), dy=np.zeros(2))
    cycles = curve.plain(values[second])
    span = float(curve.low[1]), float(curve.high[1])
    return curve_from(problem.replace(**values), cycles, fold, "period_doubling", second, span, {})


def _doubled(
    problem: Problem, orbit: xr.Dataset, spans: dict[str, tuple[float, float]], label: str
) -> Iterator[CyclePoint[CycleBranch]]:
    """Special points of a kind on the doubled cycles of the family through an orbit.

    If there are none, on those that leave them over the second parameter.
    """
    few = ContinuationOptions(max_points=FEW)
    first, second = spans
    at = problem.parameters[first]
    with contextlib.suppress(ConvergenceError, ParameterError):
        family = continue_orbit(problem, first, orbit, spans[first], {}, few)
        doublings = _converged(family, "PD")
        for one in sorted(doublings, key=lambda one: abs(one.parameters[first] - at))[:2]:
            twice = switched(one, 0, few)
            yield from _converged(twice, label)
            beside = twice.orbit(min(SHORT, twice.points.sizes["point"] - 1))
            there = problem.replace(**{first: float(beside[first])})
            other = continue_orbit(there, second, beside, spans[second], {}, few)
            yield from _converged(other, label)


def _converged(family: Any, label: str) -> list[CyclePoint[CycleBranch]]:
    found = (one for one in family.special(label) if one.status == "converged")
    return [one for one in found if isinstance(one, CyclePoint)]


def _near(
    point: CyclePoint[CycleBranch], one: CyclePoint[CycleBranch], spans: dict[str, Any]
) -> bool:
    """Whether what was found lies beside a point."""
    gaps = [
        abs(one.parameters[name] - point.parameters[name]) / (high - low)
        for name, (low, high) in spans.items()
    ]
    return bool(np.max(gaps) < APART)
