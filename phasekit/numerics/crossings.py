"""Eigenvalues that cross the imaginary axis between two matrices, by their vectors at both.

With the projectors P and Q on what grows at one and at the other, trace(P Q) is how many grow at
both: it needs no order of eigenvalues, nor vectors of double ones that are alike.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.optimize import linear_sum_assignment

from phasekit.arrays import Complex, Ints
from phasekit.numerics.rightmost import Spectrum

ALIKE = 0.5  # how much of a vector is the other's, from which on they are one that moves
WHOLE = 0.25  # distance of a trace from the whole number that it stands for


@dataclass(frozen=True)
class Crossings:
    """How many pairs and real eigenvalues cross, either way.

    ``single`` says that this is sure and not more than one, ``unclear`` that more may cross.
    """

    pairs: int
    real: int
    single: bool
    unclear: bool = False


def crossings(one: Spectrum, two: Spectrum) -> Crossings:
    """What crosses the axis between two spectra."""
    pairs, real = abs(one.pairs - two.pairs), abs(one.real - two.real)
    if not (one.near or (one.pairs + one.real and two.pairs + two.real)):
        return Crossings(pairs, real, pairs + real <= 1)
    known = one.modes is not None and two.modes is not None
    if not known and (one.near or two.near):
        return Crossings(0, 0, False, True)
    if one.modes is None or two.modes is None:
        others = are_others(one, two)
        single = pairs + real <= 1 and not others
        grow = 2 * (two.pairs - one.pairs) + two.real - one.real
        if not grow:  # a pair that became real, or none
            return Crossings(0, 0, single, others)
        return Crossings(pairs, abs(grow - 2 * (two.pairs - one.pairs)), single, others)
    kinds = [_kinds(values) for values in (one.modes[0], two.modes[0])]
    table = np.zeros((3, 3))  # of pairs that grow, real ones that do, and all others

    def alike(rows: Ints, columns: Ints) -> float:
        return float(shared_parts(one, two, rows, columns).sum().real)

    if one.near:
        # What grows at one end, and is farther from the axis at the other, crosses nothing.
        rest = [np.flatnonzero(values.real <= 0.0) for values in (one.modes[0], two.modes[0])]
        table[:2, 2] = [alike(a, rest[1]) for a in kinds[0]]
        table[2, :2] = [alike(rest[0], b) for b in kinds[1]]
    else:
        table[:2, :2] = [[alike(a, b) for b in kinds[1]] for a in kinds[0]]
        table[:2, 2] = [len(one) for one in kinds[0]] - table[:2].sum(axis=1)
        table[2, :2] = [len(one) for one in kinds[1]] - table[:, :2].sum(axis=0)
    whole = np.rint(table)
    unclear = bool(np.max(np.abs(table - whole)) > WHOLE)
    counts = np.maximum(whole, 0.0).astype(int).tolist()
    halves = [divmod(count, 2) for count in (counts[0][2], counts[2][0])]
    odd = sum(rest for _, rest in halves)
    pairs = sum(half for half, _ in halves)
    real = counts[1][2] + counts[2][1] + odd
    return Crossings(pairs, real, pairs + real <= 1 and not (unclear or odd), unclear)


def _kinds(values: Complex) -> list[Ints]:
    """Ints of pairs that grow, and of real ones that do."""
    grows, turns = values.real > 0.0, values.imag != 0.0
    return [np.flatnonzero(one) for one in (grows & turns, grows & ~turns)]


def shared_parts(
    one: Spectrum, two: Spectrum, rows: Ints | None = None, columns: Ints | None = None
) -> Complex:
    """Traces of products of projectors on single vectors: rows and columns have the sum 1.

    Of those in ``rows`` and ``columns`` alone, if they are given; empty if vectors are not known.
    """
    if one.modes is None or two.modes is None:
        return np.empty((0, 0), complex)
    (_, v, w), (_, x, y) = one.modes, two.modes
    if rows is not None:
        v, w = v[:, rows], w[rows]
    if columns is not None:
        x, y = x[:, columns], y[columns]
    return np.asarray((w @ x) * (y @ v).T)


def are_others(one: Spectrum, two: Spectrum) -> bool:
    """Whether as many that grow may be others, by values: one came while another went.

    So it may be where one at the right is nearer to one at the left of the other spectrum than to
    its own partner.
    """
    return one.complete and two.complete and any(
        _are_others(_sides(one.values, turns), _sides(two.values, turns))
        for turns in (True, False)
    )  # fmt: skip


def _are_others(one: tuple[Complex, Complex], two: tuple[Complex, Complex]) -> bool:
    gaps = np.abs(one[0][:, None] - two[0])
    if not gaps.size:
        return False
    i, j = linear_sum_assignment(gaps)
    for right, left in ((one[0][i], two[1]), (two[0][j], one[1])):
        nearest = np.abs(right[:, None] - left).min(axis=1, initial=np.inf)
        if np.any(nearest < gaps[i, j]):
            return True
    return False


def _sides(values: Complex, turns: bool) -> tuple[Complex, Complex]:
    mine = values[values.imag > 0.0] if turns else values[values.imag == 0.0]
    return mine[mine.real > 0.0], mine[mine.real <= 0.0]


def crossing_pair(one: Spectrum, two: Spectrum) -> tuple[complex, complex]:
    """The pair at both ends whose real part changes its sign: with vectors that are most alike.

    Without vectors, those nearest to each other.
    """
    more, less = (one, two) if one.pairs > two.pairs else (two, one)
    if more.modes is not None and less.modes is not None:
        a, b = more.modes[0], less.modes[0]
        likeness = np.abs(shared_parts(more, less)) * np.outer(
            (a.imag > 0.0) & (a.real > 0.0), (b.imag > 0.0) & (b.real <= 0.0)
        )
        i, j = np.unravel_index(np.argmax(likeness), likeness.shape)
        pair = _nearest(more.values, a[i]), _nearest(less.values, b[j])
        if likeness[i, j] > ALIKE:
            return pair if one.pairs > two.pairs else (pair[1], pair[0])
    right, left = _sides(more.values, True)[0], _sides(less.values, True)[1]
    if not len(left):
        left = less.values[less.values.imag > 0.0]
    if not len(left):
        left = right
    gaps = np.abs(right[:, None] - left)
    i, j = np.unravel_index(np.argmin(gaps), gaps.shape)
    pair = complex(right[i]), complex(left[j])
    return pair if one.pairs > two.pairs else (pair[1], pair[0])


def _nearest(values: Complex, value: complex) -> complex:
    return complex(values[np.argmin(np.abs(values - value))])
