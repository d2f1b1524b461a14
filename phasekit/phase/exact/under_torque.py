"""Equilibria under a constant torque N, where V' = N.

Between two neighboring extremes of V' it is monotone, so that it takes each value once or not at
all. Seen from a saddle, at theta = phi - phi_s, the height left to its energy is

``[k^2 - (A/2) (c cos 2 phi_s + sin theta sin 2 phi_s)] c + N (theta - sin theta)``,
``c = 1 - cos theta``,

which cancels neither next to the saddle nor next to a fold.
"""

from __future__ import annotations

import itertools
import math
from typing import Any, NamedTuple

import numpy as np

from phasekit.arrays import Array, Codes
from phasekit.errors import EquilibriumKind
from phasekit.phase.exact.inflections import inflections
from phasekit.phase.exact.phase_space import Equilibria, equilibria
from phasekit.phase.exact.potential import curvature, gradient, potential

HALVINGS = 64
ROUNDINGS = 4.0 * 2.0**-52
#: Taylor's coefficients of (sin x - x)/x^3 by x^2.
EXCESS = [(-1.0) ** (n + 1) / math.factorial(2 * n + 3) for n in range(9)]


def equilibria_under(A: Array, B: Array, C: Array, N: Array) -> Equilibria:
    """Equilibria of cells in a row, with the labels that they have without a torque."""
    points = equilibria(A, B, C)
    fields = [np.array(x) for x in points]
    cells = np.flatnonzero((N != 0.0) | np.isnan(N))
    if cells.size:
        bent = _under_torque(A[cells], B[cells], C[cells], N[cells], points.phi[cells])
        invalid = (points.n_equilibria[cells] < 0) | np.isnan(N[cells])
        bent = bent._replace(n_equilibria=np.where(invalid, -1, bent.n_equilibria))
        parts: tuple[Any, ...] = bent
        for field, one in zip(fields, parts, strict=True):
            field[cells] = one
    return Equilibria._make(fields)


def numbers_under(A: Array, B: Array, C: Array, N: Array, still: Codes) -> Codes:
    """Numbers of equilibria of cells in a row under torques; `still` are those of N = 0."""
    found = np.array(still)
    cells = np.flatnonzero(((N != 0.0) & (still >= 0)) | np.isnan(N))
    arcs = _arcs(A[cells], B[cells], C[cells], N[cells])
    saddles = np.zeros(arcs.crossed.shape, bool)  # in the place of one stands a merged pair
    rows, ends = np.nonzero(arcs.touches)
    if rows.size:
        saddles[rows, arcs.before()[rows, ends]] = True
    number = (arcs.crossed.sum(axis=1) + saddles.sum(axis=1)).astype(np.int8)
    found[cells] = np.where(np.isnan(N[cells]), -1, number)
    return found


class Arcs(NamedTuple):
    """Arcs of a circle on each of which V' is monotone, and whether it takes the torque there."""

    start: Array
    stop: Array
    #: Whether V' = N inside, away from the ends.
    crossed: Any
    #: Whether V' = N at the start, within rounding.
    touches: Any
    rises: Any

    def before(self) -> Any:
        """Of each arc the falling one that ends or begins at its start."""
        arc = np.arange(4)
        last = np.maximum(np.isfinite(self.start).sum(axis=1) - 1, 0)[:, None]
        return np.where(self.rises, np.where(arc == 0, last, arc - 1), arc)


def _arcs(A: Array, B: Array, C: Array, N: Array) -> Arcs:
    """The arcs of cells in a row; NaN where there are fewer than four."""
    ends = inflections(A, B, C)
    number = np.isfinite(ends).sum(axis=-1)
    following = np.where(
        np.arange(4) == np.maximum(number, 1)[:, None] - 1,
        ends[:, :1] + 2.0 * np.pi,
        np.concatenate([ends[:, 1:], ends[:, :1]], axis=1),
    )
    a, b, c, n = (x[:, None] for x in (A, B, C, N))
    at_low, at_high = gradient(a, b, c, ends) - n, gradient(a, b, c, following) - n
    crossed = np.sign(at_low) * np.sign(at_high) < 0.0  # their product may underflow
    # A torque at an end of what V' takes, within rounding, merges both neighbors there.
    size = np.abs(a) + np.abs(b) + np.abs(c) + np.abs(n)
    touches = np.abs(at_low) <= ROUNDINGS * size
    after = np.roll(touches, -1, axis=1)
    last = np.arange(4) == number[:, None] - 1
    after = np.where(last, touches[:, :1], after)
    return Arcs(ends, following, crossed & ~touches & ~after, touches, at_high > at_low)


def _under_torque(A: Array, B: Array, C: Array, N: Array, still: Array) -> Equilibria:
    """Equilibria of cells in a row, where V' = N; `still` are those of N = 0."""
    arcs = _arcs(A, B, C, N)
    a, b, c, n = (x[:, None] for x in (A, B, C, N))
    low, high = arcs.start, arcs.stop
    x = 0.5 * (low + high)
    for _ in range(HALVINGS):
        value = gradient(a, b, c, x) - n
        above = (value > 0.0) == arcs.rises
        low, high = np.where(above, low, x), np.where(above, x, high)
        with np.errstate(all="ignore"):  # V'' may vanish
            step = x - value / curvature(a, b, c, x)
        x = np.where((step > low) & (step < high), step, 0.5 * (low + high))
    phi = np.where(x > np.pi, x - 2.0 * np.pi, x)
    return _labelled((A, B, C, N), arcs._replace(crossed=arcs.crossed & np.isfinite(x)), phi, still)


def _labelled(system: tuple[Array, ...], arcs: Arcs, phi: Array, still: Array) -> Equilibria:
    """Put the equilibrium of each arc where the arc's own at torque 0 stands."""
    A, B, C, N = system
    start, stop, there, touches, rises = arcs
    cells = np.arange(len(A))
    slot = np.full(phi.shape, -1)
    turn = 2.0 * np.pi
    for label in range(4):
        own = still[:, label, None]
        inside = np.mod(own - start, turn) < (stop - start)
        inside &= (rises == (label % 2 == 0)) & (slot < 0)
        found = inside.any(axis=1)
        slot[cells[found], inside.argmax(axis=1)[found]] = label
    # Arcs that hold none at torque 0 take the labels that are left: first those that hold one now.
    for there_now, kind in itertools.product((True, False), (0, 1)):
        order = (0, 2) if kind == 0 else (3, 1)
        for arc in range(4):
            open_ = (slot[:, arc] < 0) & np.isfinite(phi[:, arc]) & (rises[:, arc] == (kind == 0))
            open_ &= there[:, arc] == there_now
            for label in order:
                free = open_ & ~(slot == label).any(axis=1)
                slot[cells[free], arc] = label
                open_ &= ~free
    out = np.full((len(A), 4), np.nan)
    kinds = np.zeros((len(A), 4), np.int8)
    for arc in range(4):
        good = there[:, arc] & (slot[:, arc] >= 0)
        rows, labels = cells[good], slot[good, arc]
        out[rows, labels] = phi[good, arc]
        kinds[rows, labels] = np.where(
            labels % 2 == 0, EquilibriumKind.CENTER, EquilibriumKind.SADDLE
        )
        merged = touches[:, arc] & (slot[:, arc] >= 0)  # stands once, in the place of the saddle
        pair = arcs.before()[:, arc]
        rows = cells[merged]
        labels = slot[rows, pair[merged]]
        out[rows, labels] = start[merged, arc]
        kinds[rows, labels] = EquilibriumKind.DEGENERATE
    a, b, c, n = (x[:, None] for x in (A, B, C, N))
    with np.errstate(all="ignore"):
        bend = np.where(kinds == EquilibriumKind.DEGENERATE, 0.0, curvature(a, b, c, out))
        bend = np.where(np.isnan(out), np.nan, bend)
        energy = potential(a, b, c, out) - n * out
        frequency = np.sqrt(np.where(kinds == EquilibriumKind.CENTER, bend, np.nan))
        exponent = np.sqrt(np.where(kinds == EquilibriumKind.SADDLE, -bend, np.nan))
    count = (kinds > 0).sum(axis=1).astype(np.int8)
    margin = np.full(len(A), np.nan)
    return Equilibria(out, kinds, energy, bend, frequency, exponent, count, margin)


class Saddle(NamedTuple):
    """A saddle, and the potential as it is seen from there; fields broadcast."""

    phi: Array
    square: Array
    """k^2."""
    level: Array
    """(A/2) cos 2 phi_s."""
    slope: Array
    """(A/2) sin 2 phi_s."""
    torque: Array

    def spread(self) -> Saddle:
        """With one more axis at the end."""
        return Saddle._make(x[..., None] for x in self)

    def depth(self, theta: Any) -> Array:
        """Energy of the saddle less the potential at an angle from it."""
        c = 2.0 * np.sin(0.5 * theta) ** 2
        bend = self.square - self.level * c - self.slope * np.sin(theta)
        return np.asarray(bend * c - self.torque * sine_excess(theta))


def saddle_at(A: Any, phi: Any, k: Any, torque: Any) -> Saddle:
    """The saddle of an angle and an exponent."""
    level, slope = (0.5 * A * f(2.0 * phi) for f in (np.cos, np.sin))
    return Saddle(*np.broadcast_arrays(phi, k * k, level, slope, torque))


def sine_excess(x: Any) -> Array:
    """Sin x - x, by its series where that cancels.

    >>> abs(float(sine_excess(1e-5)) / (-1e-15 / 6 + 1e-25 / 120) - 1.0) < 1e-15
    True
    """
    x = np.asarray(x, float)
    small = np.abs(x) < 1.0
    square = np.where(small, x * x, 0.0)
    total = np.full(x.shape, EXCESS[-1])
    for coefficient in EXCESS[-2::-1]:
        total *= square
        total += coefficient
    total *= square * x
    return np.asarray(np.where(small, total, np.sin(x) - x))
