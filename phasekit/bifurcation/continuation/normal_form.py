"""What the normal forms of special points are made with ([Kuznetsov2004] chapters 3, 5 and 8).

A coefficient whose error hides its digits is NaN.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
import numpy.typing as npt

from phasekit.arrays import Array
from phasekit.bifurcation.continuation.curve import Curve
from phasekit.bifurcation.continuation.derivatives import Derivatives as Derivatives
from phasekit.bifurcation.continuation.derivatives import Estimate as Estimate
from phasekit.bifurcation.continuation.kernels.defining import FLIP
from phasekit.bifurcation.continuation.units import row_sizes

Vector = npt.NDArray[Any]  # real or complex

DIGITS = 1e-2  # largest relative error of a coefficient that is said
ROUNDED = 1e-13  # part of the terms of a coefficient that may be left of them where they cancel
SMALL = 1e-9  # largest error in units of f and of the states, where a coefficient is next to zero
DOUBLE = 1e-9  # part of their sizes that the product of null vectors has where zero is double


def unknown(form: dict[str, float]) -> str:
    """Which coefficients are not known, in words; nothing if all are."""
    names = [name for name, value in form.items() if np.isnan(value)]
    if not names:
        return ""
    return f"{' and '.join(names)} not known: the derivatives of f are not known to enough digits"


def null_vectors(jacobian: Array, scale: Array, rows: Array) -> tuple[Array, Array]:
    """Right and left null vector of f_x: |q| = 1, its largest entry positive, and p.q = 1.

    Found with states in units of their scales and f in those of ``rows``, so that units do not
    matter. Where zero is a double eigenvalue, as always in conservative systems, p.q = 0: then
    p.q1 = 1 with f_x q1 = q, and normal forms are those of the second derivative by time.
    """
    scaled = jacobian * scale
    left, _, right = np.linalg.svd(scaled / rows[:, None])
    q, p = right[-1] * scale, left[:, -1] / rows
    q = q / np.linalg.norm(q)
    q = q * np.sign(q[np.argmax(np.abs(q))])
    product, size = float(p @ q), float(np.linalg.norm(p * scale) * np.linalg.norm(q / scale))
    if abs(product) <= DOUBLE * size:
        # The eigenvalue next to zero is product / other, which of a slow variable is small, too.
        other = float(p @ solve_off(jacobian, q, q, p))
        if abs(product) <= DOUBLE * abs(other) * np.max(np.abs(scaled / scale[:, None])):
            product = other
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


def fed(d: Derivatives, q: Vector, h: Vector, inverse: Vector, error: Array) -> Estimate:
    """B(q, h), with what the error of the right side of h leaves of it."""
    found = d.second(q, h)
    loose = np.abs(inverse) @ error
    size = np.max(loose / np.maximum(np.max(np.abs(h)), 1e-300))
    return Estimate(found.value, found.error + size * np.abs(found.value))


def unit_of(d: Derivatives, rows: Array, p: Vector, q: Vector, order: int) -> float:
    """Size of a coefficient, f being of its own size where states change by theirs."""
    scale = d.curve.scale[: d.curve.n]
    return float(np.abs(p) @ rows) * float(np.max(np.abs(q) / scale)) ** order


def real_part(coefficient: Estimate, unit: float) -> float:
    """The real part of a coefficient, NaN where its error hides it."""
    value, error = float(np.real(coefficient.value)), float(np.max(coefficient.error))
    sure = error <= DIGITS * abs(value) or error <= SMALL * unit
    return value if sure else np.nan


def signed(terms: Sequence[Estimate], p: Vector, found: float) -> float:
    """A coefficient that is the sum of terms along p; 0 where its error leaves it no sign.

    The error is that of the terms, and what rounding makes of terms that cancel.
    """
    error = sum(float(np.max(np.abs(one.dot(p).error))) for one in terms)
    size = sum(float(np.abs(p) @ np.abs(one.value)) for one in terms)
    return 0.0 if abs(found) <= 4.0 * error + ROUNDED * size else found


def zero_along(coefficient: str, kind: str) -> str:
    """What is said of a curve along which a coefficient is zero, so that it has no such points."""
    of = coefficient or "the test function"
    return (
        f"{of} is zero all along the curve but for its error: there are no "
        f"{kind.replace('_', ' ')} points to tell, and what higher terms do is not known"
    )


def motion(d: Derivatives) -> Array:
    """(dx/dp, 1) along the branch."""
    n = d.curve.n
    return np.append(-np.linalg.solve(d.slopes[:, :n], d.slopes[:, n]), 1.0)


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
