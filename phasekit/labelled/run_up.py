"""A disk whose support is run up or down: its motion, and the loads of its bearings."""

from __future__ import annotations

from typing import Any

import numpy as np
import xarray as xr

from phasekit.labelled.loads import bearing_forces, is_disk
from phasekit.labelled.motion import flow
from phasekit.labels.arguments import NumberLike, bad, call_checked
from phasekit.labels.grid import variable
from phasekit.motion.flow import accelerations
from phasekit.motion.prescribed import prescribed_at, span, table_of
from phasekit.systems.perturbed import Perturbed
from phasekit.systems.system import as_system, single


@call_checked
def run_up(
    disk: Any,
    *,
    omega1: Any,
    phi0: NumberLike,
    dphi0: NumberLike,
    t: NumberLike,
    damping: float = 0.0,
    quadratic: float = 0.0,
    torque: float = 0.0,
    rtol: float | None = None,
    atol: float | None = None,
) -> xr.Dataset:
    """Motion and bearing forces of a disk while the angular velocity of its support changes.

    Parameters
    ----------
    disk : GyroRotorDisk
        One disk; its own omega1 does not matter. With ``m`` and ``half_span`` there are forces.
    omega1 : callable, (times, values) or xarray.DataArray
        Angular velocity of the support in s^-1 as a function of time in s, or as a table: two
        arrays, or a DataArray on the dim ``time``, which reaches over all times of the motion.
        Through a table goes a spline of the fifth degree.
    t : float, 1-D array_like or xarray.DataArray
        Times in s, of either sign. A bare array makes the dim ``time``.
    damping, quadratic, torque : float, default 0
        Of the disk on its shaft, as in `Perturbed`.

    Returns
    -------
    xarray.Dataset
        The motion: ``motion_phi`` in rad, ``motion_dphi`` and ``motion_omega1`` in s^-1, ``ddphi``
        and ``domega1`` in s^-2; and all that `bearing_forces` gives along it. `bearing_forces`,
        `fixed_bearing_forces` and `rotators` take it as a motion.

    Raises
    ------
    ParameterError
        If an argument is unusable, or a table does not reach over the motion.

    Warns
    -----
    RuntimeWarning
        If a motion ends before its last time, as in `flow`; it is NaN from there on.

    Notes
    -----
    ``phi'' + V'(phi; omega1(t)) = -omega1' kappa cos phi - damping phi' - ...`` with ``kappa`` as
    in `Perturbed`: the torque of omega1' is lost where omega1(t) is put into [Veljovic2015] (12).

    Examples
    --------
    >>> import numpy as np
    >>> import phasekit as pk
    >>> disk = pk.GyroRotorDisk(
    ...     beta=1.0, e=0.01, a=0.1, r=0.1, omega1=0.0, m=2.0, half_span=0.1
    ... )
    >>> ds = pk.run_up(
    ...     disk, omega1=lambda t: 5.0 * t, phi0=0.1, dphi0=0.0, t=np.linspace(0.0, 2.0, 5),
    ...     damping=0.2,
    ... )
    >>> ds.motion_omega1.values.round(12)
    array([ 0. ,  2.5,  5. ,  7.5, 10. ])
    >>> ds.force.dims
    ('time', 'bearing', 'disk_axis')
    """
    found: Any = as_system(disk)
    if not is_disk(found):
        raise bad("disk", disk, "a GyroRotorDisk")
    if omega1 is None or isinstance(omega1, (int, float)):
        hint = "for a constant omega1 use pk.flow and pk.bearing_forces"
        raise bad("omega1", omega1, "a function of time, or a table (times, values)", hint)
    if isinstance(omega1, xr.DataArray):
        if omega1.dims != ("time",) or "time" not in omega1.coords:
            raise bad("omega1", omega1, "a DataArray on the dim 'time', with its coordinate")
        omega1 = (omega1.time.values, omega1.values)
    own: dict[str, Any] = {"damping": damping, "quadratic": quadratic, "torque": torque}
    system = Perturbed(found, **own, omega1=omega1)
    _, parameters = single(system)
    ds = flow(system, phi0, dphi0, t, rtol=rtol, atol=atol)
    law, times = system.law, np.asarray(ds.time.values, dtype=float)
    table = table_of(law.prescribed, *span(times))
    speed, change = prescribed_at(table, times)
    spread = xr.broadcast(ds.motion_phi, ds.time)[1].values
    states = ds.motion_phi.values, ds.motion_dphi.values
    bend = accelerations(law, law.values(*parameters.values()), spread, *states)
    rows = {
        "motion_omega1": (ds.time.dims, speed, "s-1",
                          "angular velocity of the support", "omega1(t)"),
        "domega1": (ds.time.dims, change, "s-2",
                    "angular acceleration of the support", "omega1'(t)"),
        "ddphi": (ds.motion_phi.dims, bend, "s-2", "angular acceleration of the disk",
                  "phi'' = -V'(phi; omega1) - omega1' kappa cos phi - d phi' - q |phi'| phi' + N"),
    }  # fmt: skip
    source = "Lagrange's equations, with the torque of omega1'"
    for name, (dims, array, units, text, equation) in rows.items():
        attrs = {"long_name": text, "units": units, "equation": equation, "source": source}
        ds[name] = variable(map(str, dims), array, attrs)
    ds = ds.drop_vars("omega1")
    if getattr(found, "m", None) is None or getattr(found, "half_span", None) is None:
        return ds
    forces = bearing_forces(found, ds)
    order = [dim for dim in map(str, ds.motion_phi.dims)]
    loads = {name: force.transpose(*order, ...).variable for name, force in forces.items()}
    return ds.assign(loads).assign_coords(
        {dim: forces[dim] for dim in ("bearing", "disk_axis", "component")}
    )
