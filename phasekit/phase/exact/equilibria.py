"""All equilibria of phi'' = -V'(phi), with their types. Arrays in, arrays out."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from phasekit.phase.exact.kernels import phase_space as kernels
from phasekit.phase.exact.solve import solve

Array = npt.NDArray[np.float64]

POINT = ((4,), float)
SHAPES = (POINT, ((4,), np.int8), POINT, POINT, POINT, POINT, ((), np.int8), ((), float))
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
    (points,) = solve(kernels.equilibria, (SHAPES,), COUNT, (A, B, C), threads)
    return Equilibria(*points)
