"""Integrals of 1/v and of v over arcs, by Gauss' rule on panels that are halved where they must be.

Each half of an arc runs from its end inward: from a turning point in s = sqrt(distance), in which
the root of v there is smooth, or from a maximum of V that is passed. The kinetic energy is the
integral of -V' from that end, so it has all its digits next to it, and panels crowd toward the end
geometrically, down to the scale that V has there. On each panel the decay of Legendre series tells
how well V', 1/v and v are known, and bounds of V' about it whether anything narrow fell between
the nodes.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from phasekit.arrays import Array, Flags
from phasekit.arrays import Ints as Index
from phasekit.numerics.contract import contract
from phasekit.phase.numerical.differences import Anchor, Ground
from phasekit.phase.numerical.formula_bounds import smooth
from phasekit.phase.numerical.quadrature import Pieces, each

_NODES = 16
_ROUNDS = 64  # of halving
_MOST = 1024  # panels of one half
_DEEPEST = 540.0  # panels that shrink by 4, down to the least double
_EPS = float(np.finfo(float).eps)
#: Tail of V' that is as good as rounding, and tails of 1/v and v, whose rule errs by the square.
_TIGHT, _LOOSE = 1e-14, 2e-8


class Integrals(NamedTuple):
    """Integrals of 1/v and of v for each orbit, with estimates of their errors."""

    time: Array
    area: Array
    time_error: Array
    area_error: Array


def _tables() -> tuple[Array, Array, Array, Array, Array]:
    legendre: Any = np.polynomial.legendre
    nodes, weights = legendre.leggauss(_NODES)
    basis = legendre.legvander(nodes, _NODES - 1)
    to_series = (basis * weights[:, None]).T * (np.arange(_NODES)[:, None] + 0.5)
    integrals = np.stack(
        [legendre.legval(nodes, legendre.legint(row, lbnd=-1)) for row in np.eye(_NODES)], axis=1
    )
    # Mean over [0, s_i] with the weight 2 s/s_i^2, of a function of s in [0, 1].
    s = 0.5 * (1.0 + nodes)
    means = np.zeros((_NODES, _NODES))
    for share, weight in zip(s, 0.5 * weights, strict=True):
        inner = legendre.legvander(2.0 * s * share - 1.0, _NODES - 1) @ to_series
        means += 2.0 * share * weight * inner
    return s, 0.5 * weights, 0.5 * integrals @ to_series, np.asarray(to_series), means


_S, _WEIGHTS, _CUMULATIVE, _TO_SERIES, _MEANS = _tables()


@dataclass
class _Panels:
    """Stretches [low, high] in s of halves of arcs, and what V' is there."""

    half: Index
    low: Array
    high: Array
    force: Array
    """-dV/ds at the nodes; where s = 0 is a turning point, -dV/dy with y = s^2."""
    tail: Array
    """Last of the series of -dV/ds, and that of the panel from which this one was cut."""
    before: Array
    rough: Flags

    def take(self, which: Index | Flags) -> _Panels:
        return _Panels(*(field[which] for field in vars(self).values()))


class _Halves:
    """Halves of arcs: their ends, lengths in s, and what they need of V'."""

    def __init__(self, ground: Ground, pieces: Pieces) -> None:
        owner = np.repeat(pieces.orbit, 2)
        ends = np.stack([pieces.left, pieces.right], axis=1).reshape(-1, 4)
        cut, length = pieces.cut, pieces.length
        self.orbit = owner
        self.systems = ground.systems.take(owner)
        self.anchor = Anchor(self.systems, ends[:, 0], ends[:, 1])
        self.u, self.way = ends[:, 2], np.tile([1.0, -1.0], cut.size)
        self.turning = self.u != 0.0
        # What rounding has done to the energy of turning points that are known by difference.
        with np.errstate(all="ignore"):
            heights = [self.systems.potential(ends[:, 0] + u) for u in (0.0, self.u)]
        away = self.turning & (np.abs(self.u) > ends[:, 1])
        self.blur = np.where(away, 2.0 * _EPS * np.abs(heights).sum(axis=0), 0.0)
        self.start = np.where(self.turning, 0.0, ends[:, 3])
        reach = np.stack([cut, length - cut], axis=1).reshape(-1)
        exact = pieces.reach.reshape(-1)
        self.reach = np.where(np.isnan(exact), reach, exact)
        self.stop = np.where(self.turning, np.sqrt(self.reach), self.reach)

    def first(self) -> tuple[Index, Array, Array]:
        """Panels that shrink by 4 toward the end, down to the scale of V there."""
        with np.errstate(all="ignore"):
            x = self.anchor.at + self.u
            bend = np.abs(self.systems.bend(x))
            scale = np.where(
                self.turning,
                np.sqrt(np.abs(self.anchor.slope(self.u)) / bend),
                np.sqrt(2.0 * self.start / bend),
            )
            steps = np.ceil(0.5 * np.log2(self.stop / scale))
        steps = np.where(np.isfinite(steps), np.clip(steps, 1.0, _DEEPEST), 1.0).astype(int)
        half, number = each(steps + 1)
        last = steps[half]
        high = self.stop[half] * 0.25 ** (last - number)
        low = np.where(number == 0, 0.0, 0.25 * high)
        return half, low, high

    def panels(self, half: Index, low: Array, high: Array, before: Array) -> _Panels:
        """Evaluate V' on panels."""
        width = (high - low)[:, None]
        s = low[:, None] + width * _S
        turning = self.turning[half, None]
        y = np.where(turning, s * s, s)
        way = self.way[half, None]
        rows = np.repeat(half, _NODES)
        u = (self.u[half, None] + way * y).reshape(-1)
        slope = self.anchor.take(rows).slope(u).reshape(s.shape)
        force = -way * slope
        series = contract(force, _TO_SERIES[-2:])
        tail = np.max(np.abs(series), axis=1)
        return _Panels(half, low, high, force, tail, before, self._rough(half, y, force))

    def _rough(self, half: Index, y: Array, force: Array) -> Flags:
        """Whether V' may do on a panel what its nodes do not show."""
        ends = [self.anchor.at[half] + self.u[half] + self.way[half] * y[:, k] for k in (0, -1)]
        low, high = np.minimum(*ends), np.maximum(*ends)
        narrow = high - low <= 64.0 * np.spacing(np.abs(high))
        shown = smooth(self.systems, half, low, high, np.max(np.abs(force), axis=1))
        return np.asarray(~shown & ~narrow)


def integrate(ground: Ground, pieces: Pieces, *, timed: bool = True) -> Integrals:
    """Integrals of 1/v (if `timed`) and of v over the pieces of each orbit."""
    size = ground.systems.size
    totals = np.zeros((4, size))
    if not pieces.orbit.size:
        return Integrals(*totals)
    halves = _Halves(ground, pieces)
    half, low, high = halves.first()
    panels = halves.panels(half, low, high, np.full(half.size, np.inf))
    count = halves.orbit.size
    for _ in range(_ROUNDS):
        panels = panels.take(np.lexsort((panels.low, panels.half)))
        sums, meeting, poor = _sums(halves, panels, timed)
        crowded = np.bincount(panels.half, minlength=count) > _MOST
        middle = 0.5 * (panels.low + panels.high)
        poor &= ~crowded[panels.half] & (middle > panels.low) & (middle < panels.high)
        if not poor.any():
            break
        cut, kept = panels.take(poor), panels.take(~poor)
        middle = middle[poor]
        fresh = halves.panels(
            np.tile(cut.half, 2),
            np.concatenate([cut.low, middle]),
            np.concatenate([middle, cut.high]),
            np.tile(cut.tail, 2),
        )
        panels = _Panels(
            *(
                np.concatenate(pair)
                for pair in zip(*(vars(p).values() for p in (kept, fresh)), strict=True)
            )
        )
    # Both halves of a piece meet with the same energy, but for errors.
    one, two = meeting[::2], meeting[1::2]
    with np.errstate(all="ignore"):
        gap = np.repeat(0.5 * np.abs(one - two) / np.maximum(one, two), 2)
    gap = np.where(np.isfinite(gap), gap, 0.0)
    for k in (0, 1):
        np.add.at(totals[k], halves.orbit, sums[k])
        np.add.at(totals[k + 2], halves.orbit, sums[k + 2] + (gap + 4.0 * _EPS) * sums[k])
    return Integrals(*totals)


def _sums(halves: _Halves, panels: _Panels, timed: bool) -> tuple[Array, Array, Flags]:
    """Integrals and errors of each half, its energy at the inner end, and panels to be halved."""
    count = halves.orbit.size
    width = panels.high - panels.low
    s = panels.low[:, None] + width[:, None] * _S
    turning = halves.turning[panels.half]
    rate = np.where(turning[:, None], 2.0 * s, 1.0)  # dy/ds
    force = panels.force * rate
    series = contract(force, _TO_SERIES[-2:])
    tail = np.max(np.abs(series), axis=1) * width
    gain = width * contract(force, _WEIGHTS)
    before, blur = (_running(panels.half, values, count) for values in (gain, tail))
    start = halves.start[panels.half] + before
    kinetic = start[:, None] + width[:, None] * contract(force, _CUMULATIVE)
    # Next to a turning point v and s go to 0 together: 1/v dy/ds is a root of the mean of -V'.
    first = turning & (panels.low == 0.0)
    means = contract(panels.force, _MEANS)
    kinetic[first] = (s * s * means)[first]
    with np.errstate(all="ignore"):
        speed = np.sqrt(2.0 * kinetic)
        slowness = np.where(first[:, None], 2.0 / np.sqrt(2.0 * means), rate / speed)
        flow = rate * speed
        scale = np.max(kinetic, axis=1)
        unsure = (blur + tail)[:, None] / kinetic
        unsure[first] = (tail / (width * np.max(np.abs(force), axis=1)))[first, None]
        poor = panels.rough | ~(
            (tail <= _TIGHT * scale)
            | (panels.tail <= _TIGHT * np.max(np.abs(panels.force), axis=1))
        )
        # Halving that does not shrink the tail meets the rounding of V' itself.
        stuck = (panels.tail >= 0.25 * panels.before) & (
            panels.tail <= 1e-6 * np.max(np.abs(panels.force), axis=1)
        )
        poor &= ~stuck | panels.rough
        sums = np.zeros((4, count))
        for k, values in ((0, slowness), (1, flow)):
            if k == 0 and not timed:
                continue
            part = width * contract(values, _WEIGHTS)
            most = np.max(np.abs(values), axis=1)
            rest = np.max(np.abs(contract(values, _TO_SERIES[-2:])), axis=1)
            # The rule errs by terms of twice the order, a series of which the first is as the
            # square of the last here.
            error = 4.0 * width * rest * np.minimum(rest / most, 1.0)
            error += width * contract(values * 0.5 * unsure, _WEIGHTS)
            error += 0.5 * part * halves.blur[panels.half] / scale
            poor |= ~(rest <= _LOOSE * most) & ~stuck
            np.add.at(sums[k], panels.half, part)
            np.add.at(sums[k + 2], panels.half, error)
    meeting = np.asarray(halves.start + np.bincount(panels.half, gain, count), dtype=float)
    return sums, meeting, np.asarray(poor)


def _running(half: Index, values: Array, count: int) -> Array:
    """Sum of the values before each panel in its half; panels are in order."""
    first = np.searchsorted(half, np.arange(count))
    number = np.arange(half.size) - first[half]
    table = np.zeros((count, int(number.max(initial=0)) + 2))
    table[half, number + 1] = values
    return np.asarray(np.cumsum(table, axis=1)[half, number])
