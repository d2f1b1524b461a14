"""Atlases: the curves and regions of a rectangle of two parameters."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import matplotlib.pyplot as plt
import numpy as np
import numpy.typing as npt
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.colors import ListedColormap, to_rgb
from matplotlib.lines import Line2D
from matplotlib.patches import Patch
from matplotlib.transforms import Bbox, ScaledTranslation

from phasekit.bifurcation.special_points import KINDS
from phasekit.inputs import call_checked
from phasekit.labelled.continuation.atlas import Atlas
from phasekit.labels.arguments import bad, flag
from phasekit.numerics.waits import notice, stage
from phasekit.plot.branch import CURVES
from phasekit.plot.parts import labels as words
from phasekit.plot.parts import style
from phasekit.plot.parts.flow_portrait import thumbnail
from phasekit.plot.parts.frame import inches
from phasekit.plot.parts.points import label_points
from phasekit.plot.parts.style import look_of
from phasekit.plot.parts.units import Units

#: Names of small portraits; their least side in inches, and the gaps between them in parts of it.
LETTERS = "ABCDEFGH"
SIDE, GAP = 0.95, 0.08
#: Part of the height of given axes that they may take.
PART = 0.5
#: Regions thinner than this part of the rectangle are not annotated.
READABLE = 0.03
#: Part of a text that is in its region where it has room.
WITHIN = 0.5
#: Half the size of a point's marker (inches), off which numbers are written.
MARK = 0.06
#: How much of a color regions have, by their number of stable equilibria.
TINTS = (0.12, 0.3, 0.48, 0.66)
#: Colors of regions by their number of equilibria, after the last again from the first.
COLORS = (style.GRAY, style.BLUE, style.ORANGE, style.GREEN, style.PURPLE, style.SKY)
#: Looks of curves that are told apart here alone: all others are those of `plot.branch`.
LOOKS: Mapping[str, style.Look] = {
    **CURVES,
    "event": {
        "color": style.VERMILLION, "linestyle": (0, (4, 2)), "linewidth": 1.4,
        "label": "window's edge",
    },
    "period_doubling": {**CURVES["period_doubling"], "linestyle": (0, (8, 1.5, 2, 1.5))},
    "torus": {**CURVES["torus"], "linestyle": (0, (3, 1))},
    "connection": {**CURVES["connection"], "label": "homoclinic"},
}  # fmt: skip


@call_checked
def atlas(
    atlas: Any,
    *,
    angles: style.Angles = "rad",
    units: Mapping[str, str] | None = None,
    counts: bool = True,
    labels: bool = True,
    portraits: bool = False,
    legend: bool = True,
    ax: Axes | None = None,
) -> Axes:
    """Draw the curves of an atlas, its regions, and its points of codimension two.

    Each region shows its number of equilibria and, behind the stroke, how many are stable; its
    color says the same. A third number is that of limit cycles in the window, where they were
    counted. A question mark stands for a number that parts of a region disagree on. What is not
    proved is hatched.

    Parameters
    ----------
    atlas : Atlas
        What `phasekit.atlas` returns.
    units : mapping of str to str, optional
        Units in which parameters are shown, by name.
    counts : bool
        Whether to write the numbers into each region.
    labels : bool
        Whether to write BT, CP, GH, ... beside points.
    portraits : bool, default False
        Of a planar flow: whether to draw small phase portraits above the axes, one of each of the
        widest regions, with letters that say where they are.

    Examples
    --------
    >>> import phasekit as pk
    >>> cusp = pk.Problem("mu + l*x - x^3", "x", {"mu": 0.0, "l": 0.0}, window={"x": (-3, 3)})
    >>> found = pk.atlas(cusp, "mu", "l", span={"mu": (-1, 1), "l": (-1, 2)})
    >>> ax = pk.plot.atlas(found)
    >>> sorted(text.get_text() for text in ax.texts)
    ['1/1', '3/2', 'CP']
    """
    if not isinstance(atlas, Atlas):
        raise bad("atlas", atlas, "what pk.atlas returns")
    own = {"counts": counts, "labels": labels, "portraits": portraits, "legend": legend}
    for name, value in own.items():
        flag(name, value)
    if portraits and len(atlas.window) != 2:
        raise bad(
            "portraits", True, "False, for an atlas of a flow of more or less than two states"
        )
    ds = atlas.to_dataset()
    ds, shown = Units.of_dataset(ds, angles, units)
    axes = style.axes_for(ax, legend=legend)
    scales = [shown.scale(name, str(ds[name].attrs.get("units", ""))) for name in atlas.names]
    ends = [
        (low * scale, high * scale)
        for (low, high), scale in zip(atlas.span.values(), scales, strict=True)
    ]
    handles: dict[str, Artist] = {}
    _fill(axes, ds, ends)
    open_ = (ds["n_equilibria_open"] | ds["n_stable_open"]).values
    if not ds["complete"].values.all() and open_.any():
        handles["open"] = _hatch(axes, open_, ends)
    for curve, lines in zip(atlas.curves, atlas.lines(), strict=True):
        look = style.inked(LOOKS[curve.kind])
        for line in lines:
            x, y = (line[:, k] * scales[k] for k in (0, 1))
            (drawn,) = axes.plot(x, y, zorder=2.0 if curve.kind == "event" else 2.5, **look)
            handles.setdefault(str(look["label"]), drawn)
    names: dict[tuple[float, float], str] = {}
    for point in atlas.special_points:
        look = look_of(point.kind)
        place = point[atlas.names[0]] * scales[0], point[atlas.names[1]] * scales[1]
        axes.plot(*place, linestyle="none", zorder=4, clip_on=False, **look)
        names[place] = KINDS[point.kind].label
        handles.setdefault(point.kind, Line2D([], [], linestyle="none", **look))
    axes.set(xlim=ends[0], ylim=ends[1])
    letters = _portraits(axes, atlas, ds, alone=ax is None) if portraits else {}
    axes.set_xlabel(words.label(ds[atlas.names[0]], shown, style.letters(axes, "x")))
    axes.set_ylabel(words.label(ds[atlas.names[1]], shown, style.letters(axes, "y")))
    if legend:
        style.legend_below(axes, list(handles.values()))
    if labels or counts or letters:
        _lay_out(axes)
    if labels:
        label_points(axes, names)
    if counts or letters:
        _write_counts(axes, ds, atlas.names, scales, letters, list(names), counts=counts)
    return axes


def _lay_out(axes: Axes) -> None:
    """Give axes the size that they will have, which says what has room in them."""
    figure = axes.get_figure(root=True)
    engine = None if figure is None else figure.get_layout_engine()
    if figure is not None and engine is not None:
        engine.execute(figure)


def _fill(axes: Axes, ds: Any, ends: Any) -> None:
    """Color the cells by their region; those that a curve crosses by the nearest one."""
    from scipy import ndimage

    region = ds["cell_region"].values
    if not (region >= 0).any():
        return
    nearest = ndimage.distance_transform_edt(
        region < 0, return_distances=False, return_indices=True
    )
    region = region[tuple(nearest)]
    number, stable = ds["region_n_equilibria"].values, ds["region_n_stable"].values
    colors = [
        _tint(COLORS[max(n, 0) % len(COLORS)], TINTS[min(max(s, 0), len(TINTS) - 1)])
        for n, s in zip(number.tolist(), stable.tolist(), strict=True)
    ]
    axes.imshow(
        region.T, origin="lower", extent=(*ends[0], *ends[1]), aspect="auto",
        interpolation="nearest", cmap=ListedColormap(colors), vmin=-0.5, vmax=len(colors) - 0.5,
        zorder=0.5,
    )  # fmt: skip


def _tint(color: Any, part: float) -> npt.NDArray[np.float64]:
    ground = np.array(to_rgb(plt.rcParams["axes.facecolor"]))
    return np.asarray(ground + part * (np.array(to_rgb(color)) - ground))


def _hatch(axes: Axes, open_: npt.NDArray[np.bool_], ends: Any) -> Patch:
    """Hatch cells; the entry of the legend that says what it means."""
    x, y = (
        low + (np.arange(size) + 0.5) * (high - low) / size
        for (low, high), size in zip(ends, open_.shape, strict=True)
    )
    drawn = axes.contourf(
        x, y, open_.T.astype(float), levels=[0.5, 1.5], colors="none", hatches=["xxxx"], zorder=1.0
    )
    drawn.set(edgecolor=style.GRAY, linewidth=0.0)
    return Patch(facecolor="none", edgecolor=style.GRAY, hatch="xxxx", label="not proved")


def _portraits(axes: Axes, atlas: Atlas, ds: Any, *, alone: bool) -> dict[int, str]:
    """Draw portraits of the widest regions above the axes; their letters, by region.

    A figure of its own gets as much higher; in others there are as many as have room.
    """
    reach = ds["region_reach"].values
    wide = [k for k in np.argsort(-reach, kind="stable").tolist() if reach[k] > READABLE]
    width, height = inches(axes)
    columns = int(np.clip(width / SIDE, 3, len(LETTERS)))
    side = width / columns
    most = len(LETTERS) if alone else columns * max(1, int(PART * height / side))
    # Letters go through the regions from the left.
    left = ds[f"region_{atlas.names[0]}"].values
    chosen = sorted(wide[: min(most, len(LETTERS))], key=lambda k: float(left[k]))
    figure = axes.get_figure(root=True)
    if alone and figure is not None:
        rows = -(-len(chosen) // columns)
        figure.set_figheight(figure.get_figheight() + side * rows)
    # Inches from the upper left corner, however high the layout makes the axes.
    left_top: Any = axes.transAxes
    corner = axes.figure.dpi_scale_trans + ScaledTranslation(0.0, 1.0, left_top)
    low, high = np.array(list(atlas.window.values())).T
    letters: dict[int, str] = {}
    with notice("drawing phase portraits of regions"):
        for i, k in enumerate(chosen):
            stage(f"portrait {i + 1} of {len(chosen)}")
            row = (len(chosen) - 1) // columns - i // columns
            corner_of = side * (i % columns), side * (row + GAP)
            small = axes.inset_axes(
                (*corner_of, side * (1 - GAP), side * (1 - GAP)), transform=corner
            )
            place = {name: float(ds[f"region_{name}"][k]) for name in atlas.names}
            letters[k] = LETTERS[i]
            thumbnail(small, atlas.problem.replace(**place), low, high)
            text = small.annotate(
                LETTERS[i], (0, 1), (3, -3), "axes fraction", "offset points", va="top",
                fontsize="small", fontweight="bold", zorder=7,
            )  # fmt: skip
            text.set_path_effects(style.halo(plt.rcParams["axes.facecolor"], 2.0))
    return letters


def _write_counts(
    axes: Axes, ds: Any, names: tuple[str, str], scales: Any, letters: Mapping[int, str],
    points: Sequence[tuple[float, float]], *, counts: bool,
) -> None:  # fmt: skip
    """Write numbers into regions, off the names of points."""
    places = [ds[f"region_{name}"].values * s for name, s in zip(names, scales, strict=True)]
    number, stable = ds["region_n_equilibria"].values, ds["region_n_stable"].values
    cycles = ds["region_n_cycles"].values
    taken = [text.get_window_extent() for text in axes.texts]
    half = MARK * float(axes.figure.dpi)
    for x, y in axes.transData.transform(np.reshape(points, (-1, 2))):
        taken.append(Bbox.from_extents(x - half, y - half, x + half, y + half))
    ends = axes.transData.transform(np.array([axes.get_xlim(), axes.get_ylim()]).T)
    for k in np.flatnonzero(ds["region_reach"].values > READABLE).tolist():
        parts = [letters[k]] if k in letters else []
        known = (number[k], stable[k], cycles[k])[: 2 + int(cycles[k] >= 0)]
        parts += ["/".join("?" if n < 0 else str(n) for n in known)] if counts else []
        text = axes.text(
            places[0][k], places[1][k], " ".join(parts), ha="center", va="center",
            color=plt.rcParams["text.color"], zorder=5,
        )  # fmt: skip
        text.set_path_effects(style.halo(plt.rcParams["axes.facecolor"], 3.0))
        own = text.get_window_extent()
        size = own.width + half, own.height + half
        own = Bbox.from_bounds(own.x0 - 0.5 * half, own.y0 - 0.5 * half, *size)
        if k not in letters and any(own.overlaps(box) for box in taken):
            at = _free_place(ds["cell_region"].values == k, ends, size, taken)
            x, y = axes.transData.inverted().transform(at)
            text.set_position((float(x), float(y)))
        # Where there is no room for it the color of a region says its numbers alone.
        inside = _part_within(ds["cell_region"].values == k, ends, text.get_window_extent())
        if k not in letters and inside < WITHIN:
            text.remove()


def _part_within(
    cells: npt.NDArray[np.bool_], ends: npt.NDArray[np.float64], box: Bbox
) -> float:  # fmt: skip
    """What part of a text, in pixels, is in the cells of a region."""
    step = (ends[1] - ends[0]) / cells.shape
    (i, j), (k, m) = (
        np.clip(np.floor((np.array(corner) - ends[0]) / step), 0, np.array(cells.shape) - 1)
        for corner in (box.min, box.max)
    )  # fmt: skip
    return float(cells[int(i) : int(k) + 1, int(j) : int(m) + 1].mean())


def _free_place(
    cells: npt.NDArray[np.bool_], ends: npt.NDArray[np.float64], size: tuple[float, float],
    taken: Sequence[Bbox],
) -> npt.NDArray[np.float64]:  # fmt: skip
    """The middle of the cell of a region, in pixels, with most room for a text off what is taken.

    Of the axes' two corners the pixels are given.
    """
    from scipy import ndimage

    low, step = ends[0], (ends[1] - ends[0]) / cells.shape
    free = np.pad(cells, 1)
    x, y = (low[k] + (np.arange(-1, n + 1) + 0.5) * step[k] for k, n in enumerate(cells.shape))
    for box in taken:
        beside = np.maximum(x - box.x1, box.x0 - x)[:, None] < 0.5 * size[0]
        free &= ~(beside & (np.maximum(y - box.y1, box.y0 - y) < 0.5 * size[1]))
    room = ndimage.distance_transform_edt(np.pad(cells, 1), sampling=np.abs(step) / size)
    i, j = np.unravel_index(np.argmax(np.where(free, room, -1.0)), room.shape)
    if not free[i, j]:
        i, j = np.unravel_index(np.argmax(room), room.shape)
    return np.array([x[i], y[j]])
