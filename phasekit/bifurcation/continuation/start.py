"""From a guess to a curve: the first equilibrium, its scales and its tangent."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from phasekit.bifurcation.continuation.curve import Curve, Track, nullspace
from phasekit.bifurcation.continuation.path import Sample
from phasekit.bifurcation.continuation.points.branch_point import directions_at
from phasekit.errors import ConvergenceError

Array = npt.NDArray[np.float64]

LARGE = 1e8  # a state that grows so many times beyond its scale leaves the picture


def settle(curve: Curve, u: Array, names: str) -> Array:
    """The equilibrium that a guess leads to at fixed parameters.

    Raises
    ------
    ConvergenceError
        If neither Newton's method nor SciPy's hybrid and Levenberg-Marquardt methods find one.
    """
    n = curve.n
    value, _ = curve.at(u)
    if not np.isfinite(value).all():
        raise ConvergenceError(
            f"x0: f is not finite there: f = {value.tolist()} at {names}; give another x0"
        )
    row = np.zeros(curve.size)
    row[n] = 1.0
    point = curve.refine(u, row, iterations=30)
    if point.converged and np.isfinite(point.residual).all():
        return _at(point.u, u, n)
    if np.max(np.abs(value)) <= 1e-13 * max(1.0, float(np.max(np.abs(u[:n])))):
        return u  # an equilibrium, but one where f_x is singular

    from scipy.optimize import root

    def f(x: Array) -> Array:
        return curve.at(np.append(x, u[n:]))[0]

    def jacobian(x: Array) -> Array:
        return curve.at(np.append(x, u[n:]))[1][:, :n]

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
            return _at(point.u, u, n)
        residual = np.max(np.abs(found.fun))
        if residual <= 1e-12:
            return guess
    raise ConvergenceError(
        f"x0: no equilibrium was found from {names} (|f| = {np.max(np.abs(value)):.3g} there) by "
        "Newton's method, Powell's hybrid method or Levenberg-Marquardt; give an x0 that is closer"
    )


def _at(found: Array, asked: Array, n: int) -> Array:
    """The point with the parameters that were asked for, to the last bit."""
    return np.concatenate([found[:n], asked[n:]])


def scaled(curve: Curve, u: Array, given: dict[int, float]) -> Curve:
    """The curve with scales of its states: given, of angles, or from the start and its slope."""
    n = curve.n
    scale = curve.scale.copy()
    _, slopes = curve.at(u)
    with np.errstate(all="ignore"):
        motion = np.linalg.lstsq(slopes[:, :n], -slopes[:, n], rcond=1e-10)[0] * scale[n]
    for i in range(n):
        if curve.period[i] > 0.0:
            scale[i] = curve.period[i] / (2.0 * np.pi)
        elif i in given:
            scale[i] = given[i]
        else:
            size = max(abs(u[i]), min(abs(motion[i]), 1.0) if np.isfinite(motion[i]) else 0.0)
            scale[i] = size if size > 1e-10 else 1.0
    low, high = curve.low.copy(), curve.high.copy()
    for i in range(n):
        if curve.period[i] == 0.0 and not np.isfinite(low[i]) and not np.isfinite(high[i]):
            reach = LARGE * max(scale[i], 1.0)
            low[i], high[i] = u[i] - reach, u[i] + reach
    return curve.replace(scale=scale, low=low, high=high)


def tangent_of(curve: Curve, u: Array) -> Array:
    """The unit tangent towards a larger parameter; at a branch point that of the steepest."""
    n = curve.n
    _, slopes = curve.at(u)
    directions = nullspace(slopes, curve.scale[: curve.m])
    if len(directions) == 1:
        t = directions[0]
    else:
        found = directions_at(curve, u)
        t = max(found, key=lambda t: abs(t[n])) if found else directions[0]
    t = t / curve.length(t)
    lead = t[n] if abs(t[n]) > 1e-9 * curve.scale[n] else t[np.argmax(np.abs(t[:n]))]
    return np.asarray(-t if lead < 0.0 else t)


def run(curve: Curve, start: Sample, directions: str) -> tuple[Track | None, Track | None]:
    """Follow a curve from its start, backward and forward; None where it was not asked for."""
    points = curve.options.max_points
    forward = backward = None
    if directions != "backward":
        forward = curve.follow(curve.start_state(start.u, start.tangent), points)
    closed = forward is not None and forward.stop.reason == "closed"
    if directions != "forward" and not closed:
        backward = curve.follow(curve.start_state(start.u, -start.tangent), points)
    return backward, forward


def go_on(curve: Curve, track: Track | None, points: int) -> Track | None:
    """More points of a track that ended for their number, exactly as if it had never stopped."""
    if track is None or track.stop.reason != "max_points":
        return track
    more = curve.follow(track.state, points)
    return Track(np.concatenate([track.record, more.record]), more.state, more.stop)
