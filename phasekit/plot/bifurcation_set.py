"""Bifurcation sets in a plane of two parameters."""

from __future__ import annotations

from collections.abc import Mapping

import matplotlib.pyplot as plt
import numpy as np
import xarray as xr
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.lines import Line2D

from phasekit.inputs import call_checked
from phasekit.labels.arguments import flag
from phasekit.plot.parts import labels, style
from phasekit.plot.parts.points import label_points
from phasekit.plot.parts.units import Units

# Regions thinner than this part of the plane are not annotated.
READABLE = 0.035


@call_checked
def bifurcation_set(
    dataset: xr.Dataset,
    *,
    angles: style.Angles = "rad",
    units: Mapping[str, str] | None = None,
    counts: bool = True,
    legend: bool = True,
    ax: Axes | None = None,
) -> Axes:
    r"""Draw the bifurcation set in a plane of two parameters.

    Folds, pitchforks, equal energies and A = 0 each have their line style, cusps are marked CP,
    and the regions between the folds show their number of equilibria.

    Parameters
    ----------
    dataset : xarray.Dataset
        What `phasekit.bifurcation_set` returns.
    counts : bool
        Whether to write the number of equilibria into each region.

    Examples
    --------
    >>> import phasekit as pk
    >>> from phasekit.labelled.bifurcation_set import bifurcation_set
    >>> reduced = pk.Reduced(lam=0.0, psi=0.0)
    >>> ds = bifurcation_set(reduced, "lam", "psi", xlim=(-1.5, 1.5), ylim=(-1.5, 1.5))
    >>> ax = pk.plot.bifurcation_set(ds)
    >>> ax.get_xlabel()
    '$\\lambda$, lambda = B/A'
    """
    flag("counts", counts)
    needs = ("curve_kind", "region_count")
    ds = labels.dataset(dataset, "dataset", needs, "pk.bifurcation_set")
    ds, shown = Units.of_dataset(ds, angles, units)
    axes = style.axes_for(ax, legend=legend)
    names = (str(ds.attrs["x"]), str(ds.attrs["y"]))
    signs = ds["sign_of_A"].values if "sign_of_A" in ds else np.zeros(ds.sizes["curve"], int)
    handles: dict[str, Artist] = {}
    for row in range(ds.sizes["curve"]):
        kind, sign = str(ds["curve_kind"].values[row]), int(signs[row])
        look = style.inked(style.LOCI.get((kind, sign)) or style.LOCI[kind, 0])
        x, y = (labels.shown(ds[name].isel(curve=row), shown)[0] for name in names)
        (line,) = axes.plot(x, y, zorder=2.5 if kind == "fold" else 2.0, clip_on=True, **look)
        handles.setdefault(str(look["label"]), line)
    for i, which in enumerate("xy"):
        low, high = (
            end * shown.scale(names[i], ds[names[i]].attrs.get("units", ""))
            for end in ds.attrs[f"{which}lim"]
        )
        axes.set(**{f"{which}lim": (low, high)})
    x, y = (labels.shown(ds[f"cusp_{name}"].rename(name), shown)[0] for name in names)
    if x.size:
        look = style.MERGERS["cusp"]
        axes.plot(x, y, linestyle="none", zorder=4, clip_on=False, **look)
        handles["cusp"] = Line2D([], [], linestyle="none", **look)
        label_points(axes, dict.fromkeys(zip(x, y, strict=True), "CP"))
    if counts:
        _write_counts(axes, ds, names, shown)
    axes.set_xlabel(labels.label(ds[names[0]], shown, style.letters(axes, "x")))
    axes.set_ylabel(labels.label(ds[names[1]], shown, style.letters(axes, "y")))
    if legend:
        style.legend_below(axes, list(handles.values()))
    return axes


def _write_counts(ax: Axes, ds: xr.Dataset, names: tuple[str, str], shown: Units) -> None:
    x, y = (labels.shown(ds[f"region_{name}"].rename(name), shown)[0] for name in names)
    wide = ds["region_reach"].values > READABLE
    for i in np.flatnonzero(wide):
        text = ax.text(
            x[i],
            y[i],
            str(int(ds["region_count"].values[i])),
            ha="center",
            va="center",
            fontsize="large",
            color=style.GRAY,
            zorder=5,
        )
        # A line may run through the number.
        text.set_path_effects(style.halo(plt.rcParams["axes.facecolor"], 4.0))
