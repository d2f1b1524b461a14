"""Branch points: located, refined and told apart by their corank and their branches."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from phasekit.arrays import Array
from phasekit.bifurcation.continuation import normal_form as forms
from phasekit.bifurcation.continuation.curve import Curve
from phasekit.bifurcation.continuation.events import Bracket
from phasekit.bifurcation.continuation.path import Sample, between, bracket_root
from phasekit.bifurcation.continuation.points.directions import Directions, directions, rays_around
from phasekit.bifurcation.continuation.points.path_test import PathTest
from phasekit.bifurcation.continuation.points.singular import Singular, candidates, refine
from phasekit.bifurcation.continuation.points.special import (
    CONVERGED,
    GUESS,
    Special,
    interval_of,
    reach_of,
)
from phasekit.bifurcation.continuation.spectrum import orientation
from phasekit.bifurcation.continuation.units import accuracy_of, force_sizes, scale_at

# A tangent whose part along the parameter is less, on scaled axes, does not move it: by formulas'
# derivatives, and by differences.
VERTICAL, ROUGH = 1e-9, 1e-5
BESIDE = 1e-5  # distance on scaled axes
#: Parts of a bracket beside a point at which a determinant may touch zero, where it is taken.
BESIDES = (1e-2, 1e-3, 1e-3)
NOTHING = 1e-7  # its lowest value in units of that so far from it that is zero, by rounding
MISSED = "no point where f_u is singular was found by Newton's method"
TOUCHES = (
    "the determinant of f_u and the tangent touches zero to rounding and keeps its sign: a double "
    "point, or two that are closer than can be told"
)
NARROW = 1e-3  # part of a bracket to which a change of sign is narrowed before it is refined


def branch_point(curve: Curve, bracket: Bracket) -> Special:
    """The branch point of a bracket in which the determinant of f_u and the tangent changes."""
    test = determinant_test(curve, bracket)
    best, left, right = bracket_root(curve, bracket.a, bracket.b, test, steps=10, width=NARROW)
    if test(bracket.a) * test(bracket.b) < 0.0:
        middle, width = 0.5 * (left.u + right.u), curve.length(right.u - left.u)
    else:  # the end of the path lies on it
        middle, width = best.u, 1e-6
    point = singular_point(curve, middle, width, reach_of(curve, bracket))
    if point is None:
        best, _, _ = bracket_root(curve, left, right, test, steps=60, width=1e-14)
        return _degenerate(curve, bracket, best)
    return described(curve, bracket, best, point)


def determinant_test(curve: Curve, bracket: Bracket) -> Callable[[Sample], float]:
    """The determinant of f_u and the tangent, in units of its larger value at the ends."""
    ends = [orientation(curve, s.tangent, s.slopes)[1] for s in (bracket.a, bracket.b)]
    unit = np.max(ends)

    def test(s: Sample) -> float:
        sign, log = orientation(curve, s.tangent, s.slopes)
        return float(sign * np.exp(np.minimum(log - unit, 50.0)))

    return test


def singular_point(
    curve: Curve, u: Array, width: float, reach: float, least: int = 1
) -> Singular | None:
    """The point of the largest corank next to a point that is known within a width."""
    most = candidates(curve, u, width)
    for k in range(min(max(most, least), curve.n), least - 1, -1):
        point = refine(curve, u, k, reach)
        if point is not None:
            break
    else:
        return None
    # Next to a point of larger corank those of smaller corank look the same.
    for k in range(candidates(curve, point.u, BESIDE), point.corank, -1):
        larger = refine(curve, point.u, k, 1e2 * BESIDE)
        if larger is not None:
            return larger
    return point


def meets(curve: Curve, point: Singular) -> bool:
    """Whether f itself vanishes where f_u loses rank."""
    return float(np.max(np.abs(point.offset))) <= 1e3 * accuracy_of(curve)


def described(curve: Curve, bracket: Bracket, best: Sample, point: Singular) -> Special:
    """A refined point with its kind, its branches and its normal form."""
    message = ""
    if not meets(curve, point):
        message = "the equilibria nearby do not meet: f differs from zero where f_u is singular"
    u = best.u if message else point.u
    chord = bracket.b.u - bracket.a.u
    chord = chord / curve.length(chord)
    found = Directions([], False) if message else directions(curve, point)
    own, others = _own(curve, found.tangents, chord)
    kind, form, turns = "branch_point", {}, ""
    extra: Array | None = None
    corank = point.corank
    if corank == 1:
        w = point.left[:, 0] / point.rows
        extra = np.append(w, point.offset[0])
        if len(others) == 1 and own is not None and not found.message:
            steep = [is_vertical(curve, u, t) for t in (own, others[0])]
            if all(steep):
                turns = "both branches turn back here: a fold of each"
            else:
                kind = "pitchfork" if any(steep) else "transcritical"
                moving = others[0] if steep[0] else own
                form = normal_form(
                    forms.Derivatives(curve, u), moving, pitchfork=kind == "pitchfork"
                )
                if _stands(curve, moving):  # beside it terms of the coefficients cancel
                    form = dict.fromkeys(form, np.nan)
    note = message or found.message or turns or forms.unknown(form)
    if kind == "transcritical" and np.isnan(form["a"]):
        kind, note = "branch_point", f"transcritical or a pitchfork: {note}"
    if len(others) > 1 and corank == 1:
        note = f"{len(others) + 1} branches meet"
        if not curve.knows_slopes:  # all second derivatives vanish: by differences, not quite
            message = note = f"{note}: by differences of f, the point is known to few digits"
    return Special(
        kind, u, interval_of(curve, bracket), point.residual,
        GUESS if message else CONVERGED, note, form,
        tangent=best.tangent if own is None else own, others=tuple(others), extra=extra,
        corank=corank,
    )  # fmt: skip


def is_vertical(curve: Curve, u: Array, tangent: Array) -> bool:
    """Whether the parameter stands still along a tangent at a branch point, as at a pitchfork.

    Beside its span, and where f is steep in it beside what moves f as states do.
    """
    if not _stands(curve, tangent):
        return False
    return bool(abs(tangent[curve.n]) / scale_at(curve, u)[curve.n] < _bound(curve))


def _stands(curve: Curve, tangent: Array) -> bool:
    """Whether it does beside its span."""
    return bool(abs(tangent[curve.n]) / curve.scale[curve.n] < _bound(curve))


def _bound(curve: Curve) -> float:
    return VERTICAL if curve.field.exact else ROUGH


def _own(curve: Curve, tangents: list[Array], chord: Array) -> tuple[Array | None, list[Array]]:
    """The path's own tangent among those at a point, and the others."""
    if not tangents:
        return None, []
    near = [abs(float(np.dot(curve.weight * t, chord))) for t in tangents]
    i = int(np.argmax(near))
    own = tangents[i] if np.dot(curve.weight * tangents[i], chord) >= 0.0 else -tangents[i]
    return own, [t for j, t in enumerate(tangents) if j != i]


def _degenerate(curve: Curve, bracket: Bracket, best: Sample, message: str = MISSED) -> Special:
    """A point that is not refined, since the equations for it are singular there themselves."""
    point = null_spaces(curve, best.u)
    tangents = rays_around(curve, point) if point.corank == 1 else []
    chord = bracket.b.u - bracket.a.u
    own, others = _own(curve, tangents, chord / curve.length(chord))
    if len(others) > 1:
        message = f"{len(others) + 1} branches meet; {message}"
    return Special(
        "branch_point", best.u, interval_of(curve, bracket),
        float(np.max(np.abs(curve.evaluate(best.u)[0]))), GUESS, message,
        tangent=best.tangent if own is None else own, others=tuple(others),
        corank=point.corank,
    )  # fmt: skip


def null_spaces(curve: Curve, u: Array, tolerance: float = 1e-7) -> Singular:
    """Null spaces of f_u at a point as it stands, by its singular values."""
    n, m = curve.n, curve.m
    scale = scale_at(curve, u)
    rows = force_sizes(curve, u, scale)
    f, slopes = curve.evaluate(u)
    left, values, right = np.linalg.svd(slopes * scale / rows[:, None])
    k = max(1, int(np.sum(values <= tolerance * max(1.0, values[0]))))
    return Singular(
        np.array(u[:m]), right[n - k :].T * scale[:, None], left[:, n - k :],
        np.zeros(k), rows, float(np.max(np.abs(f))),
    )  # fmt: skip


def directions_at(curve: Curve, u: Array) -> list[Array]:
    """Unit tangents of the branches through a point of a branch; at a regular point one tangent."""
    point = null_spaces(curve, u, 1e-9)
    scaled = curve.evaluate(u)[1] * scale_at(curve, u) / point.rows[:, None]
    if np.linalg.svd(scaled, compute_uv=False)[-1] > 1e-9:
        t = point.right[:, -1]
        return [t / curve.length(t)]
    found = directions(curve, point)
    return found.tangents


def normal_form(d: forms.Derivatives, tangent: Array, *, pitchfork: bool) -> dict[str, float]:
    """Xi' = d (p - p0) xi + a xi^2, or + c xi^3 at a pitchfork; xi from the branch of `tangent`.

    ``tangent`` is that of a branch on which the parameter moves.
    """
    n = d.curve.n
    jacobian = d.slopes[:, :n]
    rows = force_sizes(d.curve, d.u)
    q, p = forms.null_vectors(jacobian, d.curve.scale[:n], rows)
    along = tangent[: n + 1] / tangent[n]
    length = float(np.max(np.abs(along) / d.curve.scale[: n + 1]))
    bent = d.second(q, q)
    form = {
        "d": forms.real_part(d.second(q, along).dot(p), forms.unit_of(d, rows, p, q, 1) * length)
    }
    if not pitchfork:
        form["a"] = forms.real_part(bent.dot(p) * 0.5, forms.unit_of(d, rows, p, q, 2))
        return form
    h = forms.solve_off(jacobian, bent.value, q, p)
    loose = forms.solve_off(jacobian, bent.error, q, p)
    fed = d.second(q, h)
    fed = forms.Estimate(fed.value, fed.error + np.abs(d.second(q, loose).value))
    total = d.third(q, q, q) - 3.0 * fed
    form["c"] = forms.real_part(total.dot(p) * (1.0 / 6.0), forms.unit_of(d, rows, p, q, 3))
    return form


def touch(curve: Curve, bracket: Bracket, known: list[Special]) -> list[Special]:
    """A branch point at which two eigenvalues pass zero, one in each direction; or nothing."""
    best = min((bracket.a, bracket.b), key=lambda s: orientation(curve, s.tangent, s.slopes)[1])
    width = curve.length(bracket.b.u - bracket.a.u)
    point = singular_point(curve, best.u, width, 2.0 * width, least=2)
    if point is not None and meets(curve, point):
        return [described(curve, bracket, best, point)]
    touching = _lowest(curve, bracket, best)
    return [] if touching is None else [_degenerate(curve, bracket, touching, TOUCHES)]


def _lowest(curve: Curve, bracket: Bracket, best: Sample) -> Sample | None:
    """Where the determinant touches zero next to the second end of a bracket, if it does.

    By parabolas through three points. As beside a double zero these are no nearer than half of the
    digits allow.
    """
    test, at = determinant_test(curve, bracket), 1.0 if best is bracket.b else 0.0
    for step in BESIDES:
        beside = [between(curve, bracket.a, bracket.b, at + k * step) for k in (-1.0, 0.5, 1.0)]
        if any(one is None for one in beside):
            return None
        left, middle, right = samples = [one for one in beside if one is not None]
        f, g, h = (test(one) for one in samples)
        # f + (s + step) r + (s + step)(s - step/2) bend through (-step, f), (step/2, g), (step, h).
        rate, bend = (g - f) / 1.5, ((h - g) / 0.5 - (g - f) / 1.5) / 2.0
        if bend == 0.0:
            return None
        s = -0.25 - 0.5 * rate / bend
        lowest = f + (s + 1.0) * rate + (s + 1.0) * (s - 0.5) * bend
        if not abs(s) < 1.0:
            return None
        at += s * step
    if not abs(lowest) <= NOTHING * abs(bend):
        return None
    part = 0.5 * (s + 1.0)
    return Sample(left.u + part * (right.u - left.u), middle.tangent, middle.slopes)


CROSSING = PathTest("branch", lambda curve, bracket, known: [branch_point(curve, bracket)])
TOUCH = PathTest("touch", touch)
