"""Systems that conserve energy as formulas of angle and rate: what a `Problem` of orbits holds."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

from phasekit.labels.arguments import bad
from phasekit.laws.formulas import symbols_of
from phasekit.laws.ladder import Routhian

#: The formulas of a system: right-hand sides, states, values of its parameters, keywords.
Formulas = tuple[list[Any], tuple[str, str], dict[str, float], dict[str, Any]]


def moving_formulas(system: Any) -> Formulas:
    """Formulas of the motion of a system in a potential, or of a rotor at its momentum.

    Raises
    ------
    ParameterError
        If a parameter is an array.
    """
    free = issubclass(system.rung, Routhian)
    values = at_momentum(system) if free else numbers(system, system.formula_inputs())
    law = system.law
    states = (law.coordinate, f"d{law.coordinate}")
    of = symbols_of([*states, *values])
    force = _at_momentum(of) if free else -law.gradient_formula(of)
    periods = {} if law.period is None else {law.coordinate: law.period}
    return [of[states[1]], force], states, values, {"periods": periods, "conservative": True}


def numbers(system: Any, names: Sequence[str]) -> dict[str, float]:
    """Values of the parameters of a single system.

    Raises
    ------
    ParameterError
        If one is an array.
    """
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


def _at_momentum(of: dict[str, Any]) -> Any:
    """Phi'' of the disk on a free support: M phi'' + M' phi'^2/2 + V_p' = 0.

    M = M22 - M12^2/M11 and the amended potential V_p = V + p^2/(2 M11), as in
    `phasekit.mechanics.two_degrees`.
    """
    import sympy

    beta, m, a, e, r, phi, v = (of[n] for n in ("beta", "m", "a", "e", "r", "phi", "dphi"))
    sine, cosine, s, c = sympy.sin(beta), sympy.cos(beta), sympy.sin(phi), sympy.cos(phi)
    own = m * r**2 / 4
    across = own + m * e**2
    along, deviation = own + across * sine**2, across * sine * cosine
    m11 = of["carrier_inertia"] + own + m * (e * cosine) ** 2 + own * cosine**2 * c**2
    m11 += m * (a + e * sine * s) ** 2
    inertia = along - (deviation * c) ** 2 / m11
    slope = sympy.diff(m11, phi)
    torque = of["momentum"] ** 2 * slope / (2 * m11**2) - m * of["g"] * e * sine * s
    return (torque - sympy.diff(inertia, phi) * v**2 / 2) / inertia


def moving_words(system: Any, states: Sequence[str], names: Sequence[str]) -> dict[str, Any]:
    """Long names and units of the states and parameters."""
    declared = {p.name: {"long_name": p.long_name, "units": p.units} for p in system.declared}
    words = {name: declared[name] for name in names if name in declared}
    if system.law.period is not None and math.isclose(system.law.period, 2.0 * math.pi):
        words[states[0]] = {"long_name": "angle", "units": "rad"}
        words[states[1]] = {"long_name": "angular velocity", "units": "s-1"}
    return words
