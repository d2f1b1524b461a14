"""The arrays of a stored branch of fields of states, and what was followed made of them."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from phasekit.bifurcation.continuation.kernels import trace
from phasekit.bifurcation.continuation.large.curve import Track
from phasekit.bifurcation.continuation.large.walk import LargeWalk
from phasekit.bifurcation.continuation.walk import NO_START, Stop
from phasekit.labelled.continuation.branch import Branch
from phasekit.labelled.continuation.branch_stored import Stored, damaged
from phasekit.labelled.continuation.large_branch import LargeBranch
from phasekit.labelled.continuation.large_parts import (
    CURVE,
    NUMBERS,
    STATE,
    TESTS,
    VECTORS,
    arrays_of,
    followed,
    solve,
    track_of,
    words_of,
)
from phasekit.systems.problem import Problem

__all__ = ["arrays_of", "read", "solve", "words_of"]


def read(
    stored: Stored, problem: Problem, events: Mapping[str, Any] | None
) -> tuple[type[Branch], LargeWalk, Any, tuple[Any, Any], Stop]:
    """The class of a stored branch, what was followed, its start, its tracks and its origin."""
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
                ("residual", (count,)), ("state", (len(STATE), size)), ("numbers", (len(NUMBERS),)),
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
    return LargeBranch, walker, start, tracks, NO_START
