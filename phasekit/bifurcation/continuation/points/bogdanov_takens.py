"""Bogdanov-Takens points: a double eigenvalue zero, along curves of folds and Hopf points."""

from __future__ import annotations

import numpy as np

from phasekit.arrays import Array
from phasekit.bifurcation.continuation import normal_form as forms
from phasekit.bifurcation.continuation.curve import Curve
from phasekit.bifurcation.continuation.kernels.defining import FOLD, HOPF
from phasekit.bifurcation.continuation.normal_form import left_and_right
from phasekit.bifurcation.continuation.points.curve_test import CurveTest
from phasekit.bifurcation.continuation.reduction import described
from phasekit.bifurcation.continuation.units import force_sizes


def product(curve: Curve, u: Array, slopes: Array) -> Array:
    """The product of both null vectors, zero where the eigenvalue is double."""
    p, v = left_and_right(curve, u, slopes)
    return np.asarray(np.sum(p * v * curve.scale[: curve.n], axis=1))


def square(curve: Curve, u: Array, slopes: Array) -> Array:
    """The square of the frequency, negative where the pair is real."""
    return np.asarray(u[:, curve.m + curve.n])


def chain(d: forms.Derivatives, A: Array) -> tuple[Array, Array, Array, Array]:
    """Vectors q0, q1, p0, p1 of a double eigenvalue 0 of a matrix.

    A q0 = 0, A q1 = q0, A^T p1 = 0, A^T p0 = p1, with |q0| = 1, its largest entry positive,
    q0 q1 = 0, p0 q0 = p1 q1 = 1 and p0 q1 = 0.
    """
    scale, rows = d.curve.scale[: d.curve.n], force_sizes(d.curve, d.u)
    q0, p1 = forms.null_vectors(A, scale, rows)
    q1 = forms.solve_off(A, q0, q0, p1)
    p1 = p1 / float(p1 @ q1)
    p0 = forms.solve_off(A.T, p1, p1, q0)
    p0 = p0 / float(p0 @ q0)
    return q0, q1, p0 - float(p0 @ q1) * p1, p1


def normal_form(d: forms.Derivatives) -> tuple[dict[str, float], str]:
    """Of w0' = w1, w1' = a w0^2 + b w0 w1, of maps what w0 and w1 grow by ([Kuznetsov2004] 8.4).

    a = <p1, B(q0, q0)>/2, b = <p1, B(q0, q1)> + <p0, B(q0, q0)>.
    """
    q0, q1, p0, p1 = chain(d, d.slopes[:, : d.curve.n])
    rows = force_sizes(d.curve, d.u)
    bent = d.second(q0, q0)
    a = 0.5 * bent.dot(p1)
    b = d.second(q0, q1).dot(p1) + bent.dot(p0)
    unit = forms.unit_of(d, rows, p1, q0, 2)
    return described({"a": (a, unit), "b": (b, forms.unit_of(d, rows, p0, q0, 2) + unit)})


TESTS = (
    CurveTest("bogdanov_takens", FOLD, product, 2, form=normal_form),
    CurveTest("bogdanov_takens", HOPF, square, form=normal_form),
)
