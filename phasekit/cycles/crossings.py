"""Curves of branch points of cycles, in three parameters or, where they persist, in two.

Families cross where the equations of the orbit x, with the period T and the first parameter p among
the unknowns, leave out a direction: that of an adjoint function w ([Doedel1991]; [Govaerts2000]
chapter 3),

    x' = T (f + b w),    w' = -T (f_x^T w + kappa f),    w(1) = w(0),
    mean(w . f) = 0,     mean(w . f_p) = 0,              mean |w|^2 held,

on scaled axes. Of a forced system T goes with p, and there is no kappa nor the first mean. Kappa is
zero: of any orbit w . f is the same all along, so that one of the equations follows from the
others. Of two parameters b is free, and has to stay zero; of three it is.
"""

from __future__ import annotations

from dataclasses import dataclass, fields, replace
from functools import cached_property
from typing import Any

import numpy as np

from phasekit.arrays import Array
from phasekit.cycles import collocation, lines
from phasekit.cycles.cycles import Cycles, Orbit, Solution
from phasekit.cycles.extended import Extended
from phasekit.cycles.functionals import Rows
from phasekit.cycles.jets import GivenJets, Jets
from phasekit.cycles.linear import Linear
from phasekit.cycles.point import Point

BRANCHING = "cycle_branch_point"
UNFOLDED = 1e-6  # size of b w beside f from which on the families do not cross
STEP = 2.0**-10  # part of a parameter's span over which the period of a forcing is differenced
ITERATIONS = 3  # of the first adjoint function


@dataclass(frozen=True, eq=False)
class Crossings(Extended):
    """Orbits at which families cross, with adjoint functions.

    Behind the period and the parameters stand b, if two of them are free, and kappa.
    """

    kind: str = BRANCHING

    def __post_init__(self) -> None:
        """Know the right-hand side on the first scales."""
        self.jets  # noqa: B018

    @property
    def unfolds(self) -> bool:
        """Whether b is among the unknowns."""
        return len(self.active) == 2

    @cached_property
    def jets(self) -> Any:
        """The right-hand side of the orbit and its adjoint function, with derivatives."""
        time = (len(self.par) - 1,) if self.forced else ()
        return _Adjoint(self, Jets(self.field, self.par, (*time, *self.active), self.forced))

    def correct(
        self, guess: Orbit, rows: Array, rows_y: Array, target: Array, *,
        iterations: int | None = None, damped: bool = False,
    ) -> Solution:  # fmt: skip
        """Newton's method, as of `Cycles`; where b is not zero no families cross."""
        found = super().correct(guess, rows, rows_y, target, iterations=iterations, damped=damped)
        o = found.orbit
        A = self.jets.slopes_at(o)[1][:, :, : self.own]
        trace = float(o.y[0] * _weights(o, self.m) @ np.trace(A, axis1=1, axis2=2))
        found = replace(found, divergence=trace * self.n / self.own)
        if found.converged and self.unfolds and self.apart(o, o.y) > UNFOLDED:
            return replace(found, steps=0, message="no families cross nearby: b w is not zero")
        return found

    def apart(self, orbit: Orbit, y: Array) -> float:
        """Size of b w beside f, with the b of y."""
        n, S = self.own, self.scale[: self.own]
        f = self.jets.slopes_at(orbit)[0]
        w = np.max(np.abs(orbit.x[:, n:]) / S)
        return float(abs(y[3]) * w / np.max(np.abs(f) / S))

    def rows(self, orbit: Orbit, dx: Array, dy: Array) -> Rows:
        """Bordering rows: phase or period, size of the function, both means, direction."""
        n, m = self.own, self.m
        rows, rows_y, target = Cycles.rows(self, orbit, dx, dy)
        rows[0, :, n:] = 0.0
        v = np.zeros_like(orbit.x)
        v[:, n:] = orbit.x[:, n:] / self.scale[n:] ** 2
        rows[1] = collocation.functional(orbit.mesh, collocation.at_gauss(v, m), m)
        target = np.einsum("rkn,kn->r", rows, orbit.x) + rows_y @ orbit.y
        return self.rows_beside(orbit, rows, rows_y, target)

    def rows_beside(self, orbit: Orbit, rows: Array, rows_y: Array, target: Array) -> Rows:
        """The rows with both means linear beside an orbit."""
        rows, rows_y, target = rows.copy(), rows_y.copy(), target.copy()
        n, k, m, S = self.own, len(self.active), self.m, self.jets.scale
        f, J, D = self.jets.derivatives(orbit)
        weights = _weights(orbit, m)
        w = collocation.at_gauss(orbit.x[:, n:], m).reshape(-1, n) / S**2

        def fill(row: int, g: Array, by: Array, by_period: Array) -> None:
            """The row of mean(w . g), with derivatives of g by states and parameters, and T."""
            own = np.einsum("ki,kij->kj", w, by)
            values = np.hstack([own[:, :n], g / S**2]).reshape(-1, m, 2 * n)
            rows[row] = collocation.functional(orbit.mesh, values, m)
            rows_y[row] = 0.0
            rows_y[row, 1 : 1 + k] = weights @ own[:, n:]
            rows_y[row, 0] = weights @ np.sum(w * by_period, axis=1)
            value = weights @ np.sum(w * g, axis=1)
            target[row] = np.sum(rows[row] * orbit.x) + rows_y[row] @ orbit.y - value

        if not self.forced:
            fill(2, J[:, :, n], np.moveaxis(D[:, :, :, n], 0, 2), np.zeros_like(f))
            fill(3, f, J, np.zeros_like(f))
            return rows, rows_y, target
        # With the parameter time goes by as the period does.
        stretch, more = self._stretch(orbit.y[: 1 + k])
        s = _times(orbit, m)[:, None]
        t, J_t, D_t = orbit.y[0] * s, J[:, :, n], D[n]
        g = J[:, :, n + 1] + stretch * (f + t * J_t)
        by = D[:, :, :, n + 1] + stretch * (np.moveaxis(J, 2, 0) + t * D[:, :, :, n])
        by[n + 1 :] += more[:, None, None] * (f + t * J_t)
        by_period = s * (D_t[:, :, n + 1] + stretch * (J_t + t * D_t[:, :, n])) + stretch * s * J_t
        fill(2, g, np.moveaxis(np.delete(by, n, axis=0), 0, 2), by_period)
        return rows, rows_y, target

    def _stretch(self, y: Array) -> tuple[float, Array]:
        """By what part the period of the forcing grows with the first parameter, and its slopes."""

        def part(y: Array) -> float:
            period, slope = Cycles.own_period(self, y)
            return float(slope[0]) / period

        found = np.zeros(len(self.active))
        for i, width in enumerate(self.width[: len(self.active)].tolist()):
            h = np.zeros_like(y)
            h[1 + i] = STEP * width
            found[i] = (part(y + h) - part(y - h)) / (2.0 * STEP * width)
        return part(y), found


def _weights(orbit: Orbit, m: int) -> Array:
    """Weights of all Gauss points, of which the whole is 1."""
    return np.outer(np.diff(orbit.mesh), collocation.scheme(m).weights).ravel()


def _times(orbit: Orbit, m: int) -> Array:
    """Times of all Gauss points."""
    inside = np.diff(orbit.mesh)[:, None] * collocation.scheme(m).nodes
    return np.asarray((orbit.mesh[:-1, None] + inside).ravel())


class _Adjoint(GivenJets):
    """Derivatives of the right-hand sides of an orbit and its adjoint function."""

    def __init__(self, cycles: Crossings, jets: Jets) -> None:
        super().__init__(jets)
        self.m, self.n, self.forced = cycles.m, cycles.own, cycles.forced
        self.unfolds, self.count = cycles.unfolds, len(cycles.active)
        self.scale = cycles.scale[: self.n].copy()
        self.sizes = np.concatenate(
            [self.scale, np.ones(int(self.forced)), cycles.width[: self.count]]
        )  # fmt: skip
        self._last: tuple[Orbit, tuple[Array, Array, Array]] | None = None

    def slopes_at(self, orbit: Orbit, moved: int = -1, by: float = 0.0) -> tuple[Array, Array]:
        """F and its derivatives at all Gauss points; with one of its arguments moved."""
        n, mesh, y = self.n, orbit.mesh, orbit.y[: 1 + self.count].copy()
        x = orbit.x[:, :n].copy()
        if 0 <= moved < n:
            x[:, moved] += by
        elif self.forced and moved == n:
            mesh = mesh + by / y[0]
        elif moved >= 0:
            y[1 + moved - n - self.forced] += by
        found = self.jets(mesh, x, y, self.m, self.sizes)
        return found[:, :n], found[:, n:].reshape(len(found), n, -1)

    def derivatives(self, orbit: Orbit) -> tuple[Array, Array, Array]:
        """F, its derivatives, and how these change with each of its arguments."""
        if self._last is not None:
            last, known = self._last
            same = all(
                np.array_equal(getattr(last, name), getattr(orbit, name))
                for name in ("mesh", "x", "y")
            )
            if same:
                return known
        with np.errstate(all="ignore"):
            known = self._derivatives(orbit)
        self._last = Orbit(orbit.mesh.copy(), orbit.x.copy(), orbit.y.copy()), known
        return known

    def _derivatives(self, orbit: Orbit) -> tuple[Array, Array, Array]:
        f, J = self.slopes_at(orbit)
        sizes = self.sizes.copy()
        if self.forced:
            sizes[self.n] = orbit.y[0]
        rounding = lines.EPSILON if self.jets.exact else lines.DIFFERENCED
        noise = rounding * np.max(np.max(np.abs(J), axis=0) * sizes, axis=1)
        D = np.array([
            lines.slope_along(
                lambda h, i=i: self.slopes_at(orbit, i, h)[1],  # type: ignore[misc]
                lines.REACH * size, noise, sizes,
            )
            for i, size in enumerate(sizes.tolist())
        ])  # fmt: skip
        return f, J, D

    def __call__(self, mesh: Array, x: Array, y: Array, m: int, sizes: Array) -> Array:
        """Rows of f and its derivatives, at one Gauss point each."""
        n, S = self.n, self.scale
        f, J, D = self.derivatives(Orbit(mesh, x, y))
        count, a = len(f), J.shape[2] - n
        w = collocation.at_gauss(x[:, n:], m).reshape(count, n)
        wide = 2 * n + a + self.unfolds + (not self.forced)
        out = np.zeros((count, 2 * n * (1 + wide)))
        slopes = out[:, 2 * n :].reshape(count, 2 * n, wide)
        adjoint = -np.swapaxes(J[:, :, :n], 1, 2) * S[:, None] ** 2 / S**2
        out[:, :n], out[:, n : 2 * n] = f, np.einsum("kij,kj->ki", adjoint, w)
        bent = -np.einsum("jkil,ki->klj", D[:, :, :, :n], w / S**2) * S[:, None] ** 2
        slopes[:, :n, :n], slopes[:, :n, 2 * n : 2 * n + a] = J[:, :, :n], J[:, :, n:]
        slopes[:, n:, :n], slopes[:, n:, 2 * n : 2 * n + a] = bent[:, :, :n], bent[:, :, n:]
        slopes[:, n:, n : 2 * n] = adjoint
        if self.unfolds:
            b = y[1 + self.count]
            out[:, :n] += b * w
            slopes[:, :n, n : 2 * n] += b * np.eye(n)
            slopes[:, :n, 2 * n + a] = w
        if not self.forced:
            kappa = y[-1]
            out[:, n : 2 * n] += kappa * f
            slopes[:, n:, :n] += kappa * J[:, :, :n]
            slopes[:, n:, 2 * n : 2 * n + a] += kappa * J[:, :, n:]
            slopes[:, n:, -1] = f
        return out


def crossings_of(
    cycles: Cycles, here: Point, more: dict[int, float], spans: list[tuple[float, float]],
    clock: int,
) -> tuple[Crossings, Orbit]:  # fmt: skip
    """The branch points of a family over more parameters, and the one at hand with its function.

    ``more`` are places of the parameters and their values, ``spans`` those of the first and these.
    """
    nothing = np.zeros(cycles.n)
    kept = {f.name: getattr(cycles, f.name) for f in fields(Cycles)}
    low, high = np.array(spans).T
    free = np.full((len(more) == 1) + (not cycles.forced), np.inf)
    kept |= {
        "ends": (),
        "active": (cycles.active[0], *more),
        "clock": clock,
        "turns": np.append(cycles.turns, nothing),
        "period": np.append(cycles.period, nothing),
        "scale": np.tile(cycles.scale, 2),
        "width": np.concatenate([cycles.width[:1], high[1:] - low[1:], free]),
        "low": np.append(low, -free),
        "high": np.append(high, free),
    }
    orbit = here.orbit
    x = np.hstack([orbit.x, _function(cycles, orbit)])
    y = np.concatenate([orbit.y, list(more.values()), np.zeros(len(free))])
    return Crossings(**kept), Orbit(orbit.mesh, x, y)


def _function(cycles: Cycles, orbit: Orbit) -> Array:
    """The adjoint function of a branch point, of mean square 1 on scaled axes."""
    line, S = Linear(cycles, orbit), cycles.scale
    line.A = -np.swapaxes(line.A, 1, 2) * S[:, None] ** 2 / S**2
    flow = [] if cycles.forced else [line.f]
    at = column = np.random.default_rng(7).standard_normal(line.f.shape) * S
    for _ in range(ITERATIONS):
        right = np.array([0.0] * len(flow) + [1.0])
        w, _ = line.solve(
            np.zeros_like(line.f), [*flow, column], [*(f / S**2 for f in flow), at / S**2],
            right=right,
        )  # fmt: skip
        nothing = np.zeros(cycles.q)
        w = w / np.sqrt(cycles.inner(orbit.mesh, w, w, nothing, nothing))
        at = column = line.values(w)
    return np.asarray(w)
