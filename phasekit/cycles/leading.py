"""Floquet multipliers of very many states: those near and outside the unit circle alone.

Their invariant subspace is found by a scheme that takes fast decays to zero, whose errors are of
the order 2m - 1. With rows that belong to it, what the orbit's own scheme makes of that subspace
gives them to the order 2m: errors of both subspaces enter by their product alone.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from phasekit.arrays import Array, Complex
from phasekit.cycles.sparse import FORMED, formed
from phasekit.numerics.factors import is_definite

PASSES = 12
COLUMNS = 12  # of the first subspace in which these are looked for
CONVERGED = 1e-9  # residual of a multiplier, beside its size, that is rounding
INSIDE = 1e-2  # size of multipliers that stay inside the unit circle, whatever their digits
LOST = 0.1  # relative difference of a multiplier by two schemes, from which on it is not known
BACK = 3  # passes for the rows, each of which leaves the part INSIDE of others
BESIDE, ONE = 8, 1.0 + 1e-9  # passes for what grows beside the subspace, and a size that grows
APEX = 3.0  # rate times length of an interval up to which all is resolved


@dataclass(frozen=True)
class Carried:
    """What takes columns over a period, by two schemes."""

    damped: Callable[[Array], Array]  # which takes fast decays to zero, but fast growth, too
    back: Callable[[Array], Array]  # its transpose
    own: Callable[[Array], Array]  # which does neither
    calm: Callable[[], bool] = bool  # whether all that intervals do not resolve is known to decay
    grows: Callable[[], bool] = bool  # whether some of it grows somewhere, and may decay elsewhere


def leading(carried: Callable[[Array], Array], n: int) -> Complex | None:
    """Multipliers, largest first; those of no size to speak of are 0. None: they are too many."""
    found = _iterated(carried, n)
    if found is None:
        return None
    values, held = found[2:]
    out = np.zeros(n, dtype=complex)
    out[: np.sum(held)] = sorted(values[held], key=abs, reverse=True)
    return out


def _iterated(
    carried: Callable[[Array], Array], n: int
) -> tuple[Array, Array, Complex, npt.NDArray[np.bool_]] | None:
    """Subspace iteration, with as many columns as bring one multiplier below `INSIDE`.

    Until the residuals of all above are rounding: the basis Q, Q^T Z of what it is carried to, its
    eigenvalues, and which have converged. None if they do not.
    """
    rng = np.random.default_rng(7)
    columns = COLUMNS
    while columns <= n // 2:
        # By chance alone columns hold next to nothing of a few vectors among very many.
        Q = carried(rng.normal(size=(n, columns)))
        for _ in range(PASSES):
            if not np.isfinite(Q).all():
                return None
            Q = np.linalg.qr(Q)[0]
            Z = carried(Q)
            if not np.isfinite(Z).all():
                return None
            within = Q.T @ Z
            values, vectors = np.linalg.eig(within)
            sizes = np.abs(values)
            off = np.linalg.norm(Z @ vectors - Q @ vectors * values, axis=0)
            held = off <= CONVERGED * sizes
            if np.all(held | (sizes < INSIDE)):
                if np.min(sizes) >= INSIDE:
                    break  # more columns
                return Q, within, values, held
            Q = Z
        columns *= 2
    return None


def through(G: Array, Z: Array) -> Array:
    """G_N ... G_1 Z."""
    with np.errstate(all="ignore"):
        for one in G:
            Z = one @ Z
    return Z


def carried_multipliers(ways: Carried, flow: Array | None, n: int) -> tuple[Complex, float]:
    """Multipliers, largest first, and the error of the one that belongs to a flow, if there is one.

    Those of no size to speak of are 0; NaN where both schemes disagree, and all of them where
    something grows faster than they resolve.
    """
    out = np.full(n, np.nan, dtype=complex)
    found = _iterated(ways.damped, n)
    if found is None:  # of waves all have a size
        whole = formed(ways.damped, n)
        if not np.isfinite(whole).all():
            return out, np.nan
        Q, within = np.eye(n), whole
    else:
        Q, within = found[:2]
    V = Q @ _large(within)
    if not V.size:  # all decay
        trivial = 0.0 if flow is None else np.nan
        known = _decays(ways, V, lambda columns: columns[:0])
        return np.zeros(n, dtype=complex) if known else out, trivial
    left = V
    for _ in range(BACK):
        left = np.linalg.qr(ways.back(left))[0]
    products = left.T @ V

    if not np.linalg.cond(products) < 1.0 / np.finfo(float).eps:
        return out, np.nan

    def inside(columns: Array) -> Array:
        return np.asarray(np.linalg.solve(products, left.T @ columns))

    at = None if flow is None else inside(flow[:, None])
    first, _ = _across_flow(inside(ways.damped(V)), at)
    second, trivial = _across_flow(inside(ways.own(V)), at)
    if not np.isfinite(second).all() or not _decays(ways, V, inside):
        return out, trivial
    apart = np.abs(first[:, None] - second).min(axis=0)
    hidden = (apart > LOST * np.abs(second)) & (np.abs(second) >= INSIDE)
    out[:] = 0.0
    out[: len(second)] = np.where(hidden, np.nan, second)
    out = out[np.argsort(-np.abs(out), kind="stable")]  # those that are not known last
    return out, trivial


def _large(within: Array) -> Array:
    """An orthonormal basis of the invariant subspace of the multipliers that have a size."""
    from scipy.linalg import schur

    _, U, count = schur(within, sort=lambda re, im: abs(complex(re, im)) >= INSIDE)
    return np.asarray(U[:, :count])


def _across_flow(matrix: Array, flow: Array | None) -> tuple[Complex, float]:
    """Eigenvalues of a matrix, that of a flow, a column, apart from the others, and its error.

    So it is as accurate at folds, where another one is 1, too.
    """
    if flow is None:
        known = bool(np.isfinite(matrix).all())
        first = np.linalg.eigvals(matrix) if known else np.full(len(matrix), np.nan)
        return first.astype(complex)[np.argsort(-np.abs(first), kind="stable")], 0.0
    if not (np.isfinite(matrix).all() and np.isfinite(flow).all() and np.any(flow)):
        return np.full(len(matrix), np.nan, dtype=complex), np.nan
    turn = np.linalg.qr(flow, mode="complete")[0]
    turned = turn.T @ matrix @ turn
    values: Complex = np.append(turned[0, 0], np.linalg.eigvals(turned[1:, 1:])).astype(complex)
    error = float(abs(turned[0, 0] - 1.0)) + float(np.linalg.norm(turned[1:, 0]))
    return values[np.argsort(-np.abs(values), kind="stable")], error


def _decays(ways: Carried, V: Array, inside: Callable[[Array], Array]) -> bool:
    """Whether nothing grows that is not in a subspace, in its scheme.

    Of very many states by Arnoldi's method, which sees no growth next to 1 among many decays.
    """
    if ways.calm():
        return True
    if ways.grows():
        return False
    carried = ways.own
    if len(V) <= FORMED:
        basis = np.eye(len(V))
    else:
        Z = np.random.default_rng(11).normal(size=(len(V), 2))
        basis = np.empty((len(V), 0))
        for _ in range(BESIDE):
            Z = Z - V @ inside(Z)
            Z = np.linalg.qr(np.hstack([basis, Z]))[0][:, basis.shape[1] :]
            basis = np.hstack([basis, Z])
            Z = carried(Z)
            if not np.isfinite(Z).all():
                return False
    whole = carried(basis)
    whole = basis.T @ (whole - V @ inside(whole))
    known = bool(np.isfinite(whole).all())
    return known and bool(np.max(np.abs(np.linalg.eigvals(whole))) <= ONE)


def fast_ones_decay(matrices: list[Any], lengths: Array, scale: Array) -> bool:
    """Whether all rates that intervals do not resolve are known to be those of decays.

    Numerical ranges of the derivatives lie in a sector of 90 degrees around the negative axis,
    whose apex is a rate that intervals resolve: where Hermitian matrices are positive definite.
    """
    import scipy.sparse as sp

    n = len(scale)
    for one, length in zip(matrices, lengths.tolist(), strict=True):
        entries = sp.coo_array(one * length)
        values = entries.data * scale[entries.col] / scale[entries.row]
        scaled = sp.csc_array((values, (entries.row, entries.col)), shape=(n, n))
        turned = sp.csc_array(scaled.T)
        tilted = 0.5 * (scaled + turned) + 0.5j * (scaled - turned)
        if not is_definite(sp.csc_array(APEX * sp.eye_array(n) - tilted)):
            return False
    return True


def some_grow(matrices: list[Any], lengths: Array) -> bool:
    """Whether rates that intervals do not resolve grow at a place; not asked of very many states.

    A scheme leaves almost all of the size of what decays slower elsewhere, if that is fast, too.
    """
    if matrices[0].shape[0] > FORMED:
        return False
    for one, length in zip(matrices, lengths.tolist(), strict=True):
        whole = one.toarray() * length
        if not np.isfinite(whole).all() or np.max(np.linalg.eigvals(whole).real) > APEX:
            return True
    return False
