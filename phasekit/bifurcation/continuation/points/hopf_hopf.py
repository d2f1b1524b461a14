"""Hopf-Hopf points: a second pair of eigenvalues on the imaginary axis."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from phasekit.bifurcation.continuation.curve import Curve
from phasekit.bifurcation.continuation.kernels.defining import HOPF
from phasekit.bifurcation.continuation.path import Sample
from phasekit.bifurcation.continuation.points.curve_test import CurveTest
from phasekit.bifurcation.continuation.spectrum import eigenvalues_of, pair_function

Array = npt.NDArray[np.float64]


def _without_pair(curve: Curve, u: Array, slopes: Array) -> npt.NDArray[np.complex128]:
    """All eigenvalues, on scaled axes, but the pair of the Hopf point, at each point."""
    n, m = curve.n, curve.m
    scale = curve.scale[:n]
    values = eigenvalues_of(slopes[:, :, :n] * scale / scale[:, None])
    root = np.sqrt(u[:, m + n].astype(complex))[:, None]  # i omega, or r of r and -r
    for one in (1j * root, -1j * root):
        place = np.argmin(np.abs(values - one), axis=1)
        keep = np.arange(values.shape[1]) != place[:, None]
        values = values[keep].reshape(len(values), -1)
    return values


def others(curve: Curve, u: Array, slopes: Array) -> Array:
    """The pair function of all eigenvalues but the pair of the Hopf point."""
    return pair_function(_without_pair(curve, u, slopes))


def other_pair(curve: Curve, s: Sample) -> bool:
    """Whether the two others whose sum vanishes are conjugate."""
    if not s.u[curve.m + curve.n] > 0.0:
        return False
    values = _without_pair(curve, s.u[None], s.slopes[None])[0]
    above = values[values.imag > 0.0]
    least = np.min(np.abs(2.0 * above.real), initial=np.inf)
    return bool(least <= abs(float(pair_function(values))) * (1.0 + 1e-9))


TESTS = (CurveTest("hopf_hopf", HOPF, others, 4, other_pair),)
