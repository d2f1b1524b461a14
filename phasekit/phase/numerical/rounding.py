"""Rounding bounds outward, and bounds of functions that rise."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, TypeAlias

import numpy as np
import numpy.typing as npt

Array = npt.NDArray[np.float64]
Flags = npt.NDArray[np.bool_]
#: Lower and upper bounds, arrays of one shape.
Interval: TypeAlias = tuple[Any, Any]

#: Units in the last place by which elementary functions of NumPy may be off (it promises 4).
_ULPS = 4.0
_EPS = float(np.finfo(float).eps)
_MOST = float(np.finfo(float).max)


def outward(low: Any, high: Any) -> Interval:
    """Round bounds outward by one unit in the last place."""
    return np.nextafter(low, -np.inf), np.nextafter(high, np.inf)


def wide(low: Array, high: Array) -> Interval:
    """Round outward by what an elementary function may be off."""
    low, high = np.minimum(low, _MOST), np.maximum(high, -_MOST)
    return (
        np.nextafter(low - _ULPS * _EPS * np.abs(low), -np.inf),
        np.nextafter(high + _ULPS * _EPS * np.abs(high), np.inf),
    )


def rising(
    function: Callable[[Any], Any],
    domain: tuple[float, float] = (-np.inf, np.inf),
    image: tuple[float, float] = (-np.inf, np.inf),
) -> Callable[..., Interval]:
    """Rule for a function that rises."""

    def rule(undefined: Flags, a: Interval) -> Interval:
        undefined |= (np.asarray(a[0]) < domain[0]) | (np.asarray(a[1]) > domain[1])
        low, high = (function(np.clip(end, *domain)) for end in a)
        undefined |= ~np.isfinite(low) & np.isfinite(a[0])
        low, high = wide(low, high)
        return np.maximum(low, image[0]), np.minimum(high, image[1])

    return rule
