"""Curves that end at the first special point or event of a kind that was asked for."""

from __future__ import annotations

from collections import Counter
from dataclasses import replace

import numpy as np

from phasekit.bifurcation.continuation.acceptance import on_bound
from phasekit.bifurcation.continuation.curve import Curve, Stop, Track
from phasekit.bifurcation.continuation.path import Path, Sample, Slopes, join
from phasekit.bifurcation.continuation.placed import Placed
from phasekit.bifurcation.continuation.points.special import Special
from phasekit.bifurcation.continuation.specials import Specials, find
from phasekit.bifurcation.continuation.stops import SEARCHED
from phasekit.bifurcation.special_points import KINDS

FIRST = 32  # points after which a curve is looked at first; then after twice as many each time
START = 1e-6  # distance on scaled axes within which a point is the start itself


def names_of(special: Special) -> set[str]:
    """What a special point goes by."""
    return {special.kind, KINDS[special.kind].label, special.name} - {""}


def ending_of(curve: Curve, special: Special) -> str | None:
    """The name by which a special point ends the curve, if it does."""
    return next((name for name in curve.ends if name in names_of(special)), None)


def followed(
    curve: Curve, start: Sample, state: np.ndarray, points: int, known: Track | None = None
) -> Track:
    """Follow a curve from a state for so many points, or to where it is to end."""
    track = known
    chunk = FIRST if curve.ends else points
    known_points = 0 if known is None else len(known.record)
    while True:
        more = curve.follow(state if track is None else track.state, min(chunk, points))
        more = on_bound(curve, more)
        whole = more if track is None else _joined(track, more)
        try:
            ended = _ended(curve, start, whole, known_points) if curve.ends else None
        except KeyboardInterrupt:
            track = curve.not_begun(start.u, start.tangent) if track is None else track
            return replace(track, stop=SEARCHED)
        track = whole
        points -= len(more.record)
        if ended is not None or more.stop.reason != "max_points" or points <= 0:
            return track if ended is None else ended
        chunk *= 2


def _joined(track: Track, more: Track) -> Track:
    record = np.concatenate([track.record, more.record])
    return Track(record, np.concatenate([track.slopes, more.slopes]), more.state, more.stop)


def _ended(curve: Curve, start: Sample, track: Track, known: int) -> Track | None:
    """A track up to the point behind that at which it ends; None if it goes on.

    Points that were known before count no more: there it ended, and goes on.
    """
    path = join(curve, start, None, track)
    passed: Counter[str] = Counter()
    for one in find(curve, path).placed:
        name = ending_of(curve, one.special)
        if name is None or one.index < known:
            continue
        if curve.length(_gap(curve, one.special, start)) > START:
            passed[name] += 1
            if passed[name] < curve.ends.count(name):
                continue
            count = one.index + 1
            stop = Stop(name, f"stop = {name!r}: {_said(curve, one.special)}")
            return Track(track.record[:count], track.slopes[:count], track.state, stop)
    return None


def cut(curve: Curve, path: Path, specials: Specials) -> tuple[Path, Specials]:
    """A path that ends on the special points at which it is to end, and what is left on it."""
    placed, first, last = list(specials.placed), 0, path.count
    ends: list[Special | None] = [None, None]
    start = Sample(path.u[path.start], path.tangent[path.start], path.slopes[path.start])
    for side, stop in enumerate(path.stops):
        there = [
            one
            for one in placed
            if (one.index >= path.start) == bool(side)
            and stop.reason in names_of(one.special)
            and curve.length(_gap(curve, one.special, start)) > START
        ]
        if stop.reason not in curve.ends or not there or path.closed:
            continue
        # Where it ended before, it went on; it ends at the first of those that its wish is for.
        own = [one for one in there if _beyond(path, one, side)]
        one = (own or there)[side - 1]
        ends[side] = one.special
        if side:
            last, placed = one.index + 1, placed[: placed.index(one) + 1]
        else:
            first, placed = one.index + 1, placed[placed.index(one) :]
    if ends == [None, None]:
        return path, specials
    kept = slice(first, max(last, first + 1))
    u = path.u[kept]
    slopes = path.slopes[kept] if isinstance(path.slopes, np.ndarray) else Slopes(curve, u)
    values = None if path.eigenvalues is None else path.eigenvalues[kept]
    path = replace(
        path, u=u, tangent=path.tangent[kept], slopes=slopes, info=path.info[kept],
        start=path.start - first, residual=path.residual[kept], eigenvalues=values,
        ends=(ends[0], ends[1]),
    )  # fmt: skip
    moved = [Placed(one.index - first, one.along, one.special) for one in placed]
    return path, Specials(moved, specials.eigenvalues[kept], specials.messages)


def _beyond(path: Path, one: Placed, side: int) -> bool:
    """Whether a special point lies in the last step of its side."""
    return one.index >= path.count - 2 if side else one.index <= 0


def _gap(curve: Curve, special: Special, start: Sample) -> np.ndarray:
    gap = np.zeros(curve.size)
    gap[: curve.m] = special.u[: curve.m] - start.u[: curve.m]
    return gap


def _said(curve: Curve, special: Special) -> str:
    names = [*curve.field.states, *(curve.field.parameters[i] for i in curve.active)]
    where = ", ".join(f"{name} = {special.u[i]:.9g}" for i, name in enumerate(names[:4]))
    what = f"the event {special.name!r}" if special.name else special.kind.replace("_", " ")
    return f"{what} at {where}"
