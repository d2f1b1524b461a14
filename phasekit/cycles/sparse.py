"""Condensed equations of very many states, which are applied and never formed.

Derivatives of f are sparse matrices, an interval of the mesh is one sparse factorisation, and
states at its end follow from those at its beginning by a solution with it. What closes the orbit is
solved by Krylov's method ([Saad2003] chapter 6): where decays are fast all but a few multipliers
are next to nothing, and it takes about as many steps as there are others.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np

from phasekit.arrays import Array
from phasekit.cycles.collocation import Scheme
from phasekit.numerics.memory import refuse

FORMED = 300  # states up to which matrices of all of them are formed at each point of a mesh
SPARSE = 0.1  # part of entries of derivatives that are not zero, up to which they are sparse
SOLVED = 1e-12  # residual of a solution beside its right side
SEEN = 1e-3  # the same of a side by chance, whose space then holds all that decides the sign
COPIES = 4  # of the space of a solution, or of a full matrix: itself, its factors, what they take
PART = 32  # columns of a full matrix that are found at once
LEFT, FLAT = 1e-6, 5  # the most of it where rounding leaves more; steps in which it does not halve


@dataclass(eq=False)
class Slopes:
    """F at Gauss points, its derivatives by states as sparse matrices, and by all else."""

    f: Array  # (points, n)
    matrices: list[Any]  # by columns
    others: Array  # (points, n, active parameters)

    @classmethod
    def nowhere(cls, n: int, points: int, others: int) -> Slopes:
        """What has no value."""
        return cls(np.full((points, n), np.nan), [], np.full((points, n, others), np.nan))

    @cached_property
    def finite(self) -> bool:
        """Whether all of them are."""
        numbers = (self.f, self.others, *(one.data for one in self.matrices))
        return all(bool(np.isfinite(one).all()) for one in numbers)

    @cached_property
    def sparse(self) -> bool:
        """Whether most entries are zero."""
        n = self.f.shape[1]
        return bool(max(one.nnz for one in self.matrices) < SPARSE * n * n)

    @cached_property
    def traces(self) -> Array:
        """Of the derivatives by states."""
        return np.asarray(self.diagonals.sum(axis=1))

    @cached_property
    def diagonals(self) -> Array:
        """Of the derivatives by states, (points, n)."""
        return np.stack([one.diagonal() for one in self.matrices])

    def absolute(self, by: Array) -> Array:
        """Sums over the rows of sizes of entries, times what belongs to their columns."""
        return np.stack([abs(one) @ by[i] for i, one in enumerate(self.matrices)])


@dataclass(eq=False)
class Condensed:
    """All places of each interval by the states at its beginning and some unknowns.

    Places are columns @ unknowns + right + M^-1 (start @ states), in the order of the mesh.
    """

    m: int = 0
    n: int = 0
    scale: Any = None
    factors: Any = ()  # of M, whose order is by states, then by places
    starts: Any = ()
    columns: Any = None  # (intervals, m n, unknowns)
    right: Any = None  # (intervals, m n)

    @property
    def shape(self) -> tuple[int, int]:
        """Intervals, and numbers of each."""
        return self.right.shape[0], self.right.shape[1]

    def fill(
        self, slopes: Slopes, mesh: Array, c: Scheme, scale: Array, y: Array,
        total: Array | None = None,
    ) -> tuple[float, float]:  # fmt: skip
        """Fill them from derivatives and residuals.

        Returns the sign of the determinants, 0 where they are singular, and the trace's integral.
        """
        import scipy.sparse as sp

        from phasekit.numerics.factors import Factors

        value, slope = c.value, c.slope
        m, n, q = c.m, scale.size, y.size
        period = y[0]
        place = np.arange(n)
        i, k = np.indices((m, m)).reshape(2, -1)
        own_rows = (place[:, None] * m + i).ravel()
        own_columns = (place[:, None] * m + k).ravel()
        own = np.tile(slope[i, k + 1], n)
        factors, starts, sign, divergence = [], [], 1.0, 0.0
        columns, right = np.empty((len(mesh) - 1, m * n, q)), np.empty((len(mesh) - 1, m * n))
        order = (place[None, :] * m + np.arange(m)[:, None]).ravel()  # from places to states
        for j, h in enumerate(np.diff(mesh)):
            here = slice(j * m, (j + 1) * m)
            inner, row, column = [own], [own_rows], [own_columns]
            outer: Any = [-np.tile(slope[:, 0], n)], [np.arange(m * n)], [np.repeat(place, m)]
            for g, matrix in enumerate(slopes.matrices[here]):
                places = np.repeat(place, np.diff(matrix.indptr))
                inner.append((-h * period * value[g, 1:, None] * matrix.data).ravel())
                row.append(np.tile(matrix.indices * m + g, m))
                column.append((places * m + np.arange(m)[:, None]).ravel())
                outer[0].append(h * period * value[g, 0] * matrix.data)
                outer[1].append(row[-1][: len(places)])
                outer[2].append(places)
            entries = np.concatenate(inner), (np.concatenate(row), np.concatenate(column))
            try:
                found = Factors(sp.csc_array(entries, shape=(m * n, m * n)))
            except RuntimeError:  # singular, whatever is added to its diagonal
                return 0.0, np.nan
            sign *= found.sign * c.side**n
            factors.append(found)
            data, *spots = (np.concatenate(one) for one in outer)
            starts.append(sp.csr_array((data, tuple(spots)), shape=(m * n, n)))
            rhs = np.empty((m, n, q + 1))
            rhs[:, :, 0] = h * slopes.f[here]
            rhs[:, :, 1:q] = h * period * slopes.others[here, :, : q - 1]
            rhs[:, :, q] = 0.0 if total is None else -total[j]
            ordered = np.empty((m * n, q + 1))
            ordered[order] = rhs.reshape(m * n, -1)
            solution = found.solve(ordered)[order]
            columns[j], right[j] = solution[:, :q], solution[:, q]
            divergence += h * period * float(c.weights @ slopes.traces[here])
        self.m, self.n, self.scale, self.factors, self.starts = m, n, scale, factors, starts
        self.columns, self.right = columns, right
        return sign, divergence

    def bordered(self, unknowns: int, column: Array, *, still: bool) -> Condensed:
        """The same with the first unknowns and another column; ``still`` without a right side."""
        columns = np.concatenate([self.columns[:, :, :unknowns], column[:, :, None]], axis=2)
        return replace(self, columns=columns, right=0.0 * self.right if still else self.right)

    def swept(self, first: Array, unknowns: Array, right: Array) -> Array:
        """All places, (places, n, solutions), from states at the beginning."""
        m, n, count = self.m, self.n, first.shape[1]
        out = np.empty((self.shape[0] * m + 1, n, count))
        out[0] = first
        for j, (factors, start) in enumerate(zip(self.factors, self.starts, strict=True)):
            inside = factors.solve(np.ascontiguousarray(start @ out[j * m]))
            inside = inside.reshape(n, m, count).transpose(1, 0, 2)
            given = self.columns[j] @ unknowns + np.outer(self.right[j], right)
            out[j * m + 1 : (j + 1) * m + 1] = inside + given.reshape(m, n, count)
        return out

    def carried(self, first: Array) -> Array:
        """States a period later, of columns at the beginning: the product of all intervals."""
        at = first
        for factors, start in zip(self.factors, self.starts, strict=True):
            inside = factors.solve(np.ascontiguousarray(start @ at))
            at = inside.reshape(self.n, self.m, first.shape[1])[:, -1]
        return np.asarray(at)

    def carried_back(self, at: Array) -> Array:
        """Rows, as columns, a period earlier: the transposed product of all intervals."""
        for factors, start in zip(self.factors[::-1], self.starts[::-1], strict=True):
            side = np.zeros((self.n, self.m, at.shape[1]))
            side[:, -1] = at
            at = start.T @ factors.solve_transposed(side.reshape(-1, at.shape[1]))
        return np.asarray(at)

    def solve(
        self, rows: Array, rows_y: Array, right: Array, gap: Array, sigma: Array, dx: Array,
        dy: Array,
    ) -> float:  # fmt: skip
        """What `kernels.solve` does."""
        n, q = self.n, rows_y.shape[1]
        flat = rows.reshape(q, -1)
        sizes = np.linalg.norm(flat.reshape(q, -1, n) * self.scale, axis=2).sum(axis=1)
        ends = np.linalg.norm(self.columns[:, -n:] / self.scale[:, None], axis=1).max(axis=0)
        widths = 1.0 / np.where(ends > 0.0, ends, 1.0)
        heights = sizes + np.abs(rows_y) @ widths
        if not (np.isfinite(heights).all() and np.isfinite(ends).all() and heights.min() > 0.0):
            return 0.0
        units, lengths = np.append(self.scale, widths), np.append(self.scale, heights)

        def sides(places: Array, unknowns: Array) -> Array:
            borders = flat @ places.reshape(flat.shape[1], -1) + rows_y @ unknowns
            return np.vstack([sigma[:, None] * places[0] - places[-1], borders])

        def times(z: Array) -> Array:
            whole = units[:, None] * z
            places = self.swept(whole[:n], whole[n:], np.zeros(z.shape[1]))
            return np.asarray(sides(places, whole[n:]) / lengths[:, None])

        one, none = np.ones(1), np.zeros((n, 1))
        known = sides(self.swept(none, np.zeros((q, 1)), one), np.zeros((q, 1)))[:, 0]
        given = np.zeros((n + q, 3))
        given[:, 0] = (np.append(-gap, right) - known) / lengths
        given[-1, 1] = 1.0 / lengths[-1]
        given[:, 2] = np.random.default_rng(7).standard_normal(n + q)
        found, sign = solved(times, given)
        if sign == 0.0:
            return 0.0
        whole = units[:, None] * found
        places = self.swept(whole[:n], whole[n:], np.array([1.0, 0.0]))
        dx[:], dy[:] = places.transpose(2, 0, 1), whole[n:].T
        return sign


def solved(times: Any, sides: Array) -> tuple[Array, float]:
    """Solutions for all right sides but the last, which is by chance; the determinant's sign, or 0.

    By the block method of minimal residuals. Its space holds all vectors by which the matrix
    differs from one with positive eigenvalues once that last side is solved in it, too.
    """
    n, wide = sides.shape
    V, R = np.linalg.qr(sides)
    blocks, H = [V], np.zeros((0, 0))
    sizes = np.linalg.norm(sides, axis=0)
    parts: list[float] = []
    while True:
        k = len(blocks)
        Z = times(blocks[-1])
        if not np.isfinite(Z).all():
            return np.zeros((n, wide - 1)), 0.0
        _refuse(n, (k + 1) * wide)
        basis = np.hstack(blocks)
        # By reflections, since what is new may vanish: then any direction across goes on.
        Q, above = np.linalg.qr(np.hstack([basis, Z]))
        V, same = Q[:, -wide:], np.append(np.diagonal(above)[:-wide], np.ones(wide))
        above = np.sign(same)[:, None] * above[:, -wide:]
        grown = np.zeros(((k + 1) * wide, k * wide))
        grown[: H.shape[0], : H.shape[1]], grown[:, -wide:] = H, above
        H = grown
        start = np.zeros((len(H), wide))
        start[:wide] = R
        y = np.linalg.lstsq(H, start, rcond=None)[0]
        left = np.linalg.norm(H @ y - start, axis=0)
        parts.append(float(np.max(left[:-1] / np.where(sizes > 0.0, sizes, 1.0)[:-1])))
        # Where rounding leaves more, it no longer falls.
        rounded = k > FLAT and LEFT >= parts[-1] > 0.5 * parts[-FLAT]
        done = (parts[-1] <= SOLVED or rounded) and left[-1] <= SEEN * sizes[-1]
        if done:
            break
        if (k + 2) * wide > n:  # no multipliers are next to nothing, as of waves
            return _directly(times, sides)
        blocks.append(V)
    sign = float(np.linalg.slogdet(H[:-wide])[0])
    return np.asarray(basis @ y[:, :-1]), sign


def _directly(times: Any, sides: Array) -> tuple[Array, float]:
    """What `solved` returns, by the matrix itself."""
    n, wide = sides.shape
    matrix = formed(times, n)
    sign = float(np.linalg.slogdet(matrix)[0]) if np.isfinite(matrix).all() else 0.0
    if sign == 0.0:
        return np.zeros((n, wide - 1)), 0.0
    return np.asarray(np.linalg.solve(matrix, sides[:, :-1]), float), sign


def formed(times: Any, n: int) -> Array:
    """The matrix itself, of one that is applied to columns.

    Raises
    ------
    ParameterError
        If no memory would hold it and its factors.
    """
    _refuse(n, n)
    out = np.empty((n, n))
    for i in range(0, n, PART):
        part = np.zeros((n, min(PART, n - i)))
        part[np.arange(i, i + part.shape[1]), np.arange(part.shape[1])] = 1.0
        out[:, i : i + PART] = times(part)
    return out


def _refuse(n: int, columns: int) -> None:
    """Refuse so many columns of all states, some of which are there at once.

    Raises
    ------
    ParameterError
    """
    needed = 8 * COPIES * n * columns
    refuse("state", f"{n:,}", "fewer", f"{columns:,} columns of all of them", needed,
           "where decays are slow, as of waves, an orbit takes that many")  # fmt: skip
