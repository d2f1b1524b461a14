"""Branches of equilibria in cells: what is found along one parameter, for values of the others."""

from __future__ import annotations

import contextlib
import functools
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any, NamedTuple

import numpy as np

from phasekit.arrays import Array
from phasekit.bifurcation.continuation.connected import Traced, connected, first_traced
from phasekit.bifurcation.continuation.curve import Curve
from phasekit.bifurcation.continuation.kernels.defining import FLIP, FOLD, HOPF, TORUS
from phasekit.bifurcation.continuation.options import ContinuationOptions
from phasekit.bifurcation.continuation.path import turned
from phasekit.bifurcation.continuation.points.branch_point import meets, singular_point
from phasekit.bifurcation.continuation.points.hopf_families import Family
from phasekit.bifurcation.continuation.points.special import CONVERGED, Special, polish
from phasekit.bifurcation.continuation.walk import Stop, run, search
from phasekit.bifurcation.special_points import KINDS
from phasekit.cells.equations import each_cell, problem_without_values
from phasekit.cycles import collocation
from phasekit.cycles.cycle_walk import CycleWalk
from phasekit.cycles.cycles import Cycles, Orbit
from phasekit.cycles.stable_spans import most, overlaps, stable_cycles, stable_spans
from phasekit.errors import BranchStatus, ConvergenceError, PointStatus, SpecialPointKind
from phasekit.labels.arguments import bad, pair, unknown
from phasekit.laws.ladder import Flow, Law, Map
from phasekit.systems.cycle_families import hopf_families, hopf_family
from phasekit.systems.problem import Problem, as_problem
from phasekit.systems.problem_parts import equilibrium_curve
from phasekit.systems.rests import corners, natural_window, states_of_cells
from phasekit.systems.smooth import refuse_jumps
from phasekit.systems.system import System
from phasekit.table.along import COEFFICIENT, COUNTED, GROUPS, OF_CYCLES, rows_of
from phasekit.table.row import Pass, Table

#: How near a Hopf point a family ends that shrinks to it, on scaled axes and in the period.
NEAR = 1e-2
UNFINISHED = ("max_points", "stuck", "not_finite")


class CycleFamily(NamedTuple):
    """A family of periodic orbits: rows (least, greatest), and the spans where it is stable."""

    extent: Array
    period: Array
    states: Array  # a row each
    stable: Array
    finished: bool


def families_of(
    problem: Problem, points: Iterable[tuple[Curve, Special]], options: ContinuationOptions
) -> tuple[list[CycleFamily], bool]:
    """The families that begin at Hopf points, each once, and whether any could not be followed.

    A family may end at another of the Hopf points, and does not begin there again.
    """
    hopf = [(curve, one) for curve, one in points if one.kind == "hopf"]
    found: list[CycleFamily] = []
    ended: set[int] = set()
    cut = any(special.status != CONVERGED for _, special in hopf)
    for k, (curve, special) in enumerate(hopf):
        if special.status != CONVERGED or k in ended:
            continue
        for family in hopf_families(curve, special.u[: curve.m])[0]:
            try:
                one, end = _followed(problem, hopf, k, family, options)
            except (ConvergenceError, np.linalg.LinAlgError):
                cut = True
                continue
            found.append(one)
            ended.add(end)
    return found, cut


def _followed(
    problem: Problem, hopf: Sequence[tuple[Curve, Special]], begins: int, family: Family,
    options: ContinuationOptions,
) -> tuple[CycleFamily, int]:  # fmt: skip
    """One family, and the place of the Hopf point at which it ends; -1: at none of these."""
    curve, special = hopf[begins]
    n = curve.n
    cycles, start = hopf_family(problem, curve, special, family, options)
    walker = CycleWalk(cycles)
    tracks = run(walker, start, "forward")
    path, specials, _ = search(walker, start, tracks, Stop("hopf", ""))
    orbits = [one.orbit for one in path.points]
    last, stop = orbits[path.count - 1], path.stops[1]
    orbits += [one.point.orbit for one in specials if one.kind != "end"]
    extremes = np.array([collocation.extremes(one.x, cycles.m) for one in orbits])
    end = _ends_at(cycles, last, hopf, begins) if stop.reason == "hopf" else -1
    ends = [float(hopf[k][1].u[n]) for k in (begins, end) if k >= 0]
    values = np.array([*ends, *(one.y[1] for one in orbits)])
    periods = np.array([2.0 * np.pi / family.omega, *(one.y[0] for one in orbits)])
    states = np.column_stack([extremes[:, 0].min(axis=0), extremes[:, 1].max(axis=0)])
    found = CycleFamily(
        np.array([values.min(), values.max()]), np.array([periods.min(), periods.max()]),
        states, stable_cycles(cycles, path, specials, *ends), stop.reason not in UNFINISHED,
    )  # fmt: skip
    return found, end


def _ends_at(
    cycles: Cycles, last: Orbit, hopf: Sequence[tuple[Curve, Special]], begins: int
) -> int:
    """The place of the Hopf point that the last orbit of a family surrounds; -1: none of these.

    The nearest one, no farther than the orbit is large: it stands next to the point, not on it.
    """
    curve = hopf[begins][0]
    n = curve.n
    scale = np.append(curve.scale[:n], curve.high[n] - curve.low[n])
    low, high = collocation.extremes(last.x, cycles.m)
    reach = max(NEAR, float(np.max((high - low) / scale[:n])))
    middle = np.append(collocation.mean(last.mesh, last.x, cycles.m), last.y[1])
    gaps = [
        np.inf
        if k == begins
        else max(
            float(np.max(np.abs(one.u[: n + 1] - middle) / scale)),
            abs(float(last.y[0]) * one.normal_form["omega"] / (2.0 * np.pi) - 1.0),
        )
        for k, (_, one) in enumerate(hopf)
    ]
    nearest = int(np.argmin(gaps))
    return nearest if gaps[nearest] <= reach else -1


DEPTH = 3  # how many times branches are switched in a row
SAME = 1e-8  # distance on scaled axes within which points of two branches are one
#: The same of a point that two defining systems gave.
FOUND = 1e-5
#: How many times shorter steps are where a cell lacks what its neighbours have.
CAREFUL = 5.0


def ends_of(parameter: str) -> tuple[str, str]:
    """Inputs that say from where to where branches go."""
    return f"first_{parameter}", f"last_{parameter}"


def parameter_along(names: Iterable[str], inputs: Iterable[str]) -> str | None:
    """The parameter along which branches go, by the names of a map's inputs."""
    known = set(inputs)
    return next((name for name in names if known.issuperset(ends_of(name))), None)


def check_along(system: System, along: Any, axes: Iterable[str]) -> tuple[str, dict[str, float]]:
    """The parameter of branches, and the inputs that say their span."""
    law = system.own_equations
    if law is None:
        raise bad(
            "along", along, "None, for maps of a system that states no equations of its own",
            "pk.bifurcation_set answers a rotor; pk.sweep(pk.Problem(...), along=...) the rest",
        )  # fmt: skip
    wants = "a parameter and its span, as in along=('p', (0.0, 1.0))"
    if not isinstance(along, (tuple, list)) or len(along) != 2:
        raise bad("along", along, wants)
    name, span = along
    if not isinstance(name, str) or name not in system.parameters:
        raise unknown("along: parameter of the system", name, system.parameters)
    low, high = pair("along", span, "two finite numbers, low < high", system.unit_of(name))
    if not low < high:
        raise bad("along", span, "two finite numbers, low < high")
    if name in axes or not isinstance(system.parameters[name], float):
        raise bad("along", name, f"a parameter that is no axis of the map; {name} is one")
    if law.time is not None:
        raise bad("system", system, "one whose f does not depend on time, for branches along=")
    problem = problem_without_values(system)
    corners(problem, natural_window(system), "window")
    equilibrium_curve(problem.replace(**{name: low}), name, (low, high), ContinuationOptions())
    return name, dict(zip(ends_of(name), (low, high), strict=True))


def table_along(system: System, parameter: str, of: Iterable[str]) -> Table:
    """The rows that a map of branches in a parameter has, and what computes them.

    Families of periodic orbits are followed where a row ``of`` theirs is asked for.
    """
    law = system.own_equations
    assert law is not None
    rung: type[Law] = Map if isinstance(law, Map) else Flow
    problem = problem_without_values(system)
    rows = rows_of(law, parameter)
    others = tuple(name for name in problem.parameters if name != parameter)
    cycles = {OF_CYCLES, *(row.name for row in rows.values() if row.group == OF_CYCLES)}
    asked = not cycles.isdisjoint(of) and any(row.group == OF_CYCLES for row in rows.values())
    groups = (*GROUPS, OF_CYCLES) if asked else GROUPS
    function = functools.partial(branches, problem, natural_window(system), parameter, asked)
    chosen = tuple(row for row in rows.values() if row.group in groups)
    inputs = (*others, *ends_of(parameter))
    return Table(chosen, [Pass(function, inputs, groups, rung, rows=chosen)])


def branches(
    problem: Problem, window: Any, parameter: str, cycles: bool, *arrays: Any
) -> tuple[dict[str, Any], ...]:
    """Special points, stable equilibria and hysteresis of the branches of each cell."""
    shape, cells = each_cell(len(problem.parameters) - 1, arrays)
    names = [name for name in problem.parameters if name != parameter]
    corner = corners(problem, window)
    own = {}
    for k, values, (low, high) in cells:
        at = {**dict(zip(names, values, strict=True)), parameter: low}
        own[k] = _Cell(problem.replace(**at), (low, high))
    _start(own, parameter, corner)
    _follow(list(own.values()), parameter, ContinuationOptions())
    for k, beside in _alone(shape, own).items():
        own[k] = _followed_again(own[k], parameter, beside)
    if cycles:
        for cell in own.values():
            _follow_cycles(cell)
        return (*_tabulated(problem, parameter, shape, own), _tabulated_cycles(problem, shape, own))
    return _tabulated(problem, parameter, shape, own)


def branches_of(
    system: System, parameter: str, span: tuple[float, float]
) -> tuple[Problem, list[Traced]]:
    """The problem of a system at the lower end of a span, and all branches, as in a cell."""
    problem = as_problem(system)
    cell = _Cell(problem.replace(**{parameter: span[0]}), span)
    _start({0: cell}, parameter, corners(problem, natural_window(system)))
    curve = equilibrium_curve(cell.problem, parameter, span, ContinuationOptions())
    return cell.problem, connected(curve, cell.starts, DEPTH)


@dataclass
class _Cell:
    """One cell: its problem, from where its branches are followed, and what they are."""

    problem: Problem
    span: tuple[float, float]
    starts: list[Array] = field(default_factory=list)
    proved: bool = False
    traced: list[Traced] = field(default_factory=list)
    failure: str = ""
    missed: bool = False
    families: list[CycleFamily] = field(default_factory=list)
    cut: bool = False

    @functools.cached_property
    def points(self) -> list[tuple[Curve, Special]]:
        """The special points of all branches, once each, by their parameter."""
        found: list[tuple[Curve, Special]] = []
        for one in self.traced:
            m = one.curve.m
            others = tuple(found)  # of one branch each point is there once
            for special in one.specials:
                gaps = (
                    np.abs(turned(one.curve, special.u[:m] - other.u[:m]) / one.curve.scale[:m])
                    for _, other in others
                    if KINDS[other.kind].label == KINDS[special.kind].label
                )
                if all(np.max(gap) > SAME for gap in gaps):
                    found.append((one.curve, special))
        n = len(self.problem.state)
        return sorted(found, key=lambda point: float(point[1].u[n]))

    @functools.cached_property
    def stable(self) -> Array:
        """Spans over which a branch is stable, rows (low, high)."""
        spans = [np.clip(stable_spans(one), *self.span) for one in self.traced]
        return np.concatenate([np.empty((0, 2)), *spans])

    @functools.cached_property
    def counts(self) -> tuple[int, ...]:
        """How many special points there are of each label."""
        labels = [KINDS[special.kind].label for _, special in self.points]
        return tuple(labels.count(label) for label in COUNTED)

    @property
    def status(self) -> BranchStatus:
        """Whether these are all branches."""
        if self.failure:
            return BranchStatus.FAILED
        if not self.starts and self.proved:
            return BranchStatus.NO_EQUILIBRIUM
        unfinished = any(one.unfinished for one in self.traced)
        if unfinished or self.cut or not all(one.finished for one in self.families):
            return BranchStatus.CUT
        if self.missed:
            return BranchStatus.MISSED
        return BranchStatus.COMPLETE if self.proved else BranchStatus.UNPROVED


def _start(own: Mapping[int, _Cell], parameter: str, corner: tuple[Array, Array]) -> None:
    """Look for the equilibria in the window at both ends of the span."""
    for end in (0, 1):
        problems = [cell.problem for cell in own.values()]  # at the lower end
        if end:
            problems = [cell.problem.replace(**{parameter: cell.span[1]}) for cell in own.values()]
        for cell, (found, why) in zip(
            own.values(), states_of_cells(problems, *corner), strict=True
        ):
            cell.starts += [np.append(x, cell.span[end]) for x in found]
            cell.proved = not why and (cell.proved or end == 0)


def _follow(cells: Sequence[_Cell], parameter: str, options: ContinuationOptions) -> None:
    """Follow the branches of cells."""
    begin = [cell for cell in cells if cell.starts]
    curves = _curves(begin, parameter, options)
    firsts = first_traced(curves, [cell.starts[0] for cell in begin])
    for cell, curve, first in zip(begin, curves, firsts, strict=True):
        try:
            if isinstance(first, Exception):
                raise first
            cell.traced = connected(curve, cell.starts, DEPTH, first)
        except (ConvergenceError, np.linalg.LinAlgError) as error:
            cell.failure = str(error) or type(error).__name__


def _curves(cells: Sequence[_Cell], parameter: str, options: ContinuationOptions) -> list[Curve]:
    """The curves of cells, which differ in their parameters and spans alone."""
    if not cells:
        return []
    first = equilibrium_curve(cells[0].problem, parameter, cells[0].span, options)
    found = [first]
    for cell in cells[1:]:
        refuse_jumps(cell.problem, (parameter,))
        low, high, scale = first.low.copy(), first.high.copy(), first.scale.copy()
        low[-1], high[-1], scale[-1] = *cell.span, cell.span[1] - cell.span[0]
        par = np.array(list(cell.problem.parameters.values()))
        found.append(first.replace(par=par, low=low, high=high, scale=scale))
    return found


def _follow_cycles(cell: _Cell) -> None:
    """Follow the periodic orbits from the Hopf points of a cell."""
    found = families_of(cell.problem, cell.points, ContinuationOptions())
    cell.families, cell.cut = found


def _alone(shape: Sequence[int], own: Mapping[int, _Cell]) -> dict[int, list[_Cell]]:
    """Cells that lack special points which all their neighbours have, with these.

    Those on the rim of a block have not all of their neighbours in it, and are not judged.
    """
    counts = {k: cell.counts for k, cell in own.items()}
    strides = [int(np.prod(shape[i + 1 :], dtype=int)) for i in range(len(shape))]
    found = {}
    for k, cell in own.items():
        place = np.unravel_index(k, tuple(shape)) if shape else ()
        beside = [
            k + sign * stride
            for at, length, stride in zip(place, shape, strides, strict=True)
            for sign in (-1, 1)
            if 0 <= at + sign < length and k + sign * stride in own
        ]
        theirs = {counts[other] for other in beside}
        every = 2 * sum(length > 1 for length in shape)
        if len(beside) == every > 0 and len(theirs) == 1 and not cell.failure:
            if any(a < b for a, b in zip(counts[k], theirs.pop(), strict=True)):
                found[k] = [own[other] for other in beside]
    return found


def _followed_again(cell: _Cell, parameter: str, beside: list[_Cell]) -> _Cell:
    """A cell by shorter steps, and from its neighbours' special points."""
    options = ContinuationOptions()
    careful = replace(
        options, max_step=options.max_step / CAREFUL, turn=options.turn / CAREFUL,
        max_points=int(options.max_points * CAREFUL),
    )  # fmt: skip
    again = replace(cell)
    _follow([again], parameter, careful)
    (curve,) = _curves([cell], parameter, careful)
    for _, special in beside[0].points:
        with contextlib.suppress(ConvergenceError, np.linalg.LinAlgError):
            more = connected(curve, [*cell.starts, special.u[: curve.m]], DEPTH)
            if len(more) > len(again.traced):
                again = replace(cell, traced=more)
    found = again if sum(again.counts) > sum(cell.counts) else cell
    missed = any(a < b for a, b in zip(found.counts, beside[0].counts, strict=True)) and any(
        _lacks(found, curve.par, other) for other in beside
    )
    return replace(found, failure=cell.failure, missed=missed)


#: Systems that define special points alone, whatever branch they are on.
ALONE = {"fold": FOLD, "hopf": HOPF, "period_doubling": FLIP, "torus": TORUS}
#: Least part of the way from cell to cell that a special point is carried, and how near to each
#: other, on scaled axes, two are that meet there.
LEAST, MET = 1.0 / 128, 0.25


def _lacks(cell: _Cell, par: Array, beside: _Cell) -> bool:
    """Whether a cell has, or may have, special points of a neighbour that are not listed.

    Each is carried from the neighbour's parameters to the cell's. It is not in the cell where it
    turns into a point of another kind on the way, leaves the span, or meets another of its kind;
    where it cannot be carried on for another reason, that is open.
    """
    lost = list[tuple[str, float, Array]]()
    for curve, theirs in beside.points:
        label, m = KINDS[theirs.kind].label, curve.m
        part, u, gone = _carried(curve, par, theirs)
        if gone:
            continue
        if part < 1.0:
            lost.append((label, part, u / curve.scale[:m]))
        elif not any(
            KINDS[one.kind].label == label
            and np.max(np.abs(turned(own, one.u[:m] - u)) / own.scale[:m]) < FOUND
            for own, one in cell.points
        ):
            return True
    return any(
        not any(
            i != j and other[0] == one[0] and abs(other[1] - one[1]) <= 4.0 * LEAST
            and np.max(np.abs(other[2] - one[2])) < MET
            for j, other in enumerate(lost)
        )
        for i, one in enumerate(lost)
    )  # fmt: skip


def _carried(curve: Curve, par: Array, theirs: Special) -> tuple[float, Array, bool]:
    """How far a special point is led to other parameters, where to, and whether it is gone then."""
    n, m, own = curve.n, curve.m, curve.par
    alone = theirs.kind in ALONE and theirs.extra is not None
    count = n if theirs.kind in ("fold", "period_doubling") else n + 1
    u, extra, part, step = theirs.u[:m], theirs.extra, 0.0, 1.0
    while part < 1.0:
        here = curve.replace(par=own + (part + step) * (par - own))
        at: tuple[Array, Array | None] | None = None
        with contextlib.suppress(np.linalg.LinAlgError):
            if alone:
                assert extra is not None
                rest = extra[count:]
                to, more, _, message = polish(
                    here, ALONE[theirs.kind], u, extra[:count], MET, rest if len(rest) else None
                )
                at = None if message else (to, np.append(more, rest))
            elif (point := singular_point(here, u, MET, MET)) is not None and meets(here, point):
                at = (point.u[:m], extra)
        if at is None:
            step *= 0.5
            if step < LEAST:
                break
            continue
        (u, extra), part = at, part + step
        step = min(2.0 * step, 1.0 - part)
        # Beyond a Bogdanov-Takens point, and its like of maps, both eigenvalues are real.
        split = alone and extra is not None and (
            (theirs.kind == "hopf" and extra[n] <= 0.0)
            or (theirs.kind == "torus" and not 0.0 < extra[n] < 4.0)
        )  # fmt: skip
        if split or not np.all((u >= curve.low[:m]) & (u <= curve.high[:m])):
            return part, u, True
    return part, u, False


def _tabulated(
    problem: Problem, parameter: str, shape: tuple[int, ...], own: Mapping[int, _Cell]
) -> tuple[dict[str, Any], ...]:
    """What was found in all cells, by the names of rows."""
    size, n = int(np.prod(shape, dtype=int)), len(problem.state)
    points = {k: cell.points for k, cell in own.items()}
    double = {k: overlaps(cell.stable, 2) for k, cell in own.items()}
    wide = (size, max(map(len, points.values()), default=0))
    special: dict[str, Any] = {
        name: np.full(wide, np.nan)
        for name in (f"special_{x}" for x in (parameter, *problem.state, "coefficient"))
    }
    special["special_kind"] = np.zeros(wide, np.int8)
    special["special_status"] = np.zeros(wide, np.int8)
    counts = {name: np.full(size, -1, np.int64) for name in COUNTED.values()}
    status = np.full(size, BranchStatus.NOT_COMPUTED, np.int8)
    n_stable, n_hysteresis = (np.full(size, -1, np.int64) for _ in range(2))
    width = np.full(size, np.nan)
    intervals = np.full((size, max(map(len, double.values()), default=0), 2), np.nan)
    for k, cell in own.items():
        for i, (_, one) in enumerate(points[k]):
            special[f"special_{parameter}"][k, i] = one.u[n]
            for j, name in enumerate(problem.state):
                special[f"special_{name}"][k, i] = one.u[j]
            special["special_coefficient"][k, i] = one.normal_form.get(
                COEFFICIENT.get(one.kind, ""), np.nan
            )
            special["special_kind"][k, i] = SpecialPointKind.__members__.get(
                one.kind.upper(), SpecialPointKind.OTHER
            )
            sure = one.status == CONVERGED
            special["special_status"][k, i] = PointStatus.CONVERGED if sure else PointStatus.GUESS
        status[k] = cell.status
        if cell.failure:
            continue
        for name, number in zip(counts, cell.counts, strict=True):
            counts[name][k] = number
        n_stable[k], n_hysteresis[k] = most(cell.stable), len(double[k])
        width[k] = float(np.sum(double[k][:, 1] - double[k][:, 0]))
        intervals[k, : len(double[k])] = double[k]
    back = functools.partial(_back, shape)
    return (
        back({"branch_status": status}),
        back({**special, **counts}),
        back({"n_stable": n_stable}),
        back({
            "hysteresis": intervals, "n_hysteresis": n_hysteresis, "hysteresis_width": width
        }),
    )  # fmt: skip


def _tabulated_cycles(
    problem: Problem, shape: tuple[int, ...], own: Mapping[int, _Cell]
) -> dict[str, Any]:
    """What families of periodic orbits are in all cells, by the names of rows."""
    size = int(np.prod(shape, dtype=int))
    spans = {
        k: np.concatenate([np.empty((0, 2)), *(one.stable for one in cell.families)])
        for k, cell in own.items()
    }
    families: dict[str, Callable[[CycleFamily], Array]] = {
        "period": lambda one: one.period,
        "cycle_extent": lambda one: one.extent,
        **{f"cycle_{x}": functools.partial(_states_of, i) for i, x in enumerate(problem.state)},
    }
    columns = {
        name: {k: [take(one) for one in cell.families] for k, cell in own.items()}
        for name, take in families.items()
    }
    columns["oscillation"] = {k: list(overlaps(one, 1)) for k, one in spans.items()}
    columns["bistability"] = {
        k: list(overlaps(np.concatenate([cell.stable, spans[k]]), 2)) for k, cell in own.items()
    }
    number = np.full(size, -1, np.int64)
    found: dict[str, Any] = {"n_cycle_families": number}
    for name, cells in columns.items():
        found[name] = np.full((size, max(map(len, cells.values()), default=0), 2), np.nan)
        for k, rows in cells.items():
            if rows and not own[k].failure:
                found[name][k, : len(rows)] = rows
    for k, cell in own.items():
        number[k] = -1 if cell.failure else len(cell.families)
    return _back(shape, found)


def _states_of(place: int, family: CycleFamily) -> Array:
    row: Array = family.states[place]
    return row


def _back(shape: tuple[int, ...], found: Mapping[str, Any]) -> dict[str, Any]:
    return {name: values.reshape(shape + values.shape[1:]) for name, values in found.items()}
