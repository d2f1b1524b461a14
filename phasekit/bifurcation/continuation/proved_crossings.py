"""Branch points that are proved, where formulas split them, and tubes that pass them."""

from __future__ import annotations

import itertools
from collections.abc import Iterator, Mapping
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from phasekit.bifurcation.continuation.enclosed_points import Enclosure, Equations
from phasekit.bifurcation.continuation.splits import Split, splits
from phasekit.bifurcation.continuation.tube_chains import Chain, chain_of, held
from phasekit.numerics.intervals.krawczyk import UNIT, inverses
from phasekit.numerics.intervals.tubes import Tubes, joined, tubes_about
from phasekit.numerics.intervals.zeros import Boxes, System, enclosures, holds_one
from phasekit.numerics.later import later

if TYPE_CHECKING:
    import sympy as sp
else:
    sp = later("sympy")

Array = npt.NDArray[np.float64]
Flags = npt.NDArray[np.bool_]

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
