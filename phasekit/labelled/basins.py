"""Attractors of systems, and their basins, labelled."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np
import xarray as xr

from phasekit.cells.request import equations_for
from phasekit.cells.schema import dataset_attrs, input_attrs
from phasekit.cells.start_grid import StartGrid, start_grid
from phasekit.errors import warn
from phasekit.labelled.driven import perturbed_of
from phasekit.labelled.flows import refuse_force
from phasekit.labelled.motion import checked_tolerances
from phasekit.labels.arguments import (
    FloatArray,
    NumberLike,
    bad,
    number,
    numeric,
    state_arguments,
    unknown,
    whole,
)
from phasekit.labels.coordinates import LABELS
from phasekit.labels.grid import variable
from phasekit.laws.equations import Equations
from phasekit.motion import attractors as search
from phasekit.motion import basins as shares
from phasekit.motion.flow import RTOL
from phasekit.motion.lost import tell_open
from phasekit.motion.shares import damping_time
from phasekit.motion.strobe import check_period, common_period
from phasekit.numerics.waits import notice
from phasekit.systems.levels import window_of_damped
from phasekit.systems.perturbed import Perturbed
from phasekit.systems.problem import as_problem
from phasekit.systems.problem_parts import refuse_aperiodic
from phasekit.systems.system import System, as_system, single
from phasekit.table.attractors import rows_of
from phasekit.table.quantities import ROWS
from phasekit.table.row import Quantity

#: States along each axis of a search, at most, and of a grid of basins where none are given.
STARTS, EACH = 16, 100


@state_arguments
def attractors(
    system: Any,
    grid: Mapping[str, Any] | None = None,
    *,
    fixed: Mapping[str, Any] | None = None,
    phi: NumberLike | None = None,
    dphi: NumberLike | None = None,
    period: float | None = None,
    rtol: float | None = None,
) -> xr.Dataset:
    """Attractors of a flow or map, found by motions from a grid of states.

    Parameters
    ----------
    system : Problem, Perturbed, or system that states rates or a step
        One flow, forced or not, one map, or one system with damping and drive.
    grid : mapping of str to 1-D array_like or xarray.DataArray, optional
        Values of states from which motions start; of a large grid a part is used. By default it
        spans the window of the system.
    fixed : mapping of str to float or str, optional
        Numbers for states that are not on the grid, or formulas of those on it and of parameters;
        by default the middle of the window.
    phi, dphi : 1-D array_like or xarray.DataArray, optional
        The grid of a system with one coordinate: angles in rad and angular velocities in s^-1. By
        default they span a turn, and the speeds of a portrait: past the separatrices.
    period : float, optional
        Of a `Perturbed` system, the time from state to state in s; default: the common period of
        all that varies, of a system without such a quarter of the period of small oscillations,
        without these 1/damping.
    rtol : float, optional
        Error of a step that is allowed, relative to the state; default 1e-10.

    Returns
    -------
    xarray.Dataset
        On (``attractor``, ``crossing``): ``attractor_`` and the name of each state (``phi``,
        ``dphi``): the states of a periodic orbit, once an iteration or a period of the forcing; of
        a flow that does not vary a rest, or a cycle at equal times; or some states of a motion
        that does not repeat itself. On ``attractor``:
        ``attractor_kind`` (`AttractorKind`), ``attractor_period``, after so many iterations or
        periods, or after which time, it repeats itself (0: it does not),
        ``attractor_multiplier``, <= 1, ``attractor_exponent`` with
        ``attractor_exponent_error``, and of angles ``attractor_rotation``, the turns in a period
        or a unit of time.

    Raises
    ------
    ParameterError
        If an argument is unusable, or the system conserves energy and so has no attractors.

    Warns
    -----
    RuntimeWarning
        If it is not seen where some motions end.

    Notes
    -----
    Motions are followed until they repeat themselves. Newton's method then
    finds the fixed point of the q-th power of the map, or of the Poincare map of a forced flow; of
    another flow an equilibrium, or a cycle by its state and period. Its multipliers, all of a
    modulus below 1 (but that along a cycle), say that it attracts ([GuckenheimerHolmes1983]
    section 1.5). What has come to none after 4,300 looks, or more where damping is weak, is chaotic
    where its largest exponent is positive by three times its error, and a torus where that is zero
    within it and its states fill a closed curve, or of a flow without forcing the second one is
    zero as well; otherwise it is unknown, which a warning says.

    Of a damped system in a potential that does not vary the attractors are the rests of the wells,
    however slowly motions come to them, and at most one rotation: the fixed point of the map from
    a speed at an angle to that one turn later. An attractor to which none of the states comes is
    not found.

    Examples
    --------
    >>> import numpy as np
    >>> import phasekit as pk
    >>> well = pk.Potential("x^4/4 - x^2/2", "x")
    >>> driven = pk.Perturbed(well, damping=0.15, forcing=pk.Harmonic(0.2, 1.0))
    >>> ds = pk.attractors(driven, phi=np.linspace(-2, 2, 5), dphi=[-1.0, 1.0])
    >>> ds.attractor_phi.values.round(6).ravel().tolist()
    [-0.779055, 1.210091]
    >>> oscillator = pk.Problem(
    ...     {"x": "y", "y": "(1 - x^2)*y - x"}, window={"x": (-3, 3), "y": (-3, 3)}
    ... )
    >>> ds = pk.attractors(oscillator)
    >>> pk.AttractorKind(ds.attractor_kind.item()).name, ds.attractor_period.round(6).item()
    ('CYCLE', 6.663287)
    """
    found = as_system(system)
    if (law := equations_for(found, "basin_fractions")) is not None:
        if found.standing.traits is not None and grid is None:
            phi, dphi = _over_window(found, phi, dphi, STARTS)
            grid, phi, dphi = {"phi": phi, "dphi": dphi}, None, None
        _refuse_of_equations(phi=phi, dphi=dphi, period=period)
        result, _ = _searched_of(found, law, grid, fixed, rtol)
        tell_open("attractors", result.open)
        return laid_out(found, rows_of(law), attractor_rows(law, result.result()))
    phi, dphi = _plane(found, grid, fixed, phi, dphi, STARTS)
    perturbed, result, _ = _searched(found, phi, dphi, period, rtol)
    tell_open("attractor_phi", result.open)
    return _dataset_of_perturbed(perturbed, _perturbed_rows(result.result()), result.leg)


@state_arguments
def basins(
    system: Any,
    grid: Mapping[str, Any] | None = None,
    *,
    fixed: Mapping[str, Any] | None = None,
    phi: NumberLike | None = None,
    dphi: NumberLike | None = None,
    period: float | None = None,
    periods: int = shares.LEGS,
    rtol: float | None = None,
) -> xr.Dataset:
    """Basins of the attractors over a grid of states, and their shares.

    Parameters
    ----------
    system : Problem, Perturbed, or system that states rates or a step
        One flow, forced or not, one map, or one system with damping and drive.
    grid : mapping of str to 1-D array_like or xarray.DataArray, optional
        Values of one state, of two or more at t = 0. By default it spans the window of the system
        by about 10,000 states.
    fixed : mapping of str to float or str, optional
        As in `attractors`.
    phi, dphi : 1-D array_like or xarray.DataArray, optional
        The grid of a system with one coordinate, by default as in `attractors`, of 10,000 states.
    period : float, optional
        As in `attractors`.
    periods : int, default 10000
        Iterations, periods or looks after which a motion that came to no attractor is undecided.
    rtol : float, optional
        As in `attractors`.

    Returns
    -------
    xarray.Dataset
        ``basin`` on ``state_`` and the names of the states on the grid: the number of the
        attractor, -1 where a
        motion is undecided, -2 where it runs to infinity; ``basin_decided``, whether the errors of
        the steps stayed smaller than a cell until the motion was caught: elsewhere it is that of a
        state next to the one given; ``basin_time`` until the motion is caught, in s or iterations;
        on ``attractor``: ``basin_fraction`` and ``basin_fraction_error``;
        ``boundary_fraction``, the share of the cells beside another basin; and what `attractors`
        gives.

    Raises
    ------
    ParameterError
        As `attractors`.

    Warns
    -----
    RuntimeWarning
        If it is not seen where some motions end, as of `attractors`; and if more than half of the
        cells lie beside another basin: the grid is too coarse to show the basins.

    Notes
    -----
    A motion belongs to an attractor when it comes as near as states on a ring around it were seen
    to be caught; of a damped system in a potential that does not vary, when its energy is below the
    barriers of the well,
    or its speed above that of a turn that ends faster than it began; or, of an
    attractor that does not repeat itself, when it has been in forty of its
    cells in succession [DatserisWagemakers2022]. It runs to infinity when it overflows, or is a
    thousand times the size of the grid away; one that ends where the law has no value is undecided.
    The error of a share p of n states is that of a
    sample, ``sqrt(p (1 - p)/n)``, and the share of the undecided on top; it is NaN of an attractor
    of unknown kind, which may be a part of another.

    Examples
    --------
    >>> import numpy as np
    >>> import phasekit as pk
    >>> damped = pk.Perturbed(pk.Coefficients(1.0, 0.35, 0.12), damping=0.2)
    >>> ds = pk.basins(damped, phi=np.linspace(-3.0, 3.0, 31), dphi=np.linspace(-1.0, 1.0, 21))
    >>> ds.attractor_phi.values.round(3).ravel().tolist(), float(ds.basin_fraction.sum())
    ([-1.156, 1.255], 1.0)
    >>> henon = pk.Problem(
    ...     {"x": "1 - a*x^2 + y", "y": "b*x"}, parameters={"a": 1.4, "b": 0.3}, map=True,
    ... )
    >>> axis = np.linspace(-2.0, 2.0, 100)
    >>> ds = pk.basins(henon, {"x": axis, "y": axis})
    >>> ds.basin_fraction.values.round(2).tolist()
    [0.43]
    """
    periods = whole("periods", periods, "a number of periods, >= 1", 1)
    found = as_system(system)
    if (law := equations_for(found, "basin_fractions")) is not None:
        if found.standing.traits is not None and grid is None:
            phi, dphi = _over_window(found, phi, dphi, EACH)
            grid, phi, dphi = {"phi": phi, "dphi": dphi}, None, None
        _refuse_of_equations(phi=phi, dphi=dphi, period=period)
        ds, coarse = _basins_of(found, law, grid, fixed, periods, rtol)
        _warn_of_coarse(coarse)
        return ds
    phi, dphi = _plane(found, grid, fixed, phi, dphi, EACH)
    perturbed, result, axes = _searched(found, phi, dphi, period, rtol)
    with notice(f"following {axes[0].size * axes[1].size:,} motions to their attractors"):
        spread = shares.basins(result, dict(enumerate(axes)), legs=periods)
    tell_open("attractor_phi", result.open)
    data = _perturbed_rows(result.result())
    dims = ("state_phi", "state_dphi")
    for name, values in spread._asdict().items():
        data[name] = (dims if np.ndim(values) == 2 else ROWS[name].dims, values)
    coords = dict(zip(dims, axes, strict=True))
    ds = _dataset_of_perturbed(perturbed, data, result.leg, coords)
    _warn_of_coarse(_too_coarse(spread, result, axes))
    return ds


def _basins_of(
    system: System, law: Equations, grid: Any, fixed: Any, periods: int, rtol: float | None
) -> tuple[xr.Dataset, str]:
    """Basins of a flow or map, and why the grid does not show them."""
    result, starts = _searched_of(system, law, grid, fixed, rtol)
    count = int(np.prod(starts.shape))
    with notice(f"following {count:,} motions to their attractors"):
        spread = shares.basins(result, starts.places, starts.states(), legs=periods)
    tell_open("basin", result.open)
    rows, data = rows_of(law), attractor_rows(law, result.result())
    dims = tuple(f"state_{name}" for name in starts.axes)
    for name, values in spread._asdict().items():
        over = name in ("basin", "basin_decided", "basin_time")
        data[name] = (dims if over else rows[name].dims, values)
    coords = {
        f"state_{name}": variable(
            (f"state_{name}",), axis,
            {"long_name": f"{name} at the start", "units": law.units.get(name, "1")}
            | ({"period": law.periods[name]} if name in law.periods else {}),
        )
        for name, axis in starts.axes.items()
    }  # fmt: skip
    ds = laid_out(system, rows, data, coords)
    for name, given in starts.fixed.items():
        words = {"long_name": f"{name} at the start", "units": law.units.get(name, "1")}
        if isinstance(given, float):
            ds = ds.assign_coords({f"state_{name}": variable((), given, words)})
        else:
            ds.basin.attrs[f"state_{name}"] = str(given)
    return ds, _too_coarse(spread, result, starts.axes.values())


def _too_coarse(spread: shares.Basins, result: search.Search, axes: Any) -> str:
    """Why a grid does not show the basins; empty where it does."""
    if not spread.boundary_fraction > shares.COARSE:
        return ""
    sure = not any(result.open.values()) and np.isfinite(spread.basin_fraction_error).all()
    held = "; their fractions hold as those of a sample" if sure else ""
    return (
        f"basin: {spread.boundary_fraction:.0%} of the cells lie beside another basin: a grid of "
        f"{' x '.join(str(len(axis)) for axis in axes)} states is too coarse to show the basins"
        f"{held}"
    )


def _warn_of_coarse(text: str) -> None:
    """Say it to who called, through two wrappers."""
    if text:
        warn(text, RuntimeWarning)


def _refuse_of_equations(**given: Any) -> None:
    for name, value in given.items():
        if value is not None:
            wants = "nothing for a system with states of its own, whose grid is a mapping"
            raise bad(name, value, wants)


def _searched_of(
    system: System, law: Equations, grid: Any, fixed: Any, rtol: float | None
) -> tuple[search.Search, StartGrid]:
    """The attractors of a flow or map, and the grid."""
    _, parameters = single(system)
    refuse_force(system)
    refuse_aperiodic(law, system)
    if getattr(system, "conservative", False):
        wants = "a system with damping"
        raise bad("system", system, wants, "one that conserves energy has no attractors")
    rtol = checked_tolerances(rtol, None).get("rtol", RTOL)
    starts = start_grid(law, parameters, grid, fixed)
    states = starts.starts()
    values = {name: np.asarray(parameters[name], float) for name in law.names}
    if law.time is not None:
        check_period("period", common_period(law, values))
    with notice(f"looking for attractors from {len(states)} states"):
        found = search.find_of(law, values, states, starts.widths, rtol)
    return found, starts


def _over_window(system: Any, phi: Any, dphi: Any, count: int) -> tuple[Any, Any]:
    """Both axes of a system with one coordinate; none that is given spans a turn and its levels."""
    if system.standing.traits is None or (phi is not None and dphi is not None):
        return phi, dphi
    problem = as_problem(system)
    window = window_of_damped(system, problem, None)
    x, v = problem.state[:2]
    half = 0.5 * problem.periods.get(x, 0.0)
    ends = {"phi": window.get(x, (-half, half)), "dphi": window[v]}
    parts = (np.arange(count) + 0.5) / count
    phi, dphi = (
        low + (high - low) * parts if axis is None else axis
        for axis, (low, high) in zip((phi, dphi), ends.values(), strict=True)
    )
    return phi, dphi


def _plane(
    system: System, grid: Any, fixed: Any, phi: Any, dphi: Any, count: int
) -> tuple[Any, Any]:
    """The grid of a system with one coordinate, whose states may go by its name as well."""
    if fixed is not None:
        raise bad("fixed", fixed, "nothing for a system whose states are both on the grid")
    x = system.coordinate or "phi"
    if grid is not None:
        if not isinstance(grid, Mapping):
            raise bad("grid", grid, "a mapping from names of states to values")
        given = {"phi": phi, "dphi": dphi}
        for name, axis in grid.items():
            own = {x: "phi", f"d{x}": "dphi", "phi": "phi", "dphi": "dphi"}.get(name)
            if own is None:
                raise unknown("grid: state", name, (x, f"d{x}"))
            if given[own] is not None:
                raise bad(f"grid[{name!r}]", axis, "each state once")
            given[own] = axis
        phi, dphi = given["phi"], given["dphi"]
    phi, dphi = _over_window(system, phi, dphi, count)
    for name, axis in {"phi": phi, "dphi": dphi}.items():
        if axis is None:
            raise bad(name, None, "values of a grid", f"or grid={{{x!r}: ..., 'd{x}': ...}}")
    return phi, dphi


def attractor_rows(
    law: Equations, found: search.Attractors
) -> dict[str, tuple[tuple[str, ...], Any]]:
    """Attractors of a flow or map by the names of their rows."""
    on = ("attractor",)
    data: dict[str, tuple[tuple[str, ...], Any]] = {
        f"attractor_{name}": ((*on, "crossing"), found.state[..., i])
        for i, name in enumerate(law.states)
    }
    for part in ("kind", "period", "multiplier", "exponent", "exponent_error", "rotation"):
        data[f"attractor_{part}"] = (on, getattr(found, part))
    if "attractor_rotation" not in rows_of(law):
        del data["attractor_rotation"]
    return data


def laid_out(
    system: System,
    rows: Mapping[str, Quantity],
    data: Mapping[str, tuple[tuple[str, ...], Any]],
    coords: Mapping[str, xr.Variable] | None = None,
) -> xr.Dataset:
    """Rows of one system with their attributes, and its parameters as coordinates."""
    variables: dict[str, xr.Variable] = {}
    named: dict[str, xr.Variable] = {}
    for name, (dims, values) in data.items():
        variables[name] = variable(dims, np.asarray(values, rows[name].dtype), rows[name].attrs)
        for dim, size in zip(dims, np.shape(values), strict=True):
            if dim in LABELS and dim not in named:
                named[dim] = variable((dim,), np.arange(size), {"long_name": LABELS[dim][1]})
    named.update(coords or {})
    for name, value in system.parameters.items():
        named[name] = variable((), value, input_attrs(system, name))
    return xr.Dataset(variables, named, dataset_attrs(system))


def _searched(
    perturbed: Any, phi: NumberLike, dphi: NumberLike, period: float | None, rtol: float | None
) -> tuple[Perturbed, search.Search, tuple[FloatArray, FloatArray]]:
    """The attractors of one system, and the grid."""
    system = perturbed_of(perturbed)
    grid = (
        _axis("phi", phi, system.unit_of("state_phi")),
        _axis("dphi", dphi, system.unit_of("state_dphi")),
    )
    _, parameters = single(system)
    law = system.law
    rtol = checked_tolerances(rtol, None).get("rtol", RTOL)
    if not (parameters["damping"] > 0.0 or parameters["quadratic"] > 0.0):
        raise bad(
            "damping", parameters["damping"], "a system with damping > 0 or quadratic > 0",
            "without damping there are no attractors",
        )  # fmt: skip
    values = law.values(*parameters.values())
    own = common_period(law, values)
    if period is not None:
        leg = number("period", period, "a time in s, > 0", "s")
        if not leg > 0.0:
            raise bad("period", period, "a time in s, > 0")
    elif own is None:
        leg = _quarter(system, values)
    else:
        leg = float(check_period("period", own))
    every = [axis[np.linspace(0, len(axis) - 1, min(len(axis), STARTS)).round().astype(int)]
             for axis in grid]  # fmt: skip
    states = np.stack(np.meshgrid(*every, indexing="ij"), axis=-1).reshape(-1, 2)
    with notice(f"looking for attractors from {len(states)} states"):
        found = search.find(law, values, leg, states, rtol)
    return system, found, grid


def _quarter(system: Perturbed, values: Mapping[str, Any]) -> float:
    """A quarter of the period of small oscillations about the center of greatest curvature.

    Without one the time in which damping acts.
    """
    from phasekit.labelled.phase_space import equilibria

    frequency = equilibria(system.system).natural_frequency.values
    if not np.isfinite(frequency).any():
        return damping_time(values)
    return float(0.5 * np.pi / np.nanmax(frequency))


def _axis(name: str, values: NumberLike, units: str | None) -> FloatArray:
    wants = "a 1-D array of finite, increasing values"
    kept = numeric(name, values, units, wants)
    axis = np.atleast_1d(np.asarray(kept, dtype=float))
    if axis.ndim != 1 or not np.isfinite(axis).all() or not (np.diff(axis) > 0.0).all():
        raise bad(name, values, wants)
    return axis


def _perturbed_rows(found: search.Attractors) -> dict[str, tuple[tuple[str, ...], Any]]:
    """Attractors of a perturbed system by the names of their rows."""
    fields = {
        "phi": found.state[..., 0], "dphi": found.state[..., 1], "kind": found.kind,
        "period": found.period, "multiplier": found.multiplier, "exponent": found.exponent,
        "exponent_error": found.exponent_error, "rotation": found.rotation,
    }  # fmt: skip
    named = {f"attractor_{name}": values for name, values in fields.items()}
    return {name: (ROWS[name].dims, values) for name, values in named.items()}


def _dataset_of_perturbed(
    system: Perturbed,
    data: Mapping[str, tuple[tuple[str, ...], Any]],
    leg: float,
    coords: Mapping[str, FloatArray] | None = None,
) -> xr.Dataset:
    """The same with the words of its law, and the period."""
    words: dict[str, Quantity] = {}
    for name in data:
        row = ROWS[name]
        own: dict[str, Any] = dict(system.law.words(name, row.units, row.long_name))
        words[name] = replace(row, **own)
    axes = {
        name: variable((name,), axis, input_attrs(system, name))
        for name, axis in (coords or {}).items()
    }
    return laid_out(system, words, data, axes).assign_attrs(period=repr(leg))
