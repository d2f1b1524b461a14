"""Newton's method on a defining system, bordered by a plane where the system is a curve.

Matrices are scaled by columns and rows, so that units do not matter ([AllgowerGeorg1990]
chapter 3).
"""

from __future__ import annotations

from typing import Any

import numpy as np

from phasekit.arrays import Array
from phasekit.bifurcation.continuation.kernels.defining import (
    QUADRATIC,
    SCALE,
    SIGN,
    VECTORS,
    evaluate,
    places,
)
from phasekit.numerics.compile import kernel, routine
from phasekit.numerics.native import FEW, _solve, dot, solve, twin

# Newton steps that shrink like this converge quadratically.
FAST = 1e-3
# Of terms that cancel: what is left of them where they do so but for rounding.
ROUNDING = 64.0 * 2.0**-52
LITTLE = 0.1  # of an unknown
NOTHING = 1e-30  # of an unknown's scale
NEIGHBOURS = 8
LEAST = 2e-3  # of a scale: times ten times ROUNDING, rounding of numbers of that size
APART = 4.2e-14  # of unknowns; no power of two, which would show the same rounding everywhere
RAISED = 1e-10  # tolerances from here on are for noisy functions
# Why it fails: steps that do not shrink, a singular matrix, f that is not finite.
DIVERGED, SINGULAR, NO_NUMBER = -1, -2, -3


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


def _solved(
    w: Array, g: int, jac: int, rows: int, n: int, scale: int, row: int, rest: float, a: int, b: int
) -> float:
    assemble(w, g, jac, rows, n, scale, row, rest, a, b)
    return solve(w, a, b, n)


@twin(_solved)
def solved(
    w: Array, g: int, jac: int, rows: int, n: int, scale: int, row: int, rest: float, a: int, b: int
) -> float:
    """The step and the tangent, scaled, in place of the right sides; the determinant's sign."""
    if n > FEW:
        return _solved(w, g, jac, rows, n, scale, row, rest, a, b)
    numbers: Any = w.tolist()
    _assemble(numbers, g, jac, rows, n, scale, row, rest, a, b)
    sign = _solve(numbers, a, b, n)
    w[a : b + 2 * n] = numbers[a : b + 2 * n]
    return sign


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


def _settled(
    w: Array, jac: int, rows: int, n: int, u: int, scale: int, b: int, factor: float,
    late: bool,
) -> bool:  # fmt: skip
    for j in range(n):
        step = abs(w[scale + j] * w[b + 2 * j])
        if not (step <= LITTLE * abs(w[u + j]) or (late and step <= NOTHING * w[scale + j])):
            return False
    for i in range(rows):
        left = 0.0
        terms = 0.0
        unit = 0.0
        for j in range(n):
            slope = abs(w[jac + i * n + j])
            left += slope * abs(w[scale + j] * w[b + 2 * j])
            terms += slope * abs(w[u + j])
            unit += slope * w[scale + j]
        if not (factor * left <= ROUNDING * terms or (late and left <= NOTHING * unit)):
            return False
    return True


@twin(_settled)
def settled(
    w: Array, jac: int, rows: int, n: int, u: int, scale: int, b: int, factor: float,
    late: bool,
) -> bool:  # fmt: skip
    """Whether a part `factor` of the last step changes G by no more than rounding of its terms.

    And whether the derivatives at the point before it, of which the tangent is made, are those
    here: what is small against its scale may still have changed by much. After some steps,
    ``late``, what is next to nothing on its scale is taken for zero.
    """
    if n <= FEW:
        return _settled(w.tolist(), jac, rows, n, u, scale, b, factor, late)
    scales = w[scale : scale + n]
    steps, sizes = np.abs(scales * w[b : b + 2 * n : 2]), np.abs(w[u : u + n])
    nothing = NOTHING if late else 0.0
    if not np.all((steps <= LITTLE * sizes) | (steps <= nothing * scales)):
        return False
    slopes = np.abs(w[jac : jac + rows * n].reshape(rows, n))
    left, terms = slopes @ steps, slopes @ sizes
    return bool(np.all((factor * left <= ROUNDING * terms) | (left <= nothing * (slopes @ scales))))


def _terms_of(w: Array, jac: int, rows: int, n: int, sizes: Array, terms: Array) -> None:
    for i in range(rows):
        terms[i] = 0.0
        for j in range(n):
            terms[i] += abs(w[jac + i * n + j] * sizes[j])


@twin(_terms_of)
def terms_of(w: Array, jac: int, rows: int, n: int, sizes: Array, terms: Array) -> None:
    """The terms of G: what its derivatives make of unknowns of these sizes."""
    if n <= FEW:
        _terms_of(w, jac, rows, n, sizes, terms)
    else:
        terms[:] = np.abs(w[jac : jac + rows * n].reshape(rows, n)) @ np.abs(sizes)


@routine
def zero_at_zero(
    first: Any, second: Any, mode: int, kind: int, n: int, par: Array, active: Any, w: Array,
    u: int,
) -> bool:  # fmt: skip
    """Whether what is next to nothing on its scale may as well be zero.

    It may where G then is, or stays, but for rounding; it may not where it is multiplied by what is
    as large, as in p*exp(x) far out.
    """
    size, rows, _, _, _, _, _, g, jac, _, _, _, _ = places(kind, n, active.size)
    here = w[u : u + size].copy()
    for j in range(size):
        if abs(here[j]) <= NOTHING * w[SCALE * size + j]:
            w[u + j] = 0.0
    evaluate(first, second, mode, kind, n, par, active, w, u)
    zeroed = w[g : g + rows].copy()
    terms = np.zeros(rows)
    terms_of(w, jac, rows, size, w[u : u + size], terms)
    for j in range(size):
        w[u + j] = here[j]
    evaluate(first, second, mode, kind, n, par, active, w, u)
    for i in range(rows):
        if not min(abs(zeroed[i]), abs(zeroed[i] - w[g + i])) <= ROUNDING * terms[i]:
            return False
    return True


@routine
def at_noise(
    first: Any, second: Any, mode: int, kind: int, n: int, par: Array, active: Any, w: Array,
    u: int,
) -> bool:  # fmt: skip
    """Whether G is but rounding at u: of its terms, or of whatever f does inside.

    The latter shows in differences of G between neighbours of u, where nothing else remains. Few
    neighbours may show none of it in one of many entries: each is known to rounding of unknowns of
    their scales at best.
    """
    size, rows, _, _, _, _, _, g, jac, _, _, _, _ = places(kind, n, active.size)
    values = np.zeros((NEIGHBOURS, rows))
    here = w[u : u + size].copy()
    for k in range(NEIGHBOURS):
        for j in range(size):
            w[u + j] = here[j] + k * APART * max(abs(here[j]), w[SCALE * size + j])
        evaluate(first, second, mode, kind, n, par, active, w, u)
        for i in range(rows):
            values[k, i] = w[g + i]
    for j in range(size):
        w[u + j] = here[j]
    evaluate(first, second, mode, kind, n, par, active, w, u)
    unknowns, terms = np.zeros(size), np.zeros(rows)
    for j in range(size):
        unknowns[j] = abs(here[j]) + LEAST * w[SCALE * size + j]
    terms_of(w, jac, rows, size, unknowns, terms)
    for i in range(rows):
        noise = 0.0
        for k in range(NEIGHBOURS - 4):
            fourth = (
                values[k, i] - 4.0 * values[k + 1, i] + 6.0 * values[k + 2, i]
                - 4.0 * values[k + 3, i] + values[k + 4, i]
            )  # fmt: skip
            noise += fourth * fourth / (70.0 * (NEIGHBOURS - 4))
        if not abs(w[g + i]) <= 10.0 * ROUNDING * terms[i] + 10.0 * np.sqrt(noise):
            return False
    return True


@routine
def correct(
    first: Any, second: Any, mode: int, kind: int, n: int, par: Array, active: Any, w: Array,
    u: int, row: int, target: float, tolerance: float, iterations: int,
) -> int:  # fmt: skip
    """Newton's method from u on G = 0 and row.u = target; the number of steps, or why it fails.

    It has converged when steps shrink quadratically, the next one would be far below the tolerance
    (what follows the first step is judged by the last point), and G would change by no more than
    rounding of its terms; or when steps cease to shrink where G is rounding. Only a tolerance that
    was raised, for a function that is noisy, asks for no more than small steps. What solves for the
    tangent is left beside the last step.
    """
    size, rows, _, _, a, b, _, g, jac, _, _, _, _ = places(kind, n, active.size)
    scale = SCALE * size
    expected = VECTORS * size + QUADRATIC
    before = 0.0
    for i in range(iterations):
        evaluate(first, second, mode, kind, n, par, active, w, u)
        rest = 0.0
        if rows < size:
            rest = dot(w, row, u, size) - target
        sign = solved(w, g, jac, rows, size, scale, row, rest, a, b)
        if sign == 0.0:
            return NO_NUMBER if not finite(w, jac, rows * size) else SINGULAR
        w[VECTORS * size + SIGN] = sign
        step = advance(w, u, scale, b, size)
        if not np.isfinite(step):
            return NO_NUMBER
        # Shrinking fast, on any scale, so that the next step, step * ratio^2, would be nothing; or
        # at rounding, where steps do not shrink.
        ratio = step / before if i > 0 else 0.2
        if i == 0 and w[expected] > 0.0 and 4.0 * w[expected] * step * step <= 1e-4 * tolerance:
            w[expected] *= 1.25  # so that it is measured again before long
            if settled(w, jac, rows, size, u, scale, b, 2.0 * w[expected] * step, False):
                return 1
        if i == 1:
            w[expected] = max(0.5 * w[expected], ratio / before)
        if step == 0.0 or (step <= 1e-12 and at_rounding(w, u, scale, b, size)):
            return i + 1
        if ratio <= FAST and step * ratio * ratio <= 1e-4 * tolerance:
            if settled(w, jac, rows, size, u, scale, b, ratio * ratio, False):
                return i + 1
            if i > 1 and settled(w, jac, rows, size, u, scale, b, ratio * ratio, True):
                if zero_at_zero(first, second, mode, kind, n, par, active, w, u):
                    return i + 1
        elif step <= 1e-5 and (ratio >= 0.25 or (step <= tolerance and i + 1 == iterations)):
            if settled(w, jac, rows, size, u, scale, b, 0.1, False):
                return i + 1  # G itself was but rounding of its terms
            if i > 1 and settled(w, jac, rows, size, u, scale, b, 0.1, True):
                if zero_at_zero(first, second, mode, kind, n, par, active, w, u):
                    return i + 1
            if (tolerance >= RAISED and step <= tolerance) or at_noise(
                first, second, mode, kind, n, par, active, w, u
            ):
                return i + 1
        if not step < 1e3 or (i > 1 and step > 2.0 * before and step > 1e-5):
            return DIVERGED
        before = step
    return DIVERGED


@routine
def finite(w: Array, place: int, count: int) -> bool:
    """Whether so many entries are finite."""
    for i in range(count):
        if not np.isfinite(w[place + i]):
            return False
    return True


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
