"""Bifurcation diagram: equilibria against one swept parameter."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
import xarray as xr
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.lines import Line2D

from phasekit.arrays import Array
from phasekit.errors import EquilibriumKind, ParameterError
from phasekit.inputs import call_checked
from phasekit.labels.arguments import named
from phasekit.plot.branch import branch, holds_branches
from phasekit.plot.parts import atlas, labels, strands, style
from phasekit.plot.parts.circle import Circle
from phasekit.plot.parts.units import Units

# Roots of |V''|, which exist for one kind only and are 0 where two kinds meet.
VANISHING = ("natural_frequency", "exponent")


@call_checked
def bifurcation_diagram(
    dataset: Any,
    x: str | None = None,
    y: str | None = None,
    *,
    angles: style.Angles = "rad",
    units: Mapping[str, str] | None = None,
    cut: float | None = None,
    legend: bool = True,
    ax: Axes | None = None,
) -> Axes:
    r"""Draw the equilibria against a swept parameter.

    Centers are solid, saddles dashed; folds, where a center and a saddle meet, and pitchforks,
    where three equilibria meet, are marked. Angles live on a circle: a curve that leaves through
    the top edge comes back at the bottom.

    Parameters
    ----------
    dataset : xarray.Dataset, Branch or sequence of Branch
        What `branches` returns; or `equilibria` or `sweep`, with one swept parameter: select the
        others; or what `continuation` or `diagram` return, drawn by `branch`.
    x : str, optional
        The swept parameter, or another coordinate along it; not needed where there is one only.
    y : str, optional
        The quantity to draw, phi if left out: any with the dim `equilibrium`: phi, energy,
        curvature, natural_frequency, exponent; of an atlas phi, energy or curvature; of a Branch
        any along its points, its first state if left out.

    Raises
    ------
    ParameterError
        If an argument is unusable, or more than one parameter is swept.

    Notes
    -----
    The atlas of `branches` is drawn as it is, exact, with its special points labelled: LP fold,
    BP branch point (pitchfork), CP cusp, NF no force. For columns of equilibria a fold is placed
    where fold_margin, interpolated between the columns, vanishes; the curves are
    carried up to it on the parabola on which equilibria meet. The error is that of the
    interpolation, second order in the spacing of `x`; `critical` gives the exact value.

    Examples
    --------
    >>> import numpy as np
    >>> import phasekit as pk
    >>> ds = pk.equilibria(pk.Reduced(lam=np.linspace(0.0, 1.5, 61), psi=0.1))
    >>> ax = pk.plot.bifurcation_diagram(ds, angles="deg")
    >>> ax.get_ylabel()
    '$\\varphi$, angle of the equilibrium (°)'
    """
    if holds_branches(dataset):
        return branch(dataset, x, y, angles=angles, units=units, cut=cut, legend=legend, ax=ax)
    y = "phi" if y is None else y
    ds = labels.dataset(dataset, "dataset", ("phi", "kind"))
    ds, shown = Units.of_dataset(ds, angles, units)
    if ds["phi"].dims == atlas.DIMS:
        return atlas.draw(ds, x, y, units=shown, cut=cut, legend=legend, ax=ax)
    offered = _drawable(ds)
    named("y", y, offered)
    columns, along = _columns(ds, x, y)
    # The numbers of a Potential's equilibria are no branches.
    numbered = ds["equilibrium"].dtype.kind in "iu"
    curves, mergers = ([], []) if numbered else strands.trace(columns)
    circle = Circle.of_axis(ds[y], shown, cut)
    axes = style.axes_for(ax, legend=legend)

    values, _ = labels.shown(along, shown)
    stretch = (_stretch(along, shown), _stretch(ds[y], shown))
    handles = _draw_curves(axes, curves, circle, stretch)
    handles |= _draw_mergers(axes, mergers, circle, stretch)
    if numbered:
        handles |= _draw_points(axes, columns, circle, stretch)
    if circle is not None:
        style.circle_axis(axes, "y", shown, circle)
    axes.set_xlim(float(np.min(values)), float(np.max(values)))
    axes.set_xlabel(labels.label(along, shown, style.letters(axes, "x")))
    axes.set_ylabel(labels.label(ds[y], shown, style.letters(axes, "y")))
    if legend:
        order = ("center", "saddle", "degenerate", "fold", "pitchfork")
        style.legend_below(axes, [handles[name] for name in order if name in handles])
    return axes


def _drawable(ds: xr.Dataset) -> list[str]:
    """Return the quantities that each equilibrium has a number of."""
    return [
        str(name)
        for name, values in ds.data_vars.items()
        if "equilibrium" in values.dims and values.dtype.kind == "f"
    ]


def _stretch(values: xr.DataArray, units: Units) -> float:
    return units.scale(str(values.name), str(values.attrs.get("units", "")))


def _draw_curves(
    ax: Axes, curves: list[strands.Strand], circle: Circle | None, stretch: tuple[float, float]
) -> dict[str, Artist]:
    handles: dict[str, Artist] = {}
    for curve in curves:
        look = style.BRANCHES[curve.kind]
        across, up = np.asarray(curve.x), np.asarray(curve.y if circle is None else curve.phi)
        if circle is not None:
            up, across = circle.unrolled(up, across)
        if np.isfinite(up).any():
            (line,) = ax.plot(across * stretch[0], up * stretch[1], **look)
            handles.setdefault(str(look["label"]), line)
    return handles


def _draw_points(
    ax: Axes, columns: strands.Columns, circle: Circle | None, stretch: tuple[float, float]
) -> dict[str, Artist]:
    """Draw the equilibria of each column as points, by kind."""
    handles: dict[str, Artist] = {}
    across = np.broadcast_to(columns.x[:, None], columns.y.shape)
    for kind, look in style.POINTS.items():
        there = (columns.kind == kind) & np.isfinite(columns.y)
        if there.any():
            x, y = across[there], columns.y[there]
            if circle is not None:
                y, x = circle.points(y, x)
            (handles[kind.name.lower()],) = ax.plot(
                x * stretch[0],
                y * stretch[1],
                linestyle="none",
                **{**look, "markersize": 3.0, "markeredgewidth": 0.8},
            )
    return handles


def _draw_mergers(
    ax: Axes, mergers: list[strands.Merger], circle: Circle | None, stretch: tuple[float, float]
) -> dict[str, Artist]:
    handles: dict[str, Artist] = {}
    for name, look in style.MERGERS.items():
        points = [(p.x, p.y if circle is None else p.phi) for p in mergers if p.name == name]
        if points:
            x, y = np.array(points).T
            if circle is not None:
                y, x = circle.points(y, x)
            ax.plot(
                x * stretch[0], y * stretch[1], linestyle="none", zorder=4, clip_on=False, **look
            )
            handles[name] = Line2D([], [], linestyle="none", **look)
    return handles


def _columns(ds: xr.Dataset, x: str | None, y: str) -> tuple[strands.Columns, xr.DataArray]:
    """Return the columns of the diagram, and the coordinate along them."""
    phi = ds["phi"]
    dims = labels.swept(phi, ["equilibrium"])
    if not dims:
        raise ParameterError(
            "dataset: got a single system, wants one swept parameter, for example "
            "pk.equilibria(disk.replace(beta=np.linspace(0, np.pi / 2, 201)))"
        )
    name = dims[0] if x is None and len(dims) == 1 else x
    if name is None:
        raise ParameterError(f"x: got None, wants one of {', '.join(dims)}, for all are swept")
    name = labels.choose_axis(phi, name, "x", dims)
    dim = name if name in dims else str(phi.coords[name].dims[0])
    others = [other for other in dims if other != dim]
    if others:
        pick = ", ".join(f"{other}=0" for other in others)
        raise ParameterError(
            f"dataset: got {', '.join(dims)} swept, wants {dim} alone; "
            f"select the others first, for example ds.isel({pick})"
        )
    along = (
        phi.coords[name]
        if name in phi.coords
        else xr.DataArray(np.arange(ds.sizes[dim]), name=name, dims=dim)
    )
    labels.monotone(along, "x")

    def table(variable: str) -> Array:
        array = ds[variable].transpose(dim, "equilibrium").values
        return np.asarray(array, dtype=float)

    margin: Any = np.full(along.size, np.nan)
    if "fold_margin" in ds and ds["fold_margin"].dims == (dim,):
        margin = ds["fold_margin"].values
    kind = table("kind").astype(np.int8)
    kinds = [int(code) for code in EquilibriumKind]
    if not np.isin(kind, kinds).all():
        raise ParameterError(f"dataset: got kinds other than the codes {kinds}")
    columns = strands.Columns(
        along.values.astype(float), table("phi"), kind, table(y), margin, y in VANISHING
    )
    return columns, along
