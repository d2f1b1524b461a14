"""States from which motions start: grids over some states of a law, the others fixed."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from phasekit.labels.arguments import FloatArray, bad, number, numeric, unknown
from phasekit.laws.equations import Equations
from phasekit.laws.formulas import symbols_of, take_formula

#: Cells of a grid over the whole window, and starts of a search for attractors.
CELLS, STARTS = 10_000, 256
#: Points of the grid over the window of a single state, at most; and states of a full one.
LONGEST, FULL = 1_000, 5
#: Points along an axis of a grid that shows nothing.
FEW = 4
WANTS = "a 1-D array of finite, increasing values"


@dataclass(frozen=True)
class StartGrid:
    """A grid over some states of a law, the others fixed by numbers or formulas of these."""

    law: Equations
    axes: dict[str, FloatArray]
    fixed: dict[str, Any]
    values: dict[str, float]
    """The parameters."""

    @property
    def shape(self) -> tuple[int, ...]:
        """Points along each axis."""
        return tuple(axis.size for axis in self.axes.values())

    @property
    def places(self) -> dict[int, FloatArray]:
        """The axes by the places of their states."""
        return {self.law.states.index(name): axis for name, axis in self.axes.items()}

    @property
    def widths(self) -> FloatArray:
        """Widths of the window, or else of the grid; 0 where there is neither."""
        window = self.law.window
        found = []
        for name in self.law.states:
            low, high = window.get(name, (0.0, 0.0))
            own = float(np.ptp(self.axes[name])) if name in self.axes else 0.0
            found.append(max(high - low, own))
        return np.array(found)

    def states(self) -> FloatArray:
        """All states, of shape (cells, states)."""
        if len(self.axes) > FULL and min(self.shape) <= FEW:
            wants = "values of some states, the others in fixed"
            raise bad("grid", None, wants, f"one over all {len(self.axes)} states is too coarse")
        return self._filled(np.meshgrid(*self.axes.values(), indexing="ij"))

    def starts(self) -> FloatArray:
        """States evenly among them from which attractors are looked for."""
        if len(self.axes) <= FULL:
            each = max(int(STARTS ** (1.0 / len(self.axes)) + 1e-9), 3)
            few = [
                np.linspace(0, axis.size - 1, min(axis.size, each)) for axis in self.axes.values()
            ]
            some = [
                axis[at.round().astype(int)]
                for axis, at in zip(self.axes.values(), few, strict=True)
            ]
            return self._filled(np.meshgrid(*some, indexing="ij"))
        chance = np.random.default_rng(0)
        return self._filled([chance.choice(axis, STARTS) for axis in self.axes.values()])

    def _filled(self, grids: Sequence[FloatArray]) -> FloatArray:
        """States of points of the grid."""
        import sympy as sp

        known = {name: grid.ravel() for name, grid in zip(self.axes, grids, strict=True)}
        count = grids[0].size
        columns = []
        for name in self.law.states:
            if name in known:
                columns.append(known[name])
            elif isinstance(self.fixed[name], float):
                columns.append(np.full(count, self.fixed[name]))
            else:
                symbols = symbols_of([*self.axes, *self.values])
                function = sp.lambdify(list(symbols.values()), self.fixed[name], "numpy")
                with np.errstate(all="ignore"):
                    found = function(*known.values(), *self.values.values())
                columns.append(np.array(np.broadcast_to(found, count), float))
        return np.stack(columns, axis=-1)


def start_grid(law: Equations, values: Mapping[str, float], grid: Any, fixed: Any) -> StartGrid:
    """The grid that a call asks for; by default one over the window of all states.

    ``grid`` are values of states, ``fixed`` numbers for others, or formulas of those of the grid
    and of parameters.
    """
    for argument, given in (("grid", grid), ("fixed", fixed)):
        if given is not None and not isinstance(given, Mapping):
            raise bad(argument, given, "a mapping from names of states to values")
        for name in given or {}:
            if name not in law.states:
                raise unknown(f"{argument}: state", name, law.states)
    fixed = dict(fixed or {})
    for name in grid or {}:
        if name in fixed:
            raise bad(f"fixed[{name!r}]", fixed[name], "a state that is not on the grid")
    if grid is None:
        free = [name for name in law.states if name not in fixed]
        axes = _default_axes(law, free)
    else:
        if not grid:
            raise bad("grid", grid, "at least one state")
        axes = {name: _axis(f"grid[{name!r}]", axis) for name, axis in grid.items()}
    kept: dict[str, Any] = {}
    symbols = symbols_of([*axes, *values])
    for name in law.states:
        if name in axes:
            continue
        if name in fixed:
            kept[name] = _fixed(f"fixed[{name!r}]", fixed[name], symbols)
        elif name in law.window:
            kept[name] = 0.5 * sum(law.window[name])
        else:
            wants = f"a number or a formula for {name}, or a window of it"
            raise bad("fixed", list(fixed), wants, "it is not on the grid")
    return StartGrid(law, axes, kept, dict(values))


def _fixed(argument: str, given: Any, symbols: Mapping[str, Any]) -> Any:
    if isinstance(given, str) or hasattr(given, "free_symbols"):
        declare = "it is neither a state of the grid nor a parameter"
        return take_formula(given, symbols, argument, declare)
    return number(argument, given, "a finite number, or a formula")


def _axis(argument: str, values: Any) -> FloatArray:
    if np.ndim(values) == 0 and not isinstance(values, str):
        hint = "np.linspace(low, high, n) makes one; a state that stands still goes into fixed"
        raise bad(argument, values, WANTS, hint)
    axis = np.atleast_1d(np.asarray(numeric(argument, values, None, WANTS), dtype=float))
    if axis.ndim != 1 or not np.isfinite(axis).all() or not (np.diff(axis) > 0.0).all():
        raise bad(argument, values, WANTS)
    return axis


def _default_axes(law: Equations, free: list[str]) -> dict[str, FloatArray]:
    """Axes over the window, in the middles of their cells; of angles without one over a turn."""
    if not free:
        raise bad("fixed", list(law.states), "at least one state left for the grid")
    each = min(max(int(CELLS ** (1.0 / len(free)) + 1e-9), FEW), LONGEST)
    axes = {}
    for name in free:
        if name in law.window:
            low, high = law.window[name]
        elif name in law.periods:
            low, high = -0.5 * law.periods[name], 0.5 * law.periods[name]
        else:
            wants = f"values of {name}, where the system has no window of it"
            raise bad("grid", None, wants, "a Problem takes window={...}")
        axes[name] = low + (high - low) * (np.arange(each) + 0.5) / each
    return axes
