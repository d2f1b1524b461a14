"""Spectra of motions: lines over frequency, and waterfalls over a swept parameter."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
import xarray as xr
from matplotlib.artist import Artist
from matplotlib.axes import Axes

from phasekit.errors import ParameterError
from phasekit.inputs import call_checked
from phasekit.labels.arguments import bad, flag, number, unknown
from phasekit.plot.parameter_map import parameter_map
from phasekit.plot.parts import labels, strokes, style
from phasekit.plot.parts.units import Units
from phasekit.plot.time_history import motions_of

AXES = ("frequency", "harmonic")
#: Part of the greatest amplitude down to which colors tell amplitudes apart.
DEPTH = 1e-5
KINDS = ("amplitude_", "density_")


@call_checked
def spectrum(
    dataset: xr.Dataset,
    variable: str | None = None,
    *,
    log: bool = True,
    highest: float | None = None,
    units: Mapping[str, str] | None = None,
    legend: bool = True,
    ax: Axes | None = None,
) -> Axes:
    r"""Draw a spectrum, or several, over the frequency.

    Amplitudes of harmonics are stems, others are lines.

    Parameters
    ----------
    dataset : xarray.Dataset
        What `phasekit.spectrum` returns. Along other dims there are several spectra, of which each
        gets a line.
    variable : str, optional
        What to draw, such as ``"amplitude_x"``; by default the first.
    log : bool, default True
        Whether the amplitude has a logarithmic scale.
    highest : float, optional
        The highest frequency shown, in its own unit.
    units : mapping of str to str, optional
        Units in which quantities and parameters are shown, by name: ``{"frequency": "rpm"}``.
    legend : bool
        Whether to name the spectra under the axes, if there are several.

    Raises
    ------
    ParameterError
        If an argument is unusable, or there are more spectra than can be told apart.

    Notes
    -----
    The amplitudes are those of cosines, ``x = sum of a cos(w t + p)`` [Harris1978].

    Examples
    --------
    >>> import numpy as np
    >>> import phasekit as pk
    >>> oscillator = pk.Problem(["y", "2*(1 - x^2)*y - x"], ("x", "y"), start={"x": 2.0, "y": 0.0})
    >>> motion = pk.flow(oscillator, t=np.arange(50.0, 250.0, 0.05))
    >>> ax = pk.plot.spectrum(pk.spectrum(motion), "amplitude_x", highest=8.0)
    >>> ax.get_ylabel()
    'amplitude of x'
    """
    ds, name, along = _chosen(dataset, variable)
    flag("log", log)
    flag("legend", legend)
    ds, shown = Units.of_dataset(ds, "rad", units)
    held = str(ds["frequency"].attrs.get("units", ""))
    pace = shown.scale("frequency", held)
    lines = motions_of(ds[name], along, shown)
    axes = style.axes_for(ax, legend=legend and len(lines) > 1)
    stretch = shown.scale(name, str(ds[name].attrs.get("units", "")))
    handles: list[Artist] = []
    limit = np.inf if highest is None else number("highest", highest, "a number > 0", held)
    if not limit > 0.0:
        raise bad("highest", highest, "a number > 0")
    top, low = 0.0, np.inf
    for count, (text, line) in enumerate(lines.items()):
        look = strokes.orbit_look(count) if len(lines) > 1 else style.MOTION
        w, a = line["frequency"].values * pace, line.values * stretch
        seen = (line["frequency"].values <= limit) & np.isfinite(a) & ((a > 0.0) | (not log))
        seen &= (line["frequency"].values > 0.0) | (not log)
        if seen.any():
            top, low = max(top, float(a[seen].max())), min(low, float(a[seen].min()))
        if along == "harmonic":
            base = 0.0 if not log else np.finfo(float).tiny
            axes.vlines(w[seen], base, a[seen], color=look.get("color"), linewidth=1.0)
            handles += axes.plot(
                w[seen], a[seen], "o", markersize=4.0, color=look.get("color"), label=text
            )
        else:
            handles += axes.plot(w[seen], a[seen], label=text, **look)
    if log and top > 0.0:
        axes.set_yscale("log")
        axes.set_ylim(max(0.5 * low, 1e-12 * top), 2.0 * top)
    elif not log:
        axes.set_ylim(bottom=0.0)
    if np.isfinite(limit):
        axes.set_xlim(0.0, limit * pace)
    axes.set_xlabel(labels.label(ds["frequency"], shown, style.letters(axes, "x")))
    axes.set_ylabel(labels.label(ds[name], shown, style.letters(axes, "y")))
    if legend and len(lines) > 1:
        style.legend_below(axes, handles)
    return axes


@call_checked
def waterfall(
    dataset: xr.Dataset,
    variable: str | None = None,
    *,
    log: bool = True,
    highest: float | None = None,
    units: Mapping[str, str] | None = None,
    ax: Axes | None = None,
) -> Axes:
    r"""Draw spectra over a swept parameter as colors: the frequency across, the parameter up.

    Parameters
    ----------
    dataset : xarray.Dataset
        What `phasekit.spectrum` returns for motions over one swept parameter.
    variable : str, optional
        What to draw, such as ``"amplitude_x"``; by default the first.
    log : bool, default True
        Whether the colors have a logarithmic scale; it ends at 1e-5 of the greatest.
    highest : float, optional
        The highest frequency shown, in its own unit.
    units : mapping of str to str, optional
        Units in which quantities and parameters are shown, by name.

    Raises
    ------
    ParameterError
        If an argument is unusable, or the spectra are not along one parameter.

    Notes
    -----
    The amplitudes are those of cosines, ``x = sum of a cos(w t + p)`` [Harris1978].

    Examples
    --------
    >>> import numpy as np
    >>> import phasekit as pk
    >>> driven = pk.Problem(
    ...     ["v", "cos(w*t) - 0.1*v - x - x^3"], ("x", "v"), {"w": np.linspace(0.4, 2.0, 5)},
    ...     time="t", period="2*pi/w", start={"x": 0.0, "v": 0.0},
    ... )
    >>> motion = pk.flow(driven, t=np.arange(100.0, 300.0, 0.1))
    >>> ax = pk.plot.waterfall(pk.spectrum(motion, "x"), highest=8.0)
    >>> ax.get_ylabel()
    'w'
    """
    ds, name, along = _chosen(dataset, variable)
    dims = [str(dim) for dim in ds[name].dims if dim != along]
    if len(dims) != 1:
        raise ParameterError(
            f"dataset: got {name} over {', '.join(dims) or 'no parameter'}, wants one swept "
            "parameter; select the others with ds.sel(...)"
        )
    if highest is not None:
        held = str(ds["frequency"].attrs.get("units", ""))
        limit = number("highest", highest, "a number > 0", held)
        kept = np.atleast_2d(ds["frequency"].values <= limit).any(axis=0)
        if not kept.any():
            raise bad("highest", highest, "a frequency above the lowest")
        ds = ds.isel({along: np.flatnonzero(kept)})
    if along == "frequency" and log:
        ds = ds.isel(frequency=slice(1, None))  # the mean is no line
    field = ds[[name]]
    if log:  # what is smaller has the darkest color
        field[name] = field[name].clip(min=DEPTH * float(field[name].max()), keep_attrs=True)
    # The words stand over the colors, and one of them at their bar, which leaves these their width.
    words = str(field[name].attrs.get("long_name", name))
    field[name].attrs["long_name"] = words.split(" of ")[0]
    axes = parameter_map(field, name, x=along, y=dims[0], log=log, units=units, ax=ax)
    axes.set_title(words, size="medium")
    return axes


def _chosen(dataset: xr.Dataset, variable: str | None) -> tuple[xr.Dataset, str, str]:
    ds = labels.dataset(dataset, "dataset", ("frequency",), "pk.spectrum")
    offered = [str(name) for name in ds.data_vars if str(name).startswith(KINDS)]
    offered = [name for name in offered if not name.startswith("density_error_")]
    if not offered:
        raise bad("dataset", list(map(str, ds.data_vars)), "amplitudes or densities of pk.spectrum")
    name = offered[0] if variable is None else variable
    if name not in offered:
        raise unknown("variable", name, offered)
    along = next(dim for dim in AXES if dim in ds[name].dims)
    return ds, name, along
