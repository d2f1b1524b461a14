"""The angle of the disk on a free support, at one momentum: the rotor's Routhian."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np

from phasekit.laws.ladder import Routhian
from phasekit.mechanics.two_degrees import (
    RelativeEquilibria,
    TwoDegrees,
    amended_potential,
    effective_inertia,
    relative_equilibria,
    support_inertia,
)


@dataclass(frozen=True)
class AtMomentum(Routhian):
    """A machine of two degrees of freedom at the momentum p about n1, kg m^2/s.

    Energies are in J, the inertia in kg m^2.
    """

    coordinate = "phi"
    period = 2.0 * math.pi

    machine: TwoDegrees
    p: float

    @property
    def momentum(self) -> tuple[str, float, str]:  # type: ignore[override]
        """The momentum p."""
        return "p", self.p, "kg m2 s-1"

    def potential(self, x: Any) -> tuple[Any, Any, Any]:
        """Amended potential and its first two derivatives, J."""
        return amended_potential(self.machine, self.p, x)

    def inertia(self, x: Any) -> tuple[Any, Any]:
        """M22 - M12^2/M11 and its derivative, kg m^2."""
        m11, slope, _ = support_inertia(self.machine, x)
        m12 = self.machine.Jvn * np.cos(x)
        ratio = m12 / m11
        change = 2.0 * ratio * self.machine.Jvn * np.sin(x) + ratio**2 * slope
        return effective_inertia(self.machine, x), change

    def equilibria(self) -> RelativeEquilibria:
        """All steady rotations at this momentum."""
        return relative_equilibria(self.machine, self.p)
