"""From a guess to a curve: the first equilibrium and its tangent."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from phasekit.bifurcation.continuation.acceptance import rounded
from phasekit.bifurcation.continuation.curve import Curve
from phasekit.bifurcation.continuation.path import Sample
from phasekit.bifurcation.continuation.points.branch_point import directions_at
from phasekit.bifurcation.continuation.scales import guessed, scaled
from phasekit.bifurcation.continuation.units import nullspace
from phasekit.errors import ConvergenceError

Array = npt.NDArray[np.float64]

STEP = 2.0**-20  # of an unknown, within which f may have no value


def begun(curve: Curve, guess: Array, given: dict[int, float], where: str) -> tuple[Curve, Sample]:
    """The curve with its scales, and its first point, from a guess of an equilibrium."""
    curve = guessed(curve, guess, given)
    u = settle(curve, guess, where)
    curve = scaled(curve, u, given)
    return curve, Sample(u, tangent_of(curve, u), curve.evaluate(u)[1])


def settle(curve: Curve, u: Array, names: str) -> Array:
    """The equilibrium that a guess leads to at fixed parameters."""
    found = _settled(curve, u, names)
    if not np.isfinite(curve.evaluate(found)[1]).all():
        raise ConvergenceError(
            f"x0: the derivatives of f are not finite at the equilibrium x = "
            f"{found[: curve.n].tolist()} that {names} leads to{_edges(curve, found)}; give "
            "another x0, or start beside"
        )
    return found


def _edges(curve: Curve, u: Array) -> str:
    """Where f has no value right beside a point, in words; nothing if it has one all around."""
    names = [*curve.field.states, *(curve.field.parameters[i] for i in curve.active)]
    steps = STEP * np.maximum(np.abs(u[: curve.m]), curve.scale[: curve.m])
    found = [
        f"{name} {side} {u[j]:.9g}"
        for side, sign in (("below", -1.0), ("above", 1.0))
        for j, name in enumerate(names)
        if not np.isfinite(curve.values(u[None] + sign * steps[j] * np.eye(curve.size)[j])).all()
    ]
    return f": f has no value for {' and '.join(found)}" if found else ""


def _settled(curve: Curve, u: Array, names: str) -> Array:
    n = curve.n
    curve.field.failure = None
    value, _ = curve.evaluate(u)
    if not np.isfinite(value).all():
        failure = curve.field.failure
        said = "" if failure is None else f" (it raised {type(failure).__name__}: {failure})"
        raise ConvergenceError(
            f"x0: f is not finite there{said}: f = {value.tolist()} at {names}; give another x0"
        ) from failure
    row = np.zeros(curve.size)
    row[n] = 1.0
    point = curve.refine(u, row, iterations=30)
    if point.converged and np.isfinite(point.residual).all():
        return rounded(curve, _with_parameters(point.u, u, n))

    def vanishes(u: Array) -> bool:
        """Whether f does: beside its terms, and what it was where the search began."""
        found, slopes = curve.evaluate(u)
        size = np.abs(slopes) @ np.abs(u[: curve.m]) + np.abs(value)
        return bool(np.all(np.abs(found) <= 1e-12 * size))

    if not np.any(value):
        return u  # an equilibrium, but one where f_x is singular
    if np.isfinite(point.u).all() and vanishes(point.u):
        return _with_parameters(point.u, u, n)

    from scipy.optimize import root

    tried = np.array(u)

    def f(x: Array) -> Array:
        tried[:n] = x
        return np.asarray(curve.values(tried[None])[0])

    def jacobian(x: Array) -> Array:
        tried[:n] = x
        return curve.evaluate(tried)[1][:, :n]

    for method in ("hybr", "lm"):
        try:
            with np.errstate(all="ignore"):
                found = root(f, u[:n], jac=jacobian, method=method, tol=1e-12)
        except (ValueError, ArithmeticError):
            continue
        guess = np.append(found.x, u[n:])
        point = curve.refine(guess, row, iterations=30)
        close = np.max(np.abs(point.u - guess) / np.maximum(curve.scale, np.abs(guess))) < 1e-3
        if point.converged and close:
            return _with_parameters(point.u, u, n)
        if vanishes(guess):
            return guess
    raised = curve.field.raised.replace(":", "; on the way", 1)
    raise ConvergenceError(
        f"x0: no equilibrium was found from {names} (|f| = {np.max(np.abs(value)):.3g} there) by "
        f"Newton's method, Powell's hybrid method or Levenberg-Marquardt{raised}"
        f"{_edges(curve, u)}; give an x0 that is closer"
    ) from curve.field.failure


def _with_parameters(found: Array, asked: Array, n: int) -> Array:
    """The point with the parameters that were asked for, to the last bit."""
    return np.concatenate([found[:n], asked[n:]])


def tangent_of(curve: Curve, u: Array) -> Array:
    """The unit tangent towards a larger parameter; at a branch point that of the steepest."""
    n = curve.n
    _, slopes = curve.evaluate(u)
    t = _regular_tangent(curve, slopes)
    t = _steepest(curve, u, slopes) if t is None else t
    t = t / curve.length(t)
    lead = t[n] if abs(t[n]) > 1e-9 * curve.scale[n] else t[np.argmax(np.abs(t[:n]))]
    return np.asarray(-t if lead < 0.0 else t)


def _steepest(curve: Curve, u: Array, slopes: Array) -> Array:
    """The tangent by singular values; of several that of the steepest branch."""
    directions = nullspace(slopes, curve.scale[: curve.m])
    if len(directions) > 1:
        return max(directions_at(curve, u), key=lambda t: abs(t[curve.n]), default=directions[0])
    t: Array = directions[0]
    with np.errstate(all="ignore"):
        # Elimination leaves zero what is zero, where rounding would lead away from it.
        row = t / curve.scale[: curve.m] ** 2
        try:
            exact = np.linalg.solve(np.vstack([slopes, row]), np.eye(curve.m)[-1])
        except np.linalg.LinAlgError:
            return t
    return exact if curve.length(exact - t) < 1e-6 * curve.length(t) else t


#: Largest entries of the inverse of f_x, in units of its rows and of the states, of regular points.
STIFF = 1e3


def _regular_tangent(curve: Curve, slopes: Array) -> Array | None:
    """A tangent of the branch where f_x is far from singular; what is zero stays it."""
    n, scale = curve.n, curve.scale[: curve.m]
    if curve.m != n + 1:
        return None
    scaled = slopes * scale
    rows = np.abs(scaled).max(axis=1, keepdims=True)
    if not np.all(rows > 0.0):
        return None
    sides = np.eye(n, n + 1, 1)
    sides[:, :1] = -scaled[:, n:] / rows
    try:
        found = np.linalg.solve(scaled[:, :n] / rows, sides)
    except np.linalg.LinAlgError:
        return None
    if not np.abs(found).max() < STIFF:
        return None
    return np.asarray(np.append(found[:, 0], 1.0) * scale)
