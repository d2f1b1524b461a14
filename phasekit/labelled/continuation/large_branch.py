"""Branches of fields of states: arrays over the places of the states, with their special points."""

from __future__ import annotations

import functools
from collections.abc import Callable
from dataclasses import dataclass
from types import MappingProxyType
from typing import Any, ClassVar

import numpy as np
import numpy.typing as npt
import xarray as xr

from phasekit.bifurcation.continuation.kernels import trace
from phasekit.bifurcation.continuation.large.curve import LargeCurve
from phasekit.bifurcation.continuation.large.search import POSITIVE
from phasekit.bifurcation.continuation.placed import Placed
from phasekit.bifurcation.continuation.walk import Found
from phasekit.bifurcation.special_points import KINDS
from phasekit.labelled.continuation.branch import Branch, Place, Record
from phasekit.labelled.continuation.branch_points import attrs_of, labels_along
from phasekit.labelled.continuation.large_parts import arrays_of, made_again, words_of
from phasekit.labelled.continuation.onward import Of
from phasekit.labelled.continuation.special_point import SpecialPoint, fixed
from phasekit.labelled.field_arrays import fields_of
from phasekit.labels.grid import LABEL_DTYPE
from phasekit.systems.problem import Problem

Array = npt.NDArray[np.float64]

#: What is shown of a field at each point.
NUMBERS: dict[str, Callable[..., Any]] = {"min": np.min, "mean": np.mean, "max": np.max}


@dataclass(frozen=True, eq=False, repr=False)
class LargePoint(SpecialPoint[Of]):
    """A special point of a branch of fields of states.

    ``x`` holds all states; a field by name is an array over its places.
    """

    way: ClassVar[str] = "large"

    def __getitem__(self, name: str) -> Any:
        """A field of states, or a parameter, by name."""
        problem = self.branch.problem
        found = fields_of(problem, self.x[None])
        if name in found:
            return found[name].isel(point=0)
        return self.parameters[name]

    def __repr__(self) -> str:
        """Write kind, place and how well it is known."""
        where = ", ".join(f"{name}={self.parameters[name]:.10g}" for name in self.branch.free)
        notes = [f"{name}={value:.6g}" for name, value in self.normal_form.items()]
        notes += [f"corank={self.corank}"] if self.corank > 1 else []
        notes += [self.status] if self.status != "converged" else []
        notes += [self.message] if self.message else []
        return f"<{self.label} {self.kind} at {where}{'; ' if notes else ''}{', '.join(notes)}>"


@dataclass(frozen=True, eq=False, repr=False)
class LargeBranch(Branch):
    """A curve of equilibria of fields of states: `Branch`, with arrays for states."""

    _derived: ClassVar[tuple[str, ...]] = ("_table", "matrix", "bordered")

    @staticmethod
    def _tabulated(
        problem: Problem, walker: Any, found: Found, record: Record
    ) -> tuple[Callable[[], xr.Dataset], list[Place]]:
        return points_of(problem, walker.curve, found, record)

    def _special_point(self, found: Any, index: int, eigenvalues: Any) -> Any:
        curve, special = self.walker.curve, found.special
        parameters = {**self.problem.parameters, curve.free: float(special.u[curve.n])}
        parameters |= {name: float(special.u[place]) for name, place in curve.beside.items()}
        states = fixed(special.u[: len(self.problem.state)])
        return LargePoint(
            special.kind, states, MappingProxyType(parameters),
            special.interval, special.residual, special.status, special.message,
            MappingProxyType(dict(special.normal_form)), fixed(eigenvalues), index, special, self,
        )  # fmt: skip

    @functools.cached_property
    def free(self) -> tuple[str, ...]:
        """The free parameters."""
        parameters = self.problem.parameters
        return (*(name for name in self.curve.beside if name in parameters), self.curve.free)

    @property
    def problem_state(self) -> tuple[str, ...]:
        """The fields of states, each by what a picture shows of it first: its largest value."""
        return tuple(f"{block.name}_max" for block in self.problem.blocks)

    def to_dataset(self) -> xr.Dataset:
        """The points, and the special points on the dim ``special_point``.

        Returns
        -------
        xarray.Dataset
            As `Branch.to_dataset`; ``special_<name>`` of a field is an array over its places.
        """
        ds = self.points
        specials = self.special_points
        dim = "special_point"
        for name in ("kind", "label", "status", "message"):
            values = [getattr(s, name) for s in specials]
            ds[f"special_{name}"] = (dim, np.array(values, dtype=LABEL_DTYPE))
        for name in self.free:
            ds[f"special_{name}"] = (dim, np.array([s[name] for s in specials]))
        for name, array in fields_of(self.problem, np.array([s.x for s in specials])).items():
            ds[f"special_{name}"] = (("special_point", *array.dims[1:]), array.values)
        ds["special_residual"] = (dim, np.array([s.residual for s in specials]))
        ds["special_corank"] = (dim, np.array([s.corank for s in specials], dtype=np.int64))
        ds["special_index"] = (dim, np.array([s.index for s in specials], dtype=np.int64))
        intervals = np.array([s.interval for s in specials]).reshape(-1, 2)
        ds["special_interval"] = ((dim, "end"), intervals)
        return ds

    def __reduce__(self) -> tuple[Any, ...]:
        """Copies and pickles are made again of what was traced, as when a branch is loaded."""
        return made_again, (
            type(self), self.problem, self.kind, self.free, arrays_of(self),
            words_of(self), self.curve.options,
            [None if track is None else track.stop for track in self.tracks], dict(self.record),
        )  # fmt: skip


def points_of(
    problem: Problem, curve: LargeCurve, found: Found, record: Record
) -> tuple[Callable[[], xr.Dataset], list[Any]]:
    """The points of a path with its special points, and the places of these."""
    path, specials = found.path, found.specials
    inner = [one for one in specials if one.special.kind != "end"]
    where = np.array([one.index + 1 for one in inner], dtype=np.int64)
    own = np.arange(path.count)
    own = own + np.searchsorted(where, own, side="right")
    mine = where + np.arange(len(inner))
    total = path.count + len(inner)
    u, info = np.empty((total, curve.n + 1)), np.zeros((total, trace.RECORDED))
    residual, unstable = np.empty(total), np.full(total, -1, dtype=np.int64)
    label = np.full(total, "", dtype=LABEL_DTYPE)
    u[own], info[own], residual[own] = path.u, path.info, path.residual
    unstable[own] = path.tests[:, POSITIVE].astype(np.int64)
    for i, one in zip(mine, inner, strict=True):
        u[i] = one.special.u
        gap = curve.length(u[i] - path.u[one.index])
        info[i, trace.ARCLENGTH] = path.info[one.index, trace.ARCLENGTH] + gap
        ends = path.tests[one.index : one.index + 2, POSITIVE]
        crossing = one.special.kind in labels_of_zero()
        unstable[i] = int(np.min(ends)) if crossing else int(ends[0])
        label[i] = KINDS[one.special.kind].label
    residual[mine] = curve.residuals(u[mine], None)
    places, seen = [], 0
    nothing = np.empty(0, dtype=complex)
    for one in specials:
        if one.special.kind == "end":
            place = 0 if one.along < 0 else total - 1
            label[place] = label[place] or KINDS["end"].label
        else:
            place, seen = int(mine[seen]), seen + 1
        places.append((one, place, _critical(one, nothing)))
    table = functools.partial(_dataset, problem, curve, u, info, residual, unstable, label, record)
    return table, places


def labels_of_zero() -> tuple[str, ...]:
    """Kinds of points at which real eigenvalues vanish."""
    marked = labels_along("fold", "branch_point")
    return tuple(kind.name for kind in KINDS.values() if kind.label in marked)


def _critical(one: Placed, nothing: npt.NDArray[np.complex128]) -> npt.NDArray[np.complex128]:
    """The eigenvalues that are known at a special point: those that are critical."""
    special = one.special
    if special.kind in labels_of_zero() and special.corank:
        return np.zeros(special.corank, dtype=complex)
    return nothing


def _dataset(
    problem: Problem, curve: LargeCurve, u: Array, info: Array, residual: Array, unstable: Any,
    label: Any, record: Record,
) -> xr.Dataset:  # fmt: skip
    dim, n = "point", curve.n
    numbers = {**curve.beside, curve.free: n}
    data: dict[str, Any] = {
        name: (dim, u[:, place].copy(), attrs_of(problem, name)) for name, place in numbers.items()
    }
    for name, array in fields_of(problem, u[:, :n]).items():
        data[name] = array
        axes = tuple(range(1, array.ndim))
        for word, function in NUMBERS.items():
            says = {**array.attrs, "long_name": f"{word} of {array.attrs.get('long_name', name)}"}
            data[f"{name}_{word}"] = (dim, function(array.values, axis=axes), says)
    unknown = "number of eigenvalues with a positive real part; -1: not known"
    data["n_unstable"] = (dim, unstable, {"long_name": unknown})
    data["arclength"] = (
        dim, info[:, trace.ARCLENGTH].copy(), {"long_name": "arclength on scaled axes"},
    )  # fmt: skip
    data["special"] = (dim, label, {"long_name": "label of a special point"})
    data["step"] = (dim, info[:, trace.STEP_LENGTH].copy(), {"long_name": "length of the step"})
    data["residual"] = (dim, residual, {"long_name": "largest f relative to its terms"})
    data["newton_steps"] = (dim, info[:, trace.NEWTON_STEPS].astype(np.int64))
    ds = xr.Dataset(data)
    coords = {k: ((), v, attrs_of(problem, k)) for k, v in problem.parameters.items()}
    ds = ds.assign_coords({k: v for k, v in coords.items() if k not in numbers})
    if record:
        from phasekit.labelled.continuation.recording import recorded

        ds = ds.assign(recorded(problem, ds, (curve.free,), record))
    for variable in ds.variables.values():
        if isinstance(variable.data, np.ndarray):
            variable.data.flags.writeable = False
    return ds
