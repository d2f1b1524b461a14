"""Phase portrait of a planar flow: field, nullclines, equilibria and manifolds of its saddles."""

from __future__ import annotations

from typing import Any

import numpy as np
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.lines import Line2D
from numpy.typing import ArrayLike

from phasekit.errors import FlowEquilibriumKind
from phasekit.labelled.in_box import corners, equilibria_in_box
from phasekit.labelled.manifolds import manifolds
from phasekit.labelled.motion import flow
from phasekit.labelled.nullclines import nullclines
from phasekit.labels.arguments import bad, number
from phasekit.laws.equations import Equations
from phasekit.laws.ladder import Map
from phasekit.motion.equation_rates import rates_on
from phasekit.plot.parts import strokes, style
from phasekit.plot.parts.units import coordinate_symbol
from phasekit.systems.problem import as_problem

#: Arrows of the field along each axis.
ARROWS = 19
#: Time for which motions are drawn, in times that the field takes across the window.
LONG = 60.0
FIELD: style.Look = {"color": style.GRAY, "alpha": 0.55, "zorder": 0.5}
NULLCLINES: tuple[style.Look, ...] = (
    {"color": style.GRAY, "linestyle": (0, (6, 2)), "linewidth": 1.2},
    {"color": style.GRAY, "linestyle": (0, (1.2, 1.4)), "linewidth": 1.4},
)


def flow_portrait(
    system: Any,
    law: Equations,
    *,
    window: Any,
    orbits: ArrayLike | None,
    duration: float | None,
    legend: bool,
    ax: Axes | None,
) -> Axes:
    """Draw a planar flow in a window; see `phase_portrait`."""
    if isinstance(law, Map) or law.time is not None or len(law.states) != 2:
        hint = "draw pk.flow(...) with pk.plot.time_history"
        if law.time is not None:
            hint = "draw pk.plot.poincare_section of motions once a period"
        raise bad("system", system, "a flow of two states without forcing", hint)
    problem = as_problem(system)
    low, high = corners(problem, window)
    box = dict(zip(law.states, zip(low.tolist(), high.tolist(), strict=True), strict=True))
    values = {name: float(problem.parameters[name]) for name in law.names}
    starts = [] if orbits is None else strokes.starts_of_pairs(orbits)
    rests = equilibria_in_box(problem, box)
    axes = style.axes_for(ax, legend=legend)
    _field(axes, law, values, low, high)
    symbols = [coordinate_symbol(name) for name in law.states]
    handles = _nullclines(axes, problem, box, law, symbols)
    handles += _manifolds(axes, problem, box, law, rests)
    handles += _motions(axes, problem, law, values, starts, duration, (low, high))
    handles += _points(axes, rests)
    axes.set_xlim(low[0], high[0])
    axes.set_ylim(low[1], high[1])
    texts = []
    for name, symbol in zip(law.states, symbols, strict=True):
        unit = law.units.get(name, "1")
        texts.append(f"${symbol}$" + (f" ({unit})" if unit not in ("", "1") else ""))
    axes.set_xlabel(texts[0])
    axes.set_ylabel(texts[1])
    if legend:
        style.legend_below(axes, handles, style.MANIFOLDS)
    return axes


def _field(axes: Axes, law: Equations, values: Any, low: Any, high: Any) -> None:
    """Arrows of one length: where the flow goes, as it is seen."""
    parts = (np.arange(ARROWS) + 0.5) / ARROWS
    x, y = np.meshgrid(*(a + parts * (b - a) for a, b in zip(low, high, strict=True)))
    rates = rates_on(law, values, np.stack([x.ravel(), y.ravel()], axis=-1)) / (high - low)
    with np.errstate(all="ignore"):
        rates /= np.linalg.norm(rates, axis=1)[:, None]
    axes.quiver(
        x, y, *rates.T, angles="uv", pivot="mid", scale=1.7 * ARROWS, width=0.0028,
        headwidth=4, **FIELD,
    )  # fmt: skip


def _nullclines(
    axes: Axes, problem: Any, box: Any, law: Equations, symbols: list[str]
) -> list[Artist]:
    found, handles = nullclines(problem, box), list[Artist]()
    for name, symbol, look in zip(law.states, symbols, NULLCLINES, strict=True):
        own = found.isel(curve=np.flatnonzero(found.nullcline_of.values == name))
        for row in range(own.sizes["curve"]):
            across, up = (own[f"nullcline_{state}"].values[row] for state in law.states)
            axes.plot(across, up, zorder=1, **look)
        if own.sizes["curve"]:
            name = symbol if symbol[1:].isalpha() else f"{{{symbol}}}"
            handles.append(Line2D([], [], label=rf"$\dot {name} = 0$", **look))
    return handles


def _manifolds(axes: Axes, problem: Any, box: Any, law: Equations, rests: Any) -> list[Artist]:
    if not np.any(rests.kind.values == FlowEquilibriumKind.SADDLE):
        return []
    found, handles = manifolds(problem, window=box), list[Artist]()
    for stable, look, text in (
        (True, style.STABLE, "stable manifold"), (False, style.UNSTABLE, "unstable manifold"),
    ):  # fmt: skip
        own = found.isel(manifold=np.flatnonzero(found.manifold_stable.values == stable))
        for row in range(own.sizes["manifold"]):
            axes.plot(*(own[f"manifold_{s}"].values[row] for s in law.states), zorder=3, **look)
        if own.sizes["manifold"]:
            handles.append(Line2D([], [], label=text, **look))
    return handles


def _motions(
    axes: Axes, problem: Any, law: Equations, values: Any, starts: list[strokes.State],
    duration: float | None, window: Any,
) -> list[Artist]:  # fmt: skip
    """Motions from given states, with their starts."""
    if not starts:
        return []
    low, high = window
    if duration is None:
        inside = low + (high - low) * np.random.default_rng(0).random((400, 2))
        speed = np.linalg.norm(rates_on(law, values, inside) / (high - low), axis=1)
        typical = float(np.nanmedian(speed))
        duration = LONG / typical if typical > 0.0 else 1.0
    elif not (duration := number("duration", duration, "a time > 0")) > 0.0:
        raise bad("duration", duration, "a time > 0")
    times, handles = np.linspace(0.0, duration, 6_001), list[Artist]()
    for k, start in enumerate(starts):
        ds = flow(problem, list(start), times)
        look = strokes.orbit_look(k)
        axes.plot(*(ds[f"motion_{name}"].values for name in law.states), zorder=2.5, **look)
        look = {**look, **strokes.START}
        axes.plot([start[0]], [start[1]], zorder=6, **{**look, "linestyle": "none"})
        text = f"from ({start[0]:.4g}, {start[1]:.4g})".replace("-", "\N{MINUS SIGN}")
        handles.append(Line2D([], [], label=text, **look))
    return handles


def _points(axes: Axes, rests: Any) -> list[Artist]:
    handles: list[Artist] = []
    for kind in FlowEquilibriumKind:
        if (look := style.FLOW_POINTS.get(kind)) is None:
            continue
        own = rests.x.values[rests.kind.values == kind]
        if len(own):
            handles += axes.plot(*own.T, zorder=5, clip_on=False, linestyle="none", **look)
    return handles
