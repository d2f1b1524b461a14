"""Systems as first-order equations, and as what a `Problem` of them is made of."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from fractions import Fraction
from typing import Any

import numpy as np

from phasekit.errors import ParameterError
from phasekit.labels.arguments import bad
from phasekit.laws.equations import Equations
from phasekit.laws.first_order import FirstOrder, first_order
from phasekit.laws.formulas import symbols_of
from phasekit.laws.ladder import Routhian, Trait, is_turn
from phasekit.laws.perturbed import forcing_names
from phasekit.laws.terms import Drag, Drift, Noise, Prescribed
from phasekit.systems.parameter import attrs_of

#: The formulas of a system: right-hand sides, states, values of its parameters, keywords.
Formulas = tuple[list[Any], tuple[str, str], dict[str, float], dict[str, Any]]

ULP = 2.0**-52
LONGEST = 100  # periods of the first harmonic that a common period may have
#: What is said where a force is not smooth.
SMOOTH = "tanh(dphi/width) in place of sign(dphi), sqrt(x^2 + width^2) in place of Abs(x)"


def equations_in_results(system: Any) -> Equations:
    """The equations of a system with terms, its coordinate and rate called phi and dphi."""
    refuse_jumps(system)
    if system.omega1 is not None:
        wants = "None beside terms that are functions, or have states of their own"
        raise bad("omega1", system.omega1, wants, "use modulation or drift")
    values = {name: float(np.ravel(value)[0]) for name, value in system.parameters.items()}
    start = {k: v for term in system.terms for k, v in term.start.items()}
    units = {"phi": system.unit_of("state_phi") or "1", "dphi": system.unit_of("state_dphi") or "1"}
    return first_order(system.law, ("phi", "dphi"), values, units=units, start=start)


def refuse_jumps(system: Any) -> None:
    """Refuse a force that jumps: where it holds a motion, that does not go on."""
    _refuse_rough(system, Trait.JUMPING, "a force without jumps")


def _refuse_rough(system: Any, trait: Trait, wants: str) -> None:
    for term, own in zip(system.terms, system.law.own, strict=True):
        if own.trait & trait:
            raise ParameterError(f"terms: got {term!r}, wants {wants}; smooth it: {SMOOTH}")


def formulas_of(
    system: Any, *, arrays: bool = False
) -> tuple[Any, tuple[str, ...], dict[str, Any], Any]:
    """Right-hand side, states, parameters and keywords of the `Problem` of a system.

    Parameters are numbers, or also ``arrays``, where nothing varies with time. Frequencies of
    further harmonics stay in their ratio to the first, which is the parameter.
    """
    _refuse(system)
    law, given = system.law, system.parameters
    own = [term for term in law.terms if not isinstance(term, Noise)]
    used = {name for term in own for name in term.names}
    names = [*law.inputs, *(name for name in law.names if name in used)]
    x = law.base.coordinate
    if arrays and isinstance(system.quadratic, float) and system.quadratic == 0.0:
        law = replace(law, terms=tuple(term for term in law.terms if not isinstance(term, Drag)))
    rates = FirstOrder(law, (x, f"d{x}"))
    for name in names:
        if not isinstance(given[name], float) and (not arrays or rates.is_driven):
            raise bad(name, given[name], "a single number, to continue a single system")
    values: dict[str, Any] = {name: given[name] for name in names}
    turn = law.base.period
    keywords: dict[str, Any] = {"periods": {} if turn is None else {x: turn}}
    formulas = rates.formulas()
    fixed: dict[Any, Any] = {}
    if rates.is_driven:
        found = law.frequencies()
        if not found:
            raise bad("terms", list(system.terms), "terms with a period in time, to continue them",
                      "say period=...")  # fmt: skip
        period, fixed = _common(found, values)
        keywords.update(time=rates.time, period=period)
    values = {n: x for n, x in values.items() if symbols_of([n])[n] not in fixed}
    if rates.calls:
        return rates, rates.states, values, keywords
    return [f.xreplace(fixed) for f in formulas], rates.states, values, keywords


def _common(frequencies: Sequence[Any], values: Mapping[str, float]) -> tuple[Any, dict[Any, Any]]:
    """The common period, and further frequencies that are parameters by the first."""
    import sympy as sp

    numbers = {symbols_of([n])[n]: value for n, value in values.items()}
    lengths = [float(sp.sympify(one).subs(numbers)) for one in frequencies]
    ratios, first = ratios_of(lengths, list(map(str, frequencies))), frequencies[0]
    turns = math.lcm(*(ratio.denominator for ratio in ratios))
    fixed = {
        one: sp.Rational(ratio.numerator, ratio.denominator) * first
        for one, ratio in zip(frequencies, ratios, strict=True)
        if one.is_Symbol and one != first
    }
    return 2 * turns * sp.pi / first, fixed


def ratios_of(frequencies: Sequence[float], names: Sequence[str] | None = None) -> list[Fraction]:
    """Frequencies over the first one, by the names that messages give them."""
    names = names or [forcing_names(i)[1] for i in range(len(frequencies))]
    found = []
    for name, frequency in zip(names, frequencies, strict=True):
        ratio = frequency / frequencies[0]
        near = Fraction(ratio).limit_denominator(LONGEST) if math.isfinite(ratio) else Fraction(0)
        if not (near > 0 and abs(ratio - near) <= 4.0 * ULP * ratio):
            raise bad(
                name, frequency,
                f"a frequency commensurable with {names[0]} = {frequencies[0]!r}: "
                f"their ratio a fraction with a denominator up to {LONGEST}",
                "without a common period there are no periodic orbits",
            )  # fmt: skip
        found.append(near)
    if math.lcm(*(ratio.denominator for ratio in found)) > LONGEST:
        raise bad(
            "forcing", [float(one) for one in frequencies],
            f"frequencies with a common period of at most {LONGEST} times that of the first",
        )  # fmt: skip
    return found


def words_of(
    system: Any, states: Sequence[str], names: Iterable[str], period: float | None
) -> dict[str, Any]:
    """Long names and units of the states and parameters of the `Problem` of a system."""
    declared = attrs_of(*system.declared)
    words: dict[str, Any] = {name: declared[name] for name in names if name in declared}
    if is_turn(period):
        words[states[0]] = {"long_name": "angle", "units": "rad"}
        words[states[1]] = {"long_name": "angular velocity", "units": "s-1"}
    return words


def _refuse(system: Any) -> None:
    """What a problem with equilibria and periodic orbits cannot hold, by name."""
    _refuse_rough(system, Trait.JUMPING | Trait.KINKED, "a force without jumps and kinks")
    terms = system.law.terms
    if any(isinstance(term, Drift) for term in terms):
        raise bad("drift", system.drift, "none, to continue it: what drifts has no period")
    if any(isinstance(term, Prescribed) for term in terms):
        raise bad("omega1", system.omega1, "a constant, to continue it")
    if not (isinstance(system.kT, float) and system.kT == 0.0):
        raise bad("kT", system.kT, "0.0, to continue it: with noise there are no periodic orbits")


# ------------------------------------------------------------------------------ without terms


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
