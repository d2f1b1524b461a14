"""Normal forms of phi'' = -V'(phi) at degenerate equilibria, in closed form.

With x = phi - phi* and mu = p - p* the equation is, to leading order,

- at a fold ``x'' = u mu + q x^2``,
- at a pitchfork ``x'' = u mu x + k x^3``,
- at a cusp ``x'' = u mu + k x^3`` along a path through it,

with q = -V'''/2, k = -V''''/6, and u = -dV'/dp (fold, cusp) or -dV''/dp (pitchfork), at the point.
x is the angle itself, in radians, so q and k are in s^-2. ([Kuznetsov2004] sections 3.3, 7.4 and
8.2 give the reductions.)
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

import numpy as np
import numpy.typing as npt

from phasekit.arrays import Array
from phasekit.bifurcation.curves import NormalForm
from phasekit.laws.trigonometric import Trigonometric

#: Imaginary step: derivatives are exact to rounding for every size of it.
STEP = 1e-30


def fold_angle(A: npt.ArrayLike, B: npt.ArrayLike, C: npt.ArrayLike) -> Array:
    """Angle of the merged pair on the fold: A cos^3 phi = B, A sin^3 phi = -C."""
    A, B, C = (np.asarray(x, dtype=float) for x in (A, B, C))
    # The negative of a zero C would turn pi into -pi.
    sine = np.where(C == 0.0, 0.0, -np.sign(A) * np.cbrt(C))
    return np.asarray(np.arctan2(sine, np.sign(A) * np.cbrt(B)))


def quadratic_coefficient(A: npt.ArrayLike, phi: npt.ArrayLike) -> Array:
    """Coefficient -V'''/2 = -(3/2) A sin phi cos phi on the fold, 1/s^2; 0 at its cusps."""
    phi = np.asarray(phi, dtype=float)
    return np.asarray(-1.5 * np.asarray(A, dtype=float) * np.sin(phi) * np.cos(phi))


def cubic_coefficient(A: npt.ArrayLike, phi: npt.ArrayLike) -> Array:
    """Coefficient -V''''/6 = -(1/2) A cos 2 phi where V'' = 0, 1/s^2.

    At the cusps, where phi is a multiple of pi/2, it is -A/2 or A/2.
    """
    # V'''' = 4 A cos 2 phi - (B cos phi + C sin phi), where the bracket is A cos 2 phi.
    return np.asarray(-0.5 * np.asarray(A, dtype=float) * np.cos(2.0 * np.asarray(phi)))


def normal_form(
    law: Trigonometric, values: Mapping[str, float], parameter: str, phi: float, kind: str
) -> NormalForm:
    """Coefficients of the normal form at a special point of a path."""
    A, B, C, N = law(values)
    moved = law({**values, parameter: complex(values[parameter], STEP)})
    # V' and V'' vanish at the point, so that N counts as a constant.
    dA, dB, dC = (complex(x).imag / STEP / N for x in moved[:3])
    sin, cos = math.sin(phi), math.cos(phi)
    if kind == "pitchfork":
        unfolding = -(dB * cos - dA * math.cos(2.0 * phi) + dC * sin)
    else:
        unfolding = -(dB * sin - dA * sin * cos - dC * cos)
    quadratic: Any = quadratic_coefficient(A / N, phi) if kind == "fold" else 0.0
    cubic: Any = math.nan if kind == "fold" else cubic_coefficient(A / N, phi)
    return NormalForm(float(unfolding), float(quadratic), float(cubic))
