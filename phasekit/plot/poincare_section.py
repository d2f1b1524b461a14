"""Poincare sections."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
import xarray as xr
from matplotlib.axes import Axes

from phasekit.inputs import call_checked
from phasekit.plot.parts import labels, style
from phasekit.plot.parts.circle import TURN
from phasekit.plot.parts.plane import StatePlane
from phasekit.plot.parts.units import Units


@call_checked
def poincare_section(
    dataset: xr.Dataset,
    *,
    angles: style.Angles = "rad",
    units: Mapping[str, str] | None = None,
    cut: float | None = None,
    ax: Axes | None = None,
) -> Axes:
    r"""Draw the states of motions in a section, each motion in its color.

    Parameters
    ----------
    dataset : xarray.Dataset
        What `stroboscopic` or `poincare_section` returns.
    units : mapping of str to str, optional
        Units in which quantities are shown, by name: ``{"phi": "deg", "dphi": "rpm"}``.

    Examples
    --------
    >>> import phasekit as pk
    >>> well = pk.Potential("x^4/4 - x^2/2", "x")
    >>> driven = pk.Perturbed(well, damping=0.25, forcing=pk.Harmonic(0.4, 1.0))
    >>> ds = pk.stroboscopic(driven, 0.1, 0.0, n=500, skip=50)
    >>> ax = pk.plot.poincare_section(ds)
    >>> ax.get_ylabel()
    '$\\dot x$'
    """
    ds = labels.dataset(dataset, "dataset", ("section_phi", "section_dphi"), "pk.stroboscopic")
    ds, shown = Units.of_dataset(ds, angles, units)
    on_angle = ds.section_phi.attrs.get("units") == "rad"
    plane = StatePlane.from_arguments(
        shown, TURN if on_angle else None, cut, on_angle=on_angle,
        coordinate=ds.attrs.get("phasekit_coordinate"),
    )  # fmt: skip
    axes = style.axes_for(ax, legend=False)
    across, up = (np.moveaxis(ds[name].values, ds[name].dims.index("crossing"), -1)
                  for name in ("section_phi", "section_dphi"))  # fmt: skip
    size = ds.sizes["crossing"]
    for number, motion in enumerate(
        zip(across.reshape(-1, size), up.reshape(-1, size), strict=True)
    ):
        x, v = plane.circle.points(*motion)
        color = style.ORBIT_COLORS[(number - 1) % len(style.ORBIT_COLORS)]
        axes.plot(
            x * plane.scale[0], v * plane.scale[1],
            linestyle="none", marker=".", markersize=2, color=color,
        )  # fmt: skip
    if on_angle:
        style.circle_axis(axes, "x", shown, plane.circle)
    plane.name_axes(axes)
    return axes
