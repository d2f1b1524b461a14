"""Derivatives of special points by the other parameters, with labels."""

from __future__ import annotations

import functools
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import xarray as xr

from phasekit.arrays import Array
from phasekit.bifurcation.continuation import sensitivity as equilibria
from phasekit.cycles import starts
from phasekit.cycles.cycles import Cycles, Orbit
from phasekit.cycles.extended import FOLD
from phasekit.cycles.functionals import numbers_of_orbit
from phasekit.cycles.point import Point
from phasekit.labelled.continuation.cycle_onward import CURVES, critical_orbit
from phasekit.labelled.continuation.special_point import SpecialPoint
from phasekit.labels.grid import LABEL_DTYPE, labels_of, variable
from phasekit.systems.cycle_families import clock_code
from phasekit.systems.problem import Problem

#: Dims and long names of what there is of each point, and the dims whose names have units.
WORDS = {
    "d_free": (
        ("free", "parameter"), "derivative of the branch's own parameters at the point",
    ),
    "d_state": (("state", "parameter"), "derivative of the state at the point"),
    "d_coefficient": (
        ("coefficient", "parameter"), "derivative of the coefficients of the normal form",
    ),
    "reason": (("parameter",), "why a derivative is not known; empty where it is"),
    "coefficient_reason": (
        ("coefficient", "parameter"),
        "why the derivative of a coefficient is not known; empty where it is",
    ),
    "d_period": (("parameter",), "derivative of the period of the orbit"),
}  # fmt: skip
WITH_UNITS = ("parameter", "free", "state")


def of_equilibrium(point: SpecialPoint[Any]) -> xr.Dataset:
    """Of a point of a branch of equilibria, or of a curve of their points."""
    return labelled(point, equilibria.sensitivity(point.branch.curve, point.special))


def of_orbit(point: SpecialPoint[Any]) -> xr.Dataset:
    """Of a point of a family of periodic orbits."""
    found, numbers = orbits(point)
    ds = labelled(point, found)
    names = np.array(list(numbers), dtype=LABEL_DTYPE)
    words = {"long_name": "derivative of the numbers of the orbit"}
    return ds.assign_coords(number=names).assign(
        d_number=(("number", "parameter"), np.array(list(numbers.values())), words)
    )


def orbits(
    point: SpecialPoint[Any],
) -> tuple[equilibria.Sensitivity, Mapping[str, Array]]:
    """Derivatives of an orbit, and of its period and the extremes and means of its states."""
    cycles, problem = point.branch.curve, point.branch.problem
    names = list(problem.parameters)
    others = tuple(i for i in range(len(names)) if i not in cycles.active)
    k, why = len(others), hindered(point)
    numbers = {name: np.full(k, np.nan) for name in numbers_at(point)}
    found = equilibria.unknown(others, cycles.own, len(cycles.active), {}, why)
    period, reasons = np.full(k, np.nan), [why] * k
    if not why:
        problem = problem.replace(**point.parameters)
        cycles = cycles.replace(par=_par(cycles, point.parameters))
        for i, place in enumerate(others):
            line = _line(problem, cycles, point, names[place])
            if isinstance(line, str):
                reasons[i] = line
                continue
            found.x[:, i], found.free[:, i] = line.dx[0], line.dy[1]
            period[i] = line.dy[0]
            for name, rate in line.rates(cycles, tuple(numbers)).items():
                numbers[name][i] = rate
    return replace(found, period=period, reasons=tuple(reasons)), numbers


def hindered(point: SpecialPoint[Any]) -> str:
    """Why an orbit has no equations that make it an isolated one."""
    if point.branch.kind != "cycle" or len(point.branch.free) != 1:
        return "only points of families of periodic orbits in one parameter have derivatives"
    if point.status != "converged":
        return "the point has not converged"
    if point.kind not in (*CURVES, "event"):
        return f"no equations of its own define a point of kind {point.kind}"
    return ""


def _par(cycles: Cycles, parameters: Mapping[str, float]) -> Array:
    """All parameters in their places; of a forced system time behind them."""
    par = cycles.par.copy()
    par[: len(parameters)] = list(parameters.values())
    return par


def numbers_at(point: SpecialPoint[Any]) -> dict[str, float]:
    """The period of an orbit, and extremes and means of its states."""
    found = numbers_of_orbit(point.branch.curve, point.special.point.orbit)
    return {k: v for k, v in found.items() if k not in point.branch.problem.parameters}


def orbit_at(point: SpecialPoint[Any], parameters: Mapping[str, float]) -> Point | None:
    """The orbit at other parameters than its own; None if there is none nearby."""
    cycles: Cycles = point.branch.curve
    here: Point = point.special.point
    problem = point.branch.problem.replace(**parameters)
    cycles = cycles.replace(par=_par(cycles, parameters))
    if point.kind == "event":
        return _event_at(problem, cycles, point, here)
    name = next(one for one in problem.parameters if one != point.branch.parameter)
    value, n = problem.parameters[name], cycles.own
    size = abs(value) or 1.0
    span = (value - size, value + size)
    made, found = critical_orbit(problem, cycles, here, point.kind, name, span)
    if not found.converged:
        return None
    x, y = found.orbit.x, found.orbit.y
    dx, dy = np.zeros((len(x), n)), np.zeros(2)
    if point.kind == made.kind == FOLD:  # its function is the tangent of the family
        dx, dy[0] = x[:, n:].copy(), (y[-1] * y[0] if made.q == 4 else 0.0)
    orbit = Orbit(found.orbit.mesh, x[:, :n].copy(), y[:2].copy())
    return replace(here, orbit=orbit, dx=dx, dy=dy)


def _event_at(
    problem: Problem, cycles: Cycles, point: SpecialPoint[Any], here: Point
) -> Point | None:
    """The orbit at which a number is zero, by Newton's method in the parameter of the family."""
    own, before = point.branch.parameter, np.inf
    (event,) = (one for one in cycles.events if one.name == point.name)
    value = float(here.orbit.y[1])
    for _ in range(equilibria.STEPS):
        y = np.array([here.orbit.y[0], value])
        here = replace(here, orbit=Orbit(here.orbit.mesh, here.orbit.x, y))
        line = _held_line(problem.replace(**{own: value}), cycles, here, own)
        if isinstance(line, str):
            return None
        zeros = np.zeros_like(line.orbit.x)
        here = replace(here, orbit=line.orbit, dx=zeros, dy=np.zeros(2))
        step = -float(event.value(cycles, line.orbit)) / line.rate(cycles, event)
        size = abs(step) / cycles.width[0]
        if not size < 1e3:
            return None
        if size <= 1e-13 or (size <= 1e-8 and size >= 0.5 * before):
            return here
        value, before = value + step, size
    return None


@dataclass(frozen=True)
class _Line:
    """An orbit, and its derivatives by a parameter: of its states and (period, own parameter)."""

    orbit: Orbit
    dx: Array
    dy: Array
    parameter: str

    def rates(self, cycles: Cycles, names: tuple[str, ...]) -> dict[str, float]:
        """Derivatives of numbers of the orbit, by differences along the line."""
        at = {
            s: numbers_of_orbit(cycles, self._orbit(cycles, s))
            for s, _ in equilibria.STENCIL
        }  # fmt: skip
        return {
            name: sum(weight * at[s][name] for s, weight in equilibria.STENCIL) / self._step(cycles)
            for name in names
        }

    def rate(self, cycles: Cycles, event: Any) -> float:
        """The derivative of an event's function."""
        step = self._step(cycles)
        values = (w * self._value(cycles, event, s) for s, w in equilibria.STENCIL)
        return sum(values) / step

    def _value(self, cycles: Cycles, event: Any, s: float) -> float:
        par = cycles.par.copy()
        place = cycles.field.parameters.index(self.parameter)
        if place not in cycles.active:
            par[place] += s * self._step(cycles)
        return float(event.value(cycles.replace(par=par), self._orbit(cycles, s)))

    def _step(self, cycles: Cycles) -> float:
        size = float(np.max(np.abs(self.dx) / cycles.scale))
        size = max(size, abs(self.dy[0]) / self.orbit.y[0], abs(self.dy[1]) / cycles.width[0])
        return equilibria.STEP / size if size > 0.0 else 1.0

    def _orbit(self, cycles: Cycles, s: float) -> Orbit:
        step = s * self._step(cycles)
        return Orbit(self.orbit.mesh, self.orbit.x + step * self.dx, self.orbit.y + step * self.dy)


def _line(problem: Problem, cycles: Cycles, point: SpecialPoint[Any], name: str) -> _Line | str:
    """The derivative of an orbit by a parameter; why there is none."""
    here, n = point.special.point, cycles.own
    value = problem.parameters[name]
    size = abs(value) or 1.0
    if point.kind == "event":
        return _event_line(problem, cycles, point, name)
    made, found = critical_orbit(
        problem, cycles, here, point.kind, name, (value - size, value + size)
    )
    if not found.converged:
        return found.message
    per = found.dy[2]
    if not abs(per) > equilibria.SINGULAR * size:
        return "its defining system is singular there"
    orbit = Orbit(found.orbit.mesh, found.orbit.x[:, :n].copy(), found.orbit.y[:2].copy())
    return _Line(orbit, found.dx[:, :n] / per, found.dy[:2] / per, name)


def _held_line(problem: Problem, cycles: Cycles, here: Point, name: str) -> _Line | str:
    """The derivative of an orbit by a parameter while all others stay."""
    place = list(problem.parameters).index(name)
    value = problem.parameters[name]
    one = cycles.replace(
        active=(place,), clock=clock_code(problem, (place,)), events=(), ends=(),
        width=np.array([abs(value) or 1.0]), low=np.array([-np.inf]), high=np.array([np.inf]),
    )  # fmt: skip
    y = np.array([here.orbit.y[0], value])
    found = starts.settled(one, Orbit(here.orbit.mesh, here.orbit.x, y))
    if not found.converged or found.dy[1] == 0.0:
        return found.message or "its defining system is singular there"
    own = place in cycles.active
    dy = np.array([found.dy[0] / found.dy[1], 1.0 if own else 0.0])
    y = np.array([found.orbit.y[0], here.orbit.y[1]])
    return _Line(Orbit(found.orbit.mesh, found.orbit.x, y), found.dx / found.dy[1], dy, name)


def _event_line(
    problem: Problem, cycles: Cycles, point: SpecialPoint[Any], name: str
) -> _Line | str:
    """The derivative of an orbit at which a number keeps its value zero."""
    (event,) = (one for one in cycles.events if one.name == point.name)
    lines = [
        _held_line(problem, cycles, point.special.point, one)
        for one in (point.branch.parameter, name)
    ]
    along, beside = lines
    if isinstance(along, str):
        return along
    if isinstance(beside, str):
        return beside
    slope = along.rate(cycles, event)
    part = -beside.rate(cycles, event) / slope if slope != 0.0 else np.nan
    if not np.isfinite(part):
        return f"the event {point.name!r} does not move with {point.branch.parameter}"
    x = _on_mesh(cycles, along, beside.orbit)
    return _Line(beside.orbit, beside.dx + part * x, beside.dy + part * along.dy, name)


def _on_mesh(cycles: Cycles, line: _Line, orbit: Orbit) -> Array:
    """Derivatives of the states on the mesh of another orbit."""
    _, (dx,) = cycles.on(orbit.mesh, line.orbit, line.dx)
    return dx


def labelled(point: SpecialPoint[Any], found: equilibria.Sensitivity) -> xr.Dataset:
    """With the names of parameters, states and coefficients, and units."""
    problem = point.branch.problem
    names, form = list(problem.parameters), list(found.form)
    others = tuple(names[i] for i in found.others)
    coefficients = np.array([found.form[name] for name in form]).reshape(len(form), len(others))
    causes = np.array(found.reasons, dtype=LABEL_DTYPE)
    alone = f"derivatives of this coefficient are not computed at a point of kind {point.kind}"
    without = np.empty(coefficients.shape, dtype=LABEL_DTYPE)
    without[:] = np.where(causes == "", alone, causes)
    without[np.isfinite(coefficients)] = ""
    data = {
        "d_free": found.free, "d_state": found.x, "d_coefficient": coefficients,
        "reason": causes, "coefficient_reason": without,
    }  # fmt: skip
    if found.period is not None:
        data["d_period"] = found.period
    axes = {
        "parameter": others, "free": point.branch.free, "state": problem.state,
        "coefficient": tuple(form),
    }  # fmt: skip
    units = tuple(tuple(problem.unit_of(name) or "" for name in axes[axis]) for axis in WITH_UNITS)
    blank = _blank(tuple(axes.items()), units, found.period is not None)
    # Variables are taken as they are; arrays of labels would be looked through first.
    ds = blank.copy(data={name: variable(WORDS[name][0], one) for name, one in data.items()})
    ds.attrs = {"kind": point.kind, "label": point.label}
    return ds


@functools.lru_cache(maxsize=64)
def _blank(
    axes: tuple[tuple[str, tuple[str, ...]], ...], units: tuple[tuple[str, ...], ...], period: bool
) -> xr.Dataset:
    """The same without numbers, which takes longer to make than all else."""
    names, sizes = labels_of(axes), {axis: len(one) for axis, one in axes}
    coords: dict[Any, Any] = dict(names.variables)
    for axis, one in zip(WITH_UNITS, units, strict=True):
        values = np.array(one, dtype=LABEL_DTYPE)
        values.flags.writeable = False  # those of all points of the branch
        coords[f"{axis}_units"] = variable((axis,), values)
    data = {
        name: variable(dims, np.empty([sizes[axis] for axis in dims]), {"long_name": words})
        for name, (dims, words) in WORDS.items() if period or name != "d_period"
    }  # fmt: skip
    return xr.Dataset(data, xr.Coordinates(coords, names.xindexes))
