"""How many mesh intervals an orbit needs, and where they should lie."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from phasekit.bifurcation.continuation.periodic import collocation
from phasekit.bifurcation.continuation.periodic.cycles import Cycles, Orbit

Array = npt.NDArray[np.float64]

SPARE = 0.3  # part of the mesh tolerance that a new mesh aims at
LEAST = 8
FLAT, STILL = 1e-3, 60  # amplitude beside the scale of what is at rest, and its intervals


def count_for(cycles: Cycles, orbit: Orbit) -> int:
    """Number of intervals with which the mesh error is a part of its tolerance."""
    m = cycles.m
    sizes = collocation.highest(orbit.mesh, orbit.x, m, cycles.amplitudes(orbit), cycles.closure)
    whole = 1.2 * float(np.sum(sizes ** (1.0 / (m + 1)) * np.diff(orbit.mesh)))
    aim = SPARE * cycles.options.mesh_tolerance / collocation.factor(m)
    if cycles.forced and np.all(cycles.amplitudes(orbit) < FLAT * cycles.scale):
        return max(LEAST, STILL)  # the multipliers of a state at rest still have a mesh to resolve
    count = whole / aim ** (1.0 / (m + 1))
    return max(LEAST, 4 * int(np.ceil(min(count, 1e6) / 4.0)))


def fitted(cycles: Cycles, orbit: Orbit) -> Array:
    """A mesh over which the error is even, with as many intervals as the orbit needs."""
    fixed = cycles.options.intervals
    count = orbit.intervals if fixed is None else fixed
    if fixed is None:
        wanted = min(count_for(cycles, orbit), cycles.options.max_intervals)
        if wanted > count or wanted < 0.75 * count:
            count = wanted
    return collocation.even(
        orbit.mesh, orbit.x, cycles.m, cycles.amplitudes(orbit), count, cycles.closure
    )
