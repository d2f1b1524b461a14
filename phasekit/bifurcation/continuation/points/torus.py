"""Neimark-Sacker points of maps: a pair of multipliers passes the unit circle."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from phasekit.bifurcation.continuation import normal_form as forms
from phasekit.bifurcation.continuation.curve import Curve
from phasekit.bifurcation.continuation.events import Bracket
from phasekit.bifurcation.continuation.path import Sample, bracket_root
from phasekit.bifurcation.continuation.points.special import (
    CONVERGED,
    GUESS,
    Special,
    interval_of,
    reach_of,
    solved,
    tangent_at,
)
from phasekit.bifurcation.continuation.spectrum import eigenvalues_of, product_function

Array = npt.NDArray[np.float64]

RESONANT = 1e-6  # distance of a third or fourth power of a multiplier from 1


def torus(curve: Curve, bracket: Bracket) -> Special | None:
    """The point of a bracket at which mu_i mu_j - 1 of a pair vanishes; None of a real pair."""
    n, m, scale = curve.n, curve.m, curve.scale[: curve.n]

    def test(s: Sample) -> float:
        values = eigenvalues_of(curve.linear(s.slopes)[None], accuracy=curve.field.accuracy)
        return float(product_function(values)[0])

    best, left, right = bracket_root(curve, bracket.a, bracket.b, test, steps=10, width=1e-4)
    A = curve.linear(best.slopes) * scale / scale[:, None]
    values, vectors = np.linalg.eig(A)
    above = np.flatnonzero(values.imag > 0.0)
    near = above[np.argsort(np.abs(np.abs(values[above]) - 1.0))]
    if not len(near) or abs(abs(values[near[0]]) ** 2 - 1.0) > 2.0 * abs(test(best)) + 1e-9:
        return None
    mu, q = values[near[0]], vectors[:, near[0]]
    v = q.real / np.linalg.norm(q.real)
    l_row = A @ v - np.dot(v, A @ v) * v
    l_row = l_row / np.linalg.norm(l_row) / scale

    def system(z: Array) -> tuple[Array, Array]:
        """The equations f = 0, (A^2 - 2 k A + 1) v = 0, |v| = 1, l.v = 0, and derivatives."""
        u, v, k = z[:m], z[m : m + n], z[-1]
        f, slopes = curve.at(u)
        A = curve.linear(slopes)
        along = curve.bend(u, v)
        bent = A @ along + curve.bend(u, A @ v) - 2.0 * k * along
        square = A @ A - 2.0 * k * A + np.eye(n)
        zeros = np.zeros(m)
        matrix = np.vstack([
            np.hstack([slopes, np.zeros((n, n + 1))]),
            np.hstack([bent, square, (-2.0 * A @ v)[:, None]]),
            np.concatenate([zeros, 2.0 * v / scale**2, [0.0]]),
            np.concatenate([zeros, l_row, [0.0]]),
        ])  # fmt: skip
        rest = [np.sum((v / scale) ** 2) - 1.0, l_row @ v]
        return np.concatenate([f, square @ v, rest]), matrix

    start = np.concatenate([best.u[:m], v * scale, [mu.real / abs(mu)]])
    sizes = np.concatenate([curve.scale[:m], scale, [1.0]])
    z, residual, message = solved(curve, system, start, sizes, reach_of(curve, bracket))
    if not message and not abs(z[-1]) < 1.0:
        message = "the defining system led to a real pair"
    u = z[:m]
    if message:
        best, _, _ = bracket_root(curve, left, right, test, steps=60, width=1e-14)
        u = best.u
    angle = float(np.angle(mu)) if message else float(np.arccos(z[-1]))
    form, note = {"d": np.nan, "angle": angle}, message
    extra = None
    if not message:
        form, note = _normal_form(curve, u, angle)
        extra = np.concatenate([z[m:-1], [2.0 - 2.0 * z[-1]], l_row])
    return Special(
        "torus", u, interval_of(curve, bracket), residual, GUESS if message else CONVERGED, note,
        form, tangent=tangent_at(curve, u, best.tangent), extra=extra,
    )  # fmt: skip


def _normal_form(curve: Curve, u: Array, angle: float) -> tuple[dict[str, float], str]:
    """The normal form; of a strong resonance, of which it says nothing, a note."""
    for k, word in ((3, "a third"), (4, "a quarter")):
        if abs(np.exp(1j * k * angle) - 1.0) < RESONANT:
            form = {"d": np.nan, "angle": angle}
            return form, f"d not known: the angle is {word} of a turn, a strong resonance"
    form = forms.torus(forms.Derivatives(curve, u), angle)
    return form, forms.unknown(form)
