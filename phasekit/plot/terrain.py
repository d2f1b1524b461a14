"""The graph of any potential as pictures need it: a window, critical points, level curves in it.

Arrays only, for a `Potential`; `landscape` does the same for systems with coefficients.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from phasekit.errors import EquilibriumKind, ParameterError
from phasekit.labelled.potential_system import Potential
from phasekit.phase.numerical import functions
from phasekit.phase.numerical.equilibria import Equilibria
from phasekit.phase.numerical.separatrices import Separatrices

FloatArray = NDArray[np.float64]
Arc = tuple[float, float]
#: A level: its energy, and the point whose arc alone is meant, or None.
Level = tuple[float, float | None]

_SAMPLES = 241
_BISECTIONS = 60
#: Energies that differ by less than this part of the scale are one.
_SAME = 1e-12


@dataclass(frozen=True)
class Terrain:
    """One potential with its equilibria and separatrices, in a window.

    Attributes
    ----------
    system : Potential
        Its parameters are scalars.
    equilibria, separatrices
        Results of the array floor.
    window : (float, float)
        What is shown of the coordinate.
    """

    system: Potential
    equilibria: Equilibria
    separatrices: Separatrices
    window: tuple[float, float]

    @classmethod
    def of(cls, system: Potential) -> Terrain:
        """Return the terrain of a potential whose parameters are all scalars."""
        values = list(system.parameters.values())
        for name, value in system.parameters.items():
            if not isinstance(value, float):
                raise ParameterError(
                    f"system: got an array parameter ({name}), wants a single system; select one "
                    "cell first: ds.isel(...).phasekit.system()"
                )
        system.law.check_searchable()
        points, loops = functions.phase_space(system.formula, *values)
        return cls(system, points, loops, _window(system, points, loops))

    @property
    def knots(self) -> FloatArray:
        """Ends of the window and the critical points in it: V is monotone in between."""
        low, high = self.window
        phi = self.equilibria.phi
        inside = phi[(phi > low) & (phi < high)]
        return np.concatenate([[low], inside, [high]])

    @property
    def floor(self) -> float:
        """Least potential in the window."""
        return float(np.min(self.potential(self.knots)))

    @property
    def summit(self) -> float:
        """Energy of the highest saddle, or of the window's lower end where there is none."""
        energies = self.separatrices.saddle_energy
        if energies.size:
            return float(np.max(energies))
        return float(np.min(self.potential(np.array(self.window))))

    @property
    def top_speed(self) -> float:
        """Greatest speed on the level of the summit; 1 where that is flat."""
        speed = float(np.sqrt(2.0 * max(self.summit - self.floor, 0.0)))
        return speed if speed > 0.0 else 1.0

    def potential(self, x: Any) -> FloatArray:
        """Return V at x."""
        return self.system.potential(x)

    def energy(self, x: float, speed: float) -> float:
        """Return the energy of a state."""
        return float(self.potential(x)) + 0.5 * speed * speed

    def arcs(self, energy: float) -> list[Arc]:
        """Return the arcs of the window where V < energy, cut at saddles of that energy."""
        knots = self.knots
        height = self.potential(knots)
        slack = _SAME * (float(np.max(np.abs(height))) + abs(energy))
        arcs: list[Arc] = []
        for left, right, a, b in zip(knots[:-1], knots[1:], height[:-1], height[1:], strict=True):
            if min(a, b) >= energy - slack:
                continue
            start, stop = float(left), float(right)
            if a > energy + slack:
                start = self._crossing(left, right, energy)
            elif b > energy + slack:
                stop = self._crossing(left, right, energy)
            if arcs and arcs[-1][1] == start and a < energy - slack:
                arcs[-1] = (arcs[-1][0], stop)
            else:
                arcs.append((start, stop))
        return arcs

    def _crossing(self, left: float, right: float, energy: float) -> float:
        rising = self.potential(right) > self.potential(left)
        for _ in range(_BISECTIONS):
            middle = 0.5 * (left + right)
            if bool(self.potential(middle) > energy) == bool(rising):
                right = middle
            else:
                left = middle
        return 0.5 * (left + right)

    def arc_at(self, energy: float, x: float) -> Arc | None:
        """Return the arc of a level that holds x, or None."""
        for arc in self.arcs(energy):
            slack = 1e-9 * (arc[1] - arc[0])
            if arc[0] - slack <= x <= arc[1] + slack:
                return arc
        return None

    def closes(self, arc: Arc) -> tuple[bool, bool]:
        """Whether the level turns at either end of an arc, or leaves the window there."""
        return arc[0] > self.window[0], arc[1] < self.window[1]

    def turns_round(self, arc: Arc) -> bool:
        """Whether the level runs round the circle."""
        return self.system.period is not None and arc == self.window

    def curve(self, arc: Arc, energy: float) -> tuple[FloatArray, FloatArray]:
        """Return x and x' >= 0 along a level over one of its arcs."""
        middle, half = 0.5 * (arc[0] + arc[1]), 0.5 * (arc[1] - arc[0])
        # Points crowd at the ends, where x' falls like a square root.
        x = middle + half * np.sin(np.linspace(-0.5 * np.pi, 0.5 * np.pi, _SAMPLES))
        with np.errstate(invalid="ignore"):
            speed = np.sqrt(2.0 * np.maximum(energy - self.potential(x), 0.0))
        for place, closed in zip((0, -1), self.closes(arc), strict=True):
            if closed:
                speed[place] = 0.0
        return x, speed

    def orbit(self, energy: float, arc: Arc, quantity: str) -> float:
        """Return what the orbit of a level over one of its arcs has, such as its period."""
        inside = self.knots[(self.knots > arc[0]) & (self.knots < arc[1])]
        low = inside if inside.size else np.array([0.5 * (arc[0] + arc[1])])
        x = float(low[np.argmin(self.potential(low))])
        speed = float(np.sqrt(2.0 * max(energy - float(self.potential(x)), 0.0)))
        values = list(self.system.parameters.values())
        return float(getattr(functions.orbits(self.system.formula, *values, x, speed), quantity))

    def levels(self, spacing: float = 1.0 / 6.0) -> list[Level]:
        """Choose levels evenly spaced in speed: well by well, then over all."""
        step = spacing * self.top_speed
        rims = self.separatrices.saddle_energy
        chosen: list[Level] = []
        for x, bottom, kind in zip(
            self.equilibria.phi, self.equilibria.energy, self.equilibria.kind, strict=True
        ):
            if kind != EquilibriumKind.CENTER or not rims.size:
                continue
            above = rims[rims > bottom]
            around = self.separatrices.saddle_phi[rims > bottom]
            near = [above[around < x][-1:], above[around > x][:1]]
            if self.system.period is not None:
                near += [above]
            rim = float(min((float(np.min(r)) for r in near if r.size), default=bottom))
            depth = float(np.sqrt(2.0 * max(rim - bottom, 0.0)))
            count = max(2, round(depth / step))
            chosen += [
                (float(bottom) + 0.5 * (depth * k / count) ** 2, float(x)) for k in range(1, count)
            ]
        first = 0.0 if not rims.size else float(np.sqrt(2.0 * max(np.min(rims) - self.floor, 0.0)))
        speeds = np.arange(first + step, 1.4 * self.top_speed + 0.5 * step, step)
        chosen += [(self.floor + 0.5 * float(s) ** 2, None) for s in speeds]
        slack = 1e-3 * (self.summit - self.floor)
        return [level for level in chosen if not np.any(np.abs(rims - level[0]) <= slack)]

    def arcs_of(self, level: Level) -> list[Arc]:
        """Return the arcs over which a level is drawn: one, or all."""
        energy, x = level
        if x is None:
            return self.arcs(energy)
        arc = self.arc_at(energy, x)
        return [] if arc is None else [arc]


def _window(system: Potential, points: Equilibria, loops: Separatrices) -> tuple[float, float]:
    if system.period is not None or system.interval is not None:
        return system.formula.ends
    marks = np.concatenate([points.phi, loops.turning_phi.ravel()])
    marks = marks[np.isfinite(marks)]
    if not marks.size:
        return -2.0, 2.0
    low, high = float(marks.min()), float(marks.max())
    if low == high:
        return low - 2.0, high + 2.0
    margin = 0.3 * (high - low)
    return low - margin, high + margin
