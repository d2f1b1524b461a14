"""What is asked for, worked out once: of which system, which quantities, by whom, from what.

Sweeps, labelled functions and stored maps all start from a `Request`.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from phasekit.cells.dispatch import fitted, passes_of
from phasekit.errors import ParameterError
from phasekit.labels.arguments import Value
from phasekit.labels.coordinates import STATES
from phasekit.labels.grid import Grid, make_grid
from phasekit.systems.system import Model
from phasekit.table.quantities import ROWS, pass_of
from phasekit.table.row import Pass, Quantity


@dataclass(frozen=True)
class Part:
    """What is computed on the same dims, and so tile by tile together."""

    dims: tuple[str, ...]
    passes: tuple[Pass, ...]
    rows: tuple[Quantity, ...]
    inputs: tuple[str, ...]


@dataclass(frozen=True)
class Request:
    """Quantities of a system on a grid of cells, and what they need."""

    system: Model
    grid: Grid
    rows: tuple[Quantity, ...]
    needs: Mapping[Pass, Sequence[str]]  # the inputs on which each pass depends, in the end
    parts: tuple[Part, ...]


def ask(
    system: Model,
    rows: Sequence[Quantity],
    passes: Sequence[Pass] | None = None,
    *,
    states: Mapping[str, Value] | None = None,
    axis: Mapping[str, str] | None = None,
    called: Mapping[str, str] | None = None,
    order: Sequence[str] = (),
) -> Request:
    """Say what is computed where, and refuse what cannot be.

    Parameters
    ----------
    system : Model
        Its array parameters span the cells.
    rows : sequence of Quantity
        What to compute.
    passes : sequence of Pass, optional
        What computes it; the lines of the table that fit by default.
    states : mapping of str to Value, optional
        States by the names of the table.
    axis : mapping of str to str, optional
        The dim of a bare state array, where that is not its own name.
    called : mapping of str to str, optional
        What messages call a state, where that is not its own name.
    order : sequence of str
        Dims that come first.

    Raises
    ------
    ParameterError
        If nothing computes a row, an input is missing, or dims disagree.
    """
    passes = passes or passes_of(system, rows)
    rows, passes = fitted(system, rows, passes)
    inputs = {**system.parameters, **(states or {})}
    grid = make_grid(inputs, axis=axis, called=called, order=order)
    needs = needs_of(system, passes)
    for one, names in needs.items():
        for name in names:
            if name not in inputs:
                raise _missing(system, one, name)
    if not grid.sizes and any(set(system.rung.derived) & set(one.inputs) for one in passes):
        system.coefficients()  # scalars that are invalid raise, where cells of arrays become NaN
    titles, dims = {row.name for row in rows}, {dim for row in rows for dim in row.dims}
    if titles & dims or not grid.sizes.keys().isdisjoint(titles | dims):
        raise _taken(grid, rows, titles, dims)
    on: dict[tuple[str, ...], list[Pass]] = {}
    for one, leaves in needs.items():
        on.setdefault(grid.dims_of(leaves), []).append(one)
    parts = []
    for used, together in on.items():
        groups = {group for one in together for group in one.groups}
        parts.append(
            Part(
                used,
                tuple(together),
                tuple(row for row in rows if row.group in groups),
                tuple(dict.fromkeys(name for one in together for name in needs[one])),
            )
        )
    return Request(system, grid, tuple(rows), needs, tuple(parts))


def needs_of(system: Model, passes: Sequence[Pass]) -> dict[Pass, tuple[str, ...]]:
    """Return the parameters and states on which passes depend, in the end."""
    derived = system.rung.derived
    own = system.formula_inputs() if derived else ()
    needs = {}
    for one in passes:
        found: dict[str, None] = {}
        left = [*reversed(one.inputs)]
        while left:
            name = left.pop()
            if name in derived:
                found.update(dict.fromkeys(own))
            elif name in ROWS:
                left.extend(reversed(pass_of(ROWS[name].group, passes).inputs))
            else:
                found[name] = None
        needs[one] = tuple(found)
    return needs


def _missing(system: Model, one: Pass, name: str) -> ParameterError:
    way = ", which has no such parameter"
    if name in [parameter.name for parameter in system.declared]:
        way = f"; use system.replace({name}=...)"
    elif name in STATES:
        way = f"; give {name}="
    return ParameterError(
        f"{name}: got nothing, wants a value for {' and '.join(one.groups)} of "
        f"{type(system).__name__}{way}"
    )


def _taken(grid: Grid, rows: Sequence[Quantity], names: set[str], dims: set[str]) -> ParameterError:
    for name in sorted(names & dims):
        counted = ", ".join(sorted(row.name for row in rows if name in row.dims))
        return ParameterError(
            f"of: got {name!r} beside {counted}, whose dim has that name; compute them apart"
        )
    dim = next(dim for dim in grid.sizes if dim in names | dims)
    return ParameterError(
        f"dim {dim!r}: got it as a dim of an argument, wants another name, because the "
        f"result has a variable or dim {dim!r}; rename it with .rename({dim}=...)"
    )
