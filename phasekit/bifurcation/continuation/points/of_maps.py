"""Points on curves of folds, flips and tori of maps: strong resonances, and where c or d is zero.

[Kuznetsov2004] chapter 9.
"""

from __future__ import annotations

import numpy as np

from phasekit.arrays import Array
from phasekit.bifurcation.continuation import normal_form as forms
from phasekit.bifurcation.continuation.curve import Curve
from phasekit.bifurcation.continuation.kernels.defining import FLIP, FOLD, TORUS
from phasekit.bifurcation.continuation.path import Sample
from phasekit.bifurcation.continuation.points import period_doubling
from phasekit.bifurcation.continuation.points import torus as of_torus
from phasekit.bifurcation.continuation.points.bogdanov_takens import chain, product
from phasekit.bifurcation.continuation.points.bogdanov_takens import normal_form as first_resonance
from phasekit.bifurcation.continuation.points.curve_test import CurveTest
from phasekit.bifurcation.continuation.reduction import (
    Critical,
    Reduction,
    combined,
    critical,
    described,
    fed,
)
from phasekit.bifurcation.continuation.units import force_sizes

MAPS = (True,)

#: What 2 - 2 cos theta of a pair of multipliers is where it is resonant.
RESONANT = {"resonance_1": 0.0, "resonance_2": 4.0, "resonance_3": 3.0, "resonance_4": 2.0}


def flip(curve: Curve, u: Array, slopes: Array) -> Array:
    """The coefficient c of period doublings."""
    found = [period_doubling.normal_form(forms.Derivatives(curve, point))["c"] for point in u]
    return np.array(found)


def torus(curve: Curve, u: Array, slopes: Array) -> Array:
    """The coefficient d of pairs on the unit circle, NaN of real ones and at strong resonances."""
    found = np.full(len(u), np.nan)
    k = u[:, curve.m + curve.n]
    off = np.min([np.abs(k - one) for one in RESONANT.values()], axis=0)
    for i in np.flatnonzero((k > 0.0) & (k < 4.0) & (off > of_torus.RESONANT)):
        angle = float(np.arccos(1.0 - 0.5 * k[i]))
        found[i] = of_torus.normal_form(forms.Derivatives(curve, u[i]), angle)["d"]
    return found


def away(curve: Curve, s: Sample) -> bool:
    """Whether a zero of d is none of its poles, next to a third of a turn."""
    return bool(abs(s.u[curve.m + curve.n] - RESONANT["resonance_3"]) > of_torus.RESONANT)


def _of_flip(d: forms.Derivatives) -> tuple[dict[str, float], str]:
    """Of xi -> -xi + c xi^3 + e xi^5 with c = 0."""
    at = critical(d, [-1.0], [(1,)], (2,))
    e = Reduction(d, at, 5).coefficient(0, (5,))
    return described({"e": (e, _unit(d, at, 0, 5))})


def _of_torus(d: forms.Derivatives) -> tuple[dict[str, float], str]:
    """Of |xi| -> |xi| + d |xi|^3 + e |xi|^5 with d = 0, and the angle of the multipliers."""
    mu = _pair(d)
    at = critical(d, [mu, np.conj(mu)], [(1,), (-1,)])
    it = Reduction(d, at, 5)
    e = combined(
        lambda c, d: np.real(d / mu) + 0.5 * np.imag(c / mu) ** 2,
        it.coefficient(0, (2, 1)), it.coefficient(0, (3, 2)),
    )  # fmt: skip
    form, words = described({"e": (e, _unit(d, at, 0, 5))}, it.resonance)
    return {**form, "angle": float(np.angle(mu))}, words


def _of_third(d: forms.Derivatives) -> tuple[dict[str, float], str]:
    """A = Re C1/|B1|^2 of the flow xi' = B1 xi*^2 + C1 xi |xi|^2 that three steps are.

    Of xi -> mu xi + B xi*^2 + C xi |xi|^2: B1 = 3 mu* B, C1 = 3 mu* C - 3 |B|^2.
    """
    mu = complex(np.exp(2j * np.pi / 3.0))
    at = critical(d, [mu, np.conj(mu)], [(1,), (-1,)], (3,))
    it = Reduction(d, at, 3)
    a = combined(
        lambda b, c: (np.real(3.0 * c / mu) - 3.0 * abs(b) ** 2) / (9.0 * abs(b) ** 2),
        it.coefficient(0, (0, 2)), it.coefficient(0, (2, 1)),
    )  # fmt: skip
    return described({"a": (a, 0.0)})


def _of_quarter(d: forms.Derivatives) -> tuple[dict[str, float], str]:
    """A = a + i b = C1/|D1| of the flow xi' = C1 xi |xi|^2 + D1 xi*^3 that four steps are."""
    at = critical(d, [1j, -1j], [(1,), (-1,)], (4,))
    it = Reduction(d, at, 3)
    given = it.coefficient(0, (2, 1)), it.coefficient(0, (0, 3))
    a = combined(lambda c, d: np.real(-1j * c / abs(d)), *given)
    b = combined(lambda c, d: np.imag(-1j * c / abs(d)), *given)
    return described({"a": (a, 0.0), "b": (b, 0.0)})


def _of_flips(d: forms.Derivatives) -> tuple[dict[str, float], str]:
    """Of w0 -> -w0 + w1, w1 -> -w1 + c w0^3 + d w0^2 w1.

    With h20 = (1 - A)^-1 B(q0, q0), h11 = (1 - A)^-1 (B(q0, q1) + h20),
    r = C(q0, q0, q0) + 3 B(q0, h20): c = <p1, r>/6 and
    d = <p1, C(q0, q0, q1) + 2 B(q0, h11) + B(q1, h20)>/2 + <p0, r>/2.
    """
    n = d.curve.n
    A = d.curve.linear(d.slopes)
    q0, q1, p0, p1 = chain(d, A + np.eye(n))
    back, none = np.linalg.inv(np.eye(n) - A), np.zeros(n)

    def solved(right: forms.Estimate) -> forms.Estimate:
        return forms.Estimate(back @ right.value, np.abs(back) @ np.abs(right.error))

    first, second = forms.Estimate(q0, none), forms.Estimate(q1, none)
    h20 = solved(d.form(q0, q0))
    h11 = solved(d.form(q0, q1) + h20)
    r = d.form(q0, q0, q0) + 3.0 * fed(d, first, h20)
    s = d.form(q0, q0, q1) + 2.0 * fed(d, first, h11) + fed(d, second, h20)
    unit = forms.unit_of(d, force_sizes(d.curve, d.u), p1, q0, 3)
    both = 0.5 * s.dot(p1) + 0.5 * r.dot(p0)
    return described({"c": ((1.0 / 6.0) * r.dot(p1), unit), "d": (both, unit)})


def _of_fold_flip(d: forms.Derivatives) -> tuple[dict[str, float], str]:
    """Of xi -> xi + a xi^2 + b eta^2, eta -> -eta + e xi eta."""
    at = critical(d, [1.0, -1.0], [(0,), (1,)], (2,))
    it = Reduction(d, at, 2)
    places = {"a": (0, (2, 0)), "b": (0, (0, 2)), "e": (1, (1, 1))}
    return described(
        {name: (it.coefficient(*one), _unit(d, at, one[0], 2)) for name, one in places.items()}
    )


def _pair(d: forms.Derivatives) -> complex:
    """The multiplier of the upper half plane next to the unit circle, brought onto it."""
    scale = d.curve.scale[: d.curve.n]
    values = np.linalg.eigvals(d.curve.linear(d.slopes) * scale / scale[:, None])
    above = values[values.imag > 0.0]
    mu = complex(above[np.argmin(np.abs(np.abs(above) - 1.0))])
    return mu / abs(mu)


def _unit(d: forms.Derivatives, at: Critical, j: int, order: int) -> float:
    return forms.unit_of(d, force_sizes(d.curve, d.u), at.left[j], at.right[j], order)


_FORMS = {
    "resonance_1": first_resonance,
    "resonance_2": _of_flips,
    "resonance_3": _of_third,
    "resonance_4": _of_quarter,
}


def _resonance(kind: str, k: float) -> CurveTest:
    def off(curve: Curve, u: Array, slopes: Array) -> Array:
        """How far k of the pair is from its resonant value."""
        return np.asarray(u[:, curve.m + curve.n] - k)

    return CurveTest(kind, TORUS, off, of=MAPS, form=_FORMS[kind])


def _together(along: int, shift: float) -> CurveTest:
    def rest(curve: Curve, u: Array, slopes: Array) -> Array:
        """The product of mu - 1 + shift of all multipliers."""
        return np.asarray(np.linalg.det(slopes[:, :, : curve.n] + shift * np.eye(curve.n)))

    return CurveTest("fold_flip", along, rest, 2, of=MAPS, form=_of_fold_flip)


_C, _D = "the coefficient c", "the coefficient d"
TESTS = (
    CurveTest("resonance_1", FOLD, product, 2, of=MAPS, form=first_resonance),
    CurveTest("resonance_2", FLIP, product, 2, of=MAPS, form=_of_flips),
    *(_resonance(kind, k) for kind, k in RESONANT.items()),
    _together(FOLD, 2.0),
    _together(FLIP, 0.0),
    CurveTest("generalized_flip", FLIP, flip, of=MAPS, coefficient=_C, form=_of_flip),
    CurveTest("chenciner", TORUS, torus, holds=away, of=MAPS, coefficient=_D, form=_of_torus),
)
