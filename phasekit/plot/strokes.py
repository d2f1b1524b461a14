"""Strokes of which portraits and wells are made: levels, separatrices, orbits, points.

Curves are drawn in unwrapped angle and repeated a turn to either side, so that nothing is cut at
the seam of the cylinder; the axes clip what lies outside.
"""

from __future__ import annotations

import numpy as np
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.lines import Line2D
from matplotlib.patches import Patch
from numpy.typing import NDArray

from phasekit.errors import EquilibriumKind, Loop
from phasekit.plot import style
from phasekit.plot.landscape import Arc, Landscape, Level, is_turn

FloatArray = NDArray[np.float64]

TURN = 2.0 * np.pi
START: style.Look = {"marker": ">", "markersize": 6.5, "markeredgecolor": style.BLACK}
# A marker this near to an edge (rad) is cut by it, and so stands on the other one too.
SEAM = 0.02


def turns_in_sight(phi: FloatArray) -> list[float]:
    """Return the turns by which a curve is moved so that all of it is seen in [-pi, pi]."""
    first = int(np.ceil((-np.pi - np.nanmax(phi)) / TURN))
    last = int(np.floor((np.pi - np.nanmin(phi)) / TURN))
    return [turn * TURN for turn in range(first, last + 1)]


def round_the_cylinder(phi: FloatArray, other: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Join the copies of a curve that are in sight into one broken line."""
    if not phi.size:
        return phi, other
    gap = np.array([np.nan])
    turns = turns_in_sight(phi)
    x = np.concatenate([part for turn in turns for part in (phi + turn, gap)])
    y = np.concatenate([part for _ in turns for part in (other, gap)])
    return x[:-1], y[:-1]


def closed(phi: FloatArray, speed: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return the closed curve whose upper half is given."""
    return np.concatenate([phi, phi[::-1]]), np.concatenate([speed, -speed[::-1]])


def level_arcs(land: Landscape, level: Level) -> list[Arc]:
    """Return the arcs over which a level is drawn: one well's, or all."""
    energy, well = level
    if well is None:
        return land.basins(energy)
    arc = land.basin_of(energy, well)
    return [] if arc is None else [arc]


def draw_level(
    ax: Axes, land: Landscape, energy: float, arc: Arc, factor: float, color: str | None = None
) -> None:
    """Draw a level curve, solid where it closes, dotted where it runs round the cylinder."""
    look = style.ROTATION if is_turn(arc) else style.LEVEL
    if color is not None:
        width = look["linewidth"] + 0.7
        look = {**look, "color": color, "linewidth": width, "solid_capstyle": "round"}
    phi, speed = land.loop(arc, energy)
    if is_turn(arc):
        for sign in (1.0, -1.0):
            ax.plot(phi * factor, sign * speed * factor, zorder=1, **look)
    else:
        x, y = round_the_cylinder(*closed(phi, speed))
        ax.plot(x * factor, y * factor, zorder=1, **look)


def draw_separatrices(ax: Axes, land: Landscape, factor: float) -> list[Artist]:
    """Draw what leaves and reaches the saddles, fill an eight; return handles for the legend."""
    handles: list[Artist] = []

    def outline(phi: FloatArray, speed: FloatArray, look: style.Look) -> Line2D:
        x, y = round_the_cylinder(*closed(phi, speed))
        # The dashes of a winding separatrix show on an eight that all but touches it.
        zorder = 3.5 if look is style.WINDING else 3.0
        (line,) = ax.plot(x * factor, y * factor, zorder=zorder, **look)
        return line

    loops = land.separatrices.loop
    for saddle in (1, 0):
        if loops[saddle] == Loop.WINDING:
            handles.append(outline(*land.winding(saddle), style.WINDING))
        elif loops[saddle] == Loop.LOBES:
            for side in (0, 1):
                phi, speed = land.lobe(saddle, side)
                outline(phi, speed, style.EIGHT)
                x, y = closed(phi, speed)
                for turn in turns_in_sight(x):
                    ax.fill((x + turn) * factor, y * factor, zorder=0.5, **style.EIGHT_FILL)
            handles.append(Patch(**style.EIGHT_KEY))
    if loops[0] == Loop.HETEROCLINIC:
        # The arcs of the two saddles are the same curves.
        handles += [outline(*land.lobe(0, side), style.CYCLE) for side in (0, 1)][:1]
    if land.equilibria.kind[1] == EquilibriumKind.DEGENERATE:
        # A fold: motions on this level tend to the merged pair.
        energy = float(land.equilibria.energy[1])
        arc = land.basin_of(energy, float(land.equilibria.phi[1]))
        if arc is not None:
            handles.append(outline(*land.loop(arc, energy), style.DEGENERATE))
    return handles


def draw_orbit(
    ax: Axes, land: Landscape, start: tuple[float, float], number: int, factor: float
) -> Artist:
    """Draw the orbit through a start (phi, phi'), mark the start, return a handle."""
    phi0, speed0 = start
    look = orbit_look(number)
    energy = land.energy(phi0, speed0)
    arc = land.basin_of(energy, phi0)
    if arc is not None:
        phi, speed = land.loop(arc, energy)
        if is_turn(arc):
            x, y = phi, (speed if speed0 >= 0.0 else -speed)
        else:
            x, y = round_the_cylinder(*closed(phi, speed))
        ax.plot(x * factor, y * factor, zorder=4, **look)
    where = np.pi - (np.pi - phi0) % TURN
    ax.plot([where * factor], [speed0 * factor], zorder=6, color=look["color"], **START)
    return Line2D([], [], label=start_name(start, factor), **START, **look)


def start_name(start: tuple[float, float], factor: float) -> str:
    """Return a start (phi, phi') for print, its angle on the circle."""
    where = np.pi - (np.pi - start[0]) % TURN
    text = f"from ({where * factor:.4g}, {start[1] * factor:.4g})"
    return text.replace("-", "\N{MINUS SIGN}")


def draw_points(ax: Axes, land: Landscape, factor: float, *, on_potential: bool) -> list[Artist]:
    """Mark the equilibria; a point at the seam stands on both edges, for it is one point."""
    handles: list[Artist] = []
    kinds = np.asarray(land.equilibria.kind)
    for kind, look in style.POINTS.items():
        phi = np.asarray(land.equilibria.phi)[kinds == kind]
        level = np.asarray(land.equilibria.energy)[kinds == kind]
        if not phi.size:
            continue
        seam = np.abs(phi) > np.pi - SEAM
        phi = np.concatenate([phi, phi[seam] - np.sign(phi[seam]) * TURN])
        level = np.concatenate([level, level[seam]]) if on_potential else np.zeros(phi.shape)
        handles += ax.plot(phi * factor, level, linestyle="none", zorder=5, clip_on=False, **look)
    if not land.phi.size and not on_potential:
        ends = np.array([-np.pi, np.pi]) * factor
        handles += ax.plot(ends, [0.0, 0.0], zorder=5, **style.REST)
    return handles


def orbit_look(number: int) -> style.Look:
    """Return color and dashes of the `number`-th orbit."""
    return {
        "color": style.ORBIT_COLORS[number % len(style.ORBIT_COLORS)],
        "linestyle": style.ORBIT_DASHES[number % len(style.ORBIT_DASHES)],
        "linewidth": 1.8,
    }
