"""Curves that m equations define in m + 1 unknowns, for m = 1, 2 or 3, traced inside a box.

The unknowns are measured in units of the box, so that one step size serves them all. Vertices solve
the equations to rounding; a curve ends on the edge of the box, or closes.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from phasekit.arrays import Array

#: Residuals (m,) and their Jacobian (m, m + 1) at a point.
Equations = Callable[[Array], tuple[Array, Array]]

LONGEST, SHORTEST = 0.02, 1e-7
TURN = 0.12  # between neighboring chords, rad
MOST = 20_000
# Chords lie this near to their curve, in units of the box; two points this near are the same.
NEAR, SAME = 2e-3, 1e-8
EDGE = 1e-12


@dataclass(frozen=True)
class Trace:
    """Vertices of one curve, shape (n, m + 1), and whether it is closed."""

    vertices: Array
    closed: bool


def trace(
    equations: Equations,
    start: Array,
    corners: Array | None = None,
    inside: Callable[[Array], bool] | None = None,
) -> Trace:
    """Trace the curve through a point, both ways.

    Parameters
    ----------
    equations : callable
        The first two unknowns run over the unit box.
    start : ndarray
        A point on the curve.
    corners : ndarray, optional
        Values of the third unknown, modulo their spacing, at which the curve may have a cusp in
        the plane of the first two: there a vertex is placed.
    inside : callable, optional
        Whether a point belongs to the curve; it ends where the points do not.
    """
    forward, closed = _one_way(equations, start, 1.0, corners, inside)
    if closed:
        return Trace(np.array(forward), True)
    backward, _ = _one_way(equations, start, -1.0, corners, inside)
    return Trace(np.array([*backward[:0:-1], *forward]), False)


def solve(equations: Equations, guess: Array, fixed: int, value: float) -> Array | None:
    """Return the point near `guess` where one unknown has a value, or None."""
    row = np.zeros(guess.size)
    row[fixed] = 1.0
    point = guess.copy()
    point[fixed] = value
    found = newton(equations, point, row, value)
    if found is not None:
        found[fixed] = value
    return found


def newton(equations: Equations, point: Array, row: Array, level: float) -> Array | None:
    """Solve the equations together with ``row . z = level``, to rounding."""
    z = point.copy()
    last = np.inf
    for _ in range(12):
        residual, jacobian = equations(z)
        right = np.append(residual, row @ z - level)
        try:
            step = np.linalg.solve(np.vstack([jacobian, row]), right)
        except np.linalg.LinAlgError:
            return None
        size = float(np.abs(step).max())
        if not size < 0.5:
            return None
        z = z - step
        if size < 1e-15 or (size < 1e-11 and size >= 0.5 * last):
            return z
        last = size
    return z if last < 1e-12 else None


def tangent(jacobian: Array) -> Array:
    """Return the unit vector that all gradients are square to."""
    if jacobian.shape[0] == 1:
        vector = np.array([-jacobian[0, 1], jacobian[0, 0]])
    elif jacobian.shape[0] == 2:
        (a, b, c), (d, e, f) = jacobian
        vector = np.array([b * f - c * e, c * d - a * f, a * e - b * d])
    else:
        minors = [np.delete(jacobian, i, axis=1) for i in range(jacobian.shape[1])]
        signs = (-1.0) ** np.arange(len(minors))
        vector = signs * np.linalg.det(np.array(minors))
    length = np.sqrt(vector @ vector)
    return np.asarray(vector / length if length > 0.0 else vector)


def _one_way(
    equations: Equations,
    start: Array,
    sign: float,
    corners: Array | None,
    inside: Callable[[Array], bool] | None,
) -> tuple[list[Array], bool]:
    points = [start]
    way = sign * tangent(equations(start)[1])
    first = way
    step = 0.25 * LONGEST
    while len(points) < MOST and step > SHORTEST and way.any():
        here = points[-1]
        guess = here + step * way
        there = newton(equations, guess, way, float(way @ guess))
        ahead = None if there is None else tangent(equations(there)[1])
        if ahead is not None:
            ahead = ahead if ahead @ way > 0.0 else -ahead
        if there is None or ahead is None or ahead @ way < np.cos(2.0 * TURN):
            step *= 0.5
            continue
        if inside is not None and not inside(there):
            return [*points, last_point(equations, here, there, inside)], False
        corner = _corner(equations, here, there, corners)
        if corner is not None:
            points.append(corner)
            if _outside(there):
                return points, False
        elif _outside(there):
            edge = _edge(equations, here, there)
            if edge is not None:
                points.append(edge)
            return points, False
        if len(points) > 3 and _passes(here, there, start, first):
            return [*points, start + _turns(there - start)], True
        points.append(there)
        turn = np.arccos(min(1.0, float(ahead @ way)))
        step = min(LONGEST, step * float(np.clip(TURN / max(turn, 1e-6), 0.5, 1.6)))
        way = ahead
    return points, False


def _outside(point: Array) -> bool:
    return bool((point[:2] < -EDGE).any() or (point[:2] > 1.0 + EDGE).any())


def _edge(equations: Equations, here: Array, there: Array) -> Array | None:
    """Return where a chord that leaves the box has the curve on the edge."""
    best: tuple[float, Array] | None = None
    for i in (0, 1):
        for bound in (0.0, 1.0):
            low, high = sorted((here[i], there[i]))
            if not low <= bound <= high or there[i] == here[i]:
                continue
            share = (bound - here[i]) / (there[i] - here[i])
            point = solve(equations, here + share * (there - here), i, bound)
            if point is not None and not _outside(point) and (best is None or share < best[0]):
                best = (share, point)
    return None if best is None else best[1]


def _corner(equations: Equations, here: Array, there: Array, corners: Array | None) -> Array | None:
    """Return the point between two where the third unknown has a special value."""
    if corners is None:
        return None
    low, high = sorted((here[2], there[2]))
    inside = corners[(corners > low + 1e-9) & (corners < high - 1e-9)]
    if not inside.size:
        return None
    share = (inside[0] - here[2]) / (there[2] - here[2])
    point = solve(equations, here + share * (there - here), 2, float(inside[0]))
    if point is None or _outside(point):
        return None
    point[:2] = np.where(np.abs(point[:2] - 0.5) >= 0.5 - EDGE, np.round(point[:2]), point[:2])
    return point


def _passes(here: Array, there: Array, start: Array, first: Array) -> bool:
    """Whether the last step ran past the point where the curve began, in the same direction."""
    chord = there - here
    back = start + _turns(there - start) - here
    length = float(chord @ chord)
    along = float(back @ chord) / length
    off = back - along * chord
    near = float(np.sqrt(off @ off)) < 0.05 * np.sqrt(length)
    return 0.0 <= along <= 1.0 and near and float(chord @ first) > 0.0


def _turns(shift: Array) -> Array:
    """Whole units of the third unknown, which is an angle in turns."""
    turns = np.zeros(shift.size)
    turns[2:] = np.round(shift[2:])
    return turns


# ------------------------------------------------------------------------- several curves


def new_curve(
    curves: list[Trace],
    equations: Equations,
    start: Array | None,
    guess: Array,
    corners: Array | None = None,
    inside: Callable[[Array], bool] | None = None,
) -> Trace | None:
    """Trace the curve through a point, unless it is known; add it to the curves.

    None where the point is far from the guess, or the curve touches a corner of the box alone.
    """
    if start is None or np.abs(start - guess).max() > 0.01 or _on(curves, equations, start):
        return None
    curve = trace(equations, start, corners, inside)
    if not extends(curve.vertices):
        return None
    curves.append(curve)
    return curve


def extends(vertices: Array) -> bool:
    """Whether a curve is more than a point in the box."""
    return len(vertices) > 1 and bool(np.ptp(vertices[:, :2], axis=0).max() > SAME)


def _on(curves: list[Trace], equations: Equations, point: Array) -> bool:
    """Whether a point of the set lies on one of the curves."""
    for curve in curves:
        shift = point - curve.vertices
        shift[:, 2:] -= np.round(shift[:, 2:])
        chord = np.diff(curve.vertices, axis=0)
        if np.abs(shift).max(axis=1).min() < SAME:
            return True
        along = (shift[:-1] * chord).sum(axis=1) / (chord * chord).sum(axis=1).clip(1e-300)
        off = shift[:-1] - np.clip(along, 0.0, 1.0)[:, None] * chord
        distance = (off * off).sum(axis=1)
        k = int(distance.argmin())
        if distance[k] > NEAR * NEAR:
            continue
        # The curve itself, over the foot of the point on its chord.
        start, way = curve.vertices[k], chord[k]
        level = float(way @ (start + shift[k]))
        there = newton(equations, start + along[k] * way, way, level)
        if there is not None and np.abs(there - start - shift[k]).max() < SAME:
            return True
    return False


def last_point(
    equations: Equations, inner: Array, outer: Array, holds: Callable[[Array], bool]
) -> Array:
    """The last point of a curve between two of its vertices where a condition holds."""
    chord = outer - inner
    low, high = 0.0, 1.0
    point = inner
    for _ in range(60):
        share = 0.5 * (low + high)
        guess = inner + share * chord
        found = newton(equations, guess, chord, float(chord @ guess))
        point = guess if found is None else found
        low, high = (share, high) if holds(point) else (low, share)
    return point
