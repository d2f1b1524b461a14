"""Names beside special points, where there is room for them."""

from __future__ import annotations

from collections.abc import Mapping

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.axes import Axes
from matplotlib.transforms import Bbox

from phasekit.plot.parts import style

#: Distance in letters within which the names of two points would cover each other.
TOUCHING = 1.6
#: Half the size of a point's marker, in letters.
MARK = 0.4


def label_points(ax: Axes, named: Mapping[tuple[float, float], str]) -> None:
    """Write the names of points next to them; those of points that touch on the page are one text.

    A name stands on the side where there is room, which the limits of the axes tell: they have to
    be set before.
    """
    kept: list[tuple[list[str], tuple[float, float], np.ndarray]] = []
    for point, text in named.items():
        at = ax.transData.transform(point)
        near = [one for one in kept if np.hypot(*(at - one[2])) < _pixels(ax, TOUCHING)]
        if not near:
            kept.append(([text], point, at))
        elif text not in near[0][0]:
            near[0][0].append(text)
    taken: list[Bbox] = []
    marks = ax.transData.transform(np.reshape(list(named), (-1, 2)))
    for names, point, _ in kept:
        taken.append(_label_point(ax, point, ", ".join(names), marks, taken))


def _pixels(ax: Axes, letters: float) -> float:
    size = float(ax.xaxis.label.get_fontsize())
    return letters * size * float(ax.figure.dpi) / 72.0


def _label_point(
    ax: Axes, point: tuple[float, float], text: str, marks: np.ndarray, taken: list[Bbox]
) -> Bbox:
    """Write a name on the first side that is inside the axes and free of names and points."""
    box, size = ax.get_window_extent(), _pixels(ax, MARK)
    sides = [(1, 1), (-1, 1), (1, -1), (-1, -1), (0, 1), (0, -1), (1, 0), (-1, 0)]
    written = ax.annotate(
        text, point, xytext=(6, 6), textcoords="offset points", fontsize="small", zorder=6,
        annotation_clip=False, path_effects=style.halo(plt.rcParams["axes.facecolor"], 2.5),
    )  # fmt: skip

    def put(side: tuple[int, int]) -> Bbox:
        right, above = side
        written.set_position((6 * right, 6 * above))
        written.set_horizontalalignment(("center", "left", "right")[right])
        written.set_verticalalignment(("center", "bottom", "top")[above])
        return written.get_window_extent()

    def crowded(side: tuple[int, int]) -> int:
        own = put(side)
        inside = [box.x0 <= own.x0 and own.x1 <= box.x1, box.y0 <= own.y0 and own.y1 <= box.y1]
        covered = [other for other in taken if own.overlaps(other)]
        low, high = np.array(own.min) - size, np.array(own.max) + size
        over = np.all((marks > low) & (marks < high), axis=1)  # its own point is beside it
        return 2 * inside.count(False) + 2 * len(covered) + int(over.sum())

    return put(min(sides, key=crowded))
