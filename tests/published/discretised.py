"""Partial differential equations in differences, with all their branch points in closed form.

All have u = 0 outside: the eigenvalues of the second difference on n inner nodes of (0, length) are
-mu_k = -4 (n + 1)^2/length^2 sin^2(k pi/(2 (n + 1))), so that the trivial state's are explicit.
"""

from __future__ import annotations

import numba
import numpy as np

import phasekit as pk


def modes(n: int, length: float = 1.0) -> np.ndarray:
    """The numbers mu_k, in order."""
    k = np.arange(1, n + 1)
    return 4.0 * (n + 1) ** 2 / length**2 * np.sin(0.5 * np.pi * k / (n + 1)) ** 2


@numba.njit
def _second(u, length):
    out = -2.0 * u
    out[1:] += u[:-1]
    out[:-1] += u[1:]
    return out * ((u.size + 1.0) / length) ** 2


@numba.njit
def allen_cahn(u, r):
    """The right-hand side u'' + r (u - u^3)."""
    return _second(u, 1.0) + r * (u - u**3)


def allen_cahn_points(n: int) -> np.ndarray:
    """Where its trivial state loses stability mode by mode: r = mu_k, all pitchforks."""
    return modes(n)


@numba.njit
def swift_hohenberg(u, r):
    """The right-hand side r u - (1 + d^2)^2 u - u^3 on a length of 20."""
    v = u + _second(u, 20.0)
    return r * u - (v + _second(v, 20.0)) - u**3


def swift_hohenberg_points(n: int) -> np.ndarray:
    """Where its trivial state loses stability mode by mode: r = (1 - mu_k)^2, all pitchforks."""
    return np.sort((1.0 - modes(n, 20.0)) ** 2)


A, D1, D2 = 2.0, 0.002, 0.02


@numba.njit
def brusselator(u, B):
    """A - (B + 1) X + X^2 Y + D1 X'', B X - X^2 Y + D2 Y'', as departures from (A, B/A)."""
    n = u.size // 2
    x, y = u[:n], u[n:]
    X, Y = x + 2.0, y + B / 2.0
    rate = X * X * Y
    out = np.empty(u.size)
    out[:n] = 2.0 - (B + 1.0) * X + rate + 0.002 * _second(x, 1.0)
    out[n:] = B * X - rate + 0.02 * _second(y, 1.0)
    return out


def brusselator_points(n: int, low: float, high: float) -> tuple[np.ndarray, np.ndarray]:
    """Its Hopf points and branch points between two values of B, mode by mode."""
    mu = modes(n)
    hopf = 1.0 + A**2 + (D1 + D2) * mu
    # det of [[B - 1 - D1 mu, A^2], [-B, -A^2 - D2 mu]] there, and where it vanishes.
    det = (hopf - 1.0 - D1 * mu) * (-(A**2) - D2 * mu) + A**2 * hopf
    hopf = hopf[det > 0.0]
    branch = (1.0 + D1 * mu) * (A**2 + D2 * mu) / (D2 * mu)
    return tuple(np.sort(v[(v > low) & (v < high)]) for v in (hopf, branch))


def trivial(f, n: int, parameter: str, span: tuple[float, float], **options):
    """The branch of the trivial state."""
    problem = pk.Problem(f, state=tuple(f"u{i}" for i in range(n)), parameters={parameter: span[0]})
    return pk.continuation(
        problem, parameter, x0=np.zeros(n), span=span, options=pk.ContinuationOptions(**options)
    )


def span_of(points: np.ndarray, count: int) -> tuple[float, float]:
    """A span from below the first point to between the count-th and the next."""
    high = points[count] if count < len(points) else points[-1] + (points[-1] - points[-2])
    gap = points[min(count, len(points)) - 1]
    return float(points[0] - 0.31 * abs(points[1] - points[0]) - 0.1), 0.5 * float(gap + high)
