"""Basins of attraction."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
import xarray as xr
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.colors import BoundaryNorm, ListedColormap
from matplotlib.lines import Line2D
from matplotlib.patches import Patch
from numpy.typing import NDArray

from phasekit.labels.arguments import bad
from phasekit.plot.parts import labels, style
from phasekit.plot.parts.circle import TURN
from phasekit.plot.parts.plane import StatePlane
from phasekit.plot.parts.units import Units

FloatArray = NDArray[np.float64]

#: Colors of attractors; light enough that their points show, and apart in gray print.
COLORS = ("#DCEFFA", "#E9A94B", "#5FAF95", "#F4E59A", "#C08BB0", "#8C8C8C")
ESCAPED, UNDECIDED = "#FFFFFF", style.NOTHING


def basins(
    dataset: xr.Dataset,
    *,
    capture: xr.Dataset | None = None,
    angles: style.Angles = "rad",
    units: Mapping[str, str] | None = None,
    legend: bool = True,
    ax: Axes | None = None,
) -> Axes:
    r"""Draw basins of attraction with their shares, and the predicted odds of capture.

    Parameters
    ----------
    dataset : xarray.Dataset
        What `basins` returns.
    capture : xarray.Dataset, optional
        What `capture` returns for the same system: the odds with which a slowly damped motion
        falls to either side, which are written beside the shares of the attractors that lie there.
    angles : {"rad", "deg"}
        Unit of the angle on both axes.
    units : mapping of str to str, optional
        Units in which quantities are shown, by name: ``{"phi": "deg", "dphi": "rpm"}``.
    legend : bool
        Whether to name the attractors under the axes.
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
    >>> import numpy as np
    >>> import phasekit as pk
    >>> damped = pk.Perturbed(pk.Coefficients(1.0, 0.35, 0.12), damping=0.2)
    >>> ds = pk.basins(damped, phi=np.linspace(-3.0, 3.0, 61), dphi=np.linspace(-2.0, 2.0, 41))
    >>> ax = pk.plot.basins(ds, capture=pk.capture(damped))
    >>> ax.get_xlabel()
    '$\\varphi$ (rad)'
    """
    ds = labels.dataset(dataset, "dataset", ("basin", "attractor_phi"), "pk.basins")
    ds, shown = Units.of_dataset(ds, angles, units)
    on_angle = ds.attractor_phi.attrs.get("units") == "rad"
    plane = StatePlane.of(
        shown, None, None, on_angle=on_angle, coordinate=ds.attrs.get("phasekit_coordinate")
    )
    if min(ds.basin.shape) < 2:
        raise bad("dataset", ds, "basins over at least two angles and two angular velocities")
    count = ds.sizes["attractor"]
    colors = [UNDECIDED if i == 1 else ESCAPED if i == 0 else COLORS[(i - 2) % len(COLORS)]
              for i in range(count + 2)]  # fmt: skip
    axes = style.axes_for(ax, legend=legend)
    norm = BoundaryNorm(np.arange(count + 3) - 2.5, count + 2)
    stretch, pace = plane.scale
    phi, dphi = ds.state_phi.values * stretch, ds.state_dphi.values * pace
    axes.pcolormesh(
        phi, dphi, ds.basin.values.T, cmap=ListedColormap(colors), norm=norm, shading="nearest",
        rasterized=True,
    )  # fmt: skip
    predicted = {} if capture is None else _odds(ds, capture)
    handles: list[Artist] = []
    for i in range(count):
        points = ds.isel(attractor=i)
        still = points.attractor_period.item() > 0
        across, up = points.attractor_phi.values, points.attractor_dphi.values
        if on_angle:
            across, up = _copies(across, up, ds.state_phi.values)
        look: style.Look = (
            {"marker": "o", "markersize": 5} if still else {"marker": ".", "markersize": 2}
        )
        axes.plot(across * stretch, up * pace, color=style.BLACK, ls="none", zorder=3, **look)
        share, error = points.basin_fraction.item(), points.basin_fraction_error.item()
        text = f"{_name(points, stretch)}: {share:.3f} $\\pm$ {error:.3f}"
        text = text.replace("at -", "at \N{MINUS SIGN}")
        if i in predicted:
            text += f", predicted odds {predicted[i]:.3f}"
        handles.append(Patch(facecolor=colors[i + 2], edgecolor=style.GRAY, label=text))
    for code, text in ((-1, "undecided"), (-2, "away to infinity")):
        if (ds.basin == code).any():
            handles.append(Patch(facecolor=colors[code + 2], edgecolor=style.GRAY, label=text))
    key = style.inked({"color": style.BLACK, "marker": "o", "linestyle": "none"})
    handles.append(Line2D([], [], label="attractor, once a period", **key))
    axes.set_xlim(phi.min(), phi.max())
    axes.set_ylim(dphi.min(), dphi.max())
    if on_angle:
        style.unwrapped_axis(axes, "x", shown)
    plane.name_axes(axes)
    if legend:
        style.legend_below(axes, handles)
    return axes


def _copies(x: FloatArray, other: FloatArray, seen: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Points on a circle wherever they are among the angles that are seen."""
    first = int(np.ceil((seen.min() - np.nanmax(x)) / TURN))
    last = int(np.floor((seen.max() - np.nanmin(x)) / TURN))
    turns = range(first, last + 1)
    return (
        np.concatenate([x + k * TURN for k in turns] or [x]),
        np.concatenate([other for _ in turns] or [other]),
    )


def _name(points: xr.Dataset, stretch: float) -> str:
    q = int(points.attractor_period.item())
    if q == 0:
        return "never repeats itself"
    place = f"at {points.attractor_phi.values[0] * stretch:.3g}"
    return place if q == 1 else f"{place}, {q} periods"


def _odds(ds: xr.Dataset, capture: xr.Dataset) -> dict[int, float]:
    """Predicted odds of the attractors: of one on either side of the lower saddle."""
    odds: Any = labels.dataset(capture, "capture", ("capture_probability",), "pk.capture")
    still = np.flatnonzero((ds.attractor_period == 1) & (np.abs(ds.attractor_rotation) == 0))
    phi = ds.attractor_phi.values[still, 0]
    if odds.capture_probability.ndim != 1 or len(still) != 2:
        return {}
    left, right = still[np.argsort(phi)]
    regions = odds.capture_probability
    return {
        int(left): float(regions.sel(region="left")),
        int(right): float(regions.sel(region="right")),
    }
