"""Results of systems whose equilibria are numbered: as many as the cell with most of them has.

How many that is shows when all cells are solved. Until then each tile keeps the columns that its
own cells need; then all are filled up to the greatest number.
"""

from __future__ import annotations

import functools
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from math import prod
from typing import Any

import numpy as np

from phasekit.errors import warn
from phasekit.labels.coordinates import LABELS, Labels
from phasekit.labels.grid import refuse_too_large
from phasekit.laws.ladder import Conservative, Routhian, Standing
from phasekit.systems.system import System
from phasekit.table.numerical import NUMERICAL_ROWS
from phasekit.table.quantities import ROWS, variant
from phasekit.table.row import Pass, Quantity

#: Dims along which equilibria and saddles are numbered, with the long names of the numbers.
NUMBERED = {
    "equilibrium": "equilibrium, by its coordinate",
    "saddle": "saddle, by its coordinate",
    "special_point": "special point, by its parameter",
    "interval": "interval of a parameter",
    "cycle_family": "family of periodic orbits",
    "oscillation_interval": "interval of a parameter",
    "bistable_interval": "interval of a parameter",
}

_POINTWISE = (
    "potential",
    "potential_gradient",
    "potential_curvature",
    "energy_integral",
    "phase_velocity",
)
#: Groups that are numerical at constant momenta as well.
_ALONG = ("separatrices", "orbits", "action_angle", "state_of")
#: Cells of a tile of numerical results at most: a few seconds' work.
TILE = 1 << 14
#: Of these as many at once as fit into the processor's cache with all that integrals are made of.
PIECE = 1 << 10
#: What stands where a cell has fewer than others, in place of NaN or 0.
_EMPTY = {"kind": 0, "loop": 0}

Widths = Mapping[str, int]


def fitted(
    system: System, rows: Sequence[Quantity], passes: Sequence[Pass], search: Pass
) -> tuple[Sequence[Quantity], Sequence[Pass]]:
    """Return rows and passes of a system whose equilibria are numbered, how many is still open.

    Where none of the passes finds the equilibria on which the rows rest, `search` goes along: it
    says what is not proved.
    """
    if any(row.group not in _POINTWISE for row in rows):
        system.law.check_searchable()
    restful = {row.group for row in rows} & {"orbits", "motion"}
    resting = restful and system.law.may_be_incomplete
    lines = [line for one in passes for line in (one, *one.behind)]
    if (resting or any(map(is_numbered, rows))) and not any(map(_finds, lines)):
        passes = [*passes, search]
    rows = [
        replace(_with_words(row, system, _labels({}, row)), most_cells=min(row.most_cells, TILE))
        for row in with_errors(system, rows)
    ]
    return rows, [_telling(p, system) for p in passes]


def with_errors(system: System, rows: Sequence[Quantity]) -> Sequence[Quantity]:
    """Return rows with those that say how sure they are, where they are numerical."""
    where = system.standing
    groups = list(dict.fromkeys(row.group for row in rows))
    if where == Standing(Routhian):  # whose equilibria and motions are not numerical
        where, groups = Standing(Conservative), [group for group in groups if group in _ALONG]
    elif not issubclass(where.rung, Conservative):
        return rows
    errors = [row for group in groups for row in NUMERICAL_ROWS.get(group, ())]
    there = {row.name for row in rows}
    more = (row for row in errors if where.is_within(row.of) and row.name not in there)
    return [*rows, *more]


def is_numbered(row: Quantity) -> bool:
    """Whether a row has as many entries as a cell has equilibria or saddles."""
    return not NUMBERED.keys().isdisjoint(row.dims)


def sized(rows: Iterable[Quantity], widths: Widths) -> tuple[Quantity, ...]:
    """Return rows with so many numbers on their dims."""
    return tuple(
        replace(row, labels=_labels(widths, row)) if is_numbered(row) else row for row in rows
    )


def _labels(widths: Widths, row: Quantity) -> dict[str, Labels]:
    labels = row.labels or LABELS
    own = NUMBERED if row.labels is None else {}
    texts = {dim: own.get(dim) or labels[dim][1] for dim in NUMBERED if dim in {**own, **labels}}
    return {**labels, **{dim: (range(widths.get(dim, 0)), text) for dim, text in texts.items()}}


def with_words(system: System, rows: Sequence[Quantity]) -> Sequence[Quantity]:
    """Return rows without label dims with the words that the system's results have."""
    return [_with_words(row, system, dict(row.labels or LABELS)) for row in rows]


def _with_words(row: Quantity, system: System, labels: dict[str, Labels]) -> Quantity:
    words: dict[str, Any] = {"labels": labels, **variant(row, system.standing.rung)}
    words |= system.law.words(row.name, row.units, row.long_name)
    if row.name == "n_equilibria":
        words["dtype"] = "int16"
    return replace(row, **words)


def _finds(one: Pass) -> bool:
    return "equilibria" in one.groups


# ------------------------------------------------------------------------------ columns


def measured(one: Pass, found: dict[str, Any], widths: dict[str, int]) -> dict[str, Any]:
    """Return what a pass found with one column at least, and note how many it found.

    Functions that start from these, and reduce over them, need not care for cells without any.
    """
    rows = {row.name: row for row in one.rows} or ROWS
    finds = not any(name in rows and is_numbered(rows[name]) for name in one.inputs)
    for name in found:
        row = rows.get(name)
        if row is None or not is_numbered(row):
            continue
        tail = found[name].shape[found[name].ndim - len(row.dims) :]
        if finds:
            for dim, n in zip(row.dims, tail, strict=True):
                if dim in NUMBERED:
                    widths[dim] = max(widths.get(dim, 0), n)
        found[name] = resized(found[name], row, tuple(max(n, 1) for n in tail))
    return found


def resized(values: Any, row: Quantity, tail: tuple[int, ...]) -> Any:
    """Return values of a row with label axes of these lengths: cut, or filled with nothing."""
    values = np.asarray(values)
    first = values.ndim - len(tail)
    if values.shape[first:] == tail:
        return values
    values = values[(..., *map(slice, tail))]
    more = [(0, n - m) for n, m in zip(tail, values.shape[first:], strict=True)]
    empty = _EMPTY.get(row.name, np.nan if values.dtype.kind in "fc" else 0)
    return np.pad(values, [(0, 0)] * first + more, constant_values=empty)


@dataclass
class Columns:
    """What was found of the numbered rows of a part, tile by tile, each as wide as it is."""

    rows: tuple[Quantity, ...]
    sizes: dict[str, int]
    widths: dict[str, int] = field(default_factory=dict)
    pieces: list[tuple[tuple[slice, ...], dict[str, Any]]] = field(default_factory=list)
    stretches: list[Any] = field(default_factory=list)
    searched: bool = False

    def put(self, tile: tuple[slice, ...], computed: Mapping[str, Any], widths: Widths) -> None:
        """Keep the columns of a tile, if all have room in memory with as many as are needed."""
        with np.errstate(over="ignore"):  # where a result is kept in single precision
            kept = {row.name: computed[row.name].astype(row.dtype) for row in self.rows}
        self.pieces.append((tile, kept))
        if any(n > self.widths.get(dim, 0) for dim, n in widths.items()):
            rows, cells = sized(self.rows, widths), prod(self.sizes.values())
            refuse_too_large({row.name: cells * row.cell_bytes for row in rows}, self.sizes)

    def note(self, widths: Widths, stretches: Any) -> None:
        """Note how many columns cells need, and what their search for equilibria left open."""
        if stretches is not None:
            self.searched = True
            self.stretches.append(stretches)
        self.widths.update(greatest([self.widths, widths]))

    def joined(self, widths: Widths) -> dict[str, Any]:
        """Return the results with so many columns."""
        found = {}
        shape = tuple(self.sizes.values())
        for row in sized(self.rows, widths):
            result = np.empty(shape + row.label_shape, row.dtype)
            for tile, kept in self.pieces:
                result[tile] = resized(kept.pop(row.name), row, row.label_shape)
            found[row.name] = result
        return found


def greatest(several: Iterable[Widths]) -> dict[str, int]:
    """Return the greatest numbers of columns by dims."""
    found: dict[str, int] = {}
    for widths in several:
        for dim, n in widths.items():
            found[dim] = max(found.get(dim, 0), n)
    return found


# ------------------------------------------------------------------------------ what is said


def stretches(computed: Mapping[str, Any]) -> Any:
    """Return stretches that a search left open, a row a system: low, high of the widest, number.

    None where no equilibria were looked for.
    """
    if "gaps" not in computed or "n_gaps" not in computed:
        return None
    gaps, number = np.reshape(computed["gaps"], (-1, 2)), np.reshape(computed["n_gaps"], -1)
    return np.column_stack([gaps, number])[number > 0]


def unproved(several: Iterable[Any]) -> tuple[float, ...]:
    """Sum stretches up: low and high of the widest, how many stretches, in how many systems."""
    gaps = np.concatenate([np.empty((0, 3)), *several])
    if not len(gaps):
        return ()
    low, high = gaps[np.argmax(gaps[:, 1] - gaps[:, 0]), :2]
    return float(low), float(high), int(gaps[:, 2].sum()), len(gaps)


def warn_of_stretches(system: System, several: Iterable[Columns]) -> None:
    """Say where it is not proved that there are no more equilibria."""
    columns = next((one for one in several if one.searched), None)
    if columns is not None:
        warn_unproved(system, unproved(columns.stretches), tuple(columns.sizes.values()))


def warn_unproved(system: System, found: Sequence[float], shape: Sequence[int]) -> None:
    """Say what `unproved` found in systems of this shape."""
    if not found:
        return
    low, high, number, systems = found
    among = "" if number == 1 else f", the widest of {number} such stretches"
    of = f", in {systems} of {prod(shape)} systems" if shape else ""
    missing = system.law.unbounded_function
    because = f", because no bounds of {missing} are known" if missing else ""
    warn(
        f"equilibria of {system!r}: it is not proved that there are no others between "
        f"{low:.6g} and {high:.6g}{among}{of}{because}; there `complete` is False",
        RuntimeWarning,
    )


def _telling(one: Pass, system: System) -> Pass:
    """Return a pass that says how many results it, or one behind it, could not compute."""
    behind = tuple(_telling(line, system) for line in one.behind)
    if {"orbits", "motion", "separatrices"}.isdisjoint(one.groups):
        return replace(one, behind=behind) if behind else one
    return replace(one, function=functools.partial(_with_warning, one, repr(system)), behind=behind)


def _with_warning(one: Pass, text: str, *arrays: Any) -> Any:
    """Call a pass, and say how many results it could not compute, and why."""
    result = one.resolved(*arrays)
    for part in result if len(one.groups) > 1 else (result,):
        _tell_unknown(part._asdict(), text)
    return result


#: Why nothing is known of a result.
_UNKNOWN = {
    "motion_phi": "they take too many steps",
    "period": "V is too rough, or rounding hides where they turn",
}


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
                    why = _UNKNOWN.get(name, "V is too rough")
                warn(
                    f"{name} of {text}: {unknown.sum()} of {unknown.size} values are NaN, because "
                    f"{why}",
                    RuntimeWarning,
                )
