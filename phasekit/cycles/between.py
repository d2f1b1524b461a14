"""Points of a family between two of its points: at a distance, or where a number vanishes."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from phasekit.arrays import Array
from phasekit.cycles import moving
from phasekit.cycles.criteria import LARGEST, determinant, determinant_whole, fold_test
from phasekit.cycles.cycles import Cycles, Orbit
from phasekit.cycles.point import Point, State, point_of
from phasekit.cycles.starts import other_tangent, resolved, singularity

Value = Callable[[Any, bool], float]

SPLIT = 1e-2  # part of a step between the zeros into which rounding parts a double one
STILL = 1e-11  # part of a stretch, as far as orbits are known, within which roots settle
ROUNDING, STALLS = 1e-6, 3  # part of its lesser value at the ends, where it may stand, how often
UNKNOWN = 6  # values that are not known, after which a search ends
FINER = 1.1  # times the points of a mesh that does not resolve what goes off
ZOOMS, ZOOM = 3, 0.06  # windows in which it is looked for, and half of one beside the last
WINDOWS = 8  # the same at most, where multipliers say whether one shows it
NODES = 9  # points of the family through which a branch point is interpolated
SETTLED = 1e-9  # part of a stretch by which a zero may move without the outer points


@dataclass(frozen=True, eq=False)
class Stretch:
    """The family between two of its points, by the distance s along the tangent of the first."""

    cycles: Cycles
    a: Point | State
    b: Point
    mesh: Array | None = None

    def __post_init__(self) -> None:
        """Bring both ends to one mesh."""
        shift: Any = None
        moves: Any = None
        if self.cycles.slides:
            (a, one), (b, other) = moving.matched(self.cycles, self.a, self.b)
            (shift, dx, across, dy), (moves, db, _, db_y) = one, other
        else:
            mesh = self.b.orbit.mesh
            if self.a.orbit.intervals > self.b.orbit.intervals:
                mesh = self.a.orbit.mesh
            mesh = mesh if self.mesh is None else self.mesh
            a, (dx,) = self.cycles.on(mesh, self.a.orbit, self.a.dx)
            b, (db,) = self.cycles.on(mesh, self.b.orbit, self.b.dx)
            dy, db_y, across = self.a.dy, self.b.dy, dx
        rows, rows_y, target = self.cycles.rows(a, across, dy)
        length = float(np.sum(rows[-1] * (b.x - a.x)) + rows_y[-1] @ (b.y - a.y))
        # db/ds of the second end, where its tangent has this part along that of the first.
        rate = float(np.sum(rows[-1] * db) + rows_y[-1] @ db_y)
        own: dict[str, Any] = {
            "ends": (a, b), "tangents": ((dx, dy), (db / rate, db_y / rate)),
            "rows": (rows, rows_y, target), "length": length,
            "across": across, "shifts": None if shift is None else (shift, moves / rate),
        }  # fmt: skip
        for name, value in own.items():
            object.__setattr__(self, name, value)

    ends: tuple[Orbit, Orbit] = None  # type: ignore[assignment]
    tangents: Any = None
    rows: Any = None
    length: float = 0.0
    across: Any = None
    shifts: Any = None  # by which both meshes move, where they do

    def guess(self, s: float) -> Orbit:
        """On the cubic through both ends with their tangents."""
        (a, b), ((dx, dy), (ex, ey)) = self.ends, self.tangents
        t, h = s / self.length, self.length
        c = (2 * t**3 - 3 * t**2 + 1, t**3 - 2 * t**2 + t, 3 * t**2 - 2 * t**3, t**3 - t**2)
        x = c[0] * a.x + h * c[1] * dx + c[2] * b.x + h * c[3] * ex
        y = c[0] * a.y + h * c[1] * dy + c[2] * b.y + h * c[3] * ey
        mesh = a.mesh
        if self.shifts is not None:
            one, other = self.shifts
            mesh = c[0] * a.mesh + h * c[1] * one + c[2] * b.mesh + h * c[3] * other
            if np.any(np.diff(mesh) <= 0.0):
                mesh = (1.0 - t) * a.mesh + t * b.mesh
        return Orbit(mesh, x, y)

    def point(self, s: float) -> Point | None:
        """The point at a distance; None if Newton's method finds none."""
        guess = self.guess(s)
        if self.shifts is None:
            rows, rows_y, target = self.rows
            # The phase of the guess, which the second end may have measured by another orbit.
            target = target.copy()
            target[-1] += s
            target[0] = np.sum(rows[0] * guess.x)
        else:  # the plane moves with the guess
            rows, rows_y, target = self.cycles.rows(guess, self.across, self.tangents[0][1])
        found = self.cycles.correct(guess, rows, rows_y, target, iterations=12)
        if not found.converged:
            return None
        made = point_of(self.cycles, found, self.a.arclength + s, s)
        return made


def root(stretch: Stretch, test: Value) -> Point | None:
    """The point of a stretch where a test function vanishes.

    By inverse quadratic interpolation where that stays between, and by halves [Chandrupatla1997].
    """
    forced, length = stretch.cycles.forced, stretch.length
    a, b = 0.0, length  # the zero lies between; a is the newest, c the one before
    f_a, f_b = test(stretch.a, forced), test(stretch.b, forced)
    best: Point | None = None
    least, t = np.inf, f_a / (f_a - f_b) if f_a != f_b else 0.5
    rounding, stalled, unknown = ROUNDING * min(abs(f_a), abs(f_b)), 0, 0
    for _ in range(60):
        t = t if 0.0 < t < 1.0 else 0.5  # of infinite values too
        s = a + t * (b - a)
        point = stretch.point(s)
        if point is None:
            return None
        value = test(point, forced)
        if np.isnan(value):  # errors hide the multipliers: nearer to where they are known
            unknown, t = unknown + 1, 0.9 * t
            if unknown == UNKNOWN:
                break
            continue
        stalled = stalled + 1 if 0.5 * least <= abs(value) and least <= rounding else 0
        if abs(value) <= least:  # of what jumps, the last one
            best, least = point, abs(value)
        if stalled == STALLS or value == 0.0:
            break
        if (value >= 0.0) == (f_a >= 0.0):
            c, f_c = a, f_a
        else:
            c, f_c, b, f_b = b, f_b, a, f_a
        a, f_a = s, value
        if abs(b - a) <= STILL * length:
            break
        xi, phi = (a - b) / (c - b), (f_a - f_b) / (f_c - f_b) if f_c != f_b else np.nan
        t = 0.5
        if phi * phi < xi and (1.0 - phi) ** 2 < 1.0 - xi:
            t = f_a / (f_b - f_a) * f_c / (f_b - f_c)
            t += (c - a) / (b - a) * f_a / (f_c - f_a) * f_b / (f_c - f_b)
        least_step = 0.5 * STILL * length / abs(b - a)
        t = min(max(t, least_step), 1.0 - least_step)
    return best


def branching(stretch: Stretch, test: Value) -> Point | None:
    """A branch point, where the equations are singular: from the points to both of its sides.

    The family is smooth through it, so its points at a distance say where it is to rounding.
    """
    cycles = stretch.cycles

    def singular(points: Sequence[Point]) -> Array:
        if not cycles.closes:
            return np.array([singularity(cycles, p) for p in points])
        found = np.array([determinant_whole(p, cycles.forced) for p in points])
        if np.abs(found).max() < LARGEST:
            return found
        return np.array([determinant(p, cycles.forced) for p in points])

    low, high = 0.0, stretch.length
    seen = None
    for _ in range(WINDOWS if cycles.closes else ZOOMS):
        nodes = 0.5 * (1.0 - np.cos(np.pi * (np.arange(NODES) + 0.5) / NODES))
        points = [stretch.point(float(low + s * (high - low))) for s in nodes]
        there = [(s, p) for s, p in zip(nodes, points, strict=True) if p is not None]
        if len(there) < NODES - 2:
            break
        at = np.array([s for s, _ in there])
        values = [
            singular([p for _, p in there]),
            np.array([fold_test(p, cycles.forced) for _, p in there]),
        ]
        s = _crossing(at, *values)
        if s is None:  # rounding may hide in a narrow window what a wider one shows
            break
        width, middle = high - low, low + s * (high - low)
        seen = there, at, s, middle
        if cycles.closes:  # determinants are smooth, borders not
            inner = _crossing(at[1:-1], *(one[1:-1] for one in values))
            if inner is not None and abs(inner - s) * width <= SETTLED * stretch.length:
                break
        low, high = _window(low, width, s, at, values[0])
    if seen is None:
        return None
    made, at, s, middle = seen
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
    if not cycles.closes:
        null, _ = other_tangent(cycles, orbit, checked.W, (checked.dx, checked.dy))
        finer = resolved(cycles, orbit.mesh, null)
        if finer is not None and len(finer) > FINER * len(orbit.mesh):
            return branching(Stretch(cycles, stretch.a, stretch.b, finer), test)
    return point_of(cycles, checked, stretch.a.arclength + middle, middle)


def _window(low: float, width: float, s: float, at: Array, determinants: Array) -> list[float]:
    """A smaller stretch: about a zero, or what has it between two points where it is far off."""
    window = [max(0.0, s - ZOOM), min(1.0, s + ZOOM)]
    changes = np.flatnonzero((determinants[:-1] >= 0.0) != (determinants[1:] >= 0.0))
    if len(changes) == 1:
        before, after = at[changes[0]], at[changes[0] + 1]
        window = [min(max(window[0], before), after), max(min(window[1], after), before)]
        if not window[0] < s < window[1]:
            window = [before, after]
    return [float(low + width * end) for end in window]


def _crossing(at: Array, determinants: Array, rates: Array) -> float | None:
    """Where two families cross, between 0 and 1.

    The determinant changes its sign there, but at a pitchfork along the family whose parameter
    turns back: there it only touches zero.
    """
    if not (np.isfinite(determinants).all() and np.isfinite(rates).all()):
        return None
    found, turns = (_zeros(at, values) for values in (determinants, rates))
    if len(turns):
        found = found[[np.min(np.abs(turns - one)) > SPLIT for one in found]]
        found = found if len(found) else turns
    return float(found[np.argmin(np.abs(found - 0.5))]) if len(found) else None


def _zeros(at: Array, values: Array) -> Array:
    """Zeros between 0 and 1 of the polynomial through values."""
    fit = np.polynomial.Polynomial.fit(at, values, len(at) - 1, domain=[0.0, 1.0])
    roots = fit.roots()
    inside = (np.abs(roots.imag) < 1e-6) & (roots.real > -1e-9) & (roots.real < 1.0 + 1e-9)
    return np.asarray(roots[inside].real)
