"""Families of orbits by their energy, from the center or a separatrix on: rungs of a ladder.

A rung is the logarithm of the distance in energy to where the ladder stands, over the height of
the family: next to a separatrix that distance carries the digits.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any, Protocol

import numpy as np

from phasekit.arrays import Array, Ints
from phasekit.errors import EquilibriumKind, Loop, OrbitFamily
from phasekit.phase.exact import flow as closed
from phasekit.phase.exact.orbits import energy_rises, orbits_at_gap
from phasekit.phase.exact.phase_space import phase_space
from phasekit.phase.exact.potential import potential
from phasekit.phase.numerical.differences import Ground
from phasekit.phase.numerical.families import FORWARD, Range, above_anchor, range_of
from phasekit.phase.numerical.motion import flow

#: Distances to a separatrix, from a center without one, and at the most, as logarithms.
NEAREST, LOWEST, FARTHEST = -60.0, -30.0, 30.0
SCAN = 181
#: Parts of the height, squared, and powers of ten, next to the other end of a family.
_SQUARES, _TENTHS = np.arange(1, 33) / 33.0, 10.0 ** -np.arange(1.0, 10.0)
_OTHER_END = np.log1p(-np.sort(np.concatenate([_SQUARES**2, _TENTHS]))[::-1])


class Ladder(Protocol):
    """The orbits of one family in each cell."""

    @property
    def rungs(self) -> Array:
        """Rungs to look at, from the orbit of least action or next to the separatrix on."""

    @property
    def height(self) -> Array:
        """What distances are parts of."""

    @property
    def separates(self) -> Any:
        """Whether the ladder stands on a separatrix, where orbits are lost in the end."""

    def take(self, rows: Ints) -> Ladder:
        """The families of some cells, which may repeat."""

    def levels(self, u: Array) -> tuple[Array, Any]:
        """Energies above where the ladder stands, negative below, and orbits at some rungs."""

    def motion(self, gap: Array, orbit: Any, time: Array) -> tuple[Array, Array]:
        """Coordinate and speed at times on the last axis, along one orbit a cell."""


@dataclass(frozen=True, eq=False)
class ClosedLadder:
    """A family of (A, B, C): by the gap to a separatrix."""

    coefficients: tuple[Array, Array, Array]
    height: Array
    saddle: Any
    side: Any
    sign: float
    rungs: Array
    family: int
    separates: Any = True

    @classmethod
    def from_coefficients(cls, A: Array, B: Array, C: Array, family: int) -> ClosedLadder:
        """The ladder of a family, a code of `OrbitFamily`."""
        points, loops = phase_space(A, B, C)
        rises = energy_rises(A, B, C)
        four = np.isfinite(loops.saddle_phi[:, 0])
        number = 1 if family == OrbitFamily.UPPER_WELL else 0
        lower, upper = loops.saddle_phi[:, 0], loops.saddle_phi[:, 1]
        turn = 2.0 * np.pi
        own = points.phi[:, 2 * number]
        right = np.mod(own - lower, turn) < np.mod(upper - lower, turn)
        side, sign, far = np.where(four & ~right, 0, 1), 1.0, -1e-9
        if family in (OrbitFamily.LOWER_WELL, OrbitFamily.UPPER_WELL):
            saddle, height, sign = np.where(four, 0, 1), rises[:, number], -1.0
        elif family == OrbitFamily.OUTER:
            saddle = np.zeros(len(A), int)
            height = np.where(four & (loops.loop[:, 0] == Loop.LOBES), rises[:, 2], np.nan)
        else:
            saddle, height, far = np.ones(len(A), int), rises[:, 3], FARTHEST
        rungs = np.linspace(NEAREST, far, SCAN)
        if sign < 0.0:  # librations begin at the center
            rungs = rungs[::-1]
        rungs = np.broadcast_to(rungs, (len(A), SCAN))
        return cls((A, B, C), height, saddle, side, sign, rungs, family)

    def take(self, rows: Ints) -> ClosedLadder:
        """The families of some cells, which may repeat."""
        A, B, C = (x[rows] for x in self.coefficients)
        few = {name: getattr(self, name)[rows] for name in ("height", "saddle", "side", "rungs")}
        return replace(self, coefficients=(A, B, C), **few)

    def levels(self, u: Array) -> tuple[Array, Any]:
        """Energies above the saddle, and orbits."""
        gap = self.sign * self.height[:, None] * np.exp(u)
        a, b, c = (x[:, None] for x in self.coefficients)
        return gap, orbits_at_gap(a, b, c, gap, self.saddle[:, None], self.side[:, None])

    def motion(self, gap: Array, orbit: Any, time: Array) -> tuple[Array, Array]:
        """Coordinate and speed at times on the last axis."""
        A, B, C = self.coefficients
        points, loops = phase_space(A, B, C)
        if self.family in (OrbitFamily.FORWARD, OrbitFamily.BACKWARD):
            phi = points.phi[:, 0]
            level = loops.saddle_energy[:, 1] + gap - potential(A, B, C, phi)
            dphi = np.sqrt(2.0 * level) * (1.0 if self.family == OrbitFamily.FORWARD else -1.0)
        else:
            # From the turning point that lies farther from the saddle, which fewer digits decide.
            phi = np.where(self.side == 1, orbit.phi_max, orbit.phi_min)
            dphi = np.zeros(phi.shape)
        a, b, c, x, v = (one[:, None] for one in (A, B, C, phi, dphi))
        found = closed.flow(a, b, c, x, v, time)
        return found[0], found[1]


@dataclass(frozen=True, eq=False)
class NumericalLadder:
    """A family in any potential, also under a torque: by its distance to a separatrix or center."""

    ground: Ground
    #: Columns of the deepest center, and of the equilibrium from which energies count.
    column: Ints
    anchor: Ints
    sign: Array
    height: Array
    rungs: Array
    separates: Any
    #: 1 and -1 of rotations forward and backward, else 0.
    sense: Array

    @classmethod
    def from_ground(cls, ground: Ground, code: Array) -> NumericalLadder:
        """The ladders of families, one code each; of 0 that of the lowest center."""
        points, rows = ground.points, np.arange(code.size)
        centers = points.kind == EquilibriumKind.CENTER
        code = np.where(code == 0, 1 << _lowest(ground, centers), code)
        nothing = np.full(code.size, np.nan)
        span = Range(np.zeros(code.size, np.intp), nothing, nothing.copy())
        for one in np.unique(code):
            some = np.flatnonzero(code == one)
            for field, found in zip(span, range_of(ground.take(some), int(one)), strict=True):
                field[some] = found
        rise = -ground.above(span.column)
        rise = np.where(centers | ~np.isfinite(points.phi), np.nan, rise)

        def saddle(level: Array) -> tuple[Ints, Any]:
            off = np.abs(rise - level[:, None])
            off = np.where(np.isnan(off), np.inf, off)
            column = np.argmin(off, axis=1)
            return column, off[rows, column] == 0.0

        (floor, on_floor), (wall, at_wall) = saddle(span.low), saddle(span.high)
        on_floor &= span.low > 0.0
        hung = at_wall & ~on_floor
        anchor = np.where(on_floor, floor, np.where(hung, wall, span.column))
        with np.errstate(all="ignore"):
            bend = points.curvature[rows, span.column]
            open_ = np.where(on_floor, span.low, bend)
            height = np.where(np.isinf(span.high), open_, span.high - span.low)
        far = np.where(np.isinf(span.high), FARTHEST, -1e-9)
        near = np.where(on_floor | hung, NEAREST, LOWEST)
        rungs = near[:, None] + (far - near)[:, None] * np.linspace(0.0, 1.0, SCAN)
        rungs = np.sort(np.concatenate([rungs, np.tile(_OTHER_END, (code.size, 1))], axis=1))
        rungs = np.where(hung[:, None], rungs[:, ::-1], rungs)
        sense = np.where(code < 0, np.where(code == FORWARD, 1.0, -1.0), 0.0)
        sign = np.where(hung, -1.0, 1.0)
        return cls(
            ground, span.column, anchor, sign, height, rungs, on_floor | hung, sense
        )  # fmt: skip

    def take(self, rows: Ints) -> NumericalLadder:
        """The families of some cells, which may repeat."""
        few = {name: x[rows] for name, x in vars(self).items() if name != "ground"}
        return NumericalLadder(self.ground.take(rows), **few)

    def levels(self, u: Array) -> tuple[Array, Any]:
        """Energies above the saddle or center, and orbits."""
        gap = (self.sign * self.height)[:, None] * np.exp(u)
        many = self.take(np.repeat(np.arange(len(u)), u.shape[1]))
        found = above_anchor(many.ground, many.column, many.anchor, gap.reshape(-1))
        return gap, type(found)._make(x.reshape(u.shape) for x in found)

    def motion(self, gap: Array, orbit: Any, time: Array) -> tuple[Array, Array]:
        """Coordinate and speed at times on the last axis."""
        ground, rows = self.ground, np.arange(len(gap))
        rise = gap + ground.above(self.anchor)[rows, self.column]
        # From the turning point that lies on the steeper slope, which fewer digits decide.
        ends = np.stack([orbit.phi_min, orbit.phi_max])
        with np.errstate(all="ignore"):
            steep = np.abs([ground.systems.slope(end) for end in ends])
            turned = np.where(steep[0] > steep[1], *ends)
            speed = self.sense * np.sqrt(2.0 * rise)
        start = np.where(self.sense == 0.0, turned, ground.points.phi[rows, self.column])
        found = np.full((2, *time.shape), np.nan)
        there = np.flatnonzero(np.isfinite(start + speed) & np.isfinite(time).all(axis=1))
        if there.size:
            owner = np.repeat(np.arange(there.size), time.shape[1])
            moved = flow(
                ground.take(there), start[there], speed[there], owner, time[there].reshape(-1)
            )
            found[:, there] = [x.reshape(there.size, -1) for x in moved[:2]]
        return found[0], found[1]


def _lowest(ground: Ground, centers: Any) -> Ints:
    """Number of the lowest center of each system, among the equilibria of its own turn."""
    turns: Any = ground
    energy = np.where(centers, ground.points.energy, np.inf)
    if (own := getattr(turns, "own", None)) is not None:
        energy = np.take_along_axis(energy, own, axis=1)
    return np.asarray(np.argmin(energy, axis=1))
