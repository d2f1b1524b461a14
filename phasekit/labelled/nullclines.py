"""Nullclines of planar flows, labelled."""

from __future__ import annotations

from typing import Any

import numpy as np
import xarray as xr

from phasekit.cells.schema import dataset_attrs
from phasekit.labels.arguments import bad, call_checked, whole
from phasekit.labels.grid import LABEL_DTYPE, variable
from phasekit.laws.equations import Equations
from phasekit.laws.formulas import symbols_of
from phasekit.laws.ladder import Map
from phasekit.motion.equation_rates import rates_on, slopes_on
from phasekit.numerics.intervals.curves import Curves, zero_curves
from phasekit.numerics.intervals.program import NoRule
from phasekit.systems.problem import as_problem
from phasekit.systems.rests import corners, window_of
from phasekit.systems.system import as_system


@call_checked
def nullclines(system: Any, window: Any = None, *, resolution: int = 400) -> xr.Dataset:
    """Curves of a planar flow on which one of its states does not change.

    Parameters
    ----------
    system : Problem, or system that states rates
        One flow of two states, without forcing.
    window : mapping of str to (float, float), optional
        Where to look; by default the system's.
    resolution : int, default 400
        Cells of the grid along each state, at least.

    Returns
    -------
    xarray.Dataset
        On ``curve``: ``nullcline_of``, the state whose rate vanishes. On (``curve``, ``point``):
        ``nullcline_`` with the name of each state, in order along each curve; shorter ones end in
        NaN. The last point of a closed curve is its first. ``complete``: whether it is proved that
        these are all; if not, its attribute ``reason`` says what is open.

    Raises
    ------
    ParameterError
        If the system is no planar flow, or an argument is unusable.

    Notes
    -----
    Formulas are taken apart into factors, whose curves may cross. Boxes are quartered until
    interval arithmetic excludes zeros of a factor in them, or finds its gradient within a right
    angle; then the signs at their corners tell how the curve goes [PlantingaVegter2004]. What
    touches the edge of the window within one box may be left out. Of functions, zeros on the lines
    of a grid are joined to curves and moved onto f_i = 0 by Newton's method, and curves smaller
    than a cell are missed; ``complete`` is False.

    Examples
    --------
    >>> import phasekit as pk
    >>> predator = pk.Problem(
    ...     {"n": "n*(1 - n) - n*p/(n + h)", "p": "p*(n/(n + h) - m)"},
    ...     parameters={"h": 0.3, "m": 0.5}, window={"n": (0.0, 1.2), "p": (0.0, 1.0)},
    ... )
    >>> curves = pk.nullclines(predator)
    >>> curves.nullcline_of.values.tolist(), curves.complete.item()
    (['n', 'n', 'p', 'p'], True)
    """
    found = as_system(system)
    found = found if found.standing.traits is None else as_problem(found)
    law = found.own_equations
    if law is None or isinstance(law, Map) or law.time is not None or len(law.states) != 2:
        raise bad("system", found, "a flow of two states without forcing, such as a pk.Problem")
    count = whole("resolution", resolution, "a number of cells >= 10", 10)
    problem = as_problem(found)
    low, high = corners(problem, window_of(system, window))
    values = {name: float(problem.parameters[name]) for name in law.names}
    curves, reasons = [], list[str]()
    for name, (lines, why) in zip(law.states, _curves(law, values, low, high, count), strict=True):
        curves += [(name, line) for line in lines]
        reasons += [why] if why else []
    most = max((len(line) for _, line in curves), default=0)
    table = np.full((len(curves), most, 2), np.nan)
    for row, (_, line) in zip(table, curves, strict=True):
        row[: len(line)] = line
    data = {
        "nullcline_of": variable(
            ("curve",), np.array([name for name, _ in curves], LABEL_DTYPE),
            {"long_name": "state that does not change"},
        ),
        "complete": variable(
            (), not reasons,
            {"long_name": "whether these are proved to be all", "reason": "; ".join(reasons)},
        ),
        **{
            f"nullcline_{name}": variable(
                ("curve", "point"), table[..., i],
                {"long_name": f"{name} on the nullcline", "units": law.units.get(name, "1")},
            )
            for i, name in enumerate(law.states)
        },
    }  # fmt: skip
    coords = {name: variable((), value) for name, value in values.items()}
    attrs = {**dataset_attrs(problem), "complete": "no" if reasons else "yes"}
    return xr.Dataset(data, coords, attrs)


def _curves(
    law: Equations, values: dict[str, float], low: Any, high: Any, count: int
) -> list[tuple[list[Any], str]]:
    """Curves on which each rate vanishes, and why there may be others."""
    why = "f is code, which is looked at on a grid"
    if law.kind == "symbolic":
        symbols = symbols_of([*law.states, *law.names])
        states = [symbols[name] for name in law.states]
        numbers = {symbols[name]: value for name, value in values.items()}
        try:
            found = [zero_curves(f, states, numbers, low, high, count) for f in law.f]
        except NoRule as rule:
            why = f"no bounds are known for {rule}, so that a grid is looked at"
        else:
            return [(curves.lines, _open(law, curves)) for curves in found]
    axes = [np.linspace(a, b, count + 1) for a, b in zip(low, high, strict=True)]
    grid = np.stack(np.meshgrid(*axes, indexing="xy"), axis=-1)
    rates = rates_on(law, values, grid.reshape(-1, 2)).reshape(*grid.shape)
    return [
        ([_onto(law, values, line, i, high - low) for line in _lines(axes, rates[..., i])], why)
        for i in (0, 1)
    ]


def _open(law: Equations, found: Curves) -> str:
    """What is not proved of some curves."""
    if found.complete:
        return ""
    low, high = found.undecided
    ends = zip(law.states, low.min(axis=0), high.max(axis=0), strict=True)
    where = ", ".join(f"{name} in ({a:.6g}, {b:.6g})" for name, a, b in ends)
    return f"a crossing, a pole or the end of a domain leaves it undecided within {where}"


def _lines(axes: list[Any], values: Any) -> list[Any]:
    """Curves on which a function on a grid vanishes, by marching squares."""
    from contourpy import contour_generator

    if not np.isfinite(values).any():
        return []
    masked = np.ma.masked_invalid(values)
    lines = contour_generator(axes[0], axes[1], masked).lines(0.0)
    return [np.asarray(line) for line in lines if len(line) > 1]


def _onto(law: Equations, values: Any, line: Any, i: int, width: Any) -> Any:
    """Points moved onto the curve, where that is nearer than a cell of the grid."""
    at = line.copy()
    for _ in range(4):
        slopes = slopes_on(law, values, at)[:, i] * width
        rates = rates_on(law, values, at)[:, i]
        size = (slopes**2).sum(axis=1)
        good = (size > 0.0) & np.isfinite(rates) & np.isfinite(size)
        part = np.where(good, rates, 0.0) / np.where(good, size, 1.0)
        at = at - part[:, None] * np.where(good[:, None], slopes, 0.0) * width
    near = np.all(np.abs(at - line) < 0.01 * width, axis=1)
    return np.where(near[:, None], at, line)
