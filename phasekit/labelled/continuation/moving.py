"""Special points that move with parameters: their numbers, derivatives, and where they go."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from types import MappingProxyType
from typing import Any

import numpy as np

from phasekit.arrays import Array
from phasekit.bifurcation.continuation.curve import Curve
from phasekit.bifurcation.continuation.points.special import Special
from phasekit.bifurcation.continuation.sensitivity import Sensitivity, moved, sensitivity
from phasekit.labelled.continuation.sensitivity import hindered, numbers_at, orbit_at, orbits
from phasekit.labelled.continuation.special_point import SpecialPoint


class Moving:
    """A point at some parameters."""

    names: tuple[str, ...]

    @property
    def numbers(self) -> Mapping[str, float]:
        """Its quantities."""
        raise NotImplementedError

    @property
    def rates(self) -> Mapping[str, Array]:
        """Their derivatives by the other parameters."""
        raise NotImplementedError

    @property
    def found(self) -> Sensitivity:
        """The derivatives of the point."""
        raise NotImplementedError

    def slopes(self, by: Sequence[str]) -> dict[str, Array]:
        """Derivatives of the numbers; by its own parameters, which are none of its own, zero."""
        others = [self.names[i] for i in self.found.others]
        zero = {name: np.zeros(len(by)) for name in self.numbers}
        for k, name in enumerate(by):
            if name in others:
                for number, rate in self.rates.items():
                    zero[number][k] = rate[others.index(name)]
        return zero

    def reason(self, by: Sequence[str]) -> str:
        """Why a derivative is not known."""
        pairs = zip(self.found.others, self.found.reasons, strict=True)
        return next((why for i, why in pairs if why and self.names[i] in by), "")

    def moved(self, values: Mapping[str, float]) -> Moving | None:
        """The point at other parameters; None if it is lost."""
        raise NotImplementedError


@dataclass
class _Rest(Moving):
    """A point of equilibria."""

    names: tuple[str, ...]
    curve: Curve
    special: Special
    coefficients: bool

    @cached_property
    def found(self) -> Sensitivity:
        """Its derivatives."""
        return sensitivity(self.curve, self.special, coefficients=self.coefficients)

    @cached_property
    def numbers(self) -> Mapping[str, float]:
        """Its own parameters, states, coefficients, and the period of a Hopf point."""
        curve, u = self.curve, self.special.u
        free = [self.names[i] for i in curve.active]
        unknowns = dict(zip([*curve.field.states, *free], u.tolist(), strict=True))
        form = dict(self.special.normal_form)
        if self.special.kind == "hopf":
            form["period"] = 2.0 * np.pi / form["omega"]
        return form | unknowns

    @cached_property
    def rates(self) -> Mapping[str, Array]:
        """Their derivatives by the other parameters."""
        curve, found = self.curve, self.found
        free = [self.names[i] for i in curve.active]
        rows = dict(zip([*curve.field.states, *free], [*found.x, *found.free], strict=True))
        form = dict(found.form)
        if self.special.kind == "hopf":
            omega = self.special.normal_form["omega"]
            form["period"] = -2.0 * np.pi / omega**2 * form["omega"]
        return form | rows

    def moved(self, values: Mapping[str, float]) -> Moving | None:
        """The point at other parameters; None if it is lost."""
        par = self.curve.par.copy()
        for name, value in values.items():
            par[self.names.index(name)] = value
        made = moved(self.curve, self.special, par, self.found, coefficients=self.coefficients)
        return None if made is None else _Rest(self.names, *made, self.coefficients)


@dataclass
class _Cycle(Moving):
    """A point of periodic orbits."""

    names: tuple[str, ...]
    point: SpecialPoint[Any]

    @cached_property
    def _derived(self) -> tuple[Sensitivity, Mapping[str, Array]]:
        return orbits(self.point)

    @cached_property
    def found(self) -> Sensitivity:
        """Its derivatives."""
        return self._derived[0]

    @cached_property
    def numbers(self) -> Mapping[str, float]:
        """Its own parameter, the period, extremes, means and amplitudes of the states."""
        found = numbers_at(self.point)
        parameter = self.point.branch.parameter
        heights = {
            f"{x}_amplitude": 0.5 * (found[f"{x}_max"] - found[f"{x}_min"])
            for x in self.point.branch.curve.field.states
        }
        return {**found, **heights, parameter: self.point.parameters[parameter]}

    @cached_property
    def rates(self) -> Mapping[str, Array]:
        """Their derivatives by the other parameters."""
        found, numbers = self._derived
        heights = {
            f"{x}_amplitude": 0.5 * (numbers[f"{x}_max"] - numbers[f"{x}_min"])
            for x in self.point.branch.curve.field.states
        }
        return {**numbers, **heights, self.point.branch.parameter: found.free[0]}

    def moved(self, values: Mapping[str, float]) -> Moving | None:
        """The point at other parameters; None if it is lost."""
        own = self.point.branch.parameter
        changed = {**self.point.parameters, **{k: v for k, v in values.items() if k != own}}
        made = orbit_at(self.point, changed)
        if made is None:
            return None
        changed[own] = float(made.orbit.y[1])
        special = replace(self.point.special, point=made)
        fresh = replace(self.point, parameters=MappingProxyType(changed), special=special)
        return _Cycle(self.names, fresh)


def moving(point: SpecialPoint[Any], quantities: Collection[str]) -> Moving | str:
    """A point that moves, of which these quantities are asked for; why it does not."""
    names = tuple(point.branch.problem.parameters)
    if point.way == "orbit":
        return hindered(point) or _Cycle(names, point)
    asked = {name for name in quantities if name != "omega"}
    coefficients = not asked.isdisjoint(point.normal_form)
    one = _Rest(names, point.branch.curve, point.special, coefficients)
    reasons = one.found.reasons
    return reasons[0] if reasons and len(set(reasons)) == 1 and reasons[0] else one
