"""Curves of special points and events in two parameters, and the special points on them."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from phasekit.arrays import Array
from phasekit.bifurcation.continuation.curve import Curve
from phasekit.bifurcation.continuation.derivatives import Derivatives
from phasekit.bifurcation.continuation.kernels.defining import BRANCH, EVENT, HOPF, TORUS
from phasekit.bifurcation.continuation.normal_form import zero_along
from phasekit.bifurcation.continuation.path import Path, Sample, between, bracket_root
from phasekit.bifurcation.continuation.points.curve_test import CurveTest
from phasekit.bifurcation.continuation.points.curve_tests import looked_for_on
from phasekit.bifurcation.continuation.points.special import (
    CONVERGED,
    GUESS,
    Placed,
    Special,
    extended,
    unique,
)
from phasekit.bifurcation.continuation.units import force_sizes

GOLDEN = 18  # halvings, nearly, of a step in which a test function may touch zero


def two_parameter_curve(curve: Curve, special: Special, kind: int) -> tuple[Curve, Sample] | None:
    """The curve through a special point with one more free parameter, and the point on it.

    ``curve`` has both parameters free, or three of branch points; None where the curve has no
    tangent there.
    """
    n, m = curve.n, curve.m
    extra, aux = np.zeros(0) if special.extra is None else special.extra, None
    if kind in (HOPF, TORUS):
        extra, aux = extra[: n + 1], extra[n + 1 :]
    u = np.concatenate([special.u[: n + 1], curve.par[list(curve.active[1:])], extra])
    made = curve.replace(kind=kind) if kind == EVENT else extended(curve, kind, u, extra, aux)
    # One unknown is held: a parameter for which the square system is regular; a state if there is
    # none, as at an event that a parameter alone decides.
    best = None
    for i in (*range(n + 1, m), n, *(range(n) if kind == EVENT else ())):
        row = np.zeros(made.size)
        row[i] = 1.0
        point = made.refine(u, row)
        if point.converged and made.length(point.u - u) < 1e-3:
            slopes = point.tangent
            if best is None or abs(slopes[i]) / made.scale[i] > best[0]:
                best = (abs(slopes[i]) / made.scale[i], point)
    if best is None:
        return None
    point = best[1]
    if kind == BRANCH and m == n + 2:
        # Points of this curve are branch points only where f itself vanishes, not f + b w.
        sizes = force_sizes(curve, u)
        most = 1e-6 / float(np.max(np.abs(point.u[m : m + n]) / sizes))
        if abs(point.tangent[-1]) > most * made.length(point.tangent):
            return None
        low, high = made.low.copy(), made.high.copy()
        low[-1], high[-1] = -most, most
        made = made.replace(low=low, high=high)
    t = point.tangent / made.length(point.tangent)
    lead = t[n + 1] if abs(t[n + 1]) > 1e-9 * made.scale[n + 1] else t[n]
    t = -t if lead < 0.0 else t
    return made, Sample(point.u, t, point.slopes[:, :m])


def find_on(curve: Curve, path: Path) -> tuple[list[Placed], tuple[str, ...]]:
    """Cusp, Bogdanov-Takens, zero-Hopf, generalized Hopf and double Hopf points of a curve.

    And, in words, what is zero all along it, whose zeros are no points.
    """
    found: list[Placed] = []
    messages: list[str] = []
    m = curve.m
    for test in looked_for_on(curve):
        values = test.along_path(curve, path.u, path.slopes[:], path.tangent)
        if _vanishes(values):
            messages.append(zero_along(test.coefficient, test.kind))
            continue
        for i in _interesting(values):
            for a, b in _changes(curve, path, values, i, test):
                special = _locate(curve, a, b, test)
                if special is not None:
                    chord = path.u[i + 1] - path.u[i]
                    ahead = (curve.weight * chord)[:m]
                    gap = np.dot(ahead, special.u - path.u[i, :m])
                    square = np.dot(ahead, chord[:m])
                    found.append(Placed(i, float(gap / square), special))
    kept = _without_echoes(curve, unique(curve, path, found))
    return [replace(one, special=_described(curve, one.special)) for one in kept], tuple(messages)


def _described(curve: Curve, special: Special) -> Special:
    """A point with its normal form, where it is known well enough to have one."""
    if special.status != CONVERGED:
        return special
    (form,) = {test.form for test in looked_for_on(curve) if test.kind == special.kind}
    found, words = form(Derivatives(curve, special.u))
    return replace(special, normal_form=found, message=words)


def _vanishes(values: Array) -> bool:
    """Whether a function is zero along more than half of the curve where it is known."""
    finite = values[np.isfinite(values)]
    return len(finite) > 2 and 2 * int(np.sum(finite == 0.0)) > len(finite)


def _interesting(values: Array) -> list[int]:
    """Intervals in which the sign changes, or whose neighbours on both sides are farther from 0."""
    sign, size = np.sign(values), np.abs(values)
    finite = np.isfinite(values)
    change = (sign[1:] != sign[:-1]) & finite[1:] & finite[:-1]
    before = np.append(np.inf, size[:-2])
    after = np.append(size[2:], np.inf)
    dip = (before > size[:-1]) & (after > size[1:]) & finite[1:] & finite[:-1]
    return [int(i) for i in np.flatnonzero(change | dip)]


def _changes(
    curve: Curve, path: Path, values: Array, i: int, test: CurveTest
) -> list[tuple[Sample, Sample]]:
    """Where a test function changes its sign from one point to the next, or dips to it between."""
    a, b = (Sample(path.u[k], path.tangent[k], path.slopes[k]) for k in (i, i + 1))
    if np.sign(values[i]) != np.sign(values[i + 1]):
        return [(a, b)]
    sign = np.sign(values[i])

    def height(s: float) -> float:
        sample = between(curve, a, b, s)
        return np.inf if sample is None else sign * test.value(curve, sample)

    # Golden section, to where the sign is another or the function is lowest.
    low, high = 0.0, 1.0
    ratio = 0.5 * (np.sqrt(5.0) - 1.0)
    one, two = 1.0 - ratio, ratio
    at_one, at_two = height(one), height(two)
    for _ in range(GOLDEN):
        if min(at_one, at_two) < 0.0:
            middle = between(curve, a, b, one if at_one < at_two else two)
            return [] if middle is None else [(a, middle), (middle, b)]
        if at_one < at_two:
            high, two, at_two = two, one, at_one
            one = high - ratio * (high - low)
            at_one = height(one)
        else:
            low, one, at_one = one, two, at_two
            two = low + ratio * (high - low)
            at_two = height(two)
    return []


def _locate(curve: Curve, a: Sample, b: Sample, test: CurveTest) -> Special | None:
    n = curve.n

    def criterion(s: Sample) -> float:
        return test.value(curve, s)

    best, _, _ = bracket_root(curve, a, b, criterion, steps=60, width=1e-15)
    value = abs(criterion(best))
    size = max(abs(criterion(a)), abs(criterion(b)))
    if not test.holds(curve, best):
        return None
    # A test function that jumps instead of passing zero is no point.
    if not (test.oriented or value <= 1e-3 * size):
        return None
    ends = float(min(a.u[n], b.u[n])), float(max(a.u[n], b.u[n]))
    residual = max(value, float(np.max(np.abs(curve.evaluate(best.u)[0]))))
    sharp = value <= max(1e-6, 1e2 * curve.field.accuracy) * size
    return Special(
        test.kind, best.u[: curve.m], ends, residual, CONVERGED if sharp else GUESS,
        "" if sharp else "the test function did not reach zero", tangent=best.tangent,
        extra=best.u[curve.m :],
    )  # fmt: skip


def _without_echoes(curve: Curve, placed: list[Placed]) -> list[Placed]:
    """Leave out what other test functions show of a Bogdanov-Takens point."""
    takens = [one.special.u for one in placed if one.special.kind == "bogdanov_takens"]
    kept = []
    for one in placed:
        near = any(_distance(curve, one.special.u, u) < 1e-5 for u in takens)
        if one.special.kind != "bogdanov_takens" and near:
            continue
        kept.append(one)
    return kept


def _distance(curve: Curve, a: Array, b: Array) -> float:
    m = curve.m
    return float(np.sqrt(np.sum(((a[:m] - b[:m]) / curve.scale[:m]) ** 2)))
