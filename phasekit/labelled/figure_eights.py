"""The figure-eight along a path of parameters: its loops, and where it comes and goes."""

from __future__ import annotations

import functools
import itertools
from collections.abc import Callable, Mapping, Sequence
from typing import Any, NamedTuple, TypeAlias

import numpy as np
import xarray as xr

from phasekit.errors import Loop, ParameterError
from phasekit.inputs import call_checked
from phasekit.labelled.phase_space import equilibria, separatrices
from phasekit.labels.arguments import FloatArray, bad, pair, unknown, whole
from phasekit.labels.grid import LABEL_DTYPE, refuse_too_large, variable
from phasekit.phase.numerical.formula import Formula
from phasekit.phase.numerical.functions import number_of_equilibria as number
from phasekit.phase.numerical.functions import topology
from phasekit.systems.system import System, as_system

#: Places at which an event is looked for at once: where those next to it take long, few.
_PARTS, _FEW = 33, 9
#: Of a potential: width of the path on which a fold is the only event, and that of rounding, in
#: which marks come and go.
_ONE, _ROUNDING = 1e-8, 1e-14


@call_checked
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
        Number of places. Two events between neighboring places that cancel are not seen. Of a
        `Potential`, what happens within 1e-8 of the path beside a fold counts as this fold.

    Returns
    -------
    xarray.Dataset
        On ``path`` (0 to 1): the parameters, and all that `separatrices` says (topology,
        figure_eight, lobe_area, ...). On ``event``: ``event_path``, the parameters there as
        ``event_<name>``, ``event_kind`` (fold: two equilibria merge; heteroclinic: two saddles
        have equal energy, and the eight passes from one to the other) and ``event_change``
        (birth, death, exchange, or none of the eight).

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
    ds = separatrices(_system_on(system, ways, s))
    marks = _marks(system, ways, s)
    invalid = [i for i, mark in enumerate(marks) if mark.number < 0]
    if invalid:
        place = s[invalid[:1]]
        got = ", ".join(f"{name} = {way(place)[0]:.6g}" for name, way in ways.items())
        raise ParameterError(f"path: got {got}, wants values that {type(system).__name__} can have")
    found: list[Event] = []
    for i in _events(marks):
        found.extend(_narrow(system, ways, float(s[i]), float(s[i + 1])))
    return _with_events(ds, ways, s, _merged(found))


def _ways(system: System, path: Any) -> dict[str, Callable[[FloatArray], FloatArray]]:
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


def _system_on(
    system: System, ways: Mapping[str, Callable[[FloatArray], FloatArray]], s: FloatArray
) -> System:
    changes = {name: xr.DataArray(way(s), dims="path") for name, way in ways.items()}
    for name, values in changes.items():
        if not np.isfinite(values.values).all():
            raise ParameterError(f"path[{name!r}]: got values that are not finite")
    return system.replace(**changes)


class Mark(NamedTuple):
    """What changes at an event: topology, number of equilibria, loops of the saddles."""

    topology: int
    eight: bool
    number: int
    loops: tuple[int, ...]
    places: tuple[float, ...] = ()
    period: float | None = None

    def differs(self, other: Mark) -> bool:
        """Whether something has happened between two neighboring places of the path."""
        if self[:3] != other[:3] or len(self.loops) != len(other.loops):
            return True
        if self.period is None or not self.loops:
            return self.loops != other.loops
        # On a circle a saddle that passes the cut goes from one end of the row to the other.
        ways = np.subtract.outer(self.places, other.places) / self.period
        apart = np.abs(ways - np.round(ways))
        n = len(self.loops)
        rows = np.arange(n)
        shift = int(np.argmin([apart[rows, (rows + k) % n].sum() for k in range(n)]))
        return self.loops != tuple(other.loops[(i + shift) % n] for i in range(n))


def _marks(
    system: System, ways: Mapping[str, Callable[[FloatArray], FloatArray]], s: FloatArray
) -> list[Mark]:
    at = _system_on(system, ways, s)
    if isinstance(at.law, Formula):  # areas, which take longest, change nothing
        points, found = topology(at.law, *_values(at, s))
        columns: Any = found.topology, found.figure_eight, points.n_equilibria
        loops, places = found.loop, found.saddle_phi
    else:
        ds = separatrices(at)
        columns = ds.topology.values, ds.figure_eight.values, equilibria(at).n_equilibria.values
        if system.standing.rung.labels_fixed:
            A, B, C = (np.broadcast_to(np.asarray(x), s.shape) for x in at.coefficients())
            side = np.where(A > 0.0, np.sign(B), 2.0 * np.sign(C))
            eights = np.where(ds.figure_eight.values, side, 0.0)
            return [Mark(a, b, c, (d,)) for a, b, c, d in zip(*columns, eights, strict=True)]
        loops = ds.loop.transpose("path", "saddle").values
        places = ds.saddle_phi.transpose("path", "saddle").values
    period = getattr(system, "period", None)
    there = loops != Loop.ABSENT
    return [
        Mark(a, b, c, tuple(loop[own]), tuple(place[own]), period)
        for a, b, c, loop, place, own in zip(*columns, loops, places, there, strict=True)
    ]


#: Where something happens, and what is found before and after.
Event: TypeAlias = tuple[float, Mark, Mark]


def _events(marks: Sequence[Mark]) -> list[int]:
    """The places after which something happens."""
    return [i for i, pair in enumerate(itertools.pairwise(marks)) if pair[0].differs(pair[1])]


def _narrow(
    system: System, ways: Mapping[str, Callable[[FloatArray], FloatArray]], low: float, high: float
) -> list[Event]:
    """Events between two places, each to rounding: (place, mark before, mark after)."""
    least = 4.0 * np.spacing(high) if system.standing.rung.labels_fixed else _ROUNDING
    if high - low <= least:
        marks = _marks(system, ways, np.array([low, high]))
        return [(0.5 * (low + high), marks[0], marks[1])]
    s = np.linspace(low, high, _PARTS if system.standing.rung.labels_fixed else _FEW)
    marks = _marks(system, ways, s)
    found: list[Event] = []
    if (
        high - low < _ONE
        and marks[0].number != marks[-1].number
        and isinstance(system.law, Formula)
    ):
        place = _count_changes(system, ways, low, high)
        return [(place, marks[0], marks[-1])]
    for i in _events(marks):
        found.extend(_narrow(system, ways, float(s[i]), float(s[i + 1])))
    return found


def _count_changes(
    system: System, ways: Mapping[str, Callable[[FloatArray], FloatArray]], low: float, high: float
) -> float:
    """Where the number of equilibria changes between two places, to rounding."""
    while high - low > _ROUNDING:
        s = np.linspace(low, high, _FEW)
        at = _system_on(system, ways, s)
        law: Any = at.law
        count = number(law, *_values(at, s))
        i = int(np.flatnonzero(count[1:] != count[0])[0])
        low, high = float(s[i]), float(s[i + 1])
    return 0.5 * (low + high)


def _values(system: System, s: FloatArray) -> list[FloatArray]:
    """Values of the parameters of a formula, one a place."""
    given = system.parameters
    own = [system.in_domain(name, np.asarray(given[name])) for name in system.formula_inputs()]
    return list(np.broadcast_arrays(s, *own)[1:])


def _merged(
    found: list[Event],
) -> list[Event]:
    """Events at one place as one: from the first mark to the last."""
    kept: list[Event] = []
    for place, before, after in sorted(found, key=lambda one: one[0]):
        if kept and place - kept[-1][0] < 1e-12:
            kept[-1] = (kept[-1][0], kept[-1][1], after)
        else:
            kept.append((place, before, after))
    return [one for one in kept if one[1].differs(one[2])]


def _with_events(
    ds: xr.Dataset,
    ways: Mapping[str, Callable[[FloatArray], FloatArray]],
    s: FloatArray,
    found: list[Event],
) -> xr.Dataset:
    place = np.array([one[0] for one in found])
    kinds, changes = [], []
    for _, before, after in found:
        kinds.append("fold" if before.number != after.number else "heteroclinic")
        eight = bool(before.eight), bool(after.eight)
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
