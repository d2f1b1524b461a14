"""Whether a point lies on a traced path: by the curve, not only by its points."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from phasekit.bifurcation.continuation.curve import Curve
from phasekit.bifurcation.continuation.kernels.defining import HOPF, TORUS
from phasekit.bifurcation.continuation.path import Path, Sample, in_phase, turned

Array = npt.NDArray[np.float64]
SAME = 1e-7  # distance on scaled axes


def lies_on(curve: Curve, path: Path, u: Array) -> bool:
    """Whether the curve of a path goes through a point of the same problem, given as far as m."""
    m = curve.m
    weight = 1.0 / curve.scale[:m] ** 2
    if not path.count:
        return False
    gap = turned(curve, u[:m] - path.u[:, :m])
    distance = np.sqrt(np.sum(weight * gap**2, axis=1))
    if np.min(distance) < SAME:
        return True
    chord = np.diff(path.u[:, :m], axis=0)
    square = np.sum(weight * chord**2, axis=1)
    along = np.sum(weight * chord * gap[:-1], axis=1) / np.where(square > 0.0, square, 1.0)
    across = np.sqrt(
        np.sum(weight * (gap[:-1] - np.clip(along, 0.0, 1.0)[:, None] * chord) ** 2, axis=1)
    )
    length = np.sqrt(square)
    near = np.flatnonzero((across < 0.3 * length + SAME) & (along > -0.05) & (along < 1.05))
    for i in near:
        row = np.zeros(curve.size)
        row[:m] = weight * chord[i]
        s = along[i]
        target = path.u[i, :m] + gap[i]
        step = path.u[i + 1] - path.u[i]
        guess = (
            path.u[i]
            + (3.0 - 2.0 * s) * s * s * step
            + curve.length(step) * s * (1.0 - s)
            * ((1.0 - s) * path.tangent[i] - s * path.tangent[i + 1])
        )  # fmt: skip
        here = curve
        if curve.kind in (HOPF, TORUS):
            k = int(i) + int(s > 0.5)
            sample = Sample(path.u[k], path.tangent[k], path.slopes[k])
            here, guess = in_phase(curve, sample, guess)
        point = here.refine(guess, row, float(np.dot(row[:m], target)))
        if point.converged:
            off = turned(curve, point.u[:m] - target)
            if np.sqrt(np.sum(weight * off**2)) < SAME:
                return True
    return False
