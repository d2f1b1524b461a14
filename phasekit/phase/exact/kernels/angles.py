"""Angles from their tangents and cotangents."""

from __future__ import annotations

import math

import numpy as np

from phasekit.numerics.compile import inline


@inline
def tan_half(y: float, x: float) -> float:
    """Return tan(angle/2) of the angle atan2(y, x), y > 0."""
    size = length(y, x)
    return y / (size + x) if x >= 0.0 else (size - x) / y


@inline
def length(y: float, x: float) -> float:
    """sqrt(x^2 + y^2) without overflow; y and x are not both 0."""
    most = max(abs(x), abs(y))
    return most * np.sqrt(x / most * (x / most) + y / most * (y / most))


@inline
def unit_vector(z: float) -> tuple[float, float]:
    """Cosine and sine >= 0 of the angle whose cotangent is z."""
    size = np.sqrt(1.0 + z * z) if abs(z) < 1e150 else abs(z)
    return (z / size if abs(z) < math.inf else math.copysign(1.0, z)), 1.0 / size
