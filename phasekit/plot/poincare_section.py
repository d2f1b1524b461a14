"""Poincare sections."""

from __future__ import annotations

import re
from collections.abc import Mapping

import numpy as np
import xarray as xr
from matplotlib.axes import Axes

from phasekit.errors import ParameterError
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
        What `stroboscopic` or `poincare_section` returns. Of a `Problem` its first two states are
        drawn, but for one that the section alone holds.
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
    source = "pk.poincare_section or pk.stroboscopic"
    ds = labels.dataset(dataset, "dataset", ("crossing",), source)
    ds, shown = Units.of_dataset(ds, angles, units)
    names = ["section_phi", "section_dphi"]
    in_potential = all(name in ds for name in names)
    if not in_potential:
        names = _states_drawn(ds)
    on_angle = in_potential and ds.section_phi.attrs.get("units") == "rad"
    plane = StatePlane.from_arguments(
        shown, TURN if on_angle else None, cut, on_angle=on_angle,
        coordinate=ds.attrs.get("phasekit_coordinate"),
    )  # fmt: skip
    axes = style.axes_for(ax, legend=False)
    across, up = (np.moveaxis(ds[name].values, ds[name].dims.index("crossing"), -1)
                  for name in names)  # fmt: skip
    size = ds.sizes["crossing"]
    scale = (
        plane.scale
        if in_potential
        else [shown.scale(name, str(ds[name].attrs.get("units", ""))) for name in names]
    )
    for number, motion in enumerate(
        zip(across.reshape(-1, size), up.reshape(-1, size), strict=True)
    ):
        x, v = plane.circle.points(*motion)
        color = style.ORBIT_COLORS[(number - 1) % len(style.ORBIT_COLORS)]
        axes.plot(
            x * scale[0], v * scale[1],
            linestyle="none", marker=".", markersize=2, color=color,
        )  # fmt: skip
    if on_angle:
        style.circle_axis(axes, "x", shown, plane.circle)
    if in_potential:
        plane.name_axes(axes)
    else:
        axes.set_xlabel(labels.label(ds[names[0]], shown, style.letters(axes, "x")))
        axes.set_ylabel(labels.label(ds[names[1]], shown, style.letters(axes, "y")))
    return axes


def _states_drawn(ds: xr.Dataset) -> list[str]:
    """The first two states; one that alone the section holds comes last."""
    found = (
        str(name).removeprefix("section_") for name in ds.data_vars if "crossing" in ds[name].dims
    )
    states = [name for name in found if name != "time"]
    if len(states) < 2:
        raise ParameterError(f"dataset: got one state, {', '.join(states)}, wants two or more")
    formula = str(ds.section_time.attrs.get("equation", ""))
    on = formula.removesuffix(" = 0") if formula.endswith(" = 0") else ""  # of a stroboscope x(n T)
    held = [name for name in states if re.search(rf"\b{re.escape(name)}\b", on)]
    order = [name for name in states if [name] != held] + (held if len(held) == 1 else [])
    return [f"section_{name}" for name in order[:2]]
