"""Linear algebra along orbits: by the kernels where states are few, by LAPACK where they are many.

Derivatives of f that are mostly zeros are eliminated as sparse matrices, interval by interval.
Decays that are far faster than an interval, as diffusion on a fine grid has them, stay inside the
unit circle with Gauss points, and nobody needs their digits: no mesh is made so fine as to resolve
them. Of very many states whose derivatives are sparse nothing else is formed (`sparse`).
"""

from __future__ import annotations

import functools
import math
from types import FunctionType
from typing import TYPE_CHECKING, Any

import numpy as np

from phasekit.arrays import Array
from phasekit.cycles import along, collocation, kernels, newton
from phasekit.cycles.sparse import Condensed, Slopes
from phasekit.numerics.later import later

if TYPE_CHECKING:
    from scipy.linalg import lapack
else:  # which takes long, and few states never need it
    lapack = later("scipy.linalg.lapack")


WIDE = 24  # states from which it is faster
SPARSE = 0.1  # part of entries of derivatives that are not zero, up to which they are sparse
STIFF = 2.0  # mean decay of states over an interval from which it is not resolved
LONG = 400  # and unknowns of an interval from which it pays


def condense(
    jet_: Any, forced: bool, mesh: Array, nodes: Array, weights: Array, value: Array,
    slope: Array, side: float, scale: Array, x: Array, y: Array, W: Any,
) -> tuple[float, float, float, float]:  # fmt: skip
    """What `kernels.condense` does."""
    given = jet_, forced, mesh, nodes, weights, value, slope, side, scale, x, y, W
    return (kernels.condense if x.shape[1] < WIDE else _condense)(*given)


def space(jet_: Any, intervals: int, size: int, width: int) -> Any:
    """What `condense` fills."""
    return Condensed() if isinstance(jet_, Slopes) else np.empty((intervals, size, width))


def solve(
    W: Any, rows: Array, rows_y: Array, right: Array, gap: Array, sigma: Array, m: int,
    dx: Array, dy: Array,
) -> float:  # fmt: skip
    """What `kernels.solve` does."""
    if isinstance(W, Condensed):
        return W.solve(rows, rows_y, right, gap, sigma, dx, dy)
    wide = len(sigma) >= WIDE and right.size == dy.shape[1]
    return (_solve if wide else kernels.solve)(W, rows, rows_y, right, gap, sigma, m, dx, dy)


def bordered(W: Any, n: int, unknowns: int, column: Array, *, still: bool) -> Any:
    """Condensed equations with the first unknowns and another column; ``still``: for sides of 0."""
    if isinstance(W, Condensed):
        return W.bordered(unknowns, column, still=still)
    V = np.zeros((*column.shape, n + unknowns + 2))
    V[:, :, : n + unknowns], V[:, :, n + unknowns] = W[:, :, : n + unknowns], column
    if not still:
        V[:, :, -1] = W[:, :, -1]
    return V


def follow(states: int, *given: Any) -> Any:
    """What `newton.newton` does, of so many states."""
    return (newton.newton if states < WIDE else _newton())(*given)


@functools.cache
def _newton() -> Any:
    """Newton's method as the kernel has it, interpreted, with what takes long by other means."""
    code: Any = newton.newton
    own = {"condense": _condense, "solve": solve, "jets": along.jets, "inner": along.inner}
    own |= {"residual_of": _residual, "made_unit": _unit, "call": _call, "grain_of": _grain}
    own |= {"fill_sides": _fill_sides, "size_of": _size, "add": _add}
    return FunctionType(code.py_func.__code__, vars(newton) | own)


def _call(function: Any, w: Array, x: int, par: Array, z: int, out: int) -> None:
    """Machine code of the period of a forcing and its derivatives."""
    along.evaluate(function, par, w, out)


def _unit(
    mesh: Array, weights: Array, value: Array, scale: Array, width: Array, dx: Array, dy: Array
) -> float:  # fmt: skip
    """What `newton.made_unit` does."""
    length = float(np.sum((dy[1:] / width) ** 2))
    length += along.inner(mesh, weights, value, dx, dx, scale)
    length = math.sqrt(length) if length > 0.0 else 1.0
    dx /= length
    dy /= length
    return length


def _residual(
    jet_: Any, mesh: Array, slope: Array, scale: Array, x: Array, y: Array
) -> tuple[float, float]:
    """What `newton.residual_of` does."""
    _, worst, speed = _off(jet_, mesh, slope, scale, x, y)
    return (worst / speed if speed > kernels.REST else worst), speed


def _grain(jet_: Any, mesh: Array, slope: Array, scale: Array, x: Array, y: Array) -> float:
    """What `newton.grain_of` does."""
    n = x.shape[1]
    steep = float(np.max(np.sum(np.abs(slope), axis=1)))
    least = min(1.0, float(np.min(np.diff(mesh))))
    if isinstance(jet_, Slopes):
        terms = jet_.absolute(np.abs(x))
    else:
        slopes = jet_[:, n:].reshape(len(jet_), n, -1)[:, :, :n]
        terms = np.einsum("gck,gk->gc", np.abs(slopes), np.abs(x[: len(jet_)]))
    most = float(np.max(terms / scale))
    size = float(np.max(np.abs(x) / scale))
    return newton.GRAIN * float(size * steep / least + y[0] * most)


def _fill_sides(
    rows: Array, rows_y: Array, target: Array, x: Array, y: Array, right: Array
) -> None:
    """What `newton.fill_sides` does."""
    right[:] = target - rows_y @ y - rows.reshape(len(target), -1) @ x.ravel()


def _size(scale: Array, width: Array, y: Array, dx: Array, dy: Array) -> float:
    """What `newton.size_of` does."""
    of_y = np.abs(dy) / np.append(y[0], width)
    return float(max(np.max(of_y), np.max(np.abs(dx) / scale)))


def _add(part: float, dx: Array, dy: Array, x: Array, y: Array) -> None:
    """What `newton.add` does."""
    x += part * dx
    y += part * dy


def _off(
    jet_: Any, mesh: Array, slope: Array, scale: Array, x: Array, y: Array
) -> tuple[Array, float, float]:
    """The residual at all Gauss points, times the length of the interval; its size and of T f."""
    m, n = len(slope), x.shape[1]
    places = (np.arange(len(mesh) - 1) * m)[:, None] + np.arange(m + 1)
    f = y[0] * (jet_.f if isinstance(jet_, Slopes) else jet_[:, :n]).reshape(-1, m, n)
    h = np.diff(mesh)[:, None, None]
    total = slope @ x[places] - h * f
    if not np.isfinite(total).all():
        return total, np.inf, np.inf
    return total, float(np.max(np.abs(total / h) / scale)), float(np.max(np.abs(f) / scale))


def _condense(
    jet_: Any, forced: bool, mesh: Array, nodes: Array, weights: Array, value: Array,
    slope: Array, side: float, scale: Array, x: Array, y: Array, W: Any,
) -> tuple[float, float, float, float]:  # fmt: skip
    """Fill W as `kernels.condense` does."""
    m, n, q = nodes.size, x.shape[1], y.size
    size, t = m * n, 1 if forced else 0
    total, worst, speed = _off(jet_, mesh, slope, scale, x, y)
    sparse = isinstance(jet_, Slopes)
    if not np.isfinite(worst) or not (jet_.finite if sparse else np.isfinite(jet_).all()):
        return 0.0, np.inf, 0.0, np.nan
    if sparse:
        sign, divergence = W.fill(jet_, mesh, collocation.scheme(m), scale, y, total)
        return sign, worst / speed if speed > kernels.REST else worst, speed, divergence
    slopes = jet_[:, n:].reshape(len(jet_), n, -1)
    every = np.flatnonzero(np.any(slopes[:, :, :n] != 0.0, axis=0))
    sparse = size >= LONG and len(every) < SPARSE * n * n
    sign, divergence = 1.0, 0.0
    rhs = np.empty((m, n, n + q + 1))
    for j, h in enumerate(np.diff(mesh)):
        here = slice(j * m, (j + 1) * m)
        A = slopes[here, :, :n]
        rhs[:, :, :n] = h * y[0] * value[:, 0, None, None] * A
        rhs[:, np.arange(n), np.arange(n)] -= slope[:, :1]
        rhs[:, :, n] = h * jet_[here, :n]
        if forced:
            rhs[:, :, n] += h * y[0] * (mesh[j] + h * nodes)[:, None] * slopes[here, :, n]
        rhs[:, :, n + 1 : n + q] = h * y[0] * slopes[here, :, n + t : n + t + q - 1]
        rhs[:, :, -1] = -total[j]
        found, solution = (_sparse if sparse else _dense)(
            -h * y[0] * value[:, 1:], slope[:, 1:], A, rhs.reshape(size, -1), every
        )
        if found == 0.0:
            return 0.0, np.inf, 0.0, np.nan
        sign *= found * side**n
        W[j] = solution
        divergence += h * y[0] * float(weights @ np.trace(A, axis1=1, axis2=2))
    return sign, worst / speed if speed > kernels.REST else worst, speed, divergence


def _dense(part: Array, slope: Array, A: Array, rhs: Array, every: Any) -> tuple[float, Array]:
    """Solve for the places of an interval; the sign of the determinant, or 0."""
    m, n = A.shape[:2]
    M = part[:, None, :, None] * A[:, :, None, :]
    place = np.arange(n)
    M[:, place, :, place] += slope
    lu, swaps, info = lapack.dgetrf(M.reshape(m * n, m * n), overwrite_a=True)
    if info != 0:
        return 0.0, rhs
    return _sign(np.diagonal(lu), swaps), lapack.dgetrs(lu, swaps, rhs)[0]


def _sign(diagonal: Array, swaps: Any) -> float:
    odd = np.count_nonzero(swaps != np.arange(len(swaps))) + np.count_nonzero(diagonal < 0.0)
    return -1.0 if odd % 2 else 1.0


def _sparse(part: Array, slope: Array, A: Array, rhs: Array, every: Any) -> tuple[float, Array]:
    """The same by a sparse factorisation."""
    from scipy.sparse import csc_array
    from scipy.sparse.linalg import splu

    from phasekit.numerics.factors import parity_of

    m, n = A.shape[:2]
    rows, columns = np.divmod(every, n)
    i, k = np.indices((m, m)).reshape(2, -1, 1)
    place = np.arange(n)
    values = part.reshape(-1, 1) * A[:, rows, columns][i[:, 0]]
    entries = np.concatenate([values.ravel(), np.repeat(slope.ravel(), n)])
    row = np.concatenate([(i * n + rows).ravel(), (i * n + place).ravel()])
    column = np.concatenate([(k * n + columns).ravel(), (k * n + place).ravel()])
    # By states, then by places: a matrix of blocks as f_x itself, whose order keeps it sparse.
    row, column = row % n * m + row // n, column % n * m + column // n
    try:
        lu = splu(csc_array((entries, (row, column)), shape=(m * n, m * n)))
    except RuntimeError:  # singular
        return 0.0, rhs
    order = (np.arange(m * n) % m) * n + np.arange(m * n) // m
    diagonal = lu.U.diagonal()
    sign = parity_of(lu.perm_r) * parity_of(lu.perm_c)
    sign *= -1.0 if np.count_nonzero(diagonal < 0.0) % 2 else 1.0
    solution = np.empty_like(rhs)
    solution[order] = lu.solve(np.ascontiguousarray(rhs[order]))
    return sign, solution


def _solve(
    W: Array, rows: Array, rows_y: Array, right: Array, gap: Array, sigma: Array, m: int,
    dx: Array, dy: Array,
) -> float:  # fmt: skip
    """Solve the condensed system that is closed by sigma, as `kernels.solve` does."""
    count, n, q = len(W), len(sigma), dy.shape[1]
    top = (m - 1) * n
    # Columns: x_j, x_0, x_(j+1), y, right side.
    block = np.zeros((2 * n + q, 3 * n + q + 1))
    block[:n, :n], block[:n, n : 2 * n] = np.eye(n), -np.eye(n)
    block[2 * n :, :n] = rows[:, 0]
    block[2 * n :, 3 * n : -1], block[2 * n :, -1] = rows_y, right
    sign, stores = 1.0, []
    for j in range(count):
        inside = rows[:, j * m + 1 : (j + 1) * m].reshape(q, top)
        block[n : 2 * n, :n] = -W[j, top:, :n]
        block[n : 2 * n, n : 2 * n] = 0.0
        block[n : 2 * n, 2 * n : 3 * n] = np.eye(n)
        block[n : 2 * n, 3 * n : -1] = -W[j, top:, n:-1]
        block[n : 2 * n, -1] = W[j, top:, -1]
        block[2 * n :, 2 * n : 3 * n] = rows[:, (j + 1) * m]
        block[2 * n :, :n] += inside @ W[j, :top, :n]
        block[2 * n :, 3 * n : -1] += inside @ W[j, :top, n:-1]
        block[2 * n :, -1] -= inside @ W[j, :top, -1]
        lu, swaps, info = lapack.dgetrf(block[: 2 * n, :n])
        if info != 0 or not np.isfinite(lu).all():
            return 0.0
        sign *= _sign(np.diagonal(lu), swaps)
        rest = block[:, n:].copy()
        for i, other in enumerate(swaps):
            if other != i:
                rest[[i, other]] = rest[[other, i]]
        upper = lapack.dtrtrs(lu[:n], rest[:n], lower=1, unitdiag=1)[0]
        border = lapack.dtrtrs(lu[:n], block[2 * n :, :n].T, lower=0, trans=1)[0].T
        rest[n : 2 * n] -= lu[n:] @ upper
        rest[2 * n :] -= border @ upper
        stores.append((lu[:n], upper))
        # x_(j+1) takes the place of x_j.
        block[:n, :n], block[2 * n :, :n] = rest[n : 2 * n, n : 2 * n], rest[2 * n :, n : 2 * n]
        block[:n, n : 2 * n], block[2 * n :, n : 2 * n] = rest[n : 2 * n, :n], rest[2 * n :, :n]
        block[:n, 2 * n : 3 * n], block[2 * n :, 2 * n : 3 * n] = 0.0, 0.0
        block[:n, 3 * n :], block[2 * n :, 3 * n :] = (
            rest[n : 2 * n, 2 * n :],
            rest[2 * n :, 2 * n :],
        )
    ends = np.concatenate([np.arange(n), np.arange(2 * n, 2 * n + q)])
    D = np.hstack([sigma * block[ends, :n] + block[ends, n : 2 * n], block[ends, 3 * n : -1]])
    sides = np.zeros((n + q, 2))
    sides[:, 0] = block[ends, -1] - block[ends, :n] @ gap
    sides[-1, 1] = 1.0
    size = np.max(np.abs(D), axis=1)
    if not np.isfinite(size).all() or not size.min() > 0.0:
        return 0.0
    lu, swaps, info = lapack.dgetrf(D / size[:, None])
    if info != 0:
        return 0.0
    sign *= _sign(np.diagonal(lu), swaps)
    found = lapack.dgetrs(lu, swaps, sides / size[:, None])[0]
    dy[:] = found[n:].T
    first, after = found[:n], sigma[:, None] * found[:n]
    after[:, 0] += gap
    dx[:, 0], dx[:, count * m] = first.T, after.T
    whole = np.array([1.0, 0.0])  # of right sides, the second solution has the last alone
    for j in range(count - 1, 0, -1):
        lu, upper = stores[j]
        known = np.outer(upper[:, -1], whole) - upper[:, :n] @ first - upper[:, n : 2 * n] @ after
        after = lapack.dtrtrs(lu, known - upper[:, 2 * n : -1] @ found[n:], lower=0)[0]
        dx[:, j * m] = after.T
    for j in range(count):
        inside = W[j, :top, :n] @ dx[:, j * m].T + W[j, :top, n:-1] @ found[n:]
        inside += np.outer(W[j, :top, -1], whole)
        dx[:, j * m + 1 : (j + 1) * m] = inside.T.reshape(2, m - 1, n)
    return sign
