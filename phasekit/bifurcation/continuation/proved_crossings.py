"""Branch points that are proved, where formulas split them, and tubes that pass them."""

from __future__ import annotations

import functools
import itertools
import math
from collections.abc import Iterator, Mapping, Sequence
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from phasekit.arrays import Array, Flags
from phasekit.bifurcation.continuation.enclosed_points import Enclosure, Equations
from phasekit.numerics.intervals.krawczyk import UNIT, inverses
from phasekit.numerics.intervals.tube_chains import Chain, chain_of, held
from phasekit.numerics.intervals.tubes import Tubes, joined, tubes_about
from phasekit.numerics.intervals.zeros import Boxes, System, enclosures, holds_one
from phasekit.numerics.later import later
from phasekit.numerics.slopes import slope

if TYPE_CHECKING:
    import sympy as sp
else:
    sp = later("sympy")


#: Half widths of boxes in which a crossing may be the only one, the largest first.
SIZES = tuple(2.0**-k for k in range(3, 30, 3))
#: How many times larger they are in the null vector's entries.
PARTS = (16.0, 256.0)


def passed(
    equations: Equations, system: System, chain: Chain, points: Array, place: int,
    crossings: Mapping[int, str],
) -> tuple[Chain, Enclosure | None]:  # fmt: skip
    """The branch point at a place, if formulas split it, and tubes that pass it.

    About the gap that is left these are tubes of the branch's own equations, in a box in which the
    crossing is the only one, or where nothing crosses.
    """
    numbers = {s: sp.Rational(v) for s, v in equations.values.items() if s != equations.parameter}
    zero = tuple(row.xreplace(numbers) for row in equations.zero())
    unknowns = (*equations.states, equations.parameter)
    units = np.asarray(system.units)
    size = np.maximum(np.max(np.abs(points[:, :-1]), axis=0), units[:-1])
    at = points[place]
    for first, last in _gaps(chain, place, crossings):
        owners = np.arange(chain.owner[first], chain.owner[last - 1] + 1)
        start = chain.tubes.end[first - 1] if first else points[owners[0]] / units
        u = np.vstack([start, points[owners[1:]] / units, chain.tubes.end[last - 1]])
        whole = np.append(True, np.linalg.norm(np.diff(u, axis=0), axis=1) > 0.0)
        u, owners = u[whole], owners[whole[1:]]
        for split in splits(zero, equations.states, np.vstack([u * units, at]), size):
            own = System(split.branch, unknowns, {}, units)
            box, alone = _crossing(split, unknowns, at, system, units)
            if box is None:
                continue
            regular = System(split.matrix, unknowns, {}, units)

            def clear(tubes: Tubes, alone: Boxes = alone, regular: System = regular) -> Flags:
                low, high = tubes.middle - tubes.reach, tubes.middle + tubes.reach
                inside = np.all((low >= alone[0]) & (high <= alone[1]), axis=1)
                found: Flags = (inside | _regular(regular, low, high)) & ~system(low, high)[2]
                return found

            inner = chain_of(own, u, clear)
            if not (inner.tubes.proved.all() and inner.joined.all()):
                continue
            if not _goes_on(own, inner, chain, first, last):
                continue
            if held(inner, box[0] / units, box[1] / units):
                enclosed = Enclosure(True, box[0], box[1], "")
                inner = inner._replace(owner=owners[inner.owner])
                return _spliced(chain, inner, first, last), enclosed
    return chain, None


def _gaps(chain: Chain, place: int, crossings: Mapping[int, str]) -> Iterator[tuple[int, int]]:
    """Tubes about a branch point that are not proved: of all stretches next to it, or a few."""
    open_, owner = ~chain.tubes.proved, chain.owner
    before = first = last = behind = int(np.searchsorted(owner, place))
    while first > 0 and open_[first - 1]:
        first -= 1
    while last < len(owner) and open_[last]:
        last += 1
    low = high = place
    while low > 0 and low - 1 not in crossings and open_[owner == low - 1].any():
        low -= 1
    while high < owner[-1] + 1 and high + 1 not in crossings and open_[owner == high].any():
        high += 1
    gap = np.flatnonzero(open_ & (owner >= low) & (owner < high))
    if gap.size:
        before, behind = min(first, int(gap[0])), max(last, int(gap[-1]) + 1)
    if behind > before:
        yield before, behind
    if first < last and (first, last) != (before, behind):
        yield first, last


def _regular(system: System, low: Array, high: Array) -> Flags:
    """Whether matrices of formulas are not singular anywhere in boxes."""
    (least, most), _, undefined = system(low, high)
    n = round(np.sqrt(system.m))
    with np.errstate(all="ignore"):
        center = (0.5 * least + 0.5 * most).reshape(-1, n, n)
        wide = (0.5 * (most - least)).reshape(-1, n, n) + 8.0 * n * UNIT * np.abs(center)
        inverse, usable = inverses(center)
        off = np.abs(np.eye(n) - inverse @ center) + np.abs(inverse) @ wide
        found: Flags = usable & ~undefined & (np.max(np.sum(off, axis=2), axis=1) < 0.99)
    return found


def _spliced(chain: Chain, inner: Chain, first: int, last: int) -> Chain:
    """A chain with other tubes from one to another."""
    tubes = Tubes(*(
        np.concatenate([array[:first], new, array[last:]])
        for array, new in zip(chain.tubes, inner.tubes, strict=True)
    ))  # fmt: skip
    sides = (np.ones(int(first > 0), bool), np.ones(int(last < len(chain.owner)), bool))
    before, behind = chain.joined[: max(first - 1, 0)], chain.joined[last:]
    together = np.concatenate([before, sides[0], inner.joined, sides[1], behind])
    owners = np.concatenate([chain.owner[:first], inner.owner, chain.owner[last:]])
    return Chain(tubes, owners, together)


def _goes_on(system: System, inner: Chain, chain: Chain, first: int, last: int) -> bool:
    """Whether tubes in a gap hold the curve of the tubes before and behind."""
    if first:
        start = inner.tubes.rows(slice(0, 1))
        base = chain.tubes.rows(slice(first - 1, first))
        back = tubes_about(system, start.end, base.end)
        if not (back.proved & joined(back, base)).all():
            return False
    if last < len(chain.owner):
        behind = chain.tubes.rows(slice(last, last + 1))
        return bool(joined(inner.tubes.rows(slice(-1, None)), behind).all())
    return True


def _crossing(
    split: Split, unknowns: tuple[Any, ...], u: Array, system: System, units: Array
) -> tuple[Boxes | None, Boxes]:
    """A box with exactly one crossing of a branch with another, and one where it is the only one.

    The first in the unknowns' own units, the second in those of the system. No third branch crosses
    in either.
    """
    n, count = len(u) - 1, len(split.vectors)
    nothing = None, (u, u)
    start, numbers = u / units, np.zeros(0)
    if count:
        at = (u / units)[None]
        _, slopes, _ = system(at, at)
        matrix = (0.5 * slopes[0] + 0.5 * slopes[1])[0, :, :n] / units[:n]
        if not np.isfinite(matrix).all():
            return nothing
        numbers = np.linalg.svd(split.rows @ matrix @ split.directions)[2][-1]
        start = np.append(start, numbers)
    values = {
        number: np.array([value]) for number, value in zip(split.numbers, numbers, strict=True)
    }
    whole = System(
        (*split.branch, *split.crossing), (*unknowns, *split.vectors), values,
        np.append(units, np.ones(count)),
    )  # fmt: skip
    (low, high), held = enclosures(whole, start[None])
    if not held[0]:
        return nothing
    middle, most = (0.5 * low + 0.5 * high)[0], (low[0, : n + 1], high[0, : n + 1])
    others = System(split.others, unknowns, {}, units) if split.others else None
    if _vanish(others, *most):
        return nothing
    regular = System(split.matrix, unknowns, {}, units)
    for size, part in itertools.product(SIZES, PARTS[: 1 + (count > 1)]):
        half = np.append(np.full(n + 1, size), np.full(count, part * size))
        box = (middle - half)[: n + 1], (middle + half)[: n + 1]
        if (
            holds_one(whole, middle - half, middle + half, middle)
            and not _vanish(others, *box)
            and (count < 2 or _one_vector(regular, *box, middle[n + 1 :], numbers, part * size))
        ):
            most = box
            break
    low, high = low[:, : n + 1], high[:, : n + 1]
    return (low[0] * units, high[0] * units), most


def _vanish(system: System | None, low: Array, high: Array) -> bool:
    """Whether a formula may vanish in a box."""
    if system is None:
        return False
    (least, most), _, undefined = system(low[None], high[None])
    return bool(undefined.any() or np.any((least <= 0.0) & (most >= 0.0)))


def _one_vector(
    system: System, low: Array, high: Array, v: Array, number: Array, size: float
) -> bool:
    """Whether all null vectors of matrices in a box are one, so far from v at most, times numbers.

    The matrix bordered by vectors close to the null vectors is not singular; null vectors z with
    l z = 1 solve it with the right side (0, 1), and so are close to v.
    """
    count = len(v)
    (least, most), _, undefined = system(low[None], high[None])
    center = (0.5 * least + 0.5 * most).reshape(count, count)
    if undefined.any() or not np.isfinite(center).all():
        return False
    wide = (0.5 * (most - least)).reshape(count, count) + 8.0 * count * UNIT * np.abs(center)
    whole, spread = np.zeros((2, count + 1, count + 1))
    whole[:count, :count], spread[:count, :count] = center, wide
    whole[:count, count] = np.linalg.svd(center)[0][:, -1]
    whole[count, :count] = number
    (inverse,), usable = inverses(whole[None])
    off = np.abs(np.eye(count + 1) - inverse @ whole) + np.abs(inverse) @ (
        spread + 8.0 * count * UNIT * np.abs(whole)
    )
    part = float(np.max(np.sum(off, axis=1)))
    away = (
        np.abs(inverse[:count, count] - v).max()
        + part / (1.0 - part) * np.abs(inverse[:, count]).max()
        if part < 0.9
        else np.inf
    )
    return bool(usable[0] and away * (1.0 + 1e-12) < size)


if TYPE_CHECKING:
    import sympy as sp
else:
    sp = later("sympy")

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
