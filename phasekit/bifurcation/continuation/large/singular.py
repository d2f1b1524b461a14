"""Folds and branch points of many states, by a bordered f_x that is regular at them.

With the border (w, v) next to the null vectors of f_x, ``[f_x w; v 0] (y, g) = (0, 1)`` defines a
function g that vanishes where f_x is singular; a second one vanishes where f_u is, and the forms of
second derivatives on both null vectors give the directions of the branches ([Govaerts2000]
chapter 3).
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from scipy.optimize import brentq

from phasekit.arrays import Array
from phasekit.bifurcation.continuation.large.curve import (
    ROUNDING,
    Corrected,
    LargeCurve,
    is_rounding,
)
from phasekit.bifurcation.continuation.large.forms import Forms
from phasekit.bifurcation.continuation.large.path import Between
from phasekit.bifurcation.continuation.points.special import CONVERGED, GUESS, Special
from phasekit.numerics.factors import Bordered, Factors
from phasekit.numerics.rightmost import modes_next_to_zero

STEPS = 15
ALIKE = 0.5  # how much of a vector is another's, which moved
NOTHING = 1e-5  # of its terms, from which on a coefficient vanishes but for differences
OFF = 1e-6  # of how branches bend, by which two that do not meet may be apart
LOST = "no point was found between two of the path"
# Last step of Newton's method on a branch point, and one that is rounding if others get no shorter;
# on scaled axes.
CLOSE, FLAT, SLOW = 1e-11, 1e-8, 0.3


@dataclass(frozen=True)
class Border:
    """F_x bordered, with its null vectors: y and z of unit length where it is singular.

    Another pair may be ``held``, along which rounding of f moves points: the border has it, too.
    """

    system: Bordered
    right: Array
    left: Array
    defect: float  # g
    held: tuple[Array, Array] | None = None

    @classmethod
    def next_to(
        cls, matrix: Any, left: Array, right: Array, times: int = 1,
        held: tuple[Array, Array] | None = None,
    ) -> Border:  # fmt: skip
        """The border next to a matrix, from a guess of its null vectors, sharpened some times."""
        factors = Factors(matrix)
        n = factors.size
        side = np.zeros(n + (1 if held is None else 2))
        side[n] = 1.0
        for _ in range(times):
            system = Bordered(factors, left, right)
            system = system if held is None else Bordered(system, *held)
            y, z = system.solve(side), system.solve_transposed(side)
            found = cls(system, y[:n], z[:n], float(y[n]), held)
            right, left = y[:n] / np.linalg.norm(y[:n]), z[:n] / np.linalg.norm(z[:n])
        return found

    def solve(self, side: Array) -> Array:
        """What solves f_x for a side, and what is left of it along the left null vector."""
        n = len(side)
        return self.system.solve(np.append(side, np.zeros(self.system.size - n)))[: n + 1]


def border_at(matrix: Any) -> Border:
    """The border of a matrix that is singular, or next to it, from nothing."""
    n = matrix.shape[0]
    guess = 1.0 + 0.5 * np.cos(1.7 * np.arange(n)) + 0.3 * np.sin(0.013 * np.arange(n))
    guess = guess / np.linalg.norm(guess)
    return Border.next_to(matrix, guess, guess, 4)


def has_settled(length: float, before: float) -> bool:
    """Whether Newton's method on a branch point ends with a step of this length."""
    return length <= CLOSE or (length <= FLAT and length >= SLOW * before)


def interval_of(curve: LargeCurve, a: Array, b: Array) -> tuple[float, float]:
    """The values of the parameter at two points."""
    ends = float(a[curve.n]), float(b[curve.n])
    return min(ends), max(ends)


def fold(curve: LargeCurve, a: Array, b: Array) -> Special:
    """The fold between two points at which the parameter moves in opposite directions."""
    chord = Between(curve, a, b)

    def test(s: float) -> float:
        point = chord.point(s)
        return np.nan if point is None else float(point.tangent[curve.n] / curve.scale[curve.n])

    point, message = root_of(chord, test)
    form: dict[str, float] = {}
    if point is None:
        return guess_between(curve, "fold", a, b, message)
    null = border_at(point.matrix)
    v = null.right / np.linalg.norm(null.right)
    w = null.left / (null.left @ v)
    forms = Forms(curve, point.u)
    form = {"a": float(0.5 * w @ forms.second(v, v)), "b": float(w @ point.slope)}
    return Special(
        "fold", point.u, interval_of(curve, a, b), float(np.max(np.abs(curve.value(point.u)))),
        CONVERGED, "", form, tangent=point.tangent, extra=v, corank=1,
    )  # fmt: skip


def guess_between(curve: LargeCurve, kind: str, a: Array, b: Array, message: str) -> Special:
    """The middle of two points between which a special point was not found, and why."""
    u = 0.5 * (a + b)
    residual = float(np.max(np.abs(curve.value(u))))
    return Special(kind, u, interval_of(curve, a, b), residual, GUESS, message, corank=1)


def root_of(chord: Between, test: Any, width: float = 1e-13) -> tuple[Corrected | None, str]:
    """The point of a chord at which a function vanishes."""
    low, high = test(0.0), test(1.0)
    if not low * high <= 0.0:
        return None, "the test function has the same sign at both points of the path"
    try:
        s = brentq(test, 0.0, 1.0, xtol=width, rtol=8.9e-16, maxiter=60)
    except (ValueError, RuntimeError):
        return None, LOST
    point = chord.point(float(s))
    return point, "" if point is not None else LOST


@dataclass(frozen=True)
class Crossing:
    """F_u next to a point where it loses rank: a border, and two directions in its kernel."""

    border: Border
    one: Array  # the null vector of f_x, no part along the parameter
    two: Array  # the other, its part along the parameter one
    defects: tuple[float, float]


def crossing_at(matrix: Any, slope: Array, near: Border) -> Crossing:
    """The two directions at a point, next to the border of another one."""
    n = len(slope)
    left, right = near.left / np.linalg.norm(near.left), near.right / np.linalg.norm(near.right)
    border = Border.next_to(matrix, left, right, held=near.held)
    other = border.solve(slope)
    two = np.append(-other[:n], 1.0)
    return Crossing(border, np.append(border.right, 0.0), two, (border.defect, float(other[n])))


def crossing_border(chord: Between, middle: Any) -> Border | None:
    """The border by the vectors of the one eigenvalue that changes its sign along a chord."""
    ends = [chord.point(s) for s in (0.0, 1.0)]
    if ends[0] is None or ends[1] is None:
        return None
    found = [modes_next_to_zero(one) for one in (ends[0].matrix, middle, ends[1].matrix)]
    if any(one is None for one in found):
        return None
    (first, v, w), (_, x, y), (last, p, q) = (one for one in found if one is not None)
    alike = np.abs((w @ p) * (q @ v).T)
    changes = first[:, None] * last < 0.0
    pairs = np.argwhere(changes & (alike > ALIKE))
    if len(pairs) != 1:
        return None
    i, j = pairs[0]
    beside = np.abs(w[i] @ x) * np.abs(y @ v[:, i]) + np.abs(q[j] @ x) * np.abs(y @ p[:, j])
    k = int(np.argmax(beside))
    return Border.next_to(middle, y[k], x[:, k])


def branch_point(curve: LargeCurve, a: Array, b: Array) -> Special:
    """The branch point between two points with opposite signs of the bordered determinant."""
    n = curve.n
    chord = Between(curve, a, b)
    middle = chord.point(0.5) or chord.point(0.4)
    if middle is None:
        return guess_between(
            curve, "branch_point", a, b, "no point was found between two of the path"
        )
    near = border_at(middle.matrix)

    def test(s: float) -> float:
        point = chord.point(s)
        if point is None:
            return np.nan
        found = crossing_at(point.matrix, point.slope, near)
        t, (g1, g2) = curve.weight * point.tangent, found.defects
        return float(g1 * (t @ found.two) + g2 * (t @ found.one))

    point, message = root_of(chord, test, 1e-4)
    if point is None:  # the kernel there may be that of another eigenvalue, next to zero all along
        other = crossing_border(chord, middle.matrix)
        if other is not None:
            held = curve.unknown_of(other.system, middle.matrix, middle.slope, middle.u)
            near = replace(other, held=held)
            point, message = root_of(chord, test, 1e-4)
    u, residual = (0.5 * (a + b), np.inf) if point is None else (point.u, np.inf)
    polished = _polished(curve, u, near, chord.length)
    if near.held is not None and not (polished and _held_rightly(curve, *polished[:2])):
        polished = _polished(curve, u, replace(near, held=None), chord.length)
    if polished is None:
        message = message or "Newton's method did not converge"
        return guess_between(curve, "branch_point", a, b, message)
    u, found, residual = polished
    forms = Forms(curve, u)
    v, w = found.one / np.linalg.norm(found.one), found.border.left
    w = w / (w @ v[:n])
    bent = forms.second(v, v)
    across, along = forms.second(v, found.two), forms.second(found.two, found.two)
    q = np.array([w @ bent, w @ across, w @ along])
    terms = float(np.abs(w) @ np.abs(bent))
    flat = bool(abs(q[0]) <= NOTHING * terms) or not terms
    form = {"a": float(0.5 * q[0]), "d": float(q[1])}
    kind = "transcritical"
    if flat:
        kind = "pitchfork"
        slaved = found.border.solve(bent)[:n]
        cubic = w @ (forms.third(v, v) - 3.0 * forms.second(v, slaved)) / 6.0
        form = {"c": float(cubic), "d": float(q[1])}
    unit = 1.0 / np.array([curve.length(v), curve.length(found.two)])
    rays = _directions(*(np.array([0.0 if flat else q[0], q[1], q[2]])
                         * unit[[0, 0, 1]] * unit[[0, 1, 1]]))  # fmt: skip
    if not rays:
        return guess_between(curve, "branch_point", a, b, "branches touch here, or none meet")
    lines = [alpha * unit[0] * v + beta * unit[1] * found.two for alpha, beta in rays]
    lines = [t / curve.length(t) for t in lines]
    chords = (b - a) / chord.length
    cosines = [abs(float(curve.weight @ (t * chords))) for t in lines]
    own = int(np.argmax(cosines))
    sign = 1.0 if curve.weight @ (lines[own] * chords) >= 0.0 else -1.0
    return Special(
        kind, u, interval_of(curve, a, b), residual, CONVERGED, "", form,
        tangent=sign * lines[own], others=(lines[1 - own],), corank=1,
    )  # fmt: skip


def _held_rightly(curve: LargeCurve, u: Array, found: Crossing) -> bool:
    """Whether f_x takes the null vector to nothing along what is held, but for rounding."""
    matrix, slope = curve.derivatives(u)
    both = curve.unknown_of(found.border.system.matrix, matrix, slope, u)
    v = found.border.right
    return both is None or is_rounding(both[0][: curve.n], matrix @ v, abs(matrix) @ np.abs(v))


def _directions(a: float, b: float, c: float) -> list[tuple[float, float]]:
    """Both rays with a x^2 + 2 b x y + c y^2 = 0."""
    root = b * b - a * c
    if not root > 1e-10 * max(abs(a), abs(b), abs(c)) ** 2:
        return []
    far = -(b + np.copysign(np.sqrt(root), b))
    return [(far, a), (c, far)]


def _polished(
    curve: LargeCurve, start: Array, near: Border, reach: float
) -> tuple[Array, Crossing, float] | None:
    """Newton's method on f + w b = 0, g = 0 by the unknowns and b: the point and its directions."""
    n, u, offset, before = curve.n, np.array(start), 0.0, np.inf
    for _ in range(STEPS):
        value = curve.value(u)
        matrix, slope = curve.derivatives(u)
        if not (np.isfinite(value).all() and np.isfinite(matrix.data).all()):
            return None
        found = crossing_at(matrix, slope, near)
        w = found.border.left
        column = near.left / np.linalg.norm(near.left)
        rest = found.border.solve(-value - column * offset)
        still = np.append(rest[:n], 0.0)
        forms = Forms(curve, u)
        both = [forms.second(z, still) for z in (found.one, found.two)]
        q = [w @ forms.second(x, y) for x, y in (
            (found.one, found.one), (found.one, found.two), (found.two, found.two)
        )]  # fmt: skip
        g1, g2 = found.defects
        unit = 1.0 / np.array([curve.length(z) for z in (found.one, found.two)])
        system = np.array([[q[0], q[1]], [q[1], q[2]]]) * np.outer(unit, unit)
        side = np.array([g1 - w @ both[0], -g2 - w @ both[1]]) * unit
        size = np.max(np.abs(system))
        if not size > 0.0 or abs(np.linalg.det(system)) <= 1e-12 * size**2:
            return None
        alpha, beta = np.linalg.solve(system, side) * unit
        step = still + alpha * found.one + beta * found.two
        offset += float(rest[n] + alpha * g1 - beta * g2)
        u = u + step
        length = curve.length(step)
        if not np.isfinite(length) or curve.length(u - start) > 2.0 * reach:
            return None
        if has_settled(length, before):
            matrix, slope = curve.derivatives(u)
            rounding = float(np.abs(w) @ (ROUNDING * curve.terms(matrix, slope, u)))
            # Beside how branches bend over the reach: what keeps them apart is no branch point.
            bent = float(np.max(np.abs(system))) * reach**2
            if abs(offset * (w @ column)) > OFF * bent + rounding:
                return None
            found = crossing_at(matrix, slope, near)
            value = curve.value(u)
            return u, found, float(np.max(np.abs(value)))
        before = length
    return None
