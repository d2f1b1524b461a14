"""Regular folds, Hopf points and neutral saddles of formulas: those of a path in one call."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import numpy.typing as npt

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

Array = npt.NDArray[np.float64]

FLAT = 1e-9  # a tangent's part along the parameter next to which signs may be those of rounding


def regular_points(curve: Curve, brackets: Sequence[Bracket]) -> dict[int, Special]:
    """Special points of brackets that hold one regular point each, by their places."""
    formula = curve.field.exact and curve.field.steps == 1 and curve.n <= NEUTRAL
    if not formula or len(curve.active) != 1 or curve.field.mode != placing.DERIVED:
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


def _turns(curve: Curve, bracket: Bracket) -> bool:
    """Whether the parameter surely turns back between both ends, once, and nothing else happens."""
    n = curve.n
    ends = [s.tangent[n] / curve.scale[n] for s in (bracket.a, bracket.b)]
    alone = bracket.changes == {"fold"} and bracket.jump <= 1
    return bool(alone and min(ends) < -FLAT and max(ends) > FLAT)


def _placed(curve: Curve, kernel: object, brackets: Sequence[Bracket], *more: Array) -> Array:
    """What a kernel finds of brackets."""
    n, m, count = curve.n, curve.m, len(brackets)
    both = (s for b in brackets for s in (b.a, b.b))
    ends = np.concatenate([x[:m] for s in both for x in (s.u, s.tangent)]).reshape(count, 4 * m)
    found = np.zeros((count, placing.VECTOR + 2 * m + 2 * n + 1))
    codes = [curve.field.second(curve.active)]
    if more:
        codes.append(curve.field.third(curve.active))
    sizes = curve.par, curve.scale[:m], curve.weight[:m]
    rows = [np.repeat(one[None], count, axis=0) for one in sizes]
    kernel(*codes, n, *rows, ends, *more, found)  # type: ignore[operator]
    return found


def _folds(curve: Curve, brackets: Sequence[Bracket], chosen: list[int]) -> dict[int, Special]:
    n, m, first = curve.n, curve.m, placing.VECTOR
    table = _placed(curve, placing.folds, [brackets[k] for k in chosen])
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
    table = _placed(curve, placing.pairs, [brackets[k] for k in chosen], starts[sure])
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
