"""Acceptance of points: f at each is no more than rounding of its terms, or it is said.

Newton's method judges a point by the steps that led to it, and unknowns that vanish by their
scales; here f itself is held against its terms. What is larger is brought down, where it can be.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import numpy.typing as npt

from phasekit.bifurcation.continuation.curve import TIGHT, Curve, Track
from phasekit.bifurcation.continuation.derivatives import Derivatives
from phasekit.bifurcation.continuation.kernels.defining import EQUILIBRIUM
from phasekit.bifurcation.continuation.kernels.newton import RAISED, ROUNDING
from phasekit.bifurcation.continuation.kernels.trace import BOUND

Array = npt.NDArray[np.float64]

EPSILON = 2.0**-52
INSIDE = 1e-12  # of a function, whose inner terms are not seen
BESIDE = 1e-6  # farthest, on scaled axes, that a bound lies from a last point
NEAR = 1e-8  # farthest, on scaled axes, that a point is moved
VAIN = 3  # points in a row that cannot be brought nearer: f is no better known


def accepted(
    curve: Curve, u: Array, tangent: Array, residual: Array, fixed: dict[int, int]
) -> tuple[dict[int, Array], str]:
    """Points of a path that are better than those it has, by their places; and what is left.

    residual: |f| beside its terms at each point; fixed: the unknown that keeps its value, of
    points where one does: at the start and at bounds.
    """
    bound = ROUNDING if curve.field.exact else INSIDE
    better: dict[int, Array] = {}
    left = np.array(residual)
    vain = 0
    poor = np.flatnonzero(~(residual <= bound))
    if curve.options.tolerance < RAISED:
        for i in (k for k in fixed if 0.0 < residual[k] <= bound):  # ends are special points
            found, value = nearer(curve, u[i], tangent[i], float(residual[i]), fixed[i])
            if value < residual[i]:
                better[i], left[i] = found, value
        for i in poor.tolist():
            found, value = nearer(curve, u[i], tangent[i], float(residual[i]), fixed.get(i))
            if value < residual[i]:
                better[i], left[i] = found, value
            vain = 0 if value <= bound or value < 0.5 * residual[i] else vain + 1
            if vain >= VAIN:
                break
    poor = np.flatnonzero(~(left <= bound))
    return better, _residual_words(curve, [better.get(i, u[i]) for i in poor.tolist()], bound)


def on_bound(curve: Curve, track: Track) -> Track:
    """A track that is stuck next to a branch point on a bound, brought there.

    Newton's method has nothing to hold on to where f_x is singular.
    """
    if track.stop.reason != "stuck" or curve.kind != EQUILIBRIUM or not len(track.record):
        return track
    m = curve.m
    u, t = track.record[-1, :m], track.record[-1, m : 2 * m]
    with np.errstate(all="ignore"):
        bound = np.where(t > 0.0, curve.high, curve.low)
        length = np.where(t != 0.0, (bound - u) / t, np.inf)
    j = int(np.argmin(length))
    if not 0.0 <= length[j] <= BESIDE:
        return track
    u = u + length[j] * t
    u[j] = bound[j]
    value, slopes = curve.evaluate(u)
    if not np.all(np.abs(value) <= ROUNDING * (np.abs(slopes) @ np.abs(u))):
        return track
    record, state = track.record.copy(), track.state.copy()
    record[-1, :m] = state[:m] = u
    return replace(track, record=record, state=state, stop=curve.stop_of(BOUND, j, state))


def nearer(
    curve: Curve, u: Array, tangent: Array, residual: float, fixed: int | None
) -> tuple[Array, float]:
    """The best of a point, of what Newton's method makes of it, and of their rounded zeros."""
    row = curve.weight * tangent
    if fixed is not None:
        row = np.zeros(curve.size)
        row[fixed] = 1.0
    point = curve.refine(u, row, tolerance=TIGHT)
    tried = [u]
    if point.converged and curve.length(point.u - u) <= NEAR:
        again = np.array(point.u)
        if fixed is not None:
            again[fixed] = u[fixed]
        tried.append(again)
    tried += [without_rounding(curve, one) for one in tried]
    best, least = u, residual
    for i, one in enumerate(tried):
        if not any(np.array_equal(one, other) for other in (u, *tried[:i])):
            value = residual_at(curve, one)
            if value < least:
                best, least = one, value
    return best, least


def residual_at(curve: Curve, u: Array) -> float:
    """|f| beside its terms at one point, whose sizes need few digits."""
    return float(curve.residuals(u[None], curve.evaluate(u, sharp=False)[1][None])[0])


def without_rounding(curve: Curve, u: Array) -> Array:
    """A point of a branch of equilibria whose unknowns are zero where they are but rounding."""
    u = np.array(u)
    if curve.kind == EQUILIBRIUM:
        u[: curve.m][np.abs(u[: curve.m]) <= EPSILON * curve.scale[: curve.m]] = 0.0
    return u


def rounded(curve: Curve, u: Array) -> Array:
    """`without_rounding`, where f is no larger there."""
    zeros = without_rounding(curve, u)
    if np.array_equal(zeros, u) or residual_at(curve, zeros) > residual_at(curve, u):
        return u
    return zeros


def _residual_words(curve: Curve, points: list[Array], bound: float) -> str:
    """What is left of f, in words; nothing if unknowns of their scales would leave as much."""
    sizes = []
    for u in points:
        value, slopes = curve.evaluate(u)
        terms = np.abs(slopes) @ np.maximum(np.abs(u[: curve.m]), curve.scale[: curve.m])
        with np.errstate(all="ignore"):
            sizes.append(np.max(np.where(value == 0.0, 0.0, np.abs(value) / terms)))
    many = int(np.sum(~(np.array(sizes) <= bound)))
    if not many:
        return ""
    u = points[int(np.argmax(np.nan_to_num(sizes, nan=np.inf)))]
    names = [*curve.field.states, *(curve.field.parameters[i] for i in curve.active)]
    where = [f"{name} = {number:.6g}" for name, number in zip(names, u, strict=False)]
    where = where if len(where) <= 4 else [*where[:3], "..."]
    noise = np.all(np.abs(curve.evaluate(u)[0]) <= 10.0 * Derivatives(curve, u).noise())
    return (
        f"{many} points solve f = 0 to {max(sizes):.1e} of its terms, which exceeds rounding"
        f"{' of numbers: f itself is not known better' if noise else ''}; the worst at "
        f"{', '.join(where)}"
    )
