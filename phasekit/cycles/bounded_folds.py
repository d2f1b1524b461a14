"""Curves of folds of solutions with conditions, in two parameters.

The solution x is followed together with the function along which it stands still as the first
parameter does, in one collocation problem ([Doedel1991]):

    v' = T (f_x v + f_r w),    the conditions linear along (v, w) = 0,    mean |v|^2 + |w|^2 held

where r are the parameters that the conditions free, and w by how much they move. Derivatives of
f_x v + f_r w, and of the linear conditions, are differences along (v, w). Along v the first
parameter goes with the square of the distance; where it does not, at a cusp, two folds meet.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, fields
from functools import cached_property
from typing import Any

import numpy as np

from phasekit.arrays import Array
from phasekit.bifurcation.special_points import look_for
from phasekit.cycles import collocation, lines, wide
from phasekit.cycles.bounded import Bounded
from phasekit.cycles.cycles import Orbit, fields_alone
from phasekit.cycles.functionals import Rows
from phasekit.cycles.jets import GivenJets, Jets
from phasekit.cycles.on_curves import OrbitTest
from phasekit.cycles.point import Point

FOLD = "fold"


@dataclass(frozen=True, eq=False)
class BoundedFolds(Bounded):
    """Solutions at folds with their critical functions, whose parts follow the states.

    Free are the parameter of the family, the second one, those that the conditions free, and how
    these move along the function.
    """

    kind: str = FOLD

    def __post_init__(self) -> None:
        """Know the right-hand side on the first scales."""
        self.jets  # noqa: B018

    @property
    def own(self) -> int:
        """Number of states of the solution itself."""
        return len(self.field.states)

    @cached_property
    def q(self) -> int:
        """Number of the time, the free parameters, and how those that follow move."""
        return 1 + len(self.width)

    @property
    def bordering(self) -> int:
        """Number of bordering rows: time, conditions and these once more, size, direction."""
        return 3 + 2 * self._held

    @cached_property
    def _held(self) -> int:
        return sum(one.count for one in self.conditions) + len(self.holds)

    @cached_property
    def jets(self) -> Any:
        """The right-hand side of the solution and its function, with derivatives."""
        return _Along(self, Jets(self.field, self.par, self.active, self.forced))

    @cached_property
    def plain(self) -> Bounded:
        """The solutions alone, over the same parameters."""
        return Bounded(**fields_alone(self, Bounded, self.own, len(self.active)))

    def parted(self, orbit: Orbit) -> tuple[Orbit, Array, Array]:
        """The solution alone, its function, and by how much all free parameters move along it."""
        n, k = self.own, 1 + len(self.active)
        dy = np.zeros(k)
        dy[3:] = orbit.y[k:]
        alone = Orbit(orbit.mesh, np.ascontiguousarray(orbit.x[:, :n]), orbit.y[:k].copy())
        return alone, np.ascontiguousarray(orbit.x[:, n:]), dy

    def rows(self, orbit: Orbit, dx: Array, dy: Array) -> Rows:
        """Bordering rows: time, conditions, these along the function, its size, direction."""
        rows, rows_y, target = super().rows(orbit, dx, dy)
        n, k = self.own, 1 + len(self.active)
        v = np.zeros_like(orbit.x)
        v[:, n:] = orbit.x[:, n:] / self.scale[n:] ** 2
        rows[-2] = collocation.functional(orbit.mesh, collocation.at_gauss(v, self.m), self.m)
        rows_y[-2] = 0.0
        rows_y[-2, k:] = orbit.y[k:] / self.width[2 : k - 1] ** 2
        target[-2] = np.sum(rows[-2] * orbit.x) + rows_y[-2] @ orbit.y
        return rows, rows_y, target

    def rows_beside(self, orbit: Orbit, rows: Array, rows_y: Array, target: Array) -> Rows:
        """The rows with the time as it is, and the conditions linear beside an orbit."""
        rows, rows_y, target = rows.copy(), rows_y.copy(), target.copy()
        n, k, count = self.own, 1 + len(self.active), self._held
        alone, v, dy = self.parted(orbit)
        rows[0], rows_y[0], target[0] = 0.0, np.eye(self.q)[0], self.duration
        here, there = slice(1, 1 + count), slice(1 + count, 1 + 2 * count)
        by, by_y, values = self._conditions(alone)
        bent, bent_y = self._bent(alone, v, dy)
        rows[here], rows_y[here], rows[there], rows_y[there] = 0.0, 0.0, 0.0, 0.0
        rows[here, :, :n], rows_y[here, :k] = by, by_y
        rows[there, :, :n], rows_y[there, :k] = bent, bent_y
        rows[there, :, n:], rows_y[there, k:] = by, by_y[:, 3:]
        off = np.concatenate([values, np.einsum("rkn,kn->r", by, v) + by_y @ dy])
        both = slice(1, 1 + 2 * count)
        at = np.einsum("rkn,kn->r", rows[both], orbit.x) + rows_y[both] @ orbit.y
        target[both] = at - off
        return rows, rows_y, target

    def _conditions(self, alone: Orbit) -> Rows:
        """Derivatives of all that holds, and its values."""
        one = self.plain
        found = [condition.linear(one, alone) for condition in self.conditions]
        for held in self.holds:
            by, by_y, value = held.linear(one, alone)
            found.append((by[None], by_y[None], np.array([value])))
        rows, rows_y, values = (np.concatenate(part) for part in zip(*found, strict=True))
        return rows, rows_y, values

    def _bent(self, alone: Orbit, v: Array, dy: Array) -> tuple[Array, Array]:
        """How these derivatives change along the function."""
        one = self.plain
        size = float(np.max(np.abs(v) / one.scale))
        h = lines.REACH / size if size > 0.0 else 1.0

        def moved(k: float) -> tuple[Array, Array]:
            return self._conditions(Orbit(alone.mesh, alone.x + k * v, alone.y + k * dy))[:2]

        ends = {k: moved(k * h) for k in (-2.0, -1.0, 1.0, 2.0)}
        near, wide = (
            [(ends[k][i] - ends[-k][i]) / (2.0 * k * h) for i in (0, 1)] for k in (1.0, 2.0)
        )
        rows, rows_y = ((4.0 * a - b) / 3.0 for a, b in zip(near, wide, strict=True))
        return rows, rows_y


def bend(folds: BoundedFolds, point: Point) -> tuple[float, float]:
    """The second derivative of the first parameter along the family, in spans; its size.

    That of the solution, which follows, has no part along the function.
    """
    n, m, a = folds.own, folds.m, len(folds.active)
    orbit = point.orbit
    alone, v, dy = folds.parted(orbit)
    jets = folds.jets(orbit.mesh, orbit.x, orbit.y, m, folds.sizes)
    slopes = jets[:, 2 * n :].reshape(len(jets), 2 * n, -1)
    values = collocation.at_gauss(v, m)
    bent = np.einsum("kij,kj->ki", slopes[:, n:, :n], values.reshape(-1, n))
    bent += slopes[:, n:, 2 * n : 2 * n + a] @ dy[1:]
    rows_bent, y_bent = folds._bent(alone, v, dy)
    off = np.einsum("rkn,kn->r", rows_bent, v) + y_bent @ dy
    by, by_y, _ = folds._conditions(alone)
    # Free are the first parameter and those that follow; the second one stays.
    linear = slopes[:, :n, [*range(n), 2 * n, *range(2 * n + 2, 2 * n + a)]]
    free, count = [0, 1, *range(3, 1 + a)], len(by)
    rows, rows_y = np.zeros((count + 2, *alone.x.shape)), np.zeros((count + 2, a))
    rows[1:-1], rows_y[1:-1], rows_y[0, 0] = by, by_y[:, free], 1.0
    rows[-1] = collocation.functional(orbit.mesh, values / folds.scale[:n] ** 2, m)
    rows_y[-1, 2:] = dy[3:] / folds.width[2:a] ** 2
    c, nothing = collocation.scheme(m), np.zeros(n)

    def parameter_for(forces: Array, gaps: Array) -> float:
        """By how much the parameter moves where equations and conditions are off."""
        given = np.hstack([forces, linear.reshape(len(forces), -1)])
        W = np.empty((orbit.intervals, m * n, n + a + 1))
        wide.condense(
            given, False, orbit.mesh, c.nodes, c.weights, c.value, c.slope, c.side, np.ones(n),
            np.zeros_like(alone.x), np.eye(a)[0], W,
        )  # fmt: skip
        dx, dp = np.empty((2, *alone.x.shape)), np.empty((2, a))
        right = np.concatenate([[0.0], -gaps, [0.0]])
        found = wide.solve(W, rows, rows_y, right, nothing, nothing, m, dx, dp)
        return float(dp[0, 1]) if found else math.nan

    def of_one_sign(terms: Array, slope: Array) -> Array:
        return np.abs(terms) * np.where(slope < 0.0, -1.0, 1.0)

    whole = parameter_for(of_one_sign(bent, linear[:, :, n]), of_one_sign(off, by_y[:, 1]))
    return parameter_for(bent, off) / folds.width[0], abs(whole) / folds.width[0]


_WHAT = "the second derivative of the parameter along the family"
look_for(OrbitTest("cusp", FOLD, bend, bent=True, coefficient=_WHAT))


class _Along(GivenJets):
    """Derivatives of the right-hand sides of a solution and its function."""

    def __init__(self, folds: BoundedFolds, jets: Jets) -> None:
        super().__init__(jets)
        self.folds = folds

    def __call__(self, mesh: Array, x: Array, y: Array, m: int, sizes: Array) -> Array:
        """Rows of f and its derivatives, at one Gauss point each."""
        with np.errstate(all="ignore"):
            return self._rows(mesh, x, y, m, sizes)

    def _rows(self, mesh: Array, x: Array, y: Array, m: int, sizes: Array) -> Array:
        c = self.folds
        n, a = c.own, len(c.active)
        alone, v, dy = c.parted(Orbit(mesh, x, y))
        own = np.concatenate([sizes[:n], sizes[2 * n : 2 * n + a]])

        def matrices(k: float) -> tuple[Array, Array]:
            at = self.jets(mesh, alone.x + k * v, alone.y + k * dy, m, own)
            return at[:, :n], at[:, n:].reshape(len(at), n, n + a)

        f, J = matrices(0.0)
        count, more = len(f), c.q - 1 - a
        out = np.zeros((count, 2 * n * (1 + 2 * n + a + more)))
        slopes = out[:, 2 * n :].reshape(count, 2 * n, 2 * n + a + more)
        rounding = lines.EPSILON if self.jets.exact else lines.DIFFERENCED
        noise = rounding * np.max(np.max(np.abs(J), axis=0) * own, axis=1)
        size = max(float(np.max(np.abs(v) / sizes[:n])), float(np.max(np.abs(dy[1:]) / own[n:])))
        bent = lines.slope_along(
            lambda k: matrices(k)[1], lines.REACH / size if size > 0.0 else 1.0, noise, own
        )
        at = np.hstack([collocation.at_gauss(v, m).reshape(count, n), np.tile(dy[1:], (count, 1))])
        out[:, :n], out[:, n : 2 * n] = f, np.einsum("kij,kj->ki", J, at)
        slopes[:, :n, :n], slopes[:, :n, 2 * n : 2 * n + a] = J[:, :, :n], J[:, :, n:]
        slopes[:, n:, :n], slopes[:, n:, 2 * n : 2 * n + a] = bent[:, :, :n], bent[:, :, n:]
        slopes[:, n:, n : 2 * n] = J[:, :, :n]
        slopes[:, n:, 2 * n + a :] = J[:, :, n + 2 :]
        return out


def folds_of(
    bounded: Bounded, here: Point, second: int, value: float, spans: list[tuple[float, float]]
) -> tuple[BoundedFolds, Orbit]:
    """The folds of a family over a second parameter, and the one at hand with its function.

    ``spans`` are those of the first and the second parameter.
    """
    more = len(bounded.active) - 1
    kept = {f.name: getattr(bounded, f.name) for f in fields(Bounded)}
    nothing = np.zeros(bounded.n)
    low, high = np.array(spans).T
    free = np.full(more, np.inf)
    kept |= {
        "ends": (),
        "kind": FOLD,
        "active": (bounded.active[0], second, *bounded.active[1:]),
        "turns": np.append(bounded.turns, nothing),
        "period": np.append(bounded.period, nothing),
        "scale": np.tile(bounded.scale, 2),
        "width": np.concatenate(
            [bounded.width[:1], high[1:] - low[1:], bounded.width[1:], bounded.width[1:]]
        ),
        "low": np.concatenate([low, bounded.low[1:], -free]),
        "high": np.concatenate([high, bounded.high[1:], free]),
    }
    made, y = BoundedFolds(**kept), here.orbit.y
    y = np.concatenate([y[:2], [value], y[2:], here.dy[2:]])
    x = np.hstack([here.orbit.x, here.dx])
    return made, Orbit(here.orbit.mesh, x, y)
