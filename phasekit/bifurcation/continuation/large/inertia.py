"""Real eigenvalues of symmetric f_x that cross zero between points, none hidden by another.

No eigenvalue moves by more than f_x does (Weyl), and pivots count those within that of zero: where
none is, none crosses. Where more are than the count changes by, their vectors tell which do.
"""

from __future__ import annotations

import functools
from typing import Any

import numpy as np
import scipy.sparse as sp

from phasekit.arrays import Array
from phasekit.bifurcation.continuation.large.curve import LargeCurve
from phasekit.bifurcation.continuation.large.field import DENSE
from phasekit.bifurcation.continuation.large.hopf import Part, parts_of
from phasekit.bifurcation.continuation.large.path import Between
from phasekit.numerics.factors import Factors, is_symmetric
from phasekit.numerics.rightmost import Spectrum, nearest_to_zero

TOGETHER = 8  # steps that are looked at together
MORE = 1.0 + 2.0**-20  # of how far f_x moves: of rounding


def moved(one: Any, two: Any) -> float:
    """How far eigenvalues of a symmetric matrix move to those of another one at most."""
    gap = abs(sp.csr_array(two - one))
    return MORE * float(np.max(np.asarray(gap.sum(axis=1)), initial=0.0))


def next_to_zero(matrix: Any, width: float) -> int | None:
    """How many eigenvalues are within a width of zero; None if pivots do not tell."""
    if not width > 0.0:
        return 0
    unit = width * sp.eye_array(matrix.shape[0], format="csc")
    above, below = (
        Factors(sp.csc_array(matrix + k * unit), symmetric=True).positive for k in (1.0, -1.0)
    )
    return None if above is None or below is None else above - below


def positive_of_full(matrix: Any) -> int:
    """How many eigenvalues of a symmetric matrix are positive, where pivots do not tell.

    -1 if it is not symmetric, or too large to be filled.
    """
    if matrix.shape[0] > DENSE or not is_symmetric(matrix):
        return -1
    return int(np.sum(np.linalg.eigvalsh(matrix.toarray()) > 0.0))


def suspects(curve: LargeCurve, points: Array, positive: Array) -> list[int]:
    """Places of steps between points in which more may cross zero than the counts change by."""
    found: list[int] = []

    def look(matrices: list[Any], first: int) -> None:
        """Of some points in turn, the first of which has a place."""
        middle = len(matrices) // 2
        here = matrices[middle]
        width = max(moved(here, other) for k, other in enumerate(matrices) if k != middle)
        near = next_to_zero(here, width) if np.isfinite(width) else None
        if near == 0:
            return
        if len(matrices) == 2:
            change = abs(int(positive[first + 1]) - int(positive[first]))
            if near is None or near > change:
                found.append(first)
            return
        look(matrices[: middle + 1], first)
        look(matrices[middle:], first + middle)

    for first in range(0, len(points) - 1, TOGETHER):
        some = points[first : first + TOGETHER + 1]
        look(
            [curve.sparse.matrix(u[: curve.n].copy(), curve.parameters_at(u)) for u in some], first
        )
    return found


def spectrum_next_to_zero(matrix: Any, width: float) -> Spectrum:
    """The eigenvalues within a width of zero, with their vectors; none if pivots do not tell."""
    count, n = next_to_zero(matrix, width), matrix.shape[0]
    values, vectors = np.empty(0, dtype=complex), np.empty((n, 0), dtype=complex)
    found = nearest_to_zero(matrix, count) if count else None
    if found is not None:
        values, vectors = found
    if count is None or len(values) < count:
        return Spectrum(values, False, near=True)
    return Spectrum(values, True, some=lambda: (values, vectors, np.conj(vectors.T)), near=True)


def parts_by_vectors(curve: LargeCurve, chord: Between) -> list[Part]:
    """Parts of a chord in which single eigenvalues cross zero, by vectors of those next to it."""
    one, two = (
        curve.sparse.matrix(u[: curve.n].copy(), curve.parameters_at(u))
        for u in (chord.a, chord.a + chord.chord)
    )
    spectrum = functools.partial(spectrum_next_to_zero, width=2.0 * moved(one, two))
    return list(parts_of(curve, chord, (spectrum(one), spectrum(two)), spectrum=spectrum))
