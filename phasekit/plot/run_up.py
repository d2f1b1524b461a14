"""Run-ups over time, with the loads of the bearings."""

from __future__ import annotations

import xarray as xr
from matplotlib.artist import Artist
from matplotlib.axes import Axes

from phasekit.labels.arguments import bad
from phasekit.plot.parts import labels, style

SPEED: style.Look = {"color": style.BLACK, "linestyle": (0, (4, 2)), "linewidth": 1.2}


def run_up(dataset: xr.Dataset, *, legend: bool = True, ax: Axes | None = None) -> Axes:
    r"""Draw the forces in the bearings during a run-up, and the support's speed over them.

    Parameters
    ----------
    dataset : xarray.Dataset
        One motion that `run_up` returns, with its forces.
    legend : bool
        Whether to name the lines under the axes.
    ax : matplotlib.axes.Axes, optional
        Where to draw; a new figure if left out. The speed has an axis of its own on the right.

    Returns
    -------
    matplotlib.axes.Axes

    Raises
    ------
    ParameterError
        If an argument is unusable.

    Examples
    --------
    >>> import numpy as np
    >>> import phasekit as pk
    >>> disk = pk.GyroRotorDisk(
    ...     beta=1.0, e=0.01, a=0.1, r=0.1, omega1=0.0, m=2.0, half_span=0.1
    ... )
    >>> ds = pk.run_up(
    ...     disk, omega1=lambda t: 5.0 * t, phi0=0.1, dphi0=0.0, t=np.linspace(0.0, 2.0, 201)
    ... )
    >>> ax = pk.plot.run_up(ds)
    >>> ax.get_ylabel()
    'force in the bearing (N)'
    """
    names = ("force_magnitude", "motion_omega1")
    ds = labels.dataset(dataset, "dataset", names, "pk.run_up of a disk with m and half_span")
    if ds.force_magnitude.dims != ("time", "bearing"):
        raise bad("dataset", ds, "one motion over time; select it first: ds.isel(point=0)")
    labels.monotone(ds.time, "time")
    axes = style.axes_for(ax, legend=legend)
    times = ds.time.values
    handles: list[Artist] = []
    for name, color in zip(ds.bearing.values, style.LOAD_COLORS, strict=False):
        force = ds.force_magnitude.sel(bearing=name).values
        handles += axes.plot(times, force, color=color, linewidth=1.4, label=f"bearing {name}")
    speeds = axes.twinx()
    handles += speeds.plot(times, ds.motion_omega1.values, label=r"$\omega_1$", **SPEED)
    speeds.set_ylabel(r"$\omega_1$ (rad/s)")
    axes.set_xlim(*sorted((float(times[0]), float(times[-1]))))
    axes.set_xlabel("$t$ (s)")
    axes.set_ylabel("force in the bearing (N)")
    if legend:
        style.legend_below(axes, handles)
    return axes
