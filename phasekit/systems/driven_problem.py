"""The whole machine of a rotor on a free support, under torques, as equations of four states."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np

from phasekit.labels.arguments import bad
from phasekit.laws.formulas import symbols_of, take_formula
from phasekit.mechanics.at_momentum import lagrange_formulas
from phasekit.mechanics.two_degrees import accelerations, two_degrees
from phasekit.systems.driven_rotor import ARGUMENTS, DERIVED, STATE, check_call

if TYPE_CHECKING:
    from phasekit.systems.problem import Problem

#: Parameters of the machine, in the order of `two_degrees`.
MACHINE = ("beta", "e", "a", "r", "m", "carrier_inertia", "g")
STATES = tuple(STATE)


def driven_problem(
    rotor: Any, torques: tuple[Any, Any], parameters: Mapping[str, Any] | None, period: Any
) -> Problem:
    """The machine under torques on the support and on the disk's shaft, as a `Problem`."""
    from phasekit.systems.problem import Problem

    own = {name: rotor.parameters[name] for name in MACHINE}
    if parameters is not None and not isinstance(parameters, Mapping):
        raise bad("parameters", parameters, "a mapping of names to values, {'slip': 0.05}")
    more = dict(parameters or {})
    for name in more:
        if name in (*own, *ARGUMENTS):
            raise bad("parameters", name, "a name that the machine has not")
    values = {**own, **more}
    coded = [callable(one) and not hasattr(one, "free_symbols") for one in torques]
    words = {name: {"units": units, "long_name": text} for name, (units, text, _) in STATE.items()}
    words |= {
        p.name: {"units": p.units, "long_name": p.long_name}
        for p in rotor.declared
        if p.name in own
    }
    turn = 2.0 * np.pi
    common: dict[str, Any] = {
        "periods": {"phi1": turn, "phi": turn},
        "start": {"phi1": 0.0, "omega1": float(rotor.disk.omega1)},
    }
    if any(coded):
        for name, one, is_function in zip(("torque1", "torque2"), torques, coded, strict=True):
            if is_function:
                wants = "a torque in N m: a number, or a function of (t, phi1, phi, omega1, dphi)"
                check_call(name, one, wants)
            elif isinstance(one, str) or hasattr(one, "free_symbols"):
                raise bad(name, one, "a number or a function, beside a function")
        rates = Torqued(tuple(torques))
        made = Problem(rates, STATES, values, time="t", period=period, **common)
        return made.described(words)
    symbols = symbols_of([*values, *ARGUMENTS])
    declare = "declare it in parameters"
    pair = tuple(
        take_formula(0.0 if one is None else one, symbols, name, declare)
        for name, one in zip(("torque1", "torque2"), torques, strict=True)
    )
    found = lagrange_formulas(symbols, (pair[0], pair[1]))
    found |= {"torque1": pair[0], "torque2": pair[1]}
    f = [symbols["omega1"], symbols["dphi"], found["domega1"], found["ddphi"]]
    if any(symbols["t"] in one.free_symbols for one in pair) or period is not None:
        common |= {"time": "t", "period": period}
    made = Problem(f, STATES, values, observables={name: found[name] for name in DERIVED}, **common)
    return made.described(words)


class Torqued:
    """The rates of the machine, where a torque is a function."""

    def __init__(self, torques: tuple[Any, Any]) -> None:
        self.torques = torques

    def __call__(self, x: Any, t: float = 0.0, **values: float) -> tuple[Any, ...]:
        """The rates at a state and time."""
        state = tuple(map(float, x))
        machine = two_degrees(*(values[name] for name in MACHINE))
        own = [
            0.0 if one is None else one(t, *state) if callable(one) else one for one in self.torques
        ]
        _, phi, omega1, dphi = state
        with np.errstate(all="ignore"):
            return omega1, dphi, *accelerations(machine, phi, dphi, omega1, *own)

    def __eq__(self, other: object) -> bool:
        """Whether the torques are the same."""
        return isinstance(other, Torqued) and self.torques == other.torques

    def __hash__(self) -> int:
        """Hash of the torques."""
        return hash(self.torques)
