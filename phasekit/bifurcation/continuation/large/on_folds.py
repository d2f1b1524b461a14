"""Cusps and Bogdanov-Takens points along a curve of folds of many states.

With the null vectors v and w of f_x, w.f_xx(v, v) vanishes at a cusp and w.v at a Bogdanov-Takens
point ([Kuznetsov2004] 8.2 and 8.4); both follow from one factorisation of f_x.
"""

from __future__ import annotations

import itertools

import numpy as np

from phasekit.arrays import Array
from phasekit.bifurcation.continuation.large.curve import LargeCurve
from phasekit.bifurcation.continuation.large.extended import PointField
from phasekit.bifurcation.continuation.large.path import Between, LargePath
from phasekit.bifurcation.continuation.large.search import placement
from phasekit.bifurcation.continuation.large.singular import (
    Border,
    border_at,
    guess_between,
    interval_of,
    root_of,
)
from phasekit.bifurcation.continuation.points.special import CONVERGED, Placed, Special

KINDS = ("cusp", "bogdanov_takens")
LOST = "no point was found at a point of the path"


def tests_at(curve: LargeCurve, u: Array, near: Array | None) -> tuple[Array, Border]:
    """What vanishes at a cusp and at a Bogdanov-Takens point, and null vectors like those near."""
    field = curve.sparse
    assert isinstance(field, PointField)
    field.prepare(curve.scale)
    x, p, (v,) = field.parts_of(u[: curve.n], curve.parameters_at(u))
    v = v / np.linalg.norm(v)
    matrix = field.field.matrix(x, p)
    border = border_at(matrix) if near is None else Border.next_to(matrix, near, v, 2)
    w = border.left / np.linalg.norm(border.left)
    w = w if near is None or w @ near >= 0.0 else -w
    tests = np.array([w @ (field.bent(x, p, v) @ v), w @ v])
    return tests, Border(border.system, v, w, border.defect)


def points_on_folds(curve: LargeCurve, path: LargePath) -> list[Placed]:
    """Cusps and Bogdanov-Takens points of a path of folds."""
    if not curve.detect:
        return []
    found, lefts, near = [], [], None
    for u in path.u:
        tests, border = tests_at(curve, u, near)
        near = border.left
        found.append(tests)
        lefts.append(near)
    placed = []
    for k in range(len(KINDS)):
        signs = np.sign([tests[k] for tests in found])
        for i, j in itertools.pairwise(range(path.count)):
            exact = None  # the end of the two that is one, to the last digit
            if signs[j] == 0.0 != signs[i]:
                exact = 1.0
            elif i == 0 and signs[0] == 0.0 != signs[1]:
                exact = 0.0
            if exact is not None or signs[i] * signs[j] < 0.0:
                special = _located(curve, path.u[i], path.u[j], lefts[i], k, exact)
                placed.append(placement(curve, path, i, special))
    return sorted(placed, key=lambda one: (one.index, one.along))


def _located(
    curve: LargeCurve, a: Array, b: Array, near: Array, k: int, exact: float | None = None
) -> Special:
    """The point between two at which a test vanishes, of vectors alike; a guess if none does."""
    chord = Between(curve, a, b)

    def test(s: float) -> float:
        point = chord.point(s)
        return np.nan if point is None else float(tests_at(curve, point.u, near)[0][k])

    point, message = root_of(chord, test, 1e-12) if exact is None else (chord.point(exact), LOST)
    if point is None:
        return guess_between(curve, KINDS[k], a, b, message)
    residual = float(np.max(np.abs(curve.value(point.u))))
    form = _cubic(curve, point.u, near) if KINDS[k] == "cusp" else {}
    return Special(
        KINDS[k], point.u, interval_of(curve, a, b), residual, CONVERGED, "", form,
        tangent=point.tangent, corank=1,
    )  # fmt: skip


def _cubic(curve: LargeCurve, u: Array, near: Array) -> dict[str, float]:
    """The coefficient c of xi' = c xi^3 at a cusp, on a null vector of length one."""
    _, border = tests_at(curve, u, near)
    field = curve.sparse
    assert isinstance(field, PointField)
    x, p, _ = field.parts_of(u[: curve.n], curve.parameters_at(u))
    v, w = border.right, border.left
    bent = field.bent(x, p, v)
    slaved = border.system.solve(np.append(bent @ v, 0.0))[: len(v)]
    cubic = field.bent(x, p, v, twice=True) @ v - 3.0 * (bent @ slaved)
    return {"c": float(w @ cubic / (6.0 * (w @ v)))}
