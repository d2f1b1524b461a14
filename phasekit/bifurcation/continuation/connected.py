"""All curves of equilibria that hang together: from starts, and through every branch point."""

from __future__ import annotations

import functools
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from phasekit.arrays import Array
from phasekit.bifurcation.continuation.curve import Curve
from phasekit.bifurcation.continuation.curve_walk import CurveWalk, special_points
from phasekit.bifurcation.continuation.path import Path, Sample, lies_on, turned
from phasekit.bifurcation.continuation.points.special import Placed, Special
from phasekit.bifurcation.continuation.start import begun, begun_cells
from phasekit.bifurcation.continuation.walk import NO_START, Found, Tracks, run, search
from phasekit.bifurcation.special_points import KINDS
from phasekit.errors import ConvergenceError

SAME = 1e-8  # distance on scaled axes within which two branch points are one
#: What one curve of many may raise.
FAILURES = (ConvergenceError, np.linalg.LinAlgError)


@dataclass(frozen=True)
class Traced:
    """A curve that was followed from a start: its points, and the special points on it."""

    walker: CurveWalk
    start: Sample
    tracks: Tracks
    path: Path
    placed: list[Placed]  # its special points where they stand, without its ends

    @property
    def curve(self) -> Curve:
        """Its equations."""
        return self.walker.curve

    @functools.cached_property
    def found(self) -> Found:
        """The same with its ends, and what is to be said of it."""
        return search(self.walker, self.start, self.tracks, NO_START)

    @property
    def specials(self) -> list[Special]:
        """The special points alone."""
        return [one.special for one in self.placed]

    @property
    def unfinished(self) -> str:
        """Why it ends where it might go on; nothing where it does not."""
        for stop in self.path.stops:
            if stop.reason not in ("bound", "closed", "start"):
                return stop.message
        return ""


def traced(curve: Curve, start: Sample) -> Traced:
    """The curve through a point, with its special points."""
    return _with_points([_walked(curve, start)])[0]


def _walked(curve: Curve, start: Sample) -> Traced:
    """The same before these are looked for."""
    walker = CurveWalk(curve)
    tracks = run(walker, start, curve.options.directions)
    return Traced(walker, start, tracks, walker.joined(start, tracks, NO_START), [])


def _with_points(walked: Sequence[Traced]) -> list[Traced]:
    """Curves that differ in their parameters, scales and bounds, with their special points."""
    found = special_points([(one.curve, one.path) for one in walked])
    both = zip(walked, found, strict=True)
    return [replace(one, path=path, placed=placed) for one, (path, placed) in both]


def first_traced(curves: Sequence[Curve], starts: Sequence[Array]) -> list[Traced | Exception]:
    """The curve through a start of each, where these differ in their parameters and bounds.

    Or why there is none.
    """
    if not curves:
        return []
    found: list[Traced | Exception] = []
    for one in begun_cells(curves, starts, _given(curves[0]), "the start"):
        try:
            found.append(one if isinstance(one, Exception) else _walked(*one))
        except FAILURES as error:
            found.append(error)
    whole = iter(_or_failures([one for one in found if isinstance(one, Traced)]))
    return [next(whole) if isinstance(one, Traced) else one for one in found]


def _or_failures(walked: Sequence[Traced]) -> list[Traced | Exception]:
    """Curves with their special points, or why these are not known; one by one if not at once."""
    try:
        return [*_with_points(walked)]
    except FAILURES as error:
        return [error] if len(walked) == 1 else [_or_failures([one])[0] for one in walked]


def _given(curve: Curve) -> dict[int, float]:
    """The scales of states that are asked for."""
    asked = curve.options.scales
    return {i: asked[name] for i, name in enumerate(curve.field.states) if name in asked}


def connected(
    curve: Curve, starts: Iterable[Array], depth: int, first: Traced | None = None
) -> list[Traced]:
    """All curves through equilibria, each once, with those that branch off, to a depth.

    curve: of equilibria in one parameter, its states not yet scaled; starts: unknowns of
    equilibria, or guesses of them, shape (states + 1,); depth: how many times branches are
    switched in a row; first: the curve through the first of the starts, if that is known.
    """
    found: list[Traced] = []
    passed: list[tuple[Curve, Array]] = []
    for u in starts:
        if any(lies_on(one.curve, one.path, u) for one in found):
            continue
        if found or first is None:
            own, start = begun(curve, u, _given(curve), "the start")
            if any(lies_on(one.curve, one.path, start.u) for one in found):
                continue  # a start that is no equilibrium leads to one of these
            found.append(traced(own, start))
        else:
            found.append(first)
        queue = [(found[-1], 0)]
        while queue:
            one, level = queue.pop(0)
            for special in one.specials if level < depth else ():
                if KINDS[special.kind].label != "BP" or seen(passed, special.u):
                    continue
                passed.append((one.curve, special.u))
                for tangent in special.others:
                    if led(((o.curve, o.path) for o in found), one.curve, special.u, tangent):
                        continue
                    slopes = one.curve.evaluate(special.u)[1]
                    found.append(traced(one.curve, Sample(special.u, tangent, slopes)))
                    queue.append((found[-1], level + 1))
    return found


def seen(passed: Iterable[tuple[Curve, Array]], u: Array) -> bool:
    """Whether branches were switched at a point before."""
    return any(
        np.max(np.abs(turned(curve, u[: curve.m] - other[: curve.m]) / curve.scale[: curve.m]))
        < SAME
        for curve, other in passed
    )


def led(paths: Iterable[tuple[Curve, Path]], curve: Curve, u: Array, tangent: Array) -> bool:
    """Whether both ways along a tangent at a branch point were followed before."""
    paths = list(paths)
    for sign in (1.0, -1.0):
        step = sign * curve.options.initial_step * tangent
        probe = curve.refine(u + step, curve.weight * tangent)
        if not probe.converged:
            return False
        inside = np.all((probe.u >= curve.low) & (probe.u <= curve.high))
        if inside and not any(lies_on(*path, probe.u) for path in paths):
            return False
    return True
