"""An inertia that changes with the coordinate: by arc length it is 1, and all methods hold.

Along s, with ds = sqrt(M(x)) dx, the energy M(x) x'^2/2 + V(x) is s'^2/2 + V, so that s'' = -dV/ds.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from phasekit.arrays import Array
from phasekit.errors import EquilibriumKind, ParameterError
from phasekit.laws.ladder import Routhian
from phasekit.phase.numerical import orbits as rounds
from phasekit.phase.numerical.differences import Ground, survey
from phasekit.phase.numerical.equilibria import Equilibria
from phasekit.phase.numerical.formula import Formula, Shape
from phasekit.phase.numerical.systems import Systems

_LEAST, _MOST = 64, 4096
_NEWTON = 6
_ROUNDING = np.finfo(float).eps
#: Rounding of the series for the arc length and back, as part of half a turn.
SERIES = 8.0 * float(_ROUNDING)


@dataclass(frozen=True, eq=False)
class Wave:
    """A function that grows evenly but for a Fourier sum: rate t + Re sum of c_k exp(2 pi i k t/T).

    Attributes
    ----------
    rate : float
        Mean of the derivative.
    period : float
        T.
    series : numpy.ndarray
        c_0, c_1, ...
    """

    rate: float
    period: float
    series: npt.NDArray[np.complex128]

    def __call__(self, t: npt.ArrayLike) -> Array:
        """Return the values at t."""
        t = np.asarray(t, dtype=float)
        turn = np.exp(2j * np.pi / self.period * t)
        total = np.zeros_like(turn)
        for coefficient in self.series[::-1]:
            total = total * turn + coefficient
        return np.asarray(self.rate * t + total.real)

    def slope(self) -> Wave:
        """Derivative of a wave that does not grow."""
        turns = 2j * np.pi / self.period * np.arange(self.series.size)
        return Wave(0.0, self.period, turns * self.series)


def _fourier(
    function: Callable[[Array], Array], period: float, size: float
) -> npt.NDArray[np.complex128]:
    """Coefficients of a periodic function as those of a `Wave`; none if they do not end.

    They end where they are lost beside `size`.
    """
    count = _LEAST
    while count <= _MOST:
        found = np.fft.rfft(function(period * np.arange(count) / count))[: count // 2] / count
        found[1:] *= 2.0
        if np.max(np.abs(found[-count // 8 :])) <= _ROUNDING * size:
            kept = np.flatnonzero(np.abs(found) > _ROUNDING * size)
            return found[: kept.max(initial=0) + 1]
        count *= 2
    return np.empty(0, complex)


@dataclass(frozen=True, eq=False)
class ArcLength:
    """The arc length s of a law's coordinate x, 0 at x = 0.

    Attributes
    ----------
    law : Routhian
        The law.
    length, place : Wave
        s of x, and x of s.
    """

    law: Routhian
    length: Wave
    place: Wave

    @classmethod
    def from_law(cls, law: Routhian) -> ArcLength:
        """Integrate sqrt(M), a Fourier series, term by term, and invert the sum."""

        def rate(x: Array) -> Array:
            with np.errstate(all="ignore"):
                finite = np.isfinite(law.potential(x)[0]).all()
                return np.sqrt(law.inertia(x)[0]) if finite else np.full(x.shape, np.nan)

        mean = float(np.mean(rate(law.period * np.arange(_LEAST) / _LEAST)))
        rates = _fourier(rate, law.period, mean)
        if rates.size and mean > 0.0:
            series = rates * law.period / (2j * np.pi * np.maximum(np.arange(rates.size), 1))
            series[0] = -series[1:].sum().real
            length = Wave(float(rates[0].real), law.period, series)
            turn = length.rate * law.period
            nodes = np.linspace(0.0, law.period, 16 * (series.size + 4))

            def lag(s: Array) -> Array:
                x = np.interp(s, length(nodes), nodes)
                for _ in range(_NEWTON):
                    x = x - (length(x) - s) / rate(x)
                return np.asarray(x - s / length.rate)

            with np.errstate(all="ignore"):
                back = _fourier(lag, turn, law.period)
            if back.size:
                return cls(law, length, Wave(1.0 / length.rate, turn, back))
        wants = "an inertia > 0 at every place, and finite energies"
        known = law.momentum
        where = "one" if known is None else f"one at {known[0]} = {known[1]:g}"
        raise ParameterError(f"system: got {where}, wants {wants}")

    @property
    def turn(self) -> float:
        """Arc length of the whole circle."""
        return self.place.period

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
        rows: Any = (a[np.newaxis] for a in columns)
        # All of them, and no stretch that may hold others.
        count, gaps = np.array([phi.size], np.int16), np.full((1, 2), np.nan)
        none = np.zeros(1, np.int64)
        unknown = np.full((1, phi.size), np.nan)
        points = Equilibria._make((*rows, count, np.array([True]), gaps, none, unknown))
        return survey(Systems(self.formula(), (), 1), points)

    def bends_of_centers(self, ground: Ground) -> tuple[Array, Array, Array]:
        """Second to fourth derivatives of V by s at the equilibria, NaN but for centers."""
        bends, points = self.formula().bends, ground.points
        nodes = self.turn * np.arange(_LEAST) / _LEAST
        series = _fourier(bends, self.turn, float(np.max(np.abs(bends(nodes)))))
        if not series.size:
            raise ParameterError(
                "system: got a potential with details too narrow, or too much rounding, for a "
                "Fourier series, wants a smoother one; pk.orbits has the periods of all"
            )
        third = Wave(0.0, self.turn, series).slope()
        center = np.where(points.kind[0] == EquilibriumKind.CENTER, points.phi[0], np.nan)
        curvature = np.where(np.isfinite(center), points.curvature[0], np.nan)
        return curvature, third(center), third.slope()(center)

    def scale(self, x: npt.ArrayLike) -> Array:
        """Arc length per coordinate: the root of the inertia."""
        return np.asarray(np.sqrt(self.law.inertia(np.asarray(x, float))[0]))

    def error(self, x: Array, error: Any) -> Array:
        """An error of the arc length as one of the coordinate, which may be NaN."""
        there = np.where(np.isfinite(x), x, 0.0)
        rounding = SERIES * (0.5 * self.law.period + np.abs(there))
        return np.asarray(error / self.scale(there) + rounding)

    def by_coordinate(self, found: rounds.Orbits) -> rounds.Orbits:
        """Orbits along the arc length in terms of the coordinate."""
        low, high = self.place(found.phi_min), self.place(found.phi_max)
        return found._replace(
            phi_min=low, phi_max=high, amplitude=0.5 * (high - low),
            phi_min_error=self.error(low, found.phi_min_error),
            phi_max_error=self.error(high, found.phi_max_error),
        )  # fmt: skip

    def orbit(self, ground: Ground, x: float, v: float) -> rounds.Orbits:
        """The orbit through a state (x, x')."""
        found = rounds.orbits(ground, self.length([x]), np.array([v * float(self.scale(x))]))
        return rounds.Orbits._make(field[0] for field in self.by_coordinate(found))
