"""Events on motions, labelled: zeros of formulas and functions on the way."""

from __future__ import annotations

import inspect
from collections.abc import Callable, Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np
import xarray as xr

from phasekit.arrays import Array
from phasekit.labelled.crossings import Motions, motions_in_cells
from phasekit.labels.arguments import bad, list_names
from phasekit.labels.grid import LABEL_DTYPE, variable
from phasekit.laws.equations import Equations
from phasekit.laws.formulas import take_formula
from phasekit.laws.ladder import Map
from phasekit.motion.crossings import Crossing, crossings, symbols_here
from phasekit.motion.equation_rates import pointwise
from phasekit.motion.events import Event
from phasekit.motion.integrate import integrate
from phasekit.motion.method import unit_of
from phasekit.motion.prescribed import span
from phasekit.motion.steps import InitialValue
from phasekit.numerics.waits import stage
from phasekit.systems.driven_rotor import event_of
from phasekit.systems.system import System

ARGUMENTS = ("t", "phi", "dphi")


class Watched(NamedTuple):
    """An event that is looked for."""

    name: str
    what: Any
    """A formula, or a function of (t, x)."""
    terminal: int
    direction: float

    @property
    def is_formula(self) -> bool:
        """Whether it is a formula."""
        return hasattr(self.what, "free_symbols")


#: Events of one motion in time: name, time and state of each.
Occurred = list[tuple[str, float, Array]]


def watched_of(law: Equations, events: Any) -> list[Watched]:
    """Events of formulas, or of functions of (t, x), by name."""
    if isinstance(law, Map):
        raise bad("events", events, "nothing for a map, whose states are between no times")
    return _watched(law, events, lambda name, event: _called(law, name, event))


def events_of_equations(
    ds: xr.Dataset, law: Equations, system: System, x0: Any, named: Mapping[str, Any],
    watched: Sequence[Watched], tolerances: Mapping[str, Any],
) -> xr.Dataset:  # fmt: skip
    """Add the events on motions of equations, and end motions where they say so."""
    motions = motions_in_cells(system, law, x0, named, law.names)
    if all(one.is_formula for one in watched):
        found, ends = _by_formulas(law, motions, watched, _span(ds), tolerances)
    else:

        def problem(k: int, stop: float) -> InitialValue:
            values = {name: float(own[k]) for name, own in motions.values.items()}
            start = motions.states[k].tolist()
            return InitialValue(pointwise(law, values), start, **tolerances, unit=np.inf)

        found, ends = _one_by_one(law, motions, watched, _span(ds), problem)
    names = {name: (f"motion_{name}", f"event_{name}") for name in law.states}
    return _with_events(ds, motions, found, ends, names)


def with_events(
    ds: xr.Dataset, system: System, events: Any, tolerances: Mapping[str, Any]
) -> xr.Dataset:
    """Add the events on damped and driven motions, and end motions where they say so."""
    law: Any = system.law
    moved: Any = system
    prescribed = getattr(system, "omega1", None) is not None
    equations = Equations(("phi", "dphi"), tuple(law.names), None)
    if not prescribed:
        equations = moved.equations()
    start = {"phi": ds.state_phi, "dphi": ds.state_dphi}
    x = system.coordinate or "phi"
    watched = _watched(
        equations, events, lambda name, event: event_of(name, event, ARGUMENTS),
        {x: "phi", f"d{x}": "dphi"},
    )  # fmt: skip
    motions = motions_in_cells(system, equations, start, {}, tuple(system.parameters))
    if not prescribed and all(one.is_formula for one in watched):
        found, ends = _by_formulas(equations, motions, watched, _span(ds), tolerances)
    else:

        def initial(k: int, stop: float) -> InitialValue:
            own = law.values(*(float(motions.values[name][k]) for name in system.parameters))
            rates = pointwise(law, own, stop)
            return InitialValue(rates, motions.states[k], **tolerances, unit=unit_of(law))

        found, ends = _one_by_one(equations, motions, watched, _span(ds), initial)
    names = {name: (f"motion_{name}", f"event_{name}") for name in ("phi", "dphi")}
    return _with_events(ds, motions, found, ends, names)


def _span(ds: xr.Dataset) -> tuple[float, float]:
    return span(ds.time.values)


def _watched(
    law: Equations, events: Any, called: Callable[[str, Any], Event],
    other: Mapping[str, str] | None = None,
) -> list[Watched]:  # fmt: skip
    """Events by name, whose formulas are read and whose functions are checked."""
    if isinstance(events, (list, tuple, set)):
        wants = "a formula, a function of (t, x), or a mapping of names to these"
        raise bad("events", events, wants, f"such as {{'up': '{law.states[0]} - 1'}}")
    named = events if isinstance(events, Mapping) else {"event": events}
    symbols, clock = symbols_here(law.states, law.names, law.time)
    for alias, name in (other or {}).items():
        symbols.setdefault(alias, symbols[name])
    found = []
    for name, event in named.items():
        if not isinstance(name, str):
            raise bad("events", name, "names that are strings")
        given = event.function if isinstance(event, Event) else event
        if isinstance(given, str) or hasattr(given, "free_symbols"):
            argument = f"events[{name!r}]"
            known = {**symbols, str(clock): clock}
            formula = take_formula(given, known, argument, "it is no state and no parameter")
            own = event if isinstance(event, Event) else Event(given)
            found.append(Watched(name, formula, int(own.terminal), float(own.direction)))
            continue
        own = event if isinstance(event, Event) else called(name, event)
        found.append(Watched(name, own.function, int(own.terminal), float(own.direction)))
    return found


def _called(law: Equations, name: str, given: Any) -> Event:
    """The event of a function of (t, x)."""
    argument = f"events[{name!r}]"
    if not callable(given):
        wants = "a formula of the states, or a function of (t, x), whose zeros are looked for"
        raise bad(argument, given, wants)
    count = sum(
        one.default is one.empty and one.kind in (one.POSITIONAL_ONLY, one.POSITIONAL_OR_KEYWORD)
        for one in inspect.signature(given).parameters.values()
    )
    if count != 2:
        raise bad(argument, given, f"a function of (t, x), x holding {list_names(law.states)}")
    terminal, direction = getattr(given, "terminal", 0), getattr(given, "direction", 0)
    return Event(lambda t, x: float(given(t, x)), int(terminal), float(direction))


def _by_formulas(
    law: Equations, motions: Motions, watched: Sequence[Watched], ends: tuple[float, float],
    tolerances: Mapping[str, Any],
) -> tuple[list[Occurred], Array]:  # fmt: skip
    """Events of formulas, of all motions at once, and when each motion ends either way."""
    count = len(motions.states)
    functions = [
        Crossing(
            one.what, int(np.sign(one.direction)), one.terminal, touches=one.direction == 0.0
        )
        for one in watched
    ]  # fmt: skip
    found: list[Occurred] = [[] for _ in range(count)]
    stops = np.tile(ends, (count, 1)).astype(float)
    for way, stop in enumerate(ends):
        if stop == 0.0:
            continue
        times = np.tile([0.0, stop], (count, 1))
        on = np.full(count, -2)
        part = crossings(
            law, motions.values, motions.states, times, functions, on=on, **tolerances
        )  # fmt: skip
        for k in range(count):
            number = int((part.which[k] >= 0).sum())
            own = [
                (watched[part.which[k, i]].name, float(part.time[k, i]), part.state[k, i])
                for i in range(number)
            ]
            last = watched[part.which[k, number - 1]] if number else None
            if last is not None and 0 < last.terminal == sum(n == last.name for n, *_ in own):
                stops[k, way] = own[-1][1]
            found[k] = _both_ways(found[k], own, stop)
    return found, stops


def _both_ways(before: Occurred, own: Occurred, stop: float) -> Occurred:
    """Events in time, of those before the start and those after it; one at the start once."""
    if stop < 0.0:
        return own[::-1]
    return before + [one for one in own if one[1] > 0.0 or not before]


def _one_by_one(
    law: Equations, motions: Motions, watched: Sequence[Watched], ends: tuple[float, float],
    problem: Callable[[int, float], InitialValue],
) -> tuple[list[Occurred], Array]:  # fmt: skip
    """The same where an event is a function: motion by motion."""
    import sympy as sp

    symbols, clock = symbols_here(law.states, law.names, law.time)
    count = len(motions.states)
    found: list[Occurred] = []
    stops = np.tile(ends, (count, 1)).astype(float)
    states = [symbols[name] for name in law.states]
    for k in range(count):
        own: Occurred = []
        functions = {}
        for one in watched:
            function = one.what
            if one.is_formula:
                fixed = {
                    symbols[name]: sp.Float(float(motions.values[name][k]), 17)
                    for name in law.names
                }
                function = sp.lambdify([clock, states], one.what.subs(fixed), "numpy")
            functions[one.name] = Event(function, one.terminal, one.direction)
        for way, stop in enumerate(ends):
            if stop == 0.0:
                continue
            motion = integrate(problem(k, stop), stop, functions)
            events = motion.events
            rows = list(zip(events.name, events.time.tolist(), events.state.T, strict=True))
            own = _both_ways(own, rows, stop)
            stops[k, way] = motion.times[-1]
        found.append(own)
        stage(f"{k + 1:,} of {count:,} motions")
    return found, stops


def _with_events(
    ds: xr.Dataset, motions: Motions, found: Sequence[Occurred], ends: Array,
    names: Mapping[str, tuple[str, str]],
) -> xr.Dataset:  # fmt: skip
    """Motions with their events, NaN after those that end them."""
    dims = motions.dims
    low, high = (xr.DataArray(motions.laid(ends[:, i]), dims=dims) for i in range(2))
    there = (ds.time >= low) & (ds.time <= high) | ~np.isfinite(ds.time)
    changed = {}
    for motion in [str(name) for name in ds.data_vars if str(name).startswith("motion_")]:
        kept = ds[motion].where(there).transpose(*ds[motion].dims)
        changed[motion] = ds[motion].copy(data=kept.values)
    ds = ds.assign(changed)
    width = max(map(len, found), default=0)
    labels = np.full((len(found), width), "", LABEL_DTYPE)
    times = np.full((len(found), width), np.nan)
    states = np.full((len(found), width, len(names)), np.nan)
    for k, own in enumerate(found):
        for i, (name, time, state) in enumerate(own):
            labels[k, i], times[k, i], states[k, i] = name, time, state
    on = (*dims, "event")
    ds["event_name"] = variable(on, motions.laid(labels), {"long_name": "name of the event"})
    attrs = {**ds.time.attrs, "long_name": "time of the event", "equation": "event = 0"}
    ds["event_time"] = variable(on, motions.laid(times), attrs)
    for i, (motion, event) in enumerate(names.values()):
        words = {**ds[motion].attrs, "equation": "event = 0"}
        words["long_name"] = f"{words['long_name']} at the event"
        if motion not in ("motion_phi", "motion_dphi"):
            words["long_name"] = f"{event.removeprefix('event_')} at the event"
        ds[event] = variable(on, motions.laid(states[..., i]), words)
    if dims:
        numbers = np.array([len(own) for own in found], np.int64)
        ds["n_events"] = variable(dims, motions.laid(numbers), {"long_name": "number of events"})
    return ds
