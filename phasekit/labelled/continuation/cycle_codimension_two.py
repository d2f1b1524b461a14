"""What begins at points of codimension two of cycles: curves of cycles of two and four periods.

Such a curve begins where the doubled cycles have amplitude zero, at which its equations are
singular. So the family of a point beside it is followed to its period doubling, the doubled cycles
to their first fold or torus, and the curve of these from there to both sides. At a resonance 1:4
cycles of four times the period tell themselves where they fold (see `fourfold`).
"""

from __future__ import annotations

import contextlib
import warnings
from collections.abc import Iterator
from dataclasses import replace
from typing import Any

import numpy as np
import xarray as xr

from phasekit.bifurcation.continuation.fourfold import circle_beside
from phasekit.bifurcation.continuation.options import ContinuationOptions
from phasekit.bifurcation.special_points import KINDS
from phasekit.cycles.cycles import Orbit
from phasekit.cycles.fourfold import FourfoldCycles
from phasekit.cycles.point import point_of
from phasekit.errors import ConvergenceError, ParameterError
from phasekit.inputs import is_whole
from phasekit.labelled.continuation.checks import check_options, folding
from phasekit.labelled.continuation.cycle_branch import CycleBranch
from phasekit.labelled.continuation.cycle_onward import curve_from, point_curve, switched
from phasekit.labelled.continuation.cycle_points import CyclePoint, orbit_dataset, refined_points
from phasekit.labelled.continuation.cycle_start import continue_orbit
from phasekit.labels.arguments import bad
from phasekit.numerics.waits import notice
from phasekit.systems.problem import Problem

#: The curves of doubled cycles that begin at points of a kind.
BEGINS = {
    "generalized_flip": "fold_of_cycles", "resonance_2": "torus", "fold_flip": "torus",
    "resonance_4": "fold_of_cycles",
}  # fmt: skip
#: What begins where nothing is followed.
NONE = {
    "cusp": "the two curves of folds that meet there are the curve itself",
    "resonance_1": "a curve of tori, and homoclinic tangles beside it: the torus curve ends there "
    "itself, tangles are not followed",
    "resonance_3": "saddle cycles of three times the period, on both sides of the point, and "
    "homoclinic tangles: no curve of cycles begins there",
    "chenciner": "a curve on which two tori merge: tori are not followed",
}
FEW = 60  # points of a family within which something is looked for
AWAY = (1, 4, 7)  # points of the curve to each side from which it is looked for
SHORT = 10  # points of doubled cycles until they are followed over the other parameter
SMALL = 0.05  # steps along fourfold cycles beside their amplitude
ASIDE = 0.4  # angle, on the circle of such cycles, from a fold to where they are followed from
ALONG = 0.95  # cosine of the angle between a fold and the half-line on which it is expected
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
    several = point.kind == "resonance_4"
    if not is_whole(direction) or not 0 <= direction <= several:
        raise bad("direction", direction, "0 or 1" if several else "0: there is one such curve")
    options = check_options(options, point.branch.curve.options)
    first, second = point.branch.free
    curve = point.branch.curve
    spans = {
        name: (float(curve.low[i]), float(curve.high[i])) for i, name in enumerate((first, second))
    }
    label = KINDS[along].label
    if several:
        one = _fourfold(point, direction, spans)
        (other,) = set(spans) - {one.branch.parameter}
        return point_curve(one, other, spans[other], options)
    for there, orbit in _beside(point):
        for one in _doubled(there, orbit, spans, label):
            if _near(point, one, spans):
                (other,) = set(spans) - {one.branch.parameter}
                return point_curve(one, other, spans[other], options)
    raise ConvergenceError(
        f"switch: beside {point!r} no {label} point was found on cycles of twice the period"
    )


def _fourfold(
    point: CyclePoint[CycleBranch], direction: int, spans: dict[str, tuple[float, float]]
) -> CyclePoint[CycleBranch]:
    """A fold of cycles of four times the period beside a resonance 1:4."""
    found = FourfoldCycles(point.branch.curve, point.special.point.orbit)
    circle, size = folding(point, circle_beside(found.parameters_at))
    angle = circle.folds[direction]
    place = circle.parameters_at(angle)
    names, steps = list(spans), SMALL * size
    # Over the parameter that leads across the half-line, from an orbit to one side of the fold.
    name = names[int(np.argmin(np.abs(place)))]
    options = ContinuationOptions(
        max_points=FEW, degree=found.cycles.m, initial_step=steps, max_step=2.0 * steps
    )
    for side in (ASIDE, -ASIDE):
        solution = found.orbit(size, 0.25 * (angle + side))
        if not solution.converged:
            continue
        start = point_of(found.cycles, solution, 0.0, 0.0)
        values = dict(zip(names, map(float, start.orbit.y[1:]), strict=True))
        there = point.branch.problem.replace(**values)
        orbit = orbit_dataset(there, found.cycles, start)
        with warnings.catch_warnings(), contextlib.suppress(ConvergenceError, ParameterError):
            warnings.simplefilter("ignore", RuntimeWarning)
            family = continue_orbit(there, name, orbit, spans[name], {}, options, stop=["LPC"])
            for one in refined_points(family, "LPC"):
                gaps = np.array([one.parameters[k] - point.parameters[k] for k in names])
                gaps /= found.cycles.width
                if gaps @ place > ALONG * np.linalg.norm(gaps) * np.linalg.norm(place):
                    return one
    raise ConvergenceError(f"switch: beside {point!r} no fold of fourfold cycles was found")


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
        doublings = refined_points(family, "PD")
        for one in sorted(doublings, key=lambda one: abs(one.parameters[first] - at))[:2]:
            twice = switched(one, 0, few)
            yield from refined_points(twice, label)
            beside = twice.orbit(min(SHORT, twice.points.sizes["point"] - 1))
            there = problem.replace(**{first: float(beside[first])})
            other = continue_orbit(there, second, beside, spans[second], {}, few)
            yield from refined_points(other, label)


def _near(
    point: CyclePoint[CycleBranch], one: CyclePoint[CycleBranch], spans: dict[str, Any]
) -> bool:
    """Whether what was found lies beside a point."""
    gaps = [
        abs(one.parameters[name] - point.parameters[name]) / (high - low)
        for name, (low, high) in spans.items()
    ]
    return bool(np.max(gaps) < APART)
