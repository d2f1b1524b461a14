"""Nullclines of a planar flow."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
import xarray as xr
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.lines import Line2D

from phasekit.errors import ParameterError
from phasekit.labelled.nullclines import nullclines as found_nullclines
from phasekit.labels.arguments import call_checked
from phasekit.plot.parts import style
from phasekit.plot.parts.units import Units, state_symbols

#: A look for each state.
LOOKS: tuple[style.Look, ...] = (
    {"color": style.BLUE, "linestyle": "-", "linewidth": 1.8},
    {"color": style.VERMILLION, "linestyle": (0, (5, 1.5)), "linewidth": 1.8},
)


@call_checked
def nullclines(
    system: Any, *, window: Any = None, units: Mapping[str, str] | None = None, legend: bool = True,
    ax: Axes | None = None,
) -> Axes:  # fmt: skip
    r"""Draw the curves of a planar flow on which one of its states does not change.

    They meet in the equilibria.

    Parameters
    ----------
    system : Problem, system that states rates, or xarray.Dataset
        One flow of two states, or what `nullclines` returns for it.
    window : mapping of str to (float, float), optional
        Of a system: where to look; by default its window.
    units : mapping of str to str, optional
        Units in which states are shown, by name.
    legend : bool
        Whether to say under the axes which curve is which.

    Examples
    --------
    >>> import phasekit as pk
    >>> nerve = pk.Problem(
    ...     {"v": "v - v^3/3 - w + I", "w": "v + 0.7 - 0.8*w"}, parameters={"I": 0.5},
    ...     window={"v": (-2.5, 2.5), "w": (-1, 2)},
    ... )
    >>> ax = pk.plot.nullclines(nerve)
    >>> [text.get_text() for text in ax.get_legend().get_texts()]
    ['$\\dot v = 0$', '$\\dot w = 0$']
    """
    ds = system if isinstance(system, xr.Dataset) else found_nullclines(system, window)
    names = [
        str(name).removeprefix("nullcline_")
        for name in ds.data_vars
        if str(name).startswith("nullcline_") and name != "nullcline_of"
    ]
    if "nullcline_of" not in ds or len(names) != 2:
        raise ParameterError(
            "system: got a Dataset without nullclines, wants a flow of two states, or what "
            "pk.nullclines returns for one"
        )
    ds = ds.rename({f"nullcline_{name}": name for name in names})
    ds, shown = Units.of_dataset(ds, "rad", units)
    axes, handles = style.axes_for(ax, legend=legend), list[Artist]()
    own_units = [str(ds[name].attrs.get("units", "1")) for name in names]
    scales = [shown.scale(name, unit) for name, unit in zip(names, own_units, strict=True)]
    states, rates = state_symbols(names)
    for name, rate, look in zip(names, rates, LOOKS, strict=True):
        for row in np.flatnonzero(ds.nullcline_of.values == name):
            curve = [ds[own].values[row] for own in names]
            axes.plot(*(s * part for s, part in zip(scales, curve, strict=True)), **look)
        if np.any(ds.nullcline_of.values == name):
            handles.append(Line2D([], [], label=f"${rate} = 0$", **look))
    for which, name, symbol, unit in zip("xy", names, states, own_units, strict=True):
        text = f"${symbol}$" + (f" ({shown.text(name, unit)})" if unit not in ("", "1") else "")
        axes.set(**{f"{which}label": text})
    if legend:
        style.legend_below(axes, handles)
    return axes
