"""Eigenvalues of a sparse f_x next to the imaginary axis, and whether none is missed.

In units of the fields, with the symmetric part S and the skew one K of f_x, no eigenvalue with a
real part >= 0 lies beyond the largest of S to the right, nor beyond the norm of K up or down
(Bendixson). Disks on the axis cover that box: each holds the eigenvalues nearest to its center, by
Arnoldi's method on the inverse, with the residuals of their vectors.
"""

from __future__ import annotations

import functools
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt
import scipy.sparse as sp
from scipy.sparse.linalg import ArpackError, LinearOperator, eigs

from phasekit.arrays import Array, Complex
from phasekit.numerics.factors import Factors

DEFECTIVE = 1e8  # condition of vectors that say nothing
BESIDE = 1e-11  # of the largest entry, by which such a matrix is moved for vectors
# An imaginary part that may be rounding, as of a double eigenvalue, and one that is: of the largest
# one. The first only is where it is so small a part of the real one: fast states beside say little.
REAL, ROUNDING, SLOW = 1e-12, 2.0**-49, 1e-3
FULL = 200  # states up to which all eigenvalues are computed
DENSE, FEW = 1000, 3  # the same where so many disks do not cover what they should
NEAREST = 12  # eigenvalues of a disk
MODES = 6  # and of the one next to zero
DISKS = 24  # of a point
SAME = 1e-7  # distance of eigenvalues that two disks share, beside their sizes
TRUE = 1e-7  # residual of an eigenvector of the inverse
INSIDE = 0.999  # of a radius
ASIDE = 1e-3  # of the height of the box: centers are no eigenvalues that lie on the axis


Modes = tuple[Complex, Complex, Complex]


@dataclass(frozen=True)
class Spectrum:
    """Eigenvalues in the upper half plane and on the real axis that were found.

    ``complete`` says whether all of those with a real part >= 0 are among them; ``matrix`` is the
    one that they are of, if all vectors are to be had, and ``some`` gives vectors of those alone.
    Of ``near`` they are those next to the axis, and more may grow.
    """

    values: Complex
    complete: bool
    matrix: Array | None = None
    some: Callable[[], Modes | None] | None = None
    near: bool = False

    @functools.cached_property
    def modes(self) -> Modes | None:
        """Eigenvalues, their vectors, and rows that are 1 on these, 0 on others; None: not known.

        All of them, or those found with their conjugates.
        """
        if self.matrix is None:
            return None if self.some is None else self.some()
        matrix = self.matrix
        eig = np.linalg.eigh if np.array_equal(matrix, matrix.T) else np.linalg.eig
        values, vectors = eig(matrix)
        if not np.linalg.cond(vectors) < DEFECTIVE:  # vectors of a matrix next to it
            n = len(matrix)
            beside = BESIDE * float(np.max(np.abs(matrix)))
            values, vectors = eig(matrix + beside * np.cos(np.arange(n * n) ** 2.0).reshape(n, n))
            if not np.linalg.cond(vectors) < DEFECTIVE:
                return None
        return _with_real_ones(values), vectors.astype(complex), np.linalg.inv(vectors)

    @property
    def pairs(self) -> int:
        """How many pairs have a positive real part."""
        return int(np.sum((self.values.imag > 0.0) & (self.values.real > 0.0)))

    @property
    def real(self) -> int:
        """How many real ones are positive."""
        return int(np.sum((self.values.imag == 0.0) & (self.values.real > 0.0)))

    @property
    def positive(self) -> int:
        """How many there are with a positive real part; -1 if it is not known."""
        return 2 * self.pairs + self.real if self.complete else -1


def box_of(matrix: Any, scale: Array) -> tuple[float, float]:
    """How far to the right and up eigenvalues with a real part >= 0 may lie."""
    units = sp.diags_array(scale)
    even = sp.csr_array(sp.diags_array(1.0 / scale) @ matrix @ units)
    both, skew = 0.5 * (even + even.T), 0.5 * (even - even.T)
    diagonal = both.diagonal()
    sums = np.asarray(abs(both).sum(axis=1)).ravel()
    right = float(np.max(diagonal + sums - np.abs(diagonal)))
    return max(right, 0.0), float(np.max(np.asarray(abs(skew).sum(axis=1))))


def spectrum_at(matrix: Any, scale: Array) -> Spectrum:
    """The eigenvalues of a matrix in units of its fields that may lie right of the axis."""
    n = matrix.shape[0]
    if n <= FULL:
        return _full(matrix, scale)
    right, up = box_of(matrix, scale)
    if right == 0.0:
        return Spectrum(np.empty(0, dtype=complex), True)
    found: list[complex] = []
    right_vectors: list[Complex] = []
    centers: list[complex] = []
    height = max(up, ASIDE * right)
    complete, low, step, middle = True, 0.0, 0.25 * height, 0.5 * right
    for number in range(DISKS):
        if number == FEW and n <= DENSE:
            return _full(matrix, scale)
        center = low + max(step, ASIDE * height)
        disk = nearest(matrix, middle + 1j * center)
        if disk is None:
            return Spectrum(np.array(found, dtype=complex), False)
        values, vectors, radius = disk
        new = [k for k, one in enumerate(values) if not _seen(one, found)]
        found += values[new].tolist()
        right_vectors += list(vectors[:, new].T)
        centers.append(middle + 1j * center)
        square = radius**2 - middle**2  # the chord of the disk at both sides of the box
        half = float(np.sqrt(square)) if square > 0.0 else 0.0
        if half > 0.0 and center - half <= low:
            low, step = center + half, half
        elif step > ASIDE * height:
            step = min(0.5 * step, half) if half > 0.0 else 0.5 * step
        else:
            complete = False
            break
        if low >= height:
            break
    else:
        complete = False
    values = np.array(found, dtype=complex)
    size = np.max(np.abs(values), initial=0.0)
    values.imag[np.abs(values.imag) <= 1e-9 * size] = 0.0  # real ones, but for rounding
    some = functools.partial(_modes_of, matrix, values, right_vectors, centers)
    return Spectrum(values, complete, some=some)


def _full(matrix: Any, scale: Array) -> Spectrum:
    """All eigenvalues of a matrix."""
    full = matrix.toarray()
    symmetric = np.array_equal(full, full.T)
    values = _with_real_ones((np.linalg.eigvalsh if symmetric else np.linalg.eigvals)(full))
    even = full if symmetric else full / scale[:, None] * scale
    return Spectrum(values[values.imag >= 0.0], True, even)


def _with_real_ones(values: npt.NDArray[Any]) -> Complex:
    """Eigenvalues, those real that are so but for rounding."""
    found = values.astype(complex)
    size = np.max(np.abs(found), initial=0.0)
    most = np.clip(SLOW * np.abs(found.real), ROUNDING * size, REAL * size)
    found.imag[np.abs(found.imag) <= most] = 0.0
    return found


def _modes_of(
    matrix: Any, values: Complex, right: list[Complex], centers: list[complex]
) -> Modes | None:
    """Vectors of eigenvalues that were found next to some centers, with those of conjugates."""
    found: list[complex] = []
    rows: list[Complex] = []
    for center in centers:
        near = pairs_near(matrix, center, NEAREST, left=True)
        if near is None:
            return None
        upper = near[0].imag >= -1e-9 * np.max(np.abs(near[0]))
        mine, vectors = near[0][upper], near[1][:, upper]
        new = [k for k, one in enumerate(mine) if not _seen(one, found)]
        found += mine[new].tolist()
        rows += list(vectors[:, new].T)
    if len(rows) != len(right) or not rows:
        return None
    turns = values.imag != 0.0
    v, w = np.stack(right, axis=1), np.stack(rows)
    v = np.concatenate([v, np.conj(v[:, turns])], axis=1)
    odd = np.abs(np.array(found).imag) > 1e-9 * np.max(np.abs(values))
    w = np.concatenate([w, np.conj(w[odd])])
    if len(w) != v.shape[1]:
        return None
    product = w @ v  # of vectors of different eigenvalues it is 0
    if not np.linalg.cond(product) < DEFECTIVE:
        return None
    both: Complex = np.concatenate([values, np.conj(values[turns])])
    return both, v, np.asarray(np.linalg.solve(product, w), dtype=complex)


def _seen(value: complex, found: list[complex]) -> bool:
    return any(abs(value - other) <= SAME * max(1e-300, abs(value)) for other in found)


def nearest(
    matrix: Any, center: complex, count: int = NEAREST
) -> tuple[Complex, Complex, float] | None:
    """Eigenvalues next to a point, of the upper half plane, their vectors, how far they are all.

    None if Arnoldi's method does not end, or residuals say that they are wrong.
    """
    found = pairs_near(matrix, center, count)
    if found is None:
        return None
    values, vectors = found
    radius = INSIDE * float(np.max(np.abs(values - center)))
    # Conjugates are farther from the center; copies of multiple ones count.
    upper = values.imag >= -1e-9 * np.max(np.abs(values))
    return values[upper], vectors[:, upper], radius


def pairs_near(
    matrix: Any, center: complex, count: int, *, left: bool = False
) -> tuple[Complex, Complex] | None:
    """Eigenvalues nearest to a point with their vectors; with ``left`` those of the transpose."""
    n = matrix.shape[0]
    shifted = sp.csc_array(matrix - center * sp.eye_array(n, format="csc"), dtype=complex)
    factors = Factors(shifted)
    solve = factors.solve_transposed if left else factors.solve
    inverse = LinearOperator(
        (n, n), matvec=lambda b: solve(b.ravel().astype(complex)), dtype=complex
    )
    begin = (1.0 + 0.5 * np.cos(1.7 * np.arange(n))).astype(complex)
    try:
        ritz, vectors = eigs(inverse, k=min(count, n - 2), v0=begin, tol=1e-13, maxiter=200)
    except ArpackError:
        return None
    values = center + 1.0 / ritz
    operand = matrix.T if left else matrix
    rest = operand @ vectors - vectors * values
    # What is left, by the inverse: that is how far they are off.
    wrong = np.linalg.norm(np.stack([solve(one) for one in rest.T]), axis=1) > TRUE
    return None if wrong.any() else (values, vectors)


def nearest_to_zero(matrix: Any, count: int) -> tuple[Complex, Complex] | None:
    """So many eigenvalues of a symmetric matrix next to 0, and their vectors; None: not found."""
    from scipy.sparse.linalg import eigsh

    n = matrix.shape[0]
    begin = 1.0 + 0.5 * np.cos(1.7 * np.arange(n))
    try:
        values, vectors = eigsh(matrix, k=min(count, n - 2), sigma=0.0, v0=begin, maxiter=400)
    except (ArpackError, RuntimeError):
        return None
    return values.astype(complex), vectors.astype(complex)


def modes_next_to_zero(matrix: Any) -> tuple[Array, Array, Array] | None:
    """Real eigenvalues next to 0, their vectors, and rows that are 1 on these, 0 on others."""
    size = float(np.max(np.abs(matrix.data), initial=1e-300))
    center = complex(0.0, 2.0**-26 * size)  # beside eigenvalues that are next to zero
    both = [pairs_near(matrix, center, MODES, left=one) for one in (False, True)]
    if both[0] is None or both[1] is None:
        return None
    (values, v), (others, w) = (_real_ones(*one) for one in both if one is not None)
    if len(values) != len(others) or not len(values):
        return None
    product = w.T @ v
    if not np.linalg.cond(product) < DEFECTIVE:
        return None
    return values, v, np.asarray(np.linalg.solve(product, w.T), dtype=float)


def _real_ones(values: Complex, vectors: Complex) -> tuple[Array, Array]:
    real = np.flatnonzero(np.abs(values.imag) <= 1e-9 * np.max(np.abs(values)))
    real = real[np.argsort(values[real].real)]
    turned = vectors[:, real]
    at = np.argmax(np.abs(turned), axis=0)
    phase = turned[at, np.arange(len(real))]
    return values[real].real, np.ascontiguousarray((turned / (phase / np.abs(phase))).real)
