"""Newton's method on a defining system, bordered by a plane where the system is a curve.

Matrices are scaled by columns and rows, so that units do not matter ([AllgowerGeorg1990]
chapter 3).
"""

from __future__ import annotations

from typing import Any

import numpy as np

from phasekit.kernels.compile import Array, kernel, routine
from phasekit.kernels.defining import evaluate, places
from phasekit.kernels.native import solve, twin
from phasekit.kernels.state import QUADRATIC, SCALE, SIGN, VECTORS

# Newton steps that shrink like this converge quadratically.
FAST = 1e-3


def _assemble(
    w: Array, g: int, jac: int, rows: int, n: int, scale: int, row: int, rest: float, a: int, b: int
) -> None:
    for i in range(n):
        source = jac + i * n if i < rows else row
        largest = 0.0
        for j in range(n):
            value = w[source + j] * w[scale + j]
            w[a + i * n + j] = value
            largest = max(largest, abs(value))
        inverse = 1.0 / largest if largest > 0.0 else 1.0
        for j in range(n):
            w[a + i * n + j] *= inverse
        w[b + 2 * i] = -inverse * (w[g + i] if i < rows else rest)
        w[b + 2 * i + 1] = 0.0 if i < rows else 1.0


@twin(_assemble)
def assemble(
    w: Array, g: int, jac: int, rows: int, n: int, scale: int, row: int, rest: float, a: int, b: int
) -> None:
    """The scaled matrix of a Newton step and its right sides: the step, and the tangent."""
    matrix, right = w[a : a + n * n].reshape(n, n), w[b : b + 2 * n].reshape(n, 2)
    matrix[:rows] = w[jac : jac + rows * n].reshape(rows, n)
    right[:rows, 0] = w[g : g + rows]
    if rows < n:
        matrix[rows] = w[row : row + n]
        right[rows, 0] = rest
    matrix *= w[scale : scale + n]
    largest = np.abs(matrix).max(axis=1)
    largest[largest == 0.0] = 1.0
    matrix /= largest[:, None]
    right[:, 0] /= -largest
    right[:, 1] = 0.0
    right[rows:, 1] = 1.0


def _advance(w: Array, u: int, scale: int, b: int, n: int) -> float:
    size = 0.0
    for j in range(n):
        w[u + j] += w[scale + j] * w[b + 2 * j]
        step = abs(w[b + 2 * j])
        if not step <= size:  # NaN stays
            size = step
    return size


@twin(_advance)
def advance(w: Array, u: int, scale: int, b: int, n: int) -> float:
    """Add a Newton step to u; return its size."""
    step = w[b : b + 2 * n : 2]
    w[u : u + n] += w[scale : scale + n] * step
    return float(np.abs(step).max())


@routine
def at_rounding(w: Array, u: int, scale: int, b: int, n: int) -> bool:
    """Whether a Newton step is but rounding, unknown by unknown."""
    for j in range(n):
        if not abs(w[scale + j] * w[b + 2 * j]) <= 1e-15 * abs(w[u + j]):
            return False
    return True


@routine
def correct(
    first: Any, second: Any, mode: int, kind: int, n: int, par: Array, active: Any, w: Array,
    u: int, row: int, target: float, tolerance: float, iterations: int,
) -> int:  # fmt: skip
    """Newton's method from u on G = 0 and row.u = target; the number of steps, -1 if it fails.

    It has converged when steps shrink quadratically and the next one would be far below the
    tolerance, so that also an unknown that is small against its scale has its digits (what follows
    the first step is judged by the last point); or when steps cease to shrink. What solves for the
    tangent is left beside the last step.
    """
    size, rows, _, _, a, b, _, g, jac, _, _, _, _ = places(kind, n, active.size)
    scale = SCALE * size
    before = 0.0
    for i in range(iterations):
        evaluate(first, second, mode, kind, n, par, active, w, u)
        rest = 0.0
        if rows < size:
            rest = -target
            for j in range(size):
                rest += w[row + j] * w[u + j]
        assemble(w, g, jac, rows, size, scale, row, rest, a, b)
        sign = solve(w, a, b, size)
        if sign == 0.0:
            return -1
        w[VECTORS * size + SIGN] = sign
        step = advance(w, u, scale, b, size)
        # Shrinking fast, on any scale, so that the next step, step * ratio^2, would be nothing; or
        # at rounding, where steps do not shrink.
        ratio = step / before if i > 0 else 0.2
        expected = VECTORS * size + QUADRATIC
        if i == 0 and w[expected] > 0.0 and 4.0 * w[expected] * step * step <= 1e-4 * tolerance:
            w[expected] *= 1.25  # so that it is measured again before long
            return 1
        if i == 1:
            w[expected] = max(0.5 * w[expected], ratio / before)
        if step <= 1e-12 and at_rounding(w, u, scale, b, size):
            return i + 1
        if step == 0.0 or (ratio <= FAST and step * ratio * ratio <= 1e-4 * tolerance):
            return i + 1
        if step <= 1e-6 and (ratio >= 0.25 or (step <= tolerance and i + 1 == iterations)):
            return i + 1
        if not step < 1e3 or (i > 1 and step > 2.0 * before):
            return -1
        before = step
    return -1


@kernel
def refine(
    first: Any, second: Any, mode: int, kind: int, n: int, par: Array, active: Any, w: Array,
    target: float, tolerance: float, iterations: int,
) -> int:  # fmt: skip
    """Correct one point: the first of the six vectors, with the second as row.

    Its tangent becomes the third; G and the derivatives of f are left in their places.
    """
    size, _, _, u, _, b, _, _, _, _, _, _, _ = places(kind, n, active.size)
    steps = correct(
        first, second, mode, kind, n, par, active, w, u, u + size, target, tolerance, iterations
    )
    for j in range(size):
        w[u + 2 * size + j] = w[SCALE * size + j] * w[b + 2 * j + 1]
    evaluate(first, second, mode, kind, n, par, active, w, u)
    return steps
