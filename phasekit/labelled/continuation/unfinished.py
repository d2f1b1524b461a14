"""Branches that are not complete, which their user has to know."""

from __future__ import annotations

from typing import Any, TypeVar

from phasekit.bifurcation.continuation.stops import UNFINISHED
from phasekit.errors import warn

Of = TypeVar("Of", bound=Any)


def interrupted(branch: Any) -> bool:
    """Whether Ctrl-C ended it."""
    return any(stop.reason == "interrupted" for stop in branch.stops)


def announced(branch: Of) -> Of:
    """The branch, with a warning if it ended for its number of points, or by Ctrl-C."""
    ends = [
        f"{name}: {stop.message}"
        for name, stop in zip(("first point", "last point"), branch.stops, strict=True)
        if stop.reason in UNFINISHED
    ]
    if ends:
        more = (
            ""
            if interrupted(branch)
            else ", ContinuationOptions(max_points=...) allows more points"
        )
        warn(
            f"the branch in {branch.parameter} is not complete, {'; '.join(ends)}; what "
            f"lies beyond on this {_named(branch)} was not seen; extend() continues it{more}",
            RuntimeWarning,
        )
    return branch


def _named(branch: Any) -> str:
    """What a branch is, and at which point it begins."""
    what = "family of periodic orbits" if branch.kind == "cycle" else f"{branch.kind} branch"
    points = branch.special_points
    return f"{what} from {points[0]!r}" if points else what
