"""Generalized Hopf points: the first Lyapunov coefficient is zero."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from phasekit.bifurcation.continuation import normal_form as forms
from phasekit.bifurcation.continuation.curve import Curve
from phasekit.bifurcation.continuation.kernels.defining import HOPF
from phasekit.bifurcation.continuation.points.curve_test import CurveTest
from phasekit.bifurcation.continuation.points.pair import normal_form

Array = npt.NDArray[np.float64]


def lyapunov(curve: Curve, u: Array, slopes: Array) -> Array:
    """The first Lyapunov coefficient, NaN of neutral saddles."""
    n, m = curve.n, curve.m
    size = np.max(np.abs(slopes[:, :, :n]), axis=(1, 2))
    found = np.full(len(u), np.nan)
    for i in np.flatnonzero(u[:, m + n] > 1e-8 * np.maximum(1e-300, size**2)):
        d = forms.Derivatives(curve, u[i])
        found[i] = normal_form(d, float(np.sqrt(u[i, m + n])))["l1"]
    return found


TESTS = (
    CurveTest("generalized_hopf", HOPF, lyapunov, coefficient="the first Lyapunov coefficient l1"),
)
