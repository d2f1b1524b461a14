"""Basins of attraction."""

from __future__ import annotations

from typing import Any

import numpy as np
import xarray as xr
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.colors import BoundaryNorm, ListedColormap
from matplotlib.lines import Line2D
from matplotlib.patches import Patch

from phasekit.labels.arguments import bad
from phasekit.plot.parts import labels, style

#: Colors of attractors; light enough that their points show.
COLORS = ("#CFE8F7", "#F6D7A7", "#BFE3D0", "#E8C9DD", "#F4E59A", "#D5D5D5")
ESCAPED, UNDECIDED = "#FFFFFF", style.NOTHING


def basins(
    dataset: xr.Dataset,
    *,
    capture: xr.Dataset | None = None,
    angles: style.Angles = "rad",
    legend: bool = True,
    ax: Axes | None = None,
) -> Axes:
    r"""Draw basins of attraction with their shares, and beside them the predicted odds.

    Parameters
    ----------
    dataset : xarray.Dataset
        What `basins` returns.
    capture : xarray.Dataset, optional
        What `capture` returns for the same system: the odds with which a slowly damped motion
        falls to either side, which are written beside the shares of the attractors that lie there.
    angles : {"rad", "deg"}
        Unit of the angle on both axes.
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
    factor = style.angle_factor(angles)
    ds = labels.dataset(dataset, "dataset", ("basin", "attractor_phi"), "pk.basins")
    if min(ds.basin.shape) < 2:
        raise bad("dataset", ds, "basins over at least two angles and two angular velocities")
    count = ds.sizes["attractor"]
    colors = [UNDECIDED if i == 1 else ESCAPED if i == 0 else COLORS[(i - 2) % len(COLORS)]
              for i in range(count + 2)]  # fmt: skip
    axes = style.axes_for(ax, legend=legend)
    norm = BoundaryNorm(np.arange(count + 3) - 2.5, count + 2)
    phi, dphi = ds.state_phi.values * factor, ds.state_dphi.values * factor
    axes.pcolormesh(
        phi, dphi, ds.basin.values.T, cmap=ListedColormap(colors), norm=norm, shading="nearest",
        rasterized=True,
    )  # fmt: skip
    predicted = {} if capture is None else _odds(ds, capture)
    handles: list[Artist] = []
    for i in range(count):
        points = ds.isel(attractor=i)
        still = points.attractor_period.item() > 0
        axes.plot(
            points.attractor_phi.values * factor, points.attractor_dphi.values * factor,
            color=style.BLACK, marker="o" if still else ".", markersize=5 if still else 2,
            linestyle="none", zorder=3,
        )  # fmt: skip
        share, error = points.basin_fraction.item(), points.basin_fraction_error.item()
        text = f"{_name(points, factor)}: {share:.3f} $\\pm$ {error:.3f}"
        if i in predicted:
            text += f", predicted odds {predicted[i]:.3f}"
        handles.append(Patch(facecolor=colors[i + 2], edgecolor=style.GRAY, label=text))
    for code, text in ((-1, "undecided"), (-2, "away to infinity")):
        if (ds.basin == code).any():
            handles.append(Patch(facecolor=colors[code + 2], edgecolor=style.GRAY, label=text))
    handles.append(Line2D([], [], color=style.BLACK, marker="o", linestyle="none",
                          label="attractor, once a period"))  # fmt: skip
    axes.set_xlim(phi[0], phi[-1])
    axes.set_ylim(dphi[0], dphi[-1])
    on_angle = ds.attractor_phi.attrs.get("units") == "rad"
    unit = style.angle_unit(angles)
    axes.set_xlabel(rf"$\varphi$ ({unit})" if on_angle else "$x$")
    axes.set_ylabel(rf"$\dot\varphi$ ({unit}/s)" if on_angle else r"$\dot x$")
    if legend:
        style.legend_below(axes, handles)
    return axes


def _name(points: xr.Dataset, factor: float) -> str:
    q = int(points.attractor_period.item())
    if q == 0:
        return "never repeats itself"
    place = f"at {points.attractor_phi.values[0] * factor:.3g}"
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
