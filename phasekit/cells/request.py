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
from phasekit.laws.equations import Equations
from phasekit.laws.ladder import Conservative, Law, Standing, Trait
from phasekit.systems.system import System, stands_on
from phasekit.table.quantities import ROWS, TABLE
from phasekit.table.row import Pass, Quantity, Table


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
    #: Of a system with states of its own that of its law.
    table: Table = TABLE

    @property
    def is_open(self) -> bool:
        """Whether equilibria are numbered, so that the length of their dims is yet to be found."""
        where = self.system.standing
        fixed = where.rung.labels_fixed and self.table is TABLE
        numbered_groups = ("equilibria", "special_points")
        return not fixed and any(self.table.offers(where, group) for group in numbered_groups)

    @property
    def states(self) -> frozenset[str]:
        """Names of inputs that come with the quantities that need them."""
        return frozenset({*STATES, *(self.grid.inputs.keys() - self.system.parameters.keys())})

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
    table: Table = TABLE,
) -> Request:
    """Say what is computed where, and refuse what cannot be.

    ``axis`` and ``called`` are the dim of a bare state array, and what messages call a state, where
    these are not its own name; ``order`` are dims that come first.
    """
    passes = passes or passes_of(system, rows, table=table)
    if table is TABLE:
        rows, passes = fitted(system, rows, passes)
    inputs = {**system.parameters, **(states or {})}
    grid = make_grid(inputs, axis=axis, called=called, order=order)
    needs = needs_of(system, passes)
    for one, names in needs.items():
        if missing := [name for name in names if name not in inputs]:
            raise _missing(system, one, missing)
    if not grid.sizes and any(set(system.rung.derived) & set(one.inputs) for one in passes):
        system.coefficients()  # scalars that are invalid raise, where cells of arrays become NaN
    titles, dims = {row.name for row in rows}, {dim for row in rows for dim in row.dims}
    if titles & dims or not grid.sizes.keys().isdisjoint(titles | dims):
        raise _taken(grid, rows, titles, dims)
    if table is not TABLE and (both := sorted(titles & inputs.keys())):
        wants = f"quantities of other names than the parameter {both[0]}; rename that"
        raise bad("of", both[0], wants)
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
    return Request(system, grid, tuple(rows), needs, tuple(parts), table)


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
            elif name not in own_names and (line := TABLE.line_for(name, passes)) is not None:
                left.extend(reversed(line.inputs))
            else:
                found[name] = None
        needs[one] = tuple(found)
    return needs


def _missing(system: System, one: Pass, names: Sequence[str]) -> ParameterError:
    declared = [parameter.name for parameter in system.declared]
    ways = []
    if own := [name for name in names if name in declared]:
        ways.append(f"use system.replace({', '.join(f'{name}=...' for name in own)})")
    if states := [name for name in names if name in STATES and name not in declared]:
        ways.append(f"give {', '.join(f'{name}=' for name in states)}")
    way = "".join(f"; {way}" for way in ways) or ", which has no such parameter"
    wants = "wants a value" if len(names) == 1 else "wants values"
    return ParameterError(
        f"{', '.join(names)}: got nothing, {wants} for {' and '.join(one.groups)} of "
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
    system: System, rows: Iterable[Quantity], given: Iterable[str] = (), table: Table = TABLE
) -> tuple[Pass, ...]:
    """Return the passes that compute rows of the table for a system.

    A pass takes those of the states ``given`` that it can do without as well.
    """
    rows = tuple(rows)
    passes = table.plan(rows, system.standing)
    computed = {group for one in passes for group in one.groups}
    for row in rows:
        if row.group not in computed:
            refuse(system, table.standings_of(row.group), row.group)
    states = {*given, *system.parameters}
    return tuple(
        one.bound(system, states)
        if table.rows.keys().isdisjoint({*one.inputs} - states)
        else _whole(one, system, states, table)
        for one in passes
    )


def equations_for(system: System, group: str = "") -> Equations | None:
    """The equations by which a group is answered; None where a line of the table answers it.

    What no line bears of a system with terms is answered of its first-order equations.
    """
    law: Equations | None = system.own_equations
    if law is None and system.standing.traits is not None:
        return None if TABLE.offers(system.standing, group) else system.equations()
    return law


def _whole(one: Pass, system: System, states: set[str], table: Table) -> Pass:
    """Return a line for one system with those that it starts from."""
    lines, missing = table.behind(one, system.standing)
    if missing is not None:
        refuse(system, table.standings_of(missing), missing)
    behind = tuple(other.bound(system, states) for other in lines)
    bound = one.bound(system, states)
    return replace(bound, behind=behind) if behind else bound


def refuse(system: System, wanted: set[Standing], what: str) -> None:
    """Raise a `ParameterError` that says where the law of a system should stand, of several."""
    plain = {one for one in wanted if one.traits is None}
    own = system.standing.rung
    near = {one for one in plain if issubclass(own, one.rung)}

    def order(one: Standing) -> tuple[Any, str]:
        return one.depth, one.rung.__name__

    # The nearest one below its own, else the most general, which asks for the least.
    where = max(near, key=order) if near else min(plain or wanted, key=order)
    tilted = any(one.traits == Trait.TORQUED for one in wanted)
    stands_on(system, where, what, tilted=tilted)


def fitted(
    system: System, rows: Sequence[Quantity], passes: Sequence[Pass]
) -> tuple[Sequence[Quantity], Sequence[Pass]]:
    """Return rows and passes with the labels and words that the system's results have."""
    where = system.standing
    kept = [row for row in rows if where.is_within(row.of)]
    if not rows:
        raise bad("system", system, "a system in a potential, for maps", system.answered_by)
    if not kept:
        raise bad("of", rows[0].name, f"quantities that a {type(system).__name__} has")
    if where.rung.labels_fixed:
        return with_words(system, kept), passes
    labelled = any(dim in ("equilibrium", "saddle") for row in kept for dim in row.dims)
    labelled |= any(row.group == "equilibria" for row in kept)
    if where.is_within(Standing(Conservative, Trait.TORQUED)):
        labelled |= any(row.group in ("orbits", "action_angle") for row in kept)
    followed = where.traits is not None or {row.group for row in kept} <= _FOLLOWED
    if followed and not labelled:
        kept = list(numbered.with_errors(system, kept))
        return numbered.with_words(system, kept), passes  # no equilibrium is looked for
    if not TABLE.offers(where, "equilibria"):  # states of their own, and no labels
        return kept, passes
    (search,) = passes_of(system, [ROWS["phi"]])
    return numbered.fitted(system, kept, passes, search)


#: Groups of motions that are integrated, whatever the system.
_FOLLOWED = {"lyapunov", "stroboscopic"}


def with_words(system: System, rows: Sequence[Quantity]) -> Sequence[Quantity]:
    """Return rows with what a system's law alone says of them."""
    where = system.standing
    if system.own_equations is not None:
        return rows  # which are of this law alone
    if not where.rung.labels_fixed:
        return numbered.with_words(system, rows)
    if where.traits is None and where.rung.words is Law.words:
        return rows
    words: list[Any] = [system.law.words(row.name, row.units, row.long_name) for row in rows]
    return [replace(row, **own) for row, own in zip(rows, words, strict=True)]
