"""Pictures of a map, or of one of its cells, from the map itself: ``ds.phasekit.plot``."""

from __future__ import annotations

from typing import Any

import xarray as xr

from phasekit.docstrings import explained
from phasekit.errors import ParameterError
from phasekit.labelled.pictures import picture
from phasekit.spellings import Guided
from phasekit.systems.identity import model_name
from phasekit.systems.registry import model_named
from phasekit.systems.system import System


@explained(
    {"options": "**options\n    Keywords of `phasekit.plot.{name}`."}, result="matplotlib.axes.Axes"
)
class MapPlots(Guided):
    """Pictures of a map; each takes the keywords of its namesake in ``phasekit.plot``.

    Examples
    --------
    Pictures of a map over one or two parameters:

    >>> import matplotlib.pyplot as plt
    >>> import phasekit as pk
    >>> disk = pk.GyroRotorDisk(beta=0.7, e=0.05, a=0.024, r=0.2, omega1=31.4, m=2, half_span=0.2)
    >>> ds = pk.sweep(disk, beta=[0.5, 0.7], a=[0.01, 0.024])
    >>> figure, axes = plt.subplots(1, 3)
    >>> ax = ds.phasekit.plot.parameter_map("topology", ax=axes[0])
    >>> ax = ds.phasekit.plot.bearing_load_map(ax=axes[1])
    >>> ax = ds.isel(a=1).phasekit.plot.bifurcation_diagram(ax=axes[2])
    >>> plt.close(figure)

    Of what follows slow parameters:

    >>> loop = pk.quasi_static(disk, omega1=[10.0, 20.0, 31.4])
    >>> ax = loop.phasekit.plot.hysteresis_loop(units={"omega1": "rpm"})
    >>> plt.close(ax.figure)

    Pictures of one of its cells:

    >>> cell = ds.isel(beta=1, a=1).phasekit.plot
    >>> figure, axes = plt.subplots(2, 3)
    >>> ax = cell.phase_portrait(ax=axes[0, 0])
    >>> ax = cell.period_energy(ax=axes[0, 1])
    >>> ax = cell.frequency_action(ax=axes[0, 2])
    >>> ax = cell.hodograph(orbits=(1.0, 0.2), ax=axes[1, 0])
    >>> ax = cell.bearing_forces(orbit=(1.0, 0.2), ax=axes[1, 1])
    >>> ax = cell.force_polygon(1.0, 0.2, ax=axes[1, 2])
    >>> plt.close(figure)
    >>> well, portrait = cell.potential_well()
    >>> plt.close(well.figure)
    """

    _guides = ("pictures",)

    def __init__(self, ds: xr.Dataset) -> None:
        self._ds = ds

    def __call__(self, *given: Any, **options: Any) -> Any:
        """Refuse to guess which picture is meant."""
        got = ", ".join([*(repr(one)[:40] for one in given), *options]) or "nothing"
        raise TypeError(
            f"ds.phasekit.plot: got {got}, wants the name of a picture; {self._listed()}"
        )

    def phase_portrait(self, **options: Any) -> Any:
        """Draw the phase portrait of the one selected cell; returns the Axes."""
        return picture("phase_portrait")(self._cell(), **options)

    def potential_well(self, **options: Any) -> Any:
        """Draw the potential of the one selected cell over its portrait; returns both Axes.

        Returns
        -------
        tuple of two matplotlib.axes.Axes
            Of the potential and of the portrait.
        """
        return picture("potential_well")(self._cell(), **options)

    def period_energy(self, **options: Any) -> Any:
        """Draw period against energy for the one selected cell; returns the Axes."""
        return picture("period_energy")(self._cell(), **options)

    def frequency_action(self, **options: Any) -> Any:
        """Draw frequency against action for the one selected cell; returns the Axes."""
        return picture("frequency_action")(self._cell(), **options)

    def bifurcation_diagram(self, **options: Any) -> Any:
        """Draw the equilibria against a swept parameter; returns the Axes."""
        return picture("bifurcation_diagram")(self._ds, **options)

    def parameter_map(self, variable: str | None = None, **options: Any) -> Any:
        """Draw a variable over two swept parameters; returns the Axes.

        Parameters
        ----------
        variable : str, optional
            A variable of the map; left out, that which tells most of a cell.
        """
        return picture("parameter_map")(self._ds, variable, **options)

    def hodograph(self, rotator: str = "R022", **options: Any) -> Any:
        """Draw a rotator's hodograph for the one selected cell, or of motions; returns the Axes.

        Parameters
        ----------
        rotator : str
            Name of the rotator: ``"R01"``, ``"R011"``, ``"R022"``, ...
        """
        return picture("hodograph")(self._cell_or_motion(), rotator, **options)

    def bearing_forces(self, **options: Any) -> Any:
        """Draw bearing forces for the one selected cell, or of one motion; returns the Axes."""
        return picture("bearing_forces")(self._cell_or_motion(), **options)

    def force_polygon(self, phi: float, dphi: float, **options: Any) -> Any:
        """Draw the force polygon of the one selected cell in a state; returns the Axes.

        Parameters
        ----------
        phi, dphi : float
            The state: angle in rad and angular velocity in s^-1.
        """
        return picture("force_polygon")(self._cell(), phi, dphi, **options)

    def hysteresis_loop(self, **options: Any) -> Any:
        """Draw what `quasi_static` followed, with its jumps; returns the Axes."""
        return picture("hysteresis_loop")(self._ds, **options)

    def bearing_load_map(self, variable: str = "peak_force", **options: Any) -> Any:
        """Draw the load on the separatrices over two swept parameters; returns the Axes.

        Parameters
        ----------
        variable : str
            A load of ``ds.phasekit.bearing_forces(on="separatrix")``.
        """
        return picture("bearing_load_map")(self._ds, variable, **options)

    def _cell_or_motion(self) -> System | xr.Dataset:
        along = {"motion_phi", "hodograph_u", "force"} & set(self._ds.data_vars)
        return self._ds if along and "time" in self._ds.dims else self._cell()

    def _cell(self) -> System:
        system = model_named("ds", model_name(self._ds)).from_dataset(self._ds)
        axes = [name for name, value in system.parameters.items() if not isinstance(value, float)]
        if axes:
            raise ParameterError(
                f"ds: got several cells along {', '.join(axes)}, wants a single one; select it "
                f"first: ds.sel({axes[0]}=..., method='nearest')"
            )
        return system
