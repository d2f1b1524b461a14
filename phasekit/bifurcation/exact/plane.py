"""A plane of two parameters: the equations of its sets, the net of lines that finds them.

Points of the plane are measured in units of its limits.
"""

from __future__ import annotations

import itertools
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from phasekit.arrays import Array
from phasekit.bifurcation.exact.line import Path
from phasekit.bifurcation.exact.normal_forms import STEP
from phasekit.bifurcation.regions import components, depths
from phasekit.laws.trigonometric import Factor, Trigonometric
from phasekit.numerics.real_roots import unit_roots
from phasekit.numerics.tracing import Equations

Limits = tuple[float, float]

#: Lines of the net in each direction, beside the edges of the plane.
LINES = 24
# Crossings are found to 2^-SEEDS, and refined on the curves.
SEEDS = 30
TURN = 2.0 * np.pi


@dataclass(frozen=True)
class Plane:
    """Two parameters of a law over a rectangle; `values` holds the others."""

    law: Trigonometric
    values: Mapping[str, float]
    names: tuple[str, str]
    limits: tuple[Limits, Limits]

    # ---------------------------------------------------------------- coordinates

    def values_at(self, point: Array, step: complex = 0.0, along: int = 0) -> dict[str, Any]:
        """Return all parameters at a point in units of the plane, displaced along one of two."""
        values: dict[str, Any] = dict(self.values)
        for i, (name, (low, high)) in enumerate(zip(self.names, self.limits, strict=True)):
            u = float(point[i])
            value = high if u == 1.0 else low + (high - low) * u
            values[name] = complex(value, (high - low) * STEP) if step and along == i else value
        return values

    def parameters(self, points: Array) -> Array:
        """Return both parameters of points in units of the plane, inside its limits."""
        low, high = np.array(self.limits).T
        u = points[:, :2]
        return np.asarray(np.where(u == 1.0, high, np.clip(low + (high - low) * u, low, high)))

    def unit(self, value: float, i: int) -> float:
        """Return a parameter in units of the plane."""
        low, high = self.limits[i]
        return (value - low) / (high - low)

    def A(self, x: Array, y: Array) -> Array:
        """A at values of both parameters."""
        values = {name: np.full(x.shape, value) for name, value in self.values.items()}
        with np.errstate(all="ignore"):
            found: Array = self.law.coefficients({**values, self.names[0]: x, self.names[1]: y})[0]
        return found

    # ---------------------------------------------------------------- equations

    def _derivatives(self, function: Callable[[dict[str, Any]], tuple[Any, ...]], z: Array) -> Any:
        """Values of a function of the parameters and its two derivatives, exact to rounding."""
        columns = [np.array(function(self.values_at(z, 1j, i))) for i in (0, 1)]
        return columns[0].real, columns[0].imag / STEP, columns[1].imag / STEP

    def fold(self, z: Array) -> tuple[Array, Array]:
        """V' and V'' and their Jacobian at (x, y, phi in turns), relative to the force."""
        (A, B, C), dx, dy = self._derivatives(lambda v: self.law(v)[:3], z)
        phi = TURN * z[2]
        sin, cos = np.sin(phi), np.cos(phi)
        sin2, cos2 = 2.0 * sin * cos, (cos - sin) * (cos + sin)
        rows = np.array([[-sin * cos, sin, -cos], [-cos2, cos, sin]])
        force = np.hypot(np.hypot(A, B), C)  # squares of large ones overflow
        if force == 0.0:  # no direction: the curve ends here
            return np.zeros(2), np.zeros((2, 3))
        scale = 1.0 / force
        abc = np.array([A, B, C]) * scale
        third = -B * sin + 2.0 * A * sin2 + C * cos
        residual = rows @ abc
        jacobian = np.empty((2, 3))
        jacobian[:, 0], jacobian[:, 1] = rows @ dx * scale, rows @ dy * scale
        jacobian[:, 2] = TURN * np.array([residual[1], third * scale])
        return residual, jacobian

    def zero(self, factor: Factor) -> Equations:
        """Equation of the set where a factor vanishes."""

        def equation(z: Array) -> tuple[Array, Array]:
            f, dx, dy = self._derivatives(lambda v: (factor(self.law.turned(v)),), z)
            size = float(np.hypot(dx[0], dy[0])) or 1.0
            return f / size, np.array([[dx[0], dy[0]]]) / size

        return equation

    # ---------------------------------------------------------------- what vanishes everywhere

    @cached_property
    def flat(self) -> tuple[bool, bool, bool]:
        """Whether A, B, C vanish in the whole plane."""
        rng = np.random.default_rng(0)
        samples = [self.law(self.values_at(u))[:3] for u in rng.random((3, 2))]
        return tuple(all(s[i] == 0.0 for s in samples) for i in range(3))  # type: ignore[return-value]

    # ---------------------------------------------------------------- net of lines

    def lines(self) -> Iterator[tuple[int, float, Path]]:
        """Lines of the net: which parameter is fixed, where in units of the plane, the path."""
        inner = (np.arange(LINES) + 0.5 + 0.1 * np.sin(np.arange(LINES))) / LINES
        for i, u in itertools.product((0, 1), (0.0, *inner, 1.0)):
            low, high = self.limits[i]
            value = high if u == 1.0 else float(low + (high - low) * u)
            values = {**self.values, self.names[i]: value}
            yield i, u, Path(self.law, values, self.names[1 - i], self.limits[1 - i])

    @cached_property
    def net(self) -> list[tuple[int, float, Path]]:
        """The lines, each of which keeps its polynomials."""
        return list(self.lines())

    def crossings(self, polynomial: Callable[[Path], Any]) -> Iterator[tuple[int, float, Array]]:
        """All points of the net where a polynomial along its lines vanishes."""
        for i, u, path in self.net:
            for x in unit_roots(polynomial(path), SEEDS):
                point = np.empty(2)
                point[i], point[1 - i] = u, self.unit(path.along(x), 1 - i)
                yield i, u, point


def regions(plane: Plane, cells: int = 160) -> list[tuple[float, float, int, float]]:
    """A point well inside each region of the plane with one number of equilibria.

    Rows are x, y, number and the distance from the border in units of the plane; regions that are
    thinner than a cell of the grid on which they are told apart may be missing.
    """
    ticks = (np.arange(cells) + 0.5) / cells
    grid = np.stack(np.meshgrid(ticks, ticks, indexing="ij"), axis=-1).reshape(-1, 2)
    x, y = plane.parameters(grid).T
    values = {name: np.full(x.size, value) for name, value in plane.values.items()}
    A, B, C = plane.law({**values, plane.names[0]: x, plane.names[1]: y})[:3]
    number = np.where(np.cbrt(B) ** 2 + np.cbrt(C) ** 2 < np.cbrt(A) ** 2, 4, 2)
    number = np.where((A == 0.0) & (B == 0.0) & (C == 0.0), 0, number).reshape(cells, cells)
    # Points keep off the lines on which A, B or C changes sign.
    clear = np.ones((cells, cells), bool)
    for sign in (np.sign(f).reshape(cells, cells) for f in (A, B, C)):
        clear[1:] &= sign[1:] == sign[:-1]
        clear[:, 1:] &= sign[:, 1:] == sign[:, :-1]
    labels = components(number)
    depth = depths(labels, clear)
    found = []
    for label in np.unique(labels):
        i = int(np.where(labels == label, depth, -1).argmax())
        n = int(number.flat[i])
        found.append((float(x[i]), float(y[i]), n, float(depth.flat[i]) / cells))
    return found
