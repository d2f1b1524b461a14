"""A map that is applied many times: its steps follow one another, and derivatives multiply.

Formulas that are put into one another grow with each step, and differences of what a map does in
many steps lose the digits that those of one step have.
"""

from __future__ import annotations

import functools
from collections.abc import Callable
from typing import Any

import numpy as np
import numpy.typing as npt

from phasekit.arrays import Array
from phasekit.bifurcation.continuation.fields import Field
from phasekit.numerics import differences
from phasekit.numerics.differences import PLAIN, SHARP
from phasekit.numerics.machine_code import machine_code

DIFFERENCED = 1e-11  # relative error of the derivatives of compiled functions
MOST = 10_000  # times that a map is applied
MANY = 100  # steps within which rounding stays what it is of one


@functools.cache
def _compiled(function: Callable[..., Any]) -> int:
    """The address of a function, kept on disk where that can be."""
    from phasekit.numerics.compiler.kinds import DOUBLES, LONGS
    from phasekit.numerics.forms import native_function

    return native_function(function, (LONGS, *[DOUBLES] * 5))


def bound(
    function: Callable[..., Any], numbers: npt.NDArray[np.int64], sizes: npt.NDArray[np.float64]
) -> int:
    """Address of ``void (double *x, double *p, double *z, double *out)``: a function with own data.

    The function, of pointers to the numbers, the sizes and these four, is compiled. Numbers and
    sizes must outlast the calls; what they hold may change between these.
    """
    own = ", ".join(f"ptr inttoptr (i64 {array.ctypes.data} to ptr)" for array in (numbers, sizes))
    return machine_code(
        "define void @fill(ptr %x, ptr %p, ptr %z, ptr %out) {\n"
        f"  call void inttoptr (i64 {_compiled(function)} to ptr)"
        f"({own}, ptr %x, ptr %p, ptr %z, ptr %out)\n"
        "  ret void\n}\n",
        host=False,
    )


class IteratedField(Field):
    """f(f(... f(x))), so many times; with ``less`` x is taken off."""

    def __init__(self, base: Field, times: int, *, less: bool = False) -> None:
        super().__init__(base.states, base.parameters)
        self.base, self.steps, self.less = base, times, less
        self.compiled, self.exact = base.compiled, base.exact
        own = max(base.accuracy, DIFFERENCED if base.mode == PLAIN else 0.0)
        self.accuracy = own * max(1.0, times / MANY)
        self.scale = np.ones(len(base.states) + len(base.parameters))
        self._made: dict[tuple[Any, ...], tuple[int, Any]] = {}  # addresses, and what they use

    @property
    def jacobian(self) -> Any:
        """The derivatives of one step, if they are given."""
        return getattr(self.base, "jacobian", None)

    @property
    def failure(self) -> Exception | None:
        """What f raised last, instead of a value."""
        return self.base.failure

    @failure.setter
    def failure(self, error: Exception | None) -> None:
        if hasattr(self, "base"):
            self.base.failure = error

    def prepare(self, scale: Array) -> None:
        """Take the scales of the unknowns, for differences."""
        self.base.prepare(scale)
        self.scale[: len(scale)] = scale

    def first(self, active: tuple[int, ...], *, sharp: bool = False) -> Any:
        """F and its derivatives."""
        if not self.compiled:
            return _interpreted(self.base.first(active, sharp=sharp), *self._sizes(active))
        return self._bound("first", active, sharp)

    def second(self, active: tuple[int, ...]) -> Any:
        """Function that fills f, its derivatives and those of f_u z."""
        if not self.compiled:
            return _interpreted_twice(self.base.second(active), *self._sizes(active))
        return self._bound("second", active, True)

    def third(self, active: tuple[int, ...]) -> Any:
        """Third derivative along the three directions that z holds, of formulas."""
        return self._bound("third", active, True)

    def values(self, u: Array, par: Array, active: tuple[int, ...]) -> Array:
        """F at many points, the rows of u."""
        points = np.array(u)
        n = len(self.states)
        for _ in range(self.steps):
            points[:, :n] = self.base.values(points, par, active)
        return points[:, :n] - u[:, :n] if self.less else points[:, :n]

    def with_terms(self, u: Array, par: Array, active: tuple[int, ...]) -> tuple[Array, Array]:
        """F at many points, and the sums of the sizes of its terms, as steps pass them on."""
        n, m = len(self.states), u.shape[1]
        count = n + n * m
        base: Any = self.base
        points, terms = np.array(u), np.zeros((len(u), n))
        out, places = np.empty((len(u), count)), np.array(active, dtype=np.int64)
        for _ in range(self.steps):
            wide = _padded(points, count)
            differences.values(base.first(active), count, par[None], places, wide, out)
            slopes = np.abs(out[:, n:].reshape(-1, n, m)[:, :, :n])
            value, own = base.with_terms(points, par, active)
            terms = np.einsum("kij,kj->ki", slopes, terms) + own
            points[:, :n] = value
        value = points[:, :n]
        return (value - u[:, :n], terms + np.abs(u[:, :n])) if self.less else (value, terms)

    def _sizes(self, active: tuple[int, ...]) -> tuple[int, int, int, bool]:
        return len(self.states), len(self.states) + len(active), self.steps, self.less

    def _bound(self, order: str, active: tuple[int, ...], sharp: bool) -> int:
        """The address of native code, which is made once."""
        from phasekit.bifurcation.continuation.iterated_field import bound
        from phasekit.bifurcation.continuation.kernels import iterated as kernels

        key = (order, active, sharp and self.base.mode == PLAIN)
        if key not in self._made:
            n, m, times, less = self._sizes(active)
            numbers = np.zeros(kernels.ACTIVE + len(active), dtype=np.int64)
            numbers[kernels.STATES], numbers[kernels.UNKNOWNS] = n, m
            numbers[kernels.TIMES], numbers[kernels.LESS] = times, less
            numbers[kernels.PARAMETERS] = max(1, len(self.parameters))
            numbers[kernels.ACTIVE :] = active
            if self.base.mode == PLAIN:
                numbers[kernels.MODE] = SHARP if sharp else PLAIN
                numbers[kernels.FIRST] = self.base.first(active)
                step = numbers.copy()
                numbers[kernels.FIRST] = bound(kernels.differenced, step, self.scale)
                if order == "second":
                    numbers[kernels.SECOND] = bound(kernels.differenced_twice, step, self.scale)
                self._made[*key, "step"] = (0, step)
            else:
                numbers[kernels.FIRST] = self.base.first(active)
                if order != "first":
                    numbers[kernels.SECOND] = self.base.second(active)
                if order == "third":
                    numbers[kernels.THIRD] = self.base.third(active)
            self._made[key] = (bound(getattr(kernels, order), numbers, self.scale), numbers)
        return self._made[key][0]


def _padded(points: Array, count: int) -> Array:
    """Points as `differences.values` takes them for so many results: longer than these."""
    return np.pad(points, ((0, 0), (0, count)))


def _interpreted(
    base: Callable[..., None], n: int, m: int, times: int, less: bool
) -> Callable[..., None]:
    """A Python function that fills f and its derivatives, as those of one step are multiplied."""

    def first(u: Array, par: Array, z: Array, out: Array) -> None:
        point, step = u[:m].copy(), np.empty(n + n * m)
        slopes = np.eye(m)
        for _ in range(times):
            base(point, par, point, step)
            slopes[:n] = step[n:].reshape(n, m) @ slopes
            point[:n] = step[:n]
        out[:n] = point[:n] - less * u[:n]
        out[n : n + n * m] = (slopes[:n] - less * np.eye(n, m)).ravel()

    return first


def _interpreted_twice(
    base: Callable[..., None], n: int, m: int, times: int, less: bool
) -> Callable[..., None]:
    """A Python function that fills f, its derivatives and those of f_u z."""

    def second(u: Array, par: Array, z: Array, out: Array) -> None:
        point, along, step = u[:m].copy(), z[:m].copy(), np.empty(n + 2 * n * m)
        slopes, bent = np.eye(m), np.zeros((n, m))
        for _ in range(times):
            base(point, par, along, step)
            own, curved = step[n:].reshape(2, n, m)
            bent = own[:, :n] @ bent + curved @ slopes
            slopes[:n] = own @ slopes
            along[:n] = own @ along
            point[:n] = step[:n]
        out[:n] = point[:n] - less * u[:n]
        out[n : n + n * m] = (slopes[:n] - less * np.eye(n, m)).ravel()
        out[n + n * m : n + 2 * n * m] = bent.ravel()

    return second
