"""Paths of motions in their window: states close together, until something ends them."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np

from phasekit.arrays import Array
from phasekit.errors import ConvergenceError
from phasekit.laws.equations import Equations
from phasekit.motion.crossings import Edges
from phasekit.motion.equation_rates import parameters_of, pointwise, rates_of
from phasekit.motion.lost import ARRIVED, CROWDED, EXHAUSTED, FAILED, LEFT, RESTING
from phasekit.motion.method import WEIGHT, limits_of, whole_turns
from phasekit.motion.steps import InitialValue, steps

#: States of a path, and steps.
ROOM, MOST = 30_000, 100_000


class Path(NamedTuple):
    """States along one motion, its start first."""

    time: Array
    state: Array
    """Of shape (points, states)."""
    status: int
    """How it ended."""


def paths(
    law: Equations,
    values: Mapping[str, float],
    states: Array,
    times: Array,
    *,
    widths: Array,
    close: float,
    longest: float = np.inf,
    edges: Edges | None = None,
    rtol: float,
    atol: float,
    room: int = ROOM,
) -> list[Path]:
    """Follow motions of one system and keep states close together.

    States are of shape (cells, states), times from and to (cells, 2), either way. Distances, of
    states at most `close`, are measured by widths; motions end at the edges, near a point of these
    unless they start there.
    """
    count, n = states.shape
    edges = Edges.none(n) if edges is None else edges
    how = *edges, np.array(widths, float), close, longest
    if law.kind == "python":
        return [
            _followed(law, values, states[k], times[k], *how, rtol=rtol, atol=atol)
            for k in range(count)
        ]
    from phasekit.motion.kernels.paths import paths as kernel
    from phasekit.numerics.launch import launch

    code, parameters = rates_of(law), parameters_of(law, values, count)
    when, where = np.full((count, room), np.nan), np.full((count, room, n), np.nan)
    number, status, taken = (np.zeros(count, np.int64) for _ in range(3))
    shared = np.zeros((0, 3)), limits_of(law, rtol, atol, max(MOST, room), alone=True), *how
    cells = np.array(times, float), np.array(states, float), parameters
    groups: Any = (when, where, number, status, taken)
    launch(kernel, (code.address, *shared, *cells), count, groups, None, WEIGHT)
    return [Path(when[k, : number[k]], where[k, : number[k]], int(status[k])) for k in range(count)]


def _followed(
    law: Equations, values: Mapping[str, float], state: Array, times: Array, box: Array,
    rests: Array, widths: Array, close: float, longest: float, *, rtol: float, atol: float,
) -> Path:  # fmt: skip
    """One motion of a Python function."""
    when, where, length = [float(times[0])], [np.array(state, float)], 0.0
    problem = InitialValue(
        pointwise(law, values), list(state), float(times[0]), rtol=rtol, atol=atol, unit=np.inf,
        most=MOST,
    )  # fmt: skip
    status, away = ARRIVED, False
    try:
        for step in steps(problem, float(times[1])):
            far = float(np.linalg.norm((step.after - step.before) / widths))
            parts = int(min(max(np.ceil(far / close), 1.0), 1000.0))
            at = step.start + np.arange(1, parts + 1) / parts * (step.stop - step.start)
            inner = step.dense(at).T
            inner[-1] = step.after
            for t, x in zip(at, inner, strict=True):
                length += float(np.linalg.norm((x - where[-1]) / widths))
                when.append(float(t))
                where.append(x)
                if length >= longest:
                    return Path(np.array(when), np.array(where), ARRIVED)
            if box.size and not np.all((step.after >= box[0]) & (step.after <= box[1])):
                status = LEFT
            away_from = np.abs(step.after - rests[:-1])
            at_rest = np.all(away_from <= rests[-1], axis=1)
            away = away or not at_rest.any()
            if away and at_rest.any():
                status = RESTING + int(np.argmax(at_rest))
            if len(when) > ROOM:
                status = CROWDED
            if status != ARRIVED:
                break
    except ConvergenceError:
        status = EXHAUSTED
    except ValueError:  # of rates that are not finite
        status = FAILED
    return Path(np.array(when), np.array(where), status)


def distances(states: Array, curve: Array, widths: Array, turns: Array) -> Array:
    """Distances of states, the rows, from a curve of states close together, in widths."""
    step = (curve[1:] - curve[:-1]) / widths
    size = np.maximum((step**2).sum(axis=1), 1e-300)
    found = np.empty(len(states))
    for k, state in enumerate(states):
        apart = curve[:-1] - state
        apart = (apart - whole_turns(apart, turns)) / widths
        part = np.clip(-(apart * step).sum(axis=1) / size, 0.0, 1.0)[:, None]
        found[k] = np.linalg.norm(apart + part * step, axis=1).min(initial=np.inf)
    return found
