"""One attractor of a flow or map that is followed while parameters change slowly, labelled."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
import xarray as xr

from phasekit.cells.equations import peak
from phasekit.cells.schema import dataset_attrs, input_attrs
from phasekit.errors import warn
from phasekit.labelled.flows import refuse_force, start_state, steps_of
from phasekit.labels.arguments import FloatArray, bad, unknown
from phasekit.labels.grid import LABEL_DTYPE, variable
from phasekit.laws.equations import Equations
from phasekit.laws.ladder import Map
from phasekit.motion.flow import RTOL
from phasekit.motion.pace import units_of
from phasekit.motion.slow_path import DENSE, Kept, SlowPath, growth
from phasekit.numerics.waits import notice
from phasekit.systems.problem_parts import refuse_aperiodic
from phasekit.systems.system import System, single
from phasekit.table.attractors import rows_of

#: Part of their range by which extremes may be off before more states are taken along a way.
CLOSE = 1e-4


def slow_path(system: System, law: Equations, path: Mapping[str, Any], x0: Any) -> xr.Dataset:
    """Follow an attractor along a path of parameters; see `phasekit.quasi_static`."""
    refuse_force(system)
    refuse_aperiodic(law, system)
    for name in path:
        if name not in law.names:
            raise unknown("path: parameter", name, law.names)
    steps = steps_of(path, dict.fromkeys(path))
    first = system.replace(**{name: float(array[0]) for name, array in steps.items()})
    _, parameters = single(first)
    count = len(next(iter(steps.values())))
    start = start_state(law, x0)
    places = np.arange(count)

    def inputs(place: float) -> dict[str, FloatArray]:
        return {
            name: np.asarray(np.interp(place, places, steps[name]) if name in steps else value)
            for name, value in parameters.items()
        }

    widths = np.array([np.ptp(law.window.get(name, (0.0, 0.0))) for name in law.states])
    units = units_of(law, inputs(0.0), start[None], widths)
    units = np.where(widths > 0.0, units, np.maximum(units, np.abs(start)))
    track = SlowPath(law, inputs, units, RTOL)
    with notice(f"following an attractor along {count:,} steps"):
        kept = track.settled(start[None], 0.0)
        if kept is None:
            why = "runs to infinity" if track.escaped else "comes to no attractor that is found"
            raise bad(
                "x0", start.tolist(), "a state in a basin at the first step", f"its motion {why}"
            )
        found = track.follow(kept, count)
        ds = _dataset(first, law, steps, track, found)
    there = sum(one is not None for one in found)
    if there < count:
        why = "runs to infinity" if track.escaped else "comes to nothing that is found"
        warn(
            f"path: the attractor is lost before step {there}, and the motion from it {why}; from "
            "there on results are NaN",
            RuntimeWarning,
        )
    return ds


def _dataset(
    system: System, law: Equations, steps: Mapping[str, FloatArray], track: SlowPath,
    found: list[Kept | None],
) -> xr.Dataset:  # fmt: skip
    rows, count = rows_of(law), len(found)
    low, high = np.full((2, count, len(law.states)), np.nan)
    kind, period, recovery = (
        np.full(count, -1, np.int8),
        np.full(count, np.nan),
        np.full(count, np.nan),
    )
    for k, one in enumerate(found):
        if one is None:
            continue
        low[k], high[k] = _extremes(track, one, float(k))
        kind[k], period[k] = one.kind, one.period
        if one.values.size:
            time = 1.0 if one.is_rest_of_flow else one.period
            time *= track.leg(float(k)) if track.strobed and law.time is not None else 1.0
            recovery[k] = -growth(one) / time
    jumped = np.zeros(count, bool)
    jumped[[min(int(np.ceil(loss.place)), count - 1) for loss in track.losses]] = True
    on = ("step",)
    data: dict[str, xr.Variable] = {}
    for i, name in enumerate(law.states):
        for word, values in (("least", low), ("greatest", high)):
            attrs = {
                "long_name": f"{word} {name} along the attractor",
                "units": law.units.get(name, "1"),
            }
            end = "min" if word == "least" else "max"
            data[f"{name}_{end}"] = variable(on, values[:, i], attrs)
    data["attractor_kind"] = variable(on, kind, rows["attractor_kind"].attrs)
    data["attractor_period"] = variable(on, period, rows["attractor_period"].attrs)
    words = "rate at which disturbances decay; it vanishes where the attractor is lost"
    data["recovery_rate"] = variable(on, recovery, {"long_name": words, "units": "1"})
    about = "whether the attractor was lost since the step before"
    data["jumped"] = variable(on, jumped, {"long_name": about})
    data |= _losses(system, law, steps, track)
    coords = {"step": variable(on, np.arange(count), {"long_name": "step along the path"})}
    for name, value in system.parameters.items():
        own = on if name in steps else ()
        coords[name] = variable(own, steps.get(name, value), input_attrs(system, name))
    return xr.Dataset(data, coords, dataset_attrs(system))


def _losses(
    system: System, law: Equations, steps: Mapping[str, FloatArray], track: SlowPath
) -> dict[str, xr.Variable]:
    """Where the attractor was lost, and what came after."""
    losses, n = track.losses, len(law.states)
    nothing = np.full(n, np.nan)
    columns: dict[str, tuple[Any, dict[str, str]]] = {
        "jump_step": (
            np.array([int(np.ceil(one.place)) for one in losses], int),
            {"long_name": "first step after it"},
        ),
        "jump_kind": (
            np.array([one.why for one in losses], LABEL_DTYPE),
            {"long_name": "how the attractor is lost"},
        ),
        "jump_soft": (
            np.array([one.soft for one in losses], bool),
            {"long_name": "whether what comes after grows out of what was before"},
        ),
    }
    for name in steps:
        own = {**input_attrs(system, name)}
        own["long_name"] = f"{own.get('long_name', name)} where the attractor is lost"
        places = np.array([float(track.at(one.place)[name]) for one in losses])
        columns[f"jump_{name}"] = places, own
    for i, name in enumerate(law.states):
        units = {"units": law.units.get(name, "1")}
        before = np.array([one.before.points[-1, i] for one in losses])
        after = np.array(
            [(nothing if one.after is None else one.after.points[0])[i] for one in losses]
        )
        columns[f"jump_from_{name}"] = before, {"long_name": f"{name} before the jump", **units}
        columns[f"jump_to_{name}"] = after, {"long_name": f"{name} after the jump", **units}
    return {name: variable(("jump",), values, attrs) for name, (values, attrs) in columns.items()}


def _extremes(track: SlowPath, one: Kept, place: float) -> tuple[FloatArray, FloatArray]:
    """Least and greatest states along a closed way, between its points by quartics.

    Of a map, and of what is not periodic, states follow each other on no smooth way.
    """
    way = track.way(one, place)
    if not one.period or isinstance(track.law, Map):
        return way.min(axis=0), way.max(axis=0)
    for count in (DENSE, 8 * DENSE, 64 * DENSE, 512 * DENSE):
        way = track.way(one, place, count)
        ends = np.array([[peak(sense * column) for column in way.T] for sense in (-1.0, 1.0)])
        turning = np.abs(way[0] - way[-1]) > 0.5 * np.ptp(way, axis=0)  # of a rotation
        if np.all(turning | (ends[..., 1] <= CLOSE * np.ptp(way, axis=0) + 1e-9 * track.units)):
            break
    else:
        warn("path: an orbit changes so fast that its extremes are known roughly", RuntimeWarning)
    return -ends[0, :, 0], ends[1, :, 0]
