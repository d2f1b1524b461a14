"""How things look: colors, line styles and markers for every picture, in one place.

The colors are those of Okabe and Ito, which the color-blind can tell apart. No meaning hangs on a
color alone: each also has its own line style or marker, so that a picture survives gray print.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.colors import ListedColormap, to_rgba
from matplotlib.patheffects import AbstractPathEffect, withStroke

from phasekit.bifurcation.special_points import KINDS
from phasekit.errors import EquilibriumKind, FlowEquilibriumKind, Topology
from phasekit.plot.parts.circle import circle_axis as circle_axis
from phasekit.plot.parts.circle import unwrapped_axis as unwrapped_axis
from phasekit.plot.parts.frame import axes_for as axes_for
from phasekit.plot.parts.frame import check_axes as check_axes
from phasekit.plot.parts.frame import few_ticks as few_ticks
from phasekit.plot.parts.frame import inches as inches
from phasekit.plot.parts.frame import legend_below as legend_below
from phasekit.plot.parts.frame import letters as letters
from phasekit.plot.parts.frame import narrow as narrow
from phasekit.plot.parts.frame import new_figure as new_figure
from phasekit.plot.parts.units import Angles as Angles

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

# Those of flows; stable ones are full, unstable ones empty.
FLOW_POINTS: Mapping[FlowEquilibriumKind, Look] = {
    FlowEquilibriumKind.CENTER: POINTS[EquilibriumKind.CENTER],
    FlowEquilibriumKind.SADDLE: POINTS[EquilibriumKind.SADDLE],
    FlowEquilibriumKind.DEGENERATE: POINTS[EquilibriumKind.DEGENERATE],
    **{
        kind: {
            "marker": marker,
            "markersize": size,
            "markerfacecolor": BLACK if stable else "white",
            "markeredgecolor": "white" if stable else BLACK,
            "markeredgewidth": 0.8 if stable else 1.5,
            "label": kind.name.lower().replace("_", " "),
        }
        for kind, marker, size, stable in (
            (FlowEquilibriumKind.STABLE_NODE, "s", 7, True),
            (FlowEquilibriumKind.UNSTABLE_NODE, "s", 6, False),
            (FlowEquilibriumKind.STABLE_FOCUS, "o", 7.5, True),
            (FlowEquilibriumKind.UNSTABLE_FOCUS, "o", 6.5, False),
        )
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


#: Names of people in kinds of special points, and what is written with a hyphen.
WRITTEN: Mapping[str, str] = {
    "bogdanov_takens": "Bogdanov-Takens", "shilnikov": "Shilnikov", "hopf": "Hopf",
    "zero_H": "zero-H", "Hopf_H": "Hopf-H", "Shilnikov_H": "Shilnikov-H", "chenciner": "Chenciner",
}  # fmt: skip


def look_of(name: str) -> Look:
    """The look of a kind of special point, as the registry has it."""
    kind = KINDS[name]
    return {
        "marker": kind.marker,
        "markersize": kind.size,
        "markerfacecolor": PALETTE.get(kind.face, kind.face),
        "markeredgecolor": BLACK,
        "label": _words(kind.name),
    }


def _words(name: str) -> str:
    """A kind of special point as it is written in a text."""
    for plain, written in WRITTEN.items():
        name = name.replace(plain, written)
    return name.replace("_", " ")


#: Special points of phasekit, by kind.
POINTS_OF: Mapping[str, Look] = {name: look_of(name) for name in KINDS if KINDS[name].marker}

# Points where equilibria meet.
MERGERS: Mapping[str, Look] = {
    name: POINTS_OF[name] for name in POINTS_OF if "branches" in KINDS[name].found_by
}

# Equilibria that stay degenerate along a branch.
MERGED: Look = {"color": PURPLE, "linestyle": (0, (1, 1)), "linewidth": 2.4, "label": "degenerate"}

# Curves in a plane of two parameters, by kind and the sign of A.
LOCI: Mapping[tuple[str, int], Look] = {
    ("fold", 0): {"color": BLUE, "linestyle": "-", "linewidth": 2.0, "label": "fold"},
    ("pitchfork", 0): {"color": BLUE, "linestyle": "-", "linewidth": 3.0, "label": "pitchfork"},
    ("transcritical", 0): {
        "color": VERMILLION,
        "linestyle": (0, (4, 1)),
        "linewidth": 3.0,
        "label": "transcritical",
    },
    ("window_exit", 0): {
        "color": BLACK,
        "linestyle": (0, (1, 1.5)),
        "linewidth": 1.2,
        "label": "leaves the interval",
    },
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

STABLE: Look = {"color": BLUE, "linestyle": (0, (5, 1.5)), "linewidth": 1.6}
UNSTABLE: Look = {"color": VERMILLION, "linestyle": "-", "linewidth": 1.6}
#: Short names of manifolds, for narrow legends.
MANIFOLDS = {"stable manifold": "stable", "unstable manifold": "unstable"}

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
    {"color": color, "linestyle": dash, "linewidth": 2.0}
    for color, dash in (
        (BLUE, "-"),
        (SKY, (0, (4, 1))),
        (GREEN, (0, (6, 1.5, 1.5, 1.5))),
        (PURPLE, (0, (1.5, 0.8))),
        (GRAY, (0, (2.5, 1))),
    )
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
# Colors of lines stay clear of the light end, which is lost on white, or of the dark one on black.
LINES = ListedColormap(plt.colormaps["viridis"](np.linspace(0.0, 0.9, 256)))
LINES_ON_DARK = ListedColormap(plt.colormaps["viridis"](np.linspace(0.25, 1.0, 256)))


def inked(look: Look) -> Look:
    """Return a look whose black is the color of text, which is light in dark styles."""
    return {**look, "color": plt.rcParams["text.color"]} if look["color"] == BLACK else look


def lines() -> ListedColormap:
    """Return the colors of lines on the background that is set."""
    dark = sum(to_rgba(plt.rcParams["axes.facecolor"])[:3]) < 1.5
    return LINES_ON_DARK if dark else LINES


def halo(color: str = "white", width: float = 1.6) -> list[AbstractPathEffect]:
    """Return what sets a line or a text off from what lies under it."""
    return [withStroke(linewidth=width, foreground=color)]
