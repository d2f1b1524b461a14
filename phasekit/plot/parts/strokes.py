"""Strokes of which portraits and wells are made: levels, separatrices, orbits, points."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.lines import Line2D
from matplotlib.patches import Patch
from numpy.typing import NDArray

from phasekit.errors import Loop
from phasekit.phase.level_curves import Arc, LevelCurves
from phasekit.plot.parts import style
from phasekit.plot.parts.circle import Circle

FloatArray = NDArray[np.float64]
State = tuple[float, float]
#: What the coordinate and its rate are multiplied by to be shown.
Scale = tuple[float, float]

START: style.Look = {"marker": ">", "markersize": 6.5, "markeredgecolor": style.BLACK}
LOOPS: Mapping[Loop, style.Look] = {
    Loop.LOBES: style.EIGHT,
    Loop.WINDING: style.WINDING,
    Loop.HETEROCLINIC: style.CYCLE,
    Loop.LOBE: {**style.EIGHT, "label": "homoclinic loop"},
    Loop.UNBOUNDED: {**style.WINDING, "label": "unbounded separatrix"},
}


def circle_of(land: LevelCurves) -> Circle:
    """Return the circle on which a system's coordinate is shown; or its line."""
    return Circle(land.window[0], land.answers.period)


def closed(x: FloatArray, speed: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return the closed curve whose upper half is given."""
    return np.concatenate([x, x[::-1]]), np.concatenate([speed, -speed[::-1]])


def draw_level(
    ax: Axes, land: LevelCurves, energy: float, arc: Arc, scale: Scale, **look: Any
) -> None:
    """Draw both halves of a level curve over an arc, as one line where they join."""
    x, speed = land.curve(arc, energy)
    if all(land.closes(arc)):
        x, speed = circle_of(land).unrolled(*closed(x, speed))
        ax.plot(x * scale[0], speed * scale[1], **look)
        return
    for sign in (1.0, -1.0):
        ax.plot(x * scale[0], sign * speed * scale[1], **look)


def level_look(land: LevelCurves, arc: Arc, color: str | None = None) -> style.Look:
    """Return how a level looks: solid where it closes, dotted where it runs round."""
    look = style.ROTATION if land.turns(arc) else style.LEVEL
    if color is None:
        return look
    width = look["linewidth"] + 0.7
    return {**look, "color": color, "linewidth": width, "solid_capstyle": "round"}


def draw_separatrices(ax: Axes, land: LevelCurves, scale: Scale) -> list[Artist]:
    """Draw what leaves and reaches the saddles, fill an eight; return handles for the legend."""
    handles: dict[str, Artist] = {}
    for energy, arc, loop in land.separatrices:
        look = style.inked(LOOPS[loop])
        # The dashes of a winding separatrix show on an eight that all but touches it.
        draw_level(
            ax, land, energy, arc, scale, zorder=3.5 if "winding" in look["label"] else 3.0, **look
        )
        key: Artist = Line2D([], [], **look)
        if loop == Loop.LOBES:
            key = Patch(**style.EIGHT_KEY)
            x, y = closed(*land.curve(arc, energy))
            for turn in circle_of(land).turns(x):
                ax.fill((x + turn) * scale[0], y * scale[1], zorder=0.5, **style.EIGHT_FILL)
        handles.setdefault(look["label"], key)
    for energy, arc, _ in land.steps:
        draw_level(ax, land, energy, arc, scale, zorder=3.0, **style.DEGENERATE)
        handles["step"] = Line2D([], [], **style.DEGENERATE)
    return list(handles.values())


def draw_orbit(ax: Axes, land: LevelCurves, start: State, number: int, scale: Scale) -> Artist:
    """Draw the orbit through a start (x, x'), mark the start, return a handle."""
    look = orbit_look(number)
    where = circle_of(land).home(start[0])
    for energy, arc in orbit_levels(land, start):
        if land.comes_back(*start):
            draw_level(ax, land, energy, arc, scale, zorder=4, **look)
        else:
            x, speed = land.curve(arc, energy)
            sign = 1.0 if start[1] >= 0.0 else -1.0
            x, speed = circle_of(land).unrolled(x, sign * speed)
            ax.plot(x * scale[0], speed * scale[1], zorder=4, **look)
    ax.plot([where * scale[0]], [start[1] * scale[1]], zorder=6, color=look["color"], **START)
    return Line2D([], [], label=start_name(land, start, scale), **START, **look)


def orbit_levels(land: LevelCurves, start: State) -> list[tuple[float, Arc]]:
    """Return energy and arc of the orbit through a start, and of its turns where they differ.

    None where it is at rest or out of sight.
    """
    if land.at_rest(*start):
        return []
    energy = land.energy(*start)
    arcs = land.arcs_of((energy, circle_of(land).home(start[0])))
    return [level for arc in arcs for level in land.followed(energy, arc)]


def start_name(land: LevelCurves, start: State, scale: Scale) -> str:
    """Return a start (x, x') for print, its angle on the circle."""
    where, speed = circle_of(land).home(start[0]) * scale[0], start[1] * scale[1]
    text = f"from ({where:.4g}, {speed:.4g})"
    return text.replace("-", "\N{MINUS SIGN}")


def draw_points(
    ax: Axes, land: LevelCurves, scale: Scale, *, on_potential: bool = False
) -> list[Artist]:
    """Mark the equilibria, on the axis or on the potential, which `scale` then ends with."""
    handles: list[Artist] = []
    known, period = land.answers, land.answers.period
    for kind, look in style.POINTS.items():
        x, level = known.phi[known.kind == kind], known.energy[known.kind == kind]
        if not x.size:
            continue
        x, level = circle_of(land).points(x, level)
        height = level * scale[1] if on_potential else np.zeros(x.shape)
        handles += ax.plot(x * scale[0], height, linestyle="none", zorder=5, clip_on=False, **look)
    if not known.phi.size and period is not None and not on_potential:
        ends = np.array(land.window) * scale[0]
        handles += ax.plot(ends, [0.0, 0.0], zorder=5, **style.REST)
    return handles


def orbit_look(number: int) -> style.Look:
    """Return color and dashes of the `number`-th orbit."""
    return {
        "color": style.ORBIT_COLORS[number % len(style.ORBIT_COLORS)],
        "linestyle": style.ORBIT_DASHES[number % len(style.ORBIT_DASHES)],
        "linewidth": 1.8,
    }
