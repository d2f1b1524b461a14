"""Krawczyk's operator on arrays of boxes: one step of Newton's method for all points at once.

K(X) = m - Y f(m) + (I - Y f'(X)) (X - m), Y close to the inverse of f'(m). A zero in X lies in K(X)
as well; where K(X) lies inside X there is exactly one, whatever the parameters are that the bounds
allow ([MooreKearfottCloud2009] 8.2).
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from phasekit.arrays import Array, Flags

#: Half the spacing of doubles next to one.
UNIT = 2.0**-53


class Image(NamedTuple):
    """K of boxes: its middle and radius, and where it is usable."""

    middle: Array
    radius: Array
    usable: Flags

    @property
    def low(self) -> Array:
        """Its lower ends."""
        return self.middle - self.radius

    @property
    def high(self) -> Array:
        """Its upper ends."""
        return self.middle + self.radius


def inverses(matrices: Array) -> tuple[Array, Flags]:
    """Approximate inverses, 0 where there are none."""
    usable: Flags = np.asarray(np.isfinite(matrices).all(axis=(1, 2)))
    found = np.zeros_like(matrices)
    with np.errstate(all="ignore"):
        usable &= np.abs(np.linalg.det(np.where(usable[:, None, None], matrices, 0.0))) > 0.0
        if usable.any():
            found[usable] = np.linalg.inv(matrices[usable])
    usable &= np.isfinite(found).all(axis=(1, 2))
    found[~usable] = 0.0
    return found, usable


def krawczyk(
    middle: Array,
    reach: Array,
    at: tuple[Array, Array],
    slopes: tuple[Array, Array],
) -> Image:
    """K of boxes about their middles.

    Middle and reach to either side are of shape (boxes, n), bounds of f in the middle as well,
    those of its derivatives on the box of shape (boxes, n, n).
    """
    n = middle.shape[1]
    with np.errstate(all="ignore"):
        center = 0.5 * slopes[0] + 0.5 * slopes[1]
        inverse, usable = inverses(center)
        value, blur = 0.5 * (at[0] + at[1]), 0.5 * (at[1] - at[0])
        # A sum of n products is off by n rounded units at most, of the products' sizes.
        rounding = UNIT * (2 * n + 6)
        step = np.einsum("kij,kj->ki", inverse, value)
        size = np.abs(inverse)
        error = np.einsum("kij,kj->ki", size, blur + rounding * np.abs(value))
        spread = 0.5 * (slopes[1] - slopes[0]) + rounding * np.abs(center)
        eye = np.eye(n)
        off = np.abs(eye - np.einsum("kij,kjl->kil", inverse, center))
        off += np.einsum("kij,kjl->kil", size, spread)
        off += rounding * eye
        radius = (error + np.einsum("kij,kj->ki", off, reach)) * (1.0 + 2.0 * rounding)
        found = middle - step
        radius += 4.0 * UNIT * (np.abs(middle) + np.abs(step))
    usable &= np.isfinite(radius).all(axis=1) & np.isfinite(found).all(axis=1)
    return Image(found, np.where(usable[:, None], radius, np.inf), usable)
