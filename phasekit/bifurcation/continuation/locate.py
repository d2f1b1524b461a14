"""From a bracket to its special points, and an account of every eigenvalue that crosses in it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import numpy.typing as npt

from phasekit.bifurcation.continuation.curve import Curve
from phasekit.bifurcation.continuation.events import Bracket
from phasekit.bifurcation.continuation.points.branch_point import (
    VERTICAL,
    branch_point,
    described,
    meets,
    singular_point,
)
from phasekit.bifurcation.continuation.points.fold import fold
from phasekit.bifurcation.continuation.points.pair import pair, pairs
from phasekit.bifurcation.continuation.points.period_doubling import period_doubling
from phasekit.bifurcation.continuation.points.special import (
    CONVERGED,
    GUESS,
    Special,
    interval_of,
    reach_of,
)
from phasekit.bifurcation.continuation.points.torus import torus
from phasekit.bifurcation.continuation.spectrum import eigenvalues_of, orientation

Array = npt.NDArray[np.float64]

FLAT = 1e-12  # a tangent's part along the parameter that is no more than rounding
SAME = 1e-6


def locate(curve: Curve, bracket: Bracket) -> list[Special]:
    """The special points of one bracket."""
    with np.errstate(all="ignore"):
        found = _locate(curve, bracket)
    ends = [abs(s.tangent[curve.n]) / curve.scale[curve.n] for s in (bracket.a, bracket.b)]
    if max(ends) < FLAT:  # the parameter does not move: signs are those of rounding errors
        found = [one for one in found if one.status == CONVERGED and one.kind != "fold"]
    return found


def _locate(curve: Curve, bracket: Bracket) -> list[Special]:
    found: list[Special] = []
    if "branch" in bracket.changes:
        found.append(branch_point(curve, bracket))
    if "fold" in bracket.changes and not any(_is_turn(curve, point) for point in found):
        found.append(fold(curve, bracket))
    if "flip" in bracket.changes:
        found.append(period_doubling(curve, bracket))
    if "pair" in bracket.changes:
        point = torus(curve, bracket) if curve.discrete else pair(curve, bracket, found)
        found += [] if point is None else [point]
    if "touch" in bracket.changes:
        found += _touch(curve, bracket)
    found = _merged(curve, found)
    left = abs(bracket.jump) - sum(_explained(one) for one in found)
    if left > 0 and curve.discrete:
        found.append(
            _several(curve, bracket, left, bracket.a.u, hopf=_complex_cross(curve, bracket))
        )
    elif left > 0:
        found += _together(curve, bracket, found, left)
    return found


def _touch(curve: Curve, bracket: Bracket) -> list[Special]:
    """A branch point at which two eigenvalues pass zero, one in each direction; or nothing."""
    best = min((bracket.a, bracket.b), key=lambda s: orientation(curve, s.tangent, s.slopes)[1])
    width = curve.length(bracket.b.u - bracket.a.u)
    point = singular_point(curve, best.u, width, 2.0 * width, least=2)
    if point is None or not meets(curve, point):
        return []
    return [described(curve, bracket, best, point)]


def _is_turn(curve: Curve, point: Special) -> bool:
    """Whether the parameter turns back at a branch point: the path is a pitchfork's side branch."""
    t = point.tangent
    return t is not None and bool(abs(t[curve.n]) / curve.scale[curve.n] < VERTICAL)


def _explained(point: Special) -> int:
    """How many eigenvalues may cross at a point."""
    return {"hopf": 2, "torus": 2, "period_doubling": 1}.get(point.kind, point.corank)


def _merged(curve: Curve, found: list[Special]) -> list[Special]:
    """Each point once; a double zero eigenvalue is said at the fold or branch point that it is."""
    kept: list[Special] = []
    for one in sorted(found, key=lambda one: (one.kind == "bogdanov_takens", -one.corank)):
        m = curve.m
        near = [i for i, other in enumerate(kept) if curve.length(one.u[:m] - other.u[:m]) < SAME]
        if near and one.kind == "bogdanov_takens":
            other = kept[near[0]]
            if other.kind in ("fold", "pitchfork", "transcritical", "branch_point"):
                note = "two eigenvalues vanish here: a Bogdanov-Takens point"
                note = f"{other.message}; {note}" if other.message else note
                kept[near[0]] = replace(other, message=note)
                continue
        if one.kind in ("fold", "branch_point", "transcritical", "pitchfork") and any(
            kept[i].corank >= max(one.corank, 1) and kept[i].kind == "branch_point" for i in near
        ):
            continue
        kept.append(one)
    return kept


def _complex_cross(curve: Curve, bracket: Bracket) -> bool:
    """Whether pairs of multipliers cross the unit circle."""
    counts = [
        np.sum((v.imag > 0.0) & (curve.growth(v) > 0.0))
        for s in (bracket.a, bracket.b)
        for v in eigenvalues_of(curve.linear(s.slopes)[None], accuracy=curve.field.accuracy)
    ]
    return bool(counts[0] != counts[1])


def _together(curve: Curve, bracket: Bracket, found: list[Special], left: int) -> list[Special]:
    """Eigenvalues that cross together, without a change of sign that would tell."""
    ends = [
        eigenvalues_of(s.slopes[None], accuracy=curve.field.accuracy)[0]
        for s in (bracket.a, bracket.b)
    ]
    real = [int(np.sum((v.imag == 0.0) & (v.real > 0.0))) for v in ends]
    above = [int(np.sum((v.imag > 0.0) & (v.real > 0.0))) for v in ends]
    u = 0.5 * (bracket.a.u + bracket.b.u)
    more: list[Special] = []
    if real[0] != real[1] and not any(one.corank for one in found):
        width = curve.length(bracket.b.u - bracket.a.u)
        point = singular_point(curve, u, width, reach_of(curve, bracket))
        if point is not None and meets(curve, point):
            more.append(described(curve, bracket, bracket.a, point))
            left -= point.corank
    count = abs(above[1] - above[0]) - sum(one.kind == "hopf" for one in found)
    if left > 0 and count > 0:
        point_ = pairs(curve, bracket, count)
        if point_.status == CONVERGED:
            left -= 2 * count
        more.append(point_)
    if left > 0 and not any(one.status == GUESS for one in more):
        more.append(_several(curve, bracket, left, u, hopf=above[0] != above[1]))
    return more


def _several(curve: Curve, bracket: Bracket, count: int, u: Array, *, hopf: bool) -> Special:
    """Eigenvalues that cross, and it is not known how: said, not refined."""
    kind = ("torus" if curve.discrete else "hopf") if hopf else "branch_point"
    return Special(
        kind, u, interval_of(curve, bracket),
        float(np.max(np.abs(curve.at(u)[0]))), GUESS,
        f"{count} eigenvalues cross together: a multiple point, which is not refined",
        tangent=bracket.a.tangent,
    )  # fmt: skip
