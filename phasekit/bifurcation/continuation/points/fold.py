"""Folds: the parameter turns back, and one real eigenvalue vanishes."""

from __future__ import annotations

import numpy as np

from phasekit.arrays import Array
from phasekit.bifurcation.continuation import normal_form as forms
from phasekit.bifurcation.continuation.curve import Curve
from phasekit.bifurcation.continuation.events import Bracket
from phasekit.bifurcation.continuation.kernels.defining import FOLD
from phasekit.bifurcation.continuation.path import Sample, bracket_root
from phasekit.bifurcation.continuation.points.branch_point import (
    described,
    is_vertical,
    meets,
    singular_point,
)
from phasekit.bifurcation.continuation.points.path_test import PathTest
from phasekit.bifurcation.continuation.points.special import (
    CONVERGED,
    GUESS,
    Special,
    interval_of,
    polish,
    reach_of,
    tangent_at,
)
from phasekit.bifurcation.continuation.units import force_sizes

ON = 1e-7  # distance on scaled axes from a point of larger corank that is none


def fold(curve: Curve, bracket: Bracket) -> Special:
    """The fold of a bracket in which the tangent's part along the parameter changes its sign.

    Where branches meet there, a branch point: the parameter may turn back on one of them.
    """
    n = curve.n

    def test(s: Sample) -> float:
        return float(s.tangent[n])

    best, left, right = bracket_root(curve, bracket.a, bracket.b, test, steps=10, width=1e-4)
    reach = reach_of(curve, bracket)
    # Where the parameter stands still, the tangent is the null vector.
    v = best.tangent[:n] / np.linalg.norm(best.tangent[:n] / curve.scale[:n])
    u, v, residual, message = polish(curve, FOLD, best.u, v, reach)
    if not message and not _turns(curve, u, v):
        message = "Newton's method on the defining system did not converge"
    width = max(curve.length(right.u - left.u), 1e-4) if message else ON
    point = singular_point(curve, 0.5 * (left.u + right.u) if message else u, width, reach)
    if point is not None and meets(curve, point):
        return described(curve, bracket, best, point)
    if message:
        best, _, _ = bracket_root(curve, left, right, test, steps=60, width=1e-14)
        u = best.u
    form = normal_form(forms.Derivatives(curve, u))
    return Special(
        "fold", u, interval_of(curve, bracket), residual, GUESS if message else CONVERGED,
        message or forms.unknown(form), form, tangent=tangent_at(curve, u, best.tangent),
        extra=v, corank=1,
    )  # fmt: skip


def _turns(curve: Curve, u: Array, v: Array) -> bool:
    """Whether the eigenvalue vanishes at the point itself, by how fast it changes along v."""
    n = curve.n
    rows, scale = force_sizes(curve, u), curve.scale[:n]
    left, _, _ = np.linalg.svd(curve.evaluate(u)[1][:, :n] * scale / rows[:, None])
    w = left[:, -1] / rows
    rest = abs(w @ curve.evaluate(u)[1][:, :n] @ v)
    rate = abs(w @ curve.bend(u, v)[:, :n] @ v)
    return bool(rest <= 1e-8 * rate + 1e2 * curve.field.accuracy)


def normal_form(d: forms.Derivatives) -> dict[str, float]:
    """Xi' = b (p - p0) + a xi^2 on the center manifold."""
    n = d.curve.n
    rows = force_sizes(d.curve, d.u)
    q, p = forms.null_vectors(d.slopes[:, :n], d.curve.scale[:n], rows)
    unit = forms.unit_of(d, rows, p, q, 2)
    return {
        "a": forms.real_part(d.second(q, q).dot(p) * 0.5, unit),
        "b": float(p @ d.slopes[:, n]),
    }


def turn(curve: Curve, bracket: Bracket, known: list[Special]) -> list[Special]:
    """The fold of a bracket, unless the path is a pitchfork's side branch, which turns there."""
    if any(is_vertical(curve, one.u, one.tangent) for one in known if one.tangent is not None):
        return []
    return [fold(curve, bracket)]


TURN = PathTest("fold", turn)
