"""Strokes of which portraits and wells are made: levels, separatrices, orbits, points."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.lines import Line2D
from matplotlib.patches import Patch
from numpy.typing import ArrayLike, NDArray

from phasekit.errors import Loop
from phasekit.labels.arguments import bad, reals
from phasekit.phase.level_curves import Arc, LevelCurves
from phasekit.plot.parts import style
from phasekit.plot.parts.circle import Circle

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


@dataclass(frozen=True)
class Strokes:
    """The level curves of one system, drawn in Axes."""

    ax: Axes
    land: LevelCurves
    #: The circle on which the coordinate is shown; or its line.
    circle: Circle
    #: What the coordinate and its rate, or its potential, are multiplied by to be shown.
    scale: Scale

    def level(self, energy: float, arc: Arc, **look: Any) -> None:
        """Draw both halves of a level curve over an arc, as one line where they join."""
        closed = all(self.land.closes(arc))
        x, speed = self.land.curve(arc, energy, whole=closed)
        if closed:
            x, speed = self.circle.unrolled(x, speed)
        for sign in (1.0,) if closed else (1.0, -1.0):
            self.ax.plot(x * self.scale[0], sign * speed * self.scale[1], **look)

    def separatrices(self) -> list[Artist]:
        """Draw what leaves and reaches the saddles, fill an eight; return handles for a legend."""
        handles: dict[str, Artist] = {}
        stretch, rise = self.scale
        for energy, arc, loop in self.land.separatrices:
            look = style.inked(LOOPS[loop])
            # The dashes of a winding separatrix show on an eight that all but touches it.
            self.level(energy, arc, zorder=3.5 if "winding" in look["label"] else 3.0, **look)
            key: Artist = Line2D([], [], **look)
            if loop == Loop.LOBES:
                key = Patch(**style.EIGHT_KEY)
                x, y = self.land.curve(arc, energy, whole=True)
                for turn in self.circle.turns(x):
                    self.ax.fill((x + turn) * stretch, y * rise, zorder=0.5, **style.EIGHT_FILL)
            handles.setdefault(look["label"], key)
        for energy, arc, _ in self.land.steps:
            self.level(energy, arc, zorder=3.0, **style.DEGENERATE)
            handles["step"] = Line2D([], [], **style.DEGENERATE)
        return list(handles.values())

    def orbit(self, start: State, number: int) -> Artist:
        """Draw the orbit through a start (x, x'), mark the start, return a handle."""
        look, (stretch, rise) = orbit_look(number), self.scale
        for energy, arc in self.land.orbit_levels(*start):
            if self.land.comes_back(*start):
                self.level(energy, arc, zorder=4, **look)
            else:
                x, speed = self.land.curve(arc, energy)
                x, speed = self.circle.unrolled(x, speed if start[1] >= 0.0 else -speed)
                self.ax.plot(x * stretch, speed * rise, zorder=4, **look)
        where = self.circle.home(start[0]) * stretch
        self.ax.plot([where], [start[1] * rise], zorder=6, color=look["color"], **START)
        return Line2D([], [], label=start_name(self.circle, start, self.scale), **START, **look)

    def points(self, *, on_potential: bool = False) -> list[Artist]:
        """Mark the equilibria, on the axis or on the potential; return handles for a legend."""
        handles: list[Artist] = []
        known, (stretch, rise) = self.land.answers, self.scale
        for kind, look in style.POINTS.items():
            x, level = known.phi[known.kind == kind], known.energy[known.kind == kind]
            if not x.size:
                continue
            x, level = self.circle.points(x, level)
            height = level * rise if on_potential else np.zeros(x.shape)
            handles += self.ax.plot(
                x * stretch, height, linestyle="none", zorder=5, clip_on=False, **look
            )
        if not known.phi.size and known.period is not None and not on_potential:
            ends = np.array(self.land.window) * stretch
            handles += self.ax.plot(ends, [0.0, 0.0], zorder=5, **style.REST)
        return handles


def level_look(land: LevelCurves, arc: Arc, color: str | None = None) -> style.Look:
    """Return how a level looks: solid where it closes, dotted where it runs round."""
    look = style.ROTATION if land.turns(arc) else style.LEVEL
    if color is None:
        return look
    width = look["linewidth"] + 0.7
    return {**look, "color": color, "linewidth": width, "solid_capstyle": "round"}


def start_name(circle: Circle, start: State, scale: Scale) -> str:
    """Return a start (x, x') for print, its angle on the circle."""
    text = f"from ({circle.home(start[0]) * scale[0]:.4g}, {start[1] * scale[1]:.4g})"
    return text.replace("-", "\N{MINUS SIGN}")


def orbit_look(number: int) -> style.Look:
    """Return color and dashes of the `number`-th orbit."""
    return {
        "color": style.ORBIT_COLORS[number % len(style.ORBIT_COLORS)],
        "linestyle": style.ORBIT_DASHES[number % len(style.ORBIT_DASHES)],
        "linewidth": 1.8,
    }


def starts_of_pairs(orbits: ArrayLike) -> list[State]:
    """Return pairs of numbers as pairs of floats."""
    pairs = finite(orbits, "orbits", "rad and rad/s")
    if not pairs.size:
        return []
    if pairs.ndim == 1:
        pairs = pairs[np.newaxis]
    if pairs.ndim != 2 or pairs.shape[1] != 2:
        raise bad("orbits", orbits, "pairs (phi0, dphi0), of shape (2,) or (n, 2)")
    return [(float(phi), float(speed)) for phi, speed in pairs]


def finite(values: ArrayLike, argument: str, unit: str) -> NDArray[np.float64]:
    """Return finite numbers as an array."""
    wants = f"finite numbers in {unit}"
    array = reals(argument, getattr(values, "values", values), wants)
    if not np.isfinite(array).all():
        raise bad(argument, values, wants)
    return array
