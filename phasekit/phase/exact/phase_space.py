"""Equilibria and separatrices of phi'' = -V'(phi), with their types. Arrays in, arrays out."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from phasekit.arrays import Array
from phasekit.numerics.launch import Arrays, launch
from phasekit.phase.exact.kernels import phase_space as kernels
from phasekit.phase.exact.kernels.equilibria import UNDECIDED, exact_discriminant

Shapes = tuple[tuple[tuple[int, ...], Any], ...]

NOTHING: Array = np.empty(0)


def solve(
    kernel: Callable[..., None],
    shapes: tuple[Shapes, ...],
    count: int,
    coefficients: tuple[npt.ArrayLike, npt.ArrayLike, npt.ArrayLike],
    threads: int | None,
    exact: Array = NOTHING,
) -> Iterator[Arrays]:
    """Run a kernel over broadcast coefficients.

    ``shapes`` gives, for each group of outputs, the trailing shape and dtype of its arrays, and
    ``count`` the place of n_equilibria in the first group. ``threads`` defaults to all cores.
    Where the kernel leaves a number open, it is called again with the ``exact`` discriminants.
    """
    arrays = [np.asarray(value, dtype=float) for value in coefficients]
    shape = np.broadcast_shapes(*(array.shape for array in arrays))
    # Copies: numba compiles a kernel anew for arrays that are read-only or not contiguous.
    flat = tuple(np.array(np.broadcast_to(array, shape)).reshape(-1) for array in arrays)
    size = flat[0].size
    groups = [tuple(np.empty((size, *tail), dtype) for tail, dtype in group) for group in shapes]
    launch(kernel, (*flat, exact), size, groups, threads)
    undecided = np.flatnonzero(groups[0][count] == UNDECIDED)
    if undecided.size:
        A, B, C = (array[undecided] for array in flat)
        exact = np.array([exact_discriminant(*abc) for abc in zip(A, B, C, strict=True)])
        decided = solve(kernel, shapes, count, (A, B, C), threads, exact)
        for group, part in zip(groups, decided, strict=True):
            for array, values in zip(group, part, strict=True):
                array[undecided] = values
    return (tuple(array.reshape(shape + array.shape[1:]) for array in group) for group in groups)


POINT = ((4,), float)
POINTS = (POINT, ((4,), np.int8), POINT, POINT, POINT, POINT, ((), np.int8), ((), float))
COUNT = 6


class Equilibria(NamedTuple):
    """Equilibria of each system; the last axis of the first six is the label.

    Labels are lower_center, lower_saddle, upper_center, upper_saddle, by energy. A fold's merged
    pair stands as lower_saddle; a cusp's triple as lower_center or upper_saddle.
    """

    phi: Array
    """Angle in (-pi, pi], rad."""
    kind: npt.NDArray[np.int8]
    """`EquilibriumKind`."""
    energy: Array
    """V(phi), 1/s^2."""
    curvature: Array
    """V''(phi), 1/s^2; exactly 0 where degenerate."""
    natural_frequency: Array
    """sqrt(V'') of centers, rad/s."""
    exponent: Array
    """sqrt(-V'') of saddles, 1/s."""
    n_equilibria: npt.NDArray[np.int8]
    """Number of distinct equilibria: 4, 3 (fold), 2, 0 (no force), -1 (invalid)."""
    fold_margin: Array
    """1 - (|B/A|^(2/3) + |C/A|^(2/3))^(3/2): positive where four exist, 0 on the fold."""


def equilibria(
    A: npt.ArrayLike, B: npt.ArrayLike, C: npt.ArrayLike, *, threads: int | None = None
) -> Equilibria:
    """All equilibria of B sin phi - A sin phi cos phi - C cos phi = 0, with their types.

    Complete: after reduction to A, B, C >= 0 by symmetry, the first quadrant holds one root (the
    global minimum), the third one (the global maximum), the second none, and the fourth two, one or
    none as Delta = (B^2 + C^2 - A^2)^3 + 27 A^2 B^2 C^2 is negative, zero or positive. The sign of
    Delta is that of exact arithmetic on the doubles given. [Veljovic2015] says that the equilibrium
    condition of (12) has to be solved numerically; it is a quartic. Angles are within a few units
    of rounding, also on folds and next to them. Cells that are not finite come back as NaN, with
    kind absent and n_equilibria -1.
    """
    (points,) = solve(kernels.equilibria, (POINTS,), COUNT, (A, B, C), threads)
    return Equilibria(*points)


SADDLE = ((2,), float)
SIDE = ((2, 2), float)
LOOPS = (
    ((), np.int8),
    ((), bool),
    SADDLE,
    SADDLE,
    SADDLE,
    ((2,), np.int8),
    SADDLE,
    SIDE,
    SIDE,
    SIDE,
)


class Separatrices(NamedTuple):
    """Separatrices of each system; axes are saddle (lower, upper), then side (left, right)."""

    topology: npt.NDArray[np.int8]
    """`Topology` of the whole phase portrait."""
    figure_eight: npt.NDArray[np.bool_]
    """Whether a homoclinic figure-eight exists: the papers' "trigger of coupled singularities",
    center, saddle, center, inside one closed curve."""
    saddle_phi: Array
    """Angle of the saddle, rad. A single saddle is the upper one; a fold's pair is absent."""
    saddle_energy: Array
    """Energy of the saddle, 1/s^2."""
    saddle_exponent: Array
    """sqrt(-V''), 1/s; 0 at a saddle-like cusp."""
    loop: npt.NDArray[np.int8]
    """`Loop`: what the separatrix of this saddle does."""
    winding_area: Array
    """Integral of |phi'| over 2 pi along one winding branch, rad^2/s."""
    turning_offset: Array
    """Signed angle from the saddle to the turning point, or to the partner saddle, rad."""
    turning_phi: Array
    """Angle of the turning point, or of the partner, in (-pi, pi], rad."""
    lobe_area: Array
    """Area of the closed lobe (heteroclinic: between both arcs on that side), rad^2/s."""


def phase_space(
    A: npt.ArrayLike, B: npt.ArrayLike, C: npt.ArrayLike, *, threads: int | None = None
) -> tuple[Equilibria, Separatrices]:
    """Equilibria and separatrices in one pass; see `equilibria` and `separatrices`."""
    shapes = (POINTS, LOOPS)
    points, loops = solve(kernels.phase_space, shapes, COUNT, (A, B, C), threads)
    return Equilibria(*points), Separatrices(*loops)


def separatrices(
    A: npt.ArrayLike, B: npt.ArrayLike, C: npt.ArrayLike, *, threads: int | None = None
) -> Separatrices:
    """Topology, turning points and areas of the separatrices, in closed form.

    With four equilibria the lower saddle carries a figure-eight round the two centers, and the
    upper one a pair of loops that wind round the cylinder; where both saddles have the same energy
    (A > 0 and B = 0, or A < 0 and C = 0) they are joined by heteroclinic arcs instead. With two
    equilibria the single saddle's loops wind. The homoclinic figure-eight and the trigger of
    coupled singularities are those of [Veljovic2015], section 4, and of [HedrihVeljovic2011].
    """
    return phase_space(A, B, C, threads=threads)[1]
