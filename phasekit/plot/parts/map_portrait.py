"""Phase portrait of a map, or of a forced flow seen once a period.

Fixed points by kind, the stable and unstable manifolds of saddles, and iterates of given states.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.lines import Line2D

from phasekit.arrays import Array
from phasekit.labelled.driven import stroboscopic
from phasekit.labelled.manifolds import Legs, tell_missing
from phasekit.labelled.motion import flow
from phasekit.labels.arguments import bad, flag, whole
from phasekit.plot.parts import strokes, style
from phasekit.plot.parts.flow_portrait import (
    View,
    draw_basins,
    draw_manifolds,
    draw_points,
    starts_of,
)
from phasekit.plot.parts.units import Units
from phasekit.systems.problem import Problem

#: Iterates that are drawn of each state.
ITERATES = 1000
#: Window in which manifolds are followed, in widths of that which is drawn: they come back. Their
#: length in widths of that.
WIDE, LENGTH = 3.0, 3.0
#: Width of their lines, of that in portraits of flows.
THIN = 0.6
#: The look of iterates.
DOT: style.Look = {"linestyle": "none", "marker": ".", "markersize": 2.5, "markeredgewidth": 0.0}


def map_portrait(
    problem: Problem, *, window: Any, plane: Any, orbits: Any, duration: Any, cycles: bool | None,
    shade: bool, angles: style.Angles, legend: bool, ax: Axes | None,
) -> Axes:  # fmt: skip
    """Draw a map, or a forced flow once a period, in a window; see `phase_portrait`."""
    Units.from_arguments(angles)
    flag("basins", shade)
    if cycles:
        wants = "None for a map or a forced flow; orbits= draws the points of a cycle"
        raise bad("cycles", cycles, wants)
    if shade and len(problem.state) != 2:
        raise bad("basins", True, "False, for more than two states")
    wants = "a number of iterations >= 1"
    count = ITERATES if duration is None else whole("duration", duration, wants)
    starts = starts_of(problem, orbits)
    axes = style.axes_for(ax, legend=legend)
    view = View.from_arguments(axes, problem, window, plane)
    if angles != "rad" and all(circle.period is None for circle in view.circles):
        raise bad("angles", angles, "'rad' where no state that is drawn is an angle all round")
    rests = Legs(problem, view.low, view.high, 1).rests()
    aside = np.where([name in problem.periods for name in problem.state], 0.0, 0.5 * (WIDE - 1.0))
    room = aside * (view.high - view.low)
    legs = Legs(problem, view.low - room, view.high + room, 1)
    found = legs.manifolds(rests, range(len(rests.x)), LENGTH)
    tell_missing("phase_portrait", problem, rests, found, LENGTH)
    handles = draw_basins(view) if shade else []
    senses = [begin.sense for begin in found.starts]
    handles += draw_manifolds(view, [one.x for one in found.strands], senses, thin=THIN)
    for k, start in enumerate(starts):
        handles.append(_iterates(view, start, k, count))
    handles += draw_points(view, rests)
    view.name_axes(angles)
    if legend:
        style.legend_below(axes, handles, style.MANIFOLDS)
    return axes


def _iterates(view: View, start: Array, k: int, count: int) -> Artist:
    """Points of a state's iterates, or of its motion once a period."""
    problem = view.problem
    if problem.map:
        ds, name = flow(problem, list(start), np.arange(count + 1.0)), "motion"
    else:
        ds, name = stroboscopic(problem, list(start), n=count), "section"
    states = np.stack([ds[f"{name}_{state}"].values for state in problem.state], axis=-1)
    color = strokes.orbit_look(k)["color"]
    look: style.Look = {**DOT, "color": color}
    view.axes.plot(*view.points(states), zorder=2.5, rasterized=True, **look)
    text = f"from ({', '.join(f'{x:.4g}' for x in start)})".replace("-", "\N{MINUS SIGN}")
    return Line2D([], [], label=text, **{**look, "markersize": 6})
