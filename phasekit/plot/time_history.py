"""Motions over time."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
import xarray as xr
from matplotlib.artist import Artist
from matplotlib.axes import Axes

from phasekit.errors import ParameterError
from phasekit.inputs import call_checked
from phasekit.labels.arguments import flag, named
from phasekit.plot.parts import labels, strokes, style
from phasekit.plot.parts.units import Units, coordinate_symbol

TIME = "time"
SYMBOLS = {"motion_phi": r"$\varphi$", "motion_dphi": r"$\dot\varphi$"}
# Beyond this number the looks of orbits begin again.
MOST = len(style.ORBIT_COLORS) * len(style.ORBIT_DASHES)


@call_checked
def time_history(
    dataset: xr.Dataset,
    variable: str | None = None,
    *,
    angles: style.Angles = "rad",
    units: Mapping[str, str] | None = None,
    legend: bool = True,
    ax: Axes | None = None,
) -> Axes:
    r"""Draw one motion or several over time.

    Angles are continuous in time: they are not wrapped when the motion turns over.

    Parameters
    ----------
    dataset : xarray.Dataset
        What `flow` or `separatrix_motion` returns for times along the dim ``time``, of a map for
        counts of iterations. Along other dims there are several motions, of which each gets a line.
    variable : str, optional
        The quantity to draw: motion_phi, motion_dphi, ``motion_`` and the name of a state, or any
        other number along ``time``; by default the first state.
    angles : {"rad", "deg"}
        Unit in which angles and angular velocities are shown.
    units : mapping of str to str, optional
        Units in which quantities and parameters are shown, by name: ``{"time": "ms"}``.
    legend : bool
        Whether to name the motions under the axes, if there are several.
        A given figure without layout engine gets the constrained one then.

    Raises
    ------
    ParameterError
        If an argument is unusable, or there are more motions than can be told apart.

    Notes
    -----
    Those of a system in a potential are the motions of [Veljovic2015] eq. (12), in closed form.
    Where the states have no units, the time is shown without one.

    Examples
    --------
    Angle over angular velocity, of two motions:

    >>> import matplotlib.pyplot as plt
    >>> import numpy as np
    >>> import phasekit as pk
    >>> system = pk.Coefficients(4.0, 1.0, 0.5)
    >>> ds = pk.flow(system, [0.6, 1.9], 0.0, np.linspace(0.0, 20.0, 401))
    >>> figure, (over, under) = plt.subplots(2, sharex=True)
    >>> ax = pk.plot.time_history(ds, legend=False, ax=over)
    >>> ax = pk.plot.time_history(ds, "motion_dphi", ax=under)
    >>> ax.get_ylabel()
    '$\\dot\\varphi$ (rad/s)'
    """
    ds = labels.dataset(dataset, "dataset", (), "pk.flow")
    ds, shown = Units.of_dataset(ds, angles, units)
    offered = _drawable(ds)
    if not offered:
        raise ParameterError(
            "dataset: got a Dataset without numbers along the dim 'time', wants motions over "
            "time, for example pk.flow(system, 0.5, 0.0, np.linspace(0.0, 10.0, 201))"
        )
    if variable is None:
        variable = next((name for name in offered if name.startswith("motion_")), offered[0])
    named("variable", variable, offered)
    flag("legend", legend)
    times = ds[TIME]
    labels.monotone(times, "time")
    motions = motions_of(ds[variable], str(times.dims[0]), shown)
    axes = style.axes_for(ax, legend=legend and len(motions) > 1)

    held = str(ds[variable].attrs.get("units", ""))
    stretch, pace = shown.scale(variable, held), shown.scale(TIME, "s")
    counted = str(times.attrs.get("units", "")) == "1"
    handles: list[Artist] = []
    for number, (name, motion) in enumerate(motions.items()):
        look = strokes.orbit_look(number) if len(motions) > 1 else style.MOTION
        if counted:  # nothing is between two iterations
            look = {**look, "marker": ".", "markersize": 5, "linewidth": 0.6}
        handles += axes.plot(times.values * pace, motion.values * stretch, label=name, **look)
    if held == "rad":
        style.unwrapped_axis(axes, "y", shown, variable)
    axes.set_xlim(*sorted((float(times[0]) * pace, float(times[-1]) * pace)))
    clock = "" if held in ("", "1") and variable not in SYMBOLS else f" ({shown.text(TIME, 's')})"
    axes.set_xlabel("iteration" if counted else f"$t${clock}")
    axes.set_ylabel(_label(ds[variable], shown, style.letters(axes, "y")))
    if legend and len(motions) > 1:
        style.legend_below(axes, handles)
    return axes


def _drawable(ds: xr.Dataset) -> list[str]:
    """Return the quantities that are numbers along time."""
    return [
        str(name)
        for name, values in ds.data_vars.items()
        if TIME in values.coords and values[TIME].ndim == 1 and values.dtype.kind == "f"
    ]


def motions_of(values: xr.DataArray, along: str, units: Units) -> dict[str, xr.DataArray]:
    """Return the motions one by one, under what tells each from the others."""
    dims = [str(dim) for dim in values.dims if dim != along]
    count = int(np.prod([values.sizes[dim] for dim in dims], dtype=int))
    if not 0 < count <= MOST:
        size = ", ".join(f"{dim}: {values.sizes[dim]}" for dim in dims)
        raise ParameterError(
            f"dataset: got {count} motions ({size}), wants from 1 to {MOST}; "
            f"select some first, for example ds.isel({dims[0]}=slice(None, None, 5))"
        )
    cells = [
        dict(zip(dims, cell, strict=True))
        for cell in np.ndindex(*(values.sizes[dim] for dim in dims))
    ]
    # A coordinate that is the same for all motions tells none of them.
    telling = [
        coord
        for coord in values.coords.values()
        if along not in coord.dims and (coord.values != coord.values.flat[0]).any()
    ]
    names = [
        ", ".join(
            labels.value(coord.isel({dim: cell[str(dim)] for dim in coord.dims}), units)
            for coord in telling
        )
        for cell in cells
    ]
    if len(set(names)) < count:
        names = [", ".join(f"{dim} {place}" for dim, place in cell.items()) for cell in cells]
    return {name: values.isel(cell) for name, cell in zip(names, cells, strict=True)}


def _label(values: xr.DataArray, units: Units, width: int) -> str:
    name, held = str(values.name), str(values.attrs.get("units", ""))
    if name in SYMBOLS:
        return labels.with_unit(SYMBOLS[name], units.text(name, held))
    if name.startswith("motion_"):
        symbol = f"${coordinate_symbol(name.removeprefix('motion_'))}$"
        return symbol if held in ("", "1") else labels.with_unit(symbol, units.text(name, held))
    return labels.label(values, units, width)
