"""Motion in closed form: states after any time. Arrays in, arrays out."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from phasekit.errors import ParameterError
from phasekit.numerics.launch import launch
from phasekit.phase.exact.kernels import portrait as kernels
from phasekit.phase.exact.states import flat, systems

Array = npt.NDArray[np.float64]


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
    double-double arithmetic, so that digits are not lost over many periods. Motion on a
    separatrix is elementary.

    Parameters
    ----------
    A, B, C : array_like
        Coefficients in 1/s^2.
    phi0, dphi0 : array_like
        States at t = 0: angles in rad, angular velocities in 1/s.
    t : array_like
        Times in s, of any sign and size. All six broadcast; the shape of an orbit is worked out
        once for all its times if these lie on axes of their own.
    threads : int, optional
        Number of threads for large arrays; all cores by default.

    Returns
    -------
    Motion
        NaN where an input is not finite.

    Notes
    -----
    Solves [Veljovic2015] (12).

    Examples
    --------
    >>> there = flow(2.0, 1.0, 0.3, 0.5, 0.1, 1e6)
    >>> back = flow(2.0, 1.0, 0.3, *there, -1e6)
    >>> round(float(back.motion_phi), 9)
    0.5
    """
    cells = systems(A, B, C, threads)
    states = np.broadcast_shapes(cells.shape, np.shape(phi0), np.shape(dphi0))
    shape = np.broadcast_shapes(states, np.shape(t))
    number = np.arange(int(np.prod(states, dtype=int))).reshape(states)
    # Axes along which the state does not change come last, so that it is prepared once.
    spread = (1,) * (len(shape) - len(states)) + states
    order = sorted(range(len(shape)), key=lambda axis: spread[axis] == 1)
    arrays = (
        *cells.arrays,
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
    on a winding loop, and S2 + c exp(-kt) on a heteroclinic arc.

    Parameters
    ----------
    A, B, C : array_like
        Coefficients in 1/s^2.
    t : array_like
        Times in s: 0 at the turning point of a lobe, where a winding loop is opposite to the
        saddle, and half-way to the partner on a heteroclinic arc.
    saddle : array_like of int
        0 for the lower saddle, 1 for the upper one; by default (-1) the lower one where there are
        two, else the only one.
    side : array_like of int
        Side on which the motion leaves the saddle: 0 left, 1 right. All six broadcast.
    threads : int, optional
        Number of threads for large arrays; all cores by default.

    Returns
    -------
    Motion
        The angle is continuous from the saddle's. NaN where the saddle is absent.

    Notes
    -----
    The homoclinic orbits of [Veljovic2015], section 4.

    Examples
    --------
    >>> motion = separatrix_motion(0.0, 1.0, 0.0, 0.0)
    >>> round(float(motion.motion_phi / np.pi), 9), float(motion.motion_dphi)
    (2.0, 2.0)
    """
    saddle = -1 if saddle is None else saddle
    for name, value, wanted in (("saddle", saddle, (-1, 0, 1)), ("side", side, (0, 1))):
        if not np.isin(value, wanted).all():
            raise ParameterError(f"{name}: got {value!r}, wants one of {wanted}")
    cells = systems(A, B, C, threads)
    shape = np.broadcast_shapes(cells.shape, *(np.shape(x) for x in (t, saddle, side)))
    arrays = (
        *cells.arrays,
        cells.numbers(shape),
        flat(saddle, shape),
        flat(side, shape),
        flat(t, shape),
    )
    size = arrays[-1].size
    out = (np.empty(size), np.empty(size))
    launch(kernels.separatrix_motion, arrays, size, (out,), threads)
    return Motion(*(array.reshape(shape) for array in out))
