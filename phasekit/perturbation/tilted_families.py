"""Families of librations under a constant torque N: from each center up to its lower barrier.

Seen from a center the saddles on both sides differ in energy, by 2 pi N where they are the same
one. Librations round both wells are those above a saddle whose separatrix closes on both sides;
what rotates gains energy each turn and has no period.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from phasekit.errors import EquilibriumKind, Loop
from phasekit.laws.perturbed import PerturbedTrigonometric
from phasekit.perturbation.tilted import tilted_cells
from phasekit.perturbation.tilted_energy import tilt
from phasekit.perturbation.tilted_orbits import TURN, orbits_at_gap

Array = npt.NDArray[np.float64]
Index = npt.NDArray[np.intp]

#: Energies approach a separatrix as this power of the level: periods grow with their logarithm.
CLUSTER = 4
FIELDS = ("period", "frequency", "action", "period_error", "action_error")


class TiltedFamilies(NamedTuple):
    """Orbits at levels; the last axis is the family (lower_well, upper_well, outer, rotation)."""

    energy_level: Array
    period: Array
    frequency: Array
    action: Array
    period_error: Array
    action_error: Array


class Wall(NamedTuple):
    """The saddle that bounds orbits: its label, the side on which they lie, its energy there."""

    saddle: Index
    side: Index
    energy: Array


def families(law: PerturbedTrigonometric, *inputs: npt.ArrayLike) -> TiltedFamilies:
    """Librations of cells, all of them under a torque, at levels, the last of the inputs."""
    shape = np.broadcast_shapes(*map(np.shape, inputs))
    *parameters, level = (np.array(np.broadcast_to(x, shape), float).reshape(-1) for x in inputs)
    own, cell = np.unique(np.stack(parameters), axis=1, return_inverse=True)
    A, B, C, N = (np.array(np.broadcast_to(x, own.shape[1:])) for x in tilt(law, *own))
    points, loops = tilted_cells(A, B, C, N)
    found = np.full((len(FIELDS) + 1, level.size, 4), np.nan)

    def put(family: int, rows: Any, wall: Wall, gap: Array, base: Array) -> None:
        """Orbits below, or above, the saddles that bound them, in some rows."""
        at = cell.reshape(-1)
        for saddle in (0, 1):
            for side in (0, 1):
                chosen = rows & (wall.saddle == saddle)[at] & (wall.side == side)[at]
                some = np.flatnonzero(chosen & np.isfinite(gap))
                if some.size:
                    states = [p[some] for p in parameters]
                    orbit = orbits_at_gap(law, *states, gap[some], saddle=saddle, side=side)
                    found[0, some, family] = base[some] + gap[some]
                    found[1:, some, family] = [getattr(orbit, name) for name in FIELDS]

    at, whole = cell.reshape(-1), np.ones(level.size, bool)
    up, down = level**CLUSTER, (1.0 - level) ** CLUSTER
    for family, center in enumerate((0, 2)):
        there = points.kind[:, center] == EquilibriumKind.CENTER
        bottom = np.where(there, points.energy[:, center], np.nan)
        wall = lower_wall(loops, np.where(there, points.phi[:, center], np.nan), N)
        put(family, whole, wall, -(wall.energy - bottom)[at] * down, wall.energy[at])
    eight = (loops.loop == Loop.LOBES).any(axis=1)
    middle = np.argmax(loops.loop == Loop.LOBES, axis=1)
    cells = np.arange(len(N))
    phi, energy = (
        np.where(eight, x[cells, middle], np.nan) for x in (loops.saddle_phi, loops.saddle_energy)
    )
    wall = lower_wall(loops, phi, N)
    inner = Wall(middle, np.ones_like(middle), energy)
    step, half = (wall.energy - energy)[at], 2.0 ** (CLUSTER - 1)
    put(2, level < 0.5, inner, step * half * up, energy[at])
    put(2, level >= 0.5, wall, -step * half * down, wall.energy[at])
    return TiltedFamilies(*(x.reshape(*shape, 4) for x in found))


def lower_wall(loops: Any, phi: Array, N: Array) -> Wall:
    """The lower one of the saddles next to some angles on both sides, that of an angle aside."""
    place, energy = loops.saddle_phi, loops.saddle_energy
    walls = []
    for way in (-1.0, 1.0):
        far = np.mod(way * (place - phi[:, None]), TURN)
        far = np.where(far > 0.0, far, TURN)
        far = np.where(np.isnan(far), np.inf, far)
        saddle = np.argmin(far, axis=1)
        rows = np.arange(len(saddle))
        with np.errstate(all="ignore"):
            moved = phi + way * far[rows, saddle] - place[rows, saddle]
            turned = TURN * np.round(moved / TURN)
        walls.append((saddle, energy[rows, saddle] - N * turned))
    (left, below), (right, above) = walls
    on_left = below < above
    return Wall(
        np.where(on_left, left, right),
        np.where(on_left, 1, 0),  # what lies right of the left wall
        np.where(on_left, below, above),
    )
