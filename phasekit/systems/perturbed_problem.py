"""A system with damping and forcing as formulas: what a `Problem` of it is made of."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from fractions import Fraction
from typing import Any

from phasekit.labels.arguments import bad
from phasekit.laws.formulas import symbols_of
from phasekit.laws.ladder import is_turn
from phasekit.laws.perturbed import forcing_names

#: What is added to the potential; kT is noise, of which a periodic orbit knows nothing.
ADDED = ("damping", "quadratic", "torque")
LONGEST = 100  # periods of the first harmonic that a common period may have
ULP = 2.0**-52


def formulas_of(system: Any) -> tuple[list[Any], tuple[str, str], dict[str, float], Any]:
    """Right-hand side, states, parameters and keywords of the `Problem` of a system.

    Frequencies of further harmonics stay in their ratio to the first, which is the parameter.

    Raises
    ------
    ParameterError
        If a parameter is an array, the system varies other than by a periodic torque, or there is
        noise.
    """
    _refuse(system)
    law, number = system.law, len(system.forcing)
    names = [*law.inputs, *ADDED]
    for i in range(number):
        names += [n for n in forcing_names(i) if i == 0 or not n.endswith("_frequency")]
    given: dict[str, Any] = system.parameters
    for name in (*names, *(forcing_names(i)[1] for i in range(number))):
        if not isinstance(given[name], float):
            raise bad(name, given[name], "a single number, to continue a single system")
    values = {name: float(given[name]) for name in names}
    x = law.base.coordinate
    states = (x, f"d{x}")
    time = next(name for name in ("t", "time", "_t") if name not in (*states, *names))
    of = symbols_of([*states, *names, time])
    v = of[states[1]]
    force = of["torque"] - of["damping"] * v - of["quadratic"] * abs(v) * v
    keywords: dict[str, Any] = {"periods": {} if law.base.period is None else {x: law.base.period}}
    if number:
        ratios = ratios_of([given[forcing_names(i)[1]] for i in range(number)])
        force += _forcing(of, ratios, of[time])
        turns = math.lcm(*(ratio.denominator for ratio in ratios))
        keywords.update(time=time, period=f"{2 * turns}*pi/forcing_frequency")
    law_of_motion = law.base.acceleration_formula(symbols_of([x, *law.inputs]), v, force)
    return [v, law_of_motion], states, values, keywords


def words_of(system: Any, states: Sequence[str], names: Iterable[str]) -> dict[str, Any]:
    """Long names and units of the states and parameters of the `Problem` of a system."""
    declared = {p.name: {"long_name": p.long_name, "units": p.units} for p in system.declared}
    words = {name: declared[name] for name in names}
    if is_turn(system.law.base.period):
        words[states[0]] = {"long_name": "angle", "units": "rad"}
        words[states[1]] = {"long_name": "angular velocity", "units": "s-1"}
    return words


def ratios_of(frequencies: Sequence[float]) -> list[Fraction]:
    """Frequencies over the first one.

    Raises
    ------
    ParameterError
        If they have no common period, or a very long one.
    """
    found = []
    for i, frequency in enumerate(frequencies):
        ratio = frequency / frequencies[0]
        near = Fraction(ratio).limit_denominator(LONGEST) if math.isfinite(ratio) else Fraction(0)
        if not (near > 0 and abs(ratio - near) <= 4.0 * ULP * ratio):
            raise bad(
                forcing_names(i)[1], frequency,
                f"a frequency commensurable with forcing_frequency = {frequencies[0]!r}: "
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


def _refuse(system: Any) -> None:
    """What a problem with periodic orbits cannot hold, by name."""
    wants = "none, to continue it: a Problem holds damping, torque and forcing"
    if system.modulation:
        raise bad("modulation", system.modulation, wants)
    if system.drift:
        raise bad("drift", system.drift, wants)
    if system.omega1 is not None:
        raise bad("omega1", system.omega1, "a constant, to continue it")
    if not (isinstance(system.kT, float) and system.kT == 0.0):
        raise bad("kT", system.kT, "0.0, to continue it: with noise there are no periodic orbits")


def _forcing(of: dict[str, Any], ratios: Sequence[Fraction], t: Any) -> Any:
    """The sum of the harmonics."""
    import sympy

    total = sympy.Integer(0)
    for i, ratio in enumerate(ratios):
        amplitude, _, phase = forcing_names(i)
        angle = sympy.Rational(ratio.numerator, ratio.denominator) * of["forcing_frequency"] * t
        total += of[amplitude] * sympy.cos(angle + of[phase])
    return total
