"""Integrals over arcs cut at the maxima of V, by the double-exponential rule.

Its points crowd at both ends of a piece so fast that neither the root at a turning point nor the
near-pole next to a saddle slows it down [TakahasiMori1974]. Each point is placed by its distance
from the nearer end, and the energy there is a difference from that end, so digits are kept.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
import numpy.typing as npt

from phasekit.errors import EquilibriumKind
from phasekit.phase.numerical.arcs import End, distances
from phasekit.phase.numerical.ground import Anchor, Ground

Array = npt.NDArray[np.float64]
#: An end of a piece: its anchor's place and reach, its own place from there, the energy above it.
PieceEnd = tuple[float, float, float, float]

_LEVELS = (3, 4, 5, 6, 7)
#: How far the rule goes: where 1/v is like d^(-1/2) or log d at the ends, and for v alone.
_RANGES = (4.2, 3.1)
_AGREE = 1e-9


@dataclass
class Pieces:
    """Stretches of orbits, each with its length and its two ends."""

    orbit: list[int] = field(default_factory=list)
    length: list[float] = field(default_factory=list)
    left: list[PieceEnd] = field(default_factory=list)
    right: list[PieceEnd] = field(default_factory=list)

    def add(self, orbit: int, length: float, left: PieceEnd, right: PieceEnd) -> None:
        """Add one stretch."""
        self.orbit.append(orbit)
        self.length.append(length)
        self.left.append(left)
        self.right.append(right)


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
    pieces = Pieces()
    way = distances(ground, start, 1.0)
    inside = tops(ground) & (way > 0.0) & (way < width[:, None])
    points, near = ground.points, ground.near
    for i in range(start.size):
        first, last = (
            (float(e.anchor.at[i]), float(e.anchor.near[i]), float(e.u[i]), float(e.excess[i]))
            for e in (left, right)
        )
        places, ends = [0.0], [first]
        for j in np.flatnonzero(inside[i])[np.argsort(way[i][inside[i]])]:
            x = float(points.phi[i, j])
            if any(end[0] == x and abs(end[2]) < 1e-12 * width[i] for end in (first, last)):
                continue  # the end itself, moved inside by rounding
            places.append(float(way[i, j]))
            ends.append((x, float(near[i, j]), 0.0, float(excess[i, j])))
        places.append(float(width[i]))
        ends.append(last)
        for k in range(len(ends) - 1):
            pieces.add(i, places[k + 1] - places[k], ends[k], ends[k + 1])
    return pieces


def round_the_circle(ground: Ground, excess: Array) -> Pieces:
    """Pieces of whole turns; `excess` is the energy of the orbits above each equilibrium."""
    pieces = Pieces()
    turn = ground.systems.formula.period
    assert turn is not None
    high = tops(ground)
    for i in range(ground.systems.size):
        ends = [
            (float(ground.points.phi[i, j]), float(ground.near[i, j]), 0.0, float(excess[i, j]))
            for j in np.flatnonzero(high[i])
        ]
        for k, end in enumerate(ends):
            after = ends[(k + 1) % len(ends)]
            length = after[0] - end[0]
            pieces.add(i, length if k + 1 < len(ends) else length + turn, end, after)
    return pieces


def integrate(ground: Ground, pieces: Pieces, *, timed: bool = True) -> tuple[Array, Array]:
    """Integrals of 1/v (if `timed`) and of v over the pieces of each orbit."""
    orbit = np.array(pieces.orbit, dtype=np.intp)
    length = np.array(pieces.length)
    systems = ground.systems.take(orbit)
    ends = [np.array(end).reshape(-1, 4).T for end in (pieces.left, pieces.right)]
    sums = np.zeros((2, length.size))
    rows = np.arange(length.size)
    coarse = np.full((2, length.size), np.nan)
    for level in _LEVELS:
        steps = round(_RANGES[0 if timed else 1] * 2**level)
        t = np.arange(-steps, steps + 1) / 2**level
        share = 1.0 / (1.0 + np.exp(np.pi * np.abs(np.sinh(t))))  # distance from the nearer end
        weight = np.pi * np.cosh(t) * share * (1.0 - share) / 2**level
        speed = np.empty((rows.size, t.size))
        for side, nodes in ((0, t <= 0.0), (1, t > 0.0)):
            at, near, u, excess = (column[rows] for column in ends[side])
            d = length[rows, None] * share[nodes] * (1.0 if side == 0 else -1.0)
            speed[:, nodes] = speeds(Anchor(systems.take(rows), at, near), u, excess, d)
        fine = np.zeros((2, rows.size))
        fine[1] = length[rows] * (speed @ weight)
        if timed:
            with np.errstate(divide="ignore", invalid="ignore"):
                fine[0] = length[rows] * ((1.0 / speed) @ weight)
        good = np.all(np.abs(fine - coarse) <= _AGREE * fine, axis=0) | (level == _LEVELS[-1])
        sums[:, rows[good]] = fine[:, good]
        rows, coarse = rows[~good], fine[:, ~good]
        if not rows.size:
            break
    totals = np.zeros((2, ground.systems.size))
    for total, values in zip(totals, sums, strict=True):
        np.add.at(total, orbit, values)
    return totals[0], totals[1]


def speeds(anchor: Anchor, u: Array, excess: Array, d: Array) -> Array:
    """Speed at distances d from ends that lie at u from their anchor; shape (pieces, nodes).

    An end at u = 0 is the equilibrium itself, passed with the energy `excess` above it; any other
    is a turning point.
    """
    rows = np.repeat(np.arange(u.size), d.shape[1])
    many, place, step = anchor.take(rows), u[rows], d.reshape(-1)
    kinetic = np.zeros(step.shape)
    for kind in (place == 0.0, place != 0.0):
        some = np.flatnonzero(kind)
        if some.size:
            few, first, further = many.take(some), place[some], step[some]
            if kind[some[0]] and first[0] == 0.0:
                kinetic[some] = excess[rows[some]] - few.rise(further)
                continue
            value = np.empty(some.size)
            close = np.abs(further) < few.near
            value[close] = -few.take(np.flatnonzero(close)).climb(first[close], further[close])
            far = np.flatnonzero(~close)
            value[far] = excess[rows[some]][far] - few.take(far).rise((first + further)[far])
            kinetic[some] = value
    return np.sqrt(2.0 * np.maximum(kinetic, 0.0)).reshape(d.shape)
