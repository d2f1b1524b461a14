"""The figure-eight along a path of parameters: its loops, and where it comes and goes."""

from __future__ import annotations

import functools
from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np
import xarray as xr

from phasekit.errors import ParameterError
from phasekit.labelled.phase_space import equilibria, separatrices
from phasekit.labels.arguments import FloatArray, bad, pair, unknown, whole
from phasekit.labels.grid import LABEL_DTYPE, refuse_too_large, variable
from phasekit.systems.system import Model, as_system

_PARTS = 33


def figure_eights(
    system: Any,
    path: Mapping[str, Sequence[float] | Callable[[FloatArray], Any]],
    n: int = 401,
) -> xr.Dataset:
    """Follow the separatrices along a path of parameters; find where the figure-eight changes.

    Parameters
    ----------
    system : system
        A single system; parameters that are not on the path keep its values.
    path : mapping
        Parameter -> (first, last value), a straight way, or a function of the places on the path,
        an array from 0 to 1.
    n : int, default 401
        Number of places. Two events between neighboring places that cancel are not seen.

    Returns
    -------
    xarray.Dataset
        On ``path`` (0 to 1): the parameters, and all that `separatrices` says (topology,
        figure_eight, lobe_area, ...). On ``event``: ``event_path``, the parameters there as
        ``event_<name>``, ``event_kind`` (fold: two equilibria merge; heteroclinic: two saddles
        have equal energy, and the eight passes from one to the other) and ``event_change``
        (birth, death, exchange, or none of the eight).

    Raises
    ------
    ParameterError
        If an argument is unusable.

    Notes
    -----
    The separatrices are level sets of the energy at the saddles ([Veljovic2015] (14)), so there is
    nothing to integrate, and no parameter has to be added to keep a homoclinic orbit closed. Events
    are narrowed to rounding.

    Examples
    --------
    >>> import phasekit as pk
    >>> disk = pk.GyroRotorDisk(beta=0.1, e=0.0115, a=0.02, r=0.21, omega1=2.5)
    >>> ds = figure_eights(disk, {"beta": (0.1, 0.6), "a": (0.02, 0.001)})
    >>> ds.event_kind.values.tolist(), ds.event_change.values.tolist()
    (['fold'], ['death'])
    """
    system = as_system(system)
    n = whole("n", n, "a number of places >= 2", 2)
    ways = _ways(system, path)
    refuse_too_large({"figure_eights": 8 * n}, {"s": n})
    s = np.linspace(0.0, 1.0, n)
    ds = separatrices(_at(system, ways, s))
    marks = _marks(system, ways, s)
    invalid = np.flatnonzero(marks[:, 2] < 0)
    if invalid.size:
        place = s[invalid[:1]]
        got = ", ".join(f"{name} = {way(place)[0]:.6g}" for name, way in ways.items())
        raise ParameterError(f"path: got {got}, wants values that {type(system).__name__} can have")
    found: list[tuple[float, tuple[Any, ...], tuple[Any, ...]]] = []
    for i in np.flatnonzero(np.any(marks[1:] != marks[:-1], axis=1)):
        found.extend(_narrow(system, ways, float(s[i]), float(s[i + 1])))
    return _with_events(ds, ways, s, _merged(found))


def _ways(system: Model, path: Any) -> dict[str, Callable[[FloatArray], FloatArray]]:
    if not isinstance(path, Mapping) or not path:
        raise bad("path", path, "a mapping: parameter -> (first, last), or a function of 0 to 1")
    names = [parameter.name for parameter in system.declared]
    ways: dict[str, Callable[[FloatArray], FloatArray]] = {}
    for name, way in path.items():
        if name not in names:
            raise unknown(f"path: parameter of {type(system).__name__}", name, names)
        if callable(way):
            ways[name] = functools.partial(_along, way)
            continue
        wants = "two numbers (first, last), or a function"
        first, last = pair(f"path[{name!r}]", way, wants, system.unit_of(name))
        ways[name] = functools.partial(_straight, first, last)
    for name, value in system.parameters.items():
        if name not in ways and not isinstance(value, float):
            raise bad(name, value, "one number")
    return ways


def _along(way: Callable[[FloatArray], Any], s: FloatArray) -> FloatArray:
    return np.array(np.broadcast_to(np.asarray(way(s), dtype=float), s.shape))


def _straight(first: float, last: float, s: FloatArray) -> FloatArray:
    return np.asarray(first + s * (last - first))


def _at(
    system: Model, ways: Mapping[str, Callable[[FloatArray], FloatArray]], s: FloatArray
) -> Model:
    changes = {name: xr.DataArray(way(s), dims="path") for name, way in ways.items()}
    for name, values in changes.items():
        if not np.isfinite(values.values).all():
            raise ParameterError(f"path[{name!r}]: got values that are not finite")
    return system.replace(**changes)


def _marks(
    system: Model, ways: Mapping[str, Callable[[FloatArray], FloatArray]], s: FloatArray
) -> Any:
    """What changes at an event: topology, number of equilibria, which saddle is the lower one."""
    at = _at(system, ways, s)
    ds = separatrices(at)
    count = equilibria(at).n_equilibria.values
    columns = [ds.topology.values, ds.figure_eight.values, count]
    if system.rung.labels_fixed:
        A, B, C = (np.broadcast_to(np.asarray(x), s.shape) for x in at.coefficients())
        side = np.where(A > 0.0, np.sign(B), 2.0 * np.sign(C))
        columns.append(np.where(ds.figure_eight.values, side, 0.0))
    else:  # saddles keep their numbers
        columns.extend(np.moveaxis(ds.loop.transpose("path", "saddle").values, 1, 0))
    return np.stack([np.asarray(column, dtype=float) for column in columns], axis=1)


def _narrow(
    system: Model, ways: Mapping[str, Callable[[FloatArray], FloatArray]], low: float, high: float
) -> list[tuple[float, tuple[Any, ...], tuple[Any, ...]]]:
    """Events between two places, each to rounding: (place, mark before, mark after)."""
    if high - low <= 4.0 * np.spacing(high):
        marks = _marks(system, ways, np.array([low, high]))
        return [(0.5 * (low + high), tuple(marks[0]), tuple(marks[1]))]
    s = np.linspace(low, high, _PARTS)
    marks = _marks(system, ways, s)
    found = []
    for i in np.flatnonzero(np.any(marks[1:] != marks[:-1], axis=1)):
        found.extend(_narrow(system, ways, float(s[i]), float(s[i + 1])))
    return found


def _merged(
    found: list[tuple[float, tuple[Any, ...], tuple[Any, ...]]],
) -> list[tuple[float, tuple[Any, ...], tuple[Any, ...]]]:
    """Events at one place as one: from the first mark to the last."""
    kept: list[tuple[float, tuple[Any, ...], tuple[Any, ...]]] = []
    for place, before, after in sorted(found, key=lambda one: one[0]):
        if kept and place - kept[-1][0] < 1e-12:
            kept[-1] = (kept[-1][0], kept[-1][1], after)
        else:
            kept.append((place, before, after))
    return [one for one in kept if one[1] != one[2]]


def _with_events(
    ds: xr.Dataset,
    ways: Mapping[str, Callable[[FloatArray], FloatArray]],
    s: FloatArray,
    found: list[tuple[float, tuple[Any, ...], tuple[Any, ...]]],
) -> xr.Dataset:
    place = np.array([one[0] for one in found])
    kinds, changes = [], []
    for _, before, after in found:
        kinds.append("fold" if before[2] != after[2] else "heteroclinic")
        eight = bool(before[1]), bool(after[1])
        changes.append(
            {(False, True): "birth", (True, False): "death", (True, True): "exchange"}.get(
                eight, "none"
            )
        )
    dim = ("event",)
    new = {
        "event_path": variable(dim, place, {"long_name": "place on the path"}),
        "event_kind": variable(dim, np.array(kinds, LABEL_DTYPE), {"long_name": "what happens"}),
        "event_change": variable(
            dim, np.array(changes, LABEL_DTYPE), {"long_name": "what becomes of the figure-eight"}
        ),
    }
    for name, way in ways.items():
        values = way(place) if place.size else np.empty(0)
        new[f"event_{name}"] = variable(dim, values, dict(ds[name].attrs))
    coordinate = variable(("path",), s, {"long_name": "place on the path", "units": "1"})
    return ds.assign_coords(path=coordinate).assign(new)
