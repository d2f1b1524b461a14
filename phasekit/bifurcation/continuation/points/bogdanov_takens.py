"""Bogdanov-Takens points: a double eigenvalue zero, along curves of folds and Hopf points."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from phasekit.bifurcation.continuation.curve import Curve
from phasekit.bifurcation.continuation.kernels.defining import FOLD, HOPF
from phasekit.bifurcation.continuation.points.curve_test import CurveTest
from phasekit.bifurcation.continuation.points.null_vectors import left_and_right

Array = npt.NDArray[np.float64]


def product(curve: Curve, u: Array, slopes: Array) -> Array:
    """The product of both null vectors, zero where the eigenvalue is double."""
    p, v = left_and_right(curve, u, slopes)
    return np.asarray(np.sum(p * v * curve.scale[: curve.n], axis=1))


def square(curve: Curve, u: Array, slopes: Array) -> Array:
    """The square of the frequency, negative where the pair is real."""
    return np.asarray(u[:, curve.m + curve.n])


TESTS = (
    CurveTest("bogdanov_takens", FOLD, product, 2),
    CurveTest("bogdanov_takens", HOPF, square),
)
