"""A center that follows slow parameters, over one of them, with its jumps."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
import xarray as xr
from matplotlib.axes import Axes

from phasekit.errors import ParameterError
from phasekit.inputs import call_checked
from phasekit.labels.arguments import bad, describe, unknown
from phasekit.plot.parts import labels, style
from phasekit.plot.parts.units import Angles, Units

STEP = "step"


@call_checked
def hysteresis_loop(
    dataset: xr.Dataset,
    x: str | xr.DataArray | None = None,
    y: str | xr.DataArray = "phi",
    *,
    angles: Angles = "rad",
    units: Mapping[str, str] | None = None,
    ax: Axes | None = None,
) -> Axes:
    r"""Draw a quantity that follows slow parameters: a hysteresis loop or a slow run-up.

    The curve is broken where the center jumps; a dashed line leads from the last step before a jump
    to the first one after it, with an arrow in the direction of the jump.

    Parameters
    ----------
    dataset : xarray.Dataset
        What `quasi_static` returns.
    x : str or xarray.DataArray, optional
        The parameter along the axis, or numbers for each step (the field, say, of two components);
        left out, the first parameter of the path.
    y : str or xarray.DataArray
        The quantity that is drawn, or numbers for each step, which are drawn as they are:
        ``np.cos(loop.phi)`` is the magnetisation along the easy axis.
    units : mapping of str to str, optional
        Units in which quantities and parameters are shown, by name: ``{"omega1": "rpm"}``.

    Examples
    --------
    >>> import numpy as np
    >>> import phasekit as pk
    >>> magnet = pk.StonerWohlfarth(K=1.0, h_x=0.0, h_y=0.5)
    >>> field = np.concatenate([np.linspace(3, -3, 200), np.linspace(-3, 3, 200)])
    >>> loop = pk.quasi_static(magnet, h_x=field)
    >>> ax = pk.plot.hysteresis_loop(loop, y=np.cos(loop.phi))
    >>> len(ax.texts)  # arrows of the jumps
    2
    """
    ds = labels.dataset(dataset, "dataset", ("phi", "jumped"), "pk.quasi_static")
    ds, shown = Units.of_dataset(ds, angles, units)
    path = [str(name) for name in ds.coords if ds[name].dims == (STEP,) and name != STEP]
    drawable = [*path, *(str(n) for n, v in ds.data_vars.items() if v.dims == (STEP,))]
    if not path:
        raise ParameterError("dataset: got no parameter along 'step', wants one of pk.quasi_static")
    across = _values(ds, "x", path[0] if x is None else x, drawable)
    up = _values(ds, "y", y, drawable)
    axes = style.axes_for(ax, legend=False)
    (xs, _), (ys, _) = (labels.shown(values, shown) for values in (across, up))
    edges = np.flatnonzero(ds["jumped"].values)
    for piece in np.split(np.arange(xs.size), edges):
        axes.plot(xs[piece], ys[piece], **style.MOTION)
    for k in edges:
        axes.plot(xs[k - 1 : k + 1], ys[k - 1 : k + 1], **{**style.MOTION, "linestyle": "--"})
        _arrow(axes, xs[k - 1 : k + 1], ys[k - 1 : k + 1])
    axes.set_xlabel(_label(across, shown, style.letters(axes, "x")))
    axes.set_ylabel(_label(up, shown, style.letters(axes, "y")))
    return axes


def _values(ds: xr.Dataset, argument: str, given: Any, names: list[str]) -> xr.DataArray:
    if isinstance(given, xr.DataArray):
        if given.dims != (STEP,) or given.size != ds.sizes[STEP]:
            raise bad(argument, given, f"a number for each of {ds.sizes[STEP]} steps")
        return given.drop_attrs().rename(None)  # of what it was computed from
    if not isinstance(given, str):
        raise bad(argument, describe(given), "the name of a variable, or a DataArray on 'step'")
    if given not in names:
        raise unknown(argument, given, names)
    return ds[given]


def _label(values: xr.DataArray, shown: Units, letters: int) -> str:
    """What an axis shows; numbers that somebody computed have no name."""
    return "" if values.name is None else labels.label(values, shown, letters)


def _arrow(axes: Axes, xs: Any, ys: Any) -> None:
    """Point an arrow along a jump, in its middle."""
    tail, head = ((xs[0] + s * (xs[1] - xs[0]), ys[0] + s * (ys[1] - ys[0])) for s in (0.45, 0.55))
    look = {"arrowstyle": "-|>", "color": style.MOTION["color"], "shrinkA": 0, "shrinkB": 0}
    axes.annotate("", head, tail, arrowprops=look)
