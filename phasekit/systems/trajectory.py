"""Motions in time, labelled: the motion itself, its events, its sections."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, TypeAlias

import numpy as np
import xarray as xr

from phasekit.labels.arguments import FloatArray, NumberLike, bad, numeric
from phasekit.labels.grid import LABEL_DTYPE, variable
from phasekit.labels.units import UNITS_OF
from phasekit.motion.events import Event
from phasekit.motion.integrate import Occurrences, integrate
from phasekit.motion.sections import Section
from phasekit.motion.steps import InitialValue

if TYPE_CHECKING:
    from scipy.integrate import OdeSolution

#: Units, long_name and equation of a variable.
Row: TypeAlias = tuple[str, str, str]


@dataclass(frozen=True)
class Labels:
    """What is written on the motions of one system."""

    state: Mapping[str, Row]
    """Components of the state by name, in their order."""
    derived: Mapping[str, Row]
    """What follows from time and state."""
    derive: Callable[[FloatArray, FloatArray], Iterable[Any]]
    """Computes that at times, from states of shape (n, *times.shape)."""
    source: str
    attrs: Mapping[str, str]
    coords: Mapping[str, xr.Variable]

    def motion(self, times: FloatArray, states: FloatArray) -> xr.Dataset:
        """Motion at times: an array on the dim `time`, or one instant without it."""
        dims = ("time",) * times.ndim
        rows = {**{f"motion_{name}": row for name, row in self.state.items()}, **self.derived}
        values = (*states, *self.derive(times, states))
        data = self._variables(dims, rows, values)
        time = variable(dims, times, {"long_name": "time", "units": "s"})
        return xr.Dataset(data, {"time": time, **self.coords}, dict(self.attrs))

    def events(self, found: Occurrences) -> xr.Dataset:
        """Events on the dim `event`: name, time and the state then."""
        rows = {"event_time": ("s", "time of the event", "event = 0")}
        for name, (units, long_name, equation) in self.state.items():
            rows[f"event_{name}"] = units, f"{long_name} at the event", equation
        names = np.array(found.name, LABEL_DTYPE)
        named = variable(("event",), names, {"long_name": "name of the event"})
        data = self._variables(("event",), rows, (found.time, *found.state))
        return xr.Dataset({"event_name": named, **data}, self.coords, dict(self.attrs))

    def section(self, found: Section, equation: str) -> xr.Dataset:
        """Section on the dim `crossing`: times and states."""
        rows = {"section_time": ("s", "time of the crossing", equation)}
        for name, (units, long_name, rate) in self.state.items():
            rows[f"section_{name}"] = units, f"{long_name} in the section", rate
        data = self._variables(("crossing",), rows, (found.time, *found.state))
        return xr.Dataset(data, self.coords, dict(self.attrs))

    def _variables(
        self, dims: tuple[str, ...], rows: Mapping[str, Row], values: Iterable[Any]
    ) -> dict[str, xr.Variable]:
        data = {}
        for (name, (units, long_name, equation)), array in zip(rows.items(), values, strict=True):
            attrs = {"long_name": long_name, "units": units, "equation": equation}
            data[name] = variable(dims, array, {**attrs, "source": self.source})
        return data


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
    _labels: Labels
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
        return self._labels.motion(times, self._solution(times))

    def __repr__(self) -> str:
        """Write the span and what was found in it."""
        return (
            f"Trajectory({self.start!r} s to {self.stop!r} s, {self.steps.size - 1} steps, "
            f"{self.events.sizes['event']} events)"
        )


def trajectory(
    labels: Labels, problem: InitialValue, stop: float, events: Mapping[str, Event]
) -> Trajectory:
    """Integrate a motion, and find its events on the way.

    Raises
    ------
    ConvergenceError
        If the integrator cannot reach the end with the accuracy asked for.
    """
    found = integrate(problem, stop, events)
    times = found.times
    happened = labels.events(found.events)
    return Trajectory(problem.start, float(times[-1]), times, happened, labels, found.state)
