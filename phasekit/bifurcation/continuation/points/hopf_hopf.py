"""Hopf-Hopf points: a second pair of eigenvalues on the imaginary axis."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from phasekit.arrays import Array
from phasekit.bifurcation.continuation import normal_form as forms
from phasekit.bifurcation.continuation.curve import Curve
from phasekit.bifurcation.continuation.kernels.defining import HOPF
from phasekit.bifurcation.continuation.path import Sample
from phasekit.bifurcation.continuation.points.curve_test import CurveTest
from phasekit.bifurcation.continuation.reduction import (
    Reduction,
    combined,
    critical,
    described,
    frequencies,
)
from phasekit.bifurcation.continuation.spectrum import eigenvalues_of, pair_function
from phasekit.bifurcation.continuation.units import force_sizes


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


def normal_form(d: forms.Derivatives) -> tuple[dict[str, float], str]:
    """Of r1' = r1 (p11 r1^2 + p12 r2^2), r2' = r2 (p21 r1^2 + p22 r2^2) ([Kuznetsov2004] 8.6).

    r1 is the size of the pair with the larger frequency; theta = p12/p22, delta = p21/p11.
    """
    one, two = frequencies(d, 2)
    values = [1j * one, -1j * one, 1j * two, -1j * two]
    at = critical(d, values, [(1, 0), (-1, 0), (0, 1), (0, -1)])
    it = Reduction(d, at, 3)
    p = {
        "p11": it.coefficient(0, (2, 1, 0, 0)), "p12": it.coefficient(0, (1, 0, 1, 1)),
        "p21": it.coefficient(2, (1, 1, 1, 0)), "p22": it.coefficient(2, (0, 0, 2, 1)),
    }  # fmt: skip
    rows = force_sizes(d.curve, d.u)
    sizes = [forms.unit_of(d, rows, at.left[j], at.right[j], 3) for j in (0, 0, 2, 2)]
    found = dict(zip(p, zip(p.values(), sizes, strict=True), strict=True))
    for name, over, under in (("theta", "p12", "p22"), ("delta", "p21", "p11")):
        ratio = combined(lambda x, y: np.real(x) / np.real(y), p[over], p[under])
        found[name] = ratio, 0.0
    form, words = described(found, it.resonance)
    return {**form, "omega1": one, "omega2": two}, words


TESTS = (CurveTest("hopf_hopf", HOPF, others, 4, other_pair, form=normal_form),)
