"""What the table is: rows, what is computed, and passes, by which function and from what.

`Table` chooses among them: the most special lines that fit the rung of a law answer.

In derived units the radian is 1 and left out: angles are in rad, rates in s-1, energies (per unit
of inertia about the shaft) in s-2, areas of the phase plane and actions in s-1.
"""

from __future__ import annotations

import functools
import importlib
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from enum import IntEnum
from typing import Any

import numpy as np

from phasekit.errors import ParameterError, PhasekitError
from phasekit.labels.arguments import bad, unknown
from phasekit.labels.coordinates import LABELS, STATES, Labels
from phasekit.laws.ladder import Law, Standing
from phasekit.laws.trigonometric import Trigonometric

#: Among the inputs of a pass: the law, and its parameters.
LAW = "law"

#: Inputs that many passes take: the coefficients, and a state.
ABC = ("A", "B", "C")
STATE = ("state_phi", "state_dphi")

#: Dims that many rows have.
BRANCHES = ("equilibrium",)
SADDLES = ("saddle",)
SIDES = ("saddle", "side")
DIRECTION = ("direction",)

#: Sources that many rows have.
FROM_ENERGY = "[Veljovic2015] (14), corrected coefficients"
FROM_MOTION = "[Veljovic2015] (12), corrected coefficients"

#: What holds names, and is no list of them.
_NO_LISTS = (bytes, Mapping)


@dataclass(frozen=True, slots=True)
class Quantity:
    """One row: a variable of a labelled result."""

    name: str
    group: str
    dims: tuple[str, ...]
    dtype: str
    units: str
    long_name: str
    equation: str
    source: str
    flags: type[IntEnum] | None = None
    #: The most general rung of the ladder of laws on which it is computed, with the traits.
    of: type[Law] | Standing = Law
    #: The equation in any potential, where `equation` is that of (A, B, C).
    general: str = ""
    #: Labels of the row's dims where they are not those of the table.
    labels: Mapping[str, Labels] | None = field(default=None, compare=False)
    #: Cells of a tile at most, few where one takes long: tiles are what is shared and resumed.
    most_cells: int = 1 << 20

    @property
    def attrs(self) -> dict[str, Any]:
        """Attributes of the variable, as they stand in every Dataset."""
        attrs: dict[str, Any] = {
            "long_name": self.long_name,
            "units": self.units,
            "equation": self.equation,
            "source": self.source,
        }
        if self.flags is not None:
            attrs["flag_values"] = np.array([flag.value for flag in self.flags], dtype=np.int8)
            attrs["flag_meanings"] = " ".join(flag.name.lower() for flag in self.flags)
        return attrs

    @property
    def label_shape(self) -> tuple[int, ...]:
        """Lengths of the label dims."""
        labels = self.labels or LABELS
        return tuple(len(labels[dim][0]) for dim in self.dims)

    def labels_of(self, dim: str) -> Labels:
        """Labels of a dim, with its long name."""
        return (self.labels or LABELS)[dim]

    @property
    def cell_bytes(self) -> int:
        """Bytes that one cell of a map takes."""
        return int(np.prod(self.label_shape, dtype=int)) * np.dtype(self.dtype).itemsize


@dataclass(frozen=True, slots=True)
class Pass:
    """One call of an array function, which computes whole groups at once.

    `inputs` are coefficients (A, B, C), parameters, states, or quantities of other groups; those
    come with their label axes last. `LAW` among them is the law itself, with its parameters after
    it. The function returns one result a group, each a NamedTuple whose fields are named as the
    quantities, or arrays in the order of the group's rows.
    """

    function: str | Callable[..., Any]  # "module:name", imported when it is first needed
    inputs: tuple[str, ...]
    groups: tuple[str, ...]
    #: The rung of the ladder of laws for which it holds; of laws with terms also the traits.
    of: type[Law] | Standing = Trigonometric
    #: Keywords that a call has to say: numbers of a center or saddle, a side.
    options: tuple[str, ...] = ()
    #: States that it can do without, with their keywords.
    optional: tuple[tuple[str, str], ...] = ()
    #: The rows that it computes, where these are those of one system and not of the table.
    rows: tuple[Quantity, ...] = ()
    #: Lines for the same system that compute the quantities among its inputs, and theirs.
    behind: tuple[Pass, ...] = ()

    @property
    def standing(self) -> Standing:
        """The rung for which it holds, and the traits that it bears."""
        return Standing.from_rung(self.of)

    @property
    def resolved(self) -> Callable[..., Any]:
        """The function."""
        if not isinstance(self.function, str):
            return self.function
        module, _, name = self.function.partition(":")
        function: Callable[..., Any] = getattr(importlib.import_module(module), name)
        return function

    def bound(self, system: Any, given: set[str], options: dict[str, Any] | None = None) -> Pass:
        """Return the line for one system: with its law, options and optional states."""
        extra = {state: keyword for state, keyword in self.optional if state in given}
        if LAW not in self.inputs and not options and not extra:
            return self
        function = self.resolved
        inputs = self.inputs
        if LAW in inputs:
            function = functools.partial(function, system.law_of_parameters)
            own = tuple(system.parameters)
            inputs = tuple(x for name in inputs for x in (own if name == LAW else (name,)))
        if options:
            function = functools.partial(function, **options)
        if extra:
            function = functools.partial(_with_keywords, function, tuple(extra.values()))
        return replace(self, function=function, inputs=(*inputs, *extra), options=(), optional=())


def _with_keywords(function: Any, keywords: tuple[str, ...], *arrays: Any, **options: Any) -> Any:
    """Call a function whose last arrays go by keyword."""
    own = len(arrays) - len(keywords)
    return function(*arrays[:own], **dict(zip(keywords, arrays[own:], strict=True)), **options)


class Table:
    """Rows by name and passes, and the choice among them."""

    def __init__(self, rows: Iterable[Quantity], passes: Iterable[Pass]) -> None:
        self.rows = {row.name: row for row in rows}
        self.passes = tuple(passes)
        self.own: set[str] = set()  # groups of the user's

    def add(self, row: Quantity, *passes: Pass) -> None:
        """Add a quantity, a group of its own, with the passes that compute it.

        From then on `sweep` and `quantities` have it; so have worker processes, where this is
        called in the module that defines the function.

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
        >>> from phasekit.table.quantities import ROWS, TABLE
        >>> TABLE.add(ROWS["phi"], TABLE.passes[0])
        Traceback (most recent call last):
        phasekit.errors.ParameterError: row: got 'phi', wants a name that is not taken
        """
        if row.name in {*self.rows, *LABELS, *STATES}:
            raise bad("row", row.name, "a name that is not taken")
        if row.group in {other.group for other in self.rows.values()}:
            raise bad("row", row.name, f"a group of its own; {row.group!r} is taken")
        for dim in row.dims:
            if dim not in (row.labels or LABELS):
                raise unknown("row: dim", dim, row.labels or LABELS)
        if not passes or any(one.groups != (row.group,) for one in passes):
            groups = [group for one in passes for group in one.groups]
            wants = f"one or several that compute the group {row.group!r} alone"
            raise bad("passes", groups, wants)
        self.rows[row.name] = row
        self.own.add(row.group)
        self.passes += passes

    @property
    def offered(self) -> dict[str, Quantity]:
        """The rows that passes compute, by name."""
        computed = {group for one in self.passes for group in one.groups}
        return {name: row for name, row in self.rows.items() if row.group in computed}

    def select(
        self, of: str | Iterable[str], where: Standing | None = None
    ) -> tuple[Quantity, ...]:
        """Return the rows that `of` names: groups, quantities, or several of either.

        With a standing, only those of them that are computed there.

        Raises
        ------
        ParameterError
            If a name is unknown or nothing is named.
        """
        offered = self.offered
        groups = dict.fromkeys(row.group for row in offered.values())
        try:
            names = (of,) if isinstance(of, str) else () if isinstance(of, _NO_LISTS) else tuple(of)
        except TypeError:
            names = ()
        if not names:
            raise bad("of", of, "a name or a list of names", "pk.quantities() lists them")
        for name in names:
            row = self.rows.get(name) if isinstance(name, str) else None
            if row is not None and name not in offered:
                raise ParameterError(
                    f"of: got {name!r}, which needs an argument of its own; call pk.{row.group}"
                )
            if not isinstance(name, str) or (name not in offered and name not in groups):
                valid = [*groups, *offered]
                raise unknown("of: the quantity", name, valid, listed="pk.quantities()")
        whole = {name for name in names if name not in offered}
        if where is not None:
            able = {g for one in self.passes if where.is_within(one.of) for g in one.groups}
            groups = {group: None for group in groups if group in able}
        return tuple(
            row
            for row in offered.values()
            if row.group in groups and (row.name in names or row.group in whole)
        )

    def standings_of(self, group: str) -> set[Standing]:
        """Where a group is computed."""
        return {one.standing for one in self.passes if group in one.groups}

    def offers(self, where: type[Law] | Standing, group: str) -> bool:
        """Whether a group is computed on a rung, or where a law stands."""
        where = Standing.from_rung(where)
        return any(where.is_within(one) for one in self.standings_of(group))

    def plan(
        self, rows: Iterable[Quantity], where: type[Law] | Standing = Trigonometric
    ) -> tuple[Pass, ...]:
        """Return the passes that compute the rows where a law stands, as few as the table has.

        Groups that are not computed there are left out.
        """
        missing = {row.group for row in rows}
        lines, chosen = self.fitting(Standing.from_rung(where)), list[Pass]()
        for candidate in lines:
            if missing.issuperset(candidate.groups):
                chosen.append(candidate)
                missing.difference_update(candidate.groups)
        for group in sorted(missing):  # its passes compute others as well, which are not wanted
            if not any(group in one.groups for one in chosen):
                chosen += [one for one in reversed(lines) if group in one.groups][:1]
        return tuple(chosen)

    def fitting(self, where: Standing) -> list[Pass]:
        """Return the lines for where a law stands: of each group the most special ones."""
        able = [one for one in self.passes if where.is_within(one.of) and not one.options]
        depths, special = [one.standing.depth for one in able], dict[str, tuple[int, int]]()
        for one, depth in zip(able, depths, strict=True):
            special |= {group: max(depth, special.get(group, depth)) for group in one.groups}
        return [
            one for one, depth in zip(able, depths, strict=True)
            if all(depth == special[group] for group in one.groups)
        ]  # fmt: skip

    def behind(self, one: Pass, where: Standing) -> tuple[list[Pass], str | None]:
        """Return the lines for the quantities from which a line starts, in the end.

        Each is the one that computes the least. Besides the group that nothing there computes.
        """
        left, found = [name for name in one.inputs if name in self.rows], list[Pass]()
        lines = self.fitting(where)[::-1] if left else []
        while left:
            group = self.rows[left.pop()].group
            if any(group in other.groups for other in found):
                continue
            able = [other for other in lines if group in other.groups]
            if not able:
                return found, group
            found.append(able[0])
            left += [name for name in able[0].inputs if name in self.rows]
        return found, None

    def line_for(self, name: str, chosen: Sequence[Pass]) -> Pass | None:
        """Return the line for a quantity: one of those chosen, else one behind them; or None."""
        behind = (other for one in chosen for other in one.behind)
        group = self.rows[name].group if name in self.rows else ""
        for one in (*chosen, *behind):
            if group in one.groups or any(row.name == name for row in one.rows):
                return one
        return None

    def call(self, one: Pass, *arrays: Any) -> dict[str, Any]:
        """Call the function of a pass; return the arrays by the names of the quantities."""
        if not self.own.isdisjoint(one.groups):
            return self._of_own(one, arrays)
        result = one.resolved(*arrays)
        results = result if len(one.groups) > 1 else (result,)
        named: dict[str, Any] = {}
        for group, part in zip(one.groups, results, strict=True):
            if isinstance(part, dict):
                named.update(part)
                continue
            names = [row.name for row in self.rows.values() if row.group == group]
            if names[0] in getattr(part, "_fields", ()):
                named.update(part._asdict())
            else:
                named.update(zip(names, part if isinstance(part, tuple) else (part,), strict=True))
        return named

    def _of_own(self, one: Pass, arrays: tuple[Any, ...]) -> dict[str, Any]:
        """The quantity that a function of the user's gives, checked."""
        (row,) = (row for row in self.rows.values() if row.group == one.groups[0])
        try:
            result = one.resolved(*arrays)
        except PhasekitError:
            raise
        except Exception as error:
            raise ParameterError(
                f"of: the function of {row.name!r} raised {type(error).__name__}: {error}"
            ) from error
        if isinstance(result, tuple) and len(result) == 1:
            (result,) = result
        try:
            found = np.asarray(result)
        except ValueError:  # lists of several lengths
            found = np.asarray(None)
        fits = found.dtype.kind in "biuf"
        if fits and np.dtype(row.dtype).kind != "f":
            with np.errstate(all="ignore"):  # of numbers that its type does not hold
                fits = bool(np.all(found == found.astype(row.dtype)))
        if not fits:
            given = repr(result)[:60] if found.dtype == object else f"{found.dtype} values"
            raise ParameterError(
                f"of: the function of {row.name!r} gave {given}, wants an array of {row.dtype}"
            )
        return {row.name: found}
