"""Motions of systems with states of their own, labelled: flows and maps of any number of states."""

from __future__ import annotations

import functools
import inspect
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import xarray as xr

from phasekit.cells.states import at_states
from phasekit.labels.arguments import bad, numeric, one_of, unknown, whole
from phasekit.labels.coordinates import LABELS, STATES
from phasekit.labels.grid import LABEL_DTYPE, variable
from phasekit.laws.equations import Equations
from phasekit.laws.formulas import symbols_of, take_formula
from phasekit.laws.ladder import Flow, Law, Map
from phasekit.motion import flows
from phasekit.motion.equation_rates import pointwise
from phasekit.motion.events import Event
from phasekit.motion.integrate import Solution, integrate
from phasekit.motion.prescribed import span
from phasekit.motion.steps import InitialValue
from phasekit.numerics.waits import said
from phasekit.systems.system import System
from phasekit.table.row import Pass, Quantity

#: Methods of integration by name.
METHODS = ("taylor", "dop853", "radau")


def rung_of(law: Equations) -> type[Law]:
    """The rung of equations."""
    return Map if isinstance(law, Map) else Flow


def states_of(law: Equations, x0: Any, named: Mapping[str, Any]) -> dict[str, tuple[str, Any]]:
    """States at the start by name, from one argument or one for each.

    Parameters
    ----------
    law : Equations
        The law.
    x0 : mapping, sequence or xarray.DataArray
        All states, by name or in their order; a number for one state. None where they are named.
    named : mapping
        Arguments by name: ``v``, or ``v0``.

    Returns
    -------
    dict
        For `at_states`: (name, value) by the name that messages give it.

    Raises
    ------
    ParameterError
        If a state is missing, given twice, or unknown.
    """
    given: dict[str, Any] = {}
    for argument, value in named.items():
        name = argument if argument in law.states else argument.removesuffix("0")
        if name not in law.states:
            raise unknown("state", argument, law.states)
        given[name] = value
    if x0 is not None:
        if given:
            raise bad("x0", x0, f"None beside {', '.join(named)}")
        given = _spread(law, x0)
    missing = [name for name in law.states if name not in given]
    if missing:
        raise bad("x0", list(given), f"a value for {', '.join(missing)} as well")
    return {name: (f"state_{name}", given[name]) for name in law.states}


def _spread(law: Equations, x0: Any) -> dict[str, Any]:
    n, wants = len(law.states), f"a value for each of {', '.join(law.states)}"
    if isinstance(x0, Mapping) or isinstance(x0, xr.Dataset):
        for name in x0:
            if name not in law.states:
                raise unknown("x0: state", name, law.states)
        return {str(name): x0[name] for name in x0}
    if isinstance(x0, xr.DataArray) and "state" in x0.dims:
        names = [str(name) for name in x0["state"].values] if "state" in x0.coords else law.states
        if sorted(names) != sorted(law.states) or x0.sizes["state"] != n:
            raise bad("x0", list(names), wants)
        return {name: x0.isel(state=i, drop=True) for i, name in enumerate(names)}
    if n == 1 and not (isinstance(x0, (list, tuple)) and len(x0) == 1):
        return {law.states[0]: x0}
    try:
        parts = list(x0)
    except TypeError:
        raise bad("x0", x0, wants) from None
    if len(parts) != n:
        raise bad("x0", x0, wants, f"it has {len(parts)}")
    return dict(zip(law.states, parts, strict=True))


def motions_of(
    system: System, law: Equations, x0: Any, named: Mapping[str, Any], t: Any, *,
    tolerances: Mapping[str, float], method: str | None = None, events: Any = None,
) -> xr.Dataset:  # fmt: skip
    """States of motions at times, of maps after so many steps.

    Raises
    ------
    ParameterError
        If an argument is unusable.
    """
    if t is None:
        raise bad("t", None, "times, or counts of iterations of a map")
    if method is not None:
        one_of("method", method, METHODS)
    discrete = isinstance(law, Map)
    if discrete and events is not None:
        raise bad("events", events, "nothing for a map, whose states are between no times")
    if discrete and method is not None:
        raise bad("method", method, "nothing for a map, which is not integrated")
    refuse_force(system)
    rows = [_row(law, name) for name in law.states]
    options = {**tolerances, **({} if discrete else {"method": method})}
    states = {**states_of(law, x0, named), "t": ("time", t)}
    inputs = tuple(name for name, _ in states.values())
    one = Pass(
        functools.partial(_move, law, **options), (*law.names, *inputs), ("flow",), rung_of(law)
    )
    with said("following motions"):
        ds = at_states(system, rows, states, (one,))
    if discrete:
        ds.time.attrs = {"long_name": "number of iterations", "units": "1"}
    ds = with_starts(ds, law, inputs)
    return ds if events is None else _with_events(ds, law, system, events, tolerances)


def refuse_force(system: Any) -> None:
    """Refuse a force alone, of which nothing moves.

    Raises
    ------
    ParameterError
    """
    if getattr(system, "conservative", False) and len(system.state) == 1:
        x = system.state[0]
        raise bad(
            "system", system, "rates of all states; this one states a force alone",
            f"state ({x}, d{x}) with conservative=True: pk.Problem.from_potential does",
        )  # fmt: skip


def _move(law: Equations, *arrays: Any, **options: Any) -> Any:
    found = flows.flow(law, *arrays, **options)
    return dict(zip([f"motion_{name}" for name in law.states], found, strict=True))


def _row(law: Equations, name: str) -> Quantity:
    arrow = f"{name} -> f({name}, ...)" if isinstance(law, Map) else f"{name}' = f({name}, ...)"
    if isinstance(law.f, tuple):
        formula = str(law.f[law.states.index(name)])
        arrow = arrow.split("f(", 1)[0] + (formula if len(formula) < 200 else f"f({name}, ...)")
    return Quantity(
        f"motion_{name}", "flow", (), "float64", law.units.get(name, "1"),
        f"{name} along the motion", arrow, "[HairerNorsettWanner1993]", of=rung_of(law),
    )  # fmt: skip


def with_starts(ds: xr.Dataset, law: Equations, inputs: Sequence[str]) -> xr.Dataset:
    """Say of coordinates which states they are."""
    coords = {}
    for name in inputs:
        if name not in STATES:
            own = name.removeprefix("state_")
            attrs = {"long_name": f"{own} at the start", "units": law.units.get(own, "1")}
            given = ds[name].variable
            coords[name] = variable(map(str, given.dims), given.data, attrs)
    return ds.assign_coords(coords)


def _with_events(
    ds: xr.Dataset, law: Equations, system: Any, events: Any, tolerances: Mapping[str, float]
) -> xr.Dataset:
    """Add the events on one motion, and end it where they say so."""
    named = events if isinstance(events, Mapping) else {"event": events}
    starts = [ds[f"state_{name}"] for name in law.states]
    if any(start.ndim for start in starts) or any(np.ndim(ds[name]) for name in law.names):
        raise bad("events", list(named), "nothing, or one motion: a single state and system")
    values = {name: float(ds[name]) for name in law.names}
    watched = {name: _event(law, values, name, event) for name, event in named.items()}
    rates = pointwise(law, values)
    start = [float(one) for one in starts]
    data = {name: ds[f"motion_{name}"].values.copy() for name in law.states}
    found: list[tuple[str, float, Any]] = []
    for stop in span(ds.time.values):
        if stop == 0.0:
            continue
        motion = motion_of(rates, start, stop, tolerances, watched)
        own = list(zip(motion.events.name, motion.events.time, motion.events.state.T, strict=True))
        found = own[::-1] if stop < 0.0 else found + [e for e in own if e[1] > 0.0 or not found]
        beyond = np.sign(stop) * (ds.time.values - motion.times[-1]) > 0.0
        for array in data.values():
            array[beyond] = np.nan
    ds = ds.assign({f"motion_{n}": ds[f"motion_{n}"].copy(data=x) for n, x in data.items()})
    names = np.array([name for name, *_ in found], LABEL_DTYPE)
    ds["event_name"] = variable(("event",), names, {"long_name": "name of the event"})
    times = np.array([time for _, time, _ in found], float)
    attrs = {**ds.time.attrs, "long_name": "time of the event", "equation": "event = 0"}
    ds["event_time"] = variable(("event",), times, attrs)
    columns = np.reshape([state for *_, state in found], (-1, len(law.states))).T
    for name, column in zip(law.states, columns, strict=True):
        words = {**ds[f"motion_{name}"].attrs, "long_name": f"{name} at the event"}
        ds[f"event_{name}"] = variable(("event",), column, {**words, "equation": "event = 0"})
    return ds


def motion_of(
    rates: Any, start: Sequence[float], stop: float, tolerances: Mapping[str, Any],
    watched: Mapping[str, Event] | None = None,
) -> Solution:  # fmt: skip
    """One motion of rates, with events."""
    return integrate(InitialValue(rates, start, **tolerances, unit=np.inf), stop, watched)


def _event(law: Equations, values: Mapping[str, float], name: str, given: Any) -> Event:
    """The event of a formula of states, parameters and time, or of a function of (t, x)."""
    argument = f"events[{name!r}]"
    if isinstance(given, Event):
        return given
    if isinstance(given, str) or hasattr(given, "free_symbols"):
        return Event(scalar_of(law, values, argument, given))
    if not callable(given):
        wants = "a formula of the states, or a function of (t, x), whose zeros are looked for"
        raise bad(argument, given, wants)
    count = sum(
        one.default is one.empty and one.kind in (one.POSITIONAL_ONLY, one.POSITIONAL_OR_KEYWORD)
        for one in inspect.signature(given).parameters.values()
    )
    if count != 2:
        raise bad(argument, given, f"a function of (t, x), x holding {', '.join(law.states)}")
    terminal, direction = getattr(given, "terminal", 0), getattr(given, "direction", 0)
    return Event(lambda t, x: float(given(t, x)), int(terminal), float(direction))


def scalar_of(law: Equations, values: Mapping[str, float], argument: str, given: Any) -> Any:
    """A formula of states, parameters and time as a function of (t, x)."""
    import sympy as sp

    clock = law.time or "t"
    names = [*law.states, *law.names, *([] if clock in (*law.states, *law.names) else [clock])]
    symbols = symbols_of(names)
    formula = take_formula(given, symbols, argument, "it is no state and no parameter")
    states = [symbols[name] for name in law.states]
    fixed = {symbols[name]: sp.Float(value, 17) for name, value in values.items()}
    time = symbols.get(clock, sp.Dummy())
    function = sp.lambdify([time, states], formula.subs(fixed), "numpy")
    return lambda t, x: function(t, x)


def exponents_of(
    system: System, law: Equations, x0: Any, named: Mapping[str, Any],
    duration: tuple[str, Any], n: Any, count: int | None, tolerances: Mapping[str, float],
) -> xr.Dataset:  # fmt: skip
    """Lyapunov exponents of motions of a flow, or of the orbits of a map.

    Raises
    ------
    ParameterError
        If an argument is unusable.
    """
    discrete, states = isinstance(law, Map), len(law.states)
    called, length = ("n", n) if discrete else duration
    other, given = duration if discrete else ("n", n)
    if given is not None:
        raise bad(other, given, f"None, but {called}= for {'a map' if discrete else 'a flow'}")
    wants = "whole numbers of iterations, >= 100" if discrete else "times > 0"
    if length is None:
        raise bad(called, length, wants)
    numbers = np.asarray(numeric(called, length, None, wants))
    if np.any(numbers < 100 if discrete else numbers <= 0.0):
        raise bad(called, length, wants)
    if discrete and np.any(numbers != np.rint(numbers)):
        raise bad(called, length, wants)
    most = f"a whole number from 1 to {states}"
    count = states if count is None else whole("count", count, most)
    if count > states:
        raise bad("count", count, most)
    refuse_force(system)
    labels = {**LABELS, "exponent": (range(1, count + 1), LABELS["exponent"][1])}
    per = "of an iteration" if discrete else "of the motion"
    about = {
        "lyapunov_exponent": (f"Lyapunov exponent {per}, the largest first", ("exponent",)),
        "lyapunov_error": ("estimated error of the Lyapunov exponent", ("exponent",)),
        "lyapunov_sum": ("sum of all Lyapunov exponents", ()),
        "lyapunov_dimension": ("Kaplan and Yorke's dimension", ()),
    }
    rows = [
        Quantity(
            name, "exponents", dims, "float64", "1", text, "mean growth of log|u|, u' = f_x u",
            "[BenettinGalganiGiorgilliStrelcyn1980]", of=rung_of(law), labels=labels,
        )
        for name, (text, dims) in about.items()
    ]  # fmt: skip
    at = {**states_of(law, x0, named), called: ("time", length)}
    inputs = tuple(name for name, _ in at.values())
    function = functools.partial(_exponents, law, count=count, **tolerances)
    one = Pass(function, (*law.names, *inputs), ("exponents",), rung_of(law))
    with said("following motions and their tangent vectors"):
        ds = at_states(system, rows, at, (one,))
    if discrete:
        ds.time.attrs = {"long_name": "number of iterations", "units": "1"}
    return with_starts(ds, law, inputs)


def _exponents(law: Equations, *arrays: Any, **options: Any) -> Any:
    from phasekit.motion.exponents import exponents

    return exponents(law, *arrays, **options)


def sections_of(
    system: System, law: Equations, x0: Any, named: Mapping[str, Any], n: int, skip: int,
    period: float | None, tolerances: Mapping[str, float],
) -> xr.Dataset:  # fmt: skip
    """States of a forced flow once a period, or of any flow after equal times.

    Raises
    ------
    ParameterError
        If the system is a map, or has no period and none is given.
    """
    if isinstance(law, Map):
        raise bad("system", system, "a flow: pk.flow gives the iterates of a map")
    if period is None and law.period is None:
        raise bad("period", None, "a time > 0", "nothing in the system has a period of its own")
    labels = {**LABELS, "crossing": (range(skip, skip + n), "number of the period")}
    about = {"section_time": ("time of the crossing", "1")}
    about |= {f"section_{x}": (f"{x} in the section", law.units.get(x, "1")) for x in law.states}
    rows = [
        Quantity(
            name, "sections", ("crossing",), "float64", units, text, "x(n T)",
            "[GuckenheimerHolmes1983] section 1.5", of=Flow, labels=labels,
        )
        for name, (text, units) in about.items()
    ]  # fmt: skip
    at = states_of(law, x0, named)
    inputs = tuple(name for name, _ in at.values())
    function = functools.partial(flows.sections, law, n=n, skip=skip, period=period, **tolerances)
    one = Pass(function, (*law.names, *inputs), ("sections",), Flow)
    with said(f"following motions for {skip + n:,} periods"):
        return with_starts(at_states(system, rows, at, (one,)), law, inputs)
