"""How things look: colors, line styles and markers for every picture, in one place.

The colors are those of Okabe and Ito, which the color-blind can tell apart. No meaning hangs on a
color alone: each also has its own line style or marker, so that a picture survives gray print.
"""

from __future__ import annotations

import contextlib
from collections.abc import Mapping
from typing import Any, Literal

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.cm import ScalarMappable
from matplotlib.colorbar import Colorbar
from matplotlib.colors import ListedColormap, LogNorm, to_rgba
from matplotlib.figure import Figure
from matplotlib.ticker import FixedLocator, FuncFormatter, MaxNLocator, MultipleLocator, NullLocator
from matplotlib.transforms import ScaledTranslation

from phasekit.bifurcation.special_points import KINDS
from phasekit.errors import EquilibriumKind, Topology
from phasekit.labels.arguments import bad, flag

Angles = Literal["rad", "deg"]
Look = dict[str, Any]

BLACK, GRAY = "#000000", "#6E6E6E"
BLUE, SKY, GREEN = "#0072B2", "#56B4E9", "#009E73"
ORANGE, VERMILLION, PURPLE, YELLOW = "#E69F00", "#D55E00", "#CC79A7", "#F0E442"

#: Colors by the names that the registry of special points has for them.
PALETTE = {
    "SKY": SKY, "GREEN": GREEN, "ORANGE": ORANGE, "PURPLE": PURPLE, "YELLOW": YELLOW,
}  # fmt: skip

# Markers of equilibria, by kind.
POINTS: Mapping[EquilibriumKind, Look] = {
    EquilibriumKind.CENTER: {
        "marker": "o",
        "markersize": 7,
        "markerfacecolor": BLUE,
        "markeredgecolor": "white",
        "label": "center",
    },
    EquilibriumKind.SADDLE: {
        "marker": "D",
        "markersize": 6.5,
        "markerfacecolor": "white",
        "markeredgecolor": VERMILLION,
        "markeredgewidth": 1.8,
        "label": "saddle",
    },
    EquilibriumKind.DEGENERATE: {
        "marker": "s",
        "markersize": 7,
        "markerfacecolor": PURPLE,
        "markeredgecolor": BLACK,
        "label": "degenerate",
    },
}

# Curves of equilibria in bifurcation diagrams, by kind.
BRANCHES: Mapping[EquilibriumKind, Look] = {
    EquilibriumKind.CENTER: {
        "color": BLUE,
        "linestyle": "-",
        "linewidth": 1.8,
        "label": "center",
    },
    EquilibriumKind.SADDLE: {
        "color": VERMILLION,
        "linestyle": (0, (5, 2)),
        "linewidth": 1.8,
        "label": "saddle",
    },
}

#: Special points, by kind: as the registry has them.
POINTS_OF: Mapping[str, Look] = {
    kind.name: {
        "marker": kind.marker,
        "markersize": kind.size,
        "markerfacecolor": PALETTE.get(kind.face, kind.face),
        "markeredgecolor": BLACK,
        "label": kind.name.replace("_", " "),
    }
    for kind in KINDS.values()
    if kind.marker
}

# Points where equilibria meet.
MERGERS: Mapping[str, Look] = {
    name: POINTS_OF[name] for name in POINTS_OF if "branches" in KINDS[name].found_by
}

# Equilibria that stay degenerate along a branch.
MERGED: Look = {"color": PURPLE, "linestyle": (0, (1, 1)), "linewidth": 2.4, "label": "degenerate"}

# Curves in a plane of two parameters, by kind and the sign of A.
LOCI: Mapping[tuple[str, int], Look] = {
    ("fold", 1): {"color": BLUE, "linestyle": "-", "linewidth": 2.0, "label": "fold, $A > 0$"},
    ("fold", -1): {
        "color": VERMILLION,
        "linestyle": (0, (6, 1.5)),
        "linewidth": 2.0,
        "label": "fold, $A < 0$",
    },
    ("pitchfork", 1): {
        "color": BLUE,
        "linestyle": "-",
        "linewidth": 3.0,
        "label": "pitchfork, $A > 0$",
    },
    ("pitchfork", -1): {
        "color": VERMILLION,
        "linestyle": (0, (4, 1)),
        "linewidth": 3.0,
        "label": "pitchfork, $A < 0$",
    },
    ("sign_change", 0): {
        "color": BLACK,
        "linestyle": (0, (4, 2)),
        "linewidth": 1.2,
        "label": "$A = 0$",
    },
    ("equal_saddles", 0): {
        "color": GREEN,
        "linestyle": (0, (7, 2, 1.5, 2)),
        "linewidth": 1.8,
        "label": "saddles of equal energy",
    },
    ("equal_centers", 0): {
        "color": PURPLE,
        "linestyle": (0, (1.2, 1.2)),
        "linewidth": 1.8,
        "label": "centers of equal energy",
    },
}

LEVEL: Look = {"color": GRAY, "linestyle": "-", "linewidth": 0.8}
ROTATION: Look = {"color": GRAY, "linestyle": (0, (1, 1.5)), "linewidth": 1.1}
EIGHT: Look = {"color": VERMILLION, "linestyle": "-", "linewidth": 2.0, "label": "figure-eight"}
WINDING: Look = {
    "color": BLACK,
    "linestyle": (0, (6, 2)),
    "linewidth": 1.8,
    "label": "winding separatrix",
}
CYCLE: Look = {
    "color": VERMILLION,
    "linestyle": (0, (7, 2, 1.5, 2)),
    "linewidth": 2.0,
    "label": "heteroclinic cycle",
}
DEGENERATE: Look = {
    "color": PURPLE,
    "linestyle": (0, (4, 1.5, 1, 1.5, 1, 1.5)),
    "linewidth": 1.8,
    "label": "level of the degenerate point",
}
EIGHT_FILL: Look = {"facecolor": ORANGE, "alpha": 0.28, "edgecolor": "none"}
EIGHT_KEY: Look = {
    "facecolor": to_rgba(ORANGE, 0.28),
    "edgecolor": VERMILLION,
    "linewidth": 2.0,
    "label": "figure-eight",
}
REST: Look = {"color": PURPLE, "linestyle": "-", "linewidth": 3.0, "label": "rest, at every angle"}
FOLD_CURVE: Look = {"color": BLACK, "linestyle": "-", "linewidth": 2.0, "label": "fold"}
PITCHFORK_CURVE: Look = {**FOLD_CURVE, "linestyle": (0, (3, 1)), "label": "pitchfork"}
SIGN_CHANGE: Look = {"color": BLACK, "linestyle": (0, (4, 2)), "linewidth": 1.4, "label": "$A = 0$"}
# Both wells have the same period at the same energy: the dashes let the lower one show through.
FAMILIES: Mapping[str, Look] = {
    "lower_well": {"color": BLUE, "linestyle": "-", "linewidth": 2.4, "label": "lower well"},
    "upper_well": {
        "color": ORANGE,
        "linestyle": (0, (4, 3)),
        "linewidth": 2.0,
        "label": "upper well",
    },
    "outer": {
        "color": GREEN,
        "linestyle": (0, (7, 2, 1.5, 2)),
        "linewidth": 2.0,
        "label": "round both wells",
    },
    "rotation": {
        "color": PURPLE,
        "linestyle": (0, (1.2, 1.2)),
        "linewidth": 2.2,
        "label": "rotation",
    },
}
WALLS: Mapping[str, Look] = {
    "lower": {
        "color": VERMILLION,
        "linestyle": (0, (5, 2)),
        "linewidth": 1.2,
        "label": "energy of the lower saddle",
    },
    "upper": {
        "color": BLACK,
        "linestyle": (0, (6, 4)),
        "linewidth": 1.2,
        "label": "energy of the upper saddle",
    },
    "degenerate": {
        "color": PURPLE,
        "linestyle": (0, (4, 1.5, 1, 1.5, 1, 1.5)),
        "linewidth": 1.2,
        "label": "energy of the degenerate point",
    },
}
ORIGIN: Look = {
    "marker": "P",
    "markersize": 7,
    "markerfacecolor": BLACK,
    "markeredgecolor": "white",
    "linestyle": "none",
    "label": "equilibria",
}
MOTION: Look = {"color": BLUE, "linestyle": "-", "linewidth": 1.8}
ORBIT_COLORS = (GREEN, PURPLE, SKY, ORANGE, BLUE)
ORBIT_DASHES: tuple[Any, ...] = ("-", (0, (6, 2)), (0, (6, 2, 1.5, 2)), (0, (1.5, 1.5)))
# Magnitude and components of a force, or two bearings.
LOAD_COLORS = (BLUE, VERMILLION, GREEN, PURPLE)
# Sides of a force polygon: the four components, the weight; and what they sum to.
POLYGON: tuple[Look, ...] = tuple(
    {"color": color, "linestyle": "-", "linewidth": 2.0}
    for color in (BLUE, SKY, GREEN, PURPLE, GRAY)
)
RESULTANT: Look = {"color": BLACK, "linestyle": "-", "linewidth": 2.6}

# Cells of coded maps; the lightness falls from one code to the next.
NOTHING = "#DDDDDD"
CODE_COLORS = ("#CFE8F7", ORANGE, "#7A2E00", GREEN, BLUE, PURPLE)
TOPOLOGY_COLORS: Mapping[int, str] = {
    Topology.NOT_COMPUTED: "#FFFFFF",
    Topology.NONE: NOTHING,
    Topology.WINDING: CODE_COLORS[0],
    Topology.FIGURE_EIGHT: CODE_COLORS[1],
    Topology.HETEROCLINIC: CODE_COLORS[2],
    Topology.HOMOCLINIC: CODE_COLORS[3],
    Topology.UNBOUNDED: CODE_COLORS[4],
}
COUNT_COLORS: Mapping[int, str] = {
    -1: "#FFFFFF",
    0: NOTHING,
    2: CODE_COLORS[0],
    3: GREEN,
    4: CODE_COLORS[1],
}
KIND_COLORS: Mapping[int, str] = {
    EquilibriumKind.NOT_COMPUTED: "#FFFFFF",
    EquilibriumKind.ABSENT: NOTHING,
    EquilibriumKind.CENTER: SKY,
    EquilibriumKind.SADDLE: VERMILLION,
    EquilibriumKind.DEGENERATE: BLACK,
}
SEQUENTIAL = "cividis"
# Colors of lines stay clear of the light end, which is lost on white.
LINES = ListedColormap(plt.colormaps["viridis"](np.linspace(0.0, 0.9, 256)))


def new_figure(width: float = 6.4, height: float = 4.8) -> Figure:
    """Return an empty pyplot figure that keeps labels and legends inside."""
    return plt.figure(figsize=(width, height), layout="constrained")


def axes_for(ax: object, *, legend: bool, width: float = 6.4) -> Axes:
    """Return the Axes to draw in: the given one, or that of a new figure."""
    flag("legend", legend)
    if ax is None:
        return new_figure(width).add_subplot()
    return check_axes(ax, legend=legend)


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


def angle_factor(angles: object) -> float:
    """Return what radians are multiplied by to be shown in `angles`."""
    factors = {"rad": 1.0, "deg": 180.0 / np.pi}
    if not isinstance(angles, str) or angles not in factors:
        raise bad("angles", angles, "'rad' or 'deg'")
    return factors[angles]


def multiple_of_pi(value: float, _position: object = None) -> str:
    """Write an angle as a multiple of pi/2."""
    halves = round(value / (np.pi / 2))
    if halves == 0:
        return "0"
    sign = "-" if halves < 0 else ""
    whole, odd = divmod(abs(halves), 2)
    if odd:
        top = "" if abs(halves) == 1 else f"{abs(halves)}"
        return rf"${sign}{top}\pi/2$"
    return rf"${sign}{'' if whole == 1 else whole}\pi$"


def angle_unit(angles: Angles) -> str:
    """Return the symbol of the unit in which angles are shown."""
    return "rad" if angles == "rad" else "°"


def circle_axis(ax: Axes, which: Literal["x", "y"], angles: Angles) -> None:
    """Show the whole circle on one axis, with ticks at multiples of a quarter turn."""
    factor = angle_factor(angles)
    axis = ax.xaxis if which == "x" else ax.yaxis
    quarters = np.arange(-2, 3) * (np.pi / 2)
    axis.set_major_locator(FixedLocator(list(quarters * factor)))
    axis.set_minor_locator(MultipleLocator(np.pi / 8 * factor))
    if angles == "rad":
        axis.set_major_formatter(FuncFormatter(multiple_of_pi))
    ax.set(**{f"{which}lim": (-np.pi * factor, np.pi * factor)})


def unwrapped_axis(ax: Axes, which: Literal["x", "y"], angles: Angles) -> None:
    """Put ticks at quarter turns or multiples of them, where an axis spans half a turn or more."""
    factor = angle_factor(angles)
    axis = ax.xaxis if which == "x" else ax.yaxis
    low, high = sorted(ax.get_xlim() if which == "x" else ax.get_ylim())
    quarters = (high - low) / factor / (np.pi / 2)
    if quarters < 2.0 or not np.isfinite(quarters):
        return
    steps = [1.0, 2.0, *(float(f"{digit}e{power}") for power in range(16) for digit in (4, 8, 20))]
    step = next((step for step in steps if quarters <= 8.0 * step), quarters / 8.0)
    axis.set_major_locator(MultipleLocator(step * np.pi / 2 * factor))
    if angles == "rad":
        axis.set_major_formatter(FuncFormatter(multiple_of_pi))


def inked(look: Look) -> Look:
    """Return a look whose black is the color of text, which is light in dark styles."""
    return {**look, "color": plt.rcParams["text.color"]} if look["color"] == BLACK else look


def log_limits(values: Any) -> tuple[float, float] | None:
    """Return the least and the greatest of the finite values > 0, None where there are none."""
    finite = np.asarray(values)[np.isfinite(values) & (np.asarray(values) > 0.0)]
    if not finite.size:
        return None
    low, high = float(finite.min()), float(finite.max())
    return (low, high) if high > 1.02 * low else (low / 1.1, high * 1.1)


def log_bar(ax: Axes, limits: tuple[float, float], text: str) -> ScalarMappable:
    """Draw a color bar with round numbers, also where a logarithmic scale spans little."""
    mappable = ScalarMappable(LogNorm(*limits), LINES)
    log_ticks(ax.figure.colorbar(mappable, ax=ax, label=text))
    return mappable


def log_ticks(bar: Colorbar) -> None:
    """Put round numbers along a color bar with a logarithmic scale."""
    bar.ax.yaxis.set_major_locator(FixedLocator(round_numbers(*bar.mappable.get_clim())))
    bar.ax.yaxis.set_minor_locator(NullLocator())
    bar.ax.yaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:.4g}"))


def round_numbers(low: float, high: float) -> list[float]:
    """Return round numbers from `low` to `high` for a logarithmic scale.

    >>> round_numbers(1.8, 33.0), round_numbers(1.8, 3.3)
    ([2.0, 5.0, 10.0, 20.0], [2.0, 2.5, 3.0])
    """
    if high < 5.0 * low:
        ticks = list(MaxNLocator(6, steps=[1, 2, 5, 10]).tick_values(low, high))
    else:
        digits = (1, 2, 5) if high < 5e3 * low else (1,)
        powers = range(int(np.floor(np.log10(low))), int(np.floor(np.log10(high))) + 1)
        ticks = [float(f"{digit}e{power}") for power in powers for digit in digits]
    inside = [float(tick) for tick in ticks if low <= tick <= high]
    return inside[:: -(-len(inside) // 9)] if inside else [low, high]


def letters(ax: Axes, which: Literal["x", "y"]) -> int:
    """Return about how many letters of a label fit along one axis."""
    axis = ax.xaxis if which == "x" else ax.yaxis
    box = ax.get_window_extent().transformed(ax.figure.dpi_scale_trans.inverted())
    inches = box.width if which == "x" else box.height
    return max(20, int(72.0 * inches / (0.6 * float(axis.label.get_fontsize()))))


def legend_below(ax: Axes, handles: list[Artist]) -> None:
    """Put a legend under the axis label, where it cannot cover what is drawn."""
    if not handles:
        return
    text = ax.xaxis.label
    lines = text.get_text().count("\n") + 1
    points = 22.0 + 1.35 * lines * float(text.get_fontsize())
    offset = ScaledTranslation(0.0, -points / 72.0, ax.figure.dpi_scale_trans)
    for columns in range(min(3, len(handles)), 0, -1):
        legend = ax.legend(
            handles=handles,
            loc="upper center",
            bbox_to_anchor=(0.5, 0.0),
            bbox_transform=ax.transAxes + offset,
            ncols=columns,
            frameon=False,
            borderaxespad=0.0,
            fontsize="small",
            handlelength=2.6,
        )
        # A wider one would be cut, or leave no room for the axes.
        if legend.get_window_extent().width <= 1.25 * ax.get_window_extent().width:
            break
