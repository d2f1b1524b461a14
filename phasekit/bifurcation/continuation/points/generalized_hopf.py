"""Generalized Hopf points: the first Lyapunov coefficient is zero."""

from __future__ import annotations

import numpy as np

from phasekit.arrays import Array
from phasekit.bifurcation.continuation import normal_form as forms
from phasekit.bifurcation.continuation.curve import Curve
from phasekit.bifurcation.continuation.kernels.defining import HOPF
from phasekit.bifurcation.continuation.points.curve_test import CurveTest
from phasekit.bifurcation.continuation.points.pair import normal_form as first_form
from phasekit.bifurcation.continuation.reduction import (
    Reduction,
    combined,
    critical,
    described,
    frequencies,
)
from phasekit.bifurcation.continuation.units import force_sizes


def lyapunov(curve: Curve, u: Array, slopes: Array) -> Array:
    """The first Lyapunov coefficient, NaN of neutral saddles."""
    n, m = curve.n, curve.m
    scale = curve.scale[:n]
    size = np.max(np.abs(slopes[:, :, :n]) * scale / scale[:, None], axis=(1, 2))
    found = np.full(len(u), np.nan)
    for i in np.flatnonzero(u[:, m + n] > 1e-8 * np.maximum(1e-300, size**2)):
        d = forms.Derivatives(curve, u[i])
        found[i] = first_form(d, float(np.sqrt(u[i, m + n])))["l1"]
    return found


def normal_form(d: forms.Derivatives) -> tuple[dict[str, float], str]:
    """Of w' = i omega w + c1 w |w|^2 + c2 w |w|^4: l2 = Re c2/omega ([Kuznetsov2004] 8.3)."""
    (omega,) = frequencies(d, 1)
    at = critical(d, [1j * omega, -1j * omega], [(1,), (-1,)])
    c2 = Reduction(d, at, 5).coefficient(0, (3, 2))
    unit = forms.unit_of(d, force_sizes(d.curve, d.u), at.left[0], at.right[0], 5) / omega
    l2 = combined(lambda c: np.real(c) / omega, c2)
    form, words = described({"l2": (l2, unit)})
    return {**form, "omega": omega}, words


_L1 = "the first Lyapunov coefficient l1"
TESTS = (CurveTest("generalized_hopf", HOPF, lyapunov, coefficient=_L1, form=normal_form),)
