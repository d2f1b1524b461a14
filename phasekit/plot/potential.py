"""Phase portrait and well of any potential, on a line or a circle."""

from __future__ import annotations

from typing import Any

import numpy as np
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.colors import to_hex
from matplotlib.lines import Line2D
from matplotlib.patches import Patch
from numpy.typing import NDArray

from phasekit.errors import EquilibriumKind, Loop
from phasekit.labelled.arguments import bad
from phasekit.plot import strokes, style
from phasekit.plot.terrain import Arc, Level, Terrain

FloatArray = NDArray[np.float64]

_LOOKS = {
    Loop.LOBES: style.EIGHT,
    Loop.WINDING: style.WINDING,
    Loop.HETEROCLINIC: {**style.CYCLE, "label": "heteroclinic separatrix"},
    Loop.LOBE: {**style.EIGHT, "label": "homoclinic loop"},
    Loop.UNBOUNDED: {**style.WINDING, "label": "unbounded separatrix"},
}


def scale_of(land: Terrain, angles: style.Angles) -> float:
    """Return the factor by which the coordinate is shown; degrees only where it is an angle."""
    factor = style.angle_factor(angles)
    if factor != 1.0 and not is_angle(land):
        raise bad("angles", angles, "'rad' for a coordinate that is not an angle of period 2 pi")
    return factor


def is_angle(land: Terrain) -> bool:
    """Whether the coordinate is an angle in radians."""
    period = land.system.period
    return period is not None and bool(np.isclose(period, 2.0 * np.pi, rtol=1e-12, atol=0.0))


def draw_portrait(
    axes: Axes,
    land: Terrain,
    chosen: list[Level],
    starts: list[tuple[float, float]],
    color_by: tuple[str, str] | None,
    factor: float,
) -> list[Artist]:
    """Draw levels, separatrices, orbits and equilibria; return handles for a legend."""
    curves = [(level[0], arc) for level in chosen for arc in land.arcs_of(level)]
    for (energy, arc), color in zip(curves, _colors(axes, land, curves, color_by), strict=True):
        look = style.ROTATION if land.turns_round(arc) else style.LEVEL
        if color is not None:
            look = {**look, "color": color, "linewidth": look["linewidth"] + 0.7}
        _draw(axes, land, energy, arc, factor, zorder=1, **look)
    handles: dict[str, Artist] = {}
    for saddle, loop in enumerate(land.separatrices.loop):
        look = _LOOKS[Loop(int(loop))]
        x = float(land.separatrices.saddle_phi[saddle])
        energy = float(land.separatrices.saddle_energy[saddle])
        for arc in _leaving(land, energy, x):
            if loop == Loop.LOBES and all(land.closes(arc)):
                px, py = strokes.closed(*land.curve(arc, energy))
                axes.fill(px * factor, py * factor, zorder=0.5, **style.EIGHT_FILL)
            _draw(axes, land, energy, arc, factor, zorder=3, **look)
        key = Patch(**style.EIGHT_KEY) if loop == Loop.LOBES else Line2D([], [], **look)
        handles.setdefault(str(look["label"]), key)
    points = _points(axes, land, factor, on_potential=False)
    for number, (x, speed) in enumerate(starts):
        look = strokes.orbit_look(number)
        home = _home(land, x)
        energy = land.energy(home, speed)
        own = land.arc_at(energy, home)
        if own is not None:
            sides = (1.0 if speed >= 0.0 else -1.0,) if land.turns_round(own) else (1.0, -1.0)
            _draw(axes, land, energy, own, factor, sides, zorder=4, **look)
        mark: style.Look = {"marker": ">", "markersize": 6.5, "markeredgecolor": style.BLACK}
        axes.plot([home * factor], [speed * factor], zorder=6, color=look["color"], **mark)
        label = f"from ({home * factor:.4g}, {speed * factor:.4g})".replace("-", "\N{MINUS SIGN}")
        points.append(Line2D([], [], label=label, **mark, **look))
    highest = max([land.energy(_home(land, x), v) for x, v in starts], default=land.floor)
    given = 1.08 * np.sqrt(2.0 * max(highest - land.floor, 0.0))
    levels = 1.05 * np.sqrt(2.0 * max(max((e for e, _ in chosen), default=0.0) - land.floor, 0.0))
    reach = factor * max(1.2 * land.top_speed, given, levels)
    axes.set_ylim(-reach, reach)
    coordinate_axis(axes, land, factor)
    name = rf"\dot{{{symbol(land)}}}"
    axes.set_ylabel(f"${name}$" + (f" ({_unit(factor)}/s)" if is_angle(land) else ""))
    return [*handles.values(), *points]


def draw_well(
    ax: Axes, land: Terrain, chosen: list[Level], starts: list[tuple[float, float]], factor: float
) -> None:
    """Draw the potential with chords at levels, saddles and orbits."""
    low, high = land.window
    x = np.linspace(low, high, 1201)
    height = land.potential(x)

    def chord(energy: float, arcs: list[Arc], zorder: float, **look: Any) -> None:
        for arc in arcs:
            ax.plot(np.array(arc) * factor, [energy, energy], zorder=zorder, **look)

    for level in chosen:
        chord(level[0], land.arcs_of(level), 1, **style.LEVEL)
    for saddle, loop in enumerate(land.separatrices.loop):
        energy = float(land.separatrices.saddle_energy[saddle])
        place = float(land.separatrices.saddle_phi[saddle])
        chord(energy, _leaving(land, energy, place), 2, **_LOOKS[Loop(int(loop))])
    for number, (start, speed) in enumerate(starts):
        home = _home(land, start)
        energy = land.energy(home, speed)
        arc = land.arc_at(energy, home)
        chord(energy, [] if arc is None else [arc], 4, **strokes.orbit_look(number))
    ax.plot(x * factor, height, color=style.BLACK, linewidth=1.8, zorder=3)
    _points(ax, land, factor, on_potential=True)
    # Where V falls without bound, or is steep at the window's ends, show what has a structure.
    marks = np.concatenate([land.equilibria.energy, [land.summit]])
    bottom = float(np.min(marks)) if land.equilibria.energy.size else float(height.min())
    span = max(land.summit - bottom, 0.0) or float(np.ptp(height)) or 1.0
    top = min(float(height.max()), land.summit + 0.8 * span)
    ax.set_ylim(bottom - 0.2 * span, max(top, land.summit) + 0.15 * span)
    coordinate_axis(ax, land, factor)
    ax.set_ylabel("$V$ (s$^{-2}$)" if is_angle(land) else "$V$")


def coordinate_axis(ax: Axes, land: Terrain, factor: float) -> None:
    """Show the window on the x axis, under the coordinate's name."""
    if is_angle(land):
        style.circle_axis(ax, "x", "rad" if factor == 1.0 else "deg")
    else:
        ax.set_xlim(*land.window)
    ax.set_xlabel(f"${symbol(land)}$" + (f" ({_unit(factor)})" if is_angle(land) else ""))


def symbol(land: Terrain) -> str:
    """Return the coordinate for print."""
    import sympy as sp

    return str(sp.latex(sp.Symbol(land.system.coordinate)))


def _unit(factor: float) -> str:
    return style.angle_unit("rad" if factor == 1.0 else "deg")


def _home(land: Terrain, x: float) -> float:
    period = land.system.period
    return x if period is None else 0.5 * period - (0.5 * period - x) % period


def _draw(
    ax: Axes,
    land: Terrain,
    energy: float,
    arc: Arc,
    factor: float,
    sides: tuple[float, ...] = (1.0, -1.0),
    **look: Any,
) -> None:
    x, speed = land.curve(arc, energy)
    for side in sides:
        ax.plot(x * factor, side * speed * factor, **look)


def _leaving(land: Terrain, energy: float, x: float) -> list[Arc]:
    """Return the arcs of a saddle's level that end at it, and on a circle at its other side."""
    arcs = land.arcs(energy)
    slack = 1e-6 * (land.window[1] - land.window[0])
    found = [arc for arc in arcs if min(abs(arc[0] - x), abs(arc[1] - x)) <= slack]
    if land.system.period is not None:
        # Round the seam, unless another saddle or a slope stands there.
        low, high = land.window
        edges = [arc for arc in arcs if arc[0] == low or arc[1] == high]
        touched = any(arc[0] == low or arc[1] == high for arc in found)
        if touched or min(abs(x - low), abs(x - high)) <= slack:
            found += [arc for arc in edges if arc not in found]
    return found


def _colors(
    ax: Axes, land: Terrain, curves: list[tuple[float, Arc]], color_by: tuple[str, str] | None
) -> list[str | None]:
    if color_by is None:
        return [None] * len(curves)
    quantity, text = color_by
    values = np.array([land.orbit(energy, arc, quantity) for energy, arc in curves])
    values = np.where(np.isfinite(values), values, np.nan)
    limits = style.log_limits(values)
    if limits is None:
        return [None] * len(curves)
    mappable = style.log_bar(ax, limits, text)
    shown = mappable.to_rgba(np.minimum(values, limits[1]))
    return [None if np.isnan(v) else to_hex(c) for v, c in zip(values, shown, strict=True)]


def _points(ax: Axes, land: Terrain, factor: float, *, on_potential: bool) -> list[Artist]:
    handles: list[Artist] = []
    low, high = land.window
    for kind, look in style.POINTS.items():
        there = land.equilibria.kind == EquilibriumKind(kind)
        x, level = land.equilibria.phi[there], land.equilibria.energy[there]
        if not x.size:
            continue
        if land.system.period is not None:  # a point at the seam is one point on both edges
            seam = np.abs(np.abs(x) - high) < 1e-3 * (high - low)
            x = np.concatenate([x, -x[seam]])
            level = np.concatenate([level, level[seam]])
        height = level if on_potential else np.zeros(x.shape)
        handles += ax.plot(x * factor, height, linestyle="none", zorder=5, clip_on=False, **look)
    return handles
