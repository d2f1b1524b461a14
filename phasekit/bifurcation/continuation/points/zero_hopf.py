"""Zero-Hopf points: an eigenvalue zero beside a pair on the imaginary axis."""

from __future__ import annotations

from typing import Any

import numpy as np

from phasekit.arrays import Array
from phasekit.bifurcation.continuation import normal_form as forms
from phasekit.bifurcation.continuation.curve import Curve
from phasekit.bifurcation.continuation.kernels.defining import FOLD, HOPF
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

SMALL = 1e-11  # size of a coefficient that is zero, in units of f and of the states


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


def normal_form(d: forms.Derivatives) -> tuple[dict[str, float], str]:
    """Of xi' = b xi^2 + c |w|^2, w' = i omega w + d xi w + e xi^2 w ([Kuznetsov2004] 8.5).

    d and e are real parts, e of the form whose other cubic terms time and coordinates have
    removed; theta = d/b.
    """
    (omega,) = frequencies(d, 1)
    at = critical(d, [0.0, 1j * omega, -1j * omega], [(0,), (1,), (-1,)])
    it = Reduction(d, at, 3)
    rows = force_sizes(d.curve, d.u)
    b, c = it.coefficient(0, (2, 0, 0)), it.coefficient(0, (0, 1, 1))
    turned = it.coefficient(1, (1, 1, 0))
    cubic = [it.coefficient(0, (3, 0, 0)), it.coefficient(0, (1, 1, 1))]
    cubic += [it.coefficient(1, (2, 1, 0)), it.coefficient(1, (0, 2, 1))]

    def e(
        b: complex, c: complex, g: complex, x: complex, y: complex, z: complex, w: complex
    ) -> Any:
        inner = 2.0 * np.real(w) / c - 3.0 * x / b + y / c
        return np.real(z + 0.5 * g * inner - w * b / c)

    zero, pair = (forms.unit_of(d, rows, at.left[j], at.right[j], 2) for j in (0, 1))
    found = {
        "b": (b, zero), "c": (c, zero), "d": (turned, pair),
        "e": (combined(e, b, c, turned, *cubic), 0.0),
        "theta": (combined(lambda g, b: np.real(g) / b, turned, b), 0.0),
    }  # fmt: skip
    nothing = [name for name in ("b", "c") if abs(found[name][0].value) <= SMALL * zero]
    because = f"{' and '.join(nothing)} of the normal form vanish" if nothing else ""
    form, words = described(found, because)
    return {**form, "omega": omega}, words


TESTS = (
    CurveTest("zero_hopf", FOLD, rest, 3, conjugate, form=normal_form),
    CurveTest("zero_hopf", HOPF, determinant, 3, imaginary, form=normal_form),
)
