"""Cells of systems with states of their own: what computes the rows that their laws offer."""

from __future__ import annotations

import functools
import warnings
from collections.abc import Callable, Iterable, Iterator, Mapping
from typing import Any

import numpy as np
import numpy.typing as npt

from phasekit.cells.start_grid import start_grid
from phasekit.errors import AttractorKind, FlowEquilibriumKind
from phasekit.labels.arguments import bad
from phasekit.laws.equations import Equations
from phasekit.laws.formulas import symbols_of
from phasekit.laws.ladder import Flow, Law, Map
from phasekit.systems.problem import Problem, as_problem
from phasekit.systems.rests import corners, equilibria_of
from phasekit.table.attractors import SLOTS
from phasekit.table.equations import rows_of
from phasekit.table.quantities import TABLE
from phasekit.table.row import Pass, Table

Array = npt.NDArray[np.float64]

#: Looks per period at a motion along its attractor, and parts of a look between which it is smooth.
LOOKS, SMOOTH = 256, 16
#: Kinds of equilibria that attract.
STABLE = (FlowEquilibriumKind.STABLE_NODE, FlowEquilibriumKind.STABLE_FOCUS)
#: Looks at an attractor that does not repeat itself.
MANY = 4096


def table_of(system: Any, law: Equations) -> Table:
    """Return the rows that a system with such equations has, and what computes them.

    With rows of the table that hold of any flow, or of any map, such as a user's own.
    """
    observables = dict(getattr(system, "observables", {}))
    own, passes = rows_of(law, observables), list[Pass]()
    rung: type[Law] = Map if isinstance(law, Map) else Flow

    def add(function: Callable[..., Any], more: Iterable[str], *groups: str) -> None:
        rows = tuple(row for row in own.values() if row.group in groups)
        passes.append(Pass(function, (*law.names, *more), groups, rung, rows=rows))

    starts = tuple(f"state_{name}" for name in law.states)
    if law.time is None:
        add(functools.partial(equilibria, _unset(system)), (), "equilibria")
    add(functools.partial(exponents, law), (*starts, "time"), "lyapunov")
    along = functools.partial(along_attractor, law, observables)
    add(along, starts, "period", "extrema")
    add(functools.partial(attractors, law), (), "attractors")
    add(functools.partial(fractions, law), (), "attractors", "basin_fractions")
    groups = {row.group for row in own.values()}
    fitting = [one for one in TABLE.fitting(system.standing) if groups.isdisjoint(one.groups)]
    theirs = {group for one in fitting for group in one.groups}
    others = [row for row in TABLE.rows.values() if row.group in theirs and row.name not in own]
    return Table((*own.values(), *others), (*passes, *fitting))


def _unset(system: Any) -> Problem:
    """The problem of a system without its values, which each cell brings."""
    problem = as_problem(system, arrays=True)
    return problem.replace(**dict.fromkeys(problem.parameters, 0.0))


def _cells(
    count: int, arrays: Iterable[Any]
) -> tuple[tuple[int, ...], Iterator[tuple[int, list[float], list[float]]]]:
    """The shape of cells, and of each that has numbers its place, parameters and other values."""
    given = [np.asarray(array, dtype=float) for array in arrays]
    shape = np.broadcast_shapes(*(array.shape for array in given))
    flat = [np.broadcast_to(array, shape).ravel() for array in given]

    def each() -> Iterator[tuple[int, list[float], list[float]]]:
        for k in range(int(np.prod(shape, dtype=int))):
            own = [float(column[k]) for column in flat]
            if np.isfinite(own).all():
                yield k, own[:count], own[count:]

    return shape, each()


def _back(shape: tuple[int, ...], found: Mapping[str, Any]) -> dict[str, Any]:
    return {name: values.reshape(shape + values.shape[1:]) for name, values in found.items()}


def equilibria(problem: Problem, *arrays: Any) -> dict[str, Any]:
    """Equilibria in the window, of each cell."""
    low, high = corners(problem, None)
    shape, cells = _cells(len(arrays), arrays)
    names, size = tuple(problem.parameters), int(np.prod(shape, dtype=int))
    ones = {
        k: equilibria_of(problem.replace(**dict(zip(names, own, strict=True))), low, high)
        for k, own, _ in cells
    }
    n, most = len(problem.state), max((len(one.x) for one in ones.values()), default=0)
    found: dict[str, Any] = {
        "x": np.full((size, most, n), np.nan),
        "eigenvalue": np.full((size, most, n), np.nan + 0j),
        "kind": np.zeros((size, most), np.int8),
        "n_unstable": np.zeros((size, most), np.int64),
        "n_equilibria": np.full(size, -1, np.int64),
        "n_stable": np.full(size, -1, np.int64),
        "complete": np.zeros(size, bool),
    }
    for k, one in ones.items():
        part = slice(0, len(one.x))
        found["x"][k, part], found["eigenvalue"][k, part] = one.x, one.eigenvalues
        found["kind"][k, part], found["n_unstable"][k, part] = one.kind, one.n_unstable
        found["n_equilibria"][k], found["complete"][k] = len(one.x), one.complete
        found["n_stable"][k] = np.isin(one.kind, STABLE).sum()
    return _back(shape, found)


def exponents(law: Equations, *arrays: Any) -> dict[str, Any]:
    """All Lyapunov exponents of motions from states."""
    from phasekit.motion.exponents import exponents as compute

    return compute(law, *arrays, count=len(law.states))


def attractors(law: Equations, *arrays: Any) -> dict[str, Any]:
    """Attractors to which motions from states in the window come."""
    return _found(law, arrays, shares=False)


def fractions(law: Equations, *arrays: Any) -> tuple[dict[str, Any], dict[str, Any]]:
    """The same, and the shares of their basins."""
    found = _found(law, arrays, shares=True)
    own = {"basin_fraction", "basin_fraction_error", "remaining_fraction", "escaped_fraction"}
    return (
        {name: values for name, values in found.items() if name not in own},
        {name: values for name, values in found.items() if name in own},
    )


def _found(law: Equations, arrays: Iterable[Any], *, shares: bool) -> dict[str, Any]:
    from phasekit.motion.attractors import find_of
    from phasekit.motion.basins import ESCAPED, basins

    shape, cells = _cells(len(law.names), arrays)
    size = int(np.prod(shape, dtype=int))
    rows = {
        name: row
        for name, row in rows_of(law).items()
        if row.group == "attractors" or (shares and row.group == "basin_fractions")
    }
    found: dict[str, Any] = {
        name: np.full(
            (size, *row.label_shape), np.nan if row.dtype == "float64" else -1, row.dtype
        )
        for name, row in rows.items()
    }  # fmt: skip
    for k, own, _ in cells:
        parameters = dict(zip(law.names, own, strict=True))
        grid = start_grid(law, parameters, None, None)
        states = grid.starts()
        values = {name: np.asarray(value) for name, value in parameters.items()}
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", RuntimeWarning)  # what is open stands in the shares
            search = find_of(law, values, states, grid.widths)
            places = {0: np.arange(len(states), dtype=float)}
            spread = basins(search, places, states) if shares else None
        one = search.result()
        part = slice(0, min(len(one.kind), SLOTS))
        named = {
            **{f"attractor_{name}": one.state[:, 0, i] for i, name in enumerate(law.states)},
            **{f"attractor_{name}": getattr(one, name) for name in one._fields if name != "state"},
        }
        if spread is not None:
            named["basin_fraction"] = spread.basin_fraction
            named["basin_fraction_error"] = spread.basin_fraction_error
            found["escaped_fraction"][k] = np.mean(spread.basin == ESCAPED)
            found["remaining_fraction"][k] = 1.0 - spread.basin_fraction[part].sum()
        for name, column in named.items():
            if name in found:
                found[name][k, part] = column[part]
        found["n_attractors"][k] = len(one.kind)
    return _back(shape, found)


def along_attractor(
    law: Equations, observables: Mapping[str, Any], *arrays: Any
) -> tuple[dict[str, Any], dict[str, Any]]:
    """Period of the attractor to which one motion comes; extremes and means along it."""
    import sympy as sp

    from phasekit.motion.attractors import find_of

    shape, cells = _cells(len(law.names), arrays)
    size = int(np.prod(shape, dtype=int))
    period = np.full(size, np.nan)
    names = (*law.states, *observables)
    ends = {f"{w}_{name}": np.full(size, np.nan) for name in names for w in ("min", "max", "mean")}
    symbols = symbols_of([*law.states, *law.names, law.time or "time"])
    functions = {
        name: sp.lambdify(list(symbols.values()), formula, ["scipy", "numpy"])
        for name, formula in observables.items()
    }
    widths = np.array([np.ptp(law.window.get(name, (0.0, 0.0))) for name in law.states])
    for k, own, start in cells:
        values = {name: np.asarray(value) for name, value in zip(law.names, own, strict=True)}
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", RuntimeWarning)  # NaN says which are lost
            search = find_of(law, values, np.array([start]), widths)
            if not search.found or search.found[0].kind is AttractorKind.UNKNOWN:
                continue
            one = search.found[0]
            period[k] = one.period
            times, states = _way_along(law, values, search, one)
        data = {name: states[:, i] for i, name in enumerate(law.states)}
        with np.errstate(all="ignore"):
            for name, function in functions.items():
                data[name] = np.broadcast_to(function(*states.T, *own, times), len(states))
        for name, column in data.items():
            smooth = not isinstance(law, Map) and len(column) > 1
            ends[f"min_{name}"][k] = -_peak(-column) if smooth else column.min()
            ends[f"max_{name}"][k] = _peak(column) if smooth else column.max()
            ends[f"mean_{name}"][k] = column[: max(len(column) - smooth, 1)].mean()
    return _back(shape, {"period": period}), _back(shape, ends)


def _way_along(
    law: Equations, values: Mapping[str, Any], search: Any, one: Any
) -> tuple[Array, Array]:
    """Times and states along an attractor, of a periodic one over one period and its end."""
    from phasekit.motion.strobe import strobe

    if isinstance(law, Map) or one.period == 0.0 and one.is_periodic:
        points = one.points if one.is_periodic else _more(law, values, search, one)
        return np.arange(float(len(points))), points
    if not one.is_periodic:
        looks, leg = MANY, search.leg / (SMOOTH if law.time is not None else 1.0)
    else:
        whole = one.period if law.time is None else one.period * search.leg
        looks = LOOKS * SMOOTH * (1 if law.time is None else max(int(one.period), 1))
        leg = whole / looks
    found = strobe(law, values, one.points[:1], leg, looks + 1, **search.tolerances)
    times: Array = leg * np.arange(looks + 1.0)
    return times, np.asarray(found.states[0])


def _more(law: Equations, values: Mapping[str, Any], search: Any, one: Any) -> Array:
    """More iterates on an attractor that does not repeat itself."""
    from phasekit.motion.strobe import strobe

    found = strobe(law, values, one.points[-1:], search.leg, MANY, **search.tolerances)
    return np.asarray(found.states[0])


def _peak(column: Array) -> float:
    """The greatest value of a smooth function seen at equal distances, by a parabola."""
    top = int(np.argmax(column))
    if not 0 < top < len(column) - 1:
        return float(column[top])
    before, at, after = column[top - 1 : top + 2]
    bend = before - 2.0 * at + after
    return float(at - (after - before) ** 2 / (8.0 * bend)) if bend < 0.0 else float(at)


def start_of(law: Equations, name: str) -> float:
    """Where motions start that are told no other state: as the law has it, or in mid-window.

    Raises
    ------
    ParameterError
        If there is neither.
    """
    if name in law.start:
        return float(law.start[name])
    if name in law.window:
        return 0.5 * float(sum(law.window[name]))
    raise bad(name, None, f"a state at the start, {name}=, or a window of it")
