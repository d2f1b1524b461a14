"""Phase responses of periodic orbits, over the phase."""

from __future__ import annotations

from collections.abc import Mapping

import xarray as xr
from matplotlib.artist import Artist
from matplotlib.axes import Axes

from phasekit.inputs import call_checked
from phasekit.labels.arguments import bad, flag, unknown
from phasekit.plot.parts import labels, strokes, style
from phasekit.plot.parts.units import Units


@call_checked
def phase_response(
    dataset: xr.Dataset,
    states: str | list[str] | None = None,
    *,
    units: Mapping[str, str] | None = None,
    legend: bool = True,
    ax: Axes | None = None,
) -> Axes:
    """Draw phase responses over the phase of the kick, one line for each state.

    Parameters
    ----------
    dataset : xarray.Dataset
        What `phasekit.phase_response` returns.
    states : str or list of str, optional
        Which states are kicked; by default all.
    units : mapping of str to str, optional
        Units in which times and parameters are shown, by name: ``{"time": "ms"}``.
    legend : bool
        Whether to name the states under the axes, if there are several.

    Notes
    -----
    Above zero a kick in the direction of the state brings the next turn forward, below zero it
    delays it ([ErmentroutTerman2010] chapter 8).

    Examples
    --------
    >>> import phasekit as pk
    >>> oscillator = pk.Problem(["y", "(1 - x**2)*y - mu*x"], ("x", "y"), {"mu": 1.0})
    >>> oscillator = oscillator.described({"time": {"units": "ms"}})
    >>> response = pk.phase_response(pk.periodic_orbit(oscillator, [2.0, 0.0]))
    >>> ax = pk.plot.phase_response(response, "x")
    >>> ax.get_ylabel()
    'phase response to x (ms)'
    """
    if not isinstance(dataset, xr.Dataset) or "phase_response" not in dataset:
        raise bad("dataset", dataset, "what pk.phase_response returns")
    flag("legend", legend)
    known = [str(name) for name in dataset["state"].values]
    if states is None:
        chosen = known
    elif isinstance(states, str):
        chosen = [states]
    elif isinstance(states, (list, tuple)) and states:
        chosen = list(states)
    else:
        raise bad("states", states, "a state, a list of states, or None")
    for name in chosen:
        if name not in known:
            raise unknown("states: state", name, known)
    ds, shown = Units.of_dataset(dataset, "rad", units)
    (time, _), (responses, _) = shown.shown(ds["time"]), shown.shown(ds["phase_response"])
    axes = style.axes_for(ax, legend=legend and len(chosen) > 1)
    handles: list[Artist] = []
    for count, name in enumerate(chosen):
        look = strokes.orbit_look(count) if len(chosen) > 1 else style.MOTION
        values = responses[:, known.index(name)]
        handles += axes.plot(time, values, label=name, **look)
    axes.plot(time[[0, -1]], [0.0, 0.0], color=style.GRAY, linewidth=0.8, zorder=1.0)
    axes.set_xlim(time[0], time[-1])
    axes.set_xlabel(labels.label(ds["time"], shown, style.letters(axes, "x")))
    whole = labels.label(ds["phase_response"], shown, style.letters(axes, "y"))
    text, bracket, unit = whole.partition(" (")
    to = f" to {chosen[0]}" if len(chosen) == 1 else ""
    axes.set_ylabel(f"{text}{to}{bracket}{unit}")
    if legend and len(chosen) > 1:
        style.legend_below(axes, handles)
    return axes
