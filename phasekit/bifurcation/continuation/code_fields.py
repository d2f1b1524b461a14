"""Right-hand sides that are code: compiled by numba, or plain Python."""

from __future__ import annotations

import functools
import math
from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np

from phasekit.arrays import Array
from phasekit.bifurcation.continuation.fields import Field
from phasekit.errors import ParameterError
from phasekit.numerics import differences
from phasekit.numerics.columns import MANY, Groups, are_all, groups_at
from phasekit.numerics.differences import (
    BENT,
    CLOSE,
    COARSE,
    EDGES,
    EPSILON,
    FINE,
    KNOWN,
    NEAR,
    PLAIN,
    SHORTER,
    STEP,
    TRIES,
    coarse,
)
from phasekit.numerics.wrapped import wrap

NUMBERS = np.dtype(float)
ON_EDGE = 1e-6  # part by which slopes over two steps may differ on the edge of a domain


class CompiledField(Field):
    """A numba-compiled f(x, parameters by name); its derivatives are differences, compiled."""

    mode = PLAIN

    def __init__(
        self, function: Any, names: Sequence[str], states: Sequence[str],
        parameters: Sequence[str], *, less: bool = False,
    ) -> None:  # fmt: skip
        """Take the function and the names of its arguments after x, in its own order.

        With ``less`` the field is f(x) - x, of a map f.
        """
        super().__init__(states, parameters)
        self.function, self.names, self.less = function, tuple(names), less
        self._wrapped: Any = None

    def first(self, active: tuple[int, ...], *, sharp: bool = False) -> int:
        """Address of f alone."""
        if self._wrapped is None:
            places = tuple(self.parameters.index(name) for name in self.names)
            self._wrapped = wrap(self.function, len(self.states), places, less=self.less)
        return int(self._wrapped.address)

    def second(self, active: tuple[int, ...]) -> int:
        """Address of f alone."""
        return self.first(active)

    def values(self, u: Array, par: Array, active: tuple[int, ...]) -> Array:
        """F at many points, the rows of u."""
        out = np.empty((len(u), len(self.states)))
        places = np.array(active, dtype=np.int64)
        differences.values(self.first(active), len(self.states), par[None], places, u, out)
        return out


class PythonField(Field):
    """A Python function f(x, **parameters); its derivatives are differences, unless it has them."""

    compiled = False
    accuracy = 1e-10

    def __init__(
        self,
        function: Callable[..., Any],
        jacobian: Callable[..., Any] | None,
        states: Sequence[str],
        parameters: Sequence[str],
        *,
        less: bool = False,
    ) -> None:
        """Take f and its derivatives by the states; with ``less`` the field is f(x) - x."""
        super().__init__(states, parameters)
        self.function, self.jacobian, self.less = function, jacobian, less
        self.scale = np.ones(len(states) + len(parameters))
        self.sizes: list[float] = self.scale.tolist()
        self._together: Groups | None = None
        self._looked = False  # whether groups were looked for

    def prepare(self, scale: Array) -> None:
        """Take the scales of the unknowns, for differences."""
        self.scale = np.asarray(scale, dtype=float)
        self.sizes = self.scale.tolist()

    def value(self, x: Array, p: Mapping[str, float]) -> Array:
        """F as an array of its own; NaN where it has no value. Warnings are the caller's."""
        try:
            result = self.function(x.copy() if self.less else x, **p)
        except Exception as error:  # whatever a user's function raises, it has no value there
            self.failure = error
            return np.full(len(self.states), np.nan)
        value = numbers_of("f", result, (len(self.states),))
        return value - x if self.less else value

    def slopes(self, x: Array, p: Mapping[str, float]) -> Array:
        """The given derivatives by the states; NaN where they have no value."""
        n = len(self.states)
        assert self.jacobian is not None
        try:
            result = self.jacobian(x, **p)
        except Exception as error:  # whatever a user's function raises, it has no value there
            self.failure = error
            return np.full((n, n), np.nan)
        result = result.toarray() if hasattr(result, "toarray") else result
        slopes = numbers_of("jac", result, (n, n))
        return slopes - np.eye(n) if self.less else slopes

    def values(self, u: Array, par: Array, active: tuple[int, ...]) -> Array:
        """F at many points, the rows of u."""
        n = len(self.states)
        p = dict(zip(self.parameters, par.tolist(), strict=True))
        free = [self.parameters[i] for i in active]
        out = np.empty((len(u), n))
        for k, point in enumerate(u):
            p.update(zip(free, point[n:].tolist(), strict=True))
            out[k] = self.value(point[:n].copy(), p) if np.isfinite(point).all() else np.nan
        return out

    def slopes_along(
        self, par: Array, active: tuple[int, ...], u: Array, z: Array
    ) -> Callable[[Array], Array] | None:
        """f_x z by the given derivatives, where z has no part along parameters."""
        n = len(self.states)
        if self.jacobian is None or np.any(z[n:]):
            return None
        p = dict(zip(self.parameters, par.tolist(), strict=True))
        p.update(zip((self.parameters[i] for i in active), u[n:].tolist(), strict=True))
        return lambda point: np.asarray(self.slopes(point[:n].copy(), p) @ z[:n])

    def first(self, active: tuple[int, ...], *, sharp: bool = False) -> Callable[..., None]:
        """A function that fills f and its derivatives.

        They are central differences: of second order while stepping, of fourth for refined points.
        """
        names, n = self.parameters, len(self.states)
        free = [names[i] for i in active]
        m = n + len(free)
        exact = self.jacobian

        def first(u: Array, par: Array, z: Array, out: Array) -> None:
            p = dict(zip(names, par.tolist(), strict=True))
            values = u[:m].tolist()
            if not all(map(math.isfinite, values)):  # a Newton step led nowhere
                out[: n + n * m] = np.nan
                return
            for name, number in zip(free, values[n:], strict=True):
                p[name] = number
            x = np.array(values[:n])
            out[:n] = middle = self.value(x.copy(), p)
            slopes = out[n : n + n * m].reshape(n, m)
            begin = 0
            if exact is not None:
                slopes[:, :n] = self.slopes(x.copy(), p)
                begin = n
            if begin == m:
                return

            def shifted_value(j: int, h: float) -> Array:
                if j < n:
                    shifted = x.copy()
                    shifted[j] += h
                    return self.value(shifted, p)
                p[free[j - n]] = values[j] + h
                value = self.value(x.copy(), p)
                p[free[j - n]] = values[j]
                return value

            grouped = None if begin else self._by_groups(x, middle, p, sharp)
            if grouped is not None:
                slopes[:, :n], begin = grouped, n
            lines = [functools.partial(shifted_value, j) for j in range(begin, m)]
            if sharp:
                slopes[:, begin:] = sharp_slopes(lines, middle, values[begin:], self.sizes[begin:])
                return
            steps = [COARSE * coarse(values[j], self.sizes[j]) for j in range(begin, m)]
            ahead = np.array([at(h) for at, h in zip(lines, steps, strict=True)])
            behind = np.array([at(-h) for at, h in zip(lines, steps, strict=True)])
            rise = ahead - behind
            slopes[:, begin:] = (rise / (2.0 * np.array(steps))[:, None]).T
            bent = np.abs(ahead + behind - 2.0 * middle)
            for i in np.flatnonzero((bent > BENT * np.abs(rise)).any(axis=1)).tolist():
                at, h = lines[i], steps[i]
                # Next to an edge of the domain, not where f itself turns within a step.
                if not np.isfinite(at(NEAR * h) + at(-NEAR * h)).all():
                    j = begin + i
                    slopes[:, j] = _shorter(at, middle, slopes[:, j], bent[i], h, values[j])
            _inside(lines, middle, slopes[:, begin:], values[begin:], self.sizes[begin:])

        return first

    def groups(self, x: Array, p: Mapping[str, float]) -> Groups | None:
        """Columns that one difference takes together; None if each is taken alone."""
        if not self._looked and len(x) >= MANY:
            failure = self.failure
            self._together = groups_at(lambda y: self.value(y, p), x, self._units(x))
            self.failure, self._looked = failure, True
        return self._together

    def _units(self, x: Array) -> Array:
        """Powers of two about as large as the states."""
        size = np.maximum(np.abs(x), self.scale[: len(x)])
        return np.ldexp(0.5, np.frexp(size)[1])

    def _by_groups(
        self, x: Array, middle: Array, p: Mapping[str, float], sharp: bool
    ) -> Array | None:
        """Derivatives by states, of groups at once; None where each is to be taken alone."""
        found = self.groups(x, p)
        if found is None or not np.isfinite(middle).all():
            return None

        def value(y: Array) -> Array:
            return self.value(y, p)

        if sharp:
            units = self._units(x)
            lines = [found.line(value, x, k, units) for k in range(found.count)]
            slopes = _slopes(lines, middle, [1.0] * found.count)
            steps = COARSE * units
        else:
            steps = COARSE * np.array([coarse(*one) for one in zip(x, self.sizes, strict=False)])
            units = steps
            lines = [found.line(value, x, k, steps) for k in range(found.count)]
            ahead, behind = (np.array([at(side) for at in lines]) for side in (1.0, -1.0))
            rise = ahead - behind
            if (np.abs(ahead + behind - 2.0 * middle) > BENT * np.abs(rise)).any():
                return None
            slopes = 0.5 * rise.T
        columns = found.full(slopes, units)
        right = np.isfinite(slopes).all() and are_all(value, x, middle, columns, steps)
        return columns if right else None

    def second(self, active: tuple[int, ...]) -> Callable[..., None]:
        """A function that fills f, its derivatives and those of f_u z."""
        jet = self.first(active, sharp=True)
        names, n = self.parameters, len(self.states)
        free = [names[i] for i in active]
        m = n + len(free)
        exact: Any = self.jacobian

        def values_at(u: Array, par: Array) -> tuple[Array, dict[str, float]]:
            p = dict(zip(names, par.tolist(), strict=True))
            p.update(zip(free, u[n:m].tolist(), strict=True))
            return u[:n].copy(), p

        def second(u: Array, par: Array, z: Array, out: Array) -> None:
            jet(u, par, z, out)
            u, z = u[:m].copy(), z[:m].copy()
            bent = out[n + n * m : n + 2 * n * m].reshape(n, m)
            size = np.maximum(np.abs(u), self.scale[:m])
            length = np.max(np.abs(z) / size)
            bent[:] = 0.0
            if not length > 0.0:
                return
            in_state = exact is not None and not np.any(z[n:])
            along = 2.0**-12 / length
            for j in range(m):
                h = (2.0**-17 if in_state else 2.0**-12) * size[j]
                for k in (1.0, -1.0):
                    shifted = u.copy()
                    shifted[j] += k * h
                    if in_state:
                        x, p = values_at(shifted, par)
                        bent[:, j] += k * (self.slopes(x, p) @ z[:n]) / (2.0 * h)
                    else:
                        difference = self.value(*values_at(shifted + along * z, par)) - self.value(
                            *values_at(shifted - along * z, par)
                        )
                        bent[:, j] += k * difference / (4.0 * h * along)

        return second


def sharp_slopes(
    lines: Sequence[Callable[[float], Array]], middle: Array, places: list[float],
    sizes: list[float],
) -> Array:  # fmt: skip
    """The slopes of functions at 0 (columns), each along an unknown of some size at some place."""
    units = [_power(max(abs(x), size)) for x, size in zip(places, sizes, strict=True)]
    slopes = _slopes(lines, middle, units)
    _inside(lines, middle, slopes, places, sizes)
    return slopes


def _inside(
    lines: Sequence[Callable[[float], Array]], middle: Array, slopes: Array, places: list[float],
    sizes: list[float],
) -> None:  # fmt: skip
    """Take slopes that are not finite over shorter steps, next to an edge of the domain."""
    if not np.isfinite(middle).all():
        return
    for j in np.flatnonzero(~np.isfinite(slopes).all(axis=0)).tolist():
        slopes[:, j] = _beside_edge(lines[j], places[j], sizes[j])


def _beside_edge(at: Callable[[float], Array], x: float, size: float) -> Array:
    """The slope of a function that has no value a usual step away from x."""
    h = COARSE * coarse(x, size)
    for _ in range(EDGES):
        h /= 16.0
        if not h > 4.0 * EPSILON * abs(x):
            break
        if np.isfinite(at(h) - at(-h)).all():
            h = max(h / 4096.0, 4.0 * _power(4.0 * EPSILON * abs(x)))  # the edge is far beside it
            return np.asarray((at(h) - at(-h)) / (2.0 * h))
    return _on_edge(at, COARSE * coarse(x, size))


def _on_edge(at: Callable[[float], Array], h: float) -> Array:
    """The slope of a function on the edge of its domain, from inside; NaN where it has none there.

    Over two steps, which agree unless the function bends without end.
    """
    here = at(0.0)
    for side in (h, -h):
        wide, near = (
            (4.0 * at(k) - at(2.0 * k) - 3.0 * here) / (2.0 * k) for k in (side, 0.125 * side)
        )
        if np.isfinite(wide).all() and np.isfinite(near).all():
            noise = ON_EDGE * (np.abs(wide) + np.abs(near)) + 1e3 * EPSILON * np.abs(here) / h
            return np.where(np.abs(wide - near) <= noise, wide, np.nan)
    return here * np.nan


def _shorter(
    at: Callable[[float], Array], middle: Array, slope: Array, bent: Array, h: float, x: float
) -> Array:
    """The slope of a function that bends within a step, over one that is short enough."""
    last = np.inf
    for _ in range(EDGES):
        size = np.abs(slope) + bent / h
        h /= 16.0
        if not h > 4.0 * EPSILON * abs(x):
            break
        ahead, behind = at(h), at(-h)
        found = (ahead - behind) / (2.0 * h)
        gap = float(np.max(np.abs(found - slope) / np.where(size > 0.0, size, 1.0)))
        if not CLOSE < gap < 0.5 * last:
            break  # it is the same, or but rounding
        last, slope, bent = gap, found, np.abs(ahead + behind - 2.0 * middle)
    return slope


def _power(h: float) -> float:
    """The power of two below: what is added to a number of its size is then exact."""
    return math.ldexp(0.5, math.frexp(h)[1])


def _slopes(lines: Sequence[Callable[[float], Array]], middle: Array, sizes: list[float]) -> Array:
    """The slopes of functions at 0 (columns), as `phasekit.numerics.differences` takes them."""
    if not lines:
        return np.empty((len(middle), 0))
    short = []
    for at, size in zip(lines, sizes, strict=True):
        h, k = FINE * size, 2.0 * FINE * size
        short.append(((at(h) - at(-h)) / (2.0 * h), (at(k) - at(-k)) / (2.0 * k)))
    gaps = np.sort(
        [FINE * size * np.abs(a - b) for (a, b), size in zip(short, sizes, strict=True)], axis=0
    )
    terms = EPSILON * np.sum(
        [size * np.abs(a) for (a, _), size in zip(short, sizes, strict=True)], axis=0
    )
    noise = np.maximum(gaps[-2], terms) if len(gaps) > 1 else terms
    return np.column_stack(
        [
            _slope(at, middle, size, *two, noise, terms)
            for at, size, two in zip(lines, sizes, short, strict=True)
        ]
    )


def _slope(
    at: Callable[[float], Array], middle: Array, size: float, fine: Array, wide: Array,
    noise: Array, terms: Array,
) -> Array:  # fmt: skip
    """The slope of a function at 0, given those over the shortest steps and the noise of f."""
    seen = np.maximum(np.abs(fine - wide), noise / (FINE * size))
    slope, least = fine.copy(), np.full_like(middle, np.inf)
    h = STEP * size
    for _ in range(TRIES):
        far = (at(2.0 * h) - at(-2.0 * h)) / (4.0 * h)
        ahead, behind = at(h), at(-h)
        near = (ahead - behind) / (2.0 * h)
        gap = np.abs(near - far)
        best = near + (near - far) / 3.0
        steep, curved = np.abs(near), np.abs(ahead + behind - 2.0 * middle) / h
        width = np.fmin((gap / curved) ** 2, gap / steep)
        left = np.where(gap > 0.0, gap * width, 0.0)
        rounding = np.minimum(
            FINE * size / h * np.abs(fine - wide), KNOWN * (steep + 100.0 * curved)
        )
        rounding += terms / h
        off = np.maximum(0.0, np.abs(best - fine) - 4.0 * seen)
        off[off <= 1e-9 * (steep + curved)] = 0.0
        better = left + off + rounding < least
        slope[better], least[better] = best[better], (left + off + rounding)[better]
        if np.all((left <= rounding) & (off == 0.0)):
            break
        h *= SHORTER
    return slope


def numbers_of(argument: str, result: Any, shape: tuple[int, ...]) -> Array:
    """What a function returned as an array of its own, of real numbers."""
    try:
        numbers = np.array(result)
        if numbers.dtype is NUMBERS and numbers.shape == shape:
            return numbers
        if numbers.dtype.kind == "c":
            raise ParameterError(
                f"{argument}: returned complex numbers, {str(numbers)[:80]}, wants real ones"
            )
        if numbers.dtype == object and any(number is None for number in numbers.flat):
            raise ValueError("None among the numbers")  # which NumPy takes for NaN
        return np.asarray(numbers, dtype=float).reshape(shape)
    except (TypeError, ValueError) as error:
        if isinstance(error, ParameterError):
            raise
        raise ParameterError(
            f"{argument}: returned {str(result)[:80]}, wants numbers of shape {shape}"
        ) from error
