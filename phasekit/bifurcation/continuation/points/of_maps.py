"""Points on curves of folds, flips and tori of maps: strong resonances, and where c or d is zero.

[Kuznetsov2004] chapter 9.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from phasekit.bifurcation.continuation import normal_form as forms
from phasekit.bifurcation.continuation.curve import Curve
from phasekit.bifurcation.continuation.kernels.defining import FLIP, FOLD, TORUS
from phasekit.bifurcation.continuation.path import Sample
from phasekit.bifurcation.continuation.points import period_doubling
from phasekit.bifurcation.continuation.points import torus as of_torus
from phasekit.bifurcation.continuation.points.bogdanov_takens import product
from phasekit.bifurcation.continuation.points.curve_test import CurveTest

Array = npt.NDArray[np.float64]

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


def _resonance(kind: str, k: float) -> CurveTest:
    def off(curve: Curve, u: Array, slopes: Array) -> Array:
        """How far k of the pair is from its resonant value."""
        return np.asarray(u[:, curve.m + curve.n] - k)

    return CurveTest(kind, TORUS, off, of=MAPS)


def _together(along: int, shift: float) -> CurveTest:
    def rest(curve: Curve, u: Array, slopes: Array) -> Array:
        """The product of mu - 1 + shift of all multipliers."""
        return np.asarray(np.linalg.det(slopes[:, :, : curve.n] + shift * np.eye(curve.n)))

    return CurveTest("fold_flip", along, rest, 2, of=MAPS)


TESTS = (
    CurveTest("resonance_1", FOLD, product, 2, of=MAPS),
    CurveTest("resonance_2", FLIP, product, 2, of=MAPS),
    *(_resonance(kind, k) for kind, k in RESONANT.items()),
    _together(FOLD, 2.0),
    _together(FLIP, 0.0),
    CurveTest("generalized_flip", FLIP, flip, of=MAPS, coefficient="the coefficient c"),
    CurveTest("chenciner", TORUS, torus, holds=away, of=MAPS, coefficient="the coefficient d"),
)
