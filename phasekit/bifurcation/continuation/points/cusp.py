"""Cusps: the quadratic coefficient along a curve of folds is zero."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from phasekit.bifurcation.continuation.curve import Curve
from phasekit.bifurcation.continuation.kernels.defining import FOLD
from phasekit.bifurcation.continuation.points.curve_test import CurveTest
from phasekit.bifurcation.continuation.points.null_vectors import left_and_right

Array = npt.NDArray[np.float64]


def quadratic(curve: Curve, u: Array, slopes: Array) -> Array:
    """The quadratic coefficient of the fold."""
    n, m = curve.n, curve.m
    p, _ = left_and_right(curve, u, slopes)
    v = u[:, m : m + n]
    z = np.zeros((len(u), m))
    z[:, :n] = v
    bent = curve.bend_all(u, z)[:, :, :n]
    return np.asarray(np.einsum("ki,kij,kj->k", p, bent, v))


TESTS = (CurveTest("cusp", FOLD, quadratic, of=(False, True)),)
