"""Second and third derivatives of f along directions, by differences of its sparse derivatives."""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt

from phasekit.arrays import Array
from phasekit.bifurcation.continuation.large.curve import LargeCurve

Vector = npt.NDArray[Any]  # real or complex

WIDE = 2.0**-7  # of the sizes of unknowns: wide, for the rounding of large entries that cancel


class Forms:
    """The multilinear forms of f at one point, of the unknowns u = (x, parameter)."""

    def __init__(self, curve: LargeCurve, u: Array) -> None:
        self.curve, self.u = curve, np.array(u)
        self.matrix, self.slope = curve.derivatives(self.u)
        self.sizes = np.maximum(curve.scale, np.abs(u))
        #: Derivatives by differences have fewer digits, over wider steps.
        self.width = WIDE * (4.0 if curve.sparse.differenced else 1.0)

    def _full(self, z: Vector) -> Vector:
        return z if len(z) == len(self.u) else np.append(z, 0.0)

    def _step(self, z: Array) -> float:
        size = float(np.max(np.abs(z) / self.sizes))
        return self.width / size if size else 0.0

    def _on(self, u: Array, z: Vector) -> Vector:
        matrix, slope = self.curve.derivatives(u)
        return np.asarray(matrix @ z[:-1] + slope * z[-1])

    def second(self, a: Vector, b: Vector) -> Vector:
        """B(a, b): the second derivative of f along a and b."""
        if np.iscomplexobj(a):
            return self.second(a.real, b) + 1j * self.second(a.imag, b)
        a, b = self._full(a), self._full(b)
        h = self._step(a)
        if not h:
            return np.zeros(len(b) - 1, dtype=b.dtype)
        one, two = (
            self._on(self.u + k * h * a, b) - self._on(self.u - k * h * a, b) for k in (1.0, 2.0)
        )
        return np.asarray((8.0 * one - two) / (12.0 * h))

    def third(self, a: Array, b: Vector) -> Vector:
        """C(a, a, b): the third derivative of f, twice along a."""
        a, b = self._full(a), self._full(b)
        h = self._step(a)
        if not h:
            return np.zeros(len(b) - 1, dtype=b.dtype)
        here = self._on(self.u, b)
        one, two = (
            self._on(self.u + k * h * a, b) - 2.0 * here + self._on(self.u - k * h * a, b)
            for k in (1.0, 2.0)
        )
        return np.asarray((16.0 * one - two) / (12.0 * h * h))
