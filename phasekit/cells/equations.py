"""Cells of systems with states of their own: what computes the rows that their laws offer."""

from __future__ import annotations

import functools
import warnings
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np

from phasekit.arrays import Array
from phasekit.cells.formulas_along import asked_formulas
from phasekit.cells.start_grid import STARTS, StartGrid
from phasekit.errors import AttractorKind, FlowEquilibriumKind
from phasekit.labels.arguments import bad, numeric, unknown, whole
from phasekit.laws.equations import Equations
from phasekit.laws.formulas import symbols_of
from phasekit.laws.ladder import Flow, Law, Map
from phasekit.numerics.differences import EPSILON
from phasekit.systems.problem import Problem, as_problem
from phasekit.systems.rests import Equilibria, corners, equilibria_of_cells, natural_window
from phasekit.systems.smooth import jumping_formula, refuse_jumps
from phasekit.systems.waves import repeats
from phasekit.table.attractors import SLOTS
from phasekit.table.equations import parts_along, rows_of
from phasekit.table.quantities import TABLE
from phasekit.table.row import Pass, Table

#: Looks per period at a motion along its attractor, and parts of a look between which it is smooth.
LOOKS, SMOOTH = 256, 16
#: Part of the window about its middle in which motions start, each state at a place of its own.
ASIDE, GOLDEN = 0.1, 0.5 * (5.0**0.5 - 1.0)
#: Kinds of equilibria that attract.
STABLE = (FlowEquilibriumKind.STABLE_NODE, FlowEquilibriumKind.STABLE_FOCUS)
#: Looks at an attractor that does not repeat itself, and motions that are seen side by side.
MANY, BESIDE = 4096, 64
#: Longest period of an orbit with a multiplier of size 1 that is looked for, and how near, in
#: units of the states, a motion must have come.
LONG_MARGINAL, NEAR_MARGINAL = 8, 0.1


def table_of(system: Any, law: Equations, of: Any = ()) -> Table:
    """Return the rows that a system with such equations has, and what computes them.

    With rows of the table that hold of any flow, or of any map, such as a user's own; and with
    those of the formulas that are asked for, as in ``max(x*y)``.
    """
    observables = dict(getattr(system, "observables", {}))
    asked = asked_formulas(of, law, observables)
    if (span := law.period) is not None:  # along an orbit of that period others would be wrong
        for text, one in asked.items():
            if not repeats(one, span, law.time):
                raise bad("of", text, f"a formula that repeats itself after the period {span}")
        observables = {k: one for k, one in observables.items() if repeats(one, span, law.time)}
    observables |= asked
    own, passes = rows_of(law, observables), list[Pass]()
    rung: type[Law] = Map if isinstance(law, Map) else Flow

    def add(function: Callable[..., Any], more: Iterable[str], *groups: str) -> None:
        rows = tuple(row for row in own.values() if row.group in groups)
        passes.append(Pass(function, (*law.names, *more), groups, rung, rows=rows))

    states = tuple(f"state_{name}" for name in law.states)
    problem = problem_without_values(system) if law.time is None else None
    if problem is not None:
        rest = functools.partial(equilibria, problem, natural_window(system))
        passes.append(
            Pass(
                rest,
                tuple(problem.parameters),
                ("equilibria",),
                rung,
                rows=tuple(row for row in own.values() if row.group == "equilibria"),
            )
        )
    add(functools.partial(exponents, law), (*states, "time"), "lyapunov")
    along = functools.partial(along_attractor, law, observables)
    add(along, states, "period", "extrema")
    add(functools.partial(attractors, law), starts_of(law), "attractors")
    add(functools.partial(fractions, law), starts_of(law), "attractors", "basin_fractions")
    groups = {row.group for row in own.values()}
    fitting = [one for one in TABLE.fitting(system.standing) if groups.isdisjoint(one.groups)]
    theirs = {group for one in fitting for group in one.groups}
    others = [row for row in TABLE.rows.values() if row.group in theirs and row.name not in own]
    return Table((*own.values(), *others), (*passes, *fitting))


def starts_of(law: Equations) -> tuple[str, ...]:
    """Inputs that say from which states attractors are looked for: of each state a range."""
    return tuple(f"{end}_{name}" for name in law.states for end in ("starts", "first", "last"))


def chosen_starts(
    law: Equations, asked: Any, window: Mapping[str, tuple[float, float]]
) -> dict[str, float]:
    """These inputs, for a number of states in the window, or for a grid as of `attractors`."""
    grid = isinstance(asked, Mapping)
    if not grid:
        number = whole("starts", STARTS if asked is None else asked, "a number of states >= 1")
        each = max(int(number ** (1.0 / len(law.states)) + 1e-9), 1)
    for name in asked if grid else ():
        if name not in law.states:
            raise unknown("starts: state", name, law.states)
    found: dict[str, float] = {}
    for name in law.states:
        if grid and name in asked:
            argument = f"starts[{name!r}]"
            wants = "a number, or a 1-D array of increasing values at equal distances"
            axis = np.atleast_1d(np.asarray(numeric(argument, asked[name], None, wants), float))
            even = axis.ndim == 1 and axis.size and np.isfinite(axis).all()
            if even and axis.size > 1:
                steps = np.diff(axis)
                even = bool(np.ptp(steps) <= 1e-9 * np.ptp(axis)) and steps[0] > 0.0
            if not even:
                raise bad(argument, asked[name], wants)
            found[f"starts_{name}"] = float(axis.size)
            found[f"first_{name}"], found[f"last_{name}"] = float(axis[0]), float(axis[-1])
            continue
        if name in window:
            low, high = map(float, window[name])
        elif name in law.periods:
            low, high = -0.5 * law.periods[name], 0.5 * law.periods[name]
        elif name in law.start:
            low = high = float(law.start[name])
        else:
            wants = f"values of {name} as well, of which the system has no window"
            raise bad("starts", asked, wants, "as in starts={'x': np.linspace(-2, 2, 32), ...}")
        count = 1 if grid or low == high else each
        half = 0.5 * (high - low) / count
        found[f"starts_{name}"] = float(count)
        found[f"first_{name}"], found[f"last_{name}"] = low + half, high - half
    return found


def _grid_of(law: Equations, parameters: dict[str, float], given: list[float]) -> StartGrid:
    """The grid that such inputs say."""
    axes, fixed = dict[str, Array](), dict[str, Any]()
    for i, name in enumerate(law.states):
        count, first, last = given[3 * i : 3 * i + 3]
        if count > 1.0:
            axes[name] = np.linspace(first, last, int(count))
        else:
            fixed[name] = first
    if not axes:  # one state
        axes = {law.states[0]: np.array([fixed.pop(law.states[0])])}
    return StartGrid(law, axes, fixed, parameters)


def problem_without_values(system: Any) -> Problem:
    """The problem of a system without its values, which each cell brings."""
    problem = as_problem(system, arrays=True)
    return problem.replace(**dict.fromkeys(problem.parameters, 0.0))


def each_cell(
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


def equilibria(problem: Problem, window: Any, *arrays: Any) -> dict[str, Any]:
    """Equilibria in a window, by default that of the problem, of each cell."""
    low, high = corners(problem, window)
    shape, cells = each_cell(len(arrays), arrays)
    names, size = tuple(problem.parameters), int(np.prod(shape, dtype=int))
    own = {k: problem.replace(**dict(zip(names, values, strict=True))) for k, values, _ in cells}
    if jumping_formula(problem, problem.parameters):
        for one in own.values():
            refuse_jumps(one)
    ones = dict(zip(own, equilibria_of_cells(list(own.values()), low, high), strict=True))
    return _back(shape, tabulated(ones, size, len(problem.state)))


def tabulated(ones: Mapping[int, Equilibria], size: int, n: int) -> dict[str, Any]:
    """Equilibria of some of so many cells, by the names of their rows, filled up to the most."""
    most = max((len(one.x) for one in ones.values()), default=0)
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
    return found


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

    shape, cells = each_cell(len(law.names), arrays)
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
    for k, own, given in cells:
        parameters = dict(zip(law.names, own, strict=True))
        grid = _grid_of(law, parameters, given)
        states = grid.states()
        values = {name: np.asarray(value) for name, value in parameters.items()}
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", RuntimeWarning)  # what is open stands in the shares
            search = find_of(law, values, grid.starts(), grid.widths)
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

    shape, cells = each_cell(len(law.names), arrays)
    size = int(np.prod(shape, dtype=int))
    period, found = np.full(size, np.nan), list[_Attracted]()
    names = (*law.states, *observables)
    ends = {part: np.full(size, np.nan) for name in names for part in parts_along(name)}
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
            one = next(iter(search.found), None)
            if one is not None and one.kind is AttractorKind.UNKNOWN:
                one = _marginal(law, values, search, one)
        if one is not None:
            period[k] = one.period
            found.append(_Attracted(k, own, search, one))
    for cell, times, states in _ways_along(law, found):
        off = cell.search.rtol * np.maximum(np.abs(states).max(axis=0), cell.search.units)
        data = {name: (states[:, i], float(off[i])) for i, name in enumerate(law.states)}
        with np.errstate(all="ignore"):
            for name, function in functions.items():
                moved = np.stack([states, *(states + step for step in np.diag(off))])
                column, *beside = np.broadcast_to(
                    function(*np.moveaxis(moved, 2, 0), *cell.own, times), moved.shape[:2]
                )
                rounding = sum((float(np.abs(one - column).max()) for one in beside), 0.0)
                data[name] = column, rounding + EPSILON * float(np.abs(column).max())
        for name, (column, rounding) in data.items():
            seen = _ends_of(law, cell.one, column, rounding)
            for part, value in zip(parts_along(name), seen, strict=True):
                ends[part][cell.place] = value
    return _back(shape, {"period": period}), _back(shape, ends)


class _Attracted(NamedTuple):
    """The attractor to which the motion of one cell comes."""

    place: int
    own: list[float]
    search: Any
    one: Any


def _marginal(law: Equations, values: Mapping[str, Any], search: Any, one: Any) -> Any:
    """The periodic orbit with a multiplier of size 1 that a motion comes to, if it does.

    It comes the nearer, the slower: by the terms of higher order.
    """
    from phasekit.motion.variational import returned

    if law.time is None and not isinstance(law, Map):
        return None
    points, steps = one.points, search.leg
    for q in range(1, LONG_MARGINAL + 1):
        near = points[-2 * q * (len(points) // (4 * q)) :: q].mean(axis=0)
        closed = returned(law, values, near, q * steps, search.units, NEAR_MARGINAL)
        if closed is None:
            continue
        growth = float(np.abs(np.linalg.eigvals(closed[1])).max())
        first, last = (
            float(search.apart(points[part], closed[0]).max()) for part in _parts(len(points), q)
        )
        if abs(growth - 1.0) < 1e-6 and last < min(first, NEAR_MARGINAL):
            orbit = search.run(closed[0][None], q, 0).states[0]
            return replace(one, kind=AttractorKind.CYCLE, points=orbit, multiplier=1.0)
    return None


def _parts(size: int, q: int) -> tuple[slice, slice]:
    """Every q-th state of the first and the last tenth."""
    tenth = max(size // 10, q)
    begin = (size - 1) % q
    return slice(begin, tenth, q), slice(begin + q * ((size - tenth) // q), None, q)


def _ways_along(
    law: Equations, found: Sequence[_Attracted]
) -> Iterator[tuple[_Attracted, Array, Array]]:
    """Times and states along attractors, of periodic ones over one period and its end."""
    from phasekit.motion.strobe import strobe

    moving: dict[int, list[tuple[_Attracted, float]]] = {}
    for cell in found:
        one, steps = cell.one, isinstance(law, Map)
        if one.is_periodic and (steps or one.period == 0.0):
            yield cell, np.arange(float(len(one.points))), one.points
        elif not one.is_periodic:
            leg = cell.search.leg / (1.0 if steps or law.time is None else SMOOTH)
            moving.setdefault(MANY, []).append((cell, leg))
        else:
            forced = law.time is not None
            turns = max(int(one.period), 1) if forced else 1
            whole = one.period * (cell.search.leg if forced else 1.0)
            looks = LOOKS * SMOOTH * turns
            moving.setdefault(looks, []).append((cell, whole / looks))
    for looks, many in moving.items():  # those of as many looks side by side
        cells, legs = [cell for cell, _ in many], np.array([leg for _, leg in many])
        for part in range(0, len(cells), BESIDE):
            some, leg = cells[part : part + BESIDE], legs[part : part + BESIDE]
            columns = np.array([cell.own for cell in some]).reshape(len(some), -1).T
            values = dict(zip(law.names, columns, strict=True))
            states = np.array([cell.one.points[0] for cell in some])
            seen = strobe(law, values, states, leg, looks + 1, steps=some[0].search.steps)
            for i, cell in enumerate(some):
                yield cell, leg[i] * np.arange(looks + 1.0), np.asarray(seen.states[i])


def _ends_of(law: Equations, one: Any, column: Array, rounding: float) -> tuple[float, ...]:
    """Least, greatest and mean value along an attractor, and the errors of the first two.

    The states are off by a part of themselves or of their units, and so is what has no size.
    """
    if len(column) == 1 or (one.is_periodic and isinstance(law, Map)):
        return column.min(), column.max(), column.mean(), rounding, rounding
    if not one.is_periodic:  # seen for so long: what the halves differ by
        half = len(column) // 2
        first, last = column[:half], column[half:]
        below, above = abs(first.min() - last.min()), abs(first.max() - last.max())
        return column.min(), column.max(), column.mean(), below + rounding, above + rounding
    closed = abs(float(column[-1] - column[0]))  # what a period is not closed by
    (low, below), (high, above) = peak(-column[:-1]), peak(column[:-1])
    return -low, high, column[:-1].mean(), below + closed + rounding, above + closed + rounding


def peak(column: Array) -> tuple[float, float]:
    """The greatest value of a smooth periodic function seen at equal distances, and its error.

    By a quartic through five values; the error is its distance from the parabola.
    """
    top = int(np.argmax(column))
    v = np.take(column, range(top - 2, top + 3), mode="wrap")
    slope, bend = 0.5 * (v[3] - v[1]), v[3] - 2.0 * v[2] + v[1]
    if not bend < 0.0:
        return float(v[2]), float(np.ptp(v))
    parabola = float(v[2] - slope**2 / (2.0 * bend))
    d1 = (v[0] - 8.0 * v[1] + 8.0 * v[3] - v[4]) / 12.0
    d2 = (-v[0] + 16.0 * v[1] - 30.0 * v[2] + 16.0 * v[3] - v[4]) / 12.0
    d3 = (-v[0] + 2.0 * v[1] - 2.0 * v[3] + v[4]) / 2.0
    d4 = v[0] - 4.0 * v[1] + 6.0 * v[2] - 4.0 * v[3] + v[4]
    x = -slope / bend
    for _ in range(4):
        x -= (d1 + x * (d2 + x * (d3 / 2.0 + x * d4 / 6.0))) / (d2 + x * (d3 + x * d4 / 2.0))
    quartic = float(v[2] + x * (d1 + x * (d2 / 2.0 + x * (d3 / 6.0 + x * d4 / 24.0))))
    if not abs(x) <= 1.0:
        return parabola, float(np.ptp(v[1:4]))
    return quartic, abs(quartic - parabola)


def start_of(law: Equations, name: str) -> float:
    """Where motions start that are told no other state: as the law has it, or about mid-window.

    In the middle itself motions of symmetric laws may stay where no others come.
    """
    if name in law.start:
        return float(law.start[name])
    if name in law.window:
        low, high = law.window[name]
        aside = GOLDEN * (law.states.index(name) + 1) % 1.0 - 0.5
        return float(low + (0.5 + ASIDE * aside) * (high - low))
    raise bad(name, None, f"a state at the start, {name}=, or a window of it")
