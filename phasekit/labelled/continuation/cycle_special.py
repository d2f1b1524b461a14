"""Special points of branches of periodic orbits."""

from __future__ import annotations

from dataclasses import dataclass
from types import MappingProxyType
from typing import Any, ClassVar

import xarray as xr

from phasekit.bifurcation.special_points import KINDS
from phasekit.cycles.cycles import Cycles
from phasekit.cycles.family import Found
from phasekit.labelled.continuation.cycle_points import orbit_dataset, parameters_at
from phasekit.labelled.continuation.onward import Of
from phasekit.labelled.continuation.special_point import SpecialPoint, fixed
from phasekit.labelled.field_arrays import fields_of
from phasekit.systems.problem import Problem


@dataclass(frozen=True, eq=False, repr=False)
class CyclePoint(SpecialPoint[Of]):
    """A periodic orbit at which something happens: LPC, PD, TR, BPC, UZ or an end.

    ``x`` is a state on the orbit, ``eigenvalues`` are its multipliers. ``normal_form`` holds the
    coefficient of the map over one period.
    """

    way: ClassVar[str] = "orbit"

    @property
    def corank(self) -> int:
        """Number of critical multipliers besides the one that is always 1; 0 at ends."""
        return KINDS[self.kind].crossing or 0

    @property
    def period(self) -> float:
        """The period of the orbit."""
        return float(self.special.point.orbit.y[0])

    @property
    def orbit(self) -> xr.Dataset:
        """The orbit over time."""
        cycles, problem = self.branch.walker.curve, self.branch.problem
        return orbit_dataset(problem, cycles, self.special.point, self.label)

    def __getitem__(self, name: str) -> Any:
        """A state, or field of states, a parameter or the period by name."""
        if name == "period":
            return self.period
        found = fields_of(self.branch.problem, self.x[None])
        return found[name].isel(point=0) if name in found else super().__getitem__(name)


def cycle_point(
    problem: Problem, cycles: Cycles, found: Found, multipliers: Any, index: int, branch: Of
) -> CyclePoint[Of]:
    """A special point of a branch of periodic orbits."""
    point = found.point
    return CyclePoint(
        found.kind, fixed(point.orbit.x[0]),
        MappingProxyType(parameters_at(problem, cycles, point.orbit)), found.interval,
        point.residual, found.status, found.message, MappingProxyType(dict(found.normal_form)),
        fixed(multipliers), index, found, branch,
    )  # fmt: skip
