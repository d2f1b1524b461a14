"""Curves of folds, period doublings and tori of cycles in two parameters.

The orbit x is followed together with its critical function, in one collocation problem
([KuznetsovEtAl2005]; [Doedel1991]):

    fold              v' = T (f_x v + kappa f),   v(1) = v(0),    mean(v . x') = 0
    period doubling   v' = T f_x v,               v(1) = -v(0)
    torus             v' = T (f_x v - i omega v), v(1) = v(0),    v complex

with the mean square of v held. Unknowns besides x and v are T, both parameters, and kappa or
omega. Derivatives of f_x v by x are differences of f_x along v.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, fields, replace
from functools import cached_property
from typing import Any

import numpy as np

from phasekit.arrays import Array, Complex
from phasekit.cycles import collocation, folds, lines
from phasekit.cycles.cycles import Cycles, Orbit, Solution, fields_alone
from phasekit.cycles.divergence import across, function, single
from phasekit.cycles.jets import GivenJets, Jets
from phasekit.cycles.linear import Linear
from phasekit.cycles.multipliers import known_multipliers, off_one

GROWN = 1e5  # factor by which a critical function changes, above which digits run short
RESTS = (
    "the orbit rests at an equilibrium: rounding of its states hides in which direction it goes "
    "on, and with it the critical function"
)
FOLD, DOUBLING, TORUS = "fold_of_cycles", "period_doubling", "torus"


@dataclass(frozen=True, eq=False)
class Extended(Cycles):
    """Orbits with their critical functions, whose parts follow the states of the orbit."""

    kind: str = DOUBLING

    @property
    def own(self) -> int:
        """Number of states of the orbit itself."""
        return len(self.field.states)

    @cached_property
    def q(self) -> int:
        """Number of free parameters, the period, and kappa or omega."""
        return 1 + len(self.width)

    @cached_property
    def closure(self) -> Array:
        """By what each state is multiplied after a period."""
        signs = np.ones(self.n)
        if self.kind == DOUBLING:
            signs[self.own :] = -1.0
        return signs

    @cached_property
    def jets(self) -> Any:
        """The right-hand side of the orbit and its function, with derivatives."""
        time = (len(self.par) - 1,) if self.forced else ()
        return _Both(self, Jets(self.field, self.par, (*time, *self.active), self.forced))

    def plain(self, second: float) -> Cycles:
        """The family of the orbits alone, at a value of the second parameter."""
        kept, par = fields_alone(self, Cycles, self.own, 1), self.par.copy()
        par[self.active[1]] = second
        kept |= {"active": self.active[:1], "par": par, "clock": 0, "events": (), "ends": ()}
        return Cycles(**kept)

    @property
    def moving(self) -> int:
        """Number of states with a part in tangents."""
        return self.n if self.folds is None else self.own

    @cached_property
    def folds(self) -> Cycles | None:
        """The orbits alone over both parameters, of folds whose multiplier is a single one."""
        if self.kind != FOLD or not single(self):
            return None
        kept = fields_alone(self, Cycles, self.own, 2)
        made = Cycles(**{**kept, "events": (), "ends": ()})
        made.__dict__["jets"] = self.jets.jets
        return made

    def correct(
        self, guess: Orbit, rows: Array, rows_y: Array, target: Array, *,
        iterations: int | None = None, damped: bool = False,
    ) -> Solution:  # fmt: skip
        """Newton's method, as of `Cycles`.

        Folds with a single multiplier are found by that; their function follows from the orbit.
        """
        if self.folds is None:
            solved = super().correct(
                guess, rows, rows_y, target, iterations=iterations, damped=damped
            )
            return (
                solved if solved.converged else replace(solved, message=self._lost(solved, guess))
            )
        n, y = self.own, guess.y
        alone = Orbit(guess.mesh, np.ascontiguousarray(guess.x[:, :n]), y[:3].copy())
        one = self.folds.sized(alone)
        held = target - np.einsum("rkn,kn->r", rows[:, :, n:], guess.x[:, n:])
        kept = [0, 1, len(y) - 1]
        found = folds.correct(
            one, alone, np.ascontiguousarray(rows[kept][:, :, :n]), rows_y[kept][:, :3],
            held[kept], iterations or self.options.max_iterations, damped,
        )  # fmt: skip
        if not found.converged:
            return replace(found, orbit=guess)
        orbit = found.orbit
        line = Linear(self.folds, orbit)
        beside = line.values(np.ascontiguousarray(guess.x[:, n:]))
        it = across(line)
        if it.moving:
            near, v, rate = function(it, self.scale[n:])
        if not (it.moving and np.all(np.isfinite(v))):
            return replace(found, orbit=guess, steps=0, message=RESTS)
        was, now = (
            float(line.weights @ np.sum((one / self.scale[n:]) ** 2, axis=1))
            for one in (beside, near)
        )
        part = np.sqrt(was / now)
        whole = Orbit(
            orbit.mesh, np.hstack([orbit.x, part * v]),
            np.append(orbit.y, np.full(len(y) - 3, -part * rate)),
        )  # fmt: skip
        # Its tangent is that of the orbits: the function has no part in how far they are apart.
        dx, dy = np.zeros_like(whole.x), np.zeros_like(y)
        dx[:, :n], dy[:3] = found.dx, found.dy
        length = self.length(orbit.mesh, dx, dy) or 1.0
        return replace(
            found, orbit=whole, dx=dx / length, dy=dy / length, length=length,
            divergence=found.divergence * self.n / n,
        )  # fmt: skip

    def _lost(self, found: Solution, guess: Orbit) -> str:
        """Why there is no orbit: its equations lose as many digits as its function grows by."""
        n, parts = self.own, guess.x[:, self.own :] / self.scale[self.own :]
        if not self.forced:
            flow = np.gradient(guess.x[:, :n], collocation.times(guess.mesh, self.m), axis=0)
            flow /= self.scale[:n]
            flow /= np.sqrt(np.sum(flow**2, axis=1, keepdims=True))
            for k in range(0, parts.shape[1], n):
                here = parts[:, k : k + n]
                parts[:, k : k + n] = here - np.sum(here * flow, axis=1, keepdims=True) * flow
        sizes = np.sqrt(np.sum(parts**2, axis=1))
        ratio = float(np.max(sizes) / np.min(sizes)) if np.min(sizes) > 0.0 else np.inf
        if not GROWN < ratio:
            return found.message
        return (
            f"{found.message}: the critical function changes by a factor of {ratio:.1g} or more "
            "along the orbit, as along canards, and its equations lose as many digits"
        )

    def own_period(self, y: Array) -> tuple[float, Array]:
        """The period of the forcing, and its derivatives by all of y after the period."""
        k = len(self.active)
        period, slope = super().own_period(y[: 1 + k])
        return period, np.append(slope, np.zeros(self.q - 1 - k))

    def rows(self, orbit: Orbit, dx: Array, dy: Array) -> tuple[Array, Array, Array]:
        """Bordering rows: phase or period, those of the function, direction."""
        n, m = self.own, self.m
        if self.folds is not None and np.any(dx[:, n:]):  # of a curve whose function was solved for
            dx = np.hstack([dx[:, :n], np.zeros_like(dx[:, n:])])
            length = self.length(orbit.mesh, dx, dy)
            dx, dy = dx / length, dy / length
        rows, rows_y, _ = super().rows(orbit, dx, dy)
        # The phase is that of the orbit alone; its function follows.
        rows[0, :, n:] = 0.0
        v = np.zeros_like(orbit.x)
        v[:, n:] = orbit.x[:, n:] / self.scale[n:] ** 2
        rows[1] = collocation.functional(orbit.mesh, collocation.at_gauss(v, m), m)
        more = np.zeros((orbit.intervals, m, self.n))
        if self.kind == FOLD and not self.forced:
            slope = collocation.slopes_at_gauss(orbit.mesh, orbit.x[:, :n], m)
            more[:, :, n:] = slope / self.scale[n:] ** 2
        if self.kind == TORUS:
            at = collocation.at_gauss(v, m)
            more[:, :, n : 2 * n], more[:, :, 2 * n :] = -at[:, :, 2 * n :], at[:, :, n : 2 * n]
        if self.q == 4:
            rows[2] = collocation.functional(orbit.mesh, more, m)
        target = np.einsum("rkn,kn->r", rows, orbit.x) + rows_y @ orbit.y
        if self.q == 4:
            target[2] = 0.0
        return rows, rows_y, target

    def multipliers(
        self, W: Array, orbit: Orbit, divergence: float = math.nan
    ) -> tuple[Complex, float, float]:
        """Floquet multipliers of the orbit itself."""
        if self.folds is not None:
            n = self.own
            alone = Orbit(orbit.mesh, np.ascontiguousarray(orbit.x[:, :n]), orbit.y[:3].copy())
            return self.folds.multipliers(W, alone, divergence)
        n, last = self.own, (self.m - 1) * self.n
        G = W[:, last : last + n, :n]
        divergence = self.resolved(G, orbit, divergence)
        values, log = known_multipliers(np.ascontiguousarray(G), divergence)
        return values, abs(log - divergence), 0.0 if self.forced else off_one(values)

    def reaches(self, orbit: Orbit) -> Array | None:
        """As of `Cycles`; an orbit that is solved for with its function has no other mesh."""
        if self.folds is None:
            return None
        n = self.own
        alone = Orbit(orbit.mesh, np.ascontiguousarray(orbit.x[:, :n]), orbit.y[:3].copy())
        return self.folds.reaches(alone)

    def on_finer(self, orbit: Orbit, dx: Array, dy: Array, allowed: float) -> Solution:
        """As of `Cycles`; folds go as orbits of a family whose tangent is their function."""
        if self.folds is None:
            return super().on_finer(orbit, dx, dy, allowed)
        n = self.own
        x, v = (np.ascontiguousarray(part) for part in (orbit.x[:, :n], orbit.x[:, n:]))
        one, y = self.folds, orbit.y[:3].copy()
        if not self.forced:
            one, y = self.plain(float(y[2])), y[:2]
        alone, along = Orbit(orbit.mesh, x, y), np.zeros(len(y))
        found = one.looked_at(alone, v, along)
        if not self.forced:
            solved = one.correct(alone, *one.rows(alone, v, along))
            found = solved if solved.converged else found
        whole = Orbit(orbit.mesh, found.orbit.x, orbit.y[:3].copy())
        whole.y[:2] = found.orbit.y[:2]
        return replace(found, orbit=whole, divergence=found.divergence * self.n / n)

    def divergence(self, found: float) -> float:
        """Integral of the trace of f_x, of which each part of the function has its own."""
        return found * self.own / self.n


class _Both(GivenJets):
    """Derivatives of the right-hand sides of an orbit and its critical function."""

    def __init__(self, cycles: Extended, jets: Jets) -> None:
        super().__init__(jets)
        self.cycles = cycles

    def __call__(self, mesh: Array, x: Array, y: Array, m: int, sizes: Array) -> Array:
        """Rows of f and its derivatives, at one Gauss point each."""
        c = self.cycles
        n, k, forced = c.own, len(c.active), c.forced
        parts = c.n // n - 1
        a = k + forced
        own = np.concatenate([sizes[:n], sizes[c.n : c.n + a]])
        more = c.q - 1 - k
        base, short = np.ascontiguousarray(x[:, :n]), y[: 1 + k]

        def matrices(at: Array) -> tuple[Array, Array]:
            found = self.jets(mesh, np.ascontiguousarray(at), short, m, own)
            return found[:, :n], found[:, n:].reshape(len(found), n, n + a)

        f, J = matrices(base)
        A = J[:, :, :n]
        count, wide = len(f), c.n
        out = np.zeros((count, wide * (1 + wide + a + more)))
        slopes = out[:, wide:].reshape(count, wide, wide + a + more)
        out[:, :n] = f
        # Bends of what is itself differences need no more digits than those have.
        rounding = lines.EPSILON if self.jets.exact else lines.DIFFERENCED
        noise = rounding * np.max(np.max(np.abs(J), axis=0) * own, axis=1)
        slopes[:, :n, :n], slopes[:, :n, wide : wide + a] = A, J[:, :, n:]
        for part in range(1, parts + 1):
            here = slice(part * n, (part + 1) * n)
            v = x[:, here]
            length = float(np.max(np.abs(v) / c.scale[:n]))
            bent = lines.slope_along(
                lambda k, v=v: matrices(base + k * v)[1],  # type: ignore[misc]
                lines.REACH / length if length > 0.0 else 1.0, noise, own,
            )  # fmt: skip
            at = collocation.at_gauss(v, m).reshape(count, n)
            out[:, here] = np.einsum("kij,kj->ki", A, at)
            slopes[:, here, :n], slopes[:, here, wide : wide + a] = bent[:, :, :n], bent[:, :, n:]
            slopes[:, here, here] = A
        if c.kind == FOLD and more:
            here = slice(n, 2 * n)
            out[:, here] += y[-1] * f
            slopes[:, here, :n] += y[-1] * A
            slopes[:, here, wide : wide + a] += y[-1] * J[:, :, n:]
            slopes[:, here, -1] = f
        if c.kind == TORUS:
            u, w = slice(n, 2 * n), slice(2 * n, 3 * n)
            at = collocation.at_gauss(x, m).reshape(count, wide)
            i = np.arange(n)
            out[:, u] += y[-1] * at[:, w]
            out[:, w] -= y[-1] * at[:, u]
            slopes[:, n + i, 2 * n + i] += y[-1]
            slopes[:, 2 * n + i, n + i] -= y[-1]
            slopes[:, u, -1], slopes[:, w, -1] = at[:, w], -at[:, u]
        return out


def extended(
    cycles: Cycles, kind: str, second: int, span: tuple[float, float], clock: int,
    first: tuple[float, float],
) -> Extended:  # fmt: skip
    """The family of special orbits of a kind, with a second parameter free."""
    n = cycles.n
    parts = 2 if kind == TORUS else 1
    more = 0 if kind == DOUBLING or (kind == FOLD and cycles.forced) else 1
    kept = {f.name: getattr(cycles, f.name) for f in fields(Cycles)}
    low = np.array([first[0], span[0], *[-np.inf] * more])
    high = np.array([first[1], span[1], *[np.inf] * more])
    kept |= {
        "ends": (),
        "active": (cycles.active[0], second),
        "clock": clock,
        "turns": np.append(cycles.turns, np.zeros(parts * n)),
        "period": np.append(cycles.period, np.zeros(parts * n)),
        "scale": np.tile(cycles.scale, 1 + parts),
        "width": np.array([cycles.width[0], span[1] - span[0], *[np.inf] * more]),
        "low": low,
        "high": high,
    }
    return Extended(**kept, kind=kind)
