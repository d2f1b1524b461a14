"""Zero-Hopf points: an eigenvalue zero beside a pair on the imaginary axis."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from phasekit.bifurcation.continuation.curve import Curve
from phasekit.bifurcation.continuation.kernels.defining import FOLD, HOPF
from phasekit.bifurcation.continuation.path import Sample
from phasekit.bifurcation.continuation.points.curve_test import CurveTest
from phasekit.bifurcation.continuation.spectrum import eigenvalues_of, pair_function

Array = npt.NDArray[np.float64]


def rest(curve: Curve, u: Array, slopes: Array) -> Array:
    """The pair function of all eigenvalues but the one that is zero."""
    values = eigenvalues_of(slopes)
    place = np.argmin(np.abs(values), axis=1)
    keep = np.arange(values.shape[1]) != place[:, None]
    return pair_function(values[keep].reshape(len(values), -1))


def conjugate(curve: Curve, s: Sample) -> bool:
    """Whether there is a pair at all: two real ones are a neutral saddle with a zero eigenvalue."""
    values = eigenvalues_of(s.slopes)
    return bool(np.any(np.delete(values, np.argmin(np.abs(values))).imag != 0.0))


def determinant(curve: Curve, u: Array, slopes: Array) -> Array:
    """The determinant of f_x."""
    return np.asarray(np.linalg.det(slopes[:, :, : curve.n]))


def imaginary(curve: Curve, s: Sample) -> bool:
    """Whether the pair of the Hopf curve is none of a neutral saddle."""
    return bool(s.u[curve.m + curve.n] > 0.0)


TESTS = (
    CurveTest("zero_hopf", FOLD, rest, 3, conjugate),
    CurveTest("zero_hopf", HOPF, determinant, 3, imaginary),
)
