"""What is asked for, worked out once: of which system, which quantities, by whom, from what.

Sweeps, labelled functions and stored maps all start from a `Request`. Each line of `PASSES` says
which groups it computes, of which rung of the ladder of laws, and from what; the most special line
that fits answers.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

from phasekit.cells import numbered
from phasekit.errors import ParameterError
from phasekit.labels.arguments import Value, bad
from phasekit.labels.coordinates import STATES
from phasekit.labels.grid import Grid, make_grid
from phasekit.laws.ladder import Law
from phasekit.laws.perturbed import (
    PerturbedConservative,
    TiltedConservative,
    TiltedTrigonometric,
)
from phasekit.laws.trigonometric import Trigonometric
from phasekit.systems.system import System, stands_on
from phasekit.table.quantities import ROWS, TABLE
from phasekit.table.row import Pass, Quantity, depth


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

    system: System
    grid: Grid
    rows: tuple[Quantity, ...]
    needs: Mapping[Pass, Sequence[str]]  # the inputs on which each pass depends, in the end
    parts: tuple[Part, ...]

    @property
    def is_open(self) -> bool:
        """Whether equilibria are numbered, so that the length of their dims is yet to be found."""
        rung = self.system.rung
        return not rung.labels_fixed and TABLE.offers(rung, "equilibria")

    def sized(self, widths: Mapping[str, int]) -> Request:
        """Return it with so many equilibria and saddles."""
        parts = (replace(part, rows=numbered.sized(part.rows, widths)) for part in self.parts)
        return replace(self, rows=numbered.sized(self.rows, widths), parts=tuple(parts))


def ask(
    system: System,
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
    system : System
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


def needs_of(system: System, passes: Sequence[Pass]) -> dict[Pass, tuple[str, ...]]:
    """Return the parameters and states on which passes depend, in the end."""
    derived = system.rung.derived
    own = system.formula_inputs() if derived else ()
    own_names = system.parameters  # of any name, where these are the user's
    needs = {}
    for one in passes:
        found: dict[str, None] = {}
        left = [*reversed(one.inputs)]
        while left:
            name = left.pop()
            if name in derived:
                found.update(dict.fromkeys(own))
            elif name in ROWS and name not in own_names:
                left.extend(reversed(TABLE.pass_of(ROWS[name].group, passes).inputs))
            else:
                found[name] = None
        needs[one] = tuple(found)
    return needs


def _missing(system: System, one: Pass, name: str) -> ParameterError:
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
            f"of: got {name!r} beside {counted}, whose dim has that name; compute them separately"
        )
    dim = next(dim for dim in grid.sizes if dim in names | dims)
    return ParameterError(
        f"dim {dim!r}: got it as a dim of an argument, wants another name, because the "
        f"result has a variable or dim {dim!r}; rename it with .rename({dim}=...)"
    )


# ------------------------------------------------------------------------------ who answers


def passes_of(
    system: System, rows: Iterable[Quantity], given: Iterable[str] = ()
) -> tuple[Pass, ...]:
    """Return the passes that compute rows of the table for a system.

    Parameters
    ----------
    system : System
        The system.
    rows : iterable of Quantity
        What to compute.
    given : iterable of str
        Names of states; a pass takes those of them that it can do without as well.

    Raises
    ------
    ParameterError
        If a row is not offered on the rung of the system's law.
    """
    rows = tuple(rows)
    passes = TABLE.plan(rows, system.rung)
    computed = {group for one in passes for group in one.groups}
    for row in rows:
        if row.group not in computed:
            refuse(system, TABLE.rungs_of(row.group), row.group)
    states = {*given, *system.parameters}
    return tuple(
        one.bound(system, states)
        if ROWS.keys().isdisjoint(one.inputs)
        else _whole(one, system, states)
        for one in passes
    )


def _whole(one: Pass, system: System, states: set[str]) -> Pass:
    """Return a line for one system with those that it starts from."""
    lines, missing = TABLE.behind(one, system.rung)
    if missing is not None:
        refuse(system, TABLE.rungs_of(missing), missing)
    behind = tuple(other.bound(system, states) for other in lines)
    bound = one.bound(system, states)
    return replace(bound, behind=behind) if behind else bound


def refuse(system: System, rungs: set[type[Law]], what: str) -> None:
    """Raise a `ParameterError` that says on which of some rungs a system should stand."""
    plain = {one for one in rungs if not issubclass(one, PerturbedConservative)}
    own = (getattr(system, "system", None) or system).rung  # that of what is perturbed
    near = {one for one in plain if issubclass(own, one)}
    tilted = TiltedTrigonometric if issubclass(own, Trigonometric) else TiltedConservative

    def order(one: type[Law]) -> tuple[int, str]:
        return depth(one), one.__name__

    # The nearest one below its own, else the most general, which asks for the least.
    rung = max(near, key=order) if near else min(plain or rungs, key=order)
    stands_on(system, rung, what, tilted=tilted in rungs)


def fitted(
    system: System, rows: Sequence[Quantity], passes: Sequence[Pass]
) -> tuple[Sequence[Quantity], Sequence[Pass]]:
    """Return rows and passes with the labels and words that the system's results have.

    Raises
    ------
    ParameterError
        If nothing is left of what was asked for, or the system lacks what it needs.
    """
    kept = [row for row in rows if issubclass(system.rung, row.of)]
    if not rows:
        raise bad("system", system, "a system in a potential, for maps", system.answered_by)
    if not kept:
        raise bad("of", rows[0].name, f"quantities that a {type(system).__name__} has")
    if system.rung.labels_fixed:
        return worded(system, kept), passes
    labelled = any(dim in ("equilibrium", "saddle") for row in kept for dim in row.dims)
    labelled |= any(row.group == "equilibria" for row in kept)
    if issubclass(system.rung, TiltedConservative):
        labelled |= any(row.group in ("orbits", "action_angle") for row in kept)
    if issubclass(system.rung, PerturbedConservative) and not labelled:
        return numbered.worded(system, kept), passes  # no equilibrium is looked for
    if not TABLE.offers(system.rung, "equilibria"):  # states of their own, and no labels
        return kept, passes
    (search,) = passes_of(system, [ROWS["phi"]])
    return numbered.fitted(system, kept, passes, search)


def worded(system: System, rows: Sequence[Quantity]) -> Sequence[Quantity]:
    """Return rows with what a system's law alone says of them."""
    if not system.rung.labels_fixed:
        return numbered.worded(system, rows)
    if system.rung.words is Law.words:
        return rows
    words: list[Any] = [system.law.words(row.name, row.units, row.long_name) for row in rows]
    return [replace(row, **own) for row, own in zip(rows, words, strict=True)]
