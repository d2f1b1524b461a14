"""Test functions along a path of equilibria, for many points at once ([Kuznetsov2004] 10.2)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from phasekit.bifurcation.continuation.curve import Curve

Array = npt.NDArray[np.float64]
NEUTRAL = 1e-9  # a spectrum whose pairs sum to less, relative, is that of a conservative system


@dataclass(frozen=True)
class Tests:
    """Test functions of points: each changes its sign where something happens.

    Attributes
    ----------
    fold : ndarray
        Component of the unit tangent along the parameter.
    branch : ndarray
        Determinant of f_u with the tangent as last row, on scaled axes, rows of length one.
    pair : ndarray
        Sum of two real or two conjugate eigenvalues, the smallest in size, with the sign of the
        product of all: zero at Hopf points and neutral saddles.
    unstable : ndarray of int
        Number of eigenvalues with a positive real part.
    eigenvalues : ndarray
        Eigenvalues of f_x.
    """

    fold: Array
    branch: Array
    pair: Array
    unstable: npt.NDArray[np.int64]
    eigenvalues: npt.NDArray[np.complex128]


def eigenvalues_of(slopes: Array) -> npt.NDArray[np.complex128]:
    """Eigenvalues of f_x of many points."""
    n = slopes.shape[-2]
    if n == 1:
        return slopes[..., :, 0].astype(complex)
    if n == 2:
        return _eigenvalues_of_two(slopes)
    finite = np.isfinite(slopes).all(axis=(-2, -1))
    result = np.full(slopes.shape[:-2] + (n,), np.nan, dtype=complex)
    result[finite] = np.linalg.eigvals(slopes[finite][..., :n])
    return result


def _eigenvalues_of_two(slopes: Array) -> npt.NDArray[np.complex128]:
    """Eigenvalues of 2 x 2 matrices in closed form, without cancellation where they are real."""
    a, b, c, d = slopes[..., 0, 0], slopes[..., 0, 1], slopes[..., 1, 0], slopes[..., 1, 1]
    mean, half = 0.5 * (a + d), 0.5 * (a - d)
    root = half * half + b * c
    real = root >= 0.0
    width = np.sqrt(np.abs(root))
    far = mean + np.where(mean >= 0.0, width, -width)
    with np.errstate(all="ignore"):
        # The product is the determinant, which is exact next to zero where mean -+ width is not.
        near = np.where(far != 0.0, (a * d - b * c) / far, 0.0)
    result = np.empty(slopes.shape[:-2] + (2,), dtype=complex)
    result.real = np.stack([np.where(real, far, mean), np.where(real, near, mean)], axis=-1)
    result.imag = np.stack([np.where(real, 0.0, width), np.where(real, 0.0, -width)], axis=-1)
    return result


def determinant(matrix: Array) -> Array:
    """Determinants of many matrices; of small ones in closed form."""
    if matrix.shape[-1] == 2:
        a, b, c, d = (matrix[..., i, j] for i in (0, 1) for j in (0, 1))
        return np.asarray(a * d - b * c)
    if matrix.shape[-1] == 3:
        return np.asarray(np.sum(matrix[..., 0, :] * _cross(matrix), axis=-1))
    return np.asarray(np.linalg.det(matrix))


def _cross(matrix: Array) -> Array:
    """Cross product of the last two of three rows."""
    (a, b, c), (x, y, z) = (np.moveaxis(matrix[..., i, :], -1, 0) for i in (1, 2))
    return np.stack([b * z - c * y, c * x - a * z, a * y - b * x], axis=-1)


def test_functions(curve: Curve, tangent: Array, slopes: Array, *, pairs: bool) -> Tests:
    """The test functions of points with their tangents and derivatives of f."""
    n, m = curve.n, curve.m
    scale = curve.scale[:m]
    top = slopes * scale
    top = top / np.maximum(np.linalg.norm(top, axis=-1, keepdims=True), 1e-300)
    bottom = tangent[..., :m] / scale
    matrix = np.concatenate([top, bottom[..., None, :]], axis=-2)
    values = eigenvalues_of(slopes)
    return Tests(
        tangent[..., n] / scale[n],
        determinant(matrix),
        pair_function(values) if pairs and n > 1 else np.ones(slopes.shape[:-2]),
        np.sum(values.real > 0.0, axis=-1),
        values,
    )


def pair_function(values: npt.NDArray[np.complex128]) -> Array:
    """Smallest real sum of two eigenvalues with the sign of the product of all such sums."""
    n = values.shape[-1]
    i, j = np.triu_indices(n, 1)
    sums = values[..., i] + values[..., j]
    both_real = (values[..., i].imag == 0.0) & (values[..., j].imag == 0.0)
    conjugate = (values[..., i] == np.conj(values[..., j])) & ~both_real
    real = both_real | conjugate
    sizes = np.where(real, np.abs(sums.real), np.inf)
    negative = np.sum(real & (sums.real < 0.0), axis=-1)
    least = np.min(sizes, axis=-1, initial=np.inf)
    least = np.where(np.isfinite(least), least, 1.0)
    return np.asarray(np.where(negative % 2 == 1, -least, least))


def is_conservative(values: npt.NDArray[np.complex128]) -> bool:
    """Whether the spectrum of every point is its own mirror image: no damping anywhere."""
    n = values.shape[-1]
    if n < 2 or n % 2 or not len(values):
        return False
    size = np.max(np.abs(values), axis=-1, initial=1e-300)
    order = np.sort_complex(values)
    mirror = np.sort_complex(-values)
    gap = np.abs(order - mirror).max(axis=-1) / np.where(size > 0.0, size, 1.0)
    return bool(np.median(gap) <= NEUTRAL and np.max(gap) < 1e-5)
