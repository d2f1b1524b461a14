"""Maps of Lyapunov exponents over two swept parameters."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import matplotlib.pyplot as plt
import numpy as np
import xarray as xr
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.colors import LinearSegmentedColormap, ListedColormap, Normalize, TwoSlopeNorm
from matplotlib.patches import Patch
from matplotlib.ticker import MaxNLocator
from numpy.typing import NDArray

from phasekit.inputs import call_checked
from phasekit.labels.arguments import bad, flag, whole
from phasekit.plot.parameter_map import axes_of, parameter_map, selected_in
from phasekit.plot.parts import labels, style
from phasekit.plot.parts.units import Units

EXPONENT, ERROR = "lyapunov_exponent", "lyapunov_error"
#: Colors below and above zero; the lightness falls throughout, and jumps at zero.
CALM = LinearSegmentedColormap.from_list("calm", ("#F7FBFF", "#C9E1F2", "#7DB8DA"))
CHAOS = LinearSegmentedColormap.from_list("chaos", ("#D55E00", "#8C2D04", "#2A0A00"))
BOTH = ListedColormap(
    np.concatenate([CALM(np.linspace(0, 1, 128)), CHAOS(np.linspace(0, 1, 128))]), "exponents"
)
HATCH = "xxxx"


@call_checked
def lyapunov_map(
    dataset: xr.Dataset,
    exponent: int = 1,
    *,
    x: str | None = None,
    y: str | None = None,
    units: Mapping[str, str] | None = None,
    legend: bool = True,
    ax: Axes | None = None,
    **sel: Any,
) -> Axes:
    r"""Draw a Lyapunov exponent over two swept parameters, by its sign.

    Negative exponents are light, positive ones dark, also in gray print. Cells whose exponent is
    within its error of zero are hatched: nothing is said of their sign.

    Parameters
    ----------
    dataset : xarray.Dataset
        What `sweep` with ``of="lyapunov"``, or `lyapunov` of arrays of parameters returns.
    exponent : int, default 1
        Which exponent, where there are several; 1 is the largest.
    x, y : str, optional
        The parameters on the axes; left out, the first two that are swept, in their order.
    units : mapping of str to str, optional
        Units in which the exponent and parameters are shown, by name.
    legend : bool
        Whether to explain what is hatched or absent under the axes.
    ax : matplotlib.axes.Axes, optional
        Where to draw; a new figure if left out. The color bar takes its room from it.
    **sel
        Values along other dims, of which the nearest are taken.

    Raises
    ------
    ParameterError
        If an argument is unusable, or dims other than two are left.

    Notes
    -----
    Exponents are those of [BenettinGalganiGiorgilliStrelcyn1980], with the errors of `lyapunov`.

    Examples
    --------
    >>> import numpy as np
    >>> import phasekit as pk
    >>> henon = pk.Problem({"x": "1 - a*x^2 + y", "y": "b*x"}, parameters={"a": 1.4, "b": 0.3},
    ...                    map=True)
    >>> ds = pk.sweep(henon, a=np.linspace(0.9, 1.2, 8), b=np.linspace(0.1, 0.3, 6),
    ...               of="lyapunov", x=0.1, y=0.1, n=500)
    >>> ax = pk.plot.lyapunov_map(ds)
    >>> ax.get_xlabel()
    '$a$'
    """
    ds = labels.dataset(dataset, "dataset", (EXPONENT,), "pk.sweep(..., of='lyapunov')")
    flag("legend", legend)
    keep = [name for name in (EXPONENT, ERROR) if name in ds]
    ds = ds[keep]
    if "exponent" in ds[EXPONENT].dims:
        wants = f"a number from 1 to {ds.sizes['exponent']}"
        number = whole("exponent", exponent, wants, 1)
        if number not in ds["exponent"].values:
            raise bad("exponent", exponent, wants)
        ds = ds.sel(exponent=number, drop=True)
    elif whole("exponent", exponent, "1, the only one", 1) != 1:
        raise bad("exponent", exponent, "1, the only one")
    axes = style.axes_for(ax, legend=legend)
    parameter_map(ds, EXPONENT, x=x, y=y, units=units, legend=False, ax=axes, **sel)
    chosen, shown = Units.of_dataset(selected_in(ds, EXPONENT, sel), "rad", units)
    across, up = axes_of(chosen[EXPONENT], x, y)
    chosen = chosen.transpose(up.dims[0], across.dims[0])
    handles = list[Artist]()
    if axes.collections:
        mesh: Any = axes.collections[0]
        colors, norm = _colors(mesh.norm.vmin, mesh.norm.vmax)
        mesh.set(cmap=colors, norm=norm)
        if isinstance(norm, TwoSlopeNorm):
            mesh.colorbar.set_ticks(_ticks(*mesh.get_clim()))
    if ERROR in chosen:
        unsure = np.abs(chosen[EXPONENT].values) <= chosen[ERROR].values
        handles += _hatched(axes, [labels.shown(one, shown)[0] for one in (across, up)], unsure)
    if np.isnan(chosen[EXPONENT].values).any():
        handles.append(Patch(facecolor=style.NOTHING, edgecolor=style.GRAY, label="absent"))
    if legend:
        style.legend_below(axes, handles)
    return axes


def _hatched(axes: Axes, grid: Sequence[NDArray[Any]], where: NDArray[np.bool_]) -> list[Artist]:
    """Hatch the cells of a map that are within their errors of zero."""
    if not where.any():
        return []
    with plt.rc_context({"hatch.color": style.GRAY, "hatch.linewidth": 0.7}):
        edges = [_edges(along) for along in grid]
        cells = np.ma.masked_where(~where, np.ones(where.shape))
        axes.pcolor(*edges, cells, cmap=ListedColormap([(0, 0, 0, 0)]), hatch=HATCH, linewidth=0.0)
        return [
            Patch(facecolor="none", edgecolor=style.GRAY, hatch=HATCH, label="0 within its error")
        ]


def _ticks(low: float, high: float) -> list[float]:
    """Round numbers on both sides of zero, of which each has its own scale."""
    below, above = (MaxNLocator(3).tick_values(*ends) for ends in ((low, 0.0), (0.0, high)))
    return [float(x) for x in (*below, *above[1:]) if low <= x <= high]


def _edges(along: NDArray[Any]) -> NDArray[Any]:
    """Edges of the cells about points of an axis."""
    middle = 0.5 * (along[1:] + along[:-1])
    return np.concatenate([[2 * along[0] - middle[0]], middle, [2 * along[-1] - middle[-1]]])


def _colors(low: float, high: float) -> tuple[Any, Normalize]:
    """Colors of exponents, and how values go to them."""
    if low >= 0.0:
        return CHAOS, Normalize(low, high)
    if high <= 0.0:
        return CALM, Normalize(low, high)
    return BOTH, TwoSlopeNorm(0.0, low, high)
