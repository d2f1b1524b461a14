"""Branches of a continuation: equilibria against a parameter, or curves in two parameters."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.lines import Line2D

from phasekit.errors import EquilibriumKind
from phasekit.labelled.arguments import bad, flag, unknown
from phasekit.plot import style

_STABLE: style.Look = {
    "color": style.BLUE,
    "linestyle": "-",
    "linewidth": 1.8,
    "label": "stable",
}
_UNSTABLE: style.Look = {
    "color": style.VERMILLION,
    "linestyle": (0, (5, 2)),
    "linewidth": 1.8,
    "label": "unstable",
}
_CURVES: dict[str, style.Look] = {
    "fold": {"color": style.BLACK, "linestyle": "-", "linewidth": 2.0, "label": "fold"},
    "hopf": {"color": style.GREEN, "linestyle": "-", "linewidth": 2.0, "label": "Hopf"},
    "neutral_saddle": {
        "color": style.GRAY,
        "linestyle": (0, (1.5, 1.5)),
        "linewidth": 1.4,
        "label": "neutral saddle",
    },
    "branch_point": {
        "color": style.PURPLE,
        "linestyle": (0, (7, 2, 1.5, 2)),
        "linewidth": 2.0,
        "label": "branch points",
    },
}
_MARKS = {
    "LP": ("s", style.YELLOW),
    "BP": ("^", style.PURPLE),
    "H": ("o", style.GREEN),
    "NS": ("D", "white"),
    "CP": ("v", style.ORANGE),
    "BT": ("P", style.SKY),
    "GH": ("h", style.SKY),
    "ZH": ("X", style.SKY),
}


def branch(
    branches: Any,
    x: str | None = None,
    y: str | None = None,
    *,
    labels: bool = True,
    legend: bool = True,
    ax: Axes | None = None,
) -> Axes:
    """Draw one branch or several, with their special points labelled.

    Stable equilibria (centers of a conservative problem) are solid, unstable ones (saddles)
    dashed. Curves in two parameters are drawn in the plane of both.

    Parameters
    ----------
    branches : Branch or sequence of Branch
        What `continuation`, `diagram`, `.switch` or `.curve` return.
    x, y : str, optional
        Variables of ``branch.points``; default: the parameter and the first state, or the two
        parameters.
    labels : bool
        Whether to write LP, BP, H, ... beside special points.
    legend : bool
        Whether to explain the lines under the axes.
    ax : matplotlib.axes.Axes, optional
        Where to draw; a new figure if left out.

    Returns
    -------
    matplotlib.axes.Axes

    Raises
    ------
    ParameterError
        If an argument is unusable.
    """
    flag("labels", labels)
    flag("legend", legend)
    several = _several(branches)
    first = several[0]
    x = x or first.free[0]
    y = y or (first.free[1] if len(first.free) > 1 else first.problem_state[0])
    for argument, name in (("x", x), ("y", y)):
        offered = [str(n) for n, v in first.points.data_vars.items() if v.dims == ("point",)]
        if name not in offered:
            raise unknown(argument, name, offered)
    axes = style.axes_for(ax, legend=legend)
    handles: dict[str, Artist] = {}
    for one in several:
        for look, across, up in _pieces(one, x, y):
            (line,) = axes.plot(across, up, **look)
            handles.setdefault(str(look["label"]), line)
    marks: dict[str, list[tuple[float, float]]] = {}
    for one in several:
        for special in one.special_points:
            if special.kind == "end" or x not in one.points or y not in one.points:
                continue
            place = (float(one.points[x][special.index]), float(one.points[y][special.index]))
            marks.setdefault(special.label, []).append(place)
    for label, places in marks.items():
        marker, color = _MARKS[label]
        across, up = np.array(places).T
        axes.plot(
            across, up, linestyle="none", marker=marker, markersize=7, markerfacecolor=color,
            markeredgecolor=style.BLACK, zorder=4,
        )  # fmt: skip
        for spot in _apart(places) if labels else []:
            axes.annotate(
                label, spot, xytext=(6, 6), textcoords="offset points", fontsize="small", zorder=5
            )
        handles[label] = Line2D(
            [], [], linestyle="none", marker=marker, markersize=7, markerfacecolor=color,
            markeredgecolor=style.BLACK, label=label,
        )  # fmt: skip
    axes.set_xlabel(_label(first, x))
    axes.set_ylabel(_label(first, y))
    if legend:
        style.legend_below(axes, list(handles.values()))
    return axes


def _several(branches: Any) -> list[Any]:
    several = list(branches) if isinstance(branches, Sequence) else [branches]
    if hasattr(branches, "branches"):
        several = list(branches.branches)
    for one in several:
        if not hasattr(one, "special_points") or not hasattr(one, "points"):
            raise bad("branches", one, "a Branch, or several")
    if not several:
        raise bad("branches", branches, "at least one Branch")
    return several


def _pieces(one: Any, x: str, y: str) -> list[tuple[style.Look, Any, Any]]:
    """Runs of points of one look; each begins where the one before ends, and angles may wrap."""
    points = one.points
    across, up = points[x].values.astype(float), points[y].values.astype(float)
    looks = _looks(one)
    pieces = []
    begin = 0
    for i in range(1, len(across) + 1):
        if i < len(across) and looks[i] is looks[begin]:
            continue
        stop = min(i + 1, len(across))
        pieces.append((looks[begin], *_broken(one, x, y, across[begin:stop], up[begin:stop])))
        begin = i
    return pieces


def _looks(one: Any) -> list[style.Look]:
    points = one.points
    if one.kind == "hopf":
        pair = [str(name) or "hopf" for name in points.kind_of_pair.values]
        return [_CURVES[name] for name in pair]
    if one.kind != "equilibrium":
        return [_CURVES[one.kind]] * points.sizes["point"]
    if "kind" in points:
        kinds = points.kind.values.copy()
        # A degenerate point has the look of what comes after it.
        for i in range(len(kinds) - 2, -1, -1):
            if kinds[i] == EquilibriumKind.DEGENERATE:
                kinds[i] = kinds[i + 1]
        if len(kinds) > 1 and kinds[-1] == EquilibriumKind.DEGENERATE:
            kinds[-1] = kinds[-2]
        return [
            style.BRANCHES.get(EquilibriumKind(int(k)), style.BRANCHES[EquilibriumKind.SADDLE])
            for k in kinds
        ]
    return [_STABLE if k == 0 else _UNSTABLE for k in points.n_unstable.values]


def _broken(one: Any, x: str, y: str, across: Any, up: Any) -> tuple[Any, Any]:
    """Lines with a gap where an angle jumps by about its period."""
    periods = dict(one.problem.periods) if one.problem is not None else {}
    jump = np.zeros(max(len(across) - 1, 0), dtype=bool)
    for name, values in ((x, across), (y, up)):
        if name in periods:
            jump |= np.abs(np.diff(values)) > 0.5 * periods[name]
    places = np.flatnonzero(jump) + 1
    return np.insert(across, places, np.nan), np.insert(up, places, np.nan)


def _apart(places: list[tuple[float, float]]) -> list[tuple[float, float]]:
    """One of those that coincide."""
    kept: list[tuple[float, float]] = []
    for place in places:
        if all(np.hypot(place[0] - q[0], place[1] - q[1]) > 1e-9 * (1 + abs(q[0])) for q in kept):
            kept.append(place)
    return kept


def _label(one: Any, name: str) -> str:
    attrs = one.points[name].attrs
    text = attrs.get("long_name", name)
    units = attrs.get("units", "")
    text = f"{name}, {text}" if text != name else name
    return f"{text} ({units})" if units not in ("", "1") else text
