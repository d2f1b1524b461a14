"""The disk on a free support under torques: its law in time, and what is known along a motion."""

from __future__ import annotations

import inspect
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, TypeAlias

import numpy as np

from phasekit.errors import ParameterError
from phasekit.inputs import is_whole
from phasekit.labels.arguments import FloatArray, bad, describe, number
from phasekit.labels.units import UNITS_OF
from phasekit.laws.formulas import symbols_of, take_formula
from phasekit.mechanics import two_degrees as mechanics
from phasekit.mechanics.at_momentum import lagrange_formulas
from phasekit.mechanics.two_degrees import TwoDegrees, accelerations, two_degrees
from phasekit.motion.events import Event

if TYPE_CHECKING:
    from phasekit.systems.problem import Problem

#: A function of (t, phi1, phi, omega1, dphi): a torque in N m, or what vanishes at an event.
StateFunction: TypeAlias = Callable[[float, float, float, float, float], float]
Torque: TypeAlias = float | StateFunction | None

LAGRANGE = "Lagrange's equations, [Veljovic2015] (11) with omega1 free, corrected"
MOMENTUM = "d/dt [M11 omega1 + M12 phi'] = Q1"

#: name -> (units, long_name, equation)
STATE = {
    "phi1": ("rad", "angle of the support", "d phi1/dt = omega1"),
    "phi": ("rad", "angle of the disk", "d phi/dt = phi'"),
    "omega1": ("s-1", "angular velocity of the support", MOMENTUM),
    "dphi": ("s-1", "angular velocity of the disk", "d/dt [M12 omega1 + M22 phi'] = dL/dphi + Q2"),
}
DERIVED = {
    "domega1": ("s-2", "angular acceleration of the support", "M q'' = Q - bias"),
    "ddphi": ("s-2", "angular acceleration of the disk", "M q'' = Q - bias"),
    "torque1": ("N m", "torque on the support", "Q1"),
    "torque2": ("N m", "torque on the disk by its shaft", "Q2"),
    "torque_power": ("W", "power of the torques", "Q1 omega1 + Q2 phi'"),
    "mechanical_energy": ("J", "kinetic and potential energy", "T - m g e sin(beta) cos(phi)"),
    "angular_momentum": (
        "kg m2 s-1",
        "angular momentum about the vertical axis",
        "p = M11 omega1 + M12 phi'",
    ),
}


#: What functions of time and state take.
ARGUMENTS = ("t", "phi1", "phi", "omega1", "dphi")

#: What messages suppose where the integrator cannot go on.
CAUSES = (
    "A torque without bound, or a particle over the vertical axis on a support without inertia,"
)


@dataclass(frozen=True)
class DrivenRotor:
    """The machine and what drives it."""

    machine: TwoDegrees
    torque1: float | StateFunction
    torque2: float | StateFunction

    def torques(self, t: float, state: Any) -> tuple[float, float]:
        """Q1 and Q2 in a state."""
        q1, q2 = self.torque1, self.torque2
        return q1(t, *state) if callable(q1) else q1, q2(t, *state) if callable(q2) else q2

    def rates(self, t: float, state: Any) -> tuple[Any, ...]:
        """Time derivative of the state."""
        _, phi, omega1, dphi = state
        return (
            omega1,
            dphi,
            *mechanics.accelerations(self.machine, phi, dphi, omega1, *self.torques(t, state)),
        )

    def check(self, start: float, state: tuple[float, ...]) -> None:
        """Raise a `ParameterError` if it cannot start in a state."""
        with np.errstate(all="ignore"):
            rates = self.rates(start, np.array(state))[2:]  # Python's floats raise on overflow
        if not np.isfinite(rates).all():
            _, phi, omega1, dphi = state
            raise ParameterError(
                f"phi0, dphi0, omega1: got {phi!r}, {dphi!r}, {omega1!r}, where the accelerations "
                f"are {tuple(map(float, rates))}; wants a state in which they are finite: not a "
                "particle over the vertical axis on a support without inertia"
            )

    def derived(self, times: FloatArray, states: FloatArray) -> tuple[Any, ...]:
        """All that `DERIVED` names, along a motion."""
        pairs = zip(times.ravel(), states.reshape(4, -1).T, strict=True)
        torques = np.array([self.torques(t, tuple(state)) for t, state in pairs], dtype=float)
        torque1, torque2 = torques.T.reshape(2, *times.shape)
        _, phi, omega1, dphi = states
        now = (self.machine, phi, dphi, omega1)
        with np.errstate(all="ignore"):
            accelerations = mechanics.accelerations(*now, torque1, torque2)
        power = torque1 * omega1 + torque2 * dphi
        rest = (mechanics.energy(*now), mechanics.angular_momentum(*now))
        return (*accelerations, torque1, torque2, power, *rest)


def checked_torque(
    argument: str, value: Any, t: float, state: tuple[float, ...]
) -> float | StateFunction:
    """Return a torque as a number or a function that gives one at the initial state."""
    if value is None:
        return 0.0
    wants = "a torque in N m: a number, or a function of (t, phi1, phi, omega1, dphi)"
    if not callable(value):
        return checked_number(argument, value, wants)
    check_call(argument, value, wants)
    with np.errstate(all="ignore"):
        number = value(t, *np.array(state))
    known = is_whole(number) or isinstance(number, (float, np.floating))
    if not known or not np.isfinite(number):
        raise bad(f"{argument} at t = {t!r}", number, "a function that returns a finite number")
    function: StateFunction = value
    return function


def event_of(name: Any, event: Any, arguments: Sequence[str] = ARGUMENTS) -> Event:
    """Return an event of a function of time and state, which may bear attributes.

    These are SciPy's: `terminal`, and `direction`.
    """
    if not isinstance(name, str):
        raise bad("events", name, "names that are strings")
    wants = f"a function of ({', '.join(arguments)}), or a mapping of names to such"
    if not callable(event):
        raise bad("events", event, wants)
    check_call("events", event, wants, len(arguments))
    terminal, direction = getattr(event, "terminal", None), getattr(event, "direction", 0)
    try:
        count = 0 if terminal is None else int(terminal)
        if count < 0 or (terminal is not None and count != terminal):
            raise ValueError
        return Event(_numbers_of(name, event), count, float(direction))
    except (TypeError, ValueError):
        got = f"terminal = {describe(terminal)}, direction = {describe(direction)}"
        wants = "terminal of True, False or a count, and direction of 1, -1 or 0"
        raise ParameterError(f"events: got a function with {got}, wants {wants}") from None


def _numbers_of(name: str, event: Any) -> Callable[..., float]:
    """The function of an event, whose values are checked where it is asked."""

    def value(t: float, state: Any) -> float:
        found = event(t, *state)
        at, kind = f"events: {name!r} at t = {float(t)!r}", np.asarray(found).dtype.kind
        if kind == "b":
            hint = "it says yes or no: give a difference that changes its sign, such as phi - 1"
            raise bad(at, found, "a function whose zero is the event", hint)
        if kind not in "iuf" or np.ndim(found) or not np.isfinite(found):
            raise bad(at, found, "a function that returns one finite number")
        return float(found)

    return value


def checked_number(argument: str, value: Any, wants: str, *, low: float = -np.inf) -> float:
    """Return one finite number, at least `low`."""
    kept = number(argument, value, wants, UNITS_OF.get(argument, ""))
    if kept < low:
        raise bad(argument, value, wants)
    return kept


def check_call(
    argument: str, function: Callable[..., Any], wants: str, count: int = len(ARGUMENTS)
) -> None:
    """Raise a `ParameterError` unless a function takes so many arguments."""
    try:
        inspect.signature(function).bind(*range(count))
    except TypeError:
        raise bad(argument, function, wants, "its arguments do not fit") from None
    except ValueError:  # a builtin without signature
        return


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
