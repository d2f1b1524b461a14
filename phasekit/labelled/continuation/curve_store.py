"""The arrays of a stored curve of equilibria or of special points, and the curve made of them."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np

from phasekit.arrays import Array
from phasekit.bifurcation.continuation.curve import Curve, Stop, Track
from phasekit.bifurcation.continuation.curve_walk import KINDS, CurveWalk
from phasekit.bifurcation.continuation.kernels import trace
from phasekit.bifurcation.continuation.kernels.defining import (
    BRANCH,
    EQUILIBRIUM,
    EVENT,
    HOPF,
    NUMBERS,
    TORUS,
    VECTORS,
)
from phasekit.bifurcation.continuation.path import Sample
from phasekit.bifurcation.continuation.walk import NO_START
from phasekit.labelled.continuation.branch import Branch
from phasekit.labelled.continuation.branch_stored import Stored, damaged
from phasekit.systems.problem import Problem
from phasekit.systems.user_events import events_of, written

#: Arrays of a curve, by name.
ARRAYS = ("par", "scale", "period", "low", "high")


def arrays_of(branch: Branch) -> dict[str, Array]:
    """What it takes to make the branch again, as arrays."""
    curve, start = branch.curve, branch.start
    arrays = {f"curve_{name}": getattr(curve, name) for name in ARRAYS}
    arrays["curve_aux"] = np.zeros(0) if curve.aux is None else curve.aux
    arrays |= {
        "start_u": start.u, "start_tangent": start.tangent, "start_slopes": start.slopes
    }  # fmt: skip
    for side, track in zip(("backward", "forward"), branch.tracks, strict=True):
        if track is not None:
            arrays |= {side: track.record, f"{side}_state": track.state}
            if track.slopes.shape[1]:
                arrays[f"{side}_slopes"] = track.slopes
    return arrays


def words_of(branch: Branch) -> dict[str, Any]:
    """And what is no array."""
    curve = branch.curve
    words: dict[str, Any] = {}
    if curve.events:
        words["conditions"] = [event.name for event in curve.events if event.condition]
    if curve.held is not None:
        words["held"] = written([curve.held])
    return words


def read(
    stored: Stored, problem: Problem, events: Mapping[str, Any] | None
) -> tuple[CurveWalk, Sample, tuple[Track | None, Track | None], Stop]:
    """What was followed, its start, its tracks and its origin."""
    curve = _curve(stored, problem)
    asked = stored.events(problem, events, events_of)
    with damaged(stored.name, "its events"):
        conditions = list(stored.spec.get("conditions", ()))
        curve = curve.replace(
            events=tuple(replace(event, condition=event.name in conditions) for event in asked),
            ends=stored.ends(), conservative=problem.conservative, discrete=problem.map,
        )  # fmt: skip
    if stored.kind == KINDS[EVENT]:
        found = stored.events(problem, events, events_of, "held")
        with damaged(stored.name, "its event"):
            (held,) = found
        curve = curve.replace(held=held)
    size, n, m = curve.size, curve.n, curve.m
    with damaged(stored.name, "its points"):
        u, tangent = stored.array("start_u", (size,)), stored.array("start_tangent", (size,))
        start = Sample(u, tangent, stored.array("start_slopes", (n, m), finite=False))
        tracks = stored.tracks(lambda name, stop: _track(stored, name, stop, curve))
    return CurveWalk(curve), start, tracks, NO_START


def _curve(stored: Stored, problem: Problem) -> Curve:
    with damaged(stored.name, "its curve"):
        kind = {name: number for number, name in KINDS.items()}[stored.kind]
        counts = {EQUILIBRIUM: (1,), BRANCH: (2, 3)}
        active = stored.active(problem, counts.get(kind, (2,)))
        empty = np.zeros(0)
        curve = Curve(
            problem.field, kind, empty, active, empty, empty, empty, empty, stored.options()
        )
        shapes = {name: (curve.size,) for name in ARRAYS} | {"par": (len(problem.parameters),)}
        arrays = {
            name: stored.array(f"curve_{name}", shape, finite=name not in ("low", "high"))
            for name, shape in shapes.items()
        }
        if not (arrays["scale"] > 0.0).all() or not (arrays["period"] >= 0.0).all():
            raise ValueError("raw_curve_scale, raw_curve_period: want numbers > 0, and >= 0")
        aux = stored.array("curve_aux", (curve.n if kind in (HOPF, TORUS) else 0,))
        return curve.replace(**arrays, aux=aux if aux.size else None)


def _track(stored: Stored, name: str, stop: Stop, curve: Curve) -> Track:
    size = curve.size
    record, slopes = _points(stored, name, curve)
    # Where f ends, derivatives and the state that is left need not be finite.
    state = stored.array(f"{name}_state", (VECTORS * size + curve.n + NUMBERS,), finite=False)
    if not np.isfinite(record[:, : 2 * size]).all():
        raise ValueError(f"raw_{name}: got points that are not finite")
    return Track(record, slopes, state, stop)


def _points(stored: Stored, name: str, curve: Curve) -> tuple[Array, Array]:
    """Points and, of few states, the derivatives of f at each."""
    columns, matrix = 2 * curve.size + trace.RECORDED, curve.n * curve.m
    if stored.ds.variables[f"raw_{name}"].shape[-1:] != (columns,):
        # Earlier versions kept the derivatives between tangents and step data.
        record = stored.array(name, (None, columns + matrix), finite=False)
        here = slice(2 * curve.size, 2 * curve.size + matrix)
        slopes = record[:, here] if curve.keeps else record[:, :0]
        return np.delete(record, here, axis=1), slopes
    record = stored.array(name, (None, columns), finite=False)
    if not curve.keeps:
        return record, record[:, :0]
    return record, stored.array(f"{name}_slopes", (len(record), matrix), finite=False)
