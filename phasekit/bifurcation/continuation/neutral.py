"""Pairs of eigenvalues on the axis all along a path: their signs are those of rounding errors."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from phasekit.bifurcation.continuation.curve import Curve
from phasekit.bifurcation.continuation.rows import largest
from phasekit.bifurcation.continuation.spectrum import is_conservative, on_axis, twos_on_axis

FEW = 3  # points from which on it is a path
MOST = 0.9  # part of its points; next to double eigenvalues errors are larger


def is_neutral(curve: Curve, values: npt.NDArray[np.complex128]) -> bool:
    """Whether the spectrum keeps a pair on the axis along a path, or is always its mirror image.

    Then the sum of two eigenvalues, of a map the product less 1, is zero everywhere, and tells of
    no Hopf point.
    """
    if is_conservative(values, discrete=curve.discrete):
        return True
    if values.shape[-1] < 2 or len(values) < FEW:
        return False
    if not twos_on_axis(curve, values[:: max(1, len(values) // FEW)]).any():
        return False
    return bool(np.mean(twos_on_axis(curve, values)) >= MOST)


def said_of(curve: Curve, values: npt.NDArray[np.complex128]) -> tuple[str, ...]:
    """What is said of a path whose spectrum `is_neutral`, where nothing is known of energy."""
    turning = on_axis(curve, values).any(axis=-1)
    if len(values) < FEW or not turning.any() or not np.any(largest(values) > 0.0):
        return ()
    if curve.discrete:
        where, kind, more = "unit circle", "torus", "multipliers"
    else:
        where, kind, more = "imaginary axis", "Hopf", "eigenvalues"
    return (
        f"a pair of {more} stays on the {where} along the branch, within its error, as where f "
        f"conserves something or is reversible: no {kind} points are told of it, and it does not "
        "decide stability",
    )
