"""Crossings of motions of equations, labelled: Poincare sections, and events on the way."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np
import xarray as xr

from phasekit.arrays import Array
from phasekit.cells.schema import dataset_attrs, input_attrs
from phasekit.cells.states import kept_states
from phasekit.errors import warn
from phasekit.labelled.flows import refuse_force, states_of, with_starts
from phasekit.labels.arguments import bad, number, unknown
from phasekit.labels.coordinates import LABELS
from phasekit.labels.grid import Grid, loaded_grid, variable
from phasekit.laws.equations import Equations
from phasekit.laws.formulas import take_formula
from phasekit.motion.crossings import NEVER, Crossing, crossings, symbols_here
from phasekit.motion.lost import EXHAUSTED, MOST, STUCK, stuck, tell
from phasekit.numerics.waits import notice

#: Steps of motions that have no last time.
ENDLESS = 1_000_000


class Motions(NamedTuple):
    """Motions side by side: cells of parameters and states."""

    grid: Grid
    values: dict[str, Array]
    """Parameters by name, one for each motion."""
    states: Array
    """Of shape (motions, states)."""

    @property
    def dims(self) -> tuple[str, ...]:
        """Names of the dims of the cells."""
        return tuple(self.grid.sizes)

    def laid(self, array: Any) -> Any:
        """An array with the motions on its first axis, on the dims of the cells."""
        return array.reshape(tuple(self.grid.sizes.values()) + array.shape[1:])

    def coords(self, system: Any) -> dict[str, xr.Variable]:
        """Coordinates of the cells: parameters, and states at the start."""
        found = dict(self.grid.coords)
        for name, given in {**self.grid.coords, **self.grid.inputs}.items():
            attrs = input_attrs(system, name) or given.attrs
            found[name] = variable(map(str, given.dims), given.data, attrs)
        return found


def motions_in_cells(
    system: Any, law: Equations, x0: Any, named: Mapping[str, Any], names: Sequence[str]
) -> Motions:
    """Lay out motions by the parameters of these names, and by states as of `flow`."""
    states = states_of(law, x0, named)
    kept = kept_states(system, states)
    inputs = {name: system.parameters[name] for name in names}
    grid = loaded_grid(
        {**inputs, **kept}, axis=dict.fromkeys(kept, "point"),
        called={name: argument for argument, (name, _) in states.items()},
    )  # fmt: skip
    dims, shape = tuple(grid.sizes), tuple(grid.sizes.values())

    def flat(name: str) -> Array:
        return np.array(np.broadcast_to(grid.aligned(name, dims), shape), float).reshape(-1)

    columns = [flat(name) for name, _ in states.values()]
    return Motions(grid, {name: flat(name) for name in names}, np.stack(columns, axis=-1))


def section_of(
    law: Equations, section: Any, sense: int, last: int, other: Mapping[str, str] | None = None
) -> tuple[list[Crossing], str]:
    """What is looked for along motions, and its equation.

    In formulas states may have ``other`` names.
    """
    first = law.states[0]
    wants = (
        f"a state with its value, ({first!r}, 0.0), or a formula of the states, '{first} = 0', "
        "that is satisfied on it"
    )
    symbols, clock = symbols_here(law.states, law.names, law.time)
    if isinstance(section, Mapping) and len(section) == 1:
        section = next(iter(section.items()))
    if isinstance(section, (tuple, list)) and len(section) == 2 and isinstance(section[0], str):
        name, value = section
        if name not in law.states:
            raise unknown("section: state", name, law.states)
        level = number("section", value, wants, law.units.get(name))
        text = f"{name} = {level!r}"
        if name not in law.periods:
            return [Crossing(symbols[name] - level, sense, last)], text
        import sympy as sp

        angle = 2 * sp.pi * (symbols[name] - level) / law.periods[name]
        # The sine rises through whole turns alone where its cosine is above zero.
        return [Crossing(sp.sin(angle), sense, last, 1), Crossing(sp.cos(angle), NEVER)], text
    if isinstance(section, str) and section.count("=") == 1:
        left, right = section.split("=")
        section = f"({left}) - ({right})"
    if not (isinstance(section, str) or hasattr(section, "free_symbols")):
        raise bad("section", section, wants)
    if hasattr(section, "lhs") and not hasattr(section, "is_Pow"):
        section = section.lhs - section.rhs
    known = {**symbols, str(clock): clock}
    for alias, name in (other or {}).items():
        known |= {alias: symbols[name], f"d{alias}": symbols[f"d{name}"]}
    formula = take_formula(section, known, "section", "it is no state and no parameter")
    if not formula.free_symbols & {*(symbols[name] for name in law.states), clock}:
        raise bad("section", section, wants)
    return [Crossing(formula, sense, last)], f"{formula} = 0"


def sections_through(
    system: Any, law: Equations, x0: Any, named: Mapping[str, Any], *, section: Any,
    duration: float | None, n: int | None, direction: int, tolerances: Mapping[str, Any],
    other: Mapping[str, str] | None = None,
) -> xr.Dataset:  # fmt: skip
    """States at which motions cross a section; see `phasekit.poincare_section`."""
    refuse_force(system)
    watched, equation = section_of(law, section, direction, 0 if n is None else n, other)
    motions = motions_in_cells(system, law, x0, named, law.names)
    count = len(motions.states)
    times = np.tile([0.0, np.inf if duration is None else duration], (count, 1))
    most = ENDLESS if duration is None else MOST
    with notice("following motions to a section"):
        found = crossings(
            law, motions.values, motions.states, times, watched, most=most, **tolerances
        )
    which = found.which == 0
    numbers = which.sum(axis=1)
    stuck(law, found.status)
    if duration is not None or (found.status == STUCK).any():
        tell("section", found.status, motions.states)
    few = numbers < (1 if n is None else n)
    if few.any():
        what = "do not meet the section" if n is None else f"meet the section less than {n} times"
        open_ = few & (found.status == EXHAUSTED)
        if duration is None and open_.any():
            what += f" in {ENDLESS:,} steps; a duration= ends them sooner"
        warn(f"poincare_section: {few.sum()} of {count} motions {what}", RuntimeWarning)
    width = found.time.shape[1] if n is None else n
    time, state = _padded(found.time, width), _padded(found.state, width)
    for i, name in enumerate(law.states):
        if name in law.periods:
            turn = law.periods[name]
            state[..., i] = 0.5 * turn - np.mod(0.5 * turn - state[..., i], turn)
    if equation.count("=") == 1 and watched[0].gate == 1:
        state = _at_level(law, section, state)
    dims = (*motions.dims, "crossing")
    attrs = {
        "long_name": "time of the crossing",
        "units": system.unit_of("time") or "1",
        "equation": equation,
    }
    data = {"section_time": variable(dims, motions.laid(time), attrs)}
    for i, name in enumerate(law.states):
        attrs = {
            "long_name": f"{name} in the section", "units": law.units.get(name, "1"),
            "equation": equation,
        }  # fmt: skip
        data[f"section_{name}"] = variable(dims, motions.laid(state[..., i]), attrs)
    if motions.dims:
        data["n_crossings"] = variable(
            motions.dims, motions.laid(numbers), {"long_name": "number of crossings"}
        )
    coords = {
        **motions.coords(system),
        "crossing": variable(
            ("crossing",), np.arange(width), {"long_name": LABELS["crossing"][1]}
        ),
    }  # fmt: skip
    ds = xr.Dataset(data, coords, dataset_attrs(system))
    return with_starts(ds, law, [f"state_{name}" for name in law.states])


def _padded(array: Array, width: int) -> Array:
    """An array with so many columns, the last ones NaN."""
    found = np.full((array.shape[0], width, *array.shape[2:]), np.nan)
    found[:, : array.shape[1]] = array[:, :width]
    return found


def _at_level(law: Equations, section: Any, state: Array) -> Array:
    """States with the angle of the section as it is, which rounding would put beside the cut."""
    name, value = next(iter(section.items())) if isinstance(section, Mapping) else section
    i, turn = law.states.index(name), law.periods[name]
    level = 0.5 * turn - np.mod(0.5 * turn - float(value), turn)
    state[..., i] = np.where(np.isfinite(state[..., i]), level, np.nan)
    return state
