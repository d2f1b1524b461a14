"""From systems and states to cells of a kernel: which cell belongs to which system.

The equilibria of a system are computed once, however many states broadcast against it.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from phasekit.arrays import Array, Index
from phasekit.phase.exact.kernels import portrait as kernels
from phasekit.phase.exact.phase_space import Equilibria, equilibria


class Systems(NamedTuple):
    """Systems with their equilibria, one a row, and the shape over which they are spread."""

    A: Array
    B: Array
    C: Array
    points: Equilibria
    shape: tuple[int, ...]

    @property
    def rows(self) -> kernels.Systems:
        """What kernels take."""
        return self.A, self.B, self.C, self.points.phi, self.points.curvature

    def numbers(self, shape: tuple[int, ...]) -> Index:
        """Number of the system of each cell of a shape."""
        own = np.arange(self.A.size).reshape(self.shape)
        return np.array(np.broadcast_to(own, shape)).reshape(-1)


def systems(A: npt.ArrayLike, B: npt.ArrayLike, C: npt.ArrayLike, threads: int | None) -> Systems:
    """Systems with coefficients that broadcast, and their equilibria."""
    arrays = [np.asarray(value, dtype=float) for value in (A, B, C)]
    shape = np.broadcast_shapes(*(array.shape for array in arrays))
    a, b, c = (flat(array, shape) for array in arrays)
    return Systems(a, b, c, equilibria(a, b, c, threads=threads), shape)


def flat(array: npt.ArrayLike, shape: tuple[int, ...]) -> Array:
    """Copy over all cells of a shape, in one row: what a compiled kernel takes."""
    return np.array(np.broadcast_to(np.asarray(array, dtype=float), shape)).reshape(-1)
