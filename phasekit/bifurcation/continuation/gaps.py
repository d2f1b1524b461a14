"""Steps that something narrow lies in: what a curve does between two points, by its chord.

A chord is the mean of the tangents along the curve. Where it is not what the tangents at both ends
say, and half the step makes it no better, the curve turns within less than the step.
"""

from __future__ import annotations

import numpy as np

from phasekit.bifurcation.continuation.curve import Curve
from phasekit.bifurcation.continuation.kernels.defining import REGULAR
from phasekit.bifurcation.continuation.kernels.newton import RAISED
from phasekit.bifurcation.continuation.path import Path, Sample, between

SEEN = 1e-5  # off the mean tangent: more than errors of derivatives
DEPTH = 8
MOST = 20  # steps that are looked into
SHORT = 1e-5  # steps whose chords are not known well


def narrow(curve: Curve, path: Path) -> tuple[str, ...]:
    """Where a branch turns within less than a step, in words."""
    if curve.kind not in REGULAR or curve.options.tolerance >= RAISED or path.count < 2:
        return ()
    unit = np.sqrt(curve.weight[: curve.m])
    u, t = path.u[:, : curve.m] * unit, path.tangent[:, : curve.m] * unit
    t = t / np.linalg.norm(t, axis=1, keepdims=True)  # scales have grown along the path
    chord = np.diff(u, axis=0)
    h = np.linalg.norm(chord, axis=1)
    with np.errstate(all="ignore"):
        off = np.linalg.norm(chord / h[:, None] - 0.5 * (t[1:] + t[:-1]), axis=1)
    turn = np.linalg.norm(t[1:] - t[:-1], axis=1)
    doubtful = np.flatnonzero((off > SEEN) & (off > turn) & (h > SHORT))
    doubtful = doubtful[np.argsort(-off[doubtful])][:MOST]
    found = []
    for i in np.sort(doubtful).tolist():
        a, b = (Sample(path.u[k], path.tangent[k], path.slopes[k]) for k in (i, i + 1))
        if not _smooth(curve, a, b, DEPTH):
            found.append(i)
    if not found:
        return ()
    n = curve.n
    name = curve.field.parameters[curve.active[0]]
    places = ", ".join(
        f"{path.u[i, n]:.6g} and {path.u[i + 1, n]:.6g}" for i in found[:3]
    ) + (", ..." if len(found) > 3 else "")  # fmt: skip
    return (
        f"the curve turns within less than a step between {name} = {places}: special points there "
        "may be missed; a smaller max_step follows it",
    )


def _smooth(curve: Curve, a: Sample, b: Sample, depth: int) -> bool:
    """Whether halves of a step are better known by their tangents than the whole is."""
    whole = _off(curve, a, b)
    if whole <= SEEN:
        return True
    middle = between(curve, a, b, 0.5)
    if middle is None or depth == 0:
        return False
    halves = [(a, middle), (middle, b)]
    return all(
        _off(curve, *half) <= max(0.5 * whole, SEEN) or _smooth(curve, *half, depth - 1)
        for half in halves
    )


def _off(curve: Curve, a: Sample, b: Sample) -> float:
    chord = b.u - a.u
    h = curve.length(chord)
    mean = sum(0.5 * s.tangent / curve.length(s.tangent) for s in (a, b))
    return curve.length(chord / h - mean) if h > 0.0 else 0.0
