"""The table of quantities: what phasekit computes on a map, one row each.

Labelled functions, sweeps, the attributes of stored maps and the reference pages all follow from
this table. A new quantity is a row in the `QUANTITIES` of its subject and a line in the `PASSES`
there that names the array function which computes it; nothing else has to change.
"""

from __future__ import annotations

import html
import itertools
from collections.abc import Iterable, Iterator, Mapping, Sequence

from phasekit.errors import ParameterError
from phasekit.labels.arguments import bad, unknown
from phasekit.labels.coordinates import LABELS, STATES
from phasekit.laws.ladder import Law, Routhian
from phasekit.laws.perturbed import PerturbedRouthian
from phasekit.laws.trigonometric import Trigonometric
from phasekit.table import loads, motion, numerical, orbits, perturbed, phase_space, steady
from phasekit.table.row import REGISTERED, Pass, Quantity

QUANTITIES: tuple[Quantity, ...] = (
    *phase_space.QUANTITIES,
    *orbits.QUANTITIES,
    *loads.QUANTITIES,
    *steady.QUANTITIES,
    *motion.QUANTITIES,
    *perturbed.QUANTITIES,
)
#: Every row by its name.
ROWS = REGISTERED
ROWS.update({row.name: row for row in QUANTITIES})

#: Passes over the cells; `phasekit.cells.request` finds the one for a system.
PASSES: tuple[Pass, ...] = (
    *phase_space.PASSES,
    *orbits.PASSES,
    *loads.PASSES,
    *steady.PASSES,
    *numerical.PASSES,
    *motion.PASSES,
    *perturbed.PASSES,
)


def variant(row: Quantity, rung: type[Law]) -> Mapping[str, str]:
    """What is said of a row on a rung below that of (A, B, C): equation, source, units, ..."""
    if issubclass(rung, (Routhian, PerturbedRouthian)):
        return steady.ROUTH.get(row.name, {})
    return {"equation": row.general} if row.general else {}


def add(row: Quantity, *passes: Pass) -> None:
    """Add a quantity, a group of its own, with the passes that compute it.

    From then on `sweep` and `quantities` have it; so have worker processes, where this is called
    in the module that defines the function.

    Parameters
    ----------
    row : Quantity
        The row.
    *passes : Pass
        Lines that compute its group, one for each rung of the ladder of laws.

    Raises
    ------
    ParameterError
        If its name or group is taken, a dim is unknown, or no pass computes it.

    Examples
    --------
    >>> add(ROWS["phi"], PASSES[0])
    Traceback (most recent call last):
    phasekit.errors.ParameterError: row: got 'phi', wants a name that is not taken
    """
    global QUANTITIES, PASSES
    if row.name in {*ROWS, *LABELS, *STATES}:
        raise bad("row", row.name, "a name that is not taken")
    if row.group in {other.group for other in QUANTITIES}:
        raise bad("row", row.name, f"a group of its own; {row.group!r} is taken")
    for dim in row.dims:
        if dim not in (row.labels or LABELS):
            raise unknown("row: dim", dim, row.labels or LABELS)
    if not passes or any(one.groups != (row.group,) for one in passes):
        groups = [group for one in passes for group in one.groups]
        raise bad("passes", groups, f"one or several that compute the group {row.group!r} alone")
    ROWS[row.name] = row
    QUANTITIES += (row,)
    PASSES += passes


_NO_LISTS = (bytes, Mapping)


def select(of: str | Iterable[str]) -> tuple[Quantity, ...]:
    """Return the rows that `of` names: groups, quantities, or several of either.

    Raises
    ------
    ParameterError
        If a name is unknown or nothing is named.
    """
    offered = _offered()
    groups = dict.fromkeys(row.group for row in offered.values())
    try:
        names = (of,) if isinstance(of, str) else () if isinstance(of, _NO_LISTS) else tuple(of)
    except TypeError:
        names = ()
    if not names:
        raise bad("of", of, "a name or a list of names", "pk.quantities() lists them")
    for name in names:
        row = ROWS.get(name) if isinstance(name, str) else None
        if row is not None and name not in offered:
            raise ParameterError(
                f"of: got {name!r}, which needs an argument of its own; call pk.{row.group}"
            )
        if not isinstance(name, str) or (name not in offered and name not in groups):
            valid = [*groups, *offered]
            raise unknown("of: the quantity", name, valid, listed="pk.quantities()")
    whole = {name for name in names if name not in offered}
    return tuple(row for row in offered.values() if row.name in names or row.group in whole)


def _offered() -> dict[str, Quantity]:
    """The rows that passes compute, by name."""
    computed = {group for one in PASSES for group in one.groups}
    return {row.name: row for row in QUANTITIES if row.group in computed}


def plan_passes(rows: Iterable[Quantity], rung: type[Law] = Trigonometric) -> tuple[Pass, ...]:
    """Return the passes that compute the rows on a rung, as few as the table has."""
    missing = {row.group for row in rows}
    lines, chosen = fitting(rung), list[Pass]()
    for candidate in lines:
        if missing.issuperset(candidate.groups):
            chosen.append(candidate)
            missing.difference_update(candidate.groups)
    for group in sorted(missing):  # its passes compute others as well, which are not wanted
        if not any(group in one.groups for one in chosen):
            chosen.append(next(one for one in reversed(lines) if group in one.groups))
    return tuple(chosen)


def fitting(rung: type[Law]) -> list[Pass]:
    """Return the lines of the table for a rung: of each group the most special ones."""
    able = [one for one in PASSES if issubclass(rung, one.of) and not one.options]
    special = {group: max(len(one.of.__mro__) for one in able if group in one.groups)
               for group in {group for one in able for group in one.groups}}  # fmt: skip
    return [
        one for one in able if all(len(one.of.__mro__) == special[group] for group in one.groups)
    ]


def pass_of(group: str, chosen: Sequence[Pass], rung: type[Law] = Trigonometric) -> Pass:
    """Return the pass for a group: one of those chosen, else the one that computes the least."""
    for candidate in (*chosen, *reversed(fitting(rung))):
        if group in candidate.groups:
            return candidate
    raise KeyError(group)


class Quantities(Mapping[str, Quantity]):
    """The quantities that a sweep offers, by name; prints as a table."""

    def __init__(self) -> None:
        self._rows = _offered()

    @property
    def groups(self) -> dict[str, tuple[str, ...]]:
        """Names of the quantities of each group."""
        names = dict.fromkeys(row.group for row in self._rows.values())
        return {g: tuple(r.name for r in self._rows.values() if r.group == g) for g in names}

    def __getitem__(self, name: str) -> Quantity:
        """Return the row of a quantity."""
        return self._rows[name]

    def __iter__(self) -> Iterator[str]:
        """Iterate over the names."""
        return iter(self._rows)

    def __len__(self) -> int:
        """Return the number of quantities."""
        return len(self._rows)

    def _lines(self) -> list[tuple[str, ...]]:
        return [
            ("quantity", "group", "dims", "units", "meaning"),
            *(
                (row.name, row.group, ", ".join(row.dims), row.units, row.long_name)
                for row in self._rows.values()
            ),
        ]

    def __repr__(self) -> str:
        """Write the table."""
        lines = self._lines()
        widths = [max(len(line[i]) for line in lines) for i in range(4)]
        return "\n".join(
            "  ".join(text.ljust(width) for text, width in zip(line, widths, strict=False))
            + f"  {line[-1]}"
            for line in lines
        )

    def _repr_html_(self) -> str:
        """Write the table for a notebook."""
        rows = [
            "".join(f"<{tag} style='text-align: left'>{html.escape(text)}</{tag}>" for text in line)
            for tag, line in zip(
                itertools.chain(["th"], itertools.repeat("td")), self._lines(), strict=False
            )
        ]
        return f"<table>{''.join(f'<tr>{row}</tr>' for row in rows)}</table>"


def quantities() -> Quantities:
    """List what `sweep(of=...)` takes: quantities and groups of them, with units and meaning.

    Returns
    -------
    Quantities
        A mapping of name to row; a row has ``group``, ``dims``, ``units``, ``long_name``,
        ``equation`` and ``source``. Printed, it is a table.

    Examples
    --------
    >>> import phasekit as pk
    >>> pk.quantities()["winding_area"].units
    's-1'
    >>> "figure_eight" in pk.quantities().groups["separatrices"]
    True
    """
    return Quantities()
