"""Who computes a quantity: one function over the table, by the rung of the law and what is given.

Each line of `PASSES` says which groups it computes, of which rung of the ladder of laws, and from
what. The most special line that fits answers.
"""

from __future__ import annotations

import functools
from collections.abc import Iterable, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from phasekit.labels.arguments import bad, one_of
from phasekit.labels.coordinates import LABELS
from phasekit.laws.ladder import Law
from phasekit.laws.perturbed import PerturbedConservative
from phasekit.systems.as_system import stands_on
from phasekit.systems.system import Model
from phasekit.table import quantities
from phasekit.table.quantities import ROWS, plan_passes
from phasekit.table.row import LAW, Pass, Quantity

CENTERS = tuple(name for name in LABELS["equilibrium"][0] if name.endswith("center"))
SADDLES, SIDES = LABELS["saddle"][0], LABELS["side"][0]

#: A pass, and what is noted of the arguments that it was made from.
Noted = tuple[Pass, dict[str, str]]


def passes_of(
    system: Model, rows: Iterable[Quantity], given: Iterable[str] = ()
) -> tuple[Pass, ...]:
    """Return the passes that compute rows of the table for a system.

    Parameters
    ----------
    system : Model
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
    for group in dict.fromkeys(row.group for row in rows):
        if not is_offered(system, group):
            rungs = rungs_of(group)
            plain = {one for one in rungs if not issubclass(one, PerturbedConservative)}
            stands_on(system, max(plain or rungs, key=depth), group)
    states = {*given, *system.parameters}
    return tuple(bound(one, system, states) for one in plan_passes(rows, system.rung))


def inputs_of(system: Model, rows: Iterable[Quantity]) -> tuple[Quantity, ...]:
    """The rows that others are computed from, where labels are numbered: these go along."""
    rows = tuple(rows)
    if system.rung.labels_fixed or not all(is_offered(system, row.group) for row in rows):
        return ()
    names = (name for one in plan_passes(rows, system.rung) for name in one.inputs)
    found = {ROWS[name]: None for name in names if name in ROWS and ROWS[name] not in rows}
    return (*found, *inputs_of(system, (*rows, *found))) if found else ()


def rungs_of(group: str) -> set[type[Law]]:
    """The rungs on which a group is computed."""
    return {one.of for one in quantities.PASSES if group in one.groups}


def is_offered(system: Model, group: str) -> bool:
    """Whether a group is computed on the rung of a system's law."""
    return any(group in one.groups and issubclass(system.rung, one.of) for one in quantities.PASSES)


def pass_from(system: Model, group: str, start: str, **options: Any) -> Noted:
    """Return the pass that computes a group from a state of another kind, and from options.

    Parameters
    ----------
    system : Model
        The system.
    group : str
        What to compute.
    start : str
        The state that is given.
    **options : str, int or None
        What else the call says: center, saddle, side.

    Raises
    ------
    ParameterError
        If an option is not a label that the system has, or nothing computes the group from this.
    """
    fitting = [
        one
        for one in quantities.PASSES
        if group in one.groups and start in one.inputs and set(one.options) == set(options)
    ]
    rungs = [one.of for one in fitting if issubclass(system.rung, one.of)]
    if not rungs:
        stands_on(system, fitting[0].of, f"{group} from {start}")
    best = max(rungs, key=depth)
    (one,) = (one for one in fitting if one.of is best)
    chosen = {name: _option(system, name, value) for name, value in options.items()}
    notes = {
        name: str(system.rung.default[name] if value is None else value)
        for name, value in options.items()
    }
    return bound(one, system, set(), chosen), notes


def depth(rung: type) -> int:
    """How special a rung is."""
    return len(rung.__mro__)


def bound(one: Pass, system: Model, given: set[str], options: dict[str, Any] | None = None) -> Pass:
    """Return a line of the table for one system: with its law, options and optional states."""
    extra = {state: keyword for state, keyword in one.optional if state in given}
    if LAW not in one.inputs and not options and not extra:
        return one
    function = one.resolved
    inputs = one.inputs
    if LAW in inputs:
        function = functools.partial(function, system.law)
        own = tuple(system.parameters)
        inputs = tuple(x for name in inputs for x in (own if name == LAW else (name,)))
    if options:
        function = functools.partial(function, **options)
    if extra:
        function = functools.partial(_with_keywords, function, tuple(extra.values()))
    return Pass(function, (*inputs, *extra), one.groups, one.of)


def _with_keywords(function: Any, keywords: tuple[str, ...], *arrays: Any, **options: Any) -> Any:
    """Call a function whose last arrays go by keyword."""
    own = len(arrays) - len(keywords)
    return function(*arrays[:own], **dict(zip(keywords, arrays[own:], strict=True)), **options)


def _option(system: Model, name: str, value: Any) -> int | None:
    """Return an option as the number that array functions take; None where nothing is said."""
    if name == "side":
        return one_of(name, value, SIDES)
    if value is None:
        return None
    if system.rung.labels_fixed:
        return one_of(name, value, {"center": CENTERS, "saddle": SADDLES}[name])
    if isinstance(value, (bool, np.bool_)) or not isinstance(value, (int, np.integer)) or value < 0:
        dim = {"center": "equilibrium", "saddle": "saddle"}[name]
        wants = f"a {name}'s number on the dim {dim}, 0 or more, for a {type(system).__name__}"
        raise bad(name, value, wants)
    return int(value)


def fitted(
    system: Model, rows: Sequence[Quantity], passes: Sequence[Pass]
) -> tuple[Sequence[Quantity], Sequence[Pass]]:
    """Return rows and passes with the labels and words that the system's results have.

    Raises
    ------
    ParameterError
        If nothing is left of what was asked for, or the system lacks what it needs.
    """
    kept = [row for row in rows if issubclass(system.rung, row.of)]
    if not kept:
        raise bad("of", rows[0].name, f"quantities that a {type(system).__name__} has")
    if system.rung.labels_fixed:
        words: list[Any] = [system.law.words(r.name, r.units, r.long_name) for r in kept]
        told = (replace(row, **w) if w else row for row, w in zip(kept, words, strict=True))
        return tuple(told), passes
    from phasekit.cells import numbered  # loads scipy, which named labels do not need

    labelled = any(dim in ("equilibrium", "saddle") for row in kept for dim in row.dims)
    if issubclass(system.rung, PerturbedConservative) and not labelled:
        return numbered.worded(system, kept), passes  # no equilibrium is looked for
    counts = [one for one in quantities.PASSES if one.groups == ("labels",)]
    (count,) = (one for one in counts if issubclass(system.rung, one.of))
    return numbered.fitted(system, kept, passes, bound(count, system, set(system.parameters)))
