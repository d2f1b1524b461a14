"""The table of quantities: what phasekit computes on a map, one row each.

Labelled functions, sweeps, the attributes of stored maps and the reference pages all follow from
this table. A new quantity is a row in the `QUANTITIES` of its subject and a line in the `PASSES`
there that names the array function which computes it; nothing else has to change.
"""

from __future__ import annotations

import html
import itertools
import re
import textwrap
from collections.abc import Callable, Iterator, Mapping
from typing import Any, TypeVar

from phasekit.docstrings import with_section
from phasekit.laws.ladder import Law, Routhian
from phasekit.table import loads, motion, numerical, orbits, perturbed, phase_space, steady
from phasekit.table.row import Quantity, Table

TABLE = Table(
    (
        *phase_space.QUANTITIES,
        *orbits.QUANTITIES,
        *loads.QUANTITIES,
        *steady.QUANTITIES,
        *motion.QUANTITIES,
        *perturbed.QUANTITIES,
    ),
    (
        *phase_space.PASSES,
        *orbits.PASSES,
        *loads.PASSES,
        *steady.PASSES,
        *numerical.PASSES,
        *motion.PASSES,
        *perturbed.PASSES,
    ),
)
#: Every row by its name, those that a name means, and how a user adds one.
ROWS, select, add = TABLE.rows, TABLE.select, TABLE.add


Function = TypeVar("Function", bound=Callable[..., Any])


def returns(*of: str) -> Callable[[Function], Function]:
    """Let the docstring of a labelled function name the quantities that it returns."""

    def completed(function: Function) -> Function:
        named = [row for row in ROWS.values() if row.group in of or row.name in of]
        lines = [line for row in named for line in _WRAP.wrap(described(row))]
        text = "\n".join(["xarray.Dataset", *lines])
        function.__doc__ = with_section(function.__doc__, "Returns", text)
        return function

    return completed


_WRAP = textwrap.TextWrapper(99, "    - ", "      ", break_long_words=False)


def described(row: Quantity) -> str:
    """A row in one line: name, dims, units, codes, meaning and equation.

    >>> described(ROWS["potential_gradient"])
    "``potential_gradient`` in s^-2: gradient of the potential (``V' = B sin(phi) - A sin(phi) \
cos(phi) - C cos(phi)``)."
    """
    dims = ", ".join(f"``{dim}``" for dim in row.dims)
    on = f" on ({dims})" if len(row.dims) > 1 else f" on {dims}" if dims else ""
    raised = re.sub(r"(?<=[A-Za-z])-?[0-9]", r"^\g<0>", row.units)
    units = "" if row.units == "1" else f" in {raised}"
    codes = f", a code of `{row.flags.__name__}`" if row.flags is not None else ""
    equation = f"``{row.equation}``" if re.search(r"[=<>^|/()]", row.equation) else row.equation
    return f"``{row.name}``{on}{units}: {row.long_name}{codes} ({equation})."


def variant(row: Quantity, rung: type[Law]) -> Mapping[str, str]:
    """What is said of a row on a rung below that of (A, B, C): equation, source, units, ..."""
    if issubclass(rung, Routhian):
        return steady.ROUTH.get(row.name, {})
    return {"equation": row.general} if row.general else {}


class Quantities(Mapping[str, Quantity]):
    """The quantities that a sweep offers, by name; prints as a table."""

    def __init__(self, rows: Mapping[str, Quantity] | None = None) -> None:
        self._rows = TABLE.offered if rows is None else dict(rows)

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
