"""Sparse factors of a matrix: solutions, the sign of its determinant, how many pivots are positive.

Block elimination solves bordered systems with them ([Govaerts2000] chapter 3): each side is solved
twice, once by the border and once by the matrix, so that the matrix itself may be singular.
"""

from __future__ import annotations

import functools
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from phasekit.numerics.compile import kernel
from phasekit.numerics.later import later
from phasekit.numerics.memory import refuse, room_short_of

if TYPE_CHECKING:
    import scipy.sparse as sp
    from scipy.sparse import csgraph, linalg
else:  # which take long, and few states never need them
    sp = later("scipy.sparse")
    csgraph, linalg = later("scipy.sparse.csgraph"), later("scipy.sparse.linalg")

Array = npt.NDArray[Any]

TINY = 1e-14  # of the largest entry: what is added to a diagonal whose pivots vanish
SYMMETRIC = 1e-13  # difference of two entries, beside these
POOR = 1e-10  # part by which two ways to the same pivot of a border may differ
FILLED = 3  # cells of a band beside its entries, up to which it is factored in its own order
NEARBY = 0.1  # of the largest entry of a column, from which on one on the diagonal is its pivot
NUMBER = 16  # bytes of an entry of factors, with its place
AT_ONCE = 3  # of a point, of the next one, and of what is looked for between them
TRUE = 1e-6  # residual of a solution, relative, from which on pivots on the diagonal do not count


def inner(a: Array, b: Array) -> Any:
    """The product of two vectors, on one thread: others cost more than they save."""
    return np.einsum("i,i", a, b)


class Factors:
    """The factors of a square sparse matrix, by columns.

    Of a symmetric one, in some units, all pivots stay on the diagonal if that is accurate; then
    ``positive`` is how many eigenvalues are positive (Sylvester), else None.
    """

    def __init__(self, matrix: Any, *, symmetric: bool = False) -> None:
        self.matrix = matrix
        self.positive: int | None = None
        band = is_band(matrix)
        # Their columns are too sparse to be gathered in dense panels.
        single = {"relax": 1, "panel_size": 1}
        if symmetric:
            self._take(permc_spec="NATURAL" if band else "MMD_AT_PLUS_A", diag_pivot_thresh=0.0,
                       options={"SymmetricMode": True}, **single)  # fmt: skip
            n = matrix.shape[0]
            side = np.cos(np.arange(n, dtype=float))
            rest = np.max(np.abs(matrix @ self.solve(side) - side))
            if np.array_equal(self._lu.perm_r, self._lu.perm_c) and rest <= TRUE:
                self.positive = int(np.sum(self._pivots > 0.0))
                return
        if band:
            self._take(permc_spec="NATURAL", **single)
        elif is_alike(matrix):  # a third of the fill of an order for any pivots
            self._take(permc_spec="MMD_AT_PLUS_A", diag_pivot_thresh=NEARBY,
                       options={"SymmetricMode": True}, **single)  # fmt: skip
        else:
            self._take(permc_spec="COLAMD")

    def _take(self, **how: Any) -> None:
        try:
            self._lu = linalg.splu(self.matrix, **how)
        except RuntimeError:  # a pivot is zero
            size = float(np.max(np.abs(self.matrix.data), initial=1e-300))
            shifted = self.matrix + TINY * size * sp.eye_array(self.matrix.shape[0], format="csc")
            self._lu = linalg.splu(sp.csc_array(shifted), **how)
        self.__dict__.pop("_pivots", None)

    @functools.cached_property
    def _pivots(self) -> Array:
        return np.asarray(self._lu.U.diagonal())

    @property
    def size(self) -> int:
        """Number of rows."""
        return int(self.matrix.shape[0])

    @property
    def entries(self) -> int:
        """Number of entries of both factors."""
        return int(self._lu.nnz)

    def solve(self, side: Array) -> Array:
        """A solution."""
        return np.asarray(self._lu.solve(side))

    def solve_transposed(self, side: Array) -> Array:
        """A solution of the transposed system."""
        return np.asarray(self._lu.solve(side, "T"))

    def times(self, x: Array) -> Array:
        """The matrix on a vector."""
        return np.asarray(self.matrix @ x)

    def times_transposed(self, x: Array) -> Array:
        """The transposed matrix on a vector."""
        return np.asarray(self.matrix.T @ x)

    @functools.cached_property
    def sign(self) -> float:
        """The sign of the determinant."""
        rows, columns = self._lu.perm_r, self._lu.perm_c
        alike = np.array_equal(rows, columns)
        sign = 1.0 if alike else parity_of(rows) * parity_of(columns)
        return float(sign * (-1.0) ** int(np.sum(self._pivots < 0.0)))


def refuse_fill(matrix: Any) -> None:
    """Refuse a matrix whose factors no memory would hold, before they are made.

    Raises
    ------
    ParameterError
    """
    n, one = matrix.shape[0], AT_ONCE * NUMBER
    if room_short_of(one * n * min(n, 2 * _width(matrix) + 1)) is None:
        return  # whatever the order of its columns
    needed = one * entries_of(matrix)
    refuse("state", f"{n:,}", "fewer", "the factors of f_x", needed,
           "a coarser grid, or fewer couplings between places, take less")  # fmt: skip


def entries_of(matrix: Any) -> int:
    """Entries of both factors of a matrix by its pattern, which are not made.

    With pivots on the diagonal, of the pattern of the matrix and its transposed one together.
    """
    n = matrix.shape[0]
    both = sp.csc_array(abs(matrix) + abs(matrix.T))
    both.data[:] = 1.0
    both = sp.csc_array(both + 2.0 * n * sp.eye_array(n))
    # Incomplete factors of next to no entries are in the same order as full ones.
    first = linalg.spilu(both, drop_tol=1.0, fill_factor=1.0, permc_spec="MMD_AT_PLUS_A",
                  diag_pivot_thresh=0.0, options={"SymmetricMode": True})  # fmt: skip
    order = np.argsort(first.perm_c)
    ordered = sp.csr_array(sp.csr_array(both)[order][:, order])
    below = _below(ordered.indptr.astype(np.int64), ordered.indices.astype(np.int64))
    return 2 * (int(below) + n)


@kernel
def _below(starts: Array, columns: Array) -> int:
    """Entries below the diagonal of the factors of a symmetric pattern, by its elimination tree."""
    n = len(starts) - 1
    parent, seen, total = np.full(n, -1), np.full(n, -1), 0
    for i in range(n):
        seen[i] = i
        for place in range(starts[i], starts[i + 1]):
            k = columns[place]
            while k < i and seen[k] != i:
                if parent[k] == -1:
                    parent[k] = i
                total += 1
                seen[k] = i
                k = parent[k]
    return total


def is_band(matrix: Any) -> bool:
    """Whether the entries of a matrix by columns fill most of a band around its diagonal.

    No order of its columns has much less fill.
    """
    return bool(matrix.shape[0] * (2 * _width(matrix) + 1) <= FILLED * matrix.nnz)


def _width(matrix: Any) -> int:
    """How far from the diagonal entries of a matrix by columns are."""
    n = matrix.shape[0]
    columns = np.repeat(np.arange(n, dtype=matrix.indices.dtype), np.diff(matrix.indptr))
    return int(np.max(np.abs(matrix.indices - columns), initial=0))


def is_alike(matrix: Any) -> bool:
    """Whether the entries of a matrix by columns stand where those of its transposed one do."""
    turned = sp.csc_array(matrix.T)
    alike = bool(np.array_equal(turned.indptr, matrix.indptr))
    if alike and not matrix.has_sorted_indices:
        matrix = matrix.sorted_indices()
    return alike and bool(np.array_equal(turned.indices, matrix.indices))


def is_symmetric(matrix: Any, differenced: bool = False) -> bool:
    """Whether a matrix is certainly symmetric, within rounding of its entries.

    Entries are compared one by one: a small skew part beside large entries moves eigenvalues off
    the real axis. So it is never certain of derivatives by differences, whose errors hide one.
    """
    if differenced:
        return False
    turned = sp.csc_array(matrix.T)
    gap = abs(sp.csc_array(matrix - turned))
    if not gap.nnz:
        return True
    sizes = SYMMETRIC * abs(matrix).maximum(abs(turned))
    return float(np.max((gap - sizes).data, initial=0.0)) <= 0.0


def is_definite(matrix: Any) -> bool:
    """Whether a Hermitian matrix by columns is certainly positive definite: all pivots are so."""
    try:
        found = linalg.splu(matrix, permc_spec="NATURAL" if is_band(matrix) else "MMD_AT_PLUS_A",
                     diag_pivot_thresh=0.0, options={"SymmetricMode": True})  # fmt: skip
    except RuntimeError:  # a pivot is zero
        return False
    kept = np.array_equal(found.perm_r, found.perm_c)
    return bool(kept and np.all(found.U.diagonal().real > 0.0))


def parity_of(order: npt.NDArray[Any]) -> float:
    """Whether a permutation is even, 1, or odd, -1."""
    n = len(order)
    graph = sp.csr_array((np.ones(n), order, np.arange(n + 1)), shape=(n, n))
    cycles = csgraph.connected_components(
        graph, directed=True, connection="weak", return_labels=False
    )
    return -1.0 if (n - int(cycles)) % 2 else 1.0


class Bordered:
    """A system with one more row and column, solved by those of the matrix inside."""

    def __init__(self, matrix: Any, column: Array, row: Array, corner: float = 0.0) -> None:
        self.matrix, self.column, self.row, self.corner = matrix, column, row, corner
        self._right = matrix.solve(column)
        self._left = matrix.solve_transposed(row)
        self._by_right = corner - inner(row, self._right)
        self._by_left = corner - inner(self._left, column)
        self._poor = not abs(self._by_right - self._by_left) <= POOR * abs(self._by_right)

    @property
    def size(self) -> int:
        """Number of rows."""
        return int(self.matrix.size) + 1

    @property
    def sign(self) -> float:
        """The sign of the determinant."""
        return float(self.matrix.sign * np.sign(self._by_right))

    def times(self, x: Array) -> Array:
        """The matrix on a vector."""
        inside = self.matrix.times(x[:-1]) + self.column * x[-1]
        return np.append(inside, inner(self.row, x[:-1]) + self.corner * x[-1])

    def times_transposed(self, x: Array) -> Array:
        """The transposed matrix on a vector."""
        inside = self.matrix.times_transposed(x[:-1]) + self.row * x[-1]
        return np.append(inside, inner(self.column, x[:-1]) + self.corner * x[-1])

    def solve(self, side: Array) -> Array:
        """A solution, refined once."""
        return self._refined(self._solved, self.times, side)

    def solve_transposed(self, side: Array) -> Array:
        """A solution of the transposed system, refined once."""
        return self._refined(self._solved_transposed, self.times_transposed, side)

    @staticmethod
    def _refined(solved: Any, times: Any, side: Array) -> Array:
        x = solved(side)
        return np.asarray(x + solved(side - times(x)))

    def solve_again(self, side: Array) -> Array:
        """A solution for what refines it itself: refined here, too, only where factors are poor."""
        return self.solve(side) if self._poor else self._solved(side)

    def _solved(self, side: Array) -> Array:
        first = (side[-1] - inner(self._left, side[:-1])) / self._by_left
        rest = self.matrix.solve(side[:-1] - self.column * first)
        last = side[-1] - self.corner * first - inner(self.row, rest)
        second = last / self._by_right
        return np.append(rest - self._right * second, first + second)

    def _solved_transposed(self, side: Array) -> Array:
        first = (side[-1] - inner(self._right, side[:-1])) / self._by_right
        rest = self.matrix.solve_transposed(side[:-1] - self.row * first)
        last = side[-1] - self.corner * first - inner(self.column, rest)
        second = last / self._by_left
        return np.append(rest - self._left * second, first + second)
