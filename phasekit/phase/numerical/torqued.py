"""What holds of a potential under a constant torque: parameters and states in, arrays out.

The namesakes of `phasekit.phase.numerical.functions`, with the law first. Equilibria of a circle
are those of its force, and energies those at their coordinates there. Where no torque acts the
potential itself answers, bit for bit.
"""

from __future__ import annotations

import functools
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, NamedTuple, TypeVar

import numpy as np
import numpy.typing as npt

from phasekit.arrays import Array, Ints
from phasekit.errors import OrbitFamily, OrbitKind
from phasekit.laws.perturbed import PerturbedLaw
from phasekit.phase.numerical import functions
from phasekit.phase.numerical import orbits as rounds
from phasekit.phase.numerical.angles import AnglesWithErrors
from phasekit.phase.numerical.angles import angles as find_angles
from phasekit.phase.numerical.constants import reduced
from phasekit.phase.numerical.differences import Ground, survey
from phasekit.phase.numerical.families import BACKWARD, FORWARD, StateWithErrors, states_of_action
from phasekit.phase.numerical.motion import MotionWithErrors
from phasekit.phase.numerical.motion import separatrix_motion as follow
from phasekit.phase.numerical.separatrices import branch_of
from phasekit.phase.numerical.systems import Systems
from phasekit.phase.numerical.turns import Turns, followed, torqued
from phasekit.phase.numerical.unpushed import TRIGONOMETRIC, Named, Unpushed, merged, unpushed

Result = TypeVar("Result", bound=tuple[Any, ...])

#: Families of librations by the labels of their centers.
NUMBERS = {OrbitFamily.LOWER_WELL: 1, OrbitFamily.UPPER_WELL: 4, OrbitFamily.OUTER: 5}
#: Those of rotations.
ROTATIONS = {OrbitFamily.FORWARD: FORWARD, OrbitFamily.BACKWARD: BACKWARD}
#: States at a time, for memory.
CELLS = 4096
#: Systems up to which their turns are kept for the next call.
KEPT = 256


class TorquedOrbits(NamedTuple):
    """Orbits under a torque; the fields of `rounds.Orbits`, and what a turn gains."""

    orbit_kind: npt.NDArray[np.int8]
    orbit_energy: Array
    period: Array
    frequency: Array
    action: Array
    phi_min: Array
    phi_max: Array
    amplitude: Array
    period_error: Array
    action_error: Array
    phi_min_error: Array
    phi_max_error: Array
    gain_per_turn: Array


class TorquedSeparatrices(NamedTuple):
    """Separatrices under a torque, and what a turn forward gains."""

    topology: npt.NDArray[np.int8]
    figure_eight: npt.NDArray[np.bool_]
    saddle_phi: Array
    saddle_energy: Array
    saddle_exponent: Array
    loop: npt.NDArray[np.int8]
    winding_area: Array
    turning_offset: Array
    turning_phi: Array
    lobe_area: Array
    winding_area_error: Array
    lobe_area_error: Array
    energy_per_turn: Array


@dataclass(frozen=True)
class Cells:
    """Systems in a row, their torques, and of which of them each state is."""

    base: Unpushed
    own: list[Array]
    torque: Array
    number: Ints
    states: tuple[Array, ...]
    shape: tuple[int, ...]

    @classmethod
    def from_inputs(cls, law: PerturbedLaw, inputs: Any, states: Any) -> Cells:
        """Lay out parameters and states that broadcast."""
        base, used, torque, own = _parts(law, inputs)
        columns = np.stack([np.broadcast_to(x, own).reshape(-1) for x in (*used, torque)]) + 0.0
        # Cells that differ in what is not in the potential are one system.
        systems, which = np.unique(columns, axis=1, return_inverse=True)
        shape = np.broadcast_shapes(own, *map(np.shape, states))
        number = np.broadcast_to(which.reshape(own), shape)
        return cls(
            base,
            list(systems[:-1]),
            systems[-1],
            np.array(number).reshape(-1),
            tuple(np.array(np.broadcast_to(x, shape), float).reshape(-1) for x in states),
            shape,
        )

    @functools.cached_property
    def points(self) -> Any:
        """Equilibria of the systems, without what belongs to their energies alone."""
        if self.torque.size > KEPT:
            return self.base.points(self.own, self.torque)
        return _kept(self.base, False, *(p.tobytes() for p in (*self.own, self.torque)))

    def parameters(self, cells: Ints) -> list[Array]:
        """Parameters of the potential of some cells."""
        return [p[self.number[cells]] for p in self.own]

    def level(self) -> Ints:
        """Cells without a torque."""
        return np.flatnonzero(self.torque[self.number] == 0.0)

    def turns(self) -> list[tuple[Turns, Ints]]:
        """The other cells, not too many at a time, each with its potential on the line."""
        pushed = self.torque != 0.0
        cells = np.flatnonzero(pushed[self.number])
        if not cells.size:
            return []
        *own, torque = (p[pushed] for p in (*self.own, self.torque))
        if torque.size <= KEPT:
            found = _kept(self.base, True, *(p.tobytes() for p in (*own, torque)))
        else:
            points = type(self.points)._make(x[pushed] for x in self.points)
            found = self.base.turns(points, own, torque)
        row = np.cumsum(pushed) - 1
        split = [cells[i : i + CELLS] for i in range(0, cells.size, CELLS)]
        return [(found.take(row[self.number[some]]), some) for some in split]

    def constant(self, cells: Ints) -> Any:
        """What belongs to the energies of cells but not to their motion."""
        return self.base.constant(self.own, self.torque)[self.number[cells]]

    def answered(self, parts: list[tuple[Ints, Any]], kind: type[Result]) -> Result:
        """Results of some cells each as those of all."""
        fields = merged(parts, self.number.size)
        return kind(*(x.reshape(self.shape + x.shape[1:]) for x in fields))


@functools.lru_cache(maxsize=64)
def _kept(base: Unpushed, lined: bool, *parameters: bytes) -> Any:
    """What is found of a few systems, which calls in a row ask for again."""
    *own, torque = (np.frombuffer(values) for values in parameters)
    points = _kept(base, False, *parameters) if lined else base.points(own, torque)
    return base.turns(points, own, torque) if lined else points


def _parts(law: PerturbedLaw, inputs: Any) -> tuple[Unpushed, list[Any], Any, tuple[int, ...]]:
    """The potential, its parameters and the torque, and the shape of all parameters."""
    values = law.values(*inputs)
    base, used = unpushed(law.base, values)
    return base, used, values["torque"], np.broadcast_shapes(*map(np.shape, values.values()))


# ------------------------------------------------------------------------- energies


def _of_formula(function: Callable[..., Array], states: int) -> Callable[..., Array]:
    def called(law: PerturbedLaw, *inputs: npt.ArrayLike) -> Array:
        base, used, torque, _ = _parts(law, inputs[:-states])
        found = function(torqued(base.formula), *used, torque, *inputs[-states:])
        return np.asarray(np.where(np.isnan(torque), np.nan, found))  # which is not in V''

    called.__doc__ = function.__doc__
    return called


potential = _of_formula(functions.potential, 1)
gradient = _of_formula(functions.gradient, 1)
curvature = _of_formula(functions.curvature, 1)
energy = _of_formula(functions.energy, 2)
phase_velocity = _of_formula(functions.phase_velocity, 2)

# ------------------------------------------------------------------------- phase space


def equilibria(law: PerturbedLaw, *parameters: npt.ArrayLike) -> Any:
    """All equilibria under a constant torque."""
    return _equilibria(Cells.from_inputs(law, parameters, ()))


def separatrices(law: PerturbedLaw, *parameters: npt.ArrayLike) -> TorquedSeparatrices:
    """Separatrices under a constant torque, of the saddles of the turn of the states."""
    return _separatrices(Cells.from_inputs(law, parameters, ()))


def phase_space(law: PerturbedLaw, *parameters: npt.ArrayLike) -> tuple[Any, TorquedSeparatrices]:
    """Equilibria and separatrices at once."""
    cells = Cells.from_inputs(law, parameters, ())
    return _equilibria(cells), _separatrices(cells)


def _equilibria(cells: Cells) -> Any:
    found = cells.base.equilibria(cells.points, cells.own, cells.torque)
    return type(found)._make(x[cells.number].reshape(cells.shape + x.shape[1:]) for x in found)


def _separatrices(cells: Cells) -> TorquedSeparatrices:
    flat, turn = cells.level(), cells.base.formula.period or np.nan
    gain = turn * cells.torque[cells.number]
    parts: list[tuple[Ints, Any]] = []
    if flat.size or not cells.number.size:
        found = cells.base.level("separatrices", cells.parameters(flat))
        # A formula without parameters is one system.
        rows = [x if cells.own else np.broadcast_to(x, (flat.size, *x.shape)) for x in found]
        parts.append((flat, (*rows, gain[flat])))
    for turns, some in cells.turns():
        found = turns.separatrices()
        height = found.saddle_energy + cells.constant(some)[:, None]
        parts.append((some, (*found._replace(saddle_energy=height), gain[some])))
    return cells.answered(parts, TorquedSeparatrices)


def grounds(
    law: PerturbedLaw, parameters: Any, most: int, *, lined: bool = False
) -> list[tuple[Any, Ints]]:
    """Potentials of cells, so many at a time: on the line where a torque acts, or all if lined.

    Those in closed form are left out where no torque acts.
    """
    cells = Cells.from_inputs(law, parameters, ())
    found: list[tuple[Ground, Ints]] = []
    level = cells.level()
    if level.size and not isinstance(cells.base, Named):
        own = cells.parameters(level)
        if lined:
            still = np.zeros(level.size)
            points = cells.base.points(own, still)
            found.append((cells.base.turns(points, own, still), level))
        else:
            systems = Systems(reduced(cells.base.formula), tuple(own), level.size)
            found.append((survey(systems), level))
    found += cells.turns()
    return [
        (ground.take(np.arange(start, min(start + most, some.size))), some[start : start + most])
        for ground, some in found
        for start in range(0, some.size, most)
    ]


def code_of_numbers(family: int) -> int:
    """The code of a named family as one of numbered centers, those of `Turns`."""
    return {**NUMBERS, **ROTATIONS}.get(OrbitFamily(family), 0)


def lines_of(*cells: Array) -> tuple[Any, Turns]:
    """Equilibria of coefficients (A, B, C) under a torque, the last, and what is on the line."""
    *own, torque = cells
    base = Named(TRIGONOMETRIC)
    points = base.points(own, torque)
    return points, base.turns(points, own, torque)


# ------------------------------------------------------------------------- orbits


def orbits(law: PerturbedLaw, *inputs: npt.ArrayLike) -> TorquedOrbits:
    """Orbits through states (phi0, dphi0), the last of the inputs."""
    cells = Cells.from_inputs(law, inputs[:-2], inputs[-2:])
    x, v = cells.states

    def start(turns: Turns, some: Ints) -> tuple[rounds.States, Array, Array]:
        near, away = turns.home(x[some])
        states = rounds.states_of(turns, near, v[some])
        height = turns.systems.potential(x[some]) + cells.constant(some)
        return states._replace(turns=states.turns + away), v[some], 0.5 * v[some] ** 2 + height

    return _orbits(cells, "orbits", start)


def orbits_at_energy(
    law: PerturbedLaw, *inputs: npt.ArrayLike, center: int | None = None
) -> TorquedOrbits:
    """Orbits of an energy, the last of the inputs, round a center: its number, or the lowest."""
    cells = Cells.from_inputs(law, inputs[:-1], inputs[-1:])
    (h,) = cells.states

    def start(turns: Turns, some: Ints) -> tuple[rounds.States, Array, Array]:
        base = cells.constant(some)
        size = np.abs(h[some]) + np.abs(base)
        states = functions.states_at_energy(turns, h[some] - base, *turns.center(center), size)
        return states, np.sqrt(2.0 * states.kinetic), h[some]

    return _orbits(cells, "orbits_at_energy", start, center=center)


def orbits_at_gap(
    law: PerturbedLaw,
    *inputs: npt.ArrayLike,
    saddle: int | None = None,
    side: int = 1,
) -> TorquedOrbits:
    """Orbits by their energy above a saddle, the last of the inputs; side 0 left, 1 right."""
    cells = Cells.from_inputs(law, inputs[:-1], inputs[-1:])
    (gap,) = cells.states

    def start(turns: Turns, some: Ints) -> tuple[rounds.States, Array, Array]:
        column, there = turns.saddle(saddle)
        states = functions.states_at_gap(turns, gap[some], column, there, side)
        height = functions.column_of(turns.points.energy, np.arange(some.size), column)
        energies = height + cells.constant(some) + gap[some]
        return states, np.sqrt(2.0 * states.kinetic), energies

    return _orbits(cells, "orbits_at_gap", start, saddle=saddle, side=side)


def angles(law: PerturbedLaw, *inputs: npt.ArrayLike) -> AnglesWithErrors:
    """Angle variables of states (phi, dphi), the last of the inputs; NaN where they run."""
    cells = Cells.from_inputs(law, inputs[:-2], inputs[-2:])
    x, v = cells.states
    flat = cells.level()
    parts: list[tuple[Ints, Any]] = []
    if flat.size:
        parts.append((flat, cells.base.level("angles", cells.parameters(flat), x[flat], v[flat])))
    for turns, some in cells.turns():
        parts.append((some, find_angles(turns, turns.home(x[some])[0], v[some])))
    found = cells.answered(parts, AnglesWithErrors)
    nothing = np.full(cells.shape, np.nan)
    return found._replace(orbit_family=np.zeros(cells.shape, np.int8), twist=nothing)


def state_of(law: PerturbedLaw, *inputs: npt.ArrayLike) -> StateWithErrors:
    """States by action, angle variable and code of the family, the last of the inputs."""
    cells = Cells.from_inputs(law, inputs[:-3], inputs[-3:])
    flat = cells.level()
    parts: list[tuple[Ints, Any]] = []
    if flat.size or not cells.number.size:
        states = (x[flat] for x in cells.states)
        parts.append((flat, cells.base.level("state_of", cells.parameters(flat), *states)))
    for turns, some in cells.turns():
        action, angle, family = (x[some] for x in cells.states)
        if turns.named:
            family = np.select([family == code for code in NUMBERS], list(NUMBERS.values()), 0.0)
        parts.append((some, states_of_action(turns, action, angle, family)))
    return cells.answered(parts, StateWithErrors)


def separatrix_motion_with_errors(
    law: PerturbedLaw, *inputs: npt.ArrayLike, saddle: int | None = None, side: int = 1
) -> MotionWithErrors:
    """Motion on the separatrix of a saddle at times, the last of the inputs.

    NaN on the side where it runs away, for there it has no turning point from which to count.
    """
    cells = Cells.from_inputs(law, inputs[:-1], inputs[-1:])
    (time,) = cells.states
    parts: list[tuple[Ints, Any]] = []
    flat = cells.level()
    if flat.size:
        level = functools.partial(cells.base.level, "separatrix_motion_with_errors")
        parts.append((flat, level(cells.parameters(flat), time[flat], saddle=saddle, side=side)))
    for turns, some in cells.turns():
        column, there = turns.saddle(saddle)
        rows = np.flatnonzero(there)
        found = np.full((4, some.size), np.nan)
        if rows.size:
            branch = branch_of(turns.take(rows), column[rows], 1.0 if side else -1.0)
            found[:, rows] = follow(branch, np.arange(rows.size), time[some[rows]])
        parts.append((some, found))
    return cells.answered(parts, MotionWithErrors)


def _orbits(cells: Cells, name: str, start: Callable[..., Any], **options: Any) -> TorquedOrbits:
    """Orbits of cells: without a torque, and under one from states, their speeds and energies."""
    parts: list[tuple[Ints, Any]] = []
    flat = cells.level()
    if flat.size or not cells.number.size:
        found = cells.base.level(
            name, cells.parameters(flat), *(x[flat] for x in cells.states), **options
        )
        parts.append((flat, (*found, np.where(found.orbit_kind >= 0, 0.0, np.nan))))
    for turns, some in cells.turns():
        states, v, energies = start(turns, some)
        found = followed(turns, states, v)
        there = found.orbit_kind >= 0
        found = found._replace(orbit_energy=np.where(there, energies, np.nan))
        gain = np.where(found.orbit_kind == OrbitKind.RUNNING, np.abs(turns.fall), 0.0)
        parts.append((some, (*found, np.where(there, gain, np.nan))))
    return cells.answered(parts, TorquedOrbits)
