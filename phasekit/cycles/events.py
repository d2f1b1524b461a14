"""Special points between the points of a family of periodic orbits.

Each is bracketed by the sign of a test function and refined on it to rounding: folds by the
tangent's part along the parameter, period doublings by det(M + 1), tori by the product of
1 - mu_i mu_j, in which real pairs are no bifurcation, branch points by the determinant of the
bordered equations and det(M - 1) ([Kuznetsov2004] 10.3). Where two pass at once no sign may change:
what is left then is counted (`together`).
"""

from __future__ import annotations

import cmath
import functools
import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from itertools import groupby
from typing import Any

import numpy as np

from phasekit.bifurcation.continuation.normal_form import zero_along
from phasekit.bifurcation.special_points import KINDS
from phasekit.cycles import on_connections as on_connections
from phasekit.cycles.between import (
    Stretch,
    Value,
    branching,
    root,
)
from phasekit.cycles.criteria import (
    conjugate,
    determinant,
    determinant_whole,
    doubling_test,
    doubling_whole,
    fold_test,
    none_passes,
    nontrivial,
    torus_test,
    unstable,
)
from phasekit.cycles.cycles import Cycles, Solution
from phasekit.cycles.divergence import single
from phasekit.cycles.family import Found, Path
from phasekit.cycles.folds import settled
from phasekit.cycles.linear import Linear
from phasekit.cycles.normal_forms import (
    VERTICAL,
    at_branching,
    at_doubling,
    at_fold,
    at_torus,
    coefficients,
)
from phasekit.cycles.on_curves import SAME, OrbitTest, looked_for_on
from phasekit.cycles.point import Point, State, point_of, still, vertical
from phasekit.cycles.starts import null_vector, other_tangent
from phasekit.cycles.together import together

DEPTH = 6  # halvings of a step whose multipliers change more than its special points explain
ASTRAY = 1e-2  # distance from 1 or -1 of all multipliers at what is no such special point
ROUNDED = 1e-10  # part of a tangent along the parameter, beside its span, that is rounding
CRITICAL = 1e-7  # distance from 1 of the multiplier of a fold, beyond which it is looked for by it
CUSP = "cusp"  # where the parameters of a curve of folds turn back
JUMP = 1e-3  # part of the values at both ends above which a number has no zero between them


def find(cycles: Cycles, path: Path) -> tuple[list[Found], tuple[str, ...]]:
    """All special points of a path, refined, in order.

    And, in words, where none are looked for, and what is zero all along, whose zeros are no points.
    """
    found: list[Found] = []
    critical = bool(tests_of(cycles))
    signs = [_signs(cycles, point) if critical else None for point in path.points]
    looked_for = _looked_for(cycles)
    values = [[_value(one, cycles, point) for one in looked_for] for point in path.points]
    said = list(_hidden(cycles, path))
    for k, test in enumerate(looked_for):
        column = np.array([row[k] for row in values])
        if isinstance(test, OrbitTest) and test.vanishes(cycles, path.points, column):
            said.append(zero_along(test.coefficient, test.kind))
            for row in values:
                row[k] = math.nan
    for test in looked_for:
        if isinstance(test, OrbitTest):
            words = (test.lost(cycles, point) for point in path.points)
            said += [f"{test.kind} is not looked for {why}" for why in {*words} - {""}]
    for test, value in zip(looked_for, values[0], strict=True):
        if isinstance(test, OrbitTest) and test.blurred and value == 0.0:  # what the curve ends for
            p = float(path.points[0].orbit.y[1])
            found.append(Found(test.kind, path.points[0], 0, (p, p), "converged"))
    for i, (a, b) in enumerate(zip(path.points[:-1], path.points[1:], strict=True)):
        here: list[Found] = []
        if signs[i] is not None and signs[i + 1] is not None and signs[i] != signs[i + 1]:
            here = _between(cycles, a, b, DEPTH)
            if cycles.closes:
                here += together(Stretch(cycles, a, b), here)
        if values[i]:
            # A special point between them parts the stretch: at a fold a parameter turns back.
            inside = [one.point for one in here if one.status == "converged"]
            inner = [[_value(one, cycles, point) for one in looked_for] for point in inside]
            stops, at = [a, *inside, b], [values[i], *inner, values[i + 1]]
            for k in range(len(stops) - 1):
                here += _events(cycles, stops[k], stops[k + 1], at[k], at[k + 1])
        found += [replace(one, index=i) for one in here]
    return found, tuple(said)


def _hidden(cycles: Cycles, path: Path) -> Iterator[str]:
    """Where errors hide multipliers, in words."""
    name = cycles.field.parameters[cycles.active[0]]
    for hidden, part in groupby(path.points, lambda one: bool(np.isnan(one.multipliers).any())):
        if not hidden:
            continue
        points = list(part)
        ends = points[0].orbit.y, points[-1].orbit.y
        a, b = (f"{name} = {y[1]:.9g} with period {y[0]:.6g}" for y in ends)
        if all(math.isnan(one.liouville_error) for one in points):
            why = (
                "two schemes differ, or what grows may do so faster than intervals of the mesh tell"
            )
        else:
            why = (
                "directions grow and decay along these orbits by so much more than over a period "
                "that errors hide them"
            )
        yield (
            f"multipliers are not known from {a} to {b}: {why}; special points that they tell are "
            "not looked for there"
        )


def _value(event: Any, cycles: Cycles, point: Point) -> float:
    """The number whose zero is an event, or a special point of a curve."""
    return float(event.value(cycles, point if isinstance(event, OrbitTest) else point.orbit))


def _looked_for(cycles: Cycles) -> tuple[Any, ...]:
    """Events, and special points of curves in two parameters, which are found alike."""
    return (*cycles.events, *looked_for_on(cycles))


def _events(
    cycles: Cycles, a: Point, b: Point, left: list[float], right: list[float]
) -> list[Found]:
    """The zeros of the numbers of orbits after one point, up to another one."""
    found = []
    for event, before, after in zip(_looked_for(cycles), left, right, strict=True):
        if not (before < 0.0 <= after or before > 0.0 >= after):
            continue
        if isinstance(event, OrbitTest) and not (
            event.signed(cycles, a) or event.signed(cycles, b)
        ):
            continue  # a coefficient that is zero all along

        def value(point: Point, forced: bool, event: Any = event) -> float:
            return _value(event, cycles, point)

        stretch = Stretch(cycles, a, b)
        point = b if after == 0.0 else root(stretch, value)
        if isinstance(event, OrbitTest) and point is not None:
            if abs(value(point, False)) > JUMP * max(abs(before), abs(after)):
                if _on_the_way(stretch, point):
                    continue  # a coefficient that changes its sign without a zero
                point = None
        p = sorted((float(a.orbit.y[1]), float(b.orbit.y[1])))
        status, message = "converged", ""
        if point is None:
            point, status = b, "guess"
            message = "Newton's method did not converge between the points"
        elif point is not b and isinstance(event, OrbitTest) and event.blurred:
            status = "guess"
            message = f"the equations are singular there: found to {2 * SAME:g} rad of the pair"
        elif event.kind == CUSP and not turns_back(cycles, a, b):
            status = "guess"
            message = f"{event.coefficient} changes its sign, but the parameters do not turn back"
        found.append(
            Found(event.kind, point, -1, (p[0], p[1]), status, message, name=event.name)
        )  # fmt: skip
    return found


def turns_back(cycles: Cycles, a: Point, b: Point) -> bool:
    """Whether both parameters go back between two points, as on both sides of a cusp of a curve.

    Further ones, that conditions tell, follow as states do.
    """
    ways = [one.dy[1:3] / cycles.width[:2] for one in (a, b)]
    return bool(ways[0] @ ways[1] < 0.0)


def _on_the_way(stretch: Stretch, point: Point) -> bool:
    """Whether a point is not farther from two others than these from each other, or tangents lead.

    Where the parameters turn back, both ends lie on one side of the point.
    """
    ends = stretch.a, stretch.b
    y, ways = (np.array([one.orbit.y for one in ends]), np.array([one.dy for one in ends]))
    low, high = y.min(axis=0), y.max(axis=0)
    away = np.maximum(low - point.orbit.y, point.orbit.y - high)
    led = abs(stretch.length) * np.abs(ways).max(axis=0)
    rounding = ROUNDED * np.append(high[0], stretch.cycles.width)
    return bool(np.all(away <= high - low + led + rounding))


def _signs(cycles: Cycles, point: Point) -> tuple[Any, ...] | None:
    """The signs of all test functions and the number of unstable multipliers; None: not known."""
    if point.sign == 0.0 or not point.trusted:  # a branch point that the path begins at
        return None
    tests = [test.value(point, cycles.forced) >= 0.0 for test in tests_of(cycles)]
    return (*tests, unstable(point.multipliers, cycles.forced) if cycles.closes else 0)


def _between(cycles: Cycles, a: Point, b: Point, depth: int) -> list[Found]:
    """The special points between two points of a family."""
    forced = cycles.forced
    changed = [
        test
        for test in tests_of(cycles)
        if (test.value(a, forced) >= 0.0) != (test.value(b, forced) >= 0.0)
    ]
    if not cycles.closes:
        if blurred(cycles, a, b):  # the parameter stands still but for rounding
            changed = [test for test in changed if test.kind != FOLD_OF_OPEN]
        made = (refined(Stretch(cycles, a, b), test) for test in changed)
        return [one for one in made if one is not None]
    if (vertical(cycles, a) and vertical(cycles, b)) or still(cycles, a, b):
        # Conservative: a second multiplier is always 1, and the parameter never moves.
        changed = [test for test in changed if test is DOUBLING]
        return [one for one in (refined(Stretch(cycles, a, b), test) for test in changed) if one]
    if blurred(cycles, a, b):
        # Rounding has no sign: where no families cross, a multiplier passes 1 at folds alone.
        passes = (determinant(a, forced) >= 0.0) != (determinant(b, forced) >= 0.0)
        changed = [test for test in changed if test is not FOLD]
        changed += [FOLD] * (passes != (BRANCHING in changed))
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
    middle = stretch.point(0.5 * stretch.length)
    if middle is None or not middle.trusted:
        return sorted(kept, key=lambda one: one.point.arclength)
    return [*_between(cycles, a, middle, depth - 1), *_between(cycles, middle, b, depth - 1)]


def refined(stretch: Stretch, test: CycleTest) -> Found | None:
    """A special point where its test function vanishes; None if it is none after all."""
    point = test.root(stretch, test.value)
    p = stretch.a.orbit.y[1], stretch.b.orbit.y[1]
    interval = (float(min(p)), float(max(p)))
    forced = stretch.cycles.forced
    if point is None:
        if not any(test.may_be(end, forced) for end in (stretch.a, stretch.b)):
            return None
        return Found(
            test.kind, stretch.b, -1, interval, "guess",
            "Newton's method did not converge between the points",
        )  # fmt: skip
    if not test.holds(point, forced):
        a, b = stretch.a, stretch.b
        if test is not BRANCHING or not isinstance(a, Point):
            return None
        if not determinant(a, forced) * determinant(b, forced) < 0.0:
            return None
        return Found(
            test.kind, point, -1, interval, "guess",
            "a multiplier passes 1 between the points, but no orbit was found at which it is 1",
        )  # fmt: skip
    if test is FOLD and point.trusted and not _near(1.0)(point, forced):
        mu = min(nontrivial(point.multipliers, forced), key=lambda one: abs(one - 1.0))
        return Found(
            test.kind, point, -1, interval, "guess",
            f"the parameter stands still to rounding, but the nearest multiplier is {mu:.3g}",
        )  # fmt: skip
    form = functools.cache(functools.partial(test.normal_form, stretch.cycles, point))
    return Found(test.kind, point, -1, interval, "converged", form=form)


def _stands(cycles: Cycles, point: Point) -> bool:
    """Whether the parameter does not move along the family."""
    return bool(abs(point.dy[1]) < VERTICAL * cycles.width[0])


# ------------------------------------------------------------------------------ the kinds


@dataclass(frozen=True, eq=False)
class CycleTest:
    """A kind of special point of a family: how it is told, found and described."""

    kind: str  # A kind of the registry of special points
    value: Value  # the test function of a point, forced or not, whose sign changes
    #: Coefficients at the point, and what is to be said of them.
    normal_form: Callable[[Cycles, Point], tuple[dict[str, float], str]]
    #: Whether it is such a point, by its multipliers but for the one that is always 1.
    holds: Callable[[Point, bool], bool] = lambda point, forced: True
    #: Whether there can be such a point beside one, by its multipliers.
    may_be: Callable[[Any, bool], bool] = lambda point, forced: True
    #: The point of a stretch at which the test function vanishes.
    root: Callable[[Stretch, Value], Point | None] = root


Form = tuple[dict[str, float], str]


def _form_of_fold(cycles: Cycles, point: Point) -> Form:
    def way(growth: float) -> Callable[[Point | Solution], Callable[[Linear], dict[str, float]]]:
        return lambda one: lambda line: at_fold(line, one.dx, growth=growth)

    ways = (math.inf, -math.inf) if single(cycles) else (math.inf,)
    return coefficients(cycles, point, {"a": 1, "b": -1}, *map(way, ways))


def _form_of_branching(cycles: Cycles, point: Point) -> Form:
    def way(one: Point | Solution) -> Callable[[Linear], dict[str, float]]:
        own = one.dx, one.dy
        other = other_tangent(cycles, one.orbit, _condensed(cycles, one), own)
        return lambda line: at_branching(line, own, other)

    return coefficients(cycles, point, {"a": 1, "c": 2}, way, crossing=True)


def _form_of_doubling(cycles: Cycles, point: Point) -> Form:
    def way(one: Point | Solution) -> Callable[[Linear], dict[str, float]]:
        v = null_vector(cycles, one.orbit, _condensed(cycles, one), -1.0)
        return lambda line: at_doubling(line, v)

    return coefficients(cycles, point, {"c": 2}, way)


def _form_of_torus(cycles: Cycles, point: Point) -> Form:
    pairs = [mu for mu in nontrivial(point.multipliers, cycles.forced) if mu.imag > 0.0]
    if not pairs:
        return {}, ""
    angle = cmath.phase(min(pairs, key=lambda mu: abs(abs(mu) - 1.0)))
    return coefficients(
        cycles, point, {"d": 2, "d_imag": 2}, lambda one: lambda line: at_torus(line, angle)
    )


def _condensed(cycles: Cycles, one: Point | Solution) -> Any:
    """The condensed equations of an orbit."""
    return one.W if isinstance(one, Solution) else cycles.looked_at(one.orbit, one.dx, one.dy).W


def blurred(cycles: Cycles, a: Point | State, b: Point) -> bool:
    """Whether the parameter stands still to rounding, as where orbits explode along canards."""
    limit = ROUNDED * float(cycles.width[0])
    return bool(min(abs(a.dy[1]), abs(b.dy[1])) <= limit)


def _fold(stretch: Stretch, value: Value) -> Point | None:
    """The fold of a stretch: where the parameter turns back or, for rounding, the multiplier is 1.

    The parameter says where it is to the root of rounding; a single multiplier is zero of an
    integral there, which says more.
    """
    cycles = stretch.cycles
    blurs = blurred(cycles, stretch.a, stretch.b)
    point = root(stretch, determinant_whole if blurs else value)
    if point is None or not single(cycles):
        return point
    mu = nontrivial(point.multipliers, cycles.forced)[0]
    if abs(mu - 1.0) <= CRITICAL:
        return point
    found = settled(cycles, point)
    moved = cycles.on(point.orbit.mesh, found.orbit)[0].x - point.orbit.x
    nothing = np.zeros(cycles.q)
    if not found.converged or cycles.length(point.orbit.mesh, moved, nothing) > stretch.length:
        return point
    return point_of(cycles, found, point.arclength, point.step)


def _near(critical: float) -> Callable[[Point, bool], bool]:
    """Whether a multiplier is next to a critical one."""

    def holds(point: Point, forced: bool) -> bool:
        mu = nontrivial(point.multipliers, forced)
        return min(abs(one - critical) for one in mu) <= ASTRAY

    return holds


FOLD = CycleTest("fold_of_cycles", fold_test, _form_of_fold, root=_fold)
DOUBLING = CycleTest(
    "period_doubling", doubling_test, _form_of_doubling, _near(-1.0),
    root=lambda stretch, value: root(stretch, doubling_whole),
)  # fmt: skip
TORUS = CycleTest("torus", torus_test, _form_of_torus, conjugate, conjugate)
BRANCHING = CycleTest(
    "cycle_branch_point", lambda point, forced: point.sign, _form_of_branching, _near(1.0),
    root=branching,
)  # fmt: skip
TESTS = (FOLD, DOUBLING, TORUS, BRANCHING)


def _no_form(cycles: Cycles, point: Point) -> Form:
    return {}, ""


FOLD_OF_OPEN = "fold"
#: Of solutions that need not close, which have no multipliers.
OPEN = (
    CycleTest(FOLD_OF_OPEN, fold_test, _no_form),
    CycleTest("branch_point", lambda point, forced: point.sign, _no_form, root=branching),
)


def tests_of(cycles: Cycles) -> tuple[CycleTest, ...]:
    """The kinds of special points that are looked for by multipliers and tangents."""
    if not cycles.closes:
        return OPEN if cycles.critical else ()
    return TESTS if len(cycles.active) == 1 else ()
