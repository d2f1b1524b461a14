"""Motion, labelled: states after any time, and motion on a separatrix.

Array parameters of the system and of the states span the result's dims, times the dim `time`.
"""

from __future__ import annotations

from typing import Any

import xarray as xr

from phasekit.cells.dispatch import pass_from
from phasekit.cells.states import at_states
from phasekit.labelled.orbits import noted
from phasekit.labels.arguments import NumberLike, state_arguments
from phasekit.systems.as_system import as_system
from phasekit.table.quantities import select


@state_arguments
def flow(system: Any, phi0: NumberLike, dphi0: NumberLike, t: NumberLike) -> xr.Dataset:
    """States after times, exact for any time: no integration, so no error that grows with steps.

    Parameters
    ----------
    system : system
        Any system.
    phi0, dphi0 : float, 1-D array_like or xarray.DataArray
        States at t = 0: angles in rad, angular velocities in s^-1.
    t : float, 1-D array_like or xarray.DataArray
        Times in s, of either sign and in any order. A bare array makes the dim ``time``.

    Returns
    -------
    xarray.Dataset
        ``motion_phi`` in rad, continuous in time (a rotation runs past pi), and ``motion_dphi``
        in s^-1.

    Raises
    ------
    ParameterError
        If an argument is unusable, or bare arrays of states differ in length.

    Notes
    -----
    Solves [Veljovic2015] (12) in elliptic functions, on a separatrix in elementary ones.

    Examples
    --------
    >>> import numpy as np
    >>> import phasekit as pk
    >>> disk = pk.GyroRotorDisk(beta=18 * pk.deg, e=0.001153, a=0.002, r=0.2, omega1=24 * pk.rpm)
    >>> pk.flow(disk, [0.1, 0.2, 0.3], 0.0, np.linspace(0.0, 60.0, 601)).motion_phi.dims
    ('point', 'time')
    """
    states = {"phi0": ("state_phi", phi0), "dphi0": ("state_dphi", dphi0), "t": ("time", t)}
    return at_states(system, select("motion"), states)


def separatrix_motion(
    system: Any, t: NumberLike, *, saddle: str | int | None = None, side: str = "right"
) -> xr.Dataset:
    """Motion on the separatrix of a saddle, in elementary functions.

    Parameters
    ----------
    system : system
        Any system.
    t : float, 1-D array_like or xarray.DataArray
        Times in s: 0 at the turning point of a lobe, where a winding separatrix is opposite to
        the saddle, and half-way to the partner between two saddles of equal energy. A bare array
        makes the dim ``time``.
    saddle : {"lower", "upper"}, or int for a `Potential`, optional
        The saddle; by default the lower one where there are two (that of a figure-eight), else
        the only one (upper).
    side : {"right", "left"}, default "right"
        The side of the saddle to which the motion leaves it.

    Returns
    -------
    xarray.Dataset
        ``motion_phi`` in rad, continuous from the saddle's angle, and ``motion_dphi`` in s^-1; NaN
        where the saddle is absent.

    Raises
    ------
    ParameterError
        If an argument is unusable.

    Notes
    -----
    The homoclinic orbits of [Veljovic2015], section 4. `separatrices` gives the turning points.

    Examples
    --------
    >>> import phasekit as pk
    >>> ds = pk.separatrix_motion(pk.Coefficients(2.0, 1.0, 0.0), [-40.0, 0.0, 40.0])
    >>> abs(ds.motion_dphi.values.round(9)).tolist()
    [0.0, 0.0, 0.0]
    """
    system = as_system(system)
    one, notes = pass_from(system, "motion", "time", saddle=saddle, side=side)
    ds = at_states(system, select("motion"), {"t": ("time", t)}, (one,))
    return noted(ds, **notes)
