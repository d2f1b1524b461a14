"""How rounding spreads along motions: as linear motions beside them carry each step's noise.

The noise of a step is that of V' at its end. What two steps add is as good as independent, so that
covariances add: each is kept as its triangular factor, which keeps the digits of narrow ones.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from phasekit.arrays import Array
from phasekit.numerics.contract import contract
from phasekit.phase.numerical.collocation import STAGES, WEIGHTS, Carry
from phasekit.phase.numerical.formula_bounds import slope_noise
from phasekit.phase.numerical.systems import Systems

#: Rows of a linear map of (x, v).
Linear = tuple[tuple[Array, Array], tuple[Array, Array]]
_EPS = float(np.finfo(float).eps)
_PLACES = 0.5 * np.polynomial.legendre.leggauss(STAGES)[0]
#: Covariances are of noise this many times as large as its usual size.
_SIGMAS = 2.0


def spreading(systems: Systems) -> Carry:
    """What takes factors of covariances of (x, v), as of `factor`, over steps of motions."""

    def carry(
        few: Any, stages: Array, ends: tuple[Array, Array], length: Array, before: Array
    ) -> Array:
        with np.errstate(all="ignore"):
            some, h = systems.take(few), np.abs(length)
            bend = some.bend(stages[..., 0])
            (x0, v0), (x1, v1) = (end.T for end in ends)
            slope = some.slope(x1)
            (a, b), (c, d) = _along(_linear(bend, length), (v0, -some.slope(x0)), (v1, -slope))
            rough = slope_noise(some, x1, np.abs(slope))
            rough = rough + _EPS * (np.abs(slope) + np.abs(x1 * bend[:, -1]))
            push = _SIGMAS * h * rough
            place = _SIGMAS * _EPS * h * np.maximum(np.abs(v0), np.abs(v1)) + 0.5 * h * push
            xx, xv, vv = before.T
            first = np.stack([a * xx + b * xv, b * vv, place])
            second = np.stack([c * xx + d * xv, d * vv, np.zeros(h.shape)])
            return _triangle(first, second, push)

    return carry


def _linear(bend: Array, h: Array) -> Linear:
    """What a step does to neighbors: exp of two terms of the series of Magnus."""
    mean = contract(bend, WEIGHTS)
    turn = h * h * contract(bend, WEIGHTS * _PLACES)
    square = turn * turn - h * h * mean
    root = np.sqrt(np.abs(square))
    even = np.where(square > 0.0, np.cosh(root), np.cos(root))
    odd = np.where(square > 0.0, np.sinh(root), np.sin(root)) / root
    odd = np.where(root > 0.0, odd, 1.0)
    return (even + odd * turn, odd * h), (-odd * h * mean, even - odd * turn)


def _along(grown: Linear, start: tuple[Array, Array], end: tuple[Array, Array]) -> Linear:
    """Change a linear map of determinant 1 so that it maps (x', v') at the start to the end's.

    A neighbor that is late stays late: nearly so would not do, as saddles multiply the rest.
    """
    (a, b), (c, d) = grown
    (p, q), (r, s) = start, end
    # One unit for x and v: neither end is small in it.
    unit = (np.abs(q) + np.abs(s)) / (np.abs(p) + np.abs(r))
    unit = np.where((unit > 0.0) & np.isfinite(unit), unit, 1.0)
    p, r, b, c = p * unit, r * unit, b * unit, c / unit
    before, after = np.hypot(p, q), np.hypot(r, s)
    p, q, r, s = p / before, q / before, r / after, s / after
    lag = (a * -q + b * p) * r + (c * -q + d * p) * s
    gain, loss = after / before, before / after
    found = (
        (gain * r * p - lag * r * q + loss * s * q, gain * r * q + lag * r * p - loss * s * p),
        (gain * s * p - lag * s * q - loss * r * q, gain * s * q + lag * s * p + loss * r * p),
    )
    usable = np.isfinite(gain) & (gain > 0.0)
    (a, b), (c, d) = (
        tuple(np.where(usable, new, old) for new, old in zip(*rows, strict=True))
        for rows in zip(found, ((a, b), (c, d)), strict=True)
    )
    return (a, b / unit), (c * unit, d)


def _triangle(first: Array, second: Array, push: Array) -> Array:
    """Lower triangular factor (xx, xv, vv) of a covariance, from rows of another one and noise."""
    xx = np.sqrt(np.sum(first * first, axis=0))
    unit = first / np.where(xx > 0.0, xx, 1.0)
    xv = np.sum(unit * second, axis=0)
    vv = np.sqrt(np.sum((second - xv * unit) ** 2, axis=0) + push * push)
    return np.stack([xx, xv, vv], axis=-1)


def widths(factor: Array) -> tuple[Array, Array]:
    """Widths of a covariance along x and v."""
    return factor[:, 0], np.hypot(factor[:, 1], factor[:, 2])
