"""Systems of one formula, one a row: what every step of the numerical path works on."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from phasekit.arrays import Array, Ints
from phasekit.phase.numerical.formula import Formula


@dataclass(frozen=True, eq=False)
class Systems:
    """A formula with the parameters of some systems, each an array of shape (systems,)."""

    formula: Formula
    parameters: tuple[Array, ...]
    size: int

    def take(self, rows: Ints) -> Systems:
        """The systems of some rows, which may repeat."""
        return Systems(self.formula, tuple(p[rows] for p in self.parameters), len(rows))

    @property
    def finite(self) -> npt.NDArray[np.bool_]:
        """Which systems have finite parameters alone."""
        valid = np.ones(self.size, dtype=bool)
        for p in self.parameters:
            valid &= np.isfinite(p)
        return valid

    def potential(self, x: Array) -> Array:
        """V at x of shape (systems, ...)."""
        return self.formula.values(x, *self.beside(x))

    def slope(self, x: Array) -> Array:
        """V' at x of shape (systems, ...)."""
        return self.formula.slopes(x, *self.beside(x))

    def bend(self, x: Array) -> Array:
        """V'' at x of shape (systems, ...)."""
        return self.formula.bends(x, *self.beside(x))

    def coefficients(self) -> npt.NDArray[np.complex128] | Array:
        """Coefficients of V', shape (systems, n); see `Formula.slope_coefficients`."""
        found = self.formula.slope_coefficients(self.parameters)
        return np.broadcast_to(found, (self.size, found.shape[-1]))

    def beside(self, x: Array) -> tuple[Array, ...]:
        """The parameters, in shapes that broadcast against x of shape (systems, ...)."""
        extra = (1,) * (x.ndim - 1)
        return tuple(p.reshape(p.shape + extra) for p in self.parameters)


def make_systems(
    formula: Formula, parameters: tuple[npt.ArrayLike, ...]
) -> tuple[Systems, tuple[int, ...]]:
    """Lay out parameters that broadcast as one row of systems; the shape that they had."""
    arrays = [np.asarray(value, dtype=float) for value in parameters]
    shape = np.broadcast_shapes(*(array.shape for array in arrays))
    flat = tuple(np.array(np.broadcast_to(array, shape)).reshape(-1) for array in arrays)
    return Systems(formula, flat, int(np.prod(shape, dtype=int))), shape
