"""Null vectors along a curve of folds or flips, which do not jump from point to point."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from phasekit.bifurcation.continuation.curve import Curve
from phasekit.bifurcation.continuation.kernels.defining import FLIP

Array = npt.NDArray[np.float64]


def left_and_right(curve: Curve, u: Array, slopes: Array) -> tuple[Array, Array]:
    """Left and right null vectors at points of a curve of folds; both move smoothly along it.

    They are those of f_x, of a curve of flips those of f_x + 2. The adjugate is smooth and a
    multiple of v p; so p is the adjugate's transpose on v.
    """
    n, m = curve.n, curve.m
    scale = curve.scale[:n]
    v = u[:, m : m + n] / scale
    matrix = slopes[:, :, :n] + (2.0 * np.eye(n) if curve.kind == FLIP else 0.0)
    scaled = matrix * scale
    rows = np.max(np.abs(slopes * curve.scale[:m]), axis=2)
    # Each row by the same number at all points, so that nothing jumps.
    rows = np.max(rows, axis=0)
    scaled = scaled / np.where(rows > 0.0, rows, 1.0)[:, None]
    return np.einsum("kij,ki->kj", adjugate(scaled), v) / np.where(rows > 0.0, rows, 1.0), v


def adjugate(matrix: Array) -> Array:
    """Adjugates of singular matrices."""
    n = matrix.shape[-1]
    if n == 1:
        return np.ones_like(matrix)
    if n == 2:
        a, b, c, d = (matrix[:, i, j] for i in (0, 1) for j in (0, 1))
        return np.stack([np.stack([d, -b], -1), np.stack([-c, a], -1)], -2)
    left, values, right = np.linalg.svd(matrix)
    sign = np.linalg.det(left) * np.linalg.det(right)
    size = np.exp(np.mean(np.log(np.maximum(values[:, :-1], 1e-300)), axis=1))
    return np.asarray((sign * size)[:, None, None] * right[:, -1, :, None] * left[:, None, :, -1])
