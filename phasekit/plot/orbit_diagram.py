"""Orbit diagrams: what motions do in the end over a parameter."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
import xarray as xr
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.lines import Line2D
from numpy.typing import NDArray

from phasekit.errors import ParameterError
from phasekit.inputs import call_checked
from phasekit.labels.arguments import flag, unknown
from phasekit.plot.parts import labels, style
from phasekit.plot.parts.units import SYMBOLS, Units

#: Looks of samples at rising and at falling values, and of these in the legend.
RISING: style.Look = {"color": style.BLACK, "marker": "o", "markeredgewidth": 0.0}
FALLING: style.Look = {"color": style.VERMILLION, "marker": "s", "markeredgewidth": 0.0}
#: Sizes of points, where these are few and where they are many, in points.
GREATEST, LEAST = 3.5, 0.8
SAMPLE = "sample_"


@call_checked
def orbit_diagram(
    dataset: xr.Dataset,
    variable: str | None = None,
    *,
    units: Mapping[str, str] | None = None,
    legend: bool = True,
    ax: Axes | None = None,
) -> Axes:
    r"""Draw an orbit diagram: samples of motions over the parameter.

    Where the values of the parameter rise and fall, both directions have their looks.

    Parameters
    ----------
    dataset : xarray.Dataset
        What `phasekit.orbit_diagram` returns.
    variable : str, optional
        The state to draw, ``"x"`` or ``"sample_x"``; by default the first.
    units : mapping of str to str, optional
        Units in which states and the parameter are shown, by name.
    legend : bool
        Whether to say under the axes which way the parameter went, if it went both.

    Examples
    --------
    >>> import numpy as np
    >>> import phasekit as pk
    >>> logistic = pk.Problem("r*x*(1 - x)", "x", {"r": 3.0}, map=True, window={"x": (0, 1)})
    >>> ds = pk.orbit_diagram(logistic, "r", np.linspace(2.8, 4.0, 200), n=64)
    >>> ax = pk.plot.orbit_diagram(ds)
    >>> ax.get_xlabel(), ax.get_ylabel()
    ('$r$', 'x after transients')
    """
    ds = labels.dataset(dataset, "dataset", ("sample",), "pk.orbit_diagram")
    flag("legend", legend)
    offered = [str(name) for name in ds.data_vars if str(name).startswith(SAMPLE)]
    if not offered:
        raise ParameterError(
            "dataset: got a Dataset without samples, wants what pk.orbit_diagram returns"
        )
    states = [name.removeprefix(SAMPLE) for name in offered]
    name = offered[0] if variable is None else variable
    if name not in (*offered, *states):
        raise unknown("variable", name, states)
    name = name if name in offered else f"{SAMPLE}{name}"
    own = {f"{SAMPLE}{state}": state for state in states}  # units go by the names of states
    ds, shown = Units.of_dataset(ds.rename(own), "rad", units)
    samples = ds[own[name]]
    dims = [str(dim) for dim in samples.dims if dim != "sample"]
    if len(dims) != 1:
        raise ParameterError(
            f"dataset: got samples over {', '.join(dims) or 'no parameter'}, wants one parameter; "
            "select the others with ds.sel(...)"
        )
    across = ds[dims[0]]
    rows = samples.transpose(dims[0], "sample").values
    ways = _ways(across.values)
    both = len({way for way, _ in ways}) > 1
    axes = style.axes_for(ax, legend=legend and both)
    x = labels.shown(across, shown)[0]
    y = rows * shown.scale(own[name], str(samples.attrs.get("units", "")))
    size = _size(axes, y)
    handles: list[Artist] = []
    for rises, part in ways:
        look = style.inked(RISING) if rises else FALLING
        where = np.broadcast_to(x[part][:, None], y[part].shape)
        axes.plot(
            where.ravel(), y[part].ravel(), linestyle="none", rasterized=True,
            **{**look, "markersize": size if rises else 0.8 * size},
        )  # fmt: skip
        text = f"{_short(across)} {'rising' if rises else 'falling'}"
        if both and text not in [str(one.get_label()) for one in handles]:
            handles.append(Line2D([], [], linestyle="none", label=text, markersize=5, **look))
    if np.isfinite(x).all() and np.ptp(x) > 0.0:
        axes.set_xlim(x.min(), x.max())
    axes.set_xlabel(labels.label(across, shown, style.letters(axes, "x")))
    axes.set_ylabel(labels.label(samples, shown, style.letters(axes, "y")))
    if legend and both:
        style.legend_below(axes, handles)
    return axes


def _short(across: xr.DataArray) -> str:
    return SYMBOLS.get(str(across.name), str(across.name).replace("_", " "))


def _ways(values: NDArray[np.float64]) -> list[tuple[bool, slice]]:
    """The parts in which a parameter rises, or falls, one after the other."""
    found, start = list[tuple[bool, slice]](), 0
    steps = np.sign(np.diff(values))
    for k in range(1, len(steps)):
        before = next((s for s in steps[k - 1 :: -1] if s != 0.0), 0.0)
        if before and steps[k] and steps[k] != before:
            cut = k + int(steps[k - 1] != 0.0)  # of equal values the last begins the way back
            found.append((before > 0.0, slice(start, cut)))
            start = cut
    turns = [s for s in steps[start:] if s != 0.0]
    return [*found, (not turns or turns[-1] > 0.0, slice(start, len(values)))]


def _size(axes: Axes, y: NDArray[np.float64]) -> float:
    """Size of points: the smaller, the more there are in an axes of this size."""
    width, height = style.inches(axes)
    room = 72.0 * np.sqrt(width * height / max(np.isfinite(y).sum(), 1))
    return float(np.clip(0.5 * room, LEAST, GREATEST))
