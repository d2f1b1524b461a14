"""Solutions of x' = T f on a stretch of time, with conditions on their ends and integrals.

They are orbits that need not close: in the place of x(1) = x(0) stand as many conditions as there
are states, and as many more as parameters are freed ([AscherMattheijRussell1995] chapter 1;
[Doedel1991]). Conditions are met by Newton's method with the equations.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from typing import Any, Protocol

import numpy as np
import numpy.typing as npt

from phasekit.bifurcation.continuation.functions import Formula
from phasekit.bifurcation.continuation.periodic import along, collocation
from phasekit.bifurcation.continuation.periodic.cycles import Cycles, Orbit

Array = npt.NDArray[np.float64]
Complex = npt.NDArray[np.complex128]
#: Rows over places, rows over y, and what the rows are to be at a solution.
Rows = tuple[Array, Array, Array]

STEP = 2.0**-10  # of differences of fourth order, beside the size of what changes


class Condition(Protocol):
    """Numbers of a solution that vanish."""

    @property
    def count(self) -> int:
        """How many."""

    def values(self, bounded: Bounded, orbit: Orbit) -> Array:
        """The numbers."""

    def slopes(self, bounded: Bounded, orbit: Orbit) -> tuple[Array, Array]:
        """Their derivatives by the values at all places and by y."""


@dataclass(frozen=True, eq=False)
class Bounded(Cycles):
    """Solutions over a length of time, with conditions.

    Attributes
    ----------
    conditions : tuple of Condition
        What vanishes.
    phased : bool
        Whether a solution has a phase, which is held: its equations do not know the time.
    kind : str
        What the branch of them is.
    duration : float
        The length of time.
    """

    conditions: tuple[Condition, ...] = ()
    phased: bool = False
    kind: str = "boundary"
    duration: float = 1.0

    @property
    def bordering(self) -> int:
        """Number of bordering rows: phase, time, conditions, direction."""
        return 2 + self.phased + sum(one.count for one in self.conditions)

    @property
    def critical(self) -> bool:
        """Whether folds and branch points are looked for: not along curves of connections."""
        return not self.phased

    @cached_property
    def closure(self) -> Array:
        """Nothing comes back."""
        return np.zeros(self.n)

    def rows(self, orbit: Orbit, dx: Array, dy: Array) -> Rows:
        """Bordering rows: phase, length of time, conditions, direction; their values."""
        border, q, places = self.bordering, self.q, orbit.x.shape
        own, own_y, at = np.zeros((2, *places)), np.zeros((2, q)), np.zeros(2)
        c = collocation.scheme(self.m)
        along.borders(
            orbit.mesh, c.weights, c.value, c.slope, orbit.x, dx, self.scale, not self.phased,
            own, at,
        )  # fmt: skip
        own_y[1, 1:] = dy[1:] / self.width**2
        rows, rows_y, target = np.zeros((border, *places)), np.zeros((border, q)), np.zeros(border)
        rows[-1], rows_y[-1], target[-1] = own[1], own_y[1], at[1] + own_y[1] @ orbit.y
        if self.phased:
            rows[0], target[0] = own[0], at[0]
        return self.rows_beside(orbit, rows, rows_y, target)

    def rows_beside(self, orbit: Orbit, rows: Array, rows_y: Array, target: Array) -> Rows:
        """The rows with the time as it is, and the conditions linear beside an orbit."""
        rows, rows_y, target = rows.copy(), rows_y.copy(), target.copy()
        k = int(self.phased)
        rows[k], rows_y[k], target[k] = 0.0, np.eye(self.q)[0], self.duration
        k += 1
        for one in self.conditions:
            here = slice(k, k + one.count)
            rows[here], rows_y[here] = one.slopes(self, orbit)
            linear = np.einsum("rkn,kn->r", rows[here], orbit.x) + rows_y[here] @ orbit.y
            target[here] = linear - one.values(self, orbit)
            k = here.stop
        return rows, rows_y, target

    def multipliers(
        self, W: Array, orbit: Orbit, divergence: float = 0.0
    ) -> tuple[Complex, float, float]:
        """There are none."""
        return np.empty(0, complex), 0.0, 0.0

    def divergence(self, found: float) -> float:
        """Of what has no multipliers."""
        return 0.0


# ------------------------------------------------------------------------------ conditions


@dataclass(frozen=True)
class _Given:
    """Numbers in the place of the unknowns of a curve."""

    par: Array
    active: tuple[int, ...]
    scale: Array
    n: int
    m: int


def _given(bounded: Bounded, copies: int) -> _Given:
    scale = np.append(np.tile(bounded.scale, copies), bounded.sizes[bounded.n :])
    n = copies * bounded.n
    return _Given(bounded.par, bounded.active, scale, n, n + len(bounded.active))


@dataclass(frozen=True)
class EndFormulas:
    """Formulas of the states at both ends, those at the beginning first, and the parameters."""

    formulas: tuple[Formula, ...]

    @property
    def count(self) -> int:
        """How many."""
        return len(self.formulas)

    def _jet(self, bounded: Bounded, orbit: Orbit) -> Array:
        u = np.concatenate([orbit.x[0], orbit.x[-1], orbit.y[1:]])
        given = _given(bounded, 2)
        return np.array([one.slopes(given, u) for one in self.formulas])

    def values(self, bounded: Bounded, orbit: Orbit) -> Array:
        """The numbers."""
        return self._jet(bounded, orbit)[:, 0]

    def slopes(self, bounded: Bounded, orbit: Orbit) -> tuple[Array, Array]:
        """Their derivatives."""
        return _of_ends(bounded, orbit, self._jet(bounded, orbit)[:, 1:])


def _of_ends(bounded: Bounded, orbit: Orbit, found: Array) -> tuple[Array, Array]:
    """Rows of derivatives by both ends and the free parameters."""
    n = bounded.n
    rows = np.zeros((len(found), *orbit.x.shape))
    rows[:, 0], rows[:, -1] = found[:, :n], found[:, n : 2 * n]
    return rows, np.hstack([np.zeros((len(found), 1)), found[:, 2 * n :]])


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

    def values(self, bounded: Bounded, orbit: Orbit) -> Array:
        """The numbers."""
        return self._value(bounded, np.concatenate([orbit.x[0], orbit.x[-1], orbit.y[1:]]))

    def slopes(self, bounded: Bounded, orbit: Orbit) -> tuple[Array, Array]:
        """Their derivatives."""
        u = np.concatenate([orbit.x[0], orbit.x[-1], orbit.y[1:]])
        scale = _given(bounded, 2).scale
        found = differences_of(lambda at: self._value(bounded, at), u, scale)
        return _of_ends(bounded, orbit, found)


def differences_of(function: Callable[[Array], Array], u: Array, scale: Array) -> Array:
    """Derivatives by central differences of fourth order, in columns."""
    columns = []
    for i in range(len(u)):
        h = STEP * max(abs(float(u[i])), float(scale[i]))

        def value_at(k: float, i: int = i) -> Array:
            moved = u.copy()
            moved[i] += k
            return function(moved)

        near, wide = ((value_at(k) - value_at(-k)) / (2.0 * k) for k in (h, 2.0 * h))
        columns.append((4.0 * near - wide) / 3.0)
    return np.stack(columns, axis=-1)


@dataclass(frozen=True)
class IntegralFormulas:
    """Formulas of the states and parameters whose integrals over [0, 1] vanish."""

    formulas: tuple[Formula, ...]

    @property
    def count(self) -> int:
        """How many."""
        return len(self.formulas)

    def _jets(self, bounded: Bounded, orbit: Orbit) -> tuple[Array, Array]:
        """Weights of all Gauss points, and value and derivatives of each formula there."""
        c = collocation.scheme(bounded.m)
        x = collocation.at_gauss(orbit.x, bounded.m).reshape(-1, bounded.n)
        u = np.hstack([x, np.tile(orbit.y[1:], (len(x), 1))])
        given = _given(bounded, 1)
        found = np.array([np.delete(one._jet(given, u), 1, axis=1) for one in self.formulas])
        return np.outer(np.diff(orbit.mesh), c.weights).ravel(), found

    def values(self, bounded: Bounded, orbit: Orbit) -> Array:
        """The integrals."""
        weights, found = self._jets(bounded, orbit)
        return np.asarray(found[:, :, 0] @ weights)

    def slopes(self, bounded: Bounded, orbit: Orbit) -> tuple[Array, Array]:
        """Their derivatives."""
        weights, found = self._jets(bounded, orbit)
        return _of_integrals(bounded, orbit, weights, found[:, :, 1:])


def _of_integrals(
    bounded: Bounded, orbit: Orbit, weights: Array, found: Array
) -> tuple[Array, Array]:
    """Rows of integrals, of derivatives by states and free parameters at all Gauss points."""
    n, m = bounded.n, bounded.m
    shape = (orbit.intervals, m, n)
    rows = np.array(
        [collocation.functional(orbit.mesh, one[:, :n].reshape(shape), m) for one in found]
    ).reshape(len(found), *orbit.x.shape)
    by_y = np.einsum("k,rkp->rp", weights, found[:, :, n:])
    return rows, np.hstack([np.zeros((len(found), 1)), by_y])


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

    def _points(self, bounded: Bounded, orbit: Orbit) -> tuple[Array, Array]:
        c = collocation.scheme(bounded.m)
        x = collocation.at_gauss(orbit.x, bounded.m).reshape(-1, bounded.n)
        return np.outer(np.diff(orbit.mesh), c.weights).ravel(), x

    def values(self, bounded: Bounded, orbit: Orbit) -> Array:
        """The integrals."""
        weights, x = self._points(bounded, orbit)
        return np.asarray(self._values(bounded, x, orbit.y[1:]) @ weights)

    def slopes(self, bounded: Bounded, orbit: Orbit) -> tuple[Array, Array]:
        """Their derivatives."""
        weights, x = self._points(bounded, orbit)
        n = bounded.n

        def moved(by: Array) -> Array:
            return self._values(bounded, x + by[:n], orbit.y[1:] + by[n:])

        found = differences_of(moved, np.zeros(n + bounded.q - 1), _given(bounded, 1).scale)
        return _of_integrals(bounded, orbit, weights, found)
