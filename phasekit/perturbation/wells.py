"""Escape by thermal noise out of the wells of any potential, also one that falls a turn.

A well ends at a saddle on either side. Over the lower one a particle comes into the wells beyond,
out of which it may come back; from then on both are one well, with ends farther off. Where nothing
beyond holds it, either end leads out, and the one that is reached first counts.
"""

from __future__ import annotations

import functools
from collections.abc import Callable
from typing import Any

import numpy as np

from phasekit.arrays import Array, Flags, Ints
from phasekit.errors import EquilibriumKind
from phasekit.perturbation.depopulation import two_rims
from phasekit.perturbation.diffusion import (
    action_in_well,
    configuration,
    passage,
    spatial_exponent,
    transition,
)
from phasekit.perturbation.rates import (
    Escape,
    Exit,
    Heat,
    combined,
    empty,
    masked,
    returning,
    scatter,
)
from phasekit.phase.numerical.families import rise_at_end
from phasekit.phase.numerical.turns import Turns

#: Energies over kT above a barrier, or below it, that are as good as infinite.
FAR = 60.0
#: Distances of two ends over kT that are.
APART = 1e6
_DOUBLINGS = 200


class Wells:
    """Potentials on the line, a row each, and what is known at their saddles."""

    def __init__(self, turns: Turns, heat: Heat) -> None:
        self.turns, self.heat = turns, heat
        self.phi, self.row = turns.points.phi, np.arange(len(turns.torque))
        self.centers = turns.points.kind == EquilibriumKind.CENTER
        rows, columns = turns.saddles
        self.loops = turns.separatrices()
        self.size = self.loops.saddle_phi.shape[1]
        # Every turn has the saddles of that of the states.
        slots = np.full(self.phi.shape, -1)
        if turns.named:
            place_of = turns.label[rows, columns] // 2
        else:
            place_of = np.arange(rows.size) - np.searchsorted(rows, rows)
        slots[rows, turns.label[rows, columns]] = place_of
        self.slot = np.take_along_axis(slots, turns.label, axis=1)
        self.saddles = (self.slot >= 0) & np.isfinite(self.phi)

    def take(self, rows: Ints) -> Wells:
        """Those of some rows."""
        few = object.__new__(Wells)
        few.turns, few.heat, few.size = self.turns.take(rows), self.heat.take(rows), self.size
        few.row = np.arange(rows.size)
        few.loops = type(self.loops)._make(x[rows] for x in self.loops)
        for name in ("phi", "centers", "slot", "saddles"):
            setattr(few, name, getattr(self, name)[rows])
        return few

    def rises(self, column: Ints) -> Array:
        """Energies of all equilibria above one."""
        return -self.turns.above(column)

    def nearest(self, start: Array, side: Any, usable: Flags) -> Ints:
        """Columns of the nearest usable equilibria on one side of some places; -1 for none."""
        way = np.broadcast_to(side, start.shape)[:, None] * (self.phi - start[:, None])
        way = np.where(usable & (way > 0.0), way, np.inf)
        column = np.argmin(way, axis=1)
        return np.where(np.isfinite(way[self.row, column]), column, -1)

    def coordinates(self, column: Ints) -> Array:
        """Coordinates of equilibria, NaN where there are none."""
        return np.where(column >= 0, self.phi[self.row, column], np.nan)

    def beyond(self, start: Array, way: Any, rise: Array) -> Array:
        """How far from some places V has risen by so much, or fallen where that is negative."""
        low, high = self.turns.systems.formula.ends
        edge = np.where(way < 0.0, start - low, high - start)
        far = np.minimum(1.0 + np.abs(start), edge)
        with np.errstate(all="ignore"):
            base = self.turns.systems.potential(start)
            for _ in range(_DOUBLINGS):
                change = self.turns.systems.potential(start + way * far) - base
                short = np.sign(rise) * change < np.abs(rise)
                short &= far < edge
                if not short.any():
                    break
                far = np.where(short, np.minimum(2.0 * far, edge), far)
        return np.asarray(far)

    def loss(self, column: Ints, side: Any) -> Array:
        """Loss over kT of a round of the loop on one side of a saddle."""
        area = self.loops.lobe_area[self.row, self.slot[self.row, column], (side > 0.0).astype(int)]
        return np.asarray(self.heat.damping * area / self.heat.kT)

    def spatial(self, column: Ints) -> Array:
        """Exponent of the saddle with which strong damping is exact at a finite barrier."""
        start, kT = self.phi[self.row, column], self.heat.kT
        lengths = []
        for side in (-1.0, 1.0):
            there = np.abs(self.coordinates(self.nearest(start, side, self.centers)) - start)
            far = self.beyond(start, np.full(start.shape, side), -FAR * kT)
            lengths.append(np.where(np.isnan(there), far, there))
        depth = self._below(start)
        left, right = lengths
        return spatial_exponent(lambda way: depth(start[:, None] + way), left, right, kT)

    def _below(self, at: Array) -> Callable[[Array], Array]:
        """How deep the potential lies below its value at some places."""
        top = self.turns.systems.potential(at)

        def depth(phi: Array) -> Array:
            found = self.turns.systems.potential(phi)
            return np.asarray(top.reshape(top.shape + (1,) * (phi.ndim - 1)) - found)

        return depth


class Basin:
    """A stretch of wells between two ends in each row: columns of saddles, or -1."""

    def __init__(self, wells: Wells, left: Ints, right: Ints) -> None:
        self.wells, self.ends = wells, (left, right)
        low, high = (
            np.where(end >= 0, wells.coordinates(end), far)
            for end, far in ((left, -np.inf), (right, np.inf))
        )
        self.inside = wells.centers & (wells.phi > low[:, None]) & (wells.phi < high[:, None])
        energy = np.where(self.inside, wells.turns.points.energy, np.inf)
        self.deepest = np.argmin(energy, axis=1)
        self.number = self.inside.sum(axis=1)
        rise = wells.rises(self.deepest)
        self.heights = [
            np.where(
                end >= 0, rise[wells.row, end], rise_at_end(wells.turns, self.deepest, int(side))
            )
            for end, side in zip(self.ends, (-1.0, 1.0), strict=True)
        ]

    def take(self, rows: Ints) -> Basin:
        """Those of some rows."""
        return Basin(self.wells.take(rows), *(end[rows] for end in self.ends))

    @property
    def side(self) -> Array:
        """Side of the lower end."""
        return np.where(self.heights[1] <= self.heights[0], 1.0, -1.0)

    def bounds(self, center: Ints, rise: Array) -> tuple[Array, Array]:
        """Where the single wells of some centers end; on a line where V has risen by so much."""
        wells, at = self.wells, self.wells.phi[self.wells.row, center]
        found = []
        for side in (-1.0, 1.0):
            end = wells.coordinates(wells.nearest(at, side, wells.saddles))
            far = wells.beyond(at, np.full(at.shape, side), rise)
            found.append(np.where(np.isnan(end), at + side * far, end))
        return found[0], found[1]

    def transition(self, height: Array) -> Array:
        """Rate of transition-state theory times exp(height/kT), of all wells together."""
        wells, kT = self.wells, self.wells.heat.kT
        bottom = wells.phi[wells.row, self.deepest]
        total = np.zeros(len(kT))
        for number in range(int(self.number.max(initial=0))):
            nth = self.inside & (np.cumsum(self.inside, axis=1) == number + 1)
            some = np.flatnonzero(nth.any(axis=1))
            few = self if some.size == len(kT) else self.take(some)
            center = nth[some].argmax(axis=1)
            rise = height[some] + FAR * kT[some]
            ends = few.bounds(center, rise)
            depth = few.wells._below(bottom[some])
            at = few.wells.phi[few.wells.row, center]
            nothing = np.zeros(some.size)
            total[some] += configuration(depth, nothing, at, *ends, kT[some])
        return transition(kT, total)

    def correction(self, height: Array, high: Array) -> Array:
        """Rate at which the diffusing energy comes to a saddle, over that of a high barrier.

        NaN of several wells together.
        """
        wells = self.wells
        at = wells.phi[wells.row, self.deepest]
        left, right = self.bounds(self.deepest, height)

        def action(part: Any, x: Array) -> Array:
            few = wells.turns.systems.take(part)
            top = few.potential(at[part]) + height[part]

            def depth(phi: Array) -> Array:
                shape = top.shape + (1,) * (phi.ndim - 1)
                return np.asarray(top.reshape(shape) - few.potential(phi))

            ends = (left[part], right[part])
            return action_in_well(depth, few.slope, height[part], at[part], ends, x)

        single = np.where(self.number == 1, height, np.nan)
        time = passage(action, single, wells.heat.damping, wells.heat.kT)
        with np.errstate(all="ignore"):
            return np.asarray(1.0 / (time * high))


def escape_from_wells(turns: Turns, heat: Heat, number: int | None) -> Escape:
    """Escape from the well of a center: its number, or the lowest."""
    wells = Wells(turns, heat)
    out = empty(len(turns.torque), wells.size)
    if not turns.label.shape[1]:
        return masked(out, np.ones(len(turns.torque), bool), turns.points.n_equilibria < 0)
    center, there = turns.center(number)
    there = there & np.isfinite(heat.kT)
    rows = np.flatnonzero(there)
    few, at = wells.take(rows), wells.phi[rows, center[rows]]
    ends = (few.nearest(at, side, few.saddles) for side in (-1.0, 1.0))
    basin = Basin(few, *ends)
    while rows.size:
        kept = np.flatnonzero(np.isfinite(np.minimum(*basin.heights)))
        low = np.where(basin.side > 0.0, basin.ends[1], basin.ends[0])
        kept = kept[low[kept] >= 0]
        basin, rows, low = basin.take(kept), rows[kept], low[kept]
        if not rows.size:
            break
        far, holds = _beyond(basin, low)
        last, rest = np.flatnonzero(~holds), np.flatnonzero(holds)
        if last.size:
            _outwards(out, basin.take(last), rows[last])
        if not rest.size:
            break
        basin, rows, low, far = basin.take(rest), rows[rest], low[rest], far[rest]
        right = basin.side > 0.0
        other = Basin(basin.wells, np.where(right, low, far), np.where(right, far, low))
        _between(out, basin, other, rows, low)
        basin = Basin(
            basin.wells,
            np.where(right, basin.ends[0], far),
            np.where(right, far, basin.ends[1]),
        )
    return masked(out, ~turns.center(number)[1], turns.points.n_equilibria < 0)


def _beyond(basin: Basin, low: Ints) -> tuple[Ints, Flags]:
    """The end of what lies beyond the lower ends, and whether it holds what comes in."""
    wells = basin.wells
    above = wells.rises(low)
    start, side = wells.phi[wells.row, low], basin.side
    level = wells.nearest(start, side, wells.saddles & (above >= 0.0))
    far = wells.nearest(start, side, wells.saddles & (above > 0.0))
    center = wells.nearest(start, side, wells.centers)
    ends = np.where(
        side > 0.0, *(rise_at_end(wells.turns, np.maximum(center, 0), way) for way in (1, -1))
    )
    open_ = (level < 0) & (center >= 0) & np.isinf(ends) & (ends > 0.0)
    return far, np.asarray(((far >= 0) & (far == level)) | open_)


def _between(out: Escape, basin: Basin, other: Basin, rows: Ints, low: Ints) -> None:
    """Over a saddle into other wells, out of which it may come back."""
    wells, side = basin.wells, basin.side
    found = []
    for one, way in ((basin, -side), (other, side)):
        height = wells.rises(one.deepest)[wells.row, low]
        rate, loss = one.transition(height), wells.loss(low, way)
        found.append((height, rate, loss, one.correction(height, rate * loss)))
    (height, rate, loss, ratio), (_, _, beyond, back) = found
    way_out = Exit(
        lambda scale, power: returning(scale * loss * ratio**power, scale * beyond * back**power),
        np.isfinite(ratio * back), height, loss, _exponents(wells, low), wells.spatial(low),
    )  # fmt: skip
    where = (side < 0.0).astype(int)
    scatter(out, combined(wells.heat, rate, way_out), rows, wells.slot[wells.row, low], where)


def _outwards(out: Escape, basin: Basin, rows: Ints) -> None:
    """Over both ends, of which the first to be reached counts."""
    wells, right = basin.wells, basin.side > 0.0
    height = np.minimum(*basin.heights)
    rate = basin.transition(height)
    low = np.where(right, basin.ends[1], basin.ends[0])
    loss = wells.loss(low, np.where(right, -1.0, 1.0))
    ratio = basin.correction(height, rate * loss)
    known = np.isfinite(ratio)
    apart = np.minimum(np.abs(basin.heights[1] - basin.heights[0]) / wells.heat.kT, APART)

    @functools.cache
    def rims(scale: float, power: float) -> tuple[Array, Array]:
        return two_rims(0.5 * scale * loss * np.where(known, ratio, 1.0) ** power, apart)

    for end, column in enumerate(basin.ends):
        there = np.flatnonzero((column >= 0) & np.isfinite(basin.heights[end]))
        lower = right if end else ~right
        few, own = wells.take(there), column[there]

        def factor(scale: float, power: float, some: Ints = there, low: Any = lower) -> Array:
            return np.where(low, *rims(scale, power))[some]

        way_out = Exit(
            factor, known[there], basin.heights[end][there], loss[there],
            _exponents(few, own), few.spatial(own),
        )  # fmt: skip
        found = combined(few.heat, rate[there], way_out)
        scatter(out, found, rows[there], few.slot[few.row, own], 1 - end)


def _exponents(wells: Wells, column: Ints) -> Array:
    return np.asarray(wells.loops.saddle_exponent[wells.row, wells.slot[wells.row, column]])
