"""Paths of curves over two parameters in their plane, as points close together."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import numpy.typing as npt

from phasekit.bifurcation.continuation.curve import Curve
from phasekit.bifurcation.continuation.kernels.defining import HOPF
from phasekit.bifurcation.continuation.path import Path

Array = npt.NDArray[np.float64]


def runs_in_plane(curve: Curve, path: Path, plane: Sequence[int], steps: Array) -> list[Array]:
    """A path in the plane of two unknowns, as runs of points closer than steps.

    Of a Hopf curve without its neutral saddles.
    """
    rows = list(plane)
    pairs = np.ones(len(path.u))
    if curve.kind == HOPF:  # omega^2, which is negative of neutral saddles
        rows.append(curve.m + curve.n)
        pairs = path.u[:, rows[2]]
    u, t = path.u[:, rows], path.tangent[:, rows]
    runs: list[Array] = []
    own: list[Array] = []
    for i in range(len(u) - 1):
        length = curve.length(path.u[i + 1] - path.u[i])

        def smooth(s: Array, i: int = i, length: float = length) -> Array:
            """The cubic with the tangents of both ends."""
            s = s[:, None]
            bend = (1.0 - s) * t[i] - s * t[i + 1]
            rise = (3.0 - 2.0 * s) * s * s * (u[i + 1] - u[i])
            return np.asarray(u[i] + rise + length * s * (1.0 - s) * bend)

        first, last = 0.0, 1.0
        if (pairs[i] > 0.0) != (pairs[i + 1] > 0.0):
            least, most = (0.0, 1.0) if pairs[i + 1] > 0.0 else (1.0, 0.0)
            for _ in range(60):  # where both eigenvalues are zero
                middle = 0.5 * (least + most)
                if smooth(np.array([middle]))[0, 2] > 0.0:
                    most = middle
                else:
                    least = middle
            first, last = (most, 1.0) if pairs[i + 1] > 0.0 else (0.0, most)
        if pairs[i] > 0.0 or pairs[i + 1] > 0.0:
            count = np.ceil(np.max(np.abs((u[i + 1] - u[i])[:2] / steps)))
            points = smooth(np.linspace(first, last, int(np.clip(count, 1, 4096)) + 1))[:, :2]
            own.append(points[1:] if own else points)
        if own and (not pairs[i + 1] > 0.0 or i == len(u) - 2):
            runs.append(np.concatenate(own))
            own = []
    return runs
