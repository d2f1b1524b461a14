"""An inertia that changes with the coordinate: by arc length it is 1, and all methods hold.

Along s, with ds = sqrt(M(x)) dx, the energy M(x) x'^2/2 + V(x) is s'^2/2 + V, so that s'' = -dV/ds.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from phasekit.errors import EquilibriumKind, ParameterError
from phasekit.laws.ladder import Routhian
from phasekit.phase.numerical import orbits as rounds
from phasekit.phase.numerical.equilibria import Equilibria
from phasekit.phase.numerical.formula import Formula, Shape
from phasekit.phase.numerical.ground import Ground, survey
from phasekit.phase.numerical.systems import Systems
from phasekit.phase.orbits import Orbits

Array = npt.NDArray[np.float64]

_SAMPLES = 32, 4096
_NEWTON = 6


@dataclass(frozen=True, eq=False)
class ArcLength:
    """The arc length s of a law's coordinate, 0 at x = 0.

    Attributes
    ----------
    law : Routhian
        The law.
    mean : float
        Mean of ds/dx.
    series : numpy.ndarray
        Fourier coefficients of s - mean x + const, from the first harmonic on.
    """

    law: Routhian
    mean: float
    series: npt.NDArray[np.complex128]

    @classmethod
    def of(cls, law: Routhian) -> ArcLength:
        """Integrate sqrt(M), a Fourier series, term by term.

        Raises
        ------
        ParameterError
            If the inertia or the potential is not finite, or the inertia vanishes somewhere.
        """
        count, most = _SAMPLES
        wants = "an inertia > 0 at every angle, and a finite energy"
        while count < most:
            count *= 2
            x = law.period * np.arange(count) / count
            with np.errstate(all="ignore"):
                inertia, height = law.inertia(x)[0], law.potential(x)[0]
            if not (np.isfinite(height).all() and np.isfinite(inertia).all() and inertia.min() > 0):
                break
            found = np.fft.rfft(np.sqrt(inertia)) / count
            if np.max(np.abs(found[-count // 8 :])) <= 1e-15 * abs(found[0]):
                order = np.arange(1, count // 2)
                series = 2.0 * found[1:-1] * law.period / (2j * np.pi * order)
                kept = np.flatnonzero(np.abs(found[1:-1]) > 1e-17 * abs(found[0]))
                size = kept[-1] + 1 if kept.size else 0
                return cls(law, float(found[0].real), series[:size])
        name, value, _ = law.momentum
        raise ParameterError(f"system: got one at {name} = {value:g}, wants {wants}")

    @property
    def turn(self) -> float:
        """Arc length of the whole circle."""
        return self.mean * self.law.period

    def length(self, x: npt.ArrayLike) -> Array:
        """Return s at x."""
        x = np.asarray(x, dtype=float)
        rates = 2j * np.pi / self.law.period * np.arange(1, self.series.size + 1)
        waves = np.expm1(x[..., np.newaxis] * rates)
        return np.asarray(self.mean * x + (waves @ self.series).real)

    def place(self, s: npt.ArrayLike) -> Array:
        """Return x at s."""
        s = np.asarray(s, dtype=float)
        nodes = np.linspace(0.0, self.law.period, 16 * (self.series.size + 4))
        turns = np.floor(s / self.turn)
        x = turns * self.law.period + np.interp(s - turns * self.turn, self.length(nodes), nodes)
        for _ in range(_NEWTON):
            x = x - (self.length(x) - s) / np.sqrt(self.law.inertia(x)[0])
        return x

    def formula(self) -> Formula:
        """The potential along s."""

        def values(s: npt.ArrayLike) -> Array:
            return np.asarray(self.law.potential(self.place(s))[0])

        def slopes(s: npt.ArrayLike) -> Array:
            x = self.place(s)
            return np.asarray(self.law.potential(x)[1] / np.sqrt(self.law.inertia(x)[0]))

        def bends(s: npt.ArrayLike) -> Array:
            x = self.place(s)
            (_, slope, bend), (inertia, change) = self.law.potential(x), self.law.inertia(x)
            return np.asarray((bend - 0.5 * slope * change / inertia) / inertia)

        return Formula(
            "V", "s", (), self.turn, None, Shape.GENERAL, None, values, slopes, bends, None
        )

    def ground(self) -> Ground:
        """The equilibria along s."""
        found = self.law.equilibria()
        place = self.length(found.phi)
        place = 0.5 * self.turn - (0.5 * self.turn - place) % self.turn
        order = np.argsort(place)
        phi, kind, energy = (a[order] for a in (found.phi, found.kind, found.energy))
        curvature = found.curvature[order] / self.law.inertia(phi)[0]
        rate = np.sqrt(np.abs(curvature))
        center = np.where(kind == EquilibriumKind.CENTER, rate, np.nan)
        saddle = np.where(kind == EquilibriumKind.SADDLE, rate, np.nan)
        columns = (place[order], kind, energy, curvature, center, saddle)
        points = Equilibria._make([a[np.newaxis] for a in columns] + [np.array([phi.size])])
        return survey(Systems(self.formula(), (), 1), points)

    def orbit(self, ground: Ground, x: float, v: float) -> Orbits:
        """The orbit through a state (x, x')."""
        speed = v * np.sqrt(self.law.inertia(x)[0])
        found = rounds.orbits(ground, self.length([x]), np.array([speed]))
        ends = (self.place(found.phi_min), self.place(found.phi_max))
        found = found._replace(phi_min=ends[0], phi_max=ends[1])
        return Orbits._make(field[0] for field in found)
