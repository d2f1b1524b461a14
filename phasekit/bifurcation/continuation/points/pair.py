"""Hopf points and neutral saddles: two eigenvalues whose sum vanishes."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import numpy.typing as npt

from phasekit.arrays import Array
from phasekit.bifurcation.continuation import normal_form as forms
from phasekit.bifurcation.continuation.curve import Curve
from phasekit.bifurcation.continuation.events import Bracket
from phasekit.bifurcation.continuation.kernels.defining import HOPF
from phasekit.bifurcation.continuation.path import Sample, bracket_root
from phasekit.bifurcation.continuation.points.branch_point import described, meets, singular_point
from phasekit.bifurcation.continuation.points.path_test import PathTest
from phasekit.bifurcation.continuation.points.special import (
    CONVERGED,
    GUESS,
    Special,
    interval_of,
    is_between,
    polish,
    reach_of,
    tangent_at,
)
from phasekit.bifurcation.continuation.spectrum import (
    conjugate_function,
    eigenvalues_of,
    nearest_pair,
    pair_function,
)
from phasekit.bifurcation.continuation.units import force_sizes

SAME = 1e-6  # part by which frequencies of pairs that cross together differ by rounding
NEAR = 1e-4  # part of the pair function at both ends from which Newton's method goes on
SURE = 1e2  # times the error of a product from which on it is not 0
ON = 1e-6  # distance on scaled axes within which a point of larger corank is looked for


def pair(curve: Curve, bracket: Bracket, known: list[Special]) -> list[Special]:
    """The point of a bracket in which the pair function changes its sign.

    A Hopf point where the two eigenvalues are conjugate, a neutral saddle where they are real; a
    branch point, unless it is known, or a Bogdanov-Takens point where both vanish.
    """
    saddles = "neutral_saddle" in curve.detect
    function = pair_function if saddles else conjugate_function

    def test(s: Sample) -> float:
        return float(function(_values(curve, s.slopes)))

    best, left, right = bracket_root(
        curve, bracket.a, bracket.b, test, steps=10, width=1e-4, near=NEAR
    )
    u, extra, aux, residual, message = _refined(curve, bracket, best, saddles=saddles)
    if not (message or is_between(curve, bracket, u)):  # another one is next to it
        best, left, right = bracket_root(curve, left, right, test, steps=60, width=1e-7)
        near_by = replace(bracket, a=left, b=right)
        u, extra, aux, residual, message = _refined(curve, near_by, best, saddles=saddles)
    if message:
        best, left, right = bracket_root(curve, left, right, test, steps=60, width=1e-14)
        u = best.u
    near = max(ON, curve.length(right.u - left.u)) if message else ON
    point = singular_point(curve, u, near, max(10.0 * near, 1e-4), least=2)
    if point is not None and meets(curve, point):
        if any(curve.length(one.u - point.u) < ON and one.corank >= 2 for one in known):
            return []
        return [described(curve, bracket, best, point)]
    slopes = curve.evaluate(u)[1]
    values = _values(curve, slopes)
    i, j = nearest_pair(values, saddles=saddles)
    kappa = float((values[i] * values[j]).real)
    size = float(np.max(np.abs(values)))
    accuracy = curve.field.accuracy
    doubtful = _doubtful(curve, u, kappa, best.tangent)
    if doubtful and (message or not _apart(curve, bracket, u, (extra, aux), best.tangent)):
        double = Special(
            "bogdanov_takens", u, interval_of(curve, bracket), residual, GUESS,
            "two eigenvalues vanish together", tangent=tangent_at(curve, u, best.tangent), corank=1,
        )  # fmt: skip
        return [double]
    kind = "hopf" if values[i].imag != 0.0 else "neutral_saddle"
    if kind == "neutral_saddle" and not saddles:
        return []
    if not message and (extra[-1] > 0.0) != (kind == "hopf"):
        message = "the defining system led to another pair of eigenvalues"
    form: dict[str, float] = {}
    status, note = (GUESS if message else CONVERGED), message
    if message and abs(values[i] + values[j]) <= 1e2 * accuracy * size:
        # More pairs at once, or no crossing at all: then Newton's method is lost, bisection not.
        status, note = CONVERGED, "found by bisection: several pairs, or one that only touches"
    if kind == "hopf":
        omega = float(np.sqrt(extra[-1] if not message else kappa))
        form = {"l1": np.nan, "omega": omega, "d": np.nan}
        if not message:
            form = normal_form(forms.Derivatives(curve, u), omega)
            note = forms.unknown(form)
    found = Special(
        kind, u, interval_of(curve, bracket), residual, status, note, form,
        tangent=tangent_at(curve, u, best.tangent),
        extra=None if message else np.concatenate([extra, aux]),
    )  # fmt: skip
    return [found]


def pairs(curve: Curve, bracket: Bracket, count: int) -> Special:
    """A point at which several conjugate pairs cross the imaginary axis together.

    Pairs that stay on it, as those of a conserved energy, are none of them.
    """
    noise = 1e2 * curve.field.accuracy

    def nearest(s: Sample) -> npt.NDArray[np.complex128]:
        values = _values(curve, s.slopes)
        above = values[values.imag > 0.0]
        return np.asarray(above[np.argsort(np.abs(above.real))] / np.max(np.abs(values)))

    stay = min(int(np.sum(np.abs(nearest(s).real) <= noise)) for s in (bracket.a, bracket.b))

    def crossing(s: Sample) -> npt.NDArray[np.complex128]:
        return nearest(s)[stay : stay + count]

    def test(s: Sample) -> float:
        return float(np.sum(crossing(s).real))

    best, _, _ = bracket_root(curve, bracket.a, bracket.b, test, steps=60, width=1e-14)
    close = crossing(best)
    # Multiple eigenvalues are known to the root of rounding only; their mean is known better.
    sharp = len(close) == count and abs(np.mean(close.real)) <= noise
    omegas = np.sort(close.imag * np.max(np.abs(_values(curve, best.slopes))))
    words = "a pair of eigenvalues crosses" if count == 1 else f"{count} pairs of eigenvalues cross"
    message = f"{words} together" if count > 1 else f"{words} beside those that stay on the axis"
    alike = len(omegas) > 0 and np.ptp(omegas) <= SAME * omegas[-1]
    if len(omegas) and not alike:
        message += f", with the frequencies {', '.join(f'{one:.9g}' for one in omegas)}"
    if count > 1:
        message += ": switch(direction=...) follows one of their families, if these are isolated"
    omega = float(np.mean(omegas) if alike else np.min(omegas, initial=np.inf))
    return Special(
        "hopf", best.u, interval_of(curve, bracket),
        float(np.max(np.abs(curve.evaluate(best.u)[0]))),
        CONVERGED if sharp else GUESS, message,
        {"l1": np.nan, "omega": omega, "d": np.nan}, tangent=best.tangent,
    )  # fmt: skip


def _values(curve: Curve, slopes: Array) -> npt.NDArray[np.complex128]:
    return np.asarray(eigenvalues_of(slopes[None], accuracy=curve.field.accuracy)[0])


def _refined(
    curve: Curve, bracket: Bracket, best: Sample, *, saddles: bool
) -> tuple[Array, Array, Array, float, str]:
    """Newton's method on the defining system: unknowns, extra ones, l, residual, message."""
    n = curve.n
    scale = curve.scale[:n]
    A = best.slopes[:, :n]
    start = start_of(A, scale, saddles=saddles)
    extra, aux = plane_of(A, scale, start[:n] / scale, float(start[n]))
    if not (np.isfinite(extra).all() and np.isfinite(aux).all()):
        return best.u, extra, aux, np.inf, "the two eigenvalues have one eigenvector"
    u, extra, residual, message = polish(curve, HOPF, best.u, extra, reach_of(curve, bracket), aux)
    return u, extra, aux, residual, message


def start_of(A: Array, scale: Array, *, saddles: bool) -> Array:
    """A scaled unit vector of the plane of the two eigenvalues whose sum is least, and k."""
    values, vectors = np.linalg.eig(A)
    i, j = nearest_pair(values, saddles=saddles)
    q, r = vectors[:, i] / scale, vectors[:, j] / scale
    if values[i].imag != 0.0:
        v = q.real if np.linalg.norm(q.real) >= np.linalg.norm(q.imag) else q.imag
    else:
        v = q.real / np.linalg.norm(q.real) + r.real / np.linalg.norm(r.real)
    return np.append(v / np.linalg.norm(v) * scale, (values[i] * values[j]).real)


def plane_of(A: Array, scale: Array, v: Array, kappa: float) -> tuple[Array, Array]:
    """What the defining system of a pair adds: a scaled unit vector of its plane, k; and its l."""
    y = A @ (v * scale) / scale
    aux = y - np.dot(v, y) * v
    return np.append(v * scale, kappa), aux / np.linalg.norm(aux) / scale


def _doubtful(curve: Curve, u: Array, kappa: float, tangent: Array) -> bool:
    """Whether the product of the two eigenvalues is but what rounding of the unknowns makes it."""
    step = 1e2 * curve.field.accuracy * curve.length(tangent)
    changes = []
    for side in (step, -step):
        values = _values(curve, curve.evaluate(u + side * tangent[: curve.m])[1])
        # Of several pairs that cancel at once, the one that is meant.
        products = (values[:, None] * values)[np.triu_indices(len(values), 1)]
        changes.append(float(np.min(np.abs(products - kappa))))
    return abs(kappa) <= max(changes)


def _apart(
    curve: Curve, bracket: Bracket, u: Array, plane: tuple[Array, Array], tangent: Array
) -> bool:
    """Whether Newton's method, from either side, makes the same product, and more than its error.

    Where a parameter is nearly 0, or moves f fast, it is known better than beside its span.
    """
    extra, aux = plane
    step = ON * reach_of(curve, bracket) * tangent[: curve.m]
    found = [extra[-1]]
    for side in (step, -0.618 * step):
        more = extra.copy()
        more[-1] *= 1.0 + ON  # so that it is found anew
        _, again, _, message = polish(curve, HOPF, u + side, more, np.inf, aux)
        if message:
            return False
        found.append(again[-1])
    return bool(np.ptp(found) * SURE < np.min(np.abs(found)))


def normal_form(d: forms.Derivatives, omega: float) -> dict[str, float]:
    """First Lyapunov coefficient and frequency.

    With A q = i omega q, A^T p = -i omega p, <q, q> = 1, <p, q> = 1:
    l1 = Re[<p, C(q, q, q*)> - 2 <p, B(q, A^-1 B(q, q*))> + <p, B(q*, (2 i omega - A)^-1 B(q, q))>]
    / (2 omega) ([Kuznetsov2004] (5.62)).
    """
    n = d.curve.n
    A = d.slopes[:, :n]
    try:
        inverse = np.linalg.inv(A)
    except np.linalg.LinAlgError:  # zero is an eigenvalue, too: there l1 has a pole
        return {"l1": np.nan, "omega": float(omega), "d": np.nan}
    values, vectors = np.linalg.eig(A)
    q = vectors[:, np.argmin(np.abs(values - 1j * omega))]
    q = q / np.linalg.norm(q)
    values, vectors = np.linalg.eig(A.T)
    p = vectors[:, np.argmin(np.abs(values + 1j * omega))]
    p = p / np.conj(np.vdot(p, q))
    bar = np.conj(q)
    still, double = d.second(q, bar), d.second(q, q)
    matrix = 2j * omega * np.eye(n) - A
    second = forms.fed(d, q, np.linalg.solve(A, still.value.real), inverse, still.error)
    third = forms.fed(
        d, bar, np.linalg.solve(matrix, double.value), np.linalg.inv(matrix), double.error
    )
    terms = [one * (0.5 / omega) for one in (d.third(q, q, bar), -2.0 * second, third)]
    total = (terms[0] + terms[1] + terms[2]).dot(p)
    rows = force_sizes(d.curve, d.u)
    motion = forms.motion(d)
    length = float(np.max(np.abs(motion) / d.curve.scale[: n + 1]))
    return {
        "l1": forms.signed(
            terms, p, forms.real_part(total, forms.unit_of(d, rows, p, q, 3) / omega)
        ),
        "omega": float(omega),
        "d": forms.real_part(d.second(q, motion).dot(p), forms.unit_of(d, rows, p, q, 1) * length),
    }


PAIR = PathTest("pair", pair, discrete=False)
