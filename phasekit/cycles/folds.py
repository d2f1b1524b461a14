"""Folds of orbits with a single multiplier: orbits on which its logarithm is zero.

One more row borders the equations of the orbits then. They stay regular where those of the critical
function lose all digits (see `divergence`).
"""

from __future__ import annotations

import numpy as np

from phasekit.arrays import Array
from phasekit.cycles import collocation, wide
from phasekit.cycles.cycles import Cycles, Orbit, Solution
from phasekit.cycles.divergence import gradient
from phasekit.cycles.newton import FLAT, ROUNDING
from phasekit.cycles.point import Point

MOST = 12  # Newton steps to a fold from an orbit of the family beside it
FOLDED = 1e-7  # logarithm of the multiplier that is zero but for rounding


def correct(
    cycles: Cycles, guess: Orbit, rows: Array, rows_y: Array, target: Array, iterations: int,
    damped: bool,
) -> Solution:  # fmt: skip
    """Newton's method for a fold; the second of the rows becomes that of the multiplier.

    The others are those of `Cycles.rows`. Without a row of direction, which is the last one,
    there is no tangent.
    """
    c = collocation.scheme(cycles.m)
    mesh, x, y = guess.mesh, guess.x.copy(), guess.y.copy()
    n, q = cycles.n, len(y)
    W = np.empty((len(mesh) - 1, cycles.m * n, n + q + 1))
    dx, dy = np.empty((2, *x.shape)), np.empty((2, q))
    rows, border = rows.copy(), rows_y.copy()
    before, residual, divergence, message = np.inf, np.inf, np.nan, ""
    for step in range(1, iterations + 1):
        jets = cycles.jets(mesh, x, y, cycles.m, cycles.sizes)
        sign, residual, speed, divergence = wide.condense(
            jets, cycles.forced, mesh, c.nodes, c.weights, c.value, c.slope, c.side, cycles.scale,
            x, y, W,
        )  # fmt: skip
        if sign == 0.0:
            message = f"f or its derivatives are not finite{cycles.field.raised}"
            break
        value, rows[1], border[1] = gradient(cycles, Orbit(mesh, x, y), jets)
        right = target - np.einsum("rkn,kn->r", rows, x) - rows_y @ y
        right[1] = -value
        if cycles.forced:
            own, slope = cycles.own_period(y)
            border[0, 0], border[0, 1:], right[0] = 1.0, -slope, own - y[0]
        gap = cycles.closure * x[0] + cycles.turns - x[-1]
        if wide.solve(W, rows, border, right, gap, cycles.closure, cycles.m, dx, dy) == 0.0:
            message = "the equations are singular"
            break
        size = float(max(
            abs(dy[0, 0]) / y[0], np.max(np.abs(dy[0, 1:]) / cycles.width),
            np.max(np.abs(dx[0]) / cycles.scale),
        ))  # fmt: skip
        if not np.isfinite(size):
            break
        part = min(1.0, 0.5 / size) if damped and size > 0.0 else 1.0
        x, y = x + part * dx[0], y + part * dy[0]
        if not y[0] > 0.0:
            break
        rounded = residual * min(speed, 1.0) < ROUNDING and abs(value) < FOLDED
        flat = 0.25 * before < size < FLAT and rounded
        small = size <= cycles.tolerance and (rounded or before <= cycles.tolerance)
        if part == 1.0 and (small or flat):
            return Solution(Orbit(mesh, x, y), dx[1], dy[1], step, residual, sign, divergence, W)
        if not damped and size > 2.0 * before:
            break
        before = size
    message = message or "Newton's method did not converge"
    return Solution(Orbit(mesh, x, y), dx[1], dy[1], 0, residual, 0.0, divergence, W, message)


def settled(cycles: Cycles, found: Solution | Point) -> Solution:
    """The fold next to an orbit of a family, where its multiplier says."""
    rows, rows_y, target = cycles.rows(found.orbit, found.dx, found.dy)
    rows, rows_y, target = rows[[0, 0]], rows_y[[0, 0]], target[[0, 0]]
    made = correct(cycles, found.orbit, rows, rows_y, target, MOST, False)
    if not made.converged:
        return made
    return cycles.correct(made.orbit, *cycles.rows(made.orbit, found.dx, found.dy))
