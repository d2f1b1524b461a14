"""Strokes of which portraits and wells are made: levels, separatrices, orbits, points.

On a circle curves are drawn in unwrapped angle and repeated a turn to either side, so that nothing
is cut at the seam of the cylinder; the axes clip what lies outside.
"""

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

FloatArray = NDArray[np.float64]
State = tuple[float, float]

TURN = 2.0 * np.pi
START: style.Look = {"marker": ">", "markersize": 6.5, "markeredgecolor": style.BLACK}
# A marker this near to an edge (in turns) is cut by it, and so stands on the other one too.
SEAM = 0.02 / TURN
LOOPS: Mapping[Loop, style.Look] = {
    Loop.LOBES: style.EIGHT,
    Loop.WINDING: style.WINDING,
    Loop.HETEROCLINIC: style.CYCLE,
    Loop.LOBE: {**style.EIGHT, "label": "homoclinic loop"},
    Loop.UNBOUNDED: {**style.WINDING, "label": "unbounded separatrix"},
}


def turns_in_sight(x: FloatArray, period: float | None = TURN) -> list[float]:
    """Return the shifts with which a curve is seen on the circle; none but 0 on a line."""
    if period is None:
        return [0.0]
    first = int(np.ceil((-0.5 * period - np.nanmax(x)) / period))
    last = int(np.floor((0.5 * period - np.nanmin(x)) / period))
    return [turn * period for turn in range(first, last + 1)]


def round_the_cylinder(
    x: FloatArray, other: FloatArray, period: float | None = TURN
) -> tuple[FloatArray, FloatArray]:
    """Join the copies of a curve that are in sight into one broken line."""
    if not x.size:
        return x, other
    gap = np.array([np.nan])
    turns = turns_in_sight(x, period)
    across = np.concatenate([part for turn in turns for part in (x + turn, gap)])
    up = np.concatenate([part for _ in turns for part in (other, gap)])
    return across[:-1], up[:-1]


def closed(x: FloatArray, speed: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return the closed curve whose upper half is given."""
    return np.concatenate([x, x[::-1]]), np.concatenate([speed, -speed[::-1]])


def home(land: LevelCurves, x: float) -> float:
    """Return a place on the circle, or on the line."""
    period = land.answers.period
    return x if period is None else 0.5 * period - (0.5 * period - x) % period


def draw_level(
    ax: Axes, land: LevelCurves, energy: float, arc: Arc, factor: float, **look: Any
) -> None:
    """Draw both halves of a level curve over an arc, as one line where they join."""
    x, speed = land.curve(arc, energy)
    if all(land.closes(arc)):
        x, speed = round_the_cylinder(*closed(x, speed), land.answers.period)
        ax.plot(x * factor, speed * factor, **look)
        return
    for sign in (1.0, -1.0):
        ax.plot(x * factor, sign * speed * factor, **look)


def level_look(land: LevelCurves, arc: Arc, color: str | None = None) -> style.Look:
    """Return how a level looks: solid where it closes, dotted where it runs round."""
    look = style.ROTATION if land.turns(arc) else style.LEVEL
    if color is None:
        return look
    width = look["linewidth"] + 0.7
    return {**look, "color": color, "linewidth": width, "solid_capstyle": "round"}


def draw_separatrices(ax: Axes, land: LevelCurves, factor: float) -> list[Artist]:
    """Draw what leaves and reaches the saddles, fill an eight; return handles for the legend."""
    handles: dict[str, Artist] = {}
    for energy, arc, loop in land.separatrices:
        look = style.inked(LOOPS[loop])
        # The dashes of a winding separatrix show on an eight that all but touches it.
        draw_level(
            ax, land, energy, arc, factor, zorder=3.5 if "winding" in look["label"] else 3.0, **look
        )
        key: Artist = Line2D([], [], **look)
        if loop == Loop.LOBES:
            key = Patch(**style.EIGHT_KEY)
            x, y = closed(*land.curve(arc, energy))
            for turn in turns_in_sight(x, land.answers.period):
                ax.fill((x + turn) * factor, y * factor, zorder=0.5, **style.EIGHT_FILL)
        handles.setdefault(look["label"], key)
    for energy, arc, _ in land.steps:
        draw_level(ax, land, energy, arc, factor, zorder=3.0, **style.DEGENERATE)
        handles["step"] = Line2D([], [], **style.DEGENERATE)
    return list(handles.values())


def draw_orbit(ax: Axes, land: LevelCurves, start: State, number: int, factor: float) -> Artist:
    """Draw the orbit through a start (x, x'), mark the start, return a handle."""
    look = orbit_look(number)
    where, energy = home(land, start[0]), land.energy(*start)
    for arc in orbit_arcs(land, start):
        if land.comes_back(*start):
            draw_level(ax, land, energy, arc, factor, zorder=4, **look)
        else:
            x, speed = land.curve(arc, energy)
            sign = 1.0 if start[1] >= 0.0 else -1.0
            x, speed = round_the_cylinder(x, sign * speed, land.answers.period)
            ax.plot(x * factor, speed * factor, zorder=4, **look)
    ax.plot([where * factor], [start[1] * factor], zorder=6, color=look["color"], **START)
    return Line2D([], [], label=start_name(land, start, factor), **START, **look)


def orbit_arcs(land: LevelCurves, start: State) -> list[Arc]:
    """Return the arc of the orbit through a start; none where it is at rest or out of sight."""
    if land.at_rest(*start):
        return []
    return land.arcs_of((land.energy(*start), home(land, start[0])))


def start_name(land: LevelCurves, start: State, factor: float) -> str:
    """Return a start (x, x') for print, its angle on the circle."""
    text = f"from ({home(land, start[0]) * factor:.4g}, {start[1] * factor:.4g})"
    return text.replace("-", "\N{MINUS SIGN}")


def draw_points(ax: Axes, land: LevelCurves, factor: float, *, on_potential: bool) -> list[Artist]:
    """Mark the equilibria; a point at the seam stands on both edges, for it is one point."""
    handles: list[Artist] = []
    known, period = land.answers, land.answers.period
    for kind, look in style.POINTS.items():
        x, level = known.phi[known.kind == kind], known.energy[known.kind == kind]
        if not x.size:
            continue
        if period is not None:
            seam = np.abs(x) > (0.5 - SEAM) * period
            x = np.concatenate([x, x[seam] - np.sign(x[seam]) * period])
            level = np.concatenate([level, level[seam]])
        height = level if on_potential else np.zeros(x.shape)
        handles += ax.plot(x * factor, height, linestyle="none", zorder=5, clip_on=False, **look)
    if not known.phi.size and period is not None and not on_potential:
        ends = np.array(land.window) * factor
        handles += ax.plot(ends, [0.0, 0.0], zorder=5, **style.REST)
    return handles


def orbit_look(number: int) -> style.Look:
    """Return color and dashes of the `number`-th orbit."""
    return {
        "color": style.ORBIT_COLORS[number % len(style.ORBIT_COLORS)],
        "linestyle": style.ORBIT_DASHES[number % len(style.ORBIT_DASHES)],
        "linewidth": 1.8,
    }
