"""Differences of the potential that keep their digits, next to equilibria and turning points.

V(c + u) - V(c) is of second order in u where c is an equilibrium: subtraction would lose what
small oscillations and separatrices are made of. There it is the integral of V'' by Gauss' rule.
"""

from __future__ import annotations

import functools
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from phasekit.arrays import Array
from phasekit.arrays import Ints as Index
from phasekit.numerics.contract import contract
from phasekit.phase.numerical.equilibria import Equilibria, equilibria
from phasekit.phase.numerical.formula import Shape
from phasekit.phase.numerical.formula_bounds import noise, slope_noise, smooth
from phasekit.phase.numerical.systems import Systems


def _gauss(count: int) -> tuple[Array, Array]:
    nodes, weights = np.polynomial.legendre.leggauss(count)
    return 0.5 * (1.0 + nodes), 0.5 * weights


NODES, WEIGHTS = _gauss(8)
#: How often a stretch is shortened, by 2 and later by 256, until a rule holds on it.
_HALVINGS = 160
_FINE_NODES, _FINE_WEIGHTS = _gauss(13)


@dataclass(frozen=True, eq=False)
class Ground:
    """Systems with their equilibria, and how far from each of these Gauss' rule holds.

    Rounding may have moved the energies of equilibria by `blur`, and V' there is at most `slope`.
    """

    systems: Systems
    points: Equilibria
    near: Array
    blur: Array
    slope: Array

    def take(self, rows: Index) -> Ground:
        """The systems of some rows, which may repeat."""
        points = Equilibria._make(field[rows] for field in self.points)
        own = (self.near, self.blur, self.slope)
        return Ground(self.systems.take(rows), points, *(field[rows] for field in own))

    @property
    def circle(self) -> float | None:
        """Length of the circle on which the coordinate lies."""
        return self.systems.formula.period

    def above(self, column: Index) -> Array:
        """Energy of one equilibrium of each system above all; 0 where rounding hides it."""
        energy, rows = self.points.energy, np.arange(column.size)
        if not energy.shape[1]:
            return energy
        there = self.points.kind > 0
        size = np.nanmax(np.abs(energy), axis=1, initial=0.0, where=there)[:, None]
        rise = energy[rows, column][:, None] - energy
        return np.where(np.abs(rise) <= 8.0 * np.finfo(float).eps * size, 0.0, rise)

    def columns_of(self, numbers: Sequence[int]) -> list[Index]:
        """Columns of equilibria by their numbers, -1 where there are fewer: all ways to see them.

        Each has a row for each system, and a column for each number.
        """
        rows, width = self.points.phi.shape
        found = np.array([k if k < width else -1 for k in numbers], np.intp)
        return [np.broadcast_to(found, (rows, found.size))]

    def place_error(self, column: Index) -> Array:
        """How far rounding of V' may have moved one equilibrium of each system."""
        rows = np.arange(column.size)
        bend = np.abs(self.points.curvature[rows, column])
        with np.errstate(all="ignore"):
            return np.where(bend > 0.0, self.slope[rows, column] / bend, 0.0)


@dataclass(frozen=True, eq=False)
class Anchor:
    """An equilibrium in each of some systems, from which differences are taken.

    Where there is none, any point may stand in with ``near = 0``.
    """

    systems: Systems
    at: Array
    near: Array

    def take(self, rows: Index) -> Anchor:
        """The anchors of some rows."""
        few = Anchor(self.systems.take(rows), self.at[rows], self.near[rows])
        vars(few)["height"] = self.height[rows]
        return few

    @functools.cached_property
    def height(self) -> Array:
        """V(at): differences from the same anchors are taken again and again."""
        return self.systems.potential(self.at)

    def rise(self, u: Array) -> Array:
        """V(at + u) - V(at), for u of shape (systems,)."""
        result = self.systems.potential(self.at + u) - self.height
        rows = np.flatnonzero(np.abs(u) < self.near)
        if rows.size:
            few, step = self.take(rows), u[rows]
            bend = few.systems.bend(few.at[:, None] + step[:, None] * NODES)
            result[rows] = step * step * contract(bend, WEIGHTS * (1.0 - NODES))
        return result

    def slope(self, u: Array) -> Array:
        """V'(at + u), for u of shape (systems,)."""
        result = self.systems.slope(self.at + u)
        rows = np.flatnonzero(np.abs(u) < self.near)
        if rows.size:
            few, step = self.take(rows), u[rows]
            bend = few.systems.bend(few.at[:, None] + step[:, None] * NODES)
            result[rows] = step * contract(bend, WEIGHTS)
        return result

    def climb(self, u: Array, d: Array) -> Array:
        """V(at + u + d) - V(at + u), with all digits also where d is small."""
        result = self.rise(u + d) - self.rise(u)
        rows = np.flatnonzero(np.abs(d) < self.near)
        if rows.size:
            many = self.take(np.repeat(rows, NODES.size))
            inner = (u[rows, None] + d[rows, None] * NODES).reshape(-1)
            slopes = many.slope(inner).reshape(-1, NODES.size)
            result[rows] = d[rows] * contract(slopes, WEIGHTS)
        return result


def survey(systems: Systems, points: Equilibria | None = None) -> Ground:
    """Find the equilibria of systems, if not known, and how far from each Gauss' rule holds."""
    points = equilibria(systems) if points is None else points
    x = points.phi
    low, high = systems.formula.ends
    period = systems.formula.period
    with np.errstate(all="ignore"):
        # Past the neighbors, if the rule holds so far: shallow wells and low saddles need it.
        near = np.where(np.isfinite(x), np.inf if _exact(systems) else 1.0 + np.abs(x), np.nan)
        if np.isfinite(high):
            near = np.where(np.isfinite(x), 0.25 * (high - low), np.nan)
        if x.shape[1] > 1:
            gap = np.diff(x, axis=1)
            around = np.full((len(x), 1), -np.inf)
            if period is not None:
                last = np.nanmax(np.where(np.isnan(x), -np.inf, x), axis=1, keepdims=True)
                around = x[:, :1] + period - last
            gap = np.where(np.isnan(gap), -np.inf, gap)
            left = np.concatenate([around, gap], axis=1)
            right = np.concatenate([gap, np.full((len(x), 1), -np.inf)], axis=1)
            reach = np.maximum(left, right)
            near = np.where(reach > 0.0, np.minimum(near, 2.0 * reach), near)
        near = _proved(systems, x, near)
        blur, slope = noise(systems, x, points.energy), systems.slope(x)
        slope = np.abs(slope) + slope_noise(systems, x, slope)
        # An equilibrium that is known so far only: V changes by the square.
        off = np.where(
            points.curvature != 0.0, 0.5 * slope * (slope / np.abs(points.curvature)), 0.0
        )
    return Ground(systems, points, near, blur + off, slope)


def _proved(systems: Systems, x: Array, near: Array) -> Array:
    """Shorten each stretch until two rules of Gauss agree on it."""
    if _exact(systems):
        return near
    formula = systems.formula
    for number in range(_HALVINGS):
        worst = np.zeros(x.shape)
        for sign in (1.0, -1.0):
            u = sign * near[..., None]
            coarse = contract(systems.bend(x[..., None] + u * NODES), WEIGHTS * (1.0 - NODES))
            bend = systems.bend(x[..., None] + u * _FINE_NODES)
            fine = contract(bend, _FINE_WEIGHTS * (1.0 - _FINE_NODES))
            size = np.max(np.abs(bend), axis=-1)
            worst = np.maximum(worst, np.abs(coarse - fine) / size)
        rough = worst > 2e-15
        if formula.shape is Shape.GENERAL:
            cell, slot = np.nonzero(np.isfinite(near))
            at, reach = x[cell, slot], near[cell, slot]
            few = systems.take(cell)
            shown = [few.slope(at + reach), few.slope(at - reach), few.bend(at) * reach]
            size = np.max(np.abs(shown), axis=0)
            rough[cell, slot] |= ~smooth(few, np.arange(cell.size), at - reach, at + reach, size)
        if not rough.any():
            break
        # Most need a few halvings; an equilibrium on a line may be the size of any double.
        near = np.where(rough, (0.5 if number < 40 else 2.0**-8) * near, near)
    # What shorter stretches do not mend is rounding of V'' itself, or a zero of high order.
    return np.where(rough & (worst > 1e-12), 0.0, near)


def _exact(systems: Systems) -> bool:
    """Whether the rule is exact."""
    degree = 2 * NODES.size
    polynomial = systems.formula.shape is Shape.POLYNOMIAL
    return polynomial and systems.coefficients().shape[1] <= degree
