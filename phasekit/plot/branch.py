"""Branches of a continuation: equilibria against a parameter, or curves in two parameters."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from typing import Any

import numpy as np
import xarray as xr
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.lines import Line2D

from phasekit.arrays import Array
from phasekit.bifurcation.special_points import KINDS
from phasekit.errors import EquilibriumKind
from phasekit.inputs import call_checked
from phasekit.labelled.continuation.branch import Branch
from phasekit.labels.arguments import bad, flag, named, unknown
from phasekit.plot.parts import labels as words
from phasekit.plot.parts import style
from phasekit.plot.parts.circle import Circle
from phasekit.plot.parts.points import label_points
from phasekit.plot.parts.style import look_of
from phasekit.plot.parts.units import Units

ROUNDING = 1e-10  # beside its size, what a located state may be wrong by

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
#: Of periodic orbits, thick beside the lines of equilibria.
_STABLE_CYCLE: style.Look = {
    "color": style.GREEN,
    "linestyle": "-",
    "linewidth": 3.0,
    "label": "stable cycle",
}
_UNSTABLE_CYCLE: style.Look = {
    "color": style.ORANGE,
    "linestyle": (0, (1.2, 0.9)),
    "linewidth": 3.0,
    "label": "unstable cycle",
}
#: Of points whose unstable directions could not be counted, and of such periodic orbits.
_UNKNOWN: style.Look = {
    "color": style.GRAY,
    "linestyle": (0, (5, 1.5, 1, 1.5)),
    "linewidth": 1.8,
    "label": "stability unknown",
}
_UNKNOWN_CYCLE: style.Look = {
    **_UNKNOWN, "linewidth": 3.0, "label": "cycle, stability unknown"
}  # fmt: skip
#: Kinds of branches whose states have a range at each point.
_RANGES = ("cycle", "boundary")
_ORBITS = (*_RANGES, "connection")  # each point is an orbit
#: What is said of a state of periodic orbits, and short names for narrow legends.
_EXTREMES = ", max and min"
_SHORT = {
    f"{word}{more}": f"{short}{more.replace(' and ', '/')}"
    for word, short in (
        ("stable equilibrium", "stable"), ("unstable equilibrium", "unstable"),
        ("stable cycle", "st. cycle"), ("unstable cycle", "unst. cycle"),
        ("connection", "connection"), ("cycle, stability unknown", "cycle, unknown"),
    )
    for more in ("", _EXTREMES)
}  # fmt: skip
#: Curves in two parameters, by their kind.
CURVES: dict[str, style.Look] = {
    "fold": {"color": style.BLACK, "linestyle": "-", "linewidth": 2.0, "label": "fold"},
    "hopf": {"color": style.GREEN, "linestyle": "-", "linewidth": 2.0, "label": "Hopf"},
    "neutral_saddle": {
        "color": style.GRAY,
        "linestyle": (0, (1.5, 1.5)),
        "linewidth": 1.4,
        "label": "neutral saddle",
    },
    "fold_of_cycles": {
        "color": style.BLACK,
        "linestyle": (0, (5, 1.5)),
        "linewidth": 2.0,
        "label": "fold of cycles",
    },
    "period_doubling": {
        "color": style.ORANGE,
        "linestyle": "-",
        "linewidth": 2.0,
        "label": "period doubling",
    },
    "torus": {"color": style.SKY, "linestyle": "-", "linewidth": 2.0, "label": "torus"},
    "connection": {
        "color": style.BLACK,
        "linestyle": (0, (1.2, 1.2)),
        "linewidth": 2.0,
        "label": "connection",
    },
    "boundary": {"color": style.BLUE, "linestyle": "-", "linewidth": 1.8, "label": "solution"},
    "branch_point": {
        "color": style.PURPLE,
        "linestyle": (0, (7, 2, 1.5, 2)),
        "linewidth": 2.0,
        "label": "branch points",
    },
    "cycle_branch_point": {
        "color": style.PURPLE,
        "linestyle": (0, (5, 1.5)),
        "linewidth": 2.0,
        "label": "branch points of cycles",
    },
}

#: Stretches that are not proved, where proofs were asked for.
UNPROVED: style.Look = {
    "color": style.GRAY, "linestyle": "-", "linewidth": 7.0, "alpha": 0.4, "zorder": 1.5,
    "solid_capstyle": "round", "label": "not proved",
}  # fmt: skip


@call_checked
def branch(
    branches: Any,
    x: str | None = None,
    y: str | None = None,
    *,
    sel: Mapping[str, Any] | None = None,
    angles: style.Angles = "rad",
    units: Mapping[str, str] | None = None,
    cut: float | None = None,
    labels: bool = True,
    legend: bool = True,
    ax: Axes | None = None,
) -> Axes:
    """Draw one branch or several, with their special points labelled.

    Stable equilibria (centers of a conservative problem) are solid, unstable ones (saddles)
    dashed. Curves in two parameters are drawn in the plane of both. Of periodic orbits the largest
    and the least value of a state are drawn, thick where stable and thick dots where unstable.
    Where the unstable directions could not be counted, lines are gray, and the legend says so.
    Where proofs were asked for, stretches that are not proved are marked by a pale band.

    Parameters
    ----------
    branches : Branch or sequence of Branch
        What `continuation`, `diagram`, ``.switch`` or ``.curve`` return.
    x, y : str, optional
        Variables of ``branch.points``; default: the parameter and the first state, or the two
        parameters. Of periodic orbits a state stands for its ``_max`` and ``_min``.
    sel : mapping of str to label, optional
        Of a recorded quantity with more dims which one: ``sel={"bearing": "A2"}``.
    labels : bool
        Whether to write LP, BP, H, ... beside special points.

    Examples
    --------
    >>> import phasekit as pk
    >>> cubic = pk.Problem("mu + x - x**3", state="x", parameters={"mu": -1.0})
    >>> ax = pk.plot.branch(pk.continuation(cubic, "mu", x0=[-1.3], span=(-1, 1)))
    >>> [text.get_text() for text in ax.texts]
    ['LP', 'LP']
    """
    flag("labels", labels)
    flag("legend", legend)
    several = _several(branches)
    first = several[0]
    if sel is not None and not isinstance(sel, Mapping):
        raise bad("sel", sel, "a mapping from dims to labels, such as {'unknown': 'x'}")
    x = first.free[0] if x is None else x
    if y is None:
        plane = len(first.free) > 1 and first.kind not in _RANGES
        y = first.free[1] if plane else first.problem_state[0]
    several, columns = _columns(several, x, y, sel)
    held = {str(c.name): str(c.attrs.get("units", "")) for c in columns[0]}
    shown = Units.from_arguments(angles, units, held)
    circle = Circle.of_axis(columns[0][1], shown, cut)
    stretch = [shown.scale(*item) for item in held.items()]
    axes = style.axes_for(ax, legend=legend)
    handles: dict[str, Artist] = {}
    mixed = len({one.kind for one in several}) > 1
    for one, pair in zip(several, columns, strict=True):
        for look, across, up in _pieces(one, pair, circle):
            if circle is not None:
                up, across = circle.unrolled(up, across)
            text = str(look["label"])
            if one.kind in _ORBITS and y in one.problem_state:
                text += _EXTREMES
            elif mixed and one.kind == "equilibrium" and text in ("stable", "unstable"):
                text += " equilibrium"
            own = {**style.inked(look), "label": text}
            if np.size(across) == 1:  # no line
                own |= {"marker": "s", "linestyle": "none", "zorder": 4}
            (line,) = axes.plot(across * stretch[0], up * stretch[-1], **own)
            handles.setdefault(text, line)
        for across, up in _unproved(one, pair):
            if circle is not None:
                up, across = circle.unrolled(up, across)
            (line,) = axes.plot(across * stretch[0], up * stretch[-1], **style.inked(UNPROVED))
            handles.setdefault(str(UNPROVED["label"]), line)
    marks: dict[tuple[str, str], list[tuple[float, float]]] = {}  # by kind and name of an event
    for one, pair in zip(several, columns, strict=True):
        across, up = (column.values for column in pair)
        for special in one.special_points:
            if special.kind == "end":
                continue
            place = (float(across[special.index]), float(up[special.index]))
            marks.setdefault((special.kind, special.name), []).append(place)
    named: dict[tuple[float, float], str] = {}
    kinds = dict.fromkeys(kind for kind, _ in marks)
    for (kind, name), places in marks.items():
        look = {**look_of(kind), "label": name or _key(kind, kinds)}
        label = name or KINDS[kind].label
        across, up = np.array(places).T
        if circle is not None:
            up, across = circle.points(up, across)
        across, up = across * stretch[0], up * stretch[-1]
        for point in zip(across, up, strict=True):
            before = named.get(point, label)
            named[point] = before if label in before.split(", ") else f"{before}, {label}"
        axes.plot(across, up, linestyle="none", zorder=3 if kind == "neutral_saddle" else 4, **look)
        handles[kind + name] = Line2D([], [], linestyle="none", **look)
    if circle is not None:
        style.circle_axis(axes, "y", shown, circle)
    else:
        _show_constant(axes, abs(stretch[-1]) * max(map(_size, several, columns)))
    if labels:
        label_points(axes, named)
    axes.set_xlabel(words.label(columns[0][0], shown, style.letters(axes, "x")))
    axes.set_ylabel(words.label(columns[0][1], shown, style.letters(axes, "y")))
    if legend:
        style.legend_below(axes, list(handles.values()), _SHORT)
    return axes


def _unproved(one: Branch, pair: tuple[xr.DataArray, xr.DataArray]) -> list[tuple[Any, Any]]:
    """Stretches of a branch that was to be proved and is not there, one after the other."""
    if "certified_onward" not in one.points:
        return []
    across, up = (column.values for column in pair)
    open_ = np.flatnonzero(~one.points.certified_onward.values[:-1])
    runs = np.split(open_, np.flatnonzero(np.diff(open_) > 1) + 1) if open_.size else []
    return [(across[run[0] : run[-1] + 2], up[run[0] : run[-1] + 2]) for run in runs]


def holds_branches(what: Any) -> bool:
    """Whether something is a Branch or a sequence of them."""
    first = what[0] if isinstance(what, Sequence) and what else what
    return isinstance(first, Branch)


def _several(branches: Any) -> list[Branch]:
    listed = isinstance(branches, Sequence) and not isinstance(branches, str)
    several = list(branches) if listed else [branches]
    for one in several:
        if not isinstance(one, Branch):
            raise bad("branches", one, "a Branch, or several")
    if not several:
        raise bad("branches", branches, "at least one Branch")
    return several


def _columns(
    several: list[Branch], x: str, y: str, sel: Mapping[str, Any] | None
) -> tuple[list[Branch], list[tuple[xr.DataArray, xr.DataArray]]]:
    """What to draw of which branch: of the states of periodic orbits the largest and the least."""
    branches, columns = [], []
    for one in several:
        cycle = one.kind in _ORBITS and y in one.problem_state
        for name in (f"{y}_max", f"{y}_min") if cycle else (y,):
            branches.append(one)
            column = _column(one, "y", name, sel)
            if cycle:
                column = column.rename(y).assign_attrs(long_name="")
            columns.append((_column(one, "x", x, sel), column))
    return branches, columns


def _column(one: Branch, argument: str, name: str, sel: Mapping[str, Any] | None) -> xr.DataArray:
    """A quantity of a branch along its points."""
    points = one.points
    offered = [
        str(n)
        for n, v in points.data_vars.items()
        if v.dims[:1] == ("point",) and v.dtype.kind in "if" and n != "tangent"
    ]
    column: xr.DataArray = points[named(argument, name, offered)]
    if column.name in _largest(one):
        beside = [dim for dim in column.dims[1:] if dim not in (sel or {})]
        column = column.min(beside) if name.endswith("_min") else column.max(beside)
    for dim in column.dims[1:]:
        values = column[dim].values.tolist()
        if dim not in (sel or {}):
            raise bad("sel", sel, f"one of {dim} = {values} for {argument} = {name}")
        label = (sel or {})[str(dim)]
        if isinstance(label, bool) or not isinstance(label, (str, int)) or label not in values:
            raise unknown(f"sel: {dim}", label, map(str, values))
        column = column.sel({dim: label})
    return column


def _largest(one: Branch) -> set[str]:
    """Extremes of fields over time, of which pictures show those over space."""
    fields = [block.name for block in one.problem.blocks]
    return {f"{name}_{which}" for name in fields for which in ("min", "max")}


def _pieces(
    one: Branch, pair: tuple[xr.DataArray, xr.DataArray], circle: Circle | None
) -> list[tuple[style.Look, Any, Any]]:
    """Runs of points of one look; each begins where the one before ends, and angles may wrap."""
    cuts = _cuts(one, pair if circle is None else pair[:1])
    looks = _looks(one)
    x, y, *slopes = _bends(one, pair)
    bends = (x, y if circle is None else np.unwrap(y), *slopes)
    pieces = []
    begin = 0
    for i in range(1, len(looks) + 1):
        if i < len(looks) and looks[i] is looks[begin]:
            continue
        parts = np.split(
            np.arange(begin, min(i + 1, len(looks))), cuts[(cuts > begin) & (cuts <= i)] - begin
        )
        curves = [smooth(*(values[part] for values in bends)) for part in parts]
        xs, ys = (
            np.concatenate([piece for curve in curves for piece in (curve[k], [np.nan])])[:-1]
            for k in (0, 1)
        )
        pieces.append((looks[begin], xs, ys))
        begin = i
    return pieces


def _bends(one: Branch, pair: tuple[xr.DataArray, xr.DataArray]) -> tuple[Array, ...]:
    """Return x, y, arclength, and the slopes of x and y over it, NaN where they are not known."""
    points = one.points
    # Points of periodic orbits have no slopes.
    unknowns = points["unknown"].values.tolist() if "unknown" in points.variables else []
    x, y = (column.values.astype(float) for column in pair)
    if all(column.dims == ("point",) and column.name in unknowns for column in pair):
        slopes = [points.tangent.sel(unknown=column.name).values for column in pair]
    else:
        slopes = [np.full(x.shape, np.nan)] * 2
    return x, y, points.arclength.values, *slopes


def _looks(one: Branch) -> list[style.Look]:
    points = one.points
    if "kind_of_pair" in points:
        pair = [str(name) or one.kind for name in points.kind_of_pair.values]
        return [CURVES[name] for name in pair]
    if one.kind not in ("equilibrium", "cycle", "event"):
        return [CURVES[one.kind]] * points.sizes["point"]
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
    stable, unstable, unclear = (
        (_STABLE_CYCLE, _UNSTABLE_CYCLE, _UNKNOWN_CYCLE)
        if one.kind == "cycle"
        else (_STABLE, _UNSTABLE, _UNKNOWN)
    )
    found = [
        unclear if k < 0 else unstable if k else stable for k in points.n_unstable.values.tolist()
    ]
    if len(found) > 1:  # where it begins or ends at a bifurcation it has the look of what is beside
        for end, beside in ((0, 1), (-1, -2)):
            found[end] = found[beside] if found[end] is unclear else found[end]
    if one.kind == "cycle" and len(found) > 1:  # beside a Hopf point rounding decides
        for end, beside, stop in ((0, 1, one.stops[0]), (-1, -2, one.stops[-1])):
            if stop.reason == "hopf":
                found[end] = found[beside]
    return found


def _size(one: Branch, pair: tuple[xr.DataArray, xr.DataArray]) -> float:
    """The size of what is drawn upwards: its values, or that of a state on scaled axes."""
    column = pair[1]
    scale = np.ravel(getattr(one.walker.curve, "scale", ()))  # periodic orbits have none
    sizes = dict(zip((*one.problem_state, *one.free), scale, strict=False))
    values = np.abs(column.values[np.isfinite(column.values)])
    return float(max(values.max(initial=0.0), sizes.get(str(column.name), 0.0)))


def _show_constant(axes: Axes, size: float) -> None:
    """Show what changes by rounding alone as the constant that it is."""
    low, high = axes.dataLim.intervaly
    if 0.0 <= high - low <= ROUNDING * size:
        middle = 0.5 * (low + high)
        axes.set_ylim(middle - 0.1 * size, middle + 0.1 * size)


def _cuts(one: Branch, pair: Sequence[xr.DataArray]) -> Any:
    """The points before which a line has a gap: an angle jumps by about its period."""
    periods = dict(one.problem.periods) if one.problem is not None else {}
    jump = np.zeros(max(pair[0].size - 1, 0), dtype=bool)
    for column in pair:
        if column.name in periods:
            jump |= np.abs(np.diff(column.values)) > 0.5 * periods[column.name]
    return np.flatnonzero(jump) + 1


def _key(kind: str, drawn: Collection[str]) -> str:
    """What the legend calls a kind: its label, and its name where another has that label too."""
    label = KINDS[kind].label
    alone = [KINDS[other].label for other in drawn].count(label) == 1
    return label if alone else f"{label} {look_of(kind)['label']}"


#: A chord may leave the curve by this part of what the picture spans.
SAGITTA = 2e-4
MOST = 24


def smooth(x: Array, y: Array, s: Array, dx: Array, dy: Array) -> tuple[Array, Array]:
    """Return the cubic curve through points with given slopes over the arclength s.

    Points are added between those where their chord would leave the curve; where slopes are not
    known, or contradict the points, the chord stays.
    """
    step = np.diff(s)
    bow = np.zeros(step.shape)
    for values, slopes in ((x, dx), (y, dy)):
        span = float(np.ptp(values)) if values.size else 0.0
        if not span > 0.0:
            continue
        # The middle of a cubic lies off that of its chord by h (slope_0 - slope_1) / 8.
        off = np.abs(step * np.diff(slopes)) / 8.0
        chord = np.abs(np.diff(values))
        strays = np.max(np.abs(np.stack([slopes[:-1], slopes[1:]])) * step, axis=0)
        bow = np.maximum(bow, np.where(strays > 4.0 * chord + 0.05 * span, np.nan, off / span))
    parts = np.ceil(np.sqrt(bow / SAGITTA))
    parts = np.where(np.isfinite(parts), np.clip(parts, 1, MOST), 1).astype(int)
    if not (parts > 1).any():
        return x, y
    pieces = [
        _cubic(
            np.arange(n) / n, values[i], values[i + 1], step[i] * slopes[i], step[i] * slopes[i + 1]
        )
        if n > 1
        else values[i : i + 1]
        for values, slopes in ((x, dx), (y, dy))
        for i, n in enumerate(parts)
    ]
    half = len(pieces) // 2
    return (
        np.concatenate([*pieces[:half], x[-1:]]),
        np.concatenate([*pieces[half:], y[-1:]]),
    )


def _cubic(t: Array, a: float, b: float, da: float, db: float) -> Array:
    """Return the cubic with the ends a, b and the slopes da, db there, at t in [0, 1]."""
    rise = t * t * (3.0 - 2.0 * t)
    return np.asarray(a + (b - a) * rise + t * (1.0 - t) * ((1.0 - t) * da - t * db))
