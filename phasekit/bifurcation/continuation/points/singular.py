"""Points at which f_u = (f_x, f_p) loses rank, by any number: where branches of equilibria meet.

With bordering columns W and rows V next to the null spaces of f_u, of k and k + 1 dimensions,

    [f_u  W] [Phi]   [0]
    [V    0] [G  ] = [1]

defines a matrix G(u) of k x (k + 1) entries that vanishes where the rank of f_u is n - k, and is
smooth, as is the system bordered ([Govaerts2000] chapter 3). The point is the solution of
f + W b = 0, G = 0 by u and b, found by the Gauss-Newton method, quadratically; branches meet there
if b = 0. No determinant takes part, and all is in units of the unknowns and of f.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from phasekit.arrays import Array
from phasekit.bifurcation.continuation.curve import Curve
from phasekit.bifurcation.continuation.units import accuracy_of, force_sizes, scale_at

STEPS = 25
LAST = (1e-9, 1e-7)  # longest last step, with exact derivatives and with differences


@dataclass(frozen=True)
class Singular:
    """A point where the rank of f_u is n - k, and its null spaces."""

    u: Array  # unknowns
    right: Array  # shape (m, k + 1): null vectors of f_u, orthonormal on scaled axes
    left: Array  # shape (n, k): left null vectors, orthonormal in the units of ``rows``
    #: By how much f differs from zero along the left null space, in units of ``rows``.
    offset: Array
    rows: Array  # sizes of the entries of f
    residual: float  # largest of |f| and |G|, G in units of f

    @property
    def corank(self) -> int:
        """By how much the rank of f_u is less than the number of equations."""
        return int(self.left.shape[1])


def candidates(curve: Curve, u: Array, reach: float) -> int:
    """How many singular values of f_u may vanish within a distance of a point, by their slopes."""
    n = curve.n
    scale = scale_at(curve, u)
    rows = force_sizes(curve, u, scale)
    scaled = curve.evaluate(u)[1] * scale / rows[:, None]
    if not np.isfinite(scaled).all():
        return 0
    left, values, right = np.linalg.svd(scaled)
    ahead = curve.bend(u, right[-1] * scale) * scale / rows[:, None]
    count = 0
    for j in range(n - 1, -1, -1):
        w = left[:, j]
        slope = curve.bend(u, right[j] * scale) * scale / rows[:, None]
        rate = np.linalg.norm(w @ slope) + np.linalg.norm(w @ ahead)
        if values[j] > 2.0 * reach * rate + 1e2 * accuracy_of(curve):
            break
        count += 1
    return count


def refine(curve: Curve, start: Array, k: int, reach: float) -> Singular | None:
    """The point of corank k next to a point; None if there is none within reach."""
    n, m = curve.n, curve.m
    u = np.array(start[:m])
    scale = scale_at(curve, u)
    rows = force_sizes(curve, u, scale)
    accuracy = accuracy_of(curve)
    scaled = curve.evaluate(u)[1] * scale / rows[:, None]
    if not np.isfinite(scaled).all():
        return None
    left, _, right = np.linalg.svd(scaled)
    W, V = left[:, n - k :], right[n - k :]
    b = np.zeros(k)
    least, last, idle, fast = np.inf, np.inf, 0, True
    for _ in range(STEPS):
        f, slopes = curve.evaluate(u)
        bordered = np.zeros((n + k + 1, m + k))
        bordered[:n, :m], bordered[:n, m:], bordered[n:, :m] = slopes * scale / rows[:, None], W, V
        if not np.isfinite(bordered).all() or not np.isfinite(f).all():
            return None
        solved = _null_spaces(bordered, n, m)
        if solved is None:
            return None
        phi, G, psi = solved
        equations = n + k * (k + 1)
        matrix, right_side = np.zeros((equations, m + k)), np.zeros(equations)
        matrix[:n] = bordered[:n]
        right_side[:n] = -(f / rows + W @ b)
        for j in range(k + 1):
            bent = curve.bend(u, phi[:, j] * scale) * scale / rows[:, None]
            place = n + j * k
            matrix[place : place + k, :m] = -psi.T @ bent
            right_side[place : place + k] = -G[:, j]
        if not np.isfinite(matrix).all():
            return None
        slope = float(np.max(np.abs(matrix[n:])))
        step, _, rank, sizes = np.linalg.lstsq(matrix, right_side, rcond=1e-11)
        floor = 10.0 * accuracy / sizes[rank - 1] if rank else np.inf  # what errors make of steps
        size = float(np.max(np.abs(step[:m])))
        miss = float(np.max(np.abs(right_side)))
        if not np.isfinite(size) or curve.length(u - start[:m]) > 2.0 * reach:
            return None
        if size > floor:
            fast = size <= 0.1 * last  # where the point is degenerate, steps shrink slowly
        small = fast and size <= LAST[accuracy > 1e-12]
        small &= miss <= max(1e-10 * slope, 1e2 * accuracy)
        idle += miss > 0.5 * least
        if (small and (size <= 1e-15 or size >= 0.5 * last or idle)) or idle > 4:
            break
        least, last = min(miss, least), size
        u = u + step[:m] * scale
        b = b + step[m:]
    if not small or curve.length(u - start[:m]) > reach:
        return None
    # Orthonormal bases of both null spaces.
    right_null = np.linalg.qr(phi)[0]
    left_null = np.linalg.qr(psi)[0]
    residual = float(max(np.max(np.abs(f)), np.max(np.abs(G * np.max(rows)))))
    return Singular(u, right_null * scale[:, None], left_null, b, rows, residual)


def _null_spaces(bordered: Array, n: int, m: int) -> tuple[Array, Array, Array] | None:
    """Phi, G and Psi of a bordered matrix, None if it is singular itself."""
    try:
        inverse = np.asarray(np.linalg.inv(bordered), dtype=float)
    except np.linalg.LinAlgError:
        return None
    if not np.isfinite(inverse).all():
        return None
    return inverse[:m, n:], inverse[m:, n:], inverse[m:, :n].T
