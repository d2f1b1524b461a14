"""Second and third derivatives of f along directions, by differences of its sparse derivatives."""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt

from phasekit.arrays import Array
from phasekit.bifurcation.continuation.large.curve import LargeCurve

Vector = npt.NDArray[Any]  # real or complex

WIDE = 2.0**-7  # of the sizes of unknowns: wide, for the rounding of large entries that cancel
KEPT = 2  # directions whose derivatives are kept: both parts of a complex one


class Forms:
    """The multilinear forms of f at one point, of the unknowns u = (x, parameter)."""

    def __init__(self, curve: LargeCurve, u: Array) -> None:
        self.curve, self.u = curve, np.array(u)
        self.matrix, self.slope = curve.derivatives(self.u)
        self.sizes = np.maximum(curve.scale, np.abs(u))
        #: Derivatives by differences have fewer digits, over wider steps.
        self.width = WIDE * (4.0 if curve.sparse.differenced else 1.0)
        self._known: dict[bytes, list[tuple[Any, Array]]] = {}

    def _full(self, z: Vector) -> Vector:
        return z if len(z) == len(self.u) else np.append(z, 0.0)

    def _step(self, z: Array) -> float:
        size = float(np.max(np.abs(z) / self.sizes))
        return self.width / size if size else 0.0

    def _beside(self, a: Array, h: float) -> list[tuple[Any, Array]]:
        """Derivatives one and two steps along a, behind and ahead: one direction serves many."""
        key = a.tobytes()
        if key not in self._known:
            self._known = dict([*self._known.items()][1 - KEPT :])
            self._known[key] = [
                self.curve.derivatives(self.u + k * h * a) for k in (-2.0, -1.0, 1.0, 2.0)
            ]
        return self._known[key]

    def second(self, a: Vector, b: Vector) -> Vector:
        """B(a, b): the second derivative of f along a and b."""
        if np.iscomplexobj(a):
            return self.second(a.real, b) + 1j * self.second(a.imag, b)
        a, b = self._full(a), self._full(b)
        h = self._step(a)
        if not h:
            return np.zeros(len(b) - 1, dtype=b.dtype)
        back, behind, ahead, far = (_on(one, b) for one in self._beside(a, h))
        one, two = ahead - behind, far - back
        return np.asarray((8.0 * one - two) / (12.0 * h))

    def third(self, a: Array, b: Vector) -> Vector:
        """C(a, a, b): the third derivative of f, twice along a."""
        a, b = self._full(a), self._full(b)
        h = self._step(a)
        if not h:
            return np.zeros(len(b) - 1, dtype=b.dtype)
        here = _on((self.matrix, self.slope), b)
        back, behind, ahead, far = (_on(one, b) for one in self._beside(a, h))
        one, two = ahead - 2.0 * here + behind, far - 2.0 * here + back
        return np.asarray((16.0 * one - two) / (12.0 * h * h))


def _on(derivatives: tuple[Any, Array], z: Vector) -> Vector:
    matrix, slope = derivatives
    return np.asarray(matrix @ z[:-1] + slope * z[-1])
