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


def regular_points(curve: Curve, brackets: Sequence[Bracket]) -> dict[int, Special]:
    """Special points of brackets that hold one regular point each, by their places."""
    if not _are_placed(curve):
        return {}
    found = {}
    folds = [k for k, bracket in enumerate(brackets) if _turns(curve, bracket)]
    if folds:
        found.update(_folds(curve, brackets, folds))
    pairs = [
        k for k, bracket in enumerate(brackets)
        if bracket.changes == {"pair"} and bracket.jump in (0, 2) and not bracket.neutral
    ]  # fmt: skip
    if pairs and not curve.discrete:
        found.update(_pairs(curve, brackets, pairs))
    return {k: one for k, one in found.items() if is_between(curve, brackets[k], one.u)}


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
    ends = np.concatenate([u - AROUND * t, np.tile(t, (len(u), 1)), u + AROUND * t,
                           np.tile(t, (len(u), 1))], axis=1)  # fmt: skip
    if not hopf:  # the parameter turns between both ends
        ends[:, m + n], ends[:, 3 * m + n] = STILL * curve.scale[n], -STILL * curve.scale[n]
    starts = np.concatenate([np.full((len(u), 1), 0.5), extra[:, : n + 1]], axis=1)
    table = _placed(curve, placing.pairs if hopf else placing.folds, ends, pars,
                    *([starts] if hopf else []))  # fmt: skip
    if not table[:, placing.PLACED].all():
        return None
    off = table[:, placing.VECTOR : placing.VECTOR + m] - u
    if not np.all(np.sum(curve.weight[:m] * off**2, axis=1) <= BESIDE**2):
        return None
    names = ("l1", "omega", "d") if hopf else ("a", "b")
    return {name: table[:, placing.FIRST + k] for k, name in enumerate(names)}


def _turns(curve: Curve, bracket: Bracket) -> bool:
    """Whether the parameter surely turns back between both ends, once, and nothing else happens."""
    n = curve.n
    ends = [s.tangent[n] / curve.scale[n] for s in (bracket.a, bracket.b)]
    alone = bracket.changes == {"fold"} and bracket.jump <= 1
    return bool(alone and min(ends) < -FLAT and max(ends) > FLAT)


def _given(curve: Curve, brackets: Sequence[Bracket], chosen: Sequence[int]) -> tuple[Array, Array]:
    """Both ends of brackets and their tangents, a row each, and the parameters."""
    m = curve.m
    both = (s for k in chosen for s in (brackets[k].a, brackets[k].b))
    whole = np.concatenate([x[:m] for s in both for x in (s.u, s.tangent)])
    return whole.reshape(len(chosen), 4 * m), np.repeat(curve.par[None], len(chosen), axis=0)


def _placed(curve: Curve, kernel: object, ends: Array, pars: Array, *more: Array) -> Array:
    """What a kernel finds between two points each, at parameters of their own."""
    n, m, count = curve.n, curve.m, len(ends)
    found = np.zeros((count, placing.VECTOR + 2 * m + 2 * n + 1))
    codes = [curve.field.second(curve.active)]
    if more:
        codes.append(curve.field.third(curve.active))
    rows = [np.repeat(one[None], count, axis=0) for one in (curve.scale[:m], curve.weight[:m])]
    kernel(*codes, n, pars, *rows, ends, *more, found)  # type: ignore[operator]
    return found


def _folds(curve: Curve, brackets: Sequence[Bracket], chosen: list[int]) -> dict[int, Special]:
    n, m, first = curve.n, curve.m, placing.VECTOR
    table = _placed(curve, placing.folds, *_given(curve, brackets, chosen))
    return {
        k: Special(
            "fold", row[first : first + m], interval_of(curve, brackets[k]),
            float(row[placing.RESIDUAL]), CONVERGED, "",
            {"a": float(row[placing.FIRST]), "b": float(row[placing.SECOND])},
            tangent=row[first + m : first + 2 * m],
            extra=row[first + 2 * m : first + 2 * m + n], corank=1,
        )
        for k, row in zip(chosen, table, strict=True) if row[placing.PLACED]
    }  # fmt: skip


def _pairs(curve: Curve, brackets: Sequence[Bracket], chosen: list[int]) -> dict[int, Special]:
    n, m, first = curve.n, curve.m, placing.VECTOR
    saddles = "neutral_saddle" in curve.detect
    slopes = np.array([[s.slopes for s in (brackets[k].a, brackets[k].b)] for k in chosen])
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
            starts[j, 1:] = start_of(A, curve.scale[:n], saddles=saddles)
    chosen = [k for k, one in zip(chosen, sure, strict=True) if one]
    if not chosen:
        return {}
    table = _placed(curve, placing.pairs, *_given(curve, brackets, chosen), starts[sure])
    found = {}
    for k, row in zip(chosen, table, strict=True):
        kind, jump, form = "neutral_saddle", 0, {}
        if row[-1] > 0.0:
            kind, jump = "hopf", 2
            form = dict(zip(("l1", "omega", "d"), row[placing.FIRST : first].tolist(), strict=True))
        if row[placing.PLACED] and brackets[k].jump == jump and (saddles or form):
            found[k] = Special(
                kind, row[first : first + m], interval_of(curve, brackets[k]),
                float(row[placing.RESIDUAL]), CONVERGED, "", form,
                tangent=row[first + m : first + 2 * m],
                extra=np.concatenate([row[first + 2 * m : first + 2 * m + n], row[-1:],
                                      row[first + 2 * m + n : -1]]),
            )  # fmt: skip
    return found
