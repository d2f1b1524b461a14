"""Right-hand sides of many states, whose derivatives are sparse matrices."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from phasekit.arrays import Array
from phasekit.bifurcation.continuation.code_fields import PythonField, numbers_of
from phasekit.errors import ParameterError
from phasekit.numerics.later import later
from phasekit.numerics.patterns import groups_of, pattern_of

if TYPE_CHECKING:
    import scipy.sparse as sp
else:
    sp = later("scipy.sparse")


OMEGA = "omega"  # the frequency of Hopf points, as an unknown
DENSE = 2000  # states up to which derivatives may be a full matrix
STEP = 2.0**-17  # of a size, over which f is differenced
SHARP = 2.0**-10  # the same for differences of fourth order, by the parameter


class SparseField(PythonField):
    """A Python function f(x, **parameters) of many states with sparse derivatives.

    These are ``jac``, a function that returns a matrix or an operator, one constant matrix, or a
    pattern (of booleans) that says which entries are differenced; nothing: all of them.
    """

    def __init__(
        self, function: Callable[..., Any], jac: Any, states: Sequence[str],
        parameters: Sequence[str],
    ) -> None:  # fmt: skip
        self.jac = jac
        self.pattern = pattern_of(jac, len(states))
        given = None if self.differenced else self._dense
        super().__init__(function, given, states, parameters)
        self._groups: npt.NDArray[np.int64] | None = None

    @property
    def beside(self) -> dict[str, int]:
        """Places among the states of what is no field: of points of one kind, see `extended`."""
        return {}

    @property
    def differenced(self) -> bool:
        """Whether derivatives are differences of f."""
        return self.jac is None or self.pattern is not None

    def _dense(self, x: Array, **p: float) -> Array:
        return np.asarray(self.matrix(x, p).toarray())

    def matrix(self, x: Array, p: Mapping[str, float]) -> Any:
        """The derivatives of f by the states, by columns; NaN where they have no value."""
        n = len(self.states)
        if self.differenced:
            return self._differences(x, p)
        if not callable(self.jac) or hasattr(self.jac, "matmat"):
            return as_columns("jac", self.jac, n)
        try:
            given = self.jac(x.copy(), **p)
        except Exception as error:  # whatever a user's function raises, it has no value there
            self.failure = error
            return sp.csc_array((np.full(n, np.nan), np.arange(n), np.arange(n + 1)), shape=(n, n))
        return as_columns("jac", given, n)

    def slope(
        self, x: Array, p: Mapping[str, float], name: str, size: float, *, rough: bool = False
    ) -> Array:
        """The derivative of f by a parameter, by differences of fourth order over its size.

        A ``rough`` one is of second order.
        """
        at = p[name]

        def across(h: float) -> Array:
            ahead, behind = (self.value(x.copy(), {**p, name: at + k}) for k in (h, -h))
            return ahead - behind

        h = SHARP * size
        found = across(h) / (2.0 * h)
        if not rough:
            found = (4.0 * found - across(2.0 * h) / (4.0 * h)) / 3.0
        if not np.isfinite(found).all():  # next to the edge of a domain
            h = STEP * size
            found = across(h) / (2.0 * h)
        return np.asarray(found)

    def _differences(self, x: Array, p: Mapping[str, float]) -> Any:
        n = len(self.states)
        steps = STEP * np.maximum(np.abs(x), self.scale[:n])
        if self.pattern is None:
            columns = np.empty((n, n))
            for j in range(n):
                columns[:, j] = self._across(x, p, steps, np.arange(n) == j) / (2.0 * steps[j])
            return sp.csc_array(columns)
        if self._groups is None:
            self._groups = groups_of(self.pattern)
        pattern, groups = self.pattern, self._groups
        data = np.empty(pattern.nnz)
        column = np.repeat(np.arange(n), np.diff(pattern.indptr))
        for group in range(int(groups.max(initial=-1)) + 1):
            change = self._across(x, p, steps, groups == group)
            mine = groups[column] == group
            data[mine] = change[pattern.indices[mine]] / (2.0 * steps[column[mine]])
        return sp.csc_array((data, pattern.indices, pattern.indptr), shape=(n, n))

    def _across(self, x: Array, p: Mapping[str, float], steps: Array, moved: Any) -> Array:
        shift = np.where(moved, steps, 0.0)
        return self.value(x + shift, dict(p)) - self.value(x - shift, dict(p))


def as_columns(argument: str, given: Any, n: int) -> Any:
    """A matrix, sparse or not, or an operator, by columns.

    Raises
    ------
    ParameterError
        If it is none, or of another shape.
    """
    shape = getattr(given, "shape", None)
    if sp.issparse(given) or (hasattr(given, "matmat") and not isinstance(given, np.ndarray)):
        if shape != (n, n):
            raise ParameterError(f"{argument}: got a matrix of shape {shape}, wants {(n, n)}")
        if sp.issparse(given):
            found = sp.csc_array(given, dtype=float)
            found.sum_duplicates()
            return found
        if n > DENSE:
            raise ParameterError(
                f"{argument}: got a LinearOperator of {n} states, wants a sparse matrix of more "
                f"than {DENSE}: a factorisation needs its entries; a pattern of booleans lets "
                "phasekit take them by differences"
            )
        return sp.csc_array(np.asarray(given.matmat(np.eye(n)), dtype=float))
    return sp.csc_array(numbers_of(argument, given, (n, n)))
