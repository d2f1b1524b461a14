"""A center that is followed while parameters change slowly, labelled, with its jumps."""

from __future__ import annotations

import warnings
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
import xarray as xr

from phasekit.bifurcation.exact.line import Path
from phasekit.bifurcation.exact.normal_forms import fold_angle
from phasekit.bifurcation.exact.quasi_static import (
    NEAR,
    Segment,
    Walk,
    center_on,
    sheet_of,
    start_label,
)
from phasekit.cells.schema import dataset_attrs, input_attrs
from phasekit.errors import ParameterError
from phasekit.labelled.atlas import single
from phasekit.labels.arguments import FloatArray, bad, number, numeric, unknown
from phasekit.labels.grid import variable
from phasekit.phase.exact.equilibria import equilibria
from phasekit.phase.exact.potential import potential
from phasekit.systems.system import System
from phasekit.table.quantities import ROWS


def quasi_static(
    system: Any,
    path: Mapping[str, Any] | None = None,
    *,
    phi0: float | None = None,
    **path_by_name: Any,
) -> xr.Dataset:
    """Follow one center while parameters change slowly, with its jumps at folds.

    A hysteresis loop of a magnet, or the slow run-up of a disk.

    Parameters
    ----------
    system : system
        A single system; its own values of the parameters that change are not used.
    path : mapping of str to array_like, optional
        Values of the parameters that change, step by step, forth and back as often as wanted: 1-D
        arrays of one length. Between steps parameters change on a straight line.
    phi0 : float, optional
        The angle in rad from which the system slides to rest at the first step; by default it
        begins in the deepest well.
    **path_by_name
        The path by keyword in place of `path`.

    Returns
    -------
    xarray.Dataset
        On ``step``, with the parameters of the path as coordinates: ``phi`` in rad, ``energy`` in
        s^-2 and ``natural_frequency`` in s^-1 of the center, and ``jumped``, whether it was lost
        since the step before. On ``jump``: ``jump_step``, the parameters at the fold
        (``jump_omega1``, ...), ``jump_phi_from`` and ``jump_phi_to`` in rad, and ``jump_loss``,
        the energy in s^-2 that is lost by coming to rest in the other well. Where there is no force
        the center disappears for good: NaN from there on, with a RuntimeWarning.

    Raises
    ------
    ParameterError
        If the system is not a single one, a parameter of the path is unknown or leaves its domain,
        lengths differ, an angle changes together with others, or phi0 is no place in a well.

    Notes
    -----
    No step is too large: all folds between two steps are found by exact arithmetic, as in
    `branches`, so that jumps and their places do not depend on the steps. Quasi-static change with
    damping is meant: slow against the oscillation and its decay. A center ends where
    ``|B|^(2/3) + |C|^(2/3) = |A|^(2/3)``, a fold ([Kuznetsov2004] section 3.3), or a cusp of this
    curve. Where a pitchfork leaves the choice between two wells, it is that of the limit B, C -> 0
    from above.

    Examples
    --------
    A field turned down along the easy axis, and the field at which the magnet switches:

    >>> import numpy as np
    >>> import phasekit as pk
    >>> magnet = pk.StonerWohlfarth(K=1.0, h_x=0.0, h_y=0.0)
    >>> loop = pk.quasi_static(magnet, h_x=np.linspace(3.0, -3.0, 13))
    >>> np.cos(loop.phi.values).round(6).tolist()[:3], loop.jump_h_x.values.tolist()
    ([1.0, 1.0, 1.0], [-2.0])
    """
    values = _values(path, path_by_name)
    system, _ = single(system)
    steps = _steps(system, values)
    # The names that stand still have numbers.
    names = system.formula_inputs()
    moved = {name: array for name, array in steps.items() if np.ptp(array) > 0.0}
    size = len(next(iter(steps.values())))
    fixed = {name: float(system.parameters[name]) for name in names}
    fixed |= {name: float(array[0]) for name, array in steps.items() if name not in moved}
    arrays = {name: np.full(size, value) for name, value in fixed.items()} | moved
    A, B, C = type(system).valid_coefficients(arrays)
    points = equilibria(A, B, C)
    if not (points.n_equilibria > 0).all():
        first = int(np.argmin(points.n_equilibria > 0))
        if first == 0 or points.n_equilibria[first] < 0:
            raise bad("path", f"step {first}", "parameters for which there are equilibria")
    track = _Track(system, fixed, moved, A, points)
    label = 0
    if phi0 is not None:
        angle = number("phi0", phi0, "an angle in rad", "rad")
        label = start_label(
            type(points)(*(field[0] for field in points)), (A[0], B[0], C[0]), _wrapped(angle)
        )
        if label < 0:
            raise bad("phi0", phi0, "an angle at which there is a force", "it is no center")
    sheets, jumps = track.follow(label)
    there = len(sheets)
    if there < size:
        warnings.warn(
            f"path: there is no force before step {there}, where the center disappears",
            RuntimeWarning,
            stacklevel=2,
        )
    return _dataset(system, steps, track, np.array(sheets), jumps)


def _values(path: Mapping[str, Any] | None, by_name: Mapping[str, Any]) -> dict[str, Any]:
    if path is not None and not isinstance(path, Mapping):
        raise bad("path", path, "a mapping of parameter names to values, {'omega1': [...]}")
    values = dict(path or {})
    for name in by_name:
        if name in values:
            raise ParameterError(f"{name}: got it in path and as a keyword, wants it once")
    values.update(by_name)
    if not values:
        raise bad("path", None, "values of a parameter, as in pk.quasi_static(system, a=[...])")
    return values


def _steps(system: System, values: Mapping[str, Any]) -> dict[str, FloatArray]:
    """The parameters of a path as arrays of one length; numbers stand still."""
    declared = {p.name: p for p in system.declared if p.name in system.formula_inputs()}
    kept: dict[str, Any] = {}
    for name, value in values.items():
        if name not in declared:
            raise unknown(f"parameter of {type(system).__name__}", name, declared)
        wants = f"a 1-D array, each value {declared[name].wants}"
        array = np.asarray(numeric(name, value, declared[name].units, wants))
        if array.ndim > 1 or not declared[name].valid(array).all():
            raise bad(name, value, wants)
        kept[name] = array
    sizes = {name: array.size for name, array in kept.items() if array.ndim}
    if len(set(sizes.values())) != 1:
        got = ", ".join(f"{n} values of {name}" for name, n in sizes.items()) or "numbers alone"
        raise bad("path", got, "1-D arrays of one length")
    (size,) = set(sizes.values())
    return {name: np.array(np.broadcast_to(array, size)) for name, array in kept.items()}


@dataclass(frozen=True)
class _Lost:
    """A jump: before which step, and the parameters at the fold."""

    step: int
    at: dict[str, float]


@dataclass(frozen=True)
class _Track:
    """Steps of a system along a path."""

    system: System
    fixed: dict[str, float]
    moved: dict[str, FloatArray]
    A: FloatArray
    points: Any

    def follow(self, label: int) -> tuple[list[int], list[_Lost]]:
        """Sheets of the center step by step, as far as it goes, and its jumps."""
        inside = self.points.n_equilibria[0] > 2
        sheet = sheet_of(self.A[0], self.points.phi[0, label]) if inside else 0
        sheets, jumps = [sheet], []
        for first, walk, place in self._walks():
            found, lost, ended = walk.follow(sheets[-1])
            jumps += [_Lost(first + one.step, place(one.at)) for one in lost]
            sheets += found[1:]
            if ended:
                break
        return sheets, jumps

    def _walks(self) -> Iterator[tuple[int, Walk, Any]]:
        """Straight parts: the step at which each begins, its walk, and the parameters on it."""
        law, size = self.system.trigonometric(), self.A.size
        numbers = self.points.n_equilibria.tolist()
        if not self.moved:
            yield 0, Walk(Segment(law, self.fixed, "", (0.0, 1.0)), [0.5] * size, numbers), dict
            return
        angles = [name for name in self.moved if name in law.angles]
        if len(self.moved) == 1:
            ((name, array),) = self.moved.items()
            path = Path(law, self.fixed, name, (float(array.min()), float(array.max())))
            yield 0, Walk(path, array.tolist(), numbers), lambda at: {name: at}
            return
        if angles:
            raise bad(angles[0], "an angle that changes with others", "an angle that moves alone")
        names = list(self.moved)
        places = np.stack([self.moved[name] for name in names])
        line = _line(places)
        parts = [(0, size, line)] if line is not None else [
            (k, k + 2, np.array([0.0, 1.0])) for k in range(size - 1)
        ]  # fmt: skip
        for first, last, at in parts:
            low, high = (places[:, first + int(pick(at))] for pick in (np.argmin, np.argmax))
            ends = (dict(zip(names, low, strict=True)), dict(zip(names, high, strict=True)))
            still = {name: value for name, value in self.fixed.items() if name not in names}
            path = Segment(law, still, "", (0.0, 1.0), ends)
            yield first, Walk(path, at.tolist(), numbers[first:last]), _between(names, low, high)


def _between(names: list[str], low: FloatArray, high: FloatArray) -> Any:
    return lambda at: dict(zip(names, (low + at * (high - low)).tolist(), strict=True))


def _line(places: FloatArray) -> FloatArray | None:
    """How far along one straight line steps are, from 0 to 1; None if they are not on one."""
    scale = np.abs(places).max(axis=1, keepdims=True)
    unit = places / np.where(scale > 0.0, scale, 1.0)
    way = unit - unit[:, :1]
    far = way[:, np.argmax((way * way).sum(axis=0))]
    along = far @ way / (far @ far)
    low, high = np.argmin(along), np.argmax(along)
    at = np.asarray((along - along[low]) / (along[high] - along[low]))
    off = unit - (unit[:, [low]] + at * (unit[:, [high]] - unit[:, [low]]))
    return at if np.abs(off).max() <= NEAR else None


def _wrapped(angle: float) -> float:
    return float(np.arctan2(np.sin(angle), np.cos(angle))) if abs(angle) > np.pi else angle


def _dataset(
    system: System,
    steps: dict[str, FloatArray],
    track: _Track,
    sheets: Any,
    jumps: list[_Lost],
) -> xr.Dataset:
    size, there = track.A.size, sheets.size
    rows = np.arange(there)
    points = type(track.points)(*(field[:there] for field in track.points))
    label = center_on(points, track.A[:there], sheets)
    jumped = np.zeros(size, bool)
    jumped[[one.step for one in jumps]] = True
    data = {}
    for name in ("phi", "energy", "natural_frequency"):
        column = np.full(size, np.nan)
        column[:there] = getattr(points, name)[rows, label]
        data[name] = variable(("step",), column, ROWS[name].attrs)
    about = "whether the center was lost at a fold since the step before"
    data["jumped"] = variable(("step",), jumped, {"long_name": about})
    data |= _jumps(system, track, jumps, steps)
    coords = {
        "step": variable(("step",), np.arange(size), {"long_name": "step along the path"}),
        **{
            name: variable(
                ("step",) if name in steps else (),
                steps.get(name, value),
                input_attrs(system, name),
            )
            for name, value in system.parameters.items()
        },
    }
    return xr.Dataset(data, coords, dataset_attrs(system))


def _jumps(
    system: System, track: _Track, jumps: list[_Lost], steps: dict[str, FloatArray]
) -> dict[str, xr.Variable]:
    at = {
        name: np.array([{**track.fixed, **one.at}[name] for one in jumps]) for name in track.fixed
    }
    A, B, C = type(system).valid_coefficients(at)
    points = equilibria(A, B, C)
    start = fold_angle(A, B, C)
    end = points.phi[:, 0]
    columns = {
        "jump_step": (np.array([one.step for one in jumps], int), "1", "first step after the jump"),
        **{
            f"jump_{name}": (
                at[name], input_attrs(system, name)["units"],
                f"{input_attrs(system, name)['long_name']} at the fold",
            )
            for name in steps
        },
        "jump_phi_from": (start, "rad", "angle of the center where the fold ends it"),
        "jump_phi_to": (end, "rad", "angle of the center to which it jumps"),
        "jump_loss": (
            potential(A, B, C, start) - points.energy[:, 0], "s-2", "energy that the jump loses",
        ),
    }  # fmt: skip
    return {
        name: variable(("jump",), column, {"long_name": about, "units": units})
        for name, (column, units, about) in columns.items()
    }
