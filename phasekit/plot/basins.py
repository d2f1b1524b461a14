"""Basins of attraction."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import matplotlib.pyplot as plt
import numpy as np
import xarray as xr
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.colors import BoundaryNorm, ListedColormap
from matplotlib.lines import Line2D
from matplotlib.patches import Patch

from phasekit.arrays import Array
from phasekit.errors import AttractorKind, ParameterError
from phasekit.inputs import call_checked
from phasekit.labels.arguments import bad, number, unknown
from phasekit.plot.parts import labels, style
from phasekit.plot.parts.circle import TURN
from phasekit.plot.parts.units import Units, state_symbols

#: Colors of attractors, each darker than the one before, so that they are apart in gray print.
COLORS = ("#BFE0F5", "#EDB458", "#5FB39A", "#B0709C", "#2C6A9E", "#6B3A0A")
ESCAPED, UNDECIDED = "#FFFFFF", style.NOTHING
#: Attractors that are named under the axes.
NAMED = 12
#: Points of attractors: rests, what repeats itself after many steps, and what never does.
REST: style.Look = {"marker": "o", "markersize": 5.5}
SET: style.Look = {"marker": ".", "markersize": 1.6, "markeredgewidth": 0.0}
EDGE: style.Look = {"markeredgecolor": "white", "markeredgewidth": 0.8}


@dataclass(frozen=True)
class StateAxis:
    """One state of the grid, along an axis of the picture."""

    #: The state as the Dataset calls it.
    name: str
    #: What the axis is called.
    text: str
    #: What values are multiplied by to be shown.
    scale: float
    #: Of an angle: its turn.
    period: float | None
    is_angle: bool

    def shown(self, values: Array) -> Array:
        """Values in the unit in which they are shown."""
        return np.asarray(values * self.scale)


@call_checked
def basins(
    dataset: xr.Dataset,
    *,
    x: str | None = None,
    y: str | None = None,
    capture: xr.Dataset | None = None,
    angles: style.Angles = "rad",
    units: Mapping[str, str] | None = None,
    legend: bool = True,
    ax: Axes | None = None,
    **sel: Any,
) -> Axes:
    r"""Draw basins of attraction with their shares, and the predicted odds of capture.

    Parameters
    ----------
    dataset : xarray.Dataset
        What `basins` returns.
    x, y : str, optional
        The states on the axes; by default the first two of the grid.
    capture : xarray.Dataset, optional
        What `capture` returns for the same system: the odds with which a slowly damped motion
        falls to either side, which are written beside the shares of the attractors that lie there.
    units : mapping of str to str, optional
        Units in which quantities are shown, by name: ``{"phi": "deg", "dphi": "rpm"}``.
    legend : bool
        Whether to name the attractors under the axes.
    **sel
        Values of the other states of a grid of three or more, such as ``z=0.5``, of which the
        nearest are taken.

    Raises
    ------
    ParameterError
        If an argument is unusable, or states other than two are left.

    Notes
    -----
    The shares are those of the whole grid, with their errors, also where a part of it is drawn.
    Attractors are drawn where they project to. What is undecided is hatched.

    Examples
    --------
    >>> import numpy as np
    >>> import phasekit as pk
    >>> damped = pk.Perturbed(pk.Coefficients(1.0, 0.35, 0.12), damping=0.2)
    >>> ds = pk.basins(damped, phi=np.linspace(-3.0, 3.0, 61), dphi=np.linspace(-2.0, 2.0, 41))
    >>> ax = pk.plot.basins(ds, capture=pk.capture(damped))
    >>> ax.get_xlabel()
    '$\\varphi$ (rad)'
    """
    ds = labels.dataset(dataset, "dataset", ("basin", "attractor_kind"), "pk.basins")
    ds, shown = Units.of_dataset(ds, angles, units)
    names = _plane(ds, x, y, sel)
    ds = ds.sel({f"state_{name}": value for name, value in sel.items()}, method="nearest")
    ds = ds.transpose(..., *(f"state_{name}" for name in names))
    if min(ds.basin.shape) < 2:
        raise bad("dataset", ds, "basins over at least two values of each state")
    pair = across, up = _axes_of(ds, names, shown)
    count = ds.sizes["attractor"]
    colors = [ESCAPED, UNDECIDED, *_colors(count)]
    axes = style.axes_for(ax, legend=legend)
    norm = BoundaryNorm(np.arange(count + 3) - 2.5, count + 2)
    places = [axis.shown(ds[f"state_{axis.name}"].values) for axis in pair]
    codes = ds.basin.values.T
    look: style.Look = {"shading": "nearest", "rasterized": True}
    axes.pcolormesh(*places, codes, cmap=ListedColormap(colors), norm=norm, **look)
    if (codes == -1).any():
        with plt.rc_context({"hatch.color": style.GRAY, "hatch.linewidth": 0.6}):
            axes.contourf(
                *places, (codes == -1).astype(float), levels=[0.5, 1.5], colors="none",
                hatches=["////"],
            )  # fmt: skip
    predicted = {} if capture is None else _odds(ds, capture)
    handles: list[Artist] = []
    for i in range(count):
        points = ds.isel(attractor=i)
        _draw_attractor(axes, points, pair, colors[i + 2])
        share, error = points.basin_fraction.item(), points.basin_fraction_error.item()
        text = f"{_name(points, pair)}: {share:.3f} $\\pm$ {error:.3f}"
        text = text.replace("-", "\N{MINUS SIGN}")
        if i in predicted:
            text += f", predicted odds {predicted[i]:.3f}"
        handles.append(Patch(facecolor=colors[i + 2], edgecolor=style.GRAY, label=text))
    if count > NAMED:
        rest = float(ds.basin_fraction[NAMED:].sum())
        handles[NAMED:] = [Line2D([], [], ls="none", label=f"{count - NAMED} others: {rest:.3f}")]
    for code, text, hatch in ((-1, "undecided", "////"), (-2, "away to infinity", None)):
        if (ds.basin == code).any():
            handles.append(
                Patch(facecolor=colors[code + 2], edgecolor=style.GRAY, label=text, hatch=hatch)
            )
    handles.append(Line2D([], [], color=style.BLACK, ls="none", label=_words(ds), **REST | EDGE))
    axes.set_xlim(places[0].min(), places[0].max())
    axes.set_ylim(places[1].min(), places[1].max())
    if across.is_angle:
        style.unwrapped_axis(axes, "x", shown, across.name)
    if up.is_angle:
        style.unwrapped_axis(axes, "y", shown, up.name)
    axes.set(xlabel=across.text, ylabel=up.text)
    if sel:
        values = [labels.value(ds[f"state_{name}"].rename(name), shown) for name in sel]
        axes.set_title(", ".join(values), size="medium")
    if legend:
        style.legend_below(axes, handles)
    return axes


def _plane(ds: xr.Dataset, x: Any, y: Any, sel: Mapping[str, Any]) -> tuple[str, str]:
    """The states on both axes, where the others are selected."""
    offered = [str(dim).removeprefix("state_") for dim in ds.basin.dims]
    for name, value in sel.items():
        if name not in offered:
            raise unknown("state of the grid", name, offered)
        number(name, value, f"one value of {name}")
    left = [name for name in offered if name not in sel]
    for argument, name in (("x", x), ("y", y)):
        if name is not None and name not in left:
            raise unknown(argument, name, left)
    if x is not None and x == y:
        raise bad("y", y, f"the state that is not on x: one of {', '.join(left)}")
    if len(left) != 2:
        wants = "two; give the others values" if len(left) > 2 else "two"
        example = f", as in {left[-1]}=0.0" if len(left) > 2 else ""
        raise ParameterError(
            f"dataset: got basins over the states {', '.join(left)}, wants {wants}{example}"
        )
    if x is None and y is None:
        x, y = left
    x = next(name for name in left if name != y) if x is None else x
    return x, next(name for name in left if name != x)


def _axes_of(ds: xr.Dataset, names: Sequence[str], units: Units) -> tuple[StateAxis, StateAxis]:
    """How both states are shown."""
    coordinate = ds.attrs.get("phasekit_coordinate")
    angles = [ds[f"attractor_{name}"].attrs.get("units") == "rad" for name in names]
    bare = coordinate is not None and not any(angles) and set(names) == {"phi", "dphi"}
    if units.angles != "rad" and not any(angles):
        wants = "'rad' for a coordinate that is not an angle of period 2 pi"
        raise bad("angles", units.angles, wants)
    own = {"phi": str(coordinate), "dphi": f"d{coordinate}"} if bare else {}
    every = [str(name).removeprefix("state_") for name in ds.coords if str(name)[:6] == "state_"]
    symbols = dict(
        zip(every, state_symbols([own.get(name, name) for name in every])[0], strict=True)
    )
    found = []
    for name, is_angle in zip(names, angles, strict=True):
        held = "" if bare else str(ds[f"state_{name}"].attrs.get("units", ""))
        period = ds[f"state_{name}"].attrs.get("period", TURN if is_angle else None)
        text = labels.with_unit(f"${symbols[name]}$", units.text(name, held))
        found.append(StateAxis(name, text, units.scale(name, held), period, is_angle))
    return found[0], found[1]


def _colors(count: int) -> list[Any]:
    """A color for each attractor; many have those of a scale."""
    if count <= len(COLORS):
        return list(COLORS[:count])
    return list(plt.colormaps["cividis"](np.linspace(0.97, 0.1, count)))


def _draw_attractor(axes: Axes, points: xr.Dataset, pair: Sequence[StateAxis], color: Any) -> None:
    """Draw an attractor where it is seen: a cycle as a line in its color, others as points."""
    ink: style.Look = {"color": style.BLACK, "zorder": 3}
    seen = [points[f"attractor_{axis.name}"].values for axis in pair]
    keep = np.isfinite(seen[0]) & np.isfinite(seen[1])
    seen = [values[keep] for values in seen]
    if _is_loop(points):
        seen = [np.append(values, values[:1]) for values in seen]
        for i, axis in enumerate(pair):
            if axis.period is not None:  # a step of half a turn is one across the cut
                jump = np.abs(np.diff(seen[i], append=seen[i][-1:])) > 0.5 * axis.period
                seen = [np.where(jump, np.nan, values) for values in seen]
    for i, axis in enumerate(pair):
        if axis.period is not None and seen[i].size:
            grid = points[f"state_{axis.name}"].values
            seen[i], seen[1 - i] = _copies(seen[i], seen[1 - i], grid, axis.period)
    shown = [axis.shown(values) for axis, values in zip(pair, seen, strict=True)]
    if _is_loop(points):
        edge = style.halo(style.BLACK, 3.4)
        axes.plot(*shown, linewidth=1.4, path_effects=edge, **ink | {"color": color})
        return
    look = REST | EDGE if keep.sum() <= 64 and _repeats(points) else SET
    axes.plot(*shown, ls="none", **ink, **look)


def _copies(x: Array, other: Array, seen: Array, turn: float) -> tuple[Array, Array]:
    """Points on a circle wherever they are among the angles that are seen."""
    first = int(np.ceil((seen.min() - np.nanmax(x)) / turn))
    last = int(np.floor((seen.max() - np.nanmin(x)) / turn))
    turns = range(first, last + 1)
    return (
        np.concatenate([x + k * turn for k in turns] or [x]),
        np.concatenate([other for _ in turns] or [other]),
    )


def _repeats(points: xr.Dataset) -> bool:
    return bool(points.attractor_period > 0) or _kind(points) is AttractorKind.EQUILIBRIUM


def _kind(points: xr.Dataset) -> AttractorKind:
    return AttractorKind(int(points.attractor_kind.item()))


def _is_loop(points: xr.Dataset) -> bool:
    """Whether it is a closed orbit, seen all along: that of a flow that does not vary."""
    closed = points.attractor_period.dtype.kind == "f" and bool(points.attractor_period > 0)
    return closed and _kind(points) is not AttractorKind.EQUILIBRIUM


def _words(ds: xr.Dataset) -> str:
    """What the points of attractors are."""
    if ds.attractor_period.dtype.kind == "f":
        return "attractor"
    is_map = '"map": true' in str(ds.attrs.get("phasekit_problem", ""))
    return "attractor" if is_map else "attractor, once a period"


def _name(points: xr.Dataset, pair: Sequence[StateAxis]) -> str:
    q = points.attractor_period.item()
    if not _repeats(points):
        kind = _kind(points)
        known = {AttractorKind.CHAOTIC: "chaotic", AttractorKind.TORUS: "torus"}
        return known.get(kind, "never repeats itself")
    if _is_loop(points):
        return f"cycle of period {q:.4g}"
    first, second = (
        axis.shown(points[f"attractor_{axis.name}"].values[:1])[0] for axis in pair
    )  # fmt: skip
    place = f"at {first:.3g}" if pair[1].name == f"d{pair[0].name}" else (
        f"at ({_short(first)}, {_short(second)})"
    )  # fmt: skip
    return place if q <= 1 else f"{place}, {int(q)} periods"


def _short(value: float) -> str:
    """Three digits, without noise about zero."""
    return f"{0.0 if abs(value) < 1e-9 else value:.3g}"


def _odds(ds: xr.Dataset, capture: xr.Dataset) -> dict[int, float]:
    """Predicted odds of the attractors: of one on either side of the lower saddle."""
    odds: Any = labels.dataset(capture, "capture", ("capture_probability",), "pk.capture")
    if "attractor_rotation" not in ds or "attractor_phi" not in ds:
        raise bad("capture", capture, "None for a system with states of its own")
    still = np.flatnonzero((ds.attractor_period == 1) & (np.abs(ds.attractor_rotation) == 0))
    phi = ds.attractor_phi.values[still, 0]
    if odds.capture_probability.ndim != 1 or len(still) != 2:
        return {}
    left, right = still[np.argsort(phi)]
    regions = odds.capture_probability
    return {
        int(left): float(regions.sel(region="left")),
        int(right): float(regions.sel(region="right")),
    }
