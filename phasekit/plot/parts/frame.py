"""Figures, Axes and legends: how much room there is, and what fits into it."""

from __future__ import annotations

import contextlib
import functools
from collections.abc import Callable, Mapping
from typing import Literal

import matplotlib.pyplot as plt
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.legend import Legend
from matplotlib.transforms import ScaledTranslation

from phasekit.labels.arguments import bad, flag

#: Axes that are narrower than this (inches) have short names in their legends.
NARROW = 4.0
#: More than ticks and labels beside Axes ever take (inches).
BESIDE = 1.5
#: Part of the width of a figure that its layout fills.
EDGES = 0.97
#: Axes that are lower than this (inches) lose a good part of their height to a legend.
LOW = 3.0
#: Part of the height of a panel that a legend may take before names become short.
TALL = 0.25
#: What names become where there is little room.
SHORT: Mapping[str, str] = {
    "winding separatrix": "winding",
    "unbounded separatrix": "unbounded",
    "heteroclinic cycle": "heteroclinic",
    "homoclinic loop": "homoclinic",
    "level of the degenerate point": "degenerate level",
    "rest, at every angle": "rest",
    "saddles of equal energy": "equal saddles",
    "centers of equal energy": "equal centers",
    "energy of the saddle": "saddle",
    "energy of the lower saddle": "lower saddle",
    "energy of the upper saddle": "upper saddle",
    "energy of the degenerate point": "degenerate",
    "round both wells": "both wells",
    "small oscillations": "centers",
    "transcritical point": "transcritical",
}


def new_figure(tall: float = 1.0) -> Figure:
    """Return an empty pyplot figure that keeps labels and legends inside.

    It has the size that matplotlib is set to, but for its height, which is `tall` times that.
    """
    width, height = plt.rcParams["figure.figsize"]
    return plt.figure(figsize=(width, tall * height), layout="constrained")


def axes_for(ax: object, *, legend: bool) -> Axes:
    """Return the Axes to draw in: the given one, or that of a new figure."""
    flag("legend", legend)
    return new_figure().add_subplot() if ax is None else check_axes(ax, legend=legend)


def check_axes(ax: object, argument: str = "ax", *, legend: bool = False) -> Axes:
    """Return `ax` if it is a matplotlib Axes, with room for a legend under it if it gets one.

    Without a layout engine a figure would cut the legend off; this has to be settled before a
    color bar is made.
    """
    if not isinstance(ax, Axes):
        raise bad(argument, ax, "a matplotlib Axes", "figure, ax = plt.subplots() makes one")
    figure = ax.get_figure(root=True)
    if legend and figure is not None and figure.get_layout_engine() is None:
        # Refused where a color bar of the old layout stands already.
        with contextlib.suppress(RuntimeError):
            figure.set_layout_engine("constrained")
    return ax


def inches(ax: Axes) -> tuple[float, float]:
    """Return width and height of Axes."""
    box = ax.get_window_extent().transformed(ax.figure.dpi_scale_trans.inverted())
    return float(box.width), float(box.height)


def narrow(ax: Axes) -> bool:
    """Whether Axes have room for short names only."""
    return inches(ax)[0] < NARROW


def few_ticks(ax: Axes) -> None:
    """Put no more ticks with long numbers along a narrow axis than have room."""
    if narrow(ax):
        ax.locator_params(axis="x", nbins=4)


def letters(ax: Axes, which: Literal["x", "y"]) -> int:
    """Return about how many letters of a label fit along one axis."""
    axis = ax.xaxis if which == "x" else ax.yaxis
    length = inches(ax)["xy".index(which)]
    if which == "y" and length < LOW:
        length *= 0.75  # a legend is yet to take its part
    return max(12, int(72.0 * length / (0.55 * float(axis.label.get_fontsize()))))


def legend_below(
    ax: Axes, handles: list[Artist], short: Mapping[str, str] | None = None
) -> Legend | None:
    """Put a legend under the axis label, where it cannot cover what is drawn.

    It has as many columns as fit; in narrow Axes it has the names of `SHORT` and `short`, if
    those that the handles have would take too much.
    """
    if not handles:
        return None
    names = [str(handle.get_label()) for handle in handles]
    known = {**SHORT, **(short or {})}
    brief = [known.get(name, name.removeprefix("from ")) for name in names]  # of a start its state
    tried: dict[float, tuple[list[str], int, float]] = {}
    alone = [*ax.figure.axes] == [ax]  # no color bar beside them: the layout will widen them
    height = float((ax.figure.bbox if alone else ax.get_window_extent()).height)
    beside = functools.cache(_beside)
    for texts in [names, brief] if brief != names else [names]:
        for columns in range(min(3, len(handles)), 0, -1):
            own = _legend(ax, handles, texts, columns).get_window_extent()
            off = _off(ax, own.width, beside, alone=alone)
            if columns == 1 or off is not None:
                tried.setdefault(float(own.height), (texts, columns, off or 0.0))
                break
        if own.height <= TALL * height and off is not None:
            break
    return _legend(ax, handles, *tried[min(tried)])


def _off(
    ax: Axes, width: float, beside: Callable[[Axes], tuple[float, float]], *, alone: bool
) -> float | None:
    """How far to the left (pixels) of the middle a legend of a width has room; None: nowhere.

    What stands beside the axes is measured only where that is not plain: it takes longer than the
    whole picture. Below it there is room for a legend, too.
    """
    whole = float(ax.figure.bbox.width)
    if not alone:
        return 0.0 if width <= ax.get_window_extent().width else None
    if width <= whole - BESIDE * ax.figure.dpi:
        return 0.0
    left, right = beside(ax)
    if width > EDGES * whole:
        return None
    # Its right end is not beyond what stands there anyway.
    return max(0.0, 0.5 * (width - (EDGES * whole - left - right)) - right)


def _beside(ax: Axes) -> tuple[float, float]:
    """How much stands to the left and to the right of axes, in pixels."""
    legend = ax.get_legend()
    if legend is not None:
        legend.set_in_layout(False)  # it is being tried
    box, tight = ax.get_window_extent(), ax.get_tightbbox()
    if tight is None:
        return 0.0, 0.0
    return max(box.x0 - tight.x0, 0.0), max(tight.x1 - box.x1, 0.0)


def _legend(
    ax: Axes, handles: list[Artist], texts: list[str], columns: int, off: float = 0.0
) -> Legend:
    label = ax.xaxis.label
    lines = label.get_text().count("\n") + 1
    points = 22.0 + 1.35 * lines * float(label.get_fontsize())
    left = off / float(ax.figure.dpi)
    offset = ScaledTranslation(-left, -points / 72.0, ax.figure.dpi_scale_trans)
    small = narrow(ax)
    return ax.legend(
        handles=handles,
        labels=texts,
        loc="upper center",
        bbox_to_anchor=(0.5, 0.0),
        bbox_transform=ax.transAxes + offset,
        ncols=columns,
        frameon=False,
        borderaxespad=0.0,
        fontsize="small",
        handlelength=2.2 if small else 2.6,
        columnspacing=1.0 if small else 2.0,
        handletextpad=0.5 if small else 0.8,
        labelspacing=0.3 if small else 0.5,
    )
