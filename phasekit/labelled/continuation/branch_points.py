"""The points of a branch as a Dataset, special points in their places."""

from __future__ import annotations

import functools
from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np
import numpy.typing as npt
import xarray as xr

from phasekit.bifurcation.continuation.conserved import NOT_ISOLATED
from phasekit.bifurcation.continuation.curve import Curve
from phasekit.bifurcation.continuation.kernels import trace
from phasekit.bifurcation.continuation.kernels.defining import HOPF, REGULAR, TORUS
from phasekit.bifurcation.continuation.path import Path
from phasekit.bifurcation.continuation.placed import Placed
from phasekit.bifurcation.continuation.spectrum import (
    eigenvalues_of,
    is_neutral,
    unstable_of,
)
from phasekit.bifurcation.continuation.walk import Found
from phasekit.bifurcation.special_points import KINDS
from phasekit.errors import EquilibriumKind
from phasekit.labels.grid import LABEL_DTYPE
from phasekit.systems.problem import Problem

FloatArray = npt.NDArray[np.float64]
Ints = npt.NDArray[np.int64]
Record = Mapping[str, Any]
Table = Callable[[], xr.Dataset]


def wrap(value: FloatArray, period: float) -> FloatArray:
    """An angle in (-period/2, period/2]."""
    return np.asarray(value - period * np.ceil(value / period - 0.5))


def woven(count: int, specials: Sequence[Any]) -> tuple[Ints, Ints, Any, list[int]]:
    """Places of a path's own points among all, those of its inner special points, labels of all.

    And the place of each special point; that of an end is a point, which may be another one.
    """
    inner = [one for one in specials if one.kind != "end"]
    where = np.array([one.index + 1 for one in inner], dtype=np.int64)
    own = np.arange(count)
    own = own + np.searchsorted(where, own, side="right")
    mine = where + np.arange(len(inner))
    label = np.full(count + len(inner), "", dtype=LABEL_DTYPE)
    for place, one in zip(mine, inner, strict=True):
        label[place] = KINDS[one.kind].label
    ends, within = iter((0, len(label) - 1)), iter(mine.tolist())
    places = [next(ends if one.kind == "end" else within) for one in specials]
    for place, one in zip(places, specials, strict=True):
        label[place] = label[place] or KINDS[one.kind].label
    return own, mine, label, places


def points_of(
    problem: Problem, curve: Curve, found: Found, record: Record
) -> tuple[Table, list[tuple[Placed, int, npt.NDArray[np.complex128]]]]:
    """The points of a path with its special points, and the places and eigenvalues of these.

    The points are made when they are called for: labels take longer than a short curve.
    """
    n, m = curve.n, curve.m
    path: Path = found.path
    specials: list[Placed] = found.specials
    inner = [one for one in specials if one.kind != "end"]
    own, mine, label, places = woven(path.count, specials)
    total = len(label)
    there = np.array([eigenvalues_at(curve, one.special.u) for one in specials], dtype=complex)
    there = there.reshape(-1, n)
    u = np.empty((total, m))
    t = np.empty((total, m))
    info = np.zeros((total, trace.RECORDED))
    values = np.empty((total, n), dtype=complex)
    u[own], t[own], info[own], values[own] = (
        path.u[:, :m],
        path.tangent[:, :m],
        path.info,
        path.eigenvalues,
    )
    for i, one in zip(mine, inner, strict=True):
        s = one.special
        before = path.u[one.index]
        u[i] = s.u[:m]
        # On the turn of the circle that the path is on.
        for j in range(n):
            if curve.period[j] > 0.0:
                u[i, j] += curve.period[j] * np.round((before[j] - u[i, j]) / curve.period[j])
        t[i] = (s.tangent if s.tangent is not None else path.tangent[one.index])[:m]
        gap = np.zeros(curve.size)
        gap[:m] = u[i] - before[:m]
        info[i, trace.ARCLENGTH] = path.info[one.index, trace.ARCLENGTH] + curve.length(gap)
    values[mine] = there[[one.kind != "end" for one in specials]]
    kappa = np.full(total, np.nan)
    if curve.kind in (HOPF, TORUS):
        kappa[own] = path.u[:, -1]
    residual = np.empty(total)
    residual[own] = path.residual
    residual[mine] = curve.residuals(u[mine], [curve.evaluate(point)[1] for point in u[mine]])
    one_of_many = any(NOT_ISOLATED in stop.message for stop in path.stops)
    table = functools.partial(
        _dataset, problem, curve, u, t, info, values, label, record, kappa, residual, one_of_many
    )
    return table, list(zip(specials, places, there, strict=True))


def eigenvalues_at(curve: Curve, u: FloatArray) -> npt.NDArray[np.complex128]:
    """Eigenvalues of f_x at a point; NaN where f is not finite."""
    return np.asarray(
        eigenvalues_of(curve.linear(curve.evaluate(u)[1])[None], accuracy=curve.field.accuracy)[0]
    )


def labels_along(*curves: str) -> list[str]:
    """Labels of the special points that form one of these curves in two parameters."""
    return [kind.label for kind in KINDS.values() if kind.curve in curves]


def kinds_of(values: npt.NDArray[np.complex128], label: Any, n: int) -> npt.NDArray[np.int8]:
    """Center, saddle or degenerate, by the eigenvalues of a conservative problem."""
    if n == 1:  # f is the force -V', so the eigenvalue is -V''
        kind = np.where(values[:, 0].real > 0.0, EquilibriumKind.SADDLE, EquilibriumKind.CENTER)
    else:
        size = np.max(np.abs(values), axis=1)
        real = np.max(np.abs(values.real), axis=1) > 1e-7 * np.where(size > 0.0, size, 1.0)
        kind = np.where(real, EquilibriumKind.SADDLE, EquilibriumKind.CENTER)
    kind[np.isin(label, labels_along("fold", "branch_point"))] = EquilibriumKind.DEGENERATE
    return kind.astype(np.int8)


def _dataset(
    problem: Problem,
    curve: Curve,
    u: FloatArray,
    t: FloatArray,
    info: FloatArray,
    values: npt.NDArray[np.complex128],
    label: Any,
    record: Record,
    kappa: FloatArray,
    residual: FloatArray,
    one_of_many: bool,
) -> xr.Dataset:
    n = curve.n
    names = [*curve.field.states, *(curve.field.parameters[i] for i in curve.active)]
    dim = "point"
    data: dict[str, Any] = {}
    for i in [*range(n, curve.m), *range(n)]:
        column = u[:, i].copy()
        if curve.period[i] > 0.0:
            column = wrap(column, float(curve.period[i]))
        data[names[i]] = (dim, column, attrs_of(problem, names[i]))
    if problem.conservative and curve.kind in REGULAR:
        flags = {
            "long_name": "kind of the equilibrium",
            "flag_values": np.array([k.value for k in EquilibriumKind], dtype=np.int8),
            "flag_meanings": " ".join(k.name.lower() for k in EquilibriumKind),
        }
        data["kind"] = (dim, kinds_of(values, label, n), flags)
    else:
        # Where eigenvalues are zero, or multipliers of size 1, but for rounding.
        marked = labels_along("fold", "branch_point", "hopf", "period_doubling", "torus")
        critical = np.isin(label, marked) | (curve.kind not in REGULAR) | one_of_many
        neutral = is_neutral(curve, values)
        blur = np.where(critical, 1e-6, 0.0)
        unstable = unstable_of(curve, values, neutral=neutral, blur=blur).astype(np.int64)
        unstable[np.isnan(values).any(axis=1)] = -1
        data["n_unstable"] = (
            dim, unstable,
            {
                "long_name": "number of multipliers outside the unit circle; -1: not known"
                if curve.discrete
                else "number of eigenvalues with a positive real part; -1: not known"
            },
        )  # fmt: skip
    if curve.kind in (HOPF, TORUS):
        name, most = ("torus", 4.0) if curve.kind == TORUS else ("hopf", np.inf)
        on = (kappa > 0.0) & (kappa < most)
        pair = np.where(np.isnan(kappa), "", np.where(on, name, "neutral_saddle"))
        says = {"long_name": f"{name.capitalize()} point or neutral saddle"}
        data["kind_of_pair"] = (dim, pair.astype(LABEL_DTYPE), says)
    data["arclength"] = (
        dim, info[:, trace.ARCLENGTH].copy(), {"long_name": "arclength on scaled axes"},
    )  # fmt: skip
    data["special"] = (dim, label, {"long_name": "label of a special point"})
    data["tangent"] = (
        (dim, "unknown"), t.copy(), {"long_name": "unit tangent on scaled axes, unscaled"},
    )  # fmt: skip
    data["step"] = (dim, info[:, trace.STEP_LENGTH].copy(), {"long_name": "length of the step"})
    data["residual"] = (
        dim, residual, {"long_name": "largest f relative to its terms"},
    )  # fmt: skip
    data["newton_steps"] = (dim, info[:, trace.NEWTON_STEPS].astype(np.int64))
    unknown = _unknowns(tuple(names))
    coords: dict[Any, Any] = dict(unknown.variables)
    for name, value in problem.parameters.items():
        if name not in data:
            coords[name] = ((), value, attrs_of(problem, name))
    ds = xr.Dataset(data, xr.Coordinates(coords, unknown.xindexes))
    if record:
        from phasekit.labelled.continuation.recording import recorded

        ds = ds.assign(recorded(problem, ds, names[n:], record))
    for array in ds.variables.values():
        if isinstance(array.data, np.ndarray):
            array.data.flags.writeable = False
    return ds


@functools.lru_cache(maxsize=64)
def _unknowns(names: tuple[str, ...]) -> xr.Coordinates:
    """The unknowns' names as a coordinate, whose index takes longer to make than all else."""
    return xr.Coordinates({"unknown": np.array(names, dtype=LABEL_DTYPE)})


def clock_units(problem: Problem) -> dict[str, str]:
    """Units of the time, where they are known."""
    unit = problem.unit_of("time")
    return {} if unit is None else {"units": unit}


def attrs_of(problem: Problem, name: str) -> dict[str, str]:
    """Long name and units of a state or parameter, where the problem has them."""
    if problem.system is not None:
        from phasekit.cells.schema import input_attrs

        if name == "phi":
            return {"long_name": "angle of the equilibrium", "units": "rad"}
        return input_attrs(problem.system, name)
    return dict(problem.words.get(name, {}))
