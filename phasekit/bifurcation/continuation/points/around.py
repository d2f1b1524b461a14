"""Branches through a degenerate point, counted on small circles around it."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from phasekit.bifurcation.continuation.curve import Curve
from phasekit.bifurcation.continuation.points.singular import Singular

Array = npt.NDArray[np.float64]

RADII = (8e-3, 4e-3)  # on scaled axes
ANGLES = 360
CHORDS = 10


def rays_around(curve: Curve, point: Singular) -> list[Array]:
    """Unit tangents of the lines along which branches leave a point of corank one.

    The reduced equation f + w b = 0 is solved for b on circles around the point, in the plane of
    the null vectors; branches cross the circle where b changes its sign. Empty unless two circles
    agree and each ray has its opposite.
    """
    angles = [_crossings(curve, point, radius) for radius in RADII]
    if len(angles[0]) != len(angles[1]) or not len(angles[0]) or len(angles[0]) % 2:
        return []
    # What is left of the bend of the branches after one extrapolation.
    turn = angles[1] - angles[0]
    turn -= 2.0 * np.pi * np.round(turn / (2.0 * np.pi))
    rays = angles[1] + turn
    half = len(rays) // 2
    gap = rays[half:] - rays[:half] - np.pi
    gap -= 2.0 * np.pi * np.round(gap / (2.0 * np.pi))
    if np.max(np.abs(turn)) > 0.2 or np.max(np.abs(gap)) > 0.05:
        return []
    lines = rays[:half] + 0.5 * gap
    found = [point.right @ np.array([np.cos(a), np.sin(a)]) for a in lines]
    return [t / curve.length(t) for t in found]


def _crossings(curve: Curve, point: Singular, radius: float) -> Array:
    """Angles at which the reduced function changes its sign, in order."""
    grid = 2.0 * np.pi * (np.arange(ANGLES) + 0.5) / ANGLES
    back = _inverse(curve, point)
    values = np.array([_reduced(curve, point, radius, a, back) for a in grid])
    if not np.isfinite(values).all():
        return np.empty(0)
    found = []
    for i in np.flatnonzero(np.sign(values) != np.sign(np.roll(values, -1))):
        low, high, at_low = grid[i], grid[i] + 2.0 * np.pi / ANGLES, values[i]
        for _ in range(30):
            middle = 0.5 * (low + high)
            value = _reduced(curve, point, radius, middle, back)
            if (value > 0.0) == (at_low > 0.0):
                low = middle
            else:
                high = middle
        found.append(0.5 * (low + high))
    return np.array(found)


def _inverse(curve: Curve, point: Singular) -> Array:
    """From what is left of f, less its part along the left null vector, to a step across."""
    m = curve.m
    scale = curve.scale[:m]
    basis = point.right / scale[:, None]
    scaled = curve.evaluate(point.u)[1] * scale / point.rows[:, None]
    scaled = scaled - point.left @ (point.left.T @ scaled)
    across = np.eye(m) - basis @ basis.T  # of the plane of the circle
    return np.asarray(scale[:, None] * np.linalg.pinv(scaled @ across, rcond=1e-9))


def _reduced(curve: Curve, point: Singular, radius: float, angle: float, back: Array) -> float:
    """What is left of f along the left null vector where all else of it is zero."""
    w = point.left[:, 0]
    u = point.u + radius * (point.right @ np.array([np.cos(angle), np.sin(angle)]))
    value = np.inf
    for _ in range(CHORDS):  # each with an error smaller by the radius
        f = curve.values(u[None])[0] / point.rows
        value = float(w @ f)
        rest = f - w * value
        if not np.max(np.abs(rest)) > 1e-15 * radius:
            break
        u = u - back @ rest
    return value
