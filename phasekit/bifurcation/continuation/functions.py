"""Functions of the states and free parameters of a curve: values, derivatives, and their noise."""

from __future__ import annotations

import functools
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np

from phasekit.arrays import Array
from phasekit.bifurcation.continuation.code_fields import numbers_of, sharp_slopes
from phasekit.bifurcation.continuation.fields import first_of, magnitude, slopes_of, unknowns_of
from phasekit.numerics import differences
from phasekit.numerics.long_formulas import long_formulas

EPSILON = 2.0**-52
STEP = 2.0**-17  # of central differences
APART = 7.7e-13  # neighbours that show rounding; no power of two, which would hide it


class Unknowns(Protocol):
    """What a curve says of its unknowns."""

    @property
    def par(self) -> Array:
        """All parameters."""

    @property
    def active(self) -> tuple[int, ...]:
        """Places of the free parameters."""

    @property
    def scale(self) -> Array:
        """Sizes of the unknowns."""

    @property
    def n(self) -> int:
        """Number of states."""

    @property
    def m(self) -> int:
        """Number of states and free parameters."""


@dataclass(frozen=True)
class Formula:
    """A formula of states and parameters; its derivatives are exact."""

    expression: Any
    states: tuple[str, ...]
    parameters: tuple[str, ...]

    def values(self, curve: Unknowns, u: Array) -> Array:
        """Values at many points, the rows of u."""
        return self._jet(curve, u)[:, 0]

    def rates(self, curve: Unknowns, u: Array, along: Array) -> Array:
        """Derivatives along a direction at each point."""
        return np.asarray(np.sum(self._jet(curve, u)[:, 2:] * along[:, : curve.m], axis=1))

    def noise(self, curve: Unknowns, u: Array) -> Array:
        """Sizes up to which a value is but rounding: of its terms, and of the unknowns."""
        found = np.abs(self._jet(curve, u))
        reach = np.maximum(np.abs(u[:, : curve.m]), curve.scale[: curve.m])
        return np.asarray(EPSILON * (16.0 * found[:, 1] + 4.0 * np.sum(found[:, 2:] * reach, 1)))

    def code(self, active: tuple[int, ...]) -> int:
        """Address of machine code for the value and its derivatives by the unknowns."""
        return first_of((self.expression,), self.states, self.parameters, active)

    def slopes(self, curve: Unknowns, u: Array) -> Array:
        """The value at a point, and its derivatives by the unknowns."""
        return np.delete(self._jet(curve, u[None])[0], 1)

    def bounds(self, curve: Unknowns) -> Callable[[Array, Array], Array] | None:
        """What tells of boxes (lows, highs) whether it may vanish there; None if nothing does."""
        from phasekit.numerics.intervals.bounds import Bounds
        from phasekit.numerics.intervals.program import NoRule

        u, _ = unknowns_of(self.states, self.parameters, curve.active)
        fixed = [i for i in range(len(self.parameters)) if i not in curve.active]
        names, _ = unknowns_of((), self.parameters, tuple(fixed))
        try:
            found = Bounds([self.expression], [*u, *names])
        except NoRule:
            return None
        numbers = [(float(curve.par[i]), float(curve.par[i])) for i in fixed]

        def vanishes(low: Array, high: Array) -> Array:
            columns = [(low[:, j], high[:, j]) for j in range(len(u))]
            ((least, most),), undefined = found(*columns, *numbers)
            return np.asarray((least <= 0.0) & (most >= 0.0) | undefined)

        return vanishes

    def _jet(self, curve: Unknowns, u: Array) -> Array:
        """Value, size of the terms and derivatives by the unknowns, in columns."""
        code = _compiled(self.expression, self.states, self.parameters, curve.active)
        count = 2 + curve.m
        # As many columns as the code that takes them reads.
        points = np.zeros((len(u), count + len(curve.active)))
        points[:, : curve.m] = u[:, : curve.m]
        out = np.empty((len(u), count))
        active = np.array(curve.active, dtype=np.int64)
        with np.errstate(all="ignore"):
            differences.values(code, count, curve.par[None].copy(), active, points, out)
        return out


@dataclass(frozen=True)
class Code:
    """A function q(x, **parameters); its derivatives are differences."""

    function: Callable[..., Any]
    states: tuple[str, ...]
    parameters: tuple[str, ...]

    def values(self, curve: Unknowns, u: Array) -> Array:
        """Values at many points, the rows of u; NaN where it has none."""
        n = curve.n
        p = dict(zip(self.parameters, curve.par.tolist(), strict=False))
        free = [self.parameters[i] for i in curve.active]
        out = np.full(len(u), np.nan)
        with np.errstate(all="ignore"):
            for k, point in enumerate(u):
                p.update(zip(free, point[n : curve.m].tolist(), strict=True))
                try:
                    value = self.function(point[:n].copy(), **p)
                except Exception:  # noqa: BLE001 - a user's function, without a value there
                    continue
                out[k] = _number(value)
        return out

    def rates(self, curve: Unknowns, u: Array, along: Array) -> Array:
        """Derivatives along a direction at each point."""
        t = along[:, : curve.m]
        sides = [self.values(curve, u[:, : curve.m] + side * STEP * t) for side in (1.0, -1.0)]
        return np.asarray((sides[0] - sides[1]) / (2.0 * STEP))

    def noise(self, curve: Unknowns, u: Array) -> Array:
        """Sizes up to which a value is but rounding: of the unknowns, and inside the function."""
        m = curve.m
        found = []
        for point in u[:, :m]:
            reach = np.maximum(np.abs(point), EPSILON * curve.scale[:m])
            near = point + APART * np.arange(-4.0, 5.0)[:, None] * reach
            values = self.values(curve, near)
            hidden = np.sqrt(np.mean(np.diff(values, n=4) ** 2) / 70.0)
            sides = np.concatenate([point + np.diag(STEP * reach), point - np.diag(STEP * reach)])
            ends = self.values(curve, sides)
            moved = np.sum(np.abs(ends[:m] - ends[m:])) / (2.0 * STEP)
            found.append(8.0 * EPSILON * moved + 8.0 * np.nan_to_num(hidden))
        return np.array(found)

    def slopes(self, curve: Unknowns, u: Array) -> Array:
        """The value at a point, and its derivatives by the unknowns."""
        m, middle = curve.m, self.values(curve, u[None])

        def along(j: int, h: float) -> Array:
            moved = u[:m].copy()
            moved[j] += h
            return self.values(curve, moved[None])

        lines = [functools.partial(along, j) for j in range(m)]
        sizes = curve.scale[:m].tolist()
        return np.append(middle, sharp_slopes(lines, middle, u[:m].tolist(), sizes))

    def bounds(self, curve: Unknowns) -> None:
        """Nothing is known of code between points."""


def _number(value: Any) -> float:
    """A value as a number; yes and no are 1 and -1."""
    if isinstance(value, (bool, np.bool_)):
        return 1.0 if value else -1.0
    return float(numbers_of("events", value, ()))


@dataclass(frozen=True)
class Event:
    """A function by name whose zeros are looked for along a curve."""

    name: str
    function: Formula | Code
    condition: bool = False  # the function says yes or no, and jumps from one to the other


@functools.lru_cache(maxsize=256)
def _compiled(
    expression: Any, states: Sequence[str], parameters: Sequence[str], active: tuple[int, ...]
) -> int:
    from phasekit.numerics.machine_code import compile_expressions

    u, places = unknowns_of(tuple(states), tuple(parameters), active)
    if long := long_formulas([expression], places, u):
        return long.event()
    entries = {0: expression, 1: magnitude(expression)}
    (row,) = slopes_of([expression], u)
    entries.update({2 + j: slope for j, slope in row.items()})
    return compile_expressions(entries, places, 2 + len(u))
