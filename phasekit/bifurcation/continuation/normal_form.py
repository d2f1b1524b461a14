"""Normal forms at special points ([Kuznetsov2004] chapters 3, 5 and 8)."""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt

from phasekit.bifurcation.continuation.derivatives import Derivatives as Derivatives

Array = npt.NDArray[np.float64]
Vector = npt.NDArray[Any]  # real or complex


def row_sizes(matrix: Array) -> Array:
    """Largest entries of the rows; 1 for rows that vanish."""
    sizes = np.max(np.abs(matrix), axis=1)
    return np.asarray(np.where(sizes > 1e-12 * np.max(sizes, initial=0.0), sizes, 1.0))


def null_vectors(jacobian: Array, scale: Array) -> tuple[Array, Array]:
    """Right and left null vector of f_x: |q| = 1, its largest entry positive, and p.q = 1.

    Found with states in units of their scales, so that units do not matter. Where zero is a double
    eigenvalue, as always in conservative systems, p.q = 0: then p.q1 = 1 with f_x q1 = q, and
    normal forms are those of the second derivative by time.
    """
    scaled = jacobian * scale
    rows = row_sizes(scaled)
    left, _, right = np.linalg.svd(scaled / rows[:, None])
    q, p = right[-1] * scale, left[:, -1] / rows
    q = q / np.linalg.norm(q)
    q = q * np.sign(q[np.argmax(np.abs(q))])
    product, size = float(p @ q), float(np.abs(p) @ np.abs(q))
    if abs(product) <= 1e-9 * size:
        product = float(p @ solve_off(jacobian, q, q, p))
    return q, (p / product if product != 0.0 and np.isfinite(product) else p)


def solve_off(jacobian: Array, right: Array, q: Array, p: Array) -> Array:
    """X with f_x x = right, less its part along p, and q.x = 0."""
    n = len(right)
    matrix = np.zeros((n + 1, n + 1))
    matrix[:n, :n], matrix[:n, n], matrix[n, :n] = jacobian, p, q
    # In units of rows and columns, so that units do not matter.
    rows = row_sizes(matrix)
    matrix = matrix / rows[:, None]
    columns = row_sizes(matrix.T)
    solution = np.linalg.solve(matrix / columns, np.append(right, 0.0) / rows) / columns
    return np.asarray(solution[:n])


def fold(d: Derivatives) -> dict[str, float]:
    """Xi' = b (p - p0) + a xi^2 on the center manifold."""
    n = d.curve.n
    q, p = null_vectors(d.slopes[:, :n], d.curve.scale[:n])
    return {"a": float(0.5 * p @ d.second(q, q).value), "b": float(p @ d.slopes[:, n])}


def branch_point(d: Derivatives, tangent: Array, *, pitchfork: bool) -> dict[str, float]:
    """Xi' = d (p - p0) xi + a xi^2, or + c xi^3 at a pitchfork; xi from the branch of `tangent`.

    ``tangent`` is that of a branch on which the parameter moves.
    """
    n = d.curve.n
    jacobian = d.slopes[:, :n]
    q, p = null_vectors(jacobian, d.curve.scale[:n])
    along = tangent[: n + 1] / tangent[n]
    forms = {"d": float(p @ d.second(q, along).value)}
    if not pitchfork:
        forms["a"] = float(0.5 * p @ d.second(q, q).value)
        return forms
    h = solve_off(jacobian, d.second(q, q).value, q, p)
    forms["c"] = float(p @ (d.third(q, q, q).value - 3.0 * d.second(q, h).value) / 6.0)
    return forms


def hopf(d: Derivatives, omega: float) -> dict[str, float]:
    """First Lyapunov coefficient and frequency.

    With A q = i omega q, A^T p = -i omega p, <q, q> = 1, <p, q> = 1:
    l1 = Re[<p, C(q, q, q*)> - 2 <p, B(q, A^-1 B(q, q*))> + <p, B(q*, (2 i omega - A)^-1 B(q, q))>]
    / (2 omega) ([Kuznetsov2004] (5.62)).
    """
    n = d.curve.n
    A = d.slopes[:, :n]
    values, vectors = np.linalg.eig(A)
    q = vectors[:, np.argmin(np.abs(values - 1j * omega))]
    q = q / np.linalg.norm(q)
    values, vectors = np.linalg.eig(A.T)
    p = vectors[:, np.argmin(np.abs(values + 1j * omega))]
    p = p / np.conj(np.vdot(p, q))
    bar = np.conj(q)
    first = np.vdot(p, d.third(q, q, bar).value)
    mean = np.linalg.solve(A, d.second(q, bar).value.real)
    double = np.linalg.solve(2j * omega * np.eye(n) - A, d.second(q, q).value)
    second = np.vdot(p, d.second(q, mean).value)
    third = np.vdot(p, d.second(bar, double).value)
    slope = np.vdot(p, d.second(q, _motion(d)).value)
    return {
        "l1": float((first - 2.0 * second + third).real / (2.0 * omega)),
        "omega": float(omega),
        "d": float(slope.real),
    }


def _motion(d: Derivatives) -> Array:
    """(dx/dp, 1) along the branch."""
    n = d.curve.n
    return np.append(-np.linalg.solve(d.slopes[:, :n], d.slopes[:, n]), 1.0)
