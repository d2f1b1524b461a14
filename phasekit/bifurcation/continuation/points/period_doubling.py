"""Period doublings of maps: a multiplier passes -1."""

from __future__ import annotations

import numpy as np

from phasekit.arrays import Array
from phasekit.bifurcation.continuation import normal_form as forms
from phasekit.bifurcation.continuation.curve import Curve
from phasekit.bifurcation.continuation.events import Bracket
from phasekit.bifurcation.continuation.path import Sample, bracket_root
from phasekit.bifurcation.continuation.points.path_test import PathTest
from phasekit.bifurcation.continuation.points.special import (
    CONVERGED,
    GUESS,
    Special,
    interval_of,
    reach_of,
    solved,
    tangent_at,
)
from phasekit.bifurcation.continuation.spectrum import eigenvalues_of, flip_function
from phasekit.bifurcation.continuation.units import force_sizes

DOUBLE = 1e-6  # distance from -1 of multipliers that are both -1: the root of rounding


def period_doubling(curve: Curve, bracket: Bracket) -> Special:
    """The point of a bracket at which 1 + mu changes its sign."""
    n, m, scale = curve.n, curve.m, curve.scale[: curve.n]

    def test(s: Sample) -> float:
        values = eigenvalues_of(curve.linear(s.slopes)[None], accuracy=curve.field.accuracy)
        return float(flip_function(values)[0])

    best, left, right = bracket_root(curve, bracket.a, bracket.b, test, steps=10, width=1e-4)
    v = np.linalg.svd((curve.linear(best.slopes) + np.eye(n)) * scale / scale[:, None])[2][-1]

    def system(z: Array) -> tuple[Array, Array]:
        """The equations f = 0, (A + 1) v = 0, |v| = 1, and their derivatives."""
        u, v = z[:m], z[m:]
        f, slopes = curve.evaluate(u)
        B, A = curve.bend(u, v), curve.linear(slopes) + np.eye(n)
        row = np.concatenate([np.zeros(m), 2.0 * v / scale**2])
        matrix = np.block([[slopes, np.zeros((n, n))], [B, A]])
        return np.concatenate([f, A @ v, [np.sum((v / scale) ** 2) - 1.0]]), np.vstack(
            [matrix, row]
        )

    sizes = np.concatenate([curve.scale[:m], scale])
    z, residual, message = solved(
        curve, system, np.concatenate([best.u[:m], v * scale]), sizes, reach_of(curve, bracket)
    )
    u = z[:m]
    if message:
        best, _, _ = bracket_root(curve, left, right, test, steps=60, width=1e-14)
        u = best.u
    form = {"c": np.nan} if message else normal_form(forms.Derivatives(curve, u))
    if not message:
        values = eigenvalues_of(
            curve.linear(curve.evaluate(u)[1])[None], accuracy=curve.field.accuracy
        )
        double = np.isnan(form["c"]) and np.sum(np.abs(values + 1.0) < DOUBLE) > 1
        note = "c not known: two multipliers are -1" if double else forms.unknown(form)
    return Special(
        "period_doubling", u, interval_of(curve, bracket), residual,
        GUESS if message else CONVERGED, message or note, form,
        tangent=tangent_at(curve, u, best.tangent), others=(z[m:],), extra=z[m:],
    )  # fmt: skip


def normal_form(d: forms.Derivatives) -> dict[str, float]:
    """Of a map next to a multiplier -1, xi -> -xi + c xi^3; c > 0: a stable orbit of period 2.

    With A q = -q, A^T p = -p, <p, q> = 1: c = <p, C(q, q, q)>/6 +
    <p, B(q, (1 - A)^-1 B(q, q))>/2 ([Kuznetsov2004] 5.4).
    """
    n = d.curve.n
    rows = force_sizes(d.curve, d.u)
    q, p = forms.null_vectors(d.curve.linear(d.slopes) + np.eye(n), d.curve.scale[:n], rows)
    bent = d.second(q, q)
    inverse = np.linalg.inv(-d.slopes[:, :n])
    fed = forms.fed(d, q, inverse @ bent.value, inverse, bent.error)
    terms = [(1.0 / 6.0) * d.third(q, q, q), 0.5 * fed]
    c = forms.real_part((terms[0] + terms[1]).dot(p), forms.unit_of(d, rows, p, q, 3))
    c = forms.signed(terms, p, c)
    # Where two multipliers are -1, `null_vectors` makes another product 1.
    return {"c": c if abs(float(p @ q) - 1.0) < 1e-9 else np.nan}


FLIP = PathTest("flip", lambda curve, bracket, known: [period_doubling(curve, bracket)])
