"""All special points of a path, in order and once each."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from phasekit.bifurcation import special_points
from phasekit.bifurcation.continuation.conserved import NOT_ISOLATED, deficient
from phasekit.bifurcation.continuation.curve import Curve
from phasekit.bifurcation.continuation.events import Bracket, brackets_of_all
from phasekit.bifurcation.continuation.kernels.defining import EQUILIBRIUM
from phasekit.bifurcation.continuation.locate import locate
from phasekit.bifurcation.continuation.path import Path, rounded
from phasekit.bifurcation.continuation.points.event import events_of
from phasekit.bifurcation.continuation.points.regular import regular_points
from phasekit.bifurcation.continuation.points.special import (
    CONVERGED,
    SAME,
    Placed,
    Special,
    _distance,
    inside,
    is_between,
    unique,
)
from phasekit.bifurcation.continuation.two_parameters import find_on
from phasekit.bifurcation.continuation.walk import NOT_SEARCHED, in_order
from phasekit.bifurcation.special_points import KINDS
from phasekit.numerics.waits import stage


class Specials(NamedTuple):
    """Special points of a path in order, the eigenvalues of f_x at its points, and doubts."""

    placed: list[Placed]
    eigenvalues: npt.NDArray[np.complex128]
    messages: tuple[str, ...]
    outside: tuple[Placed, ...] = ()  # those beyond the bounds, which one step passed twice


def find(curve: Curve, path: Path) -> Specials:
    """Special points of a path, those that the curve is asked for."""
    return find_all([(curve, path)])[0]


def find_all(paths: Sequence[tuple[Curve, Path]]) -> list[Specials]:
    """The same of paths of curves that differ in their parameters, scales and bounds."""
    with np.errstate(all="ignore"):
        known = [_brackets_without_look(*one) for one in paths]
        both = zip(paths, known, strict=True)
        asked = iter(brackets_of_all([one for one, brackets in both if brackets is None]))
        along = [Brackets(*next(asked)) if one is None else one for one in known]
        every = [(curve, one.found) for (curve, _), one in zip(paths, along, strict=True)]
        rest = zip(paths, along, regular_points(every), strict=True)
        return [_found(*one, brackets, regular) for one, brackets, regular in rest]


def _found(curve: Curve, path: Path, brackets: Brackets, regular: dict[int, Special]) -> Specials:
    """Special points of a path, where it is known between which of its points some are."""
    _, eigenvalues, messages = brackets
    placed = _bifurcations(curve, path, brackets.found, regular)
    if curve.kind != EQUILIBRIUM or any(test.along == EQUILIBRIUM for test in special_points.TESTS):
        zeros, doubts = find_on(curve, path)
        placed, messages = in_order([*placed, *zeros]), (*messages, *doubts)
    events, doubts = events_of(curve, path) if curve.events else ([], ())
    messages = (*messages, *doubts)
    flow = curve.kind == EQUILIBRIUM and not (curve.discrete or curve.conservative)
    if flow and "hopf" in curve.detect and "neutral_saddle" not in curve.detect:
        messages = (
            *messages,
            f"neutral saddles were not looked for, of {curve.n} states there may be very many: "
            f"detect={[*curve.detect, 'neutral_saddle']} looks for them",
        )
    every = in_order([*placed, *events])
    outside = tuple(one for one in every if _outside(curve, one.special))
    if outside:
        every = [one for one in every if not any(one is other for other in outside)]
        messages = (*messages, _passed(curve, outside))
    return Specials(every, eigenvalues, messages, outside)


def _passed(curve: Curve, outside: tuple[Placed, ...]) -> str:
    """What is said of a path that was beyond its bounds within a step, and came back."""
    n, name = curve.n, curve.field.parameters[curve.active[0]]
    places = [
        f"a {one.kind.replace('_', ' ')} at {name} = {one.special.u[n]:.9g}" for one in outside
    ]
    return (
        f"the curve leaves its bounds within a step, past {' and '.join(places)}, and goes on "
        "where it comes back: on the other sheet"
    )


#: Part of a span by which a point at its end may lie outside.
ROUNDING = 1e-13


def _outside(curve: Curve, special: Special) -> bool:
    """Whether a point surely lies outside the bounds, between two points inside."""
    m = curve.m
    low, high = curve.low[:m], curve.high[:m]
    span = np.where(np.isfinite(high - low), high - low, curve.scale[:m])
    room = max(ROUNDING, curve.field.accuracy) * span
    beyond = (special.u[:m] < low - room) | (special.u[:m] > high + room)
    return special.status == CONVERGED and bool(beyond.any())


def not_searched(path: Path, n: int) -> Specials:
    """What is said of a path where the search was interrupted."""
    unknown = np.full((path.count, n), np.nan, dtype=complex)
    return Specials([], unknown, NOT_SEARCHED)


class Brackets(NamedTuple):
    """Where something happens along a branch, its eigenvalues, and doubts."""

    found: list[Bracket]
    eigenvalues: npt.NDArray[np.complex128]
    messages: tuple[str, ...] = ()


def _brackets_without_look(curve: Curve, path: Path) -> Brackets | None:
    """What is known without a look at eigenvalues along a path; None where that tells."""
    values = path.eigenvalues
    if curve.kind != EQUILIBRIUM:
        assert values is not None
        return Brackets([], values)
    unknown = not_searched(path, curve.n).eigenvalues if values is None else values
    if not curve.detect:  # nothing is asked for that takes long
        return Brackets([], unknown)
    if any(NOT_ISOLATED in stop.message for stop in path.stops) and all(
        deficient(curve, path.u[k], path.slopes[k]) for k in {0, path.count // 2, path.count - 1}
    ):  # a path that is one of many, all along
        return Brackets([], unknown)
    stage(f"looking for special points on {path.count:,} points")
    return None


def _bifurcations(
    curve: Curve, path: Path, found: Sequence[Bracket], regular: dict[int, Special]
) -> list[Placed]:
    """Special points in brackets, some of which are known, where they stand."""
    placed = []
    for k, bracket in enumerate(found):
        stage(f"special point {k + 1} of about {len(found)} on {path.count:,} points")
        for special in [regular[k]] if k in regular else locate(curve, bracket):
            if KINDS[special.kind].detected not in (None, *curve.detect):
                continue
            u = rounded(curve, special.u)
            special = special if u is special.u else replace(special, u=u)
            placed.append(placement(curve, path, bracket, special))
    placed = unique(curve, path, placed)
    # The start of a closed curve is its end as well.
    if path.closed and len(placed) > 1:
        first, last = placed[0], placed[-1]
        if first.special.kind == last.special.kind and _distance(curve, first, last) < SAME:
            placed = placed[:-1]
    return placed


def placement(curve: Curve, path: Path, bracket: Bracket, special: Special) -> Placed:
    """Where on the path a special point stands."""
    first = None
    own = special.status == CONVERGED and curve.field.exact
    own = own and is_between(curve, bracket, special.u)
    # A bracket may hold points that lie too near to a branch point to say anything.
    for i in range(bracket.index, min(bracket.index + 8, path.count - 1)):
        chord = path.u[i + 1] - path.u[i]
        gap = np.zeros(curve.size)
        gap[: curve.m] = special.u[: curve.m] - path.u[i, : curve.m]
        square = float(np.dot(curve.weight * chord, chord))
        along = float(np.dot(curve.weight * chord, gap)) / square if square else 0.0
        one = Placed(i, along, special, own)
        first = one if first is None else first
        if inside(one):
            return one
    assert first is not None
    return first
