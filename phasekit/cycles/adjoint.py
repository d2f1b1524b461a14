"""The periodic solution of the adjoint equations of a cycle: how its phase responds to kicks.

z' = -A^T z with mean(f z) = 1 has one periodic solution, and f z = 1 everywhere on it
([ErmentroutTerman2010] 8.2). Phases are times: a kick dx moves the motion on by z dx.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from phasekit.cycles import collocation
from phasekit.cycles.cycles import Cycles, Orbit
from phasekit.cycles.linear import Linear

Array = npt.NDArray[np.float64]


def adjoint(cycles: Cycles, orbit: Orbit) -> tuple[Array, float]:
    """The solution at all places of the orbit, and by how much f z differs from 1."""
    line = Linear(cycles, orbit)
    line.A = -np.swapaxes(line.A, 1, 2)
    z, unknown = line.solve(
        np.zeros_like(line.f), [line.f], [line.f], right=np.array([1.0])
    )  # fmt: skip
    along = np.einsum("ki,ki->k", line.f, collocation.at_gauss(z, cycles.m).reshape(line.f.shape))
    speed = float(np.max(np.einsum("ki,ki->k", line.f, line.f)))
    return z, float(np.max(np.abs(along - 1.0))) + abs(float(unknown[0])) * speed
