"""The points of a branch of periodic orbits as a Dataset, special ones, and orbits over time."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import xarray as xr

from phasekit.arrays import Array
from phasekit.bifurcation.continuation.walk import Found
from phasekit.bifurcation.special_points import KINDS
from phasekit.cells.schema import dataset_attrs
from phasekit.cycles import collocation
from phasekit.cycles.bounded import Bounded
from phasekit.cycles.connections import ends_of, spectra, truncation
from phasekit.cycles.cycles import Cycles, Orbit
from phasekit.cycles.extended import Extended
from phasekit.cycles.fourier import coefficients
from phasekit.cycles.point import Point, critical_count, vertical
from phasekit.labelled.continuation.branch_points import Points, attrs_of, clock_units, woven
from phasekit.labelled.continuation.onward import Of
from phasekit.labelled.continuation.recording import Fourier, tell_failed, values_along
from phasekit.labelled.continuation.special_point import SpecialPoint
from phasekit.labelled.continuation.unfolding import NO_PARAMETER, UNFOLDING
from phasekit.labels.arguments import bad
from phasekit.labels.grid import LABEL_DTYPE
from phasekit.systems.field_arrays import gathered
from phasekit.systems.problem import Problem

_CHECKS = {
    "trivial_error": "distance from 1 of the multiplier that is 1; 0 of a forced system",
    "liouville_error": "logarithm of the product of the multipliers, less the integral of the "
    "divergence",
    "mesh_error": "estimated error of the states relative to their amplitudes",
    "residual": "largest x' - f relative to f, or to the states at rest",
}
_WHICH = {"min": "least", "max": "largest", "mean": "mean"}


def summary(problem: Problem, cycles: Cycles, point: Point, label: str = "") -> dict[str, Any]:
    """Numbers of one orbit by name."""
    orbit, m = point.orbit, cycles.m
    low, high, middle = collocation.ranges(orbit.mesh, orbit.x, m)
    found: dict[str, Any] = {"period": float(orbit.y[0])} if cycles.closes else {}
    for i, name in enumerate(problem.state):
        found[f"{name}_min"], found[f"{name}_max"] = low[i], high[i]
        found[f"{name}_mean"] = middle[i]
    if cycles.closes:
        found["n_unstable"] = critical_count(point, cycles.forced, label, vertical(cycles, point))
    for name in _checks(cycles):
        found[name] = float(getattr(point, name))
    found["n_intervals"] = orbit.intervals
    return found


def _checks(cycles: Cycles) -> tuple[str, ...]:
    """Checks of the points: those of multipliers only where there are some."""
    return tuple(_CHECKS) if cycles.closes else ("mesh_error", "residual")


def winding(cycles: Cycles) -> list[int]:
    """Turns of each angle over a period."""
    angles = cycles.period > 0.0
    return [int(k) for k in np.round(cycles.turns[angles] / cycles.period[angles])]


@dataclass(frozen=True, eq=False)
class Orbits:
    """The orbits of a branch, special points in their places; called, their table."""

    problem: Problem
    cycles: Cycles
    points: tuple[Point, ...]
    labels: tuple[str, ...]
    record: Mapping[str, Any]

    def __call__(self) -> xr.Dataset:
        """The points of the branch."""
        return _dataset(self.problem, self.cycles, self.points, self.labels, self.record)

    def ranges(self) -> xr.Dataset:
        """Of the points no more than free parameters, and least and largest states."""
        found = [collocation.ranges(p.orbit.mesh, p.orbit.x, self.cycles.m) for p in self.points]
        data: dict[str, Any] = {
            self.cycles.field.parameters[i]: ("point", [p.orbit.y[1 + k] for p in self.points])
            for k, i in enumerate(self.cycles.active)
        }
        for i, name in enumerate(self.problem.state):
            for k, what in enumerate(("min", "max")):
                data[f"{name}_{what}"] = ("point", [one[k][i] for one in found])
        return gathered(self.problem, xr.Dataset(data))


def points_of(
    problem: Problem, cycles: Cycles, found: Found, record: Mapping[str, Any]
) -> tuple[Orbits, list[tuple[Any, int, Any]]]:
    """The orbits of a path with its special points, and the places and multipliers of these."""
    own, _, label, places = woven(found.path.count, found.specials)
    marked = list(zip(found.specials, places, strict=True))
    at = {place: seen.point for seen, place in marked if seen.kind != "end"}
    at.update(zip(own.tolist(), found.path.points, strict=True))
    points = tuple(at[place] for place in range(len(label)))
    orbits = Orbits(problem, cycles, points, tuple(label.tolist()), record)
    return orbits, [(seen, place, seen.point.multipliers) for seen, place in marked]


def _dataset(
    problem: Problem,
    cycles: Cycles,
    points: Sequence[Point],
    labels: Sequence[str],
    record: Mapping[str, Any],
) -> xr.Dataset:
    """The points of a branch as a Dataset."""
    dim = "point"
    # On a curve of special points one multiplier at least is critical everywhere.
    on_curve = "curve" if isinstance(cycles, Extended) else ""
    rows = [
        summary(problem, cycles, p, one or on_curve) for p, one in zip(points, labels, strict=True)
    ]
    free = [cycles.field.parameters[i] for i in cycles.active]
    data: dict[str, Any] = {}
    for k, name in enumerate(free):
        column = np.array([p.orbit.y[1 + k] for p in points])
        data[name] = (dim, column, attrs_of(problem, name))
    for name in rows[0]:
        kind = np.int64 if name in ("n_unstable", "n_intervals") else np.float64
        data[name] = (dim, np.array([row[name] for row in rows], dtype=kind))
    for name in problem.state:
        words = attrs_of(problem, name)
        for what in ("min", "max", "mean") if words else ():
            long_name = f"{_WHICH[what]} {words.get('long_name', name)}"
            data[f"{name}_{what}"] = (*data[f"{name}_{what}"], {**words, "long_name": long_name})
    for name in _checks(cycles):
        data[name] = (*data[name], {"long_name": _CHECKS[name]})
    data["n_intervals"] = (*data["n_intervals"], {"long_name": "mesh intervals"})
    if cycles.closes:
        _of_cycles(problem, cycles, points, data)
    if isinstance(cycles, Bounded) and cycles.kind == "connection":
        for name, (text, column) in _of_connections(problem, cycles, points).items():
            data[name] = (dim, column, {"long_name": text})
    data["arclength"] = (dim, np.array([p.arclength for p in points]))
    data["special"] = (dim, np.array(labels, dtype=LABEL_DTYPE))
    data["step"] = (dim, np.array([p.step for p in points]))
    data["newton_steps"] = (dim, np.array([p.newton_steps for p in points], dtype=np.int64))
    coords: dict[str, Any] = {
        k: ((), v, attrs_of(problem, k)) for k, v in problem.parameters.items() if k not in free
    }
    if len(winding(cycles)) > 1:
        coords["angle"] = np.array(list(problem.periods), dtype=LABEL_DTYPE)
    if record:
        data.update(_recorded(problem, cycles, points, record))
    if "multiplier" in data:  # it comes last
        data["multiplier"] = data.pop("multiplier")
    ds = gathered(problem, Points(data, coords))
    for array in ds.variables.values():
        if isinstance(array.data, np.ndarray):
            array.data.flags.writeable = False
    return ds


def _of_cycles(
    problem: Problem, cycles: Cycles, points: Sequence[Point], data: dict[str, Any]
) -> None:
    """Columns of periodic orbits alone."""
    dim = "point"
    period = {"long_name": "period of the orbit", **clock_units(problem)}
    data["period"] = (*data["period"], period)
    data["n_unstable"] = (
        *data["n_unstable"],
        {"long_name": "number of multipliers outside the unit circle; -1: not known"},
    )
    turns = winding(cycles)
    words = {"long_name": "turns of the angle over a period"}
    if len(turns) <= 1:
        data["winding"] = (dim, np.full(len(points), sum(turns), dtype=np.int64), words)
    else:
        data["winding"] = ((dim, "angle"), np.tile(np.array(turns), (len(points), 1)), words)
    data["multiplier"] = (
        (dim, "multiplier"), np.array([p.multipliers for p in points]),
        {"long_name": "Floquet multipliers, the largest first"},
    )  # fmt: skip


def _of_connections(
    problem: Problem, cycles: Bounded, points: Sequence[Point]
) -> dict[str, tuple[str, Array]]:
    """Columns of connecting orbits alone: what they are called, and their values."""
    n = len(problem.state)
    rows = np.full((len(points), 7 + 2 * n), np.nan)
    for row, point in zip(rows, points, strict=True):
        orbit = point.orbit
        rests = ends_of(cycles).rests(cycles, orbit)
        found = spectra(cycles, orbit)
        row[0] = orbit.y[0]
        if rests is None or found is None:
            continue
        row[1] = np.max(np.abs(truncation(cycles, orbit)))
        for k, values in enumerate((found.out, found.into)):
            row[3 + 2 * k : 5 + 2 * k] = (values[0].real, abs(values[0].imag)) if len(values) else (
                np.nan, np.nan,
            )  # fmt: skip
        row[2] = row[3] + row[5]
        row[7:] = np.concatenate([rest.x for rest in rests])
    names = {
        "duration": "time between the ends of the orbit",
        "truncation_error": "estimated error of the free parameters by its ends",
        "saddle_value": "sum of the real parts of the leading eigenvalues",
        "leading_unstable": "real part of the eigenvalue by which it leaves",
        "leading_unstable_imag": "its imaginary part",
        "leading_stable": "real part of the eigenvalue by which it arrives",
        "leading_stable_imag": "its imaginary part",
    }
    names |= {f"{x}_from": f"{x} of the equilibrium that it leaves" for x in problem.state}
    names |= {f"{x}_to": f"{x} of the equilibrium that it arrives at" for x in problem.state}
    return {name: (words, rows[:, k].copy()) for k, (name, words) in enumerate(names.items())}


def orbit_dataset(
    problem: Problem, cycles: Cycles, point: Point, label: str = "",
    record: Mapping[str, Any] | None = None,
) -> xr.Dataset:  # fmt: skip
    """One orbit over time, at the places of its mesh, with its numbers as scalars."""
    orbit = point.orbit
    at = collocation.times(orbit.mesh, cycles.m) * orbit.y[0]
    data: dict[str, Any] = {
        name: ("time", orbit.x[:, i].copy(), attrs_of(problem, name))
        for i, name in enumerate(problem.state)
    }
    data.update(summary(problem, cycles, point, label))
    if cycles.closes:
        turns = winding(cycles)
        data["winding"] = sum(turns) if len(turns) <= 1 else ("angle", np.array(turns))
    held = parameters_at(problem, cycles, orbit)
    coords: dict[str, Any] = {k: ((), v, attrs_of(problem, k)) for k, v in held.items()}
    if problem.words:
        coords["time"] = ("time", at, {"long_name": "time", **clock_units(problem)})
    ds = xr.Dataset(data, {"time": at, **coords}, dataset_attrs(problem))
    if record:
        ds = ds.assign(xr.Dataset(_recorded(problem, cycles, [point], record)).isel(point=0))
    if cycles.closes:
        ds = ds.assign({"multiplier": ("multiplier", point.multipliers.copy())})
    return gathered(problem, ds)


def parameters_at(problem: Problem, cycles: Cycles, orbit: Orbit) -> dict[str, float]:
    """All parameters of the problem at an orbit."""
    values = dict(problem.parameters)
    for k, place in enumerate(cycles.active):
        values[cycles.field.parameters[place]] = float(orbit.y[1 + k])
    return values


def _recorded(
    problem: Problem, cycles: Cycles, points: Sequence[Point], record: Mapping[str, Any]
) -> dict[str, Any]:
    """What is recorded of orbits: harmonics, and least, largest and mean values."""
    data: dict[str, Any] = {}
    for name, function in record.items():
        found = np.empty((len(points), 3))
        lines = np.empty(len(points), complex)
        failed: list[Exception] = []
        count = 0
        for i, p in enumerate(points):
            orbit = p.orbit
            fixed = parameters_at(problem, cycles, orbit)
            fixed = {k: v for k, v in fixed.items() if k not in (UNFOLDING, NO_PARAMETER)}
            moments = collocation.times(orbit.mesh, cycles.m) * orbit.y[0]
            varying = {} if problem.time is None else {problem.time: moments}
            series, raised = values_along(f"record[{name!r}]", function, orbit.x.T, varying, fixed)
            if series.ndim > 1:
                hint = f"the values of this one have the shape {series.shape[1:]}"
                wants = "a function whose values are numbers, along periodic orbits"
                raise bad(f"record[{name!r}]", function, wants, hint)
            failed, count = failed + raised, count + len(series)
            if isinstance(function, Fourier):
                lines[i] = coefficients(orbit.mesh, series, cycles.m, function.order)[-1]
                continue
            low, high = collocation.extremes(series[:, None], cycles.m)
            middle = collocation.mean(orbit.mesh, series[:, None], cycles.m)
            found[i] = low[0], high[0], middle[0]
        tell_failed(name, failed, count, "places of orbits")
        if isinstance(function, Fourier):
            about = f"harmonic {function.order} of {function.formula}"
            words = {"long_name": f"amplitude of the {about}"}
            data[f"{name}_amplitude"] = ("point", np.abs(lines), words)
            words = {"long_name": f"phase of the {about}", "units": "rad"}
            data[f"{name}_phase"] = ("point", np.angle(lines), words)
            continue
        for k, what in enumerate(("min", "max", "mean")):
            data[f"{name}_{what}"] = ("point", found[:, k])
    return data


@dataclass(frozen=True, eq=False, repr=False)
class CyclePoint(SpecialPoint[Of]):
    """A periodic orbit at which something happens: LPC, PD, TR, BPC, UZ or an end.

    ``x`` is a state on the orbit, ``eigenvalues`` are its multipliers. ``normal_form`` holds the
    coefficient of the map over one period.
    """

    @property
    def corank(self) -> int:
        """Number of critical multipliers besides the one that is always 1; 0 at ends."""
        return KINDS[self.kind].crossing or 0

    @property
    def period(self) -> float:
        """The period of the orbit."""
        return float(self.special.point.orbit.y[0])

    @property
    def orbit(self) -> xr.Dataset:
        """The orbit over time."""
        cycles, problem = self.branch.walker.curve, self.branch.problem
        return orbit_dataset(problem, cycles, self.special.point, self.label)

    def __getitem__(self, name: str) -> Any:
        """A state, or field of states, a parameter or the period by name."""
        return self.period if name == "period" else super().__getitem__(name)


def refined_points(family: Any, label: str) -> list[CyclePoint[Any]]:
    """Special points of a family of a label that are more than guesses."""
    found = (one for one in family.special(label) if one.status == "converged")
    return [one for one in found if isinstance(one, CyclePoint)]
