"""Compiled Newton's method for an orbit, by collocation."""

from __future__ import annotations

from typing import Any

import numpy as np

from phasekit.arrays import Array
from phasekit.cycles.along import inner, jets
from phasekit.cycles.kernels import REST, condense, solve
from phasekit.numerics.compile import kernel, routine
from phasekit.numerics.native import call

FLAT = 1e-7  # a step that no longer shrinks counts below this, where the residual is rounding
ROUNDING = 1e-11  # of the residual, relative
GRAIN = 2.0**-50  # of a sum of some numbers, by rounding of each and of the sum
# The longest last step after which the residual is only looked at, beside the tolerance and at all.
LONGER, LONGEST = 10.0, 1e-10

# How Newton's method ended.
ON_ITS_WAY, FOUND, NOT_FINITE, SINGULAR, DIVERGED, CHECKED = range(6)


@routine
def residual_of(
    jet_: Array, mesh: Array, slope: Array, scale: Array, x: Array, y: Array
) -> tuple[float, float]:
    """The largest residual beside the largest |T f|, and the latter (see `condense`)."""
    m, n = slope.shape[0], x.shape[1]
    speed, worst = 0.0, 0.0
    for j in range(mesh.size - 1):
        h = mesh[j + 1] - mesh[j]
        for i in range(m):
            for c in range(n):
                f = y[0] * jet_[j * m + i, c]
                total = -h * f
                for k in range(m + 1):
                    total += slope[i, k] * x[j * m + k, c]
                if not np.isfinite(total):
                    return np.inf, np.inf
                speed = max(speed, abs(f) / scale[c])
                worst = max(worst, abs(total / h) / scale[c])
    return (worst / speed if speed > REST else worst), speed


@routine
def grain_of(
    jet_: Array, mesh: Array, slope: Array, scale: Array, x: Array, y: Array
) -> float:  # fmt: skip
    """What rounding of the states leaves of a residual, at most: of slopes, and of T f."""
    size, least, steep = 0.0, 1.0, 0.0
    for i in range(slope.shape[0]):
        total = 0.0
        for k in range(slope.shape[1]):
            total += abs(slope[i, k])
        steep = max(steep, total)
    for i in range(x.shape[0]):
        for c in range(x.shape[1]):
            size = max(size, abs(x[i, c]) / scale[c])
    for j in range(mesh.size - 1):
        least = min(least, mesh[j + 1] - mesh[j])
    n, most = x.shape[1], 0.0
    width = jet_.shape[1] // n - 1
    for g in range(jet_.shape[0]):
        for c in range(n):
            total = 0.0
            for k in range(n):
                total += abs(jet_[g, n + c * width + k] * x[g, k])
            most = max(most, total / scale[c])
    left: float = GRAIN * (size * steep / least + y[0] * most)
    return left


@routine
def made_unit(
    mesh: Array, weights: Array, value: Array, scale: Array, width: Array, dx: Array, dy: Array
) -> float:
    """Divide a tangent by its length, which is returned; that of none is 1."""
    length = inner(mesh, weights, value, dx, dx, scale)
    for k in range(1, dy.size):
        length += (dy[k] / width[k - 1]) ** 2
    length = np.sqrt(length) if length > 0.0 else 1.0
    for i in range(dx.shape[0]):
        for c in range(dx.shape[1]):
            dx[i, c] /= length
    for k in range(dy.size):
        dy[k] /= length
    return length


@routine
def fill_sides(rows: Array, rows_y: Array, target: Array, x: Array, y: Array, right: Array) -> None:
    """Fill by how much an orbit is off the planes rows . x + rows_y . y = target."""
    for r in range(target.size):
        right[r] = target[r]
        for k in range(y.size):
            right[r] -= rows_y[r, k] * y[k]
    for i in range(x.shape[0]):
        for c in range(x.shape[1]):
            for r in range(target.size):
                right[r] -= rows[r, i, c] * x[i, c]


@routine
def size_of(scale: Array, width: Array, y: Array, dx: Array, dy: Array) -> float:
    """The largest part of a step, on scaled axes; that of the period beside itself."""
    size: float = abs(dy[0]) / y[0]
    for k in range(1, dy.size):
        size = max(size, abs(dy[k]) / width[k - 1])
    for i in range(dx.shape[0]):
        for c in range(dx.shape[1]):
            size = max(size, abs(dx[i, c]) / scale[c])
    return size


@routine
def add(part: float, dx: Array, dy: Array, x: Array, y: Array) -> None:
    """Take a part of a step."""
    for i in range(x.shape[0]):
        for c in range(x.shape[1]):
            x[i, c] += part * dx[i, c]
    for k in range(y.size):
        y[k] += part * dy[k]


@kernel
def newton(
    given: bool, first: Any, mode: int, par: Array, active: Any, forced: bool, clock: Any,
    multiple: int, mesh: Array, nodes: Array, weights: Array, value: Array, slope: Array,
    side: float, scale: Array, sizes: Array, width: Array, closure: Array, turns: Array,
    rows: Array, rows_y: Array, target: Array, x: Array, y: Array, W: Array, dx: Array, dy: Array,
    jet_: Array, tolerance: float, iterations: int, damped: bool, before: float,
) -> tuple[int, int, float, float, float, float, float]:  # fmt: skip
    """Newton's method for an orbit, in its place, with the derivatives of f given or taken here.

    Returns how it ended, steps, sign of the determinant, residual, integral of the trace, the size
    of the last step and the length of the tangent before it is made 1. Where it ended as checked,
    W and the tangent are those of the last step; what was given to that is not known here.
    """
    m, n, q = nodes.size, x.shape[1], y.size
    places = x.shape[0]
    right, gap = np.zeros(target.size), np.zeros(n)
    border = rows_y.copy()
    w = np.zeros(2 * q + 2)
    sign, residual, divergence, size = 0.0, np.inf, np.nan, before
    whole = before < np.inf and not damped
    for step in range(1, iterations + 1):
        fill_sides(rows, rows_y, target, x, y, right)
        if forced:
            own = active.size - 1
            for k in range(own):
                w[k] = y[1 + k]
            call(clock, w, 0, par, 0, own)
            border[0, 0] = 1.0
            for k in range(own):
                border[0, 1 + k] = -multiple * w[own + 1 + k]
            right[0] = multiple * w[own] - y[0]
        if not given:
            jets(first, mode, par, active, forced, mesh, nodes, value, x, y, sizes, jet_)
        if size <= min(LONGER * tolerance, LONGEST) and whole:
            # Steps get shorter by squares: another one would be rounding, if nothing else is off.
            left, speed = residual_of(jet_, mesh, slope, scale, x, y)
            if left * min(speed, 1.0) < ROUNDING:
                length = made_unit(mesh, weights, value, scale, width, dx[1], dy[1])
                return CHECKED, step - 1, sign, left, divergence, size, length
        sign, residual, speed, divergence = condense(
            jet_, forced, mesh, nodes, weights, value, slope, side, scale, x, y, W
        )
        if sign == 0.0:
            return NOT_FINITE, step, sign, residual, divergence, size, 1.0
        for c in range(n):
            gap[c] = closure[c] * x[0, c] + turns[c] - x[places - 1, c]
        sign *= solve(W, rows, border, right, gap, closure, m, dx, dy)
        if sign == 0.0:
            return SINGULAR, step, sign, residual, divergence, size, 1.0
        size = size_of(scale, width, y, dx[0], dy[0])
        if not np.isfinite(size):
            return DIVERGED, step, sign, residual, divergence, size, 1.0
        part = min(1.0, 0.5 / size) if damped and size > 0.0 else 1.0
        add(part, dx[0], dy[0], x, y)
        if not y[0] > 0.0:
            return DIVERGED, step, sign, residual, divergence, size, 1.0
        # Of a small orbit the residual is rounding of the states, whose sizes are 1 here.
        rounded = residual * min(speed, 1.0) < ROUNDING
        if not rounded and size < FLAT:  # short intervals, or states far from zero
            rounded = residual * speed < grain_of(jet_, mesh, slope, scale, x, y)
        flat = size > 0.25 * before and size < FLAT and rounded
        # The residual is that before the step: one that is not yet rounding is looked at again.
        small = size <= tolerance and (rounded or before <= tolerance)
        if part == 1.0 and (small or flat):
            length = made_unit(mesh, weights, value, scale, width, dx[1], dy[1])
            return FOUND, step, sign, residual, divergence, size, length
        if not damped and before < np.inf and size > 2.0 * before:
            return DIVERGED, step, sign, residual, divergence, size, 1.0
        before, whole = size, part == 1.0
    return ON_ITS_WAY, iterations, sign, residual, divergence, size, 1.0
