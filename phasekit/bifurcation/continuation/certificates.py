"""Branches of formulas that are proved: one curve between neighbouring points, folds, Hopf points.

What is proved holds for the formulas and the doubles that stand for parameters, exactly. Between
neighbouring points tubes hold one curve and no other zero (`phasekit.numerics.intervals.tubes`);
where a tube fails it is tried in halves. Special points are boxes that hold exactly one solution of
the equations that define them, whose derivatives are not singular there:

    fold             f = 0, f_x v = 0, l v = 1
    hopf             f = 0, f_x v = -omega w, f_x w = omega v, l v = 1, l w = 0
    neutral_saddle   f = 0, f_x v = sigma v, f_x w = -sigma w, l v = 1, m w = 1
    period_doubling  f = x, f_x v = -v, l v = 1
    torus            f = x, f_x v = c v - s w, f_x w = s v + c w, l v = 1, l w = 0, c^2 + s^2 = 1
    branch points    where formulas split them: `phasekit.bifurcation.continuation.splits`

([Govaerts2000] chapter 4, [Kuznetsov2004] 10.2). Thus a fold is quadratic, and a pair of
eigenvalues passes the imaginary axis with a speed that is not zero.
"""

from __future__ import annotations

import functools
import itertools
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
import numpy.typing as npt

from phasekit.bifurcation.continuation.splits import Split, splits
from phasekit.numerics.intervals.krawczyk import UNIT, inverses
from phasekit.numerics.intervals.program import NoRule
from phasekit.numerics.intervals.tubes import FRAME, Tubes, joined, tubes_about
from phasekit.numerics.intervals.zeros import Boxes, System, enclosures, holds_one
from phasekit.numerics.later import later

if TYPE_CHECKING:
    import sympy as sp
else:
    sp = later("sympy")

Array = npt.NDArray[np.float64]
Flags = npt.NDArray[np.bool_]

#: How often a chord is halved, and chords at a time beside points of the branch.
HALVINGS, CHORDS = 12, 12
#: Newton steps that take a middle to the curve.
STEPS = 4
#: Half widths of boxes in which a crossing may be the only one, the largest first.
SIZES = tuple(2.0**-k for k in range(3, 30, 3))
#: How many times larger they are in the null vector's entries.
PARTS = (16.0, 256.0)
#: Kinds at which branches meet.
CROSSINGS = ("branch_point", "pitchfork", "transcritical")


@dataclass(frozen=True)
class Equations:
    """Formulas of a branch: f, its states and its parameter as symbols, the others as numbers."""

    f: tuple[Any, ...]
    states: tuple[Any, ...]
    parameter: Any
    values: Mapping[Any, float]
    discrete: bool

    def zero(self) -> tuple[Any, ...]:
        """What vanishes along the branch, its numbers exact."""
        return _zero(self.f, self.states, self.discrete)


@functools.lru_cache(maxsize=64)
def _zero(f: tuple[Any, ...], states: tuple[Any, ...], discrete: bool) -> tuple[Any, ...]:
    exact = [row.xreplace({x: sp.Rational(x) for x in row.atoms(sp.Float)}) for row in f]
    return tuple(row - x for row, x in zip(exact, states, strict=True)) if discrete else (*exact,)


class Mark(NamedTuple):
    """A special point to be proved: its kind, its unknowns, and which of the points it is."""

    kind: str
    u: Array
    place: int


class Enclosure(NamedTuple):
    """What is proved of a special point.

    Attributes
    ----------
    certified : bool
    low, high : array
        Bounds of the states, the parameter, and of omega, sigma or the angle if there is one; NaN
        where nothing is known.
    reason : str
        Why it is not proved, or what is not.
    """

    certified: bool
    low: Array
    high: Array
    reason: str


class Certificate(NamedTuple):
    """What is proved of a branch.

    Attributes
    ----------
    stretches : array of bool, shape (points - 1,)
        Whether one curve goes from each point to the next, and no other passes its tube; where
        formulas split, no other of the same part.
    reasons : list of str
        Why not, in words.
    radius : array, shape (points - 1, unknowns)
        How far the curve may be from the chords of the stretch; NaN where nothing is known.
    errors : array, shape (points, unknowns)
        How far each point may be from the curve; NaN where nothing is known.
    specials : list of Enclosure
    """

    stretches: Flags
    reasons: list[str]
    radius: Array
    errors: Array
    specials: list[Enclosure]


def certificate(
    equations: Equations, points: Array, scale: Array, marks: Sequence[Mark]
) -> Certificate:
    """What is proved of a branch through some points.

    Parameters
    ----------
    equations : Equations
    points : array, shape (points, states + 1)
        States and parameter in order along the branch, special points among them.
    scale : array, shape (states + 1,)
        Their sizes.
    marks : sequence of Mark

    Raises
    ------
    NoRule
        If formulas hold a function of which no bounds are known.
    """
    units: Array = np.exp2(np.round(np.log2(scale))).astype(float)
    unknowns = (*equations.states, equations.parameter)
    values = {s: v for s, v in equations.values.items() if s != equations.parameter}
    system = System(equations.zero(), unknowns, values, units)
    crossings = {mark.place: mark.kind for mark in marks if mark.kind in CROSSINGS}
    chain = _chain(system, points / units)
    passed = {}
    for place in crossings:
        chain, passed[place] = _passed(equations, system, chain, points, place, crossings)
    leaves = chain.tubes
    stretches, reasons = _stretches(chain, points, units, crossings)
    radius = np.full((len(points) - 1, len(units)), np.nan)
    sizes = np.einsum("kij,kj->ki", np.abs(leaves.across), leaves.radius) * (1.0 + FRAME) * units
    for k in np.intersect1d(np.flatnonzero(stretches), chain.owner):
        radius[k] = np.max(sizes[chain.owner == k], axis=0)
    errors = _errors(system, chain, len(points), units)
    specials = _specials(equations, chain, marks, errors, units)
    for i, mark in enumerate(marks):
        proved = passed.get(mark.place)
        if proved is not None and mark.kind in CROSSINGS:
            specials[i] = proved
    return Certificate(stretches, reasons, radius, errors, specials)


# ------------------------------------------------------------------------- stretches


class _Chain(NamedTuple):
    """Tubes in order along a branch, and to which stretches they belong."""

    tubes: Tubes
    owner: npt.NDArray[np.int64]
    joined: Flags
    """Whether each and the next hold the same curve."""


def _chain(system: System, u: Array, clear: Callable[[Tubes], Flags] | None = None) -> _Chain:
    """Tubes from point to point, of halves where those of wholes fail, or are not clear."""
    start, end = u[:-1], u[1:]
    owner = np.arange(len(start))
    place = owner.astype(float)
    length = np.linalg.norm(end - start, axis=1)
    long = length > 64.0 * UNIT * np.linalg.norm(np.abs(end) + np.abs(start), axis=1)
    start, end, owner, place = start[long], end[long], owner[long], place[long]
    parts: list[tuple[Tubes, Any, Array]] = []
    for level in range(HALVINGS + 1):
        found = tubes_about(system, start, end)
        if clear is not None:
            found = found._replace(proved=found.proved & clear(found))
        done = found.proved.copy()
        middle, near = _middles(system, start, end)
        last = level == HALVINGS or 2 * np.sum(~done) > CHORDS * (len(u) + 16)
        done |= ~near | last
        parts.append((found.rows(done), owner[done], place[done]))
        rest = ~done
        if not rest.any():
            break
        step = 0.5 ** (level + 1)
        start, middle, end = start[rest], middle[rest], end[rest]
        start, end = np.concatenate([start, middle]), np.concatenate([middle, end])
        place = np.concatenate([place[rest], place[rest] + step])
        owner = np.tile(owner[rest], 2)
    order = np.argsort(np.concatenate([part[2] for part in parts]), kind="stable")
    arrays = zip(*(part[0] for part in parts), strict=True)
    whole = Tubes(*(np.concatenate(array)[order] for array in arrays))
    # Of two that are not joined the one that is known less well is not used.
    apart = np.flatnonzero(whole.proved[:-1] & whole.proved[1:] & ~whole.joined)
    if apart.size:
        with np.errstate(all="ignore"):
            wide = np.linalg.norm(whole.tip, axis=1) / np.linalg.norm(whole.chord, axis=1)
        whole.proved[np.where(wide[apart] > wide[apart + 1], apart, apart + 1)] = False
    return _Chain(whole, np.concatenate([part[1] for part in parts])[order], whole.joined)


def _middles(system: System, start: Array, end: Array) -> tuple[Array, Flags]:
    """Points of the curve half way, across chords, and whether they were found near these."""
    chord, base = end - start, 0.5 * start + 0.5 * end
    u, size = base.copy(), np.linalg.norm(chord, axis=1)
    rows = np.empty((len(u), system.n, system.n))
    with np.errstate(all="ignore"):
        rows[:, -1] = chord / size[:, None]
        for _ in range(STEPS):
            f, slopes, _ = system(u, u)
            rows[:, :-1] = 0.5 * slopes[0] + 0.5 * slopes[1]
            gap = np.sum((u - base) * rows[:, -1], axis=1)
            value = np.concatenate([0.5 * f[0] + 0.5 * f[1], gap[:, None]], axis=1)
            inverse, usable = inverses(rows)
            u = u - np.einsum("kij,kj->ki", inverse, value)
        near = usable & (np.linalg.norm(u - base, axis=1) < 0.5 * size)
    return u, near


def _stretches(
    chain: _Chain, points: Array, units: Array, crossings: Mapping[int, str]
) -> tuple[Flags, list[str]]:
    """Which stretches are proved, and why others are not."""
    count = len(points) - 1
    proved, owner = chain.tubes.proved, chain.owner
    owned = np.isin(np.arange(count), owner)
    stretches, reasons = owned.copy(), [""] * count
    for k in np.unique(owner[~proved]):
        stretches[k] = False
        open_ = (owner == k) & ~proved
        ends = chain.tubes.middle[open_, -1, None] + 0.5 * chain.tubes.chord[open_, -1:] * [-1, 1]
        where = f"between {ends.min() * units[-1]:.9g} and {ends.max() * units[-1]:.9g}"
        kinds = [crossings[i] for i in (k, k + 1) if i in crossings]
        if kinds:
            what = kinds[0].replace("_", " ")
            reasons[k] = f"{where}: branches meet in the {what}, which no tube passes"
        elif not chain.tubes.defined[open_].all():
            reasons[k] = f"{where}: f or a derivative may have a pole or be undefined"
        else:
            reasons[k] = (
                f"{where}: other branches may be nearer than intervals can tell, or derivatives "
                "vanish together"
            )
    # Points that are the same but for rounding are on the curve of the stretch before them, or of
    # the first one of all, as far as that is proved.
    places = np.flatnonzero(owned)
    for k in np.flatnonzero(~owned):
        if places.size:
            near = places[max(int(np.searchsorted(places, k)) - 1, 0)]
            stretches[k], reasons[k] = stretches[near], reasons[near]
        else:
            reasons[k] = "all points are the same but for rounding: no tube is about a point"
    return stretches, reasons


def _errors(system: System, chain: _Chain, count: int, units: Array) -> Array:
    """How far points may be from the curve, in planes across the chords that end there."""
    errors = np.full((count, len(units)), np.nan)
    tubes, owner = chain.tubes, chain.owner
    last = np.append(owner[1:] != owner[:-1], True) & tubes.proved
    size = np.einsum("kij,kj->ki", np.abs(tubes.across), tubes.tip) * (1.0 + FRAME) * units
    errors[owner[last] + 1] = size[last]
    first = np.append(True, owner[1:] != owner[:-1]) & tubes.proved
    first[first] = np.isnan(errors[owner[first], 0])
    if first.any():
        there = tubes.rows(first)
        back = tubes_about(system, there.end, there.end - there.chord)
        size = np.einsum("kij,kj->ki", np.abs(back.across), back.tip) * (1.0 + FRAME) * units
        size += 2.0 * UNIT * (np.abs(there.end) + np.abs(there.chord)) * units
        same = back.proved & there.hold(back.end, back.across, back.tip)
        errors[owner[first]] = np.where(same[:, None], size, np.nan)
    return errors


# ------------------------------------------------------------------------- branch points


def _passed(
    equations: Equations, system: System, chain: _Chain, points: Array, place: int,
    crossings: Mapping[int, str],
) -> tuple[_Chain, Enclosure | None]:  # fmt: skip
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

            inner = _chain(own, u, clear)
            if not (inner.tubes.proved.all() and inner.joined.all()):
                continue
            if not _goes_on(own, inner, chain, first, last):
                continue
            if _held(inner, box[0] / units, box[1] / units):
                enclosed = Enclosure(True, box[0], box[1], "")
                inner = inner._replace(owner=owners[inner.owner])
                return _spliced(chain, inner, first, last), enclosed
    return chain, None


def _gaps(chain: _Chain, place: int, crossings: Mapping[int, str]) -> Iterator[tuple[int, int]]:
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


def _spliced(chain: _Chain, inner: _Chain, first: int, last: int) -> _Chain:
    """A chain with other tubes from one to another."""
    tubes = Tubes(*(
        np.concatenate([array[:first], new, array[last:]])
        for array, new in zip(chain.tubes, inner.tubes, strict=True)
    ))  # fmt: skip
    sides = (np.ones(int(first > 0), bool), np.ones(int(last < len(chain.owner)), bool))
    before, behind = chain.joined[: max(first - 1, 0)], chain.joined[last:]
    together = np.concatenate([before, sides[0], inner.joined, sides[1], behind])
    owners = np.concatenate([chain.owner[:first], inner.owner, chain.owner[last:]])
    return _Chain(tubes, owners, together)


def _goes_on(system: System, inner: _Chain, chain: _Chain, first: int, last: int) -> bool:
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


# ------------------------------------------------------------------------- special points


class _Kind(NamedTuple):
    """Equations of a kind of special point: formulas and their unknowns, and numbers that fix v."""

    equations: tuple[Any, ...]
    unknowns: tuple[Any, ...]
    numbers: tuple[Any, ...]


@functools.lru_cache(maxsize=128)
def _kind(kind: str, zero: tuple[Any, ...], states: tuple[Any, ...], parameter: Any) -> _Kind:
    """The equations of a kind, of f(x) - x for those of maps."""
    n = len(states)
    slopes = [[row.diff(x) for x in states] for row in zero]
    v, w, a, b = (sp.symbols(f"{name}0:{n}", cls=sp.Dummy, real=True) for name in "vwlm")

    def times(vector: Sequence[Any]) -> list[Any]:
        return [
            sp.Add(*(s * one for s, one in zip(row, vector, strict=True) if s != 0))
            for row in slopes
        ]

    def dot(first: Sequence[Any], second: Sequence[Any]) -> Any:
        return sp.Add(*(x * y for x, y in zip(first, second, strict=True)))

    def rows(vector: Sequence[Any], terms: Sequence[Any]) -> list[Any]:
        return [row + term for row, term in zip(times(vector), terms, strict=True)]

    s, c = sp.Dummy("s", real=True), sp.Dummy("c", real=True)
    if kind == "fold":
        return _Kind((*zero, *times(v), dot(a, v) - 1), (*states, parameter, *v), a)
    if kind == "period_doubling":
        doubled = rows(v, [2 * one for one in v])
        return _Kind((*zero, *doubled, dot(a, v) - 1), (*states, parameter, *v), a)
    unknowns = (*states, parameter, s, *v, *w)
    if kind == "hopf":
        both = rows(v, [s * one for one in w]) + rows(w, [-s * one for one in v])
        return _Kind((*zero, *both, dot(a, v) - 1, dot(a, w)), unknowns, a)
    if kind == "neutral_saddle":
        both = rows(v, [-s * one for one in v]) + rows(w, [s * one for one in w])
        return _Kind((*zero, *both, dot(a, v) - 1, dot(b, w) - 1), unknowns, (*a, *b))
    both = rows(v, [(1 - c) * x + s * y for x, y in zip(v, w, strict=True)])
    both += rows(w, [(1 - c) * y - s * x for x, y in zip(v, w, strict=True)])
    last = (dot(a, v) - 1, dot(a, w), c**2 + s**2 - 1)
    return _Kind((*zero, *both, *last), (*states, parameter, s, c, *v, *w), a)


#: Kinds whose equations are solved.
ENCLOSED = ("fold", "hopf", "neutral_saddle", "period_doubling", "torus")


def _specials(
    equations: Equations, chain: _Chain, marks: Sequence[Mark], errors: Array, units: Array
) -> list[Enclosure]:
    """What is proved of special points, all of a kind at once."""
    found: dict[int, Enclosure] = {}
    for kind in ENCLOSED:
        places = [i for i, mark in enumerate(marks) if mark.kind == kind]
        if places:
            some = [marks[i] for i in places]
            found |= zip(places, _of_kind(equations, kind, some, chain, units), strict=True)
    for i, mark in enumerate(marks):
        if i not in found:
            found[i] = _other(mark, errors)
    return [found[i] for i in range(len(marks))]


def _other(mark: Mark, errors: Array) -> Enclosure:
    """What is proved of a point that no equations are solved for."""
    error = errors[mark.place]
    if mark.kind == "end":
        known = bool(np.isfinite(error).all())
        reason = "" if known else "the stretch next to it is not proved"
        low, high = np.nextafter(mark.u - error, -np.inf), np.nextafter(mark.u + error, np.inf)
        return Enclosure(known, low, high, reason)
    nothing = np.full(len(mark.u), np.nan)
    if mark.kind in CROSSINGS:
        reason = (
            "branches meet: whether they do, or pass each other closely, no interval tells unless "
            "a symmetry or a factor of the formulas splits them"
        )
    else:
        reason = f"{mark.kind.replace('_', ' ')} points are not enclosed"
    return Enclosure(False, nothing, nothing, reason)


def _of_kind(
    equations: Equations, kind: str, marks: Sequence[Mark], chain: _Chain, units: Array
) -> list[Enclosure]:
    n, count = len(equations.states), len(marks)
    form = _kind(kind, equations.zero(), equations.states, equations.parameter)
    values = {
        symbol: np.full(count, value)
        for symbol, value in equations.values.items()
        if symbol != equations.parameter
    }
    u = np.array([mark.u for mark in marks])
    start, numbers, known = _starts(equations, kind, u, units[:n])
    values |= dict(zip(form.numbers, numbers.T, strict=True))
    own = np.ones(len(form.unknowns))
    own[: n + 1] = units
    for k in range(len(form.unknowns) - n, n + 1, -n):
        own[k : k + n] = units[:n]
    system = System(form.equations, form.unknowns, values, own)
    (low, high), held = enclosures(system, start / own)
    low, high = low * own, high * own
    found = []
    for i, mark in enumerate(marks):
        shown = n + 1 + (kind in ("hopf", "neutral_saddle")) + 2 * (kind == "torus")
        if not (held[i] and known[i]):
            nothing = np.full(shown, np.nan)
            found.append(Enclosure(
                False, nothing, nothing,
                "no box about it holds exactly one: it is degenerate, or nearly so, or bounds of "
                "the formulas are too wide",
            ))  # fmt: skip
            continue
        reason, box = "", slice(0, n + 1)
        # Where omega, sigma or the sine is 0 these equations hold at folds and doublings, too.
        pair = kind in ("hopf", "neutral_saddle", "torus")
        bad = pair and not (low[i, n + 1] > 0.0 or high[i, n + 1] < 0.0)
        if bad:
            reason = "its two eigenvalues may be one, of a fold or a doubling"
        elif not _on(chain, mark.place, low[i, box] / units, high[i, box] / units):
            reason = "no tube holds it: whether it is on this branch is not proved"
        found.append(Enclosure(not bad, low[i, :shown], high[i, :shown], reason))
    return found


def _on(chain: _Chain, index: int, low: Array, high: Array) -> bool:
    """Whether a box of a zero lies in a tube next to a point, so that it is on the curve."""
    near = (chain.owner == index - 1) | (chain.owner == index)
    return _held(chain._replace(tubes=chain.tubes.rows(near)), low, high)


def _held(chain: _Chain, low: Array, high: Array) -> bool:
    """Whether a box of a zero lies in a tube, so that it is on the curve."""
    tubes = chain.tubes
    count = len(tubes.middle)
    center, radius = 0.5 * low + 0.5 * high, 0.5 * (high - low) * (1.0 + 4.0 * UNIT)
    axes = np.broadcast_to(np.eye(len(low)), (count, len(low), len(low)))
    held = tubes.hold(
        np.broadcast_to(center, (count, len(low))), axes, np.broadcast_to(radius, (count, len(low)))
    )
    return bool(held.any())


def _starts(
    equations: Equations, kind: str, u: Array, scale: Array
) -> tuple[Array, Array, list[bool]]:
    """Where equations of special points are nearly solved, and the numbers that fix vectors."""
    n = len(equations.states)
    values = {s: v for s, v in equations.values.items() if s != equations.parameter}
    unknowns = (*equations.states, equations.parameter)
    _, slopes, _ = System(equations.zero(), unknowns, values)(u, u)
    matrices = (0.5 * slopes[0] + 0.5 * slopes[1])[:, :, :n] * scale / scale[:, None]
    starts, numbers, known = [], [], []
    for point, matrix in zip(u, matrices, strict=True):
        usable = bool(np.isfinite(matrix).all())
        start, number = _start(kind, matrix if usable else np.eye(n), scale)
        starts.append(np.concatenate([point, start]))
        numbers.append(number)
        known.append(usable)
    return np.array(starts), np.array(numbers), known


def _start(kind: str, matrix: Array, scale: Array) -> tuple[Array, Array]:
    """Vectors and numbers of a special point whose scaled derivatives are those of a flow."""
    n = len(matrix)
    if kind in ("fold", "period_doubling"):
        shift = 0.0 if kind == "fold" else 2.0
        v = np.linalg.svd(matrix + shift * np.eye(n))[2][-1]
        return v * scale, v / scale
    values, vectors = np.linalg.eig(matrix)
    if kind == "neutral_saddle":
        sums = np.abs(values[:, None] + values) + np.where(np.eye(n) > 0, np.inf, 0.0)
        i, j = np.unravel_index(np.argmin(sums), sums.shape)
        i, j = (i, j) if values[i].real > values[j].real else (j, i)
        v, w = vectors[:, i].real, vectors[:, j].real
        v, w = v / np.linalg.norm(v), w / np.linalg.norm(w)
        sigma = 0.5 * (values[i] - values[j]).real
        return np.concatenate([[sigma], v * scale, w * scale]), np.append(v / scale, w / scale)
    if kind == "hopf":
        away = np.abs(values.real) / np.where(values.imag > 0.0, np.abs(values), 1e-300)
    else:
        away = np.abs(np.abs(values + 1.0) - 1.0) / np.where(values.imag > 0.0, 1.0, 1e-300)
    k = int(np.argmin(np.where(values.imag > 0.0, away, np.inf)))
    q = vectors[:, k]
    # Turned so that its parts are orthogonal.
    q = q * np.exp(-0.5j * np.angle(np.sum(q * q)))
    q = q / np.linalg.norm(q.real)
    angle = [values[k].imag] if kind == "hopf" else [values[k].imag, values[k].real + 1.0]
    return np.concatenate([angle, q.real * scale, q.imag * scale]), q.real / scale


def missing_rule(equations: Equations) -> str | None:
    """The name of a function of which no bounds are known."""
    try:
        System(equations.zero(), (*equations.states, equations.parameter), dict(equations.values))
    except NoRule as missing:
        return str(missing)
    return None
