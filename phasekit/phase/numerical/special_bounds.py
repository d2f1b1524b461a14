"""Bounds of special functions over stretches: of those that rise, and by bounds of their slopes.

A function whose slope is at most L in size differs over a stretch by no more than L times half of
it from its value in the middle. The bounds of slopes follow from integrals ([DLMF2024] 6.2, 7.2,
10.9, 10.54), from Nicholson's J^2 + Y^2, which falls (10.9.30), and from Ai'^2 - x Ai^2, which
changes by -Ai^2 (9.2.1).
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

import numpy as np
import numpy.typing as npt

from phasekit.phase.numerical.rounding import Flags, Interval, rising

Array = npt.NDArray[np.float64]
Rule = Callable[..., Interval]

#: By how many units SciPy's special functions may be off, of the value and of the argument.
_ULPS = 64.0
_EPS = float(np.finfo(float).eps)
#: Values that SciPy may return as 0, or with few digits.
_LEAST = 1e-150
#: Units by which exp(x^2) may be off, up to its overflow, where x^2 is rounded.
_OF_SQUARES = 512.0
#: Where gamma is least on the right half of the line.
_TURN = 1.4616321449683623
_INF = np.inf


def _special(name: str, *before: int) -> Callable[[Any], Any]:
    """A function of SciPy, of which only the places are given that rules look at."""

    def called(x: Any) -> Any:
        import scipy.special

        return getattr(scipy.special, name)(*before, x)

    return called


def _second(name: str, which: int) -> Callable[[Any], Any]:
    """One of the functions that SciPy computes together."""
    return lambda x: _special(name)(x)[which]


def _blurred(low: Any, high: Any, size: Any) -> Interval:
    blur = _ULPS * _EPS * (np.maximum(np.abs(low), np.abs(high)) + size) + _LEAST
    return low - blur, high + blur


def _even(value: Rule, odd: bool = False) -> Rule:
    """Turn a rule for x >= 0 into that of an even or odd function."""

    def rule(undefined: Flags, a: Interval) -> Interval:
        low, high = np.asarray(a[0]), np.asarray(a[1])
        right = value(undefined, (np.maximum(low, 0.0), np.maximum(high, 0.0)))
        left = value(undefined, (np.maximum(-high, 0.0), np.maximum(-low, 0.0)))
        if odd:
            left = (-left[1], -left[0])
        least = np.where(
            low >= 0, right[0], np.where(high <= 0, left[0], np.minimum(right[0], left[0]))
        )
        most = np.where(
            low >= 0, right[1], np.where(high <= 0, left[1], np.maximum(right[1], left[1]))
        )
        return least, most

    return rule


def _sloped(
    function: Callable[[Any], Any],
    slope: Callable[[Array, Array], Any],
    size: float = _INF,
    domain: float = -_INF,
) -> Rule:
    """Rule for a function with a bound of its slope over [low, high], and one of its size."""

    def rule(undefined: Flags, a: Interval) -> Interval:
        low, high = np.asarray(a[0], dtype=float), np.asarray(a[1], dtype=float)
        outside = low <= domain
        undefined |= outside
        middle = low + 0.5 * (high - low)
        half = np.maximum(middle - low, high - middle) * (1.0 + 4.0 * _EPS)
        value, steep = function(middle), slope(low, high) * (1.0 + _ULPS * _EPS)
        distance = np.abs(middle)
        # Powers of what is next to 0 are made of logarithms, which leave fewer digits.
        away = steep * (half + _ULPS * _EPS * np.where(distance < 1e-10, 8.0, 1.0) * distance)
        least, most = _blurred(value - away, value + away, 0.0)
        unknown = outside | np.isnan(least) | np.isnan(most)
        return (
            np.where(unknown, -size, np.maximum(least, -size)),
            np.where(unknown, size, np.minimum(most, size)),
        )

    return rule


def _constant(slope: float) -> Callable[[Array, Array], Any]:
    return lambda low, high: np.full(np.shape(low), slope)


def _monotone(
    function: Callable[[Any], Any], falls: bool, least: float = -_INF, most: float = _INF
) -> Rule:
    """Rule for a function that rises or falls where x > 0, and is not defined elsewhere."""

    def rule(undefined: Flags, a: Interval) -> Interval:
        low, high = np.asarray(a[0], dtype=float), np.asarray(a[1], dtype=float)
        outside = low <= 0.0
        undefined |= outside
        ends = function(np.where(outside, 1.0, low)), function(np.where(outside, 1.0, high))
        first, last = _blurred(*(ends[::-1] if falls else ends), 0.0)
        first, last = np.maximum(first, least), np.minimum(last, most)
        return np.where(outside, least, first), np.where(outside, most, last)

    return rule


def of_squares(function: Callable[[Any], Any], least: float = -_INF, most: float = _INF) -> Rule:
    """Rule for an error function that rises, made of exp(x^2) or exp(-x^2)."""

    def rule(_: Flags, a: Interval) -> Interval:
        low, high = function(a[0]), function(a[1])
        low = low - _OF_SQUARES * _EPS * np.abs(low) - _LEAST
        high = high + _OF_SQUARES * _EPS * np.abs(high) + _LEAST
        return np.maximum(low, least), np.minimum(high, most)

    return rule


def _convex(function: Callable[[Any], Any], bottom: float) -> Rule:
    """Rule for gamma and its logarithm: least at the same place where x > 0."""

    def rule(_: Flags, a: Interval) -> Interval:
        ends = function(a[0]), function(a[1])
        through = (a[0] <= _TURN + 1e-9) & (a[1] >= _TURN - 1e-9)
        least, most = _blurred(np.minimum(*ends), np.maximum(*ends), 1.0)
        return np.where(through, bottom, least), most

    return rule


def _reflected(right: Rule, left: Callable[[Interval, Interval, Array], Interval]) -> Rule:
    """Rule for a function with poles at 0, -1, -2, ...: from that for x > 0, and its reflection.

    `left` takes the bounds of sin(pi x) in size, those of the function at 1 - x, and the sign of
    sin(pi x).
    """

    def rule(undefined: Flags, a: Interval) -> Interval:
        low, high = np.asarray(a[0], dtype=float), np.asarray(a[1], dtype=float)
        floor = np.floor(low)
        pole = (low <= 0.0) & ((high >= floor + 1.0) | (low == floor))
        undefined |= pole
        mirrored = low <= 0.0
        one = np.where(mirrored, 1.0 - high, low), np.where(mirrored, 1.0 - low, high)
        part = right(undefined, (np.maximum(one[0], 5e-324), np.maximum(one[1], 5e-324)))
        # Distances from poles are differences of doubles: exact but for one rounding.
        near = (
            np.minimum(low - floor, 1.0 + floor - low),
            np.minimum(high - floor, 1 + floor - high),
        )
        sines = np.sin(np.pi * near[0]), np.sin(np.pi * near[1])
        least, most = _blurred(np.minimum(*sines), np.maximum(*sines), 0.0)
        most = np.where((low - floor <= 0.5) & (high - floor >= 0.5), 1.0, np.minimum(most, 1.0))
        sign = np.where(floor % 2.0 == 0.0, 1.0, -1.0)
        other = _blurred(*left((np.maximum(least, 0.0), most), part, sign), 1.0)
        return (
            np.where(pole, -_INF, np.where(mirrored, other[0], part[0])),
            np.where(pole, _INF, np.where(mirrored, other[1], part[1])),
        )

    return rule


def _gamma(sine: Interval, part: Interval, sign: Array) -> Interval:
    size = np.pi / (sine[1] * part[1]), np.pi / (sine[0] * part[0])
    return np.where(sign > 0.0, size[0], -size[1]), np.where(sign > 0.0, size[1], -size[0])


def _loggamma(sine: Interval, part: Interval, _: Array) -> Interval:
    return np.log(np.pi / sine[1]) - part[1], np.log(np.pi / sine[0]) - part[0]


def _trigamma(sine: Interval, part: Interval, _: Array) -> Interval:
    return (np.pi / sine[1]) ** 2 - part[1], (np.pi / sine[0]) ** 2 - part[0]


def _psi(x: Array) -> Any:
    """Digamma, by its reflection with the distance from the nearest pole where x < 0."""
    psi = _special("psi")
    near = np.where(x < 0.0, x - np.rint(x), 0.25)
    return np.where(x < 0.0, psi(1.0 - np.minimum(x, 0.0)) - np.pi / np.tan(np.pi * near), psi(x))


def _digamma(undefined: Flags, a: Interval) -> Interval:
    """It rises between its poles."""
    low, high = np.asarray(a[0], dtype=float), np.asarray(a[1], dtype=float)
    floor = np.floor(low)
    pole = (low <= 0.0) & ((high >= floor + 1.0) | (low == floor))
    undefined |= pole
    least, most = _blurred(_psi(low), _psi(high), 1.0)
    return np.where(pole, -_INF, least), np.where(pole, _INF, most)


def _airy_slope(square: float, change: float, right: Callable[[Any], Any]) -> Any:
    """Bound of the slope of an Airy function: of its square at 0, and its growth to the left."""

    def slope(low: Array, high: Array) -> Any:
        left = np.sqrt(square + change * np.maximum(-low, 0.0))
        return np.maximum(left, np.where(high > 0.0, np.abs(right(np.maximum(high, 0.0))), 0.0))

    return slope


def _ei(undefined: Flags, a: Interval) -> Interval:
    low, high = np.asarray(a[0], dtype=float), np.asarray(a[1], dtype=float)
    through = (low <= 0.0) & (high >= 0.0)
    undefined |= through
    ends = _special("expi")(low), _special("expi")(high)
    # Its zero is where x > 0.
    least, most = _blurred(np.minimum(*ends), np.maximum(*ends), np.where(low > 0.0, 1.0, 0.0))
    return np.where(through, -_INF, least), np.where(through, _INF, most)


def _lambertw(undefined: Flags, a: Interval) -> Interval:
    """It rises from -1, where its slope is infinite: w e^w is what rounding leaves of x."""
    branch = -np.exp(-1.0)
    undefined |= np.asarray(a[0]) < branch
    w = [np.real(_special("lambertw")(np.maximum(end, branch))) for end in a]
    blur = [
        _ULPS * _EPS * (np.abs(x) + 1.0 / np.maximum(1.0 + x, np.sqrt(_EPS))) + _LEAST for x in w
    ]
    return np.maximum(w[0] - blur[0], -1.0), w[1] + blur[1]


def _envelope(order: int, low: Array) -> Any:
    """J^2 + Y^2 falls: the size of both beyond a place."""
    return np.hypot(_special("jv", order)(low), _special("yv", order)(low))


def _bessely(order: int) -> Rule:
    def slope(low: Array, _: Array) -> Any:
        if order == 0:
            return _envelope(1, low)
        return _envelope(order - 1, low) + order / low * _envelope(order, low)

    return _sloped(_special("yv", order), slope, domain=0.0)


def _besseli(order: int) -> Rule:
    return _even(_from_zero(_special("iv", order)), odd=order % 2 == 1)


def _from_zero(function: Callable[[Any], Any]) -> Rule:
    def rule(_: Flags, a: Interval) -> Interval:
        low, high = _blurred(function(a[0]), function(a[1]), 0.0)
        return np.maximum(low, 0.0), high

    return rule


def _polygamma(order: int) -> Rule:
    if order == 0:
        return _digamma
    # The first is positive and falls, the second is negative and rises, and so on.
    falls = order % 2 == 1
    bounds = (0.0, _INF) if falls else (-_INF, 0.0)
    right = _monotone(_special("polygamma", order), falls, *bounds)
    return _reflected(right, _trigamma) if order == 1 else right


RULES: Mapping[str, Rule] = {
    "Si": _sloped(_second("sici", 0), _constant(1.0), 1.8520),
    "Ci": _sloped(_second("sici", 1), lambda low, _: 1.0 / low, domain=0.0),
    "Ei": _ei,
    "SphericalJ0": _sloped(_special("spherical_jn", 0), _constant(0.5), 1.0),
    "SphericalJ1": _sloped(_special("spherical_jn", 1), _constant(1.0 / 3.0), 0.5),
    "fresnels": _sloped(_second("fresnel", 0), _constant(1.0), 1.0),
    "fresnelc": _sloped(_second("fresnel", 1), _constant(1.0), 1.0),
    "gamma": _reflected(_convex(_special("gamma"), 0.8856031944108886), _gamma),
    "loggamma": _reflected(_convex(_special("gammaln"), -0.12148629053584962), _loggamma),
    "airyai": _sloped(_second("airy", 0), _airy_slope(0.068, 0.288, lambda x: 0.26 + 0 * x), 0.536),
    "airyaiprime": _sloped(
        _second("airy", 1), lambda low, high: 0.536 * np.maximum(np.abs(low), np.abs(high))
    ),
    "airybi": _sloped(_second("airy", 2), _airy_slope(0.202, 0.379, _second("airy", 3))),
    "airybiprime": _sloped(
        _second("airy", 3),
        lambda low, high: np.maximum(
            0.615 * np.abs(np.minimum(low, 0.0)), high * _second("airy", 2)(np.maximum(high, 0.0))
        ),
    ),
    "erfi": of_squares(_special("erfi")),
    "erfinv": rising(_special("erfinv"), domain=(-1.0, 1.0)),
    "LambertW": _lambertw,
}

#: Rules of functions of a whole order and one argument, by what makes them of the order >= 0.
OF_AN_ORDER: Mapping[str, Callable[[int], Rule]] = {
    "besselj": lambda n: _sloped(_special("jv", n), _constant(1.0), 1.0),
    "bessely": _bessely,
    "besseli": _besseli,
    "besselk": lambda n: _monotone(_special("kv", n), falls=True, least=0.0),
    "polygamma": _polygamma,
}
