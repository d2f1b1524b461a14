"""The Bratu problem u'' + c e^u = 0, u(0) = u(1) = 0 on n inner nodes (n even), and its fold.

For the reference the nodes are marched outwards from the middle, where u_m = u_(m+1) = t by
symmetry; the fold is where u_0(t, c) = 0 and its derivative by t vanish. No matrix takes part.
"""

from __future__ import annotations

import mpmath as mp
import numpy as np


def bratu(u, c):
    """Right-hand side as a user writes it."""
    h2 = 1.0 / (u.size + 1) ** 2
    out = -2.0 * u + h2 * c * np.exp(u)
    out[1:] += u[:-1]
    out[:-1] += u[1:]
    return out


def bratu_jacobian(u, c):
    """Its Jacobian."""
    n = u.size
    return np.diag(-2.0 + c / (n + 1) ** 2 * np.exp(u)) + np.eye(n, k=1) + np.eye(n, k=-1)


def fold(n: int) -> tuple[float, float]:
    """The parameter c and the largest u at the fold."""
    with mp.workdps(40):
        h2 = mp.mpf(1) / (n + 1) ** 2

        def at_the_end(t, c):
            u, before = t, t  # the two nodes in the middle
            du, dbefore = mp.mpf(1), mp.mpf(1)
            for _ in range(n // 2):
                rate = h2 * c * mp.exp(u)
                u, before = 2 * u - before - rate, u
                du, dbefore = 2 * du - dbefore - rate * du, du
            return u, du

        t, c = mp.findroot(at_the_end, (mp.mpf("1.19"), mp.mpf("3.51")))
    return float(c), float(t)
