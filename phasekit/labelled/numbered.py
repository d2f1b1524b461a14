"""Results of systems whose equilibria are numbered: as many as the cell with most of them has."""

from __future__ import annotations

import functools
from collections.abc import Sequence
from dataclasses import replace
from math import prod
from typing import Any

import numpy as np

from phasekit.errors import ParameterError
from phasekit.labelled.grid import make_grid
from phasekit.labelled.quantities import LABELS, Labels, Pass, Quantity
from phasekit.labelled.system import Model
from phasekit.labelled.tiling import cut, tiles
from phasekit.phase.numerical import functions
from phasekit.phase.numerical.formula import Formula, need_a_stretch

_POINTWISE = (
    "potential",
    "potential_gradient",
    "potential_curvature",
    "energy_integral",
    "phase_velocity",
)
_EMPTY = {"kind": 0, "loop": 0}


def fitted(
    system: Model, rows: Sequence[Quantity], passes: Sequence[Pass]
) -> tuple[Sequence[Quantity], Sequence[Pass]]:
    """Return rows and passes with as many numbers on their label dims as there are points.

    Raises
    ------
    ParameterError
        If what is asked for needs an interval, or loaded parameters.
    """
    formula: Any = system.law
    if any(row.group not in _POINTWISE for row in rows):
        need_a_stretch(formula)
    labels = dict(LABELS)
    if any(dim in ("equilibrium", "saddle") for row in rows for dim in row.dims):
        equilibria, saddles = _most(system, formula)
        labels["equilibrium"] = (range(equilibria), "equilibrium, by its coordinate")
        labels["saddle"] = (range(saddles), "saddle, by its coordinate")
    found = [_worded(row, formula, labels) for row in rows]
    shapes = {row.name: row.label_shape for row in found}
    return found, [
        replace(one, function=functools.partial(_padded, one, shapes))
        if set(one.groups) & {"equilibria", "separatrices"}
        else one
        for one in passes
    ]


def _most(system: Model, formula: Formula) -> tuple[int, int]:
    """Greatest numbers of equilibria and saddles over all cells of the parameters."""
    grid = make_grid(system.parameters)
    if grid.lazy:
        raise ParameterError(
            "parameters: got chunked arrays, wants loaded ones (.load()), because the number "
            "of equilibria is not known before they are found"
        )
    dims = tuple(grid.sizes)
    arrays = [grid.aligned(name, dims) for name in formula.names]
    shape = tuple(grid.sizes.values())
    found = [
        functions.most(formula, *(cut(array, tile) for array in arrays))
        for tile in tiles(shape, 4096)
        if prod(shape)
    ]
    return max(n for n, _ in found), max(n for _, n in found)


def _worded(row: Quantity, formula: Formula, labels: dict[str, Labels]) -> Quantity:
    on_angles = formula.period is not None and abs(formula.period - 2.0 * np.pi) < 1e-12
    words: dict[str, Any] = {"labels": labels, "source": f"V = {formula.text}"}
    if row.name == "potential":
        words["equation"] = f"V = {formula.text}"
    elif row.general:
        words["equation"] = row.general
    if row.units == "rad" and not on_angles:
        words["units"] = "1"
        words["long_name"] = row.long_name.replace("signed angle", "signed distance").replace(
            "angle", "coordinate"
        )
    if row.name == "n_equilibria":
        words["dtype"] = "int16"
    return replace(row, **words)


def _padded(one: Pass, shapes: dict[str, tuple[int, ...]], *arrays: Any) -> Any:
    """Call a pass and fill its label axes up to the lengths that the whole map has."""
    assert callable(one.function)
    result = one.function(*arrays)
    filled = []
    for group in result if len(one.groups) > 1 else (result,):
        fields = {}
        for name, values in group._asdict().items():
            tail = shapes.get(name, ())
            first = values.ndim - len(tail)
            missing = [n - m for n, m in zip(tail, values.shape[first:], strict=True)]
            if any(missing):
                width = [(0, 0)] * first + [(0, n) for n in missing]
                values = np.pad(values, width, constant_values=_EMPTY.get(name, np.nan))
            fields[name] = values
        filled.append(type(group)(**fields))
    return tuple(filled) if len(filled) > 1 else filled[0]
