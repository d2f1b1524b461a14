"""Points at which several real eigenvalues of many states vanish at once, as symmetries have it.

With columns W and rows V next to both null spaces of f_x, k of each,

    [f_x W; V 0] (Phi, G) = (0, 1),  [f_x W; V 0] (y, g) = (f_p, 0),

f_u takes the k + 1 vectors (Phi, 0) and (-y, 1) to -W G and W g, which vanish where its rank is
n - k ([Govaerts2000] chapter 3). The point is found by the Gauss-Newton method, as in
`points.singular`, and the directions of its branches by the same reduced equations.
"""

from __future__ import annotations

import functools
from dataclasses import dataclass
from itertools import combinations_with_replacement as tuples
from itertools import permutations
from typing import Any

import numpy as np
import scipy.sparse as sp

from phasekit.arrays import Array
from phasekit.bifurcation.continuation.large.curve import ROUNDING, LargeCurve
from phasekit.bifurcation.continuation.large.forms import Forms
from phasekit.bifurcation.continuation.large.path import Between
from phasekit.bifurcation.continuation.large.singular import (
    NOTHING,
    OFF,
    STEPS,
    has_settled,
    interval_of,
)
from phasekit.bifurcation.continuation.points.directions import reduced_rays
from phasekit.bifurcation.continuation.points.special import CONVERGED, GUESS, Special
from phasekit.numerics.factors import Factors

BESIDE = 1e-6  # of others, up to which eigenvalues may vanish with one that does
TOGETHER, ROUNDS = 12, 8  # vectors of an inverse iteration, and its rounds
LEAST = 0.01  # of a direction, which its part among null vectors exceeds


@dataclass(frozen=True)
class Kernel:
    """Null vectors of f_u next to a point where it loses rank.

    Attributes
    ----------
    right : ndarray, shape (n + 1, k + 1)
        The last one alone moves the parameter.
    left : ndarray, shape (n, k)
    columns : ndarray, shape (n, k)
        W, on which the left ones are one.
    defects : ndarray, shape (k, k + 1)
        What f_u makes of the right ones, in terms of W.
    factors : Factors
        Of the bordered f_x.
    """

    right: Array
    left: Array
    columns: Array
    defects: Array
    factors: Factors

    @classmethod
    def next_to(cls, matrix: Any, slope: Array, columns: Array, rows: Array) -> Kernel:
        """That of a matrix, with a border."""
        n, k = columns.shape
        border = [[matrix, sp.csc_array(columns)], [sp.csc_array(rows.T), None]]
        factors = Factors(sp.csc_array(sp.block_array(border, format="csc")))
        sides = np.zeros((n + k, k + 1))
        sides[n:, :k], sides[:n, k] = np.eye(k), slope
        found = factors.solve(sides)
        left = factors.solve_transposed(np.ascontiguousarray(sides[:, :k]))[:n]
        right = np.zeros((n + 1, k + 1))
        right[:n, :k], right[:n, k], right[n, k] = found[:n, :k], -found[:n, k], 1.0
        defects = np.column_stack([-found[n:, :k], found[n:, k]])
        return cls(right, left, columns, defects, factors)

    def solve(self, side: Array) -> Array:
        """A solution of the bordered system, with zeros below."""
        return self.factors.solve(np.append(side, np.zeros(self.columns.shape[1])))


def multiple_point(curve: LargeCurve, chord: Between, k: int) -> Special | None:
    """The point on a chord at which k real eigenvalues vanish at once; None if there is none."""
    middle = chord.point(0.5)
    return None if middle is None else _point_beside(curve, chord, middle.u, k)


def multiple_instead(curve: LargeCurve, chord: Between, u: Array) -> Special | None:
    """The point at which others vanish with the eigenvalue that does at a point; None: none do."""
    sizes, _, _ = vectors_next_to_zero(curve.derivatives(u)[0])
    k = int(np.sum(sizes <= BESIDE * np.max(sizes)))
    return _point_beside(curve, chord, u, k) if k > 1 else None


def vectors_next_to_zero(matrix: Any) -> tuple[Array, Array, Array]:
    """Vectors that a matrix makes small, and how small; and those that its transpose does.

    By inverse iteration with several at once, which finds as many of a multiple eigenvalue.
    """
    n, factors, rng = matrix.shape[0], Factors(matrix), np.random.default_rng(7)
    found = []
    for solve, operand in ((factors.solve, matrix), (factors.solve_transposed, matrix.T)):
        x = rng.normal(size=(n, min(TOGETHER, n)))
        for _ in range(ROUNDS):
            x = np.linalg.qr(solve(np.ascontiguousarray(x)))[0]
        _, sizes, turn = np.linalg.svd(operand @ x, full_matrices=False)
        found.append((sizes[::-1], (x @ turn.T)[:, ::-1]))
    return found[0][0], found[0][1], found[1][1]


def _point_beside(curve: LargeCurve, chord: Between, start: Array, k: int) -> Special | None:
    """The point of corank k next to another one of the chord."""
    matrix = curve.derivatives(start)[0]
    _, right, left = vectors_next_to_zero(matrix)
    if right.shape[1] < k or not (np.isfinite(right).all() and np.isfinite(left).all()):
        return None
    size = float(np.max(np.abs(matrix.data)))
    columns, rows = size * left[:, :k], size * right[:, :k]
    found = _refined(curve, start, columns, rows, chord.length)
    if found is None:
        return None
    u, kernel = found
    part = chord.part(u - chord.a)
    if not -OFF <= part <= 1.0 + OFF:
        return None
    weight = np.sqrt(curve.weight)
    # Of unit length and orthogonal; of the last one, what is not along others is left.
    basis = np.linalg.qr(weight[:, None] * kernel.right)[0] / weight[:, None]
    tangents, message = _tangents(curve, u, kernel, basis)
    interval = interval_of(curve, chord.a, chord.a + chord.chord)
    residual = float(np.max(np.abs(curve.value(u))))
    along = curve.weight * chord.chord
    if not tangents:
        return Special(
            "branch_point", u, interval, residual, GUESS, message or "no branch was found", {},
            tangent=chord.chord / chord.length, corank=k,
        )  # fmt: skip
    own = int(np.argmax([abs(float(along @ t)) for t in tangents]))
    sign = 1.0 if along @ tangents[own] >= 0.0 else -1.0
    return Special(
        "branch_point", u, interval, residual, CONVERGED, message, {},
        tangent=sign * tangents[own],
        others=tuple(t for i, t in enumerate(tangents) if i != own),
        extra=np.ascontiguousarray(basis[:, :k].T), corank=k,
    )  # fmt: skip


def _refined(
    curve: LargeCurve, start: Array, columns: Array, rows: Array, reach: float
) -> tuple[Array, Kernel] | None:
    """The Gauss-Newton method on f + W b = 0, defects = 0: the point and its null vectors."""
    n, k = columns.shape
    u, b, before = np.array(start), np.zeros(k), np.inf
    for _ in range(STEPS):
        value = curve.value(u)
        matrix, slope = curve.derivatives(u)
        if not (np.isfinite(value).all() and np.isfinite(matrix.data).all()):
            return None
        kernel = Kernel.next_to(matrix, slope, columns, rows)
        rest = kernel.solve(-value - columns @ b)
        if not (np.isfinite(kernel.right).all() and np.isfinite(rest).all()):
            return None
        still, forms = np.append(rest[:n], 0.0), Forms(curve, u)
        unit = 1.0 / np.array([curve.length(z) for z in kernel.right.T])
        bent, side = np.empty((k + 1, k, k + 1)), np.empty((k + 1, k))
        for j, z in enumerate(kernel.right.T):
            z = np.ascontiguousarray(z)
            for i in range(j + 1):
                found = kernel.left.T @ forms.second(z, kernel.right[:, i])
                bent[i, :, j] = bent[j, :, i] = found * unit[i] * unit[j]
            side[j] = -unit[j] * (kernel.defects[:, j] + kernel.left.T @ forms.second(z, still))
        size = float(np.max(np.abs(bent)))
        if not (size > 0.0 and np.isfinite(size) and np.isfinite(side).all()):
            return None
        alpha = unit * np.linalg.lstsq(bent.reshape(-1, k + 1), side.ravel(), rcond=1e-11)[0]
        step = still + kernel.right @ alpha
        b = b + rest[n:] - kernel.defects @ alpha
        u = u + step
        length = curve.length(step)
        if not np.isfinite(length) or curve.length(u - start) > 2.0 * reach:
            return None
        if has_settled(length, before):
            # Equations are more than unknowns: beside two points that differ some are left.
            rounding = np.abs(kernel.left).T @ (ROUNDING * curve.terms(matrix, slope, u))
            meets = np.all(np.abs(b) <= OFF * size * reach**2 + rounding)
            if not meets or np.max(np.abs(side)) > OFF * size * reach:
                return None
            return u, Kernel.next_to(*curve.derivatives(u), columns, rows)
        before = length
    return None


def _tangents(curve: LargeCurve, u: Array, kernel: Kernel, basis: Array) -> tuple[list[Array], str]:
    """Unit tangents of the branches through the point, and what is unclear.

    The columns of the basis are null vectors of f_u, the last of which alone moves the parameter.
    """
    k = kernel.columns.shape[1]
    vectors = [np.ascontiguousarray(v) for v in basis.T]
    w, forms = kernel.left.T, Forms(curve, u)

    def reduced(value: Array) -> Array:
        """The part along the left null vectors, where it is more than rounding."""
        found = w @ value
        return np.where(np.abs(found) <= NOTHING * (np.abs(w) @ np.abs(value)), 0.0, found)

    q, slaved = np.zeros((k, k + 1, k + 1)), {}
    for i, j in tuples(range(k + 1), 2):
        bent = forms.second(vectors[i], vectors[j])
        q[:, i, j] = q[:, j, i] = 0.5 * reduced(bent)
        if j < k:
            slaved[i, j] = -kernel.solve(bent)[: curve.n]

    @functools.cache
    def third(a: int, b: int, c: int) -> Array:
        """C on three vectors in order: by polarisation where they differ."""
        x, y, z = (vectors[i] for i in (a, b, c))
        if b in (a, c):
            return forms.third(y, z if a == b else x)
        return 0.25 * (forms.third(x + y, z) - forms.third(x - y, z))

    cubic = np.zeros((k, k, k, k))
    for a, b, c in tuples(range(k), 3):
        total = third(a, b, c)
        for one, pair in ((a, (b, c)), (b, (a, c)), (c, (a, b))):
            total = total + forms.second(vectors[one], slaved[pair])
        for i, j, m in set(permutations((a, b, c))):
            cubic[:, i, j, m] = reduced(total) / 6.0
    rays, _, message = reduced_rays(q, cubic, moves=True)
    tangents = [basis @ y for y in rays]
    return [t / curve.length(t) for t in tangents], message


def kernel_part(curve: LargeCurve, kernel: Array, along: Array) -> Array | None:
    """The part of states along null vectors, rows of unit length; None if it is next to none."""
    whole = np.append(along, 0.0)
    part = np.asarray(kernel.T @ (kernel @ (curve.weight * whole)))
    return part if curve.length(part) > LEAST * curve.length(whole) else None
