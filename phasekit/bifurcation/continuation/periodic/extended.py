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

from dataclasses import dataclass, fields
from functools import cached_property
from typing import Any

import numpy as np
import numpy.typing as npt

from phasekit.bifurcation.continuation.periodic import collocation, lines
from phasekit.bifurcation.continuation.periodic.cycles import Cycles, Orbit
from phasekit.bifurcation.continuation.periodic.jets import Jets
from phasekit.bifurcation.continuation.periodic.multipliers import multipliers

Array = npt.NDArray[np.float64]
Complex = npt.NDArray[np.complex128]

FOLD, DOUBLING, TORUS = "fold_of_cycles", "period_doubling", "torus"


@dataclass(frozen=True, eq=False)
class Extended(Cycles):
    """Orbits with their critical functions, whose parts follow the states of the orbit."""

    kind: str = DOUBLING

    @property
    def own(self) -> int:
        """Number of states of the orbit itself."""
        return len(self.field.states)

    @property
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
        n = self.own
        kept = {f.name: getattr(self, f.name) for f in fields(Cycles)}
        for name in ("turns", "period", "scale"):
            kept[name] = kept[name][:n]
        for name in ("width", "low", "high", "active"):
            kept[name] = kept[name][:1]
        par = self.par.copy()
        par[self.active[1]] = second
        return Cycles(**{**kept, "par": par, "clock": 0, "events": (), "ends": ()})

    def own_period(self, y: Array) -> tuple[float, Array]:
        """The period of the forcing, and its derivatives by all of y after the period."""
        k = len(self.active)
        period, slope = super().own_period(y[: 1 + k])
        return period, np.append(slope, np.zeros(self.q - 1 - k))

    def rows(self, orbit: Orbit, dx: Array, dy: Array) -> tuple[Array, Array, Array]:
        """Bordering rows: phase or period, those of the function, direction."""
        rows, rows_y, _ = super().rows(orbit, dx, dy)
        n, m = self.own, self.m
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

    def multipliers(self, W: Array, orbit: Orbit) -> tuple[Complex, float, float]:
        """Floquet multipliers of the orbit itself."""
        n, last = self.own, (self.m - 1) * self.n
        values, log = multipliers(W[:, last : last + n, :n])
        return values, log, 0.0 if self.forced else float(np.min(np.abs(values - 1.0)))

    def resolving(self, orbit: Orbit, reach: float) -> Array | None:
        """The orbit has no other mesh than its function."""
        return None

    def divergence(self, found: float) -> float:
        """Integral of the trace of f_x, of which each part of the function has its own."""
        return found * self.own / self.n


class _Both:
    """Derivatives of the right-hand sides of an orbit and its critical function."""

    given, first = True, 0

    def __init__(self, cycles: Extended, jets: Jets) -> None:
        self.cycles, self.jets = cycles, jets
        self.mode, self.par, self.places, self.active = (
            jets.mode,
            jets.par,
            jets.places,
            jets.active,
        )

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
