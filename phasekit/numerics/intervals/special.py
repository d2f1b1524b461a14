"""Bounds of special functions over intervals, by ball arithmetic and what is known of slopes.

A function whose slope is at most L in size differs over a stretch by no more than L times half of
it from its value in the middle: of Bessel functions that is less than balls tell. The slopes follow
from integrals ([DLMF2024] 10.9, 10.54) and from Nicholson's J^2 + Y^2, which falls (10.9.30).
"""

from __future__ import annotations

from collections.abc import Callable
from typing import TypeAlias

import numpy as np

from phasekit.arrays import Array, Flags
from phasekit.numerics.intervals.balls import Chain, chain
from phasekit.numerics.intervals.balls import enclose as enclose_anew

#: Bounds over intervals (low, high), and where the function may be undefined or have a pole.
Rule: TypeAlias = Callable[[Array, Array], tuple[Array, Array, Flags]]

_INF = np.inf
_BRANCH = -0.36787944117144233  # the double next to -1/e on the right


#: Intervals of each function whose bounds are kept: searches halve boxes of one grid, so that those
#: of many systems are the same.
_KEPT = 1 << 14
_bounds: dict[Chain, dict[tuple[float, float], tuple[float, float]]] = {}


def enclose(function: Chain, low: Array, high: Array) -> tuple[Array, Array]:
    """Bounds of a function over intervals; infinite where nothing is known."""
    least, most = np.full(low.shape, -_INF), np.full(low.shape, _INF)
    rows = np.flatnonzero(np.isfinite(low) & np.isfinite(high))
    known = _bounds.setdefault(function, {})
    pairs = list(zip(low[rows].tolist(), high[rows].tolist(), strict=True))
    fresh = [pair for pair in dict.fromkeys(pairs) if pair not in known]
    if len(known) + len(fresh) > _KEPT:
        known = _bounds[function] = {}
        fresh = list(dict.fromkeys(pairs))
    if fresh:
        found = enclose_anew(function, *np.array(fresh).T)
        known.update(zip(fresh, zip(*(end.tolist() for end in found), strict=True), strict=True))
    if pairs:
        least[rows], most[rows] = np.array([known[pair] for pair in pairs]).T
    return least, most


def _direct(function: Chain, least: float = -_INF, most: float = _INF) -> Rule:
    """As balls have it."""

    def rule(low: Array, high: Array) -> tuple[Array, Array, Flags]:
        a, b = enclose(function, low, high)
        unknown = ~(np.isfinite(a) & np.isfinite(b)) & np.isfinite(low) & np.isfinite(high)
        return np.maximum(a, least), np.minimum(b, most), unknown

    return rule


def _rising(
    function: Chain,
    domain: tuple[float, float] = (-_INF, _INF),
    image: tuple[float, float] = (-_INF, _INF),
    falls: bool = False,
    poles: Callable[[Array, Array], Flags] | None = None,
) -> Rule:
    """Of a function that rises, or falls, between its poles and nowhere else has a value."""

    def rule(low: Array, high: Array) -> tuple[Array, Array, Flags]:
        bad = (low < domain[0]) | (high > domain[1])
        if poles is not None:
            bad |= poles(low, high)
        places = np.clip(np.concatenate([low, high]), *domain)
        places[np.tile(bad, 2)] = np.nan
        least, most = enclose(function, places, places)
        n = low.size
        a, b = (least[n:], most[:n]) if falls else (least[:n], most[n:])
        return np.maximum(a, image[0]), np.minimum(b, image[1]), bad

    return rule


def _sloped(
    function: Chain, slope: Callable[[Array], Array], size: float = _INF, domain: float = -_INF
) -> Rule:
    """By the value in the middle and a bound of the slope, which takes the left end."""

    def rule(low: Array, high: Array) -> tuple[Array, Array, Flags]:
        bad = low <= domain
        start = np.where(bad, np.nan, low)
        middle = start + 0.5 * (high - start)
        half = np.maximum(middle - low, high - middle) * (1.0 + 2.0**-50)
        a, b = enclose(function, middle, middle)
        with np.errstate(invalid="ignore"):
            away = slope(start) * half * (1.0 + 2.0**-50)
            a, b = np.nextafter(a - away, -_INF), np.nextafter(b + away, _INF)
        a, b = np.where(np.isnan(a), -_INF, a), np.where(np.isnan(b), _INF, b)
        return np.maximum(a, -size), np.minimum(b, size), bad

    return rule


def _through_zero(low: Array, high: Array) -> Flags:
    return np.asarray((low <= 0.0) & (high >= 0.0))


def _pole(low: Array, high: Array) -> Flags:
    """Whether one of 0, -1, -2, ... is there."""
    return np.asarray((low <= 0.0) & (np.floor(high) >= np.ceil(low)))


def _ei(low: Array, high: Array) -> tuple[Array, Array, Flags]:
    """Ei falls to its pole at 0 and rises after it."""
    left = high < 0.0
    mirrored = np.where(left, high, low), np.where(left, low, high)
    bad = _through_zero(low, high)
    places = np.where(np.tile(bad, 2), np.nan, np.concatenate(mirrored))
    a, b = enclose(chain("Ei"), places, places)
    return a[: low.size], b[low.size :], bad


def _envelope(order: int, low: Array) -> Array:
    """J^2 + Y^2 falls: the size of both beyond a place."""
    sizes = (
        np.maximum(*np.abs(enclose(chain(name, order), low, low)))
        for name in ("besselj", "bessely")
    )
    return np.hypot(*sizes) * (1.0 + 2.0**-50)


def _slope_of_y(order: int) -> Callable[[Array], Array]:
    def slope(low: Array) -> Array:
        if order == 0:
            return _envelope(1, low)
        return _envelope(order - 1, low) + order / low * _envelope(order, low) * (1 + 2.0**-50)

    return slope


def _constant(slope: float) -> Callable[[Array], Array]:
    return lambda low: np.full(low.shape, slope)


def _polygamma(order: int) -> Rule:
    function = chain("polygamma", order)
    if order == 0:
        return _rising(function, poles=_pole)
    if order == 1:
        return _direct(function, least=0.0)
    # The odd ones are positive and fall, the others negative and rise, where x > 0.
    positive = order % 2 == 1
    image = (0.0, _INF) if positive else (-_INF, 0.0)
    return _rising(function, image=image, falls=positive, poles=lambda low, _: low <= 0.0)


RULES: dict[str, Rule] = {
    **{
        name: _direct(chain(name))
        for name in "Ci gamma loggamma airyai airyaiprime airybi airybiprime".split()
    },
    "Si": _direct(chain("Si"), -1.8520, 1.8520),
    "fresnels": _direct(chain("fresnels"), -1.0, 1.0),
    "fresnelc": _direct(chain("fresnelc"), -1.0, 1.0),
    "SphericalJ0": _direct(chain("SphericalJ0"), -1.0, 1.0),
    "SphericalJ1": _sloped(chain("SphericalJ1"), _constant(1.0 / 3.0), 0.5),
    "Ei": _ei,
    "erfi": _rising(chain("erfi")),
    "erfinv": _rising(chain("erfinv"), domain=(-1.0, 1.0)),
    "LambertW": _rising(chain("LambertW"), domain=(_BRANCH, _INF), image=(-1.0, _INF)),
}
#: Rules of functions of a whole order.
OF_AN_ORDER: dict[str, Callable[[int], Rule]] = {
    "besselj": lambda n: _sloped(chain("besselj", n), _constant(1.0), 1.0),
    "bessely": lambda n: _sloped(chain("bessely", n), _slope_of_y(n), domain=0.0),
    "besseli": lambda n: _direct(chain("besseli", n), 0.0 if n % 2 == 0 else -_INF),
    "besselk": lambda n: _rising(
        chain("besselk", n), image=(0.0, _INF), falls=True, poles=lambda low, _: low <= 0.0
    ),
    "polygamma": _polygamma,
}
