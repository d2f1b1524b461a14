"""Linear equations along a periodic orbit, and derivatives of f_x along functions of it."""

from __future__ import annotations

from functools import cached_property

import numpy as np

from phasekit.arrays import Array
from phasekit.cycles import collocation, wide
from phasekit.cycles.cycles import Cycles, Orbit
from phasekit.cycles.multilinear import OfMatrices, OfValues
from phasekit.errors import ParameterError
from phasekit.numerics.memory import human, room_short_of

STORED = 5  # matrices an interval of the elimination, beside those of its places
COPIES = 8  # matrices a place, of derivatives and their forms


def lacking_memory(cycles: Cycles, intervals: int) -> str:
    """Why linear equations along an orbit on so many intervals cannot be made; empty if they can.

    They are matrices of all states at each point of its mesh, also of very many states.
    """
    needed = 8 * cycles.n**2 * intervals * (COPIES * cycles.m + STORED)
    room = room_short_of(needed)
    if room is None:
        return ""
    return f"linear equations along an orbit would take {human(needed)}, {human(room)} are free"


class Linear:
    """Linear equations along an orbit, in its own time: h' - A h + columns . unknowns = g.

    A ``variant`` of the second and third derivatives is off by about their errors.
    """

    def __init__(self, cycles: Cycles, orbit: Orbit, variant: int = 0) -> None:
        lacking = lacking_memory(cycles, orbit.intervals)
        if lacking:
            raise ParameterError(f"states: got {cycles.n:,}, wants fewer: {lacking}")
        self.variant = variant
        self.size = 0.0
        self.cycles, self.orbit, self.m = cycles, orbit, cycles.m
        n = self.n = cycles.n
        whole = self._jets(orbit.x)
        self.f = whole[:, :n]
        self.slopes = whole[:, n:].reshape(len(whole), n, -1)
        self.A = self.slopes[:, :, :n]

    def _jets(self, x: Array, y: Array | None = None) -> Array:
        o = self.orbit
        return self.cycles.jets(o.mesh, x, o.y if y is None else y, self.m, self.cycles.sizes)

    def by_parameter(self, stretch: float) -> Array:
        """Derivative of f by the parameter, at all Gauss points.

        With the parameter the period grows by a part, ``stretch``; of a forced system time, too.
        """
        found = self.slopes[:, :, -1] + stretch * self.f
        if self.cycles.forced:
            time = stretch * self.orbit.y[0] * self.times[:, None]
            found = found + time * self.slopes[:, :, self.n]
        return np.asarray(found)

    def values(self, h: Array) -> Array:
        """Values of a function at all Gauss points, one after another."""
        return collocation.at_gauss(h, self.m).reshape(-1, h.shape[1])

    def second(self, v: Array, u: Array) -> Array:
        """B(v, u) at all Gauss points."""
        return self._forms.second(v, np.zeros(1), u, self.variant)

    def third(self, v: Array, u: Array) -> Array:
        """C(v, v, u) at all Gauss points."""
        return self._forms.third(v, u, self.variant)

    def moved(self, dx: Array, dy: Array, u: Array) -> Array:
        """Derivative of f_x u along a family, as period and parameter change, too."""
        return self._forms.second(dx, dy, u, self.variant)

    @cached_property
    def _forms(self) -> OfMatrices | OfValues:
        cycles, o = self.cycles, self.orbit
        if not cycles.jets.exact:
            u = self._wide(o.x, o.y)
            return OfValues(cycles.jets.values, self._wide, u, cycles.sizes, self.slopes)

        def matrices(dx: Array, dy: Array) -> Array:
            whole = self._jets(o.x + dx, o.y + dy)
            return whole[:, self.n :].reshape(self.slopes.shape)[:, :, : self.n]

        return OfMatrices(matrices, self.values, cycles.scale, cycles.width)

    def _wide(self, v: Array, y: Array) -> Array:
        """States and active parameters at all Gauss points; of a forced system with its time."""
        out = np.zeros((len(self.A), self.slopes.shape[2]))
        out[:, : self.n] = self.values(v)
        if self.cycles.forced:
            out[:, self.n] = y[0] * self.times
        out[:, out.shape[1] - len(y) + 1 :] = y[1:]
        return out

    @cached_property
    def times(self) -> Array:
        """Gauss points."""
        mesh = self.orbit.mesh
        inside = np.diff(mesh)[:, None] * collocation.scheme(self.m).nodes
        return np.asarray((mesh[:-1, None] + inside).ravel())

    @cached_property
    def weights(self) -> Array:
        """Weights of all Gauss points, of which the whole is 1."""
        return np.asarray(
            np.outer(np.diff(self.orbit.mesh), collocation.scheme(self.m).weights).ravel()
        )

    def total(self, v: Array, *terms: Array) -> Array:
        """The sum of the terms that give a coefficient of v.

        ``size`` is that of the coefficient, did they not cancel.
        """
        scale = np.tile(self.cycles.scale, v.shape[1] // self.n)
        sizes = (float(np.sqrt(np.mean((one / scale) ** 2))) for one in (self.values(v), *terms))
        whole = next(sizes)
        self.size = sum(sizes) / whole if whole > 0.0 else 0.0
        return np.asarray(sum(terms))

    def times_A(self, v: Array) -> Array:
        """A v at all Gauss points."""
        return np.asarray(np.einsum("kij,kj->ki", self.A, self.values(v)))

    def solve(
        self, g: Array, columns: list[Array], rows: list[Array], sigma: float = 1.0,
        turn: float = 0.0,
        right: Array | None = None,
    ) -> tuple[Array, Array]:  # fmt: skip
        """H and the unknowns, with mean(row . h) = right, or 0; one column for each row.

        With a turn, h is complex: its parts stand one after another, and h' + i turn h - A h is
        what is meant.
        """
        n, q, parts = self.n, len(columns), 1 if turn == 0.0 else 2
        total = n * parts
        count = len(self.A)
        jets = np.zeros((count, total * (1 + total + q)))
        jets[:, :total] = g
        slopes = jets[:, total:].reshape(count, total, total + q)
        for k in range(parts):
            here = slice(k * n, (k + 1) * n)
            slopes[:, here, here] = self.A
        if parts == 2:
            i = np.arange(n)
            slopes[:, i, n + i] = turn
            slopes[:, n + i, i] = -turn
        for k, column in enumerate(columns):
            slopes[:, :, total + k] = -column
        W = self._condensed(jets, total, q)
        o = self.orbit
        places = len(o.x)
        border = np.zeros((1 + q, places, total))
        border_y = np.zeros((1 + q, 1 + q))
        border_y[0, 0] = 1.0  # the period is what it is
        for k, row in enumerate(rows):
            border[1 + k] = collocation.functional(
                o.mesh, row.reshape(o.intervals, self.m, total), self.m
            )
        sides = np.zeros(1 + q)
        if right is not None:
            sides[1:] = right
        dx, dy = np.empty((2, places, total)), np.empty((2, 1 + q))
        sign = wide.solve(
            W, border, border_y, sides, np.zeros(total), np.full(total, sigma), self.m, dx,
            dy,
        )  # fmt: skip
        if sign == 0.0:  # singular still: there is no such coefficient
            dx[:], dy[:] = np.nan, np.nan
        return dx[0], dy[0, 1:]

    def bounded(self, column: Array, ends: tuple[Array, Array], row: Array) -> tuple[Array, float]:
        """H with mean(row . h) = 1 that is orthogonal to vectors at its ends; the unknown.

        They are given in rows, as many as there are states.
        """
        n, o = self.n, self.orbit
        jets = np.zeros((len(self.A), n * (2 + n)))
        slopes = jets[:, n:].reshape(len(self.A), n, n + 1)
        slopes[:, :, :n], slopes[:, :, n] = self.A, -column
        W = self._condensed(jets, n, 1)
        border = np.zeros((n + 2, len(o.x), n))
        first = 1 + len(ends[0])
        border[1:first, 0], border[first:-1, -1] = ends
        at = row.reshape(o.intervals, self.m, n)
        border[-1] = collocation.functional(o.mesh, at, self.m)
        border_y, right = np.zeros((n + 2, 2)), np.zeros(n + 2)
        border_y[0, 0] = right[-1] = 1.0  # the time is what it is
        none = np.zeros(n)
        dx, dy = np.empty((2, len(o.x), n)), np.empty((2, 2))
        if wide.solve(W, border, border_y, right, none, none, self.m, dx, dy) == 0.0:
            dx[:], dy[:] = np.nan, np.nan
        return dx[0], float(dy[0, 1])

    def _condensed(self, jets: Array, total: int, unknowns: int) -> Array:
        """The condensed equations of so many states and unknowns, from their derivatives."""
        c, o = collocation.scheme(self.m), self.orbit
        x, y = np.zeros((len(o.x), total)), np.zeros(1 + unknowns)
        y[0] = o.y[0]
        W = np.empty((o.intervals, self.m * total, total + unknowns + 2))
        wide.condense(
            jets, False, o.mesh, c.nodes, c.weights, c.value, c.slope, c.side, np.ones(total), x,
            y, W,
        )  # fmt: skip
        return W

    def across(self, v: Array) -> tuple[Array, float]:
        """A critical function without a part along the flow, of mean square 1; and its alpha.

        v' = A v - alpha f: a part along f, a shift of time, leaves that as it is.
        """
        at, alpha = self.values(self.unit(v)), 0.0
        for _ in range(2):
            nothing = np.zeros_like(self.f)
            v, unknowns = self.solve(
                nothing, [at, self.f], [at, self.f], right=np.array([1.0, 0.0])
            )
            one = self.unit(v)
            alpha = float(unknowns[1] * np.max(np.abs(one)) / np.max(np.abs(v)))
            at = self.values(one)
        return one, alpha

    def unit(self, v: Array) -> Array:
        """A function of mean square 1."""
        values = collocation.at_gauss(v, self.m)
        weights = np.diff(self.orbit.mesh)[:, None] * collocation.scheme(self.m).weights
        square = np.einsum("ji,jin,jin->", weights, values, values)
        return np.asarray(v / np.sqrt(square))


def wave(line: Linear, omega: float) -> Array:
    """The periodic v = u + i w with v' + i omega v = A v, of mean square 1, parts side by side."""
    n = line.n
    count = len(line.A)
    at = np.random.default_rng(7).standard_normal((count, 2 * n))
    for _ in range(3):
        around = np.hstack([-at[:, n:], at[:, :n]])
        v, _ = line.solve(
            np.zeros((count, 2 * n)), [at, around], [at, around], turn=omega,
            right=np.array([1.0, 0.0]),
        )  # fmt: skip
        v = line.unit(v)
        at = line.values(v)
    return v
