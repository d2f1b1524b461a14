"""Special points between the points of a family of periodic orbits.

Each is bracketed by the sign of a test function and refined on it to rounding: folds by the
tangent's part along the parameter, period doublings by det(M + 1), tori by the product of
1 - mu_i mu_j, in which real pairs are no bifurcation, branch points by the determinant of the
bordered equations and det(M - 1) ([Kuznetsov2004] 10.3).
"""

from __future__ import annotations

import cmath
from collections.abc import Callable
from dataclasses import dataclass, replace
from itertools import combinations
from typing import Any

from phasekit.bifurcation.continuation.periodic.between import (
    Stretch,
    Value,
    branching,
    root,
)
from phasekit.bifurcation.continuation.periodic.criteria import (
    doubling_test,
    fold_test,
    none_passes,
    nontrivial,
    torus_test,
    unstable,
)
from phasekit.bifurcation.continuation.periodic.cycles import Cycles
from phasekit.bifurcation.continuation.periodic.family import Found, Path
from phasekit.bifurcation.continuation.periodic.linear import Linear
from phasekit.bifurcation.continuation.periodic.normal_forms import (
    VERTICAL,
    at_branching,
    at_doubling,
    at_fold,
    at_torus,
    known,
)
from phasekit.bifurcation.continuation.periodic.on_curves import SAME, CurveTest, tests_of
from phasekit.bifurcation.continuation.periodic.point import Point, vertical
from phasekit.bifurcation.continuation.periodic.starts import null_vector, other_tangent
from phasekit.bifurcation.special_points import KINDS

DEPTH = 6  # halvings of a step whose multipliers change more than its special points explain
ASTRAY = 1e-2  # distance from 1 or -1 of all multipliers at what is no such special point
JUMP = 1e-3  # part of the values at both ends above which a number has no zero between them


def find(cycles: Cycles, path: Path) -> list[Found]:
    """All special points of a path, refined, in order."""
    found: list[Found] = []
    critical = len(cycles.active) == 1
    signs = [_signs(cycles, point) if critical else None for point in path.points]
    values = [_values(cycles, point) for point in path.points]
    for test, value in zip(_looked_for(cycles), values[0], strict=True):
        if isinstance(test, CurveTest) and test.blurred and value == 0.0:  # what the curve ends for
            p = float(path.points[0].orbit.y[1])
            found.append(Found(test.kind, path.points[0], 0, (p, p), "converged", "", {}))
    for i, (a, b) in enumerate(zip(path.points[:-1], path.points[1:], strict=True)):
        here: list[Found] = []
        if signs[i] is not None and signs[i + 1] is not None and signs[i] != signs[i + 1]:
            here = _between(cycles, a, b, DEPTH)
        if values[i]:
            # A special point between them parts the stretch: at a fold a parameter turns back.
            inside = [one.point for one in here if one.status == "converged"]
            inner = [_values(cycles, point) for point in inside]
            stops, at = [a, *inside, b], [values[i], *inner, values[i + 1]]
            for k in range(len(stops) - 1):
                here += _events(cycles, stops[k], stops[k + 1], at[k], at[k + 1])
        found += [replace(one, index=i) for one in here]
    return found


def _values(cycles: Cycles, point: Point) -> list[float]:
    """The numbers whose zeros are events."""
    return [_value(event, cycles, point) for event in _looked_for(cycles)]


def _value(event: Any, cycles: Cycles, point: Point) -> float:
    """The number whose zero is an event, or a special point of a curve."""
    return float(event.value(cycles, point if isinstance(event, CurveTest) else point.orbit))


def _looked_for(cycles: Cycles) -> tuple[Any, ...]:
    """Events, and special points of curves in two parameters, which are found alike."""
    return (*cycles.events, *tests_of(cycles))


def _events(
    cycles: Cycles, a: Point, b: Point, left: list[float], right: list[float]
) -> list[Found]:
    """The zeros of the numbers of orbits after one point, up to another one."""
    found = []
    for event, before, after in zip(_looked_for(cycles), left, right, strict=True):
        if not (before < 0.0 <= after or before > 0.0 >= after):
            continue
        if isinstance(event, CurveTest) and not (
            event.signed(cycles, a, before) or event.signed(cycles, b, after)
        ):
            continue  # a coefficient that is zero all along

        def value(point: Point, forced: bool, event: Any = event) -> float:
            return _value(event, cycles, point)

        point = b if after == 0.0 else root(Stretch(cycles, a, b), value)
        if isinstance(event, CurveTest) and point is not None:
            if abs(value(point, False)) > JUMP * max(abs(before), abs(after)):
                continue  # a coefficient that changes its sign without a zero
        p = sorted((float(a.orbit.y[1]), float(b.orbit.y[1])))
        status, message = "converged", ""
        if point is None:
            point, status = b, "guess"
            message = "Newton's method did not converge between the points"
        elif point is not b and isinstance(event, CurveTest) and event.blurred:
            status = "guess"
            message = f"the equations are singular there: found to {2 * SAME:g} rad of the pair"
        found.append(
            Found(event.kind, point, -1, (p[0], p[1]), status, message, {}, name=event.name)
        )  # fmt: skip
    return found


def _signs(cycles: Cycles, point: Point) -> tuple[Any, ...] | None:
    """The signs of all test functions and the number of unstable multipliers; None: not known."""
    if point.sign == 0.0 or not point.trusted:  # a branch point that the path begins at
        return None
    tests = [test.value(point, cycles.forced) >= 0.0 for test in TESTS]
    return (*tests, unstable(point.multipliers, cycles.forced))


def _between(cycles: Cycles, a: Point, b: Point, depth: int) -> list[Found]:
    """The special points between two points of a family."""
    forced = cycles.forced
    changed = [
        test for test in TESTS if (test.value(a, forced) >= 0.0) != (test.value(b, forced) >= 0.0)
    ]
    if vertical(cycles, a) and vertical(cycles, b):
        # Conservative: a second multiplier is always 1, and the parameter never moves.
        changed = [test for test in changed if test is DOUBLING]
        return [one for one in (refined(Stretch(cycles, a, b), test) for test in changed) if one]
    if FOLD in changed and BRANCHING not in changed and none_passes(a, b, forced):
        changed.remove(FOLD)  # the parameter stands still to rounding, and no multiplier passes 1
    gap = unstable(b.multipliers, forced) - unstable(a.multipliers, forced)
    if not changed and gap == 0:
        return []
    stretch = Stretch(cycles, a, b)
    found = [refined(stretch, test) for test in changed]
    kept = [one for one in found if one is not None]
    steep = [one for one in kept if one.kind == BRANCHING.kind and _stands(cycles, one.point)]
    if steep:  # where the parameter turns back at a pitchfork is no fold
        kept = [one for one in kept if one.kind != FOLD.kind]
    moves = [KINDS[one.kind].crossing or 0 for one in kept if one not in steep]
    explained = abs(gap) <= sum(moves) and (gap - sum(moves)) % 2 == 0
    if explained or depth == 0:
        return sorted(kept, key=lambda one: one.point.arclength)
    middle = stretch.at(0.5 * stretch.length)
    if middle is None or not middle.trusted:
        return sorted(kept, key=lambda one: one.point.arclength)
    return [*_between(cycles, a, middle, depth - 1), *_between(cycles, middle, b, depth - 1)]


def refined(stretch: Stretch, test: CycleTest) -> Found | None:
    """A special point where its test function vanishes; None if it is none after all."""
    point = test.root(stretch, test.value)
    p = stretch.a.orbit.y[1], stretch.b.orbit.y[1]
    interval = (float(min(p)), float(max(p)))
    if point is None:
        return Found(
            test.kind, stretch.b, -1, interval, "guess",
            "Newton's method did not converge between the points", {},
        )  # fmt: skip
    if not test.holds(nontrivial(point.multipliers, stretch.cycles.forced)):
        return None
    form, message = test.normal_form(stretch.cycles, point)
    return Found(test.kind, point, -1, interval, "converged", message, form)


def _stands(cycles: Cycles, point: Point) -> bool:
    """Whether the parameter does not move along the family."""
    return bool(abs(point.dy[1]) < VERTICAL * cycles.width[0])


# ------------------------------------------------------------------------------ the kinds


@dataclass(frozen=True, eq=False)
class CycleTest:
    """A kind of special point of a family: how it is told, found and described.

    Attributes
    ----------
    kind : str
        A kind of the registry of special points.
    value : callable
        The test function of a point, forced or not, whose sign changes.
    normal_form : callable
        Coefficients at the point, and what is to be said of them.
    holds : callable
        Whether it is such a point, by its multipliers but for the one that is always 1.
    root : callable
        The point of a stretch at which the test function vanishes.
    """

    kind: str
    value: Value
    normal_form: Callable[[Cycles, Point], tuple[dict[str, float], str]]
    holds: Callable[[list[complex]], bool] = lambda multipliers: True
    root: Callable[[Stretch, Value], Point | None] = root


Form = tuple[dict[str, float], str]


def _form_of_fold(cycles: Cycles, point: Point) -> Form:
    line = Linear(cycles, point.orbit)
    return known(line, lambda line: at_fold(line, point.dx, point.dy), {"a": 1, "b": -1})


def _form_of_branching(cycles: Cycles, point: Point) -> Form:
    own = point.dx, point.dy
    W = cycles.looked_at(point.orbit, *own).W
    other = other_tangent(cycles, point.orbit, W, own)
    line = Linear(cycles, point.orbit)
    return known(line, lambda line: at_branching(line, own, other), {"a": 1, "c": 2})


def _form_of_doubling(cycles: Cycles, point: Point) -> Form:
    W = cycles.looked_at(point.orbit, point.dx, point.dy).W
    v = null_vector(cycles, point.orbit, W, -1.0)
    return known(Linear(cycles, point.orbit), lambda line: at_doubling(line, v), {"c": 2})


def _form_of_torus(cycles: Cycles, point: Point) -> Form:
    pairs = [mu for mu in nontrivial(point.multipliers, cycles.forced) if mu.imag > 0.0]
    if not pairs:
        return {}, ""
    angle = cmath.phase(min(pairs, key=lambda mu: abs(abs(mu) - 1.0)))
    line = Linear(cycles, point.orbit)
    return known(line, lambda line: at_torus(line, angle), {"d": 2, "d_imag": 2})


def _near(critical: float) -> Callable[[list[complex]], bool]:
    """Whether a multiplier is next to a critical one."""
    return lambda multipliers: min(abs(one - critical) for one in multipliers) <= ASTRAY


def _conjugate(multipliers: list[complex]) -> bool:
    """Whether the two multipliers whose product is 1 are no real ones."""
    pairs = combinations(multipliers, 2)
    one, _ = min(pairs, key=lambda pair: abs(1.0 - pair[0] * pair[1]))
    return abs(one.imag) > 1e-9 * abs(one)


FOLD = CycleTest("fold_of_cycles", fold_test, _form_of_fold)
DOUBLING = CycleTest("period_doubling", doubling_test, _form_of_doubling, _near(-1.0))
TORUS = CycleTest("torus", torus_test, _form_of_torus, _conjugate)
BRANCHING = CycleTest(
    "cycle_branch_point", lambda point, forced: point.sign, _form_of_branching, _near(1.0),
    branching,
)  # fmt: skip
TESTS = (FOLD, DOUBLING, TORUS, BRANCHING)
