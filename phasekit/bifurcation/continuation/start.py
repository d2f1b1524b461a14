"""From a guess to a curve: the first equilibrium, its tangent, and both ways from it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import numpy.typing as npt

from phasekit.bifurcation.continuation.acceptance import rounded
from phasekit.bifurcation.continuation.conserved import deficient, not_isolated
from phasekit.bifurcation.continuation.curve import Curve, Stop, Track
from phasekit.bifurcation.continuation.ending import followed
from phasekit.bifurcation.continuation.kernels.defining import EQUILIBRIUM
from phasekit.bifurcation.continuation.path import Sample
from phasekit.bifurcation.continuation.points.branch_point import directions_at
from phasekit.bifurcation.continuation.stops import UNFINISHED, place_of, wished
from phasekit.bifurcation.continuation.units import nullspace
from phasekit.errors import ConvergenceError

Array = npt.NDArray[np.float64]

STEP = 2.0**-20  # of an unknown, within which f may have no value


def settle(curve: Curve, u: Array, names: str) -> Array:
    """The equilibrium that a guess leads to at fixed parameters.

    Raises
    ------
    ConvergenceError
        If f or its derivatives are not finite there, or if neither Newton's method nor SciPy's
        hybrid and Levenberg-Marquardt methods find one.
    """
    found = _settled(curve, u, names)
    if not np.isfinite(curve.at(found)[1]).all():
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
    value, _ = curve.at(u)
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
        return rounded(curve, _at(point.u, u, n))

    def vanishes(u: Array) -> bool:
        """Whether f does: beside its terms, and what it was where the search began."""
        found, slopes = curve.at(u)
        size = np.abs(slopes) @ np.abs(u[: curve.m]) + np.abs(value)
        return bool(np.all(np.abs(found) <= 1e-12 * size))

    if not np.any(value):
        return u  # an equilibrium, but one where f_x is singular
    if np.isfinite(point.u).all() and vanishes(point.u):
        return _at(point.u, u, n)

    from scipy.optimize import root

    tried = np.array(u)

    def f(x: Array) -> Array:
        tried[:n] = x
        return np.asarray(curve.values(tried[None])[0])

    def jacobian(x: Array) -> Array:
        tried[:n] = x
        return curve.at(tried)[1][:, :n]

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
        if vanishes(guess):
            return guess
    raise ConvergenceError(
        f"x0: no equilibrium was found from {names} (|f| = {np.max(np.abs(value)):.3g} there) by "
        f"Newton's method, Powell's hybrid method or Levenberg-Marquardt{_edges(curve, u)}; give "
        "an x0 that is closer"
    )


def _at(found: Array, asked: Array, n: int) -> Array:
    """The point with the parameters that were asked for, to the last bit."""
    return np.concatenate([found[:n], asked[n:]])


def tangent_of(curve: Curve, u: Array) -> Array:
    """The unit tangent towards a larger parameter; at a branch point that of the steepest."""
    n = curve.n
    _, slopes = curve.at(u)
    directions = nullspace(slopes, curve.scale[: curve.m])
    if len(directions) == 1:
        t = directions[0]
        with np.errstate(all="ignore"):
            # Elimination leaves zero what is zero, where rounding would lead away from it.
            row = t / curve.scale[: curve.m] ** 2
            try:
                exact = np.linalg.solve(np.vstack([slopes, row]), np.eye(curve.m)[-1])
            except np.linalg.LinAlgError:
                exact = t
        if curve.length(exact - t) < 1e-6 * curve.length(t):
            t = exact
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
    if curve.kind == EQUILIBRIUM and deficient(curve, start.u, start.slopes):
        why = not_isolated(curve, start.u[: curve.m], place_of(curve, start.u))
        if why:  # there is no branch to follow
            still = replace(curve.not_begun(start.u, start.tangent), stop=Stop("stuck", why))
            return (None if directions == "forward" else still), (
                None if directions == "backward" else still
            )
    if directions != "backward":
        forward = followed(curve, start, curve.start_state(start.u, start.tangent), points)
    closed = forward is not None and forward.stop.reason == "closed"
    if directions != "forward" and not closed:
        start = _turned(start)
        if forward is not None and forward.stop.reason == "interrupted":
            return curve.not_begun(start.u, start.tangent), forward
        backward = followed(curve, start, curve.start_state(start.u, start.tangent), points)
    return backward, forward


def go_on(
    curve: Curve, start: Sample, tracks: tuple[Track | None, Track | None], points: int
) -> tuple[Track | None, Track | None]:
    """More points of tracks that can be longer, exactly as if they had never stopped."""
    backward, forward = (
        track
        if track is None or not goes_on(curve, track)
        else followed(curve, begin, *_left(curve, begin, track, points))
        for begin, track in zip((_turned(start), start), tracks, strict=True)
    )
    if forward is not None and forward.stop.reason == "closed":
        backward = None
    return backward, forward


def goes_on(curve: Curve, track: Track) -> bool:
    """Whether a track can be longer: it was cut, or a bound is no longer where it met it."""
    reason = track.stop.reason
    if reason != "bound":
        return reason in UNFINISHED or wished(track.stop, curve.ends)
    u = track.state[: len(curve.low)]  # vectors of curves in two parameters have bounds as well
    return bool(np.all((u > curve.low) & (u < curve.high)))


def _left(curve: Curve, start: Sample, track: Track, points: int) -> tuple[Array, int, Track]:
    """What `followed` goes on from: the state behind the last point.

    Where the track was cut at a special point, it is followed again up to there.
    """
    if wished(track.stop, curve.ends) and len(track.record):
        state = curve.start_state(start.u, start.tangent)
        track = replace(track, state=curve.follow(state, len(track.record)).state)
    return track.state, points, track


def _turned(start: Sample) -> Sample:
    return Sample(start.u, -start.tangent, start.slopes)
