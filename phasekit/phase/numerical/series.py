"""Equilibria of polynomials and Fourier sums, proved from the roots of a companion matrix.

Smith's discs about approximate roots hold all roots of a polynomial, and one that touches no other
holds exactly one [Smith1970]. Roots that are not real come in pairs, mirrored at the axis (on the
circle: at the unit circle), so a root alone in a disc about a real number is real.

Where discs touch, a polynomial whose coefficients are rational is isolated in exact arithmetic.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from fractions import Fraction
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt
from flint import fmpq_poly

from phasekit.arrays import Array, Complex, Flags
from phasekit.numerics.real_roots import nearest_roots, rational
from phasekit.phase.numerical.coefficients import slope_coefficients, spreads
from phasekit.phase.numerical.formula import Formula
from phasekit.phase.numerical.systems import Systems

_EPS = float(np.finfo(float).eps)


class Roots(NamedTuple):
    """Zeros of V' of some systems, rising, NaN beyond those that there are."""

    phi: Array
    sign: Array
    """Sign of V''; 0 where it vanishes."""
    radius: Array
    """How far the zero may be from where it was found."""
    clear: Flags
    """Whether that is proved."""
    exact: dict[int, list[Fraction]]
    """Coefficients of V' of those rows whose roots are known to the last digit."""


def companion_roots(coefficients: npt.NDArray[Any]) -> Complex:
    """Roots of polynomials whose highest coefficient, the last, is not 0."""
    degree = coefficients.shape[1] - 1
    matrix = np.zeros((len(coefficients), degree, degree), dtype=coefficients.dtype)
    matrix[:, np.arange(1, degree), np.arange(degree - 1)] = 1.0
    matrix[:, :, -1] = -coefficients[:, :-1] / coefficients[:, -1:]
    matrix = np.where(np.isfinite(matrix).all(axis=(1, 2), keepdims=True), matrix, 0.0)
    return np.asarray(np.linalg.eigvals(matrix), dtype=complex)


def degrees(coefficients: npt.NDArray[Any]) -> npt.NDArray[np.intp]:
    """Degree of each polynomial, lowest coefficient first."""
    powers = np.arange(coefficients.shape[1])
    return np.asarray(np.max(np.where(coefficients != 0.0, powers, 0), axis=1, initial=0))


def discs(coefficients: npt.NDArray[Any], spread: Array) -> tuple[Complex, Array, Flags]:
    """Roots of polynomials of full degree, radii of Smith's discs, and whether none touch.

    Nor may they touch where rounding on the way has moved coefficients by `spread`.
    """
    z = companion_roots(coefficients)
    n = z.shape[1]
    with np.errstate(all="ignore"):
        value = np.zeros(z.shape, dtype=complex)
        size, moved = np.zeros((2, *z.shape))
        for k in range(n, -1, -1):
            value = value * z + coefficients[:, k, None]
            size = size * np.abs(z) + np.abs(coefficients[:, k, None])
            moved = moved * np.abs(z) + spread[:, k, None]
        # Coefficients, products and sums are rounded.
        most = np.abs(value) + 8.0 * (n + 3) * _EPS * size
        apart = np.abs(z[:, :, None] - z[:, None, :])
        apart[:, np.arange(n), np.arange(n)] = 1.0
        product = np.abs(coefficients[:, n, None]) * np.prod(apart, axis=2)
        radius, wide = (1.01 * n * size / product for size in (most, most + moved))
        apart[:, np.arange(n), np.arange(n)] = np.inf
        # Twice the radii, so that mirrored discs keep apart as well.
        separate = apart > 2.0 * (wide[:, :, None] + wide[:, None, :])
        clear = separate.all(axis=(1, 2)) & np.isfinite(wide).all(axis=1)
    return z, radius, np.asarray(clear)


def of_polynomials(systems: Systems) -> Roots:
    """Zeros on the whole line, where discs or exact arithmetic prove them."""
    coefficients = np.asarray(systems.coefficients(), dtype=float)
    width = max(coefficients.shape[1] - 1, 1)
    found = _none(systems.size, width)
    finite = np.isfinite(coefficients).all(axis=1)
    degree = np.where(finite, degrees(coefficients), 0)
    spread = spreads(systems, coefficients)
    known = _of_known_degree(coefficients, spread, degree)
    found.clear[(degree == 0) & known] = True
    for n in np.unique(degree[degree > 0]):
        rows = np.flatnonzero(degree == n)
        z, radius, clear = discs(coefficients[rows, : n + 1], spread[rows, : n + 1])
        clear &= known[rows]
        real = (z.imag == 0.0) & clear[:, None]
        leading = np.sign(coefficients[rows, n])
        _enter(found, rows, z.real, radius, real, leading, clear)
    for row in np.flatnonzero(~found.clear & finite):
        exact = exact_coefficients(
            systems.formula, tuple(float(p[row]) for p in systems.parameters)
        )
        if exact is not None:
            phi, sign = exact_roots(exact)
            for field, values in ((found.phi, phi), (found.sign, sign), (found.radius, 0.0 * phi)):
                field[row] = np.nan
                field[row, : phi.size] = values
            found.clear[row], found.exact[int(row)] = True, exact
    return found


def of_fourier_sums(systems: Systems) -> Roots:
    """Zeros in (-period/2, period/2], where discs prove them."""
    period = systems.formula.period
    assert period is not None
    coefficients = np.asarray(systems.coefficients(), dtype=complex)
    found = _none(systems.size, max(2 * coefficients.shape[1] - 2, 1))
    finite = np.isfinite(coefficients).all(axis=1)
    degree = np.where(finite, degrees(coefficients), 0)
    spread = spreads(systems, coefficients)
    known = _of_known_degree(coefficients, spread, degree)
    found.clear[(degree == 0) & finite & known] = True
    for n in np.unique(degree[degree > 0]):
        rows = np.flatnonzero(degree == n)
        upper, off = coefficients[rows, : n + 1], spread[rows, : n + 1]
        whole = np.concatenate([np.conj(upper[:, :0:-1]), upper.real[:, :1], upper[:, 1:]], axis=1)
        z, radius, clear = discs(whole, np.concatenate([off[:, :0:-1], off], axis=1))
        clear &= known[rows]
        on_circle = np.abs(np.abs(z) - 1.0) <= radius
        clear &= np.all(np.where(on_circle, radius, 0.0) < 0.1, axis=1)
        angle = np.angle(z) * (period / (2.0 * np.pi))
        slack = 2.0 * radius * (period / (2.0 * np.pi))
        found.clear[rows] = clear
        order = np.argsort(np.where(on_circle, angle, np.nan), axis=1)
        angle, slack = (np.take_along_axis(a, order, axis=1) for a in (angle, slack))
        there = np.take_along_axis(on_circle & clear[:, None], order, axis=1)
        # Between neighboring zeros V' has one sign.
        following = np.take_along_axis(angle, _next(there), axis=1)
        following = np.where(following <= angle, following + period, following)
        after = np.sign(systems.take(rows).slope(0.5 * (angle + following)))
        for field, values in ((found.phi, angle), (found.sign, after), (found.radius, slack)):
            field[rows[:, None], np.arange(2 * n)] = np.where(there, values, np.nan)
    return found


def _of_known_degree(coefficients: npt.NDArray[Any], spread: Array, degree: Any) -> Flags:
    """Whether rounding of coefficients cannot have changed the degree."""
    beyond = np.arange(coefficients.shape[1]) >= np.maximum(degree, 1)[:, None]
    return np.asarray(~np.any(beyond & (spread > 0.25 * np.abs(coefficients)), axis=1))


def _next(there: Flags) -> npt.NDArray[np.intp]:
    """Column of the zero after each; those that there are stand first."""
    count = np.maximum(there.sum(axis=1, keepdims=True), 1)
    return np.asarray((np.arange(there.shape[1]) + 1) % count)


def _none(rows: int, columns: int) -> Roots:
    phi, sign, radius = np.full((3, rows, columns), np.nan)
    return Roots(phi, sign, radius, np.zeros(rows, dtype=bool), {})


def _enter(
    found: Roots, rows: Any, place: Array, radius: Array, real: Flags, leading: Array, clear: Flags
) -> None:
    """Write down real roots; V' passes 0 upward at the last if its leading power does."""
    order = np.argsort(np.where(real, place, np.nan), axis=1)
    place, radius = (np.take_along_axis(a, order, axis=1) for a in (place, radius))
    real = np.take_along_axis(real, order, axis=1)
    behind = real.sum(axis=1, keepdims=True) - 1 - np.arange(real.shape[1])
    sign = leading[:, None] * np.where(behind % 2 == 0, 1.0, -1.0)
    columns = np.arange(real.shape[1])
    for field, values in ((found.phi, place), (found.sign, sign), (found.radius, radius)):
        field[rows[:, None], columns] = np.where(real, values, np.nan)
    found.clear[rows] = clear


# ------------------------------------------------------------------------- exact arithmetic


def _fraction(value: float) -> Any:
    import sympy as sp

    return sp.Rational(*value.as_integer_ratio())


def exact_coefficients(formula: Formula, parameters: tuple[float, ...]) -> list[Fraction] | None:
    """Coefficients of V' for the doubles that parameters are; None where they are irrational."""
    import sympy as sp

    symbolic = slope_coefficients(formula)
    if symbolic is None:
        return None
    values = {
        sp.Symbol(name, real=True): _fraction(value)
        for name, value in zip(formula.names, parameters, strict=True)
    }
    numbers = [coefficient.xreplace(values) for coefficient in symbolic]
    if not all(n.is_Rational for n in numbers):
        return None
    return [Fraction(int(n.p), int(n.q)) for n in numbers]


def exact_roots(coefficients: list[Fraction]) -> tuple[Array, Array]:
    """Real roots as the nearest doubles, and the signs of the derivative there, 0 if multiple."""
    polynomial = fmpq_poly([rational(c) for c in coefficients])
    if polynomial.degree() < 1:
        return np.empty(0), np.empty(0)
    found = nearest_roots(polynomial)
    sign = 1.0 if polynomial.leading_coefficient() > 0 else -1.0
    signs = []
    for _, times in reversed(found):
        signs.append(sign if times == 1 else 0.0)
        sign = -sign if times % 2 else sign
    return np.array([at for at, _ in found]), np.array(signs[::-1])


def exact_base(formula: Formula, parameters: tuple[float, ...]) -> Fraction:
    """V(0) of a polynomial; to 60 digits if it is irrational."""
    import sympy as sp

    values = {
        sp.Symbol(name, real=True): _fraction(value)
        for name, value in zip(
            (formula.coordinate, *formula.names), (0.0, *parameters), strict=True
        )
    }
    base = formula.expression.xreplace(values)
    base = base if base.is_Rational else sp.Rational(base.evalf(60))
    return Fraction(int(base.p), int(base.q))


def exact_heights(base: Fraction, coefficients: list[Fraction], x: Array) -> tuple[Array, Array]:
    """V and V'' of V(0) and exact coefficients of V', rounded once."""
    height = [base, *(c / (k + 1) for k, c in enumerate(coefficients))]
    bend = [k * c for k, c in enumerate(coefficients)][1:] or [Fraction(0)]

    def evaluator(numbers: list[Any]) -> Callable[[float], float]:
        def value(place: float) -> float:
            total: Any = Fraction(0)
            for c in reversed(numbers):
                total = total * Fraction(place) + c
            try:
                return float(total)
            except OverflowError:
                return math.inf if total > 0 else -math.inf

        return value

    return np.array([evaluator(height)(p) for p in x]), np.array([evaluator(bend)(p) for p in x])
