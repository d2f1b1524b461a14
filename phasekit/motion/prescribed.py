"""A prescribed function of time as pieces of Chebyshev series, for compiled code."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import numpy.typing as npt
from numpy.polynomial import chebyshev

from phasekit.arrays import Array
from phasekit.errors import ParameterError

#: Coefficients of a piece, the error relative to the greatest value that is allowed, and the
#: shortest piece, as a part of the whole.
TERMS, TOLERANCE, SHORTEST = 24, 1e-13, 2.0**-40
#: Most pieces.
PIECES = 20_000
#: Degree of the spline through a table.
DEGREE = 5


def span(times: npt.ArrayLike) -> tuple[float, float]:
    """First and last of the times that a motion from t = 0 to all finite ones comes to."""
    finite = np.nan_to_num(np.asarray(times, dtype=float), nan=0.0, posinf=0.0, neginf=0.0)
    return float(finite.min(initial=0.0)), float(finite.max(initial=0.0))


def table_of(prescribed: Any, start: float, stop: float) -> Array:
    """Pieces of a function or table of time between two times.

    Rows: start, half-width, number of coefficients, coefficients. No rows for None. Through a table
    goes a spline of the fifth degree, which has four continuous derivatives.
    """
    if prescribed is None:
        return np.zeros((0, 3))
    if not callable(prescribed):
        times, values = prescribed
        return _of_table(times, values, start, stop)
    return _of_function(prescribed, start, stop if stop > start else start + 1.0)


def _of_table(times: Array, values: Array, start: float, stop: float) -> Array:
    from scipy.interpolate import PPoly, make_interp_spline

    if start < times[0] or stop > times[-1]:
        raise ParameterError(
            f"omega1: got a table from {times[0]:g} s to {times[-1]:g} s, wants one that reaches "
            f"over all times of the motion, {start:g} s to {stop:g} s"
        )
    degree = min(DEGREE, len(times) - 1)
    pieces = PPoly.from_spline(make_interp_spline(times, values, k=degree))
    rows = []
    for low, high, powers in zip(pieces.x[:-1], pieces.x[1:], pieces.c.T, strict=True):
        if high > low:
            half = 0.5 * (high - low)
            inner = np.polynomial.Polynomial(powers[::-1])(np.polynomial.Polynomial([half, half]))
            series = np.zeros(degree + 1)
            found = chebyshev.poly2cheb(inner.coef)
            series[: len(found)] = found
            rows.append([low, half, len(series), *series])
    return np.array(rows)


def _of_function(function: Callable[[float], float], start: float, stop: float) -> Array:
    nodes = chebyshev.chebpts1(TERMS)
    back = np.linalg.inv(chebyshev.chebvander(nodes, TERMS - 1))
    waiting, rows, scale = [(start, stop)], [], 0.0
    while waiting:
        low, high = waiting.pop()
        half = 0.5 * (high - low)
        values = np.array([_value(function, low + half * (1.0 + s)) for s in nodes])
        scale = max(scale, float(np.abs(values).max()))
        series = back @ values
        smooth = np.abs(series[-4:]).max() <= TOLERANCE * scale
        if smooth or high - low <= SHORTEST * (stop - start):
            used = np.flatnonzero(np.abs(series) > 1e-17 * scale)
            rows.append([low, half, max(1, 1 + int(used.max(initial=0))), *series])
        else:
            middle = low + half
            waiting += [(middle, high), (low, middle)]
        if len(rows) + len(waiting) > PIECES:
            raise ParameterError(
                f"omega1: got a function that takes more than {PIECES} pieces from {start:g} s to "
                f"{stop:g} s, wants a smooth function of time, shorter times, or a table (times, "
                "values)"
            )
    return np.array(rows)


def _value(function: Callable[[float], float], t: float) -> float:
    value = function(t)
    try:
        number = float(value)
    except (TypeError, ValueError):
        number = np.nan
    if not np.isfinite(number):
        raise ParameterError(
            f"omega1: got a function whose value at t = {t:g} s is {value!r}, wants one finite "
            "number in s^-1"
        )
    return number


def prescribed_at(table: Array, t: npt.ArrayLike) -> tuple[Array, Array]:
    """Values and slopes at times of what `table_of` made.

    Examples
    --------
    >>> table = table_of(lambda t: 3.0 * t * t, 0.0, 2.0)
    >>> [array.round(9).tolist() for array in prescribed_at(table, [0.5, 1.0, 2.0])]
    [[0.75, 3.0, 12.0], [3.0, 6.0, 12.0]]
    """
    t = np.asarray(t, dtype=float)
    row = np.clip(np.searchsorted(table[:, 0], t, side="right") - 1, 0, len(table) - 1)
    start, half = table[row, 0], table[row, 1]
    s = (t - start) / half - 1.0
    values, slopes = np.empty(t.shape), np.empty(t.shape)
    for number in np.unique(row):
        here = row == number
        series = table[number, 3:]
        values[here] = chebyshev.chebval(s[here], series)
        slopes[here] = chebyshev.chebval(s[here], chebyshev.chebder(series)) / half[here]
    return values, slopes
