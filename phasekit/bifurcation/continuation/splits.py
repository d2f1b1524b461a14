"""Branch points that formulas split: equations of one branch alone, and of another's crossings.

Where a row of f is a product of factors, its zeros are those of each: the branch is that of one
factor g, which no longer is singular where another branch crosses, and branch points are the zeros
of g and another factor h together. Rows that give one state by others are put into the rest first.
Where states a are 0, or equal to others, and their rows then vanish whatever the rest is, by a
symmetry or else, the branch keeps to that subspace, with equations z_a = 0, and others leave it
along v where (df_a/dz_a) v = 0 ([CrandallRabinowitz1971]). A box with one regular solution of these
holds one branch point, at which exactly two branches cross.
"""

from __future__ import annotations

import functools
import itertools
import math
from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
import numpy.typing as npt

from phasekit.numerics.later import later
from phasekit.numerics.slopes import slope

if TYPE_CHECKING:
    import sympy as sp
else:
    sp = later("sympy")

Array = npt.NDArray[np.float64]

#: Longest formulas that are factored and simplified, and subspaces that are tried.
LONG, SIMPLE, MOST = 400, 100, 8
#: Most terms of a formula that is expanded.
TERMS = 200.0
#: How close to 0, beside their sizes, states are that may be 0 or equal.
NEAR = 1e-9


class Split(NamedTuple):
    """Equations of one branch alone, and of its crossings with another."""

    branch: tuple[Any, ...]
    """As many as f has; its zeros are zeros of f, and the branch point is a regular one."""
    crossing: tuple[Any, ...]
    """What vanishes at crossings beside these, in the unknowns, v and the numbers l."""
    vectors: tuple[Any, ...]
    """v."""
    numbers: tuple[Any, ...]
    """l."""
    others: tuple[Any, ...]
    """What must not vanish there: a third branch would cross."""
    matrix: tuple[Any, ...]
    """Row by row, in the unknowns: where it is not singular, nothing else crosses the branch."""
    directions: Array
    """The state's change with each entry of v, of shape (states, entries)."""
    rows: Array
    """The parts of f that vanish on the subspace, by the rows of f, of shape (entries, states)."""


def splits(
    zero: tuple[Any, ...], states: tuple[Any, ...], points: Array, scale: Array
) -> Iterator[Split]:
    """Ways to split equations whose only symbols are states and parameter, at points of a branch.

    points shape (points, states + 1); scale shape (states,).
    """
    for forms in itertools.islice(_subspaces(points[:, :-1], scale), MOST):
        kept = _invariant(zero, states, forms)
        if kept:
            yield _of_subspace(zero, states, kept)
    if sum(row.count_ops() for row in zero) <= LONG:
        yield from _factors(zero, states)


# ------------------------------------------------------------------------- subspaces

#: A state that is 0, or equal to another.
Form = tuple[int, int | None]


def _subspaces(x: Array, scale: Array) -> Iterator[tuple[Form, ...]]:
    """Which states are 0 along a branch, and pairs of the others that are equal."""
    n = x.shape[1]
    none = [i for i in range(n) if np.all(np.abs(x[:, i]) <= NEAR * scale[i])]
    if none:
        yield tuple((i, None) for i in none)
    pairs = [
        (i, j) for i, j in itertools.combinations(range(n), 2)
        if np.all(np.abs(x[:, i] - x[:, j]) <= NEAR * min(scale[i], scale[j]))
    ]  # fmt: skip
    for count in range(min(n // 2, len(pairs)), 0, -1):
        for chosen in itertools.combinations(pairs, count):
            if len({i for pair in chosen for i in pair}) == 2 * count:
                yield tuple((j, i) for i, j in chosen)


def _invariant(
    zero: tuple[Any, ...], states: tuple[Any, ...], forms: tuple[Form, ...]
) -> tuple[Form, ...]:
    """Those of the forms whose parts of f vanish where all of them do, exactly."""
    while forms:
        on = {states[i]: states[j] if j is not None else sp.Integer(0) for i, j in forms}
        kept = tuple(
            (i, j) for i, j in forms
            if _vanishes((zero[i] - zero[j] if j is not None else zero[i]).xreplace(on))
        )  # fmt: skip
        if kept == forms:
            return kept
        forms = kept
    return ()


@functools.lru_cache(maxsize=256)
def _vanishes(formula: Any) -> bool:
    """Whether a formula is 0 for all its symbols, as far as simplifying tells."""
    if formula == 0:
        return True
    at = {
        x: sp.Rational(37 + 9 * k, 101) for k, x in enumerate(sorted(formula.free_symbols, key=str))
    }
    terms = [abs(term.evalf(30, subs=at)) for term in sp.Add.make_args(formula)]
    value = formula.evalf(30, subs=at)
    if value.is_number and abs(value) > 1e-20 * sum(terms):
        return False
    return bool(
        (_terms(formula) <= 20.0 * TERMS and sp.expand(formula) == 0)
        or (formula.count_ops() <= SIMPLE and sp.simplify(formula) == 0)
    )


@functools.lru_cache(maxsize=64)
def _of_subspace(zero: tuple[Any, ...], states: tuple[Any, ...], forms: tuple[Form, ...]) -> Split:
    n, count = len(states), len(forms)
    v, number = (sp.symbols(f"{name}0:{count}", cls=sp.Dummy, real=True) for name in "vl")
    rows, directions, parts = list(zero), np.zeros((n, count)), np.zeros((count, n))
    for k, (i, j) in enumerate(forms):
        rows[i] = states[i] if j is None else states[i] - states[j]
        directions[i, k], parts[k, i] = (1.0, 1.0) if j is None else (0.5, 1.0)
        if j is not None:
            directions[j, k], parts[k, j] = -0.5, -1.0
    crossing, matrix = [], []
    for k, (i, j) in enumerate(forms):
        part = zero[i] if j is None else zero[i] - zero[j]
        for p, q in forms:
            along = slope(part, states[p])
            matrix.append(along if q is None else (along - slope(part, states[q])) / 2)
        row = matrix[k * count :]
        crossing.append(sp.Add(*(a * b for a, b in zip(row, v, strict=True))))
    crossing.append(sp.Add(*(a * b for a, b in zip(number, v, strict=True))) - 1)
    return Split(tuple(rows), tuple(crossing), v, number, (), tuple(matrix), directions, parts)


# ------------------------------------------------------------------------- factors


@functools.lru_cache(maxsize=64)
def _factors(zero: tuple[Any, ...], states: tuple[Any, ...]) -> tuple[Split, ...]:
    """Splits of each row that is a product, for each ordered pair of its factors."""
    rows = list(zero)
    for i in range(len(rows)):  # rows that give a state by others are put into the rest
        for x in states:
            along = slope(rows[i], x)
            if along.is_number and along != 0:
                value = x - rows[i] / along
                put = [row if k == i else row.xreplace({x: value}) for k, row in enumerate(rows)]
                if max(map(_terms, put)) <= TERMS:
                    rows = [row if k == i else sp.expand(row) for k, row in enumerate(put)]
                break
    found = []
    nothing = np.zeros((len(states), 0))
    for i, row in enumerate(rows):
        factors = _product(row)
        for g, h in itertools.permutations(factors, 2):
            branch = tuple(g if k == i else other for k, other in enumerate(rows))
            others = tuple(one for one in factors if one not in (g, h))
            product = (sp.Mul(h, *others),)
            found.append(Split(branch, (h,), (), (), others, product, nothing, nothing.T))
    return tuple(found)


def _product(row: Any) -> Sequence[Any]:
    """The different factors of a formula that hold symbols, as far as they are found."""
    upper, symbols = sp.fraction(sp.together(row))[0], sorted(row.free_symbols, key=str)
    if _terms(upper) <= TERMS and upper.is_polynomial(*symbols):
        whole = sp.factor(upper)
    else:
        whole = sp.factor_terms(row)
    bases = [
        factor.base if factor.is_Pow else factor
        for factor in sp.Mul.make_args(whole)
        if not (factor.is_Pow and not factor.exp.is_positive)
    ]
    return list(dict.fromkeys(base for base in bases if base.free_symbols))


def _terms(formula: Any) -> float:
    """A bound of how many terms a formula has when it is expanded."""
    if formula.is_Add:
        return sum(map(_terms, formula.args))
    if formula.is_Mul:
        return math.prod(map(_terms, formula.args))
    if formula.is_Pow and formula.exp.is_Integer:
        return min(_terms(formula.base) ** abs(int(formula.exp)), np.inf)
    return 1.0
