"""The potential of one system as a landscape: its hills, its basins, and the level curves in them.

Arrays only. Pictures ask this module where a level runs; nothing here knows about matplotlib.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from phasekit.errors import ParameterError
from phasekit.labelled.arguments import bad
from phasekit.labelled.as_system import as_system
from phasekit.phase.equilibria import Equilibria
from phasekit.phase.orbits import orbits
from phasekit.phase.potential import phase_velocity, potential
from phasekit.phase.separatrices import Separatrices, phase_space

FloatArray = NDArray[np.float64]
Arc = tuple[float, float]
# An energy, and the angle of the one well it is meant for; None means every arc.
Level = tuple[float, float | None]

_SAMPLES = 241
_BISECTIONS = 60


@dataclass(frozen=True)
class Landscape:
    """One system with its equilibria and separatrices, and its critical points round the circle.

    Attributes
    ----------
    A, B, C : float
        Coefficients (s^-2).
    equilibria, separatrices
        Results of the array floor for this system.
    phi, height : numpy.ndarray
        Angles (rad, rising) and potentials (s^-2) of the critical points.
    """

    A: float
    B: float
    C: float
    equilibria: Equilibria
    separatrices: Separatrices
    phi: FloatArray
    height: FloatArray
    _hilltop: NDArray[np.bool_]

    @classmethod
    def of(cls, system: Any) -> Landscape:
        """Return the landscape of a system whose parameters are all scalars."""
        A, B, C = scalar_coefficients(system)
        # No potential spans more than this; its square root is a speed.
        if not np.isfinite(4.0 * abs(A) + 4.0 * abs(B) + 4.0 * abs(C)):
            raise bad("system", system, "coefficients whose potential can be drawn")
        equilibria, separatrices = phase_space(A, B, C)
        present = np.isfinite(equilibria.phi)
        order = np.argsort(equilibria.phi[present])
        return cls(
            A,
            B,
            C,
            equilibria,
            separatrices,
            np.asarray(equilibria.phi[present][order], dtype=float),
            np.asarray(equilibria.energy[present][order], dtype=float),
            np.asarray(present.nonzero()[0][order] % 2 == 1),
        )

    @property
    def floor(self) -> float:
        """Least potential (s^-2)."""
        return float(self.height.min()) if self.height.size else 0.0

    @property
    def summit(self) -> float:
        """Greatest potential (s^-2)."""
        return float(self.height.max()) if self.height.size else 0.0

    @property
    def top_speed(self) -> float:
        """Greatest speed (rad/s) on the separatrix of the highest saddle; 1 where V is constant."""
        speed = float(np.sqrt(2.0 * (self.summit - self.floor)))
        return speed if speed > 0.0 else 1.0

    def potential(self, phi: Any) -> FloatArray:
        """Return V at `phi` (s^-2)."""
        return np.asarray(potential(self.A, self.B, self.C, phi))

    def energy(self, phi: float, speed: float) -> float:
        """Return the energy of a state (s^-2)."""
        return float(self.potential(phi)) + 0.5 * speed * speed

    def speed(self, phi: FloatArray, energy: float) -> FloatArray:
        """Return |phi'| at `phi` on the level `energy`; 0 where rounding puts the point outside."""
        speed = np.asarray(phase_velocity(self.A, self.B, self.C, phi, energy), dtype=float)
        return np.where(np.isnan(speed), 0.0, speed)

    def basins(self, energy: float) -> list[Arc]:
        """Return the arcs where V <= energy; a full turn is (-pi, pi), an arc may run past pi."""
        # A summit of exactly this height can be passed, a bottom of this height is a point.
        inside = (self.height < energy) | ((self.height == energy) & self._hilltop)
        roots = []
        for i in range(self.phi.size):
            j = (i + 1) % self.phi.size
            if inside[i] != inside[j]:
                right = self.phi[j] if j > i else self.phi[j] + 2.0 * np.pi
                roots.append((self._crossing(self.phi[i], right, energy), not inside[j]))
        if not roots:
            return [(-np.pi, np.pi)] if energy >= self.summit else []
        arcs = []
        for i, (start, rising) in enumerate(roots):
            if not rising:
                end = roots[(i + 1) % len(roots)][0]
                arcs.append((start, end if end > start else end + 2.0 * np.pi))
        return arcs

    def _crossing(self, left: float, right: float, energy: float) -> float:
        """Return where V, monotone between `left` and `right`, passes `energy`."""
        rising = self.potential(right) > self.potential(left)
        for _ in range(_BISECTIONS):
            middle = 0.5 * (left + right)
            if (self.potential(middle) > energy) == rising:
                right = middle
            else:
                left = middle
        return 0.5 * (left + right)

    def basin_of(self, energy: float, phi: float) -> Arc | None:
        """Return the arc of `energy` that holds `phi`, or the nearest; None if there is none."""

        def distance(arc: Arc) -> float:
            inside = (phi - arc[0]) % (2.0 * np.pi)
            width = arc[1] - arc[0]
            return 0.0 if inside <= width else min(inside - width, 2.0 * np.pi - inside)

        return min(self.basins(energy), key=distance, default=None)

    def orbit(self, energy: float, arc: Arc, quantity: str) -> float:
        """Return what the orbit of a level over one of its arcs has, such as its period."""
        phi = 0.5 * (arc[0] + arc[1])
        speed = float(self.speed(np.asarray(phi), energy))
        return float(getattr(orbits(self.A, self.B, self.C, phi, speed), quantity))

    def loop(self, arc: Arc, energy: float) -> tuple[FloatArray, FloatArray]:
        """Return phi and phi' >= 0 along the upper half of a level over `arc`."""
        if is_turn(arc):
            phi = np.linspace(-np.pi, np.pi, 2 * _SAMPLES - 1)
            return phi, self.speed(phi, energy)
        middle, half = 0.5 * (arc[0] + arc[1]), 0.5 * (arc[1] - arc[0])
        # Points crowd at the ends, where phi' falls like a square root.
        phi = middle + half * np.sin(np.linspace(-0.5 * np.pi, 0.5 * np.pi, _SAMPLES))
        speed = self.speed(phi, energy)
        speed[[0, -1]] = 0.0
        return phi, speed

    def lobe(self, saddle: int, side: int) -> tuple[FloatArray, FloatArray]:
        """Return the upper half of a separatrix from its saddle to the turning point or partner."""
        start = float(self.separatrices.saddle_phi[saddle])
        offset = float(self.separatrices.turning_offset[saddle, side])
        tau = np.linspace(0.0, 1.0, _SAMPLES)
        phi = start + offset * np.sin(0.5 * np.pi * tau)
        speed = self.speed(phi, float(self.separatrices.saddle_energy[saddle]))
        speed[[0, -1]] = 0.0
        return phi, speed

    def winding(self, saddle: int) -> tuple[FloatArray, FloatArray]:
        """Return the upper half of a separatrix that runs round the cylinder."""
        phi = float(self.separatrices.saddle_phi[saddle]) + np.linspace(0.0, 2.0 * np.pi, 481)
        speed = self.speed(phi, float(self.separatrices.saddle_energy[saddle]))
        speed[[0, -1]] = 0.0
        return phi, speed

    def levels(self, spacing: float = 1.0 / 6.0) -> list[Level]:
        """Choose levels that are evenly spaced in speed, region by region between the saddles.

        Returns
        -------
        list of (energy, phi)
            `phi` names the well of a level that is meant for one well only; None means all arcs.
        """
        if not self.height.size:
            return [(0.5 * k * k, None) for k in (1.0, 2.0, 3.0)]
        step = spacing * self.top_speed
        centers = np.isfinite(self.equilibria.phi[[0, 2]])
        rims = self.separatrices.saddle_energy
        rim = float(np.nanmin(rims))
        chosen: list[Level] = []
        for slot, present in zip((0, 2), centers, strict=True):
            if not present:
                continue
            bottom = float(self.equilibria.energy[slot])
            depth = float(np.sqrt(2.0 * max(rim - bottom, 0.0)))
            count = max(2, round(depth / step))
            where = float(self.equilibria.phi[slot])
            chosen += [(bottom + 0.5 * (depth * k / count) ** 2, where) for k in range(1, count)]
        low = float(np.sqrt(2.0 * max(rim - self.floor, 0.0)))
        gap = self.top_speed - low
        if gap > 0.3 * step:
            count = max(2, round(gap / step))
            rise = gap / count
            chosen += [(self.floor + 0.5 * (low + rise * k) ** 2, None) for k in range(1, count)]
        above = range(1, max(2, round(1.0 / (3.0 * spacing))) + 1)
        chosen += [(self.floor + 0.5 * (self.top_speed + step * k) ** 2, None) for k in above]
        return chosen


def is_turn(arc: Arc) -> bool:
    """Return whether an arc is the whole circle."""
    return arc[1] - arc[0] >= 2.0 * np.pi


def scalar_coefficients(system: Any) -> tuple[float, float, float]:
    """Return A, B, C of a system as floats, or say why they are not single numbers."""
    system = as_system(system)
    arrays = [name for name, value in system.parameters.items() if not isinstance(value, float)]
    if arrays:
        raise ParameterError(
            f"system: got array parameters ({', '.join(arrays)}), wants a single system; select "
            "one cell first: ds.isel(...).phasekit.system()"
        )
    A, B, C = system.coefficients()
    return A, B, C
