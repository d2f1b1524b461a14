"""Separatrices of any potential: the level of each saddle, followed to both sides."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from phasekit.arrays import Array, Flags
from phasekit.errors import EquilibriumKind, Loop, Topology
from phasekit.phase.numerical.differences import Anchor, Ground
from phasekit.phase.numerical.panels import integrate
from phasekit.phase.numerical.periods import WORST
from phasekit.phase.numerical.quadrature import between
from phasekit.phase.numerical.turning_points import End, distances, find_end

SIDES = (-1.0, 1.0)
#: Saddles: their rows and columns, their places on the axis of saddles, and its length.
Placed = tuple[npt.NDArray[np.intp], npt.NDArray[np.intp], npt.NDArray[np.intp], int]


class Separatrices(NamedTuple):
    """Separatrices of systems, as in closed form, with estimates of errors."""

    topology: npt.NDArray[np.int8]
    """`Topology`."""
    figure_eight: Flags
    saddle_phi: Array
    saddle_energy: Array
    saddle_exponent: Array
    loop: npt.NDArray[np.int8]
    """`Loop`."""
    winding_area: Array
    turning_offset: Array
    turning_phi: Array
    lobe_area: Array
    winding_area_error: Array
    lobe_area_error: Array


@dataclass(frozen=True, eq=False)
class Branch:
    """What leaves each of some saddles to one side, one row each.

    `length` is the distance to the turning point, or to the saddle that it joins, which on a
    circle may be the saddle itself; infinite where there is neither. `place_error` is how
    far rounding of V' may have moved the saddle.
    """

    ground: Ground
    saddle: Array
    side: float
    length: Array
    joins: Flags
    winds: Flags
    near: End
    far: End
    excess: Array
    place_error: Array


def saddles_of(ground: Ground) -> tuple[npt.NDArray[np.intp], npt.NDArray[np.intp]]:
    """Rows and columns of the saddles: maxima of V, degenerate ones included."""
    points = ground.points
    flat = points.kind == EquilibriumKind.DEGENERATE
    if flat.any():
        rows, columns = np.nonzero(flat)
        few = Anchor(
            ground.systems.take(rows), points.phi[rows, columns], ground.near[rows, columns]
        )
        falls = [few.rise(0.5 * sign * few.near) < 0.0 for sign in SIDES]
        flat[rows, columns] = falls[0] & falls[1]
    rows, columns = np.nonzero((points.kind == EquilibriumKind.SADDLE) | flat)
    return rows, columns


def numbered(rows: npt.NDArray[np.intp], columns: npt.NDArray[np.intp]) -> Placed:
    """Saddles in places from left to right."""
    # Rows rise, so the place of a saddle in its row counts from where the row begins.
    slot = np.arange(rows.size) - np.searchsorted(rows, rows)
    return rows, columns, slot, int(slot.max(initial=-1)) + 1


def branch_of(ground: Ground, column: npt.NDArray[np.intp], side: float) -> Branch:
    """Follow the level of a saddle to one side; one row of `ground` for each saddle."""
    points, systems = ground.points, ground.systems
    rows = np.arange(column.size)
    saddle = points.phi[rows, column]
    with np.errstate(all="ignore"):
        excess = ground.above(column)
        level = excess == 0.0
        # Not at rest, though as slow as can be: the level leaves the saddle.
        far = find_end(ground, saddle, np.full(saddle.shape, 1e-300), excess, side)
        way = distances(ground, saddle, side)
        level &= (points.kind != EquilibriumKind.CENTER) & (way > 0.0)
        ways = np.where(level, way, np.inf)
        partner = np.argmin(ways, axis=1)
        joined = ways[rows, partner]
        joins = np.isfinite(joined) & ~(joined > far.offset)
        winds = joins & (partner == column)
    length = np.where(joins, joined, np.where(np.isnan(far.offset), np.inf, far.offset))
    at = np.where(joins, points.phi[rows, partner], far.anchor.at)
    reach = np.where(joins, ground.near[rows, partner], far.anchor.near)
    u, above = (np.where(joins, 0.0, x) for x in (far.u, far.excess))
    end = End(length, far.turned, Anchor(systems, at, reach), u, above)
    zero = np.zeros(saddle.shape)
    own = Anchor(systems, saddle, ground.near[rows, column])
    near = End(zero, far.turned, own, zero, zero)
    off = ground.place_error(column)
    return Branch(ground, saddle, side, length, joins, winds, near, end, excess, off)


def areas(branch: Branch, rows: npt.NDArray[np.intp], worst: float) -> tuple[Array, Array]:
    """Integral of v over the finite branches of some rows, and its error.

    NaN where the error may be more than the worst part of it.
    """
    ground, length = branch.ground.take(rows), branch.length[rows]
    near, far = branch.near.take(rows), branch.far.take(rows)
    start = branch.saddle[rows] - (length if branch.side < 0.0 else 0.0)
    ends = (near, far) if branch.side > 0.0 else (far, near)
    pieces = between(ground, start, length, branch.excess[rows], *ends)
    with np.errstate(all="ignore"):
        found = integrate(ground, pieces, timed=False)
        # Either end may lie beside where V' is 0; the area goes with the square of the length.
        off = branch.place_error[rows] / length
        error = found.area_error + 4.0 * found.area * np.where(length > 0.0, off, 0.0)
        known = error <= worst * found.area
    return np.where(known, found.area, np.nan), error


def separatrices(
    ground: Ground,
    *,
    measured: bool = True,
    placed: Placed | None = None,
    worst: float = WORST,
) -> Separatrices:
    """Topology, turning points and, if measured, areas; saddles from left to right on their axis.

    The level of a saddle is followed to either side until V rises to it again: at a turning
    point (a lobe), at a saddle of the same energy within rounding (heteroclinic; on a circle the
    saddle itself: winding), or not at all.
    """
    systems, period = ground.systems, ground.circle
    rows, columns, slot, most = numbered(*saddles_of(ground)) if placed is None else placed
    shape = (systems.size, most)
    few = ground.take(rows)
    found = np.full((len(rows), 4, 2), np.nan)  # offset, angle, area, its error
    closed, joined = (np.zeros((len(rows), 2), dtype=bool) for _ in range(2))
    winding_area, winding_error = (np.full(len(rows), np.nan) for _ in range(2))
    winds = np.zeros(len(rows), dtype=bool)
    for k, side in enumerate(SIDES if rows.size else ()):
        branch = branch_of(few, columns, side)
        finite = np.flatnonzero(np.isfinite(branch.length))
        area = np.full(len(rows), np.inf)
        error = np.zeros(len(rows))
        area[finite], error[finite] = areas(branch, finite, worst) if measured else (np.nan, np.nan)
        place = branch.far.anchor.at + branch.far.u
        place = np.where(np.isfinite(branch.length), place, side * np.inf)
        if period is not None:
            place[finite] = 0.5 * period - (0.5 * period - place[finite]) % period
        found[:, 0, k] = side * branch.length
        found[:, 1, k] = place
        found[:, 2, k] = 2.0 * area
        found[:, 3, k] = 2.0 * error
        closed[:, k] = np.isfinite(branch.length) & ~branch.joins
        joined[:, k] = branch.joins & ~branch.winds
        winds |= branch.winds
        winding_area = np.where(branch.winds, area, winding_area)
        winding_error = np.where(branch.winds, error, winding_error)
    found[winds] = np.nan
    loop = np.select(
        [winds, joined.any(axis=1), closed.all(axis=1), closed.any(axis=1)],
        [Loop.WINDING, Loop.HETEROCLINIC, Loop.LOBES, Loop.LOBE],
        Loop.UNBOUNDED,
    )
    loops = np.full(shape, Loop.ABSENT, dtype=np.int8)
    loops[rows, slot] = loop

    def spread(values: Array, tail: tuple[int, ...] = ()) -> Array:
        out = np.full(shape + tail, np.nan)
        out[rows, slot] = values
        return out

    points = ground.points
    exponent = points.exponent[rows, columns]
    exponent = np.where(points.kind[rows, columns] == EquilibriumKind.SADDLE, exponent, 0.0)
    topology = np.full(systems.size, Topology.NONE, dtype=np.int8)
    for code, meaning in (
        (Loop.UNBOUNDED, Topology.UNBOUNDED),
        (Loop.WINDING, Topology.WINDING),
        (Loop.LOBE, Topology.HOMOCLINIC),
        (Loop.LOBES, Topology.FIGURE_EIGHT),
        (Loop.HETEROCLINIC, Topology.HETEROCLINIC),
    ):  # the last that occurs
        topology[(loops == code).any(axis=1)] = meaning
    topology[points.n_equilibria < 0] = Topology.NOT_COMPUTED
    return Separatrices(
        topology,
        (loops == Loop.LOBES).any(axis=1),
        spread(points.phi[rows, columns]),
        spread(points.energy[rows, columns]),
        spread(exponent),
        loops,
        spread(winding_area),
        spread(found[:, 0], (2,)),
        spread(found[:, 1], (2,)),
        spread(found[:, 2], (2,)),
        spread(winding_error),
        spread(found[:, 3], (2,)),
    )
