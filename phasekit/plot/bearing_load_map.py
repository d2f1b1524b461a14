"""Map of the greatest bearing load over two swept parameters, with the fold curve."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
import xarray as xr
from matplotlib.axes import Axes

from phasekit.errors import ParameterError
from phasekit.inputs import call_checked
from phasekit.labelled.loads import is_disk, on_map
from phasekit.labelled.phase_space import equilibria
from phasekit.labels.arguments import one_of
from phasekit.plot.parameter_map import SELECTION, parameter_map
from phasekit.plot.parts import labels, style

# What each label may be, and what the greater of them is called.
CHOICES = {
    "saddle": ("lower", "upper"),
    "side": ("left", "right"),
    "bearing": ("A2", "B2"),
}
LOADS = ("peak_force", "mean_force", "rms_force")
# From this ratio on, the scale of colors is logarithmic.
DECADES = 30.0


@call_checked
def bearing_load_map(
    dataset: xr.Dataset,
    variable: str = "peak_force",
    *,
    bearing: str = "larger",
    saddle: str = "larger",
    side: str = "larger",
    log: bool | None = None,
    x: str | None = None,
    y: str | None = None,
    angles: style.Angles = "rad",
    units: Mapping[str, str] | None = None,
    legend: bool = True,
    ax: Axes | None = None,
    **sel: Any,
) -> Axes:
    r"""Draw the bearing load on the separatrices over two swept parameters, with the fold curve.

    The separatrices bound the oscillations: the load on the winding one is about the worst that
    a rotor meets before it turns over.

    Parameters
    ----------
    dataset : xarray.Dataset
        A map of disks with ``m`` and ``half_span``; the loads are taken from it, if it holds those
        of the separatrices (``sweep(of="separatrix_forces")``,
        ``ds.phasekit.bearing_forces(on="separatrix")``), and computed otherwise. So is fold_margin.
    variable : {"peak_force", "mean_force", "rms_force"}
        What to draw: the greatest force on the separatrix, or its mean over the angle.
    bearing : {"larger", "A2", "B2"}
        The bearing, or the larger of the two values.
    saddle : {"larger", "lower", "upper"}
        The saddle of the separatrix: ``lower`` is that of a figure-eight.
    side : {"larger", "left", "right"}
        The side of the saddle, of a winding separatrix the direction.
    log : bool, optional
        Whether the scale of colors is logarithmic; left out, where the values differ by more than a
        factor of 30.
    x, y, angles, units, legend, ax
        As in :func:`parameter_map`.
    **sel
        As in :func:`parameter_map`.

    Raises
    ------
    ParameterError
        If an argument is unusable, or the Dataset is no map of disks.

    Notes
    -----
    The forces are those of [HedrihVeljovic2013] (22) to (28), corrected, on the rotor; that of A2
    has the axial force in it. The fold curve is the zero contour of fold_margin.

    Examples
    --------
    >>> import numpy as np
    >>> import phasekit as pk
    >>> disk = pk.GyroRotorDisk(
    ...     beta=1.0, e=0.05, a=0.02, r=0.2, omega1=30.0, m=2.0, half_span=0.1
    ... )
    >>> ds = pk.sweep(disk, beta=np.linspace(0.2, 1.5, 8), a=np.linspace(0.0, 0.05, 6))
    >>> ax = pk.plot.bearing_load_map(ds, saddle="upper")
    >>> [text.get_text() for text in ax.get_legend().get_texts()]
    ['fold', '$A = 0$']
    """
    ds = labels.dataset(dataset, "dataset", (), "pk.sweep")
    one_of("variable", variable, LOADS)
    chosen = {"saddle": saddle, "side": side, "bearing": bearing}
    for name, value in chosen.items():
        one_of(name, value, ("larger", *CHOICES[name]))
    ds = _with_loads(ds, variable)
    load, words = ds[variable], []
    for name, value in chosen.items():
        if name not in load.dims:
            continue  # selected already
        load = load.max(name, keep_attrs=True) if value == "larger" else load.sel({name: value})
        words.append(_words(name, value))
    ds = ds.assign({variable: load.assign_attrs({SELECTION: ", ".join(filter(None, words))})})
    if log is None:
        log = _spans_decades(load)
    return parameter_map(
        ds,
        variable,
        x=x,
        y=y,
        angles=angles,
        units=units,
        log=log,
        legend=legend,
        ax=ax,
        **sel,
    )


def _words(name: str, value: str) -> str:
    """Return what is chosen, for the color bar."""
    if value == "larger":
        return "larger of A$_2$ and B$_2$" if name == "bearing" else ""
    return f"{value[0]}$_2$" if name == "bearing" else f"{value} {name}"


def _with_loads(ds: xr.Dataset, variable: str) -> xr.Dataset:
    """Return the map with loads on separatrices and fold margins, computed if they are missing."""
    if variable in ds and "fold_margin" in ds:
        return ds
    system = labels.system_of(ds, "dataset", "pk.sweep")
    if not is_disk(system):
        raise ParameterError(
            f"dataset: got a map of {type(system).__name__}, wants one of GyroRotorDisk"
        )
    found = {}
    if variable not in ds:
        found[variable] = on_map(ds, system, "forces", "separatrix", None, None)[variable]
    if "fold_margin" not in ds:
        found["fold_margin"] = equilibria(system).fold_margin
    # Axes of the map stay as they are: they may be in other units.
    own = {
        name: load.drop_vars(load.coords.keys() & ds.coords.keys()) for name, load in found.items()
    }
    return ds.assign(own)


def _spans_decades(load: xr.DataArray) -> bool:
    finite = load.values[np.isfinite(load.values) & (load.values > 0.0)]
    return bool(finite.size) and bool(finite.max() > DECADES * finite.min())
