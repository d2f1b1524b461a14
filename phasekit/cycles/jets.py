"""A right-hand side and its derivatives at all Gauss points of an orbit, whatever form it has."""

from __future__ import annotations

from typing import Any

import numpy as np

from phasekit.arrays import Array
from phasekit.bifurcation.continuation.code_fields import PythonField
from phasekit.bifurcation.continuation.fields import Field
from phasekit.bifurcation.continuation.large.field import SparseField
from phasekit.cycles import along, lines
from phasekit.cycles.collocation import Scheme, at_gauss, scheme
from phasekit.cycles.sparse import Slopes
from phasekit.errors import PhasekitError
from phasekit.numerics import differences

STEP = 2.0**-10  # of differences of fourth order, at first
#: The place of the beginning of an interval, and its value there by those at both ends.
BEGINNING, ONE = np.zeros(1), np.array([[1.0, 0.0]])
SAME = 1e-13  # by which f of many states at once may differ from f of each


class Jets:
    """F and its derivatives by states and active parameters (of a forced system time first)."""

    def __init__(self, field: Field, par: Array, active: tuple[int, ...], forced: bool) -> None:
        self.field, self.par, self.forced = field, par.copy(), forced
        self.active = active
        self.places = np.array(active, dtype=np.int64)
        self.many: bool | None = None  # whether a Python f takes many states at once
        self.full: bool | None = None  # whether sparse matrices of derivatives are full, at first
        # Whether kernels are given the derivatives, and what those call that take them themselves.
        self.given = isinstance(field, PythonField)
        self.mode = differences.SHARP if field.mode == differences.PLAIN else field.mode
        self.first = 0 if self.given else field.first(active, sharp=True)

    def __call__(
        self, mesh: Array, x: Array, y: Array, m: int, scale: Array, c: Scheme | None = None
    ) -> Array:
        """Rows of f and its derivatives, at one Gauss point each, or one of another scheme."""
        n, a = x.shape[1], len(self.active)
        c = c or scheme(m)
        if isinstance(self.field, PythonField):
            at = mesh[:-1, None] + np.diff(mesh)[:, None] * c.nodes
            return np.asarray(self._python(at_gauss(x, m, c).reshape(-1, n), y, at.ravel(), scale))
        out = np.empty(((len(mesh) - 1) * m, n * (1 + n + a)))
        along.jets(
            self.first, self.mode, self.par, self.places, self.forced,
            mesh, c.nodes, c.value, x, y, scale, out,
        )  # fmt: skip
        return out

    def sparse(self, mesh: Array, x: Array, y: Array, m: int, scale: Array) -> Slopes | None:
        """F and its derivatives as sparse matrices; None where those are not sparse."""
        if self.full or not self.matrix:
            return None
        found = self.matrices(mesh, x, y, m, scale, scheme(m))
        if self.full is None and found.matrices:  # once for all: equations keep their form
            self.full = not found.sparse
        return None if self.full else found

    def matrices(
        self, mesh: Array, x: Array, y: Array, m: int, scale: Array, c: Scheme
    ) -> Slopes:  # fmt: skip
        """The same, however sparse they are, at a scheme's points."""
        if not self.matrix:
            from scipy.sparse import csc_array

            n, found = x.shape[1], self(mesh, x, y, m, scale, c)
            slopes = found[:, n:].reshape(len(found), n, -1)
            inside = [csc_array(one) for one in slopes[:, :, :n]]
            return Slopes(found[:, :n], inside, slopes[:, :, n:])
        at = mesh[:-1, None] + np.diff(mesh)[:, None] * c.nodes
        if not np.isfinite(x).all() or not np.isfinite(y).all():
            return Slopes.nowhere(x.shape[1], at.size, len(self.active))
        places = at_gauss(x, m, c).reshape(-1, x.shape[1])
        of_field: Slopes = self._python(places, y, at.ravel(), scale, True)
        return of_field

    @property
    def matrix(self) -> bool:
        """Whether the field has its derivatives as sparse matrices."""
        return isinstance(self.field, SparseField)

    @property
    def exact(self) -> bool:
        """Whether derivatives by states are known without differences of f."""
        if isinstance(self.field, PythonField):
            return self.field.jacobian is not None
        return self.mode == differences.DERIVED

    def values(self, u: Array) -> Array:
        """F at points, the rows of u: states and active parameters."""
        if not isinstance(self.field, PythonField):
            return self.field.values(np.ascontiguousarray(u), self.par.copy(), self.active)
        n = len(self.field.states)
        given: dict[str, Any] = dict(zip(self.field.parameters, self.par.tolist(), strict=True))
        for column, place in zip(u[:, n:].T, self.active, strict=True):
            same = np.all(column == column[0])
            given[self.field.parameters[place]] = float(column[0]) if same else column
        return self._values(np.ascontiguousarray(u[:, :n]), given)

    def at_mesh(self, mesh: Array, x: Array, y: Array, m: int, scale: Array) -> Array:
        """F at the beginning of each interval."""
        n = x.shape[1]
        points = np.ascontiguousarray(x[::m])
        if isinstance(self.field, PythonField):
            return np.asarray(self._python(points[:-1], y, mesh[:-1], scale)[:, :n])
        out = np.empty((len(mesh) - 1, n * (1 + n + len(self.active))))
        along.jets(
            self.first, self.mode, self.par, self.places, self.forced, mesh, BEGINNING, ONE, points,
            y, scale, out,
        )  # fmt: skip
        return out[:, :n]

    def _python(self, x: Array, y: Array, s: Array, scale: Array, sparse: bool = False) -> Any:
        """Rows of f and its derivatives or, ``sparse``, these as `Slopes`."""
        field: Any = self.field
        n, a = x.shape[1], len(self.active)
        names = [field.parameters[i] for i in self.active]
        given: dict[str, Any] = dict(zip(field.parameters, self.par.tolist(), strict=True))
        free = list(y[1:].tolist())
        given.update(zip(names[1:] if self.forced else names, free, strict=True))
        if self.forced:
            given[names[0]] = y[0] * s
        shape = len(x), n, a if sparse else n + a
        if not np.isfinite(x).all() or not np.isfinite(y).all():
            return np.full((len(x), n * (1 + n + a)), np.nan)
        f = self._values(x, given)
        slopes, matrices = np.empty(shape), []
        sizes = scale.tolist()
        if self.forced:
            sizes[n] = float(y[0])
        begin = n if sparse or field.jacobian is not None else 0
        if begin:
            taken = field.matrix if sparse else field.slopes
            matrices = [taken(one.copy(), self._parameters(given, i)) for i, one in enumerate(x)]
        if begin and not sparse:
            slopes[:, :, :n] = matrices
        columns = []
        noise = lines.EPSILON * np.max(np.abs(f), axis=0)
        for j in range(begin, n + a):
            size = float(np.max(np.abs(x[:, j] if j < n else self._p(given, j - n))))
            h = STEP * 2.0 ** np.floor(np.log2(max(size, sizes[j])))

            def value_at(k: float, j: int = j) -> Array:
                if j >= n:
                    name = names[j - n]
                    return self._values(x, given | {name: given[name] + k})
                shifted = x.copy()
                shifted[:, j] += k
                return self._values(shifted, given)

            wide, near = ((value_at(k) - value_at(-k)) / (2.0 * k) for k in (2.0 * h, h))
            columns.append((j, value_at, h, (wide, near)))
            noise += lines.EPSILON * h / STEP * np.max(np.abs(near), axis=0)
        for j, line, h, sides in columns:
            slopes[:, :, j - n if sparse else j] = lines.slope_along(line, h, noise, sides=sides)
        if sparse:
            return Slopes(f, matrices, slopes)
        out = np.hstack([f, slopes.reshape(len(x), -1)])
        out[~np.isfinite(f).all(axis=1), :] = np.nan
        return out

    def _p(self, given: dict[str, Any], k: int) -> Any:
        return given[self.field.parameters[self.active[k]]]

    def _parameters(self, given: dict[str, Any], i: int) -> dict[str, Any]:
        """The parameters at one of many times."""
        return {k: float(v[i]) if isinstance(v, np.ndarray) else v for k, v in given.items()}

    def _values(self, x: Array, given: dict[str, Any]) -> Array:
        field: Any = self.field
        if self.many is not False:
            try:
                found = field.function(np.ascontiguousarray(x.T), **given)
                rows = [np.broadcast_to(np.asarray(row, dtype=float), len(x)) for row in found]
                whole = np.stack(rows, axis=1) if len(rows) == x.shape[1] else None
            except PhasekitError:
                raise
            except Exception:  # noqa: BLE001 - f of one state; it is called state by state
                whole = None
            if self.many and whole is not None:
                return whole
            if self.many is None:
                single = self._each(x, given)
                self.many = whole is not None and bool(
                    np.allclose(whole, single, rtol=SAME, atol=SAME * float(np.max(np.abs(single))))
                )
                return single
        return self._each(x, given)

    def _each(self, x: Array, given: dict[str, Any]) -> Array:
        field: Any = self.field
        return np.array(
            [field.value(one.copy(), self._parameters(given, i)) for i, one in enumerate(x)]
        )


class GivenJets:
    """Right-hand sides made of those of an orbit, whose derivatives kernels are given."""

    given, first = True, 0

    def __init__(self, jets: Jets) -> None:
        self.jets, self.mode, self.par = jets, jets.mode, jets.par
        self.places, self.active = jets.places, jets.active
