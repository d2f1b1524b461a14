"""Names beside special points, where there is room for them."""

from __future__ import annotations

from collections.abc import Mapping

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.axes import Axes

from phasekit.plot.parts import style

#: Distance in letters within which the names of two points would cover each other.
TOUCHING = 1.6


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
    for number, (names, point, at) in enumerate(kept):
        others = [other for _, _, other in kept[:number] + kept[number + 1 :]]
        _label_point(ax, point, ", ".join(names), at, others)


def _pixels(ax: Axes, letters: float) -> float:
    size = float(ax.xaxis.label.get_fontsize())
    return letters * size * float(ax.figure.dpi) / 72.0


def _label_point(
    ax: Axes, point: tuple[float, float], text: str, at: np.ndarray, others: list[np.ndarray]
) -> None:
    """Write a name on the first side that lies inside the axes and is free of other points."""
    box, reach = ax.get_window_extent(), _pixels(ax, 0.7 * len(text) + 1.0)
    sides = [(1, 1), (-1, 1), (1, -1), (-1, -1)]

    def crowded(side: tuple[int, int]) -> float:
        x, y = at + 0.5 * reach * np.array(side)
        inside = [
            box.x0 <= at[0] + reach * side[0] <= box.x1,
            box.y0 <= at[1] + reach * side[1] <= box.y1,
        ]
        near = [other for other in others if np.hypot(other[0] - x, other[1] - y) < 0.7 * reach]
        return 2.0 * inside.count(False) + len(near)

    right, above = min(sides, key=crowded)
    ax.annotate(
        text,
        point,
        xytext=(6 * right, 6 * above),
        textcoords="offset points",
        ha="left" if right > 0 else "right",
        va="bottom" if above > 0 else "top",
        fontsize="small",
        zorder=6,
        annotation_clip=False,
        path_effects=style.halo(plt.rcParams["axes.facecolor"], 2.5),
    )
