"""Systems that conserve energy as formulas of angle and rate: what a `Problem` of orbits holds."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from phasekit.labels.arguments import bad
from phasekit.laws.formulas import symbols_of
from phasekit.laws.ladder import Routhian, is_turn

#: The formulas of a system: right-hand sides, states, values of its parameters, keywords.
Formulas = tuple[list[Any], tuple[str, str], dict[str, float], dict[str, Any]]


def moving_formulas(system: Any) -> Formulas:
    """Formulas of the motion of a system in a potential, or of a rotor at its momentum."""
    free = issubclass(system.rung, Routhian)
    carried = hasattr(system, "angular_momentum")
    values = at_momentum(system) if carried else numbers(system, system.formula_inputs())
    law = system.law
    states = (law.coordinate, f"d{law.coordinate}")
    of = symbols_of([*states, *values])
    own = system.law_of_parameters if free else law
    force = own.acceleration_formula(of, of[states[1]], 0)
    periods = {} if law.period is None else {law.coordinate: law.period}
    return [of[states[1]], force], states, values, {"periods": periods, "conservative": True}


def numbers(system: Any, names: Sequence[str]) -> dict[str, float]:
    """Values of the parameters of a single system."""
    given = system.parameters
    for name in names:
        if not isinstance(given[name], float):
            raise bad(name, given[name], "a single number, to continue a single system")
    return {name: float(given[name]) for name in names}


def at_momentum(machine: Any) -> dict[str, float]:
    """The parameters of a free rotor, with the momentum that it keeps in place of omega1."""
    names = [n for n in machine.formula_inputs() if n not in ("omega1", "momentum")]
    values = numbers(machine, names)
    if machine.momentum is None:
        kept = float(machine.angular_momentum(0.0, 0.0))
    else:
        kept = numbers(machine, ["momentum"])["momentum"]
    return {**values, "momentum": kept}


def moving_words(system: Any, states: Sequence[str], names: Sequence[str]) -> dict[str, Any]:
    """Long names and units of the states and parameters."""
    declared = {p.name: {"long_name": p.long_name, "units": p.units} for p in system.declared}
    words = {name: declared[name] for name in names if name in declared}
    if is_turn(system.law.period):
        words[states[0]] = {"long_name": "angle", "units": "rad"}
        words[states[1]] = {"long_name": "angular velocity", "units": "s-1"}
    return words
