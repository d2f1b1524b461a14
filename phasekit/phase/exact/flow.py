"""Motion in closed form: states after any time. Arrays in, arrays out."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from phasekit.arrays import Array
from phasekit.errors import ParameterError
from phasekit.numerics.launch import launch
from phasekit.phase.exact.kernels import portrait as kernels
from phasekit.phase.exact.states import flat, systems


class Motion(NamedTuple):
    """States along a motion."""

    motion_phi: Array
    """Angle, rad, continuous in time."""
    motion_dphi: Array
    """Angular velocity, 1/s."""


def flow(
    A: npt.ArrayLike,
    B: npt.ArrayLike,
    C: npt.ArrayLike,
    phi0: npt.ArrayLike,
    dphi0: npt.ArrayLike,
    t: npt.ArrayLike,
    *,
    threads: int | None = None,
) -> Motion:
    """States after times t, exact for any t: no integration in time.

    Librations and rotations are elliptic functions of the phase, whose frequency is computed in
    double-double arithmetic, so that digits are not lost over many periods. Motion on a separatrix
    is elementary. Solves [Veljovic2015] (12). The shape of an orbit is worked out once for all its
    times if these lie on axes of their own. NaN where an input is not finite.
    """
    cells = systems(A, B, C, threads)
    states = np.broadcast_shapes(cells.shape, np.shape(phi0), np.shape(dphi0))
    shape = np.broadcast_shapes(states, np.shape(t))
    number = np.arange(int(np.prod(states, dtype=int))).reshape(states)
    # Axes along which the state does not change come last, so that it is prepared once.
    spread = (1,) * (len(shape) - len(states)) + states
    order = sorted(range(len(shape)), key=lambda axis: spread[axis] == 1)
    arrays = (
        cells.rows,
        cells.numbers(states),
        flat(phi0, states),
        flat(dphi0, states),
        np.array(np.broadcast_to(number, shape).transpose(order)).reshape(-1),
        np.array(np.broadcast_to(np.asarray(t, float), shape).transpose(order)).reshape(-1),
    )
    size = arrays[-1].size
    out = (np.empty(size), np.empty(size))
    launch(kernels.flow, arrays, size, (out,), threads)
    moved = tuple(shape[axis] for axis in order)
    return Motion(*(array.reshape(moved).transpose(np.argsort(order)) for array in out))


def separatrix_motion(
    A: npt.ArrayLike,
    B: npt.ArrayLike,
    C: npt.ArrayLike,
    t: npt.ArrayLike,
    saddle: npt.ArrayLike | None = None,
    side: npt.ArrayLike = 1,
    *,
    threads: int | None = None,
) -> Motion:
    """Motion on a separatrix, in elementary functions of time.

    With z = cot((phi - phi_s)/2), z k^2 = S2 +- sqrt(D) cosh kt on a lobe, S2 +- sqrt(-D) sinh kt
    on a winding loop, and S2 + c exp(-kt) on a heteroclinic arc. The homoclinic orbits of
    [Veljovic2015], section 4. Time is 0 at the turning point of a lobe, where a winding loop is
    opposite to the saddle, and half-way to the partner on a heteroclinic arc. The saddle is 0, the
    lower one, or 1, the upper one; -1: the lower one where there are two, else the only one. The
    motion leaves it on the side 0, left, or 1, right; its angle is continuous from the saddle's.
    """
    saddle = -1 if saddle is None else saddle
    for name, value, wanted in (("saddle", saddle, (-1, 0, 1)), ("side", side, (0, 1))):
        if not np.isin(value, wanted).all():
            raise ParameterError(f"{name}: got {value!r}, wants one of {wanted}")
    cells = systems(A, B, C, threads)
    shape = np.broadcast_shapes(cells.shape, *(np.shape(x) for x in (t, saddle, side)))
    arrays = (
        cells.rows,
        cells.numbers(shape),
        flat(saddle, shape),
        flat(side, shape),
        flat(t, shape),
    )
    size = arrays[-1].size
    out = (np.empty(size), np.empty(size))
    launch(kernels.separatrix_motion, arrays, size, (out,), threads)
    return Motion(*(array.reshape(shape) for array in out))
