"""Sections of a motion: its states at given times, and where a coordinate passes a value."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from phasekit.arrays import Array
from phasekit.errors import ConvergenceError
from phasekit.inputs import bad, reals
from phasekit.motion.events import instant
from phasekit.motion.steps import InitialValue, Pace, Step, states_at, steps


class Section(NamedTuple):
    """States of a motion in a section."""

    time: Array
    state: Array
    """Of shape (n, times)."""


def strobe(problem: InitialValue, times: npt.ArrayLike) -> Section:
    """States at given times; what lies between is not kept.

    Times are from the start on, all rising or all falling.
    """
    wants = "times from the start on, all finite, rising or falling"
    times = reals("times", times, wants)
    if times.ndim != 1 or not np.isfinite(times).all():
        raise bad("times", times, wants)
    ahead = np.diff(times, prepend=problem.start)
    if not ((ahead[1:] > 0.0).all() and (ahead[:1] >= 0.0).all()) and not (
        (ahead[1:] < 0.0).all() and (ahead[:1] <= 0.0).all()
    ):
        raise bad("times", times, wants)
    states = np.empty((len(problem.state), times.size))
    done = int(times.size > 0 and times[0] == problem.start)
    states[:, :done] = np.reshape(problem.state, (-1, 1))
    if done == times.size:
        return Section(times, states)
    for _ in states_at(problem, times[done:], states.T[done:]):
        pass
    return Section(times, states)


def passages(
    problem: InitialValue,
    stop: float,
    coordinate: int,
    level: float,
    *,
    period: float | None = None,
    direction: int = 0,
) -> Section:
    """Times and states at which one coordinate of the state passes a level; the start is none.

    Every step is cut where the coordinate turns, so that passages which lie closely together there
    are not lost. An angle passes the level whole periods off, too. The direction is 1 or -1 where
    it only counts if it rises or falls along the motion.
    """
    times: list[float] = []
    states: list[Array] = []
    pace = Pace(problem.most, stop)
    for step in steps(problem, stop):
        for (t0, x0), (t1, x1) in _between_turns(problem, step, coordinate):
            sense, first, last = _passed(x0, x1, level, period, direction)
            if pace.taken + last + 1 - first > problem.most:
                raise _too_many(problem, step.stop, pace)
            for k in range(first, last + 1):
                passed = level + sense * k * (period or 0.0)
                before = times[-1] if times else problem.start
                times.append(_passage(step, coordinate, passed, t0, t1))
                states.append(step.dense(times[-1]))
                if pace.is_too_slow(before, times[-1]):
                    raise _too_many(problem, times[-1], pace)
    return Section(np.array(times), np.reshape(states, (-1, len(problem.state))).T)


def _between_turns(
    problem: InitialValue, step: Step, coordinate: int
) -> list[tuple[tuple[float, float], tuple[float, float]]]:
    """Pieces of a step, with time and coordinate at their ends, in which it does not turn."""
    ends = [
        (t, float(x[coordinate])) for t, x in ((step.start, step.before), (step.stop, step.after))
    ]
    rates = step.rates_before[coordinate], step.rates_after[coordinate]
    if min(rates) < 0.0 < max(rates):
        turn = instant(
            lambda t: float(problem.rates(t, step.dense(t))[coordinate]), step.start, step.stop
        )
        ends.insert(1, (turn, float(step.dense(turn)[coordinate])))
    return list(zip(ends[:-1], ends[1:], strict=True))


def _too_many(problem: InitialValue, t: float, pace: Pace) -> ConvergenceError:
    return ConvergenceError(
        f"the motion came to t = {float(t)!r} s of {float(pace.stop)!r} s, and passes the section "
        f"more than {problem.most} times; try a shorter time"
    )


def _passage(step: Step, coordinate: int, level: float, start: float, stop: float) -> float:
    """Time at which the coordinate has a value in a piece of a step."""
    return instant(lambda t: float(step.dense(t)[coordinate] - level), start, stop)


def _passed(
    start: float, end: float, level: float, period: float | None, direction: int
) -> tuple[int, int, int]:
    """Sense of a piece, and the first and the last period whose level it passes.

    Counted in its sense; its end is part of it, its start is not.
    """
    sense = 1 if end >= start else -1
    if direction * sense < 0:
        return sense, 0, -1
    before, after = sense * (start - level), sense * (end - level)
    if period is None:
        return sense, 0, 0 if before < 0.0 <= after else -1
    return sense, int(np.floor(before / period)) + 1, int(np.floor(after / period))
