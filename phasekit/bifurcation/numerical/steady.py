"""The potential that equilibria rest in: of any law in a potential, with its constant torque."""

from __future__ import annotations

import functools
from collections.abc import Mapping
from typing import Any

import numpy as np

from phasekit.bifurcation.numerical.line import Line
from phasekit.laws.formulas import symbols_of
from phasekit.laws.perturbed import PerturbedLaw
from phasekit.laws.trigonometric import Trigonometric
from phasekit.mechanics.at_momentum import Machines
from phasekit.phase.numerical.formula import Formula, make_formula
from phasekit.phase.numerical.inertial import Inertial
from phasekit.phase.numerical.turns import torqued

Span = tuple[float, float]


@functools.singledispatch
def steady_formula(law: Any) -> Formula:
    """V of a law as a formula; under a constant torque V less torque times coordinate."""
    raise TypeError(law)


@steady_formula.register
def _(law: Formula) -> Formula:
    return law


@steady_formula.register
def _(law: Trigonometric) -> Formula:
    import sympy as sp

    symbols = symbols_of((law.coordinate, *law.parameters))
    phi = symbols[law.coordinate]
    A, B, C = law.formulas({name: symbols[name] for name in law.parameters})
    V = -B * sp.cos(phi) + A / 2 * sp.cos(phi) ** 2 - C * sp.sin(phi)
    return make_formula(V, law.coordinate, law.parameters, law.period, None)


@steady_formula.register
def _(law: Machines) -> Formula:
    symbols = symbols_of((law.coordinate, *law.names))
    V = law.resting_formula(symbols)
    names = tuple(name for name in law.names if symbols[name] in V.free_symbols)
    return make_formula(V, law.coordinate, names, law.period, None)


@steady_formula.register
def _(law: Inertial) -> Formula:
    return law.formula


@steady_formula.register
def _(law: PerturbedLaw) -> Formula:
    return torqued(steady_formula(law.base))


#: The potential of numbers A, B and C.
NAMED = "A*cos(phi)^2/2 - B*cos(phi) - C*sin(phi)"


def steady_line(law: Any, values: Mapping[str, float], moving: Mapping[str, Span]) -> Line:
    """The line along which parameters of a law move, the others having these values.

    The torque alone moves in the potential of numbers A, B and C.
    """
    known, base = dict(values), getattr(law, "base", None)
    if isinstance(base, Trigonometric) and moving.keys() <= {"torque"}:
        formula = torqued(make_formula(NAMED, "phi", ("A", "B", "C"), base.period, None))
        ABC = base.coefficients({name: np.asarray(values[name]) for name in base.parameters})
        known |= dict(zip("ABC", map(float, ABC), strict=True))
    else:
        formula = steady_formula(law)
    still = {name: known[name] for name in formula.names if name not in moving}
    return Line(formula, still, dict(moving))
