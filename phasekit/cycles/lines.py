"""Derivatives along a line, at all points of an orbit, over steps that suit them.

A step that suits the size of the states may be far too wide for f, as where states are far from
zero beside what they move by: it is halved until what it leaves out is rounding, or grows.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from phasekit.arrays import Array

EPSILON = 2.0**-52
DIFFERENCED = 1e-10  # relative error of slopes that are differences
REACH = 2.0**-8  # of the first differences along a direction, beside the sizes of the states
ENOUGH = 1e-9  # part of a derivative that may be left out
SMOOTH = 3e-6  # part by which slopes over two steps differ, whose square is left out
LEVELS = 24  # halvings of a step
WIDER = 8  # first steps, each 16 times the one before, where f is linear over the shorter ones
SEEN = 1e3  # a derivative beside its error, where there is one
PATIENCE = 3  # halvings without a better row after which no more are tried


@dataclass(frozen=True, eq=False)
class Derivatives:
    """First and second derivatives along a line, and what they would be with another step."""

    first: Array  # shape (points, rows, columns)
    second: Array
    other_first: Array  # those of the next wider step: they differ by about the error of those
    other_second: Array


def along_line(
    at: Callable[[float], Array], middle: Array, step: float, weights: Array
) -> Derivatives:
    """Derivatives at 0 of a function whose values are matrices at many points.

    Each row takes the step that leaves out least of its largest entry, columns being weighed.
    """

    def sides(h: float) -> tuple[Array, ...]:
        ahead, behind = at(h), at(-h)
        return (ahead - behind) / (2.0 * h), ((ahead - middle) + (behind - middle)) / h**2

    noise = EPSILON * _size(middle, weights)
    for _ in range(WIDER):
        best, other, least = _halved(sides, step, sides(2.0 * step), sides(step), noise, weights)
        sizes = (_size(one, weights) for one in best)
        seen = [size > SEEN * left for size, left in zip(sizes, least, strict=True)]
        if np.any(seen) or not np.any(noise > 0.0):
            break
        # Over such a step it is linear but for rounding: of a state at rest the size is not known.
        step *= 16.0
    return Derivatives(*best, *other)


def slope_along(
    at: Callable[[float], Array], step: float, noise: Array, weights: Array | None = None,
    sides: tuple[Array, Array] | None = None,
) -> Array:  # fmt: skip
    """Slopes at 0 of functions (rows) at many points, weighed as in `along_line`.

    ``noise`` is the rounding of each function, ``sides`` the slopes over two steps and over one
    where they are known.
    """

    def side(h: float) -> Array:
        return np.asarray((at(h) - at(-h)) / (2.0 * h))

    wide, near = sides or (side(2.0 * step), side(step))
    gap = _size(near - wide, weights)
    if np.all(gap <= np.maximum(SMOOTH * _size(near, weights), 4.0 * noise / step)):
        return np.asarray(near + (near - wide) / 3.0)
    return _halved(lambda h: (side(h),), step, (wide,), (near,), noise, weights)[0][0]


def _halved(
    sides: Callable[[float], tuple[Array, ...]], h: float, wide: tuple[Array, ...],
    near: tuple[Array, ...], noise: Array, weights: Array | None = None,
) -> tuple[list[Array], list[Array], list[Array]]:  # fmt: skip
    """Derivatives row by row over the best of halved steps, over the step before it; errors."""
    orders = range(len(wide))
    best, other = ([np.full_like(one, np.nan) for one in wide] for _ in range(2))
    least = [np.full(len(noise), np.inf) for _ in orders]
    before: list[Array] = []
    idle = 0
    for _ in range(LEVELS):
        found = [n + (n - w) / 3.0 for n, w in zip(near, wide, strict=True)]
        if before:
            idle += 1
            for k in orders:
                # Nothing is known better than rounding lets it be.
                left = np.maximum(_size(found[k] - before[k], weights), noise / h ** (1 + k))
                rows = left < least[k]
                least[k][rows] = left[rows]
                best[k][:, rows], other[k][:, rows] = found[k][:, rows], before[k][:, rows]
                idle = 0 if np.any(rows) else idle
            enough = all(
                np.all(least[k] <= np.maximum(
                    ENOUGH * _size(best[k], weights), 4.0 * noise / h ** (1 + k)
                ))
                for k in orders
            )  # fmt: skip
            if enough or idle == PATIENCE:
                break
        h *= 0.5
        before, wide, near = found, near, sides(h)
    return best, other, least


def _size(values: Array, weights: Array | None = None) -> Array:
    """Largest entry of each row over all points; infinite where one is not finite."""
    found = np.max(np.abs(values), axis=0)
    if weights is not None:
        found = np.max(found * weights, axis=1)
    return np.asarray(np.where(np.isfinite(found), found, np.inf))
