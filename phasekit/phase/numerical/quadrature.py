"""Arcs of orbits cut at the maxima of V, and the speed at places on them."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from phasekit.arrays import Array, Ints
from phasekit.errors import EquilibriumKind
from phasekit.phase.numerical.differences import Anchor, Ground
from phasekit.phase.numerical.turning_points import End, distances

#: Entries of tables of pieces and equilibria at a time, for memory.
_ENTRIES = 1 << 20


@dataclass(frozen=True)
class Pieces:
    """Stretches of orbits, each with its length, its two ends, and a place between to cut it.

    Of an end, `left` and `right` have on their last axis its anchor's place and reach, its own
    place from there and the energy above it. `cut` counts from the left end. Where both ends are
    known from the center between them, `reach` says more exactly how far from it they lie.
    """

    orbit: Ints
    length: Array
    left: Array
    right: Array
    cut: Array
    reach: Array

    @classmethod
    def from_ends(cls, orbit: Ints, length: Array, left: Array, right: Array, cut: Array) -> Pieces:
        """Lay out stretches of which the ends are known."""
        shared = (left[:, 0] == right[:, 0]) & (left[:, 2] < 0.0) & (right[:, 2] > 0.0)
        reach = np.stack([-left[:, 2], right[:, 2]], axis=1)
        reach = np.where(shared[:, None], reach, np.nan)
        return cls(orbit, length, left, right, cut, reach)


def tops(ground: Ground) -> npt.NDArray[np.bool_]:
    """Equilibria at which a passing orbit is slow."""
    kind = ground.points.kind
    return np.asarray((kind == EquilibriumKind.SADDLE) | (kind == EquilibriumKind.DEGENERATE))


def between(
    ground: Ground, start: Array, width: Array, excess: Array, left: End, right: End
) -> Pieces:
    """Pieces of arcs that begin at `start`, where `left` is their end, and go up by `width`.

    `excess` is the energy of the orbits above each equilibrium.
    """
    points, rows = ground.points, np.arange(start.size)
    way = distances(ground, start, 1.0)
    within = (way > 0.0) & (way < width[:, None])
    cuts = tops(ground) & within
    for end in (left, right):  # the end itself, moved inside by rounding
        own = np.abs(end.u) < 1e-12 * width
        cuts &= ~((points.phi == end.anchor.at[:, None]) & own[:, None])
    order = np.argsort(np.where(cuts, way, np.inf), axis=1, kind="stable")
    last = np.count_nonzero(cuts, axis=1) + 1
    places = np.pad(np.take_along_axis(way, order, axis=1), ((0, 0), (1, 1)))
    places[rows, last] = width
    ends = np.pad(_tops_with(ground, excess, order), ((0, 0), (1, 1), (0, 0)))
    for end, column in ((left, 0), (right, last)):
        ends[rows, column] = np.stack([end.anchor.at, end.anchor.near, end.u, end.excess], axis=1)
    orbit, number = each(last)
    first = places[orbit, number]
    length = places[orbit, number + 1] - first
    bottoms = np.where((points.kind == EquilibriumKind.CENTER) & within, way, np.nan)
    cut = _middles(length, lambda some: bottoms[orbit[some]] - first[some, None], way.shape[1])
    return Pieces.from_ends(orbit, length, ends[orbit, number], ends[orbit, number + 1], cut)


def round_the_circle(ground: Ground, excess: Array) -> Pieces:
    """Pieces of whole turns; `excess` is the energy of the orbits above each equilibrium."""
    turn, points = ground.systems.formula.period, ground.points
    assert turn is not None
    high = tops(ground)
    order = np.argsort(~high, axis=1, kind="stable")
    ends = _tops_with(ground, excess, order)
    count = np.count_nonzero(high, axis=1)
    orbit, number = each(count)
    left, right = (ends[orbit, k % count[orbit]] for k in (number, number + 1))
    length = right[:, 0] - left[:, 0]
    length = np.where(number + 1 < count[orbit], length, length + turn)
    bottoms = np.where(points.kind == EquilibriumKind.CENTER, points.phi, np.nan)
    cut = _middles(
        length, lambda some: (bottoms[orbit[some]] - left[some, :1]) % turn, points.phi.shape[1]
    )
    return Pieces.from_ends(orbit, length, left, right, cut)


def _tops_with(ground: Ground, excess: Array, order: Ints) -> Array:
    """Ends of pieces at equilibria, in an order of columns."""
    fields = (ground.points.phi, ground.near, np.zeros(excess.shape), excess)
    return np.stack([np.take_along_axis(x, order, axis=1) for x in fields], axis=-1)


def each(count: Ints) -> tuple[Ints, Ints]:
    """Rows that stand so many times each, and the number of each among those of its row."""
    rows = np.repeat(np.arange(count.size), count)
    return rows, np.arange(rows.size) - np.repeat(np.cumsum(count) - count, count)


def _middles(length: Array, bottoms: Callable[[Ints], Array], columns: int) -> Array:
    """Where to cut pieces: at the minimum of V next to their middle, or there.

    `bottoms` says of some pieces how far from their left ends minima lie.
    """
    cut = 0.5 * length
    step = max(1, _ENTRIES // max(1, columns))
    for begin in range(0, length.size if columns else 0, step):
        some = np.arange(begin, min(begin + step, length.size))
        way, middle = bottoms(some), cut[some, None]
        inside = (way > 0.0) & (way < length[some, None])
        nearest = np.argmin(np.where(inside, np.abs(way - middle), np.inf), axis=1)[:, None]
        found = np.take_along_axis(np.where(inside, way, middle), nearest, axis=1)
        cut[some] = found[:, 0]
    return cut


def speeds(anchor: Anchor, u: Array, excess: Array, d: Array) -> Array:
    """Speed at distances d from ends that lie at u from their anchor; shape (pieces, nodes).

    An end at u = 0 is the equilibrium itself, passed with the energy `excess` above it; any other
    is a turning point.
    """
    many, place, energy, step = anchor, u, excess, d.reshape(-1)
    if d.shape[1] > 1:
        rows = np.repeat(np.arange(u.size), d.shape[1])
        many, place, energy = anchor.take(rows), u[rows], excess[rows]
    if not place.any():
        kinetic = energy - many.rise(step)
        return np.sqrt(2.0 * np.maximum(kinetic, 0.0)).reshape(d.shape)
    kinetic = np.zeros(step.shape)
    for kind in (place == 0.0, place != 0.0):
        some = np.flatnonzero(kind)
        if some.size:
            few, first, further = many.take(some), place[some], step[some]
            if kind[some[0]] and first[0] == 0.0:
                kinetic[some] = energy[some] - few.rise(further)
                continue
            value = np.empty(some.size)
            close = np.abs(further) < few.near
            value[close] = -few.take(np.flatnonzero(close)).climb(first[close], further[close])
            far = np.flatnonzero(~close)
            value[far] = energy[some][far] - few.take(far).rise((first + further)[far])
            kinetic[some] = value
    return np.sqrt(2.0 * np.maximum(kinetic, 0.0)).reshape(d.shape)
