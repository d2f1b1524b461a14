"""Cusps: the quadratic coefficient along a curve of folds is zero."""

from __future__ import annotations

import numpy as np

from phasekit.arrays import Array
from phasekit.bifurcation.continuation import normal_form as forms
from phasekit.bifurcation.continuation.curve import Curve
from phasekit.bifurcation.continuation.kernels.defining import FOLD
from phasekit.bifurcation.continuation.normal_form import left_and_right
from phasekit.bifurcation.continuation.points.curve_test import CurveTest
from phasekit.bifurcation.continuation.reduction import Reduction, critical, described
from phasekit.bifurcation.continuation.units import force_sizes


def quadratic(curve: Curve, u: Array, slopes: Array) -> Array:
    """The quadratic coefficient of the fold."""
    n, m = curve.n, curve.m
    p, _ = left_and_right(curve, u, slopes)
    v = u[:, m : m + n]
    z = np.zeros((len(u), m))
    z[:, :n] = v
    bent = curve.bend_all(u, z)[:, :, :n]
    return np.asarray(np.einsum("ki,kij,kj->k", p, bent, v))


def normal_form(d: forms.Derivatives) -> tuple[dict[str, float], str]:
    """Of xi' = c xi^3, of maps xi -> xi + c xi^3, with |q| = 1 ([Kuznetsov2004] 8.2, 9.2)."""
    at = critical(d, [1.0 if d.curve.discrete else 0.0], [(0,)])
    c = Reduction(d, at, 3).coefficient(0, (3,))
    rows = force_sizes(d.curve, d.u)
    return described({"c": (c, forms.unit_of(d, rows, at.left[0], at.right[0], 3))})


TESTS = (CurveTest("cusp", FOLD, quadratic, of=(False, True), form=normal_form),)
