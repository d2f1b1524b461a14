"""The surface of equilibria over a plane of two parameters, with its folds."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from matplotlib.artist import Artist
from matplotlib.colors import LightSource, to_rgb
from matplotlib.lines import Line2D
from matplotlib.patches import Patch
from mpl_toolkits.mplot3d import Axes3D
from mpl_toolkits.mplot3d.art3d import Poly3DCollection

from phasekit.arrays import Array
from phasekit.bifurcation.along import view_of
from phasekit.bifurcation.surface import equilibrium_surface
from phasekit.errors import EquilibriumKind
from phasekit.inputs import call_checked
from phasekit.labelled.atlas import resting
from phasekit.labelled.bifurcation_set import bifurcation_set
from phasekit.labels.arguments import bad, flag, pair, whole
from phasekit.plot.parts import labels, style
from phasekit.plot.parts.circle import Circle, multiple_of_pi, quarters
from phasekit.plot.parts.units import SYMBOLS, Units, coordinate_symbol

LEAST, MOST = 4, 200
LIGHT = LightSource(azdeg=225.0, altdeg=50.0).direction
# What is left of the light on faces that turn away from it.
SHADE = 0.72
# Light and dark under any light, so that they differ in gray, too.
FACES = {
    EquilibriumKind.CENTER: "#8FD0F5",
    EquilibriumKind.SADDLE: style.VERMILLION,
}


@call_checked
def branch_surface(
    system: Any,
    x: str,
    y: str,
    *,
    xlim: tuple[float, float],
    ylim: tuple[float, float],
    cells: int = 36,
    angles: style.Angles = "rad",
    units: Mapping[str, str] | None = None,
    cut: float | None = None,
    legend: bool = True,
    view: tuple[float, float] = (28.0, -58.0),
    ax: Axes3D | None = None,
) -> Axes3D:
    r"""Draw the equilibria over a plane of two parameters, as a surface with its folds.

    Parameters
    ----------
    system : system
        A single system in a potential; its own values of the two parameters are not used.
    x, y : str
        Two different parameters on which the equilibria depend.
    xlim, ylim : (float, float)
        The part of the plane, in the parameters' units.
    cells : int
        Number of cells of the surface along each parameter, 4 to 200.
    legend : bool
        Whether to explain colors, lines and markers.
    view : (float, float)
        Elevation and azimuth of the eye, in degrees.
    ax : mpl_toolkits.mplot3d.axes3d.Axes3D, optional
        Where to draw; a new figure if left out.

    Returns
    -------
    mpl_toolkits.mplot3d.axes3d.Axes3D

    Notes
    -----
    The surface is V'(phi) = 0, of [Veljovic2015] (12) or of any potential, on a grid; the folds and
    cusps on it are those of `bifurcation_set`. Where phi lives on a circle the surface goes on from
    the top to the bottom.

    Examples
    --------
    >>> import phasekit as pk
    >>> reduced = pk.Reduced(lam=0.0, psi=0.0)
    >>> ax = pk.plot.branch_surface(
    ...     reduced, "lam", "psi", xlim=(0.0, 1.5), ylim=(-0.6, 0.6), cells=8
    ... )
    >>> ax.get_zlabel()
    '$\\varphi$ (rad)'
    """
    flag("legend", legend)
    wants = f"a whole number from {LEAST} to {MOST}"
    cells = whole("cells", cells, wants, LEAST)
    if cells > MOST:
        raise bad("cells", cells, wants)
    elevation, azimuth = pair("view", view, "two angles in degrees: elevation and azimuth")
    if ax is not None and not isinstance(ax, Axes3D):
        hint = 'plt.figure().add_subplot(projection="3d") makes one'
        raise bad("ax", ax, "a matplotlib 3-D Axes", hint)
    folds = bifurcation_set(system, x, y, xlim=xlim, ylim=ylim)
    _, law, values = resting(system, x, y, what="branch_surface")
    box = [folds.attrs[ends] for ends in ("xlim", "ylim")]
    seen = view_of(law, values, (x, y), (tuple(box[0]), tuple(box[1])))
    held = {name: str(folds[name].attrs.get("units", "")) for name in (x, y)}
    shown = Units.from_arguments(angles, units, held)
    place = str(folds["phi"].attrs["units"])
    stretch = np.array([shown.scale(*item) for item in [*held.items(), ("phi", place)]])
    circle = Circle(seen.ends[0], None)
    if seen.period is not None:
        circle = Circle.cut_at(cut, stretch[2], seen.period)
    elif cut is not None:
        raise bad("cut", cut, "None, for the coordinate is not on a circle")
    top = circle.ends if seen.period is not None else seen.ends
    grids = [np.linspace(low, high, cells + 1) for low, high in box]
    phi = np.linspace(*top, 2 * cells + 1)
    surface = equilibrium_surface(seen.force, grids[0], grids[1], phi)

    axes: Any = ax
    if axes is None:
        axes = style.new_figure(1.1).add_subplot(projection="3d")
    ends = np.array([[*grids[0][[0, -1]]], [*grids[1][[0, -1]]], top])
    handles: list[Artist] = []
    for code, triangles in zip(FACES, surface, strict=True):
        if triangles.size:
            _add_faces(axes, triangles, stretch, FACES[code])
            name = style.BRANCHES[code]["label"]
            handles.append(Patch(facecolor=FACES[code], edgecolor=style.GRAY, label=name))
    handles += _draw_folds(axes, folds, (x, y), stretch, circle)
    for which, limits, scale in zip("xyz", ends, stretch, strict=True):
        getattr(axes, f"set_{which}lim")(*(limits * scale))
    axes.set_xlabel(_short(folds[x], shown))
    axes.set_ylabel(_short(folds[y], shown))
    axes.set_zlabel(_name(system, shown, place))
    if place == "rad":
        ticks = quarters(*top)
        axes.set_zticks([tick * stretch[2] for tick in ticks])
        if stretch[2] == 1.0:
            axes.set_zticklabels([multiple_of_pi(tick) for tick in ticks])
    axes.yaxis.labelpad = 8.0
    if style.narrow(axes):
        axes.locator_params(axis="x", nbins=4)
        axes.locator_params(axis="y", nbins=4)
    # The label along phi stands outside the box.
    axes.set_box_aspect(None, zoom=0.85)
    axes.view_init(elevation, azimuth)
    axes.computed_zorder = False  # folds stay in sight
    if legend and handles:
        axes.legend(handles=handles, loc="upper left", frameon=False, fontsize="small")
    return axes


def _name(system: Any, units: Units, place: str) -> str:
    """Return symbol and unit of the coordinate."""
    own = coordinate_symbol(system.coordinate or "phi")
    return labels.with_unit(f"${own}$", units.text("phi", place))


def _short(values: Any, units: Units) -> str:
    """Return symbol and unit: there is no room for more along a slanted axis."""
    symbol = SYMBOLS.get(str(values.name), str(values.name).replace("_", " "))
    return labels.with_unit(symbol, units.text(str(values.name), values.attrs.get("units", "")))


def _add_faces(ax: Any, triangles: Array, stretch: Array, color: str) -> None:
    """Add triangles, shaded by the way the surface faces in the box."""
    normal = triangles[..., 3:].mean(axis=1)
    length = np.linalg.norm(normal, axis=1)
    glance = np.abs(normal @ LIGHT) / np.where(length > 0.0, length, 1.0)
    colors = np.array(to_rgb(color)) * (SHADE + (1.0 - SHADE) * glance)[:, None]
    corners = triangles[..., :3] * stretch
    faces = Poly3DCollection(
        corners, facecolors=colors, edgecolors=colors, linewidths=0.2, zorder=1
    )
    ax.add_collection3d(faces)


def _draw_folds(
    ax: Any, ds: Any, names: tuple[str, str], stretch: Array, circle: Circle
) -> list[Artist]:
    """Draw the fold curves on the surface, and the cusps."""
    handles: dict[str, Artist] = {}
    for row in range(ds.sizes["curve"]):
        kind = str(ds["curve_kind"].values[row])
        if kind not in ("fold", "pitchfork"):
            continue
        x, y, phi = (ds[name].values[row] for name in (*names, "phi"))
        phi = circle.home(phi)
        torn = 0.5 * (circle.period or np.inf)
        seam = np.flatnonzero(np.abs(np.diff(phi)) > torn) + 1
        points = np.insert(np.stack([x, y, phi]) * stretch[:, None], seam, np.nan, axis=1)
        look = style.inked(style.FOLD_CURVE if kind == "fold" else style.PITCHFORK_CURVE)
        (line,) = ax.plot(*points, zorder=10, **look)
        handles.setdefault(kind, line)
    if ds.sizes["cusp"]:
        points = np.stack([ds[f"cusp_{name}"].values for name in (*names, "phi")])
        points[2] = circle.home(points[2])
        look = {**style.MERGERS["cusp"], "markerfacecolor": "white"}
        ax.plot(*(points * stretch[:, None]), linestyle="none", zorder=11, **look)
        for point in (points * stretch[:, None]).T:
            ax.text(*point, "  CP", fontsize="small", zorder=12)
        handles["cusp"] = Line2D([], [], linestyle="none", **look)
    return list(handles.values())
