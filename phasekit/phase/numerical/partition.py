"""Points between which V' is monotone: the zeros of V'', as eigenvalues of companion matrices.

For what `series` and `isolation` do not prove: equilibria that have merged within the rounding of
irrational coefficients, and functions of which no bounds are known. All that is asked of the points
is that no zero of V'' is missing. So the real parts of complex ones are kept as well, and no
tolerance decides what counts as real.
"""

from __future__ import annotations

import itertools

import numpy as np

from phasekit.arrays import Array
from phasekit.errors import ConvergenceError
from phasekit.numerics.contract import contract
from phasekit.phase.numerical.formula import Shape
from phasekit.phase.numerical.series import companion_roots, degrees
from phasekit.phase.numerical.systems import Systems

#: Degree of the interpolants, and the number of pieces at which they are given up.
DEGREE = 24
MOST_PIECES = 4096
_SHORTEST = 1e-9
_TINY = 1e-18
_ROUNDING = 8.0 * float(np.finfo(float).eps)


def partition(systems: Systems) -> tuple[Array, Array]:
    """Return points that hold the zeros of V'', rising, and the bound of rounding of V' there.

    Shape (systems, points), NaN beyond those that a system has. On a line the first and the last
    of them lie outside all equilibria, or are the ends of the interval.
    """
    if systems.formula.shape is Shape.GENERAL:
        points, sizes = _interpolated(systems)
    elif systems.formula.shape is Shape.POLYNOMIAL:
        points, sizes = _of_polynomials(systems)
    else:
        points, sizes = _of_fourier_sums(systems)
    return points, _ROUNDING * sizes


def noise_at(systems: Systems, x: Array, left: Array, right: Array) -> Array:
    """Bound of rounding of V' at x, between points where it is `left` and `right`."""
    if systems.formula.shape is Shape.POLYNOMIAL:
        slope = np.abs(np.asarray(systems.coefficients(), dtype=float))
        return np.asarray(
            _ROUNDING * np.sum(slope * np.abs(x)[:, None] ** np.arange(slope.shape[1]), axis=1)
        )
    return np.fmin(left, right)


def _of_polynomials(systems: Systems) -> tuple[Array, Array]:
    slope = np.asarray(systems.coefficients(), dtype=float)
    powers = np.arange(slope.shape[1])
    bend = np.asarray(slope[:, 1:] * powers[1:], dtype=float)
    reach = _reach(slope)
    points = np.concatenate([-reach, _polynomial_roots(bend), reach], axis=1)
    low, high = systems.formula.ends
    if np.isfinite(low):
        points = np.where((points > low) & (points < high), points, np.nan)
        ends = np.broadcast_to([low, high], (systems.size, 2))
        points = np.concatenate([points, ends], axis=1)
    points = np.sort(points, axis=1)
    sizes = np.sum(np.abs(slope)[:, None] * np.abs(points)[..., None] ** powers, axis=-1)
    return points, sizes


def _reach(coefficients: Array) -> Array:
    """Return a number beyond all roots of each polynomial (Fujiwara's bound), shape (n, 1)."""
    degree = degrees(coefficients)
    rows = np.arange(len(degree))
    leading = coefficients[rows, degree]
    with np.errstate(all="ignore"):
        ratio = np.abs(coefficients / leading[:, None])
        steps = degree[:, None] - np.arange(coefficients.shape[1])
        bound = np.where(steps > 0, ratio ** (1.0 / np.maximum(steps, 1)), 0.0)
    # Not round, so that it is no point of symmetry.
    bound = np.max(bound, axis=1, initial=0.0)[:, None]
    return np.asarray(np.where(bound > 0.0, 2.0625 * bound, 1.0))


def _polynomial_roots(coefficients: Array) -> Array:
    """Real parts of all roots of polynomials, lowest coefficient first, NaN beyond the degree."""
    count = max(coefficients.shape[1] - 1, 0)
    found = np.full((len(coefficients), count), np.nan)
    count = np.where(np.isfinite(coefficients).all(axis=1), degrees(coefficients), 0)
    for degree in np.unique(count[count > 0]):
        rows = np.flatnonzero(count == degree)
        found[rows, :degree] = companion_roots(coefficients[rows, : degree + 1]).real
    return found


def _of_fourier_sums(systems: Systems) -> tuple[Array, Array]:
    period = systems.formula.period
    assert period is not None
    slope = np.asarray(systems.coefficients(), dtype=complex)
    harmonics = np.arange(slope.shape[1])
    bend = 1j * harmonics * slope
    sizes = 2.0 * np.sum(np.abs(slope) * (1.0 + harmonics), axis=1)
    # Harmonics that rounding cannot see do not move the zeros of V''.
    seen = np.abs(bend) > _TINY * np.max(np.abs(bend), axis=1, keepdims=True)
    count = np.where(np.isfinite(sizes), degrees(np.where(seen, 1.0, 0.0)), 0)
    points = np.full((systems.size, max(2 * slope.shape[1] - 2, 1)), np.nan)
    for degree in np.unique(count[count > 0]):
        rows = np.flatnonzero(count == degree)
        upper = bend[rows, 1 : degree + 1]
        middle = np.zeros((len(rows), 1), dtype=complex)
        whole = np.concatenate([np.conj(upper[:, ::-1]), middle, upper], axis=1)
        points[rows, : 2 * degree] = np.angle(companion_roots(whole)) * (period / (2.0 * np.pi))
    points = np.sort(points, axis=1)
    return points, np.broadcast_to(sizes[:, None], points.shape)


# ------------------------------------------------------------------------- any other function


def _interpolated(systems: Systems) -> tuple[Array, Array]:
    low, high = systems.formula.ends
    rows, sizes = [], []
    for i in range(systems.size):
        one = systems.take(np.array([i]))
        if not all(np.isfinite(p[0]) for p in one.parameters):
            rows.append(np.empty(0))
            sizes.append(np.empty(0))
            continue
        zeros, size = _zeros(one, low, high)
        if systems.formula.period is None:
            zeros = np.concatenate([[low], zeros, [high]])
            size = np.concatenate([size[:1], size, size[-1:]])
        order = np.argsort(zeros)
        rows.append(zeros[order])
        sizes.append(size[order])
    points = np.full((systems.size, max(map(len, rows), default=0)), np.nan)
    bounds = np.full(points.shape, np.nan)
    for i, (zeros, size) in enumerate(zip(rows, sizes, strict=True)):
        points[i, : len(zeros)], bounds[i, : len(zeros)] = zeros, size
    return points, bounds


_NODES = np.cos(np.pi * (np.arange(DEGREE + 1) + 0.5) / (DEGREE + 1))
_TO_SERIES = (2.0 / (DEGREE + 1)) * np.cos(
    np.outer(np.arange(DEGREE + 1), np.pi * (np.arange(DEGREE + 1) + 0.5) / (DEGREE + 1))
)
_TO_SERIES[0] *= 0.5


def _zeros(system: Systems, low: float, high: float) -> tuple[Array, Array]:
    """Zeros of V'' by Chebyshev series on pieces so short that the series has converged.

    With the size of V' on the piece of each.
    """
    from numpy.polynomial import chebyshev

    waiting = [(low, high)]
    done: list[tuple[float, float, float, Array]] = []
    size = 0.0
    while waiting:
        middle = np.array([0.5 * (a + b) for a, b in waiting])
        half = np.array([0.5 * (b - a) for a, b in waiting])
        x = (middle[:, None] + half[:, None] * _NODES).reshape(1, -1)
        bend, slope = (f(x).reshape(len(waiting), -1) for f in (system.bend, system.slope))
        if not np.isfinite(bend).all():
            raise ConvergenceError(
                f"{system.formula.text} is not smooth and finite between {low:.6g} and {high:.6g}; "
                "take an interval on which it is"
            )
        series = contract(bend, _TO_SERIES)
        tail = np.max(np.abs(series[:, -4:]), axis=1)
        good = tail <= 1e-13 * np.max(np.abs(series), axis=1)
        sizes = np.maximum(np.max(np.abs(slope), axis=1), np.max(np.abs(bend), axis=1) * half)
        size = max(size, float(np.max(sizes[good], initial=0.0)))
        # A piece whose bend is lost beside that of others may be as rough as rounding makes it.
        good |= tail * half <= 4.0 * np.finfo(float).eps * size
        done += [
            (m, h, z, s)
            for m, h, z, s, g in zip(middle, half, sizes, series, good, strict=True)
            if g
        ]
        waiting = [
            part
            for (a, b), g in zip(waiting, good, strict=True)
            if not g
            for part in ((a, 0.5 * (a + b)), (0.5 * (a + b), b))
        ]
        narrow = bool(waiting) and min(b - a for a, b in waiting) < _SHORTEST * (high - low)
        if narrow or len(waiting) + len(done) > MOST_PIECES:
            raise ConvergenceError(
                f"{system.formula.text} is not smooth between {low:.6g} and {high:.6g}: "
                f"pieces of degree {DEGREE} do not resolve it, however short; take a shorter "
                "interval, or one without kinks and poles"
            )
    done.sort(key=lambda piece: piece[0])
    found = [np.array([m + h for m, h, *_ in done[:-1]])]
    bounds = [np.array([max(a[2], b[2]) for a, b in itertools.pairwise(done)])]
    for m, h, z, series in done:
        largest = np.max(np.abs(series))
        keep = np.flatnonzero(np.abs(series) > 1e-16 * largest)
        if keep.size and keep[-1] > 0:
            roots = np.real(chebyshev.chebroots(series[: keep[-1] + 1]))
            roots = roots[np.abs(roots) <= 1.0]
            found.append(m + h * roots)
            bounds.append(np.full(roots.size, z))
    return np.concatenate(found), np.concatenate(bounds)
