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
