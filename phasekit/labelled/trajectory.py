"""Motions of the machine of two degrees of freedom: integration in time, events, sections."""

from __future__ import annotations

import inspect
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from typing import Any, TypeAlias

import numpy as np
import xarray as xr
from scipy.integrate import DOP853, OdeSolution, solve_ivp
from scipy.optimize import brentq

from phasekit.errors import ConvergenceError, ParameterError
from phasekit.labelled.arguments import FloatArray, NumberLike, bad, number, numeric
from phasekit.labelled.grid import variable
from phasekit.labelled.schema import LABEL_DTYPE
from phasekit.labelled.units import UNITS_OF
from phasekit.mechanics import two_degrees as mechanics
from phasekit.mechanics.two_degrees import TwoDegrees

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


@dataclass(frozen=True)
class Motion:
    """An initial-value problem: the machine, what drives it, and where it starts."""

    machine: TwoDegrees
    state: tuple[float, float, float, float]  # phi1, phi, omega1, dphi
    torque1: float | StateFunction
    torque2: float | StateFunction
    attrs: Mapping[str, str]
    coords: Mapping[str, xr.Variable]
    solver: Mapping[str, float]  # rtol, atol, max_step

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

    def check(self, start: float) -> Motion:
        """Return itself, if it can start: the integrator would not come back from NaN."""
        with np.errstate(all="ignore"):
            rates = self.rates(start, self.state)[2:]
        if not np.isfinite(rates).all():
            _, phi, omega1, dphi = self.state
            raise ParameterError(
                f"phi0, dphi0, omega1: got {phi!r}, {dphi!r}, {omega1!r}, where the accelerations "
                f"are {tuple(map(float, rates))}; wants a state in which they are finite: not a "
                "particle over the vertical axis on a support without inertia"
            )
        return self

    def derived(self, times: FloatArray, states: FloatArray) -> dict[str, Any]:
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
        return dict(zip(DERIVED, (*accelerations, torque1, torque2, power, *rest), strict=True))

    def dataset(self, times: FloatArray, states: FloatArray) -> xr.Dataset:
        """Labelled motion at times: an array on the dim `time`, or one instant without it."""
        dims = ("time",) * times.ndim
        values = {f"motion_{name}": x for name, x in zip(STATE, states, strict=True)}
        rows = {f"motion_{name}": row for name, row in STATE.items()} | DERIVED
        values |= self.derived(times, states)
        data = {name: labelled(dims, values[name], *rows[name]) for name in rows}
        time = variable(dims, times, {"long_name": "time", "units": "s"})
        return xr.Dataset(data, {"time": time, **self.coords}, dict(self.attrs))


def labelled(
    dims: tuple[str, ...], values: Any, units: str, long_name: str, equation: str
) -> xr.Variable:
    """Make a variable with the attributes that every result carries."""
    attrs = {"long_name": long_name, "units": units, "equation": equation, "source": LAGRANGE}
    return variable(dims, values, attrs)


@dataclass(frozen=True, eq=False, repr=False)
class Trajectory:
    """One motion, to be evaluated at any time between its ends.

    `FreeGyroRotor.trajectory` makes it. Between the steps of the integrator it is interpolated to
    the seventh order.

    Examples
    --------
    >>> import phasekit as pk
    >>> disk = pk.GyroRotorDisk(beta=1.0, e=0.1, a=0.05, r=0.1, omega1=6.0, m=2.0)
    >>> motion = pk.FreeGyroRotor(disk, 0.02).trajectory(0.5, 0.0, (0.0, 3.0))
    >>> motion
    Trajectory(0.0 s to 3.0 s, ... steps, 0 events)
    >>> motion([1.0, 2.0]).motion_phi.dims
    ('time',)
    """

    start: float
    """Time of the initial state, s."""
    stop: float
    """Time at which it ends, s: as asked for, or that of an event which ends it."""
    steps: FloatArray
    """Times of the integrator's steps, s."""
    events: xr.Dataset
    """On the dim ``event``: event_name, event_time and the state then."""
    _motion: Motion
    _solution: OdeSolution

    def __call__(self, t: NumberLike) -> xr.Dataset:
        """Motion at times, as `FreeGyroRotor.simulate` gives it.

        Parameters
        ----------
        t : float or 1-D array_like
            Times in s between start and stop, in any order.

        Raises
        ------
        ParameterError
            If a time lies outside.
        """
        kept = numeric("t", t, UNITS_OF["t"])
        times = np.asarray(kept.values if isinstance(kept, xr.DataArray) else kept)
        low, high = sorted((self.start, self.stop))
        if times.ndim > 1 or not np.all((times >= low) & (times <= high)):
            raise bad("t", t, f"one or a 1-D array of times from {low!r} s to {high!r} s")
        return self._motion.dataset(times, self._solution(times))

    def __repr__(self) -> str:
        """Write the span and what was found in it."""
        return (
            f"Trajectory({self.start!r} s to {self.stop!r} s, {self.steps.size - 1} steps, "
            f"{self.events.sizes['event']} events)"
        )


def trajectory(
    motion: Motion, start: float, stop: float, events: Mapping[str, StateFunction]
) -> Trajectory:
    """Integrate a motion, and find its events on the way.

    Raises
    ------
    ConvergenceError
        If the integrator cannot reach the end with the accuracy asked for.
    """
    found = [_scipy_event(event) for event in events.values()]
    with np.errstate(all="ignore"):
        result = solve_ivp(
            motion.rates,
            (start, stop),
            motion.state,
            method="DOP853",
            dense_output=True,
            events=found or None,
            **motion.solver,
        )
    if result.status < 0:
        raise _failed(result.t[-1], stop, result.message)
    times = result.t_events or []
    count = [len(found) for found in times]
    when = np.concatenate([*times, np.empty(0)])
    order = np.argsort(when if stop >= start else -when, kind="stable")
    states = result.sol(when[order]) if when.size else np.empty((4, 0))
    each = [name for name, n in zip(events, count, strict=True) for _ in range(n)]
    names = np.array([each[i] for i in order], LABEL_DTYPE)
    rows = {
        "event_time": ("s", "time of the event", "event = 0"),
        **{
            f"event_{name}": (u, f"{long} at the event", eq)
            for name, (u, long, eq) in STATE.items()
        },
    }
    data = {
        name: labelled(("event",), values, *rows[name])
        for name, values in zip(rows, (when[order], *states), strict=True)
    }
    name = variable(("event",), names, {"long_name": "name of the event"})
    happened = xr.Dataset({"event_name": name, **data}, motion.coords, dict(motion.attrs))
    return Trajectory(start, float(result.t[-1]), result.t, happened, motion, result.sol)


def _scipy_event(event: StateFunction) -> Callable[[float, Any], float]:
    def value(t: float, state: Any) -> float:
        return event(t, *state)

    for name in ("terminal", "direction"):
        if hasattr(event, name):
            setattr(value, name, getattr(event, name))
    return value


def _failed(t: float, stop: float, message: str) -> ConvergenceError:
    return ConvergenceError(
        f"the integrator stopped at t = {float(t)!r} s of {stop!r} s: {message} A torque without "
        "bound, or a particle over the vertical axis on a support without inertia, may be why; "
        "otherwise try a larger rtol"
    )


def strobe(motion: Motion, times: FloatArray) -> FloatArray:
    """States at times, in order and from 0 on; what lies between is not kept."""
    states = np.empty((4, times.size))
    states[:, 0] = motion.state
    done = 1
    for solver, _ in _steps(motion, float(times[-1])):
        upto = int(np.searchsorted(times, solver.t, side="right"))
        if upto > done:
            states[:, done:upto] = solver.dense_output()(times[done:upto])
            done = upto
    return states


def crossings(
    motion: Motion, stop: float, section: float, direction: int
) -> tuple[FloatArray, FloatArray]:
    """Times and states, from 0 to stop, where phi passes the section or a full turn off it.

    Every step is cut at its turning point, so that passages which lie closely together there are
    not lost.
    """
    times: list[float] = []
    states: list[Any] = []
    for solver, before in _steps(motion, stop):
        after = solver.y
        turns = before[3] * after[3] < 0.0
        if not turns and not any(True for _ in _passed(before[1], after[1], section, direction)):
            continue
        dense = solver.dense_output()
        nodes = [(solver.t_old, before[1]), (solver.t, after[1])]
        if turns:
            turn = _instant(dense, 3, 0.0, solver.t_old, solver.t)
            nodes.insert(1, (turn, dense(turn)[1]))
        for (t0, phi0), (t1, phi1) in zip(nodes[:-1], nodes[1:], strict=True):
            for level in _passed(phi0, phi1, section, direction):
                times.append(_instant(dense, 1, level, t0, t1))
                states.append(dense(times[-1]))
    return np.array(times), np.reshape(states, (-1, 4)).T


def _steps(motion: Motion, stop: float) -> Iterator[tuple[Any, Any]]:
    """Step from 0 to stop: the solver after each step, and the state before it."""
    solver = DOP853(motion.rates, 0.0, np.array(motion.state), stop, **motion.solver)
    while solver.status == "running":
        before = solver.y
        with np.errstate(all="ignore"):
            message = solver.step()
        if solver.status == "failed":
            raise _failed(solver.t, stop, message)
        yield solver, before


def _passed(phi0: float, phi1: float, section: float, direction: int) -> Iterator[float]:
    """Angles of the section that a piece of motion passes, its end included, its start not."""
    sense = 1 if phi1 >= phi0 else -1
    if direction * sense < 0:
        return
    turn = 2.0 * np.pi
    first = np.floor(sense * (phi0 - section) / turn) + 1
    last = np.floor(sense * (phi1 - section) / turn)
    for k in np.arange(first, last + 1):
        yield section + sense * k * turn


def _instant(dense: Any, place: int, value: float, low: float, high: float) -> float:
    """Time in a step at which one component of the state has a value.

    An end of the step, if rounding leaves the value just outside.
    """

    def excess(t: float) -> float:
        return float(dense(t)[place] - value)

    left, right = excess(low), excess(high)
    if left * right >= 0.0:
        return low if abs(left) < abs(right) else high
    found: float = brentq(excess, low, high, xtol=1e-15, rtol=4 * np.finfo(float).eps)
    return found


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
    number = value(t, *state)
    if not isinstance(number, (int, float, np.floating, np.integer)) or not np.isfinite(number):
        raise bad(f"{argument} at t = {t!r}", number, "a function that returns a finite number")
    function: StateFunction = value
    return function


def checked_number(argument: str, value: Any, wants: str, *, low: float = -np.inf) -> float:
    """Return one finite number, at least `low`."""
    kept = number(argument, value, wants, UNITS_OF.get(argument, ""))
    if kept < low:
        raise bad(argument, value, wants)
    return kept


def check_call(argument: str, function: Callable[..., Any], wants: str) -> None:
    """Raise a `ParameterError` unless a function takes (t, phi1, phi, omega1, dphi)."""
    try:
        inspect.signature(function).bind(*range(5))
    except TypeError:
        raise bad(argument, function, wants, "its arguments do not fit") from None
    except ValueError:  # a builtin without signature
        return
