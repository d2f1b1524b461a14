"""Branches of fields of states: arrays over the places of the states, with their special points."""

from __future__ import annotations

import functools
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np
import numpy.typing as npt
import xarray as xr

from phasekit.arrays import Array
from phasekit.bifurcation.continuation.kernels import trace
from phasekit.bifurcation.continuation.large.curve import LargeCurve
from phasekit.bifurcation.continuation.large.search import POSITIVE
from phasekit.bifurcation.continuation.points.special import Placed
from phasekit.bifurcation.continuation.walk import Found
from phasekit.bifurcation.special_points import KINDS
from phasekit.labelled.continuation.branch import Branch, Place, Record
from phasekit.labelled.continuation.branch_points import Points, attrs_of, labels_along, woven
from phasekit.labelled.continuation.large_store import arrays_of, made_again, words_of
from phasekit.systems.field_arrays import fields_of
from phasekit.systems.problem import Problem

#: What is shown of a field at each point.
NUMBERS: dict[str, Callable[..., Any]] = {"min": np.min, "mean": np.mean, "max": np.max}


@dataclass(frozen=True, eq=False, repr=False)
class LargeBranch(Branch):
    """A curve of equilibria of fields of states: `Branch`, with arrays for states."""

    way: ClassVar[str] = "large"
    _derived: ClassVar[tuple[str, ...]] = ("_table", "matrix", "bordered")

    @staticmethod
    def _tabulated(
        problem: Problem, walker: Any, found: Found, record: Record
    ) -> tuple[Callable[[], xr.Dataset], list[Place]]:
        return points_of(problem, walker.curve, found, record)

    def _values(self, special: Any) -> tuple[Any, dict[str, float]]:
        curve, parameters = self.walker.curve, dict(self.problem.parameters)
        for name, place in {**curve.beside, curve.free: curve.n}.items():
            parameters[name] = float(special.u[place])
        return special.u[: len(self.problem.state)], parameters

    @functools.cached_property
    def free(self) -> tuple[str, ...]:
        """The free parameters."""
        parameters = self.problem.parameters
        return (*(name for name in self.curve.beside if name in parameters), self.curve.free)

    @property
    def problem_state(self) -> tuple[str, ...]:
        """The fields of states, each by what a picture shows of it first: its largest value."""
        return tuple(f"{block.name}_max" for block in self.problem.blocks)

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
    inner = [one for one in specials if one.kind != "end"]
    own, mine, label, places = woven(path.count, specials)
    total = len(label)
    u, info = np.empty((total, curve.n + 1)), np.zeros((total, trace.RECORDED))
    residual, unstable = np.empty(total), np.full(total, -1, dtype=np.int64)
    u[own], info[own], residual[own] = path.u, path.info, path.residual
    unstable[own] = path.tests[:, POSITIVE].astype(np.int64)
    for i, one in zip(mine, inner, strict=True):
        u[i] = one.special.u
        gap = curve.length(u[i] - path.u[one.index])
        info[i, trace.ARCLENGTH] = path.info[one.index, trace.ARCLENGTH] + gap
        ends = path.tests[one.index : one.index + 2, POSITIVE]
        crossing = one.kind in labels_of_zero()
        unstable[i] = int(np.min(ends)) if crossing else int(ends[0])
    residual[mine] = curve.residuals(u[mine], None)
    table = functools.partial(_dataset, problem, curve, u, info, residual, unstable, label, record)
    known = [_critical(one) for one in specials]
    return table, list(zip(specials, places, known, strict=True))


def labels_of_zero() -> tuple[str, ...]:
    """Kinds of points at which real eigenvalues vanish."""
    marked = labels_along("fold", "branch_point")
    return tuple(kind.name for kind in KINDS.values() if kind.label in marked)


def _critical(one: Placed) -> npt.NDArray[np.complex128]:
    """The eigenvalues that are known at a special point: those that are critical."""
    crossing = one.kind in labels_of_zero()
    return np.zeros(one.special.corank if crossing else 0, dtype=complex)


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
    ds = Points(data)
    coords = {k: ((), v, attrs_of(problem, k)) for k, v in problem.parameters.items()}
    ds = ds.assign_coords({k: v for k, v in coords.items() if k not in numbers})
    if record:
        from phasekit.labelled.continuation.recording import recorded

        ds = ds.assign(recorded(problem, ds, (curve.free,), record))
    for variable in ds.variables.values():
        if isinstance(variable.data, np.ndarray):
            variable.data.flags.writeable = False
    return ds
