"""Numbers of whole orbits whose zeros are looked for along a family."""

from __future__ import annotations

import inspect
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from phasekit.arrays import Array
from phasekit.bifurcation.continuation.code_fields import numbers_of
from phasekit.bifurcation.continuation.functions import Formula
from phasekit.cycles import collocation
from phasekit.cycles.cycles import Cycles, Orbit

#: Rows over places, rows over y, and what goes with them: values, or what they are to be.
Rows = tuple[Array, Array, Array]

PARTS = ("min", "max", "mean")
NEAR = 4  # intervals among which an extreme is looked for


@dataclass(frozen=True)
class Given:
    """Numbers of an orbit in the place of the unknowns of a curve."""

    par: Array
    active: tuple[int, ...]
    scale: Array
    n: int
    m: int


def integrals(cycles: Cycles, orbit: Orbit, formulas: Sequence[Formula]) -> Rows:
    """Integrals over [0, 1] of formulas along an orbit: their derivatives, and themselves.

    Of a forced system time is the last of the parameters; it stretches with the period.
    """
    n, forced = cycles.own, cycles.forced
    free = list(cycles.active)
    s = collocation.at_gauss(collocation.times(orbit.mesh, cycles.m)[:, None], cycles.m).ravel()
    x = collocation.at_gauss(orbit.x[:, :n], cycles.m).reshape(-1, n)
    u = np.hstack([x, np.tile(orbit.y[1 : 1 + len(free)], (len(x), 1))])
    if forced:
        free.append(len(cycles.par) - 1)
        u = np.hstack([u, orbit.y[0] * s[:, None]])
    given = Given(cycles.par, tuple(free), np.ones(u.shape[1]), n, u.shape[1])
    found = np.array([np.delete(one._jet(given, u), 1, axis=1) for one in formulas])
    slopes = np.insert(found[:, :, 1:], n, s * found[:, :, -1] if forced else 0.0, axis=2)
    return integrals_of(cycles, orbit, slopes[:, :, :-1] if forced else slopes, found[:, :, 0])


def integrals_of(cycles: Cycles, orbit: Orbit, slopes: Array, values: Array) -> Rows:
    """The same, of values and derivatives by states and y at all Gauss points."""
    n, m = cycles.own, cycles.m
    weights = np.outer(np.diff(orbit.mesh), collocation.scheme(m).weights).ravel()
    rows = np.zeros((len(values), *orbit.x.shape))
    for row, one in zip(rows, slopes, strict=True):
        row[:, :n] = collocation.functional(orbit.mesh, one[:, :n].reshape(-1, m, n), m)
    by_y = np.zeros((len(values), cycles.q))
    by_y[:, : slopes.shape[2] - n] = np.einsum("k,rkp->rp", weights, slopes[:, :, n:])
    return rows, by_y, np.asarray(values @ weights)


@dataclass(frozen=True)
class OfNumbers(Formula):
    """A formula of numbers of an orbit, among them means of formulas of its states, by name."""

    means: tuple[tuple[str, Formula], ...] = ()

    def numbers(self, cycles: Cycles, orbit: Orbit) -> dict[str, float]:
        """All numbers of an orbit by name."""
        found = numbers_of_orbit(cycles, orbit)
        if self.means:
            values = integrals(cycles, orbit, [one for _, one in self.means])[2]
            found.update(zip((name for name, _ in self.means), values.tolist(), strict=True))
        return found


@dataclass(frozen=True)
class Functional:
    """A number of an orbit by name: a formula, or a function of all of its states at once."""

    name: str
    function: OfNumbers | OfOrbit
    kind: ClassVar[str] = "event"

    def value(self, cycles: Cycles, orbit: Orbit) -> float:
        """The number of an orbit."""
        if isinstance(self.function, OfOrbit):
            return self.function.value(cycles, orbit)
        numbers = self.function.numbers(cycles, orbit)
        found = [numbers[name] for name in self.function.states]
        par = np.array([numbers[name] for name in self.function.parameters])
        given = Given(par, (), np.ones(len(found)), len(found), len(found))
        return float(self.function.values(given, np.array([found]))[0])

    @property
    def constant(self) -> bool:
        """Whether its derivatives are the same everywhere: of the period alone, and linear."""
        if isinstance(self.function, OfOrbit):
            return False
        formula = self.function.expression
        return {str(one) for one in formula.free_symbols} == {"period"} and all(
            formula.diff(one).is_number for one in formula.free_symbols
        )

    def linear(self, cycles: Cycles, orbit: Orbit) -> tuple[Array, Array, float]:
        """Derivatives by the values at all places and by y, and the number, of a formula."""
        assert isinstance(self.function, OfNumbers)
        numbers, names = self.function.numbers(cycles, orbit), self.function.states
        u = np.array([numbers[name] for name in (*names, *self.function.parameters)])
        n, count = len(names), len(self.function.parameters)
        given = Given(u[n:], tuple(range(count)), np.ones(len(u)), n, len(u))
        value, *slopes = self.function.slopes(given, u).tolist()
        by, by_y = np.zeros_like(orbit.x), np.zeros(cycles.q)
        columns = {
            f"{x}_{part}": (j, part) for j, x in enumerate(cycles.field.states) for part in PARTS
        }
        means = dict(self.function.means)
        for name, slope in zip(names, slopes[:n], strict=True):
            if name == "period":
                by_y[0] += slope
            elif name in means:
                rows, rows_y, _ = integrals(cycles, orbit, [means[name]])
                by, by_y = by + slope * rows[0], by_y + slope * rows_y[0]
            elif slope:
                j, part = columns[name]
                by[:, j] += slope * _gradient(cycles, orbit, j, part)
        for k, place in enumerate(cycles.active):
            by_y[1 + k] += slopes[n + place]
        return by, by_y, value


def _gradient(cycles: Cycles, orbit: Orbit, j: int, part: str) -> Array:
    """Derivatives of the mean, or of an extreme, of a state by its values at all places."""
    m = cycles.m
    if part == "mean":
        ones = np.ones((orbit.intervals, m, 1))
        return collocation.functional(orbit.mesh, ones, m)[:, 0]
    sign = 1.0 if part == "max" else -1.0
    parts = sign * collocation.pieces(orbit.x[:, j], m)
    best = (-np.inf, 0, np.zeros(m + 1))
    for i in np.argsort(-np.max(parts, axis=1), kind="stable")[:NEAR]:
        line = np.polynomial.Polynomial.fit(
            np.arange(m + 1.0) / m, parts[i], m, domain=[0.0, 1.0], window=[0.0, 1.0]
        )
        turns = line.deriv().roots()  # in parts of the interval
        inside = turns.real[(np.abs(turns.imag) < 1e-9) & (turns.real > 0.0) & (turns.real < 1.0)]
        at = np.concatenate([inside, [0.0, 1.0]])
        weights = collocation.basis(m, at)[0]
        values = weights @ parts[i]
        k = int(np.argmax(values))
        if values[k] > best[0]:
            best = (float(values[k]), int(i), weights[k])
    found = np.zeros(len(orbit.x))
    found[best[1] * m : (best[1] + 1) * m + 1] = best[2]
    return found


@dataclass(frozen=True)
class OfOrbit:
    """A function q(x, **parameters) of the states of a whole orbit, of shape (state, time)."""

    function: Callable[..., Any]
    parameters: tuple[str, ...]

    def value(self, cycles: Cycles, orbit: Orbit) -> float:
        """The number that it returns; NaN where it has none."""
        found = self.returned(cycles, orbit)
        if isinstance(found, (bool, np.bool_)):  # it jumps where what it says changes
            return 1.0 if found else -1.0
        return float(numbers_of("events", found, ()))

    def returned(self, cycles: Cycles, orbit: Orbit) -> Any:
        """What it returns; NaN where it is not defined."""
        x = np.ascontiguousarray(orbit.x[:, : cycles.own].T)
        values = parameters_of(cycles, orbit)
        parameters = {name: values[name] for name in self.parameters}
        more: dict[str, Any] = {"period": float(orbit.y[0])}
        if cycles.forced:
            more[cycles.field.parameters[-1]] = collocation.times(orbit.mesh, cycles.m) * orbit.y[0]
        taken = inspect.signature(self.function).parameters
        every = any(one.kind is one.VAR_KEYWORD for one in taken.values())
        given = {k: v for k, v in more.items() if k not in parameters and (every or k in taken)}
        with np.errstate(all="ignore"):
            try:
                return self.function(x, **parameters, **given)
            except Exception:  # noqa: BLE001 - a user's function, without a value there
                return np.nan


def parameters_of(cycles: Cycles, orbit: Orbit) -> dict[str, float]:
    """All parameters of an orbit by name, without time."""
    names = cycles.field.parameters[: len(cycles.par) - cycles.forced]
    values = dict(zip(names, cycles.par.tolist(), strict=False))
    values.update((names[place], float(orbit.y[1 + k])) for k, place in enumerate(cycles.active))
    return values


def number_names(states: tuple[str, ...], parameters: tuple[str, ...]) -> tuple[str, ...]:
    """Names of numbers of an orbit besides its parameters, which come first."""
    names = ("period", *(f"{x}_{part}" for x in states for part in PARTS))
    return tuple(name for name in names if name not in parameters)


def numbers_of_orbit(cycles: Cycles, orbit: Orbit) -> dict[str, float]:
    """Parameters, the period, and the least, largest and mean value of each state, by name."""
    n, m = cycles.own, cycles.m
    x = orbit.x[:, :n]
    low, high = collocation.extremes(x, m)
    three = zip(low.tolist(), high.tolist(), collocation.mean(orbit.mesh, x, m).tolist(),
                strict=True)  # fmt: skip
    found = {"period": float(orbit.y[0])}
    for name, values in zip(cycles.field.states, three, strict=True):
        found.update((f"{name}_{p}", v) for p, v in zip(PARTS, values, strict=True))
    return found | parameters_of(cycles, orbit)
