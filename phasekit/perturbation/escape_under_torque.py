"""Escape by thermal noise under a constant torque: out of a tilted well, over both its ends."""

from __future__ import annotations

import functools
from typing import Any

import numpy as np
import numpy.typing as npt

from phasekit.errors import Loop
from phasekit.perturbation.depopulation import two_rims
from phasekit.perturbation.diffusion import (
    TURN,
    action_in_well,
    configuration,
    marks_of,
    passage,
    saddles_of,
    spatial_exponent,
    transition,
)
from phasekit.perturbation.rates import (
    Cells,
    Escape,
    Exit,
    combined,
    masked,
    place,
    returning,
)
from phasekit.phase.exact.under_torque import Saddle
from phasekit.phase.numerical.torqued import lines_of

Array = npt.NDArray[np.float64]


class Wells:
    """The wells of some cells, and what is known at their saddles."""

    def __init__(self, cells: Cells) -> None:
        self.cells = cells
        self.points, turns = lines_of(cells.A, cells.B, cells.C, cells.torque)
        self.loops = turns.separatrices()
        self.row = np.arange(len(cells.A))
        phi, k = self.loops.saddle_phi, self.loops.saddle_exponent
        self.phi, self.k = phi, k
        self.centers = self.points.phi[:, ::2]
        self.saddles = saddles_of(cells.A, phi, k, cells.torque)
        left, right = (marks_of(self.points.phi, phi, way)[..., 0] for way in (-1.0, 1.0))
        self.spatial = spatial_exponent(self.saddles, left, right, np.stack([cells.kT] * 2, -1))

    def saddle(self, which: Any) -> Saddle:
        """One saddle of each cell."""
        return Saddle._make(x[self.row, which] for x in self.saddles)

    def loss(self, which: Any, side: Any) -> Array:
        """Loss over kT of a round of the loop on one side of a saddle."""
        return np.asarray(
            self.cells.damping * self.loops.lobe_area[self.row, which, side] / self.cells.kT
        )

    def rate(self, which: Any, at: Array, start: Array, end: Array) -> tuple[Array, Array]:
        """Barrier over a saddle, and rate of transition-state theory times exp(barrier/kT).

        Angles are from that saddle.
        """
        saddle = self.saddle(which)
        height = saddle.depth(at)
        well = configuration(saddle.spread().depth, height, at, start, end, self.cells.kT)
        return height, transition(self.cells.kT, well)

    def correction(
        self, which: Any, at: Array, start: Array, end: Array, height: Array, high: Array
    ) -> Array:
        """Rate at which the diffusing energy comes to the saddle, over that of a high barrier."""
        system = (self.cells.A, self.cells.B, self.cells.C, self.cells.torque)
        saddle = self.saddle(which)

        def action(part: Any, x: Array) -> Array:
            own, one = tuple(v[part] for v in system), Saddle._make(v[part] for v in saddle)
            return action_in_well(own, one, at[part], (start[part], end[part]), x)

        time = passage(action, height, self.cells.damping, self.cells.kT)
        with np.errstate(all="ignore"):
            return np.asarray(1.0 / (time * high))


def escape_under_torque(cells: Cells, number: int) -> Escape:
    """Escape under a torque from the well of a center (0 lower, 1 upper)."""
    wells = Wells(cells)
    own = wells.centers[:, number]
    with np.errstate(invalid="ignore"):
        ahead = np.mod(wells.phi - own[:, None], TURN)
    right = np.where(np.isnan(ahead), np.inf, ahead).argmin(-1)
    left = np.where(np.isnan(ahead), -np.inf, ahead).argmax(-1)
    eight = wells.loops.loop == Loop.LOBES
    inner = np.where(eight.any(-1), eight.argmax(-1), -1)
    out = cells.empty()
    double = np.flatnonzero(inner >= 0)
    if double.size:
        part = Wells(cells.at(double))
        _between(out, part, double, number, inner[double])
    # Over the ends: of the well, or of both wells together where a lower saddle parts them.
    right, left = (np.where(inner >= 0, 1 - inner, which) for which in (right, left))
    _outwards(out, wells, own, left, right, inner >= 0)
    return masked(out, np.isnan(own), wells.points.n_equilibria < 0)


def _between(out: Escape, wells: Wells, place_at: Any, number: int, inner: Any) -> None:
    """Over the saddle inside an eight into the other lobe, out of which it may come back."""
    row = wells.row
    at = wells.phi[row, inner]
    outer = np.mod(wells.phi[row, 1 - inner] - at, TURN)

    def lobe(i: int) -> tuple[Any, Array, Array, Array, Array]:
        where = np.mod(wells.centers[:, i] - at, TURN)
        side = (where < outer).astype(int)
        where = np.where(side == 1, where, where - TURN)
        ends = np.where(side == 1, 0.0, outer - TURN), np.where(side == 1, outer, 0.0)
        height, rate = wells.rate(inner, where, *ends)
        loss = wells.loss(inner, side)
        ratio = wells.correction(inner, where, *ends, height, rate * loss)
        return side, height, rate, loss, ratio

    side, height, rate, loss, ratio = lobe(number)
    *_, beyond, back = lobe(1 - number)
    way = Exit(
        lambda scale, power: returning(scale * loss * ratio**power, scale * beyond * back**power),
        np.isfinite(ratio * back), height, loss, wells.k[row, inner], wells.spatial[row, inner],
    )  # fmt: skip
    place(out, combined(wells.cells, rate, way), place_at, inner, side)


def _outwards(out: Escape, wells: Wells, own: Array, left: Any, right: Any, both: Any) -> None:
    """Over both ends of a well, of which the first to be reached counts."""
    row, kT = wells.row, wells.cells.kT
    high_end, start = wells.phi[row, right], wells.phi[row, left]
    with np.errstate(invalid="ignore"):
        # Of two wells the deeper one, in which a cold particle is.
        ahead = np.mod(high_end[:, None] - wells.centers, TURN)
        depth = wells.saddle(right).spread().depth(-ahead)
        deeper = np.where(np.isnan(depth), -np.inf, depth).argmax(-1)
        to_right = np.where(both, ahead[row, deeper], np.mod(high_end - own, TURN))
        width = np.where(left == right, TURN, np.mod(high_end - start, TURN))
    to_left = width - to_right
    found = []
    for which, where, ends in (
        (left, to_left, (np.zeros(len(row)), width)),
        (right, -to_right, (-width, np.zeros(len(row)))),
    ):
        found.append((which, where, ends, *wells.rate(which, where, *ends)))
    apart = np.abs(found[0][3] - found[1][3]) / kT
    low = found[1][3] <= found[0][3]  # whether the right end is the lower one
    which = np.where(low, right, left)
    loss = wells.loss(which, np.where(low, 0, 1))
    at, start, end, height, rate = (
        np.where(low, x, y)
        for x, y in (
            (found[1][1], found[0][1]), (found[1][2][0], found[0][2][0]),
            (found[1][2][1], found[0][2][1]), (found[1][3], found[0][3]),
            (found[1][4], found[0][4]),
        )
    )  # fmt: skip
    ratio = wells.correction(
        which, at, start, end, np.where(both, np.nan, height), rate * loss
    )  # fmt: skip
    known = np.isfinite(ratio)

    @functools.cache
    def rims(scale: float, power: float) -> tuple[Array, Array]:
        return two_rims(0.5 * scale * loss * np.where(known, ratio, 1.0) ** power, apart)

    for i, (saddle, _, _, own_height, own_rate) in enumerate(found):
        lower = low if i == 1 else ~low

        def factor(scale: float, power: float, lower: Any = lower) -> Array:
            return np.where(lower, *rims(scale, power))

        way = Exit(
            factor, known, own_height, loss, wells.k[row, saddle], wells.spatial[row, saddle]
        )  # fmt: skip
        place(out, combined(wells.cells, own_rate, way), row, saddle, 1 - i)
