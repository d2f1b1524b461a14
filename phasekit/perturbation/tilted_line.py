"""Potentials that a constant torque N tilts, laid out on the line: V - N x.

On a circle V - N x does not repeat: it is taken over the turn of the states and one to either side,
as for the potential of (A, B, C).
"""

from __future__ import annotations

import functools
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from phasekit.laws.perturbed import TiltedConservative
from phasekit.perturbation.tilted_orbits import CELLS, SPAN, followed, repeated
from phasekit.perturbation.tilted_potential import equilibria_of_cells, tilted
from phasekit.phase.numerical import orbits as rounds
from phasekit.phase.numerical.constants import constant, reduced
from phasekit.phase.numerical.differences import Ground, survey
from phasekit.phase.numerical.formula import Formula, make_formula
from phasekit.phase.numerical.separatrices import saddles_of
from phasekit.phase.numerical.systems import Systems

Array = npt.NDArray[np.float64]
Index = npt.NDArray[np.intp]


@functools.lru_cache(maxsize=32)
def unrolled(formula: Formula) -> Formula:
    """V - N x along the line, over as many turns as `SPAN` has."""
    tilt = tilted(formula)
    if formula.period is None:
        return tilt
    reach = 0.5 * len(SPAN) * formula.period
    return make_formula(tilt.expression, tilt.coordinate, tilt.names, None, (-reach, reach))


@dataclass(frozen=True)
class Cells:
    """Systems in a row, their torques, and of which of them each state is."""

    formula: Formula
    own: list[Array]
    torque: Array
    number: Index
    states: tuple[Array, ...]
    shape: tuple[int, ...]

    @classmethod
    def of(cls, law: TiltedConservative, inputs: Any, states: Any) -> Cells:
        """Lay out parameters and states that broadcast."""
        values = law.values(*inputs)
        formula: Any = law.base
        used = [values[name] for name in (*formula.names, "torque")]
        # Cells that differ in what is not in the potential are one system.
        own = np.broadcast_shapes(*map(np.shape, values.values()))
        columns = np.stack([np.broadcast_to(x, own).reshape(-1) for x in used]) + 0.0
        systems, which = np.unique(columns, axis=1, return_inverse=True)
        shape = np.broadcast_shapes(own, *map(np.shape, states))
        number = np.broadcast_to(which.reshape(own), shape)
        return cls(
            formula,
            list(systems[:-1]),
            systems[-1],
            np.array(number).reshape(-1),
            tuple(np.array(np.broadcast_to(x, shape), float).reshape(-1) for x in states),
            shape,
        )

    @property
    def period(self) -> float:
        """Length of the circle; on a line nothing returns."""
        return np.inf if self.formula.period is None else self.formula.period

    @property
    def constant(self) -> Array:
        """What belongs to the energies of each system but not to its motion."""
        return np.asarray(constant(self.formula, self.own) + 0.0 * self.torque)

    def level(self) -> tuple[Index, list[Array]]:
        """States without a torque, with the parameters of their potential."""
        cells = np.flatnonzero(self.torque[self.number] == 0.0)
        return cells, [p[self.number[cells]] for p in self.own]

    def parts(self) -> list[tuple[Slope, Index]]:
        """The others, not too many at a time, each with its potential on the line."""
        tilt = self.torque != 0.0
        cells = np.flatnonzero(tilt[self.number])
        if not cells.size:
            return []
        systems = np.flatnonzero(tilt)
        slope, row = Slope.of(self, systems), np.cumsum(tilt) - 1
        split = [cells[i : i + CELLS] for i in range(0, cells.size, CELLS)]
        return [(slope.take(row[self.number[some]]), some) for some in split]

    def shaped(self, fields: Any) -> list[Any]:
        """Fields in the shape of the states."""
        return [field.reshape(self.shape) for field in fields]


@dataclass(frozen=True)
class Slope:
    """Potentials that a torque tilts, on the line, with the columns of the turn of the states."""

    ground: Ground
    torque: Array
    first: Index
    """Column of the first equilibrium of that turn, and their number."""
    count: Index
    period: float

    @classmethod
    def of(cls, cells: Cells, systems: Index) -> Slope:
        """Find the equilibria of some systems, and repeat those of a circle."""
        own, torque = [p[systems] for p in cells.own], cells.torque[systems]
        level = reduced(cells.formula)
        points = equilibria_of_cells(level, own, torque)
        count = np.isfinite(points.phi).sum(axis=1)
        first = np.zeros(systems.size, np.intp)
        if level.period is not None:
            points, first = repeated(points, torque, level.period), count
        line = Systems(unrolled(level), (*own, torque), systems.size)
        return cls(survey(line, points), torque, first, count, cells.period)

    def take(self, rows: Index) -> Slope:
        """The systems of some rows, which may repeat."""
        return Slope(
            self.ground.take(rows), self.torque[rows], self.first[rows], self.count[rows],
            self.period,
        )  # fmt: skip

    def column(self, usable: npt.NDArray[np.bool_], number: int | None) -> tuple[Index, Any]:
        """Column of the equilibrium of a number, or of the lowest usable; whether it is there."""
        points = self.ground.points
        rows, columns = points.phi.shape
        place = np.arange(columns) - self.first[:, None]
        usable = usable & (place >= 0) & (place < self.count[:, None])
        if not columns:
            return np.zeros(rows, np.intp), np.zeros(rows, bool)
        if number is None:
            column = np.argmin(np.where(usable, points.energy, np.inf), axis=1)
        else:
            column = np.minimum(self.first + number, columns - 1)
            usable = usable & (number < self.count[:, None])
        return column, usable[np.arange(rows), column]

    def saddle(self, number: int | None) -> tuple[Index, Any]:
        """Column of the saddle of a number among those of the turn, or of the lowest."""
        usable = np.zeros(self.ground.points.phi.shape, bool)
        usable[saddles_of(self.ground)] = True
        if number is None:
            return self.column(usable, None)
        place = np.arange(self.ground.points.phi.shape[1]) - self.first[:, None]
        usable &= (place >= 0) & (place < self.count[:, None])
        nth = usable & (np.cumsum(usable, axis=1) == number + 1)
        if not place.shape[1]:
            return np.zeros(len(place), np.intp), np.zeros(len(place), bool)
        return np.argmax(nth, axis=1), nth.any(axis=1)

    def orbits(self, states: rounds.States, v: Array) -> Any:
        """Orbits of states; what runs round a circle is followed back to where it was turned."""
        if np.isinf(self.period):
            return rounds.orbits_of(self.ground, states, v)
        return followed(self.ground, states, v, self.torque, self.period)
