"""The array functions of a formula: parameters and states in, arrays out, as NumPy broadcasts.

The namesakes of the closed-form functions of `phasekit.phase`, with a `Formula` first and its
parameters where those have A, B, C. The equilibria of a system are found once, however many states
broadcast against it.
"""

from __future__ import annotations

import functools
from collections.abc import Sequence
from typing import Any

import numpy as np
import numpy.typing as npt

from phasekit.arrays import Array, Ints
from phasekit.errors import EquilibriumKind
from phasekit.phase.exact.flow import Motion
from phasekit.phase.numerical import motion as motions
from phasekit.phase.numerical import orbits as rounds
from phasekit.phase.numerical import separatrices as loops
from phasekit.phase.numerical.angles import AnglesWithErrors
from phasekit.phase.numerical.angles import angles as find_angles
from phasekit.phase.numerical.constants import constant, reduced
from phasekit.phase.numerical.differences import Ground, survey
from phasekit.phase.numerical.digits import values
from phasekit.phase.numerical.equilibria import Equilibria
from phasekit.phase.numerical.equilibria import equilibria as find_equilibria
from phasekit.phase.numerical.families import StateWithErrors, states_of_action
from phasekit.phase.numerical.formula import Formula
from phasekit.phase.numerical.motion import MotionWithErrors
from phasekit.phase.numerical.orbits import Orbits
from phasekit.phase.numerical.separatrices import Separatrices
from phasekit.phase.numerical.systems import Systems, make_systems
from phasekit.phase.numerical.turning_points import distances

Shape = tuple[int, ...]

#: Systems up to which a survey is kept for the next call.
_KEPT = 256


def potential(formula: Formula, *inputs: npt.ArrayLike) -> Array:
    """V at phi, the last of the inputs."""
    return formula.values(inputs[-1], *inputs[:-1])


def gradient(formula: Formula, *inputs: npt.ArrayLike) -> Array:
    """V' at phi, the last of the inputs."""
    return formula.slopes(inputs[-1], *inputs[:-1])


def curvature(formula: Formula, *inputs: npt.ArrayLike) -> Array:
    """V'' at phi, the last of the inputs."""
    return formula.bends(inputs[-1], *inputs[:-1])


def energy(formula: Formula, *inputs: npt.ArrayLike) -> Array:
    """Energy of states (phi, dphi), the last of the inputs."""
    *parameters, phi, dphi = inputs
    speed = np.asarray(dphi, dtype=float)
    return np.asarray(0.5 * speed * speed + formula.values(phi, *parameters))


def phase_velocity(formula: Formula, *inputs: npt.ArrayLike) -> Array:
    """Speed at phi on the level of an energy, the last of the inputs; NaN where out of reach."""
    *parameters, phi, level = inputs
    kinetic = np.asarray(level, dtype=float) - formula.values(phi, *parameters)
    return np.sqrt(2.0 * np.where(kinetic >= 0.0, kinetic, np.nan))


def equilibria(formula: Formula, *parameters: npt.ArrayLike) -> Equilibria:
    """All equilibria, from left to right on the last axis."""
    systems, shape = make_systems(reduced(formula), parameters)
    if systems.size <= _KEPT:
        points = _survey(formula, parameters)[0].points
    else:
        points = find_equilibria(systems)
    found = Equilibria._make(np.array(f).reshape(shape + f.shape[1:]) for f in points)
    return found._replace(energy=energies(formula, parameters, found.phi, found.energy))


def separatrices(formula: Formula, *parameters: npt.ArrayLike) -> Separatrices:
    """Separatrices, their saddles from left to right."""
    return phase_space(formula, *parameters)[1]


def phase_space(formula: Formula, *parameters: npt.ArrayLike) -> tuple[Equilibria, Separatrices]:
    """Equilibria and separatrices at once."""
    ground, shape = _survey(formula, parameters)
    found = loops.separatrices(ground)
    points = Equilibria._make(f.reshape(shape + f.shape[1:]) for f in ground.points)
    found = Separatrices._make(f.reshape(shape + f.shape[1:]) for f in found)
    energy = energies(formula, parameters, points.phi, points.energy)
    height = energies(formula, parameters, found.saddle_phi, found.saddle_energy)
    return points._replace(energy=energy), found._replace(saddle_energy=height)


def topology(formula: Formula, *parameters: npt.ArrayLike) -> tuple[Equilibria, Separatrices]:
    """As `phase_space` without areas, constants of V and the systems' shape: one a row."""
    ground, _ = _survey(formula, parameters)
    return ground.points, loops.separatrices(ground, measured=False)


def number_of_equilibria(formula: Formula, *parameters: npt.ArrayLike) -> Ints:
    """How many equilibria each system has: one a row."""
    systems, _ = make_systems(reduced(formula), parameters)
    return np.asarray(find_equilibria(systems, counted=True).n_equilibria, dtype=np.intp)


def orbits(formula: Formula, *inputs: npt.ArrayLike) -> Orbits:
    """Orbits through states (phi0, dphi0), the last of the inputs."""
    *parameters, phi, dphi = inputs
    ground, shape, (x, v) = _cells(formula, parameters, (phi, dphi))
    found = _shaped(rounds.orbits(ground, x, v), shape)
    return found._replace(orbit_energy=found.orbit_energy + _constants(formula, parameters))


def angles(formula: Formula, *inputs: npt.ArrayLike) -> AnglesWithErrors:
    """Angle variables of states (phi, dphi), the last of the inputs."""
    *parameters, phi, dphi = inputs
    ground, shape, (x, v) = _cells(formula, parameters, (phi, dphi))
    found = find_angles(ground, x, v)
    return AnglesWithErrors._make(array.reshape(shape) for array in found)


def state_of(formula: Formula, *inputs: npt.ArrayLike) -> StateWithErrors:
    """States by action, angle variable and code of the family, the last of the inputs."""
    *parameters, action, angle, family = inputs
    ground, shape, states = _cells(formula, parameters, (action, angle, family))
    return StateWithErrors._make(x.reshape(shape) for x in states_of_action(ground, *states))


def orbits_at_energy(formula: Formula, *inputs: npt.ArrayLike, center: int | None = None) -> Orbits:
    """Orbits of an energy, the last of the inputs, round a center: its number, or the lowest."""
    *parameters, level = inputs
    base = _constants(formula, parameters)
    ground, shape, (h, still) = _cells(formula, parameters, (level, base))
    points = ground.points
    usable = points.kind == EquilibriumKind.CENTER
    column, there = _pick(points.energy, usable, center)
    states = states_at_energy(ground, h - still, column, there, np.abs(h) + np.abs(still))
    found = _shaped(rounds.orbits_of(ground, states, np.sqrt(2.0 * states.kinetic)), shape)
    return found._replace(orbit_energy=found.orbit_energy + base)


def states_at_energy(
    ground: Ground, h: Array, column: Ints, there: Any, size: Array | float = 0.0
) -> rounds.States:
    """States of an energy at a center, by its column; `size` is that of numbers it is made of."""
    points, rows = ground.points, np.arange(h.size)
    excess = h[:, None] - points.energy
    x = np.where(there, column_of(points.phi, rows, column), np.nan)
    kinetic = np.where(there, column_of(excess, rows, column), np.nan)
    kinetic = np.where(kinetic >= 0.0, kinetic, np.nan)
    size = np.maximum(np.maximum(np.abs(h), size)[:, None], np.abs(points.energy))
    error = np.finfo(float).eps * size + ground.blur
    blur = 4.0 * np.finfo(float).eps * size
    return rounds.States(x, np.zeros(x.shape), kinetic, excess, blur, error)


def orbits_at_gap(
    formula: Formula, *inputs: npt.ArrayLike, saddle: int | None = None, side: int = 1
) -> Orbits:
    """Orbits by their energy above a saddle: its number, or the lowest; side 0 left, 1 right."""
    *parameters, level = inputs
    ground, shape, (gap,) = _cells(formula, parameters, (level,))
    column, there = _pick_saddle(ground, saddle)
    height = column_of(ground.points.energy, np.arange(gap.size), column)
    states = states_at_gap(ground, gap, column, there, side)
    found = rounds.orbits_of(ground, states, np.sqrt(2.0 * states.kinetic))
    energies = np.where(found.orbit_kind >= 0, height + gap, np.nan)
    found = _shaped(found._replace(orbit_energy=energies), shape)
    return found._replace(orbit_energy=found.orbit_energy + _constants(formula, parameters))


def states_at_gap(
    ground: Ground, gap: Array, column: Ints, there: Any, side: npt.ArrayLike
) -> rounds.States:
    """States of an energy above a saddle, by its column, on one side of it: 0 left, 1 right."""
    points = ground.points
    rows = np.arange(gap.size)
    excess = gap[:, None] + ground.above(column)
    # Above the saddle an orbit passes it; below, it stays with the nearest center on that side.
    ways = np.where(np.asarray(side)[..., None] == 0, -1.0, 1.0)
    way = distances(ground, column_of(points.phi, rows, column), ways)
    way = np.where((points.kind == EquilibriumKind.CENTER) & (way > 0.0), way, np.inf)
    center = np.argmin(way, axis=1) if way.shape[1] else column
    inside = gap <= 0.0
    there = there & (~inside | np.isfinite(column_of(way, rows, center)))
    start = np.where(inside, center, column)
    kinetic = np.where(there, column_of(excess, rows, start), np.nan)
    kinetic = np.where(kinetic >= 0.0, kinetic, np.nan)
    x = np.where(there, column_of(points.phi, rows, start), np.nan)
    own = np.arange(excess.shape[1]) == column[:, None]
    error = ground.blur + column_of(ground.blur, rows, column)[:, None]
    error = np.where(own, 0.0, error + np.finfo(float).eps * np.abs(excess))
    return rounds.States(x, np.zeros(x.shape), kinetic, excess, np.zeros(excess.shape), error)


def flow(formula: Formula, *inputs: npt.ArrayLike) -> Motion:
    """States after times, from states (phi0, dphi0); the three last of the inputs."""
    return Motion(*flow_with_errors(formula, *inputs)[:2])


def flow_with_errors(formula: Formula, *inputs: npt.ArrayLike) -> MotionWithErrors:
    """States as of `flow`, with estimates of their errors."""
    *parameters, phi, dphi, t = inputs
    ground, states, (x, v) = _cells(formula, parameters, (phi, dphi))
    shape = np.broadcast_shapes(states, np.shape(t))
    number = np.arange(x.size).reshape(states)
    owner = np.array(np.broadcast_to(number, shape)).reshape(-1)
    time = np.array(np.broadcast_to(np.asarray(t, float), shape)).reshape(-1)
    found = motions.flow(ground, x, v, owner, time)
    return MotionWithErrors(*(a.reshape(shape) for a in found))


def separatrix_motion(
    formula: Formula, *inputs: npt.ArrayLike, saddle: int | None = None, side: int = 1
) -> Motion:
    """Motion on the separatrix of a saddle at times, the last of the inputs."""
    return Motion(*separatrix_motion_with_errors(formula, *inputs, saddle=saddle, side=side)[:2])


def separatrix_motion_with_errors(
    formula: Formula, *inputs: npt.ArrayLike, saddle: int | None = None, side: int = 1
) -> MotionWithErrors:
    """Motion as of `separatrix_motion`, with estimates of its errors."""
    *parameters, t = inputs
    ground, shape = _survey(formula, parameters)
    column, there = _pick_saddle(ground, saddle)
    rows = np.flatnonzero(there)
    whole = np.broadcast_shapes(shape, np.shape(t))
    if not rows.size:
        return MotionWithErrors(*(np.full(whole, np.nan) for _ in range(4)))
    branch = loops.branch_of(ground.take(rows), column[rows], 1.0 if side else -1.0)
    number = np.full(there.size, -1)
    number[rows] = np.arange(rows.size)
    owner = np.array(np.broadcast_to(number.reshape(shape), whole)).reshape(-1)
    time = np.array(np.broadcast_to(np.asarray(t, float), whole)).reshape(-1)
    out = np.full((4, owner.size), np.nan)
    cells = np.flatnonzero(owner >= 0)
    out[:, cells] = motions.separatrix_motion(branch, owner[cells], time[cells])
    return MotionWithErrors(*(array.reshape(whole) for array in out))


# ------------------------------------------------------------------------- cells


def _survey(formula: Formula, parameters: Sequence[npt.ArrayLike]) -> tuple[Ground, Shape]:
    systems, shape = make_systems(reduced(formula), tuple(parameters))
    if systems.size > _KEPT:
        return survey(systems), shape
    return _surveyed(
        systems.formula, systems.size, tuple(p.tobytes() for p in systems.parameters)
    ), shape


@functools.lru_cache(maxsize=32)
def _surveyed(formula: Formula, size: int, parameters: tuple[bytes, ...]) -> Ground:
    """The ground of a few systems, which calls in a row ask for again."""
    arrays = tuple(np.frombuffer(values) for values in parameters)
    return survey(Systems(formula, arrays, size))


def _constants(formula: Formula, parameters: Sequence[npt.ArrayLike], axes: int = 0) -> Any:
    """The constant parts of V, to be added to energies with so many axes of their own behind."""
    base = np.asarray(constant(formula, parameters))
    return base.reshape(base.shape + (1,) * axes) if base.ndim else base


def energies(
    formula: Formula, parameters: Sequence[npt.ArrayLike], phi: Array, energy: Array
) -> Array:
    """Energies at equilibria with the constant parts of V; V as a whole where these cancel."""
    total = np.asarray(energy + _constants(formula, parameters, 1))
    lost = np.nonzero(np.abs(total) < 0.5 * np.abs(energy))
    if lost[0].size:
        shapes = [np.shape(p) + (1,) * bool(np.shape(p)) for p in parameters]
        columns = (np.reshape(p, shape) for p, shape in zip(parameters, shapes, strict=True))
        own = tuple(np.broadcast_to(np.asarray(p, float), phi.shape)[lost] for p in columns)
        fine = values(Systems(formula, own, lost[0].size), phi[lost], 0)
        if fine is not None:
            high, low, _ = fine[0]
            total[lost] = np.where(np.isfinite(high) & np.isfinite(low), high, total[lost])
    return total


def _cells(
    formula: Formula, parameters: list[npt.ArrayLike], states: tuple[npt.ArrayLike, ...]
) -> tuple[Ground, Shape, tuple[Array, ...]]:
    """Systems spread over the cells of the states, one row each, and the states."""
    ground, own = _survey(formula, parameters)
    shape = np.broadcast_shapes(own, *(np.shape(state) for state in states))
    number = np.broadcast_to(np.arange(ground.systems.size).reshape(own), shape)
    flat = tuple(np.array(np.broadcast_to(np.asarray(s, float), shape)).reshape(-1) for s in states)
    return ground.take(np.array(number).reshape(-1)), shape, flat


def _shaped(found: Orbits, shape: Shape) -> Orbits:
    return Orbits._make(array.reshape(shape) for array in found)


def column_of(values: Array, rows: Ints, column: Ints) -> Array:
    """Entries of an array by row, NaN where it has no columns."""
    return values[rows, column] if values.shape[1] else np.full(rows.shape, np.nan)


def _pick(
    height: Array, usable: npt.NDArray[np.bool_], number: int | None
) -> tuple[Ints, npt.NDArray[np.bool_]]:
    """Column of the equilibrium of a number, or of the lowest usable; whether it is there."""
    rows, columns = height.shape
    if not columns or (number is not None and number >= columns):
        return np.zeros(rows, np.intp), np.zeros(rows, dtype=bool)
    if number is None:
        column = np.argmin(np.where(usable, height, np.inf), axis=1)
    else:
        column = np.full(rows, number)
    return column, usable[np.arange(rows), column]


def _pick_saddle(ground: Ground, number: int | None) -> tuple[Ints, npt.NDArray[np.bool_]]:
    """Column of the saddle of a number among the saddles, or of the lowest."""
    usable = np.zeros(ground.points.phi.shape, dtype=bool)
    usable[loops.saddles_of(ground)] = True
    if number is None:
        return _pick(ground.points.energy, usable, None)
    nth = usable & (np.cumsum(usable, axis=1) == number + 1)
    if not nth.shape[1]:
        return np.zeros(len(nth), np.intp), np.zeros(len(nth), dtype=bool)
    return np.argmax(nth, axis=1), nth.any(axis=1)
