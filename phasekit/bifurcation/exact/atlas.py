"""The complete atlas of equilibria along one parameter, as smooth curves, by exact arithmetic."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from phasekit.arrays import Array
from phasekit.bifurcation.curves import Columns, Curve, Meeting, curves
from phasekit.bifurcation.exact.line import Path
from phasekit.bifurcation.exact.meetings import CENTERS, SADDLES, join_all, survey
from phasekit.errors import EquilibriumKind
from phasekit.phase.exact.phase_space import Equilibria, equilibria
from phasekit.phase.exact.potential import potential

Coefficients = Callable[[Array], tuple[Array, Array, Array]]

TURN = 2.0 * np.pi


def atlas(path: Path, coefficients: Coefficients) -> tuple[list[Curve], list[Meeting]]:
    """All curves of equilibria over the span of a path, and the special points on them.

    Coefficients A, B, C are functions of an array of values of the parameter. Curves that run
    through the span from its left end come first; the meetings on a curve are places in the second
    list.
    """
    events, intervals = survey(path)
    joints = join_all(path, events, intervals)
    limits = [path.span[0], *(event.at for event in events), path.span[1]]
    labels = [interval.labels for interval in intervals]
    return curves(Named(path.span, coefficients), limits, labels, joints), joints.meetings


@dataclass(frozen=True)
class Named:
    """Equilibria of (A, B, C), whose labels are names."""

    span: tuple[float, float]
    coefficients: Coefficients
    size: float = TURN
    circle: float = TURN

    def solve(self, at: Array) -> Equilibria:
        """Equilibria at values of the parameter."""
        return equilibria(*self.coefficients(at))

    def columns(self, interval: int, at: Array, points: Equilibria) -> Columns:
        """These by their labels, which stay the same between two events."""
        return Columns(*points[:4], np.broadcast_to(np.arange(4), points.phi.shape))

    def end(self, at: float, near: float, kind: int, label: int) -> Sequence[float]:
        """The equilibrium of a label at a value, or of another one that ties there."""
        points = self.solve(np.array([at]))
        # Two labels may tie here, so that the nearest point of the kind counts.
        slots = CENTERS if label in CENTERS else SADDLES
        away = [abs(_turned(float(points.phi[0, slot]) - near)) for slot in slots]
        slot = slots[int(np.nanargmin(away))] if np.isfinite(away).any() else label
        return [float(x[0, slot]) for x in points[:4]]

    def special(self, meeting: Meeting, kind: int) -> Sequence[float]:
        """A merged equilibrium."""
        A, B, C = self.coefficients(np.array([meeting.at]))
        energy = float(potential(A, B, C, meeting.phi)[0])
        return meeting.phi, EquilibriumKind.DEGENERATE, energy, 0.0


def _turned(angle: float) -> float:
    return (angle + np.pi) % TURN - np.pi
