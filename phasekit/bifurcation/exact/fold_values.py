"""Folds and the change of sign of A along any parameter of any law, by exact arithmetic.

Where no closed form is known: with A, B and C polynomials of the parameter, or of the tangent of
half an angle, all roots of the discriminant that are not negative are isolated.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from fractions import Fraction

import numpy as np
import numpy.typing as npt
from flint import fmpq_poly

from phasekit.bifurcation.exact.critical import Critical
from phasekit.bifurcation.exact.line import Path
from phasekit.laws.trigonometric import Trigonometric
from phasekit.numerics.real_roots import rational, unit_roots

# Roots in (2^-OCTAVES, 1] are found to 2^-FINEST, which leaves 60 bits to each.
OCTAVES, FINEST = 20, 80


def fold_values(
    law: Trigonometric, parameter: str, values: Mapping[str, npt.ArrayLike]
) -> Critical:
    """Least positive values of a parameter at which equilibria merge, or A changes sign.

    The least fold with A < 0, the least with A > 0, and the least value where A = 0; NaN where
    there is none, inside the parameter's domain (angles up to pi/2), to rounding. Where B and C
    vanish for every value, equilibria merge where A changes sign.
    """
    names = [name for name in law.parameters if name != parameter]
    arrays = np.broadcast_arrays(*(np.asarray(values[name], float) for name in names), 0.0)
    shape = arrays[0].shape
    found = np.full((3, arrays[0].size), np.nan)
    for place, cell in enumerate(zip(*(array.ravel().tolist() for array in arrays), strict=True)):
        if all(map(math.isfinite, cell)):
            found[:, place] = _of_one(law, parameter, dict(zip(names, cell, strict=False)))
    minus, plus, sign_change = found.reshape(3, *shape)
    return minus, plus, sign_change


def _of_one(law: Trigonometric, parameter: str, values: dict[str, float]) -> list[float]:
    low, high = (max(0.0, end) for end in law.domains[parameter])
    if parameter in law.angles:
        high = min(high, math.pi / 2)
    span = (low, high) if parameter in law.angles else (0.0, 1.0)
    path = Path(law, values, parameter, span)
    A, B, C = path.products
    whole_A = A * path.common
    flat = not B and not C
    at_zero = [x for x in _non_negative_roots(whole_A) if _turns(whole_A, x)]
    folds: tuple[list[Fraction], list[Fraction]] = (at_zero, at_zero) if flat else ([], [])
    if not flat:
        for x in _non_negative_roots(path.discriminant):
            if sign := path.sign(A, x):
                folds[sign > 0].append(x)
    parameters = ([_parameter(path, x) for x in slot] for slot in (*folds, at_zero))
    return [min((x for x in slot if low <= x <= high), default=math.nan) for slot in parameters]


def _parameter(path: Path, x: Fraction) -> float:
    """The parameter at x in units of the span; of an angle NaN beyond it."""
    if path.parameter not in path.law.angles:
        return float(x)
    return path.along(x) if x <= 1 else math.nan


def _turns(polynomial: fmpq_poly, x: Fraction) -> bool:
    """Whether a polynomial has different signs on both sides of a root."""
    gap = Fraction(1, 1 << (FINEST // 2))
    step = gap * x if x else gap**20
    left, right = (polynomial(rational(place)) for place in (x - step, x + step))
    return (left < 0) != (right < 0)


def _non_negative_roots(polynomial: fmpq_poly) -> list[Fraction]:
    """All roots >= 0 of a polynomial in rising order, each to full relative precision."""
    if polynomial.degree() < 1:
        return []
    turned = fmpq_poly(polynomial.coeffs()[::-1])
    roots = _roots_to_one(polynomial) + [1 / x for x in _roots_to_one(turned) if x]
    return sorted(set(roots))


def _roots_to_one(power: fmpq_poly) -> list[Fraction]:
    """Roots in [0, 1], those near zero magnified before they are found."""
    roots = [] if power(0) else [Fraction(0)]
    while not power(0):
        power = power.right_shift(1)
    unit = Fraction(1)
    while power.degree() > 0:
        found = unit_roots(power, FINEST)
        near = Fraction(1, 1 << OCTAVES)
        roots += [x * unit for x in found if x > near]
        if not any(x <= near for x in found):
            break
        power = power(fmpq_poly([0, rational(near)]))
        unit *= near
    return roots
