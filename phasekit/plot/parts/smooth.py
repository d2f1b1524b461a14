"""Curves of which points and tangents are known, drawn without corners."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]

#: A chord may leave the curve by this part of what the picture spans.
SAGITTA = 2e-4
MOST = 24


def smooth(
    x: FloatArray, y: FloatArray, s: FloatArray, dx: FloatArray, dy: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Return the cubic curve through points with given slopes over the arclength s.

    Points are added between those where their chord would leave the curve; where slopes are not
    known, or contradict the points, the chord stays.
    """
    step = np.diff(s)
    bow = np.zeros(step.shape)
    for values, slopes in ((x, dx), (y, dy)):
        span = float(np.ptp(values)) if values.size else 0.0
        if not span > 0.0:
            continue
        # The middle of a cubic lies off that of its chord by h (slope_0 - slope_1) / 8.
        off = np.abs(step * np.diff(slopes)) / 8.0
        chord = np.abs(np.diff(values))
        strays = np.max(np.abs(np.stack([slopes[:-1], slopes[1:]])) * step, axis=0)
        bow = np.maximum(bow, np.where(strays > 4.0 * chord + 0.05 * span, np.nan, off / span))
    parts = np.ceil(np.sqrt(bow / SAGITTA))
    parts = np.where(np.isfinite(parts), np.clip(parts, 1, MOST), 1).astype(int)
    if not (parts > 1).any():
        return x, y
    pieces = [
        _cubic(
            np.arange(n) / n, values[i], values[i + 1], step[i] * slopes[i], step[i] * slopes[i + 1]
        )
        if n > 1
        else values[i : i + 1]
        for values, slopes in ((x, dx), (y, dy))
        for i, n in enumerate(parts)
    ]
    half = len(pieces) // 2
    return (
        np.concatenate([*pieces[:half], x[-1:]]),
        np.concatenate([*pieces[half:], y[-1:]]),
    )


def _cubic(t: FloatArray, a: float, b: float, da: float, db: float) -> FloatArray:
    """Return the cubic with the ends a, b and the slopes da, db there, at t in [0, 1]."""
    rise = t * t * (3.0 - 2.0 * t)
    return np.asarray(a + (b - a) * rise + t * (1.0 - t) * ((1.0 - t) * da - t * db))
