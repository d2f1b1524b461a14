"""Bogdanov-Takens points next to equilibria, in two free parameters."""

from __future__ import annotations

from typing import Any

import numpy as np

from phasekit.arrays import Array
from phasekit.cycles.connections import Rest, slopes_at

MOST = 20  # steps of Newton's method
SETTLED, FEW = 1e-12, 1e-9  # the last of them, on scaled axes; what may be left of f's digits
STEP = 2.0**-18  # of differences of the two numbers, on scaled axes


def double_zero_near(bounded: Any, rest: Rest, y: Array) -> tuple[Array, Array] | None:
    """The state and free parameters where two eigenvalues vanish together; None if not found.

    By ``f = 0, g = 0, h = 0`` with ``A v + g b = 0, c v = 1, A w + h b = v, c w = 0``: g vanishes
    where A is singular, h where its null vector v is A times another one ([Kuznetsov2004] 10.2).
    The borders b and c are the singular vectors of the least singular value of A at first.
    """
    n, scale, width = bounded.n, bounded.scale, bounded.width
    sizes = np.concatenate([scale, width])
    left, _, right = np.linalg.svd(rest.A)
    b, c = left[:, -1], right[-1]
    unit = np.linalg.norm(rest.A)  # with it g and h are of the size of numbers

    def both(u: Array) -> tuple[Array, Array, Array]:
        f, slopes = slopes_at(bounded, u[:n] * scale, np.append(y[0], u[n:] * width))
        slopes = slopes * sizes / scale[:, None] / unit
        border = np.block([[slopes[:, :n], b[:, None]], [c[None], np.zeros((1, 1))]])
        v = np.linalg.solve(border, np.append(np.zeros(n), 1.0))
        w = np.linalg.solve(border, np.append(v[:n], 0.0))
        return f / scale / unit, slopes, np.array([v[n], w[n]])

    u = np.concatenate([rest.x, y[1:]]) / sizes
    matrix = np.empty((n + 2, n + 2))
    try:
        for _ in range(MOST):
            f, slopes, numbers = both(u)
            matrix[:n] = slopes
            for i, way in enumerate(STEP * np.eye(n + 2)):
                matrix[n:, i] = (both(u + way)[2] - both(u - way)[2]) / (2.0 * STEP)
            step = np.linalg.solve(matrix, np.append(f, numbers))
            if not np.isfinite(step).all():
                return None
            u = u - step
            if np.max(np.abs(step)) <= SETTLED * max(1.0, float(np.max(np.abs(u)))):
                return u[:n] * scale, u[n:] * width
    except np.linalg.LinAlgError:
        return None
    if np.max(np.abs(step)) <= FEW * max(1.0, float(np.max(np.abs(u)))):
        return u[:n] * scale, u[n:] * width
    return None
