"""Run-ups over time, with the loads of the bearings."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
import xarray as xr
from matplotlib.artist import Artist
from matplotlib.axes import Axes

from phasekit.inputs import call_checked
from phasekit.labels.arguments import bad
from phasekit.plot.parts import labels, style
from phasekit.plot.parts.units import Units

SPEED: style.Look = {"color": style.BLACK, "linestyle": (0, (1.5, 1.5)), "linewidth": 1.2}
BEARINGS: tuple[style.Look, ...] = (
    {"color": style.LOAD_COLORS[0], "linestyle": "-", "linewidth": 1.6},
    {"color": style.LOAD_COLORS[1], "linestyle": (0, (6, 2)), "linewidth": 1.6},
)
SPEEDS_UNIT = "rad/s"


@call_checked
def run_up(
    dataset: xr.Dataset,
    *,
    units: Mapping[str, str] | None = None,
    legend: bool = True,
    ax: Axes | None = None,
) -> Axes:
    r"""Draw the forces in the bearings during a run-up, and the support's speed over them.

    Parameters
    ----------
    dataset : xarray.Dataset
        One motion that `run_up` returns, with its forces.
    units : mapping of str to str, optional
        Units in which quantities are shown, by name: ``{"omega1": "rpm", "force": "kN"}``.
    legend : bool
        Whether to name the lines under the axes.
    ax : matplotlib.axes.Axes, optional
        Where to draw; a new figure if left out. The speed has an axis of its own on the right.

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
    ds, shown = Units.of_dataset(ds, "rad", units)
    if set(ds.force_magnitude.dims) != {"time", "bearing"}:
        raise bad("dataset", ds, "one motion over time; select it first: ds.isel(point=0)")
    labels.monotone(ds.time, "time")
    axes = style.axes_for(ax, legend=legend)
    times = ds.time.values * shown.scale("time", "s")
    force = "force_magnitude" if "force_magnitude" in shown.chosen else "force"
    handles: list[Artist] = []
    for name, look in zip(ds.bearing.values, BEARINGS, strict=False):
        size = ds.force_magnitude.sel(bearing=name).values * shown.scale(force, "N")
        handles += axes.plot(times, size, label=f"bearing {name}", **look)
    speeds = axes.twinx()
    speed = ds.motion_omega1.values * shown.scale("motion_omega1", SPEEDS_UNIT)
    handles += speeds.plot(times, speed, label=r"$\omega_1$", **style.inked(SPEED))
    for panel, values in ((axes, ds.force_magnitude), (speeds, speed)):
        if not np.isfinite(values).any():
            panel.set_ylim(0.0, 1.0)
    axes.set_xlim(*sorted((float(times[0]), float(times[-1]))))
    axes.set_xlabel(labels.with_unit("$t$", shown.text("time", "s")))
    unit, room = shown.text(force, "N"), style.letters(axes, "y")
    axes.set_ylabel(labels.fitting(room, unit, "force in the bearing", "force"))
    speeds.set_ylabel(labels.with_unit(r"$\omega_1$", shown.text("motion_omega1", SPEEDS_UNIT)))
    if legend:
        style.legend_below(axes, handles)
    return axes
