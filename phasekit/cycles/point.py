"""A point of a family of periodic orbits, with its checks."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from functools import cached_property
from typing import NamedTuple

import numpy as np

from phasekit.arrays import Array, Complex
from phasekit.cycles import along, collocation
from phasekit.cycles.cycles import MOST, Cycles, Orbit, Solution
from phasekit.cycles.multipliers import LARGEST, WIDE

TRUSTED = 1e-5  # error of the product of multipliers, beside 1 or its size, above which no tests
NEAR = 5e-7  # the same of the trivial multiplier
UNRESOLVED = 3.0  # times the mesh error or its tolerance by which exponents are not resolved
#: Rate times length of an interval that leaves errors like this one, at first; and by what more is
#: taken at most where more is allowed.
SMOOTH, CLAIMED, LONGER = 2.5, 3e-8, 2.0
SHORTER = 0.8  # of the length that the error asks for
FINER = 3  # meshes that are tried for it
ALIKE = 1e-3  # the same by itself, above which nothing is known of multipliers
STILL = 1e-12  # part of its span by which a parameter has moved between two points, or has not
ON_CIRCLE = 1e-6  # distance from the unit circle of multipliers at special points
NEUTRAL = 1e-3  # distance from 1 of multipliers that are 1 since energy is conserved


@dataclass(eq=False)
class Point:
    """A point of a family: the orbit, the unit tangent, multipliers and checks.

    ``liouville_error`` is how far the logarithm of the product of multipliers is from the integral
    of the divergence, beside 1 and its size; NaN of very many states, of which it is not known.
    """

    orbit: Orbit
    dx: Array
    dy: Array
    multipliers: Complex
    arclength: float
    step: float
    newton_steps: int
    residual: float
    sign: float
    trivial_error: float
    liouville_error: float
    mesh_error: float

    def flipped(self) -> Point:
        """The same point of a family that is followed the other way round."""
        return replace(self, dx=-self.dx, dy=-self.dy, sign=-self.sign, arclength=-self.arclength)

    @cached_property
    def trusted(self) -> bool:
        """Whether the multipliers pass their checks."""
        # A mesh that is coarser than its tolerance, as one that was asked for, may be off by more.
        near = max(NEAR, min(UNRESOLVED * self.mesh_error, ALIKE))
        # Of very many states the product of all of them is not formed.
        open_ = math.isnan(self.liouville_error) and len(self.multipliers) >= WIDE
        if not (self.trivial_error <= near and (open_ or self.liouville_error <= ALIKE)):
            return False
        sizes = [abs(one) for one in self.multipliers.tolist()]
        if not all(map(math.isfinite, sizes)):
            return False
        log = sum(math.log(one) if one > 0.0 else -LARGEST for one in sizes)
        # What the product itself is wrong by, beside 1 or its size.
        part = (1.0 + abs(log)) * math.exp(max(min(log, 0.0), -LARGEST)) if log < LARGEST else 1.0
        return open_ or self.liouville_error * part <= TRUSTED


def vertical(cycles: Cycles, point: Point) -> bool:
    """Whether the parameter keeps its value since energy is conserved: one more multiplier is 1.

    Where cycles explode along canards the parameter hardly moves either.
    """
    return cycles.vertical(point.dy) and neutral(cycles, point)


def still(cycles: Cycles, a: Point, b: Point) -> bool:
    """Whether a family is vertical between two points, even where one is too small to tell."""
    moved = bool(np.all(np.abs(b.orbit.y[1:] - a.orbit.y[1:]) > STILL * cycles.width))
    return not moved and neutral(cycles, a) and neutral(cycles, b)


def neutral(cycles: Cycles, point: Point) -> bool:
    """Whether one multiplier is 1 besides that which always is."""
    near = np.sum(np.abs(point.multipliers - 1.0) < NEUTRAL)
    return bool(near > (0 if cycles.forced else 1))


def critical_count(point: Point, forced: bool, label: str = "", neutral: bool = False) -> int:
    """Number of multipliers outside the unit circle; -1 where they are not known."""
    if not point.trusted:
        return -1
    values = point.multipliers.tolist()
    if not forced:
        # Where energy is conserved, two are always 1.
        values = sorted(values, key=lambda one: abs(one - 1.0))[2 if neutral else 1 :]
    limit = 1.0 + (ON_CIRCLE if label not in ("", "UZ") or neutral else 0.0)
    return sum(abs(one) > limit for one in values)


@dataclass(eq=False)
class State:
    """All that it takes to go on as if the trace had never stopped."""

    orbit: Orbit
    dx: Array
    dy: Array
    step: float
    arclength: float
    since: int  # points since the mesh was last fitted
    since_start: int = 0
    #: The point before on the same mesh, and its tangent.
    behind: tuple[Orbit, Array, Array] | None = None

    def ahead(self, cycles: Cycles, step: float) -> Orbit:
        """Where the family is expected a step along the tangent."""
        orbit, dx, dy = self.orbit, self.dx, self.dy
        if self.behind is None:
            return Orbit(orbit.mesh, orbit.x + step * dx, orbit.y + step * dy)
        last, *tangent = self.behind
        c, x, y = collocation.scheme(cycles.m), np.empty_like(orbit.x), np.empty_like(orbit.y)
        along.ahead(
            orbit.mesh, (c.weights, c.value), cycles.scale, cycles.width, cycles.moving, step,
            (orbit.x, orbit.y, dx, dy), (last.x, last.y, *tangent), x, y,
        )  # fmt: skip
        return Orbit(orbit.mesh, x, y)


def point_of(cycles: Cycles, s: Solution, arclength: float, step: float) -> Point:
    """A point of what Newton's method found."""
    error = cycles.mesh_error(s.orbit)
    known = _known_of(cycles, s)
    # An orbit may be smooth where its variational equations are stiff.
    least = UNRESOLVED * max(error, cycles.options.mesh_tolerance)
    if known.off > least and not cycles.stiff(s.orbit, known.divergence):
        known = _resolved(cycles, s, known, least)
    return Point(
        s.orbit, s.dx, s.dy, known.multipliers, arclength, step, s.steps, s.residual, s.sign,
        known.trivial, known.off, error,
    )  # fmt: skip


class _Known(NamedTuple):
    """What is known of the multipliers of an orbit on some mesh."""

    multipliers: Complex
    off: float  # by what the logarithm of their product is off, beside 1 and the divergence
    trivial: float
    divergence: float


def _known_of(cycles: Cycles, s: Solution) -> _Known:
    divergence = cycles.divergence(s.divergence)
    values, off, trivial = cycles.multipliers(s.W, s.orbit, divergence)
    # In logarithms, as the product may be beyond all numbers.
    return _Known(values, off / (1.0 + abs(divergence)), trivial, divergence)


def _resolved(cycles: Cycles, s: Solution, known: _Known, least: float) -> _Known:
    """The same on a mesh that resolves decays, too, whose product is off by the least at most.

    The error of a decay goes with the power 2 m of the length of intervals. How much shorter they
    are to be is so told by the error and the longest one, and what is allowed tells up to where
    that holds.
    """
    reaches = cycles.reaches(s.orbit)
    if reaches is None:
        return known
    m = cycles.m
    reach = SMOOTH * min(max(least / CLAIMED, 1.0) ** (0.5 / m), LONGER)
    reach = min(reach, float(np.max(reaches)) * _shorter(known.off / least, m))
    for _ in range(FINER):
        mesh = resolving(s.orbit.mesh, reaches, reach)
        if mesh is None:
            break
        orbit, (dx,) = cycles.on(mesh, s.orbit, s.dx)
        fine = cycles.on_finer(orbit, dx, s.dy, least)
        if not fine.converged:
            fine = cycles.looked_at(orbit, dx, s.dy)
        known = _known_of(cycles, fine)
        if not known.off > least:
            break
        reach *= _shorter(known.off / least, m)
    return known


def resolving(mesh: Array, reaches: Array, reach: float) -> Array | None:
    """A mesh on whose intervals rate times length is at most a ``reach``; None if it is too fine.

    Only intervals that are longer are divided: what the others leave is no error of decays.
    """
    counts = np.maximum(np.ceil(reaches / reach), 1.0)
    if not np.sum(counts) <= MOST:
        return None
    new = np.empty(int(np.sum(counts)) + 1)
    along.divided(mesh, counts.astype(np.int64), new)
    return new


def _shorter(part: float, m: int) -> float:
    """By how much shorter intervals are to be where errors are a ``part`` of what is allowed."""
    shorter: float = SHORTER * min(part, 1e4) ** (-0.5 / m)
    return shorter
