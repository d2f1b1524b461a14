"""Regular folds, Hopf points and neutral saddles of formulas: those of a path in one call."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from phasekit.arrays import Array
from phasekit.bifurcation.continuation.curve import NEUTRAL, Curve
from phasekit.bifurcation.continuation.events import Bracket
from phasekit.bifurcation.continuation.points.pair import start_of
from phasekit.bifurcation.continuation.points.special import (
    CONVERGED,
    Special,
    interval_of,
    is_between,
)
from phasekit.bifurcation.continuation.spectrum import (
    conjugate_function,
    eigenvalues_of,
    pair_function,
)
from phasekit.numerics import placing

#: Half the chord around a guess, on scaled axes; a part of a tangent that is next to none.
AROUND, STILL = 1e-2, 1e-9
#: How far, on scaled axes, a point may be from its guess, and still be the guessed one.
BESIDE = 1e-2 * AROUND
FLAT = 1e-9  # a tangent's part along the parameter next to which signs may be those of rounding

Given = tuple[Curve, Bracket]


def regular_points(
    bracketed: Sequence[tuple[Curve, Sequence[Bracket]]],
) -> list[dict[int, Special]]:
    """Special points of brackets that hold one regular point each, by their places on each path.

    The curves are of one field, and differ in their parameters and scales.
    """
    found: list[dict[int, Special]] = [{} for _ in bracketed]
    if not bracketed or not _are_placed(bracketed[0][0]):
        return found
    every = [
        (i, k, (curve, bracket))
        for i, (curve, brackets) in enumerate(bracketed)
        for k, bracket in enumerate(brackets)
    ]
    folds = [one for one in every if _turns(*one[2])]
    pairs = [
        one for one in every
        if one[2][1].changes == {"pair"} and one[2][1].jump in (0, 2) and not one[2][1].neutral
    ]  # fmt: skip
    for chosen, places in ((folds, _folds), (pairs, _pairs)):
        if not chosen or (places is _pairs and bracketed[0][0].discrete):
            continue
        placed = places([given for *_, given in chosen])
        for (i, k, (curve, bracket)), special in zip(chosen, placed, strict=True):
            if special is not None and is_between(curve, bracket, special.u):
                found[i][k] = special
    return found


def _are_placed(curve: Curve) -> bool:
    formula = curve.field.exact and curve.field.steps == 1 and curve.n <= NEUTRAL
    return formula and len(curve.active) == 1 and curve.field.mode == placing.DERIVED


def forms_beside(
    curve: Curve, special: Special, pars: Array, u: Array, extra: Array
) -> dict[str, Array] | None:
    """Coefficients of the normal form of a point at other parameters, from guesses of it each.

    pars shape (count, all parameters); u, extra: unknowns of the branch, and those that the
    equations of the point add.
    """
    hopf = special.kind == "hopf"
    if not (hopf or special.kind == "fold") or not _are_placed(curve) or special.tangent is None:
        return None
    if curve.discrete:
        return None
    m, n = curve.m, curve.n
    t = np.array(special.tangent[:m])
    if not hopf:
        t[n] = 0.0
    t = t / np.sqrt(np.sum(curve.weight[:m] * t * t))
    ends = np.empty((len(u), 4, m))
    ends[:, 0], ends[:, 2], ends[:, 1::2] = u - AROUND * t, u + AROUND * t, t
    kernel: object = placing.pairs if hopf else placing.folds
    starts = np.full((len(u), n + 2), 0.5)
    if hopf:
        starts[:, 1:] = extra[:, : n + 1]
    else:  # the parameter turns between both ends
        ends[:, 1, n], ends[:, 3, n] = STILL * curve.scale[n], -STILL * curve.scale[n]
    table = _placed([curve] * len(u), kernel, ends.reshape(len(u), -1), pars, *[starts] * hopf)
    if not table[:, placing.PLACED].all():
        return None
    off = table[:, placing.VECTOR : placing.VECTOR + m] - u
    if not (off**2 @ curve.weight[:m] <= BESIDE**2).all():
        return None
    names = ("l1", "omega", "d") if hopf else ("a", "b")
    return {name: table[:, placing.FIRST + k] for k, name in enumerate(names)}


def _turns(curve: Curve, bracket: Bracket) -> bool:
    """Whether the parameter surely turns back between both ends, once, and nothing else happens."""
    n = curve.n
    ends = [s.tangent[n] / curve.scale[n] for s in (bracket.a, bracket.b)]
    alone = bracket.changes == {"fold"} and bracket.jump <= 1
    return bool(alone and min(ends) < -FLAT and max(ends) > FLAT)


def _given(chosen: Sequence[Given]) -> tuple[Array, Array]:
    """Both ends of brackets and their tangents, a row each, and the parameters."""
    m = chosen[0][0].m
    both = (s for _, bracket in chosen for s in (bracket.a, bracket.b))
    whole = np.concatenate([x[:m] for s in both for x in (s.u, s.tangent)])
    return whole.reshape(len(chosen), 4 * m), np.array([curve.par for curve, _ in chosen])


def _placed(
    curves: Sequence[Curve], kernel: object, ends: Array, pars: Array, *more: Array
) -> Array:
    """What a kernel finds between two points each, at parameters of their own."""
    curve = curves[0]
    n, m, count = curve.n, curve.m, len(ends)
    found = np.zeros((count, placing.VECTOR + 2 * m + 2 * n + 1))
    codes = [curve.field.second(curve.active)]
    if more:
        codes.append(curve.field.third(curve.active))
    rows = [np.array([getattr(c, x)[:m] for c in curves]) for x in ("scale", "weight")]
    kernel(*codes, n, pars, *rows, ends, *more, found)  # type: ignore[operator]
    return found


def _folds(chosen: Sequence[Given]) -> list[Special | None]:
    curves = [curve for curve, _ in chosen]
    n, m, first = curves[0].n, curves[0].m, placing.VECTOR
    table = _placed(curves, placing.folds, *_given(chosen))
    return [
        None if not row[placing.PLACED] else
        Special(
            "fold", row[first : first + m], interval_of(*given),
            float(row[placing.RESIDUAL]), CONVERGED, "",
            {"a": float(row[placing.FIRST]), "b": float(row[placing.SECOND])},
            tangent=row[first + m : first + 2 * m],
            extra=row[first + 2 * m : first + 2 * m + n], corank=1,
        )
        for given, row in zip(chosen, table, strict=True)
    ]  # fmt: skip


def _pairs(chosen: Sequence[Given]) -> list[Special | None]:
    curve = chosen[0][0]
    n, m, first = curve.n, curve.m, placing.VECTOR
    saddles = "neutral_saddle" in curve.detect
    slopes = np.array([[s.slopes for s in (bracket.a, bracket.b)] for _, bracket in chosen])
    if n == 2:
        at = slopes[..., 0, 0] + slopes[..., 1, 1]
    else:
        values = eigenvalues_of(slopes, accuracy=curve.field.accuracy)
        at = (pair_function if saddles else conjugate_function)(values)
    with np.errstate(all="ignore"):
        part = at[:, 0] / (at[:, 0] - at[:, 1])
    sure = (at[:, 0] * at[:, 1] < 0.0) & np.isfinite(part)
    starts = np.zeros((len(chosen), n + 2))
    starts[:, 0] = np.clip(part, 0.02, 0.98)
    if n > 2:
        for j in np.flatnonzero(sure).tolist():
            A = slopes[j, int(part[j] > 0.5), :, :n]
            starts[j, 1:] = start_of(A, chosen[j][0].scale[:n], saddles=saddles)
    found: list[Special | None] = [None] * len(chosen)
    places = np.flatnonzero(sure).tolist()
    if not places:
        return found
    some = [chosen[j] for j in places]
    table = _placed([one for one, _ in some], placing.pairs, *_given(some), starts[sure])
    for j, (own, bracket), row in zip(places, some, table, strict=True):
        kind, jump, form = "neutral_saddle", 0, {}
        if row[-1] > 0.0:
            kind, jump = "hopf", 2
            form = dict(zip(("l1", "omega", "d"), row[placing.FIRST : first].tolist(), strict=True))
        if row[placing.PLACED] and bracket.jump == jump and (saddles or form):
            found[j] = Special(
                kind, row[first : first + m], interval_of(own, bracket),
                float(row[placing.RESIDUAL]), CONVERGED, "", form,
                tangent=row[first + m : first + 2 * m],
                extra=np.concatenate([row[first + 2 * m : first + 2 * m + n], row[-1:],
                                      row[first + 2 * m + n : -1]]),
            )  # fmt: skip
    return found
