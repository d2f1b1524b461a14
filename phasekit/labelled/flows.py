"""Motions of systems with states of their own, labelled: flows and maps of any number of states."""

from __future__ import annotations

import functools
import inspect
from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import Any

import numpy as np
import xarray as xr

from phasekit.cells.equations import start_of
from phasekit.cells.states import at_states
from phasekit.errors import ParameterError
from phasekit.inputs import refuse_call
from phasekit.labels.arguments import (
    FloatArray,
    bad,
    list_names,
    number,
    numeric,
    one_of,
    unknown,
    whole,
)
from phasekit.labels.coordinates import LABELS, STATES
from phasekit.labels.grid import variable
from phasekit.laws.equations import Equations
from phasekit.laws.formulas import symbols_of
from phasekit.laws.ladder import Flow, Law, Map
from phasekit.motion import flows
from phasekit.numerics.waits import notice
from phasekit.spellings import argument_meant
from phasekit.systems.system import System
from phasekit.table.row import Pass, Quantity

#: Methods of integration by name.
METHODS = ("taylor", "dop853", "rosenbrock", "radau")


def rung_of(law: Equations) -> type[Law]:
    """The rung of equations."""
    return Map if isinstance(law, Map) else Flow


def states_of(
    law: Equations, x0: Any, named: Mapping[str, Any], besides: str = "", argument: str = "x0"
) -> dict[str, tuple[str, Any]]:
    """States at the start by name, from one argument or one for each, others as the law has them.

    ``x0`` has all states, by name or in their order, or a number for one state; ``named`` are
    arguments, ``v`` or ``v0``; ``besides`` is what else is missing, so that all of it is said at
    once; ``argument`` is what errors call ``x0``. Returns what `at_states` takes.
    """
    given: dict[str, Any] = {}
    for key, value in named.items():
        name = key if key in law.states else key.removesuffix("0")
        if name not in law.states:
            text = str(unknown("state", key, law.states))
            way = f"; it is a parameter: system.replace({key}=...)"
            raise ParameterError(text + (way if key in law.names else ""))
        given[name] = value
    if x0 is not None:
        if given:
            raise bad(argument, x0, f"None beside {', '.join(named)}")
        given = _spread(law, x0, argument)
    given = {**law.start, **given}
    missing = [name for name in law.states if name not in given]
    if missing:
        more = f"; and {besides}" if besides else ""
        raise bad(argument, list(given), f"a value for {', '.join(missing)} as well{more}")
    return {name: (f"state_{name}", given[name]) for name in law.states}


def steps_of(path: Mapping[str, Any], declared: Mapping[str, Any]) -> dict[str, FloatArray]:
    """The parameters of a path as arrays of one length; numbers stand still.

    As they are declared, or None of parameters of any value.
    """
    kept: dict[str, FloatArray] = {}
    for name, value in path.items():
        own = declared[name]
        wants = f"a 1-D array, each value {own.wants}" if own else "a 1-D array of finite values"
        array = np.asarray(numeric(name, value, own.units if own else None, wants), float)
        if array.ndim > 1 or not (own.valid(array) if own else np.isfinite(array)).all():
            raise bad(name, value, wants)
        kept[name] = array
    sizes = {name: array.size for name, array in kept.items() if array.ndim}
    if len(set(sizes.values())) != 1:
        if not sizes:
            raise bad("path", path, "a 1-D array of at least one parameter")
        got = ", ".join(f"{n} values of {name}" for name, n in sizes.items())
        raise ParameterError(f"path: got {got}, wants 1-D arrays of one length")
    (size,) = set(sizes.values())
    return {name: np.array(np.broadcast_to(array, size)) for name, array in kept.items()}


def starts_of(
    system: System, x0: Any, named: Mapping[str, Any], first: Any, second: Any
) -> tuple[Any, Mapping[str, Any]]:
    """All states in one, and those by name, of a call that may have phi0 and dphi0 in their place.

    Of a system with terms these are two of its states, beside those of the terms.
    """
    if x0 is not None or second is None:
        return (first if x0 is None else x0), named
    if system.standing.traits is None:
        return [first, second], named
    return None, {"phi": first, "dphi": second, **named}


def refuse_keywords(function: Any, law: Equations, named: Iterable[str]) -> None:
    """Refuse keywords that are no states, and near to an argument of a function."""
    known = {*law.states, *(f"{name}0" for name in law.states)}
    if strange := [name for name in named if name not in known]:
        expected = inspect.signature(function).parameters
        refuse_call(function, [name for name in strange if argument_meant(name, expected)])


def start_state(law: Equations, x0: Any) -> FloatArray:
    """One state in the order of the states; without one where motions start, as `start_of` says.

    Raises
    ------
    ParameterError
        If a state is missing or unknown, or there is none.
    """
    if x0 is None:
        missing = [name for name in law.states if name not in {**law.window, **law.start}]
        if missing:
            raise bad("x0", None, f"a state, or a window of {', '.join(missing)}")
        return np.array([start_of(law, name) for name in law.states])
    given = states_of(law, x0, {}).items()
    return np.array([number(f"x0[{name!r}]", value) for name, (_, value) in given])


def _spread(law: Equations, x0: Any, argument: str = "x0") -> dict[str, Any]:
    n, wants = len(law.states), f"a value for each of {list_names(law.states)}"
    if isinstance(x0, Mapping) or isinstance(x0, xr.Dataset):
        for name in x0:
            if name not in law.states:
                raise unknown(f"{argument}: state", name, law.states)
        return {str(name): x0[name] for name in x0}
    if isinstance(x0, xr.DataArray) and "state" in x0.dims:
        names = [str(name) for name in x0["state"].values] if "state" in x0.coords else law.states
        if sorted(names) != sorted(law.states) or x0.sizes["state"] != n:
            raise bad(argument, list(names), wants)
        return {name: x0.isel(state=i, drop=True) for i, name in enumerate(names)}
    if n == 1 and not (isinstance(x0, (list, tuple)) and len(x0) == 1):
        return {law.states[0]: x0}
    try:
        parts = list(x0)
    except TypeError:
        raise bad(argument, x0, wants) from None
    if len(parts) != n:
        raise bad(argument, x0, wants, f"it has {len(parts)}")
    return dict(zip(law.states, parts, strict=True))


def motions_of(
    system: System, law: Equations, x0: Any, named: Mapping[str, Any], t: Any, *,
    tolerances: Mapping[str, float], method: str | None = None,
) -> xr.Dataset:  # fmt: skip
    """States of motions at times, of maps after so many steps."""
    if t is None:
        wants = "times, or counts of iterations of a map"
        states_of(law, x0, named, f"t: got None, wants {wants}")
        raise bad("t", None, wants)
    if method is not None:
        one_of("method", method, METHODS)
    discrete = isinstance(law, Map)
    if discrete and method is not None:
        raise bad("method", method, "nothing for a map, which is not integrated")
    refuse_force(system)
    rows = [_row(law, name) for name in law.states]
    taken: dict[str, int] = {}
    options = {**tolerances, **({} if discrete else {"method": method, "taken": taken})}
    states = {**states_of(law, x0, named), "t": ("time", t)}
    move = functools.partial(_move, law, **options)
    ds = _followed(system, law, rows, states, move, "following motions")
    if any(taken.values()):
        ds.attrs["method"] = ", ".join(name for name, number in taken.items() if number > 0)
    return with_observables(ds, law, getattr(system, "observables", {}))


def _followed(
    system: System, law: Equations, rows: Sequence[Quantity], states: Mapping[str, Any],
    function: Callable[..., Any], what: str,
) -> xr.Dataset:  # fmt: skip
    """What a function makes of motions from some states, labelled; what it does is told."""
    inputs = tuple(name for name, _ in states.values())
    one = Pass(function, (*law.names, *inputs), (rows[0].group,), rung_of(law))
    with notice(what):
        ds = at_states(system, rows, states, (one,))
    if isinstance(law, Map):
        ds.time.attrs = {"long_name": "number of iterations", "units": "1"}
    return with_starts(ds, law, inputs)


def with_observables(ds: xr.Dataset, law: Equations, observables: Mapping[str, Any]) -> xr.Dataset:
    """Add the values of formulas along motions."""
    if not observables:
        return ds
    import sympy as sp

    clock = law.time or "time"
    arrays = {name: ds[f"motion_{name}"] for name in law.states}
    arrays |= {name: ds[name] for name in law.names} | {clock: ds.time}
    symbols = symbols_of(arrays)
    for name, formula in observables.items():
        used = [x for x in arrays if symbols[x] in formula.free_symbols]
        function = sp.lambdify([symbols[x] for x in used], formula, ["scipy", "numpy"])
        dims = ds[f"motion_{law.states[0]}"].dims
        with np.errstate(all="ignore"):
            found = xr.apply_ufunc(function, *(arrays[x] for x in used), dask="allowed")
        along = arrays[law.states[0]]
        values = (0.0 * along + found).transpose(*dims)  # of all of them, NaN where it ended
        text = str(formula)
        attrs = {
            "long_name": f"{name} along the motion", "units": law.units.get(name, "1"),
            "equation": text if len(text) < 200 else f"{name} = g({list_names(law.states)})",
        }  # fmt: skip
        ds[f"motion_{name}"] = variable(map(str, dims), values.data, attrs)
    return ds


def refuse_force(system: Any) -> None:
    """Refuse a force alone, of which nothing moves."""
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
            given = ds.variables[name]
            coords[name] = variable(map(str, given.dims), given.data, attrs)
    return ds.assign_coords(coords)


def exponents_of(
    system: System, law: Equations, x0: Any, named: Mapping[str, Any],
    duration: tuple[str, Any], n: Any, count: int | None, tolerances: Mapping[str, float],
) -> xr.Dataset:  # fmt: skip
    """Lyapunov exponents of motions of a flow, or of the orbits of a map."""
    discrete, states = isinstance(law, Map), len(law.states)
    called, length = ("n", n) if discrete else duration
    other, given = duration if discrete else ("n", n)
    if given is not None:
        raise bad(other, given, f"None, but {called}= for {'a map' if discrete else 'a flow'}")
    wants = "whole numbers of iterations, >= 100" if discrete else "times > 0"
    if length is None:
        states_of(law, x0, named, f"{called}: got None, wants {wants}")
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
    clock = None if discrete else system.unit_of("time")
    rate = "1" if clock is None else f"{clock}-1"
    about = {
        "lyapunov_exponent": (f"Lyapunov exponent {per}, the largest first", ("exponent",), rate),
        "lyapunov_error": ("estimated error of the Lyapunov exponent", ("exponent",), rate),
        "lyapunov_sum": ("sum of all Lyapunov exponents", (), rate),
        "lyapunov_dimension": ("Kaplan and Yorke's dimension", (), "1"),
    }
    rows = [
        Quantity(
            name, "exponents", dims, "float64", units, text, "mean growth of log|u|, u' = f_x u",
            "[BenettinGalganiGiorgilliStrelcyn1980]", of=rung_of(law), labels=labels,
        )
        for name, (text, dims, units) in about.items()
    ]  # fmt: skip
    at = {**states_of(law, x0, named), called: ("time", length)}
    function = functools.partial(_exponents, law, count=count, **tolerances)
    what = "following motions and their tangent vectors"
    return _followed(system, law, rows, at, function, what)


def _exponents(law: Equations, *arrays: Any, **options: Any) -> Any:
    from phasekit.motion.exponents import exponents

    return exponents(law, *arrays, **options)


def sections_of(
    system: System, law: Equations, x0: Any, named: Mapping[str, Any], n: int, skip: int,
    period: float | None, tolerances: Mapping[str, float],
) -> xr.Dataset:  # fmt: skip
    """States of a forced flow once a period, or of any flow after equal times."""
    if isinstance(law, Map):
        raise bad("system", system, "a flow: pk.flow gives the iterates of a map")
    if period is None and law.period is None:
        raise bad("period", None, "a time > 0", "nothing in the system has a period of its own")
    labels = {**LABELS, "crossing": (range(skip, skip + n), "number of the period")}
    about = {"section_time": ("time of the crossing", system.unit_of("time") or "1")}
    about |= {f"section_{x}": (f"{x} in the section", law.units.get(x, "1")) for x in law.states}
    rows = [
        Quantity(
            name, "sections", ("crossing",), "float64", units, text, "x(n T)",
            "[GuckenheimerHolmes1983] section 1.5", of=Flow, labels=labels,
        )
        for name, (text, units) in about.items()
    ]  # fmt: skip
    at = states_of(law, x0, named)
    function = functools.partial(flows.sections, law, n=n, skip=skip, period=period, **tolerances)
    what = f"following motions for {skip + n:,} periods"
    return _followed(system, law, rows, at, function, what)
