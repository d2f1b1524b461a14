"""Poincare sections."""

from __future__ import annotations

import numpy as np
import xarray as xr
from matplotlib.axes import Axes

from phasekit.plot.parts import labels, style


def poincare_section(
    dataset: xr.Dataset,
    *,
    angles: style.Angles = "rad",
    ax: Axes | None = None,
) -> Axes:
    r"""Draw the states of motions in a section, each motion in its color.

    Parameters
    ----------
    dataset : xarray.Dataset
        What `stroboscopic` or `poincare_section` returns.
    angles : {"rad", "deg"}
        Unit of the angle on both axes.
    ax : matplotlib.axes.Axes, optional
        Where to draw; a new figure if left out.

    Returns
    -------
    matplotlib.axes.Axes

    Raises
    ------
    ParameterError
        If an argument is unusable.

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
    factor = style.angle_factor(angles)
    ds = labels.dataset(dataset, "dataset", ("section_phi", "section_dphi"), "pk.stroboscopic")
    axes = style.axes_for(ax, legend=False)
    on_angle = ds.section_phi.attrs.get("units") == "rad"
    across, up = (np.moveaxis(ds[name].values, ds[name].dims.index("crossing"), -1)
                  for name in ("section_phi", "section_dphi"))  # fmt: skip
    size = ds.sizes["crossing"]
    stretch = factor if on_angle else 1.0
    for number, (x, v) in enumerate(
        zip(across.reshape(-1, size), up.reshape(-1, size), strict=True)
    ):
        color = (style.BLUE, *style.ORBIT_COLORS)[number % (1 + len(style.ORBIT_COLORS))]
        axes.plot(x * stretch, v * stretch, linestyle="none", marker=".", markersize=2, color=color)
    if on_angle:
        style.circle_axis(axes, "x", angles)
    unit = style.angle_unit(angles)
    axes.set_xlabel(rf"$\varphi$ ({unit})" if on_angle else "$x$")
    axes.set_ylabel(rf"$\dot\varphi$ ({unit}/s)" if on_angle else r"$\dot x$")
    return axes
