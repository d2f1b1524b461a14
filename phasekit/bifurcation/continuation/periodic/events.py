"""Special points between the points of a family of periodic orbits."""

from __future__ import annotations

from phasekit.bifurcation.continuation.periodic.cycles import Cycles
from phasekit.bifurcation.continuation.periodic.family import Found, Path


def find(cycles: Cycles, path: Path) -> list[Found]:
    """All special points of a path, refined."""
    return []
