"""Results of systems whose equilibria are numbered: as many as the cell with most of them has."""

from __future__ import annotations

import functools
import warnings
from collections import namedtuple
from collections.abc import Mapping, Sequence
from dataclasses import replace
from math import prod
from typing import Any

import numpy as np

from phasekit.errors import ParameterError
from phasekit.labels.coordinates import LABELS, Labels
from phasekit.labels.grid import cut, make_grid, tiles
from phasekit.laws.ladder import Conservative
from phasekit.laws.perturbed import PerturbedConservative, PerturbedRouthian
from phasekit.systems.system import Model
from phasekit.table.numerical import NUMERICAL_ROWS
from phasekit.table.quantities import ROWS, variant
from phasekit.table.row import Pass, Quantity

_POINTWISE = (
    "potential",
    "potential_gradient",
    "potential_curvature",
    "energy_integral",
    "phase_velocity",
)
_EMPTY = {"kind": 0, "loop": 0}


def fitted(
    system: Model, rows: Sequence[Quantity], passes: Sequence[Pass], count: Pass
) -> tuple[Sequence[Quantity], Sequence[Pass]]:
    """Return rows and passes with as many numbers on their label dims as `count` finds.

    Raises
    ------
    ParameterError
        If what is asked for needs an interval, or loaded parameters.
    """
    if any(row.group not in _POINTWISE for row in rows):
        system.law.check_searchable()
    labels = dict(LABELS)
    if any(dim in ("equilibrium", "saddle") for row in rows for dim in row.dims):
        equilibria, saddles = _most(system, count)
        labels["equilibrium"] = (range(equilibria), "equilibrium, by its coordinate")
        labels["saddle"] = (range(saddles), "saddle, by its coordinate")
    elif any(row.group in ("orbits", "motion") for row in rows) and system.law.may_be_incomplete:
        _most(system, count)  # says what is not proved, on which orbits and motion rest as well
    searched = (Conservative, PerturbedConservative)
    if issubclass(system.rung, searched) and not issubclass(system.rung, PerturbedRouthian):
        groups = dict.fromkeys(row.group for row in rows)
        rows = [*rows, *(row for group in groups for row in NUMERICAL_ROWS.get(group, ()))]
    found = [_worded(row, system, labels) for row in rows]
    shapes = {row.name: row.label_shape for row in found}
    numbered = {row.group for row in found if set(row.dims) & {"equilibrium", "saddle"}}
    return found, [
        replace(one, function=functools.partial(_padded, one, shapes, repr(system)))
        if numbered.intersection(one.groups)
        else replace(one, function=functools.partial(_told, one, repr(system)))
        if set(one.groups) & {"orbits", "motion"}
        else one
        for one in passes
    ]


def worded(system: Model, rows: Sequence[Quantity]) -> Sequence[Quantity]:
    """Return rows without label dims with the words that the system's results have."""
    return [_worded(row, system, dict(row.labels or LABELS)) for row in rows]


def _most(system: Model, count: Pass) -> tuple[int, int]:
    """Greatest numbers of equilibria and saddles over all cells of the parameters."""
    grid = make_grid(system.parameters)
    if grid.lazy:
        raise ParameterError(
            "parameters: got chunked arrays, wants loaded ones (.load()), because the number "
            "of equilibria is not known before they are found"
        )
    dims = tuple(grid.sizes)
    arrays = [grid.aligned(name, dims) for name in count.inputs]
    shape = tuple(grid.sizes.values())
    found = [
        count.resolved(*(cut(array, tile) for array in arrays))
        for tile in tiles(shape, 4096)
        if prod(shape)
    ]
    gaps = np.concatenate([open_ for *_, open_ in found])
    if len(gaps):
        low, high = gaps[np.argmax(gaps[:, 1] - gaps[:, 0]), :2]
        stretches = int(gaps[:, 2].sum())
        among = "" if stretches == 1 else f", the widest of {stretches} such stretches"
        of = f", in {len(gaps)} of {prod(shape)} systems" if shape else ""
        missing = system.law.unbounded_function
        because = f", because no bounds of {missing} are known" if missing else ""
        warnings.warn(
            f"equilibria of {system!r}: it is not proved that there are no others between "
            f"{low:.6g} and {high:.6g}{among}{of}{because}; there `complete` is False",
            RuntimeWarning,
            stacklevel=2,
        )
    return max(n for n, *_ in found), max(n for _, n, _ in found)


def _worded(row: Quantity, system: Model, labels: dict[str, Labels]) -> Quantity:
    words: dict[str, Any] = {"labels": labels, **variant(row, system.rung)}
    words |= system.law.words(row.name, row.units, row.long_name)
    if row.name == "n_equilibria":
        words["dtype"] = "int16"
    return replace(row, **words)


def _told(one: Pass, text: str, *arrays: Any) -> Any:
    """Call a pass, and say how many results it could not compute, and why."""
    result = one.resolved(*arrays)
    _tell_unknown(result._asdict(), text)
    return result


def _tell_unknown(fields: Mapping[str, Any], text: str) -> None:
    for name in ("period", "action", "motion_phi", "winding_area", "lobe_area"):
        if f"{name}_error" in fields:
            error = fields[f"{name}_error"]
            unknown = np.isnan(fields[name]) & ~np.isnan(error)
            if name == "action" and "period" in fields:  # those without period are told with it
                unknown &= ~np.isnan(fields["period"])
            if unknown.any():
                worst = np.max(error[unknown])
                why = f"their error may be as large as {worst:.2g}"
                if np.isinf(worst):
                    why = "they take too many steps" if name == "motion_phi" else "V is too rough"
                warnings.warn(
                    f"{name} of {text}: {unknown.sum()} of {unknown.size} values are NaN, because "
                    f"{why}",
                    RuntimeWarning,
                    stacklevel=2,
                )


def _padded(one: Pass, shapes: dict[str, tuple[int, ...]], text: str, *arrays: Any) -> Any:
    """Call a pass and fill its label axes up to the lengths that the whole map has.

    What it could not compute is said, as of orbits.
    """
    result = one.resolved(*arrays)
    filled = []
    group: Any
    for title, group in zip(one.groups, result if len(one.groups) > 1 else (result,), strict=True):
        if not isinstance(group, tuple):  # the only row of its group
            (name,) = (row.name for row in ROWS.values() if row.group == title)
            group = namedtuple("Row", [name])(group)
        fields = {}
        _tell_unknown(group._asdict(), text)
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
