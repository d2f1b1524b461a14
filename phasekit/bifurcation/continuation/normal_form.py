"""Normal forms at special points ([Kuznetsov2004] chapters 3, 5 and 8).

A coefficient whose error hides its digits is NaN.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt

from phasekit.bifurcation.continuation.derivatives import Derivatives as Derivatives
from phasekit.bifurcation.continuation.derivatives import Estimate
from phasekit.bifurcation.continuation.units import force_sizes, row_sizes

Array = npt.NDArray[np.float64]
Vector = npt.NDArray[Any]  # real or complex

DIGITS = 1e-2  # largest relative error of a coefficient that is said
SMALL = 1e-9  # largest error in units of f and of the states, where a coefficient is next to zero


def unknown(form: dict[str, float]) -> str:
    """Which coefficients are not known, in words; nothing if all are."""
    names = [name for name, value in form.items() if np.isnan(value)]
    if not names:
        return ""
    return f"{' and '.join(names)} not known: the derivatives of f are not known to enough digits"


def null_vectors(jacobian: Array, scale: Array, rows: Array | None = None) -> tuple[Array, Array]:
    """Right and left null vector of f_x: |q| = 1, its largest entry positive, and p.q = 1.

    Found with states in units of their scales and f in those of ``rows``, so that units do not
    matter; by default all rows are of one size, but one may vanish with its eigenvalue. Where zero
    is a double eigenvalue, as always in conservative systems, p.q = 0: then p.q1 = 1 with
    f_x q1 = q, and normal forms are those of the second derivative by time.
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
    rows = force_sizes(d.curve, d.u)
    q, p = null_vectors(d.slopes[:, :n], d.curve.scale[:n], rows)
    unit = _unit(d, rows, p, q, 2)
    return {
        "a": _known(d.second(q, q).dot(p) * 0.5, unit),
        "b": float(p @ d.slopes[:, n]),
    }


def branch_point(d: Derivatives, tangent: Array, *, pitchfork: bool) -> dict[str, float]:
    """Xi' = d (p - p0) xi + a xi^2, or + c xi^3 at a pitchfork; xi from the branch of `tangent`.

    ``tangent`` is that of a branch on which the parameter moves.
    """
    n = d.curve.n
    jacobian = d.slopes[:, :n]
    rows = force_sizes(d.curve, d.u)
    q, p = null_vectors(jacobian, d.curve.scale[:n], rows)
    along = tangent[: n + 1] / tangent[n]
    length = float(np.max(np.abs(along) / d.curve.scale[: n + 1]))
    bent = d.second(q, q)
    forms = {"d": _known(d.second(q, along).dot(p), _unit(d, rows, p, q, 1) * length)}
    if not pitchfork:
        forms["a"] = _known(bent.dot(p) * 0.5, _unit(d, rows, p, q, 2))
        return forms
    h = solve_off(jacobian, bent.value, q, p)
    loose = solve_off(jacobian, bent.error, q, p)
    fed = d.second(q, h)
    fed = Estimate(fed.value, fed.error + np.abs(d.second(q, loose).value))
    total = d.third(q, q, q) - 3.0 * fed
    forms["c"] = _known(total.dot(p) * (1.0 / 6.0), _unit(d, rows, p, q, 3))
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
    still, double = d.second(q, bar), d.second(q, q)
    matrix = 2j * omega * np.eye(n) - A
    second = _fed(d, q, np.linalg.solve(A, still.value.real), np.linalg.inv(A), still.error)
    third = _fed(d, bar, np.linalg.solve(matrix, double.value), np.linalg.inv(matrix), double.error)
    total = (d.third(q, q, bar) - 2.0 * second + third).dot(p) * (0.5 / omega)
    rows = force_sizes(d.curve, d.u)
    motion = _motion(d)
    length = float(np.max(np.abs(motion) / d.curve.scale[: n + 1]))
    return {
        "l1": _known(total, _unit(d, rows, p, q, 3) / omega),
        "omega": float(omega),
        "d": _known(d.second(q, motion).dot(p), _unit(d, rows, p, q, 1) * length),
    }


def period_doubling(d: Derivatives) -> dict[str, float]:
    """Of a map next to a multiplier -1, xi -> -xi + c xi^3; c > 0: a stable orbit of period 2.

    With A q = -q, A^T p = -p, <p, q> = 1: c = <p, C(q, q, q)>/6 +
    <p, B(q, (1 - A)^-1 B(q, q))>/2 ([Kuznetsov2004] 5.4).
    """
    n = d.curve.n
    rows = force_sizes(d.curve, d.u)
    q, p = null_vectors(d.curve.linear(d.slopes) + np.eye(n), d.curve.scale[:n], rows)
    bent = d.second(q, q)
    inverse = np.linalg.inv(-d.slopes[:, :n])
    fed = _fed(d, q, inverse @ bent.value, inverse, bent.error)
    total = (1.0 / 6.0) * d.third(q, q, q) + 0.5 * fed
    c = _known(total.dot(p), _unit(d, rows, p, q, 3))
    # Where two multipliers are -1, `null_vectors` makes another product 1.
    return {"c": c if abs(float(p @ q) - 1.0) < 1e-9 else np.nan}


def torus(d: Derivatives, angle: float) -> dict[str, float]:
    """Of a map next to multipliers exp(+-i angle): |xi| -> |xi| + d |xi|^3; d < 0: supercritical.

    With A q = e^(i angle) q, A^T p = e^(-i angle) p, <q, q> = <p, q> = 1:
    d = Re{e^(-i angle) [<p, C(q, q, q*)> + 2 <p, B(q, (1 - A)^-1 B(q, q*))> +
    <p, B(q*, (e^(2 i angle) - A)^-1 B(q, q))>]}/2 ([Kuznetsov2004] 5.4).
    """
    n = d.curve.n
    A, turn = d.curve.linear(d.slopes), np.exp(1j * angle)
    values, vectors = np.linalg.eig(A)
    q = vectors[:, np.argmin(np.abs(values - turn))]
    q = q / np.linalg.norm(q)
    values, vectors = np.linalg.eig(A.T)
    p = vectors[:, np.argmin(np.abs(values - np.conj(turn)))]
    p = p / np.conj(np.vdot(p, q))
    bar = np.conj(q)
    still, double = d.second(q, bar), d.second(q, q)
    back, twice = np.linalg.inv(np.eye(n) - A), np.linalg.inv(turn**2 * np.eye(n) - A)
    second = _fed(d, q, (back @ still.value).real, back, still.error)
    third = _fed(d, bar, twice @ double.value, twice, double.error)
    total = (d.third(q, q, bar) + 2.0 * second + third) * (0.5 * np.conj(turn))
    unit = _unit(d, force_sizes(d.curve, d.u), p, q, 3)
    return {"d": _known(total.dot(p), unit), "angle": float(angle)}


def _fed(d: Derivatives, q: Vector, h: Vector, inverse: Vector, error: Array) -> Estimate:
    """B(q, h), with what the error of the right side of h leaves of it."""
    found = d.second(q, h)
    loose = np.abs(inverse) @ error
    size = np.max(loose / np.maximum(np.max(np.abs(h)), 1e-300))
    return Estimate(found.value, found.error + size * np.abs(found.value))


def _unit(d: Derivatives, rows: Array, p: Vector, q: Vector, order: int) -> float:
    """Size of a coefficient, f being of its own size where states change by theirs."""
    scale = d.curve.scale[: d.curve.n]
    return float(np.abs(p) @ rows) * float(np.max(np.abs(q) / scale)) ** order


def _known(coefficient: Estimate, unit: float) -> float:
    """The real part of a coefficient, NaN where its error hides it."""
    value, error = float(np.real(coefficient.value)), float(np.max(coefficient.error))
    sure = error <= DIGITS * abs(value) or error <= SMALL * unit
    return value if sure else np.nan


def _motion(d: Derivatives) -> Array:
    """(dx/dp, 1) along the branch."""
    n = d.curve.n
    return np.append(-np.linalg.solve(d.slopes[:, :n], d.slopes[:, n]), 1.0)
