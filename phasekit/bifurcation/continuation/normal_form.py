"""Normal forms at special points ([Kuznetsov2004] chapters 3, 5 and 8)."""

from __future__ import annotations

from itertools import pairwise
from typing import Any

import numpy as np
import numpy.typing as npt

from phasekit.bifurcation.continuation.curve import Curve
from phasekit.bifurcation.continuation.fields import SymbolicField
from phasekit.bifurcation.continuation.units import force_sizes, row_sizes

Array = npt.NDArray[np.float64]
Vector = npt.NDArray[Any]  # real or complex

# Central differences along a line: of order 8 for the second, of order 6 for the third derivative.
_SECOND = np.array([-1 / 560, 8 / 315, -1 / 5, 8 / 5, -205 / 72, 8 / 5, -1 / 5, 8 / 315, -1 / 560])
_THIRD = np.array(
    [-7 / 240, 3 / 10, -169 / 120, 61 / 30, 0.0, -61 / 30, 169 / 120, -3 / 10, 7 / 240]
)
# Steps that are tried, in units of the states; the two results that agree best decide.
_REACHES = (2.0**-3, 2.0**-4, 2.0**-5, 2.0**-6, 2.0**-7)


class Derivatives:
    """The multilinear forms of f at one point: B(a, b) and C(a, b, c), of unknowns u = (x, p)."""

    def __init__(self, curve: Curve, u: Array) -> None:
        self.curve, self.u = curve, np.array(u[: curve.m])
        self.exact = isinstance(curve.field, SymbolicField)
        self.reach = np.maximum(np.abs(self.u), curve.scale[: curve.m])
        self.value, self.slopes = curve.at(self.u)

    def _full(self, z: Array) -> Array:
        full = np.zeros(self.curve.m)
        full[: len(z)] = z
        return full

    def _along(self, z: Array, weights: Array, order: int) -> Array:
        """A derivative of f along a line."""
        length = float(np.max(np.abs(z) / self.reach))
        if length == 0.0:
            return np.zeros(self.curve.n)
        found = []
        for reach in _REACHES:
            h = reach / length
            total = np.zeros(self.curve.n)
            for k, weight in zip(range(-4, 5), weights, strict=True):
                if weight:
                    total += weight * self.curve.at(self.u + k * h * z)[0]
            found.append(total / h**order)
        gaps = [float(np.max(np.abs(b - a))) for a, b in pairwise(found)]
        best = int(np.nanargmin(gaps)) if np.isfinite(gaps).any() else 0
        return np.asarray(found[best + 1])

    def second(self, a: Vector, b: Vector) -> Vector:
        """B(a, b): the second derivative of f along a and b."""
        if np.iscomplexobj(a) or np.iscomplexobj(b):
            return _bilinear(self.second, a, b)
        a, b = self._full(a), self._full(b)
        if self.exact:
            return np.asarray(self.curve.bend(self.u, a) @ b)
        a, b, size = _balance(a, b, self.reach)
        plus, minus = self._along(a + b, _SECOND, 2), self._along(a - b, _SECOND, 2)
        return np.asarray(size * 0.25 * (plus - minus))

    def third(self, a: Vector, b: Vector, c: Vector) -> Vector:
        """C(a, b, c): the third derivative of f along a, b and c."""
        if any(np.iscomplexobj(z) for z in (a, b, c)):
            return _trilinear(self.third, a, b, c)
        a, b, c = self._full(a), self._full(b), self._full(c)
        if self.exact:
            return self.curve.twist(self.u, a, b, c)
        total = np.zeros(self.curve.n)
        for j, k in ((1.0, 1.0), (1.0, -1.0), (-1.0, 1.0), (-1.0, -1.0)):
            total += j * k * self._along(a + j * b + k * c, _THIRD, 3)
        return np.asarray(total / 24.0)


def _balance(a: Array, b: Array, size: Array) -> tuple[Array, Array, float]:
    """Two vectors brought to the same length, and the product of their lengths."""
    one, two = np.max(np.abs(a) / size), np.max(np.abs(b) / size)
    if one == 0.0 or two == 0.0:
        return a, b, 0.0
    return a / one, b / two, float(one * two)


def _bilinear(form: Any, a: Vector, b: Vector) -> Vector:
    """A real bilinear form of complex vectors."""
    (a, x), (b, y) = ((np.real(z), np.imag(z)) for z in (a, b))
    return np.asarray(form(a, b) - form(x, y) + 1j * (form(a, y) + form(x, b)))


def _trilinear(form: Any, a: Vector, b: Vector, c: Vector) -> Vector:
    """A real trilinear form of complex vectors."""
    total: Any = 0j * np.real(a)
    for i in range(8):
        chosen = [(np.imag(z) if i >> j & 1 else np.real(z)) for j, z in enumerate((a, b, c))]
        if all(np.any(z) for z in chosen):
            total = total + 1j ** i.bit_count() * form(*chosen)
    return np.asarray(total)


def null_vectors(
    jacobian: Array, scale: Array, rows: Array | None = None
) -> tuple[Array, Array]:
    """Right and left null vector of f_x: |q| = 1, its largest entry positive, and p.q = 1.

    Found with states in units of their scales and f in those of ``rows``, so that units do not
    matter; by default rows are of one size, but one may vanish with its eigenvalue. Where zero is a double
    eigenvalue, as always in conservative systems, p.q = 0: then p.q1 = 1 with f_x q1 = q, and
    normal forms are those of the second derivative by time.
    """
    scaled = jacobian * scale
    rows = row_sizes(scaled) if rows is None else rows
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
    q, p = null_vectors(d.slopes[:, :n], d.curve.scale[:n], force_sizes(d.curve, d.u))
    return {"a": float(0.5 * p @ d.second(q, q)), "b": float(p @ d.slopes[:, n])}


def branch_point(d: Derivatives, tangent: Array, *, pitchfork: bool) -> dict[str, float]:
    """Xi' = d (p - p0) xi + a xi^2, or + c xi^3 at a pitchfork; xi from the branch of `tangent`.

    ``tangent`` is that of a branch on which the parameter moves.
    """
    n = d.curve.n
    jacobian = d.slopes[:, :n]
    q, p = null_vectors(jacobian, d.curve.scale[:n], force_sizes(d.curve, d.u))
    along = tangent[: n + 1] / tangent[n]
    forms = {"d": float(p @ d.second(q, along))}
    if not pitchfork:
        forms["a"] = float(0.5 * p @ d.second(q, q))
        return forms
    h = solve_off(jacobian, d.second(q, q), q, p)
    forms["c"] = float(p @ (d.third(q, q, q) - 3.0 * d.second(q, h)) / 6.0)
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
    first = np.vdot(p, d.third(q, q, bar))
    second = np.vdot(p, d.second(q, np.linalg.solve(A, d.second(q, bar).real).astype(complex)))
    third = np.vdot(p, d.second(bar, np.linalg.solve(2j * omega * np.eye(n) - A, d.second(q, q))))
    slope = np.vdot(p, d.second(q, _motion(d)))
    return {
        "l1": float((first - 2.0 * second + third).real / (2.0 * omega)),
        "omega": float(omega),
        "d": float(slope.real),
    }


def _motion(d: Derivatives) -> Array:
    """(dx/dp, 1) along the branch."""
    n = d.curve.n
    return np.append(-np.linalg.solve(d.slopes[:, :n], d.slopes[:, n]), 1.0)
