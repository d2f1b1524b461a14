"""Continuation itself, whatever is followed: both ways from a start, on from an end, to a stop.

A walker follows one kind of solution: equilibria and the points of curves (`curve_walk`), periodic
orbits (`cycles.cycle_walk`). It says how a step is made, what is passed and where it ends; how
far to go, where to stop and how to go on is said here, once.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field, replace
from typing import Any, ClassVar, NamedTuple, Protocol, TypeVar

import numpy as np

from phasekit.arrays import Array
from phasekit.bifurcation.continuation.conserved import not_isolated
from phasekit.bifurcation.continuation.kernels import newton, trace
from phasekit.bifurcation.continuation.kernels.step import CROSSES, TURNS
from phasekit.bifurcation.continuation.options import ContinuationOptions
from phasekit.bifurcation.special_points import KINDS
from phasekit.numerics import differences
from phasekit.numerics.interrupts import hold, may_end
from phasekit.numerics.memory import HALTS, why_halted


@dataclass(frozen=True)
class Stop:
    """Why a curve ends, such as bound, closed, stuck or not_finite; and what says so in words."""

    reason: str
    message: str


@dataclass(frozen=True)
class Unsearched(Stop):
    """The end of a track on which special points are still to be looked for, and why it ended."""

    was: Stop = field(compare=False, repr=False)


class Rows:
    """What has a row for each of its points, in fields that are cut and joined alike."""

    #: Arrays or tuples, along the points.
    rows: ClassVar[tuple[str, ...]]

    @property
    def count(self) -> int:
        """Number of points."""
        return len(getattr(self, self.rows[0]))

    def cut(self: Any, points: slice, **changes: Any) -> Any:
        """Some of its points, with other changes."""
        return replace(self, **{name: getattr(self, name)[points] for name in self.rows}, **changes)


class Track(Rows):
    """Points in one direction from a start, and the state to go on from."""

    state: Any  # what it takes to go on as if it had never stopped
    stop: Stop

    def first(self, count: int, stop: Stop) -> Any:
        """Its first points, for what it ends there."""
        return self.cut(slice(count), stop=stop)

    def joined(self, more: Any) -> Any:
        """It and what follows."""
        both = {name: (getattr(self, name), getattr(more, name)) for name in self.rows}
        return replace(more, **{
            name: one + other if isinstance(one, tuple) else np.concatenate([one, other])
            for name, (one, other) in both.items()
        })  # fmt: skip

    def with_state(self: Any, state: Any) -> Any:
        """The same with another state to go on from."""
        return replace(self, state=state)


class Path(Rows):
    """Points in order, from the backward to the forward end."""

    start: int  # which of them is the start
    stops: tuple[Stop, Stop]
    ends: tuple[Any, Any]  # the special points at which it was told to end

    @property
    def closed(self) -> bool:
        """Whether it ends on its start."""
        return self.stops[1].reason == "closed"

    def part(self, first: int, last: int, ends: tuple[Any, Any]) -> Any:
        """Points of it, between the special points at which it ends."""
        return self.cut(slice(first, last), start=self.start - first, ends=ends)


#: Where a branch begins that was followed to one side.
NO_START = Stop("start", "the start; this direction was not requested")


def stops_of(tracks: Tracks, origin: Stop = NO_START) -> tuple[Stop, Stop]:
    """Why a path of two tracks ends; without a first one, the origin says why it begins there."""
    backward, forward = tracks
    last = NO_START if forward is None else forward.stop
    if last.reason == "closed":
        return last, last
    return origin if backward is None else backward.stop, last


class Seen(Protocol):
    """A special point on a path."""

    @property
    def index(self) -> int:
        """The point of the path before it."""

    @property
    def along(self) -> float:
        """How far it is beyond that point, of those in order behind the same one."""

    @property
    def kind(self) -> str:
        """Of the registry of special points."""

    @property
    def name(self) -> str:
        """Of an event, else empty."""

    @property
    def position(self) -> Any:
        """Where it stands, as a walker compares places."""


def in_order(seen: Iterable[Any]) -> list[Any]:
    """Special points as they come along the path."""
    return sorted(seen, key=lambda one: (one.index, one.along))


class Walker:
    """What can be followed: all that the walk asks of one kind of solution."""

    curve: Any  # the equations of what is followed, over its free parameters; their options, ends
    #: Points after which ends are looked for first; then after twice as many each time.
    chunk: ClassVar[int]
    #: Whether what is found between two points goes with those before them, too.
    looks_back: ClassVar[bool]
    in_order = staticmethod(in_order)

    def over(self: Any, **changes: Any) -> Any:
        """The same with changes of the equations, such as wider bounds."""
        return replace(self, curve=self.curve.replace(**changes))

    @property
    def kind(self) -> str:
        """What it is a curve of."""
        raise NotImplementedError

    @property
    def bounded(self) -> tuple[str, ...]:
        """Names of what its bounds are bounds of."""
        raise NotImplementedError

    @property
    def options(self) -> ContinuationOptions:
        """How far and how finely."""
        options: ContinuationOptions = self.curve.options
        return options

    def hindered(self, start: Any) -> Stop | None:
        """Why there is nothing to follow at all; None where that is seen on the way."""
        return None

    def turned(self, start: Any) -> Any:
        """The start in the other direction."""
        raise NotImplementedError

    def begin(self, start: Any) -> Any:
        """The state of a walk that begins at a point, in the direction of its tangent."""
        raise NotImplementedError

    def follow(self, state: Any, points: int, start: Any) -> Any:
        """At most so many points from a state: a track."""
        raise NotImplementedError

    def passed(self, start: Any, track: Any, since: int) -> Sequence[Seen]:
        """Special points of a track from one of its points on, in order."""
        raise NotImplementedError

    def is_at(self, seen: Any, place: Any) -> bool:
        """Whether a special point stands at the start, or where another one does."""
        raise NotImplementedError

    def within(self, state: Any) -> bool:
        """Whether a state stands inside its bounds."""
        raise NotImplementedError

    def words(self, seen: Any) -> str:
        """Where a special point is."""
        raise NotImplementedError

    def joined(self, start: Any, tracks: Tracks, origin: Stop) -> Any:
        """One path of two tracks; without a first one, the origin says why it begins there."""
        raise NotImplementedError

    def search(self, path: Any) -> tuple[Any, list[Any], tuple[str, ...]]:
        """The path, its special points in order, and what is to be said of it."""
        raise NotImplementedError

    def unsearched(self, path: Any) -> tuple[Any, list[Any], tuple[str, ...]]:
        """The same of a path on which there was no time to look for any."""
        return path, [], NOT_SEARCHED

    def notes(self, path: Any) -> tuple[str, ...]:
        """What else holds all along a path that ends where it is to end."""
        return ()

    def at_ends(self, path: Any) -> list[Any]:
        """The two ends of a path as special points."""
        raise NotImplementedError


#: What is said of a branch where the search was interrupted.
NOT_SEARCHED = ("special points were not looked for: extend() does it",)


Tracks = tuple[Any, Any]
P = TypeVar("P", bound=Path)


class Found(NamedTuple):
    """A path with its special points in order, ends among them, and what is to be said of it."""

    path: Any
    specials: list[Any]
    messages: tuple[str, ...]


def search(
    walker: Walker, start: Any, tracks: Tracks, origin: Stop, *, interrupted: bool = False
) -> Found:
    """The path of two tracks from a start, and the special points on it."""
    path = walker.joined(start, tracks, origin)
    path, seen, messages = walker.unsearched(path) if interrupted else walker.search(path)
    path, seen = cut(walker, start, path, seen)
    if not path.closed:
        seen = in_order([*seen, *walker.at_ends(path)])
    return Found(path, seen, (*messages, *walker.notes(path)))


def halted(tracks: Tracks, halt: BaseException) -> Tracks:
    """Tracks whose special points were not looked for, since that was interrupted."""
    stop = searched(halt)

    def unsearched(track: Any) -> Any:
        was = track.stop.was if isinstance(track.stop, Unsearched) else track.stop
        return replace(track, stop=Unsearched(stop.reason, stop.message, was))

    backward, forward = (None if track is None else unsearched(track) for track in tracks)
    return backward, forward


def run(walker: Walker, start: Any, directions: str) -> Tracks:
    """Follow from a start, backward and forward; None where it was not asked for."""
    points = walker.options.max_points
    why = walker.hindered(start)
    hold()
    if why is not None:
        still = walker.follow(walker.begin(start), 0, start).first(0, why)
        return None if directions == "forward" else still, (
            None if directions == "backward" else still
        )
    backward = forward = None
    if directions != "backward":
        forward = _followed(walker, start, walker.begin(start), points)
    closed = forward is not None and forward.stop.reason == "closed"
    if directions != "forward" and not closed:
        start = walker.turned(start)
        state = walker.begin(start)
        if forward is not None and forward.stop.reason == "interrupted":
            return _not_begun(walker, start, state), forward
        backward = _followed(walker, start, state, points)
    return backward, forward


def goes_on(walker: Walker, track: Track | None) -> bool:
    """Whether a track can be longer: it was cut, or a bound is no longer where it met it."""
    if track is None:
        return False
    if isinstance(track.stop, Unsearched):
        return True
    if track.stop.reason == "bound":
        return walker.within(track.state)
    return track.stop.reason in UNFINISHED or wished(track.stop, walker.curve.ends)


def go_on(walker: Walker, start: Any, tracks: Tracks, points: int) -> Tracks:
    """More points of tracks that can be longer, exactly as if they had never stopped."""
    hold()
    backward, forward = (
        _longer(walker, begin, track, points) if goes_on(walker, track) else track
        for begin, track in zip((walker.turned(start), start), tracks, strict=True)
    )
    if forward is not None and forward.stop.reason == "closed":
        backward = None
    return backward, forward


def _longer(walker: Walker, start: Any, track: Any, points: int) -> Any:
    if isinstance(track.stop, Unsearched):  # it may have come to its end
        track = replace(track, stop=track.stop.was)
        if wished(track.stop, walker.curve.ends) or not goes_on(walker, track):
            return track
    if wished(track.stop, walker.curve.ends) and track.count:
        # The state behind the last point, which is followed again.
        track = track.with_state(walker.follow(walker.begin(start), track.count, start).state)
    return _followed(walker, start, track.state, points, track)


def _not_begun(walker: Walker, start: Any, state: Any) -> Any:
    """A track without points, to go on from."""
    return walker.follow(state, 0, start).first(0, NOT_BEGUN)


def _followed(walker: Walker, start: Any, state: Any, points: int, track: Any = None) -> Any:
    """Follow from a state for so many points, or to where it is to end."""
    known = since = 0 if track is None else track.count
    passed: Counter[str] = Counter()
    chunk = walker.chunk if walker.curve.ends else points
    while True:
        more = walker.follow(state, min(chunk, points), start)
        whole = more if track is None else track.joined(more)
        try:
            with may_end():
                end = _end_of(walker, start, whole, since, passed) if walker.curve.ends else None
        except HALTS as halt:
            track = _not_begun(walker, start, state) if track is None else track
            return track.first(track.count, searched(halt))
        if end is not None:
            return whole.first(*end)
        track, state = whole, whole.state
        points -= more.count
        if more.stop.reason != "max_points" or points <= 0:
            return track
        chunk *= 2
        if walker.looks_back:
            since, passed = known, Counter()
        else:
            since = track.count


def _end_of(
    walker: Walker, start: Any, track: Track, since: int, passed: Counter[str]
) -> tuple[int, Stop] | None:
    """How many points there are up to that at which a track is to end, and why.

    Where it ended before, it goes on: what it passed there counts no more.
    """
    for one in walker.passed(start, track, since):
        name = _ending(walker, one, start)
        if name is None:
            continue
        passed[name] += 1
        if passed[name] >= walker.curve.ends.count(name):
            what = f"the event {one.name!r}" if one.name else one.kind.replace("_", " ")
            why = f"stop = {name!r}: {what} at {walker.words(one)}"
            return one.index + 1, Stop(name, why)
    return None


def _names(seen: Seen) -> set[str]:
    """What a special point goes by."""
    return {seen.kind, KINDS[seen.kind].label, seen.name} - {""}


def _ending(walker: Walker, seen: Seen, start: Any) -> str | None:
    """The name by which a special point ends the walk, if it does."""
    name = next((name for name in walker.curve.ends if name in _names(seen)), None)
    return None if name is None or walker.is_at(seen, start) else name


def cut(walker: Walker, start: Any, path: P, found: list[Any]) -> tuple[P, list[Any]]:
    """A path that ends on the special points at which it is to end, and what is left on it."""
    if path.closed or not any(stop.reason in walker.curve.ends for stop in path.stops):
        return path, found
    first, last = 0, path.count
    ends: list[Any] = [None, None]
    for side, stop in enumerate(path.stops):
        there = [
            one
            for one in found
            if (one.index >= path.start) == bool(side)
            and stop.reason in _names(one)
            and not walker.is_at(one, start)
        ]
        if stop.reason not in walker.curve.ends or not there:
            continue
        # Where it ended before, it went on; it ends at the first of those that its wish is for.
        own = [one for one in there if (one.index >= path.count - 2 if side else one.index <= 0)]
        one = (own or there)[side - 1]
        ends[side] = one
        place = next(k for k, other in enumerate(found) if other is one)
        # What stands at the same place comes before or after it by rounding.
        step = 1 if side else -1
        while 0 <= place + step < len(found) and walker.is_at(found[place + step], one.position):
            place += step
            found[place] = replace(found[place], index=one.index)
        if side:
            last, found = one.index + 1, found[: place + 1]
        else:
            first, found = one.index + 1, found[place:]
    if ends == [None, None]:
        return path, found
    moved = [replace(one, index=one.index - first) for one in found]
    kept = [
        None if end is None else next(m for m, one in zip(moved, found, strict=True) if one is end)
        for end in ends
    ]
    return path.part(first, max(last, first + 1), (kept[0], kept[1])), moved


HARDLY = 1e-3  # part of the span of a parameter
#: Ends that say nothing of the curve, which goes on from there.
UNFINISHED = ("max_points", "interrupted")


def place_of(curve: Any, w: Array) -> str:
    """A point of a curve in words."""
    names = [*curve.field.states, *(curve.field.parameters[i] for i in curve.active)]
    where = ", ".join(f"{name} = {w[i]:.9g}" for i, name in enumerate(names[:4]))
    return where + (", ..." if len(names) > 4 else "")


def track_stop(curve: Any, reason: int, which: int, w: Array) -> Stop:
    """Say why a track of a `Curve` ends in the state w."""
    names = [*curve.field.states, *(curve.field.parameters[i] for i in curve.active)]
    if reason == trace.BOUND and which >= curve.m:
        return Stop("bound", f"branches no longer meet on the curve beyond {place_of(curve, w)}")
    if reason == trace.BOUND:
        over = w[which] - curve.low[which] > 0.5 * (curve.high[which] - curve.low[which])
        if not np.isfinite(curve.low[which]) or not np.isfinite(curve.high[which]):
            over = bool(np.isfinite(curve.high[which])) or w[which] > 0.0
        side, bound = ("upper", curve.high) if over else ("lower", curve.low)
        if which < curve.n and names[which] not in curve.options.bounds:  # nobody gave it
            passed = f"passed {bound[which]:.3g}, far beyond its size at the start"
            if _ends_nowhere(curve, w, which):
                passed = f"grows without end: it {passed}"
            return Stop(
                "bound",
                f"{names[which]} {passed}; ContinuationOptions(bounds={{{names[which]!r}: "
                "(low, high)}) sets another limit",
            )
        return Stop("bound", f"{names[which]} met its {side} bound {bound[which]:.9g}")
    where = place_of(curve, w)
    if reason == trace.CLOSED:
        return Stop("closed", f"the curve closed on its start at {where}")
    if reason == trace.STUCK:
        why = not_isolated(curve, w[: curve.m], where)
        return Stop("stuck", why) if why else stuck(curve, which, where)
    if reason == trace.NOT_FINITE:
        return Stop("not_finite", f"f is not finite beyond {where}{curve.field.raised}")
    if reason == trace.INTERRUPTED:
        return Stop("interrupted", f"it was interrupted behind {where}")
    return Stop("max_points", f"max_points were computed, the last at {where}")


def stuck(curve: Any, which: int, where: str) -> Stop:
    """The end of a curve where no step stands, and why the last one was refused."""
    step = f"min_step = {curve.options.min_step:g}"
    words = {
        newton.DIVERGED: f"Newton's method converged for no step longer than {step}",
        newton.SINGULAR: f"the derivatives of f are singular beyond, for every step "
        f"longer than {step}",
        TURNS: f"the curve turns by more than max_turn = {curve.options.max_turn:g} within {step}",
        CROSSES: f"branches cross or pass each other within {step}",
    }
    return Stop("stuck", f"{words[which]} at {where}{_differences(curve)}")


def _ends_nowhere(curve: Any, w: Array, which: int) -> bool:
    """Whether the parameters hardly move while an unknown grows, as next to a pole."""
    free = slice(curve.n, curve.m)
    moved = np.abs(w[curve.size :][free] * w[which])
    room = np.where(np.isfinite(curve.high - curve.low), curve.high - curve.low, np.inf)[free]
    grown = abs(w[curve.size + which])
    return bool(np.all(moved <= HARDLY * room * grown))


def wished(stop: Stop, ends: tuple[str, ...]) -> bool:
    """Whether a user's ``stop=`` ended it, not the doubling that an orbit of period two ends at."""
    return stop.reason in ends and stop.message.startswith("stop = ")


def searched(halt: BaseException) -> Stop:
    """Where special points were not yet looked for."""
    return Stop("interrupted", f"{why_halted(halt)} while special points were looked for")


#: Where there was no time for a first point.
NOT_BEGUN = Stop("interrupted", "it was interrupted before its first point")


def _differences(curve: Any) -> str:
    """What else may end a curve whose derivatives are differences, in words."""
    if curve.knows_slopes:
        return ""
    width = 2.0 * differences.COARSE
    return (
        f"; derivatives are differences over {width:.0e} of an unknown and miss what f does "
        "within less: a formula or jac knows them"
    )
