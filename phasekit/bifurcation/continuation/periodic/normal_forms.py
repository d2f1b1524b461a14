"""Normal forms of periodic orbits at folds, period doublings and tori.

On the center manifold of the orbit, with tau the time along it and xi the other coordinate,
dtau/dt = 1 + ... and

    fold              xi' = b (p - p0) + a xi^2
    period doubling   xi' = c xi^3
    torus             xi' = i omega xi + d xi |xi|^2

([Iooss1988]; [KuznetsovEtAl2005]). The coefficients are what makes linear equations solvable whose
operator is singular; bordered by the functions concerned, these equations give them as unknowns,
so that no adjoint function is needed. Critical functions have a mean square of 1 over a period.
Second and third derivatives of f are differences of its first ones along the critical functions.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from phasekit.bifurcation.continuation.periodic import collocation, kernels
from phasekit.bifurcation.continuation.periodic.cycles import Cycles, Orbit

Array = npt.NDArray[np.float64]

REACH = 2.0**-8  # of differences along a function, beside the sizes of the states


class Linear:
    """Linear equations along an orbit, in its own time: h' - A h + columns . unknowns = g."""

    def __init__(self, cycles: Cycles, orbit: Orbit) -> None:
        self.cycles, self.orbit, self.m = cycles, orbit, cycles.m
        n = self.n = cycles.n
        whole = self._jets(orbit.x)
        self.f = whole[:, :n]
        slopes = whole[:, n:].reshape(len(whole), n, -1)
        self.A = slopes[:, :, :n]
        self.by_parameter = slopes[:, :, -1]
        self._along: dict[bytes, tuple[Array, Array]] = {}

    def _jets(self, x: Array) -> Array:
        o = self.orbit
        return self.cycles.jets(o.mesh, x, o.y, self.m, self.cycles.sizes)

    def at(self, h: Array) -> Array:
        """Values of a function at all Gauss points, one after another."""
        return collocation.at_gauss(h, self.m).reshape(-1, h.shape[1])

    def bends(self, v: Array) -> tuple[Array, Array]:
        """First and second derivatives of the matrices f_x along a function."""
        key = v.tobytes()
        if key not in self._along:
            length = float(np.max(np.abs(v) / self.cycles.scale))
            h = REACH / length if length > 0.0 else 1.0
            n = self.n

            def matrix(k: float) -> Array:
                whole = self._jets(self.orbit.x + k * h * v)
                return whole[:, n:].reshape(len(whole), n, -1)[:, :, :n]

            (a, b), (c, d) = ((matrix(k), matrix(-k)) for k in (1.0, 2.0))
            first = (8.0 * (a - b) - (c - d)) / (12.0 * h)
            second = (16.0 * (a + b) - (c + d) - 30.0 * self.A) / (12.0 * h * h)
            self._along[key] = first, second
        return self._along[key]

    def second(self, v: Array, u: Array) -> Array:
        """B(v, u) at all Gauss points."""
        return np.asarray(np.einsum("kij,kj->ki", self.bends(v)[0], self.at(u)))

    def third(self, v: Array, u: Array) -> Array:
        """C(v, v, u) at all Gauss points."""
        return np.asarray(np.einsum("kij,kj->ki", self.bends(v)[1], self.at(u)))

    def times_A(self, v: Array) -> Array:
        """A v at all Gauss points."""
        return np.asarray(np.einsum("kij,kj->ki", self.A, self.at(v)))

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
        wide = n * parts
        count = len(self.A)
        jets = np.zeros((count, wide * (1 + wide + q)))
        jets[:, :wide] = g
        slopes = jets[:, wide:].reshape(count, wide, wide + q)
        for k in range(parts):
            here = slice(k * n, (k + 1) * n)
            slopes[:, here, here] = self.A
        if parts == 2:
            i = np.arange(n)
            slopes[:, i, n + i] = turn
            slopes[:, n + i, i] = -turn
        for k, column in enumerate(columns):
            slopes[:, :, wide + k] = -column
        c, o = collocation.scheme(self.m), self.orbit
        places = len(o.x)
        x, y = np.zeros((places, wide)), np.zeros(1 + q)
        y[0] = o.y[0]
        W = np.empty((o.intervals, self.m * wide, wide + q + 2))
        kernels.condense(
            jets,
            False,
            o.mesh,
            c.nodes,
            c.weights,
            c.value,
            c.slope,
            c.side,
            np.ones(wide),
            x,
            y,
            W,
        )
        border = np.zeros((1 + q, places, wide))
        border_y = np.zeros((1 + q, 1 + q))
        border_y[0, 0] = 1.0  # the period is what it is
        for k, row in enumerate(rows):
            border[1 + k] = collocation.functional(
                o.mesh, row.reshape(o.intervals, self.m, wide), self.m
            )
        sides = np.zeros(1 + q)
        if right is not None:
            sides[1:] = right
        dx, dy = np.empty((2, places, wide)), np.empty((2, 1 + q))
        kernels.solve(
            W, border, border_y, sides, np.zeros(wide), np.full(wide, sigma), self.m, dx,
            dy,
        )  # fmt: skip
        return dx[0], dy[0, 1:]

    def unit(self, v: Array) -> Array:
        """A function of mean square 1."""
        values = collocation.at_gauss(v, self.m)
        weights = np.diff(self.orbit.mesh)[:, None] * collocation.scheme(self.m).weights
        square = np.einsum("ji,jin,jin->", weights, values, values)
        return np.asarray(v / np.sqrt(square))


def at_fold(cycles: Cycles, orbit: Orbit, dx: Array, dy: Array) -> dict[str, float]:
    """The coefficients a and b of a fold, from the tangent of its family."""
    line = Linear(cycles, orbit)
    v = line.unit(dx)
    # v' = A v - rate F, where the family changes its period.
    rate = -float(dy[0]) / orbit.y[0] * float(np.max(np.abs(v)) / np.max(np.abs(dx)))
    at = line.at(v)
    if cycles.forced:
        columns, rows = [at], [at]
        rate = 0.0
    else:
        columns, rows = [at, line.f], [at, line.f]
    a = line.solve(0.5 * line.second(v, v) - rate * line.times_A(v), columns, rows)[1][0]
    b = line.solve(line.by_parameter, columns, rows)[1][0]
    return {"a": float(a), "b": float(b)}


def at_doubling(cycles: Cycles, orbit: Orbit, v: Array) -> dict[str, float]:
    """The coefficient c of a period doubling: the doubled orbits are stable beside it if c < 0."""
    line = Linear(cycles, orbit)
    v = line.unit(v)
    at = line.at(v)
    g = line.second(v, v)
    if cycles.forced:
        h, unknown = line.solve(g, [], [])
        a1 = 0.0
    else:
        h, unknown = line.solve(g, [line.f], [line.f])
        a1 = 0.5 * float(unknown[0])
    cubic = line.third(v, v) + 3.0 * line.second(v, h) - 6.0 * a1 * line.times_A(v)
    c = line.solve(cubic, [at], [at], sigma=-1.0)[1][0] / 6.0
    return {"c": float(c)}


def at_torus(cycles: Cycles, orbit: Orbit, angle: float) -> dict[str, float]:
    """The coefficient d of a torus bifurcation, of a pair of multipliers with an angle.

    The torus is stable beside it if the real part of d is negative.
    """
    line = Linear(cycles, orbit)
    n, omega = line.n, angle / orbit.y[0]
    v = wave(line, omega)
    u, w = np.ascontiguousarray(v[:, :n]), np.ascontiguousarray(v[:, n:])
    second = line.second
    g = second(u, u) + second(w, w)
    if cycles.forced:
        h, unknown = line.solve(g, [], [])
        a1 = 0.0
    else:
        h, unknown = line.solve(g, [line.f], [line.f])
        a1 = float(unknown[0])
    g = np.hstack([second(u, u) - second(w, w), 2.0 * second(u, w)])
    double, _ = line.solve(g, [], [], turn=2.0 * omega)
    p, q = np.ascontiguousarray(double[:, :n]), np.ascontiguousarray(double[:, n:])
    real = line.third(u, u) + line.third(w, u) + 2.0 * second(u, h) + second(u, p) + second(w, q)
    imaginary = line.third(u, w) + line.third(w, w) + 2.0 * second(w, h)
    imaginary += second(u, q) - second(w, p)
    real -= 2.0 * a1 * (line.times_A(u) + omega * line.at(w))
    imaginary -= 2.0 * a1 * (line.times_A(w) - omega * line.at(u))
    at = line.at(v)
    around = np.hstack([-at[:, n:], at[:, :n]])  # i v
    _, d = line.solve(np.hstack([real, imaginary]), [at, around], [at, around], turn=omega)
    return {"d": 0.5 * float(d[0]), "d_imag": 0.5 * float(d[1]), "angle": angle}


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
        at = line.at(v)
    return v
