"""How curves of equilibria of many states are walked."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from phasekit.arrays import Array
from phasekit.bifurcation.continuation.curve_walk import SAME_PLACE, CurveWalk
from phasekit.bifurcation.continuation.large.begin import check_derivatives
from phasekit.bifurcation.continuation.large.curve import LargeCurve
from phasekit.bifurcation.continuation.large.on_folds import points_on_folds
from phasekit.bifurcation.continuation.large.path import join
from phasekit.bifurcation.continuation.large.search import find
from phasekit.bifurcation.continuation.points.special import Placed, Special
from phasekit.bifurcation.continuation.walk import NOT_SEARCHED, Stop, Tracks
from phasekit.errors import ParameterError

NO_SPECIALS = "points of codimension two are not looked for, of fields of states"
MORE = "zero-Hopf points are not looked for, of fields of states"


@dataclass(frozen=True)
class LargeWalk(CurveWalk):
    """How a curve of many states is walked: the same, with sparse derivatives."""

    curve: LargeCurve
    singular: bool = False  # whether it starts on a branch point
    of: str = "equilibrium"  # what its points are

    @property
    def kind(self) -> str:
        """What it is a curve of."""
        return self.of

    @property
    def bounded(self) -> tuple[str, ...]:
        """Names of what its bounds are bounds of."""
        return (*self.curve.field.states, self.curve.free)

    def hindered(self, start: Any) -> Stop | None:
        """Nothing that is seen before the first step."""
        return None

    def turned(self, start: Any) -> Any:
        """The start in the other direction."""
        return replace(start, tangent=-start.tangent)

    def follow(self, state: Any, points: int, start: Any) -> Any:
        """At most so many points from a state."""
        return self.curve.follow(state, points)

    def passed(self, start: Any, track: Any, since: int) -> list[Placed]:
        """Special points from one of its points on."""
        if self.of != "equilibrium":
            return []
        path = join(start, self._own(start), None, track)
        return [one for one in find(self.curve, path)[1] if one.index >= since]

    def _own(self, start: Any) -> Array:
        """The tests of the start; NaN on a branch point, where rounding would tell."""
        curve = self.curve
        if self.singular:
            return np.array([np.nan, np.nan, -1.0])
        side = curve.bordered(start.matrix, start.slope, curve.weight * start.tangent).sign
        along = start.tangent[curve.n] / curve.scale[curve.n]
        return np.array([along, side, float(curve.positive(start))])

    def is_at(self, seen: Placed, place: Any) -> bool:
        """Whether a special point stands at the start, or where another one does."""
        return not self.curve.length(seen.special.u - place.u) > SAME_PLACE

    def joined(self, start: Any, tracks: Tracks, origin: Stop) -> Any:
        """One path of two tracks."""
        return join(start, self._own(start), *tracks)

    def unsearched(self, path: Any) -> tuple[Any, list[Placed], tuple[str, ...]]:
        """The same where there was no time to look for them."""
        return path, [], NOT_SEARCHED

    def search(self, path: Any) -> tuple[Any, list[Placed], tuple[str, ...]]:
        """The path, its special points, and what is not certain."""
        if self.of != "equilibrium":
            folds = self.of == "fold"
            placed = points_on_folds(self.curve, path) if folds else []
            return path, placed, (MORE if folds else NO_SPECIALS,)
        path, placed, messages = find(self.curve, path)
        return path, placed, (*messages, *self._wrong_derivatives(path))

    def _wrong_derivatives(self, path: Any) -> tuple[str, ...]:
        """What differences of f say against the derivatives away from the start."""
        curve = self.curve
        for k in (path.count - 1, 0, path.count // 2):
            u = path.u[k]
            try:
                check_derivatives(curve, u, curve.derivatives(u)[0])
            except ParameterError as error:
                return (
                    f"{error}, at {curve.free} = {u[curve.n]:.9g}: n_unstable and special points "
                    "may be wrong",
                )  # fmt: skip
        return ()

    def at_ends(self, path: Any) -> list[Placed]:
        """The two ends of a path as special points."""
        curve, last = self.curve, path.count - 1
        found = []
        for i, along, stop in ((0, -np.inf, path.stops[0]), (last, np.inf, path.stops[1])):
            there = path.ends[0 if along < 0.0 else 1]
            u = path.u[i] if there is None else there.special.u
            at = float(u[curve.n])
            residual = float(np.max(np.abs(curve.value(u))))
            special = Special("end", u, (at, at), residual, "converged", stop.message)
            found.append(Placed(i, along, special))
        return found
