"""The separatrices of each system: topology, turning points, areas. Arrays in, arrays out."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from phasekit.phase.exact import equilibria as points_floor
from phasekit.phase.exact.equilibria import Equilibria
from phasekit.phase.exact.kernels import phase_space as kernels
from phasekit.phase.exact.solve import solve

Array = npt.NDArray[np.float64]

SADDLE = ((2,), float)
SIDE = ((2, 2), float)
SHAPES = (
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
    shapes = (points_floor.SHAPES, SHAPES)
    points, loops = solve(kernels.phase_space, shapes, points_floor.COUNT, (A, B, C), threads)
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
