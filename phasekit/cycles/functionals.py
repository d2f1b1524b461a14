"""Numbers of whole orbits whose zeros are looked for along a family."""

from __future__ import annotations

import inspect
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np
import numpy.typing as npt

from phasekit.bifurcation.continuation.code_fields import numbers_of
from phasekit.bifurcation.continuation.functions import Formula
from phasekit.cycles import collocation
from phasekit.cycles.cycles import Cycles, Orbit

Array = npt.NDArray[np.float64]

PARTS = ("min", "max", "mean")
NEAR = 4  # intervals among which an extreme is looked for


@dataclass(frozen=True)
class Functional:
    """A number of an orbit by name: a formula, or a function of all of its states at once."""

    name: str
    function: Formula | OfOrbit
    kind: ClassVar[str] = "event"

    def value(self, cycles: Cycles, orbit: Orbit) -> float:
        """The number of an orbit."""
        if isinstance(self.function, OfOrbit):
            return self.function.value(cycles, orbit)
        numbers = numbers_of_orbit(cycles, orbit)
        found = [numbers[name] for name in self.function.states]
        par = np.array([numbers[name] for name in self.function.parameters])
        given = _Given(par, (), np.ones(len(found)), len(found), len(found))
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
        assert isinstance(self.function, Formula)
        numbers, names = numbers_of_orbit(cycles, orbit), self.function.states
        u = np.array([numbers[name] for name in (*names, *self.function.parameters)])
        n, count = len(names), len(self.function.parameters)
        given = _Given(u[n:], tuple(range(count)), np.ones(len(u)), n, len(u))
        value, *slopes = self.function.slopes(given, u).tolist()
        by, by_y = np.zeros_like(orbit.x), np.zeros(cycles.q)
        columns = {
            f"{x}_{part}": (j, part) for j, x in enumerate(cycles.field.states) for part in PARTS
        }
        for name, slope in zip(names, slopes[:n], strict=True):
            if name == "period":
                by_y[0] += slope
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


@dataclass(frozen=True)
class _Given:
    """Numbers of an orbit in the place of the unknowns of a curve."""

    par: Array
    active: tuple[int, ...]
    scale: Array
    n: int
    m: int


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
