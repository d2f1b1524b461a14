"""What holds of machines at the momenta that they keep: parameters and states in, arrays out.

The namesakes of `phasekit.phase.numerical.functions`, with the law first. By arc length, with
``ds = sqrt(M) dphi``, each machine moves in a potential, and what is known of that holds.
"""

from __future__ import annotations

import functools
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any, TypeVar

import numpy as np
import numpy.typing as npt

from phasekit.arrays import Array, Ints
from phasekit.errors import EquilibriumKind, Loop, ParameterError, Topology
from phasekit.laws.ladder import Routhians
from phasekit.phase.exact.asymptotics import NearCenter
from phasekit.phase.numerical import functions
from phasekit.phase.numerical import motion as motions
from phasekit.phase.numerical import orbits as rounds
from phasekit.phase.numerical.angles import AnglesWithErrors
from phasekit.phase.numerical.angles import angles as find_angles
from phasekit.phase.numerical.arc_length import ArcLength
from phasekit.phase.numerical.asymptotics import oscillations
from phasekit.phase.numerical.differences import Ground
from phasekit.phase.numerical.families import StateWithErrors, states_of_action
from phasekit.phase.numerical.motion import MotionWithErrors
from phasekit.phase.numerical.orbits import Orbits
from phasekit.phase.numerical.separatrices import Separatrices, branch_of, saddles_of
from phasekit.phase.numerical.separatrices import separatrices as find_separatrices

Result = TypeVar("Result", bound=tuple[Any, ...])

#: What stands where there is nothing, in place of NaN or 0.
_EMPTY = {"loop": Loop.ABSENT, "topology": Topology.NOT_COMPUTED}


#: The separatrices of no machine.
NOTHING = Separatrices._make(
    (np.int8(Topology.NOT_COMPUTED), np.bool_(False), *np.full((3, 0), np.nan),
     np.empty(0, np.int8), np.empty(0), *np.full((3, 0, 2), np.nan), np.empty(0),
     np.empty((0, 2)))
)  # fmt: skip


@dataclass(frozen=True, eq=False)
class Along:
    """One machine at its momentum, along arc length.

    Attributes
    ----------
    path : ArcLength
        The way from the angle to the arc length and back.
    ground : Ground
        Its equilibria along it.
    columns, saddles : ndarray
        Places there of the equilibria and of the saddles, in the order of their angles.
    """

    path: ArcLength
    ground: Ground
    columns: Ints
    saddles: Ints

    @functools.cached_property
    def separatrices(self) -> Separatrices:
        """Its separatrices in terms of the angle, the saddles on the first axis."""
        found, place = find_separatrices(self.ground), self.path.place
        fields = {name: field[0] for name, field in found._asdict().items()}
        phi = fields["saddle_phi"]
        turn = self.path.law.period
        fields["saddle_phi"] = own = wrapped(place(phi), turn)
        reach = place(phi[:, None] + fields["turning_offset"]) - place(phi)[:, None]
        fields["turning_offset"] = np.where(
            np.isfinite(fields["turning_offset"]), reach, fields["turning_offset"]
        )
        back = fields["turning_phi"]
        fields["turning_phi"] = np.where(np.isfinite(back), wrapped(place(back), turn), back)
        order = np.argsort(own)
        return Separatrices(*(x[order] if np.ndim(x) else x for x in fields.values()))

    def rows(self, count: int) -> Ground:
        """Its ground, once for each of so many states."""
        return self.ground.take(np.zeros(count, np.intp))

    def codes(self, family: Any, back: bool = False) -> Any:
        """Codes of families by the angle as those along arc length, or back."""
        code = np.asarray(family)
        given = np.where(np.isfinite(code), code, 0).astype(np.int64)
        moved = np.zeros(given.shape, np.int64)
        for number, column in enumerate(self.columns):
            into, out = (number, column) if back else (column, number)
            moved |= (given >> out & 1) << into
        return np.where(given > 0, moved, code).astype(code.dtype)


@functools.lru_cache(maxsize=256)
def along(law: Routhians, *constants: float) -> Along:
    """The system of some constants."""
    path = ArcLength.from_law(law.alone(constants))
    ground = path.ground()
    place = wrapped(path.place(ground.points.phi[0]), path.law.period)
    columns = np.argsort(place)
    saddles = saddles_of(ground)[1]
    return Along(path, ground, columns, saddles[np.argsort(place[saddles])])


def wrapped(phi: Array, turn: float) -> Array:
    """Coordinates in (-turn/2, turn/2]."""
    return np.asarray(0.5 * turn - np.mod(0.5 * turn - phi, turn))


def followed(law: Routhians, column: Array, alone: bool) -> Along | None:
    """The system of some constants; None of an invalid one of many."""
    if not np.isfinite(column).all():
        return None
    try:
        return along(law, *map(float, column))
    except ParameterError:
        if alone:
            raise
        return None


@dataclass(frozen=True)
class Cells:
    """Machines, and of which of them each of some states is."""

    machines: list[Along | None]
    number: Ints
    states: tuple[Array, ...]
    shape: tuple[int, ...]

    @classmethod
    def from_inputs(cls, law: Routhians, inputs: Any, states: Any = ()) -> Cells:
        """Lay out parameters and states that broadcast."""
        values = law.values(*inputs)
        constants = law.constants_of(values)
        own = np.broadcast_shapes(*(np.shape(x) for x in values.values()))
        columns = np.stack(
            [np.array(np.broadcast_to(constants[n], own), float).reshape(-1)
             for n in law.constants] or [np.zeros(1)]
        )  # fmt: skip
        systems, which = np.unique(columns, axis=1, return_inverse=True)
        found = [followed(law, column, systems.shape[1] == 1) for column in systems.T]
        shape = np.broadcast_shapes(own, *map(np.shape, states))
        number = np.broadcast_to(which.reshape(own), shape)
        flat = (np.array(np.broadcast_to(x, shape), float).reshape(-1) for x in states)
        return cls(found, np.array(number).reshape(-1), tuple(flat), shape)

    def each(self) -> Iterator[tuple[Along, Ints, tuple[Array, ...]]]:
        """Each machine with the places and values of its states."""
        for k, machine in enumerate(self.machines):
            rows = np.flatnonzero(self.number == k)
            if machine is not None and rows.size:
                yield machine, rows, tuple(x[rows] for x in self.states)

    def gathered(self, parts: list[tuple[Ints, Result]], kind: type[Result]) -> Result:
        """Results of some states each, of the same fields, as those of all."""
        names: tuple[str, ...] = kind._fields  # type: ignore[attr-defined]
        fields = []
        for i, name in enumerate(names):
            types = [np.asarray(part[i]).dtype for _, part in parts]
            dtype = types[0] if types else np.dtype(float)
            empty: Any = _EMPTY.get(name, np.nan if dtype.kind == "f" else 0)
            out = np.full(self.number.size, empty, dtype)
            for rows, part in parts:
                out[rows] = part[i]
            fields.append(out.reshape(self.shape))
        return kind(*fields)


def equilibria(law: Routhians, *parameters: npt.ArrayLike) -> Any:
    """All equilibria, in the order of their coordinates."""
    return law.resting(law.values(*parameters))


def separatrices(law: Routhians, *parameters: npt.ArrayLike) -> Separatrices:
    """Separatrices, the saddles in the order of their angles."""
    cells = Cells.from_inputs(law, parameters)
    each = [NOTHING if one is None else one.separatrices for one in cells.machines]
    width = max((len(one.loop) for one in each), default=0)
    fields = []
    for name in Separatrices._fields:
        column = np.stack([widened(name, getattr(one, name), width) for one in each])
        fields.append(column[cells.number].reshape(cells.shape + column.shape[1:]))
    return Separatrices(*fields)


def widened(name: str, values: Any, width: int) -> Any:
    """Values of saddles on the first axis, and nothing where others have more; one value as it is.

    Examples
    --------
    >>> widened("loop", np.array([2], np.int8), 3).tolist(), widened("topology", np.int8(1), 3)
    ([2, 0, 0], np.int8(1))
    """
    if not np.ndim(values):
        return values
    empty: Any = _EMPTY.get(name, np.nan if values.dtype.kind == "f" else 0)
    more = [(0, width - len(values)), *((0, 0) for _ in values.shape[1:])]
    return np.pad(values, more, constant_values=empty)


def orbits(law: Routhians, *inputs: npt.ArrayLike) -> Orbits:
    """Orbits through states (phi0, dphi0), the last of the inputs."""
    cells, parts = Cells.from_inputs(law, inputs[:-2], inputs[-2:]), list[tuple[Ints, Orbits]]()
    for one, rows, (phi, dphi) in cells.each():
        found = rounds.orbits(one.rows(rows.size), one.path.length(phi), dphi * one.path.scale(phi))
        parts.append((rows, one.path.by_coordinate(found)))
    return cells.gathered(parts, Orbits)


def orbits_at_energy(law: Routhians, *inputs: npt.ArrayLike, center: int | None = None) -> Orbits:
    """Orbits of an energy, the last of the inputs, round a center: its number, or the lowest."""
    cells, parts = Cells.from_inputs(law, inputs[:-1], inputs[-1:]), list[tuple[Ints, Orbits]]()
    for one, rows, (level,) in cells.each():
        column = _center(one, center)
        if column is None:
            continue
        ground, there = one.rows(rows.size), np.ones(rows.size, bool)
        states = functions.states_at_energy(ground, level, np.full(rows.size, column), there)
        found = rounds.orbits_of(ground, states, np.sqrt(2.0 * states.kinetic))
        parts.append((rows, one.path.by_coordinate(found)))
    return cells.gathered(parts, Orbits)


def orbits_at_gap(
    law: Routhians, *inputs: npt.ArrayLike, saddle: int | None = None, side: int = 1
) -> Orbits:
    """Orbits by their energy above a saddle: its number, or the lowest; side 0 left, 1 right."""
    cells, parts = Cells.from_inputs(law, inputs[:-1], inputs[-1:]), list[tuple[Ints, Orbits]]()
    for one, rows, (gap,) in cells.each():
        column = _saddle(one, saddle)
        if column is None:
            continue
        ground, there = one.rows(rows.size), np.ones(rows.size, bool)
        columns = np.full(rows.size, column)
        states = functions.states_at_gap(ground, gap, columns, there, side)
        found = rounds.orbits_of(ground, states, np.sqrt(2.0 * states.kinetic))
        height = ground.points.energy[:, column] + gap
        found = found._replace(orbit_energy=np.where(found.orbit_kind >= 0, height, np.nan))
        parts.append((rows, one.path.by_coordinate(found)))
    return cells.gathered(parts, Orbits)


def near_center(law: Routhians, *inputs: npt.ArrayLike) -> NearCenter:
    """Period and frequency at an energy above each center, the last of the inputs."""
    cells = Cells.from_inputs(law, inputs[:-1], inputs[-1:])
    width = max((len(one.columns) for one in cells.machines if one is not None), default=0)
    found = np.full((2, cells.number.size, width), np.nan)
    for one, rows, (energy,) in cells.each():
        w2, third, fourth = (x[one.columns] for x in one.path.bends_of_centers(one.ground))
        found[:, rows, : one.columns.size] = oscillations(w2, third, fourth, energy[:, None])
    return NearCenter(*found.reshape(2, *cells.shape, width))


def angles(law: Routhians, *inputs: npt.ArrayLike) -> AnglesWithErrors:
    """Angle variables of states (phi, dphi), the last of the inputs."""
    cells, parts = Cells.from_inputs(law, inputs[:-2], inputs[-2:]), list[tuple[Ints, Any]]()
    for one, rows, (phi, dphi) in cells.each():
        found = find_angles(one.rows(rows.size), one.path.length(phi), dphi * one.path.scale(phi))
        parts.append((rows, found._replace(orbit_family=one.codes(found.orbit_family, back=True))))
    result: AnglesWithErrors = cells.gathered(parts, AnglesWithErrors)
    return result


def state_of(law: Routhians, *inputs: npt.ArrayLike) -> StateWithErrors:
    """States by action, angle variable and code of the family, the last of the inputs."""
    cells, parts = Cells.from_inputs(law, inputs[:-3], inputs[-3:]), list[tuple[Ints, Any]]()
    for one, rows, (action, angle, family) in cells.each():
        s, speed, off, blur = states_of_action(
            one.rows(rows.size), action, angle, one.codes(family)
        )
        parts.append((rows, StateWithErrors(*_moved(one, s, speed, off, blur))))
    result: StateWithErrors = cells.gathered(parts, StateWithErrors)
    return result


def separatrix_motion_with_errors(
    law: Routhians, *inputs: npt.ArrayLike, saddle: int | None = None, side: int = 1
) -> MotionWithErrors:
    """Motion on the separatrix of a saddle at times, the last of the inputs."""
    cells, parts = Cells.from_inputs(law, inputs[:-1], inputs[-1:]), list[tuple[Ints, Any]]()
    for one, rows, (time,) in cells.each():
        column = _saddle(one, saddle)
        if column is None:
            continue
        branch = branch_of(one.rows(1), np.array([column]), 1.0 if side else -1.0)
        found = motions.separatrix_motion(branch, np.zeros(rows.size, np.intp), time)
        parts.append((rows, MotionWithErrors(*_moved(one, *found))))
    result: MotionWithErrors = cells.gathered(parts, MotionWithErrors)
    return result


# ------------------------------------------------------------------------- the way back


def _moved(one: Along, s: Array, speed: Array, off: Array, blur: Array) -> tuple[Array, ...]:
    """States along arc length, and their errors, as angles and angular velocities.

    An error of the place changes the inertia by which the speed is divided as well.
    """
    phi = one.path.place(s)
    inertia, change = one.path.law.inertia(phi)
    rate = np.sqrt(inertia)
    dphi = speed / rate
    with np.errstate(all="ignore"):
        away = one.path.error(phi, off)
        blur = blur / rate + np.abs(0.5 * change / inertia * dphi) * away
    return phi, dphi, away, blur


def _center(one: Along, number: int | None) -> int | None:
    """Place of the center of a number, or of the lowest."""
    points = one.ground.points
    usable = points.kind[0] == EquilibriumKind.CENTER
    if number is not None:
        here = number < one.columns.size and usable[one.columns[number]]
        return int(one.columns[number]) if here else None
    return int(np.argmin(np.where(usable, points.energy[0], np.inf))) if usable.any() else None


def _saddle(one: Along, number: int | None) -> int | None:
    """Place of the saddle of a number, or of the lowest."""
    if number is not None:
        return int(one.saddles[number]) if number < one.saddles.size else None
    if not one.saddles.size:
        return None
    return int(one.saddles[np.argmin(one.ground.points.energy[0][one.saddles])])
