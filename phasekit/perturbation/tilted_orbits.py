"""Orbits under a constant torque: librations, and orbits that run on and gain energy each turn.

The energy ``phi'^2/2 + V(phi) - N phi`` is that of a potential on a line, which falls by 2 pi N a
turn: what holds for any potential holds for it. A libration lies within a turn of its state. What
runs was turned back once, where the potential rises; seen from as many turns before, it lies within
a turn of there as well.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from phasekit.errors import EquilibriumKind, OrbitKind
from phasekit.laws.perturbed import PerturbedTrigonometric
from phasekit.perturbation.tilted_energy import height, tilt
from phasekit.perturbation.torque import equilibria_under
from phasekit.phase.exact import flow as level_motion
from phasekit.phase.exact import orbits as level
from phasekit.phase.exact.potential import curvature, gradient
from phasekit.phase.numerical import motion, separatrices
from phasekit.phase.numerical import orbits as rounds
from phasekit.phase.numerical.angles import AnglesWithErrors, angles
from phasekit.phase.numerical.differences import Ground, survey
from phasekit.phase.numerical.equilibria import Equilibria
from phasekit.phase.numerical.formula import Formula, Shape
from phasekit.phase.numerical.functions import states_at_energy, states_at_gap
from phasekit.phase.numerical.motion import MotionWithErrors
from phasekit.phase.numerical.systems import Systems

Array = npt.NDArray[np.float64]
Index = npt.NDArray[np.intp]

TURN = 2.0 * np.pi
#: Turns over which the potential is laid out: that of the states, and one to either side.
SPAN = (-1, 0, 1)
#: Rounding of the energy, as part of what a turn changes it by, that hides on which turn it is.
HIDDEN = 1e-3
#: States at a time, for memory.
CELLS = 4096

#: The potential on the line; no string of it is ever read.
TILTED = Formula(
    text="-B*cos(phi) + A*cos(phi)**2/2 - C*sin(phi) - N*phi",
    coordinate="phi",
    names=("A", "B", "C", "N"),
    period=None,
    interval=(-1.5 * TURN, 1.5 * TURN),
    shape=Shape.FOURIER,
    expression=None,
    values=height,
    slopes=lambda x, A, B, C, N: gradient(A, B, C, x) - N,
    bends=lambda x, A, B, C, N: np.asarray(curvature(A, B, C, x)),
    _coefficients=None,
)


class TiltedOrbits(NamedTuple):
    """Orbits under a torque; the fields of `phasekit.phase.exact.orbits`, and errors."""

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
    gain_per_turn: Array


@dataclass(frozen=True)
class Cells:
    """States of systems under a torque: systems in a row, and which of them each state is of."""

    A: Array
    B: Array
    C: Array
    N: Array
    number: Index
    states: tuple[Array, ...]
    shape: tuple[int, ...]
    points: Any

    @classmethod
    def of(cls, law: PerturbedTrigonometric, inputs: Any, states: Any) -> Cells:
        """Lay out parameters and states that broadcast."""
        system = tilt(law, *inputs)
        own = np.broadcast_shapes(*map(np.shape, system))
        shape = np.broadcast_shapes(own, *map(np.shape, states))
        rows = [np.array(np.broadcast_to(x, own), float).reshape(-1) for x in system]
        number = np.arange(int(np.prod(own, dtype=int))).reshape(own)
        A, B, C, N = rows
        return cls(
            A,
            B,
            C,
            N,
            np.array(np.broadcast_to(number, shape)).reshape(-1),
            tuple(np.array(np.broadcast_to(x, shape), float).reshape(-1) for x in states),
            shape,
            equilibria_under(A, B, C, N),
        )

    def at(self, cells: Index) -> tuple[Array, Array, Array]:
        """A, B and C of some states."""
        rows = self.number[cells]
        return self.A[rows], self.B[rows], self.C[rows]

    def parts(self) -> tuple[Index, list[tuple[Ground, Index, Index]]]:
        """States without a torque; and the others in parts: ground, states and their systems."""
        tilted = self.N != 0.0
        systems = np.flatnonzero(tilted)
        ground, row = ground_of(self, systems), np.cumsum(tilted) - 1
        cells = np.flatnonzero(tilted[self.number])
        split = [cells[i : i + CELLS] for i in range(0, cells.size, CELLS)]
        parts = [(ground.take(row[self.number[some]]), some, self.number[some]) for some in split]
        return np.flatnonzero(~tilted[self.number]), parts

    def shaped(self, fields: Any) -> list[Any]:
        """Fields in the shape of the states."""
        return [field.reshape(self.shape) for field in fields]


def ground_of(cells: Cells, systems: Index) -> Ground:
    """The potential of some systems with its equilibria, over the span of turns."""
    A, B, C, N = (x[systems] for x in (cells.A, cells.B, cells.C, cells.N))
    points = [field[systems] for field in cells.points]
    count = points[6]
    nothing = np.full((len(N), 2), np.nan)
    proofs = [count.astype(np.int16), count >= 0, nothing, np.zeros(len(N), np.int64)]
    unknown = np.full(points[0].shape, np.nan)
    found = repeated(Equilibria._make([*points[:6], *proofs, unknown]), N)
    return survey(Systems(TILTED, (A, B, C, N), len(N)), found)


def repeated(points: Equilibria, torque: Array, period: float = TURN) -> Equilibria:
    """Equilibria of a circle on the line, over as many turns as `SPAN` has."""
    turns = period * np.array(SPAN, float)[:, None]
    if not points.phi.shape[1]:  # nothing stands: one place, which stays empty
        empty = np.full((len(points.phi), 1), np.nan)
        kinds = np.full(empty.shape, EquilibriumKind.ABSENT, np.int8)
        points = Equilibria._make([empty, kinds, *[empty] * 4, *list(points)[6:-1], empty])
    rows, width = points.phi.shape

    def spread(field: Any, shift: Any = 0.0) -> Any:
        return (field[:, None, :] + shift).reshape(rows, len(SPAN) * width)

    phi = spread(points.phi, turns)
    order = np.argsort(phi, axis=1)
    fields: list[Any] = [phi, spread(points.kind, np.zeros(turns.shape, np.int8))]
    fields.append(spread(points.energy, -torque[:, None, None] * turns))
    others = (points.curvature, points.natural_frequency, points.exponent, points.phi_error)
    fields += [spread(field, np.zeros(turns.shape)) for field in others]
    *listed, error = (np.take_along_axis(field, order, axis=1) for field in fields)
    proofs: list[Any] = list(points)[6:-1]
    return Equilibria._make([*listed, *proofs, error])


def home(phi: Array, period: float = TURN) -> tuple[Array, Array]:
    """Angles in one turn, and what has been taken away."""
    turns = np.where(np.abs(phi) <= 0.5 * period, 0.0, period * np.round(phi / period))
    return phi - turns, turns


def orbits(law: PerturbedTrigonometric, *inputs: npt.ArrayLike) -> TiltedOrbits:
    """Orbits through states (phi0, dphi0), the last of the inputs."""
    cells = Cells.of(law, inputs[:-2], inputs[-2:])
    phi, dphi = cells.states
    out = room(phi.size)
    flat, parts = cells.parts()
    enter_level(out, flat, level.orbits(*cells.at(flat), phi[flat], dphi[flat]))
    for ground, some, system in parts:
        x, turns = home(phi[some])
        v = dphi[some]
        states = rounds.states_of(ground, x, v)._replace(turns=turns)
        energy = 0.5 * v * v + height(phi[some], *(p for p in ground.systems.parameters))
        enter(out, some, followed(ground, states, v, cells.N[system]), energy, cells.N[system])
    return TiltedOrbits._make(cells.shaped(out))


def orbits_at_energy(
    law: PerturbedTrigonometric, *inputs: npt.ArrayLike, center: int | None = None
) -> TiltedOrbits:
    """Orbits of an energy, the last of the inputs, round the lower center (0) or the upper (1)."""
    cells = Cells.of(law, inputs[:-1], inputs[-1:])
    (h,) = cells.states
    out = room(h.size)
    flat, parts = cells.parts()
    enter_level(out, flat, level.orbits_at_energy(*cells.at(flat), h[flat], center))
    for ground, some, system in parts:
        column, there = _column(cells, ground, system, 2 * (center or 0))
        states = states_at_energy(ground, h[some], column, there)
        found = followed(ground, states, np.sqrt(2.0 * states.kinetic), cells.N[system])
        enter(out, some, found, h[some], cells.N[system])
    return TiltedOrbits._make(cells.shaped(out))


def orbits_at_gap(
    law: PerturbedTrigonometric,
    *inputs: npt.ArrayLike,
    saddle: int | None = None,
    side: int = 1,
) -> TiltedOrbits:
    """Orbits by their energy above a saddle, the last of the inputs; side 0 left, 1 right."""
    cells = Cells.of(law, inputs[:-1], inputs[-1:])
    (gap,) = cells.states
    out = room(gap.size)
    flat, parts = cells.parts()
    enter_level(out, flat, level.orbits_at_gap(*cells.at(flat), gap[flat], saddle, side))
    for ground, some, system in parts:
        column, there = _saddle(cells, ground, system, saddle)
        rows = np.arange(some.size)
        base = ground.points.energy[rows, column]
        states = states_at_gap(ground, gap[some], column, there, side)
        found = followed(ground, states, np.sqrt(2.0 * states.kinetic), cells.N[system])
        enter(out, some, found, base + gap[some], cells.N[system])
    return TiltedOrbits._make(cells.shaped(out))


def angle_variables(law: PerturbedTrigonometric, *inputs: npt.ArrayLike) -> AnglesWithErrors:
    """Angle variables of states (phi, dphi), the last of the inputs; NaN where they run."""
    from phasekit.phase.exact.action_angle import orbits_with_angles

    cells = Cells.of(law, inputs[:-2], inputs[-2:])
    phi, dphi = cells.states
    nothing = np.full(phi.size, np.nan)
    angle, error = nothing.copy(), nothing.copy()
    flat, parts = cells.parts()
    if flat.size:
        angle[flat] = orbits_with_angles(*cells.at(flat), phi[flat], dphi[flat])[1].angle
        error[flat] = np.where(np.isnan(angle[flat]), np.nan, 0.0)
    for ground, some, _ in parts:
        found = angles(ground, home(phi[some])[0], dphi[some])
        angle[some], error[some] = found.angle, found.angle_error
    out = [np.zeros(phi.size, np.int8), angle, nothing, error]
    return AnglesWithErrors._make(cells.shaped(out))


def separatrix_motion(
    law: PerturbedTrigonometric,
    *inputs: npt.ArrayLike,
    saddle: int | None = None,
    side: int = 1,
) -> MotionWithErrors:
    """Motion on the separatrix of a saddle at times, the last of the inputs.

    NaN on the side where it runs away, for there it has no turning point from which to count.
    """
    cells = Cells.of(law, inputs[:-1], inputs[-1:])
    (time,) = cells.states
    out = [np.full(time.size, np.nan) for _ in MotionWithErrors._fields]
    flat, parts = cells.parts()
    if flat.size:
        moved = level_motion.separatrix_motion(*cells.at(flat), time[flat], saddle, side)
        out[0][flat], out[1][flat] = moved
        out[2][flat], out[3][flat] = (np.where(np.isnan(x), np.nan, 0.0) for x in moved)
    for ground, some, system in parts:
        column, there = _saddle(cells, ground, system, saddle)
        enter_motion(out, some, ground, column, there, side, time[some])
    return MotionWithErrors._make(cells.shaped(out))


# ------------------------------------------------------------------------- parts


def followed(
    ground: Ground, states: rounds.States, v: Array, N: Array, period: float = TURN
) -> Any:
    """Orbits of states; what runs is followed back to where it was turned."""
    side = -np.sign(N)
    turn = period * np.abs(N)
    way = side[:, None] * (ground.points.phi - states.x[:, None])
    ahead = (way > 0.0) & (way <= period)
    with np.errstate(all="ignore"):
        rise = np.where(ahead, states.kinetic[:, None] - states.excess, -np.inf)
        highest = np.maximum(np.max(rise, axis=1), turn)
        back = np.maximum(np.ceil((states.kinetic - highest) / turn), 0.0)
        back = np.where(np.isfinite(back), back, 0.0)
        kinetic = np.clip(states.kinetic - turn * back, 0.0, highest)
        kinetic = np.where(back > 0.0, kinetic, states.kinetic)
        lost = np.where(back > 0.0, 4.0 * 2.0**-52 * states.kinetic, 0.0)[:, None]
        blur = states.blur + lost
        moved = states._replace(
            turns=states.turns + side * period * back,
            kinetic=kinetic,
            excess=states.excess - (states.kinetic - kinetic)[:, None],
            blur=blur,
            error=states.error + lost,
        )
        found = rounds.orbits_of(ground, moved, v)
    kind = found.orbit_kind
    # Whether it comes to rest at a saddle of some turn is hidden by rounding where turns are.
    hidden = (back > 0.0) & (np.fmax.reduce(blur, axis=1) > HIDDEN * turn)
    runs = (kind == OrbitKind.UNBOUNDED) | ((back > 0.0) & (kind == OrbitKind.LIBRATION)) | hidden
    unknown = {
        name: np.where(runs, np.nan, getattr(found, name))
        for name in ("period", "frequency", "action", "period_error", "action_error")
    }
    low = np.where(runs & (N < 0.0), -np.inf, found.phi_min)
    high = np.where(runs & (N > 0.0), np.inf, found.phi_max)
    kind = np.where(runs, OrbitKind.RUNNING, kind).astype(np.int8)
    return found._replace(
        orbit_kind=kind, phi_min=low, phi_max=high, amplitude=0.5 * (high - low), **unknown
    )


def room(size: int) -> list[Any]:
    """Fields of orbits, to be filled."""
    return [
        np.full(size, OrbitKind.NOT_COMPUTED, np.int8),
        *(np.full(size, np.nan) for _ in TiltedOrbits._fields[1:]),
    ]


def enter_level(out: list[Any], cells: Index, found: Any) -> None:
    """Write down orbits without a torque, with their errors if they are not exact."""
    errors = (np.where(np.isnan(x), np.nan, 0.0) for x in (found.period, found.action))
    gain = np.where(found.orbit_kind >= 0, 0.0, np.nan)
    own = found if hasattr(found, "period_error") else (*found, *errors)
    for field, values in zip(out, (*own, gain), strict=True):
        field[cells] = values


def enter(
    out: list[Any], cells: Index, found: Any, energy: Array, N: Array, period: float = TURN
) -> None:
    """Write down orbits under a torque."""
    gain = np.where(found.orbit_kind == OrbitKind.RUNNING, period * np.abs(N), 0.0)
    gain = np.where(found.orbit_kind >= 0, gain, np.nan)
    values = (found.orbit_kind, np.where(found.orbit_kind >= 0, energy, np.nan), *found[2:], gain)
    for field, one in zip(out, values, strict=True):
        field[cells] = one


def enter_motion(
    out: list[Any], cells: Index, ground: Ground, column: Index, there: Any, side: int, time: Array
) -> None:
    """Write down the motions on the separatrices of saddles where these are there."""
    rows = np.flatnonzero(there)
    if rows.size:
        branch = separatrices.branch_of(ground.take(rows), column[rows], 1.0 if side else -1.0)
        found = motion.separatrix_motion(branch, np.arange(rows.size), time[rows])
        for field, values in zip(out, found, strict=True):
            field[cells[rows]] = values


def _column(cells: Cells, ground: Ground, system: Index, label: int) -> tuple[Index, Any]:
    """Column of the equilibrium of a label in the span, and whether it is there."""
    points = cells.points
    wanted = EquilibriumKind.SADDLE if label % 2 else EquilibriumKind.CENTER
    at = np.where(points.kind[:, label] == wanted, points.phi[:, label], np.nan)[system]
    same = ground.points.phi == at[:, None]
    return np.argmax(same, axis=1), same.any(axis=1)


def _saddle(cells: Cells, ground: Ground, system: Index, saddle: int | None) -> tuple[Index, Any]:
    """Column of a saddle: of the lower one where there is one, else of the upper, by default."""
    if saddle is not None:
        return _column(cells, ground, system, 2 * saddle + 1)
    lower, there = _column(cells, ground, system, 1)
    upper, other = _column(cells, ground, system, 3)
    return np.where(there, lower, upper), there | other
