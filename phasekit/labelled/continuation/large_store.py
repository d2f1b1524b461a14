"""What makes a branch of fields of states again, as arrays and words: in files and copies."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import fields
from typing import Any

import numpy as np

from phasekit.arrays import Array
from phasekit.bifurcation.continuation.kernels import trace
from phasekit.bifurcation.continuation.kernels.defining import EQUILIBRIUM
from phasekit.bifurcation.continuation.large.begin import corrected_at
from phasekit.bifurcation.continuation.large.curve import Corrected, LargeCurve, State, Track
from phasekit.bifurcation.continuation.large.extended import PointField, blocks_with
from phasekit.bifurcation.continuation.large.walk import LargeWalk
from phasekit.bifurcation.continuation.options import ContinuationOptions
from phasekit.bifurcation.continuation.walk import NO_START, Stop
from phasekit.labelled.continuation.branch import Branch, branch_of
from phasekit.labelled.continuation.branch_stored import Stored, damaged
from phasekit.systems.problem import Problem

#: How many vectors follow the states and the moved parameter, by what a branch is of.
VECTORS = {"equilibrium": 0, "fold": 1, "hopf": 2}
SIDES = ("backward", "forward")
CURVE = ("par", "scale", "low", "high")
STATE = ("u", "tangent", "before", "scale", "start", "start_tangent")
NUMBERS = tuple(f.name for f in fields(State) if f.name not in STATE)
TESTS = 3
#: What may be left of f beside its terms at points of a branch, more than of any that converged.
SMALL = 1e-4


def arrays_of(branch: Branch) -> dict[str, Array]:
    """What it takes to make the branch again, as arrays."""
    curve, start = branch.curve, branch.start
    arrays = {f"curve_{name}": getattr(curve, name) for name in CURVE}
    arrays |= {"start_u": start.u, "start_tangent": start.tangent}
    if isinstance(curve.field, PointField):
        arrays["point_weight"] = curve.field.weight
        if curve.field.held is not None:
            arrays["point_held"] = curve.field.held
    for side, track in zip(SIDES, branch.tracks, strict=True):
        if track is not None:
            state = track.state
            arrays |= {
                f"{side}_{name}": getattr(track, name)
                for name in ("u", "info", "tests", "residual")
            }
            arrays[f"{side}_state"] = np.stack([getattr(state, name) for name in STATE])
            arrays[f"{side}_numbers"] = np.array([float(getattr(state, n)) for n in NUMBERS])
    return arrays


def words_of(branch: Branch) -> dict[str, Any]:
    """And what is no array."""
    walker: Any = branch.walker
    words = {"symmetric": bool(walker.curve.symmetric), "singular": walker.singular}
    return {**words, "ends": list(walker.curve.ends)}


def read(
    stored: Stored, problem: Problem, events: Mapping[str, Any] | None
) -> tuple[LargeWalk, Any, tuple[Any, Any], Stop]:
    """What was followed, its start, its tracks and its origin."""
    with damaged(stored.name, "its points"):
        kind = stored.kind
        moves = kind != "equilibrium"
        names = list(problem.parameters)
        free = [names[i] for i in stored.active(problem, (1 + moves,))]
        n = len(problem.state)
        size = (1 + VECTORS[kind]) * n + 1 + (VECTORS[kind] if moves else 0)
        shapes: dict[str, tuple[int | None, ...]] = {f"curve_{name}": (size,) for name in CURVE}
        shapes["start_u"] = shapes["start_tangent"] = (size,)
        shapes["curve_par"] = (len(names) - moves,)
        if moves:
            shapes["point_weight"] = (n,)
        if kind == "hopf":
            shapes["point_held"] = (2, n)
        arrays = {
            name: stored.array(name, shape, finite=not name.endswith(("low", "high")))
            for name, shape in shapes.items()
        }
        for name in ("curve_scale", "point_weight"):
            if name in arrays and not (arrays[name] > 0.0).all():
                raise ValueError(f"raw_{name}: wants numbers > 0")

        def read_track(side: str, stop: Stop) -> Track:
            u = stored.array(f"{side}_u", (None, size))
            count = len(u)
            arrays[f"{side}_u"] = u
            for name, shape in (
                ("info", (count, trace.RECORDED)), ("tests", (count, TESTS)),
                ("residual", (count,)), ("state", (len(STATE), size)), ("numbers", (None,)),
            ):  # fmt: skip
                exact = name in ("state", "numbers")
                arrays[f"{side}_{name}"] = stored.array(f"{side}_{name}", shape, finite=exact)
            return track_of(arrays, side, stop)

        tracks = stored.tracks(read_track)
        stops = [None if track is None else track.stop for track in tracks]
        words = {"ends": stored.ends()} | {
            name: bool(stored.spec[name]) for name in ("symmetric", "singular")
        }
        walker, start, tracks = followed(
            problem, kind, free, arrays, words, stored.options(), stops
        )
    return walker, start, tracks, NO_START


def made_again(
    form: type[Branch], problem: Problem, kind: str, free: tuple[str, ...],
    arrays: Mapping[str, Array], words: Mapping[str, Any], options: ContinuationOptions,
    stops: Any, record: Any,
) -> Branch:  # fmt: skip
    """A branch of the arrays and words of another one: its copy."""
    walker, start, tracks = followed(problem, kind, free, arrays, words, options, stops)
    return branch_of(form, problem, walker, start, record, tracks)


def followed(
    problem: Problem, kind: str, free: Any, arrays: Mapping[str, Array], words: Mapping[str, Any],
    options: ContinuationOptions, stops: Any,
) -> tuple[LargeWalk, Any, tuple[Any, Any]]:  # fmt: skip
    """What was followed, its start, and its tracks."""
    field: Any = problem.field
    own = tuple((block.name, block.size) for block in problem.blocks)
    blocks = own
    if kind != "equilibrium":
        field = PointField(field, free[0], arrays["point_weight"], arrays.get("point_held"))
        blocks = blocks_with(own, free[0], VECTORS[kind])
    given: dict[str, Any] = {name: arrays[f"curve_{name}"] for name in CURVE}
    curve = LargeCurve(
        field=field, kind=EQUILIBRIUM, active=(field.parameters.index(free[-1]),),
        period=np.zeros(len(given["scale"])), options=options, ends=tuple(words["ends"]),
        blocks=blocks, symmetric=words["symmetric"], **given,
    )  # fmt: skip
    walker = LargeWalk(curve, singular=words["singular"], of=kind)
    start = corrected_at(curve, arrays["start_u"], arrays["start_tangent"])
    tracks = [
        None if stop is None else track_of(arrays, side, stop)
        for side, stop in zip(SIDES, stops, strict=True)
    ]
    return walker, start, (tracks[0], tracks[1])


def solve(curve: LargeCurve, start: Corrected, tracks: tuple[Any, Any]) -> bool:
    """Whether the start and the ends solve f = 0, to a small part of its terms."""
    ends = [
        corrected_at(curve, track.u[-1], track.state.tangent)
        for track in tracks if track is not None and len(track.u)
    ]  # fmt: skip
    return all(one.residual <= SMALL for one in (start, *ends))


def track_of(arrays: Mapping[str, Array], side: str, stop: Stop) -> Track:
    """The track of the arrays of one side."""
    given = arrays[f"{side}_numbers"].tolist()
    if len(given) not in (len(NUMBERS), len(NUMBERS) - 1):  # of before a direction could be held
        raise ValueError(f"raw_{side}_numbers: got {len(given)}, wants {len(NUMBERS)}")
    numbers: dict[str, Any] = dict(zip(NUMBERS, given, strict=False))
    numbers["done"] = int(numbers["done"])
    vectors = dict(zip(STATE, arrays[f"{side}_state"], strict=True))
    u, info, tests, residual = (arrays[f"{side}_{n}"] for n in ("u", "info", "tests", "residual"))
    return Track(u, info, tests, residual, State(**vectors, **numbers), stop)
