"""All limit cycles of a planar flow in a window, and all cycles of a map, labelled."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Any, NamedTuple

import numpy as np
import xarray as xr

from phasekit.arrays import Array
from phasekit.cells.schema import dataset_attrs
from phasekit.errors import FlowEquilibriumKind, warn
from phasekit.labels.arguments import bad, call_checked, whole
from phasekit.labels.grid import Grid, loaded_grid, variable
from phasekit.laws.equations import Equations
from phasekit.laws.formulas import symbols_of
from phasekit.laws.ladder import Conservative, Routhian
from phasekit.motion.limit_cycles import Cycle, Window, limit_cycles
from phasekit.numerics.intervals.dulac import Rectangle, most_limit_cycles, rectangle
from phasekit.numerics.intervals.program import NoRule
from phasekit.numerics.waits import notice, stage
from phasekit.systems.problem import Problem, as_problem
from phasekit.systems.rests import Equilibria, corners, equilibria_of, window_of
from phasekit.systems.smooth import refuse_jumps
from phasekit.systems.system import as_system

#: How much of a turn a window of an angle all round may lack, which is made up.
ROUND = 1e-9


@call_checked
def periodic_orbits(system: Any, window: Any = None, *, n: int | None = None) -> xr.Dataset:
    """All limit cycles of a planar flow in a window, or all cycles of a map.

    Parameters
    ----------
    system : Problem, Perturbed, or system that states rates or a step
        A flow of two states that does not depend on time, of one state with a period in time, or a
        map. Array parameters span the result's dims.
    window : mapping of str to (float, float), optional
        Where the cycles lie; by default the system's window. Angles may be left out: all round.
    n : int, optional
        Of a map: how many points the cycles have; by default 1.

    Returns
    -------
    xarray.Dataset
        On ``cycle``, by their size: ``period`` with ``period_error``; ``multiplier`` (below 1 of
        a stable cycle) and its logarithm ``log_multiplier`` with ``log_multiplier_error``;
        ``n_unstable`` (0 stable, 1 unstable, -1 where that is within the error); the extremes
        ``x_min``, ``x_max`` of each state x; ``winding``, the turns of an angle in a period. On
        (``cycle``, ``sample``): ``cycle_time`` and the states ``cycle_x`` along each, NaN where
        one has no more samples. ``n_cycles``, and ``complete``: whether it is proved that these
        are all; if not, its attribute ``reason`` says what is open.

        Of a map ``multiplier`` and its size are on (``cycle``, ``eigenvalue_number``), and the
        points of each cycle on (``cycle``, ``iterate``).

    Raises
    ------
    ParameterError
        If the system is none of these, or an argument is unusable.

    Warns
    -----
    RuntimeWarning
        If cycles were met that could not be followed, and are missing; or multipliers are greater
        than any double.

    Notes
    -----
    A closed orbit in the plane encloses an equilibrium that is no saddle ([Kuznetsov2004] section
    1.3): the first returns to a ray from each of these are sampled forward and backward in time,
    more closely until their course is foreseen, and fixed points of the return map are refined to
    rounding. On a cylinder cycles that go round are looked for on a line across it. The multiplier
    is the exponential of the divergence along the cycle, and is compared with the slope of the
    return map. Motions are integrated by DOP853 with relative errors of 1e-13 a step
    ([HairerNorsettWanner1993]). Two cycles that are closer than the errors of their returns, and
    families of closed orbits as round a center, are no limit cycles here; ``reason`` names them.
    That there are no others is proved where all equilibria are saddles, and where the divergence
    has one sign: then there is none in the plane, and at most one on a cylinder. In the plane a
    function of Dulac and Cherkas is looked for besides ([Cherkas1997]): polynomials by linear
    programming, and proved by interval arithmetic to bound the number of cycles by the number of
    those that were found. The proof is of this bound: that each cycle found is one rests on its
    return, within `period_error`, and on its multiplier, not on intervals. f must have a value
    everywhere in the window. Not proved are cycles that are all but one, very stiff flows, and
    windows with no cycle where a source flows to a ring.
    Of a map the fixed points of the n-th iterate are enclosed as by `equilibria`.

    Examples
    --------
    >>> import phasekit as pk
    >>> oscillator = pk.Problem(
    ...     {"x": "y", "y": "mu*(1 - x^2)*y - x"}, parameters={"mu": 1.0},
    ...     window={"x": (-4, 4), "y": (-5, 5)},
    ... )
    >>> found = pk.periodic_orbits(oscillator)
    >>> found.period.values.round(9).tolist(), found.n_unstable.values.tolist()
    ([6.663286859], [0])
    """
    found = as_system(system)
    law = found.own_equations
    problem = _planar(found, law)
    if problem.map:
        times = 1 if n is None else whole("n", n, "a number of iterations >= 1", 1)
        return _of_map(problem, window, times)
    if n is not None:
        raise bad("n", n, "None for a flow: all its limit cycles are looked for")
    low, high = corners(problem, window_of(found, window), "window")
    grid = loaded_grid(problem.parameters)
    shape = tuple(grid.sizes.values())
    results = []
    with notice("looking for limit cycles"):
        for k, single in enumerate(_cells(problem, grid)):
            results.append(None if single is None else _of_one(single, low, high))
            stage(f"{k + 1:,} of {int(np.prod(shape)):,} systems")
    return _dataset(problem, grid, results)


def _planar(system: Any, law: Equations | None) -> Problem:
    """The equations of a planar flow or of a map."""
    if law is None and issubclass(system.rung, (Conservative, Routhian)):
        hint = "its periodic orbits fill families: pk.orbits and pk.orbit_families have them"
        raise bad("system", system, "a flow with limit cycles", hint)
    problem = as_problem(system, arrays=True)
    refuse_jumps(problem)
    if problem.map:
        return problem
    if problem.conservative:
        hint = "its periodic orbits fill families: pk.orbits of a pk.Potential has them"
        raise bad("system", problem, "a flow with limit cycles", hint)
    if problem.time is not None and len(problem.state) == 1:
        return unrolled(problem)
    if problem.time is not None or len(problem.state) != 2:
        hint = "pk.periodic_orbit finds one near a state"
        raise bad("system", problem, "a map, or a flow of two states without forcing", hint)
    return problem


def unrolled(problem: Problem) -> Problem:
    """A forced flow of one state as a flow on the cylinder, whose angle is the time."""
    if problem.kind != "symbolic":
        raise bad("system", problem, "formulas, of one state with a period in time")
    clock = str(problem.time)
    return Problem(
        {problem.state[0]: problem.f[0], clock: "1"}, parameters=problem.parameters,
        window=dict(problem.window), periods={**problem.periods, clock: problem.forcing_period},
    )  # fmt: skip


def _cells(problem: Problem, grid: Grid) -> Iterator[Problem | None]:
    """The problem of each cell; None where a parameter is none."""
    dims, shape = tuple(grid.sizes), tuple(grid.sizes.values())
    values = {name: grid.aligned(name, dims) for name in grid.inputs}
    for cell in np.ndindex(shape):
        own = {name: float(np.broadcast_to(x, shape)[cell]) for name, x in values.items()}
        valid = all(map(np.isfinite, own.values()))
        yield (problem.replace(**own) if dims else problem) if valid else None


class Limits(NamedTuple):
    """Limit cycles of one system, and why there may be others."""

    cycles: list[Cycle]
    reason: str
    lost: Sequence[str] = ()
    """Those that were met, and are missing."""
    doubts: Sequence[str] = ()
    """These, and what was seen that may hide others; without any the search is only no proof."""


def _of_one(problem: Problem, low: Array, high: Array) -> Limits:
    low, high = _whole_turns(problem, low, high)
    rests = equilibria_of(problem, low, high)
    found = cycles_of(problem, low, high, rests.x)
    turns = all_round(problem, low, high)
    # One on the edge may be outside, and one that may be two is not counted.
    counted = all(
        np.all((one.low >= low) & (one.high <= high) | (turns > 0.0))
        and one.is_single
        and abs(one.growth) > one.growth_error
        for one in found.cycles
    )
    if counted:
        number = len(found.cycles)
        most = most_cycles(problem, low, high, rests)
        if most > number and not (found.doubts or np.any(turns > 0.0)):
            most = most_by_dulac(problem, low, high, number)
        if most == number:
            return Limits(found.cycles, "")
    plane = _rectangle(problem, low, high)
    hole = (
        "it is not proved that f has a value everywhere, and cycles may go round where it has none"
    )
    why = [rests.why] if rests.why else [hole] if plane and not _is_defined(plane) else []
    return found._replace(reason="; ".join([*why, found.reason]))


def most_cycles(problem: Problem, low: Array, high: Array, rests: Equilibria) -> float:
    """How many cycles there are at most, as far as is proved at once; infinite where it is not.

    In the plane a cycle encloses an equilibrium that is no saddle. Where the divergence has one
    sign there is none, and on a cylinder at most one, as two that go round would enclose as much
    flow in as out (Bendixson, [GuckenheimerHolmes1983] section 1.8). All of this holds where f has
    a value everywhere: around a hole there may be a cycle without an equilibrium.
    """
    turns = all_round(problem, low, high)
    plane = _rectangle(problem, *_whole_turns(problem, low, high))
    if plane is None or np.all(turns > 0.0):
        return np.inf
    saddles = rests.complete and np.all(rests.kind == FlowEquilibriumKind.SADDLE)
    flat = not np.any(turns > 0.0)
    if flat and saddles and _is_defined(plane):
        return 0
    try:
        return (0 if flat else 1) if plane.diverges() else np.inf
    except NoRule:
        return np.inf


def most_by_dulac(problem: Problem, low: Array, high: Array, found: int) -> float:
    """The same of a rectangle in the plane by functions that are looked for."""
    plane = _rectangle(problem, low, high)
    try:
        return np.inf if plane is None else most_limit_cycles(plane, found)
    except NoRule:
        return np.inf


def _is_defined(plane: Rectangle) -> bool:
    try:
        return plane.is_defined()
    except NoRule:
        return False


def _rectangle(problem: Problem, low: Array, high: Array) -> Rectangle | None:
    """The formulas of a flow in a window; None where it has none."""
    if problem.kind != "symbolic":
        return None
    symbols = symbols_of([*problem.state, *problem.parameters])
    states = [symbols[name] for name in problem.state]
    values = {symbols[name]: float(value) for name, value in problem.parameters.items()}
    return rectangle(problem.f, states, values, low, high)


def all_round(problem: Problem, low: Array, high: Array) -> Array:
    """Periods of the states that are angles all round a window; 0 of others."""
    turns = np.array([problem.periods.get(name, 0.0) for name in problem.state])
    return np.where(high - low >= turns * (1.0 - ROUND), turns, 0.0)


def _whole_turns(problem: Problem, low: Array, high: Array) -> tuple[Array, Array]:
    """A window whose angles all round reach a little further than a turn, so that none is left."""
    least = all_round(problem, low, high) * (1.0 + ROUND)
    middle, half = 0.5 * (low + high), 0.5 * np.maximum(high - low, least)
    wide = half > 0.5 * (high - low)
    return np.where(wide, middle - half, low), np.where(wide, middle + half, high)


def cycles_of(problem: Problem, low: Array, high: Array, rests: Array) -> Limits:
    """Limit cycles between corners of a window, by the equilibria there, and what is not proved."""
    turns = all_round(problem, low, high)
    slopes = np.array([problem.derivatives(x)[1] for x in rests]).reshape(-1, 2, 2)
    law: Any = problem.law
    values = {name: float(problem.parameters[name]) for name in law.names}
    found = limit_cycles(law, values, Window(low, high, turns), rests, slopes)
    doubts = [*found.lost, *found.doubts]
    reason = "; ".join([*doubts, "sections were searched, and nothing is proved"])
    return Limits(found.cycles, reason, found.lost, doubts)


def _dataset(problem: Problem, grid: Grid, results: Sequence[Limits | None]) -> xr.Dataset:
    """Results of all cells, filled up to the greatest number of cycles and samples."""
    dims, shape = tuple(grid.sizes), tuple(grid.sizes.values())
    names = problem.state
    lists = [[] if one is None else one.cycles for one in results]
    most = max(map(len, lists), default=0)
    samples = max((len(cycle.time) for one in lists for cycle in one), default=0)
    count = len(results)
    scalars = {
        name: np.full((count, most), np.nan)
        for name in (
            "period", "period_error", "multiplier", "log_multiplier", "log_multiplier_error",
            *(f"{x}_{end}" for x in names for end in ("min", "max")),
        )
    }  # fmt: skip
    unstable, winding = np.zeros((count, most), np.int64), np.zeros((count, most), np.int64)
    along = np.full((3, count, most, samples), np.nan)
    for cell, one in enumerate(lists):
        for k, cycle in enumerate(one):
            own = {
                "period": cycle.period, "period_error": cycle.period_error,
                "log_multiplier": cycle.growth, "log_multiplier_error": cycle.growth_error,
            }  # fmt: skip
            with np.errstate(over="ignore", under="ignore"):
                own["multiplier"] = float(np.exp(cycle.growth))
            for i, name in enumerate(names):
                own |= {f"{name}_min": cycle.low[i], f"{name}_max": cycle.high[i]}
            for name, value in own.items():
                scalars[name][cell, k] = value
            decided = cycle.is_single and abs(cycle.growth) > cycle.growth_error
            unstable[cell, k] = int(cycle.growth > 0.0) if decided else -1
            winding[cell, k] = int(cycle.turns[np.argmax(np.abs(cycle.turns))])
            along[0, cell, k, : len(cycle.time)] = cycle.time
            along[1:, cell, k, : len(cycle.time)] = cycle.state.T
    number = np.array([-1 if one is None else len(one.cycles) for one in results], np.int64)
    if left := int(np.isinf(scalars["multiplier"]).sum()):
        warn(
            f"multiplier: those of {left} of {int(np.isfinite(scalars['period']).sum())} cycles "
            "are greater than any double; log_multiplier has their logarithms",
            RuntimeWarning,
        )
    if lost := [text for one in results if one is not None for text in one.lost]:
        warn(f"n_cycles: {len(lost)} were met and are missing: {lost[0]}", RuntimeWarning)
    complete = np.array([one is not None and not one.reason for one in results], bool)
    words = {
        "period": "period of the cycle",
        "period_error": "estimated error of the period",
        "multiplier": "multiplier of the cycle besides 1: below 1 it is stable",
        "log_multiplier": "logarithm of the multiplier: divergence along the cycle",
        "log_multiplier_error": "estimated error of the logarithm of the multiplier",
    }
    units = {name: problem.unit_of(name) or "1" for name in (*names, "time")}
    units |= dict.fromkeys(("period", "period_error"), units["time"])
    for name in names:
        for end, text in (("min", "least"), ("max", "greatest")):
            words[f"{name}_{end}"] = f"{text} {name} on the cycle"
            units[f"{name}_{end}"] = units[name]
    on, on_samples = (*dims, "cycle"), (*dims, "cycle", "sample")

    def laid(array: Any) -> Any:
        return array.reshape(shape + array.shape[1:])

    data = {
        name: variable(on, laid(array), {"long_name": words[name], "units": units.get(name, "1")})
        for name, array in scalars.items()
    }
    data["n_unstable"] = variable(
        on, laid(unstable), {"long_name": "multipliers above 1; -1: undecided"}
    )
    data["winding"] = variable(on, laid(winding), {"long_name": "turns of an angle in a period"})
    for name, array in zip(("time", *names), along, strict=True):
        attrs = {"long_name": f"{name} along the cycle", "units": units.get(name, "1")}
        data[f"cycle_{name}"] = variable(on_samples, laid(array), attrs)
    data["n_cycles"] = variable(dims, laid(number), {"long_name": "number of limit cycles"})
    data["complete"] = variable(dims, laid(complete), _completeness(results))
    coords = {
        **grid.coords,
        "cycle": variable(("cycle",), np.arange(most), {"long_name": "cycle, by its number"}),
        **{name: given for name, given in grid.inputs.items() if name not in grid.coords},
    }
    return xr.Dataset(data, coords, dataset_attrs(problem))


def _completeness(results: Sequence[Limits | None]) -> dict[str, str]:
    reasons = dict.fromkeys(one.reason for one in results if one is not None and one.reason)
    attrs = {"long_name": "whether these are proved to be all in the window"}
    return {**attrs, "reason": " | ".join(reasons)} if reasons else attrs


def _of_map(problem: Problem, window: Any, times: int) -> xr.Dataset:
    """Cycles of so many points of a map: fixed points of its iterate that no shorter one has."""
    low, high = corners(problem, window, "window")
    grid = loaded_grid(problem.parameters)
    dims, shape, n = tuple(grid.sizes), tuple(grid.sizes.values()), len(problem.state)
    found: list[tuple[Array, Array, bool] | None] = []
    reasons = []
    with notice("looking for cycles of a map"):
        for k, single in enumerate(_cells(problem, grid)):
            if single is None:
                found.append(None)
                continue
            points, multipliers, why = _cycles(single, low, high, times)
            found.append((points, multipliers, not why))
            reasons += [why] if why else []
            stage(f"{k + 1:,} of {int(np.prod(shape)):,} systems")
    most = max((len(one[0]) for one in found if one is not None), default=0)
    count = len(found)
    points = np.full((count, most, times, n), np.nan)
    multipliers = np.full((count, most, n), np.nan + 0j)
    number, complete = np.full(count, -1, np.int64), np.zeros(count, bool)
    for k, one in enumerate(found):
        if one is not None:
            part = slice(0, len(one[0]))
            points[k, part], multipliers[k, part] = one[0], one[1]
            number[k], complete[k] = len(one[0]), one[2]
    unstable = (np.abs(multipliers) > 1.0).sum(axis=-1)

    def laid(array: Any) -> Any:
        return array.reshape(shape + array.shape[1:])

    on = (*dims, "cycle")
    attrs = {"long_name": "whether these are proved to be all in the window"}
    if reasons:
        attrs["reason"] = " | ".join(dict.fromkeys(reasons))
    data = {
        "multiplier": variable(
            (*on, "eigenvalue_number"), laid(multipliers),
            {"long_name": "multipliers of the cycle, the least stable first"},
        ),
        "n_unstable": variable(on, laid(unstable), {"long_name": "multipliers of a size above 1"}),
        **{
            f"cycle_{name}": variable(
                (*on, "iterate"), laid(points[..., i]),
                {"long_name": f"{name} on the cycle", "units": problem.unit_of(name) or "1"},
            )
            for i, name in enumerate(problem.state)
        },
        "n_cycles": variable(dims, laid(number), {"long_name": f"number of {times}-cycles"}),
        "complete": variable(dims, laid(complete), attrs),
    }  # fmt: skip
    coords = {
        **grid.coords,
        "cycle": variable(("cycle",), np.arange(most), {"long_name": "cycle, by its number"}),
        **{name: given for name, given in grid.inputs.items() if name not in grid.coords},
    }
    return xr.Dataset(data, coords, dataset_attrs(problem))


def _cycles(problem: Problem, low: Array, high: Array, times: int) -> tuple[Array, Array, str]:
    """Cycles of one map, of shape (cycles, points, states), their multipliers, and what is open."""
    n = len(problem.state)
    found = equilibria_of(problem.iterated(times), low, high)
    left, cycles, multipliers = list(range(len(found.x))), [], []
    turns = np.array([problem.periods.get(name, np.inf) for name in problem.state])
    size = 1e-7 * (high - low)
    why = found.why

    def apart(x: Array, y: Array) -> Array:
        with np.errstate(invalid="ignore"):
            whole_ = np.where(np.isfinite(turns), turns * np.rint((x - y) / turns), 0.0)
        return np.abs(x - y - whole_) / size

    while left:
        x = found.x[left[0]]
        orbit = [x]
        for _ in range(times - 1):
            orbit.append(problem(orbit[-1]))
        first = left.pop(0)
        if any(np.all(apart(y, x) < 1.0) for y in orbit[1:]):
            continue  # a shorter cycle, run through several times
        inside = True
        for y in orbit[1:]:
            near = [k for k in left if np.all(apart(y, found.x[k]) < 1.0)]
            inside = inside and bool(near)
            left = [k for k in left if k not in near]
        if inside:
            cycles.append(orbit)
            multipliers.append(found.eigenvalues[first])
    shaped = np.array(cycles).reshape(-1, times, n)
    return shaped, np.array(multipliers).reshape(-1, n), why
