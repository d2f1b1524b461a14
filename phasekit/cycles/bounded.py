"""Solutions of x' = T f on a stretch of time, with conditions on their ends and integrals.

They are orbits that need not close: in the place of x(1) = x(0) stand as many conditions as there
are states, and as many more as parameters are freed ([AscherMattheijRussell1995] chapter 1;
[Doedel1991]). Conditions are met by Newton's method with the equations.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, Protocol, cast

import numpy as np

from phasekit.arrays import Array, Complex
from phasekit.bifurcation.continuation.functions import Formula
from phasekit.cycles import along, collocation
from phasekit.cycles.cycles import Cycles, Orbit
from phasekit.cycles.functionals import Given, Rows, integrals, integrals_of

STEP = 2.0**-10  # of differences of fourth order, beside the size of what changes


class Condition(Protocol):
    """Numbers of a solution that vanish."""

    @property
    def count(self) -> int:
        """How many."""

    def linear(self, bounded: Any, orbit: Orbit) -> Rows:
        """Their derivatives by the values at all places and by y, and the numbers."""


@dataclass(frozen=True, eq=False)
class Bounded(Cycles):
    """Solutions over a length of time, with conditions."""

    conditions: tuple[Condition, ...] = ()  # what vanishes
    kind: str = "boundary"  # what the branch of them is
    duration: float | None = 1.0  # the length of time; None where it is free

    @property
    def bordering(self) -> int:
        """Number of bordering rows: time, conditions, what is held, direction."""
        timed = self.duration is not None
        return 1 + timed + sum(one.count for one in self.conditions) + len(self.holds)

    @property
    def critical(self) -> bool:
        """Whether folds and branch points are looked for: not along curves of connections."""
        return self.kind == "boundary"

    @property
    def slides(self) -> bool:
        """Whether orbits are followed in a frame that moves along them: those that connect."""
        return self.kind == "connection"

    @cached_property
    def closure(self) -> Array:
        """Nothing comes back."""
        return np.zeros(self.n)

    def sized(self, orbit: Orbit) -> Bounded:
        """The same on the scales of an orbit; connections end as far from equilibria as before."""
        made = cast("Bounded", super().sized(orbit))
        if made is not self and self.kind == "connection":
            grown = float(np.max(made.scale / self.scale))
            ends: Any = self.conditions[0]
            near = tuple(one / grown for one in ends.distances)
            made.__dict__["conditions"] = (replace(ends, distances=near),)
        return made

    def rows(self, orbit: Orbit, dx: Array, dy: Array) -> Rows:
        """Bordering rows: length of time, conditions, direction; their values."""
        border, q, places = self.bordering, self.q, orbit.x.shape
        own, at = np.zeros((2, *places)), np.zeros(2)
        c = collocation.scheme(self.m)
        along.borders(
            orbit.mesh, c.weights, c.value, c.slope, orbit.x, dx, self.scale, True, own, at
        )
        rows, rows_y, target = np.zeros((border, *places)), np.zeros((border, q)), np.zeros(border)
        rows[-1], rows_y[-1, 1:] = own[1], dy[1:] / self.width**2
        target[-1] = at[1] + rows_y[-1] @ orbit.y
        return self.rows_beside(orbit, rows, rows_y, target)

    def rows_beside(self, orbit: Orbit, rows: Array, rows_y: Array, target: Array) -> Rows:
        """The rows with the time as it is, and the conditions linear beside an orbit."""
        rows, rows_y, target = rows.copy(), rows_y.copy(), target.copy()
        k = 0
        if self.duration is not None:
            rows[0], rows_y[0], target[0] = 0.0, np.eye(self.q)[0], self.duration
            k = 1
        for one in self.conditions:
            here = slice(k, k + one.count)
            rows[here], rows_y[here], values = one.linear(self, orbit)
            linear = np.einsum("rkn,kn->r", rows[here], orbit.x) + rows_y[here] @ orbit.y
            target[here] = linear - values
            k = here.stop
        return self._holding(orbit, rows, rows_y, target, k)

    def multipliers(
        self, W: Array, orbit: Orbit, divergence: float = 0.0
    ) -> tuple[Complex, float, float]:
        """There are none."""
        return np.empty(0, complex), 0.0, 0.0

    def divergence(self, found: float) -> float:
        """Of what has no multipliers."""
        return 0.0


# ------------------------------------------------------------------------------ conditions


def _given(bounded: Bounded, copies: int) -> Given:
    scale = np.append(np.tile(bounded.scale, copies), bounded.sizes[bounded.n :])
    n = copies * bounded.n
    return Given(bounded.par, bounded.active, scale, n, n + len(bounded.active))


@dataclass(frozen=True)
class _Formulas:
    formulas: tuple[Formula, ...]

    @property
    def count(self) -> int:
        """How many."""
        return len(self.formulas)


@dataclass(frozen=True)
class EndFormulas(_Formulas):
    """Formulas of the states at both ends, those at the beginning first, and the parameters."""

    def linear(self, bounded: Bounded, orbit: Orbit) -> Rows:
        """Their derivatives, and the numbers."""
        u = np.concatenate([orbit.x[0], orbit.x[-1], orbit.y[1:]])
        given = _given(bounded, 2)
        jet = np.array([one.slopes(given, u) for one in self.formulas])
        return of_ends(orbit, jet[:, 1:], jet[:, 0])


def of_ends(orbit: Orbit, slopes: Array, values: Array) -> Rows:
    """Rows of derivatives by both ends and the free parameters."""
    n = orbit.x.shape[1]
    rows = np.zeros((len(slopes), *orbit.x.shape))
    rows[:, 0], rows[:, -1] = slopes[:, :n], slopes[:, n : 2 * n]
    return rows, np.hstack([np.zeros((len(slopes), 1)), slopes[:, 2 * n :]]), values


@dataclass(frozen=True)
class EndFunction:
    """A function of the states at both ends; its derivatives are differences."""

    function: Callable[..., Any]
    count: int
    parameters: tuple[str, ...]

    def _value(self, bounded: Bounded, u: Array) -> Array:
        n = bounded.n
        par = bounded.par.copy()
        par[list(bounded.active)] = u[2 * n :]
        values = dict(zip(self.parameters, par.tolist(), strict=True))
        found = self.function(u[:n].copy(), u[n : 2 * n].copy(), **values)
        return np.asarray(found, dtype=float).reshape(self.count)

    def linear(self, bounded: Bounded, orbit: Orbit) -> Rows:
        """Their derivatives, and the numbers."""
        u = np.concatenate([orbit.x[0], orbit.x[-1], orbit.y[1:]])
        scale = _given(bounded, 2).scale
        found = differences_of(lambda at: self._value(bounded, at), u, scale)
        return of_ends(orbit, found, self._value(bounded, u))


def differences_of(function: Callable[[Array], Array], u: Array, scale: Array) -> Array:
    """Derivatives by central differences of fourth order, in columns."""
    columns = []
    for i in range(len(u)):
        h = STEP * max(abs(float(u[i])), float(scale[i]))

        def moved(k: float, i: int = i) -> Array:
            place = u.copy()
            place[i] += k
            return function(place)

        near, wide = ((moved(k) - moved(-k)) / (2.0 * k) for k in (h, 2.0 * h))
        columns.append((4.0 * near - wide) / 3.0)
    return np.stack(columns, axis=-1)


@dataclass(frozen=True)
class IntegralFormulas(_Formulas):
    """Formulas of the states and parameters whose integrals over [0, 1] vanish."""

    def linear(self, bounded: Bounded, orbit: Orbit) -> Rows:
        """Their derivatives, and the integrals."""
        return integrals(bounded, orbit, self.formulas)


@dataclass(frozen=True)
class IntegralFunction:
    """A function of a state, of so many numbers, whose integrals over [0, 1] vanish."""

    function: Callable[..., Any]
    count: int
    parameters: tuple[str, ...]

    def _values(self, bounded: Bounded, x: Array, free: Array) -> Array:
        """Its values at states, shape (count, states)."""
        par = bounded.par.copy()
        par[list(bounded.active)] = free
        values = dict(zip(self.parameters, par.tolist(), strict=True))
        each = [np.ravel(self.function(one.copy(), **values)) for one in x]
        return np.array(each, dtype=float).reshape(len(x), self.count).T

    def linear(self, bounded: Bounded, orbit: Orbit) -> Rows:
        """Their derivatives, and the integrals."""
        n = bounded.n
        x = collocation.at_gauss(orbit.x, bounded.m).reshape(-1, n)

        def moved(by: Array) -> Array:
            return self._values(bounded, x + by[:n], orbit.y[1:] + by[n:])

        nothing = np.zeros(n + bounded.q - 1)
        found = differences_of(moved, nothing, _given(bounded, 1).scale)
        slopes = np.insert(found, n, 0.0, axis=2)  # none by the time
        return integrals_of(bounded, orbit, slopes, moved(nothing))
