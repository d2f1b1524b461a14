"""Motions from a state, integrated in time: states between the steps, and events on the way."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from phasekit.arrays import Array
from phasekit.errors import warn
from phasekit.motion.events import Event, Watch
from phasekit.motion.steps import InitialValue, steps

if TYPE_CHECKING:
    from scipy.integrate import DenseOutput, OdeSolution


class Occurrences(NamedTuple):
    """Events in the order in which a motion came to them."""

    name: list[str]
    time: Array
    state: Array
    """Of shape (n, events)."""


class Solution(NamedTuple):
    """One motion."""

    times: Array
    """Ends of the integrator's steps, the start first."""
    state: OdeSolution
    """State at a time, or of shape (n, times) at an array of times between the ends."""
    events: Occurrences


def integrate(
    problem: InitialValue, stop: float, events: Mapping[str, Event] | None = None
) -> Solution:
    """Integrate a motion from its start to another time, before or after it.

    Zeros of events at the start count.
    """
    from scipy.integrate import OdeSolution

    state = np.array(problem.state, dtype=float)
    watches = {
        name: Watch(event, event.function(problem.start, state))
        for name, event in (events or {}).items()
    }
    times = [problem.start]
    segments: list[DenseOutput] = []
    found: list[tuple[str, float]] = []
    for step in steps(problem, stop):
        seen = {name: watch.look(step) for name, watch in watches.items()}
        order = sorted(
            ((name, when) for name, times_ in seen.items() for when in times_),
            key=lambda pair: abs(pair[1] - step.start),
        )
        last = [
            place
            for place, (name, when) in enumerate(order)
            if watches[name].ends and when == watches[name].times[-1]
        ]
        found += order[: last[0] + 1] if last else order
        end = found[-1][1] if last else step.stop
        if end != times[-1] or not segments:
            times.append(end)
            segments.append(step.dense)
        if last:
            break
    for name, watch in watches.items():
        if watch.rest is not None:
            warn(
                f"events: {name!r} vanishes on a stretch of time, from t = {watch.rest:.6g} on or "
                "a little before, which counts once; wants a function whose zeros are single",
                RuntimeWarning,
            )
    motion = OdeSolution(times, segments)
    when = np.array([t for _, t in found])
    states = motion(when) if found else np.empty((state.size, 0))
    return Solution(np.array(times), motion, Occurrences([n for n, _ in found], when, states))
