"""Period and action of librations and rotations, by quadrature.

A libration over [m - w, m + w] is parametrised by x = m + w sin(theta). There
``h - V = w^2 cos^2(theta) K``, and K is a mean of V'' over the arc with a positive weight, the
Green's function of d^2/dx^2 that vanishes at both ends. So K has all its digits, however small
the oscillation, and the period is the mean of 1/sqrt(2 K), a smooth periodic function of theta.
Where that converges slowly, next to separatrices, and for formulas whose narrow features the rules
might miss, the arc is cut at the maxima of V, and each piece is integrated on panels.
"""

from __future__ import annotations

import functools
from typing import NamedTuple

import numpy as np

from phasekit.arrays import Array
from phasekit.arrays import Ints as Index
from phasekit.numerics.contract import contract
from phasekit.phase.numerical.differences import Ground
from phasekit.phase.numerical.formula import Shape
from phasekit.phase.numerical.panels import Integrals, integrate
from phasekit.phase.numerical.quadrature import between, round_the_circle
from phasekit.phase.numerical.turning_points import End

#: Rules for librations, tried one after another: points at which V'' is taken, points of the rule.
_RULES = ((16, 16), (32, 32), (64, 64), (128, 128), (128, 256))
#: Two rules that agree so far: the finer one, whose error is the square, has all digits.
_AGREE = 1e-10
#: Integrals whose error may be larger than this part of them are not given.
WORST = 1e-8
_EPS = float(np.finfo(float).eps)


class Round(NamedTuple):
    """Period and action of orbits, with estimates of their errors; NaN where these are large."""

    period: Array
    action: Array
    period_error: Array
    action_error: Array


@functools.cache
def _mean_of_bend(count: int, points: int) -> tuple[Array, Array, Array, Array]:
    """Nodes of V'' and of K in (-1, 1); matrices from V'' to K and to its Chebyshev series."""
    angles = np.pi * (np.arange(count) + 0.5) / count
    y = np.cos(np.pi * (np.arange(points) + 0.5) / points)
    gauss, weights = np.polynomial.legendre.leggauss(count // 2 + 2)
    gauss, weights = 0.5 * (1.0 + gauss), 0.5 * weights
    orders = np.arange(count)
    to_series = (2.0 / count) * np.cos(np.outer(orders, angles))
    to_series[0] *= 0.5
    matrix = np.zeros((points, count))
    for sign in (1.0, -1.0):
        # From the end at -sign to y, with the weight (1 + sign s)/(2 (1 + sign y)).
        length = 1.0 + sign * y
        s = sign * (length[:, None] * gauss - 1.0)
        basis = np.polynomial.chebyshev.chebvander(np.clip(s, -1.0, 1.0), count - 1)
        matrix += np.einsum("g,jgk->jk", 0.5 * weights * gauss, basis) * length[:, None]
    return np.cos(angles), y, matrix @ to_series, to_series


def librations(ground: Ground, x: Array, excess: Array, left: End, right: End) -> Round:
    """Period and action of orbits between two turning points."""
    found = Round(*(np.full(x.shape, np.nan) for _ in range(4)))
    middle, half = _arc(x, left, right)
    coarse: tuple[Array, Array] | None = None
    rows = np.arange(x.size)
    for count, points in _RULES if ground.systems.formula.shape is not Shape.GENERAL else ():
        nodes, y, matrix, to_series = _mean_of_bend(count, points)
        few = ground.systems.take(rows)
        bend = few.bend(middle[rows, None] + half[rows, None] * nodes)
        root = np.sqrt(2.0 * contract(bend, matrix))
        fine = (
            2.0 * np.pi * np.mean(1.0 / root, axis=1),
            half[rows] ** 2 * np.mean((1.0 - y**2) * root, axis=1),
        )
        if coarse is not None:
            # Rules that differ in their points alone say nothing of how well V'' is known.
            tail = np.max(np.abs(contract(bend, to_series[-4:])), axis=1)
            least = np.min(root, axis=1) ** 2
            rounding = _EPS * np.max(np.abs(bend), axis=1) / least
            rows, fine = _settle(found, rows, fine, coarse, tail / least, rounding)
        if not rows.size:
            return found
        coarse = fine
    rest, left, right = ground.take(rows), left.take(rows), right.take(rows)
    start, width = x[rows] - left.offset, left.offset + right.offset
    _enter(
        found, rows, integrate(rest, between(rest, start, width, excess[rows], left, right)), 2.0
    )
    return found


def _settle(
    found: Round,
    rows: Index,
    fine: tuple[Array, Array],
    coarse: tuple[Array, Array],
    tail: Array,
    rounding: Array,
) -> tuple[Index, tuple[Array, Array]]:
    """Accept what two rules agree on; return the rows that are left, and the finer rule there.

    `tail` is what the series of V'' leaves out, or has of its rounding in each term, as part of
    the least that it is integrated to; `rounding` that of V'' as it is evaluated.
    """
    differences = [np.abs(f - c) / f for f, c in zip(fine, coarse, strict=True)]
    good = np.all([d <= _AGREE for d in differences], axis=0) & (tail <= 1e-12)
    done = rows[good]
    for value, error, f, d in zip(
        (found.period, found.action),
        (found.period_error, found.action_error),
        fine,
        differences,
        strict=True,
    ):
        value[done] = f[good]
        # The error is the square of the difference: it falls by as many powers again.
        error[done] = (f * (d * d + 4.0 * tail + rounding + 16.0 * _EPS))[good]
    return rows[~good], (fine[0][~good], fine[1][~good])


def _enter(found: Round, rows: Index, sums: Integrals, passes: float) -> None:
    """Write down integrals over arcs that are passed so often in one round; NaN if not known."""
    with np.errstate(all="ignore"):
        for value, error, integral, rest, factor in (
            (found.period, found.period_error, sums.time, sums.time_error, passes),
            (found.action, found.action_error, sums.area, sums.area_error, 0.5 * passes / np.pi),
        ):
            known = rest <= WORST * integral
            value[rows] = np.where(known, factor * integral, np.nan)
            error[rows] = factor * rest


def _arc(x: Array, left: End, right: End) -> tuple[Array, Array]:
    """Middle and half the width of arcs, from their equilibrium where that is one well's."""
    middle = x + 0.5 * (right.offset - left.offset)
    half = 0.5 * (right.offset + left.offset)
    same = left.anchor.at == right.anchor.at
    same &= left.u < right.u  # not a saddle that is the wall on both sides
    middle = np.where(same, right.anchor.at + 0.5 * (right.u + left.u), middle)
    return middle, np.where(same, 0.5 * (right.u - left.u), half)


def rotations(ground: Ground, x: Array, kinetic: Array, excess: Array) -> Round:
    """Period (of one turn) and action of orbits that run round the circle."""
    turn = ground.systems.formula.period
    assert turn is not None
    found = Round(*(np.full(x.shape, np.nan) for _ in range(4)))
    base = ground.systems.potential(x)
    coarse: tuple[Array, Array] | None = None
    rows = np.arange(x.size)
    for count in (32, 64, 128, 256) if ground.systems.formula.shape is not Shape.GENERAL else ():
        few = ground.systems.take(rows)
        height = few.potential(x[rows, None] + turn * np.arange(count) / count)
        speed = np.sqrt(2.0 * (kinetic[rows, None] + (base[rows, None] - height)))
        fine = (
            turn * np.mean(1.0 / speed, axis=1),
            turn * np.mean(speed, axis=1) / (2.0 * np.pi),
        )
        if coarse is not None:
            nothing = np.zeros(rows.size)
            rows, fine = _settle(found, rows, fine, coarse, nothing, nothing)
        if not rows.size:
            return found
        coarse = fine
    rest = ground.take(rows)
    _enter(found, rows, integrate(rest, round_the_circle(rest, excess[rows])), 1.0)
    return found
