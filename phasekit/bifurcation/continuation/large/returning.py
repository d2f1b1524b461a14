"""Eigenvalues of many states that cross the imaginary axis and come back within one step.

No count tells them. Parabolas through three points of the path in turn say which may have been on
the other side in between, and eigenvalues there whether they were.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import Any

import numpy as np
import numpy.typing as npt

from phasekit.arrays import Complex
from phasekit.bifurcation.continuation.large.hopf import DEPTH, Part, parts_of
from phasekit.bifurcation.continuation.large.path import Between
from phasekit.numerics.rightmost import Spectrum

NEARLY = 0.5  # of how far a parabola bends between two points, by which it may miss the axis
ROUNDS = 4  # parabolas through a point that was looked at
APART = 0.02  # of a step, by which places differ


def places_between(known: list[tuple[float, Complex]], k: int) -> list[float]:
    """Where between two of some places eigenvalues may be on the other side of the axis.

    They are known at the two, the first of which has the number k, and at neighbours.
    """
    (s, first), (t, last) = known[k], known[k + 1]
    if not (len(first) and len(last)):
        return []
    left, right = first, last[_alike(first, last)]
    same = left.real * right.real > 0.0
    found: list[tuple[float, float]] = []
    for place, others in (known[k - 1 : k] or []) + known[k + 2 : k + 3]:
        if not len(others) or place in (s, t):
            continue
        third = others[_alike(left if place < s else right, others)].real
        slope = (right.real - left.real) / (t - s)
        bend = ((third - right.real) / (place - t) - slope) / (place - s)
        for at in np.flatnonzero(same & (bend * left.real > 0.0)):
            top = 0.5 * (s + t) - 0.5 * slope[at] / bend[at]
            if not s < top < t:
                continue
            bulge = abs(bend[at] * (top - s) * (t - top))
            straight = left[at].real + slope[at] * (top - s)
            if abs(straight) - bulge <= NEARLY * bulge:
                found.append((abs(straight) / bulge, float(top)))
    kept: list[float] = []
    for _, top in sorted(found):
        if all(abs(top - other) > APART * (t - s) for other in kept):
            kept.append(top)
    return sorted(kept[:ROUNDS])


def parts_with_returns(
    chord: Between, known: list[tuple[float, Complex]], k: int, ends: tuple[Spectrum, Spectrum],
    spectrum: Callable[[Any], Spectrum],
) -> Iterator[Part]:  # fmt: skip
    """Parts of a chord in which something crosses the axis, with what crosses it twice."""
    (s, _), (t, _) = known[k], known[k + 1]
    cuts, inside = [0.0, 1.0], [*ends]
    around = [*known]
    for _ in range(ROUNDS):
        places = [
            (place - s) / (t - s)
            for i in range(k, k + len(cuts) - 1) for place in places_between(around, i)
        ]  # fmt: skip
        places = [one for one in places if min(abs(one - cut) for cut in cuts) > APART]
        point = chord.point(places[0]) if places else None
        if point is None:
            break
        here = spectrum(point.matrix)
        i = int(np.searchsorted(cuts, places[0]))
        cuts.insert(i, places[0])
        inside.insert(i, here)
        around.insert(k + i, (s + places[0] * (t - s), here.values))
    for i in range(len(cuts) - 1):
        span, both = (cuts[i], cuts[i + 1]), (inside[i], inside[i + 1])
        yield from parts_of(chord.curve, chord, both, span, DEPTH, spectrum)


def _alike(one: Complex, others: Complex) -> npt.NDArray[np.intp]:
    """The nearest of others to each."""
    return np.asarray(np.argmin(np.abs(one[:, None] - others), axis=1))
