"""The exact atlas of branches, drawn: curves by kind, special points by name."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
import xarray as xr
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.lines import Line2D
from numpy.typing import NDArray

from phasekit.arrays import Array
from phasekit.errors import EquilibriumKind
from phasekit.labels.arguments import bad, named
from phasekit.plot.parts import labels, style
from phasekit.plot.parts.circle import Circle
from phasekit.plot.parts.points import label_points
from phasekit.plot.parts.units import Units

DIMS = ("branch", "point")


def draw(
    ds: xr.Dataset,
    x: str | None,
    y: str,
    *,
    units: Units,
    cut: float | None,
    legend: bool,
    ax: Axes | None,
) -> Axes:
    """Draw an atlas; `bifurcation_diagram` says what the arguments are."""
    parameter = str(ds.attrs.get("parameter", ""))
    if parameter not in ds.coords or ds[parameter].dims != DIMS:
        raise bad("dataset", ds, "what branches returns, with its attribute 'parameter'")
    if x is not None:
        named("x", x, [parameter])
    offered = [
        str(name) for name, v in ds.data_vars.items() if v.dims == DIMS and v.dtype.kind == "f"
    ]
    named("y", y, offered)
    axes = style.axes_for(ax, legend=legend)
    along, up = ds[parameter], ds[y]
    stretch = tuple(units.scale(str(v.name), v.attrs.get("units", "")) for v in (along, up))
    circle = Circle.of_axis(up, units, cut)
    handles: dict[str, Artist] = {}
    for row in range(ds.sizes["branch"]):
        cells = {"branch": row}
        kinds = ds["kind"].isel(cells).values
        values = (along.isel(cells).values, up.isel(cells).values)
        for kind, part in _runs(kinds):
            look = style.BRANCHES.get(kind, style.MERGED)
            across, height = (v[part] for v in values)
            if circle is not None:
                height, across = circle.unrolled(height, across)
            (line,) = axes.plot(across * stretch[0], height * stretch[1], **look)
            handles.setdefault(str(look["label"]), line)
    if circle is not None:
        style.circle_axis(axes, "y", units, circle)
    low, high = float(along.min()) * stretch[0], float(along.max()) * stretch[0]
    axes.set_xlim(low, high)
    handles |= _mark(axes, ds, y, stretch, circle)
    axes.set_xlabel(labels.label(along, units, style.letters(axes, "x")))
    axes.set_ylabel(labels.label(up, units, style.letters(axes, "y")))
    if legend:
        style.legend_below(axes, list(handles.values()))
    return axes


def _runs(kinds: NDArray[np.int8]) -> Iterator[tuple[EquilibriumKind, slice]]:
    """Stretches of one kind; the degenerate point between two belongs to both."""
    n = int((kinds != EquilibriumKind.ABSENT).sum())
    degenerate = EquilibriumKind.DEGENERATE
    # The kind of each chord is that of its end which is not degenerate.
    chords = np.where(kinds[: n - 1] == degenerate, kinds[1:n], kinds[: n - 1])
    edges = np.flatnonzero(np.diff(chords)) + 1
    for start, stop in zip([0, *edges], [*edges, chords.size], strict=True):
        if stop > start:
            yield EquilibriumKind(int(chords[start])), slice(int(start), int(stop) + 1)


def _mark(
    ax: Axes, ds: xr.Dataset, y: str, stretch: tuple[float, ...], circle: Circle | None
) -> dict[str, Artist]:
    """Mark and label the special points, but for the ends of branches."""
    handles: dict[str, Artist] = {}
    kinds = ds["special_kind"].values
    texts = ds["special_label"].values
    x = ds["special_value"].values
    heights = ds["special_phi"].values if y == "phi" else _heights(ds, y)
    named: dict[tuple[float, float], str] = {}
    for name, look in style.MERGERS.items():
        chosen = np.flatnonzero(kinds == name)
        if not chosen.size:
            continue
        across, up = x[chosen], heights[chosen]
        if circle is not None:
            up, across = circle.points(up, across)
        across, up = across * stretch[0], up * stretch[1]
        ax.plot(across, up, linestyle="none", zorder=4, clip_on=False, **look)
        handles[name] = Line2D([], [], linestyle="none", **look)
        named |= {point: str(texts[chosen[0]]) for point in zip(across, up, strict=True)}
    label_points(ax, named)
    return handles


def _heights(ds: xr.Dataset, y: str) -> Array:
    """Return the quantity at each special point, from the vertex that stands there."""
    parameter = str(ds.attrs["parameter"])
    along, phi, up = (ds[name].values for name in (parameter, "phi", y))
    found = np.full(ds.sizes["special"], np.nan)
    places = zip(ds["special_value"].values, ds["special_phi"].values, strict=True)
    for i, (at, angle) in enumerate(places):
        near = np.flatnonzero(along == at)
        if near.size:
            off = np.abs(np.sin(0.5 * (phi.flat[near] - angle)))
            found[i] = up.flat[near[int(np.nanargmin(off))]]
    return found
