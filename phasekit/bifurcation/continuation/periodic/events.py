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

import numpy as np
import numpy.typing as npt

from phasekit.bifurcation.continuation.periodic.criteria import (
    determinant,
    doubling_test,
    fold_test,
    none_passes,
    nontrivial,
    torus_test,
    unstable,
)
from phasekit.bifurcation.continuation.periodic.cycles import Cycles, Orbit
from phasekit.bifurcation.continuation.periodic.family import Found, Path
from phasekit.bifurcation.continuation.periodic.normal_forms import at_doubling, at_fold, at_torus
from phasekit.bifurcation.continuation.periodic.on_curves import SAME, CurveTest, tests_of
from phasekit.bifurcation.continuation.periodic.point import Point, point_of, vertical
from phasekit.bifurcation.continuation.periodic.starts import null_vector
from phasekit.bifurcation.special_points import KINDS

Array = npt.NDArray[np.float64]
Complex = npt.NDArray[np.complex128]
Value = Callable[[Point, bool], float]

DEPTH = 6  # halvings of a step whose multipliers change more than its special points explain
ASTRAY = 1e-2  # distance from 1 or -1 of all multipliers at what is no such special point
JUMP = 1e-3  # part of the values at both ends above which a number has no zero between them
NODES = 9  # points of the family through which a branch point is interpolated


@dataclass(frozen=True, eq=False)
class Stretch:
    """The family between two of its points, by the distance s along the tangent of the first."""

    cycles: Cycles
    a: Point
    b: Point

    def __post_init__(self) -> None:
        """Bring both ends to one mesh."""
        mesh = self.b.orbit.mesh
        if self.a.orbit.intervals > self.b.orbit.intervals:
            mesh = self.a.orbit.mesh
        a, (dx,) = self.cycles.on(mesh, self.a.orbit, self.a.dx)
        b, (db,) = self.cycles.on(mesh, self.b.orbit, self.b.dx)
        rows, rows_y, target = self.cycles.rows(a, dx, self.a.dy)
        length = float(np.sum(rows[-1] * (b.x - a.x)) + rows_y[-1] @ (b.y - a.y))
        # db/ds of the second end, where its tangent has this part along that of the first.
        rate = float(np.sum(rows[-1] * db) + rows_y[-1] @ self.b.dy)
        own: dict[str, Any] = {
            "ends": (a, b), "tangents": ((dx, self.a.dy), (db / rate, self.b.dy / rate)),
            "rows": (rows, rows_y, target), "length": length,
        }  # fmt: skip
        for name, value in own.items():
            object.__setattr__(self, name, value)

    ends: tuple[Orbit, Orbit] = None  # type: ignore[assignment]
    tangents: Any = None
    rows: Any = None
    length: float = 0.0

    def at(self, s: float) -> Point | None:
        """The point at a distance; None if Newton's method finds none."""
        (a, b), ((dx, dy), (ex, ey)) = self.ends, self.tangents
        t, h = s / self.length, self.length
        # Cubic through both ends with their tangents.
        c = (2 * t**3 - 3 * t**2 + 1, t**3 - 2 * t**2 + t, 3 * t**2 - 2 * t**3, t**3 - t**2)
        x = c[0] * a.x + h * c[1] * dx + c[2] * b.x + h * c[3] * ex
        y = c[0] * a.y + h * c[1] * dy + c[2] * b.y + h * c[3] * ey
        rows, rows_y, target = self.rows
        # The phase of the guess, which the second end may have measured by another orbit.
        target = target.copy()
        target[-1] += s
        target[0] = np.sum(rows[0] * x)
        found = self.cycles.correct(Orbit(a.mesh, x, y), rows, rows_y, target, iterations=12)
        if not found.converged:
            return None
        made = point_of(self.cycles, found, self.a.arclength + s, s)
        return made


def find(cycles: Cycles, path: Path) -> list[Found]:
    """All special points of a path, refined, in order."""
    found: list[Found] = []
    critical = len(cycles.active) == 1
    signs = [_signs(cycles, point) if critical else None for point in path.points]
    values = [_values(cycles, point) for point in path.points]
    for test, value in zip(_looked_for(cycles), values[0], strict=True):
        if isinstance(test, CurveTest) and value == 0.0:  # what the curve ends for
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
    return [event.value(cycles, point.orbit) for event in _looked_for(cycles)]


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

        def value(point: Point, forced: bool, event: Any = event) -> float:
            return float(event.value(cycles, point.orbit))

        point = b if after == 0.0 else _root(Stretch(cycles, a, b), value)
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
    moves = [KINDS[one.kind].crossing or 0 for one in kept]
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
    form = test.normal_form(stretch.cycles, point)
    return Found(test.kind, point, -1, interval, "converged", "", form)


def _root(stretch: Stretch, test: Value) -> Point | None:
    """The point of a stretch where a test function vanishes, by secants within a bracket."""
    forced = stretch.cycles.forced
    low, high = 0.0, stretch.length
    left, right = test(stretch.a, forced), test(stretch.b, forced)
    best: Point | None = None
    least = np.inf
    s, before = high, np.inf
    side = 0
    f_left, f_right = left, right
    for _ in range(60):
        s = (
            low + (high - low) * f_left / (f_left - f_right)
            if f_left != f_right
            else 0.5 * (low + high)
        )
        if not low < s < high:
            s = 0.5 * (low + high)
        point = stretch.at(s)
        if point is None:
            return None
        value = test(point, forced)
        if abs(value) < least:
            best, least = point, abs(value)
        if value == 0.0 or abs(s - before) <= 1e-14 * stretch.length:
            break
        before = s
        if (value >= 0.0) == (left >= 0.0):
            low, f_left = s, value
            if side == -1:
                f_right *= 0.5  # Illinois
            side = -1
        else:
            high, f_right = s, value
            if side == 1:
                f_left *= 0.5
            side = 1
        if high - low <= 1e-14 * stretch.length:
            break
    return best


def _branching(stretch: Stretch, test: Value) -> Point | None:
    """A branch point, where the equations are singular: from the points to both of its sides.

    The family is smooth through it, so its points at a distance say where it is to rounding.
    """
    cycles = stretch.cycles
    nodes = 0.5 * stretch.length * (1.0 - np.cos(np.pi * (np.arange(NODES) + 0.5) / NODES))
    points = [stretch.at(float(s)) for s in nodes]
    made = [(s, p) for s, p in zip(nodes, points, strict=True) if p is not None]
    if len(made) < NODES - 2:
        return None
    at = np.array([s for s, _ in made]) / stretch.length
    values = np.array([determinant(p, cycles.forced) for _, p in made])
    fit = np.polynomial.Polynomial.fit(at, values, len(at) - 1, domain=[0.0, 1.0])
    roots = fit.roots()
    inside = roots[(np.abs(roots.imag) < 1e-6) & (roots.real > -1e-9) & (roots.real < 1.0 + 1e-9)]
    if not len(inside):
        return None
    s = float(inside[np.argmin(np.abs(inside.real - 0.5))].real)
    weights = np.array(
        [np.prod((s - np.delete(at, k)) / (at[k] - np.delete(at, k))) for k in range(len(at))]
    )
    mixed = [
        sum(w * getattr(p, name) for w, (_, p) in zip(weights, made, strict=True))
        for name in ("dx", "dy")
    ]
    orbit = Orbit(
        made[0][1].orbit.mesh,
        np.asarray(sum(w * p.orbit.x for w, (_, p) in zip(weights, made, strict=True))),
        np.asarray(sum(w * p.orbit.y for w, (_, p) in zip(weights, made, strict=True))),
    )
    checked = cycles.looked_at(orbit, *mixed)
    return point_of(cycles, checked, stretch.a.arclength + s * stretch.length, s * stretch.length)


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
        Coefficients at the point.
    holds : callable
        Whether it is such a point, by its multipliers but for the one that is always 1.
    root : callable
        The point of a stretch at which the test function vanishes.
    """

    kind: str
    value: Value
    normal_form: Callable[[Cycles, Point], dict[str, float]] = lambda cycles, point: {}
    holds: Callable[[list[complex]], bool] = lambda multipliers: True
    root: Callable[[Stretch, Value], Point | None] = _root


def _form_of_fold(cycles: Cycles, point: Point) -> dict[str, float]:
    return at_fold(cycles, point.orbit, point.dx, point.dy)


def _form_of_doubling(cycles: Cycles, point: Point) -> dict[str, float]:
    W = cycles.looked_at(point.orbit, point.dx, point.dy).W
    return at_doubling(cycles, point.orbit, null_vector(cycles, point.orbit, W, -1.0))


def _form_of_torus(cycles: Cycles, point: Point) -> dict[str, float]:
    pairs = [mu for mu in nontrivial(point.multipliers, cycles.forced) if mu.imag > 0.0]
    if not pairs:
        return {}
    one = min(pairs, key=lambda mu: abs(abs(mu) - 1.0))
    return at_torus(cycles, point.orbit, cmath.phase(one))


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
    "cycle_branch_point", lambda point, forced: point.sign, holds=_near(1.0), root=_branching
)
TESTS = (FOLD, DOUBLING, TORUS, BRANCHING)
