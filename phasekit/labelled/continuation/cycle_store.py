"""The arrays of a stored branch of periodic orbits, and the family made of them.

The orbits of a track have meshes of their own, so they stand one after another in flat arrays,
with the number of mesh intervals of each beside them.
"""

from __future__ import annotations

import functools
from collections.abc import Mapping, Sequence
from dataclasses import asdict
from typing import Any

import numpy as np

from phasekit.arrays import Array
from phasekit.bifurcation.continuation.curve import Stop
from phasekit.cycles.bounded import Bounded
from phasekit.cycles.bounded_folds import FOLD, BoundedFolds
from phasekit.cycles.connections import Ends, ends_of
from phasekit.cycles.crossings import BRANCHING, Crossings
from phasekit.cycles.cycle_walk import CycleWalk
from phasekit.cycles.cycles import Cycles, Orbit
from phasekit.cycles.extended import Extended
from phasekit.cycles.family import Tracks
from phasekit.cycles.point import Point, State
from phasekit.cycles.trace import Track
from phasekit.labelled.continuation.bounded_start import conditions_of
from phasekit.labelled.continuation.branch_stored import Stored, damaged
from phasekit.labelled.continuation.cycle_branch import CycleBranch
from phasekit.labelled.continuation.cycle_events import orbit_events_of
from phasekit.labelled.continuation.held_start import period_is
from phasekit.systems.cycle_families import clock_code
from phasekit.systems.problem import Problem
from phasekit.systems.user_events import written

#: Arrays of a family, by name.
_ARRAYS = ("par", "turns", "scale", "width", "low", "high", "period")
#: Numbers of a point, in their columns.
_NUMBERS = (
    "arclength", "step", "newton_steps", "residual", "sign", "trivial_error", "liouville_error",
    "mesh_error",
)  # fmt: skip
CONNECTION = "connection"
_FINITE = ("par", "turns", "scale", "period")


def arrays_of(branch: CycleBranch) -> dict[str, Array]:
    """What it takes to make the branch again, as arrays."""
    arrays: dict[str, Array] = {
        f"cycles_{name}": getattr(branch.walker.curve, name) for name in _ARRAYS
    }
    arrays.update(_packed("start", [branch.start]))
    for side, track in zip(("backward", "forward"), branch.tracks, strict=True):
        if track is not None:
            arrays.update(_packed(side, track.points))
            arrays.update(_packed_state(f"{side}_state", track.state))
    return arrays


def words_of(branch: CycleBranch) -> dict[str, Any]:
    """And what is no array."""
    origin = branch.origin
    curve = branch.walker.curve
    words = {"multiple": curve.multiple, "origin": [origin.reason, origin.message]}
    if curve.holds:
        words["held"] = written(curve.holds)
    if branch.kind == CONNECTION:
        words["connects"] = asdict(ends_of(curve))
    return words


def read(
    stored: Stored, problem: Problem, events: Mapping[str, Any] | None
) -> tuple[CycleWalk, Point, Tracks, Stop]:
    """What was followed, its start, its tracks and its origin."""
    asked = stored.events(problem, events, orbit_events_of)
    with damaged(stored.name, "its periodic orbits"):
        cycles = _cycles(stored, problem).replace(events=asked, ends=stored.ends())

        def track_of(side: str, stop: Stop) -> Track:
            points = _unpacked(stored, side, cycles)
            return Track(tuple(points), _unpacked_state(stored, f"{side}_state", cycles), stop)

        (start,) = _unpacked(stored, "start", cycles)
        tracks = stored.tracks(track_of)
        origin = Stop(*map(str, stored.spec["origin"]))
    return CycleWalk(cycles), start, tracks, origin


def _cycles(stored: Stored, problem: Problem) -> Cycles:
    held = stored.events(problem, {}, orbit_events_of, "held")
    most = len(problem.state) + 2 if stored.kind == CONNECTION else getattr(problem, "freed", 2)
    kind = stored.kind
    folds, crosses = problem.bounded and kind == FOLD, kind == BRANCHING
    active = stored.active(problem, range(1, most + len(held) + folds + crosses + 1))
    forced = problem.time is not None
    parts = {"torus": 3, "cycle": 1, "boundary": 1, CONNECTION: 1}.get(kind, 2)
    n, k = parts * len(problem.state), len(active)
    k += kind == "torus" or (kind == "fold_of_cycles" and not forced)
    k += (k - 2) * folds + ((k == 2) + (not forced)) * crosses
    shapes: dict[str, tuple[int, ...]] = {name: (n,) for name in ("turns", "scale", "period")}
    shapes.update({name: (k,) for name in ("width", "low", "high")})
    shapes["par"] = (len(problem.parameters) + forced,)
    arrays: dict[str, Any] = {
        name: stored.array(f"cycles_{name}", shapes[name], finite=name in _FINITE)
        for name in _ARRAYS
    }
    multiple = stored.spec["multiple"]
    if not isinstance(multiple, int) or multiple < 1:
        raise ValueError(f"multiple: got {multiple!r:.80}, wants a whole number >= 1")
    if not ((arrays["scale"] > 0.0).all() and (arrays["width"] > 0.0).all()):
        raise ValueError("raw_cycles_scale, raw_cycles_width: want numbers > 0")
    form: Any = Crossings if crosses else functools.partial(Extended, kind=kind)
    if problem.bounded:
        form = functools.partial(
            BoundedFolds if folds else Bounded, conditions=conditions_of(problem), holds=held
        )
    elif kind == "cycle":
        if k == 2 and not held:  # as earlier versions stored orbits that keep their period
            held = (period_is(problem, float(stored.array("start_y", (1, 1 + k))[0, 0])),)
        if k != 1 + len(held):
            raise ValueError(f"{k} parameters are free where {len(held)} quantities are held")
        form = functools.partial(Cycles, holds=held)
    if kind == CONNECTION:
        connects = dict(stored.spec["connects"])
        connects["distances"] = tuple(float(one) for one in connects["distances"])
        form = functools.partial(
            Bounded, conditions=(Ends(**connects),), kind=CONNECTION, duration=None
        )
    made: Cycles = form(
        problem.field, active=active, forced=forced,
        clock=clock_code(problem, active), multiple=multiple, options=stored.options(), **arrays,
    )  # fmt: skip
    return made


def _packed(name: str, points: Sequence[Point]) -> dict[str, Array]:
    """Points as flat arrays."""
    n = points[0].orbit.x.shape[1] if points else 0
    own = len(points[0].multipliers) if points else 0  # none of solutions that need not close
    q = len(points[0].dy) if points else 0
    table = [[float(getattr(p, one)) for one in _NUMBERS] for p in points]
    values = np.array([p.multipliers for p in points]).reshape(len(points), own)

    def flat(arrays: list[Array], *shape: int) -> Array:
        return np.concatenate(arrays) if arrays else np.empty((0, *shape))

    return {
        f"{name}_numbers": np.array(table).reshape(len(points), len(_NUMBERS)),
        f"{name}_intervals": np.array([float(p.orbit.intervals) for p in points]),
        f"{name}_mesh": flat([p.orbit.mesh for p in points]),
        f"{name}_x": flat([p.orbit.x for p in points], n),
        f"{name}_dx": flat([p.dx for p in points], n),
        f"{name}_y": np.array([p.orbit.y for p in points]).reshape(len(points), q),
        f"{name}_dy": np.array([p.dy for p in points]).reshape(len(points), q),
        f"{name}_real": values.real.copy(),
        f"{name}_imag": values.imag.copy(),
    }


def _packed_state(name: str, state: State) -> dict[str, Array]:
    made = {
        f"{name}_mesh": state.orbit.mesh,
        f"{name}_x": state.orbit.x,
        f"{name}_dx": state.dx,
        f"{name}_y": np.stack([state.orbit.y, state.dy]),
        f"{name}_numbers": np.array(
            [state.step, state.arclength, float(state.since), float(state.since_start)]
        ),
    }
    if state.behind is not None:
        last, dx, dy = state.behind
        if last.mesh is not state.orbit.mesh:
            made[f"{name}_behind_mesh"] = last.mesh
        made |= {
            f"{name}_behind_x": last.x,
            f"{name}_behind_dx": dx,
            f"{name}_behind_y": np.stack([last.y, dy]),
        }
    return made


def _unpacked(stored: Stored, name: str, cycles: Cycles) -> list[Point]:
    n, q, m = cycles.n, cycles.q, cycles.m
    counts = stored.array(f"{name}_intervals", (None,))
    intervals = counts.astype(int)
    total = len(counts)
    if (intervals < 1).any() or (intervals != counts).any():
        raise ValueError(f"raw_{name}_intervals: wants whole numbers >= 1")
    places = int(np.sum(intervals * m + 1))
    # Of no points there is nothing that has a shape.
    width, columns = (n, q) if total else (0, 0)
    table = stored.array(f"{name}_numbers", (total, len(_NUMBERS)), finite=False)
    mesh = stored.array(f"{name}_mesh", (int(np.sum(intervals + 1)),))
    x, dx = (stored.array(f"{name}_{one}", (places, width)) for one in ("x", "dx"))
    y, dy = (stored.array(f"{name}_{one}", (total, columns)) for one in ("y", "dy"))
    own = cycles.own if total and cycles.closes else 0
    real, imag = (
        stored.array(f"{name}_{one}", (total, own), finite=False) for one in ("real", "imag")
    )
    points, at, node = [], 0, 0
    for i, count in enumerate(intervals):
        here, nodes = slice(at, at + count * m + 1), slice(node, node + count + 1)
        at, node = here.stop, nodes.stop
        numbers: dict[str, Any] = dict(zip(_NUMBERS, table[i].tolist(), strict=True))
        numbers["newton_steps"] = int(numbers["newton_steps"])
        values = np.empty(own, dtype=complex)
        values.real, values.imag = real[i], imag[i]
        points.append(
            Point(
                Orbit(mesh[nodes], x[here], y[i].copy()), dx[here], dy[i].copy(), values, **numbers
            )
        )
    return points


def _unpacked_state(stored: Stored, name: str, cycles: Cycles) -> State:
    mesh = stored.array(f"{name}_mesh", (None,))

    def orbit_of(name: str, mesh: Array) -> tuple[Orbit, Array, Array]:
        places = (len(mesh) - 1) * cycles.m + 1
        x, dx = (stored.array(f"{name}_{one}", (places, cycles.n)) for one in ("x", "dx"))
        y = stored.array(f"{name}_y", (2, cycles.q))
        return Orbit(mesh, x, y[0].copy()), dx, y[1].copy()

    step, arclength, since, count = stored.array(f"{name}_numbers", (4,)).tolist()
    # Branches that were saved by earlier versions say nothing of the point behind.
    last = f"{name}_behind"
    own = stored.array(f"{last}_mesh", (None,)) if f"raw_{last}_mesh" in stored.ds else mesh
    behind = orbit_of(last, own) if f"raw_{last}_x" in stored.ds else None
    return State(*orbit_of(name, mesh), step, arclength, int(since), int(count), behind)
