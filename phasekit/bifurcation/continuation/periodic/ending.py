"""Families followed from their start, up to the first special point or event they are to end at."""

from __future__ import annotations

from collections import Counter
from dataclasses import replace

import numpy as np

from phasekit.bifurcation.continuation.curve import Stop
from phasekit.bifurcation.continuation.periodic.cycles import Cycles
from phasekit.bifurcation.continuation.periodic.events import find
from phasekit.bifurcation.continuation.periodic.family import Found, Path, Tracks
from phasekit.bifurcation.continuation.periodic.point import Point, State
from phasekit.bifurcation.continuation.periodic.trace import Track, begin, follow
from phasekit.bifurcation.continuation.stops import NOT_BEGUN, SEARCHED, UNFINISHED
from phasekit.bifurcation.special_points import KINDS

FIRST = 8  # points after which a family is looked at first; then after twice as many each time
START = 1e-6  # arclength within which a point is the start itself


def run(cycles: Cycles, start: Point, directions: str) -> Tracks:
    """Follow a family from its start, backward and forward; None where it was not asked for."""
    most = cycles.options.max_points
    backward = forward = None
    if directions != "backward":
        forward = _followed(cycles, begin(cycles, start, True), most, start, start)
    closed = forward is not None and forward.stop.reason == "closed"
    if directions != "forward" and not closed:
        state = begin(cycles, start, False)
        if forward is not None and forward.stop.reason == "interrupted":
            return Track((), state, NOT_BEGUN), forward
        backward = _followed(cycles, state, most, start, start.flipped())
    return backward, forward


def goes_on(cycles: Cycles, track: Track) -> bool:
    """Whether a track can be longer: it was cut, or a bound is no longer where it met it."""
    reason = track.stop.reason
    if reason != "bound":
        return reason in UNFINISHED or reason in cycles.ends
    y = track.state.orbit.y
    p = y[1 : 1 + len(cycles.low)]
    low, high = cycles.options.bounds.get("period", (-np.inf, np.inf))
    return bool(np.all((p > cycles.low) & (p < cycles.high)) and low < y[0] < high)


def go_on(
    cycles: Cycles, track: Track | None, points: int, start: Point, forward: bool
) -> Track | None:
    """More points of a track that can be longer, exactly as if it had never stopped."""
    if track is None or not goes_on(cycles, track):
        return track
    if track.stop.reason in cycles.ends and track.points:
        # The state behind the last point, which is followed again.
        known = len(track.points)
        track = replace(
            track, state=follow(cycles, begin(cycles, start, forward), known, start).state
        )
    last = track.points[-1] if track.points else start
    more = _followed(cycles, track.state, points, start, last)
    return Track((*track.points, *more.points), more.state, more.stop)


def _followed(cycles: Cycles, state: State, points: int, start: Point, last: Point) -> Track:
    """Follow a family from a state for so many points, or to where it is to end."""
    if not cycles.ends:
        return follow(cycles, state, points, start)
    found: tuple[Point, ...] = ()
    passed: Counter[str] = Counter()
    chunk = FIRST
    while True:
        track = follow(cycles, state, min(chunk, points), start)
        try:
            ended = _ended(cycles, last, track, passed)
        except KeyboardInterrupt:
            return Track(found, state, SEARCHED)
        track = track if ended is None else ended
        found = (*found, *track.points)
        points -= len(track.points)
        if ended is not None or track.stop.reason != "max_points" or points <= 0:
            return Track(found, track.state, track.stop)
        state, last, chunk = track.state, found[-1], 2 * chunk


def _ended(cycles: Cycles, last: Point, track: Track, passed: Counter[str]) -> Track | None:
    """A track up to the point behind that at which it ends; None if it goes on."""
    path = Path((last, *track.points), 0, (track.stop, track.stop))
    for one in in_order(find(cycles, path)[0]):
        name = _ending_of(cycles, one)
        if name is None:
            continue
        passed[name] += 1
        if passed[name] >= cycles.ends.count(name):
            stop = Stop(name, f"stop = {name!r}: {_said(cycles, one)}")
            return Track(track.points[: one.index + 1], track.state, stop)
    return None


def in_order(found: list[Found]) -> list[Found]:
    """Special points as they come along the family."""
    return sorted(found, key=lambda one: (one.index, one.point.arclength))


def cut(cycles: Cycles, path: Path, found: list[Found]) -> tuple[Path, list[Found]]:
    """A path that ends on the special points at which it is to end, and what is left on it."""
    first, last, start = 0, len(path.points), path.start
    ends: list[Found | None] = [None, None]
    for side, stop in enumerate(path.stops):
        there = [
            one
            for one in found
            if (one.index >= start) == bool(side)
            and stop.reason in _names_of(one)
            and _ending_of(cycles, one) is not None
        ]
        if stop.reason not in cycles.ends or not there:
            continue
        # Where it ended before, it went on; it ends at the first of those that its wish is for.
        edge = len(path.points) - 2 if side else 0
        own = [one for one in there if (one.index >= edge if side else one.index <= edge)]
        one = (own or there)[side - 1]
        k = found.index(one)
        ends[side] = one
        if side:
            last, found = one.index + 1, found[: k + 1]
        else:
            first, found = one.index + 1, found[k:]
    moved = [replace(one, index=one.index - first) for one in found]
    kept = tuple(None if one is None else moved[found.index(one)] for one in ends)
    return replace(
        path, points=path.points[first:last], start=start - first, ends=(kept[0], kept[1])
    ), moved


def _names_of(one: Found) -> set[str]:
    """What a special point goes by."""
    return {one.kind, KINDS[one.kind].label, one.name} - {""}


def _ending_of(cycles: Cycles, one: Found) -> str | None:
    """The name by which a special point ends the family, if it does; the start does not."""
    if abs(one.point.arclength) <= START:
        return None
    return next((name for name in cycles.ends if name in _names_of(one)), None)


def _said(cycles: Cycles, one: Found) -> str:
    names = ["period", *(cycles.field.parameters[i] for i in cycles.active)]
    where = ", ".join(
        f"{name} = {v:.9g}" for name, v in zip(names, one.point.orbit.y.tolist(), strict=False)
    )
    what = f"the event {one.name!r}" if one.name else one.kind.replace("_", " ")
    return f"{what} at {where}"
