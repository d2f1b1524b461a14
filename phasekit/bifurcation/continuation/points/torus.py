"""Neimark-Sacker points of maps: a pair of multipliers passes the unit circle."""

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
from phasekit.bifurcation.continuation.spectrum import (
    eigenvalues_of,
    product_function,
    surely_complex,
)
from phasekit.bifurcation.continuation.units import force_sizes

RESONANT = 1e-6  # distance of a third or fourth power of a multiplier from 1


def torus(curve: Curve, bracket: Bracket, known: list[Special]) -> list[Special]:
    """The point of a bracket at which mu_i mu_j - 1 of a pair vanishes; none of a real pair."""
    n, m, scale = curve.n, curve.m, curve.scale[: curve.n]

    def test(s: Sample) -> float:
        values = eigenvalues_of(curve.linear(s.slopes)[None], accuracy=curve.field.accuracy)
        return float(product_function(values)[0])

    best, left, right = bracket_root(curve, bracket.a, bracket.b, test, steps=10, width=1e-4)
    A = curve.linear(best.slopes) * scale / scale[:, None]
    values, vectors = np.linalg.eig(A)
    sure = surely_complex(A, values, curve.field.accuracy)
    above = np.flatnonzero((values.imag > 0.0) & sure)
    near = above[np.argsort(np.abs(np.abs(values[above]) - 1.0))]
    if not len(near) or abs(abs(values[near[0]]) ** 2 - 1.0) > 2.0 * abs(test(best)) + 1e-9:
        return []
    mu, q = values[near[0]], vectors[:, near[0]]
    v = q.real / np.linalg.norm(q.real)
    l_row = A @ v - np.dot(v, A @ v) * v
    l_row = l_row / np.linalg.norm(l_row) / scale

    def system(z: Array) -> tuple[Array, Array]:
        """The equations f = 0, (A^2 - 2 k A + 1) v = 0, |v| = 1, l.v = 0, and derivatives."""
        u, v, k = z[:m], z[m : m + n], z[-1]
        f, slopes = curve.evaluate(u)
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
        form, note = _described(curve, u, angle)
        extra = np.concatenate([z[m:-1], [2.0 - 2.0 * z[-1]], l_row])
    point = Special(
        "torus", u, interval_of(curve, bracket), residual, GUESS if message else CONVERGED, note,
        form, tangent=tangent_at(curve, u, best.tangent), extra=extra,
    )  # fmt: skip
    return [point]


def _described(curve: Curve, u: Array, angle: float) -> tuple[dict[str, float], str]:
    """The normal form; of a strong resonance, of which it says nothing, a note."""
    for k, word in ((3, "a third"), (4, "a quarter")):
        if abs(np.exp(1j * k * angle) - 1.0) < RESONANT:
            form = {"d": np.nan, "angle": angle}
            return form, f"d not known: the angle is {word} of a turn, a strong resonance"
    form = normal_form(forms.Derivatives(curve, u), angle)
    return form, forms.unknown(form)


def normal_form(d: forms.Derivatives, angle: float) -> dict[str, float]:
    """Of a map next to multipliers exp(+-i angle): |xi| -> |xi| + d |xi|^3; d < 0: supercritical.

    With A q = e^(i angle) q, A^T p = e^(-i angle) p, <q, q> = <p, q> = 1:
    d = Re{e^(-i angle) [<p, C(q, q, q*)> + 2 <p, B(q, (1 - A)^-1 B(q, q*))> +
    <p, B(q*, (e^(2 i angle) - A)^-1 B(q, q))>]}/2 ([Kuznetsov2004] 5.4).
    """
    n = d.curve.n
    A, turn = d.curve.linear(d.slopes), np.exp(1j * angle)
    values, vectors = np.linalg.eig(A)
    q = vectors[:, np.argmin(np.abs(values - turn))]
    q = q / np.linalg.norm(q)
    values, vectors = np.linalg.eig(A.T)
    p = vectors[:, np.argmin(np.abs(values - np.conj(turn)))]
    p = p / np.conj(np.vdot(p, q))
    bar = np.conj(q)
    still, double = d.second(q, bar), d.second(q, q)
    back, twice = np.linalg.inv(np.eye(n) - A), np.linalg.inv(turn**2 * np.eye(n) - A)
    second = forms.fed(d, q, (back @ still.value).real, back, still.error)
    third = forms.fed(d, bar, twice @ double.value, twice, double.error)
    terms = [one * (0.5 * np.conj(turn)) for one in (d.third(q, q, bar), 2.0 * second, third)]
    unit = forms.unit_of(d, force_sizes(d.curve, d.u), p, q, 3)
    total = forms.real_part((terms[0] + terms[1] + terms[2]).dot(p), unit)
    return {"d": forms.signed(terms, p, total), "angle": float(angle)}


PAIR = PathTest("pair", torus, discrete=True)
