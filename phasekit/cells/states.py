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
from phasekit.errors import ParameterError
from phasekit.labels.arguments import Value, numeric
from phasekit.labels.coordinates import AXES
from phasekit.systems.as_system import as_system
from phasekit.table.row import Pass, Quantity


def at_states(
    system: Any,
    rows: Sequence[Quantity],
    states: Mapping[str, tuple[str, Any]],
    passes: Sequence[Pass] | None = None,
) -> xr.Dataset:
    """Compute rows of the table at states.

    Parameters
    ----------
    system : system
        Any system.
    rows : sequence of Quantity
        What to compute.
    states : mapping of str to (str, value)
        For each argument, by the name that messages give it, the state that it is.
    passes : sequence of Pass, optional
        What computes it; those that the system names by default.

    Raises
    ------
    ParameterError
        If an argument is unusable, or bare arrays differ in length.
    """
    system = as_system(system)
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
    return evaluate(
        system,
        rows,
        passes,
        states=kept,
        axis={name: "point" for name in kept if name not in AXES},
        called={name: argument for argument, (name, _) in states.items()},
    )
