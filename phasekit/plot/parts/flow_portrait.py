"""Phase portrait of a flow: field, nullclines, equilibria, manifolds of saddles, limit cycles.

Of a planar flow all of it; of more states what projects to a plane of two of them.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.colors import ListedColormap
from matplotlib.lines import Line2D
from matplotlib.patches import Patch

from phasekit.arrays import Array
from phasekit.errors import AttractorKind, FlowEquilibriumKind, warn
from phasekit.labelled.basins import basins
from phasekit.labelled.manifolds import manifolds_of
from phasekit.labelled.motion import flow
from phasekit.labelled.nullclines import nullclines
from phasekit.labelled.periodic_orbits import all_round, cycles_of
from phasekit.labels.arguments import bad, flag, number, unknown
from phasekit.motion.equation_rates import rates_on
from phasekit.motion.limit_cycles import Cycle
from phasekit.motion.paths import distances
from phasekit.plot.parts import strokes, style
from phasekit.plot.parts.circle import TURN, Circle
from phasekit.plot.parts.units import Units, printed, state_symbols
from phasekit.systems.problem import Problem
from phasekit.systems.rests import Equilibria, corners, equilibria_of
from phasekit.systems.smooth import jumping_formula, refuse_jumps

#: Arrows of the field along each axis.
ARROWS = 19
#: Time for which motions are drawn, in times that the field takes across the window.
LONG = 60.0
#: Length of manifolds, in widths of the window.
LENGTH = 20.0
#: Distance from a cycle, in widths, up to which a manifold that comes to it is drawn.
BESIDE = 0.01
#: Of small portraits: parts of lines and markers, room about what lies in them in parts of it and
#: of the window, and states along each axis of streamlines.
THIN, SMALL, ROOM, LEAST, STREAMS = 0.6, 0.6, 0.35, 0.05, 40
#: States along each axis of the basins.
CELLS = 120
FIELD: style.Look = {"color": style.GRAY, "alpha": 0.55, "zorder": 0.5}
NULLCLINES: tuple[style.Look, ...] = (
    {"color": style.GRAY, "linestyle": (0, (6, 2)), "linewidth": 1.2},
    {"color": style.GRAY, "linestyle": (0, (1.2, 1.4)), "linewidth": 1.4},
)
CYCLES: Mapping[bool, style.Look] = {
    True: {"color": style.BLACK, "linestyle": "-", "linewidth": 2.4, "label": "limit cycle"},
    False: {
        "color": style.BLACK,
        "linestyle": (0, (2.5, 1.2)),
        "linewidth": 2.4,
        "label": "unstable limit cycle",
    },
}
#: Short names, for narrow legends.
SHORT = {"limit cycle": "cycle", "unstable limit cycle": "unstable cycle"}
#: Shades of basins, light enough for all that is drawn on them.
SHADES = (style.SKY, style.ORANGE, style.GREEN, style.PURPLE, style.YELLOW, style.BLUE)


@dataclass(frozen=True)
class View:
    """The plane of two states in which a flow is drawn."""

    axes: Axes
    #: The flow.
    problem: Problem
    #: Places of both states.
    shown: tuple[int, int]
    #: Corners of the window, of all states.
    low: Array
    high: Array
    #: Of both states, those that are angles all round.
    circles: tuple[Circle, Circle]

    @classmethod
    def from_arguments(cls, axes: Axes, problem: Problem, window: Any, plane: Any) -> View:
        """Check a window and a plane."""
        low, high = corners(problem, window, "window")
        names = problem.state
        chosen = names[:2] if plane is None else tuple(plane)
        if len(chosen) != 2 or chosen[0] == chosen[-1] or isinstance(plane, str):
            raise bad("plane", plane, f"two of the states {', '.join(names)}")
        for name in chosen:
            if name not in names:
                raise unknown("plane: state", name, names)
        shown = names.index(chosen[0]), names.index(chosen[1])
        turns = all_round(problem, low, high)
        # A window that is a little more than a turn is cut in its middle.
        first, second = (
            Circle(float(0.5 * (low[i] + high[i] - turns[i])), float(turns[i]))
            if turns[i] > 0.0 else Circle(float(low[i]), None)
            for i in shown
        )  # fmt: skip
        return cls(axes, problem, shown, low, high, (first, second))

    @property
    def box(self) -> dict[str, tuple[float, float]]:
        """The window by state."""
        ends = zip(self.low.tolist(), self.high.tolist(), strict=True)
        return dict(zip(self.problem.state, ends, strict=True))

    def seen(self, states: Array) -> tuple[Array, Array]:
        """A curve of states, of shape (points, states), where it is seen: round both circles."""
        x, y = (states[:, i] for i in self.shown)
        beyond = np.zeros(len(x), bool)
        for values, i, circle in zip((x, y), self.shown, self.circles, strict=True):
            if circle.period is None:  # what is far outside is not drawn at all
                width = self.high[i] - self.low[i]
                beyond |= (values < self.low[i] - width) | (values > self.high[i] + width)
        x, y = np.where(beyond, np.nan, x), np.where(beyond, np.nan, y)
        if not np.isfinite(x).any():
            return x, y
        x, y = self.circles[0].unrolled(x, y)
        y, x = self.circles[1].unrolled(y, x)
        return x, y

    def points(self, states: Array) -> tuple[Array, Array]:
        """Points where they are seen, those on a cut at both of its sides."""
        x, y = self.circles[0].points(states[:, self.shown[0]], states[:, self.shown[1]])
        y, x = self.circles[1].points(y, x)
        return x, y

    def name_axes(self, angles: style.Angles = "rad") -> None:
        """Limits, ticks and names of both axes."""
        symbols, _ = state_symbols(self.problem.state)
        for which, i, circle in zip("xy", self.shown, self.circles, strict=True):
            name = self.problem.state[i]
            unit = self.problem.unit_of(name) or "1"
            if circle.period is not None and abs(circle.period - TURN) < 1e-12:
                units = Units.from_arguments("rad", None, {})
                style.circle_axis(self.axes, which, units, circle, name)  # type: ignore[arg-type]
                if angles == "deg":  # all is drawn in rad
                    unit, axis = "deg", self.axes.xaxis if which == "x" else self.axes.yaxis
                    axis.set_major_formatter(lambda value, _: f"{np.degrees(value):.10g}")
            else:
                self.axes.set(**{f"{which}lim": (self.low[i], self.high[i])})
            text = f"${symbols[i]}$" + (f" ({printed(unit)})" if unit not in ("", "1") else "")
            self.axes.set(**{f"{which}label": text})


def flow_portrait(
    problem: Problem, *, window: Any, plane: Any, orbits: Any, duration: float | None,
    cycles: bool | None, shade: bool, angles: style.Angles, legend: bool, ax: Axes | None,
) -> Axes:  # fmt: skip
    """Draw a flow in a window; see `phase_portrait`."""
    Units.from_arguments(angles)
    flag("basins", shade)
    if cycles is not None:
        flag("cycles", cycles)
    planar = len(problem.state) == 2
    for name, value in {"basins": shade, "cycles": bool(cycles)}.items():
        if value and not planar:
            raise bad(name, True, "False, for a flow of more than two states")
    starts = starts_of(problem, orbits)
    axes = style.axes_for(ax, legend=legend)
    view = View.from_arguments(axes, problem, window, plane)
    if angles != "rad" and all(circle.period is None for circle in view.circles):
        raise bad("angles", angles, "'rad' where no state that is drawn is an angle all round")
    jumps = bool(jumping_formula(problem))
    if cycles and jumps:
        refuse_jumps(problem)
    rests = equilibria_of(problem, view.low, view.high)
    if rests.why:
        warn(f"phase_portrait: there may be other equilibria: {rests.why}")
    handles: list[Artist] = []
    found: list[Cycle] | None = [] if planar else None
    if planar:
        if shade:
            handles += draw_basins(view)
        _field(view)
        handles += _nullclines(view)
        if cycles or (cycles is None and problem.kind != "python" and not jumps):
            found, _, lost, _ = cycles_of(problem, view.low, view.high, rests.x)
            if lost:
                text = f"{len(lost)} limit cycles were met and are missing: {lost[0]}"
                warn(f"phase_portrait: {text}", RuntimeWarning)
    handles += _manifolds(view, rests, found)
    handles += _cycles(view, found or [])
    handles += _motions(view, starts, duration)
    handles += draw_points(view, rests)
    view.name_axes(angles)
    if legend:
        style.legend_below(axes, handles, {**style.MANIFOLDS, **SHORT})
    return axes


def thumbnail(axes: Axes, problem: Problem, low: Array, high: Array) -> None:
    """Draw a planar flow without words: about what lies in a window, with streamlines."""
    rests = equilibria_of(problem, low, high)
    found = []
    if problem.kind != "python":
        found = cycles_of(problem, low, high, rests.x).cycles
    ends = [rests.x, *(np.stack([one.low, one.high]) for one in found)]
    a, b = _about(problem, np.concatenate(ends), low, high)
    view = View.from_arguments(
        axes, problem, dict(zip(problem.state, zip(a, b, strict=True), strict=True)), None
    )
    _streams(view)
    _manifolds(view, rests, found)
    _cycles(view, found)
    draw_points(view, rests)
    for line in axes.lines:
        line.set(linewidth=THIN * line.get_linewidth(), markersize=SMALL * line.get_markersize())
        line.set_markeredgewidth(0.7 * line.get_markeredgewidth())
    axes.set(xlim=(a[0], b[0]), ylim=(a[1], b[1]), xticks=[], yticks=[], xlabel="", ylabel="")


def _about(problem: Problem, states: Array, low: Array, high: Array) -> tuple[Array, Array]:
    """A part of a window about states, of angles all of it."""
    width = high - low
    if not len(states):
        return low, high
    a, b = states.min(axis=0), states.max(axis=0)
    room = np.maximum(ROOM * (b - a), LEAST * width)
    whole = all_round(problem, low, high) > 0.0
    a, b = np.maximum(a - room, low), np.minimum(b + room, high)
    return np.where(whole, low, a), np.where(whole, high, b)


def _streams(view: View) -> None:
    """Streamlines, few and thin."""
    law: Any = view.problem.law
    values = {name: float(view.problem.parameters[name]) for name in law.names}
    x, y = (np.linspace(a, b, STREAMS) for a, b in zip(view.low, view.high, strict=True))
    states = np.stack([one.ravel() for one in np.meshgrid(x, y)], axis=-1)
    rates = rates_on(law, values, states).reshape(STREAMS, STREAMS, 2)
    if np.isfinite(rates).any():
        view.axes.streamplot(
            x, y, rates[..., 0], rates[..., 1], density=0.5, linewidth=0.6, arrowsize=0.5,
            color=style.GRAY, zorder=0.5,
        )  # fmt: skip


def starts_of(problem: Problem, orbits: Any) -> list[Array]:
    """States at which motions start, each of one number a state."""
    if orbits is None:
        return []
    names = problem.state
    wants = f"states ({', '.join(names)}), one or a list of them"
    if isinstance(orbits, Mapping):
        orbits = [orbits]
    if isinstance(orbits, Sequence) and orbits and isinstance(orbits[0], Mapping):
        for one in orbits:
            if set(one) != set(names):
                raise bad("orbits", one, wants)
        orbits = [[one[name] for name in names] for one in orbits]
    array = strokes.finite(orbits, "orbits", "the units of the states")
    if not array.size:
        return []
    array = np.atleast_2d(array)
    if array.ndim != 2 or array.shape[1] != len(names):
        raise bad("orbits", orbits, wants)
    return list(array)


def _field(view: View) -> None:
    """Arrows of one length: where the flow goes, as it is seen."""
    law: Any = view.problem.law
    values = {name: float(view.problem.parameters[name]) for name in law.names}
    low, width = view.low, view.high - view.low
    parts = (np.arange(ARROWS) + 0.5) / ARROWS
    x, y = np.meshgrid(*(a + parts * b for a, b in zip(low, width, strict=True)))
    rates = rates_on(law, values, np.stack([x.ravel(), y.ravel()], axis=-1)) / width
    with np.errstate(all="ignore"):
        rates /= np.linalg.norm(rates, axis=1)[:, None]
    first, second = view.shown
    at = (x, y)
    view.axes.quiver(
        at[first], at[second], rates[:, first], rates[:, second], angles="uv", pivot="mid",
        scale=1.7 * ARROWS, width=0.0028, headwidth=4, **FIELD,
    )  # fmt: skip


def _nullclines(view: View) -> list[Artist]:
    found, handles = nullclines(view.problem, view.box), list[Artist]()
    names = view.problem.state
    _, rates = state_symbols(names)
    for name, rate, look in zip(names, rates, NULLCLINES, strict=True):
        own = found.isel(curve=np.flatnonzero(found.nullcline_of.values == name))
        for row in range(own.sizes["curve"]):
            across, up = (own[f"nullcline_{names[i]}"].values[row] for i in view.shown)
            view.axes.plot(across, up, zorder=1, **look)
        if own.sizes["curve"]:
            handles.append(Line2D([], [], label=f"${rate} = 0$", **look))
    return handles


def _manifolds(view: View, rests: Equilibria, cycles: list[Cycle] | None) -> list[Artist]:
    problem = view.problem
    found = manifolds_of(
        problem, view.low, view.high, rests, range(len(rests.x)), LENGTH, cycles=cycles or []
    )
    curves = [
        one.x if goal.cycle < 0 else _until_beside(view, one.x, (cycles or [])[goal.cycle])
        for one, goal in zip(found.strands, found.goals, strict=True)
    ]
    return draw_manifolds(view, curves, [begin.sense for begin in found.starts])


def draw_manifolds(
    view: View, curves: Sequence[Array], senses: Sequence[float], thin: float = 1.0
) -> list[Artist]:
    """Curves of states, by the sense of time in which they leave: 1 of unstable manifolds."""
    handles = list[Artist]()
    for sense, look, text in (
        (-1.0, style.STABLE, "stable manifold"), (1.0, style.UNSTABLE, "unstable manifold"),
    ):  # fmt: skip
        look = {**look, "linewidth": thin * float(look["linewidth"])}
        own = [one for one, other in zip(curves, senses, strict=True) if other == sense]
        for one in own:
            view.axes.plot(*view.seen(one), zorder=3, **look)
        if own:
            handles.append(Line2D([], [], label=text, **look))
    return handles


def _until_beside(view: View, states: Array, cycle: Cycle) -> Array:
    """A curve up to where it is next to the cycle to which it comes."""
    turns = np.array([circle.period or 0.0 for circle in view.circles])
    widths = np.where(turns > 0.0, turns, view.high - view.low)
    away = distances(states, cycle.state, widths, turns)
    return states[: int(np.argmax(away < BESIDE)) + 1] if np.any(away < BESIDE) else states


def _cycles(view: View, cycles: Sequence[Cycle]) -> list[Artist]:
    handles = list[Artist]()
    for stable in (True, False):
        own = [one for one in cycles if (one.growth < 0.0) == stable]
        look = style.inked(CYCLES[stable])
        for one in own:
            view.axes.plot(*view.seen(one.state), zorder=2.8, **{**look, "label": "_"})
        if own:
            handles.append(Line2D([], [], **look))
    return handles


def _motions(view: View, starts: Sequence[Array], duration: float | None) -> list[Artist]:
    """Motions from given states, with their starts."""
    if duration is not None and not (duration := number("duration", duration, "a time > 0")) > 0.0:
        raise bad("duration", duration, "a time > 0")
    if not starts:
        return []
    if duration is None:
        duration = LONG * _crossing_time(view)
    times, handles = np.linspace(0.0, duration, 6_001), list[Artist]()
    for k, start in enumerate(starts):
        ds = flow(view.problem, list(start), times)
        states = np.stack([ds[f"motion_{name}"].values for name in view.problem.state], axis=-1)
        look = strokes.orbit_look(k)
        view.axes.plot(*view.seen(states), zorder=2.5, **look)
        look = {**look, **strokes.START}
        at = view.points(start[None])
        view.axes.plot(*at, zorder=6, **{**look, "linestyle": "none"})
        text = f"from ({', '.join(f'{x:.4g}' for x in start)})".replace("-", "\N{MINUS SIGN}")
        handles.append(Line2D([], [], label=text, **look))
    return handles


def _crossing_time(view: View) -> float:
    """A time that the flow takes across the window."""
    law: Any = view.problem.law
    values = {name: float(view.problem.parameters[name]) for name in law.names}
    width = view.high - view.low
    inside = view.low + width * np.random.default_rng(0).random((400, len(width)))
    speed = np.linalg.norm(rates_on(law, values, inside) / width, axis=1)
    typical = float(np.nanmedian(speed))
    return 1.0 / typical if typical > 0.0 else 1.0


def draw_basins(view: View) -> list[Artist]:
    """Shades of the basins of attractors, in the order in which they are found."""
    names = view.problem.state
    cells = {
        name: low + (np.arange(CELLS) + 0.5) / CELLS * (high - low)
        for name, low, high in zip(names, view.low, view.high, strict=True)
    }
    found = basins(view.problem, cells)
    first, second = (names[i] for i in view.shown)
    codes = found.basin.transpose(f"state_{second}", f"state_{first}")
    handles: list[Artist] = []
    for code in np.unique(codes.values[codes.values >= 0]):
        color = SHADES[int(code) % len(SHADES)]
        text = f"basin of {_attractor(view, found, int(code))}"
        handles.append(Patch(facecolor=color, alpha=0.25, label=text))
        here = np.where(codes.values == code, 1.0, np.nan)
        view.axes.pcolormesh(
            cells[first], cells[second], here, color=color, alpha=0.25, zorder=0, shading="nearest",
            cmap=ListedColormap([color]), linewidth=0, rasterized=True,
        )  # fmt: skip
    return handles


def _attractor(view: View, found: Any, code: int) -> str:
    """What the legend calls an attractor: a rest by its place."""
    own = found.isel(attractor=code)
    kind = AttractorKind(int(own.attractor_kind)).name.lower()
    if AttractorKind(int(own.attractor_kind)) is not AttractorKind.EQUILIBRIUM:
        return "a chaotic attractor" if kind == "chaotic" else f"a {kind}"
    place = np.array([own[f"attractor_{name}"].values.ravel()[0] for name in view.problem.state])
    small = np.abs(place) < 1e-9 * (view.high - view.low)
    text = ", ".join(f"{x:.3g}" for x in np.where(small, 0.0, place))
    return f"({text})".replace("-", "\N{MINUS SIGN}")


def draw_points(view: View, rests: Equilibria) -> list[Artist]:
    """Equilibria, or fixed points, by their kinds."""
    handles: list[Artist] = []
    for kind in FlowEquilibriumKind:
        if (look := style.FLOW_POINTS.get(kind)) is None:
            continue
        own = rests.x[rests.kind == kind]
        if len(own):
            handles += view.axes.plot(
                *view.points(own), zorder=5, clip_on=False, linestyle="none", **look
            )
    return handles
