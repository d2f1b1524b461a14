"""Calls at states: from the arguments of a labelled function to states of the table.

States are scalars, arrays of equal shape, which pair on the dim `point`, or DataArrays, which
broadcast by the names of their dims. Times and levels make an axis of their own instead.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import xarray as xr

from phasekit.cells.evaluate import evaluate
from phasekit.cells.request import refuse
from phasekit.errors import ParameterError
from phasekit.inputs import is_whole
from phasekit.labels.arguments import Value, bad, numeric, one_of
from phasekit.labels.coordinates import AXES, LABELS
from phasekit.systems.system import System, as_system
from phasekit.table.quantities import TABLE
from phasekit.table.row import Pass, Quantity

CENTERS = tuple(name for name in LABELS["equilibrium"][0] if name.endswith("center"))
SADDLES, SIDES = LABELS["saddle"][0], LABELS["side"][0]

#: A pass, and what is noted of the arguments that it was made from.
Noted = tuple[Pass, dict[str, str]]


def at_states(
    system: Any,
    rows: Sequence[Quantity],
    states: Mapping[str, tuple[str, Any]],
    passes: Sequence[Pass] | None = None,
) -> xr.Dataset:
    """Compute rows of the table at states.

    ``states`` are, for each argument, the name of the state and its value.
    """
    system = as_system(system)
    kept = kept_states(system, states)
    return evaluate(
        system,
        rows,
        passes,
        states=kept,
        axis={name: "point" for name in kept if name not in AXES},
        called={name: argument for argument, (name, _) in states.items()},
    )


def kept_states(system: System, states: Mapping[str, tuple[str, Any]]) -> dict[str, Value]:
    """States as numbers and arrays by name, from arguments as of `at_states`."""
    kept: dict[str, Value] = {}
    length: dict[str, int] = {}
    for argument, (name, value) in states.items():
        state = kept[name] = numeric(argument, value, system.unit_of(name))
        if isinstance(state, np.ndarray) and name not in AXES:
            length[argument] = state.size
    if len(set(length.values())) > 1:
        got = " and ".join(f"{n} values of {argument}" for argument, n in length.items())
        raise ParameterError(
            f"{', '.join(length)}: got {got}, wants equal lengths, which pair point by point; "
            "for all combinations give DataArrays with dims of their own"
        )
    return kept


def pass_from(system: System, group: str, start: str, **options: Any) -> Noted:
    """Return the pass that computes a group from a state of another kind, and from options.

    ``start`` is the state that is given, ``options`` what else the call says: center, saddle, side.
    """
    fitting = [
        one
        for one in TABLE.passes
        if group in one.groups and start in one.inputs and set(one.options) == set(options)
    ]
    able = [one for one in fitting if system.standing.is_within(one.of)]
    if not able:
        refuse(system, {one.standing for one in fitting}, f"{group} from {start}")
    one = max(able, key=lambda line: line.standing.depth)
    chosen = {name: option_of(system, name, value) for name, value in options.items()}
    notes = {
        name: str(system.standing.rung.default[name] if value is None else value)
        for name, value in options.items()
    }
    return one.bound(system, set(), chosen), notes


def option_of(system: System, name: str, value: Any) -> int | None:
    """Return a center, saddle or side as its number; None where nothing is said."""
    if name == "side":
        return one_of(name, value, SIDES)
    if value is None:
        return None
    if system.standing.rung.labels_fixed:
        return one_of(name, value, {"center": CENTERS, "saddle": SADDLES}[name])
    if not is_whole(value) or value < 0:
        dim = {"center": "equilibrium", "saddle": "saddle"}[name]
        wants = f"a {name}'s number on the dim {dim}, 0 or more, for a {type(system).__name__}"
        raise bad(name, value, wants)
    return int(value)
