"""Arcs of orbits cut at the maxima of V, and the speed at places on them."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
import numpy.typing as npt

from phasekit.arrays import Array
from phasekit.errors import EquilibriumKind
from phasekit.phase.numerical.differences import Anchor, Ground
from phasekit.phase.numerical.turning_points import End, distances

#: An end of a piece: its anchor's place and reach, its own place from there, the energy above it.
PieceEnd = tuple[float, float, float, float]


@dataclass
class Pieces:
    """Stretches of orbits, each with its length, its two ends, and a place between to cut it.

    `cut` counts from the left end. Where both ends are known from the center between them, `reach`
    says more exactly how far from it they lie.
    """

    orbit: list[int] = field(default_factory=list)
    length: list[float] = field(default_factory=list)
    left: list[PieceEnd] = field(default_factory=list)
    right: list[PieceEnd] = field(default_factory=list)
    cut: list[float] = field(default_factory=list)
    reach: list[tuple[float, float]] = field(default_factory=list)

    def add(
        self, orbit: int, length: float, left: PieceEnd, right: PieceEnd, bottoms: list[float]
    ) -> None:
        """Add one stretch; `bottoms` are distances of minima of V from its left end."""
        inside = [d for d in bottoms if 0.0 < d < length]
        self.orbit.append(orbit)
        self.length.append(length)
        self.left.append(left)
        self.right.append(right)
        self.cut.append(min(inside, key=lambda d: abs(d - 0.5 * length), default=0.5 * length))
        shared = left[0] == right[0] and left[2] < 0.0 < right[2]
        self.reach.append((-left[2], right[2]) if shared else (np.nan, np.nan))


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
    low = (ground.points.kind == EquilibriumKind.CENTER) & (way > 0.0) & (way < width[:, None])
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
            bottoms = [float(d) - places[k] for d in way[i][low[i]]]
            pieces.add(i, places[k + 1] - places[k], ends[k], ends[k + 1], bottoms)
    return pieces


def round_the_circle(ground: Ground, excess: Array) -> Pieces:
    """Pieces of whole turns; `excess` is the energy of the orbits above each equilibrium."""
    pieces = Pieces()
    turn = ground.systems.formula.period
    assert turn is not None
    high, low = tops(ground), ground.points.kind == EquilibriumKind.CENTER
    for i in range(ground.systems.size):
        ends = [
            (float(ground.points.phi[i, j]), float(ground.near[i, j]), 0.0, float(excess[i, j]))
            for j in np.flatnonzero(high[i])
        ]
        for k, end in enumerate(ends):
            after = ends[(k + 1) % len(ends)]
            length = after[0] - end[0]
            bottoms = [float(d) % turn for d in ground.points.phi[i][low[i]] - end[0]]
            pieces.add(i, length if k + 1 < len(ends) else length + turn, end, after, bottoms)
    return pieces


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
