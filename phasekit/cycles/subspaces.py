"""Invariant subspaces of the slopes at an equilibrium, and how they turn, by real Schur forms.

``A Q = Q T`` with the eigenvalues that are asked for first: the first columns of Q span their
subspace, the others what is orthogonal to it.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property, lru_cache
from typing import TYPE_CHECKING

import numpy as np

from phasekit.arrays import Array
from phasekit.numerics.later import later

if TYPE_CHECKING:
    from scipy.linalg import lapack
else:
    lapack = later("scipy.linalg.lapack")


@dataclass(frozen=True, eq=False)
class Subspace:
    """The subspace of the most unstable eigenvalues, or the most stable ones."""

    #: Shape (n, n): A basis of it in the first columns, of what is orthogonal to it in the others.
    Q: Array
    T: Array  # shape (n, n): the Schur form
    count: int  # its dimension
    stable: bool  # whether it is that of the most stable eigenvalues

    @property
    def plane(self) -> Array:
        """A basis of it, in columns."""
        return self.Q[:, : self.count]

    @property
    def across(self) -> Array:
        """A basis of what is orthogonal to it, in columns."""
        return self.Q[:, self.count :]

    @cached_property
    def _form(self) -> tuple[Array, float] | None:
        """B^T M + M B = +-1 of the flow B in it, and the trace of M; None if M is no measure."""
        k = self.count
        M = self._lyapunov(np.eye(k) * (-1.0 if self.stable else 1.0))
        if not np.isfinite(M).all() or np.min(np.linalg.eigvalsh(M)) <= 0.0:
            return None
        return M, float(np.trace(M))

    def _lyapunov(self, right: Array) -> Array:
        B = self.T[: self.count, : self.count]
        M, scale, info = lapack.dtrsyl(B, B, right, trana=b"T")
        return np.asarray(0.5 * (M + M.T) / scale) if info == 0 else np.full_like(right, np.nan)

    @cached_property
    def measure(self) -> Array:
        """Square of the distance from the equilibrium, as a form.

        Along the linear flow in the subspace it only grows, or only decays. A pair of complex
        eigenvalues would bring an orbit to the same plain distance several times, and a curve of
        orbits would go back on itself through them.
        """
        if self.count < 2 or self._form is None:
            return np.eye(len(self.Q))
        (M, trace), U, V = self._form, self.plane, self.across
        return np.asarray(U @ M @ U.T * (self.count / trace) + V @ V.T)

    def turned(self, dA: Array, z: Array) -> tuple[Array, float]:
        """Changes of a vector's part across the subspace and of its measure, if A changes.

        The columns of Q turn by ``dU = V X, dV = -U X^T`` with ``T22 X - X T11 = -V^T dA U``.
        """
        if not np.isfinite(dA).all():
            raise np.linalg.LinAlgError("the slopes are not finite")
        k, n = self.count, len(self.Q)
        U, V = self.plane, self.across
        X = np.zeros((n - k, k))
        if 0 < k < n:
            right = -(V.T @ dA @ U)
            X, scale, info = lapack.dtrsyl(self.T[k:, k:], self.T[:k, :k], right, isgn=-1)
            X = X / scale
            if info < 0 or not np.isfinite(X).all():
                raise np.linalg.LinAlgError("the subspace does not turn smoothly")
        a, b = U.T @ z, V.T @ z
        across = -X @ a
        if k < 2 or self._form is None:
            return across, 0.0
        (M, trace), turn = self._form, X.T @ b
        dB = U.T @ dA @ U + self.T[:k, k:] @ X
        dM = self._lyapunov(-(dB.T @ M + M @ dB))
        dM = (dM - M * (np.trace(dM) / trace)) * (k / trace)
        return across, float(a @ dM @ a + 2.0 * (k / trace) * (a @ M @ turn) + 2.0 * (b @ across))


def subspace(A: Array, count: int, stable: bool) -> Subspace:
    """That of so many of the most stable, or the most unstable, eigenvalues of a matrix."""
    return _subspace(A.tobytes(), len(A), count, stable)


@lru_cache(maxsize=16)  # what holds at the ends of an orbit is asked for several times
def _subspace(given: bytes, n: int, count: int, stable: bool) -> Subspace:
    T, Q, parts = _schur(given, n)
    if count in (0, n):
        return Subspace(Q, T, count, stable)
    sign = -1.0 if stable else 1.0
    order = np.sort(sign * parts)[::-1]
    first = sign * parts > 0.5 * (order[count - 1] + order[count])
    T, Q, _, _, own, _, _, info = lapack.dtrsen(first.astype(np.int32), T, Q, job=b"N", lwork=n)
    if own != count:  # a pair that the count parts
        raise np.linalg.LinAlgError("a complex pair stands on both sides of the count")
    if info != 0:
        raise np.linalg.LinAlgError("eigenvalues too close to be told apart")
    return Subspace(Q, T, count, stable)


@lru_cache(maxsize=8)
def _schur(given: bytes, n: int) -> tuple[Array, Array, Array]:
    """Schur form, basis and the real parts of the eigenvalues in their order."""
    A = np.frombuffer(given).reshape(n, n)
    if not math.isfinite(np.sum(A)):
        raise np.linalg.LinAlgError("the slopes are not finite")
    T, _, parts, _, Q, _, info = lapack.dgees(_all, A)
    if info != 0:
        raise np.linalg.LinAlgError("the eigenvalues were not found")
    return T, Q, parts


def _all(re: float, im: float) -> bool:
    return True
