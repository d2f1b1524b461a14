"""A center that is followed while parameters change slowly, labelled, with its jumps."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
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
from phasekit.bifurcation.numerical.quasi_static import Track
from phasekit.bifurcation.numerical.steady import steady_line
from phasekit.cells.request import with_words
from phasekit.cells.schema import dataset_attrs, input_attrs, own_names
from phasekit.errors import ParameterError, warn
from phasekit.inputs import call_checked
from phasekit.labelled.atlas import resting, single, tell_missing
from phasekit.labelled.flows import steps_of
from phasekit.labelled.slow_path import slow_path
from phasekit.labels.arguments import FloatArray, bad, number, unknown
from phasekit.labels.grid import variable
from phasekit.laws.ladder import Trait
from phasekit.laws.trigonometric import Trigonometric
from phasekit.phase.exact.phase_space import equilibria
from phasekit.phase.exact.potential import potential
from phasekit.systems.system import System, as_system
from phasekit.table.quantities import ROWS


@call_checked
def quasi_static(
    system: Any,
    path: Mapping[str, Any] | None = None,
    *,
    phi0: float | None = None,
    x0: Any = None,
    **path_by_name: Any,
) -> xr.Dataset:
    """Follow one center or attractor while parameters change slowly, with its jumps.

    A hysteresis loop of a magnet, the slow run-up of a disk, the tipping of a climate.

    Parameters
    ----------
    system : system
        A single system; its own values of the parameters that change are not used. Of a
        `Perturbed` system the constant torque counts, and nothing else; one with terms of its own
        is a flow.
    path : mapping of str to array_like, optional
        Values of the parameters that change, step by step, forth and back as often as wanted: 1-D
        arrays of one length. Between steps parameters change on a straight line.
    phi0 : float, optional
        The angle in rad from which the system slides to rest at the first step; by default it
        begins in the deepest well.
    x0 : mapping or sequence, optional
        Of a flow or map, the state whose attractor at the first step is followed; by default the
        system's `start`, or next to the middle of the window.
    **path_by_name
        The path by keyword in place of `path`.

    Returns
    -------
    xarray.Dataset
        On ``step``, with the parameters of the path as coordinates: ``phi`` in rad, ``energy`` in
        s^-2 and ``natural_frequency`` in s^-1 of the center, and ``jumped``, whether it was lost
        since the step before. On ``jump``: ``jump_step``, the parameters at the fold
        (``jump_omega1``, ...), ``jump_phi_from`` and ``jump_phi_to`` in rad, and ``jump_loss``,
        the energy in s^-2 that is lost by coming to rest in the other well; ``jump_certain`` says
        whether it comes to rest there however weak the damping is. ``complete`` says whether it is
        proved that no jump is missing. Where there is no force, or nothing stops the motion, or the
        center leaves the interval, it is lost for good: NaN from there on, with a RuntimeWarning.

        Of a flow or map, on ``step``: the least and greatest value of each state along the
        attractor (``v_min``, ``v_max``), ``attractor_kind``, ``attractor_period``, the
        ``recovery_rate`` of disturbances, and ``jumped``. On ``jump``: ``jump_step``, the
        parameters where the attractor is lost, ``jump_kind`` (fold, hopf, period_doubling, torus,
        crisis), ``jump_soft``, whether what comes after grows out of it, and for each state
        ``jump_from_`` and ``jump_to_``. Where the motion then runs to infinity, NaN from there on,
        with a RuntimeWarning.

    Raises
    ------
    ParameterError
        If the system is not a single one, a parameter of the path is unknown or leaves its domain,
        lengths differ, or phi0 is no place in a well.

    Notes
    -----
    No step is too large: all folds between two steps are found by exact arithmetic, as in
    `branches`, so that jumps and their places do not depend on the steps. Quasi-static change with
    damping is meant: slow against the oscillation and its decay. A center ends where
    ``|B|^(2/3) + |C|^(2/3) = |A|^(2/3)``, a fold ([Kuznetsov2004] section 3.3), or a cusp of this
    curve. Where a pitchfork leaves the choice between two wells, it is that of the limit B, C -> 0
    from above.

    In any other potential, or under a torque, a center is held from step to step by a tube in which
    V'' > 0 and V' has its signs at the walls for all parameters in between, by interval arithmetic;
    where there is no such tube, all mergers on the way are found as in `branches`. From a fold the
    force leads to the next center on its side; from a pitchfork to the right.

    An equilibrium or a periodic orbit of a flow or map is found step by step by Newton's method,
    and attracts by its eigenvalues or multipliers; where it does not, steps are halved until the
    place is known to 1e-11 of a step. The motion from there, a little beyond, shows what comes
    after. At a pitchfork it goes to the side of the greater first state. A chaotic attractor is
    followed by its motion.

    Examples
    --------
    A field turned down along the easy axis, and the field at which the magnet switches:

    >>> import numpy as np
    >>> import phasekit as pk
    >>> magnet = pk.StonerWohlfarth(K=1.0, h_x=0.0, h_y=0.0)
    >>> loop = pk.quasi_static(magnet, h_x=np.linspace(3.0, -3.0, 13))
    >>> np.cos(loop.phi.values).round(6).tolist()[:3], loop.jump_h_x.values.tolist()
    ([1.0, 1.0, 1.0], [-2.0])

    A fold of a lake's model, at which it tips:

    >>> lake = pk.Problem("a - x + 2*x^2/(x^2 + 1)", "x", {"a": 0.1}, window={"x": (0, 4)})
    >>> up = pk.quasi_static(lake, a=np.linspace(0.1, 0.2, 11), x0=0.1)
    >>> up.jump_a.round(6).values.tolist(), up.jump_kind.values.tolist()
    ([0.134884], ['fold'])
    """
    values = _values(path, path_by_name)
    system = as_system(system)
    law = system.own_equations
    if Trait.OWN in (system.standing.traits or Trait(0)):  # rests of which no potential tells
        law = system.equations()
    if law is not None:
        if phi0 is not None:
            raise bad("phi0", phi0, "nothing for a system with states of its own: x0")
        return slow_path(system, law, values, x0)
    if x0 is not None:
        raise bad("x0", x0, "nothing for a system whose state is phi0")
    if not system.standing.is_within(Trigonometric):
        return _of_any(system, values, phi0)
    system, _ = single(system)
    steps = _steps(system, values, system.formula_inputs())
    # The names that stand still have numbers.
    names = system.formula_inputs()
    moved = {name: array for name, array in steps.items() if np.ptp(array) > 0.0}
    if len(moved) > 1 and not moved.keys().isdisjoint(system.trigonometric().angles):
        return _of_any(system, values, phi0)  # no polynomials along such lines
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
        warn(
            f"path: there is no force before step {there}, where the center disappears",
            RuntimeWarning,
        )
    return _dataset(system, steps, track, np.array(sheets), jumps)


def _of_any(system: System, values: Mapping[str, Any], phi0: Any) -> xr.Dataset:
    """A center of any potential, or under a torque."""
    system, law, numbers = resting(system, what="quasi_static")
    steps = _steps(system, values, list(numbers))
    line = steady_line(
        law, numbers, {name: (float(a[0]), float(a[-1])) for name, a in steps.items()}
    )
    track = Track(line.formula, line.still, steps)
    valid = track.points.n_equilibria >= 0
    if not valid.all():
        raise bad("path", f"step {int(np.argmin(valid))}", "parameters for which V is finite")
    if phi0 is None:
        column = track.deepest()
        if column < 0:
            raise bad("path", "step 0", "parameters for which there is a center")
    else:
        column = track.slide(number("phi0", phi0, "a coordinate", system.unit_of("state_phi")))
        if column < 0:
            raise bad("phi0", phi0, "a coordinate from which the force leads to a center")
    found = track.follow(column)
    tell_missing("quasi_static", "the path", track.missing)
    there = found >= 0
    if not there.all():
        warn(
            f"path: {track.gone or 'the center disappears'} before step {int(np.argmin(there))}",
            RuntimeWarning,
        )
    rows = np.flatnonzero(there)
    columns = {}
    for name in ("phi", "energy", "natural_frequency"):
        columns[name] = np.full(found.size, np.nan)
        columns[name][rows] = getattr(track.points, name)[rows, found[rows]]
    moved = {
        "step": np.array([one.step for one in track.jumps], int),
        **{name: np.array([one.at[name] for one in track.jumps]) for name in steps},
        "phi_from": np.array([one.start for one in track.jumps]),
        "phi_to": np.array([one.end for one in track.jumps]),
        "loss": np.array([one.loss for one in track.jumps]),
        "certain": np.array([one.certain for one in track.jumps], bool),
    }
    return _labelled(system, steps, columns, moved, complete=not track.missing)


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


def _steps(
    system: System, values: Mapping[str, Any], inputs: Sequence[str]
) -> dict[str, FloatArray]:
    """The parameters of a path, of those on which the law depends, as arrays of one length."""
    declared = {p.name: p for p in system.declared if p.name in inputs}
    for name in values:
        if name not in declared:
            raise unknown(f"parameter of {type(system).__name__}", name, declared)
    return steps_of(values, declared)


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
        if len(self.moved) == 1:
            ((name, array),) = self.moved.items()
            path = Path(law, self.fixed, name, (float(array.min()), float(array.max())))
            yield 0, Walk(path, array.tolist(), numbers), lambda at: {name: at}
            return
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
    columns = {}
    for name in ("phi", "energy", "natural_frequency"):
        columns[name] = np.full(size, np.nan)
        columns[name][:there] = getattr(points, name)[rows, label]
    at = {
        name: np.array([{**track.fixed, **one.at}[name] for one in jumps]) for name in track.fixed
    }
    A, B, C = type(system).valid_coefficients(at)
    points = equilibria(A, B, C)
    start = fold_angle(A, B, C)
    moved = {
        "step": np.array([one.step for one in jumps], int),
        **{name: at[name] for name in steps},
        "phi_from": start,
        "phi_to": points.phi[:, 0],
        "loss": potential(A, B, C, start) - points.energy[:, 0],
        "certain": np.ones(len(jumps), bool),  # there is no other center
    }
    return _labelled(system, steps, columns, moved, complete=True)


def _labelled(
    system: System,
    steps: dict[str, FloatArray],
    columns: Mapping[str, FloatArray],
    jumps: Mapping[str, Any],
    *,
    complete: bool,
) -> xr.Dataset:
    size = len(next(iter(steps.values())))
    rows = with_words(system, [ROWS[name] for name in columns])
    data = {row.name: variable(("step",), columns[row.name], row.attrs) for row in rows}
    jumped = np.zeros(size, bool)
    jumped[jumps["step"]] = True
    about = "whether the center was lost at a fold since the step before"
    data["jumped"] = variable(("step",), jumped, {"long_name": about})
    angle, height = (row.units for row in rows[:2])
    words = {
        "step": ("1", "first step after the jump"),
        **{
            name: (
                input_attrs(system, name)["units"],
                f"{input_attrs(system, name)['long_name']} at the fold",
            )
            for name in steps
        },
        "phi_from": (angle, "angle of the center where the fold ends it"),
        "phi_to": (angle, "angle of the center to which it jumps"),
        "loss": (height, "energy that the jump loses"),
        "certain": ("1", "whether it jumps there however weak the damping is"),
    }
    for name, values in jumps.items():
        units, long_name = words[name]
        if angle != "rad":
            long_name = long_name.replace("angle", "coordinate")
        data[f"jump_{name}"] = variable(("jump",), values, {"long_name": long_name, "units": units})
    data["complete"] = variable((), complete, {"long_name": "whether no jump can be missing"})
    coords = {
        "step": variable(("step",), np.arange(size), {"long_name": "step along the path"}),
        **{
            name: variable(
                ("step",) if name in steps else (),
                steps.get(name, value),
                input_attrs(system, name),
            )
            for name, value in system.parameters.items()
            if name not in data
        },
    }
    coords |= own_names(system.coordinate or "phi", {**data, **coords})
    return xr.Dataset(data, coords, dataset_attrs(system))
