"""How curves of equilibria and of special points are walked."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import ClassVar

import numpy as np

from phasekit.arrays import Array
from phasekit.bifurcation.continuation.conserved import deficient, not_isolated
from phasekit.bifurcation.continuation.curve import Curve, Stop, Track
from phasekit.bifurcation.continuation.kernels.defining import (
    BRANCH,
    EQUILIBRIUM,
    EVENT,
    FLIP,
    FOLD,
    HOPF,
    REGULAR,
    TORUS,
)
from phasekit.bifurcation.continuation.kernels.newton import RAISED
from phasekit.bifurcation.continuation.path import Path, Sample, between, join, on_bound
from phasekit.bifurcation.continuation.points.special import Placed, Special
from phasekit.bifurcation.continuation.specials import Specials, find, find_all, not_searched
from phasekit.bifurcation.continuation.walk import Tracks, Walker, place_of

#: What curves are curves of, by their defining systems.
KINDS = {
    EQUILIBRIUM: "equilibrium", FOLD: "fold", HOPF: "hopf", BRANCH: "branch_point",
    FLIP: "period_doubling", TORUS: "torus", EVENT: "event",
}  # fmt: skip
SAME_PLACE = 1e-6  # distance on scaled axes within which two places are one


@dataclass(frozen=True)
class CurveWalk(Walker):
    """How a curve is walked; its steps are made by compiled code, many at a time."""

    curve: Curve
    chunk: ClassVar[int] = 32
    looks_back: ClassVar[bool] = True

    @property
    def kind(self) -> str:
        """What it is a curve of."""
        return KINDS[self.curve.kind]

    @property
    def bounded(self) -> tuple[str, ...]:
        """Names of what its bounds are bounds of."""
        field = self.curve.field
        return (*field.states, *(field.parameters[i] for i in self.curve.active))

    def hindered(self, start: Sample) -> Stop | None:
        """Why there is no branch: equilibria that are not isolated."""
        curve = self.curve
        if curve.kind != EQUILIBRIUM or not deficient(curve, start.u, start.slopes):
            return None
        why = not_isolated(curve, start.u[: curve.m], place_of(curve, start.u))
        return Stop("stuck", why) if why else None

    def turned(self, start: Sample) -> Sample:
        """The start in the other direction."""
        return Sample(start.u, -start.tangent, start.slopes)

    def begin(self, start: Sample) -> Array:
        """The state of a walk that begins at a point."""
        return self.curve.start_state(start.u, start.tangent)

    def follow(self, state: Array, points: int, start: Sample) -> Track:
        """At most so many points from a state."""
        return on_bound(self.curve, self.curve.follow(state, points))

    def passed(self, start: Sample, track: Track, since: int) -> list[Placed]:
        """Special points from one of its points on."""
        placed = find(self.curve, join(self.curve, start, None, track)).placed
        return [one for one in placed if one.index >= since]

    def is_at(self, seen: Placed, place: Sample | Special) -> bool:
        """Whether a special point stands at the start, or where another one does."""
        curve = self.curve
        gap = np.zeros(curve.size)
        gap[: curve.m] = seen.special.u[: curve.m] - place.u[: curve.m]
        return not curve.length(gap) > SAME_PLACE

    def within(self, state: Array) -> bool:
        """Whether a state stands inside its bounds; vectors of curves have some as well."""
        u = state[: len(self.curve.low)]
        return bool(np.all((u > self.curve.low) & (u < self.curve.high)))

    def words(self, seen: Placed) -> str:
        """Where a special point is."""
        names = self.bounded[:4]
        return ", ".join(f"{name} = {seen.special.u[i]:.9g}" for i, name in enumerate(names))

    def joined(self, start: Sample, tracks: Tracks, origin: Stop) -> Path:
        """One path of two tracks."""
        return join(self.curve, start, *tracks)

    def search(self, path: Path) -> tuple[Path, list[Placed], tuple[str, ...]]:
        """The path with its eigenvalues, its special points, and what is not certain."""
        return _with_eigenvalues(path, find(self.curve, path), narrow(self.curve, path))

    def unsearched(self, path: Path) -> tuple[Path, list[Placed], tuple[str, ...]]:
        """The same where there was no time to look for them."""
        return _with_eigenvalues(path, not_searched(path, self.curve.n), ())

    def at_ends(self, path: Path) -> list[Placed]:
        """The two ends of a path as special points."""
        curve, found = self.curve, []
        places = (0, -np.inf), (path.count - 1, np.inf)
        for (i, along), stop, there in zip(places, path.stops, path.ends, strict=True):
            u = path.u[i, : curve.m] if there is None else there.special.u
            at, tangent = float(u[curve.n]), path.tangent[i]
            residual = float(np.max(np.abs(curve.evaluate(u)[0])))
            special = Special(
                "end", u, (at, at), residual, "converged", stop.message, tangent=tangent
            )
            found.append(Placed(i, along, special))
        return found


def special_points(paths: Sequence[tuple[Curve, Path]]) -> list[tuple[Path, list[Placed]]]:
    """Paths with their eigenvalues, and their special points, without a word.

    Their curves differ in their parameters, scales and bounds.
    """
    both = zip(paths, find_all(paths), strict=True)
    return [_with_eigenvalues(path, found, ())[:2] for (_, path), found in both]


def _with_eigenvalues(
    path: Path, found: Specials, gaps: tuple[str, ...]
) -> tuple[Path, list[Placed], tuple[str, ...]]:
    """A path that knows its eigenvalues, its special points, and what is not certain of it."""
    placed, eigenvalues, doubts, outside = found
    path = replace(path, eigenvalues=eigenvalues, outside=outside)
    return path, placed, (*path.messages, *doubts, *gaps)


SEEN = 1e-5  # off the mean tangent: more than errors of derivatives
DEPTH = 8
MOST = 20  # steps that are looked into
SHORT = 1e-5  # steps whose chords are not known well


def narrow(curve: Curve, path: Path) -> tuple[str, ...]:
    """Where a branch turns within less than a step, in words."""
    if curve.kind not in REGULAR or curve.options.tolerance >= RAISED or path.count < 2:
        return ()
    unit = np.sqrt(curve.weight[: curve.m])
    u, t = path.u[:, : curve.m] * unit, path.tangent[:, : curve.m] * unit
    chord = np.diff(u, axis=0)
    h = np.linalg.norm(chord, axis=1)
    with np.errstate(all="ignore"):
        off = np.linalg.norm(chord / h[:, None] - 0.5 * (t[1:] + t[:-1]), axis=1)
    turn = np.linalg.norm(t[1:] - t[:-1], axis=1)
    doubtful = np.flatnonzero((off > SEEN) & (off > turn) & (h > SHORT))
    doubtful = doubtful[np.argsort(-off[doubtful])][:MOST]
    found = []
    for i in np.sort(doubtful).tolist():
        a, b = (Sample(path.u[k], path.tangent[k], path.slopes[k]) for k in (i, i + 1))
        if not _smooth(curve, a, b, DEPTH):
            found.append(i)
    if not found:
        return ()
    n = curve.n
    name = curve.field.parameters[curve.active[0]]
    places = ", ".join(
        f"{path.u[i, n]:.6g} and {path.u[i + 1, n]:.6g}" for i in found[:3]
    ) + (", ..." if len(found) > 3 else "")  # fmt: skip
    return (
        f"the curve turns within less than a step between {name} = {places}: special points there "
        "may be missed; a smaller max_step follows it",
    )


def _smooth(curve: Curve, a: Sample, b: Sample, depth: int) -> bool:
    """Whether halves of a step are better known by their tangents than the whole is."""
    whole = _off(curve, a, b)
    if whole <= SEEN:
        return True
    middle = between(curve, a, b, 0.5)
    if middle is None or depth == 0:
        return False
    halves = [(a, middle), (middle, b)]
    return all(
        _off(curve, *half) <= max(0.5 * whole, SEEN) or _smooth(curve, *half, depth - 1)
        for half in halves
    )


def _off(curve: Curve, a: Sample, b: Sample) -> float:
    chord = b.u - a.u
    h = curve.length(chord)
    mean = sum(0.5 * s.tangent / curve.length(s.tangent) for s in (a, b))
    return curve.length(chord / h - mean) if h > 0.0 else 0.0
