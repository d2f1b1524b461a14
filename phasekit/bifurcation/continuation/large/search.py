"""Special points on a path of many states: where signs change, one point each."""

from __future__ import annotations

import functools
import itertools
from dataclasses import replace

import numpy as np

from phasekit.arrays import Array
from phasekit.bifurcation.continuation.large.curve import LargeCurve
from phasekit.bifurcation.continuation.large.hopf import Part, hopf_point
from phasekit.bifurcation.continuation.large.inertia import (
    parts_by_vectors,
    positive_of_full,
    suspects,
)
from phasekit.bifurcation.continuation.large.multiple import multiple_instead, multiple_point
from phasekit.bifurcation.continuation.large.path import Between, LargePath
from phasekit.bifurcation.continuation.large.returning import parts_with_returns
from phasekit.bifurcation.continuation.large.singular import branch_point, fold
from phasekit.bifurcation.continuation.locate import FLAT
from phasekit.bifurcation.continuation.points.special import Placed, Special
from phasekit.numerics.crossings import crossings
from phasekit.numerics.rightmost import FULL, Spectrum, spectrum_at
from phasekit.numerics.waits import stage

ALONG, SIDE, POSITIVE = range(3)


def find(curve: LargeCurve, path: LargePath) -> tuple[LargePath, list[Placed], tuple[str, ...]]:
    """A path that knows how many eigenvalues grow, its special points, and what is not certain."""
    detect = curve.detect
    if not detect:
        return path, [], ()
    with np.errstate(all="ignore"):
        return _find(curve, path, detect)


def _find(
    curve: LargeCurve, path: LargePath, detect: tuple[str, ...]
) -> tuple[LargePath, list[Placed], tuple[str, ...]]:
    tests = path.tests
    unknown = np.isfinite(tests[:, SIDE]) & (tests[:, POSITIVE] < 0.0)
    if curve.symmetric and unknown.any() and curve.n > FULL and not curve.sparse.differenced:
        tests = tests.copy()
        path = replace(path, tests=tests)
        for k in np.flatnonzero(unknown).tolist():
            u = path.u[k]
            matrix = curve.sparse.matrix(u[: curve.n].copy(), curve.parameters_at(u))
            tests[k, POSITIVE] = positive_of_full(matrix)
            if tests[k, POSITIVE] < 0.0:
                break
    lost = bool(np.any(np.isfinite(tests[:, SIDE]) & (tests[:, POSITIVE] < 0.0)))
    looks = curve.n <= FULL or (lost and "hopf" in detect)
    if lost and looks:
        tests = tests.copy()
        path = replace(path, tests=tests)

    eigenvalues = functools.partial(spectrum_at, scale=curve.scale[: curve.n])

    @functools.lru_cache(maxsize=4)
    def spectrum(k: int) -> Spectrum:
        """The eigenvalues at a point of the path, which say how many grow there."""
        stage(f"eigenvalues of {k:,} of {path.count:,} points")
        found = eigenvalues(curve.derivatives(path.u[k])[0])
        if lost:
            tests[k, POSITIVE] = found.positive
        return found

    placed: list[Placed] = []
    messages: list[str] = []
    rest: list[tuple[int, str]] = []  # of zeros that cross, those that are not found, and where
    if "neutral_saddle" in detect:
        messages.append("neutral saddles are not looked for, of fields of states")
    stage(f"looking for special points on {path.count:,} points")
    own = np.flatnonzero(np.isfinite(tests[:, SIDE]))  # on a branch point it starts at nothing is
    hidden: set[int] = set()
    if curve.symmetric and not looks and not lost and len(own) > 1:
        hidden = set(suspects(curve, path.u[own], tests[own, POSITIVE]))
    along = np.cumsum([0.0, *(curve.length(step) for step in np.diff(path.u[own], axis=0))])
    for k, (i, j) in enumerate(itertools.pairwise(own.tolist())):
        ends = (spectrum(i), spectrum(j)) if looks else ()
        a, b = tests[i], tests[j]
        known = min(a[POSITIVE], b[POSITIVE]) >= 0
        zeros = int(abs(b[POSITIVE] - a[POSITIVE])) if known else 0
        chord, parts = Between(curve, path.u[i], path.u[j]), []
        together = _together(curve, chord, ends, zeros) if known else None
        if together is not None:
            zeros = together.corank
        elif ends and known:
            # Where the start of a branch at a branch point was, an eigenvalue touches zero.
            beside = range(max(k - 1, 0), min(k + 3, len(own))) if j == i + 1 else range(k, k + 2)
            values = [(float(along[one]), spectrum(int(own[one])).values) for one in beside]
            parts = list(parts_with_returns(chord, values, k - beside[0], ends, eigenvalues))
            zeros = sum(part.crossing.real for part in parts)
        if k in hidden:
            stage(f"counting eigenvalues between points {i:,} and {j:,}")
            parts = parts_by_vectors(curve, chord)
            zeros = max(zeros, sum(part.crossing.real for part in parts))
        found = _zeros(curve, path, i, j) if together is None else [together]
        several = [part for part in parts if part.crossing.real] if zeros > 1 else []
        if len(several) > 1 and together is None:
            found = [one for part in several for one in _zero_in(curve, chord, part)]
        left = zeros - sum(one.corank for one in found)
        if "hopf" in detect:
            found += [hopf_point(curve, chord, one) for one in parts if one.crossing.pairs]
        at = f"{curve.free} between {path.u[i, curve.n]:.9g} and {path.u[j, curve.n]:.9g}"
        rest.append((left, at))
        if any(one.crossing.unclear for one in parts):
            messages.append(f"eigenvalues may cross the axis unseen at {at}: they change too fast")
        for one in found:
            if j > i + 1:  # it is the start itself
                placed.append(Placed(i, 1.0, one))
            else:
                placed.append(placement(curve, path, i, one))
    messages += _unfound(rest)
    if looks:
        missing = sum(not spectrum(k).complete for k in np.flatnonzero(np.isnan(tests[:, SIDE])))
        missing += int(np.sum(tests[own, POSITIVE] < 0.0))
    if lost and not looks:
        messages.insert(
            0, f"at {int(np.sum(tests[own, POSITIVE] < 0.0))} of {path.count} points n_unstable is "
            "-1: without 'hopf' in detect no eigenvalues are computed where pivots do not count "
            "them, and zeros that cross together are not told apart",
        )  # fmt: skip
    if looks and missing:
        messages.insert(
            0, f"at {missing} of {path.count} points not all eigenvalues right of the axis are "
            "known: n_unstable is -1 there, and Hopf points next to them may be missing",
        )  # fmt: skip
    placed.sort(key=lambda one: (one.index, one.along))
    return path, placed, tuple(messages)


def _unfound(rest: list[tuple[int, str]]) -> list[str]:
    """What is said of zeros that cross and are not found.

    One that was found where none crosses is that of the next step: it is on a point, but for
    rounding.
    """
    counts = [count for count, _ in rest]
    for k, j in itertools.product(range(len(counts)), (-1, 1)):
        if 0 <= k + j < len(counts) and counts[k] < 0 < counts[k + j]:
            same = min(-counts[k], counts[k + j])
            counts[k], counts[k + j] = counts[k] + same, counts[k + j] - same
    return [
        f"{count} more eigenvalues cross zero in one step, {at}: not refined"
        for count, (_, at) in zip(counts, rest, strict=True) if count > 0
    ]  # fmt: skip


def _zeros(curve: LargeCurve, path: LargePath, i: int, j: int) -> list[Special]:
    """The fold or branch point between two points of a path."""
    a, b = path.tests[i], path.tests[j]
    crosses, turns = a[SIDE] * b[SIDE] < 0.0, a[ALONG] * b[ALONG] <= 0.0 and a[ALONG] != 0.0
    if crosses and "branch_point" in curve.detect:
        return [_branch_point(curve, path.u[i], path.u[j])]
    if turns and not crosses and "fold" in curve.detect and _moves(curve, path, i, j):
        return [fold(curve, path.u[i], path.u[j])]
    return []


def _zero_in(curve: LargeCurve, chord: Between, part: Part) -> list[Special]:
    """The same in a part of a chord, if one eigenvalue vanishes there."""
    ends = [chord.point(s) for s in (part.low, part.high)]
    if part.crossing.real != 1 or ends[0] is None or ends[1] is None:
        return []
    sides = [
        curve.bordered(one.matrix, one.slope, curve.weight * one.tangent).sign
        for one in ends if one is not None
    ]  # fmt: skip
    if sides[0] * sides[1] < 0.0:
        return [_branch_point(curve, ends[0].u, ends[1].u)] * ("branch_point" in curve.detect)
    if ends[0].tangent[curve.n] * ends[1].tangent[curve.n] < 0.0 and "fold" in curve.detect:
        return [fold(curve, ends[0].u, ends[1].u)]
    return []


def _branch_point(curve: LargeCurve, a: Array, b: Array) -> Special:
    """The branch point between two points, whatever else vanishes there."""
    one = branch_point(curve, a, b)
    return multiple_instead(curve, Between(curve, a, b), one.u) or one


def _together(
    curve: LargeCurve, chord: Between, ends: tuple[Spectrum, ...], count: int
) -> Special | None:
    """The point at which several eigenvalues vanish, all that cross in a step; None: none is."""
    if ends:
        if abs(ends[0].real - ends[1].real) < 2:
            return None
        crossing = crossings(*ends)
        count = 0 if crossing.pairs or crossing.unclear else crossing.real
    if count < 2 or "branch_point" not in curve.detect:
        return None
    return multiple_point(curve, chord, count)


def _moves(curve: LargeCurve, path: LargePath, i: int, j: int) -> bool:
    """Whether the parameter moves between two points by more than rounding."""
    ends = path.u[[i, j], curve.n]
    along = np.max(np.abs(path.tests[[i, j], ALONG]))
    return bool(along >= FLAT and np.ptp(ends) > FLAT * np.max(np.abs(ends)))


def placement(curve: LargeCurve, path: LargePath, i: int, special: Special) -> Placed:
    """Where between two points of the path a special point stands."""
    chord, gap = path.u[i + 1] - path.u[i], special.u - path.u[i]
    square = float(curve.weight @ chord**2)
    return Placed(i, float(curve.weight @ (chord * gap)) / square if square else 0.0, special)
