"""Period, action and turning points of orbits, in closed form. Arrays in, arrays out."""

from __future__ import annotations

from typing import NamedTuple, Self

import numpy as np
import numpy.typing as npt

from phasekit.arrays import Array
from phasekit.errors import EquilibriumKind, ParameterError
from phasekit.numerics.launch import Arrays, launch
from phasekit.phase.exact.kernels import portrait as kernels
from phasekit.phase.exact.phase_space import equilibria
from phasekit.phase.exact.states import flat, systems


class Orbits(NamedTuple):
    """Orbits, one for each state."""

    orbit_kind: npt.NDArray[np.int8]
    """`OrbitKind`."""
    orbit_energy: Array
    """Energy h = dphi^2/2 + V(phi), 1/s^2."""
    period: Array
    """Time of one round, s; inf on a separatrix and at a saddle, that of small oscillations at a
    center."""
    frequency: Array
    """2 pi/period, rad/s."""
    action: Array
    """Area inside the orbit over 2 pi, rad^2/s; of a rotation, that under one turn. NaN on a
    separatrix."""
    phi_min: Array
    """Least angle, rad, unwrapped round the state; NaN for a rotation."""
    phi_max: Array
    """Greatest angle, rad."""
    amplitude: Array
    """Half the way from the least angle to the greatest, rad."""

    @classmethod
    def from_kernel(cls, arrays: Arrays, shape: tuple[int, ...]) -> Self:
        """Return what a kernel found, from `allocate`, in the shape of its cells."""
        return cls._make(array.reshape(shape) for array in arrays)


def orbits(
    A: npt.ArrayLike,
    B: npt.ArrayLike,
    C: npt.ArrayLike,
    phi0: npt.ArrayLike,
    dphi0: npt.ArrayLike,
    *,
    threads: int | None = None,
) -> Orbits:
    """Orbits through states: kind, energy, period, frequency, action, turning points.

    The frequency is an arithmetic-geometric mean of distances between the Weierstrass roots of the
    motion; the action is the mean of phi'^2 over the phase, where the trapezoidal rule converges
    exponentially. Both keep their relative accuracy for small oscillations, and next to a
    separatrix, where the energy above the saddle is computed in double-double arithmetic. The
    motion is that of [Veljovic2015] (12), with the energy integral (14). Cells that are not finite
    come back as NaN, with the kind not_computed. An orbit is an equilibrium if dphi0 = 0 and
    V'(phi0) = 0 in floating point, and asymptotic if its energy is that of a saddle within the
    rounding of the state.
    """
    cells = systems(A, B, C, threads)
    shape = np.broadcast_shapes(cells.shape, np.shape(phi0), np.shape(dphi0))
    arrays = (cells.rows, cells.numbers(shape), flat(phi0, shape), flat(dphi0, shape))
    out = allocate(shape)
    launch(kernels.orbits, arrays, out[0].size, (out,), threads)
    return Orbits.from_kernel(out, shape)


def orbits_at_energy(
    A: npt.ArrayLike,
    B: npt.ArrayLike,
    C: npt.ArrayLike,
    energy: npt.ArrayLike,
    center: npt.ArrayLike | None = None,
    *,
    threads: int | None = None,
) -> Orbits:
    """Orbits of given energy round a center.

    Below the energy of the lower saddle the orbit stays in the center's well; above, it is the one
    that goes round both wells, or the rotation. Centers are 0, the lower, and 1, the upper one.
    Below the energy of the center, or where it is absent, the kind is not_computed and the rest
    NaN.
    """
    return _at_levels(A, B, C, energy, 0 if center is None else center, 0, False, threads)


def orbits_at_gap(
    A: npt.ArrayLike,
    B: npt.ArrayLike,
    C: npt.ArrayLike,
    gap: npt.ArrayLike,
    saddle: npt.ArrayLike | None = None,
    side: npt.ArrayLike = 1,
    *,
    threads: int | None = None,
) -> Orbits:
    """Orbits by their energy above a saddle, where the energy itself has lost the digits.

    The gap, the energy minus that of the saddle, is negative inside. The saddle is as of
    `separatrix_motion`; the side, 0 left and 1 right of it, matters where the orbit stays in one
    well.
    """
    if saddle is None:
        lower = equilibria(A, B, C, threads=threads).kind[..., 1] == EquilibriumKind.SADDLE
        saddle = np.where(lower, 0, 1)
    return _at_levels(A, B, C, gap, saddle, side, True, threads)


def energy_rises(A: npt.ArrayLike, B: npt.ArrayLike, C: npt.ArrayLike) -> Array:
    """Heights of the wells, each with its own digits, where their energies have lost them.

    On a last axis: from the lower center, and from the upper one, to the saddle where its well
    ends; from the lower saddle to the upper one, 0 between equal saddles; from the lower center to
    the upper saddle. NaN where one is absent.
    """
    cells = systems(A, B, C, None)
    out = (np.empty((cells.A.size, 4)),)
    launch(kernels.rises, (cells.rows,), cells.A.size, (out,), None)
    return out[0].reshape(*cells.shape, 4)


def _at_levels(
    A: npt.ArrayLike,
    B: npt.ArrayLike,
    C: npt.ArrayLike,
    level: npt.ArrayLike,
    point: npt.ArrayLike,
    side: npt.ArrayLike,
    gap: bool,
    threads: int | None,
) -> Orbits:
    for name, value in (("saddle" if gap else "center", point), ("side", side)):
        if not np.isin(value, (0, 1)).all():
            raise ParameterError(f"{name}: got {value!r}, wants 0 or 1")
    cells = systems(A, B, C, threads)
    shape = np.broadcast_shapes(cells.shape, np.shape(level), np.shape(point), np.shape(side))
    arrays = (
        cells.rows,
        cells.points.energy,
        cells.numbers(shape),
        flat(level, shape),
        flat(point, shape),
        flat(side, shape),
        gap,
    )
    out = allocate(shape)
    launch(kernels.levels, arrays, out[0].size, (out,), threads)
    return Orbits.from_kernel(out, shape)


def allocate(shape: tuple[int, ...]) -> Arrays:
    """Room for the orbits of all cells of a shape."""
    size = int(np.prod(shape, dtype=int))
    return (np.empty(size, np.int8), *(np.empty(size) for _ in range(7)))
