"""Families of orbits, from each center up to the separatrix that bounds it, by names.

Under a torque the saddles on both sides of a center differ in energy, by what V falls by in a turn
where they are the same one. Librations round both wells are those above a saddle whose separatrix
closes on both sides; what rotates gains energy each turn and has no period.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from phasekit.arrays import Array, Ints
from phasekit.errors import EquilibriumKind, Loop, Topology
from phasekit.laws.perturbed import PerturbedLaw
from phasekit.phase.exact.orbits import energy_rises, orbits_at_gap
from phasekit.phase.exact.phase_space import phase_space
from phasekit.phase.numerical.functions import states_at_gap
from phasekit.phase.numerical.torqued import CELLS, lines_of
from phasekit.phase.numerical.turns import followed

TURN = 2.0 * np.pi
#: Energies approach a separatrix as this power of the level: periods grow with their logarithm.
CLUSTER = 4


class Families(NamedTuple):
    """Orbits at levels; the last axis is the family (lower_well, upper_well, outer, rotation)."""

    energy_level: Array
    period: Array
    frequency: Array
    action: Array


class TorquedFamilies(NamedTuple):
    """The same with errors, which quadratures have."""

    energy_level: Array
    period: Array
    frequency: Array
    action: Array
    period_error: Array
    action_error: Array


class Wall(NamedTuple):
    """The saddle that bounds orbits: its label, the side on which they lie, its energy there."""

    saddle: Ints
    side: Ints
    energy: Array


def families(energy_max: float | None, A: Array, B: Array, C: Array, level: Array) -> Families:
    """Orbits at levels between 0 and 1 of the families lower_well, upper_well, outer, rotation."""
    points, loops = phase_space(A, B, C)
    _, low, _, high = np.moveaxis(points.energy, -1, 0)  # center, saddle, center, saddle
    *rise, step, whole = np.moveaxis(energy_rises(A, B, C), -1, 0)
    above = whole if energy_max is None else energy_max - high
    up, down = level**CLUSTER, (1.0 - level) ** CLUSTER
    near, far = 2.0 ** (CLUSTER - 1) * up, 2.0 ** (CLUSTER - 1) * down
    under = level < 0.5  # of an outer orbit: nearer to the lower saddle
    gaps = (-rise[0] * down, -rise[1] * down, step * np.where(under, near, -far), above * up)
    eight = loops.topology == Topology.FIGURE_EIGHT
    present = (rise[0] > 0.0, rise[1] > 0.0, eight & (step > 0.0), above > 0.0)
    first = np.where(points.kind[..., 1] == EquilibriumKind.SADDLE, 0, 1)  # where the wells end
    saddles = (first, first, np.where(under, 0, 1), 1)
    # To the right of the lower saddle: the center that comes before the upper saddle.
    way = (points.phi - points.phi[..., 1:2]) % (2.0 * np.pi)
    right = np.where(way[..., 0] < way[..., 3], 1, 0)
    sides = (right, 1 - right, 1, 1)
    gap, saddle, side, there = (
        np.stack(np.broadcast_arrays(*parts, level), axis=-1)[..., :-1]
        for parts in (gaps, saddles, sides, present)
    )
    gap = np.where(there, gap, np.nan)
    a, b, c = (np.asarray(x)[..., None] for x in (A, B, C))
    found = orbits_at_gap(a, b, c, gap, saddle.astype(int), side.astype(int))
    base = np.where(saddle == 1, high[..., None], low[..., None])
    absent = np.isnan(found.period)
    return Families(
        np.where(absent, np.nan, base + gap), found.period, found.frequency, found.action
    )


def families_under_torque(
    energy_max: float | None, law: PerturbedLaw, *inputs: Array
) -> TorquedFamilies:
    """The same families where a torque may act; what rotates there has no period."""
    *parameters, level = np.broadcast_arrays(*inputs)
    values = law.values(*parameters)
    A, B, C, torque, level = np.broadcast_arrays(*law.coefficients(values), values["torque"], level)
    still = families(energy_max, A, B, C, level)
    errors = (np.where(np.isnan(x), np.nan, 0.0) for x in (still.period, still.action))
    fields = [np.array(x) for x in (*still, *errors)]
    pushed = torque != 0.0
    if pushed.any():
        found = _pushed([x[pushed] for x in (A, B, C, torque)], level[pushed])
        for field, some in zip(fields, found, strict=True):
            field[pushed] = some
    return TorquedFamilies(*fields)


def _pushed(cells: list[Array], level: Array) -> Array:
    """Fields of librations of cells, all of them under a torque, at a level each."""
    own, at = np.unique(np.stack(cells), axis=1, return_inverse=True)
    at = at.reshape(-1)
    points, turns = lines_of(*own)
    loops = turns.separatrices(measured=False)
    torque = own[-1]
    up, down = level**CLUSTER, (1.0 - level) ** CLUSTER
    walls, gaps = [], []
    for center in (0, 2):
        there = points.kind[:, center] == EquilibriumKind.CENTER
        bottom = np.where(there, points.energy[:, center], np.nan)
        wall = lower_wall(loops, np.where(there, points.phi[:, center], np.nan), torque)
        walls.append([x[at] for x in wall])
        gaps.append(-(wall.energy - bottom)[at] * down)
    # Round both wells: above the saddle between them, and below the one that ends both.
    eight, row = (loops.loop == Loop.LOBES).any(axis=1), np.arange(torque.size)
    middle = np.argmax(loops.loop == Loop.LOBES, axis=1)
    phi, energy = (
        np.where(eight, x[row, middle], np.nan) for x in (loops.saddle_phi, loops.saddle_energy)
    )
    wall = lower_wall(loops, phi, torque)
    step, near = (wall.energy - energy)[at] * 2.0 ** (CLUSTER - 1), level < 0.5
    inner = Wall(middle, np.ones_like(middle), energy)
    walls.append([np.where(near, x[at], y[at]) for x, y in zip(inner, wall, strict=True)])
    gaps.append(np.where(near, step * up, -step * down))
    saddle, side, base = map(np.concatenate, zip(*walls, strict=True))
    gap = np.concatenate(gaps)
    found = np.full((len(TorquedFamilies._fields), 4, level.size), np.nan)
    flat = found[:, :3].reshape(len(found), -1)
    rows = np.flatnonzero(np.isfinite(gap))
    for some in (rows[i : i + CELLS] for i in range(0, rows.size, CELLS)):
        few = turns.take(np.tile(at, 3)[some])
        column, there = few.saddle(saddle[some])
        states = states_at_gap(few, gap[some], column, there, side[some])
        orbit = followed(few, states, np.sqrt(2.0 * states.kinetic))
        flat[0, some] = base[some] + gap[some]
        flat[1:, some] = [getattr(orbit, name) for name in TorquedFamilies._fields[1:]]
    found[:, :3] = flat.reshape(len(found), 3, -1)
    return np.moveaxis(found, 1, -1)


def lower_wall(loops: Any, phi: Array, torque: Array) -> Wall:
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
        walls.append((saddle, energy[rows, saddle] - torque * turned))
    (left, below), (right, above) = walls
    on_left = below < above
    return Wall(
        np.where(on_left, left, right),
        np.where(on_left, 1, 0),  # what lies right of the left wall
        np.where(on_left, below, above),
    )
