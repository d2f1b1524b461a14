"""From a bracket to its special points, and an account of every eigenvalue that crosses in it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import numpy.typing as npt

from phasekit.arrays import Array
from phasekit.bifurcation.continuation.curve import Curve
from phasekit.bifurcation.continuation.events import Bracket
from phasekit.bifurcation.continuation.points import (
    branch_point,
    fold,
    pair,
    period_doubling,
    torus,
)
from phasekit.bifurcation.continuation.points.branch_point import described, meets, singular_point
from phasekit.bifurcation.continuation.points.pair import pairs
from phasekit.bifurcation.continuation.points.path_test import PathTest
from phasekit.bifurcation.continuation.points.special import (
    CONVERGED,
    GUESS,
    Special,
    interval_of,
    reach_of,
)
from phasekit.bifurcation.continuation.spectrum import eigenvalues_of, on_axis, surely_complex
from phasekit.bifurcation.continuation.units import force_sizes
from phasekit.bifurcation.special_points import KINDS

FLAT = 1e-12  # a tangent's part along the parameter that is no more than rounding
SAME = 1e-6

#: What test functions along a path tell of, each beside what those before it have found.
TESTS: tuple[PathTest, ...] = (
    branch_point.CROSSING, fold.TURN, period_doubling.FLIP, torus.PAIR, pair.PAIR,
    branch_point.TOUCH,
)  # fmt: skip


def locate(curve: Curve, bracket: Bracket) -> list[Special]:
    """The special points of one bracket."""
    with np.errstate(all="ignore"):
        found = _locate(curve, bracket)
    n = curve.n
    ends = [abs(s.tangent[n]) / curve.scale[n] for s in (bracket.a, bracket.b)]
    values = [abs(s.u[n]) for s in (bracket.a, bracket.b)]
    moved = abs(bracket.a.u[n] - bracket.b.u[n])
    if max(ends) < FLAT:  # the parameter does not move: signs are those of rounding errors
        found = [one for one in found if one.status == CONVERGED and one.kind != "fold"]
    elif moved <= FLAT * max(values):  # nor beside where it is
        found = [one for one in found if one.status == CONVERGED or one.kind != "fold"]
    return found


def _locate(curve: Curve, bracket: Bracket) -> list[Special]:
    found: list[Special] = []
    for test in TESTS:
        found += test.found_in(curve, bracket, found)
    found = _merged(curve, found)
    explained = sum(_explained(one) for one in found)
    left = abs(bracket.jump) - explained
    if left > 0 and curve.discrete:
        kind = _crossing(curve, bracket, left)
        found.append(_several(curve, bracket, left, bracket.a.u, kind))
    elif left > 0:
        found += _together(curve, bracket, found, left)
    elif 2 * bracket.both > explained:  # some come where others go
        count = 2 * bracket.both - explained
        kind = "hopf" if bracket.both % 2 == 0 else "branch_point"
        if curve.discrete:
            kind = _crossing(curve, bracket, count)
        found.append(_several(curve, bracket, count, bracket.a.u, kind))
    return found


def _explained(point: Special) -> int:
    """How many eigenvalues may cross at a point."""
    return KINDS[point.kind].crossing or point.corank


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
                if _nullity(curve, other.u) > 1:
                    note = "two eigenvalues vanish here, with two eigenvectors"
                note = f"{other.message}; {note}" if other.message else note
                kept[near[0]] = replace(other, message=note)
                continue
        if one.kind in ("fold", "branch_point", "transcritical", "pitchfork") and any(
            kept[i].corank >= max(one.corank, 1) and kept[i].kind == "branch_point" for i in near
        ):
            continue
        kept.append(one)
    return kept


def _nullity(curve: Curve, u: npt.NDArray[np.float64]) -> int:
    """How many vectors f_x takes to zero, next to its sizes around."""
    n, m = curve.n, curve.m
    linear = curve.evaluate(u[:m])[1][:, :n] * curve.scale[:n]
    values = np.linalg.svd(linear / force_sizes(curve, u[:m])[:, None], compute_uv=False)
    return int(np.sum(values < SAME))


def _crossing(curve: Curve, bracket: Bracket, count: int) -> str:
    """The kind of point at which so many multipliers cross the unit circle together."""
    scale = curve.scale[: curve.n]
    outside = []
    for s in (bracket.a, bracket.b):
        A = curve.linear(s.slopes)
        values = eigenvalues_of(A[None], accuracy=curve.field.accuracy)[0]
        sure = surely_complex(A * scale / scale[:, None], values, curve.field.accuracy)
        sure &= ~(on_axis(curve, values) & bracket.neutral)
        outside.append(np.sum((values.imag > 0.0) & sure & (curve.growth(values) > 0.0)))
    if outside[0] != outside[1]:
        return "torus"
    near = np.argsort(np.abs(np.abs(values) - 1.0))[:count]
    if np.all(sure[near]):  # some come where others go
        return "torus"
    return "period_doubling" if np.all(values[near].real < 0.0) else "branch_point"


def _together(curve: Curve, bracket: Bracket, found: list[Special], left: int) -> list[Special]:
    """Eigenvalues that cross together, without a change of sign that would tell."""
    ends = [
        eigenvalues_of(s.slopes[None], accuracy=curve.field.accuracy)[0]
        for s in (bracket.a, bracket.b)
    ]
    real = [int(np.sum((v.imag == 0.0) & (v.real > 0.0))) for v in ends]
    stay = [on_axis(curve, v) & bracket.neutral for v in ends]
    above = [
        int(np.sum((v.imag > 0.0) & (v.real > 0.0) & ~on)) for v, on in zip(ends, stay, strict=True)
    ]
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
        kind = "hopf" if above[0] != above[1] else "branch_point"
        more.append(_several(curve, bracket, left, u, kind))
    return more


def _several(curve: Curve, bracket: Bracket, count: int, u: Array, kind: str) -> Special:
    """Eigenvalues that cross, and it is not known how: said, not refined."""
    return Special(
        kind, u, interval_of(curve, bracket),
        float(np.max(np.abs(curve.evaluate(u)[0]))), GUESS,
        f"{count} eigenvalues cross together: a multiple point, which is not refined",
        tangent=bracket.a.tangent,
    )  # fmt: skip
