"""A plane of two parameters of a potential: its fold curves and others, found and traced.

Each fold curve in the space of both parameters and the coordinate reaches an edge of the plane, or
has a point where one parameter is extreme along it, or a cusp. There V''' = 0, or the derivative of
V' by the other parameter vanishes: zeros of three formulas in a box, all of which are proved. So no
curve is missed.
"""

from __future__ import annotations

import functools
import itertools
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from phasekit.arrays import Array
from phasekit.bifurcation.numerical.boxes import Merger, exact
from phasekit.bifurcation.numerical.line import Line
from phasekit.bifurcation.numerical.mergers import mergers, window
from phasekit.bifurcation.numerical.resting import Resting, vanishes, vanishing
from phasekit.laws.derivatives import derivative
from phasekit.laws.formulas import symbols_of
from phasekit.numerics.intervals.bounds import Bounds
from phasekit.numerics.intervals.zeros import zeros_in_box
from phasekit.numerics.tracing import Equations
from phasekit.phase.numerical import functions
from phasekit.phase.numerical.code import array_code
from phasekit.phase.numerical.equilibria import Equilibria
from phasekit.phase.numerical.formula import Formula

Limits = tuple[float, float]

#: Half widths, as parts of the window, of what is left out about an equilibrium that rests.
BESIDE = 1e-3
#: Boxes at once that are tried beside it.
MOST_BOXES = 1 << 14
#: Widths of the window in which a coordinate on a line is measured, for it is no circle.
_SPREAD = 4.0


@functools.lru_cache(maxsize=32)
def _terms(formula: Formula, names: tuple[str, str]) -> tuple[Any, Any, tuple[Any, Any], list[Any]]:
    """V' and its symbols: the coordinate, two parameters, and the others."""
    symbols = symbols_of((formula.coordinate, *formula.names))
    x, pair = symbols[formula.coordinate], (symbols[names[0]], symbols[names[1]])
    rest = [symbols[name] for name in formula.names if name not in names]
    return derivative(formula.expression, x), x, pair, rest


#: Derivatives of V that curves need: by x, and by both parameters.
_ORDERS = (*((i, 0, 0) for i in range(5)), *((i, *by) for by in ((1, 0), (0, 1)) for i in range(3)))


@functools.lru_cache(maxsize=32)
def _jets(formula: Formula, names: tuple[str, str]) -> Any:
    """The derivatives of `_ORDERS` as one function of the coordinate and all parameters."""
    slope, x, pair, rest = _terms(formula, names)
    found = []
    for order, *by in _ORDERS:
        one = derivative(slope, x, order - 1) if order > 1 else slope if order else None
        one = formula.expression if one is None else one
        for symbol, times in zip(pair, by, strict=True):
            one = derivative(one, symbol, times) if times else one
        found.append(one)
    return array_code([x, *pair, *rest], found)


@dataclass(frozen=True, eq=False)
class Plane:
    """Two parameters of a potential over a rectangle; `still` holds the others."""

    formula: Formula
    still: Mapping[str, float]
    names: tuple[str, str]
    limits: tuple[Limits, Limits]

    # ---------------------------------------------------------------- coordinates

    @cached_property
    def diagonal(self) -> Line:
        """The line from corner to corner."""
        return Line(self.formula, self.still, dict(zip(self.names, self.limits, strict=True)))

    @cached_property
    def window(self) -> Limits:
        """Coordinates between which curves are looked for."""
        ends = [window(line) for _, line in self.edges]
        return min(low for low, _ in ends), max(high for _, high in ends)

    @cached_property
    def size(self) -> float:
        """What coordinates are measured in: one turn, or more than all of the window."""
        low, high = self.window
        return self.formula.period or _SPREAD * (high - low)

    @cached_property
    def edges(self) -> list[tuple[tuple[int, float], Line]]:
        """Edges of the plane: which parameter is fixed, at 0 or 1, and the line."""
        found = []
        for i, u in itertools.product((0, 1), (0, 1)):
            still = {**self.still, self.names[i]: self.limits[i][u]}
            moving = {self.names[1 - i]: self.limits[1 - i]}
            found.append(((i, float(u)), Line(self.formula, still, moving)))
        return found

    def parameters(self, points: Array) -> Array:
        """Both parameters of points in units of the plane, inside its limits."""
        low, high = np.array(self.limits).T
        u = points[..., :2]
        return np.asarray(np.where(u == 1.0, high, np.clip(low + (high - low) * u, low, high)))

    def unit(self, value: float, i: int) -> float:
        """A parameter in units of the plane."""
        low, high = self.limits[i]
        return (value - low) / (high - low)

    def equilibria(self, points: Array) -> Equilibria:
        """Equilibria at points in units of the plane, one row each."""
        x, y = self.parameters(points).T
        values = {name: np.full(x.shape, value) for name, value in self.still.items()}
        values |= dict(zip(self.names, (x, y), strict=True))
        return functions.equilibria(self.formula, *(values[n] for n in self.formula.names))

    @cached_property
    def extent(self) -> Limits:
        """Where equilibria lie: the circle, the interval, or a little more than some of them."""
        low, high = self.formula.ends
        if np.isfinite(low):
            return low, high
        ticks = np.linspace(0.0, 1.0, 9)
        grid = np.stack(np.meshgrid(ticks, ticks), axis=-1).reshape(-1, 2)
        phi = self.equilibria(grid).phi
        low, high = (float(end(phi[np.isfinite(phi)], initial=0.0)) for end in (np.min, np.max))
        room = 0.1 * (high - low) or 1.0
        return low - room, high + room

    def force(self, x: Array, y: Array, phi: Array) -> tuple[Array, Array]:
        """V' and V'' over a grid, in units of the greatest force at each of the parameters."""
        values = {**self.still, self.names[0]: x, self.names[1]: y}
        own = [values[name] for name in self.formula.names]
        slope, bend = (f(phi, *own) for f in (self.formula.slopes, self.formula.bends))
        size = np.max(np.abs(slope), axis=-1, keepdims=True)
        scale = np.divide(1.0, size, out=np.zeros_like(size), where=size > 0.0)
        return slope * scale, bend * scale

    # ---------------------------------------------------------------- equations

    def jet(self, z: Array, phi: float) -> dict[tuple[int, int, int], float]:
        """Derivatives of V at a point: by x, and by both parameters in units of the plane."""
        widths = [high - low for low, high in self.limits]
        places = [low + width * float(u) for (low, _), width, u in zip(self.limits, widths, z)]  # noqa: B905
        rest = [self.still[name] for name in self.formula.names if name not in self.names]
        with np.errstate(all="ignore"):
            found = _jets(self.formula, self.names)(phi, *places, *rest)
        scales = (widths[0] ** by[0] * widths[1] ** by[1] for _, *by in _ORDERS)
        return {o: float(f) * c for o, f, c in zip(_ORDERS, found, scales, strict=True)}

    def row(self, jet: Any, order: int, place: int | None, unknowns: int) -> Any:
        """A derivative of V by x and its derivatives by the unknowns, phi being one of them."""
        slopes = np.zeros(unknowns)
        slopes[0], slopes[1] = jet[order, 1, 0], jet[order, 0, 1]
        if place is not None:
            slopes[place] = jet[order + 1, 0, 0] * self.size
        return jet[order, 0, 0], slopes

    def fold(self, z: Array) -> tuple[Array, Array]:
        """V' and V'' and their Jacobian at (x, y, phi)."""
        jet = self.jet(z, self.size * z[2])
        rows = [self.row(jet, order, 2, 3) for order in (1, 2)]
        return np.array([f for f, _ in rows]), np.array([d for _, d in rows])

    def vanishing(self, x: float, order: int) -> Equations:
        """The equation of the set where V' or V'' vanishes at a coordinate."""

        def equation(z: Array) -> tuple[Array, Array]:
            f, slopes = self.row(self.jet(z, x), order, None, 2)
            return np.array([f]), slopes[None]

        return equation

    def level(self, z: Array) -> tuple[Array, Array]:
        """V' at two coordinates, and the difference of V, with their Jacobian."""
        jets = [self.jet(z, self.size * w) for w in z[2:]]
        rows = [self.row(jet, 1, 2 + i, 4) for i, jet in enumerate(jets)]
        high, low = (self.row(jet, 0, 2 + i, 4) for i, jet in enumerate(jets))
        rows.append((high[0] - low[0], high[1] - low[1]))
        return np.array([f for f, _ in rows]), np.array([d for _, d in rows])

    # ---------------------------------------------------------------- what is proved

    @cached_property
    def resting(self) -> list[Resting]:
        """Equilibria that do not move in the whole plane."""
        slope, x, _, rest = _terms(self.formula, self.names)
        numbers = tuple((symbol, exact(self.still[str(symbol)])) for symbol in rest)
        return vanishing(self.diagonal, slope, x, numbers)

    @cached_property
    def found_on_edges(self) -> list[tuple[tuple[int, float], list[Merger], str]]:
        """Mergers on the edges, and why there may be others."""
        return [(where, *mergers(line)) for where, line in self.edges]

    def triple(self, third: Sequence[int]) -> tuple[list[Array], str]:
        """All points (x, y, phi) where V', V'' and one more derivative of V vanish.

        In units of the plane, besides why there may be others. Beside equilibria that rest nothing
        is looked for.
        """
        slope, x, pair, rest = _terms(self.formula, self.names)
        f = [slope, derivative(slope, x), self._derivative(third)]
        low, high = self.window
        width = BESIDE * (high - low)
        cuts = [low]
        for point in sorted(self.resting, key=lambda one: one.low):
            cuts += [point.low - width, point.high + width]
        cuts.append(high)
        numbers = {symbol: self.still[str(symbol)] for symbol in rest}
        ends = np.array(self.limits)
        found, missing = list[Array](), ""
        for first, last in zip(cuts[::2], cuts[1::2], strict=True):
            if not first < last or self._is_zero(f[2]):
                continue
            box = zeros_in_box(f, [x, *pair], numbers, [first, *ends[:, 0]], [last, *ends[:, 1]])
            for phi, a, b in box.zeros:
                found.append(np.array([self.unit(a, 0), self.unit(b, 1), phi / self.size]))
            if not box.complete:
                missing = "points where more than three equilibria merge, or rounding, hide them"
        return found, missing

    @cached_property
    def hidden(self) -> str:
        """Why fold curves may close right beside an equilibrium that rests; empty if they do not.

        With V' = u W and W = W_u = 0 at a fold, the bounds of W and W_u are those of V'' and V'''/2
        beside it; of an even V, where W_u vanishes, W_uu takes its place.
        """
        low, high = self.window
        width = BESIDE * (high - low)
        for point in self.resting:
            if not self._alone(point, width):
                return f"folds within {width:.2g} of an equilibrium that rests are not excluded"
        return ""

    def _is_zero(self, formula: Any) -> bool:
        """Whether a formula is zero in the whole plane."""
        _, x, _, rest = _terms(self.formula, self.names)
        return vanishes(formula, x, x, 0, tuple((s, exact(self.still[str(s)])) for s in rest))

    def _alone(self, point: Resting, width: float) -> bool:
        """Whether no fold lies beside an equilibrium that rests."""
        slope, x, pair, rest = _terms(self.formula, self.names)
        orders = (1, 3 if point.even else 2)
        bounds = Bounds([derivative(slope, x, order) for order in orders], [x, *pair, *rest])
        numbers = [(self.still[str(symbol)],) * 2 for symbol in rest]
        boxes = np.array(self.limits).T[:, None, :]  # low and high, box, parameter
        while boxes.shape[1]:
            if boxes.shape[1] > MOST_BOXES:
                return False
            ends = np.full((2, boxes.shape[1]), [[point.low - width], [point.high + width]])
            columns: list[Any] = [tuple(ends), *((boxes[0, :, i], boxes[1, :, i]) for i in (0, 1))]
            found, undefined = bounds(*columns, *numbers)
            clear = np.any([(a > 0.0) | (b < 0.0) for a, b in found], axis=0) & ~undefined
            boxes = boxes[:, ~clear]
            middle = boxes.mean(axis=0)
            for i in (0, 1):
                one, other = boxes.copy(), boxes.copy()
                one[1, :, i] = other[0, :, i] = middle[..., i]
                boxes = np.concatenate([one, other], axis=1)
                middle = np.concatenate([middle, middle])
        return True

    def _derivative(self, orders: Sequence[int]) -> Any:
        slope, x, pair, _ = _terms(self.formula, self.names)
        found = derivative(slope, x, orders[0] - 1) if orders[0] > 1 else slope
        for symbol, order in zip(pair, orders[1:], strict=True):
            found = derivative(found, symbol, order) if order else found
        return found

    def extremes(self, x: Any, order: int) -> tuple[list[Array], bool]:
        """Points of the set where V' or V'' vanishes at a coordinate at which x is extreme."""
        slope, symbol, pair, rest = _terms(self.formula, self.names)
        f = (derivative(slope, symbol) if order == 2 else slope).subs(symbol, x)
        numbers = {one: self.still[str(one)] for one in rest}
        other = derivative(f, pair[1])
        if self._is_zero(other) or self._is_zero(f):  # it reaches the edges, or is none
            return [], True
        ends = np.array(self.limits)
        box = zeros_in_box([f, other], list(pair), numbers, ends[:, 0], ends[:, 1])
        return [np.array([self.unit(a, 0), self.unit(b, 1)]) for a, b in box.zeros], box.complete
