"""Motions with noise, labelled: paths, and the times at which they first pass a target."""

from __future__ import annotations

import functools
import secrets
from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np
import xarray as xr

from phasekit.cells.states import at_states
from phasekit.errors import warn
from phasekit.labelled.flows import refuse_force, states_of, with_observables, with_starts
from phasekit.labels.arguments import bad, number, numeric, state_arguments, whole
from phasekit.labels.coordinates import LABELS
from phasekit.laws.equations import Equations
from phasekit.laws.formulas import symbols_of, take_formula
from phasekit.laws.ladder import Map
from phasekit.motion import noise
from phasekit.numerics.waits import notice
from phasekit.systems.system import System, as_system
from phasekit.table.quantities import ROWS
from phasekit.table.row import Pass, Quantity

SOURCE = "[Honeycutt1992]"


def noisy_law(system: System) -> tuple[Equations, dict[str, str]]:
    """The equations of a system with noise, and what results call its states."""
    law = system.own_equations
    if law is not None:
        if isinstance(law, Map):
            raise bad("system", system, "a flow: a map has no noise here")
        if not law.noise:
            hint = "pk.Problem(..., noise={'v': 0.1}) has some"
            raise bad("system", system, "a system with noise", hint)
        refuse_force(system)
        return law, {name: name for name in law.states}
    if system.standing.traits is None:
        raise bad("system", system, "a Problem with noise, or a Perturbed with kT")
    return _thermal(system)


def _thermal(system: Any) -> tuple[Equations, dict[str, str]]:
    """The equations of a damped system in a bath: sqrt(2 damping kT) dW on its velocity."""
    from phasekit.systems.as_equations import formulas_of
    from phasekit.systems.problem import Problem

    if not np.any(np.asarray(system.kT) > 0.0):
        raise bad("kT", system.kT, "a temperature > 0, for paths with noise")
    if np.any(np.asarray(system.quadratic) != 0.0):
        raise bad("quadratic", system.quadratic, "0 with kT: noise is that of linear damping")
    first = {name: float(np.ravel(x)[0]) for name, x in system.parameters.items()}
    f, states, values, keywords = formulas_of(system.replace(**{**first, "kT": 0.0}))
    amplitude = {states[1]: "sqrt(2*damping*kT)"}
    problem = Problem(f, states, {**values, "kT": 1.0}, noise=amplitude, **keywords)
    law = problem.law
    assert isinstance(law, Equations)
    return law, dict(zip(states, ("phi", "dphi", *states[2:]), strict=True))


def checked(paths: Any, seed: Any, step: Any) -> dict[str, Any]:
    """Numbers of paths, seed and step; a seed of its own where none is given."""
    paths = whole("paths", paths, "a number of paths >= 1")
    if seed is None:
        seed = secrets.randbits(63)
    seed = whole("seed", seed, "a whole number >= 0", 0)
    if step is not None:
        step = number("step", step, "a time > 0", "s")
        if not step > 0.0:
            raise bad("step", step, "a time > 0")
    return {"paths": paths, "seed": seed, "step": step}


def paths_of(
    system: System, x0: Any, named: Mapping[str, Any], two: tuple[Any, ...], t: Any,
    options: dict[str, Any],
) -> xr.Dataset:  # fmt: skip
    """States of paths at times; see `phasekit.flow`."""
    law, called = noisy_law(system)
    if t is None:
        raise bad("t", None, "times >= 0")
    if np.any(np.asarray(numeric("t", t, system.unit_of("time"))) < 0.0):
        raise bad("t", t, "times >= 0: noise goes ahead in time alone")
    labels = {**LABELS, "path": (range(options["paths"]), "number of the path")}
    rows = [
        _row(system, f"motion_{own}", law.units.get(name, "1"), f"{name} along the path", labels)
        if called[name] == name and f"motion_{own}" not in ROWS
        else replace(ROWS[f"motion_{own}"], dims=("path",), labels=labels, of=system.rung)
        for name, own in called.items()
    ]
    rows.append(_row(system, "noise_step", "s", "longest time step of a path", labels, ()))
    at = {**_starts(law, called, x0, named, two), "t": ("time", t)}
    function = functools.partial(_paths, law, called, options)
    inputs = tuple(name for name, _ in at.values())
    one = Pass(function, (*law.names, *inputs), ("flow",), system.rung)
    with notice("following paths with noise"):
        ds = at_states(system, [replace(row, group="flow") for row in rows], at, (one,))
    ds["noise_step"] = ds.noise_step.isel(time=0, drop=True) if "time" in ds.dims else ds.noise_step
    ds = with_starts(ds, law, inputs)
    lost = int(np.isnan(ds[f"motion_{next(iter(called.values()))}"].values).sum())
    if lost:
        warn(
            f"{lost} states of paths are NaN: the paths run to infinity, the law has no value "
            "there, or their step is too long",
            RuntimeWarning,
        )
    ds.attrs["seed"] = options["seed"]
    return with_observables(ds, law, getattr(system, "observables", {}))


def _starts(
    law: Equations, called: Mapping[str, str], x0: Any, named: Mapping[str, Any],
    two: tuple[Any, ...],
) -> dict[str, tuple[str, Any]]:  # fmt: skip
    """States at the start by name."""
    given = {name: value for name, value in zip(law.states, two, strict=False) if value is not None}
    found = states_of(law, None, {**given, **named}) if given else states_of(law, x0, named)
    return {name: (f"state_{called[name]}", value) for name, (_, value) in found.items()}


def _paths(law: Equations, called: Mapping[str, str], options: dict[str, Any], *arrays: Any) -> Any:
    found = noise.paths_at(law, *arrays, **options)
    return {f"motion_{own}": found[f"motion_{name}"] for name, own in called.items()} | {
        "noise_step": found["noise_step"]
    }


def _row(
    system: System, name: str, units: str, text: str, labels: Any, dims: tuple[str, ...] = ("path",)
) -> Quantity:
    if units in ("s", "s-1"):  # where the system's time has another unit, or none
        clock = system.unit_of("time")
        units = "1" if clock is None else units.replace("s", clock)
    return Quantity(
        name, "flow", dims, "float64", units, text, "dx = f dt + s dW", SOURCE, of=system.rung,
        labels=labels,
    )  # fmt: skip


@state_arguments
def first_passage(
    system: Any,
    phi0: Any = None,
    dphi0: Any = None,
    *,
    target: Any,
    duration: Any,
    paths: int = 1000,
    seed: int | None = None,
    x0: Any = None,
    step: float | None = None,
    **states: Any,
) -> xr.Dataset:
    """Times at which paths with noise first pass a target.

    Parameters
    ----------
    system : Problem with noise, or Perturbed with kT
        The system.
    phi0, dphi0 : float, 1-D array_like or xarray.DataArray
        States at t = 0 of a `Perturbed` system, in rad and s^-1.
    target : str or sympy.Expr
        A formula of the states, the parameters and the time. A path passes where it leaves the sign
        that it has at the start.
    duration : float, 1-D array_like or xarray.DataArray
        Time after which a path is given up, > 0.
    paths : int, default 1000
        How many from each state.
    seed : int, optional
        Of the random numbers: the same seed gives the same times. By default one that
        ``attrs["seed"]`` names.
    x0 : mapping, sequence or xarray.DataArray, optional
        States at t = 0 of a `Problem`, as in `flow`; ``first_passage(problem, x0, ...)`` as well.
    step : float, optional
        Longest time step; by default as in `flow`.

    Returns
    -------
    xarray.Dataset
        On ``path``: ``passage_time``, infinite where a path did not pass in time, NaN where it has
        no value. ``n_passed``; ``passage_rate``, the number that passed over the time of all, and
        ``passage_rate_error``; ``mean_passage_time`` and ``mean_passage_time_error``, NaN unless
        all passed. ``noise_step``, the longest step. The errors are standard errors, of the finite
        number of paths; another `step` shows the error of the steps.

    Raises
    ------
    ConvergenceError
        If a path would take more than 1e9 steps.

    Notes
    -----
    Heun's steps, of second order in means ([Honeycutt1992]). That a path passes within a step and
    comes back is drawn with the probability ``exp(-2 a b/(r h))`` of a Brownian bridge between the
    values a and b of the target, r the rate at which noise spreads it ([Gobet2000]), and so is the
    time of passage in the step. Where noise acts on velocities alone and the target is a position,
    r is 0, and the time is interpolated.

    Examples
    --------
    A drift of 1 takes the time 2 to the level 2 in the mean, whatever the noise:

    >>> import phasekit as pk
    >>> drift = pk.Problem("1", "x", noise={"x": 0.5}, start={"x": 0.0})
    >>> ds = pk.first_passage(drift, target="x - 2", duration=100.0, paths=400, seed=1)
    >>> bool(abs(ds.mean_passage_time - 2.0) < 3.0 * ds.mean_passage_time_error)
    True
    """
    system = as_system(system)
    options = checked(paths, seed, step)
    law, called = noisy_law(system)
    two: tuple[Any, ...]
    if system.own_equations is not None:
        given = (phi0, dphi0) if x0 is None and dphi0 is not None else phi0
        x0, two = given if x0 is None else x0, ()
    else:
        if x0 is not None:
            raise bad("x0", x0, "nothing for a system whose state is phi0, dphi0")
        two = (phi0, dphi0)
    wants = "times > 0"
    if np.any(np.asarray(numeric("duration", duration, system.unit_of("time"), wants)) <= 0.0):
        raise bad("duration", duration, wants)
    clock = [] if law.time is None else [law.time]
    symbols = symbols_of([*law.states, *law.names, *clock])
    formula = take_formula(target, symbols, "target", "it is no state and no parameter")
    if not formula.free_symbols & {symbols[name] for name in (*law.states, *clock)}:
        raise bad("target", target, f"a formula of {', '.join(law.states)}")
    labels = {**LABELS, "path": (range(options["paths"]), "number of the path")}
    rows = [
        _row(system, "passage_time", "s", "time at which the path first passes the target", labels)
    ]
    about = {
        "n_passed": ("1", "number of paths that passed"),
        "passage_rate": ("s-1", "number of paths that passed over the time of all"),
        "passage_rate_error": ("s-1", "standard error of the passage rate"),
        "mean_passage_time": ("s", "mean time of passage, NaN unless all paths passed"),
        "mean_passage_time_error": ("s", "standard error of the mean time of passage"),
        "noise_step": ("s", "longest time step of a path"),
    }
    rows += [_row(system, name, units, text, labels, ()) for name, (units, text) in about.items()]
    at = {**_starts(law, called, x0, states, two), "duration": ("time", duration)}
    function = functools.partial(_passages, law, formula, options)
    inputs = tuple(name for name, _ in at.values())
    one = Pass(function, (*law.names, *inputs), ("flow",), system.rung)
    with notice("following paths with noise"):
        ds = at_states(system, rows, at, (one,))
    ds = with_starts(ds, law, inputs)
    ds.attrs["seed"] = options["seed"]
    lost = int(np.isnan(ds.passage_time.values).sum())
    if lost:
        warn(
            f"{lost} of {ds.passage_time.size} paths have no value before they pass: they run to "
            "infinity, the law has no value there, or their step is too long; they do not count",
            RuntimeWarning,
        )
    return ds


def _passages(law: Equations, formula: Any, options: dict[str, Any], *arrays: Any) -> Any:
    found = noise.first_passages(law, formula, *arrays, **options)
    times = found["passage_time"]
    longest = np.broadcast_to(np.asarray(arrays[-1], float)[..., None], times.shape)
    passed, valid = np.isfinite(times), ~np.isnan(times)
    number = passed.sum(axis=-1)
    count = valid.sum(axis=-1)
    with np.errstate(divide="ignore", invalid="ignore"):
        total = np.where(valid, np.minimum(times, longest), 0.0).sum(axis=-1)
        rate = number / total
        mean = np.where(passed, times, 0.0).sum(axis=-1) / number
        spread = np.where(passed, (times - mean[..., None]) ** 2, 0.0).sum(axis=-1) / (number - 1)
        whole = (number == count) & (number > 1)
        return {
            **found,
            "n_passed": number.astype(float),
            "passage_rate": rate,
            "passage_rate_error": np.where(number > 0, rate / np.sqrt(number), np.nan),
            "mean_passage_time": np.where(whole, mean, np.nan),
            "mean_passage_time_error": np.where(whole, np.sqrt(spread / number), np.nan),
        }
