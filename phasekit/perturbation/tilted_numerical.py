"""Orbits and separatrices of any potential under a constant torque N: those of V - N x.

On a line that is another potential. On a circle what runs on gains N times the circle each turn.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt

from phasekit.errors import EquilibriumKind, Loop, Topology
from phasekit.laws.perturbed import TiltedConservative
from phasekit.perturbation.tilted import Tilted
from phasekit.perturbation.tilted_line import Cells, Index, Slope
from phasekit.perturbation.tilted_orbits import (
    SPAN,
    TiltedOrbits,
    enter,
    enter_level,
    enter_motion,
    home,
    room,
)
from phasekit.perturbation.tilted_potential import equilibria
from phasekit.perturbation.tilted_potential import most as most_equilibria
from phasekit.phase.numerical import functions
from phasekit.phase.numerical import orbits as rounds
from phasekit.phase.numerical.angles import AnglesWithErrors, angles
from phasekit.phase.numerical.functions import states_at_energy, states_at_gap
from phasekit.phase.numerical.motion import MotionWithErrors
from phasekit.phase.numerical.separatrices import separatrices as find_separatrices

Array = npt.NDArray[np.float64]


def orbits(law: TiltedConservative, *inputs: npt.ArrayLike) -> TiltedOrbits:
    """Orbits through states (phi0, dphi0), the last of the inputs."""
    cells = Cells.of(law, inputs[:-2], inputs[-2:])
    x, v = cells.states
    out = room(x.size)
    flat, own = cells.level()
    if flat.size:
        enter_level(out, flat, functions.orbits(cells.formula, *own, x[flat], v[flat]))
    for slope, some in cells.parts():
        near, turns = home(x[some], cells.period) if np.isfinite(cells.period) else (x[some], 0.0)
        states = rounds.states_of(slope.ground, near, v[some])
        if np.isfinite(cells.period):
            states = states._replace(turns=np.broadcast_to(turns, near.shape))
        found = slope.orbits(states, v[some])
        level = slope.ground.systems.potential(x[some]) + cells.constant[cells.number[some]]
        whole = 0.5 * v[some] ** 2 + level
        _enter(cells, out, some, found, whole)
    return TiltedOrbits._make(cells.shaped(out))


def orbits_at_energy(
    law: TiltedConservative, *inputs: npt.ArrayLike, center: int | None = None
) -> TiltedOrbits:
    """Orbits of an energy, the last of the inputs, round a center: its number, or the lowest."""
    cells = Cells.of(law, inputs[:-1], inputs[-1:])
    (h,) = cells.states
    out = room(h.size)
    flat, own = cells.level()
    if flat.size:
        at_level = functions.orbits_at_energy(cells.formula, *own, h[flat], center=center)
        enter_level(out, flat, at_level)
    for slope, some in cells.parts():
        usable = slope.ground.points.kind == EquilibriumKind.CENTER
        column, there = slope.column(usable, center)
        base = cells.constant[cells.number[some]]
        size = np.abs(h[some]) + np.abs(base)
        states = states_at_energy(slope.ground, h[some] - base, column, there, size)
        _enter(cells, out, some, slope.orbits(states, np.sqrt(2.0 * states.kinetic)), h[some])
    return TiltedOrbits._make(cells.shaped(out))


def orbits_at_gap(
    law: TiltedConservative,
    *inputs: npt.ArrayLike,
    saddle: int | None = None,
    side: int = 1,
) -> TiltedOrbits:
    """Orbits by their energy above a saddle, the last of the inputs; side 0 left, 1 right."""
    cells = Cells.of(law, inputs[:-1], inputs[-1:])
    (gap,) = cells.states
    out = room(gap.size)
    flat, own = cells.level()
    if flat.size:
        at_level = functions.orbits_at_gap(cells.formula, *own, gap[flat], saddle=saddle, side=side)
        enter_level(out, flat, at_level)
    for slope, some in cells.parts():
        column, there = slope.saddle(saddle)
        points, rows = slope.ground.points, np.arange(some.size)
        if not points.phi.shape[1]:
            continue
        states = states_at_gap(slope.ground, gap[some], column, there, side)
        found = slope.orbits(states, np.sqrt(2.0 * states.kinetic))
        base = points.energy[rows, column] + cells.constant[cells.number[some]]
        _enter(cells, out, some, found, base + gap[some])
    return TiltedOrbits._make(cells.shaped(out))


def angle_variables(law: TiltedConservative, *inputs: npt.ArrayLike) -> AnglesWithErrors:
    """Angle variables of states (phi, dphi), the last of the inputs; NaN where they run."""
    cells = Cells.of(law, inputs[:-2], inputs[-2:])
    x, v = cells.states
    out = [np.zeros(x.size, np.int8), *(np.full(x.size, np.nan) for _ in range(3))]
    flat, own = cells.level()
    parts: list[Any] = [(slope, some) for slope, some in cells.parts()]
    if flat.size:
        parts.append((None, flat))
    for slope, some in parts:
        if slope is None:
            found = functions.angles(cells.formula, *own, x[some], v[some])
        else:
            near = home(x[some], cells.period)[0] if np.isfinite(cells.period) else x[some]
            found = angles(slope.ground, near, v[some])
        out[1][some], out[3][some] = found.angle, found.angle_error
    return AnglesWithErrors._make(cells.shaped(out))


def separatrix_motion(
    law: TiltedConservative,
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
    flat, own = cells.level()
    if flat.size:
        found = functions.separatrix_motion_with_errors(
            cells.formula, *own, time[flat], saddle=saddle, side=side
        )
        for field, values in zip(out, found, strict=True):
            field[flat] = values
    for slope, some in cells.parts():
        column, there = slope.saddle(saddle)
        enter_motion(out, some, slope.ground, column, there, side, time[some])
    return MotionWithErrors._make(cells.shaped(out))


def separatrices(law: TiltedConservative, *parameters: npt.ArrayLike) -> Tilted:
    """Separatrices of the potential that a constant torque tilts."""
    cells = Cells.of(law, parameters, ())
    parts = []
    flat, own = cells.level()
    if flat.size:
        found = functions.separatrices(cells.formula, *own)
        size = (flat.size,) if own else ()
        level = [np.broadcast_to(x, (flat.size, *x.shape[len(size) :])) for x in found]
        parts.append((flat, level))
    place = Tilted._fields.index("saddle_energy")
    for slope, some in cells.parts():
        fields = _of_turn(slope)
        fields[place] = fields[place] + cells.constant[cells.number[some]][:, None]
        parts.append((some, fields))
    width = max((fields[2].shape[1] for _, fields in parts), default=0)
    out = []
    for i, name in enumerate(Tilted._fields[:-1]):
        first = parts[0][1][i]
        tail = (width, *first.shape[2:]) if first.ndim > 1 else ()
        empty: Any = Loop.ABSENT if name == "loop" else np.nan if tail else 0
        field = np.full((cells.number.size, *tail), empty, first.dtype)
        for some, fields in parts:
            field[(some, slice(fields[i].shape[1])) if tail else some] = fields[i]
        out.append(field)
    turn = cells.period if np.isfinite(cells.period) else np.nan
    out.append(turn * cells.torque[cells.number])
    return Tilted._make(x.reshape(cells.shape + x.shape[1:]) for x in out)


def most(law: TiltedConservative, *parameters: npt.ArrayLike) -> tuple[int, int, Array]:
    """Greatest numbers of equilibria and saddles under the torque, or of saddles without it.

    Melnikov's function belongs to the latter. Besides what is not proved.
    """
    number, saddles, open_ = most_equilibria(law, *parameters)
    kinds = equilibria(law, *parameters).kind
    own = np.isin(kinds, (EquilibriumKind.SADDLE, EquilibriumKind.DEGENERATE)).sum(axis=-1)
    return number, max(saddles, int(own.max(initial=0))), open_


def _of_turn(slope: Slope) -> list[Any]:
    """Separatrices of the saddles of the turn of the states."""
    found = find_separatrices(slope.ground)
    width = found.loop.shape[1]
    number = (found.loop > Loop.ABSENT).sum(axis=1)
    turns = 1 if np.isinf(slope.period) else len(SPAN)
    each = number // turns
    most = int(each.max(initial=0))
    skip = np.where(turns > 1, each, 0)[:, None] + np.arange(most)
    there = np.arange(most) < each[:, None]
    fields: list[Any] = []
    for name, x in found._asdict().items():
        if x.ndim == 1:
            fields.append(x)
            continue
        at = np.minimum(skip, max(width - 1, 0))
        at = at.reshape(at.shape + (1,) * (x.ndim - 2))
        own = np.take_along_axis(x, at, axis=1)
        keep = there.reshape(there.shape + (1,) * (x.ndim - 2))
        fields.append(
            np.where(keep, own, Loop.ABSENT if name == "loop" else np.nan).astype(x.dtype)
        )
    names = list(found._fields)
    loop = fields[names.index("loop")]
    if turns > 1:
        half, place = 0.5 * slope.period, names.index("turning_phi")
        with np.errstate(all="ignore"):
            home_ = half - np.mod(half - fields[place], slope.period)
        fields[place] = np.where(np.isfinite(fields[place]), home_, fields[place])
        topology = np.full(len(loop), Topology.NONE, np.int8)
        for code, meaning in (
            (Loop.UNBOUNDED, Topology.UNBOUNDED),
            (Loop.LOBE, Topology.HOMOCLINIC),
            (Loop.LOBES, Topology.FIGURE_EIGHT),
            (Loop.HETEROCLINIC, Topology.HETEROCLINIC),
        ):
            topology[(loop == code).any(axis=1)] = meaning
        topology[slope.ground.points.n_equilibria < 0] = Topology.NOT_COMPUTED
        fields[names.index("topology")] = topology
        fields[names.index("figure_eight")] = (loop == Loop.LOBES).any(axis=1)
    return fields


def _enter(cells: Cells, out: list[Any], some: Index, found: Any, energy: Array) -> None:
    period = cells.period if np.isfinite(cells.period) else 0.0
    enter(out, some, found, energy, cells.torque[cells.number[some]], period)
