"""A branch as data: its points as a Dataset, its special points as a table, and all in words."""

from __future__ import annotations

import functools
import html
from collections.abc import Callable, Mapping, Sequence
from typing import TYPE_CHECKING, Any, TypeVar

import numpy as np
import numpy.typing as npt
import xarray as xr

from phasekit.arrays import Array, Index
from phasekit.bifurcation.continuation.conserved import NOT_ISOLATED
from phasekit.bifurcation.continuation.curve import Curve
from phasekit.bifurcation.continuation.kernels import trace
from phasekit.bifurcation.continuation.kernels.defining import HOPF, REGULAR, TORUS
from phasekit.bifurcation.continuation.path import Path
from phasekit.bifurcation.continuation.points.special import Placed
from phasekit.bifurcation.continuation.spectrum import eigenvalues_of, is_neutral, unstable_of
from phasekit.bifurcation.continuation.walk import UNFINISHED, Found
from phasekit.bifurcation.special_points import KINDS
from phasekit.errors import EquilibriumKind, warn
from phasekit.labels.grid import LABEL_DTYPE, labels_of
from phasekit.systems.problem import Problem

if TYPE_CHECKING:
    import pandas as pd

Record = Mapping[str, Any]
Table = Callable[[], xr.Dataset]


#: Dims along which a point has several numbers of one name.
WIDE = frozenset({"unknown", "multiplier"})


class Points(xr.Dataset):  # type: ignore[no-untyped-call]
    """The points of a branch, which make a table of pandas with a row for each."""

    __slots__ = ()

    def to_dataframe(self, dim_order: Any = None) -> pd.DataFrame:
        """A row for each point; what has several numbers there has a column for each.

        These are tangents and multipliers: ``tangent v``, ``multiplier 1``, .... Other arrays at
        points are left out, such as those over space.
        """
        if "point" not in self.dims or dim_order is not None:
            return super().to_dataframe(dim_order)
        single = self.drop_dims([dim for dim in self.dims if dim != "point"])
        frame = xr.Dataset.to_dataframe(single)
        columns = {}
        for name, values in self.variables.items():  # multipliers stand under a dim's name
            for dim in WIDE & {*values.dims} if "point" in values.dims else ():
                labels = self.indexes.get(dim, range(1, self.sizes[dim] + 1))
                for k, label in enumerate(labels):
                    columns[f"{name} {label}"] = values.isel({dim: k}).values
        return frame.assign(**columns)


def plain(points: xr.Dataset) -> xr.Dataset:
    """The same as a Dataset whose tables are those of xarray."""
    data = {name: one for name, one in points.variables.items() if name not in points.coords}
    return xr.Dataset(data, points.coords, points.attrs)


def wrap(value: Array, period: float) -> Array:
    """An angle in (-period/2, period/2]."""
    return np.asarray(value - period * np.ceil(value / period - 0.5))


def woven(count: int, specials: Sequence[Any]) -> tuple[Index, Index, Any, list[int]]:
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


def eigenvalues_at(curve: Curve, u: Array) -> npt.NDArray[np.complex128]:
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
    u: Array,
    t: Array,
    info: Array,
    values: npt.NDArray[np.complex128],
    label: Any,
    record: Record,
    kappa: Array,
    residual: Array,
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
    unknown = labels_of((("unknown", tuple(names)),))
    coords: dict[Any, Any] = dict(unknown.variables)
    for name, value in problem.parameters.items():
        if name not in data:
            coords[name] = ((), value, attrs_of(problem, name))
    ds = Points(data, xr.Coordinates(coords, unknown.xindexes))
    if record:
        from phasekit.labelled.continuation.recording import recorded

        ds = ds.assign(recorded(problem, ds, names[n:], record))
    for array in ds.variables.values():
        if isinstance(array.data, np.ndarray):
            array.data.flags.writeable = False
    return ds


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


#: Special points that a branch shows at most.
SHOWN = 20


def text_of(branch: Any, notes: Sequence[str]) -> str:
    """What it is, its range, its special points and why it ends."""
    points = [repr(s) for s in branch.special_points if s.kind != "end"]
    more = [f"... {len(points) - SHOWN} more"] if len(points) > SHOWN else []
    return "\n  ".join([f"<{head_of(branch)}", *points[:SHOWN], *more, *notes]) + ">"


def html_of(branch: Any, notes: Sequence[str]) -> str:
    """The same, special points in a table."""
    points = branch.table()
    points = points[points.kind != "end"]
    rows = points.to_html(index=False, border=0, max_rows=SHOWN) if len(points) else ""
    lines = "".join(f"<div>{html.escape(note)}</div>" for note in notes)
    return f"<div><b>{html.escape(head_of(branch))}</b>{rows}{lines}</div>"


def head_of(branch: Any) -> str:
    """What its points are, how many there are, and where."""
    points = branch._points
    count = points.sizes["point"]
    u = {name: points[name].values for name in (*branch.free, *branch._numbers)}
    ranges = ", ".join(
        f"{n} from {v.min():.6g} to {v.max():.6g}" if count > 1 else f"{n} = {v[0]:.6g}"
        for n, v in u.items()
    )
    return f"Branch of {_followed(branch)}: {count} point{'s'[: count != 1]}, {ranges}"


def _followed(branch: Any) -> str:
    held = getattr(branch.walker.curve, "held", None)
    if held is not None:
        return f"points of the event {held.name!r}"
    holds = " and ".join(one.name for one in getattr(branch.walker.curve, "holds", ()))
    with_held = f" with {holds}" if holds else ""
    words = {
        "equilibrium": "fixed points" if branch.problem.map else "equilibria",
        "cycle": "periodic orbits",
        "boundary": "solutions",
        "connection": "connections",
    }
    pairs = branch._points.get("kind_of_pair")
    names = set[str]() if pairs is None else set(map(str, pairs.values))
    beyond = sorted(names - {"", branch.kind})
    with_others = "".join(f" and {name} points" for name in beyond)
    return words.get(branch.kind, f"{branch.kind} points") + with_others + with_held


DIM = "special_point"


def with_special_points(ds: xr.Dataset, branch: Any) -> xr.Dataset:
    """The points of a branch, and its special points on a dim of their own."""
    specials = branch.special_points

    def strings(values: list[str]) -> tuple[str, Any]:
        return DIM, np.array(values, dtype=LABEL_DTYPE)

    ds["special_kind"] = strings([s.kind for s in specials])
    ds["special_label"] = strings([s.label for s in specials])
    ds["special_status"] = strings([s.status for s in specials])
    ds["special_message"] = strings([s.message for s in specials])
    if any(s.name for s in specials):
        ds["special_name"] = strings([s.name for s in specials])
    fields = tuple(block.name for block in branch.problem.blocks)
    names = (*branch.free, *(fields or branch.problem_state))
    for name in names:
        of = [s[name] for s in specials]
        dims = getattr(of[0], "dims", ()) if of else ()
        ds[f"special_{name}"] = ((DIM, *dims), np.array(of))
    ds["special_residual"] = (DIM, np.array([s.residual for s in specials]))
    ds["special_corank"] = (DIM, np.array([s.corank for s in specials], dtype=np.int64))
    ds["special_index"] = (DIM, np.array([s.index for s in specials], dtype=np.int64))
    intervals = np.array([s.interval for s in specials])
    ds["special_interval"] = ((DIM, "end"), intervals.reshape(-1, 2))
    for name in branch._numbers:
        ds[f"special_{name}"] = (DIM, np.array([s[name] for s in specials]))
    if branch._certificate is not None:
        ds["special_certified"] = (DIM, np.array([s.certified for s in specials], dtype=bool))
        ds["special_doubt"] = strings([s.doubt for s in specials])
        for name in names:
            ends = [s.enclosure.get(name, (np.nan, np.nan)) for s in specials]
            ds[f"special_{name}_enclosure"] = ((DIM, "end"), np.array(ends).reshape(-1, 2))
    return ds


def special_table(branch: Any) -> pd.DataFrame:
    """The special points of a branch, a row each."""
    import pandas as pd

    specials = branch.special_points
    columns: dict[str, Any] = {
        "label": [s.label for s in specials], "kind": [s.kind for s in specials]
    }  # fmt: skip
    states = () if branch.problem.blocks else branch.problem_state
    for name in (*branch.free, *branch._numbers, *states):
        columns[name] = [s[name] for s in specials]
    if any(s.status != "converged" for s in specials):
        columns["residual"] = [s.residual for s in specials]
    if branch._certificate is not None:
        columns["certified"] = [s.certified for s in specials]
    if "residual" in columns:
        columns["status"] = [s.status for s in specials]
    columns["message"] = ["; ".join(filter(None, (s.name, s.message))) for s in specials]
    return pd.DataFrame(columns)


Of = TypeVar("Of", bound=Any)


def interrupted(branch: Any) -> bool:
    """Whether Ctrl-C ended it."""
    return any(stop.reason == "interrupted" for stop in branch.stops)


def announced(branch: Of) -> Of:
    """The branch, with a warning if it ended for its number of points, or by Ctrl-C."""
    ends = [
        f"{name}: {stop.message}"
        for name, stop in zip(("first point", "last point"), branch.stops, strict=True)
        if stop.reason in UNFINISHED
    ]
    if ends:
        more = (
            ""
            if interrupted(branch)
            else ", ContinuationOptions(max_points=...) allows more points"
        )
        warn(
            f"the branch in {branch.parameter} is not complete, {'; '.join(ends)}; what "
            f"lies beyond on this {_named(branch)} was not seen; extend() continues it{more}",
            RuntimeWarning,
        )
    return branch


def _named(branch: Any) -> str:
    """What a branch is, and at which point it begins."""
    what = "family of periodic orbits" if branch.kind == "cycle" else f"{branch.kind} branch"
    points = branch.special_points
    return f"{what} from {points[0]!r}" if points else what
