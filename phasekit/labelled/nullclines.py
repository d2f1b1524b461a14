"""Nullclines of planar flows, labelled."""

from __future__ import annotations

from typing import Any

import numpy as np
import xarray as xr

from phasekit.cells.schema import dataset_attrs
from phasekit.labelled.in_box import corners
from phasekit.labels.arguments import bad, call_checked, whole
from phasekit.labels.grid import LABEL_DTYPE, variable
from phasekit.laws.equations import Equations, equations_of
from phasekit.laws.ladder import Map
from phasekit.motion.equation_rates import rates_on, slopes_at
from phasekit.systems.problem import as_problem
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
        Cells of the grid along each state.

    Returns
    -------
    xarray.Dataset
        On ``curve``: ``nullcline_of``, the state whose rate vanishes. On (``curve``, ``point``):
        ``nullcline_`` with the name of each state, in order along each curve; shorter ones end in
        NaN. The attribute ``complete`` is "no": curves smaller than a cell of the grid are missed.

    Raises
    ------
    ParameterError
        If the system is no planar flow, or an argument is unusable.

    Notes
    -----
    Zeros of f_i on the lines of a grid, joined to curves, then moved onto f_i = 0 by Newton's
    method along its gradient.

    Examples
    --------
    >>> import phasekit as pk
    >>> predator = pk.Problem(
    ...     {"n": "n*(1 - n) - n*p/(n + h)", "p": "p*(n/(n + h) - m)"},
    ...     parameters={"h": 0.3, "m": 0.5}, window={"n": (0.0, 1.2), "p": (0.0, 1.0)},
    ... )
    >>> sorted(set(pk.nullclines(predator).nullcline_of.values.tolist()))
    ['n', 'p']
    """
    found = as_system(system)
    law = equations_of(found)
    if law is None or isinstance(law, Map) or law.time is not None or len(law.states) != 2:
        raise bad("system", found, "a flow of two states without forcing, such as a pk.Problem")
    count = whole("resolution", resolution, "a number of cells >= 10", 10)
    problem = as_problem(found)
    low, high = corners(problem, window)
    values = {name: float(problem.parameters[name]) for name in law.names}
    axes = [np.linspace(a, b, count + 1) for a, b in zip(low, high, strict=True)]
    grid = np.stack(np.meshgrid(*axes, indexing="xy"), axis=-1)
    rates = rates_on(law, values, grid.reshape(-1, 2)).reshape(*grid.shape)
    curves = []
    for i, name in enumerate(law.states):
        for line in _lines(axes, rates[..., i]):
            curves.append((name, _onto(law, values, line, i, high - low)))
    most = max((len(line) for _, line in curves), default=0)
    table = np.full((len(curves), most, 2), np.nan)
    for row, (_, line) in zip(table, curves, strict=True):
        row[: len(line)] = line
    data = {
        "nullcline_of": variable(
            ("curve",), np.array([name for name, _ in curves], LABEL_DTYPE),
            {"long_name": "state that does not change"},
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
    return xr.Dataset(data, coords, {**dataset_attrs(problem), "complete": "no"})


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
    moved = line.copy()
    for k, x in enumerate(line):
        at = x.copy()
        for _ in range(4):
            slope = slopes_at(law, values, at)[i] * width
            value = rates_on(law, values, at[None])[0, i]
            size = float(slope @ slope)
            if not (size > 0.0 and np.isfinite(value)):
                break
            at = at - value * slope / size * width
        if np.all(np.abs(at - x) < 0.01 * width):
            moved[k] = at
    return moved
