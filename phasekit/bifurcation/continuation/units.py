"""Units of equations: sizes of the entries of f and of the rows of its derivatives."""

from __future__ import annotations

import numpy as np

from phasekit.arrays import Array
from phasekit.bifurcation.continuation.curve import Curve
from phasekit.numerics.differences import PLAIN


def row_sizes(matrix: Array) -> Array:
    """Largest entries of the rows; 1 for rows that vanish."""
    sizes = np.max(np.abs(matrix), axis=1)
    return np.asarray(np.where(sizes > 1e-12 * np.max(sizes, initial=0.0), sizes, 1.0))


NULL = 1e-9  # singular values that are zero, beside the largest
#: How many times more than the states a parameter moves f before its scale is made smaller.
STEEP = 1e6


def scale_at(curve: Curve, u: Array) -> Array:
    """Scales of the unknowns at a point: of a parameter, no more than what moves f as states do.

    The span of a parameter says nothing of where f turns steep in it, as lam exp(u) does for
    large u; next to such a column all others would vanish.
    """
    n, m = curve.n, curve.m
    scale = np.array(curve.scale[:m])
    moved = np.abs(curve.evaluate(u)[1] * scale)
    states = np.zeros(m)
    states[:n] = scale[:n]
    by_states = np.max(moved[:, :n], axis=1) + np.max(
        np.abs(curve.bend(u, states) * states), axis=1
    )
    for j in range(n, m):
        with np.errstate(all="ignore"):
            ratio = float(np.max(np.where(by_states > 0.0, moved[:, j] / by_states, 0.0)))
        if np.isfinite(ratio) and ratio > STEEP:
            scale[j] /= ratio
    return scale


def force_sizes(curve: Curve, u: Array, scale: Array | None = None) -> Array:
    """Sizes of the entries of f near a point: of its first and second derivatives.

    The second ones count because all first ones of an entry may vanish at a special point.
    """
    scale = curve.scale[: curve.m] if scale is None else scale
    sizes = np.max(np.abs(curve.evaluate(u)[1] * scale), axis=1)
    sizes = sizes + np.max(np.abs(curve.bend(u, scale) * scale), axis=1)
    return np.asarray(np.where((sizes > 0.0) & np.isfinite(sizes), sizes, 1.0))


def accuracy_of(curve: Curve) -> float:
    """Relative accuracy of the derivatives of f, by differences where f comes alone."""
    return max(curve.field.accuracy, 1e-11 if curve.field.mode == PLAIN else 0.0)


def nullspace(slopes: Array, scale: Array) -> Array:
    """Unit tangents (rows, on the scaled axes) of the kernel of f_u, least singular value last."""
    scaled = slopes * scale
    rows = np.max(np.abs(scaled), axis=1, keepdims=True)
    _, values, vectors = np.linalg.svd(scaled / np.where(rows > 0.0, rows, 1.0))
    n = slopes.shape[0]
    rank = int(np.sum(values > NULL * max(1e-300, values[0]))) if n else 0
    return np.asarray(vectors[rank:] * scale)
