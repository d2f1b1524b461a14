"""Pseudo-arclength continuation as barely as it can be written in NumPy."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

Array = np.ndarray


def differences(f: Callable[[Array], Any], u: Array, value: Array) -> Array:
    """Central differences."""
    matrix = np.empty((value.size, u.size))
    for j in range(u.size):
        step = 6e-6 * max(1.0, abs(u[j]))
        shifted = u.copy()
        shifted[j] = u[j] + step
        above = f(shifted)
        shifted[j] = u[j] - step
        matrix[:, j] = (np.asarray(above) - np.asarray(f(shifted))) / (2.0 * step)
    return matrix


def barest_loop(
    f: Callable[[Array], Any],
    start: Array,
    step: float,
    points: int,
    jac: Callable[[Array], Array] | None = None,
) -> tuple[Array, Array]:
    """Points u = (x, p) with f(u) = 0 and their tangents, at fixed steps along the curve.

    No control of the step, no bounds, no special points; Newton to 1e-10.
    """
    u = np.array(start, float)
    size = u.size
    curve, tangents = np.empty((points, size)), np.empty((points, size))
    matrix, right = np.zeros((size, size)), np.zeros(size)
    last = np.zeros(size)
    last[-1] = 1.0
    tangent = last.copy()
    for k in range(points):
        guess = u + step * tangent if k else u
        u = guess.copy()
        matrix[-1] = tangent
        for _ in range(10):
            value = np.asarray(f(u), float)
            matrix[:-1] = differences(f, u, value) if jac is None else jac(u)
            right[:-1], right[-1] = value, tangent @ (u - guess)
            change = np.linalg.solve(matrix, right)
            u = u - change
            if np.abs(change).max() < 1e-10:
                break
        else:
            raise ArithmeticError(f"no convergence at point {k}")
        tangent = np.linalg.solve(matrix, last)
        tangent /= np.linalg.norm(tangent)
        curve[k], tangents[k] = u, tangent
    return curve, tangents


def disk_force(e: float, a: float, r: float, omega1: float, g: float) -> Callable[[Array], Any]:
    """The disk's equilibrium condition as a user writes it, with u = (phi, beta)."""
    from math import cos, sin

    def f(u: Array) -> list[float]:
        phi, beta = u
        s, c = sin(beta), cos(beta)
        n = 4.0 * (e * s) ** 2 + r * r * (1.0 + s * s)
        A = omega1**2 * (2 * e * s - r * c) * (2 * e * s + r * c) / n
        B, C = 4.0 * g * e * s / n, 4.0 * omega1**2 * a * e * s / n
        return [-B * sin(phi) + A * sin(phi) * cos(phi) + C * cos(phi)]

    return f
