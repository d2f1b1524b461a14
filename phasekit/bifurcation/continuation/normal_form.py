"""What the normal forms of special points are made with ([Kuznetsov2004] chapters 3, 5 and 8).

A coefficient whose error hides its digits is NaN.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
import numpy.typing as npt

from phasekit.bifurcation.continuation.derivatives import Derivatives as Derivatives
from phasekit.bifurcation.continuation.derivatives import Estimate as Estimate
from phasekit.bifurcation.continuation.units import row_sizes

Array = npt.NDArray[np.float64]
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
