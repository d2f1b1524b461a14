"""The accessor ``ds.phasekit``: from any selection of a map to its system and its pictures.

It holds nothing but the Dataset that it was asked of (xarray keeps accessors), and never fails
when it is made.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import xarray as xr

from phasekit.errors import ParameterError
from phasekit.labelled.described import completeness, described
from phasekit.labelled.pictures import picture
from phasekit.labelled.tables import table_of
from phasekit.labels.arguments import NumberLike, bad, state_arguments
from phasekit.labels.conversion import in_si, in_units
from phasekit.systems.identity import MODEL, model_name
from phasekit.systems.registry import model_named
from phasekit.systems.system import Model

if TYPE_CHECKING:
    import pandas as pd


@xr.register_dataset_accessor("phasekit")  # type: ignore[no-untyped-call]
class PhasekitAccessor:
    """What a map can do beyond plain xarray.

    Examples
    --------
    >>> import phasekit as pk
    >>> ds = pk.sweep(pk.Reduced(0.1, 0.2), lam=[0.1, 0.2, 0.3])
    >>> pk.equilibria(ds.sel(lam=0.2).phasekit.system()).n_equilibria.item()
    4
    """

    def __init__(self, ds: xr.Dataset) -> None:
        self._ds = ds

    def __repr__(self) -> str:
        """Say whose map this is, along what, what it holds and how complete it is."""
        ds = self._ds
        if MODEL not in ds.attrs:
            return f"a Dataset without the attribute {MODEL!r}: not a map that phasekit made"
        return "\n".join([f"map of {ds.attrs[MODEL]}", *described(ds), completeness(ds)])

    def system(self) -> Model:
        """Rebuild the system of this map, or of the selected cells.

        Returns
        -------
        Model
            The model that made the map; with scalars where single cells are selected, and with
            arrays along the axes that are left.

        Raises
        ------
        ParameterError
            If the Dataset is not a map of phasekit, a parameter's coordinate is gone, or the
            selected cell is not valid.

        Examples
        --------
        >>> import phasekit as pk
        >>> ds = pk.sweep(pk.Reduced(0.1, 0.2), lam=[0.1, 0.2, 0.3])
        >>> ds.sel(lam=0.2).phasekit.system()
        Reduced(lam=0.2, psi=0.2, Omega_sq=1.0)
        """
        return model_named("ds", model_name(self._ds)).from_dataset(self._ds)

    def to(self, units: Mapping[str, str] | None = None, **units_by_name: str) -> xr.Dataset:
        """Return this Dataset with some variables and coordinates in other units.

        Parameters
        ----------
        units : mapping of str to str, optional
            Units by the names of variables or coordinates: ``"deg"``, ``"rpm"``, ``"mm"``, ...
        **units_by_name
            The same by keyword.

        Returns
        -------
        xarray.Dataset
            A copy in which their numbers, and their attributes ``units``, are in those units. What
            phasekit makes of it is the same: systems, loads and pictures read the attributes.

        Raises
        ------
        ParameterError
            If a name or a unit is unknown, a unit is one of something else, or a variable has
            no attribute ``units``.

        Examples
        --------
        >>> import phasekit as pk
        >>> disk = pk.GyroRotorDisk(beta=0.7, e=0.05, a=0.024, r=0.2, omega1=10 * pk.rpm)
        >>> folds = pk.critical(disk, "omega1").phasekit.to(critical_fold="rpm", a="mm")
        >>> folds.critical_fold.attrs["units"], folds.a.item()
        ('rpm', 24.0)
        """
        if units is not None and not isinstance(units, Mapping):
            raise bad("units", units, "a mapping of names to units, {'beta': 'deg'}")
        given = dict(units or {})
        for name in units_by_name:
            if name in given:
                raise ParameterError(f"{name}: got it in units and as a keyword, wants it once")
        return in_units(self._ds, {**given, **units_by_name})

    def table(self, units: Mapping[str, str] | None = None, **units_by_name: str) -> pd.DataFrame:
        """Return a table for reading and for spreadsheets: names for codes, units in the head.

        Parameters
        ----------
        units : mapping of str to str, optional
            Units of some columns, as in `to`.
        **units_by_name
            The same by keyword.

        Returns
        -------
        pandas.DataFrame
            A row for each cell of the dims that most variables have; variables with others are
            left out, and rows of what is absent. ``.to_csv(path)`` writes it.

        Raises
        ------
        ParameterError
            As `to`.

        Examples
        --------
        >>> import phasekit as pk
        >>> ds = pk.equilibria(pk.Coefficients(2.0, 1.0, 0.0))
        >>> ds.phasekit.table(phi="deg")[["phi (deg)", "kind"]].round(3)
                      phi (deg)    kind
        equilibrium
        lower_center       60.0  center
        lower_saddle        0.0  saddle
        upper_center      -60.0  center
        upper_saddle      180.0  saddle
        """
        return table_of(self.to(units, **units_by_name))

    @state_arguments
    def rotators(
        self,
        on: str = "equilibria",
        *,
        phi0: NumberLike | None = None,
        dphi0: NumberLike | None = None,
        **parameters: NumberLike,
    ) -> xr.Dataset:
        """Vector rotators on the equilibria, separatrices or orbits of this map of disks.

        Parameters
        ----------
        on : {"equilibria", "separatrix", "orbit"}
            Where: at every equilibrium, over the loops of the separatrices, or over the orbits
            through given states.
        phi0, dphi0 : float, 1-D array_like or xarray.DataArray
            With ``on="orbit"``: states, angles in rad and angular velocities in s^-1.
        **parameters
            Parameters that replace those of the map.

        Returns
        -------
        xarray.Dataset
            At equilibria ``rotator`` and ``rotator_intensity``. Else, for each rotator,
            ``peak_intensity``, ``mean_intensity`` and ``rms_intensity`` over the curve in s^-2, and
            ``intensity_peak_phi``, ``intensity_peak_dphi``, where the peak lies: on (``saddle``,
            ``side``) as `bearing_forces` explains. Lazy where the map is.

        Raises
        ------
        ParameterError
            If the map is not one of disks, or an argument is unusable.

        Examples
        --------
        >>> import phasekit as pk
        >>> disk = pk.GyroRotorDisk(beta=0.3, e=0.1, a=0.05, r=0.1, omega1=10.0)
        >>> ds = pk.sweep(disk, beta=[0.1, 0.2])
        >>> ds.phasekit.rotators(on="equilibria").rotator.dims
        ('beta', 'equilibrium', 'rotator_name', 'carrier_axis')
        """
        return self._on_map("rotators", on, phi0, dphi0, parameters)

    @state_arguments
    def bearing_forces(
        self,
        on: str = "equilibria",
        *,
        phi0: NumberLike | None = None,
        dphi0: NumberLike | None = None,
        **parameters: NumberLike,
    ) -> xr.Dataset:
        """Bearing forces on the equilibria, separatrices or orbits of this map of disks.

        Parameters
        ----------
        on : {"equilibria", "separatrix", "orbit"}
            Where: at every equilibrium, over the loops of the separatrices, or over the orbits
            through given states.
        phi0, dphi0 : float, 1-D array_like or xarray.DataArray
            With ``on="orbit"``: states, angles in rad and angular velocities in s^-1.
        **parameters
            Parameters that replace those of the map, or that it lacks: ``m``, ``half_span``.

        Returns
        -------
        xarray.Dataset
            At equilibria ``force`` and its parts as in `phasekit.bearing_forces`. Else, for each
            ``bearing``, ``peak_force``, ``mean_force`` and ``rms_force`` over the curve in N, and
            ``peak_phi``, ``peak_dphi``, where the peak lies. On separatrices these have the dims
            ``saddle`` and ``side``: the lobe on that side of the saddle, there and back; the
            winding loop that leaves to that side; or the arc to the partner saddle, there and back.
            Means are over the angle there (over time both are the saddle's own value), and over
            time on orbits; all is NaN for an orbit that tends to a saddle. Lazy where the map is.

        Raises
        ------
        ParameterError
            If the map is not one of disks with mass and bearings, or an argument is unusable.

        Examples
        --------
        >>> import phasekit as pk
        >>> disk = pk.GyroRotorDisk(beta=0.7, e=0.05, a=0.024, r=0.2, omega1=31.4)
        >>> ds = pk.sweep(disk, beta=[0.5, 0.7])
        >>> loads = ds.phasekit.bearing_forces(on="separatrix", m=2.0, half_span=0.2)
        >>> loads.peak_force.dims
        ('beta', 'saddle', 'side', 'bearing')
        """
        return self._on_map("forces", on, phi0, dphi0, parameters)

    def _on_map(self, what: str, on: str, phi0: Any, dphi0: Any, parameters: Any) -> xr.Dataset:
        from phasekit.labelled.loads import on_map

        system = self.system().replace(**parameters)
        return on_map(in_si(self._ds), system, what, on, phi0, dphi0)

    @property
    def plot(self) -> MapPlots:
        """Pictures of this map: see `MapPlots`."""
        return MapPlots(self._ds)


class MapPlots:
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

    def __init__(self, ds: xr.Dataset) -> None:
        self._ds = ds

    def phase_portrait(self, **options: Any) -> Any:
        """Draw the phase portrait of the one selected cell; returns the Axes."""
        return picture("phase_portrait")(self._cell(), **options)

    def potential_well(self, **options: Any) -> Any:
        """Draw the potential of the one selected cell over its portrait; returns both Axes."""
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

    def parameter_map(self, variable: str = "topology", **options: Any) -> Any:
        """Draw a variable over two swept parameters; returns the Axes."""
        return picture("parameter_map")(self._ds, variable, **options)

    def hodograph(self, rotator: str = "R022", **options: Any) -> Any:
        """Draw a rotator's hodograph for the one selected cell, or of motions; returns the Axes."""
        return picture("hodograph")(self._cell_or_motion(), rotator, **options)

    def bearing_forces(self, **options: Any) -> Any:
        """Draw bearing forces for the one selected cell, or of one motion; returns the Axes."""
        return picture("bearing_forces")(self._cell_or_motion(), **options)

    def force_polygon(self, phi: float, dphi: float, **options: Any) -> Any:
        """Draw the force polygon of the one selected cell in a state; returns the Axes."""
        return picture("force_polygon")(self._cell(), phi, dphi, **options)

    def hysteresis_loop(self, **options: Any) -> Any:
        """Draw what `quasi_static` followed, with its jumps; returns the Axes."""
        return picture("hysteresis_loop")(self._ds, **options)

    def bearing_load_map(self, variable: str = "peak_force", **options: Any) -> Any:
        """Draw the load on the separatrices over two swept parameters; returns the Axes."""
        return picture("bearing_load_map")(self._ds, variable, **options)

    def _cell_or_motion(self) -> Model | xr.Dataset:
        along = {"motion_phi", "hodograph_u", "force"} & set(self._ds.data_vars)
        return self._ds if along and "time" in self._ds.dims else self._cell()

    def _cell(self) -> Model:
        system = PhasekitAccessor(self._ds).system()
        axes = [name for name, value in system.parameters.items() if not isinstance(value, float)]
        if axes:
            raise ParameterError(
                f"ds: got several cells along {', '.join(axes)}, wants a single one; select it "
                f"first: ds.sel({axes[0]}=..., method='nearest')"
            )
        return system
