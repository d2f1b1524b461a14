"""Families at one value of the parameter: those round centers, where something is conserved."""

from __future__ import annotations

import numpy as np

from phasekit.cycles.cycles import Cycles
from phasekit.cycles.family import Path
from phasekit.cycles.point import neutral

STAYS = 1e-9  # part of its span by which a parameter moves by rounding
ALIKE = 1e-9  # part by which periods differ by rounding


def said_of(cycles: Cycles, path: Path) -> tuple[str, ...]:
    """That a family is vertical, in words; nothing where it is not, or is so by its equations."""
    points = path.points
    if len(cycles.active) > 1 or not np.isfinite(cycles.width[0]) or len(points) < 3:
        return ()
    p = np.array([point.orbit.y[1] for point in points])
    # Rounding of the largest orbits is that of their rates.
    rates = np.array([1.0 / point.orbit.y[0] for point in points])
    moved = np.abs(p - np.median(p)) > STAYS * cycles.width[0] * np.maximum(rates / rates[0], 1.0)
    known = [point for point in points if point.trusted]
    if np.any(moved) or not known or not all(neutral(cycles, point) for point in known):
        return ()
    name, value = cycles.field.parameters[cycles.active[0]], float(np.median(p))
    value = 0.0 if abs(value) <= STAYS * cycles.width[0] else value
    alike = bool(np.ptp(rates) <= ALIKE * rates[0])
    periods = ", with one period," if alike else ""
    return (
        f"a vertical family: {name} = {value:.9g} all along it, within rounding; orbits of all its "
        f"amplitudes{periods} exist together there, as round a center; families that leave it are "
        f"not looked for: an orbit at another {name} leads to one",
    )
