"""Defining systems of curves and points of equilibria: G(u) = 0 with its Jacobian.

The unknowns are u = (x, p, ...) with the state x, the free parameters p and what else a kind needs:

- EQUILIBRIUM: f(x, p) = 0.
- FOLD: f = 0, f_x v = 0, v.v = 1 with u = (x, p, v).
- HOPF: f = 0, (f_x^2 + k) v = 0, v.v = 1, l.v = 0 with u = (x, p, v, k): eigenvalues +-sqrt(-k),
  so a Hopf point where k = omega^2 > 0 and a neutral saddle where k < 0; l is held fixed.
- BRANCH: f + b w = 0, w f_x = 0, w f_q = 0, w.w = 1 with u = (x, p, w, b), q the first free
  parameter: a branch point where b = 0, which with three free parameters is one more equation.
- EVENT: f = 0, g = 0 with u = (x, p), g a function of the user's, which comes with its derivatives
  as ``second``.

Of a map A the field is f = A - x, so that multipliers -1 and exp(+-i theta) are

- FLIP: f = 0, (f_x + 2) v = 0, v.v = 1 with u = (x, p, v).
- TORUS: f = 0, (f_x^2 + k f_x + k) v = 0, v.v = 1, l.v = 0 with u = (x, p, v, k): the matrix is
  A^2 - (2 - k) A + 1, so k = 2 - 2 cos theta between 0 and 4, and two real multipliers with the
  product 1 elsewhere.

Norms of v and w are taken in units of their scales. With one free parameter all but
EQUILIBRIUM are square and define a point; with two they define a curve ([Govaerts2000] chapters 4
and 6, [Kuznetsov2004] chapters 9 and 10), as with three those of branch points do.

Everything lies in one flat work array: what `places` returns is where each piece begins.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from phasekit.arrays import Array
from phasekit.numerics.compile import kernel, routine
from phasekit.numerics.differences import DERIVED, bend, jet, spare_size
from phasekit.numerics.native import FEW, call, twin

# The state of a trace, all that it needs to go on as if it had never stopped, stands at the head
# of the work array: these vectors of unknowns, these numbers, and the vector l of a Hopf curve.
VECTORS = 7
POINT, TANGENT, BEFORE, SCALE, WEIGHT, START, START_TANGENT = range(VECTORS)

# Next step, last step (0: none that counts), arclength, points so far, the sign of the determinant
# at the last point (0: not known) and of the last matrix, and what Newton's second step was in
# units of the square of its first.
NUMBERS = 8
NEXT, LAST, LENGTH, DONE, SIDE, SIGN, QUADRATIC = range(7)


EQUILIBRIUM, FOLD, HOPF, BRANCH, FLIP, TORUS, EVENT = range(7)
#: Curves on which no eigenvalue is critical all along.
REGULAR = (EQUILIBRIUM, EVENT)


def unknowns(kind: int, n: int, free: int) -> int:
    """Number of unknowns of a defining system."""
    return n + free + (0, n, n + 1, n + 1, n, n + 1, 0)[kind]


def equations(kind: int, n: int, free: int) -> int:
    """Number of equations of a defining system."""
    if kind in REGULAR:
        return n + (kind == EVENT)
    return 2 * n + (1, 2)[kind not in (FOLD, FLIP)] + (kind == BRANCH and free == 3)


def work_size(kind: int, n: int, free: int) -> int:
    """Length of the work array."""
    size, rows = unknowns(kind, n, free), equations(kind, n, free)
    m = n + free
    kept = VECTORS * size + NUMBERS + n
    return (
        kept
        + 6 * size
        + size * size
        + 2 * size
        + n
        + n * m
        + rows
        + rows * size
        + (n * m + n * n + m + spare_size(n, m))
    )


@routine
def places(kind: int, n: int, free: int) -> tuple[int, ...]:
    """Where the pieces of the work array begin.

    In order: l, six vectors, matrix and right sides of a Newton step, f with its derivatives and,
    right after them, what `bend` gives; G and its Jacobian, a square, a direction z, spare vectors.
    """
    m = n + free
    size = m
    rows = n
    if kind == FOLD or kind == FLIP:
        size = m + n
        rows = 2 * n + 1
    elif kind == EVENT:
        rows = n + 1
    elif kind != EQUILIBRIUM:
        size = m + n + 1
        rows = 2 * n + 2
        if kind == BRANCH and free == 3:
            rows += 1
    aux = VECTORS * size + NUMBERS
    vectors = aux + n
    matrix = vectors + 6 * size
    right = matrix + size * size
    jet_ = right + 2 * size
    bent = jet_ + n + n * m
    g = bent + n * m
    jacobian = g + rows
    if kind == EQUILIBRIUM:  # f and its derivatives are the system
        g = jet_
        jacobian = jet_ + n
    square = bent + n * m + rows + rows * size
    z = square + n * n
    spare = z + m
    return size, rows, aux, vectors, matrix, right, jet_, g, jacobian, bent, square, z, spare


def _evaluate(
    first: Any, second: Any, mode: int, kind: int, n: int, par: Array, active: Any, w: Array, u: int
) -> None:
    size, rows, aux, _, _, _, base, g, jac, bent, square, z, spare = places(kind, n, active.size)
    scale = SCALE * size
    m = n + active.size
    v = u + m
    f = base
    if kind == EQUILIBRIUM:
        jet(first, mode, n, w, u, par, active, scale, f, spare)
        return
    if kind == EVENT:
        jet(first, mode, n, w, u, par, active, scale, f, spare)
        call(second, w, u, par, u, spare)
        for i in range(rows):
            w[g + i] = w[f + i] if i < n else w[spare]
            for j in range(m):
                w[jac + i * m + j] = w[base + n + i * m + j] if i < n else w[spare + 1 + j]
        return
    for i in range(m):
        w[z + i] = w[v + i] if i < n and kind != BRANCH else 0.0
    if kind == BRANCH or mode != DERIVED:
        jet(first, mode, n, w, u, par, active, scale, f, spare)
    if kind != BRANCH:
        bend(first, second, mode, n, w, u, par, active, scale, z, f, spare)
    base += n  # the derivatives
    for i in range(rows * size):
        w[jac + i] = 0.0
    for i in range(n):
        w[g + i] = w[f + i]
        for j in range(m):
            w[jac + i * size + j] = w[base + i * m + j]
    last = rows - 1
    w[g + last] = -1.0
    for i in range(n):  # the norm of v in units of its own scales
        part = w[v + i] / w[scale + m + i]
        w[g + last] += part * part
        w[jac + last * size + m + i] = 2.0 * part / w[scale + m + i]
    extra = w[u + size - 1]
    if kind == BRANCH:
        for i in range(n):
            w[g + i] += extra * w[v + i]
            w[jac + i * size + m + i] = extra
            w[jac + i * size + m + n] = w[v + i]
        for k in range(n + 1):
            w[z + k] = 1.0
            bend(first, second, mode, n, w, u, par, active, scale, z, f, spare)
            w[z + k] = 0.0
            row = jac + (n + k) * size
            w[g + n + k] = 0.0
            for i in range(n):
                w[g + n + k] += w[v + i] * w[base + i * m + k]
                w[row + m + i] = w[base + i * m + k]
                for j in range(m):
                    w[row + j] += w[v + i] * w[bent + i * m + j]
        if active.size == 3:
            w[g + last - 1] = extra
            w[jac + (last - 1) * size + size - 1] = 1.0
        return
    for i in range(n):  # f_x v
        w[z + i] = 0.0
        for j in range(n):
            w[z + i] += w[base + i * m + j] * w[v + j]
    if kind == FOLD or kind == FLIP:
        shift = 2.0 if kind == FLIP else 0.0
        for i in range(n):
            row = jac + (n + i) * size
            w[g + n + i] = w[z + i] + shift * w[v + i]
            for j in range(m):
                w[row + j] = w[bent + i * m + j]
            for j in range(n):
                w[row + m + j] = w[base + i * m + j]
            w[row + m + i] += shift
        return
    pair_rows(first, second, mode, kind, n, par, active, w, u)


@twin(_evaluate)
def evaluate(
    first: Any, second: Any, mode: int, kind: int, n: int, par: Array, active: Any, w: Array, u: int
) -> None:
    """G and its Jacobian at the unknowns that begin at u, into their places."""
    if n <= FEW or kind in REGULAR:
        _evaluate(first, second, mode, kind, n, par, active, w, u)
        return
    size, rows, aux, _, _, _, f, g, jac, bent, _, z, spare = places(kind, n, active.size)
    m, scale = n + active.size, SCALE * size
    v, extra = w[u + m : u + m + n], w[u + size - 1]
    G, J = w[g : g + rows], w[jac : jac + rows * size].reshape(rows, size)
    base = f + n
    slopes, bends = (w[k : k + n * m].reshape(n, m) for k in (base, bent))
    direction = w[z : z + m]
    direction[:] = 0.0
    if kind != BRANCH:
        direction[:n] = v
    if kind == BRANCH or mode != DERIVED:
        jet(first, mode, n, w, u, par, active, scale, f, spare)
    if kind != BRANCH:
        bend(first, second, mode, n, w, u, par, active, scale, z, f, spare)
    J[:] = 0.0
    G[:n], J[:n, :m] = w[f:base], slopes
    sizes = w[scale + m : scale + m + n]
    part = v / sizes  # the norm of v in units of its own scales
    G[-1], J[-1, m : m + n] = part @ part - 1.0, 2.0 * part / sizes
    own = np.arange(n)
    if kind == BRANCH:
        G[:n] += extra * v
        J[own, m + own] = extra
        J[:n, m + n] = v
        for k in range(n + 1):
            direction[k] = 1.0
            bend(first, second, mode, n, w, u, par, active, scale, z, f, spare)
            direction[k] = 0.0
            J[n + k, :m] = v @ bends
        G[n : 2 * n + 1] = v @ slopes[:, : n + 1]
        J[n : 2 * n + 1, m : m + n] = slopes[:, : n + 1].T
        if active.size == 3:
            G[-2], J[-2, -1] = extra, 1.0
        return
    shift = {FLIP: 2.0, TORUS: extra}.get(kind, 0.0)
    linear = slopes[:, :n].copy()
    direction[:n] = linear @ v
    if kind in (FOLD, FLIP):
        J[n : 2 * n, :m] = bends
        linear[own, own] += shift
        J[n : 2 * n, m:] = linear
        G[n : 2 * n] = direction[:n] + shift * v
        return
    # The equations of a pair and the phase of v; the norm is the last one.
    shifted = linear.copy()
    shifted[own, own] += shift
    J[n : 2 * n, :m] = shifted @ bends
    square = shifted @ linear
    square[own, own] += extra
    J[n : 2 * n, m : m + n] = square
    J[n : 2 * n, m + n] = v + (direction[:n] if kind == TORUS else 0.0)
    G[n : 2 * n] = square @ v
    bend(first, second, mode, n, w, u, par, active, scale, z, f, spare)
    J[n : 2 * n, :m] += bends
    phase = w[aux : aux + n]
    G[2 * n], J[2 * n, m : m + n] = phase @ v, phase


@routine
def pair_rows(
    first: Any, second: Any, mode: int, kind: int, n: int, par: Array, active: Any, w: Array, u: int
) -> None:
    """The equations of a pair and the phase of v; z is f_x v, the norm is there already."""
    size, _, aux, _, _, _, f, g, jac, bent, _, z, spare = places(kind, n, active.size)
    scale = SCALE * size
    m = n + active.size
    v = u + m
    base = f + n  # the derivatives
    extra = w[u + size - 1]
    shift = extra if kind == TORUS else 0.0
    for i in range(n):
        row = jac + (n + i) * size
        for k in range(n):
            value = w[base + i * m + k] + (shift if i == k else 0.0)
            for j in range(m):
                w[row + j] += value * w[bent + k * m + j]
            for j in range(n):
                w[row + m + j] += value * w[base + k * m + j]
        w[row + m + i] += extra
        w[row + m + n] = w[v + i] + (w[z + i] if kind == TORUS else 0.0)
        w[g + n + i] = 0.0
        for j in range(n):
            w[g + n + i] += w[row + m + j] * w[v + j]
    bend(first, second, mode, n, w, u, par, active, scale, z, f, spare)
    row = jac + 2 * n * size
    w[g + 2 * n] = 0.0
    # The norm of v is the last equation, the phase the one before it.
    for i in range(n):
        for j in range(m):
            w[jac + (n + i) * size + j] += w[bent + i * m + j]
        w[g + 2 * n] += w[aux + i] * w[v + i]
        w[row + m + i] = w[aux + i]


@kernel
def first_derivatives(
    first: Any, mode: int, n: int, w: Array, u: int, par: Array, active: Any, scale: int, out: int,
    spare: int,
) -> None:  # fmt: skip
    """`jet`, called from outside."""
    jet(first, mode, n, w, u, par, active, scale, out, spare)


@kernel
def second_derivatives(
    first: Any, second: Any, mode: int, n: int, w: Array, u: int, par: Array, active: Any,
    scale: int, z: int, out: int, spare: int,
) -> None:  # fmt: skip
    """`bend`, called from outside."""
    bend(first, second, mode, n, w, u, par, active, scale, z, out, spare)


@kernel
def bend_all(
    first: Any, second: Any, mode: int, n: int, par: Array, active: Any, scale: Array,
    points: Array, directions: Array, out: Array,
) -> None:  # fmt: skip
    """The derivatives of f_u z at many points, each with its own z."""
    m = n + active.size
    base = 3 * m
    bent = base + n + n * m
    w = np.zeros(bent + n * m + m + 10 * n)
    for j in range(m):
        w[m + j] = scale[j]
    for k in range(points.shape[0]):
        for j in range(m):
            w[j] = points[k, j]
            w[2 * m + j] = directions[k, j]
        bend(first, second, mode, n, w, 0, par, active, m, 2 * m, base, bent + n * m)
        for j in range(n * m):
            out[k, j] = w[bent + j]
